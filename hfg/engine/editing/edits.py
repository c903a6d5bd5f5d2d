"""Edits of a running graph: commands, undo and redo that take effect between firings (rule R4).

One edit after the other. An edit changes the declared graph, is checked there, and sets up new nodes while all others
keep running. Then the touched nodes are held as they become idle, the plan is changed at one moment, and all continue.
An edit that fails on the way leaves graph and run as they were. Pausing the whole run instead would be simpler, but
then each edit would stop a robot that has nothing to do with it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Collection, Sequence, Set
from functools import partial
from types import ModuleType
from typing import Any

import msgspec

from hfg.base.values import same
from hfg.engine.editing.applying import apply
from hfg.engine.editing.edit_lock import EditLock
from hfg.engine.editing.node_hooks import NodeHooks
from hfg.engine.editing.plan_diff import PlanDiff, diff
from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.editing.quiesce import Quiesced
from hfg.engine.editing.setting import refuse_without_effect
from hfg.engine.model import Scope
from hfg.engine.model.running_node import BACKOFF, DISABLED, RunningNode
from hfg.engine.rules import doing, node_lifecycle, subgraphs
from hfg.engine.runtime.callbacks import Edited
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.run_lifecycle import RunLifecycle
from hfg.errors import GraphError, NotRunning
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
from hfg.graph.flat import flatten
from hfg.graph.structure.membership import write_parameter
from hfg.ports.edges import EventEdge
from hfg.trace import ParameterSet, StructureChanged

__all__ = ["Edits"]

_MAY_CHANGE = ("active", "deadline_s")  # options of an edge that do not concern the tokens on it
_Switched = dict[RunningNode, bool]
"""Nodes and subgraphs, and whether they are enabled or disabled."""


class _Following:
    """One edit, and its state until it takes effect.

    Attributes:
      changes: what was done to the declared graph.
      how: what that means to the plan.
      switched: who is enabled or disabled by it.
      values: parameters that no firing uses yet.
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
      lock: callers of `edit_now`, `undo_now` and `redo_now` hold it, and call `leave` after releasing it.
    """

    def __init__(self, engine: Engine, run_lifecycle: RunLifecycle) -> None:
        self._engine = engine
        self._lifecycle = run_lifecycle
        self._graph: Graph = engine.graph
        self._index: PlanIndex | None = None  # from the first edit on
        self.lock = EditLock()
        self._hooks = NodeHooks(engine, run_lifecycle, self.lock)

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
        """Make one edit after the other; nodes that are gone are torn down after releasing the lock."""
        async with self.lock.one():
            gone = await now()
        await self.leave(gone)

    async def edit_now(self, commands: Sequence[Command]) -> list[RunningNode]:
        """Carry commands out; return the nodes to tear down after releasing the lock."""
        self._need_run()
        what = _told(commands)
        transaction = prepare(self._graph, commands, check=False)
        note = partial(history_of(self._graph).note, transaction)
        return await self._follow(transaction.changes, what, note, check=may_break(commands))

    async def undo(self) -> None:
        """See `Run.undo`."""
        await self._in_turn(self.undo_now)

    async def undo_now(self) -> list[RunningNode]:
        """Take the last edit back; return the nodes to tear down after releasing the lock."""
        self._need_run()
        history = history_of(self._graph)
        changes = undo_all(history.next_undo().changes)
        return await self._follow(changes, "undo", history.undo_done, check=False)

    async def redo(self) -> None:
        """See `Run.redo`."""
        await self._in_turn(self.redo_now)

    async def redo_now(self) -> list[RunningNode]:
        """Carry out the edit that was undone last; return the nodes to tear down after releasing the lock."""
        self._need_run()
        history = history_of(self._graph)
        transaction: Transaction = history.next_redo()
        for change in transaction.changes:
            change.do()
        return await self._follow(transaction.changes, "redo", history.redo_done, check=False)

    async def leave(self, gone: list[RunningNode]) -> None:
        """Tear down nodes that are gone, even if the caller does not wait for it any more."""
        await self._hooks.leave(gone)

    def _need_run(self) -> None:
        if self._engine.core.over:
            raise NotRunning("the run is over: edit the graph with graph.edit(...)")

    # --- following what was done to the declared graph

    async def _follow(
        self, changes: Sequence[Change], what: str, note: Callable[[], None], *, check: bool
    ) -> list[RunningNode]:
        """Bring the run in line with the declared graph; if that fails, undo the changes of the graph.

        Returns:
          The workers that are gone and must be torn down. The next edit does not wait for their teardown.
        """
        engine = self._engine
        edit = _Following(changes)
        engine.quiet.hold()
        try:
            self._find_out(edit, check=check)
            swapped = [worker for worker, _, _ in edit.how.swapped]
            self.lock.wait_for([*swapped, *self._to_start_afresh(edit.switched)], tasks_too=True)
            touched = self._touched(edit)
            self.lock.wait_for(touched)
            await self._hooks.set_up(edit.how.come, edit.come)
            self.lock.wait_for(touched)
            async with Quiesced(engine, touched) as held:
                self.lock.wait_for(())
                await self._hooks.exchange(edit.how.swapped)
                fresh = await self._begin_afresh(edit)
                self._need_run()
                if check:  # undo and redo restore what was there
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
                for worker in edit.fresh:  # it stays disabled: what it sends goes nowhere, and its tasks end (F10)
                    node_lifecycle.take_part(worker)
                self.lock.wait_for(edit.come)
                await self._hooks.to_its_end(self._hooks.tear_down(edit.come))
            raise
        finally:
            engine.quiet.unhold()
        return edit.how.gone

    def _find_out(self, edit: _Following, *, check: bool) -> None:
        """Find what the changes mean to the run; refuse those that no run can follow."""
        for change in edit.changes:
            _refuse_for_good(change)
        if self._index is None:
            self._index = PlanIndex(self._engine.core)
        edit.how = diff(self._graph, self._index, edit.changes)
        if check and edit.how.doubtful:
            self._refuse_errors()
        edit.switched = self._switched(edit.changes)
        edit.values = self._values_of_running_nodes(edit.changes)
        undo_all(edit.values)  # nodes work with the old values until their current firings are over
        edit.copied = [
            (change, dict(change.source._parameters)) for change in edit.changes if isinstance(change, NodeCopied)
        ]
        self._refuse_without_effect(edit)

    async def _begin_afresh(self, edit: _Following) -> list[RunningNode]:
        """Tear down and set up the nodes that are to be enabled, with their new values; return them."""
        fresh = self._to_start_afresh(edit.switched)
        self._refuse_without_effect(edit)
        starting = {worker.node for worker in fresh}
        for value in [value for value in edit.values if value.node in starting]:
            value.do()
            edit.values.remove(value)
        for worker in fresh:
            self.lock.wait_for((worker,))
            await self._hooks.run(worker, node_lifecycle.tear_down)
            worker.lifecycle.wait_to_take_part()
            edit.fresh.append(worker)
            await self._hooks.run(worker, node_lifecycle.set_up)
        return fresh

    def _values_of_running_nodes(self, changes: Sequence[Change]) -> list[ParameterChange]:
        values = [change for change in changes if isinstance(change, ParameterChange)]
        running = {worker.node for worker in self._engine.core.workers} if values else set()
        return [value for value in values if value.node in running]

    def _refuse_without_effect(self, edit: _Following) -> None:
        """Refuse values that running code cannot see (P8), unless this edit starts the node over."""
        if not edit.values:
            return
        how = edit.how
        afresh = {*how.gone, *(worker for worker, _, _ in how.swapped), *self._to_start_afresh(edit.switched)}
        refuse_without_effect(
            [(value.node, value.name) for value in edit.values],
            [worker for worker in self._engine.core.workers if worker not in afresh],
        )

    def _touched(self, edit: _Following) -> list[RunningNode]:
        """Return the nodes that must be idle, including all inside a subgraph that is enabled."""
        scopes = [worker.scope for worker, enabled in edit.switched.items() if worker.scope is not None and enabled]
        return list(dict.fromkeys([*edit.how.touched, *(member for scope in scopes for member in scope.members)]))

    def _refuse_errors(self) -> None:
        """Refuse an edit after which the graph has errors: a running graph has none."""
        refuse_new_errors((), [one for one in check_flat(flatten(self._graph)) if one.severity == "error"])

    def _take_effect(self, edit: _Following) -> None:
        """Change the plan, and tell everything that depends on it. Nothing in here waits."""
        engine, how = self._engine, edit.how
        assert self._index is not None
        new, nodes = apply(engine.core, self._index, self._graph, how, edit.come, engine.groups)
        for edge, flat in new:
            if flat.source.kind == "observable":
                assert isinstance(edge, EventEdge)
                self._lifecycle.streams.feed(flat.source.port, edge, flat.options.through)
            elif flat.options.through:
                assert isinstance(edge, EventEdge)  # others have no operators (P9)
                self._lifecycle.streams.pipe(edge, flat.options.through)
        for edge in how.lost:
            self._lifecycle.streams.forget(edge)
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
        """Return the nodes, then the subgraphs, that are enabled or disabled, and which of the two in the end."""
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
        """Return the nodes to tear down and set up before they are enabled (F10): all takes effect at one moment."""
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


def _take_values(edit: _Following) -> None:
    """Set on a copy the values that were set on the copied node before the edit takes effect."""
    said = {(change.node, change.name) for change in edit.changes if isinstance(change, ParameterChange)}
    for change, before in edit.copied:
        for name, value in change.source._parameters.items():
            copy = change.copy
            if (copy, name) not in said and value is not before[name] and same(copy._parameters[name], before[name]):
                write_parameter(copy, name, value)


def _refuse_for_good(change: Change) -> None:
    """Refuse to change what stays for a whole run: groups, ports of the graph, and how an edge holds tokens."""
    if isinstance(change, PortChange):
        raise GraphError(
            f'the ports of a graph that runs stay as they are, and "{change.port.name}" is one; '
            "edit it when the run is over, with graph.edit(...)"
        )
    if isinstance(change, EdgeSwap):
        old, new = change.old.options, change.new.options
        others = [
            one for one in old.__struct_fields__ if one not in _MAY_CHANGE and getattr(old, one) != getattr(new, one)
        ]
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
    """Return whether a node is disabled and will be enabled (F10); one that is backing off is set up after that."""
    if not worker.blocked & DISABLED or worker.blocked & BACKOFF:
        return False
    meant = worker in on or (worker.own_enabled and not scopes.isdisjoint(worker.around))
    return meant and all(scope.enabled or scope in scopes for scope in worker.around)


def _told(commands: Sequence[Command]) -> str:
    """Return the text for the trace; values that are not data, such as arrays, are shown."""
    try:
        return encode(commands)
    except GraphError:
        return ", ".join(map(repr, commands))
