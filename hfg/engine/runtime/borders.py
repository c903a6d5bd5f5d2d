"""Where tokens leave a part of a graph and come into it, in a graph that is cut for processes (rules L1, P4, P5, F5).

An `Outlet` stands for the far end of an edge that leads away. What may not be lost lies on that edge until it was taken
over there: so the edge's own rules hold its producer back, and nothing else has to. An `Inlet` stands for the near end.
It lays what comes on its edge as there is room, and says what was taken and what is done. Both are plain decisions;
whoever owns the part moves the tokens. Stands on `engine` and `rules`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Any

from hfg.engine.model.worker import ENDED, Worker
from hfg.engine.rules.releasing import take_from_reader
from hfg.engine.rules.sending import enqueue, put_outputs
from hfg.engine.runtime.engine import Engine
from hfg.ports.edges import EventEdge, SyncEdge
from hfg.token import Token

__all__ = ["Inlet", "Outlet"]


class Outlet:
    """The far end of an edge that leaves this part.

    Attributes:
      label: of the edge.
      sent: how many tokens have left.
      taken: how many of them count as taken by the consumer.
    """

    def __init__(self, engine: Engine, worker: Worker, *, keeps: bool, wake: Callable[[], None]) -> None:
        """Stand there.

        Args:
          engine: of the part.
          worker: the reader at the end of the edge.
          keeps: tokens lie here until they were taken over there; else they are gone when they have left.
          wake: called, amid the pump, when something lies here that has not left.
        """
        self._engine = engine
        self._worker = worker
        self._keeps = keeps
        (self._edge,) = worker.in_edges
        self._waiting = 0  # tokens that have left and still lie here
        self.label: str = worker.port_name
        self.sent = 0
        self.taken = 0

        def step(worker: Worker) -> None:
            worker.no_turn()
            wake()

        worker.run_by(step)

    def leave(self, most: int) -> list[Token[Any]]:
        """Give the tokens that have come since the last time, oldest first, at most so many; they are on their way."""
        worker, edge = self._worker, self._edge
        if not self._keeps:
            tokens = []
            while edge.untaken and len(tokens) < most:
                tokens.append(take_from_reader(worker))
            self.taken += len(tokens)
        elif type(edge) is SyncEdge:
            tokens = [edge.token] if edge.token is not None and not self._waiting and most > 0 else []
        else:
            tokens = list(islice(edge.queue, self._waiting, self._waiting + max(most, 0)))
        if self._keeps:
            self._waiting += len(tokens)
        self.sent += len(tokens)
        return tokens

    @property
    def has_more(self) -> bool:
        """Whether something lies here that has not left."""
        return bool(self._edge.untaken > self._waiting)

    def be_taken(self, count: int) -> None:
        """So many more were taken by the consumer: their places are free (F5, F8)."""
        for _ in range(min(count, self._waiting)):
            self._waiting -= 1
            self.taken += 1
            take_from_reader(self._worker)
        self._engine.kick()


class Inlet:
    """The near end of an edge that comes into this part.

    Attributes:
      label: of the edge.
      received: how many tokens have come.
      taken: how many of them their consumer has taken.
    """

    def __init__(self, engine: Engine, worker: Worker, moved: Callable[[Inlet, int], None]) -> None:
        """Stand there.

        Args:
          engine: of the part.
          worker: stands for the source of the edge.
          moved: called when `taken` has grown, with by how much.
        """
        self._engine = engine
        self._worker = worker
        (self._edge,) = worker.all_out_edges()
        self._moved = moved
        self._inbox: deque[tuple[Any, int, float]] = deque()
        self._waits = False
        self.label: str = worker.port_name
        self.received = 0
        self.taken = 0

    def arrive(self, value: object, activity: int, stamp: float) -> None:
        """A token has come over the link."""
        self.received += 1
        self._inbox.append((value, activity, stamp))

    def lay(self) -> None:
        """Lay what has come on the edge, as far as there is room; say what was taken since the last time."""
        if self._engine.core.over:
            return
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
        worker, inbox = self._worker, self._inbox
        while inbox and not worker.outputs.missing:
            value, activity, stamp = inbox.popleft()
            put_outputs(worker, [(value, activity, stamp)])
            self._engine.kick()
        lies = len(inbox) + (1 if worker.outputs.missing else 0)
        self._count(self.received - lies)
        if worker.outputs.missing and not self._waits:
            self._waits = True
            worker.outputs.when_complete(self._free)

    def _free(self) -> None:
        """Amid a step of the engine: what follows is laid when that is over."""
        self._waits = False
        self._engine.soon(self.lay)

    def _count(self, taken: int) -> None:
        more = taken - self.taken
        if more > 0:
            self.taken = taken
            self._moved(self, more)

    @property
    def is_over(self) -> bool:
        """Whether its consumer takes nothing any more, so that nobody need send (F12)."""
        return bool(self._edge.target.blocked & ENDED)
