"""Pausing a run: pause, one step of one node, one wave, breakpoints (rule R3).

While the run is paused nothing is taken from the run queues. Firings in progress end, timers ring, and tokens stay
where they are.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Protocol

from hfg.base.logs import Log
from hfg.base.token import Token
from hfg.engine.editing.breakpoints import Breakpoint, Step
from hfg.engine.model.running_node import NO_CALLS, RunningNode
from hfg.engine.rules import iterating, quiescence
from hfg.engine.runtime.callbacks import Edited
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.places import behind, edges_at, is_gone, is_near, place_of
from hfg.errors import UsageError
from hfg.trace import RunPaused, RunResumed, TokenSent, TraceEvent

__all__ = ["Pausing"]

_LOGGER = Log("hfg.engine")


class _Trace(Protocol):
    """The consumers of the run's trace, among which a breakpoint on an edge receives tokens."""

    def add(self, consumer: Callable[[TraceEvent], None]) -> Callable[[], None]:
        """Let a function receive every event from now on; return what removes it."""


class Pausing:
    """The part of the engine that can pause everything.

    Attributes:
      paused: no new firing or call starts.
      why: what paused the run: "pause", or the path of the breakpoint that was hit.
    """

    def __init__(self, engine: Engine, consumers: _Trace) -> None:
        self._engine = engine
        self._consumers = consumers
        self.paused = False
        self.why = ""
        self._on_hit: Callable[[Breakpoint], None] = lambda _: None
        self._stepping = False
        self._waiters: list[asyncio.Future[None]] = []  # for a pause, or for the end of a step
        self._at_nodes: dict[RunningNode, Breakpoint] = {}
        self._at_edges: dict[Breakpoint, Callable[[], None]] = {}
        self._labels_at: dict[Breakpoint, frozenset[str]] = {}
        self._waived: set[RunningNode] = set()  # stopped here already: continues with the run
        engine.callbacks.rested.append(self._rest)
        engine.callbacks.finished.append(self._rest)
        engine.callbacks.edited.append(self._find_again)

    # --- pause and resume -------------------------------------------------------------------------------------------

    def pause(self, why: str = "pause") -> None:
        """Let no new firing and no new slot call start. Does nothing if the run is paused."""
        engine = self._engine
        if self.paused or engine.core.over:
            return
        self.paused, self.why = True, why
        self._pause_groups(True)
        engine.core.flags.append("paused")
        if engine.core.trace_changes is not None:
            engine.core.trace_changes(RunPaused(engine.now(), why))
        self._rest()

    def resume(self) -> None:
        """Continue. Does nothing if the run is not paused.

        Raises:
          UsageError: a step is in progress.
        """
        if not self.paused:
            return
        if self._stepping:
            raise UsageError("a step is in progress: await it before run.resume()")
        engine = self._engine
        self.paused, self.why = False, ""
        self._pause_groups(False)
        if engine.core.trace_changes is not None:
            engine.core.trace_changes(RunResumed(engine.now()))
        engine.kick()

    def _pause_groups(self, paused: bool) -> None:
        self._engine.core.pause(paused)
        for group in self._engine.groups.values():
            group.pause(paused)

    def _rest(self) -> None:
        """Wake those who wait for the pause, or for the end of a step: the engine would continue now."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            if not waiter.done():
                waiter.set_result(None)

    async def _change(self) -> None:
        waiter: asyncio.Future[None] = self._engine.loop.create_future()
        self._waiters.append(waiter)
        await waiter

    async def wait_paused(self) -> str:
        """Wait until the run is paused and nothing is in progress; return why it was paused.

        Raises:
          UsageError: the run has ended.
        """
        engine = self._engine
        while not engine.core.over:
            if self.paused and not self._engine.core.in_flight and not self._stepping:
                return self.why
            await self._change()
        raise UsageError("cannot pause: the run has ended")

    # --- steps ------------------------------------------------------------------------------------------------------

    async def step(self, node: Any) -> Step:
        """Let one node make one firing or one slot call, and wait until that is over."""
        worker = self._single(node, "step")
        self._begin(worker.path)
        try:
            self._let_elements_in()
            why_not = self._why_not(worker)
            if why_not:
                return Step((), why_not)
            self._let(worker)
            await self._over([worker])
            self._let_elements_in()
        finally:
            self._stepping = False
        return Step((worker.path,))

    async def wave(self) -> Step:
        """Let each node make at most one firing and one call, including nodes that these enable."""
        self._begin("a wave")
        moved: list[str] = []
        done: set[tuple[RunningNode, str]] = set()
        workers: list[RunningNode] = []
        try:
            self._let_elements_in()
            while not self._engine.core.over:
                worker = self._next_in_wave(done)
                if worker is not None:
                    done.add((worker, _next_kind(worker)))
                    moved.append(worker.path)
                    workers.append(worker)
                    self._let(worker)
                elif _any_works(workers):
                    await self._change()
                elif not self._let_elements_in():
                    break
        finally:
            self._stepping = False
        return Step(tuple(moved), "" if moved else "no node can move")

    def _next_in_wave(self, done: set[tuple[RunningNode, str]]) -> RunningNode | None:
        """Return the node that moves next in a wave in which these have already moved.

        Nodes stay in their queues, because what they do next may change: a node that has fired may be called.
        """
        for worker in [worker for worker in self._queued() if not worker.is_boundary_output]:
            kind = _next_kind(worker)
            if not kind:
                self._let(worker)  # its reason is gone: it leaves the queue, so that it can be queued again
            elif (worker, kind) not in done:
                return worker
        return None

    def _let_elements_in(self) -> bool:
        """Let subgraphs that iterate and are quiet inside take their next element, which is not a firing (G4).

        Return whether one did, or something came out of one.
        """
        went_on = False
        while True:
            readers = [worker for worker in self._queued() if worker.is_boundary_output]
            for reader in readers:  # outputs are read by the engine, which is not paused
                self._let(reader)
            if not iterating.settle(self._engine.core) and not readers:
                return went_on
            went_on = True

    def need_still(self, what: str) -> None:
        """Refuse to step a run that is not paused.

        Raises:
          UsageError: it has ended, is running, or is already making a step.
        """
        if self._engine.core.over:
            raise UsageError(f"{what} cannot step: the run has ended")
        if not self.paused:
            raise UsageError(f"{what} cannot step while the run is not paused: run.pause() first")
        if self._stepping:
            raise UsageError(f"{what} cannot step while another step is under way: await that first")

    def _begin(self, what: str) -> None:
        self.need_still(what)
        self._stepping = True
        for region in list(self._engine.core.regions):
            region.dissolve()

    def _queued(self) -> Iterator[RunningNode]:
        """Yield the nodes that could move now, group by group."""
        for group in self._engine.groups.values():
            if not group.full:
                yield from list(group.policy)

    def _why_not(self, worker: RunningNode) -> str:
        if worker.busy:
            return f'"{worker.path}" is in the middle of a {worker.busy}'
        if worker.group.full:
            return f'group "{worker.group.name}" of "{worker.path}" is still busy'
        if worker.queued and _next_kind(worker):
            return ""
        return f'"{worker.path}" {quiescence.waits_for(worker)}'

    def _let(self, worker: RunningNode) -> None:
        """Make the next step of a node, as the engine would."""
        engine = self._engine
        worker.group.policy.remove(worker)
        self._waived.add(worker)
        engine.guard(lambda: worker.step(worker))
        self._waived.discard(worker)

    async def _over(self, workers: list[RunningNode]) -> None:
        while _any_works(workers) and not self._engine.core.over:
            await self._change()

    # --- breakpoints ------------------------------------------------------------------------------------------------

    @property
    def breakpoints(self) -> list[Breakpoint]:
        """All breakpoints."""
        return [*self._at_nodes.values(), *self._at_edges]

    def when_hit(self, told: Callable[[Breakpoint], None]) -> None:
        """Call a function when a breakpoint has paused this process of a run, so that the others pause, too."""
        self._on_hit = told

    def break_at(self, place: Any, when: Callable[[Token[Any]], object] | None) -> Breakpoint:
        """See `Run.break_at`."""
        if when is not None and not callable(when):
            raise UsageError(f"when= takes a function of the token, like lambda token: token.value > 3; got {when!r}")
        place = place_of(self._engine, place)
        if not hasattr(place, "_place"):
            return self._at_edges_of(place, when)
        if when is not None:
            raise UsageError("when= looks at a token: give an edge or a port of the node, not the node")
        return self._at_node(self._single(place, "stop at"))

    def _single(self, node: Any, what: str) -> RunningNode:
        if isinstance(node, str):
            node = self._engine.graph[node]
        worker = self._engine.worker_of(node)
        if worker.scope is not None:
            raise UsageError(f'"{worker.path}" is a subgraph: {what} a node inside (G1)')
        return worker

    def _at_node(self, worker: RunningNode) -> Breakpoint:
        """Pause before each firing and call of a node."""
        found = self._at_nodes.get(worker)
        if found is None:
            found = self._at_nodes[worker] = Breakpoint(worker.node, worker.path, self.remove)
            worker.halt_at(partial(self._behind, found))
        return found

    def _at_edges_of(self, place: Any, when: Callable[[Token[Any]], object] | None) -> Breakpoint:
        """Pause when a token is put on one of the edges, before a node takes it."""
        labels = self._labels(place)
        if not labels:
            raise UsageError(f"{place!r} has no edge in this run, so no token can come there")
        point = Breakpoint(place, _path(place, labels), self.remove)
        self._labels_at[point] = frozenset(labels)

        def look(event: TraceEvent) -> None:
            if type(event) is not TokenSent or event.edge not in self._labels_at[point]:
                return
            try:
                hit = when is None or bool(when(event.token))
            except Exception:
                _LOGGER.exception('the condition of the breakpoint at "%s" failed, so it was removed', point.path)
                point.remove()
                return
            if hit:
                self._hit(point, event.token)

        self._at_edges[point] = self._consumers.add(look)
        return point

    def _labels(self, place: Any) -> list[str]:
        return [edge.label for edge in edges_at(self._engine, place)]

    def _find_again(self, edited: Edited) -> None:
        """Keep breakpoints where they were after an edit; remove those at nodes that are gone (R4)."""
        near = {point for point in self.breakpoints if is_near(point.place, edited.nodes)}
        for point in near:
            point.follow(behind(point.place, edited.swapped))
            if is_gone(point.place):
                self.remove(point)
        for worker, point in self._at_nodes.items():
            self._is_called(point, worker.path)
        for point in near.intersection(self._at_edges):
            labels = self._labels(point.place)
            self._labels_at[point] = frozenset(labels)
            self._is_called(point, _path(point.place, labels) or point.path)

    def _is_called(self, point: Breakpoint, path: str) -> None:
        if self.why == point.path:
            self.why = path
        point.rename(path)

    def remove(self, point: Breakpoint) -> None:
        """Remove a breakpoint."""
        stop_looking = self._at_edges.pop(point, None)
        if stop_looking is not None:
            stop_looking()
            del self._labels_at[point]
        for worker in [worker for worker, found in self._at_nodes.items() if found is point]:
            del self._at_nodes[worker]
            self._waived.discard(worker)
            worker.halt_at(None)

    def _behind(self, point: Breakpoint, step: Callable[[RunningNode], None]) -> Callable[[RunningNode], None]:
        """Return the step of a node with a breakpoint before it."""

        def stop_first(worker: RunningNode) -> None:
            if worker in self._waived or worker.busy or not _next_kind(worker):
                self._waived.discard(worker)
                step(worker)
                return
            self._waived.add(worker)
            worker.group.push(worker)  # back into the queue
            self._hit(point)

        return stop_first

    def _hit(self, point: Breakpoint, token: Token[Any] | None = None) -> None:
        point.was_hit(token)
        self.pause(point.path)
        self._on_hit(point)


def _path(place: Any, labels: Sequence[str]) -> str:
    return str(getattr(place, "path", "") or next(iter(labels), ""))


def _any_works(workers: list[RunningNode]) -> bool:
    """Return whether a step of one of them will end by itself; one that waits for room in a queue (F8) may not."""
    return any(
        (worker.busy or worker.has_concurrent_code()) and not worker.room.waiting and worker.iteration is None
        for worker in workers
    )


def _next_kind(worker: RunningNode) -> str:
    """Return what a node in a run queue would do; "" if the reason is gone, or it is not a firing of a node."""
    if worker.is_boundary_output:
        return ""
    calls = worker.calls
    if worker.fireable and not (calls and worker.calls_before):
        return "firing"
    return "call" if calls and worker.blocked < NO_CALLS else ""
