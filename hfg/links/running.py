"""The ends of links in operation: over a session of a transport, on the running event loop.

Tokens sent in one iteration of the loop leave in one datagram at its end, and so do acknowledgements. If nothing is in
transit, or a quarter of a window is waiting, tokens leave at once because the other end has work to do. No decisions
are made here: that is up to the state machines in this package. They are asked after each burst, at the end of each
iteration in which tokens were sent or processed, and when their own timers are due.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec

from hfg.base.logs import Log
from hfg.errors import TransportError
from hfg.links.bounded import BoundedConsumer, BoundedProducer
from hfg.links.consumer import ExactConsumer
from hfg.links.frames import Outgoing
from hfg.links.producer import ExactProducer
from hfg.transport import Buffer, Closing, Datagrams, Delivery, EncodedToken, Message, Position, Publisher, Traffic

_LOGGER = Log("hfg.links")
_HEADROOM = 8192  # bytes of a datagram that are kept for the header
_TIMER_SLACK_S = 0.01
_FEWEST = 4  # tokens, or acknowledgements, for which a datagram is worth while although more could join it


def _portion(window: int) -> int:
    """Return how many tokens leave before the iteration ends, so that both ends work concurrently, not in turn."""
    return max(window // 4, min(window, _FEWEST))


def _to_all(name: str) -> str:
    return f"{name}/tokens"


def _to_one(name: str, consumer: str) -> str:
    return f"{name}/to/{consumer}"


def _back(name: str) -> str:
    return f"{name}/back"


def _put(publisher: Publisher, header: bytes, payload: Buffer) -> bool:
    """Put it; False if the session has been closed before its links, or under them."""
    try:
        publisher.put(header, payload)
    except TransportError:
        return False
    return True


class _Batch:
    """Does something once at the end of the turn of the loop in which it was asked for."""

    def __init__(self, loop: asyncio.AbstractEventLoop, function: Callable[[], None]) -> None:
        self.loop = loop
        self._function = function
        self.asked = False

    def ask(self) -> None:
        if not self.asked:
            self.asked = True
            self.loop.call_soon(self._run)

    def _run(self) -> None:
        self.asked = False
        self._function()


class _Turns:
    """Coroutines that wait at an end of a link, in the order of arrival; each wakes the next."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.waiting: deque[asyncio.Future[None]] = deque()
        self._loop = loop

    async def wait(self, *, again: bool = False) -> None:
        """Wait for one's turn; who had it and could not use it is the first in line again."""
        turn: asyncio.Future[None] = self._loop.create_future()
        if again:
            self.waiting.appendleft(turn)
        else:
            self.waiting.append(turn)
        try:
            await turn
        except BaseException:
            if turn in self.waiting:
                self.waiting.remove(turn)
            else:
                self.wake()  # it had its turn; now the next one has it
            raise

    def wake(self) -> None:
        """Wake the next waiting coroutine."""
        while self.waiting:
            turn = self.waiting.popleft()
            if not turn.done():
                turn.set_result(None)
                return

    def wake_all(self) -> None:
        """There will be no more turns."""
        while self.waiting:
            self.wake()


