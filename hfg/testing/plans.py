"""Descriptions of random graphs: plain data that builds the same graph each time and prints as a program.

A plan is flat; boxes only group its nodes, and the relays at their boundaries are made while it is built. So a plan
with boxes and the same plan without boxes are the same graph in the sense of rule G1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from importlib import import_module
from typing import Any, Final

from hfg.graph import Graph, Subgraph
from hfg.ports import Event, Input, Output, slot

__all__ = ["LIBRARY", "BoxPlan", "EdgePlan", "GatePlan", "GraphPlan", "NodePlan"]

LIBRARY: Final = "hfg.testing.nodes"
"""The module that has the node types of a plan, unless the plan names another one."""


@dataclass(frozen=True)
class NodePlan:
    """One node: the name of its type in the plan's library, parameters, options."""

    name: str
    type: str
    parameters: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class EdgePlan:
    """One edge: ends as (node, kind, port), the graph's own ports with node ""."""

    source: tuple[str, str, str]
    target: tuple[str, str, str]
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BoxPlan:
    """A subgraph around nodes and other boxes that stand before it in the plan."""

    name: str
    members: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class GatePlan:
    """Rule A11."""

    target: str
    by: str
    idle_rate_hz: float | None = None


@dataclass(frozen=True)
class GraphPlan:
    """A graph; `build()` makes a new one, `repr` is the program that does."""

    nodes: tuple[NodePlan, ...]
    edges: tuple[EdgePlan, ...]
    boxes: tuple[BoxPlan, ...] = ()
    gates: tuple[GatePlan, ...] = ()
    groups: tuple[str, ...] = ()
    feeds: tuple[str, ...] = ()  # inputs of the graph, of whole numbers
    library: str = LIBRARY

    def build(self) -> Graph:
        """Make the graph."""
        return _Building(self).graph

    __call__ = build

    def build_inside(self, graph: Graph, border: Mapping[str, Any]) -> None:
        """Make it inside of a subgraph instead, whose ports stand for those of the graph."""
        _Building(self, graph, border)

    def flat(self) -> GraphPlan:
        """The same without boxes, and without declarations about them."""
        boxes = {box.name for box in self.boxes}
        return replace(
            self,
            edges=tuple(edge for edge in self.edges if boxes.isdisjoint((edge.source[0], edge.target[0]))),
            boxes=(),
            gates=tuple(gate for gate in self.gates if boxes.isdisjoint((gate.target, gate.by))),
        )

    def without(self, *, nodes: frozenset[str] = frozenset(), edges: frozenset[int] = frozenset()) -> GraphPlan:
        """A smaller plan, for those who look for the smallest."""
        return replace(
            self,
            nodes=tuple(node for node in self.nodes if node.name not in nodes),
            edges=tuple(
                edge
                for index, edge in enumerate(self.edges)
                if index not in edges and edge.source[0] not in nodes and edge.target[0] not in nodes
            ),
            boxes=tuple(replace(box, members=tuple(m for m in box.members if m not in nodes)) for box in self.boxes),
            gates=tuple(gate for gate in self.gates if gate.target not in nodes and gate.by not in nodes),
        )

    def paths(self) -> dict[str, str]:
        """The path of each node, by its name."""
        around = self._around()
        return {node.name: "/".join([*around[node.name], node.name]) for node in self.nodes}

    def _around(self) -> dict[str, list[str]]:
        """The boxes around each node and box, outermost first."""
        parent = {member: box.name for box in self.boxes for member in box.members}
        found = {}
        for name in [node.name for node in self.nodes] + [box.name for box in self.boxes]:
            chain: list[str] = []
            here = name
            while here in parent:
                here = parent[here]
                chain.insert(0, here)
            found[name] = chain
        return found

    def __repr__(self) -> str:
        return _Writing(self).text()

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        printer.text(f"\n{self!r}\n")  # Hypothesis would print the fields


@dataclass(frozen=True)
class _Segment:
    """One drawn edge: in which box ("" is the whole), from and to what, with which options."""

    box: str
    source: str
    target: str
    options: dict[str, Any]


