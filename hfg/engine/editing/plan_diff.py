"""The diff of a plan: what an edit means to it, found by a look at what was touched alone (rules R4, G1).

What stays is told by identity: a node by its object, an edge by the ports at its ends, so that grouping nodes into a
subgraph moves no token. Only nodes that a change names, and drawn edges that it names or that lie inside such a node,
are looked at; the ways that lead over those edges are followed anew and compared with the running edges that did.
Decides only; `applying` does it. Stands on `plan_index`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec

from hfg.engine.editing.plan_index import PlanIndex
from hfg.engine.model.running_node import RunningNode
from hfg.graph import Graph
from hfg.graph.editing.changes import (
    Change,
    EdgeChange,
    EdgeSwap,
    GateChange,
    NodeChange,
    NodeSwap,
    OptionsChange,
    ParameterChange,
    PromotionChange,
    Renaming,
)
from hfg.graph.flat import ROOT, EdgeFollower, End, FlatEdge, FlatGraph
from hfg.graph.structure.edge import Edge, is_feed, type_of
from hfg.graph.structure.level import HasLevel, Level, inside, level_of
from hfg.graph.structure.options import NodeOptions, in_group
from hfg.graph.structure.places import edge_place, home_of, side_of
from hfg.graph.structure.subgraph import is_box, iterated
from hfg.ports import InnerSource, InnerTarget
from hfg.ports.edges import BufferEdge
from hfg.types import why_not

__all__ = ["PlanDiff", "diff"]

_JOINED = ("input", "parameter")


class PlanDiff(msgspec.Struct, eq=False):
    """What is to be done to a plan.

    Attributes:
      come: nodes that come, with their options; in any order.
      gone: workers that go.
      swapped: workers that get another node: the one they had, and the one that they get.
      placed: workers of nodes that stay, which may be elsewhere in the order or in another subgraph.
      options: workers of nodes that stay, with options that hold from now on.
      renamed: workers of nodes and subgraphs whose path is another.
      boxes_come, boxes_gone, boxes_placed: the same of subgraphs that are dissolved; those that go as workers.
      old: the running edges that were looked at.
      ways: what leads where they did, in order, each with the running edge that it is, if it is there already.
      lost: running edges that go.
      gates: whether they are to be set anew.
      touched: workers that must not fire while it is done.
      doubtful: only a check of the whole can tell whether the graph is sound.
    """

    come: dict[Any, NodeOptions] = {}
    gone: list[RunningNode] = []
    swapped: list[tuple[RunningNode, Any, Any]] = []
    placed: list[RunningNode] = []
    options: list[tuple[RunningNode, NodeOptions]] = []
    renamed: list[RunningNode] = []
    boxes_come: dict[Any, NodeOptions] = {}
    boxes_gone: list[RunningNode] = []
    boxes_placed: list[RunningNode] = []
    old: list[Any] = []
    ways: list[tuple[FlatEdge, Any]] = []
    lost: list[Any] = []
    gates: bool = False
    touched: list[RunningNode] = []
    doubtful: bool = False


def diff(graph: Graph, index: PlanIndex, changes: Sequence[Change]) -> PlanDiff:
    """Find out what changes of the drawn graph mean to the plan of its run.

    Args:
      graph: as it was drawn, with the changes in it.
      index: of the plan, which is as it was before them; nothing of it is changed but the order of its nodes, which
        also holds without them.
      changes: all since the plan was made or edited last.
    """
    comparing = _Comparing(graph, index, changes)
    comparing.nodes()
    comparing.edges()
    comparing.judge()
    comparing.touch()
    return comparing.found


class _Comparing:
    def __init__(self, graph: Graph, index: PlanIndex, changes: Sequence[Change]) -> None:
        self.graph = graph
        self.index = index
        self.changes = changes
        self.found = PlanDiff()
        self.swaps: dict[Any, RunningNode | None] = {}  # by the node of now: the worker that had another; None: not now
        self.insides: list[Level] = []  # of subgraphs that came, went or moved
        self.follower = _Follower(graph)

    # --- nodes

    def worker_of(self, node: Any) -> RunningNode | None:
        """The worker that a node has, or takes over."""
        return self.swaps[node] if node in self.swaps else self.index.by_node.get(node)

    def nodes(self) -> None:
        """Look at the nodes that changes name, and at all inside them."""
        found = self.found
        swapped: dict[RunningNode, Any] = {}
        placed: dict[Any, None] = {}
        told: dict[Any, None] = {}
        for change in self.changes:
            if isinstance(change, NodeSwap):
                worker = self.worker_of(change.old)
                self.swaps[change.old], self.swaps[change.new] = None, worker
                if worker is not None:
                    swapped[worker] = change.new
                if change.old in placed:
                    placed[change.new] = None  # whose place it takes had been moved before
                told |= {change.old: None, change.new: None}
            elif isinstance(change, NodeChange):
                placed |= dict.fromkeys(self._within(change.node, change.inside, self.insides))
            elif isinstance(change, Renaming) or (
                isinstance(change, OptionsChange) and change.before.group != change.after.group
            ):
                told |= dict.fromkeys(self._within(change.node, None, None))
        for node in dict.fromkeys((*placed, *told)):
            self._compare_node(node, moved=node in placed)
        there = set(found.gone)
        found.swapped = [
            (worker, worker.node, node)
            for worker, node in swapped.items()
            if worker.node is not node and worker not in there
        ]
        found.gates = any(isinstance(change, GateChange) for change in self.changes)

    def _within(self, node: Any, was: Level | None, levels: list[Level] | None) -> Iterator[Any]:
        """A node and all inside it; notes the levels inside."""
        waiting = [(node, was)]
        while waiting:
            one, was = waiting.pop()
            yield one
            level = inside(one) or was
            if level is None:
                continue
            if levels is not None:
                levels.append(level)
            waiting += [(inner, None) for inner in level.nodes.values()]

    def _is_leaf(self, node: Any) -> bool:
        worker = self.worker_of(node)
        return not is_box(node) or bool(iterated(node)) or (worker is not None and worker.scope is None)

    def _compare_node(self, node: Any, *, moved: bool) -> None:
        found, worker, stays = self.found, self.worker_of(node), _is_in(node, self.graph)
        leaf = self._is_leaf(node)
        if not stays:
            if worker is not None:
                (found.gone if leaf else found.boxes_gone).append(worker)
            return
        options = _options_of(node)
        self.found.doubtful |= options.group is not None and options.group not in self.graph.groups
        if worker is None:
            found.doubtful |= node._type.is_source and side_of(level_of(node._place.graph)).owner is not None
            (found.come if leaf else found.boxes_come)[node] = options
            return
        if moved:
            (found.placed if leaf else found.boxes_placed).append(worker)
        if worker.path != node._place.path:
            found.renamed.append(worker)
        if leaf:
            found.options.append((worker, options))

    # --- edges

    def edges(self) -> None:
        """Look at the drawn edges that were touched, and follow all ways that lead over them."""
        index, found = self.index, self.found
        homes, before, rubbed_out = self._touched_edges()
        affected: dict[Any, None] = {}
        begins: dict[Edge, None] = {}
        for edge, home in homes.items():
            affected |= dict.fromkeys(index.passing.get(edge, ()))
            if home is not None:
                begins |= dict.fromkeys(self.follower.begins(edge))
        after = {old: new for new, old in before.items()}
        for running in affected:
            begin = after.get(running.segments[0], running.segments[0])
            if begin not in homes or homes[begin] is not None:
                begins[begin] = None
        for begin in begins:
            affected |= dict.fromkeys(index.block(before.get(begin, begin)))
        found.old = sorted(affected, key=index.edges.label)
        present: dict[Any, list[Any]] = {}
        for running in found.old:
            if rubbed_out.isdisjoint(running.segments):
                present.setdefault(_ends_of_running(running), []).append(running)
        in_order = sorted(begins, key=lambda begin: edge_place(homes.get(begin) or home_of(begin, self.graph), begin))
        kept = set()
        for begin in in_order:
            for way in self.follower.block(begin):
                same = present.get(self._ends_of(way))
                running = same.pop(0) if same else None
                kept.add(running)
                found.ways.append((way, running))
        found.lost = [running for running in found.old if running not in kept]

    def _touched_edges(self) -> tuple[dict[Edge, Level | None], dict[Edge, Edge], set[Edge]]:
        """The edges that changes draw or delete, and the graph each is in now.

        With it: which edge one stands for, and which were deleted for good.
        """
        homes: dict[Edge, Level | None] = {}
        before: dict[Edge, Edge] = {}
        rubbed_out: set[Edge] = set()
        mentioned: list[tuple[Level, Edge]] = []
        for change in self.changes:
            if isinstance(change, EdgeChange):
                mentioned.append((change.level, change.edge))
                if not change.added and change.for_good:
                    rubbed_out.add(change.edge)
            elif isinstance(change, EdgeSwap):
                mentioned += [(change.level, change.old), (change.level, change.new)]
                before[change.new] = before.pop(change.old, change.old)
            elif isinstance(change, PromotionChange):
                mentioned += self._edges_of_promoted(change)
        mentioned += [(level, edge) for level in self.insides for edge in level.edges]
        for level, edge in mentioned:
            is_there = _is_attached(level, self.graph) and edge in level.connections.order
            homes[edge] = level if is_there else homes.get(edge)
        for edge, home in homes.items():
            if home is not None and edge not in home.connections.order:
                homes[edge] = None
        return homes, before, rubbed_out

    def _edges_of_promoted(self, change: PromotionChange) -> Iterator[tuple[Level, Edge]]:
        """The edges at parameters of the subgraph, and of those around it, that stand for others than before."""
        names = [
            name for name in {**change.before, **change.after} if change.before.get(name) != change.after.get(name)
        ]
        owner: Any = change.level.owner
        waiting = [owner.ports.parameters[name] for name in names] if owner is not None else []
        while waiting:
            port = waiting.pop()
            if port.node._place is None:
                continue
            around = level_of(port.node._place.graph)
            for edge in around.connections.at(port.node):
                if port in (edge.source, edge.target):
                    yield around, edge
            for name, ports in around.promotions.by_name.items():
                if port in ports and around.owner is not None:
                    waiting.append(around.owner.ports.parameters[name])

    def _ends_of(self, way: FlatEdge) -> tuple[Any, ...]:
        roomy = bool(way.options.initial or way.options.buffer) and not way.is_event_edge  # another kind of edge
        source, target = way.source, way.target
        begin, end = self._of_node(source.port) or source.port, self._of_node(target.port) or target.port
        return begin, _kind(source.port), source.name, end, _kind(target.port), target.name, roomy

    def _of_node(self, port: Any) -> RunningNode | None:
        """The worker of a port's node; that of a port's inner side is known by the port alone (G4)."""
        node = getattr(port, "node", None)
        return None if node is None or isinstance(port, InnerSource | InnerTarget) else self.worker_of(node)

    # --- soundness

    def judge(self) -> None:
        """See whether the graph is sound beyond doubt; else a check of the whole is to say what is wrong (R4)."""
        found = self.found
        changes = [(way, old) for way, old in found.ways if old is None or old.segments != way.segments]
        changed = [way for way, _ in changes]
        closes_a_ring = self._closes_a_ring()  # asked in any case, for the index learns by that
        found.doubtful = (
            found.doubtful
            or closes_a_ring
            or bool(self.follower.flat.findings)
            or not all(map(self._fits, changed))
            or self._are_doubled(changes)
            or found.gates
            or self._waits_in_thread()
            or self._is_concurrency_touched(changed)
        )

    def _is_concurrency_touched(self, changed: Sequence[FlatEdge]) -> bool:
        """Whether a node that has several firings under way comes, or gets what it cannot have with that (F14)."""
        found = self.found
        options = [*found.come.values(), *(options for _, options in found.options)]
        options += [_options_of(node) for _, _, node in found.swapped]
        ends = [end.port for way in changed if way.active for end in (way.source, way.target)]
        options += [getattr(getattr(port, "node", None), "_options", None) or NodeOptions() for port in ends]
        return any(one.concurrency > 1 for one in options)

    def _closes_a_ring(self) -> bool:
        """Whether new edges make a ring of synchronous ones without a delay (P7)."""
        joined = [
            (self._old_node(way.source.port), self._old_node(way.target.port))
            for way, running in self.found.ways
            if running is None and not way.is_event_edge and not way.options.initial and way.target.kind in _JOINED
            if way.source.node != ROOT and way.target.node != ROOT
        ]
        return self.index.order.closes_a_ring(joined, self.found.lost)

    def _waits_in_thread(self) -> bool:
        """Whether async code would be in a group that is a thread."""
        found = self.found
        threads = {name for name, group in self.graph.groups.items() if group.threads}
        nodes = [*found.come.items(), *((worker.node, options) for worker, options in found.options)]
        nodes += [(node, _options_of(node)) for _, _, node in found.swapped]
        return any(options.group in threads and _may_wait(node._type) for node, options in nodes)

    def _old_node(self, port: Any) -> Any:
        """The node by which the index knows a worker."""
        worker = self._of_node(port)
        return port.node if worker is None else worker.node

    def _fits(self, way: FlatEdge) -> bool:
        """Whether the parts of an edge through subgraphs make a sound one beyond doubt."""
        source, target = way.source.port, way.target.port
        if iterated(getattr(target, "node", None)) and way.target.kind != "slot" and (way.active or way.is_event_edge):
            return False
        if len(way.segments) == 1 and way.segments[0].source is source and way.segments[0].target is target:
            return True
        if way.options.through or is_feed(source) or why_not(type_of(source), type_of(target)) is not None:
            return False
        return (
            not way.options.initial
            and not way.options.buffer
            and not any(part.options.first_said("events") for part in way.segments)
        )

    def _are_doubled(self, changes: Sequence[tuple[FlatEdge, Any]]) -> bool:
        """Whether an input may have two edges, or two ports be connected twice (P2)."""
        into = set()
        moved = {*self.found.lost, *(running for _, running in changes)}  # all others stay where they are
        for way, _ in changes:
            source, target = way.source.port, way.target.port
            alone = way.target.kind in _JOINED
            key = (None if alone else source, target, way.target.kind)
            if key in into:
                return True
            into.add(key)
            worker = self._at_border(target) if isinstance(target, InnerTarget) else self._of_node(target)
            for other in () if worker is None else worker.edges_in():
                if other in moved or other.target_port is not target:
                    continue
                if other.target_kind == way.target.kind and (alone or other.source_port is source):
                    return True
        return False

    def _at_border(self, port: InnerTarget[Any]) -> RunningNode | None:
        """Who reads what comes out of a subgraph that iterates, if anybody does."""
        box = self.worker_of(port.node)
        readers = () if box is None or box.iteration is None else box.iteration.readers
        return next((reader for reader in readers if reader.port_name == port.name), None)

    # --- who must rest

    def touch(self) -> None:
        """Find who must not fire while it is done."""
        found = self.found
        touched: dict[RunningNode | None, None] = {}
        for way, running in found.ways:
            if running is None:
                touched |= {self._of_node(way.source.port): None, self._of_node(way.target.port): None}
            elif running.active != way.active:
                touched |= {running.source: None, running.target: None}
        for running in found.lost:
            touched |= {running.source: None, running.target: None}
        for change in self.changes:
            if isinstance(change, OptionsChange | ParameterChange):
                touched[self.worker_of(change.node)] = None
        touched |= dict.fromkeys((*found.gone, *(worker for worker, _, _ in found.swapped), *found.renamed))
        touched |= {worker: None for worker, options in found.options if worker.options.group != options.group}
        found.touched = [
            worker for worker in touched if worker is not None and worker.node is not None and worker.scope is None
        ]


def _may_wait(kind: Any) -> bool:
    """Whether there is async code in nodes of a type."""
    waits = kind.process_kind.startswith("async") or "do" in kind.hooks
    return waits or any(slot.is_async for slot in kind.slots.values())


def _ends_of_running(edge: Any) -> tuple[Any, ...]:
    """What makes an edge the same: nodes and names of ports; the graph's own ports and observables are themselves."""
    begin = edge.source if edge.source.node is not None else edge.source_port
    end = edge.target if edge.target.node is not None else edge.target_port
    source, target = edge.source_port, edge.target_port
    name = "observable" if is_feed(source) else source.name
    return begin, _kind(source), name, end, _kind(target), target.name, type(edge) is BufferEdge


