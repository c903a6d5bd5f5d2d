"""The near ends of edges between the parts of a run: links, with their ledgers, leases and counts.

When the other end has died and is restarted, the older of the two incarnations tells the younger where to resume
(`Joins`). Depends on `hfg.links`, `part` and `messages`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from hfg.base.token import Token
from hfg.encoding import TokenCodec
from hfg.engine.runtime.borders import Hearing
from hfg.errors import EncodingError, RunError, TransportError
from hfg.graph.flat import CutEdge
from hfg.links import Outbox
from hfg.links.consumer import ExactConsumer
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.parts.model.components import is_synchronous
from hfg.parts.model.failing import codec_of
from hfg.parts.model.inheriting import UNKNOWN, Arrived, Where
from hfg.parts.model.messages import GoesOn, Hears, Joins, Message, Sees, Shares, Speaks, Untrue
from hfg.parts.running.channels import called, name_of
from hfg.parts.running.part import Part
from hfg.parts.running.rings import Borrowing, Lending, segment_of
from hfg.ports.outputs import OutputPort
from hfg.transport import Delivery, EncodedToken, Position, Session

_UNBOUNDED: Final = 2**31


def _most_under_way(edge: CutEdge) -> int:
    """Return how many tokens a link may hold.

    For signals the edge itself determines this, and may grow (F8): a link with a bound of its own would not send what
    the larger queue has accepted.
    """
    return _UNBOUNDED if edge.edge.is_event_edge else edge.window


def _codec_of(edge: CutEdge) -> TokenCodec[Any]:
    port = edge.edge.source.port
    return codec_of(port, edge.hint, f'the value of "{port.path}"')


class World(NamedTuple):
    """Shared state of all near ends of a part; see `PartLinks`."""

    part: Part
    session: Session
    near: Session
    run: str
    incarnations: dict[str, int]
    say: Callable[[str, Message], None]

    def way_of(self, edge: CutEdge) -> Session:
        """Return the session that carries an edge."""
        return self.near if edge.within_host else self.session


class _NearEnd:
    """Common part of both ends of an edge between parts.

    Attributes:
      other: the part at its far end.
    """

    def __init__(self, world: World, edge: CutEdge, other: str) -> None:
        self.other = other
        self._part = world.part
        self._incarnation = world.incarnations[world.part.name]
        self._waits_to_join = self._incarnation > world.incarnations[other]
        self._edge = edge
        self._key = f"{world.run}/edge/{edge.number}"
        self._codec = _codec_of(edge)
        self._tell = partial(world.say, other)

    def _fail(self, why: str, error: Exception) -> None:
        """The edge has failed; the run ends with this error."""
        problem = RunError(f'edge "{self._edge.label}" {why}: {error}')
        problem.__cause__ = error
        self._part.finish("failed", problem)

    def _cannot_carry(self, error: Exception) -> None:
        self._fail(f"cannot carry a value to {called(self.other)}", error)

    def _need_to_join(self) -> None:
        if not self._waits_to_join:
            raise Untrue(
                f'of edge "{self._edge.label}", which this incarnation of {name_of(self._part.name)} already knows'
            )


class OutgoingEnd(_NearEnd):
    """The near end of a leaving edge's link."""

    def __init__(self, world: World, edge: CutEdge) -> None:
        super().__init__(world, edge, edge.target)
        part, incarnations = world.part, world.incarnations
        self._loop = asyncio.get_running_loop()
        self._most = _most_under_way(edge)
        self._known = 0  # the number of the last that had come from previous incarnations
        self._aligns = is_synchronous(edge) and part.keeper is None
        self._lending: Lending | None = None
        self._held: deque[EncodedToken] = deque()  # what is not kept yet, and may not leave before it is
        self._sender: LinkSender | BoundedSender
        outbox = None if part.keeper is None else part.keeper.outbox(edge.label)
        way = world.way_of(edge)
        self._kept_from = 1 if outbox is None else outbox.first
        if edge.guarantee == "exact":
            self._sender = sender = LinkSender(
                way,
                self._key,
                epoch=incarnations[part.name],
                window=self._most,
                released=self._released,
                inherits=part.positions(edge.label) is not None,
                outbox=outbox,
            )
            after = None if outbox is None else outbox.first - 1
            sender.admit(name_of(edge.target), incarnations[edge.target], after=after)
            part.outlets[edge.label].owe(sender.machine.unfinished)
        else:
            self._sender = BoundedSender(way, self._key, epoch=incarnations[part.name])

    def room(self) -> int:
        """See `Outgoing`."""
        sender = self._sender
        if self._waits_to_join or not self._part.is_aligned(self._edge.label):
            return 0
        if isinstance(sender, BoundedSender):
            return self._edge.window * 4
        room = self._most - self._unfinished
        if self._lending is not None:
            if not self._lending.is_answered:
                return 0
            if not self._edge.edge.is_event_edge:  # whose links have no bound
                room = min(room, self._lending.room)
        positions = self._part.positions(self._edge.label)
        return room if positions is None or room <= 0 else self._in_a_row(sender, positions, room)

    def _in_a_row(self, sender: LinkSender, positions: deque[Where], most: int) -> int:
        """Return how many can be sent before numbers jump: that they do when all before is done."""
        if not positions or not sender.machine.takes(Position(*positions[0])):
            return 0
        count = 1
        while count < min(most, len(positions)):
            stream, number = positions[count - 1]
            if positions[count] != (stream, number + 1):
                break
            count += 1
        return count

    def send(self, tokens: list[Token[Any]]) -> None:
        """See `Outgoing`."""
        sender, part, label, lending = self._sender, self._part, self._edge.label, self._lending
        positions = part.positions(label)
        repeated = 0
        try:
            for token in tokens:
                encoded = self._codec.encode(token) if lending is None else lending.encode(self._codec, token)
                if part.keeper is not None:
                    self._held.append(encoded)
                elif positions is not None and isinstance(sender, LinkSender):
                    where = positions.popleft()
                    repeated += where[1] <= self._known
                    sender.send_nowait(encoded, Position(*where))
                else:
                    sender.send_nowait(encoded)
                if lending is not None:
                    lending.sent()
        except (EncodingError, TransportError) as error:
            self._cannot_carry(error)
            return
        outlet = part.outlets[label]
        if repeated:
            outlet.repeat(repeated)
        if positions is not None and outlet.sent - self._unfinished > outlet.taken:
            self._loop.call_soon(self._released)  # already processed: there will be no other notification

    @property
    def _unfinished(self) -> int:
        return len(self._held) + (self._sender.machine.unfinished if isinstance(self._sender, LinkSender) else 0)

    # --- of a part with a ledger (see `Leaving`)

    def outbox(self) -> Outbox | None:
        """See `Leaving`."""
        if not isinstance(self._sender, LinkSender):
            return None
        stream, first, tokens = self._sender.machine.outbox
        return Outbox(stream, first, (*tokens, *self._held))

    @property
    def held(self) -> int:
        """See `Leaving`."""
        return len(self._held)

    def let_go(self, count: int) -> None:
        """See `Leaving`."""
        try:
            for _ in range(count):
                self._sender.send_nowait(self._held.popleft())
        except TransportError as error:
            self._cannot_carry(error)

    def speaks(self, speaking: bool, total: int) -> None:
        """See `Outgoing`."""
        self._tell(Speaks(self._edge.label, speaking, total))

    def begin_at(self, number: int) -> None:
        """See `Outgoing`."""
        if isinstance(self._sender, LinkSender):
            self._sender.begin_at(number)

    def goes_on(self, number: int) -> None:
        """See `Outgoing`."""
        self._tell(GoesOn(self._edge.label, self._incarnation, number))

    def _released(self) -> None:
        if self._lending is not None:
            self._lending.settle()
        label = self._edge.label
        self._part.be_taken(label, self._part.outlets[label].sent - self._unfinished)

    def admit(self, incarnation: int) -> None:
        """The consumer is restarted: resend unprocessed tokens, and tell it from where."""
        label, sender = self._edge.label, self._sender
        if isinstance(sender, LinkSender):
            sender.admit(name_of(self._edge.target), incarnation)
        self._known = 0  # it has nothing
        if self._lending is not None:
            self._lending.admit()
        outlet = self._part.outlets[label]
        stream, number = sender.machine.position
        ended = False
        if not self._aligns:
            done = max(outlet.sent - self._unfinished, 0)
            number -= self._unfinished - len(self._held)
        elif not self._part.is_aligned(label):
            (stream, number), done = UNKNOWN, 0
        else:
            stream, number = self._incarnation, number if stream and number else self._part.begun_at(label) - 1
            outlet.stand_at(number)
            ended = outlet.end_has_left and number > 0 and not self._unfinished
            done = number = number - self._unfinished - ended
        self._tell(Joins(label, done, stream, number, ended=ended))
        self._waits_to_join = False
        self._part.consumer_returns(label)

    def join(self, message: Joins) -> None:
        """The consumer reports the tokens from previous incarnations; it may wait to be told where this one resumes.

        Raises:
          Untrue: nothing waits for this report.
        """
        self._need_to_join()
        self._waits_to_join = False
        label, part = self._edge.label, self._part
        if self._aligns:
            total = None if message.stream == UNKNOWN[0] else message.total
            self._known = total or 0
            part.precede(label, total, message.hearing)
            return
        if isinstance(self._sender, LinkSender):
            self.goes_on(self._sender.machine.position.sequence)
        total = message.total
        if part.keeper is not None:
            total += self._ahead_of(message) - part.outlets[label].sent
        part.precede(label, total, message.hearing)
        if part.keeper is not None:
            self._released()

    def _ahead_of(self, message: Joins) -> int:
        """Return how many tokens previous incarnations have kept, and this one sent, that the consumer has not got."""
        if not isinstance(self._sender, LinkSender):
            return 0
        stream, number = self._sender.machine.position
        known = message.number if stream == message.stream else self._kept_from - 1  # it had nothing: all that was kept
        return len(self._held) + number - known

    def share(self, world: World) -> None:
        """Put large arrays into shared memory from now on, if there are any and the consumer can open it."""
        edge, sender = self._edge, self._sender
        if not self._codec.holds_arrays:
            return
        assert isinstance(sender, LinkSender)
        machine = sender.machine
        self._lending = Lending(
            world.run,
            world.incarnations[edge.source],
            edge.number,
            edge.label,
            edge.window,
            lambda: machine.unfinished,
            self._tell,
        )
        port = edge.edge.source.port
        if isinstance(port, OutputPort):
            port._loan_from(self._lending.loan)

    def seen(self, message: Sees) -> None:
        """The consumer has opened it, or cannot."""
        if self._lending is not None:
            self._lending.seen(message)
            self._part.room(self._edge.label)

    async def close(self) -> None:
        """End it."""
        await self._sender.close()
        if self._lending is not None:
            self._lending.close()


