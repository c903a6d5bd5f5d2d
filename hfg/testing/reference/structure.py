"""The contents of a graph with its subgraphs dissolved, as plain data (rule G1).

Walks `graph.nodes` and `graph.edges` by itself: an edge that ends at a relay continues with every edge that begins at
the relay's other side, until it meets the port of a plain node, of an iterating subgraph, or of the root graph. Knows
no rule but G1 and decides nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from hfg.graph.structure.level import level_of

ROOT: Final = -1
"""The owner of the graph's own ports; box k owns its automatic ports as -2 - k."""


_BOUNDARIES: Final = -1_000_000


def is_box(owner: int) -> bool:
    """Return whether ports of this owner are those of a dissolved subgraph."""
    return _BOUNDARIES < owner < ROOT


def boundary_of(leaf: int) -> int:
    """The owner of the inner sides of an iterating subgraph's ports: elements come from there, results go there."""
    return _BOUNDARIES - leaf


class End(NamedTuple):
    """One end of an edge: whose port, seen from where tokens flow (a graph's own input is an "output" of the root)."""

    owner: int
    kind: str
    name: str


@dataclass
class Leaf:
    """A node that is not dissolved.

    `boxes`: the subgraphs around it, outermost first. `inside`: for an iterating subgraph (G4), its own structure.
    """

    index: int
    path: str
    node: Any
    options: Any
    boxes: tuple[int, ...]
    inside: Structure | None = None
    within: int | None = None  # the iterating subgraph around it
    concurrency: int = field(init=False)  # F14

    def __post_init__(self) -> None:
        self.concurrency = int(self.options.concurrency)


@dataclass
class Box:
    """A dissolved subgraph; `members` are the leaves inside, nested ones too."""

    index: int
    path: str
    node: Any
    options: Any
    boxes: tuple[int, ...]
    members: list[int] = field(default_factory=list)


@dataclass
class Edge:
    """A real edge; `via`: the boxes whose relays it passes; `initial`: what lies on it, next to be taken first."""

    index: int
    label: str
    source: End
    target: End
    active: bool
    capacity: int
    overflow: str
    capacity_limit: int | None
    through: tuple[Any, ...]
    initial: tuple[Any, ...]
    via: tuple[int, ...]
    within: int | None = None  # the iterating subgraph around it
    parts: tuple[Any, ...] = ()  # the drawn edges that it consists of
    buffer: int = 0  # relays in a row that a synchronous edge stands for (P4)

    @property
    def is_event(self) -> bool:
        """Whether it comes from an event."""
        return self.source.kind in ("event", "observable")


@dataclass
class Gate:
    """Rule A11: `targets` work as the activity of `by` (box k is -2 - k) allows; `idle_rate_hz` None suspends."""

    targets: list[int]
    by: int
    idle_rate_hz: float | None


@dataclass
class Structure:
    """All of it, in order of adding and connecting."""

    leaves: list[Leaf] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    gates: list[Gate] = field(default_factory=list)
    threads: dict[str, int] = field(default_factory=dict)


def dissolve(graph: Any, prefix: str = "", group: str = "loop") -> Structure:
    """Dissolve all subgraphs but those that iterate; the graph stays as it is."""
    return _Dissolving(graph, prefix, group).result


def whole(graph: Any) -> Structure:
    """Dissolve a graph and put the insides of iterating subgraphs next to the rest, with their boundaries as owners."""
    result = dissolve(graph)
    waiting = [leaf for leaf in result.leaves if leaf.inside is not None]
    while waiting:
        around = waiting.pop(0)
        inside = around.inside
        assert inside is not None
        first_leaf, first_box = len(result.leaves), len(result.boxes)

        def moved(end: End, around: Leaf = around, first_leaf: int = first_leaf, first_box: int = first_box) -> End:
            if end.owner == ROOT:
                return end._replace(owner=boundary_of(around.index))
            return end._replace(owner=end.owner + first_leaf if end.owner >= 0 else end.owner - first_box)

        for leaf in inside.leaves:
            leaf.index += first_leaf
            leaf.boxes = tuple(box + first_box for box in leaf.boxes)
            leaf.within = around.index
            result.leaves.append(leaf)
            waiting += [leaf] if leaf.inside is not None else []
        for box in inside.boxes:
            box.index += first_box
            box.boxes = tuple(one + first_box for one in box.boxes)
            box.members = [member + first_leaf for member in box.members]
            result.boxes.append(box)
        for edge in inside.edges:
            edge.index = len(result.edges)
            edge.source, edge.target = moved(edge.source), moved(edge.target)
            edge.via = tuple(box + first_box for box in edge.via)
            edge.within = around.index
            result.edges.append(edge)
        for gate in inside.gates:
            gate.targets = [target + first_leaf for target in gate.targets]
            gate.by = gate.by + first_leaf if gate.by >= 0 else gate.by - first_box
            result.gates.append(gate)
    return result