def _kind(port: Any) -> str:
    return "observable" if is_feed(port) else str(port.kind)


def _is_in(node: Any, graph: Graph) -> bool:
    """Whether a node is in the whole graph, alone or with subgraphs around it."""
    return node._place is not None and _is_attached(level_of(node._place.graph), graph)


def _is_attached(level: Level, graph: Graph) -> bool:
    """Whether a level is part of the whole now."""
    root, one = level_of(graph), level
    while one is not root:
        if one.owner is None or inside(one.owner) is not one:
            return False
        around = one.around
        if around is None:
            return False
        one = around
    return True


def _options_of(node: Any) -> NodeOptions:
    """What is said about a node, with the group it really runs in."""
    own: NodeOptions = node._options
    group, level = own.group, level_of(node._place.graph)
    while group is None and level.owner is not None:
        group = level.owner._options.group
        level = level_of(level.owner.place.graph)
    return own if own.group is not None else in_group(own, group or "loop")


# --- following drawn edges ---


class _Dissolved(Mapping[Any, Any]):
    """Says of any node whether it is a subgraph that is dissolved; each stands for itself."""

    def __contains__(self, node: object) -> bool:
        return is_box(node) and not iterated(node)

    def __getitem__(self, node: Any) -> Any:
        if node not in self:
            raise KeyError(node)
        return node

    def __bool__(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Any]:
        return iter(())

    def __len__(self) -> int:
        return 0


