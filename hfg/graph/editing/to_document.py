"""Makes a document of a graph: the one place that says what of a graph is data, for files, commands and processes.

A node is represented by the reference of its type. The inner graph of a subgraph whose type has a name is the one that
the type builds: it is built again on the side, and only differences in values are listed. If more than values differ,
the document contains the whole inner graph. Depends on `document` and `boxes`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import msgspec

from hfg.base.values import same
from hfg.encoding import encode
from hfg.errors import EncodingError, GraphError
from hfg.graph.editing.boxes import parameter_as_data
from hfg.graph.editing.data import edge_as_data
from hfg.graph.editing.document import (
    PORT_KINDS,
    BoxDocument,
    Document,
    EdgeDocument,
    FactDocument,
    GateDocument,
    GroupDocument,
    InsideDocument,
    MonitorDocument,
    NodeDocument,
)
from hfg.graph.editing.type_texts import text_of_type
from hfg.graph.structure.adding import add
from hfg.graph.structure.edge import Edge, SourceEnd, end_path, is_feed
from hfg.graph.structure.facts import facts_of
from hfg.graph.structure.level import Level, Whole, inside, level_of
from hfg.graph.structure.operators import NamedOperator
from hfg.graph.structure.options import EdgeGiven, GroupGiven, GroupSpec, MonitorSpec
from hfg.graph.structure.refusals import raise_refusals
from hfg.graph.structure.subgraph import Box, is_box, is_unnamed
from hfg.monitors.conditions import Condition
from hfg.monitors.formulas import Sent
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port
from hfg.ports.specs import REQUIRED


class Describer:
    """Describes one whole graph; the graph stays as it is, and may be running.

    Subclasses decide what happens to parts that are not data.
    """

    def __init__(self, root: Level) -> None:
        self.root = root
        self.gates = {gate.target: gate for level in root.walk() for gate in level.gates}
        self._waiting: list[tuple[BoxDocument, Level]] = []  # what is still to be filled, with what

    def wrong(self, what: str, path: str, sentence: str) -> None:
        """Handle a part that is not data; messages call it `what`, as in 'edge "a.out -> b.in"'."""
        raise NotImplementedError

    def encoded(self, encode: Callable[[Any], Any], value: object) -> object:
        """Return a value as data.

        Raises:
          EncodingError: it is not data.
        """
        return encode(value)

    def document(self) -> Document:
        """Describe the graph. Nothing recurses: subgraphs may be nested to any depth."""
        root = self.root
        document = Document(name=root.name, notes=dict(root.whole.notes.get(None, {})))
        for spec in root.whole.groups.by_name.values():
            if spec != GroupSpec("loop"):
                document.groups[spec.name] = _group(spec)
        for name, monitor in root.whole.monitors.items():
            document.monitors[name] = self._monitor(monitor)
        for name, port in root.ports.inputs.items():
            document.inputs[name] = self._type(port.type, f'input "{name}"', " of the graph")
        for name, out in root.ports.outputs.items():
            document.outputs[name] = self._type(out.type, f'output "{name}"', " of the graph")
        document.facts = [FactDocument(fact.claim, [node.place.path for node in fact.nodes]) for fact in facts_of(root)]
        self._waiting.append((document, root))
        while self._waiting:
            box, level = self._waiting.pop(0)
            for name, node in level.nodes.items():
                box.nodes[name] = self.node(node)
            box.edges += [said for edge in level.edges if (said := self._edge(edge, level)) is not None]
            for name, ports in level.promotions.by_name.items():
                box.promotes[name] = [f"{port.node.place.name}.{port.name}" for port in ports]
        return document

    def _monitor(self, spec: MonitorSpec) -> MonitorDocument:
        for atom in spec.property.atoms():
            if isinstance(atom, Sent) and not isinstance(atom.when, Condition | None):
                sentence = f'its condition at "{atom.port}" is code; write it as text, as in sent(port, "value > 3")'
                self.wrong(f'monitor "{spec.name}"', f'monitor "{spec.name}"', sentence)
        return MonitorDocument(property=str(spec.property), **spec.said())

    def _type(self, hint: object, path: str, where: str = "") -> str:
        text = text_of_type(hint)
        if text is None:
            self.wrong(
                f"{path}{where}" if where else f'port "{path}"',
                path,
                f"its type {hint!r:.80} has no name; give it one in a module, as in Picture = Annotated[...], and "
                "declare the port with that",
            )
        return text or "Any"

    # --- nodes ---

    def node(self, node: Node) -> NodeDocument:
        """Describe a node: what it is, and what the graph says about it."""
        said = self.kind(node)
        for name, value in node._options.said().items():
            setattr(said, name, value)
        said.gate = self._gate(node, level_of(node.place.graph))
        said.position, said.notes = self._notes(node, {})
        return said

    def kind(self, node: Node) -> NodeDocument:
        """Describe what a node is, and its parameters."""
        said = NodeDocument(parameters=self.parameters(node))
        if is_box(node):
            self._box(node, said)
        else:
            said.type = self.reference(node)
        return said

    def reference(self, node: Node) -> str:
        """Return the reference of a node's type."""
        reference = node._type.reference
        if reference is None:
            sentence = f"its type {node._type.qualname} cannot be found by name; define it at the top of a module"
            self.wrong(f'node "{node.place.path}"', node.place.path, sentence)
        return reference or ""

    def _gate(self, node: Node, seen: Level) -> GateDocument | None:
        """Return the gate of a node, if it has one, as seen from a level."""
        gate = self.gates.get(node)
        if gate is None:
            return None
        by, prefix = gate.by.place.path, f"{seen.path}/" if seen.path else ""
        return GateDocument(by.removeprefix(prefix) if by.startswith(prefix) else f"/{by}", gate.idle_rate_hz)

    def parameters(self, node: Node, other: Node | None = None) -> dict[str, Any]:
        """Return the values that differ from what the type gives, or from those of another node."""
        found: dict[str, Any] = {}
        specs, promoted = node._type.parameters, _promoted(node)
        for name, value in node._parameters.items():
            if not specs[name].is_given:
                continue
            usual = promoted.get(name, specs[name].default) if other is None else other._parameters[name]
            if usual is not REQUIRED and same(usual, value):
                continue
            try:
                found[name] = self.encoded(specs[name].encode, value)
            except EncodingError as error:
                path = f"{node.place.path}.{name}"
                self.wrong(f'parameter "{path}"', path, f"{error}; choose a type whose values are plain data")
        return found

    def _notes(self, node: Node, usual: Mapping[str, Any]) -> tuple[list[Any] | None, dict[str, Any]]:
        """Return the notes of editors; a position is separate if it is two numbers."""
        noted = {
            name: value
            for name, value in level_of(node.place.graph).whole.notes.get(node, {}).items()
            if name not in usual or not same(usual[name], value)
        }
        position = noted.get("position")
        if not (isinstance(position, list) and len(position) == 2 and {int, float}.issuperset(map(type, position))):
            return None, noted
        return position, {name: value for name, value in noted.items() if name != "position"}

    # --- subgraphs ---

    def _box(self, node: Box, said: NodeDocument) -> None:
        """Say what a subgraph is: a type, perhaps with another inner graph than it builds, or only a graph."""
        kind, within = node._type, inside(node)
        if within is None:
            return
        if kind.reference is not None or not is_unnamed(node) or kind.vectors:
            said.type = self.reference(node)
            differences = self.differences(node, within) if kind.reference is not None else {}
            if differences is not None:
                said.inside = differences
                return
            said.graph = BoxDocument()
        else:
            said.graph = self.ports(node)
        self._waiting.append((said.graph, within))

    def replace_inside(self, node: Box, within: Level, said: NodeDocument) -> None:
        """Describe a subgraph by its ports and its whole inner graph."""
        said.graph = self.ports(node)
        self._waiting.append((said.graph, within))

    def ports(self, node: Box) -> BoxDocument:
        """Describe the ports and parameters of a subgraph without a type of its own."""
        kind, box = node._type, BoxDocument()
        for field in PORT_KINDS:
            for name, spec in getattr(kind, field).items():
                if name not in kind.parameters:  # those of triggers
                    path = f"{node.place.path}.{name}"
                    getattr(box, field)[name] = self._type(spec.type, path)
        for name, spec in kind.parameters.items():
            path = f"{node.place.path}.{name}"
            try:
                if spec.trigger or spec.default is REQUIRED:
                    what = "a trigger" if spec.trigger else "a parameter without a default"
                    raise EncodingError(f"{what} cannot be expressed as data")
                text = self._type(spec.type, path)
                box.parameters[name] = parameter_as_data(spec, text, kind.parameters)
            except EncodingError as error:
                sentence = f"{error}; define the subgraph {kind.qualname} at the top of a module"
                self.wrong(f'parameter "{path}"', path, sentence)
        return box

    def differences(self, node: Box, within: Level) -> dict[str, InsideDocument] | None:
        """Return how inner nodes differ from those that the type builds; None if more than values differ."""
        fresh = self._built_again(node)
        made = None if fresh is None else inside(fresh)
        if made is None or fresh is None or not _differ_in_values_only(within, made):
            return None
        found: dict[str, InsideDocument] = {}
        notes = level_of(fresh.place.graph).whole.notes
        built = {gate.target for level in made.whole.root.walk() for gate in level.gates}
        for (path, one), other in zip(_nodes_inside(within).items(), _nodes_inside(made).values(), strict=True):
            said = InsideDocument(parameters=self.parameters(one, other))
            if one._options.enabled != other._options.enabled:
                said.enabled = one._options.enabled
            if one._options.group != other._options.group:
                said.group = one._options.group or ""
            if other not in built:
                said.gate = self._gate(one, level_of(node.place.graph))
            said.position, said.notes = self._notes(one, notes.get(other, {}))
            if said != InsideDocument():
                found[path] = said
        return found

    def _built_again(self, node: Box) -> Box | None:
        """Return the same subgraph as its type makes it, in a graph of its own."""
        level = Level("built again", Whole(self.root.whole.make_face, self.root.whole.box_type))
        for spec in self.root.whole.groups.by_name.values():
            level.whole.groups.change(spec)
        made = node._copy()
        try:
            with raise_refusals():
                add(level, made, "box", {"iterate_over": node._options.iterate_over})
        except Exception as error:  # code of users raises anything
            self.wrong(
                f'node "{node.place.path}"',
                node.place.path,
                f"its type {node._type.qualname} cannot build its inside again ({type(error).__name__}: {error}); "
                "fix its build()",
            )
            return None
        assert is_box(made)
        return made

    # --- edges ---

    def _edge(self, edge: Edge, level: Level) -> EdgeDocument | None:
        if is_feed(edge.source):
            self.wrong(
                f'edge "{edge.label}"',
                edge.label,
                "an observable from outside is code; connect it by hand, or feed the graph by graph.input(...)",
            )
            return None
        try:
            said = edge_as_data(edge, lambda value, hint: self.encoded(partial(encode, hint=hint), value))
        except GraphError as error:
            self.wrong(f'edge "{edge.label}"', edge.label, str(error))
            return None
        return EdgeDocument(_end(edge.source, level), _end(edge.target, level), **said)


