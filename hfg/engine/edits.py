"""Edits of a graph that runs: commands, undo and redo that take effect between firings (rule R4).

One edit after the other: checked on the drawn graph, new nodes are set up while the others go on, then the touched
nodes are held as they come to rest, the plan is changed at one moment, and all go on. What fails on the way leaves
graph and run as they were. Stands on `reforming` and `lifecycle`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import msgspec

from hfg.engine import lifecycle, plan, subgraphs
from hfg.engine import ports as engine_ports
from hfg.engine.code import answer
from hfg.engine.reforming import reform
from hfg.engine.replanning import Replan, closes_a_ring, replan
from hfg.engine.sending import flush_automatic
from hfg.engine.worker import BACKOFF, DISABLED, ENDED, REMOVED, UNREADY, Worker
from hfg.errors import GraphError, HfgError, NodeError, NotRunning, UsageError
from hfg.graph import Graph
from hfg.graph.changes import Change, NodeSwap, OptionsChange, ParameterChange, undo_all
from hfg.graph.checks import check_flat
from hfg.graph.commands import Command, encode
from hfg.graph.editing import Transaction, history_of, may_break, prepare, refuse_new_errors
from hfg.graph.flat import flatten
from hfg.graph.reloading import reloaded
from hfg.trace import EditWaits, ParameterSet, StructureChanged

if TYPE_CHECKING:
    from hfg.engine.engine import Engine

__all__ = ["Edits"]

_Switched = list[tuple[Worker, bool]]
"""Nodes and subgraphs, and whether they are enabled or disabled."""


class Edits:
    """Edits the graph of one engine."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._graph: Graph = engine.flat.graph
        self._turn = asyncio.Lock()

    async def edit(self, commands: Sequence[Command]) -> None:
        """See `Run.edit`."""
        async with self._turn:
            await self._edit(commands)

    async def reload(self, module: str | ModuleType) -> None:
        """See `Run.reload`."""
        async with self._turn:
            with reloaded(self._graph, module) as commands:
                await self._edit(commands)

    async def _edit(self, commands: Sequence[Command]) -> None:
        self._need_run()
        what = _told(commands)
        transaction = prepare(self._graph, commands, check=False)
        await self._follow(transaction.changes, what, check=may_break(commands))
        history_of(self._graph).note(transaction)

    async def undo(self) -> None:
        """See `Run.undo`."""
        async with self._turn:
            self._need_run()
            history = history_of(self._graph)
            await self._follow(undo_all(history.next_undo().changes), "undo", check=False)
            history.undo_done()

    async def redo(self) -> None:
        """See `Run.redo`."""
        async with self._turn:
            self._need_run()
            history = history_of(self._graph)
            transaction: Transaction = history.next_redo()
            for change in transaction.changes:
                change.do()
            await self._follow(transaction.changes, "redo", check=False)
            history.redo_done()

    def _need_run(self) -> None:
        if self._engine.core.over:
            raise NotRunning("the run is over: edit the graph with graph.edit(...)")

    # --- following what was done to the drawn graph

    async def _follow(self, changes: Sequence[Change], what: str, *, check: bool) -> None:
        """Let the run be as the drawn graph is; if that fails, take back what was done to it."""
        engine = self._engine
        values = [change for change in changes if isinstance(change, ParameterChange)]
        come: list[Worker] = []
        took_effect = False
        engine.hold()
        try:
            how = replan(engine.core, engine.flat, changes)
            if check:
                self._refuse_errors(how)
            switched = self._switched(changes)
            touched = _touched(how, switched)
            _refuse_waiting_for_oneself(touched)
            undo_all(values)  # nodes work with the old values until their firings are over
            await self._set_up(how, come)
            async with _Held(engine, touched) as held:
                await self._exchange_nodes(how)
                fresh = await self._start_afresh(switched)
                self._need_run()
                for value in values:
                    value.do()
                took_effect = held.done = True
                if engine.core.trace is not None:
                    engine.core.trace(StructureChanged(engine.core.now(), what))
                self._switch(switched, fresh)
                self._take_effect(how, come, changes)
        except BaseException:
            if not took_effect:
                undo_all(changes)
                for worker in come:
                    await self._tear_down(worker)
            raise
        finally:
            engine.unhold()
        for worker in how.gone:
            await self._tear_down(worker)

    def _refuse_errors(self, how: Replan) -> None:
        """A graph that runs has no errors, and gets none."""
        if how.whole:
            refuse_new_errors((), [one for one in check_flat(how.flat) if one.severity == "error"])
        elif closes_a_ring(self._engine.core, how.new):
            refuse_new_errors((), [one for one in check_flat(flatten(self._graph)) if one.severity == "error"])

    async def _set_up(self, how: Replan, come: list[Worker]) -> None:
        """Make workers of the nodes that come and set them up, before anybody is held for them."""
        engine = self._engine
        for node in how.come:
            worker = plan.make_worker(engine.core, node, engine.groups)
            come.append(worker)
            engine.lifetime.carry(worker)
            worker.busy = "setup"
            await self._hook(worker, lifecycle.set_up)
            engine.lifetime.came(worker)

    async def _hook(self, worker: Worker, hook: Callable[[Worker, lifecycle.Then], None]) -> None:
        """Run a hook of a node to its end; if the edit is cancelled meanwhile, so is the hook, and waited for.

        Raises:
          NodeError: it failed.
        """
        waiter: asyncio.Future[NodeError | None] = self._engine.loop.create_future()
        hook(worker, partial(answer, waiter))
        cancelled: asyncio.CancelledError | None = None
        while not waiter.done():
            try:
                await asyncio.wait({waiter})
            except asyncio.CancelledError as error:
                if cancelled is not None or self._engine.core.over:
                    raise
                cancelled = error
                if worker.carrier is not None:
                    worker.carrier.cancel()
        if cancelled is not None:
            raise cancelled
        failure = waiter.result()
        if failure is not None:
            raise failure

    async def _exchange_nodes(self, how: Replan) -> None:
        """Tear down the nodes that are replaced and set up the others in their place; back again if that fails."""
        done: list[tuple[Worker, Any]] = []
        for worker, node in how.swapped:
            old = worker.node
            await self._hook(worker, lifecycle.tear_down)
            engine_ports.release_ports(worker)
            done.append((worker, old))
            try:
                await self._become(worker, node)
            except BaseException:
                for changed, before in reversed(done):
                    await self._hook(changed, lifecycle.tear_down)
                    await self._become(changed, before)
                raise
        for worker, _ in done:
            lifecycle.not_ended(worker)
            worker.blocked &= ~(ENDED | UNREADY)

    async def _become(self, worker: Worker, node: Any) -> None:
        if worker.carrier is not None:
            worker.carrier.drop()
            worker.carrier = None
        worker.node = node
        worker.type = type(node)._type
        worker.silent_code = worker.type.is_function
        worker.is_async = worker.type.process_kind.startswith("async")
        node._active = worker.active
        self._engine.lifetime.carry(worker)
        await self._hook(worker, lifecycle.set_up)

    def _take_effect(self, how: Replan, come: list[Worker], changes: Sequence[Change]) -> None:
        """From one moment to the next the run is another."""
        engine = self._engine
        core = engine.core
        engine.flat = how.flat
        for edge, flat in reform(core, how, come, engine.groups):
            if flat.source.kind == "observable":
                engine.lifetime.feed(flat.source.port, edge, flat.through)
            elif flat.through:
                engine.lifetime.pipe(edge, flat.through)
        for edge in how.lost:
            engine.lifetime.forget(edge)
        for worker in how.gone:
            engine.pausing.forget(worker)
        for change in changes:
            if isinstance(change, ParameterChange) and core.trace is not None and change.node._place is not None:
                here = core.by_path.get(change.node._place.path)
                if here is not None and here.node is change.node:
                    core.trace(ParameterSet(core.now(), here.path, change.name, change.after))
        engine.looked_at_anew([worker for worker, _ in how.swapped])
        for worker in come:
            core.upstairs.idle_again(worker)

    def _switched(self, changes: Sequence[Change]) -> _Switched:
        """The nodes, then the subgraphs, that are enabled or disabled, and which of both."""
        if not any(isinstance(change, OptionsChange) for change in changes):
            return []
        by_node = {worker.node: worker for worker in self._engine.core.workers}
        found = []
        for change in changes:
            if isinstance(change, NodeSwap) and change.old in by_node:
                by_node[change.new] = by_node[change.old]
            elif isinstance(change, OptionsChange) and change.before.group == change.after.group:
                worker = by_node.get(change.node)
                if worker is not None:
                    found.append((worker, change.after.enabled))
        return sorted(found, key=lambda one: one[0].scope is not None)

    async def _start_afresh(self, switched: _Switched) -> set[Worker]:
        """Tear down and set up what is going to be enabled (F10), so that it all takes effect at one moment.

        Raises:
          NodeError: one of them failed; they stay disabled.
        """
        on = {worker for worker, enabled in switched if enabled}
        scopes = {worker.scope for worker in on}
        fresh: set[Worker] = set()
        for worker in self._engine.core.workers if on else ():
            meant = worker in on or (worker.own_enabled and not scopes.isdisjoint(worker.around))
            if not meant or worker.scope is not None or not worker.blocked & DISABLED or worker.blocked & BACKOFF:
                continue
            if all(scope.enabled or scope in scopes for scope in worker.around):
                await self._hook(worker, lifecycle.tear_down)
                await self._hook(worker, lifecycle.set_up)
                fresh.add(worker)
        return fresh

    def _switch(self, switched: _Switched, fresh: set[Worker]) -> None:
        """Enable and disable nodes and subgraphs (F10)."""
        for worker, enabled in switched:
            self._note_options(worker, enabled)
            if worker.scope is not None and enabled:
                subgraphs.enable_scope(worker.scope, _nothing, fresh)
            elif worker.scope is not None:
                subgraphs.disable_scope(worker.scope)
            elif enabled:
                lifecycle.enable(worker, _nothing, fresh=worker in fresh)
            else:
                lifecycle.disable(worker)

    def _note_options(self, worker: Worker, enabled: bool) -> None:
        flat = self._engine.flat
        for node in flat.nodes:
            if node.node is worker.node:
                worker.options = node.options = msgspec.structs.replace(node.options, enabled=enabled)
        for scope in flat.scopes:
            if scope.subgraph is worker.node:
                scope.options = msgspec.structs.replace(scope.options, enabled=enabled)

    async def _tear_down(self, worker: Worker) -> None:
        """A node that is gone closes what it has opened; if it fails, that is told with the other errors (X3)."""
        engine = self._engine
        for name in ("rate_timer", "limit_timer", "active_timer", "backoff_timer"):
            timer = getattr(worker, name)
            if timer is not None:
                timer.cancel()
                setattr(worker, name, None)
        try:
            await self._hook(worker, lifecycle.tear_down)
        except HfgError as error:
            engine.core.errors.append(error)
        engine_ports.release_ports(worker)
        engine.lifetime.forget(worker)
        if worker.carrier is not None:
            worker.carrier.drop()


