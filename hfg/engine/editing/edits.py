"""Edits of a graph that runs: commands, undo and redo that take effect between firings (rule R4).

One edit after the other: checked on the drawn graph, new nodes are set up while the others go on, then the touched
nodes are held as they come to rest, the plan is changed at one moment, and all go on. What fails on the way leaves
graph and run as they were. Stands on `plan_diff`, `applying` and `node_lifecycle`.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Collection, Coroutine, Iterable, Sequence, Set
from functools import partial
from types import ModuleType
from typing import Any

import msgspec

from hfg.base.values import same
from hfg.engine.editing.applying import apply
from hfg.engine.editing.edit_lock import EditLock
from hfg.engine.editing.plan_diff import PlanDiff, diff
from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.editing.quiesce import Quiesced
from hfg.engine.editing.setting import refuse_without_effect
from hfg.engine.executing.code import answer, whose_code
from hfg.engine.model import Scope
from hfg.engine.model.running_node import BACKOFF, DISABLED, ENDED, UNREADY, RunningNode
from hfg.engine.rules import concurrency, doing, node_lifecycle, subgraphs
from hfg.engine.runtime import plan
from hfg.engine.runtime import ports as engine_ports
from hfg.engine.runtime.callbacks import Edited
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.run_lifecycle import RunLifecycle
from hfg.errors import GraphError, HfgError, NodeError, NotRunning
from hfg.graph import Graph
from hfg.graph.checks import check_flat
from hfg.graph.editing import Transaction, history_of, may_break, prepare, refuse_new_errors
from hfg.graph.editing.changes import (
    Change,
    EdgeSwap,
    GroupsChange,
    NodeCopied,
    NodeSwap,
    OptionsChange,
    ParameterChange,
    PortChange,
    undo_all,
)
from hfg.graph.editing.commands import Command, encode
from hfg.graph.editing.reloading import reloaded
from hfg.graph.flat import FlatNode, flatten
from hfg.graph.structure.membership import write_parameter
from hfg.graph.structure.places import node_place
from hfg.trace import ParameterSet, StructureChanged

__all__ = ["Edits"]

_Switched = dict[RunningNode, bool]
"""Nodes and subgraphs, and whether they are enabled or disabled."""


class _Following:
    """One edit, and what is known of it on its way into the run.

    Attributes:
      changes: what was done to the drawn graph.
      how: what that means to the plan.
      switched: who is enabled or disabled by it.
      values: parameters with which nobody works yet.
      copied: of each copy that it makes what it is a copy of, and what the parameters of that were then.
      come: new nodes, of which the setup has begun.
      fresh: nodes that are enabled by it, whose second setup has begun.
      took_effect: from here on nothing is taken back.
    """

    def __init__(self, changes: Sequence[Change]) -> None:
        self.changes = changes
        self.how = PlanDiff()
        self.switched: _Switched = {}
        self.values: list[ParameterChange] = []
        self.copied: list[tuple[NodeCopied, dict[str, Any]]] = []
        self.come: list[RunningNode] = []
        self.fresh: list[RunningNode] = []
        self.took_effect = False


class Edits:
    """Edits the graph of one engine.

    Attributes:
      turns: whoever calls one of `edit_now`, `undo_now` and `redo_now` has a turn, and calls `leave` behind it.
    """

    def __init__(self, engine: Engine, run_lifecycle: RunLifecycle) -> None:
        self._engine = engine
        self._lifecycle = run_lifecycle
        self._graph: Graph = engine.graph
        self._index: PlanIndex | None = None  # from the first edit on
        self.lock = EditLock()

    async def edit(self, commands: Sequence[Command]) -> None:
        """See `Run.edit`."""
        await self._in_turn(partial(self.edit_now, commands))

    async def reload(self, module: str | ModuleType) -> None:
        """See `Run.reload`."""
        await self._in_turn(partial(self._reload_now, module))

    async def _reload_now(self, module: str | ModuleType) -> list[RunningNode]:
        with reloaded(self._graph, module) as commands:
            return await self.edit_now(commands)

    async def _in_turn(self, now: Callable[[], Awaitable[list[RunningNode]]]) -> None:
        """One edit after the other; those who are gone are torn down behind the turn."""
        async with self.lock.one():
            gone = await now()
        await self.leave(gone)

    async def edit_now(self, commands: Sequence[Command]) -> list[RunningNode]:
        """Carry commands out; gives who is to be torn down behind the turn."""
        self._need_run()
        what = _told(commands)
        transaction = prepare(self._graph, commands, check=False)
        note = partial(history_of(self._graph).note, transaction)
        return await self._follow(transaction.changes, what, note, check=may_break(commands))

    async def undo(self) -> None:
        """See `Run.undo`."""
        await self._in_turn(self.undo_now)

    async def undo_now(self) -> list[RunningNode]:
        """Take the last edit back; gives who is to be torn down behind the turn."""
        self._need_run()
        history = history_of(self._graph)
        changes = undo_all(history.next_undo().changes)
        return await self._follow(changes, "undo", history.undo_done, check=False)

    async def redo(self) -> None:
        """See `Run.redo`."""
        await self._in_turn(self.redo_now)

    async def redo_now(self) -> list[RunningNode]:
        """Carry out again what was undone last; gives who is to be torn down behind the turn."""
        self._need_run()
        history = history_of(self._graph)
        transaction: Transaction = history.next_redo()
        for change in transaction.changes:
            change.do()
        return await self._follow(transaction.changes, "redo", history.redo_done, check=False)

    def _need_run(self) -> None:
        if self._engine.core.over:
            raise NotRunning("the run is over: edit the graph with graph.edit(...)")

    # --- following what was done to the drawn graph

    async def _follow(
        self, changes: Sequence[Change], what: str, note: Callable[[], None], *, check: bool
    ) -> list[RunningNode]:
        """Let the run be as the drawn graph is, and note that; if it fails, take back what was done to the graph.

        Returns:
          the workers that are gone and have yet to be torn down, for which the next edit does not wait.
        """
        engine = self._engine
        edit = _Following(changes)
        engine.hold()
        try:
            self._find_out(edit, check=check)
            torn_down = [*(worker for worker, _, _ in edit.how.swapped), *self._to_start_afresh(edit.switched)]
            self.lock.wait_for(torn_down, tasks_too=True)
            touched = self._touched(edit)
            self.lock.wait_for(touched)
            await self._set_up(edit)
            self.lock.wait_for(touched)
            async with Quiesced(engine, touched) as held:
                self.lock.wait_for(())
                await self._exchange_nodes(edit.how)
                fresh = await self._begin_afresh(edit)
                self._need_run()
                if check:  # what is done again is as it was
                    _take_values(edit)
                for value in edit.values:
                    value.do()
                edit.took_effect = held.done = True
                note()
                if engine.core.trace_changes is not None:
                    engine.core.trace_changes(StructureChanged(engine.core.now(), what))
                self._switch(edit.switched, fresh)
                self._take_effect(edit)
        except BaseException:
            if not edit.took_effect:
                undo_all([change for change in changes if change not in edit.values])
                _stay_disabled(edit.fresh)
                self.lock.wait_for(edit.come)
                await self._to_its_end(self._tear_down(edit.come))
            raise
        finally:
            engine.unhold()
        return edit.how.gone

    def _find_out(self, edit: _Following, *, check: bool) -> None:
        """What the changes mean to the run; what no run can follow is refused."""
        for change in edit.changes:
            _refuse_for_good(change)
        if self._index is None:
            self._index = PlanIndex(self._engine.core)
        edit.how = diff(self._graph, self._index, edit.changes)
        if check and edit.how.doubtful:
            self._refuse_errors()
        edit.switched = self._switched(edit.changes)
        edit.values = self._values_of_running_nodes(edit.changes)
        undo_all(edit.values)  # they work with the old ones until their firings are over
        edit.copied = [
            (change, dict(change.source._parameters)) for change in edit.changes if isinstance(change, NodeCopied)
        ]
        self._refuse_without_effect(edit)

    async def _begin_afresh(self, edit: _Following) -> list[RunningNode]:
        """Tear down and set up who is to be enabled, with its new values; gives them back."""
        fresh = self._to_start_afresh(edit.switched)
        self._refuse_without_effect(edit)
        starting = {worker.node for worker in fresh}
        for value in [value for value in edit.values if value.node in starting]:
            value.do()
            edit.values.remove(value)
        for worker in fresh:
            self.lock.wait_for((worker,))
            await self._hook(worker, node_lifecycle.tear_down)
            worker.lifecycle.wait_to_take_part()
            edit.fresh.append(worker)
            await self._hook(worker, node_lifecycle.set_up)
        return fresh

    def _values_of_running_nodes(self, changes: Sequence[Change]) -> list[ParameterChange]:
        values = [change for change in changes if isinstance(change, ParameterChange)]
        running = {worker.node for worker in self._engine.core.workers} if values else set()
        return [value for value in values if value.node in running]

    def _refuse_without_effect(self, edit: _Following) -> None:
        """P8: what the code that runs cannot see is refused, unless the node begins afresh by this very edit."""
        if not edit.values:
            return
        how = edit.how
        afresh = {*how.gone, *(worker for worker, _, _ in how.swapped), *self._to_start_afresh(edit.switched)}
        refuse_without_effect(
            [(value.node, value.name) for value in edit.values],
            [worker for worker in self._engine.core.workers if worker not in afresh],
        )

    def _touched(self, edit: _Following) -> list[RunningNode]:
        """Those who must rest: also all inside a subgraph that is enabled."""
        scopes = [worker.scope for worker, enabled in edit.switched.items() if worker.scope is not None and enabled]
        return list(dict.fromkeys([*edit.how.touched, *(member for scope in scopes for member in scope.members)]))

    def _refuse_errors(self) -> None:
        """A graph that runs has no errors, and gets none."""
        refuse_new_errors((), [one for one in check_flat(flatten(self._graph)) if one.severity == "error"])

    async def _set_up(self, edit: _Following) -> None:
        """Make workers of the nodes that come and set them up, before anybody is held for them."""
        engine = self._engine
        for node in sorted(edit.how.come, key=node_place):
            said = FlatNode(0, node._place.path, node, edit.how.come[node], ())
            worker = plan.make_worker(engine.core, said, engine.groups)
            edit.come.append(worker)
            self._lifecycle.carry(worker)
            worker.be_busy("setup")
            self.lock.wait_for((worker,))
            worker.lifecycle.wait_to_take_part()
            await self._hook(worker, node_lifecycle.set_up)
            self._lifecycle.came(worker)

    async def _hook(self, worker: RunningNode, hook: Callable[[RunningNode, node_lifecycle.Then], None]) -> None:
        """Run a hook of a node to its end; if the edit is cancelled meanwhile, so is the hook, and waited for.

        Raises:
          NodeError: it failed.
        """
        waiter: asyncio.Future[NodeError | None] = self._engine.loop.create_future()
        begin = partial(hook, worker, partial(answer, waiter))
        if whose_code() is None:
            self._engine.context.run(begin)
        else:  # the code of a node asks, which runs inside of that context
            self._engine.soon(partial(self._engine.guard, begin))
        cancelled: asyncio.CancelledError | None = None
        while not waiter.done():
            try:
                await asyncio.wait({waiter})
            except asyncio.CancelledError as error:
                if cancelled is not None or self._engine.core.over:
                    raise
                cancelled = error
                if worker.execution.eager_task is not None:
                    worker.execution.eager_task.cancel()
        if cancelled is not None:
            raise cancelled
        failure = waiter.result()
        if failure is not None:
            raise failure

    async def _to_its_end(self, clearing: Coroutine[Any, Any, None]) -> None:
        """Clear up after an edit that failed or was cancelled, however often it is cancelled."""
        task = asyncio.create_task(clearing, name="hfg edit")
        while not task.done():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.wait({task})
        task.result()

    async def _exchange_nodes(self, how: PlanDiff) -> None:
        """Tear down the nodes that are replaced and set up the others in their place; back again if that fails."""
        begun: list[tuple[RunningNode, Any]] = []
        try:
            for worker, _, node in how.swapped:
                begun.append((worker, worker.node))
                await self._become(worker, node)
        except BaseException:
            await self._to_its_end(self._become_again(begun))
            raise
        for worker, _ in begun:
            worker.start_over()
            worker.allow(ENDED | UNREADY)

    async def _become_again(self, begun: list[tuple[RunningNode, Any]]) -> None:
        """Put the nodes back that were to be replaced; one that cannot be set up again ends the run."""
        for worker, before in reversed(begun):
            try:
                await self._become(worker, before)
            except HfgError as error:
                self._engine.finish("failed", error)
            else:
                node_lifecycle.take_part(worker)
                doing.afresh(worker)

    async def _become(self, worker: RunningNode, node: Any) -> None:
        """Let a worker run another node: teardown, setup. A teardown that fails is told with the other errors (X3)."""
        self.lock.wait_for((worker,))
        try:
            await self._hook(worker, node_lifecycle.tear_down)
        except NodeError as error:
            self._engine.core.errors.append(error)
        engine_ports.release_ports(worker)
        if worker.execution.eager_task is not None:
            worker.execution.eager_task.drop()
            worker.execution.run_in(None)
        if worker.concurrent is not None:
            concurrency.abandon(worker)
            worker.concurrent.drop_eager_tasks()
        worker.take_node(node)
        worker.show_activity()
        self._lifecycle.carry(worker)
        worker.lifecycle.wait_to_take_part()
        await self._hook(worker, node_lifecycle.set_up)

    def _take_effect(self, edit: _Following) -> None:
        """From one moment to the next the run is another."""
        engine, how = self._engine, edit.how
        assert self._index is not None
        new, nodes = apply(engine.core, self._index, self._graph, how, edit.come, engine.groups)
        node_lifecycle.end_tasks(edit.come)
        for edge, flat in new:
            if flat.source.kind == "observable":
                self._lifecycle.feed(flat.source.port, edge, flat.options.through)
            elif flat.options.through:
                self._lifecycle.pipe(edge, flat.options.through)
        for edge in how.lost:
            self._lifecycle.forget(edge)
        self._tell_parameters(edit.changes)
        for worker in (*edit.come, *(worker for worker, _, _ in how.swapped)):
            node_lifecycle.take_part(worker)
        swapped = {change.old: change.new for change in edit.changes if isinstance(change, NodeSwap)}
        edited = Edited([worker for worker, _, _ in how.swapped], swapped, nodes)
        for find_again in engine.callbacks.edited:
            find_again(edited)
        for worker in edited.workers:
            doing.afresh(worker)
        for worker in edit.come:
            engine.core.rules.idle_again(worker)
        if engine.settings.check_all:
            engine.check_invariants()

    def _tell_parameters(self, changes: Sequence[Change]) -> None:
        core = self._engine.core
        for change in changes if core.trace_changes is not None else ():
            if isinstance(change, ParameterChange) and change.node._place is not None:
                here = core.by_path.get(change.node._place.path)
                if here is not None and here.node is change.node and core.trace_changes is not None:
                    core.trace_changes(ParameterSet(core.now(), here.path, change.name, change.after))

    def _switched(self, changes: Sequence[Change]) -> _Switched:
        """The nodes, then the subgraphs, that are enabled or disabled, and which of both in the end."""
        if not any(isinstance(change, OptionsChange) for change in changes):
            return {}
        assert self._index is not None
        by_node = self._index.by_node
        swapped: dict[Any, RunningNode] = {}
        found: _Switched = {}
        for change in changes:
            if isinstance(change, NodeSwap):
                taken_over = swapped.get(change.old) or by_node.get(change.old)
                if taken_over is not None:
                    swapped[change.new] = taken_over
            elif isinstance(change, OptionsChange) and change.before.group == change.after.group:
                worker = swapped.get(change.node) or by_node.get(change.node)
                if worker is not None:
                    found[worker] = change.after.enabled
        return dict(sorted(found.items(), key=lambda one: one[0].scope is not None))

    def _to_start_afresh(self, switched: _Switched) -> list[RunningNode]:
        """Whom to tear down and set up before they are enabled (F10), so that it all takes effect at one moment."""
        on = {worker for worker, enabled in switched.items() if enabled}
        scopes = {worker.scope for worker in on}
        inside = {member for scope in scopes if scope is not None for member in scope.members}
        assert self._index is not None
        there = sorted((worker for worker in on | inside if worker.scope is None), key=self._index.leaves.label)
        return [worker for worker in there if _is_to_begin(worker, on, scopes)]

    def _switch(self, switched: _Switched, fresh: Collection[RunningNode]) -> None:
        """Enable and disable nodes and subgraphs (F10)."""
        for worker, enabled in switched.items():
            self._note_options(worker, enabled)
            if worker.scope is not None and enabled:
                subgraphs.enable_scope(worker.scope, node_lifecycle.nothing, fresh)
            elif worker.scope is not None:
                subgraphs.disable_scope(worker.scope)
            elif enabled:
                node_lifecycle.enable(worker, node_lifecycle.nothing, fresh=worker in fresh)
            else:
                node_lifecycle.disable(worker)

    def _note_options(self, worker: RunningNode, enabled: bool) -> None:
        if worker.options is not None:
            worker.set_options(msgspec.structs.replace(worker.options, enabled=enabled))

    async def leave(self, gone: list[RunningNode]) -> None:
        """Nodes that are gone are torn down, also if nobody waits for that any more."""
        if not gone:
            return
        task = asyncio.create_task(self._tear_down(gone), name="hfg edit")
        self._lifecycle.leaving.add(task)
        task.add_done_callback(self._lifecycle.leaving.discard)
        await asyncio.shield(task)

    async def _tear_down(self, workers: Iterable[RunningNode]) -> None:
        """Let nodes that are gone close what they have opened; if that fails, it is told with other errors (X3)."""
        engine = self._engine
        for worker in workers:
            worker.cancel_timers()
        for worker in workers:
            try:
                await self._hook(worker, node_lifecycle.tear_down)
            except HfgError as error:
                engine.core.errors.append(error)
            engine_ports.release_ports(worker)
            self._lifecycle.forget(worker)
            if worker.execution.eager_task is not None:
                worker.execution.eager_task.drop()
            if worker.concurrent is not None:
                concurrency.abandon(worker)
                worker.concurrent.drop_eager_tasks()


def _take_values(edit: _Following) -> None:
    """A copy has the values that its model has as the edit takes effect, if they were set since it was asked for."""
    said = {(change.node, change.name) for change in edit.changes if isinstance(change, ParameterChange)}
    for change, before in edit.copied:
        for name, value in change.source._parameters.items():
            copy = change.copy
            if (copy, name) not in said and value is not before[name] and same(copy._parameters[name], before[name]):
                write_parameter(copy, name, value)


def _stay_disabled(fresh: Iterable[RunningNode]) -> None:
    """Nodes that were set up to be enabled, and are not: what they send goes nowhere, and their tasks end (F10)."""
    for worker in fresh:
        node_lifecycle.take_part(worker)
        node_lifecycle.end_tasks((worker,))


def _refuse_for_good(change: Change) -> None:
    """Refuse what a run has from beginning to end: its groups, the ports of the whole, what an edge holds.

    Raises:
      GraphError: it is such a change.
    """
    if isinstance(change, PortChange):
        raise GraphError(
            f'the ports of a graph that runs stay as they are, and "{change.port.name}" is one; '
            "edit it when the run is over, with graph.edit(...)"
        )
    if isinstance(change, EdgeSwap):
        old, new = change.old.options, change.new.options
        others = [one for one in old.__struct_fields__ if one != "active" and getattr(old, one) != getattr(new, one)]
        if others:
            raise GraphError(
                f'"{change.new.label}" keeps its {others[0]} while the graph runs, for tokens may lie on it; '
                "Disconnect and Connect it in one edit, which drops them, or edit it when the run is over"
            )
    if isinstance(change, GroupsChange):
        before, after = change.before[0], change.after[0]
        name = next((name for name in {**before, **after} if before.get(name) != after.get(name)), None)
        if name is not None:
            raise GraphError(
                f'the groups of a graph that runs stay as they are, and "{name}" would be another; '
                "declare all that you need before the run, and let nodes move between them with Move"
            )


def _is_to_begin(worker: RunningNode, on: Collection[RunningNode], scopes: Set[Scope | None]) -> bool:
    """Whether it is off and will be on, with all around it (F10); in a back-off it is set up when that is over."""
    if not worker.blocked & DISABLED or worker.blocked & BACKOFF:
        return False
    meant = worker in on or (worker.own_enabled and not scopes.isdisjoint(worker.around))
    return meant and all(scope.enabled or scope in scopes for scope in worker.around)


def _told(commands: Sequence[Command]) -> str:
    """What the trace says; a parameter may have a value that is no data, an array, and is shown then."""
    try:
        return encode(commands)
    except GraphError:
        return ", ".join(map(repr, commands))