class IncomingEnd(_NearEnd):
    """The near end of the link of an edge that comes in."""

    def __init__(self, world: World, edge: CutEdge, remembers: bool) -> None:
        super().__init__(world, edge, edge.source)
        part, incarnations = world.part, world.incarnations
        self._by_number = part.is_by_number(edge.label)
        self._done = 0  # of a part with a ledger: how many it has done, through all incarnations
        self._count = 0  # of signals: how many have come, through all incarnations
        self._laid: deque[int] = deque()  # the numbers of those that have come and are not done
        self._remembers = remembers
        self._awaits_number = False  # a new incarnation of the producer has not yet reported where it resumes
        self._borrowing: Borrowing | None = None
        self._undecoded: deque[Delivery] = deque()
        self._segment = partial(segment_of, world.run, edge=edge.number)
        self._lent_by = incarnations[edge.source]
        self._before = 0  # tokens of previous incarnations of the producer; for a lossy edge, whose numbers show losses
        self._receiver: LinkReceiver | BoundedReceiver
        way = world.way_of(edge)
        if edge.guarantee == "exact":
            self._receiver = LinkReceiver(
                way,
                self._key,
                consumer=name_of(part.name),
                incarnation=incarnations[part.name],
                arrived=self._arrived,
                capacity=_most_under_way(edge),
                producer=incarnations[edge.source],
                ledger=None if part.keeper is None else part.keeper.position(edge.label),
            )
        else:
            # Tokens are put on the edge at once, which drops by its own policy.
            self._receiver = BoundedReceiver(
                way, self._key, arrived=self._arrived, capacity=_UNBOUNDED, producer=incarnations[edge.source]
            )

    def _arrived(self) -> None:
        self._undecoded.extend(self._receiver.machine.take_all())
        self._decode()

    def _decode(self) -> None:
        is_lossy = isinstance(self._receiver, BoundedReceiver)
        if self._waits_to_join and not self._by_number and (is_lossy or self._part.keeper is None):
            return  # what their numbers mean is not known yet
        tokens: list[Arrived] = []
        decode = self._codec.decode
        borrowing = self._borrowing
        view = None if borrowing is None else borrowing.view
        while self._undecoded:
            delivery = self._undecoded[0]
            if is_lossy and not self._is_new(delivery.sequence, len(tokens)):
                self._undecoded.popleft()  # it is late, and was counted as lost
                continue
            try:
                token = decode(delivery.metadata, delivery.value, view=view)
            except EncodingError as error:
                if borrowing is not None and borrowing.is_awaited:
                    break  # sent to a previous incarnation, and this one has not heard of the memory yet
                self._fail("brought what it cannot", error)
                return
            self._undecoded.popleft()
            self._count += 1
            keeps = self._part.keeper is not None
            number = delivery.sequence if self._by_number or keeps else self._count
            if not is_lossy and not keeps:
                self._laid.append(number)
            tokens.append(((token.value, token.activity, token.stamp), (delivery.stream, number)))
        if tokens:
            self._part.receive(self._edge.label, tokens)

    def _is_new(self, number: int, held: int) -> bool:
        """Return whether it comes after all tokens so far; the skipped ones are lost."""
        missing = self._before + number - 1 - self._part.inlets[self._edge.label].received - held
        if missing > 0:
            self._part.lose(self._edge.label, self._before + number - 1 - held)
        return missing >= 0

    def taken(self, total: int) -> None:
        """See `Incoming`."""
        if self._part.keeper is not None:  # it puts each token on the edge, and does nothing else
            if isinstance(self._receiver, LinkReceiver):
                self._receiver.done(total - self._done)
            self._done = total
            return
        laid, count = self._laid, 0
        while laid and laid[0] <= total:
            laid.popleft()
            count += 1
        if count and isinstance(self._receiver, LinkReceiver):
            self._receiver.done(count)

    def hears(self, hearing: Hearing, total: int) -> None:
        """See `Incoming`."""
        self._tell(Hears(self._edge.label, hearing, total))

    def admit(self, incarnation: int) -> None:
        """The producer is restarted: tell it how much has arrived so far."""
        label, machine = self._edge.label, self._receiver.machine
        machine.believe(incarnation)
        self._lent_by = incarnation
        # the part that would have reported it is gone: count from what has arrived
        if self._waits_to_join and self._undecoded:
            self._before = 1 - self._undecoded[0].position.sequence
        self._waits_to_join = False
        if self._undecoded:  # they are in the memory of an incarnation that died before it could report to this one
            self._borrowing = None
            self._decode()
        stream = number = 0
        if isinstance(machine, ExactConsumer):
            stream, number = machine.accepted
        came = self._part.came(label)
        if came is None:
            stream, number, came = *UNKNOWN, 0
        else:
            self._before = self._count = came
        self._awaits_number = True
        self._part.producer_returns(label, remembers=self._remembers)
        inlet = self._part.inlets[label]
        self._tell(Joins(label, came, stream, number, inlet.hearing, ended=self._part.is_over(label)))

    def join(self, message: Joins) -> None:
        """The producer reports the progress of previous incarnations.

        Raises:
          Untrue: nothing waits for this report.
        """
        self._need_to_join()
        total, keeper = message.total, self._part.keeper
        ledger = None if keeper is None else keeper.position(self._edge.label)
        if self._by_number:
            total = message.number
        elif ledger is not None and ledger.stream == message.stream:
            total += max(ledger.sequence - message.number, 0)  # processed, but unknown to the producer
        self._count = total
        self._done += total
        self._before = message.total - message.number
        self._waits_to_join = False
        is_known = message.stream != UNKNOWN[0]
        self._awaits_number = not is_known
        self._part.follow(self._edge.label, total, is_known=is_known, ended=message.ended and keeper is None)
        self._decode()

    def goes_on(self, number: int) -> None:
        """The producer reports after which number it resumes; ignored unless it is awaited."""
        if self._awaits_number:
            self._awaits_number = False
            self._part.goes_on(self._edge.label, number)

    def share(self, world: World) -> None:
        """Look at large arrays in shared memory, when the producer offers it."""
        if self._codec.holds_arrays:
            self._borrowing = Borrowing(world.run, self._tell)

    def borrow(self, message: Shares) -> None:
        """The producer offers it.

        Raises:
          Untrue: it is not of this incarnation and edge.
        """
        if message.segment.rpartition("_")[0] != self._segment(incarnation=self._lent_by):
            raise Untrue(f'of shared memory "{message.segment:.200}", which is not that of edge "{self._edge.label}"')
        if self._borrowing is not None:
            self._borrowing.open(message)
            self._decode()

    async def close(self) -> None:
        """End it."""
        await self._receiver.close()
