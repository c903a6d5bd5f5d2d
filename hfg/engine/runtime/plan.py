"""From a flattened graph to running nodes and edges (rule G1): everything that a token needs is found here, once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from hfg.engine.model import Core, Gate, Group, Iteration, Scope
from hfg.engine.model.running_node import DISABLED, STARTING, UNWIRED, RunningNode
from hfg.engine.rules.wiring import is_live, rewire
from hfg.errors import GraphError, UsageError
from hfg.graph.flat import LINK, End, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.graph.flat import Scope as FlatScope
from hfg.graph.flat.deadlines import urgencies
from hfg.graph.structure.places import edge_place, home_of, node_place
from hfg.ports.edges import AnyEdge, BufferEdge, EventEdge, SyncEdge

__all__ = [
    "Ends",
    "add_scope",
    "build",
    "derive_release",
    "describe",
    "make_edge",
    "make_worker",
    "mark_scope",
    "outside_label",
    "prepare_slot",
    "unwire",
    "watch_scope",
    "wire",
]


_OF_ACTIVITY = ("activated", "deactivated", "timeout")  # the events that tell it


def build(core: Core, flat: FlatGraph, groups: Mapping[str, Group], *, loop: Group) -> None:
    """Make the nodes and edges of a run; nothing is set up and nothing is on the edges yet.

    The insides of subgraphs that iterate are part of it, in depth-first order of adding like all else (G4).
    """
    parts = [_Part(flat, None)]
    for part in parts:  # grows while it is walked through
        part.make_workers(core, groups, loop)
        parts += [
            _Part(node.iteration, worker.iteration)
            for node, worker in zip(part.flat.nodes, part.workers, strict=True)
            if node.iteration is not None
        ]
    leaves = [worker for part in parts for worker in part.workers]
    owners = [owner for part in parts for owner in part.owners]
    if len(parts) > 1:
        leaves.sort(key=lambda worker: node_place(worker.node))
        owners.sort(key=lambda owner: node_place(owner.node))
    boundary = core.boundary = RunningNode(core, "", None, None, loop)
    core.workers += [*leaves, *owners, boundary]
    for part in parts:
        ends = Ends(core, loop, part.around, part.workers, part.scopes)
        for flat_edge in part.flat.edges:
            _add_edge(core, flat_edge, ends)
    if len(parts) > 1:
        core.edges.sort(key=lambda edge: edge_place(home_of(edge.segments[0], flat.graph), edge.segments[0]))
        for index, edge in enumerate(core.edges):
            edge.renumber(index)
    for owner in owners:
        assert owner.scope is not None
        owner.scope.renumber(len(core.scopes))
        core.scopes.append(owner.scope)
    _derive(core, parts)
    core.sources.extend(worker for worker in leaves if worker.is_source)


def set_due_times(core: Core, flat: FlatGraph) -> None:
    """Set by when after their sources nodes should be done, for policy "deadline"."""
    for worker in core.workers:
        worker.due_s = None
    for one in flat.walk():
        for index, seconds in urgencies(one).items():
            core.by_path[one.nodes[index].path].due_s = seconds


def _derive(core: Core, parts: Sequence[_Part]) -> None:
    """Derive from the structure as a whole which nodes are enabled and gated, and which edges are live."""
    for worker in core.workers:
        if not worker.own_enabled or any(not scope.enabled for scope in worker.around):
            worker.block(DISABLED)
    for part in parts:
        part.set_gates(core)
    for scope in core.scopes:
        mark_scope(scope)
    for worker in core.workers:
        worker.watch()
    for edge in core.edges:
        edge.enliven(is_live(edge))


class _Part:
    """The running form of one flat graph: of the whole, or of the inside of a subgraph that iterates.

    Attributes:
      around: the border of that subgraph.
      workers, scopes: by their numbers in the flat graph; `owners`: the running nodes of the scopes.
    """

    def __init__(self, flat: FlatGraph, around: Iteration | None) -> None:
        self.flat = flat
        self.around = around
        self.workers: list[RunningNode] = []
        self.scopes: list[Scope] = []
        self.owners: list[RunningNode] = []

    def make_workers(self, core: Core, groups: Mapping[str, Group], loop: Group) -> None:
        """Make the running nodes of nodes and subgraphs; each refers to the scopes around it, outermost first."""
        self.workers = [make_worker(core, flat_node, groups) for flat_node in self.flat.nodes]
        core.by_path.update((worker.path, worker) for worker in self.workers)
        for flat_scope in self.flat.scopes:
            parent = self.scopes[flat_scope.parent] if flat_scope.parent is not None else None
            scope, owner = add_scope(core, flat_scope, parent, loop)
            owner.enclose(scope.and_around())
            self.scopes.append(scope)
            self.owners.append(owner)
        for flat_scope, scope in zip(self.flat.scopes, self.scopes, strict=True):
            scope.take_in([self.workers[index] for index in flat_scope.members])
        if self.around is not None:
            for worker in (*self.workers, *self.owners):
                self.around.join(worker)

    def set_gates(self, core: Core) -> None:
        """Couple the work of gated nodes to the activity of others (A11)."""
        for flat_gate in self.flat.gates:
            by, target = flat_gate.by, flat_gate.target
            state = self.scopes[scope_end(by)] if by < 0 else self.workers[by]
            gated = self.scopes[scope_end(target)].members if target < 0 else [self.workers[target]]
            core.gates.append(Gate(state, flat_gate.idle_rate_hz, gated))


def add_scope(core: Core, flat_scope: FlatScope, parent: Scope | None, loop: Group) -> tuple[Scope, RunningNode]:
    """Make a subgraph, and the running node that has its automatic ports."""
    options = flat_scope.options
    scope = Scope(flat_scope.index, flat_scope.path, parent, enabled=options.enabled)
    owner = RunningNode(core, flat_scope.path, flat_scope.subgraph, None, loop)
    owner.stand_for(scope, options.active_for_s)
    core.by_path[owner.path] = owner
    return scope, owner


def _add_edge(core: Core, flat: FlatEdge, ends: Ends) -> None:
    edge = make_edge(core, flat, ends)
    core.edges.append(edge)
    wire(edge, flat)
    if flat.source.kind == "observable":
        core.observables.append((flat.source.port, edge, flat.options.through))
    elif flat.options.through:
        core.piped.append((edge, flat.options.through))
        edge.pipe(_not_piped_yet, None)


class Ends:
    """Finds the running node at the end of an edge; each port of the graph, or of one that iterates, has one."""

    def __init__(
        self,
        core: Core,
        loop: Group,
        around: Iteration | None = None,
        workers: Sequence[RunningNode] = (),
        scopes: Sequence[Scope] = (),
    ) -> None:
        self.core = core
        self.loop = loop
        self._around = around
        self._workers = workers
        self._scopes = scopes

    def of(self, end: End) -> RunningNode:
        """Return the running node at an end."""
        if end.node >= 0:
            return self._workers[end.node]
        if end.node < -1:
            owner = self._scopes[scope_end(end.node)].worker
            assert owner is not None
            return owner
        return self.at_border(end, self._around)

    def join(self, edge: AnyEdge, flat: FlatEdge) -> None:
        """Connect an edge to its ends; an end in another part is represented by an outlet or inlet (L1)."""
        if flat.target.node == LINK:
            source = self.of(flat.source)
            edge.join(source, self._outlet(flat.target.name, source.group))
        elif flat.source.node == LINK:
            target = self.of(flat.target)
            edge.join(self._inlet(flat.source, target.group), target)
        else:
            edge.join(self.of(flat.source), self.of(flat.target))

    def _outlet(self, name: str, group: Group) -> RunningNode:
        outlet = self._make(name, "output", self.loop if group.threaded else group)
        self.core.outlets.append(outlet)
        return outlet

    def _inlet(self, end: End, group: Group) -> RunningNode:
        """It is in the group of its consumer: what it puts down is processed when all that follows is (F5)."""
        inlet = self._make(end.name, "outside" if end.kind == "event" else "input", group)
        inlet.block(UNWIRED)  # it never fires
        self.core.inlets.append(inlet)
        return inlet

    def scopes_of(self, flat: FlatEdge) -> tuple[Scope, ...]:
        """Return the scopes through whose ports an edge passes."""
        return tuple(self._scopes[scope] for scope in flat.via)

    def at_border(self, end: End, around: Iteration | None) -> RunningNode:
        """Return the running node of a port of the graph itself, or of the inner side of a subgraph that iterates."""
        border = self.core if around is None else around
        if end.kind == "observable":
            return self._make(end.name, "outside", self.loop)
        if end.kind not in ("input", "output"):
            assert self.core.boundary is not None
            return self.core.boundary
        feeds = end.kind == "output"  # the graph's input is what inner edges start from
        known = border.feeds if feeds else border.readers
        port = next((node for node in known if node.port_name == end.name), None)
        if port is None:
            port = self._make(end.name, "input" if feeds else "output", self.loop)
            known.append(port)
            if around is not None and feeds:
                port.be_within(around)  # a feed is not a member: what is to be let in does not move by itself
            elif around is not None:
                around.join(port)
        return port

    def _make(self, name: str, kind: Literal["input", "output", "outside"], group: Group) -> RunningNode:
        port = RunningNode(self.core, "", None, None, group)
        port.be_port(name, kind)
        self.core.workers.append(port)
        return port


def make_worker(core: Core, flat_node: FlatNode, groups: Mapping[str, Group]) -> RunningNode:
    """Make the running node of a node; it has no edges yet."""
    options = flat_node.options
    group = groups[options.group or "loop"]
    worker = RunningNode(core, flat_node.path, flat_node.node, options, group)
    worker.fit(flat_node.node)
    if options.iterate_over:
        worker.iterate(Iteration(worker))
    if worker.is_source:
        worker.block(STARTING)
    if group.threaded and worker.may_wait():
        raise GraphError(
            f'node "{worker.path}" is async, but its group "{group.name}" is a thread: async code runs on '
            f"the loop; leave out group=, or make the "
            f"function a plain one"
        )
    return worker


def make_edge(core: Core, flat: FlatEdge, ends: Ends) -> Any:
    """Make a running edge; it is not wired yet."""
    edge: AnyEdge
    options = flat.options
    if flat.is_event_edge:
        edge = EventEdge(
            flat.index,
            flat.label,
            options.active,
            options.capacity,
            options.overflow,
            options.capacity_limit,
            options.initial,
        )
    elif options.initial or options.buffer:
        edge = BufferEdge(flat.index, flat.label, flat.active, options.initial, options.buffer)
    else:
        edge = SyncEdge(flat.index, flat.label, flat.active)
    ends.join(edge, flat)
    derive_release(edge)
    describe(edge, flat, ends)
    return edge


def describe(edge: AnyEdge, flat: FlatEdge, ends: Ends) -> None:
    """Note what a running edge stands for in the drawn graph."""
    edge.stand_for(flat.segments, flat.source.port, flat.target.port, ends.scopes_of(flat), flat.options)


def wire(edge: AnyEdge, flat: FlatEdge) -> None:
    """Connect an edge to its source and target, in its place in the order."""
    source: RunningNode = edge.source
    target: RunningNode = edge.target
    target.lead_in(edge, flat.target.kind, flat.target.name)
    if flat.source.kind == "event":
        named = source.node is not None or flat.source.name == "start"
        event = source.make_event(flat.source.name, flat.source.port if named else None)
        assert isinstance(edge, EventEdge)
        event.feed((*event.edges, edge))
    elif flat.source.kind != "observable":
        source.lead_out(edge, flat.source.kind, flat.source.name)


def unwire(edge: AnyEdge) -> None:
    """Disconnect an edge from its source and target; its tokens stay on it."""
    edge.target.lose_incoming(edge)
    edge.source.lose_outgoing(edge)


def _not_piped_yet(token: Any) -> None:
    """Takes the place of the operators of an edge until all nodes are set up."""
    raise UsageError("an event with operators on its edge was triggered in setup(): trigger it in a firing or a slot")


def derive_release(edge: AnyEdge) -> None:
    """Derive when a token on an edge is processed, and whether the node that it enables goes next (F5, R2)."""
    if type(edge) is not EventEdge:
        sequential = _is_sequential(edge)
        edge.be_released(sequential=sequential, depth_first=sequential and _stays(edge))


def _is_sequential(edge: AnyEdge) -> bool:
    """Return the consumer's mode: `auto` is sequential within a group (F5). A delay ends the wave in any mode (P7)."""
    target: RunningNode = edge.target
    release = target.options.release if target.options is not None and target.concurrent is None else "pipelined"  # F14
    if type(edge) is BufferEdge and edge.initial:
        return False
    if release == "auto":
        return edge.source.group is target.group
    return bool(release == "sequential")


