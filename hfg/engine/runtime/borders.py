"""Where tokens leave a part of a graph and come into it, in a graph that is cut for processes (rules L1, P4, P5, F5).

An `Outlet` stands for the far end of an edge that leads away. What may not be lost lies on that edge until it was taken
over there: so the edge's own rules hold its producer back, and nothing else has to. An `Inlet` stands for the near end.
It lays what comes on its edge as there is room, and says what was taken and what is done. Both are plain decisions;
whoever owns the part moves the tokens. Stands on `engine` and `rules`.
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
"""What the consumer of an edge does with tokens: takes them; drains them, having ended (F12); is sent none (F10)."""


class Outlet:
    """The far end of an edge that leaves this part.

    Attributes:
      label: of the edge.
      sent: how many tokens have left, as its two ends count them: through all lives of both.
      taken: how many of them count as taken by the consumer.
      left: how many have left in this life.
      end_has_left: END was the last of them.
      hearing: what that does with them, as far as is known here.
    """

    def __init__(
        self, engine: Engine, worker: RunningNode, *, keeps: bool, wake: Callable[[], None], drains: bool = True
    ) -> None:
        """Stand there.

        Args:
          engine: of the part.
          worker: the reader at the end of the edge.
          keeps: tokens lie here until they were taken over there; else they are gone when they have left.
          wake: called, amid the pump, when something lies here that has not left.
          drains: what is for a consumer that has ended is drained here; else over there, where it may be known when all
            is done that came of what it took before.
        """
        self._engine = engine
        self._worker = worker
        self._keeps = keeps
        if not keeps:
            engine.look_round_often()  # nobody holds its producer back: of all that it sends in a slice one would leave
        self._drains = drains
        (self._edge,) = worker.in_edges
        self._waiting = 0  # tokens that have left and still lie here
        self._owed = 0  # tokens that a former life has kept and that are not taken: the oldest of those under way
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
        """Give the tokens that have come since the last time, oldest first, at most so many; they are on their way."""
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
        """Give END once more if it was sent and is lost, where signals may be: it may not (F13)."""
        edge = self._edge
        if self._keeps or type(edge) is not EventEdge or not edge.end_sent:
            return None
        self.sent += 1
        self.taken += 1
        self.left += 1
        return Token(END, 0, self._engine.core.now())

    @property
    def finished(self) -> int:
        """How many of those that have left in this life count as taken."""
        return self.left - self._waiting

    def rebase(self, total: int) -> None:
        """A former life has sent so many, and nobody waits for what becomes of them."""
        self.sent += total
        self.taken += total

    def stand_at(self, number: int) -> None:
        """That is the number of the last one that has left: a new life of the consumer counts from there."""
        self.taken += number - self.sent
        self.sent = number

    def owe(self, count: int) -> None:
        """A former life has kept so many for the consumer, which are on their way and do not lie here."""
        self.sent += count
        self._owed += count

    @property
    def unsent(self) -> list[Token[Any]]:
        """What lies here and has not left, oldest first."""
        lies: list[Token[Any]] = self._edge.contents()
        return lies[self._waiting :]

    def repeat(self, count: int) -> None:
        """Of what has left, so many had been sent by a former life: they count once."""
        self.sent -= count
        self.taken -= count

    @property
    def speaking(self) -> bool:
        """Whether the producer is enabled: what waits for one that is not waits for nobody (F10)."""
        return not self._edge.source.blocked & DISABLED

    @property
    def has_more(self) -> bool:
        """Whether something lies here that has not left."""
        return bool(self._edge.untaken > self._waiting)

    @property
    def holds_up(self) -> bool:
        """Whether somebody is to wait for what becomes of tokens here.

        Not where nobody hears them; nor where one end of the edge has ended, once all is taken that came before.
        """
        if self.hearing == "deaf":
            return False
        return bool(self._edge.untaken) or not (self.hearing == "over" or self.is_over)

    @property
    def is_over(self) -> bool:
        """Whether nothing will come here any more."""
        return bool(self._edge.source.blocked & ENDED) and not self._edge.untaken

    def be_taken(self, total: int) -> None:
        """So many in all were taken by the consumer: their places are free (F5, F8)."""
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
        """The consumer hears otherwise from now on: what lies here for it is treated as it would be there."""
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
      received: how many tokens have come, as its two ends count them: through all lives of both.
      taken: how many of them their consumer has taken.
      heard: how many the producer has sent, as far as is known here, by its numbers.
      speaking: whether their producer is enabled, as far as is known here.
    """

    def __init__(self, engine: Engine, worker: RunningNode, moved: Callable[[Inlet], None]) -> None:
        """Stand there.

        Args:
          engine: of the part.
          worker: stands for the source of the edge.
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
        self._done = 0  # of those, in the part, with all that came of them
        self._orphans = 0  # of so many the producer has died and left nobody who waits for them to be done

        def step(worker: RunningNode) -> None:
            worker.dequeued()
            self.lay()

        worker.run_by(step)
        worker.changed()

    @property
    def waiting(self) -> int:
        """How many have come that no firing and no call has taken."""
        return len(self._inbox) + int(self._edge.untaken)

    def rebase(self, total: int) -> None:
        """A former life has done so many."""
        self.received += total
        self.taken += total
        self._done += total

    def rebase_to(self, number: int) -> None:
        """All up to that number was done by former lives, or is lost with them."""
        self.received = self.taken = self._done = number

    @property
    def settled(self) -> int:
        """For how many nobody waits any more: they are done, or who has sent them is dead."""
        return max(self._done, self._orphans)

    def settle(self, done: int) -> bool:
        """So many are done in the part, with all that came of them; give whether more than before."""
        if done <= self._done:
            return False
        self._done = done
        return True

    def orphan(self) -> None:
        """The producer has died and left nobody who waits for what has come."""
        self._orphans = self.received

    def hold(self, held: bool) -> None:
        """Lay no more tokens on an edge of data until it is let go: what has come waits here."""
        self._held = held

    @property
    def is_clear(self) -> bool:
        """Whether nothing that was laid is still in the part, nor what came of it."""
        return not self._worker.outputs.missing and self.settled >= self.taken

    def skip(self, count: int) -> None:
        """So many have come that are not for this life: what belongs to them was done by a former one."""
        self.received += count
        self._edge.count_dropped(count)

    def lose(self, count: int) -> None:
        """So many have left and will never come: the edge may lose some, and counts them."""
        self.received += count
        self._edge.count_dropped(count)

    def count_lost(self, count: int) -> None:
        """So many are lost with the process of a part."""
        self._edge.lost += count

    def arrive(self, tokens: Sequence[tuple[Any, int, float]]) -> None:
        """Tokens have come over the link: value, modifier and stamp of each."""
        self.received += len(tokens)
        self._inbox.extend(tokens)

    def speak(self, speaking: bool) -> None:
        """The producer was disabled or enabled; what came before counts for signals alone (F10)."""
        self.speaking = speaking
        if speaking:
            enable_around(self._worker)
        else:
            disable_around([self._worker])
            if type(self._edge) is not EventEdge:
                self._inbox.clear()
        self._engine.kick()

    def lay(self) -> None:
        """Lay what has come on the edge, as far as there is room; say what was taken since the last time.

        What comes before this part has begun waits here: `start` is on its edges first (A10), wherever data comes from.
        """
        core = self._engine.core
        if core.over or not core.started:
            return
        if not reaches(self._edge):
            while self._inbox:  # what lies where it comes from goes back from there (A8)
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
        """Amid a step of the engine: what follows is laid when that is over, in turn with what else can move."""
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
        """What its consumer does with tokens; those that carry activity are for it even if it has ended (F12)."""
        if not reaches(self._edge):
            return "deaf"
        over = self._joins and not self._edge.active and self._edge.target.blocked & ENDED
        return "over" if over else "open"
