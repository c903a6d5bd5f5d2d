"""Rule G1 by structure: grouping nodes into nested subgraphs changes no edge.

A random graph is built twice, once flat and once with its nodes in random boxes, and both flatten to the same edges.
"""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hfg
from hfg.graph import Graph, Subgraph
from hfg.graph.flat import FlatGraph, flatten

pytestmark = pytest.mark.slow

Where = tuple[int, ...]  # the boxes around a node, the outermost first
LABEL = "box_{}"


class Unit(hfg.Node):
    a = hfg.Input(int, optional=True)
    b = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    more = hfg.Output(int)
    seen = hfg.Event(int)

    def process(self, a: int | None, b: int | None) -> tuple[int, int]: ...

    @hfg.slot
    def look(self, at: int) -> None: ...

    @hfg.slot
    def rest(self, at: int) -> None: ...


@st.composite
def plans(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Edges between at most six units, legal without any box."""
    size = draw(st.integers(1, 6))
    edges: list[dict[str, Any]] = []
    taken = set()
    for _ in range(draw(st.integers(0, 12))):
        source = (draw(st.integers(0, size - 1)), draw(st.sampled_from(["out", "more", "seen"])))
        target = (draw(st.integers(0, size - 1)), draw(st.sampled_from(["a", "b", "look", "rest"])))
        key = target if target[1] in "ab" else (source, target)
        if key in taken:
            continue
        taken.add(key)
        options: dict[str, Any] = {"active": draw(st.booleans())}
        if target[1] in "ab":
            options["initial"] = tuple(draw(st.lists(st.integers(0, 9), max_size=3)))
            if source[1] != "seen":
                options["buffer"] = draw(st.integers(0, 5))
        if source[1] == "seen":
            options["capacity"] = draw(st.integers(1, 20))
            if not options["active"]:
                options["overflow"] = draw(st.sampled_from(["wait", "drop_oldest", "drop_newest", "error"]))
        edges.append({"source": source, "target": target, "options": options})
    return edges


def places(size: int) -> st.SearchStrategy[list[Where]]:
    return st.lists(st.lists(st.integers(0, 1), max_size=3).map(tuple), min_size=size, max_size=size)


class Boxing:
    """Leads each edge over the borders between its ends, by ports made for it."""

    def __init__(self, places: list[Where], draw: Any) -> None:
        self.places = places
        self.draw = draw
        self.boxes = {where[:depth] for where in places for depth in range(len(where) + 1)}
        self.ports: dict[Where, dict[str, Any]] = {where: {} for where in self.boxes}
        self.parts: dict[Where, list[tuple[Any, Any, dict[str, Any]]]] = {where: [] for where in self.boxes}
        self.shared: dict[tuple[Where, Any], str] = {}  # what leaves a box may do so once for all its edges

    def lead(self, number: int, edge: dict[str, Any]) -> None:
        start, end = self.places[edge["source"][0]], self.places[edge["target"][0]]
        common = next(
            (d for d, (x, y) in enumerate(zip(start, end, strict=False)) if x != y), min(len(start), len(end))
        )
        share = self.draw(st.booleans())
        parts: list[tuple[Where, Any, Any, bool]] = []  # box, source, target, new
        at: Any = ("node", *edge["source"])
        kind = hfg.Event if edge["source"][1] == "seen" else hfg.Output
        for depth in range(len(start), common, -1):
            box = start[:depth]
            name = self.shared.get((box, edge["source"])) if share else None
            new = name is None
            if name is None:
                name = f"leave{number}"
                self.ports[box][name] = kind(int)
                if share:
                    self.shared[box, edge["source"]] = name
            parts.append((box, at, ("inner", name), new))
            at = ("box", box[-1], name)
        ways = []
        for depth in range(len(end), common, -1):
            box, name = end[:depth], f"enter{number}"
            self.ports[box][name] = hfg.Input(int) if self.draw(st.booleans()) else hfg.slot(type=int)
            ways.append((box, name))
        here = end[:common]
        for box, name in reversed(ways):
            parts.append((here, at, ("box", box[-1], name), True))
            here, at = box, ("inner", name)
        parts.append((here, at, ("node", *edge["target"]), True))
        self.share_out(edge["options"], parts, share)

    def share_out(self, options: dict[str, Any], parts: list[tuple[Where, Any, Any, bool]], share: bool) -> None:
        """Say on each part what together gives the options; a part that others use too is active and says no more."""
        own = [n for n, (_, _, target, _) in enumerate(parts) if not (share and target[0] == "inner")]
        said: list[dict[str, Any]] = [{"active": True} for _ in parts]
        if not options["active"]:
            cold = {self.draw(st.sampled_from(own)), *(n for n in own if self.draw(st.booleans()))}
            for n in cold:
                said[n]["active"] = False
        rest = list(options.get("initial", ()))
        for n in reversed(own):  # the one nearest to the consumer holds what is taken first
            count = len(rest) if n == own[0] else self.draw(st.integers(0, len(rest)))
            said[n]["initial"], rest = rest[:count], rest[count:]
        places = options.get("buffer", 0)
        for n in own:
            count = places if n == own[-1] else self.draw(st.integers(0, places))
            said[n]["buffer"], places = count, places - count
        outermost = min(range(len(parts)), key=lambda n: len(parts[n][0]))
        if "capacity" in options:
            said[outermost]["capacity"] = options["capacity"]
        if "overflow" in options:
            said[outermost]["overflow"] = options["overflow"]
            said[outermost]["active"] = said[outermost]["active"] and options["overflow"] == "wait"
        for (box, source, target, new), words in zip(parts, said, strict=True):
            if new:
                self.parts[box].append((source, target, words))

    def build(self) -> Graph:
        graph = Graph()
        self.fill((), graph, None)
        return graph

    def fill(self, where: Where, graph: Graph, owner: Any) -> None:
        for index, place in enumerate(self.places):
            if place == where:
                graph.add(Unit(), name=f"unit_{index}")
        for box in sorted(box for box in self.boxes if len(box) == len(where) + 1 and box[:-1] == where):
            body = {**self.ports[box], "build": lambda node, inside, box=box: self.fill(box, inside, node)}
            graph.add(type("Box", (Subgraph,), body)(), name=LABEL.format(box[-1]))
        for source, target, options in self.parts[where]:
            graph.connect(self.end(graph, owner, source, "out"), self.end(graph, owner, target, "in"), **options)

    def end(self, graph: Graph, owner: Any, end: Any, side: str) -> Any:
        if end[0] == "inner":
            return getattr(owner, end[1]).inner
        name = f"unit_{end[1]}" if end[0] == "node" else LABEL.format(end[1])
        return graph[f"{name}.{end[2]}"]


def edges_of(flat: FlatGraph) -> set[tuple[Any, ...]]:
    """What an observer sees of the edges: nodes by their last name, and no queue on synchronous ones."""
    return {
        (
            *(f"{flat.nodes[end.node].path.rpartition('/')[2]}.{end.name}" for end in (edge.source, edge.target)),
            edge.active,
            edge.options.initial,
            edge.options.buffer,
            (edge.options.capacity, edge.options.overflow) if edge.is_event_edge else None,
        )
        for edge in flat.edges
    }


@pytest.mark.rule("G1", "G3")
@given(st.data())
def test_grouping_changes_no_edge(data: st.DataObject) -> None:
    plan = data.draw(plans())
    size = 1 + max((end[0] for edge in plan for end in (edge["source"], edge["target"])), default=0)
    plain, boxed = Boxing([()] * size, data.draw), Boxing(data.draw(places(size)), data.draw)
    for number, edge in enumerate(plan):
        plain.lead(number, edge)
        boxed.lead(number, edge)
    ungrouped, grouped = plain.build(), boxed.build()
    flat = flatten(grouped)
    assert not flat.findings
    assert edges_of(flat) == edges_of(flatten(ungrouped))
    assert len(flat.edges) == len(plan)
    assert [p for p in grouped.check() if p.severity == "error" and "ring" not in p.what] == []
    names = [LABEL.format(box) for node in flat.nodes for box in boxed.places[int(node.path[-1])]]
    assert names == [flat.scopes[scope].path.rpartition("/")[2] for node in flat.nodes for scope in node.scopes]
    rings = [sum("ring" in p.what for p in graph.check()) for graph in (ungrouped, grouped)]
    assert rings[0] == rings[1]
