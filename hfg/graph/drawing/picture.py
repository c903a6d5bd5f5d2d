"""What is to be seen of a graph: boxes, shapes and arrows, before anybody has chosen a format.

Edges are drawn as they were connected; the ports of subgraphs, and those of the whole graph, are shapes of their own,
so an arrow never begins or ends at a box. Nothing recurses: graphs may be as deep as they like. Stands on `structure`;
changes nothing there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeGuard

import msgspec

from hfg.graph.structure.edge import Edge, PortEnd, SourceEnd, is_feed, is_port
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.options import DEFAULT_CAPACITY, EdgeOptions, NodeOptions
from hfg.graph.structure.subgraph import inside, is_box
from hfg.nodetype import Node
from hfg.ports import InnerSource, InnerTarget, Port

if TYPE_CHECKING:
    from hfg.graph.graph import Graph

__all__ = ["Arrow", "Box", "Look", "Picture", "Shape", "picture"]

Look: TypeAlias = Literal["node", "port", "start", "stop", "feed"]

_LONGEST = 40  # characters of an initial value


class Shape(msgspec.Struct):
    """A node, or a port that is drawn by itself.

    Attributes:
      id: "n0", "n1", ... in order of appearance.
      label: lines of text, as users wrote it.
      is_state: an active edge begins or ends here.
      is_active: it is active now, in a run.
    """

    id: str
    label: str
    look: Look
    is_state: bool = False
    is_active: bool = False


class Box(msgspec.Struct):
    """A subgraph; what is in it follows it with a greater depth."""

    id: str
    label: str


class Arrow(msgspec.Struct):
    """An edge or a gate.

    Attributes:
      is_signal: it begins at an event.
      is_active: it transports activity: the double line of the paper.
      is_gate: it is no edge; the tail is the state, the head what rests meanwhile.
    """

    tail: str
    head: str
    label: str
    is_signal: bool = False
    is_active: bool = False
    is_gate: bool = False


class Picture(msgspec.Struct):
    """Everything to draw.

    Attributes:
      items: boxes and shapes, each with its depth, the content of a box behind it.
    """

    title: str
    items: list[tuple[int, Box | Shape]]
    arrows: list[Arrow]


def picture(graph: Graph) -> Picture:
    """Look at a graph, or at the inside of a subgraph alone."""
    return _Look(level_of(graph)).picture


class _Look:
    """One walk through a graph and all that is inside."""

    def __init__(self, level: Level) -> None:
        self.level = level
        self.picture = Picture(level.path or level.name, [], [])
        self.ids: dict[Any, str] = {}  # of nodes, and of ports that are drawn by themselves
        self.shapes: dict[str, Shape] = {}
        self.boxes = 0
        self.edges = [edge for one in _depth_first(level) for edge in one.edges]
        self.gates = [gate for one in _depth_first(level) for gate in one.gates]
        self.on_boxes = _ports_of_boxes(self.edges)
        for gate in self.gates:
            for node, what in ((gate.target, "gate"), (gate.by, "active")):
                if is_box(node):
                    self.on_boxes.setdefault(node, {})[node, what] = what
        self._own_ports()
        self._nodes()
        for edge in self.edges:
            self._edge(edge)
        for gate in self.gates:
            self._gate(gate)
        for one in _depth_first(level):
            self._promotions(one)

    def _own_ports(self) -> None:
        """Draw the ports of the whole: inputs and outputs always, the others where they are used."""
        ports = self.level.ports
        used = {id(end) for edge in self.edges for end in (edge.source, edge.target)}
        for port in (ports.start, *ports.inputs.values(), *ports.outputs.values(), ports.stop, ports.abort):
            if id(port) in used or port.kind in ("input", "output"):
                look: Look = "start" if port is ports.start else "stop" if port.kind == "slot" else "port"
                self._shape(0, port, port.name, look)
        for port, name in self.on_boxes.get(self.level.owner, {}).items():  # the inside of a subgraph, drawn alone
            self._shape(0, port, name, "port")

    def _nodes(self) -> None:
        stack = [iter(self.level.nodes.items())]
        while stack:
            depth = len(stack) - 1
            for name, node in stack[-1]:
                ports = self.on_boxes.get(node, {})
                inner = inside(node)
                if inner is None or not (inner.nodes or ports):
                    self._shape(depth, node, _node_label(name, node._options), "node")
                    continue
                self.picture.items.append((depth, Box(f"g{self.boxes}", _box_label(name, node._options))))
                self.boxes += 1
                for port, port_name in ports.items():
                    self._shape(depth + 1, port, port_name, "port")
                stack.append(iter(inner.nodes.items()))
                break
            else:
                stack.pop()

    def _edge(self, edge: Edge) -> None:
        ends = self._end(edge.source), self._end(edge.target)
        is_signal = is_feed(edge.source) or edge.source.kind in ("event", "slot")
        label = ", ".join(part for part in (_ports_label(edge), *_options(edge.options)) if part)
        self.picture.arrows.append(Arrow(*ends, label, is_signal, edge.active))
        for end in ends:
            if edge.active and self.shapes[end].look == "node":
                self.shapes[end].is_state = True

    def _end(self, end: SourceEnd) -> str:
        if not is_port(end):
            return self.ids[end] if end in self.ids else self._shape(0, end, "observable", "feed")
        port = _outside(end)
        return self.ids[port] if port in self.ids else self.ids[port.node]

    def _gate(self, gate: Gate) -> None:
        by, target = (
            self.ids[node] if node in self.ids else self.ids[node, what]
            for node, what in ((gate.by, "active"), (gate.target, "gate"))
        )
        label = "gate" if gate.idle_rate_hz is None else f"gate, else {gate.idle_rate_hz:g} Hz"
        self.picture.arrows.append(Arrow(by, target, label, is_gate=True))

    def _promotions(self, level: Level) -> None:
        """Lead a drawn parameter of a subgraph to those that it stands for."""
        if level.owner is None:
            return
        for name, ports in level.promotions.by_name.items():
            outer = self.ids.get(level.owner.ports.parameters[name])
            if outer is not None:
                self.picture.arrows += [Arrow(outer, self._end(inner), f"→ {inner.name}") for inner in ports]

    def _shape(self, depth: int, of: object, label: str, look: Look) -> str:
        shape = Shape(f"n{len(self.shapes)}", label, look, is_active=isinstance(of, Node) and of.active)
        self.picture.items.append((depth, shape))
        self.shapes[shape.id] = shape
        self.ids[of] = shape.id
        return shape.id


def _depth_first(level: Level) -> Iterator[Level]:
    """Give a level and all that are in its boxes, each box before the next."""
    waiting = [level]
    while waiting:
        one = waiting.pop()
        yield one
        waiting += [inner for node in reversed(one.nodes.values()) if (inner := inside(node)) is not None]


def _ports_of_boxes(edges: Iterable[Edge]) -> dict[Any, dict[Any, str]]:
    """Give, for each subgraph, its ports that an edge leads to or from, outside or inside, with their names."""
    found: dict[Any, dict[Any, str]] = {}
    for edge in edges:
        for end in (edge.source, edge.target):
            if not is_feed(end) and is_box(end.node):
                port = _outside(end)
                found.setdefault(port.node, {})[port] = port.name
    return found


def _outside(end: PortEnd) -> Port:
    """Give the port of a subgraph that an inner side belongs to; another port is its own."""
    return end.outer if isinstance(end, InnerSource | InnerTarget) else end


# --- labels ---


def _node_label(name: str, options: NodeOptions) -> str:
    said = []
    if options.max_rate_hz is not None:
        said.append(f"{options.max_rate_hz:g} Hz")
    if options.active_for_s is not None:
        said.append(f"active for {options.active_for_s:g} s")
    if not options.enabled:
        said.append("disabled")
    return "\n".join([name, *said])


def _box_label(name: str, options: NodeOptions) -> str:
    each = ", ".join(options.iterate_over)
    return _node_label(name, options) + (f"\nfor each of {each}" if each else "")


def _ports_label(edge: Edge) -> str:
    """Name the ports, unless there is only one that it could be, or the port is drawn by itself."""
    source, target = _source_name(edge.source), _target_name(edge.target)
    if source == target or not target:
        return source
    return f"{source} → {target}" if source else f"→ {target}"


def _source_name(end: SourceEnd) -> str:
    if not _is_on_node(end):
        return ""
    kind = end.node._type
    is_only = end.kind == "output" and len(kind.outputs) == 1 and end.name == "out"
    return "" if is_only else end.name


def _target_name(end: SourceEnd) -> str:
    if not _is_on_node(end):
        return ""
    kind = end.node._type
    is_only = len(kind.inputs) + len(kind.slots) == 1 and (end.name in kind.inputs or end.name in kind.slots)
    return "" if is_only else end.name


def _is_on_node(end: SourceEnd) -> TypeGuard[Port]:
    return isinstance(end, Port) and isinstance(end.node, Node) and not is_box(end.node)


def _options(options: EdgeOptions) -> Iterator[str]:
    if options.overflow != "wait":
        yield options.overflow
    if options.capacity != DEFAULT_CAPACITY and options.overflow != "latest":
        yield f"capacity {options.capacity}"
    if options.capacity_limit is not None:
        yield f"at most {options.capacity_limit}"
    if options.through:
        count = len(options.through)
        yield "1 operator" if count == 1 else f"{count} operators"
    if options.buffer:
        yield f"buffer {options.buffer}"
    if options.initial:
        values = [repr(value) for value in options.initial]
        text = ", ".join(value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…" for value in values[:4])
        yield f"initial {text}" + (f" and {len(values) - 4} more" if len(values) > 4 else "")
