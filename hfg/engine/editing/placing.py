"""The nodes of a plan after an edit: who leaves, who takes whose place, and where each one belongs (rules R4, G1).

Afterwards nodes and subgraphs are in the order in which a new plan would have them. All that changes place is taken out
before anything is put in, because places are found by comparison with neighbours that are already right.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Mapping
from typing import Any

from hfg.engine.editing.plan_diff import PlanDiff
from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.model import Core, Group, Scope
from hfg.engine.model.running_node import DISABLED, RunningNode
from hfg.engine.rules.releasing import release
from hfg.engine.runtime import plan
from hfg.graph import Graph
from hfg.graph.flat import Scope as FlatScope
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.places import node_place
from hfg.ports.edges import AnyEdge, EventEdge

__all__ = ["Placing", "by_index"]


class Placing:
    """Takes nodes and subgraphs out of a plan, and puts them where a new plan would have them."""

    def __init__(
        self,
        core: Core,
        index: PlanIndex,
        graph: Graph,
        found: PlanDiff,
        come: list[RunningNode],
        groups: Mapping[str, Group],
    ) -> None:
        self.core = core
        self.index = index
        self.graph = graph
        self.found = found
        self.come = come
        self.groups = groups
        self.touched: dict[RunningNode, None] = {}  # their wiring is derived again
        self.elsewhere: dict[RunningNode, None] = {}  # they are in other subgraphs than before
        self.refitted = {worker for worker, _, _ in found.swapped}
        self.scopes: dict[Scope, None] = {}  # something in them has changed
        self.named: list[Any] = []  # edges that have another label now
        self.new_edges: list[Any] = []

    # --- what goes

    def leave(self) -> None:
        """Take lost edges and nodes out of the plan; the tokens on the edges stay there until all is in place."""
        found = self.found
        for key, edge in list(self.core.outside.items()) if found.gone or found.boxes_gone else ():
            if edge.target in found.gone or edge.target in found.boxes_gone:
                del self.core.outside[key]
                self.core.edges.remove(edge)
                found.lost.append(edge)
        for edge in found.lost:
            edge.enliven(False)
            plan.unwire(edge)
            self.touch_ends(edge)
        for worker in found.gone:
            worker.leave_plan()

    # --- nodes

    def swap(self) -> None:
        """Let workers run the nodes that replace theirs; `connect` leads the edges to them."""
        index = self.index
        lost = set(self.found.lost)
        for edge in (*self.found.old, *(self.core.outside.values() if self.refitted else ())):
            if self.is_refitted(edge) and edge not in lost:
                plan.unwire(edge)
        for worker, old, node in self.found.swapped:
            index.order.swap(old, node)
            del index.by_node[old]
            index.by_node[node] = worker
            self._list_source(worker, False)
            worker.fit(node)
            self._list_source(worker, worker.is_source)
            self.touched[worker] = None

    def touch_ends(self, edge: AnyEdge) -> None:
        """Derive the wiring of the nodes at both ends of an edge again."""
        self.touched |= {edge.source: None, edge.target: None}

    def is_refitted(self, edge: AnyEdge) -> bool:
        """Return whether a node at an end of an edge was replaced."""
        return edge.source in self.refitted or edge.target in self.refitted

    def place(self) -> None:
        """Put all nodes where a new plan would have them."""
        found = self.found
        self._take_all_out()
        for worker in (*found.renamed, *found.placed, *found.boxes_placed):
            worker.rename(worker.node._place.path)
        for worker in self.come:  # nodes inside a subgraph that iterates look for it
            self.index.by_node[worker.node] = worker
        boxes = {worker.node: worker for worker in found.boxes_placed} | dict.fromkeys(found.boxes_come)
        for box in sorted(boxes, key=node_place):
            self._put_in_scope(box, boxes[box])
        for worker in sorted((*found.placed, *self.come), key=lambda worker: node_place(worker.node)):
            self._put_in(worker)
        for worker in found.renamed:
            self._rename(worker)
        for worker, options in found.options:
            self._regroup(worker, options)
        for worker in self.come:
            if not worker.own_enabled or any(not scope.enabled for scope in worker.around):
                worker.block(DISABLED)
        self.touched |= self.elsewhere

    def _take_all_out(self) -> None:
        """Take out all that goes, and for the moment all that changes place."""
        core, index, found = self.core, self.index, self.found
        for scope in (worker.scope for worker in found.boxes_gone):
            assert scope is not None
            for member in scope.members if not scope.enabled else ():
                member.enable_itself(False)  # without the subgraph they stay disabled (G1)
        for worker in (*found.gone, *found.placed):
            self._take_out(worker)
        for border in [worker.iteration for worker in found.gone if worker.iteration is not None]:
            for outside in (*border.feeds, *border.readers):
                core.workers.remove(outside)
        for worker in (*found.boxes_gone, *found.boxes_placed):
            self._take_out_scope(worker)
        for worker in (*found.gone, *found.boxes_gone):
            del index.by_node[worker.node]
            index.order.forget(worker.node)
        for worker in (*found.gone, *found.boxes_gone, *found.renamed):
            if core.by_path.get(worker.path) is worker:
                del core.by_path[worker.path]

    def _take_out(self, worker: RunningNode) -> None:
        core, index = self.core, self.index
        label = index.leaves.label
        for scope in worker.around:
            del scope.members[bisect_left(scope.members, label(worker), key=label)]
            self.scopes[scope] = None
        self._list_source(worker, False)
        del core.workers[index.leaves.remove(worker)]
        if worker.within is not None:
            worker.within.leave(worker)

    def _put_in(self, worker: RunningNode) -> None:
        core, index = self.core, self.index
        place = node_place(worker.node)
        position = bisect_left(index.leaves.items, place, key=lambda one: node_place(one.node))
        index.leaves.insert(position, worker)
        core.workers.insert(position, worker)
        index.by_node[worker.node] = core.by_path[worker.path] = worker
        around = self._around(worker.node)
        label = index.leaves.label
        for scope in around:
            insort(scope.members, worker, key=label)
            self.scopes[scope] = None
        self._list_source(worker, worker.is_source)
        worker.enclose(around)
        self._join(worker)
        self.elsewhere[worker] = None

    def _join(self, worker: RunningNode) -> None:
        """Let the nearest subgraph around a node that iterates know it, if there is one (G4)."""
        level: Level | None = level_of(worker.node._place.graph)
        while level is not None and level.owner is not None:
            around = self.index.by_node[level.owner]
            if around.iteration is not None:
                around.iteration.join(worker)
                return
            level = level.around

    def _list_source(self, worker: RunningNode, is_one: bool) -> None:
        """Put a worker into the list of sources, or take it out."""
        sources, label = self.core.sources, self.index.leaves.label
        position = bisect_left(sources, label(worker), key=label)
        listed = position < len(sources) and sources[position] is worker
        if listed and not is_one:
            del sources[position]
        elif is_one and not listed:
            sources.insert(position, worker)

    def _around(self, node: Any) -> tuple[Scope, ...]:
        scope = self._scope_around(node)
        return () if scope is None else scope.and_around()

    def _scope_around(self, node: Any) -> Scope | None:
        """Return the scope of the subgraph directly around a node; one that iterates has none (G4)."""
        owner = level_of(node._place.graph).owner
        return None if owner is None else self.index.by_node[owner].scope

    def _take_out_scope(self, worker: RunningNode) -> None:
        core, index, scope = self.core, self.index, worker.scope
        assert scope is not None
        if scope.parent is not None:
            scope.parent.children.remove(scope)
            self.scopes[scope.parent] = None
        position = index.scopes.remove(worker)
        del core.scopes[position], core.workers[len(index.leaves.items) + position]
        if worker.within is not None:
            worker.within.leave(worker)

    def _put_in_scope(self, box: Any, worker: RunningNode | None) -> None:
        core, index = self.core, self.index
        parent = self._scope_around(box)
        if worker is None:
            path = box._place.path
            said = FlatScope(0, path, box, None, self.found.boxes_come[box], [])
            scope, worker = plan.add_scope(core, said, parent, self.groups["loop"])
            index.by_node[box] = worker
        else:
            assert worker.scope is not None
            scope = worker.scope
            scope.move(worker.path, parent)
        core.by_path[worker.path] = worker
        position = bisect_left(index.scopes.items, node_place(box), key=lambda one: node_place(one.node))
        numbering = index.scopes.numbering
        index.scopes.insert(position, worker)
        for one in (worker,) if numbering == index.scopes.numbering else index.scopes.items:
            assert one.scope is not None
            one.scope.renumber(index.scopes.label(one))
        core.scopes.insert(position, scope)
        core.workers.insert(len(index.leaves.items) + position, worker)
        if parent is not None:
            parent.children.sort(key=by_index)
            self.scopes[parent] = None
        worker.enclose(scope.and_around())
        self._join(worker)
        self.scopes[scope] = None
        self.elsewhere[worker] = None

    def _rename(self, worker: RunningNode) -> None:
        """Note the new path of a node, and of all inside it."""
        self.core.by_path[worker.path] = worker
        if worker.scope is not None:
            worker.scope.rename(worker.path)

    def _regroup(self, worker: RunningNode, options: Any) -> None:
        """Let a node have other options, and perhaps run in another group."""
        worker.set_options(options)
        group = self.groups[options.group or "loop"]
        if group is worker.group:
            return
        worker.regroup(group)
        self.touched[worker] = None
        for edge in (*worker.edges_in(), *worker.all_out_edges()):
            self.touch_ends(edge)
            self.derive_release(edge)

    def derive_release(self, edge: AnyEdge) -> None:
        """Derive whether an edge is released in sequence, which depends on the groups at its ends (F5)."""
        if type(edge) is EventEdge:
            return
        before = edge.sequential
        plan.derive_release(edge)
        target: RunningNode = edge.target
        if not before or edge.sequential:
            return
        # what it has taken is processed by that (F5)
        if edge in target.taken and (target.holds_inputs or target.busy in ("firing", "ending")):
            release(target.release_early((edge,)))
        elif edge is target.call_edge and edge.token is None:
            release((edge,))


def by_index(edge: AnyEdge | Scope) -> float:
    """Return the number of an edge or scope in the order of the plan."""
    return float(edge.index)