class _Dissolving:
    def __init__(self, graph: Any, prefix: str, group: str) -> None:
        self.graph = graph
        self.result = Structure(threads={name: spec.threads for name, spec in graph.groups.items()})
        self.leaf_of: dict[int, int] = {}  # by identity of the node
        self.box_of: dict[int, int] = {}
        self.levels: list[tuple[Any, int]] = []  # every graph that is dissolved into the whole, with its depth
        self.groups: dict[int, str] = {}
        self._nodes(graph, prefix, group, ())
        for level, depth in self.levels:
            for edge in level.edges:
                if not self._is_relay(edge.source):
                    self._follow(edge, depth)
        for level, _ in self.levels:
            for gate in level.gates:
                self._gate(gate)

    def _nodes(self, graph: Any, prefix: str, group: str, around: tuple[int, ...]) -> None:
        result = self.result
        self.levels.append((graph, len(around)))
        for name, node in graph.nodes.items():
            path, own_group = prefix + name, node._options.group or group
            inside = getattr(node, "_graph", None)
            if inside is None or node._options.iterate_over:
                leaf = Leaf(len(result.leaves), path, node, _Options(node._options, own_group), around)
                result.leaves.append(leaf)
                self.leaf_of[id(node)] = leaf.index
                for one in around:
                    result.boxes[one].members.append(leaf.index)
                if inside is not None:
                    leaf.inside = dissolve(inside, f"{path}/", own_group)
            else:
                box = Box(len(result.boxes), path, node, _Options(node._options, own_group), around)
                result.boxes.append(box)
                self.box_of[id(node)] = box.index
                self._nodes(inside, f"{path}/", own_group, (*around, box.index))

    # --- edges: rule G1

    def _is_relay(self, port: Any) -> bool:
        """Return whether tokens only pass here: a declared port of a dissolved subgraph, seen from either side."""
        outer = getattr(port, "outer", port)
        node: Any = getattr(outer, "node", None)
        if id(node) not in self.box_of or outer.kind == "parameter":
            return False
        return outer.name in getattr(node._type, f"{outer.kind}s")

    def _behind(self, port: Any) -> Iterator[tuple[Any, int]]:
        """Yield the edges that continue after a relay."""
        for level, depth in self.levels:
            for edge in level.edges:
                source = edge.source
                same = getattr(source, "outer", source) is getattr(port, "outer", port)
                if same and source is not port and self._is_relay(source):
                    yield edge, depth

    def _follow(self, edge: Any, depth: int) -> None:
        for source, entered in self._real(edge.source):
            self._onward(source, [(edge, depth)], entered)
            break  # a promoted parameter that stands for several sends the value of the first
        else:
            if not hasattr(edge.source, "kind"):
                self._onward(edge.source, [(edge, depth)], ())

    def _onward(self, source: Any, parts: list[tuple[Any, int]], via: tuple[int, ...]) -> None:
        target = parts[-1][0].target
        if self._is_relay(target):
            passed = (*via, self.box_of[id(getattr(target, "outer", target).node)])
            for part in self._behind(target):
                if part not in parts:
                    self._onward(source, [*parts, part], passed)
        else:
            for real, entered in self._real(target):
                self._join(source, real, parts, (*via, *entered))

    def _real(self, port: Any) -> Iterator[tuple[Any, tuple[int, ...]]]:
        """Yield the port itself, or for a subgraph's parameter those it stands for."""
        node = getattr(port, "node", None)
        if node is None:
            return
        if getattr(port, "kind", None) == "parameter" and id(node) in self.box_of:
            for inner in level_of(node._graph).promotions.of(port.name):
                for real, entered in self._real(inner):
                    yield real, (self.box_of[id(node)], *entered)
        else:
            yield port, ()

    def _join(self, source: Any, target: Any, parts: list[tuple[Any, int]], via: tuple[int, ...]) -> None:
        """Make one edge of all parts: active if all are; of the queues the outermost holds; initial tokens add up."""
        outermost = min(parts, key=lambda part: part[1])[0].options
        begin, end = self._end(source), self._end(target)
        edges = self.result.edges
        label = f"{self._path(begin)} -> {self._path(end)}"
        same = sum(1 for one in edges if one.label.split(" #")[0] == label)
        edges.append(
            Edge(
                index=len(edges),
                label=label if not same else f"{label} #{same + 1}",
                source=begin,
                target=end,
                active=all(part.options.active for part, _ in parts),
                capacity=outermost.capacity,
                overflow=outermost.overflow,
                capacity_limit=outermost.capacity_limit,
                through=tuple(operator for part, _ in parts for operator in part.options.through),
                initial=tuple(value for part, _ in reversed(parts) for value in part.options.initial),
                via=via,
                parts=tuple(part for part, _ in parts),
                buffer=sum(getattr(part.options, "buffer", None) or 0 for part, _ in parts),
            )
        )

    def _end(self, port: Any) -> End:
        if not hasattr(port, "kind"):
            return End(ROOT, "observable", "observable")
        outer = getattr(port, "outer", None)
        if outer is not None:  # the inside of an iterating subgraph: its boundary
            return End(ROOT, "output" if outer.kind == "input" else "input", port.name)
        if id(port.node) in self.leaf_of:
            return End(self.leaf_of[id(port.node)], port.kind, port.name)
        if id(port.node) in self.box_of:
            return End(-2 - self.box_of[id(port.node)], port.kind, port.name)
        return End(ROOT, port.kind, port.name)

    def _path(self, end: End) -> str:
        if end.owner >= 0:
            return f"{self.result.leaves[end.owner].path}.{end.name}"
        if end.owner == ROOT:
            inside = level_of(self.graph).owner
            return end.name if inside is None else f"{inside.place.path}.{end.name}"
        return f"{self.result.boxes[-2 - end.owner].path}.{end.name}"

    def _gate(self, gate: Any) -> None:
        box = self.box_of.get(id(gate.target))
        targets = [self.leaf_of[id(gate.target)]] if box is None else self.result.boxes[box].members
        by = self.leaf_of.get(id(gate.by))
        self.result.gates.append(
            Gate(list(targets), -2 - self.box_of[id(gate.by)] if by is None else by, gate.idle_rate_hz)
        )


class _Options:
    """A node's options, with the group that it inherited."""

    def __init__(self, options: Any, group: str) -> None:
        self._options = options
        self.group = group

    def __getattr__(self, name: str) -> Any:
        return getattr(self._options, name)