def _stays(edge: AnyEdge) -> bool:
    """Return whether the edge stays in a depth-first group; tokens from outside are a wave of their own (R2)."""
    source: RunningNode = edge.source
    target: RunningNode = edge.target
    return source.options is not None and source.group is target.group and source.group.depth_first


def prepare_slot(worker: RunningNode, name: str) -> EventEdge:
    """Make the edge for signals from outside the graph into a slot; it counts as active (P10, A4)."""
    core = worker.core
    edge = EventEdge(core.edges[-1].index + 1 if core.edges else 0, outside_label(worker, name), True)
    outside = RunningNode(core, "", None, None, worker.group)
    outside.block(UNWIRED)  # it never fires; only its queue may be full
    edge.join(outside, worker)
    worker.lead_in(edge, "slot", name)
    if worker.meter is not None:
        worker.meter.measure_slots()
    core.edges.append(edge)
    core.outside[worker.index, name] = edge
    edge.enliven(is_live(edge))
    if core.started:
        rewire(worker)
    return edge


def outside_label(worker: RunningNode, slot: str) -> str:
    """Return the label of the edge for signals from outside into a slot."""
    return f"outside -> {worker.path}.{slot}" if worker.path else f"outside -> {slot}"


def mark_scope(scope: Scope) -> None:
    """Watch the activity of a subgraph if something depends on it; that of others costs nothing."""
    owner = scope.worker
    assert owner is not None
    if scope.gates or owner.active_for_s is not None or not owner.events.keys().isdisjoint(_OF_ACTIVITY):
        watch_scope(scope)


def watch_scope(scope: Scope) -> None:
    """Derive A(subgraph) from now on (G2)."""
    if scope.watched:
        return
    scope.watch()
    for member in scope.inside():
        member.watch(scope)
        if member.core.started:
            rewire(member)  # no fast paths