class LinkSender:
    """The sending end of an exact link in operation.

    Args:
      session: session of a transport, or another carrier of datagrams, on the running loop.
      name: name of the link, as a key; the same at both ends.
      epoch: number of this incarnation of the producer.
      released: called when more tokens are released than before.
      **options: options of `ExactProducer`.

    Attributes:
      machine: the state machine; only for reading.
    """

    def __init__(
        self, session: Datagrams, name: str, *, epoch: int, released: Callable[[], None] | None = None, **options: Any
    ) -> None:
        room = session.largest_message - _HEADROOM
        options = {"largest_token": room, "largest_batch": min(60_000, room)} | options
        self.machine = ExactProducer(epoch, **options)
        self._portion = _portion(self.machine.window)
        self.name = name
        self._loop = asyncio.get_running_loop()
        self._session = session
        self._batch = _Batch(self._loop, self._flush)
        self._told = self.machine.released
        self._on_released = released
        self._all = session.publisher(_to_all(name), Traffic.TOKENS)
        self._one: dict[str, Publisher] = {}
        self._subscription: Closing = session.subscribe(_back(name), self._receive)
        self._timer: asyncio.TimerHandle | None = None
        self._turns = _Turns(self._loop)
        self._away: dict[str, float] = {}  # consumers that do not answer, and since when that is known
        self._closed = False

    @property
    def free(self) -> bool:
        """Whether `send_nowait` would take a token."""
        return self.machine.free and not self._turns.waiting

    @property
    def released(self) -> int:
        """The last number of the stream for which the producer's output counts as free again."""
        return self.machine.released

    def send_nowait(self, token: EncodedToken, position: Position | None = None) -> int:
        """Take the next token; see `OutgoingLink`."""
        if self._closed:
            raise TransportError(f'link "{self.name}" is closed')
        machine = self.machine
        number = machine.send(token, position)
        if machine.is_pressing(self._portion):
            self._flush()
        elif not self._batch.asked:
            self._batch.ask()
        return number

    def begin_at(self, number: int) -> None:
        """Nothing was sent in this life: the first token has that number."""
        self.machine.begin_at(number)
        self._batch.ask()

    async def send(self, token: EncodedToken, position: Position | None = None) -> int:
        """Do the same, but wait while the window is full."""
        if self._turns.waiting or not (self.machine.free if position is None else self.machine.takes(position)):
            await self._wait(position)
        number = self.send_nowait(token, position)
        self._turns.wake()
        return number

    async def wait_free(self) -> None:
        """Wait until there is room for a token; who sends it without a pause between has it."""
        if not self.free:
            await self._wait(None)
            self._turns.wake()

    async def wait_finished(self) -> None:
        """Wait until all that was sent is done."""
        while self.machine.unfinished:
            await self._wait(None, until_finished=True)
        self._turns.wake()

    async def _wait(self, position: Position | None, *, until_finished: bool = False) -> None:
        """In the order of the calls."""
        self._check_open()
        await self._turns.wait()
        self._check_open()
        while self.machine.unfinished if until_finished else not self.machine.takes(position):
            await self._turns.wait(again=True)
            self._check_open()

    def _check_open(self) -> None:
        if self._closed:
            raise TransportError(f'link "{self.name}" is closed')

    def admit(self, consumer: str, incarnation: int | None = None, *, after: int | None = None) -> None:
        """Let a consumer take part; see `ExactProducer.admit`."""
        self.machine.admit(consumer, incarnation, after=after)
        if consumer not in self._one:
            self._one[consumer] = self._session.publisher(_to_one(self.name, consumer), Traffic.TOKENS)
        self._batch.ask()

    def dismiss(self, consumer: str) -> None:
        """Wait for a consumer no longer."""
        self.machine.dismiss(consumer)
        publisher = self._one.pop(consumer, None)
        if publisher is not None:
            publisher.close()
        self._after()

    def statistics(self) -> dict[str, int]:
        """Return the numbers of tokens sent, resent, acknowledged, refused and lost."""
        counts: dict[str, int] = msgspec.structs.asdict(self.machine.counts)
        return counts | {"unfinished": self.machine.unfinished, "released": self.machine.released}

    async def close(self, *, over: bool = False) -> None:
        """End this incarnation of the link. Unacknowledged tokens are dropped and counted.

        Args:
          over: this is the last incarnation, so consumers are told to stop waiting.
        """
        if self._closed:
            return
        self._flush()
        self._put(self.machine.close(over=over))
        self._stop()

    def _receive(self, messages: list[Message]) -> None:
        receive = self.machine.receive
        for header, payload in messages:
            receive(header, payload)
        self._after()

    def _after(self) -> None:
        """After news: send the consequences, and wake coroutines that waited for them."""
        if self._away:
            self._say_who_is_away()
        self._flush()
        released = self.machine.released
        if released != self._told:
            self._told = released
            if self._on_released is not None:
                self._on_released()
        self._turns.wake()

    def _flush(self, *, rung: bool = False) -> None:
        if self._closed:
            return
        now = self._loop.time()
        due = self.machine.due if rung else None
        if due is not None and due <= now + _TIMER_SLACK_S:
            now = max(now, due)  # a timer may ring a little early, and would be set for the same moment again
        out = self.machine.flush(now)
        if out:
            self._put(out)
        due = self.machine.due
        if due is None:
            return
        if self._timer is not None:
            if self._timer.when() <= due + _TIMER_SLACK_S:
                return  # it will look again when it rings, which is cheaper than setting it at each token
            self._timer.cancel()
        self._timer = self._loop.call_at(max(due, now), self._ring)

    def _ring(self) -> None:
        self._timer = None
        self._flush(rung=True)
        self._say_who_is_away()

    def _say_who_is_away(self) -> None:
        """Log who does not answer any more, and who does again."""
        away = self.machine.away
        for name in away:
            if name not in self._away:
                self._away[name] = self._loop.time()
                _LOGGER.info(
                    'link "%s": "%s" does not answer, and %d tokens wait for it; they will reach it when it is back',
                    self.name,
                    name,
                    self.machine.unfinished,
                )
        for name in [name for name in self._away if name not in away]:
            silent_s = self._loop.time() - self._away.pop(name)
            _LOGGER.info('link "%s": "%s" answers again after %.1f s', self.name, name, silent_s)

    def _put(self, out: list[Outgoing]) -> None:
        for to, header, payload in out:
            publisher = self._all if to is None else self._one.get(to)
            if publisher is not None and not _put(publisher, header, payload):
                self._stop()
                return

    def _stop(self) -> None:
        """Nothing goes in or out any more."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        self._subscription.close()
        for publisher in (self._all, *self._one.values()):
            publisher.close()
        self._turns.wake_all()


class _Receiver:
    """Common part of both receiving ends: waiting for tokens."""

    machine: ExactConsumer | BoundedConsumer

    def __init__(self, session: Datagrams, name: str, arrived: Callable[[], None] | None) -> None:
        self.name = name
        self._loop = asyncio.get_running_loop()
        self._session = session
        self._on_arrived = arrived
        self._turns = _Turns(self._loop)
        self._subscriptions: list[Closing] = [session.subscribe(_to_all(name), self._receive)]
        self._closed = False

    def take_nowait(self) -> Delivery | None:
        """Return the next token if there is one."""
        return self.machine.take()

    async def take(self) -> Delivery:
        """Wait for the next token and return it.

        Raises:
          TransportError: the link is closed, from this end or the other, and no token is left.
        """
        while True:
            token = None if self._turns.waiting else self.machine.take()
            if token is not None:
                return token
            if self._closed or self._is_over():
                raise TransportError(f'link "{self.name}" is closed')
            await self._turns.wait()
            token = self.machine.take()
            if token is not None:
                if self.machine.waiting:
                    self._turns.wake()
                return token

    async def __aiter__(self) -> AsyncIterator[Delivery]:
        """Yield all tokens, until the link is closed."""
        while True:
            try:
                token = await self.take()
            except TransportError:
                return
            yield token

    def statistics(self) -> dict[str, int]:
        """Return the numbers of tokens received, refused, repeated, missing and dropped."""
        counts: dict[str, int] = msgspec.structs.asdict(self.machine.counts)
        return counts | {"waiting": self.machine.waiting}

    async def close(self) -> None:
        """Close it; tokens that were not acknowledged will be delivered to the next consumer."""
        if not self._closed:
            self._closed = True
            for one in self._subscriptions:
                one.close()
            self._turns.wake_all()

    def _is_over(self) -> bool:
        return False

    def _receive(self, messages: list[Message]) -> None:
        receive = self.machine.receive
        for header, payload in messages:
            receive(header, payload)
        if self.machine.waiting or self._is_over():
            if self._on_arrived is not None:
                self._on_arrived()
            self._turns.wake()


class LinkReceiver(_Receiver):
    """The receiving end of an exact link in operation.

    Args:
      session: session of a transport, or another carrier of datagrams, on the running loop.
      name: name of the link, as a key; the same at both ends.
      consumer: the name under which the producer has admitted this end.
      incarnation: number of this incarnation of the consumer.
      arrived: called when tokens have arrived; tokens that it takes and acknowledges are reported at once.
      **options: options of `ExactConsumer`.

    Attributes:
      machine: the state machine; only for reading.
    """

    machine: ExactConsumer

    def __init__(
        self,
        session: Datagrams,
        name: str,
        *,
        consumer: str,
        incarnation: int,
        arrived: Callable[[], None] | None = None,
        **options: Any,
    ) -> None:
        self.machine = ExactConsumer(consumer, incarnation, **options)
        self._portion = _portion(self.machine.capacity)
        super().__init__(session, name, arrived)
        self._subscriptions.append(session.subscribe(_to_one(name, consumer), self._receive))
        self._back = session.publisher(_back(name), Traffic.ACKNOWLEDGEMENTS)
        self._batch = _Batch(self._loop, self._flush)
        self._batch.ask()  # to announce that it is here

    def done(self, count: int = 1) -> None:
        """Say that the oldest tokens that were taken are processed; see `IncomingLink`."""
        machine = self.machine
        machine.done(count)
        if not machine.unfinished or machine.untold >= self._portion:
            self._flush()  # nothing can join it, or it is enough
        elif not self._batch.asked:
            self._batch.ask()

    async def close(self) -> None:
        """Close it; tokens that were not acknowledged will be delivered to the next consumer."""
        if not self._closed:
            self._flush()
            await super().close()
            self._back.close()

    def _is_over(self) -> bool:
        return self.machine.closed

    def _receive(self, messages: list[Message]) -> None:
        super()._receive(messages)
        self._flush()

    def _flush(self) -> None:
        if not self._closed:
            for _, header, payload in self.machine.flush():
                _put(self._back, header, payload)


class BoundedSender:
    """The sending end of a link that may lose tokens, in operation; it never waits.

    Args:
      session: session of a transport, or another carrier of datagrams, on the running loop.
      name: name of the link, as a key; the same at both ends.
      epoch: number of this incarnation of the producer.
    """

    def __init__(self, session: Datagrams, name: str, *, epoch: int) -> None:
        room = session.largest_message - _HEADROOM
        self.machine = BoundedProducer(epoch, largest_token=room, largest_batch=min(60_000, room))
        self.name = name
        self._publisher = session.publisher(_to_all(name), Traffic.BULK)
        self._batch = _Batch(asyncio.get_running_loop(), self._flush)
        self._closed = False

    def send_nowait(self, token: EncodedToken) -> int:
        """Accept the next token. Return its number."""
        if self._closed:
            raise TransportError(f'link "{self.name}" is closed')
        number = self.machine.send(token)
        if not self._batch.asked:
            self._batch.ask()
        return number

    def statistics(self) -> dict[str, int]:
        """Return the numbers of tokens and datagrams sent."""
        counts: dict[str, int] = msgspec.structs.asdict(self.machine.counts)
        return counts

    async def close(self) -> None:
        """End it; what was sent is put."""
        if not self._closed:
            self._flush()
            self._closed = True
            self._publisher.close()

    def _flush(self) -> None:
        if not self._closed:
            for _, header, payload in self.machine.flush():
                _put(self._publisher, header, payload)


class BoundedReceiver(_Receiver):
    """The receiving end of a link that may lose tokens, in operation.

    Args:
      session: session of a transport, or another carrier of datagrams, on the running loop.
      name: name of the link, as a key; the same at both ends.
      arrived: called when tokens have arrived.
      **options: options of `BoundedConsumer`.
    """

    machine: BoundedConsumer

    def __init__(
        self, session: Datagrams, name: str, *, arrived: Callable[[], None] | None = None, **options: Any
    ) -> None:
        self.machine = BoundedConsumer(**options)
        super().__init__(session, name, arrived)
