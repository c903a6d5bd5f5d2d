"""Applies the diff of a plan, between firings of the nodes that are touched (rule R4).

Afterwards the plan is what it would be if it were made afresh, and the index of the plan is true again; what lay on
edges that are gone is given back or counted. Costs what the diff holds. Nothing here waits. Stands on `plan_diff`.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Mapping
from typing import Any

from hfg.engine.editing.plan_diff import PlanDiff
from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.fusion.specialise import specialise
from hfg.engine.model import Core, Gate, Group, Scope
from hfg.engine.model.running_node import DISABLED, ENDED, RATE, REMOVED, RESTING, STARTING, RunningNode
from hfg.engine.rules import node_lifecycle, wiring
from hfg.engine.rules.activity import rest
from hfg.engine.rules.agenda import note_full
from hfg.engine.rules.ending import drain_left
from hfg.engine.rules.modifiers import discard, touch
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import deferring_events, send_automatic
from hfg.engine.rules.sources import find_dead_sources
from hfg.engine.runtime import plan, ports
from hfg.graph import Graph
from hfg.graph.flat import End, FlatEdge
from hfg.graph.flat import Scope as FlatScope
from hfg.graph.structure.edge import is_feed
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.places import edge_place, home_of, node_place
from hfg.ports import InnerSource, InnerTarget
from hfg.ports.automatic import is_automatic_event
from hfg.ports.edges import BufferEdge, EventEdge
from hfg.trace import ActivityLost

__all__ = ["apply"]


def apply(
    core: Core, index: PlanIndex, graph: Graph, found: PlanDiff, come: list[RunningNode], groups: Mapping[str, Group]
) -> tuple[list[tuple[Any, FlatEdge]], set[Any]]:
    """Do it.

    Args:
      core: the run.
      index: of its plan.
      graph: as it was drawn.
      found: what is to be done.
      come: the workers of the nodes that come, set up already.
      groups: by name.

    Returns:
      the new edges, and the nodes at which something is not as it was, for whoever looks at the run.
    """
    applying = _Applying(core, index, graph, found, come, groups)
    applying.leave()
    applying.swap()
    applying.place()
    new = applying.connect()
    applying.set_gates()
    applying.go_on(new)
    return new, applying.changed_nodes()


class _Ends(plan.Ends):
    """Finds workers by the nodes of ports: numbers mean nothing in a diff."""

    def __init__(self, core: Core, index: PlanIndex, loop: Group) -> None:
        super().__init__(core, loop)
        self._index = index

    def of(self, end: End) -> RunningNode:
        worker = self._index.by_node.get(getattr(end.port, "node", None))
        if worker is None or isinstance(end.port, InnerSource | InnerTarget):
            return self.at_border(end, None if worker is None else worker.iteration)
        return worker

    def scopes_of(self, flat: FlatEdge) -> tuple[Scope, ...]:
        return tuple(_scope_of(self._index, box) for box in flat.via)


def _scope_of(index: PlanIndex, box: Any) -> Scope:
    scope = index.by_node[box].scope
    assert scope is not None
    return scope


class _Applying:
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
        self.touched: dict[RunningNode, None] = {}  # whose wiring is to be derived anew
        self.elsewhere: dict[RunningNode, None] = {}  # who lies in other subgraphs than before
        self.refitted = {worker for worker, _, _ in found.swapped}
        self.scopes: dict[Scope, None] = {}  # in which something is not as it was
        self.named: list[Any] = []  # edges that are called otherwise now
        self.new_edges: list[Any] = []

    # --- what goes

    def leave(self) -> None:
        """Take what is lost out of the plan; what lies on it stays there for the moment."""
        found = self.found
        for key, edge in list(self.core.outside.items()) if found.gone or found.boxes_gone else ():
            if edge.target in found.gone or edge.target in found.boxes_gone:
                del self.core.outside[key]
                self.core.edges.remove(edge)
                found.lost.append(edge)
        for edge in found.lost:
            edge.enliven(False)
            plan.unwire(edge)
            self._touch_ends(edge)
        for worker in found.gone:
            worker.leave_plan()

    # --- nodes

    def swap(self) -> None:
        """Let workers run the nodes that take the place of theirs; their edges are led to them by `connect`."""
        index = self.index
        lost = set(self.found.lost)
        for edge in (*self.found.old, *(self.core.outside.values() if self.refitted else ())):
            if self._is_refitted(edge) and edge not in lost:
                plan.unwire(edge)
        for worker, old, node in self.found.swapped:
            index.order.swap(old, node)
            del index.by_node[old]
            index.by_node[node] = worker
            self._list_source(worker, False)
            worker.fit(node)
            self._list_source(worker, worker.is_source)
            self.touched[worker] = None

    def _touch_ends(self, edge: Any) -> None:
        self.touched |= {edge.source: None, edge.target: None}

    def _is_refitted(self, edge: Any) -> bool:
        return edge.source in self.refitted or edge.target in self.refitted

    def place(self) -> None:
        """Let everybody be where a plan made afresh would have him."""
        found = self.found
        self._take_all_out()
        for worker in (*found.renamed, *found.placed, *found.boxes_placed):
            worker.rename(worker.node._place.path)
        for worker in self.come:  # who iterates is asked for by those inside
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
        """What goes is nowhere any more, and what is to be elsewhere neither, for the moment."""
        core, index, found = self.core, self.index, self.found
        for scope in (worker.scope for worker in found.boxes_gone):
            assert scope is not None
            for member in scope.members if not scope.enabled else ():
                member.enable_itself(False)  # without it they stay as disabled as they were (G1)
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
        """It is inside of what iterates, if anything around it does (G4)."""
        level: Level | None = level_of(worker.node._place.graph)
        while level is not None and level.owner is not None:
            around = self.index.by_node[level.owner]
            if around.iteration is not None:
                around.iteration.join(worker)
                return
            level = level.around

    def _list_source(self, worker: RunningNode, is_one: bool) -> None:
        """Let a worker be in the list of sources, or not."""
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
        """That of the subgraph directly around it; what iterates is none (G4)."""
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
            parent.children.sort(key=_index)
            self.scopes[parent] = None
        worker.enclose(scope.and_around())
        self._join(worker)
        self.scopes[scope] = None
        self.elsewhere[worker] = None

    def _rename(self, worker: RunningNode) -> None:
        """It has another path, and so has all inside it."""
        self.core.by_path[worker.path] = worker
        if worker.scope is not None:
            worker.scope.rename(worker.path)

    def _regroup(self, worker: RunningNode, options: Any) -> None:
        """It may run elsewhere from now on."""
        worker.set_options(options)
        group = self.groups[options.group or "loop"]
        if group is worker.group:
            return
        worker.regroup(group)
        self.touched[worker] = None
        for edge in (*worker.edges_in(), *worker.all_out_edges()):
            self._touch_ends(edge)
            self._derive_release(edge)

    # --- edges

    def connect(self) -> list[tuple[Any, FlatEdge]]:
        """Lead new edges where they belong, and let those that stay be what is said about them now."""
        relabelled = self._called_otherwise()
        for edge in self.found.old:
            del self.core.edges[self.index.edges.remove(edge)]
            self.index.forget(edge)
        ways = self._list_edges()
        for edge, way, is_new in ways:
            if is_new or self._is_refitted(edge):
                plan.wire(edge, way)
                self._touch_ends(edge)
            if not is_new:
                self._say(edge, way)
        self._lead_in_from_outside()
        listed = [edge for edge, _, _ in ways]
        self._label(relabelled, listed)
        for source in {edge.source: None for edge in listed}:
            source.sort_outgoing()
        return [(edge, way) for edge, way, is_new in ways if is_new]

    def _list_edges(self) -> list[tuple[Any, FlatEdge, bool]]:
        """Let all that were looked at be in their places in the order; gives them, and which of them are new."""
        core, index = self.core, self.index
        ends = _Ends(core, index, self.groups["loop"])
        numbering = index.edges.numbering
        ways: list[tuple[Any, FlatEdge, bool]] = []
        begin, position = None, 0
        for way, running in self.found.ways:
            edge = running
            if edge is None:
                edge = plan.make_edge(core, way, ends)
                self.new_edges.append(edge)
            else:
                plan.describe(edge, way, ends)
            if way.segments[0] is not begin:
                begin = way.segments[0]
                position = self._spot(begin)
            index.edges.insert(position, edge)
            core.edges.insert(position, edge)
            index.note(edge)
            position += 1
            ways.append((edge, way, running is None))
        for edge in [edge for edge, _, _ in ways] if numbering == index.edges.numbering else index.edges.items:
            edge.renumber(index.edges.label(edge))
        return ways

    def _lead_in_from_outside(self) -> None:
        """Edges from outside the graph lead to the same slots of nodes that are others now, or are called otherwise."""
        for edge in self.core.outside.values() if self.refitted or self.found.renamed else ():
            if edge.target in self.refitted:
                edge.target.lead_in(edge, "slot", edge.port_name)
            edge.rename(plan.outside_label(edge.target, edge.port_name))

    def _spot(self, begin: Any) -> int:
        """Before which edge of the plan those come that begin with a drawn one."""
        place = edge_place(home_of(begin, self.graph), begin)
        return bisect_left(
            self.index.edges.items,
            place,
            key=lambda edge: edge_place(home_of(edge.segments[0], self.graph), edge.segments[0]),
        )

    def _say(self, edge: Any, way: FlatEdge) -> None:
        """What is said about an edge that stays."""
        if edge.active != way.active:
            edge.carry(way.active)
            self.touched[edge.source] = None
        self._derive_release(edge)

    def _derive_release(self, edge: Any) -> None:
        """Whether it is released in sequence, which depends on the groups at its ends (F5)."""
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

    # --- labels

    def _called_otherwise(self) -> dict[Any, None]:
        """Take the labels of all edges that may be called otherwise afterwards; gives the edges."""
        found = self.found
        bases = {_base(edge.label): None for edge in found.old}
        bases |= {way.label: None for way, _ in found.ways}
        for worker in found.renamed:
            feeds = () if worker.iteration is None else worker.iteration.feeds
            at_border = [edge for feed in feeds for edge in feed.all_out_edges()]
            for edge in (*worker.edges_in(), *worker.all_out_edges(), *at_border):
                if edge.segments:
                    bases |= {_base(edge.label): None, _name(edge): None}
        taken: dict[Any, None] = {}
        for base in bases:
            label, number = base, 1
            while label in self.index.labels:
                taken[self.index.labels.pop(label)] = None
                number += 1
                label = f"{base} #{number}"
        return taken

    def _label(self, taken: dict[Any, None], listed: list[Any]) -> None:
        """Name edges by their ends; those that lead the same way by different ports of subgraphs are numbered."""
        labels = self.index.labels
        for edge in sorted({**taken, **dict.fromkeys(listed)}, key=_index):
            if edge not in self.index.edges:
                continue
            base = label = _name(edge)
            number = 1
            while label in labels:
                number += 1
                label = f"{base} #{number}"
            labels[label] = edge
            if edge.label != label:
                edge.rename(label)
                self.named.append(edge)
                self._touch_ends(edge)  # fast paths know the label

    # --- gates

    def set_gates(self) -> None:
        """Set gates anew if any may gate others than before (A11); costs by what they gate."""
        core, found = self.core, self.found
        some_moved = self.elsewhere or found.gone or found.boxes_gone or found.swapped
        if found.gates or (core.gates and some_moved):
            self._set_gates_anew()
        self._watch()

    def _set_gates_anew(self) -> None:
        core = self.core
        gated = {worker: None for gate in core.gates for worker in gate.workers}
        states = {gate.state: None for gate in core.gates}
        for worker in gated:
            worker.be_gated(None)
        for state in states:
            state.forget_gates()
        core.gates.clear()
        for drawn in _gates_of(self.graph):
            target, by = self.index.by_node[drawn.target], self.index.by_node[drawn.by]
            inside = [target] if target.scope is None else target.scope.members
            core.gates.append(Gate(by.scope or by, drawn.idle_rate_hz, inside))
        states |= {gate.state: None for gate in core.gates}
        for worker in {worker: None for gate in core.gates for worker in gate.workers if worker not in gated}:
            worker.rate.start_gated(float("-inf"))  # an idle rate counts from the first firing behind the gate
            gated[worker] = None
        self.touched |= gated
        self.scopes |= {state: None for state in states if not isinstance(state, RunningNode)}
        self.touched |= {state: None for state in states if isinstance(state, RunningNode)}

    def _watch(self) -> None:
        """Whose activity somebody cares about, now that nodes are elsewhere, and edges lead from other ports (G2)."""
        for edge in (*self.found.lost, *self.new_edges):
            for worker in (edge.source, edge.target):
                self.scopes |= dict.fromkeys(worker.around)
        gone = {worker.scope for worker in self.found.boxes_gone}
        self.scopes = {scope: None for scope in self.scopes if scope not in gone}
        for scope in self.scopes:
            if scope.watched:
                scope.find_inner_edges()
            else:
                plan.mark_scope(scope)

    # --- going on

    def go_on(self, new: list[tuple[Any, FlatEdge]]) -> None:
        """Derive what follows, then let go what lay on edges that are gone."""
        for worker in self.come:
            worker.allow(STARTING)
            ports.bind_automatic(worker)
        for edge, _ in new:
            self._begin(edge)
        self._derive_live()
        touched = [worker for worker in self.touched if not worker.blocked & REMOVED]
        self._derive_anew(touched)
        with deferring_events(self.core):
            self._let_go()
        for worker in touched:
            if not worker.busy:
                send_automatic(worker)
        node_lifecycle.disable_around(worker for worker in touched if any(not scope.enabled for scope in worker.around))
        find_dead_sources(self.core)
        self.core.waits_changed()

    def _begin(self, edge: Any) -> None:
        """An edge begins: if it has initial tokens, they lie on it now (P7)."""
        edge.enliven(wiring.is_live(edge))
        if isinstance(edge, BufferEdge | EventEdge) and edge.initial:
            edge.begin(self.core.now())
            if isinstance(edge, EventEdge):
                note_full(edge)
            node_lifecycle.discard_initial((edge,))
            if edge.target.blocked & ENDED:
                drain_left((edge,))

    def _derive_live(self) -> None:
        """Edges are live or not by the subgraphs around their ends and on their way."""
        edges = [edge for edge in self.found.old if edge in self.index.edges]
        for worker in self.elsewhere:
            edges += [*worker.edges_in(), *worker.all_out_edges()]
        for edge in edges:
            live = wiring.is_live(edge)
            if live != edge.live:
                edge.enliven(live)
                self._touch_ends(edge)

    def _derive_anew(self, touched: list[RunningNode]) -> None:
        """What they wait for, what they send on, and what somebody wants to know of them."""
        for worker in touched:
            self._bind(worker)
            worker.watch()
            if worker.active_timer is not None:
                worker.active_timer.recount(worker.timeout_leads_somewhere())
        for worker in touched:
            wiring.rewire(worker)
            if worker.is_source and (worker.gates_over or worker.blocked & (RESTING | RATE)):
                rest(worker)

    def _let_go(self) -> None:
        """What lay on edges that are gone counts as processed; the activity of nodes that are gone is lost (A8)."""
        core = self.core
        for edge in self.found.lost:
            discard(edge, "removed")
            if not isinstance(edge, EventEdge):
                release((edge,))
        for worker in self.found.gone:
            if worker.active and worker.scope is None:
                core.lost_activity += 1
                if core.trace_changes is not None:
                    core.trace_changes(ActivityLost(core.now(), worker.path))
        touch(core, [scope for scope in self.scopes if scope.watched])

    def changed_nodes(self) -> set[Any]:
        """The nodes and subgraphs at which something is not as it was."""
        found = self.found
        workers = [*self.touched, *found.gone, *found.boxes_gone, *found.renamed]
        nodes = {worker.node for worker in workers} | {one for _, *both in found.swapped for one in both}
        for edge in (*self.named, *found.old, *self.new_edges):
            for segment in edge.segments:
                nodes |= {getattr(segment.source, "node", None), segment.target.node}
        return nodes

    def _bind(self, worker: RunningNode) -> None:
        """Let the events of a worker know where they lead now; one that leads nowhere and is automatic is none."""
        for name, event in list(worker.events.items()):
            watched = event.port is not None and event.port._observers
            if not event.edges and is_automatic_event(name) and not watched and worker.node is not None:
                worker.remove_event(event)
            elif worker.node is not None:
                ports.bind_event(worker, name)
        if worker.node is not None and worker.scope is None:
            self.core.rules.bind_ports(worker)
        specialise(worker)


def _index(edge: Any) -> float:
    return float(edge.index)


def _base(label: str) -> str:
    """A label without its number among those that are the same."""
    base, number_sign, number = label.rpartition(" #")
    return base if number_sign and number.isdigit() else label


def _name(edge: Any) -> str:
    """What an edge is called by its ends."""
    return f"{_path(edge.source_port)} -> {_path(edge.target_port)}"


def _path(port: Any) -> str:
    return "observable" if is_feed(port) else str(getattr(port, "outer", port).path)


def _gates_of(graph: Graph) -> list[Any]:
    """All gates of a whole graph, in the order of the plan."""
    levels = [level for level in level_of(graph).walk() if level.gates.listed]
    levels.sort(key=lambda level: () if level.owner is None else node_place(level.owner))
    return [gate for level in levels for gate in level.gates]
