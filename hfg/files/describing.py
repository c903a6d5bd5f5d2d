"""Makes a document of a graph, and finds everything that no file can say before anything is written.

A node is told by the reference of its type. What is inside of a subgraph whose type has a name is what that builds: it
is built once more beside, and what is otherwise is told; if it was edited, the inside is told whole. A subgraph that a
file describes is told by that file. Stands on `document`, `boxes` and `missing`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hfg.base.values import same
from hfg.encoding import encode
from hfg.errors import EncodingError, GraphError, UsageError
from hfg.files.allowed import project_of
from hfg.files.boxes import FileBox, conditions_in_words, limits_in_words
from hfg.files.document import (
    BoxDocument,
    Document,
    EdgeDocument,
    GateDocument,
    GroupDocument,
    InsideDocument,
    NodeDocument,
    ParameterDocument,
)
from hfg.files.findings import Findings
from hfg.files.missing import MissingNode
from hfg.graph.editing.data import edge_as_data
from hfg.graph.editing.insides import differ_in_values_only, nodes_inside
from hfg.graph.editing.type_texts import text_of_type
from hfg.graph.graph import Graph
from hfg.graph.structure.edge import Edge, is_feed
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.options import GroupSpec
from hfg.graph.structure.refusals import raise_refusals
from hfg.graph.structure.subgraph import Box, is_box, is_unnamed
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, ParameterSpec, Port
from hfg.ports.kinds import choices_of, type_of_choices
from hfg.ports.specs import REQUIRED

__all__ = ["describe"]


def describe(graph: Graph, beside: Path | None = None, *, same_program: bool = False) -> Document:
    """Make a document of a whole graph.

    Args:
      graph: that is told.
      beside: the file that it is written to: included files are named from its folder.
      same_program: it is for another process of the same program, which has its types too.

    Raises:
      FileError: something cannot be said; `problems` holds every finding.
      UsageError: it is the inside of a subgraph.
    """
    level = level_of(graph)
    if level.owner is not None:
        raise UsageError(
            f'{level.title} is saved with the whole graph: save graph "{level.whole.root.name}", or describe the '
            "subgraph in a file of its own"
        )
    telling = _Telling(level, beside, same_program)
    document = telling.document()
    telling.findings.reject(f'graph "{graph.name}" cannot be said in a file')
    return document


class _Telling:
    def __init__(self, root: Level, beside: Path | None, same_program: bool) -> None:
        self.root = root
        self.same_program = same_program
        self.beside = None if beside is None else beside.resolve()
        self.findings = Findings()
        self.gates = {gate.target: gate for level in root.walk() for gate in level.gates}

    def wrong(self, path: str, sentence: str) -> None:
        self.findings.add("", 0, path, sentence)

    def document(self) -> Document:
        root = self.root
        document = Document(name=root.name, notes=dict(root.whole.notes.get(None, {})))
        for spec in root.whole.groups.by_name.values():
            if spec != GroupSpec("loop"):
                threads = 1 if spec.name == "loop" else spec.threads
                document.groups[spec.name] = GroupDocument(**{**spec.said(), "threads": threads})
        for name, port in root.ports.inputs.items():
            document.inputs[name] = self.type_text(port.type, f'input "{name}"')
        for name, out in root.ports.outputs.items():
            document.outputs[name] = self.type_text(out.type, f'output "{name}"')
        self.fill(document, root)
        return document

    def type_text(self, hint: object, path: str) -> str:
        text = text_of_type(hint)
        if text is None:
            self.wrong(
                path,
                f"its type {hint!r:.80} has no name; give it one in a module, as in Picture = Annotated[...], and "
                "declare the port with that",
            )
        return text or "Any"

    # --- one level ---

    def fill(self, box: BoxDocument, level: Level) -> None:
        """Tell what lies at a level."""
        for name, node in level.nodes.items():
            box.nodes[name] = self.node(node)
        for edge in level.edges:
            told = self.edge(edge, level)
            if told is not None:
                box.edges.append(told)
        for name, ports in level.promotions.by_name.items():
            box.promotes[name] = [_parameter_name(port) for port in ports]

    def node(self, node: Node) -> NodeDocument:
        options = node._options.said()
        if isinstance(node, MissingNode):
            said = node._said
            told = NodeDocument(said.type, parameters=said.parameters, inside=said.inside, graph=said.graph, **options)
        else:
            told = NodeDocument(parameters=self.parameters(node), **options)
            if is_box(node):
                self.box(node, told)
            else:
                told.type = self.reference(node)
        told.gate = self.gate(node, level_of(node.place.graph))
        told.position, told.notes = self.notes(node, {})
        return told

    def gate(self, node: Node, seen: Level) -> GateDocument | None:
        """The gate of a node, if it has any; by whom is named from a level of the file."""
        gate = self.gates.get(node)
        if gate is None:
            return None
        by, prefix = gate.by.place.path, f"{seen.path}/" if seen.path else ""
        return GateDocument(by.removeprefix(prefix) if by.startswith(prefix) else f"/{by}", gate.idle_rate_hz)

    def reference(self, node: Node) -> str:
        reference = node._type.reference
        if reference is None:
            self.wrong(
                node.place.path,
                f"its type {node._type.qualname} cannot be found by name; define it at the top of a module",
            )
        elif reference.startswith(("__main__:", "hfg_target_")) and not self.same_program:
            self.wrong(
                node.place.path,
                f"its type {node._type.qualname} is in the program itself, where no other program finds it; move it to "
                "a module whose name no other module has",
            )
        return reference or ""

    def parameters(self, node: Node, other: Node | None = None) -> dict[str, Any]:
        """The values that are not what the type gives by itself, or not those of another node."""
        found: dict[str, Any] = {}
        specs, promoted = node._type.parameters, self.promoted(node)
        for name, value in node._parameters.items():
            if not specs[name].is_given:
                continue
            usual = specs[name].default if other is None else other._parameters[name]
            if other is None and name in promoted:
                usual = promoted[name]
            if usual is not REQUIRED and same(usual, value):
                continue
            try:
                found[name] = specs[name].encode(value)
            except EncodingError as error:
                self.wrong(f"{node.place.path}.{name}", f"{error}; take a type whose values are plain data")
        return found

    def promoted(self, node: Node) -> dict[str, Any]:
        """What the subgraph around gives to parameters of a node."""
        level = level_of(node.place.graph)
        return {
            port.name: level.owner._parameters[name]
            for name, ports in level.promotions.by_name.items()
            for port in ports
            if port.node is node and level.owner is not None
        }

    def notes(self, node: Node, usual: dict[str, Any]) -> tuple[list[Any] | None, dict[str, Any]]:
        """What editors noted; a position has a place of its own if it is two numbers."""
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

    def box(self, node: Box, told: NodeDocument) -> None:
        """Say what a subgraph is: a file, a type, or a graph alone."""
        kind, within = node._type, inside(node)
        if within is None:
            return
        if isinstance(node, FileBox):
            same_inside = self.as_built(node, within)
            if same_inside is not None:
                told.file, told.inside = self.file(node), same_inside
                return
        elif kind.reference is not None:
            told.type = self.reference(node)
            same_inside = self.as_built(node, within)
            if same_inside is not None:
                told.inside = same_inside
                return
            told.graph = BoxDocument()
            self.fill(told.graph, within)
            return
        elif not is_unnamed(node) or kind.vectors:
            told.type = self.reference(node)
            return
        told.graph = BoxDocument()
        for field in ("inputs", "outputs", "events", "slots"):
            for name, spec in getattr(kind, field).items():
                if name not in kind.parameters:  # those of triggers
                    getattr(told.graph, field)[name] = self.type_text(spec.type, f"{node.place.path}.{name}")
        for name in kind.parameters:
            self.declare(node, name, told.graph)
        self.fill(told.graph, within)

    def declare(self, node: Box, name: str, graph: BoxDocument) -> None:
        spec, path = node._type.parameters[name], f"{node.place.path}.{name}"
        limits = limits_in_words(spec.limits)
        if limits is None or spec.trigger or spec.default is REQUIRED:
            what = "a trigger" if spec.trigger else f"its limits {spec.limits!r:.80}"
            what = "a parameter without a default" if spec.default is REQUIRED else what
            self.wrong(
                path,
                f"{what} cannot be said in a file; define the subgraph {node._type.qualname} at the top of a module",
            )
            return
        try:
            default = encode(spec.default, spec.type)
            choices, labels = _choices(spec)
            shown_if = conditions_in_words(spec.shown_if, node._type.parameters)
        except EncodingError as error:
            self.wrong(path, f"{error}; take a type whose values are plain data")
            return
        text = self.type_text(spec.type, path)
        graph.parameters[name] = ParameterDocument(
            type=text,
            default=default,
            unit=spec.unit,
            choices=choices,
            limits=limits,
            labels=labels,
            step=spec.step,
            group=spec.group,
            help=spec.help,
            shown_if=shown_if,
            pattern=spec.pattern,
            directory=spec.directory,
            save=spec.save,
        )

    def file(self, node: FileBox) -> str:
        """Name the file of a subgraph from where this one is written."""
        file = node._file
        if self.beside is None:
            return str(file)
        project = project_of(self.beside)
        if not file.is_relative_to(project):
            self.wrong(
                node.place.path,
                f"its file {file} is outside of the project {project}, so a file there cannot include it; save beside "
                "it, or copy it there",
            )
        return Path(os.path.relpath(file, self.beside.parent)).as_posix()

    def as_built(self, node: Box, within: Level) -> dict[str, InsideDocument] | None:
        """Tell what is otherwise inside than the type builds it; None if more is than can be said so."""
        fresh = self.built_anew(node)
        made = None if fresh is None else inside(fresh)
        if made is None or fresh is None or not differ_in_values_only(within, made):
            return None
        found: dict[str, InsideDocument] = {}
        notes = level_of(fresh.place.graph).whole.notes
        others = nodes_inside(made).values()
        built = {gate.target for level in made.whole.root.walk() for gate in level.gates}
        for (path, one), other in zip(nodes_inside(within).items(), others, strict=True):
            told = InsideDocument(parameters=self.parameters(one, other))
            if one._options.enabled != other._options.enabled:
                told.enabled = one._options.enabled
            if one._options.group != other._options.group:
                told.group = one._options.group or ""
            if other not in built:
                told.gate = self.gate(one, level_of(node.place.graph))
            told.position, told.notes = self.notes(one, notes.get(other, {}))
            if told != InsideDocument():
                found[path] = told
        return found

    def built_anew(self, node: Box) -> Box | None:
        """The same subgraph as its type makes it."""
        graph = Graph("built anew")
        for spec in self.root.whole.groups.by_name.values():
            level_of(graph).whole.groups.change(spec)
        try:
            with raise_refusals():
                made: Box = graph.add(node._copy(), name="box", iterate_over=node._options.iterate_over)  # type: ignore[assignment]
        except Exception as error:  # code of users raises what it likes
            self.wrong(
                node.place.path,
                f"its type {node._type.qualname} cannot build its inside again ({type(error).__name__}: {error}); mend "
                "its build()",
            )
            return None
        return made

    # --- edges ---

    def edge(self, edge: Edge, level: Level) -> EdgeDocument | None:
        if is_feed(edge.source):
            self.wrong(
                edge.label,
                "an observable from outside is code; connect it by hand to the graph that is loaded, or feed the graph "
                "by graph.input(...)",
            )
            return None
        try:
            said = edge_as_data(edge, encode)
        except GraphError as error:
            self.wrong(edge.label, str(error))
            return None
        return EdgeDocument(_end(edge.source, level), _end(edge.target, level), **said)


def _end(end: Any, level: Level) -> str:
    """Name an end as it is seen from its level."""
    if isinstance(end, InnerSource | InnerTarget):
        return end.outer.name
    assert isinstance(end, Port)
    if level.ports.has(end):
        taken = level.owner is not None and any(
            end.name in getattr(level.owner._type, kind) for kind in ("inputs", "outputs", "events", "slots")
        )
        return f"/{end.name}" if taken else end.name
    if not isinstance(end.node, Node):
        return end.name
    return f"{end.node.place.name}.{end.name}"


def _choices(spec: ParameterSpec) -> tuple[list[Any] | None, list[str]]:
    """What may be chosen, and how it is called; nothing where the type says it."""
    known = choices_of(spec.type)
    if spec.choices is None or (
        known is not None and same((tuple(known.values()), tuple(known)), (spec.choices, spec.labels))
    ):
        return None, []
    return [encode(one, type_of_choices(spec.type)) for one in spec.choices], list(spec.labels)


def _parameter_name(port: Any) -> str:
    """Name a parameter as its subgraph promotes it."""
    return f"{port.node.place.name}.{port.name}"
