"""Applies the diff of a plan, between firings of the nodes that are touched (rule R4).

Afterwards the plan is what it would be if it were made again, which the tests of edits compare, and so is its index.
Tokens on edges that are gone are returned or counted. The cost depends on the size of the diff only. Nothing here
waits: no other code of the run sees a plan that is half changed.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from typing import Any

from hfg.engine.editing.placing import Placing, by_index
from hfg.engine.editing.plan_diff import PlanDiff
from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.fusion.specialise import specialise
from hfg.engine.model import Core, Gate, Group, Scope
from hfg.engine.model.running_node import ENDED, RATE, REMOVED, RESTING, STARTING, RunningNode
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
from hfg.graph.structure.edge import Edge, is_feed
from hfg.graph.structure.gates import Gate as DeclaredGate
from hfg.graph.structure.level import level_of
from hfg.graph.structure.places import edge_place, home_of, node_place
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget
from hfg.ports.automatic import is_automatic_event
from hfg.ports.edges import AnyEdge, BufferEdge, EventEdge
from hfg.trace import ActivityLost

__all__ = ["apply"]


def apply(
    core: Core, index: PlanIndex, graph: Graph, found: PlanDiff, come: list[RunningNode], groups: Mapping[str, Group]
) -> tuple[list[tuple[AnyEdge, FlatEdge]], set[Node]]:
    """Apply a diff.

    Args:
      core: the run.
      index: the index of its plan.
      graph: the declared graph, after the edit.
      found: the diff.
      come: the workers of the nodes that come; they have been set up.
      groups: by name.

    Returns:
      The new edges, and the nodes that have changed, for observers of the run.
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
    """Finds workers by the nodes of ports, because nodes in a diff have no numbers."""

    def __init__(self, core: Core, index: PlanIndex, loop: Group) -> None:
        super().__init__(core, loop)
        self._index = index

    def of(self, end: End) -> RunningNode:
        node = getattr(end.port, "node", None)  # the graph's own ports have none
        worker = None if node is None else self._index.by_node.get(node)
        if worker is None or isinstance(end.port, InnerSource | InnerTarget):
            return self.at_border(end, None if worker is None else worker.iteration)
        return worker

    def scopes_of(self, flat: FlatEdge) -> tuple[Scope, ...]:
        return tuple(_scope_of(self._index, box) for box in flat.via)  # a `Follower` has no numbers, but subgraphs


def _scope_of(index: PlanIndex, box: Any) -> Scope:
    scope = index.by_node[box].scope
    assert scope is not None
    return scope


