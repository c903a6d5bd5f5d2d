"""Random graphs inside of subgraphs that iterate, inside of others that do (rule G4).

Stands on `making`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from hfg.graph import Graph, Subgraph
from hfg.nodetypes.functions import node
from hfg.ports import Input, Output
from hfg.testing.plans import EdgePlan, GraphPlan
from tests.support.making import FEEDS, Allowed, SeededChooser, Wide, make_plan

__all__ = ["IteratedPlan", "collections", "gather", "random_iterated"]

_MOST_OUTPUTS = 3


@node
def collections(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    """Give collections, of collections where the graph is so deep."""
    yield from values


@node
def gather(lists: Any) -> None:
    """Take what comes out."""


@dataclass(frozen=True)
class IteratedPlan:
    """A plan that is the inside of a subgraph that iterates.

    Attributes:
      inner: what is inside of the innermost.
      depth: how many subgraphs iterate around it, one inside of the other.
      outputs: how many things come out.
      values: by feed, the collections that go in.
      repeats: a feed that the subgraphs do not iterate over, if any.
    """

    inner: GraphPlan
    depth: int
    outputs: int
    values: dict[str, tuple[Any, ...]]
    repeats: str = ""

    def build(self) -> Graph:
        """Make the graph."""
        graph = Graph()
        box = graph.add(self._box(self.depth)(), name="each")
        for feed in self.inner.feeds:
            source = graph.add(collections(values=self.values[feed]), name=feed)
            graph.connect(source.ports.outputs["out"], box.ports.inputs[feed])
        for name in box.ports.outputs:
            graph.connect(box.ports.outputs[name], graph.add(gather(), name=f"to_{name}").ports.inputs["lists"])
        return graph

    __call__ = build

    def _box(self, depth: int) -> type[Subgraph]:
        plan = self
        names = [f"o{number}" for number in range(self.outputs)]

        def build(self: Any, graph: Graph) -> None:
            feeds = {feed: getattr(self, feed).inner for feed in plan.inner.feeds}
            outputs = {name: getattr(self, name).inner for name in names}
            if depth == 1:
                plan.inner.build_inside(graph, feeds | outputs)
                return
            box = graph.add(plan._box(depth - 1)(), name="each")
            for feed, source in feeds.items():
                graph.connect(source, box.ports.inputs[feed])
            for name, target in outputs.items():
                graph.connect(box.ports.outputs[name], target)

        body: dict[str, Any] = {"build": build, "__module__": __name__}
        body |= {feed: Input(Any) for feed in self.inner.feeds}
        body |= {name: Output(Any) for name in names}
        body["iterate_over"] = tuple(feed for feed in self.inner.feeds if feed != self.repeats)
        return type(f"Each{depth}", (Subgraph,), body)


def random_iterated(seed: int, allowed: Allowed) -> IteratedPlan:
    """Make the plan of a seed."""
    choose = SeededChooser(seed)
    inside = replace(allowed, sources=False, feeds=True, start=False, threads=False)
    inner = make_plan(choose, inside)
    while not inner.feeds:
        inner = make_plan(choose, inside)
    depth = choose.one_of([1, 1, 1, 2])
    shape = _shape(choose, depth)
    repeats = choose.one_of(FEEDS) if len(inner.feeds) > 1 and choose.chance(25) else ""
    values = {feed: tuple(_filled(choose, one) for one in shape) for feed in inner.feeds}
    if repeats:
        values[repeats] = tuple(choose.number(0, 6) for _ in shape)
    taken = {edge.source for edge in inner.edges}
    ends = [(one.name, "output", port) for one in inner.nodes for port in Wide.description(one.type).outputs]
    ends = [end for end in ends if end not in taken or choose.chance(30)]
    edges = [EdgePlan(end, ("", "input", f"o{number}")) for number, end in enumerate(ends[:_MOST_OUTPUTS])]
    return IteratedPlan(replace(inner, edges=(*inner.edges, *edges)), depth, len(edges), values, repeats)


def _shape(choose: SeededChooser, depth: int) -> list[Any]:
    """How long the collections are, those inside of them, and so on; None for an element."""
    count = choose.number(0, 3)
    return [None if depth == 0 else _shape(choose, depth - 1) for _ in range(count)]


def _filled(choose: SeededChooser, shape: Any) -> Any:
    if shape is None:
        return choose.one_of([1, 2, 0, 3, 4, 6, None])
    return [_filled(choose, one) for one in shape]