class _Follower(EdgeFollower):
    """Follows single edges; looks only at the graphs on their way.

    The numbers of nodes in what it gives mean nothing: `via` holds subgraphs, and a node is known by its port.
    """

    def __init__(self, graph: Graph) -> None:
        super().__init__(FlatGraph([], [], [], graph.groups, [], graph, []), [])
        self.scope_of = _Dissolved()

    def begins(self, edge: Edge) -> Iterator[Edge]:
        """Give the drawn edges with which the ways over one begin."""
        waiting, seen = [edge], {edge}
        while waiting:
            one = waiting.pop()
            relay = self.relay(one.source)
            if relay is None:
                yield one
                continue
            around = level_of(relay.graph if isinstance(one.source, InnerSource) else relay.node._graph)
            for back in around.connections.at(relay.node):
                if back not in seen and self.relay(back.target) is relay:
                    seen.add(back)
                    waiting.append(back)

    def block(self, begin: Edge) -> list[FlatEdge]:
        """Give the edges of the plan that begin with a drawn one, in order."""
        self.flat.edges = []
        self._look_ahead(begin)
        self.begin(begin)
        return self.flat.edges

    def _look_ahead(self, begin: Edge) -> None:
        """Find the relays on the way, and what goes on behind them."""
        waiting = [begin]
        self.depth_of[begin] = self._depth(begin)
        while waiting:
            relay = self.relay(waiting.pop().target)
            if relay is None or relay in self.behind:
                continue
            onward = level_of(relay.node._graph if relay.kind in ("input", "slot") else relay.graph)
            self.behind[relay] = [
                edge for edge in onward.connections.at(relay.node) if self.relay(edge.source) is relay
            ]
            for edge in self.behind[relay]:
                self.depth_of[edge] = self._depth(edge)
            waiting += self.behind[relay]

    def _depth(self, edge: Edge) -> int:
        return home_of(edge, self.flat.graph).depth

    def _make_end(self, port: Any) -> End | None:
        if is_feed(port):
            return End(ROOT, "observable", "observable", port)
        if isinstance(port, InnerSource | InnerTarget):
            return super()._make_end(port)
        return End(ROOT if port.node is self.flat.graph else 0, port.kind, port.name, port)

    def _finish(self, source: Any, target: Any, segments: tuple[Edge, ...], via: tuple[Any, ...]) -> None:
        """An edge has both ends inside of the same subgraphs that iterate: nothing else crosses their borders (G4)."""
        inside = {_side_of_port(port, self.flat.graph) for port in (source, target) if not is_feed(port)}
        if len(inside) > 1:
            self._report_border(target)
        else:
            super()._finish(source, target, segments, via)

    def _label(self, source: End, target: End) -> str:
        return f"{_end_path(source.port)} -> {_end_path(target.port)}"


def _end_path(port: Any) -> str:
    return "observable" if is_feed(port) else str(port.path)


def _side_of_port(port: Any, graph: HasLevel) -> Level:
    """On which side of the borders of what iterates a port is; the inner side of such a border is inside."""
    if port.node is graph:
        return level_of(graph)
    level = inside(port.node) if isinstance(port, InnerSource | InnerTarget) else level_of(port.node._place.graph)
    assert level is not None
    return side_of(level)