def _group(spec: GroupSpec) -> GroupDocument:
    said: GroupGiven = {"threads": spec.threads, **spec.said()}
    return msgspec.convert(said, GroupDocument)


def _end(end: SourceEnd, level: Level) -> str:
    """Return the path of an end as seen from its level."""
    if isinstance(end, InnerSource | InnerTarget):
        return end.outer.name
    assert isinstance(end, Port)
    if level.ports.has(end):
        taken = level.owner is not None and any(end.name in getattr(level.owner._type, kind) for kind in PORT_KINDS)
        return f"/{end.name}" if taken else end.name
    return f"{end.node.place.name}.{end.name}" if isinstance(end.node, Node) else end.name


def _promoted(node: Node) -> dict[str, Any]:
    """Return what the surrounding subgraph gives to parameters of a node."""
    level = level_of(node.place.graph)
    return {
        port.name: level.owner._parameters[name]
        for name, ports in level.promotions.by_name.items()
        for port in ports
        if port.node is node and level.owner is not None
    }


# --- comparing the inside of a subgraph with what its type builds ---


def _nodes_inside(level: Level) -> dict[str, Node]:
    """Return all nodes inside a subgraph by their paths from there."""
    prefix = f"{level.path}/"
    return {node.place.path.removeprefix(prefix): node for one in level.walk() for node in one.nodes.values()}


