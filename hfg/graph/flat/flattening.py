"""One graph without subgraphs, as plain data: what a runner makes its plan from and what the checks look at (rule G1).

Subgraphs are dissolved: edges are followed through their ports from end to end, parameters to those they stand for.
An iterating subgraph (rule G4) stays one node with a flat graph of its own. Everything is in depth-first order of
adding, edges in that of connecting. Nothing recurses: graphs may be as deep as they like. Depends on `structure`;
changes nothing there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from reactivex import Observable

from hfg.errors import Problem
from hfg.graph.flat.flat_graph import ROOT, End, FlatEdge, FlatGate, FlatGraph, FlatNode, Scope, scope_end
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, is_port
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.joining import joined
from hfg.graph.structure.level import HasLevel, Level, inside, level_of
from hfg.graph.structure.options import NodeOptions, in_group
from hfg.graph.structure.subgraph import iterated
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, ParameterPort, Port


def flatten(graph: HasLevel) -> FlatGraph:
    """Dissolve all subgraphs of a whole graph; the graph stays as it is."""
    groups = level_of(graph).whole.groups.by_name
    whole = FlatGraph([], [], [], groups, [], graph, [])
    waiting = [(whole, "", "loop")]
    while waiting:
        flat, prefix, group = waiting.pop()
        levels = _collect_nodes(flat, prefix, group)
        for node in reversed(flat.nodes):
            inner = inside(node.node)
            if inner is not None and iterated(node.node):
                node.iteration = FlatGraph([], [], [], groups, [], inner.face, flat.findings)
                waiting.append((node.iteration, f"{node.path}/", node.options.group or "loop"))
        EdgeFollower(flat, levels).collect()
    return whole


def _collect_nodes(flat: FlatGraph, prefix: str, group: str) -> list[tuple[Level, int]]:
    """Fill nodes and scopes; give the levels they were found in, depth first, and how many scopes lie around each."""
    nodes, scopes = flat.nodes, flat.scopes
    levels = [(flat.level, 0)]
    # One entry for each graph that is in progress: what is left of it, and what holds for its nodes.
    stack: list[tuple[Iterator[tuple[str, Node]], str, tuple[int, ...], str]] = [
        (iter(flat.level.nodes.items()), prefix, (), group)
    ]
    while stack:
        rest, prefix, around, group = stack[-1]
        for name, node in rest:
            own: NodeOptions = node._options
            options = own if own.group is not None else in_group(own, group)
            path = prefix + name
            inner = None if own.iterate_over else inside(node)
            if inner is None:
                index = len(nodes)
                nodes.append(FlatNode(index, path, node, options, around))
                for scope in around:
                    scopes[scope].members.append(index)
                continue
            scope = len(scopes)
            scopes.append(Scope(scope, path, node, around[-1] if around else None, options, []))
            levels.append((inner, len(around) + 1))
            stack.append((iter(inner.nodes.items()), f"{path}/", (*around, scope), options.group or group))
            break
        else:
            stack.pop()
    return levels


class EdgeFollower:
    """Follows declared edges from end to end, through the ports of subgraphs, which only forward."""

    def __init__(self, flat: FlatGraph, levels: list[tuple[Level, int]]) -> None:
        self.flat = flat
        self.levels = levels
        self.ends: dict[object, End] = {}  # by port: both ends of a port are the same, but for parameters as well
        self.labels: dict[str, int] = {}
        self.index_of = {node.node: node.index for node in flat.nodes}
        self.scope_of: Mapping[object, int] = {scope.subgraph: scope.index for scope in flat.scopes}
        self.depth_of: dict[Edge, int] = {}
        # The edges that continue after a port of a dissolved subgraph: inside after inputs and slots, outside after
        # outputs and events.
        self.behind: dict[object, list[Edge]] = {}

    def collect(self) -> None:
        """Fill edges and gates."""
        if self.scope_of:
            self._find_relays()
        for level, _ in self.levels:
            for edge in level.edges:
                self.begin(edge)
        for level, _ in self.levels:
            for gate in level.gates:
                self._gate(gate)

    def _find_relays(self) -> None:
        for level, depth in self.levels:
            for edge in level.edges:
                self.depth_of[edge] = depth
                relay = self.relay(edge.source)
                if relay is not None:
                    self.behind.setdefault(relay, []).append(edge)

    def relay(self, end: SourceEnd) -> Port | None:
        """Return the port of a dissolved subgraph that an end is a side of; None if edges really begin or end there."""
        if isinstance(end, InnerSource | InnerTarget):
            return end.outer if end.node in self.scope_of else None
        if not isinstance(end, Port) or end.kind == "parameter" or end.node not in self.scope_of:
            return None
        return end if end.name in getattr(end.node._type, f"{end.kind}s") else None

    def begin(self, edge: Edge) -> None:
        """Follow an edge unless it begins at a relay; those are met on the way."""
        if not self.scope_of:
            self._finish(edge.source, edge.target, (edge,), ())
            return
        if self.relay(edge.source) is not None:
            return
        source: Any = edge.source
        via: tuple[int, ...] = ()
        if isinstance(source, ParameterPort):
            inner = next(self._inner_parameters(source), None)
            if inner is None:
                return
            source, via = inner
        # After a relay each edge continues a path; a relay that occurs twice in one closes a ring.
        stack: list[tuple[tuple[Edge, ...], tuple[Any, ...]]] = [((edge,), ())]
        while stack:
            segments, relays = stack.pop()
            target = segments[-1].target
            relay = self.relay(target)
            if relay is None:
                passed = (*via, *(self.scope_of[one.node] for one in relays))
                if isinstance(target, ParameterPort):
                    for parameter, further in self._inner_parameters(target):
                        self._finish(source, parameter, segments, (*passed, *further))
                else:
                    self._finish(source, target, segments, passed)
            elif any(relay is one for one in relays):
                self._report_ring(relay, edge)
            else:
                stack += [((*segments, onward), (*relays, relay)) for onward in reversed(self.behind.get(relay, ()))]

    def _inner_parameters(self, port: ParameterPort[Any]) -> Iterator[tuple[ParameterPort[Any], tuple[int, ...]]]:
        """Yield the parameters of nodes that one stands for, mostly itself, and the scopes on the way."""
        stack: list[tuple[ParameterPort[Any], tuple[int, ...]]] = [(port, ())]
        while stack:
            found, via = stack.pop()
            scope = self.scope_of.get(found.node)
            if scope is None:
                yield found, via
            else:
                inner = inside(found.node)
                behind = () if inner is None else inner.promotions.of(found.name)
                stack += [(parameter, (*via, scope)) for parameter in reversed(behind)]

    def _finish(self, source: SourceEnd, target: TargetEnd, segments: tuple[Edge, ...], via: tuple[int, ...]) -> None:
        begin, end = self._end(source), self._end(target)
        if begin is None or end is None:
            return
        options = segments[0].options
        if len(segments) > 1:
            outer = min(segments, key=self.depth_of.__getitem__)  # min gives the first of equals: nearest to the source
            options = joined([one.options for one in segments], outer.options)
        edges = self.flat.edges
        edges.append(FlatEdge(len(edges), self._label(begin, end), begin, end, options, via, segments))

    def _end(self, port: SourceEnd) -> End | None:
        found = self.ends.get(port)
        if found is None:
            found = self._make_end(port)
            if found is not None:
                self.ends[port] = found
        return found

    def _make_end(self, port: SourceEnd) -> End | None:
        if not isinstance(port, Port):
            return self._make_border(port)
        node = port.node
        index = self.index_of.get(node)
        if index is None:
            scope = self.scope_of.get(node)
            if scope is not None:
                index = scope_end(scope)
            elif node is self.flat.graph:
                index = ROOT
            else:
                self._report_border(port)
                return None
        return End(index, port.kind, port.name, port)

    def _make_border(self, port: InnerSource[Any] | InnerTarget[Any] | Observable[Any]) -> End | None:
        """Return the end that no node has: at what feeds from outside, or at the boundary of what iterates."""
        if not is_port(port):
            return End(ROOT, "observable", "observable", port)
        if port.kind in ("slot", "event"):
            return None  # no edge leads there from outside (rule G4)
        return End(ROOT, "output" if isinstance(port, InnerSource) else "input", port.name, port)

    def _label(self, source: End, target: End) -> str:
        label = f"{self._path(source)} -> {self._path(target)}"
        count = self.labels[label] = self.labels.get(label, 0) + 1
        return label if count == 1 else f"{label} #{count}"

    def _path(self, end: End) -> str:
        if end.node >= 0:
            return f"{self.flat.nodes[end.node].path}.{end.name}"
        if end.node == ROOT:
            around = self.flat.level.path
            return f"{around}.{end.name}" if around else end.name
        return f"{self.flat.scopes[scope_end(end.node)].path}.{end.name}"

    def _gate(self, gate: Gate) -> None:
        target, by = self._gate_end(gate.target), self._gate_end(gate.by)
        if target is not None and by is not None:
            self.flat.gates.append(FlatGate(target, by, gate.idle_rate_hz))
            return
        lost = gate.target if target is None else gate.by
        place = lost._place
        self.flat.findings.append(
            Problem(
                path=lost._type.name if place is None else place.path,
                severity="error",
                what="a gate names a node of another level",
                why="a gate does not reach into or out of a subgraph that iterates (rules A11, G4)",
                remedy="gate nodes on the same side",
                check="gate-border",
            )
        )

    def _gate_end(self, node: Node) -> int | None:
        index = self.index_of.get(node)
        if index is None and node in self.scope_of:
            return scope_end(self.scope_of[node])
        return index

    def _report_ring(self, relay: Port, edge: Edge) -> None:
        self.flat.findings.append(
            Problem(
                path=relay.path,
                severity="error",
                what=f"what comes over {edge.label} goes round through ports of subgraphs forever",
                why="no node lies on the way that would take it (rule G1)",
                remedy="remove one of the edges between the subgraphs' ports, or put a node on the way",
                check="relay-ring",
            )
        )

    def _report_border(self, port: Port) -> None:
        self.flat.findings.append(
            Problem(
                path=self.flat.level.path or port.path,
                severity="error",
                what=f'an edge to or from "{port.path}" crosses the border of a subgraph that iterates',
                why="only inputs, outputs and parameters do (rule G4)",
                remedy="take the edge out, or iterate_over",
                check="iteration-border",
            )
        )
