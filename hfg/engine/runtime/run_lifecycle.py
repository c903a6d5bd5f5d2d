"""The beginning and the end of a run: nodes are set up in order and torn down in reverse order (rules A10, R5, X3).

Depends on `node_lifecycle`, `engine` and `code`.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import anyio

from hfg.engine.executing.asking import speaker
from hfg.engine.executing.code import answer
from hfg.engine.executing.groups import ThreadGroup
from hfg.engine.executing.orphan_tasks import OrphanTasks
from hfg.engine.executing.watchdog import Watch, watchdog
from hfg.engine.model import ConcurrentFiring, Core
from hfg.engine.model.running_node import STARTING, RunningNode
from hfg.engine.rules import node_lifecycle, wiring
from hfg.engine.rules.activity import gate_changed
from hfg.engine.rules.agenda import consider, note_full
from hfg.engine.rules.modifiers import discard
from hfg.engine.rules.sending import trigger
from hfg.engine.runtime import ports as engine_ports
from hfg.engine.runtime.edge_streams import EdgeStreams
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.teardown_limit import TeardownLimit
from hfg.errors import HfgError, NodeError, TeardownError
from hfg.ports.edges import BufferEdge, EventEdge
from hfg.trace import RunEnded, RunStarted

__all__ = ["RunLifecycle"]

_LEAVING_S = 0.1  # how long a teardown that was cancelled may still take before the next one begins


class RunLifecycle:
    """Begins and ends the run of one engine.

    Attributes:
      streams: operators on edges, and observables that feed edges.
      leaving: the teardowns of nodes that an edit took out; the end of the run waits for them.
    """

    def __init__(self, engine: Engine, last: Callable[[], Awaitable[None]]) -> None:
        self._engine = engine
        self._last = last  # what is waited for when everything else is over
        self._limit = TeardownLimit(engine)
        self.leaving: set[asyncio.Task[None]] = set()
        self._was_set_up: dict[RunningNode, None] = {}
        self.streams = EdgeStreams(engine)
        self._watch: Watch | None = None
        self._asking = partial(speaker, engine.core)
        self._lost: OrphanTasks | None = None
        self._of_tasks: list[NodeError] = []  # with what they failed, or that they did not end

    async def start(self) -> None:
        """Set up all nodes, trigger `start`, then let the sources go (A10)."""
        if await self.set_up():
            self.begin()

    async def set_up(self) -> bool:
        """Set up all nodes; whether all went well. Else the run is over."""
        engine = self._engine
        engine.time.begin()
        self._lost = OrphanTasks.notice(engine.loop, self._asking)
        self._watch = watchdog.watch(engine.core, engine.settings.block_warning_s, virtual=engine.virtual)
        return await self._set_up_all(engine.core)

    def begin(self) -> None:
        """All are set up: trigger `start`, then let the sources go."""
        engine = self._engine
        core = engine.core
        if engine.settings.until_s is not None:
            engine.loop.call_at(engine.loop.time() + engine.settings.until_s, self._until)
        engine.moving_since = engine.now()
        if core.trace_changes is not None:
            core.trace_changes(RunStarted(engine.moving_since))
        core.started = True
        self._discard_initial(core)
        self._connect_operators(core)
        for worker in core.workers:  # who holds initial tokens is enabled before `start` lays anything (F9, A10)
            consider(worker)
        assert core.boundary is not None
        start = engine_ports.bind_start(core.boundary, engine.graph.start)
        if start is not None:
            trigger(start, explicit=1)
        self._open_sources(core)
        for source, edge, operators in core.observables:
            self.streams.feed(source, edge, operators)
        for told in engine.callbacks.begun:
            told()
        engine.kick()

    async def _set_up_all(self, core: Core) -> bool:
        """Set up every node in order of adding; whether all went well."""
        engine = self._engine
        for worker in core.workers:
            self.carry(worker)
        for edge in core.edges:
            if isinstance(edge, BufferEdge | EventEdge):
                edge.begin(engine.now())
                if isinstance(edge, EventEdge):
                    note_full(edge)
        for worker in core.workers:
            if worker.scope is None:
                await self._set_up_one(worker)
            if engine.ended_how is not None:
                return False
        for worker in core.workers:
            engine_ports.bind_automatic(worker)
            worker.watch()
            if worker.watched:
                engine_ports.bind(worker)
            wiring.rewire(worker)
        return True

    def _discard_initial(self, core: Core) -> None:
        node_lifecycle.discard_initial(
            edge for edge in core.edges if isinstance(edge, BufferEdge | EventEdge) and edge.initial
        )
        node_lifecycle.end_tasks(core.workers)

    def _connect_operators(self, core: Core) -> None:
        """P9: before anything is triggered; what they give out by themselves is the first of all."""
        for edge, operators in core.piped:
            self.streams.pipe(edge, operators)

    def _open_sources(self, core: Core) -> None:
        """Sources may fire from now on, as far as their gates allow."""
        for worker in core.workers:
            if worker.gates_over and worker.is_source:
                gate_changed(worker.gates_over)
            worker.allow(STARTING)
            consider(worker)

    def carry(self, worker: RunningNode) -> None:
        """Create the dormant task of an async node."""
        if worker.may_wait():
            worker.execution.run_in(self._engine.code.eager_task(worker))

    async def _set_up_one(self, worker: RunningNode) -> None:
        engine = self._engine
        waiter: asyncio.Future[HfgError | None] = engine.loop.create_future()
        self._was_set_up[worker] = None
        try:
            engine.context.run(node_lifecycle.set_up, worker, partial(answer, waiter))
        except KeyboardInterrupt:
            raise
        except BaseException as problem:
            engine.misused(worker, problem, "setup()")
            return
        error = waiter.result() if waiter.done() else await waiter
        if error is not None:
            engine.finish("failed", error)

    def came(self, worker: RunningNode) -> None:
        """A node was set up while the run was in progress (R4)."""
        self._was_set_up[worker] = None

    def went(self, worker: RunningNode) -> None:
        """A node was torn down while the run was in progress (R4)."""
        self._was_set_up.pop(worker, None)

    def _until(self) -> None:
        engine = self._engine
        engine.finish("until", None)

    async def close(self) -> None:
        """Tear everything down, in reverse order of setup, each within its time limit (X3).

        Whoever waits for it may be cancelled: it is then in a hurry, but comes to its end before the cancellation goes
        on.
        """
        closing = asyncio.create_task(self._close(), name="hfg ending")
        cancelled: asyncio.CancelledError | None = None
        try:
            await asyncio.wait({closing})
        except asyncio.CancelledError as error:
            cancelled = error
            self.hurry()
            # A scope of anyio's that is cancelled cancels whatever is awaited in it, again and again, which would keep
            # the loop busy, and a virtual clock from moving on.
            with anyio.CancelScope(shield=True):
                while not closing.done():
                    with suppress(asyncio.CancelledError):
                        await asyncio.wait({closing})
        if cancelled is not None:
            raise cancelled
        closing.result()

    async def _close(self) -> None:
        engine = self._engine
        if engine.ended_how is None:
            engine.finish("cancelled", None)
            self.hurry()
        assert engine.ended_how is not None
        core = engine.core
        outcome, error = engine.ended_how
        problems: list[NodeError] = []
        try:
            self.streams.dispose()
            if self.leaving:
                with self._limit.applied():
                    await asyncio.wait(self.leaving)
            stuck = await self._cancel_code()
            problems += [*stuck.values(), *self._of_tasks]
            for worker in reversed(self._was_set_up):
                problem = await self._tear_down_one(worker) if worker not in stuck else None
                if problem is not None:
                    problems.append(problem)
            for edge in core.edges:
                if edge.untaken and error is None and outcome in ("stopped", "until", "cancelled"):
                    discard(edge, "stopped")
            await self._end_threads()
            await self._end_carriers()
        finally:
            self._let_go()
        core.errors.extend(problems)
        if problems and error is None:
            error, outcome = TeardownError(problems), "failed"
        engine.ended_how = (outcome, error)
        if core.trace_changes is not None:
            core.trace_changes(RunEnded(engine.now(), outcome))
        await self._last()

    def _let_go(self) -> None:
        """Whatever happened: nothing of the run continues, and the graph is free."""
        engine = self._engine
        for worker in engine.core.workers:
            engine_ports.release_ports(worker)
            worker.cancel_timers()
        for eager_task in self._carriers():
            eager_task.drop()
        for group in engine.groups.values():
            if isinstance(group, ThreadGroup):
                group.stop()
        if self._watch is not None:
            watchdog.forget(self._watch)
        if self._lost is not None:
            self._lost.forget(self._asking, lambda worker: worker.core is engine.core)

    def _carriers(self) -> list[Any]:
        engine = self._engine
        eager_tasks = [
            worker.execution.eager_task for worker in engine.core.workers if worker.execution.eager_task is not None
        ]
        for worker in engine.core.workers:
            if worker.concurrent is not None:
                eager_tasks += worker.concurrent.eager_tasks()
        return eager_tasks + list(engine.code.given_up)

    async def _end_carriers(self) -> None:
        """Cancel the remaining tasks once more, with one limit for all of them together; then drop them."""
        eager_tasks = self._carriers()
        if not eager_tasks:
            return
        for eager_task in eager_tasks:
            eager_task.cancel()
        await self._limit.wait_while(lambda: any(eager_task.waiting for eager_task in eager_tasks))
        for eager_task in eager_tasks:
            eager_task.drop()
        await asyncio.wait({eager_task.task for eager_task in eager_tasks})

    def hurry(self) -> None:
        """The user wants to leave: tear down whatever can be torn down in time."""
        self._limit.hurry()

    def leave_now(self) -> None:
        """The user is tired of waiting: stop waiting altogether."""
        self._limit.leave_now()

    async def _cancel_code(self) -> dict[RunningNode, NodeError]:
        """Cancel what still waits; threads get their time to come back. Gives back who did not."""
        code = self._engine.code
        busy = [worker for worker in self._engine.core.workers if worker.execution.in_flight]
        for worker in busy:
            worker.give_up_firing()
            if worker.execution.eager_task is not None:
                worker.execution.eager_task.cancel()
        concurrent = [firing for worker in self._engine.core.workers for firing in worker.concurrent or ()]
        for firing in concurrent:
            firing.end_attempt()
            if firing.eager_task is not None:
                firing.eager_task.cancel()
        for hook in list(code.aside):
            hook.cancel()
        tasks = self._engine.tasks
        tasks.cancel_all()
        begun = time.monotonic()
        if busy or concurrent or tasks.under_way or code.aside:
            await self._limit.wait_while(
                lambda: (
                    bool(tasks.under_way or code.aside)
                    or any(worker.execution.in_flight for worker in busy)
                    or _any_works(concurrent)
                )
            )
        seconds = time.monotonic() - begun
        self._of_tasks = tasks.leave_behind(seconds)
        self._of_tasks += [
            NodeError(worker.path, f"{hook}()", _did_not_end(worker, seconds)) for worker, hook in code.leave_aside()
        ]
        late = [firing for firing in concurrent if firing.working]
        return self._leave_behind([worker for worker in busy if worker.execution.in_flight], late, seconds)

    def _leave_behind(
        self, busy: list[RunningNode], late: list[ConcurrentFiring], seconds: float
    ) -> dict[RunningNode, NodeError]:
        """Wait no more for what does not come back; others of its thread group have their teardown in a new thread."""
        code = self._engine.code
        stuck: dict[RunningNode, str] = {}
        for firing in late:
            code.interrupt(firing.worker, firing=firing)
            stuck.setdefault(firing.worker, f"firing {firing.number}")
        for worker in busy:
            region = worker.region
            amid = region.abandon() if region is not None and region.running else worker
            code.interrupt(worker, amid=amid)
            stuck[amid] = _doing(amid)
        return {worker: NodeError(worker.path, doing, _did_not_end(worker, seconds)) for worker, doing in stuck.items()}

    async def _tear_down_one(self, worker: RunningNode) -> NodeError | None:
        engine = self._engine
        if worker.node is None or not worker.lifecycle.is_up:
            return None
        if worker.execution.generator is None and worker.node._hook("teardown") is None:
            return None
        waiter: asyncio.Future[NodeError | None] = engine.loop.create_future()
        try:
            engine.context.run(node_lifecycle.tear_down, worker, partial(answer, waiter))
        except KeyboardInterrupt:  # meant for this hook, which blocks; the others have their turn
            self.hurry()
            return NodeError(worker.path, "teardown()", "it was interrupted")
        except BaseException as error:
            problem = NodeError(worker.path, "teardown()", error)
            problem.__cause__ = error
            return problem
        if waiter.done():
            return waiter.result()
        begun = time.monotonic()
        with self._limit.applied():
            await asyncio.wait({waiter})
        if waiter.done():
            return waiter.result()
        limit = f"{engine.settings.teardown_limit_s:g}"
        if self._limit.is_shortened:
            limit = f"{time.monotonic() - begun:.1f}"
        engine.code.interrupt(worker)
        if not worker.group.threaded:  # what it still has to do when it is cancelled comes before the next teardown
            with anyio.CancelScope(deadline=self._limit.deadline(min(_LEAVING_S, self._limit.seconds))):
                await asyncio.wait({waiter})
        return NodeError(worker.path, "teardown()", f"it took longer than {limit} s and was given up")

    async def _end_threads(self) -> None:
        """Let idle threads end; those that did not come back were left to themselves, as daemons."""
        for group in self._engine.groups.values():
            for thread in group.stop() if isinstance(group, ThreadGroup) else ():
                while thread.is_alive():
                    await asyncio.sleep(0)
                    thread.join(0.001)


def _any_works(concurrent: Sequence[ConcurrentFiring]) -> bool:
    return any(firing.working for firing in concurrent)


def _doing(worker: RunningNode) -> str:
    if worker.call_edge is not None:
        return f"slot {worker.call_edge.port_name}, call {worker.counts.calls}"
    return f"firing {worker.counts.firings}"


def _did_not_end(worker: RunningNode, seconds: float) -> str:
    if worker.group.threaded:
        return f"its thread did not come back within {seconds:.1f} s of the end and was left behind"
    return f"it was cancelled and did not end within {seconds:.1f} s"