def _refuse_waiting_for_oneself(touched: Sequence[Worker]) -> None:
    """Code of a node may edit the graph, but not wait for the end of its own firing."""
    task = asyncio.current_task()
    for worker in touched:
        if worker.carrier is not None and worker.carrier.task is task:
            raise UsageError(
                f'"{worker.path}" edits itself in the middle of a firing and would wait for the end of that for ever: '
                "do it in a task, asyncio.create_task(run.edit(...))"
            )


def _touched(how: Replan, switched: _Switched) -> list[Worker]:
    """Those who must rest: also all inside a subgraph that is enabled."""
    scopes = [worker.scope for worker, enabled in switched if worker.scope is not None and enabled]
    return list(dict.fromkeys([*how.touched, *(member for scope in scopes for member in scope.members)]))


def _told(commands: Sequence[Command]) -> str:
    """What the trace says; a parameter may have a value that is no data, an array, and is shown then."""
    try:
        return encode(commands)
    except GraphError:
        return ", ".join(map(repr, commands))


class _Held:
    """Holds nodes as they come to rest; inside the block all of them rest.

    Attributes:
      done: the edit has taken effect; else it was given up.
    """

    def __init__(self, engine: Engine, workers: Sequence[Worker]) -> None:
        self._engine = engine
        self._workers = workers
        self._letting_go: list[Callable[[], None]] = []
        self._given_up = False
        self.done = False
        self._said = False  # that it waits
        self._counts = False  # among what is in flight

    async def __aenter__(self) -> _Held:
        engine = self._engine
        core = engine.core
        waiter: asyncio.Future[None] = engine.loop.create_future()
        left = [len(self._workers)]

        def rests(worker: Worker, over: Callable[[], None]) -> None:
            if self._given_up:
                over()
                return
            worker.busy = "edit"
            self._letting_go.append(over)
            left[0] -= 1
            if not left[0]:
                if self._said:  # until we have our turn it is not quiet, or queues would grow (F8)
                    core.in_flight += 1
                    self._counts = True
                answer(waiter, None)

        for worker in self._workers:
            lifecycle.when_idle(worker, rests, _nothing)
        if left[0]:
            self._said = True
            if core.trace is not None:
                core.trace(EditWaits(core.now(), tuple(worker.path for worker in self._workers)))
            try:
                await self._or_end(waiter)
            except BaseException:
                self._let_go()
                raise
        return self

    async def _or_end(self, waiter: asyncio.Future[None]) -> None:
        """Wait until all rest, or the run is over."""
        engine = self._engine
        ending = asyncio.ensure_future(engine.ending.wait())
        try:
            await asyncio.wait((waiter, ending), return_when=asyncio.FIRST_COMPLETED)
        finally:
            ending.cancel()
            engine.core.in_flight -= self._counts
            self._counts = False
        if engine.core.over:
            raise NotRunning("the run ended before the edit could take effect; the graph is as it was")

    async def __aexit__(self, *_: object) -> None:
        self._let_go()

    def _let_go(self) -> None:
        core = self._engine.core
        self._given_up = True
        if not self.done and self._said and core.trace is not None and not core.over:
            core.trace(StructureChanged(core.now(), ""))
        for worker in self._workers if self.done else ():
            if not worker.blocked & REMOVED:
                flush_automatic(worker)  # what activity that went back has raised (A8, A9)
        letting_go, self._letting_go = self._letting_go, []
        for over in letting_go:
            over()
        self._engine.kick()


def _nothing() -> None:
    """Nobody waits for it."""
