"""The visible parts of a graph: boxes, shapes and arrows, in no particular format.

Edges are drawn as they were connected; the ports of subgraphs, and those of the whole graph, are shapes of their own,
so an arrow never begins or ends at a box. The content of a folded subgraph is not shown; its edges end at the
subgraph. Nothing recurses: graphs may be as deep as they like. Depends on `structure`; changes nothing there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, TypeGuard

from hfg.graph.drawing.seen import EVERYTHING, Arrow, Look, Picture, Pin, Shape, View
from hfg.graph.structure.edge import Edge, PortEnd, SourceEnd, end_path, is_feed, is_port
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import HasLevel, Level, inside, level_of
from hfg.graph.structure.monitors import node_part
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.option import declared
from hfg.graph.structure.options import EdgeOptions, NodeOptions
from hfg.graph.structure.subgraph import is_box
from hfg.monitors.formulas import Sent
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port

_LAST: Final = 1_000_000  # ports that every node has come after its own


def picture(graph: HasLevel, view: View = EVERYTHING) -> Picture:
    """Return the picture of a graph, or of only the inside of a subgraph."""
    return _Look(level_of(graph), view).picture


class _Look:
    """One walk through a graph and all that is open inside."""

    def __init__(self, level: Level, view: View) -> None:
        self.level = level
        self.view = view
        self.open, self.hidden_in = _opened(level, view)
        self.lit = _lit(level, view)
        self.monitors = _monitors(level)
        self.picture = Picture(level.path or level.name, [], [], list(level.whole.groups.by_name))
        self.ids: dict[object, str] = {}  # of nodes, and of ports that are drawn by themselves
        self.shapes: dict[str, Shape] = {}
        self.boxes = 0
        self.edges = [edge for one in self.open for edge in one.edges]
        gates = [(gate, self._seen(gate)) for one in _depth_first(level) for gate in one.gates]
        # A node may be its own gate; a gate between two that are folded into one box is not seen.
        self.gates = [seen for gate, seen in gates if seen.by is not seen.target or gate.by not in self.hidden_in]
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
        for one in self.open:
            self._promotions(one)

    def _seen(self, gate: Gate) -> Gate:
        """Let a gate lead to and from what is seen of its two nodes."""
        target, by = (self.hidden_in.get(node, node) for node in (gate.target, gate.by))
        return Gate(target, by, gate.idle_rate_hz)

    def _own_ports(self) -> None:
        """Draw the ports of the whole: inputs and outputs always, the others where they are used."""
        ports = self.level.ports
        used = {id(end) for edge in self.edges for end in (edge.source, edge.target)}
        for port in (ports.start, *ports.inputs.values(), *ports.outputs.values(), ports.stop, ports.abort):
            if id(port) in used or port.kind in ("input", "output"):
                look: Look = "start" if port is ports.start else "stop" if port.kind == "slot" else "port"
                self._shape(0, port, port.name, look, port.kind)
        for port, name in self.on_boxes.get(self.level.owner, {}).items():  # the inside of a subgraph, drawn by itself
            self._port_of_box(0, port, name)

    def _nodes(self) -> None:
        stack = [(iter(self.level.nodes.items()), self._group_around())]
        insides = set(self.open)
        while stack:
            depth = len(stack) - 1
            nodes, around = stack[-1]
            for name, node in nodes:
                options, ports, inner = node._options, self.on_boxes.get(node, {}), inside(node)
                group = options.group or around
                if inner is None or inner not in insides or not (inner.nodes or ports):
                    self._node(depth, name, node, group)
                    continue
                box = self._shape_of(f"g{self.boxes}", name, "box", node, group)
                self.boxes += 1
                self.picture.items.append((depth, box))
                for port, port_name in ports.items():
                    self._port_of_box(depth + 1, port, port_name)
                stack.append((iter(inner.nodes.items()), group))
                break
            else:
                stack.pop()

    def _group_around(self) -> str:
        """Where nodes of the outermost level run that name no group."""
        level: Level | None = self.level
        while level is not None and level.owner is not None:
            if level.owner._options is not None and level.owner._options.group:
                return str(level.owner._options.group)
            level = level.around
        return "loop"

    def _node(self, depth: int, name: str, node: Node, group: str) -> None:
        declared = _declared(node) if self.view.all_ports else {}
        shape = self._shape_of(self._next_id, name, "node", node, group)
        shape.pins += [Pin(*port, order) for port, order in declared.items() if port[0] != "parameter"]
        self._show(depth, node, shape)

    def _shape_of(self, id_: str, name: str, look: Look, node: Node, group: str) -> Shape:
        options, inner = node._options, inside(node)
        return Shape(
            id_,
            name,
            look,
            _details(options, node._type) + self.monitors.get(path_of(node), []),
            path_of(node),
            node._type.qualname,
            group,
            is_active=self._is_active(node),
            is_enabled=options.enabled,
            limit="" if options.active_for_s is None else f"{options.active_for_s:g} s",
            inner=0 if inner is None or look == "box" else sum(len(one.nodes) for one in _depth_first(inner)),
        )

    def _port_of_box(self, depth: int, port: Port | tuple[Node, str], name: str) -> None:
        self._shape(depth, port, name, "port", port.kind if isinstance(port, Port) else port[1])

    def _is_active(self, node: Node) -> bool:
        return node in self.lit

    def _edge(self, edge: Edge) -> None:
        ends = self._end(edge.source), self._end(edge.target)
        is_signal = is_feed(edge.source) or edge.source.kind in ("event", "slot")
        said = ", ".join(_badges(edge.options))
        label = ", ".join(part for part in (_ports_label(edge), said) if part)
        pins = self._pin(edge.source, _source_name(edge.source)), self._pin(edge.target, _target_name(edge.target))
        arrow = Arrow(*ends, label, *pins, said, is_signal, edge.active, is_back=bool(edge.options.initial))
        arrow.ends = end_path(edge.source), end_path(edge.target)
        self.picture.arrows.append(arrow)
        for end in ends:
            if edge.active and self.shapes[end].look == "node":
                self.shapes[end].be_state()

    def _end(self, end: SourceEnd) -> str:
        if not is_port(end):
            return self.ids[end] if end in self.ids else self._shape(0, end, "observable", "feed", "observable")
        port = _outside(end)
        return self.ids[port] if port in self.ids else self.ids[port.node]

    def _pin(self, end: SourceEnd, needed_name: str) -> Pin | None:
        if not is_port(end) or _outside(end) in self.ids:
            return None
        order = _declared(end.node).get((end.kind, end.name), _LAST) if isinstance(end.node, Node) else 0
        is_plain = not needed_name and not is_box(end.node) and not self.view.all_ports
        return Pin(end.kind, end.name, order, is_plain)

    def _gate(self, gate: Gate) -> None:
        (by, out_of), (target, into) = self._end_of_gate(gate.by, "active"), self._end_of_gate(gate.target, "gate")
        said = "" if gate.idle_rate_hz is None else f"else {gate.idle_rate_hz:g} Hz"
        label = f"gate, {said}" if said else "gate"
        ends = path_of(gate.by), path_of(gate.target)
        self.picture.arrows.append(Arrow(by, target, label, out_of, into, said, is_gate=True, ends=ends))

    def _end_of_gate(self, node: Node, what: str) -> tuple[str, Pin | None]:
        if node in self.ids:
            is_node = self.shapes[self.ids[node]].look == "node"
            return self.ids[node], Pin(what, what, is_plain=True) if is_node else None
        if (node, what) in self.ids:
            return self.ids[node, what], None
        return self._shape(0, node, path_of(node), "feed", "node outside of what is drawn"), None

    def _promotions(self, level: Level) -> None:
        """Lead a drawn parameter of a subgraph to those that it stands for."""
        if level.owner is None:
            return
        for name, ports in level.promotions.by_name.items():
            outer = self.ids.get(level.owner.ports.parameters[name])
            if outer is not None:
                self.picture.arrows.extend(
                    Arrow(
                        outer,
                        self._end(inner),
                        f"→ {inner.name}",
                        None,
                        self._pin(inner, inner.name),
                        ends=("", inner.path),
                    )
                    for inner in ports
                )

    def _shape(self, depth: int, of: object, name: str, look: Look, type_name: str) -> str:
        is_active = isinstance(of, Node) and self._is_active(of)
        return self._show(depth, of, Shape(self._next_id, name, look, type_name=type_name, is_active=is_active))

    @property
    def _next_id(self) -> str:
        return f"n{len(self.shapes)}"

    def _show(self, depth: int, of: object, shape: Shape) -> str:
        self.picture.items.append((depth, shape))
        self.shapes[shape.id] = shape
        self.ids[of] = shape.id
        return shape.id


def _opened(level: Level, view: View) -> tuple[list[Level], Mapping[Node, Node]]:
    """Return the levels that are seen, the outer ones first, each box before the next; also who is hidden in which."""
    opened: list[Level] = []
    hidden: dict[Node, Node] = {}
    waiting: list[tuple[Level, int, Node | None]] = [(level, 0, None)]
    while waiting:
        one, depth, within = waiting.pop()
        if within is None:
            opened.append(one)
        else:
            hidden.update(dict.fromkeys(one.nodes.values(), within))
        for node in reversed(one.nodes.values()):
            inner = inside(node)
            if inner is not None:
                is_folded = node in view.folded or (view.depth is not None and depth >= view.depth)
                is_folded = is_folded and path_of(node) not in view.opened
                waiting.append((inner, depth + 1, within or (node if is_folded else None)))
    return opened, hidden


def _lit(level: Level, view: View) -> set[Node]:
    """Return who is shown as active: also the subgraphs around them, which are so, too (rule G2)."""
    shown: Iterable[Node] = view.active or ()
    if view.active is None:
        shown = (node for one in _depth_first(level) for node in one.nodes.values() if node.active)
    found: set[Node] = set()
    for node in shown:
        one: Node | None = node
        while one is not None and one not in found:
            found.add(one)
            one = None if one._place is None else level_of(one._place.graph).owner
    return found


def _depth_first(level: Level) -> Iterator[Level]:
    """Yield a level and all that are in its boxes, each box before the next."""
    waiting = [level]
    while waiting:
        one = waiting.pop()
        yield one
        waiting += [inner for node in reversed(one.nodes.values()) if (inner := inside(node)) is not None]


def _ports_of_boxes(edges: Iterable[Edge]) -> dict[object, dict[Any, str]]:
    """Return for each subgraph its ports that have an edge outside or inside, with their names."""
    found: dict[object, dict[Any, str]] = {}
    for edge in edges:
        for end in (edge.source, edge.target):
            if not is_feed(end) and is_box(end.node):
                port = _outside(end)
                found.setdefault(port.node, {})[port] = port.name
    return found


def _outside(end: PortEnd) -> Port:
    """Return the port of a subgraph that an inner side belongs to; another port is its own."""
    return end.outer if isinstance(end, InnerSource | InnerTarget) else end


def _declared(node: Node) -> dict[tuple[str, str], int]:
    """Return the ports that a node's type declares, by kind and name, numbered in their order."""
    type_ = node._type
    slots = [name for name, slot in type_.slots.items() if slot.handler_name or type_.is_subgraph]
    kinds: tuple[tuple[str, Iterable[str]], ...] = (
        ("input", type_.inputs),
        ("output", type_.outputs),
        ("slot", slots),
        ("event", type_.events),
        ("parameter", type_.parameters),
    )
    return {(kind, name): order for kind, names in kinds for order, name in enumerate(names)}


# --- labels ---


def _monitors(level: Level) -> dict[str, list[str]]:
    """Return what a drawing shows of monitors, by the path of each node that they name."""
    found: dict[str, list[str]] = {}
    for name, spec in level.whole.monitors.items():
        paths = (atom.port if isinstance(atom, Sent) else atom.node for atom in spec.property.atoms())
        for path in dict.fromkeys(map(node_part, paths)):
            found.setdefault(path, []).append(f"monitor {name}")
    return found


def _details(options: NodeOptions, kind: NodeType) -> list[str]:
    return (["do"] if "do" in kind.hooks else []) + _badges(options)


def _badges(options: EdgeOptions | NodeOptions) -> list[str]:
    """Return what a drawing shows of options that are not as usual."""
    known, said = declared(type(options)), dict(options.said())
    ranked = sorted(said, key=lambda name: known[name].option.rank)
    return [badge for name in ranked if (badge := known[name].badge(said[name]))]


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
