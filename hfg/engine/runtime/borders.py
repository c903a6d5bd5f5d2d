"""Where tokens leave a part of a graph and arrive in it, if the graph is cut for processes (rules L1, P4, P5, F5).

An `Outlet` represents the far end of an edge that leaves the part. Lossless tokens stay on that edge until the other
part has taken them, so the edge's own rules block its producer, and nothing else has to. An `Inlet` represents the near
end. It puts what arrives on its edge as there is room, and reports what was taken and what is done. Both only decide;
the owner of the part moves the tokens.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice
from typing import Any, Literal, TypeAlias

from hfg.base.token import END, Token
from hfg.engine.model.running_node import DISABLED, ENDED, RunningNode
from hfg.engine.rules.ending import drain_left
from hfg.engine.rules.node_lifecycle import disable_around, enable_around
from hfg.engine.rules.quiescence import node_ended
from hfg.engine.rules.releasing import take_from_reader
from hfg.engine.rules.sending import enqueue, put_arrived
from hfg.engine.rules.wiring import reaches
from hfg.engine.runtime.engine import Engine
from hfg.ports.edges import EventEdge, SyncEdge

__all__ = ["Hearing", "Inlet", "Outlet"]

Hearing: TypeAlias = Literal["open", "over", "deaf"]
"""What the consumer of an edge does with tokens: takes them; drains them, as it has ended (F12); gets none (F10)."""


class Outlet:
    """The far end of an edge that leaves this part.

    Attributes:
      label: of the edge.
      sent: how many tokens have left, as both ends count them: over all incarnations of both.
      taken: how many of them count as taken by the consumer.
      left: how many have left in this incarnation.
      end_has_left: END was the last of them.
      hearing: what the consumer does with them, as far as is known here.
    """

    def __init__(
        self, engine: Engine, worker: RunningNode, *, keeps: bool, wake: Callable[[], None], drains: bool = True
    ) -> None:
        """Take the place of the consumer.

        Args:
          engine: of the part.
          worker: the reader at the end of the edge.
          keeps: tokens stay here until the consumer has taken them; otherwise they are gone when they have left.
          wake: called during the pump when a token is here that has not left.
          drains: tokens for an ended consumer are drained here; otherwise over there, where it may be known when all
            that follows from earlier tokens is done.
        """
        self._engine = engine
        self._worker = worker
        self._keeps = keeps
        if not keeps:
            engine.look_round_often()  # its producer is not blocked, and would replace tokens before they leave
        self._drains = drains
        (self._edge,) = worker.in_edges
        self._waiting = 0  # tokens that have left and are still here
        self._owed = 0  # tokens kept by a former incarnation and not taken: the oldest of those in transit
        self.end_has_left = False
        self.hearing: Hearing = "open"
        self.label: str = worker.port_name
        self.sent = 0
        self.taken = 0
        self.left = 0

        def step(worker: RunningNode) -> None:
            worker.use_turn()
            wake()

        worker.run_by(step)

    def leave(self, most: int) -> list[Token[Any]]:
        """Return the tokens that have arrived since the last time, at most `most`, oldest first; they leave now."""
        worker, edge = self._worker, self._edge
        if not self._keeps:
            tokens: list[Token[Any]] = []
            while edge.untaken and len(tokens) < most:
                tokens.append(take_from_reader(worker))
            self.taken += len(tokens)
        elif type(edge) is SyncEdge:
            tokens = [edge.token] if edge.token is not None and not self._waiting and most > 0 else []
        else:
            lying = islice(edge.queue, self._waiting, self._waiting + max(most, 0))
            tokens = [Token(*one) for one in lying]
        if self._keeps:
            self._waiting += len(tokens)
            self.end_has_left = self.end_has_left or (bool(tokens) and tokens[-1].value is END)
        self.sent += len(tokens)
        self.left += len(tokens)
        return tokens

    def last_word(self) -> Token[Any] | None:
        """Return END again if it was sent and lost: on a lossy edge signals may be lost, but not END (F13)."""
        edge = self._edge
        if self._keeps or type(edge) is not EventEdge or not edge.end_sent:
            return None
        self.sent += 1
        self.taken += 1
        self.left += 1
        return Token(END, 0, self._engine.core.now())

    @property
    def finished(self) -> int:
        """How many of those that have left in this incarnation count as taken."""
        return self.left - self._waiting

    def rebase(self, total: int) -> None:
        """A former incarnation has sent this many, and nothing waits for them."""
        self.sent += total
        self.taken += total

    def stand_at(self, number: int) -> None:
        """This is the number of the last token that has left: a new incarnation of the consumer counts from there."""
        self.taken += number - self.sent
        self.sent = number

    def owe(self, count: int) -> None:
        """A former incarnation has kept this many for the consumer; they are in transit, not here."""
        self.sent += count
        self._owed += count

    @property
    def unsent(self) -> list[Token[Any]]:
        """The tokens here that have not left, oldest first."""
        lies: list[Token[Any]] = self._edge.contents()
        return lies[self._waiting :]

    def repeat(self, count: int) -> None:
        """This many of those that have left were sent by a former incarnation: they count once."""
        self.sent -= count
        self.taken -= count

    @property
    def speaking(self) -> bool:
        """Whether the producer is enabled; a disabled one is not waited for (F10)."""
        return not self._edge.source.blocked & DISABLED

    @property
    def has_more(self) -> bool:
        """Whether a token is here that has not left."""
        return bool(self._edge.untaken > self._waiting)

    @property
    def holds_up(self) -> bool:
        """Whether the outcome of tokens here is waited for.

        It is not if the consumer gets none, or if one end has ended and all earlier tokens are taken.
        """
        if self.hearing == "deaf":
            return False
        return bool(self._edge.untaken) or not (self.hearing == "over" or self.is_over)

    @property
    def is_over(self) -> bool:
        """Whether no token will arrive here any more."""
        return bool(self._edge.source.blocked & ENDED) and not self._edge.untaken

    def be_taken(self, total: int) -> None:
        """The consumer has taken this many in total: their places are free (F5, F8)."""
        count = total - self.taken
        if count <= 0:
            return
        self.taken = total
        of_former = min(count, self._owed)
        self._owed -= of_former
        count -= of_former
        self._waiting = min(self._waiting, self._edge.untaken)  # what a disabled producer took back is gone (F10)
        for _ in range(min(count, self._waiting)):
            self._waiting -= 1
            take_from_reader(self._worker)
        self._engine.kick()

    def hear(self, hearing: Hearing) -> None:
        """The consumer does something else with tokens from now on: treat those here as it would."""
        before, self.hearing = self.hearing, hearing
        worker = self._worker
        if before == "deaf":
            enable_around(worker)
        elif before == "over" and self._drains:
            worker.allow(ENDED)
            worker.start_over()
            enable_around(worker)
        if hearing == "deaf":
            self._waiting = 0
            disable_around([worker])
        elif hearing == "over" and self._drains:
            self._waiting = 0
            worker.end()
            assert worker.ending is not None
            drain_left(worker.in_edges)
            worker.ending.take_deferred()
            node_ended(worker)
        self._engine.kick()


class Inlet:
    """The near end of an edge that comes into this part.

    Attributes:
      label: of the edge.
      received: how many tokens have arrived, as both ends count them: over all incarnations of both.
      taken: how many of them their consumer has taken.
      heard: how many the producer has sent, by its numbers, as far as is known here.
      speaking: whether their producer is enabled, as far as is known here.
    """

    def __init__(self, engine: Engine, worker: RunningNode, moved: Callable[[Inlet], None]) -> None:
        """Take the place of the producer.

        Args:
          engine: of the part.
          worker: represents the source of the edge.
          moved: called when `taken` has grown.
        """
        self._engine = engine
        self._worker = worker
        (self._edge,) = worker.all_out_edges()
        self._moved = moved
        self._inbox: deque[tuple[Any, int, float]] = deque()
        self._waits = False
        self._held = False
        self._joins = self._edge.joins()
        self.speaking = True
        self.label: str = worker.port_name
        self.received = 0
        self.heard = 0
        self.taken = 0
        self._done = 0  # of those, in the part, with all that followed from them
        self._orphans = 0  # the producer of so many has died, so nothing waits for them to be done

        def step(worker: RunningNode) -> None:
            worker.dequeued()
            self.lay()

        worker.run_by(step)
        worker.changed()

    @property
    def waiting(self) -> int:
        """How many have arrived and were not taken."""
        return len(self._inbox) + int(self._edge.untaken)

    def rebase(self, total: int) -> None:
        """A former incarnation has done this many."""
        self.received += total
        self.taken += total
        self._done += total

    def rebase_to(self, number: int) -> None:
        """All up to this number was done by former incarnations, or is lost with them."""
        self.received = self.taken = self._done = number

    @property
    def settled(self) -> int:
        """How many are not waited for any more: they are done, or their producer is dead."""
        return max(self._done, self._orphans)

    def settle(self, done: int) -> bool:
        """This many are done in the part, with all that followed. Return whether that is more than before."""
        if done <= self._done:
            return False
        self._done = done
        return True

    def orphan(self) -> None:
        """The producer has died, so nothing waits for what has arrived."""
        self._orphans = self.received

    def hold(self, held: bool) -> None:
        """Put no more tokens on an edge of data, or do again; those that have arrived wait here."""
        self._held = held

    @property
    def is_clear(self) -> bool:
        """Whether nothing that was put on the edge, nor what followed from it, is still in the part."""
        return not self._worker.outputs.missing and self.settled >= self.taken

    def skip(self, count: int) -> None:
        """This many have arrived that a former incarnation has handled."""
        self.received += count
        self._edge.count_dropped(count)

    def lose(self, count: int) -> None:
        """This many have left and will never arrive: a lossy edge counts them."""
        self.received += count
        self._edge.count_dropped(count)

    def count_lost(self, count: int) -> None:
        """This many are lost with the process of a part."""
        self._edge.lost += count

    def arrive(self, tokens: Sequence[tuple[Any, int, float]]) -> None:
        """Tokens have arrived over the link: value, modifier and stamp of each."""
        self.received += len(tokens)
        self._inbox.extend(tokens)

    def speak(self, speaking: bool) -> None:
        """The producer was disabled or enabled; earlier tokens stay only if they are signals (F10)."""
        self.speaking = speaking
        if speaking:
            enable_around(self._worker)
        else:
            disable_around([self._worker])
            if type(self._edge) is not EventEdge:
                self._inbox.clear()
        self._engine.kick()

    def lay(self) -> None:
        """Put what has arrived on the edge, as far as there is room; report what was taken since the last time.

        Tokens that arrive before this part starts wait here: `start` is on its edges first (A10).
        """
        core = self._engine.core
        if core.over or not core.started:
            return
        if not reaches(self._edge):
            while self._inbox:  # the other part takes back what is still on its side (A8)
                self._inbox.popleft()
                self._edge.count_dropped()
        if type(self._edge) is EventEdge:
            self._lay_signals(self._edge)
        else:
            self._lay_token()

    def _lay_signals(self, edge: EventEdge) -> None:
        inbox = self._inbox
        came = bool(inbox)
        while inbox:
            value, activity, stamp = inbox.popleft()
            enqueue(edge, value, activity if edge.active else 0, stamp)
        if came:
            self._engine.kick()
        self._count(self.received - edge.untaken)

    def _lay_token(self) -> None:
        worker, inbox, outputs = self._worker, self._inbox, self._worker.outputs
        if inbox and not outputs.missing and not self._held:
            while inbox and not outputs.missing:
                value, activity, stamp = inbox.popleft()
                put_arrived(worker, value, activity, stamp)
            self._engine.kick()
        self._count(self.received - len(inbox) - (1 if outputs.missing else 0))
        if outputs.missing and not self._waits:
            self._waits = True
            outputs.when_complete(self._free)

    def _free(self) -> None:
        """During a step of the engine: continue after it, when it is this node's turn."""
        self._waits = False
        if self._worker.group.threaded:
            self._engine.soon(self.lay)
        else:
            self._worker.enqueue()

    def _count(self, taken: int) -> None:
        if taken > self.taken:
            self.taken = taken
            self._moved(self)

    @property
    def hearing(self) -> Hearing:
        """Whether its consumer takes tokens; even an ended one gets those that carry activity (F12)."""
        if not reaches(self._edge):
            return "deaf"
        over = self._joins and not self._edge.active and self._edge.target.blocked & ENDED
        return "over" if over else "open"