class _Drawing:
    """Where every segment of every edge lies, and the relays between them; for building and for writing alike."""

    def __init__(self, plan: GraphPlan) -> None:
        self.plan = plan
        self.around = plan._around()
        self.relays: dict[str, list[tuple[str, str]]] = {box.name: [] for box in plan.boxes}  # name and kind
        self.segments: dict[str, list[_Segment]] = {name: [] for name in ("", *(box.name for box in plan.boxes))}
        for index, edge in enumerate(plan.edges):
            self._draw(index, edge)

    def _draw(self, index: int, edge: EdgePlan) -> None:
        begin, end = self._boxes(edge.source), self._boxes(edge.target)
        if edge.source[:2] == ("", "event"):  # `start` may be named anywhere; draw it where the target is
            begin = end
        if edge.target[0] == "" and edge.target[1] != "input":
            end = begin
        shared = 0
        while shared < min(len(begin), len(end)) and begin[shared] == end[shared]:
            shared += 1
        out_kind = "event" if edge.source[1] == "event" else "output"
        in_kind = "slot" if edge.target[1] == "slot" else "input"
        ends: list[tuple[str, str, str]] = []  # box, source, target
        here = _port(edge.source)
        for box in reversed(begin[shared:]):
            relay = f"r{index}"
            self.relays[box].append((relay, out_kind))
            ends.append((box, here, f"self.{relay}.inner"))
            here = f"{box}.ports.{out_kind}s[{relay!r}]"
        inward = end[shared:]
        level = begin[shared - 1] if shared else ""
        for box in inward:
            relay = f"r{index}"
            self.relays[box].append((relay, in_kind))
            ends.append((level, here, f"{box}.ports.{in_kind}s[{relay!r}]"))
            level, here = box, f"self.{relay}.inner"
        ends.append((level, here, _port(edge.target)))
        outermost = len(begin) - shared
        for number, (box, source, target) in enumerate(ends):
            options = {name: value for name, value in edge.options.items() if name == "active"}
            if number == outermost:
                apart = ("active", "initial", "buffer")
                options |= {name: value for name, value in edge.options.items() if name not in apart}
            buffer = _share(edge.options.get("buffer", 0), number, len(ends))
            if buffer:
                options["buffer"] = buffer
            if number == len(ends) - 1 and "initial" in edge.options:
                options["initial"] = edge.options["initial"]
            self.segments[box].append(_Segment(box, source, target, options))

    def _boxes(self, end: tuple[str, str, str]) -> list[str]:
        return self.around[end[0]] if end[0] else []

    def inside(self, box: str) -> list[NodePlan | BoxPlan]:
        """Nodes and boxes that lie directly in a box, or in the whole."""
        members = next((one.members for one in self.plan.boxes if one.name == box), ())
        everything: list[NodePlan | BoxPlan] = [*self.plan.nodes, *self.plan.boxes]
        if box:
            return [one for one in everything if one.name in members]
        return [one for one in everything if not self.around[one.name]]


def _share(places: int, number: int, parts: int) -> int:
    """Return how many places of a buffer lie on one part of an edge: they add up (G1)."""
    return places // parts + (number < places % parts)


def _port(end: tuple[str, str, str]) -> str:
    node, kind, name = end
    if node == "" and kind == "output":
        return f"graph.inputs[{name!r}]"
    if node == "" and kind == "input":
        return f"graph.outputs[{name!r}]"
    return f"graph.{name}" if node == "" else f"{node}.ports.{kind}s[{name!r}]"


_RELAYS: Final[dict[str, Any]] = {"input": Input, "output": Output, "event": Event}