class _Applying(Placing):
    """Edges, gates, and what follows from all."""

    # --- edges

    def connect(self) -> list[tuple[AnyEdge, FlatEdge]]:
        """Wire new edges, and give those that stay their new options."""
        relabelled = self._called_otherwise()
        for edge in self.found.old:
            del self.core.edges[self.index.edges.remove(edge)]
            self.index.forget(edge)
        ways = self._list_edges()
        for edge, way, is_new in ways:
            if is_new or self.is_refitted(edge):
                plan.wire(edge, way)
                self.touch_ends(edge)
            if not is_new:
                self._say(edge, way)
        self._lead_in_from_outside()
        listed = [edge for edge, _, _ in ways]
        self._label(relabelled, listed)
        for source in {edge.source: None for edge in listed}:
            source.sort_outgoing()
        return [(edge, way) for edge, way, is_new in ways if is_new]

    def _list_edges(self) -> list[tuple[AnyEdge, FlatEdge, bool]]:
        """Put all edges of the diff into the order of the plan; return them, and which of them are new."""
        core, index = self.core, self.index
        ends = _Ends(core, index, self.groups["loop"])
        numbering = index.edges.numbering
        ways: list[tuple[AnyEdge, FlatEdge, bool]] = []
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
        """Lead edges from outside the graph to the same slots of nodes that were replaced or renamed."""
        for edge in self.core.outside.values() if self.refitted or self.found.renamed else ():
            if edge.target in self.refitted:
                edge.target.lead_in(edge, "slot", edge.port_name)
            edge.rename(plan.outside_label(edge.target, edge.port_name))

    def _spot(self, begin: Edge) -> int:
        """Return the position in the plan of the edges that begin with a declared one."""
        place = edge_place(home_of(begin, self.graph), begin)
        return bisect_left(
            self.index.edges.items,
            place,
            key=lambda edge: edge_place(home_of(edge.segments[0], self.graph), edge.segments[0]),
        )

    def _say(self, edge: AnyEdge, way: FlatEdge) -> None:
        """Set the new options of an edge that stays."""
        if edge.active != way.active:
            edge.carry(way.active)
            self.touched[edge.source] = None
        self.derive_release(edge)

    # --- labels

    def _called_otherwise(self) -> dict[AnyEdge, None]:
        """Take the labels from all edges that may get another one; return the edges."""
        found = self.found
        bases = {_base(edge.label): None for edge in found.old}
        bases |= {way.label: None for way, _ in found.ways}
        for worker in found.renamed:
            feeds = () if worker.iteration is None else worker.iteration.feeds
            at_border = [edge for feed in feeds for edge in feed.all_out_edges()]
            for edge in (*worker.edges_in(), *worker.all_out_edges(), *at_border):
                if edge.segments:
                    bases |= {_base(edge.label): None, _name(edge): None}
        taken: dict[AnyEdge, None] = {}
        for base in bases:
            label, number = base, 1
            while label in self.index.labels:
                taken[self.index.labels.pop(label)] = None
                number += 1
                label = f"{base} #{number}"
        return taken

    def _label(self, taken: dict[AnyEdge, None], listed: list[AnyEdge]) -> None:
        """Label edges by their ends, and number those that have the same ends through different ports of subgraphs."""
        labels = self.index.labels
        for edge in sorted({**taken, **dict.fromkeys(listed)}, key=by_index):
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
                self.touch_ends(edge)  # fast paths know the label

    # --- gates

    def set_gates(self) -> None:
        """Set gates again if any may gate other nodes than before (A11); the cost depends on what they gate."""
        core, found = self.core, self.found
        some_moved = self.elsewhere or found.gone or found.boxes_gone or found.swapped
        if found.gates or (core.gates and some_moved):
            self._set_gates_anew()
        self._watch()

    def _set_gates_anew(self) -> None:
        core = self.core
        gated = {worker: None for gate in core.gates for worker in gate.workers}
        gated |= {worker: None for worker in self.elsewhere if worker.gates_over}  # moved out of what was gated
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
            worker.rate.start_gated(float("-inf"))  # an idle rate counts from the first firing after the gate closes
            gated[worker] = None
        self.touched |= gated
        self.scopes |= {state: None for state in states if not isinstance(state, RunningNode)}
        self.touched |= {state: None for state in states if isinstance(state, RunningNode)}

    def _watch(self) -> None:
        """Find the subgraphs whose activity has an observer, now that nodes and edges have moved (G2)."""
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

    def go_on(self, new: list[tuple[AnyEdge, FlatEdge]]) -> None:
        """Derive what follows from the new wiring, then release the tokens on edges that are gone."""
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

    def _begin(self, edge: AnyEdge) -> None:
        """Start an edge: its initial tokens are on it now (P7)."""
        edge.enliven(wiring.is_live(edge))
        if isinstance(edge, BufferEdge | EventEdge) and edge.initial:
            edge.begin(self.core.now())
            if isinstance(edge, EventEdge):
                note_full(edge)
            node_lifecycle.discard_initial((edge,))
            if edge.target.blocked & ENDED:
                drain_left((edge,))

    def _derive_live(self) -> None:
        """Derive which edges are live, from the subgraphs around their ends and between them."""
        edges = [edge for edge in self.found.old if edge in self.index.edges]
        for worker in self.elsewhere:
            edges += [*worker.edges_in(), *worker.all_out_edges()]
        for edge in edges:
            live = wiring.is_live(edge)
            if live != edge.live:
                edge.enliven(live)
                self.touch_ends(edge)

    def _derive_anew(self, touched: list[RunningNode]) -> None:
        """Derive what workers wait for, what they forward, and which of their events have observers."""
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
        """Count tokens on edges that are gone as processed; the activity of nodes that are gone is lost (A8)."""
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

    def changed_nodes(self) -> set[Node]:
        """Return the nodes and subgraphs that have changed."""
        found = self.found
        workers = [*self.touched, *found.gone, *found.boxes_gone, *found.renamed]
        nodes = {worker.node for worker in workers} | {one for _, *both in found.swapped for one in both}
        for edge in (*self.named, *found.old, *self.new_edges):
            for segment in edge.segments:
                nodes |= {getattr(segment.source, "node", None), segment.target.node}
        return nodes

    def _bind(self, worker: RunningNode) -> None:
        """Update where the events of a worker lead; an automatic event that leads nowhere is dropped."""
        for name, event in list(worker.events.items()):
            watched = event.port is not None and event.port._observers
            if not event.edges and is_automatic_event(name) and not watched and worker.node is not None:
                worker.remove_event(event)
            elif worker.node is not None:
                ports.bind_event(worker, name)
        if worker.node is not None and worker.scope is None:
            self.core.rules.bind_ports(worker)
        specialise(worker)


def _base(label: str) -> str:
    """Return a label without the number that tells it from equal ones."""
    base, number_sign, number = label.rpartition(" #")
    return base if number_sign and number.isdigit() else label


def _name(edge: AnyEdge) -> str:
    """Return the label of an edge without a number."""
    return f"{_path(edge.source_port)} -> {_path(edge.target_port)}"


def _path(port: Any) -> str:
    return "observable" if is_feed(port) else str(getattr(port, "outer", port).path)


def _gates_of(graph: Graph) -> list[DeclaredGate]:
    """Return all gates of a whole graph, in the order of the plan."""
    levels = [level for level in level_of(graph).walk() if level.gates.listed]
    levels.sort(key=lambda level: () if level.owner is None else node_place(level.owner))
    return [gate for level in levels for gate in level.gates]
