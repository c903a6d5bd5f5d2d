"""Follows single declared edges through the ports of subgraphs (rule G1).

The cost depends only on the levels that an edge crosses. Flattening the whole graph would be simpler, but then an edit
would cost more in a larger graph.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from hfg.graph import Graph
from hfg.graph.flat import ROOT, EdgeFollower, End, FlatEdge, FlatGraph
from hfg.graph.structure.edge import Edge, is_feed
from hfg.graph.structure.level import HasLevel, Level, inside, level_of
from hfg.graph.structure.places import home_of, side_of
from hfg.graph.structure.subgraph import is_box, iterated
from hfg.ports import InnerSource, InnerTarget
from hfg.ports.edges import AnyEdge, BufferEdge

__all__ = ["Follower", "ends_of_running", "kind_of_end"]


class _Dissolved(Mapping[Any, Any]):
    """Contains every subgraph that is dissolved, each mapped to itself."""

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


class Follower(EdgeFollower):
    """Follows single edges across levels.

    The numbers of nodes in its results mean nothing: `via` holds subgraphs, and a node is known by its port.
    """

    def __init__(self, graph: Graph) -> None:
        super().__init__(FlatGraph([], [], [], graph.groups, [], graph, []), [])
        self.scope_of = _Dissolved()

    def begins(self, edge: Edge) -> Iterator[Edge]:
        """Yield the declared edges at which the paths over one begin."""
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
        """Return the edges of the plan that begin with a declared one, in order."""
        self.flat.edges = []
        self._look_ahead(begin)
        self.begin(begin)
        return self.flat.edges

    def _look_ahead(self, begin: Edge) -> None:
        """Find the relays on the way, and the edges that continue after them."""
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
        """Add an edge if both ends are inside the same iterating subgraphs: no edge crosses their boundary (G4)."""
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
    """Return the iterating subgraph that a port is inside of; the inner side of its own port is inside."""
    if port.node is graph:
        return level_of(graph)
    level = inside(port.node) if isinstance(port, InnerSource | InnerTarget) else level_of(port.node._place.graph)
    assert level is not None
    return side_of(level)


def ends_of_running(edge: AnyEdge) -> tuple[Any, ...]:
    """Return what identifies an edge: nodes and names of ports; ports of the graph and observables are themselves."""
    begin = edge.source if edge.source.node is not None else edge.source_port
    end = edge.target if edge.target.node is not None else edge.target_port
    source, target = edge.source_port, edge.target_port
    name = "observable" if is_feed(source) else source.name
    return begin, kind_of_end(source), name, end, kind_of_end(target), target.name, type(edge) is BufferEdge


def kind_of_end(port: Any) -> str:
    """Return the kind of a port, or "observable"."""
    return "observable" if is_feed(port) else str(port.kind)