def _differ_in_values_only(level: Level, other: Level) -> bool:
    """Return whether all differences are parameters that can be set, switches and groups."""
    if not same([_shape(one, level) for one in level.walk()], [_shape(one, other) for one in other.walk()]):
        return False
    pairs = zip(_nodes_inside(level).values(), _nodes_inside(other).values(), strict=True)
    return all(_same_but_for_values(one, two) for one, two in pairs)


def _same_but_for_values(one: Node, other: Node) -> bool:
    here, there = one._options, other._options
    if msgspec.structs.replace(there, enabled=here.enabled, group=here.group) != here:
        return False
    fixed = [name for name, spec in one._type.parameters.items() if spec.is_given and not spec.is_port]
    return all(same(one._parameters[name], other._parameters[name]) for name in fixed)


def _shape(level: Level, within: Level) -> tuple[Any, ...]:
    """Return everything else at a level as data that can be compared; paths start inside the subgraph."""

    def rest(path: str) -> str:
        return path[len(within.path) :] if path.startswith((f"{within.path}/", f"{within.path}.")) else path

    return (
        [(name, node._type.reference or _kind(node)) for name, node in level.nodes.items()],
        [(rest(end_path(edge.source)), rest(end_path(edge.target)), _said(edge)) for edge in level.edges],
        [(rest(gate.target.place.path), rest(gate.by.place.path), gate.idle_rate_hz) for gate in level.gates],
        {name: [rest(port.path) for port in ports] for name, ports in level.promotions.by_name.items()},
    )


def _kind(node: Node) -> object:
    """Return what identifies a type without a name: a subgraph gets another one each time it is built."""
    return node._type.qualname if is_box(node) else node._type


def _said(edge: Edge) -> EdgeGiven[Any, Any]:
    """Return the options of an edge; operators without a name are made again each time and count as equal."""
    said = edge.options.said()
    if "through" in said:
        said["through"] = [one if isinstance(one, NamedOperator) else None for one in said["through"]]
    return said