class _Building:
    """Builds what is drawn."""

    def __init__(self, plan: GraphPlan, around: Graph | None = None, border: Mapping[str, Any] | None = None) -> None:
        self.drawing = _Drawing(plan)
        self.made: dict[str, Any] = {}
        self.library = import_module(plan.library)
        self.graph = Graph() if around is None else around
        for group in plan.groups if around is None else ():
            self.graph.group(group, threads=1)
        self.border = {feed: self.graph.input(feed, int) for feed in plan.feeds} if border is None else border
        self._fill("", self.graph, None)
        for gate in plan.gates:
            self.graph.gate(self.made[gate.target], by=self.made[gate.by], idle_rate_hz=gate.idle_rate_hz)

    def _fill(self, box: str, graph: Graph, owner: Any) -> None:
        for one in self.drawing.inside(box):
            if isinstance(one, NodePlan):
                node = getattr(self.library, one.type)(**one.parameters)
            else:
                node = self._box(one)()
            graph.add(node, name=one.name, **one.options)
            self.made[one.name] = node
        for segment in self.drawing.segments[box]:
            graph.connect(
                self._end(segment.source, graph, owner), self._end(segment.target, graph, owner), **segment.options
            )

    def _end(self, text: str, graph: Graph, owner: Any) -> Any:
        if text.startswith(("graph.inputs[", "graph.outputs[")):
            return self.border[text.partition("[")[2].strip("']")]
        if text.startswith("graph."):
            return getattr(graph, text[6:])
        if text.startswith("self."):
            return getattr(owner, text.split(".")[1]).inner
        name, _, rest = text.partition(".ports.")
        kind, _, port = rest.partition("[")
        return getattr(self.made[name].ports, kind)[port.strip("]'")]

    def _box(self, plan: BoxPlan) -> type[Subgraph]:
        building = self

        def build(self: Any, graph: Graph) -> None:
            building._fill(plan.name, graph, self)

        body: dict[str, Any] = {"build": build, "__module__": __name__}
        for name, kind in self.drawing.relays[plan.name]:
            body[name] = slot(type=Any) if kind == "slot" else _RELAYS[kind](Any)
        return type(plan.name.capitalize(), (Subgraph,), body)


class _Writing:
    """Writes what is drawn."""

    def __init__(self, plan: GraphPlan) -> None:
        self.plan = plan
        self.drawing = _Drawing(plan)

    def text(self) -> str:
        lines = ["import hfg", "from typing import Any", f"from {self.plan.library} import *"]
        lines.append("")
        for box in self.plan.boxes:
            lines += self._class(box)
        lines.append("graph = hfg.Graph()")
        lines += [f"graph.group({group!r}, threads=1)" for group in self.plan.groups]
        lines += [f"graph.input({feed!r}, int)" for feed in self.plan.feeds]
        lines += self._body("")
        for gate in self.plan.gates:
            rate = "" if gate.idle_rate_hz is None else f", idle_rate_hz={gate.idle_rate_hz!r}"
            lines.append(f"graph.gate({self._name(gate.target)}, by={self._name(gate.by)}{rate})")
        return "\n".join(lines)

    def _name(self, name: str) -> str:
        path = "/".join([*self.drawing.around[name], name])
        return f"graph[{path!r}]"

    def _class(self, box: BoxPlan) -> list[str]:
        kinds = {
            "input": "hfg.Input(Any)",
            "output": "hfg.Output(Any)",
            "event": "hfg.Event(Any)",
            "slot": "hfg.slot(type=Any)",
        }
        lines = [f"class {box.name.capitalize()}(hfg.Subgraph):"]
        lines += [f"    {name} = {kinds[kind]}" for name, kind in self.drawing.relays[box.name]]
        lines.append("    def build(self, graph):")
        return lines + ["        " + line for line in self._body(box.name) or ["pass"]] + [""]

    def _body(self, box: str) -> list[str]:
        lines = []
        for one in self.drawing.inside(box):
            if isinstance(one, NodePlan):
                made = f"{one.type}({_arguments(one.parameters)})"
            else:
                made = f"{one.name.capitalize()}()"
            lines.append(f"{one.name} = graph.add({made}, name={one.name!r}{_arguments(one.options, ', ')})")
        return lines + [
            f"graph.connect({segment.source}, {segment.target}{_arguments(segment.options, ', ')})"
            for segment in self.drawing.segments[box]
        ]


def _arguments(values: dict[str, Any], before: str = "") -> str:
    return before + ", ".join(f"{name}={_written(value)}" for name, value in values.items()) if values else ""


def _written(value: Any) -> str:
    return f"{type(value).__name__}.{value.name}" if isinstance(value, Enum) else repr(value)
