"""The diff of a plan: what an edit means to it, at a cost that depends on the edit only (rules R4, G1).

Nodes that stay are recognised by identity, edges by the ports at their ends, so that grouping nodes into a subgraph
moves no token. Only nodes and declared edges that a change names, or that are inside such a node, are examined: the
paths over those edges are followed again and compared with the running edges. Flattening the graph and comparing two
plans would be simpler, but each edit would cost as much as a start. This module decides; `applying` changes the plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from hfg.engine.editing.following import Follower, ends_of_running, kind_of_end
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
from hfg.graph.flat import ROOT, FlatEdge
from hfg.graph.structure.edge import Edge, is_feed, type_of
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.options import NodeOptions
from hfg.graph.structure.places import edge_place, effective_options, home_of, is_attached, is_in, side_of
from hfg.graph.structure.subgraph import is_box, iterated
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget
from hfg.ports.edges import AnyEdge
from hfg.types import why_not

__all__ = ["PlanDiff", "diff"]

_JOINED = ("input", "parameter")


class PlanDiff(msgspec.Struct, eq=False):
    """The changes of a plan.

    Attributes:
      come: new nodes with their options, in any order.
      gone: workers of removed nodes.
      swapped: workers that get another node, with the old and the new one.
      placed: workers of nodes that stay, but may have another place in the order or another subgraph.
      options: workers of nodes that stay, with their options from now on.
      renamed: workers of nodes and subgraphs with another path.
      boxes_come, boxes_gone, boxes_placed: the same for subgraphs that are dissolved.
      old: the running edges that were examined.
      ways: the edges that replace them, in order, each with the running edge that it continues, if any.
      lost: running edges that end.
      gates: gates must be set again.
      touched: workers that must not fire meanwhile.
      doubtful: only a check of the whole graph can tell whether it is sound.
    """

    come: dict[Node, NodeOptions] = {}
    gone: list[RunningNode] = []
    swapped: list[tuple[RunningNode, Node, Node]] = []
    placed: list[RunningNode] = []
    options: list[tuple[RunningNode, NodeOptions]] = []
    renamed: list[RunningNode] = []
    boxes_come: dict[Node, NodeOptions] = {}
    boxes_gone: list[RunningNode] = []
    boxes_placed: list[RunningNode] = []
    old: list[AnyEdge] = []
    ways: list[tuple[FlatEdge, AnyEdge | None]] = []
    lost: list[AnyEdge] = []
    gates: bool = False
    touched: list[RunningNode] = []
    doubtful: bool = False


def diff(graph: Graph, index: PlanIndex, changes: Sequence[Change]) -> PlanDiff:
    """Find what changes of the declared graph mean to the plan of its run.

    Args:
      graph: the declared graph, after the changes.
      index: the index of the plan, before them. Only the order of its nodes is changed, to one that is also valid
        without the changes.
      changes: all changes since the plan was made or last edited.
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
        self.swaps: dict[Node, RunningNode | None] = {}  # by node: the worker that takes it over; None: no longer
        self.insides: list[Level] = []  # of subgraphs that came, went or moved
        self.follower = Follower(graph)

    # --- nodes

    def worker_of(self, node: Node) -> RunningNode | None:
        """Return the worker that a node has, or takes over."""
        return self.swaps[node] if node in self.swaps else self.index.by_node.get(node)

    def nodes(self) -> None:
        """Compare the nodes that changes name, and all inside them."""
        found = self.found
        swapped: dict[RunningNode, Node] = {}
        placed: dict[Node, None] = {}
        told: dict[Node, None] = {}
        for change in self.changes:
            if isinstance(change, NodeSwap):
                worker = self.worker_of(change.old)
                self.swaps[change.old], self.swaps[change.new] = None, worker
                if worker is not None:
                    swapped[worker] = change.new
                if change.old in placed:
                    placed[change.new] = None  # the replaced node had moved before
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

    def _within(self, node: Node, was: Level | None, levels: list[Level] | None) -> Iterator[Node]:
        """Yield a node and all inside it; add the inner levels to `levels`."""
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

    def _is_leaf(self, node: Node) -> bool:
        worker = self.worker_of(node)
        return not is_box(node) or bool(iterated(node)) or (worker is not None and worker.scope is None)

    def _compare_node(self, node: Node, *, moved: bool) -> None:
        found, worker, stays = self.found, self.worker_of(node), is_in(node, self.graph)
        leaf = self._is_leaf(node)
        if not stays:
            if worker is not None:
                (found.gone if leaf else found.boxes_gone).append(worker)
            return
        place, options = node._place, effective_options(node)
        assert place is not None
        self.found.doubtful |= options.group is not None and options.group not in self.graph.groups
        if worker is None:
            found.doubtful |= node._type.is_source and side_of(level_of(place.graph)).owner is not None
            (found.come if leaf else found.boxes_come)[node] = options
            return
        if moved:
            (found.placed if leaf else found.boxes_placed).append(worker)
        if worker.path != place.path:
            found.renamed.append(worker)
        if leaf:
            found.options.append((worker, options))

    # --- edges

    def edges(self) -> None:
        """Follow all paths over the declared edges that were touched."""
        index, found = self.index, self.found
        homes, before, rubbed_out = self._touched_edges()
        affected: dict[AnyEdge, None] = {}
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
        present: dict[tuple[object, ...], list[AnyEdge]] = {}
        for running in found.old:
            if rubbed_out.isdisjoint(running.segments):
                present.setdefault(ends_of_running(running), []).append(running)
        in_order = sorted(begins, key=lambda begin: edge_place(homes.get(begin) or home_of(begin, self.graph), begin))
        kept = set()
        for begin in in_order:
            for way in self.follower.block(begin):
                same = present.get(self._ends_of(way))
                goes_on = same.pop(0) if same else None
                kept.add(goes_on)
                found.ways.append((way, goes_on))
        found.lost = [running for running in found.old if running not in kept]

    def _touched_edges(self) -> tuple[dict[Edge, Level | None], dict[Edge, Edge], set[Edge]]:
        """Return the edges that changes declare or delete, with the level where each is now.

        Return also which edge one replaces, and which were deleted permanently.
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
            is_there = is_attached(level, self.graph) and edge in level.connections.order
            homes[edge] = level if is_there else homes.get(edge)
        for edge, home in homes.items():
            if home is not None and edge not in home.connections.order:
                homes[edge] = None
        return homes, before, rubbed_out

    def _edges_of_promoted(self, change: PromotionChange) -> Iterator[tuple[Level, Edge]]:
        """Yield the edges at parameters, of the subgraph and of those around it, that stand for others than before."""
        names = [
            name for name in {**change.before, **change.after} if change.before.get(name) != change.after.get(name)
        ]
        owner = change.level.owner
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

    def _ends_of(self, way: FlatEdge) -> tuple[object, ...]:
        roomy = bool(way.options.initial or way.options.buffer) and not way.is_event_edge  # another class of edge
        source, target = way.source, way.target
        begin, end = self._of_node(source.port) or source.port, self._of_node(target.port) or target.port
        return begin, kind_of_end(source.port), source.name, end, kind_of_end(target.port), target.name, roomy

    def _of_node(self, port: Any) -> RunningNode | None:
        """Return the worker of a port's node; the inner side of a port has none, and stands for itself (G4)."""
        node = getattr(port, "node", None)
        return None if node is None or isinstance(port, InnerSource | InnerTarget) else self.worker_of(node)

    # --- soundness

    def judge(self) -> None:
        """Find whether the graph is certainly sound; otherwise a check of the whole graph decides (R4)."""
        found = self.found
        changes = [(way, old) for way, old in found.ways if old is None or old.segments != way.segments]
        changed = [way for way, _ in changes]
        closes_a_ring = self._closes_a_ring()  # always called: the index learns from it
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
        """Return whether a node with concurrent firings comes, or gets something it cannot have with them (F14)."""
        found = self.found
        options = [*found.come.values(), *(options for _, options in found.options)]
        options += [effective_options(node) for _, _, node in found.swapped]
        ends = [end.port for way in changed if way.active for end in (way.source, way.target)]
        options += [getattr(getattr(port, "node", None), "_options", None) or NodeOptions() for port in ends]
        return any(one.concurrency > 1 for one in options)

    def _closes_a_ring(self) -> bool:
        """Return whether new edges close a cycle of synchronous edges without a delay (P7)."""
        joined = [
            (self._old_node(way.source.port), self._old_node(way.target.port))
            for way, running in self.found.ways
            if running is None and not way.is_event_edge and not way.options.initial and way.target.kind in _JOINED
            if way.source.node != ROOT and way.target.node != ROOT
        ]
        return self.index.order.closes_a_ring(joined, self.found.lost)

    def _waits_in_thread(self) -> bool:
        """Return whether async code would be in a group that is a thread."""
        found = self.found
        threads = {name for name, group in self.graph.groups.items() if group.threads}
        nodes = [*found.come.items(), *((worker.node, options) for worker, options in found.options)]
        nodes += [(node, effective_options(node)) for _, _, node in found.swapped]
        return any(options.group in threads and _may_wait(node._type) for node, options in nodes)

    def _old_node(self, port: Any) -> Any:
        """Return the node by which the index knows a worker."""
        worker = self._of_node(port)
        return port.node if worker is None else worker.node

    def _fits(self, way: FlatEdge) -> bool:
        """Return whether the parts of an edge through subgraphs certainly make a sound edge."""
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

    def _are_doubled(self, changes: Sequence[tuple[FlatEdge, AnyEdge | None]]) -> bool:
        """Return whether an input may have two edges, or two ports be connected twice (P2)."""
        into = set()
        moved = {*self.found.lost, *(running for _, running in changes)}  # all others stay
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
        """Return the reader of an output of a subgraph that iterates, if it has one."""
        box = self.worker_of(port.node)
        readers = () if box is None or box.iteration is None else box.iteration.readers
        return next((reader for reader in readers if reader.port_name == port.name), None)

    # --- who must rest

    def touch(self) -> None:
        """Find the workers that must not fire meanwhile."""
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


def _may_wait(kind: NodeType) -> bool:
    """Return whether nodes of a type have async code."""
    waits = kind.process_kind.startswith("async") or "do" in kind.hooks
    return waits or any(slot.is_async for slot in kind.slots.values())
