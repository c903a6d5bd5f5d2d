"""Makes a graph of a document, and finds everything that cannot be at once.

First every file that is included is read and what they would import is looked at; only then are node types imported,
nodes added and edges connected, as if it were written by hand. What was found wrong is told with its line, and what
only follows from that is not. Stands on `reading`, `boxes`, `missing` and `allowed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from hfg import registry
from hfg.base.logs import Log
from hfg.encoding import find_reference
from hfg.errors import EngineInternalError, FileError, GraphError, HfgError, TargetError
from hfg.files.allowed import Allowed
from hfg.files.boxes import FileBox, box_type, file_box_type
from hfg.files.document import (
    NODE_OPTIONS,
    BoxDocument,
    Document,
    EdgeDocument,
    GateDocument,
    InsideDocument,
    NodeDocument,
)
from hfg.files.findings import Findings, Key, Lines, graph_path
from hfg.files.missing import MissingNode, missing_node
from hfg.files.reading import Read, read_file
from hfg.files.values import decoded, decoded_parameter
from hfg.graph.editing.commands import Disconnect, Move, Remove
from hfg.graph.editing.data import edge_as_meant
from hfg.graph.editing.performing import perform
from hfg.graph.editing.type_texts import type_of_text
from hfg.graph.graph import Graph, Subgraph, graph_of
from hfg.graph.structure.connecting import declare_edge
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.membership import set_options
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.options import GroupGiven, NodeGiven
from hfg.graph.structure.pointing import node_at, source_at, target_at
from hfg.graph.structure.refusals import raise_refusals
from hfg.nodetypes.node import Node

__all__ = ["box_of_file", "build", "load", "modules_of"]

_LOGGER: Final = Log("hfg.files")
_NOBODY: Final[Any] = None
_current: ContextVar[_Loading | None] = ContextVar("hfg.files.loading", default=None)


def load(path: Path, allow: Iterable[str] = ()) -> Graph:
    """See `hfg.load`."""
    loading = _Loading(path, allow)
    read = loading.read(path.resolve(), str(path))
    if read is None:
        loading.findings.reject(f"{path} cannot be loaded")
        raise EngineInternalError(f"{path} was not read, and nobody said why")
    graph = loading.graph(read, path.resolve())
    if unneeded := loading.allowed.unneeded():
        _LOGGER.warning("%s: %s", path, unneeded)
    return graph


def build(document: Document, beside: Path, allow: Iterable[str] = ()) -> Graph:
    """Make a graph of a document that no file needs to hold.

    Args:
      document: what the graph is.
      beside: the file in whose place it stands: included files are named from its folder.
      allow: packages whose node types may be imported.

    Raises:
      FileError: it cannot be made; `problems` holds every finding.
    """
    loading = _Loading(beside, allow)
    return loading.graph(Read(document, {}, str(beside)), beside.resolve())


def box_of_file(path: Path) -> type[FileBox]:
    """Read the type of the subgraphs that a file describes.

    Raises:
      FileError: it cannot be made.
    """
    loading = _Loading(path, ())
    found = loading.box(path.resolve(), str(path), [])
    loading.findings.reject(f"{path} cannot be loaded")
    if found is None:
        raise EngineInternalError(f"{path} was not read, and nobody said why")
    return found


FileBox._read = staticmethod(box_of_file)


class _Loading:
    """Reads a file and all that it includes."""

    def __init__(self, path: Path, allow: Iterable[str]) -> None:
        self.findings = Findings()
        self.allowed = Allowed(path, allow)
        self.files: dict[Path, Read | None] = {}
        self.types: dict[Path, type[FileBox] | None] = {}
        self.absent: list[tuple[str, int, str, str]] = []  # file, line and path of types that are not there, and why
        self.later: list[tuple[int, Callable[[], None]]] = []  # what is done when all is built, the outer first

    def read(self, path: Path, file: str) -> Read | None:
        """Read a file, once."""
        if path not in self.files:
            self.files[path] = read_file(path, file, self.findings)
        return self.files[path]

    def graph(self, read: Read, path: Path) -> Graph:
        """Make the graph of a whole file.

        Raises:
          FileError: it cannot be.
        """
        document, key = read.document, ()
        parts = self.parts(read, path, [path])
        if not self.may_import(read):
            self.findings.reject(f"{read.file} cannot be loaded", self.allowed.wanted)
        for kind in ("events", "slots", "parameters", "promotes"):
            for name in getattr(document, kind):
                line = read.lines.get((kind, name), 0)
                self.findings.add(
                    read.file, line, name, f"a whole graph has no {kind}, only a subgraph has; include this file in "
                    "another, by file: below a node, or declare inputs and outputs",
                )  # fmt: skip
        graph = Graph(document.name or "graph")
        with self.ours(), raise_refusals():
            making = _Making(self, read, key, parts)
            making.fill(graph, document, None)
            making.note(graph, None, None, document.notes)
            for _, step in sorted(self.later, key=lambda one: one[0]):
                step()
        if self.findings.problems:  # else the graph has them in their places, and its check reports them
            for file, line, at, why in self.absent:
                self.findings.add(file, line, at, f"its type is not there: {why}; install what has it, or correct it")
        self.findings.reject(f"{read.file} cannot be loaded", self.allowed.wanted)
        return graph

    @contextmanager
    def ours(self) -> Iterator[None]:
        """Let what subgraphs build inside report to this."""
        token = _current.set(self)
        try:
            yield
        finally:
            _current.reset(token)

    # --- included files ---

    def parts(self, read: Read, path: Path, around: list[Path]) -> dict[str, type[FileBox]]:
        """Give the types of the files that a document includes, by how it names them."""
        found: dict[str, type[FileBox]] = {}
        for key, node in _nodes(read.document, ()):
            if not node.file or node.file in found:
                continue
            box = self.part(read, (*key, "file"), node.file, path, around)
            if box is not None:
                found[node.file] = box
        return found

    def part(self, read: Read, key: Key, named: str, path: Path, around: list[Path]) -> type[FileBox] | None:
        sentence = self.refusal_of_part(named, path, around)
        if sentence is not None:
            self.findings.add(read.file, read.lines.get(key, 0), graph_path(key[:-1]), sentence)
            return None
        return self.box((path.parent / named).resolve(), str(Path(read.file).parent / named), around)

    def refusal_of_part(self, named: str, path: Path, around: list[Path]) -> str | None:
        """Say why a file cannot be included; None if it may be."""
        try:
            other = (path.parent / named).resolve()
        except (OSError, ValueError, RuntimeError) as error:
            return f'"{named:.80}" cannot be the name of a file ({error}); correct it'
        if Path(named).is_absolute() or not other.is_relative_to(self.allowed.project):
            return (
                f'"{named:.80}" is outside of the project {self.allowed.project.name}; '
                "put it beside this file or below the folder that has the pyproject.toml, and name it from here"
            )
        if other in around:
            ring = " -> ".join(one.name for one in [*around[around.index(other) :], other])
            return f"files that include each other have no end: {ring}; leave one of them out"
        if not other.is_file():
            return f'there is no file "{named:.80}" there; correct the name, from the folder of this file'
        return None

    def box(self, path: Path, file: str, around: list[Path]) -> type[FileBox] | None:
        """Give the type of the subgraphs that a file describes; None if it cannot be, which is reported."""
        if path in self.types:
            return self.types[path]
        before = len(self.findings.problems)
        read = self.read(path, file)
        self.types[path] = None
        if read is None:
            return None
        parts = self.parts(read, path, [*around, path])
        if not self.may_import(read):
            return None

        def said(kind: str, name: str, sentence: str) -> None:
            self.findings.add(file, read.lines.get((kind, name), 1), name, sentence)

        found = file_box_type(path, read.document, parts, _filling(read, parts, path), said, self.find)
        self.types[path] = found if len(self.findings.problems) == before else None
        return self.types[path]

    # --- what may be imported ---

    def find(self, reference: str) -> Any:
        """Give what a value refers to by "module:name".

        Raises:
          GraphError: it must not be imported, or is no value for a file to have.
          EncodingError: there is none.
        """
        why = self.allowed.refusal_of_reference(reference)
        if why is not None:
            raise GraphError(why)
        found = find_reference(reference)
        why = self.allowed.refusal_of_value(reference, found)
        if why is not None:
            raise GraphError(why)
        return found

    def may_import(self, read: Read) -> bool:
        """Report all that a document names and must not be imported; if there is any, nothing is."""
        before = len(self.findings.problems)
        for key, text, is_type in _references(read.document, ()):
            why = self.allowed.refusal_of_type(text) if is_type else self.allowed.refusal_of_reference(text)
            if why is not None:
                self.findings.add(read.file, read.lines.get(key, 0), graph_path(key), why)
        return len(self.findings.problems) == before


def _filling(read: Read, parts: Mapping[str, type[FileBox]], path: Path) -> Callable[[Any, Graph], None]:
    def fill(owner: Subgraph, graph: Graph) -> None:
        loading = _current.get()
        if loading is not None:
            _Making(loading, read, (), parts).fill(graph, read.document, owner)
            return
        loading = _Loading(path, ())
        with loading.ours(), raise_refusals():
            _Making(loading, read, (), parts).fill(graph, read.document, owner)
            for _, step in sorted(loading.later, key=lambda one: one[0]):
                step()
        loading.findings.reject(f"{read.file} cannot be loaded")

    return fill


def _is_of(names: Set[str], port: str) -> bool:
    """Whether that is the path of a port of one of these nodes."""
    name, dot, _ = port.partition(".")
    return bool(dot) and name in names


def _nodes(box: BoxDocument, key: Key) -> Iterator[tuple[Key, NodeDocument]]:
    """All nodes of a document, with where they stand."""
    waiting = [(key, box)]
    while waiting:
        key, box = waiting.pop(0)
        for name, node in box.nodes.items():
            yield (*key, "nodes", name), node
            if node.graph is not None:
                waiting.append(((*key, "nodes", name, "graph"), node.graph))


def modules_of(document: Document) -> dict[str, str]:
    """Give the modules that a graph needs for its nodes and operators, each with the first place that does."""
    found: dict[str, str] = {}
    for key, text, is_type in _references(document, ()):
        if not is_type:
            found.setdefault(text.partition(":")[0], graph_path(key).removesuffix(".type"))
    return found


def _references(document: Document, key: Key) -> Iterator[tuple[Key, str, bool]]:
    """All texts that name what is imported, with where they stand, and whether they are types of ports."""
    boxes: list[tuple[Key, BoxDocument]] = [(key, document)]
    for at, node in _nodes(document, key):
        if node.type:
            yield (*at, "type"), node.type, False
        if node.graph is not None:
            boxes.append(((*at, "graph"), node.graph))
    for at, box in boxes:
        for kind in ("inputs", "outputs", "events", "slots"):
            for name, text in getattr(box, kind).items():
                yield (*at, kind, name), text, True
        for name, parameter in box.parameters.items():
            yield (*at, "parameters", name, "type"), parameter.type, True
        for number, edge in enumerate(box.edges):
            for operator in edge.through:
                yield (*at, "edges", number), operator.type, False


class _Making:
    """Makes what one document says."""

    def __init__(self, loading: _Loading, read: Read, key: Key, parts: Mapping[str, type[FileBox]]) -> None:
        self.loading = loading
        self.lines: Lines = read.lines
        self.read = read
        self.key = key
        self.parts = parts
        self.outermost: Graph = _NOBODY
        self.gated: list[tuple[Graph, str, GateDocument, Key, Set[str]]] = []

    def wrong(self, key: Key, error: object, path: str | None = None) -> None:
        """Report something."""
        line = next((self.lines[key[:end]] for end in range(len(key), 0, -1) if key[:end] in self.lines), 0)
        where = graph_path(key) if path is None else path
        sentence = str(error).removeprefix(f'node "{where}": ')
        self.loading.findings.add(self.read.file, line, where, sentence)

    @contextmanager
    def told(self, key: Key, path: str | None = None) -> Iterator[None]:
        """Report what is refused inside."""
        try:
            yield
        except FileError as error:  # of a file that is included by a type
            self.loading.findings.problems += error.problems  # type: ignore[arg-type]
        except HfgError as error:
            self.wrong(key, error, path)
        except ValueError as error:  # a value that breaks the limits of a parameter
            self.wrong(key, error, path)

    def fill(self, graph: Graph, box: BoxDocument, owner: Subgraph | None, key: Key | None = None) -> None:
        """Make what is inside of a graph."""
        key = self.key if key is None else key
        if key == self.key:
            self.outermost = graph
        if isinstance(box, Document):
            self.add_groups(graph, box, key)
        if owner is None:
            self.declare(graph, box, key)
        for name, node in box.nodes.items():
            with self.told((*key, "nodes", name)):
                self.add(graph, box, name, node, (*key, "nodes", name))
        lost = {name for name in (*box.nodes, *self.named(key)) if name not in graph.nodes}  # what is wrong was told
        for number, edge in enumerate(box.edges):
            if not (_is_of(lost, edge.source) or _is_of(lost, edge.target)):
                with self.told((*key, "edges", number), f"{edge.source} -> {edge.target}"):
                    self.connect(level_of(graph), edge, owner, (*key, "edges", number))
        for name, path in ((name, path) for name, inner in box.promotes.items() for path in inner):
            if path.partition(".")[0] not in lost:
                with self.told((*key, "promotes", name)):
                    self.promote(graph, box, owner, name, path, (*key, "promotes", name))
        self.note_gates(graph, box, key, lost)
        if key == self.key:
            self.gate_all()

    def add_groups(self, graph: Graph, document: Document, key: Key) -> None:
        """Declare the groups of a whole graph."""
        for name, group in document.groups.items():
            with self.told((*key, "groups", name), f'group "{name}"'):
                graph.group(name, **cast(GroupGiven, {"threads": group.threads, **group.said()}))

    def note_gates(self, graph: Graph, box: BoxDocument, key: Key, lost: Set[str]) -> None:
        """Note the gates in a graph; they are made when all is there."""
        for name, node in box.nodes.items():
            if isinstance(graph.nodes.get(name), MissingNode):
                node = msgspec.structs.replace(node, inside={})
            for path, said, at in self.gates(name, node, (*key, "nodes", name)):
                self.gated.append((graph, path, said, at, lost))

    def gates(self, name: str, node: NodeDocument, key: Key) -> Iterator[tuple[str, GateDocument, Key]]:
        """The gates of a node and of what is inside of it."""
        if node.gate is not None:
            yield name, node.gate, (*key, "gate")
        if (not node.type and not node.file) or node.graph is None:
            for path, inner in node.inside.items():
                if inner.gate is not None:
                    yield f"{name}/{path}", inner.gate, (*key, "inside", path, "gate")

    def gate_all(self) -> None:
        """Set the gates when all nodes are there, for any may be gated by any."""
        for graph, path, said, key, lost in self.gated:
            by, level = said.by, level_of(graph)
            if by.startswith("/"):
                outer = level_of(self.outermost)
                prefix = level.path.removeprefix(outer.path).removeprefix("/")
                graph, path, by = self.outermost, f"{prefix}/{path}" if prefix else path, by[1:]
            elif by.partition("/")[0] in lost:
                continue
            if path.partition("/")[0] in lost:
                continue
            with self.told(key):
                graph.gate(path, by=by, idle_rate_hz=said.idle_rate_hz)

    def named(self, key: Key) -> Iterator[str]:
        """The nodes that the file has there, also those whose lines are wrong."""
        return (str(one[-1]) for one in self.read.lost if one[:-2] == key)

    def declare(self, graph: Graph, box: BoxDocument, key: Key) -> None:
        """The ports of a whole graph."""
        for kind, declare in (("inputs", graph.input), ("outputs", graph.output)):
            for name, text in getattr(box, kind).items():
                with self.told((*key, kind, name)):
                    declare(name, type_of_text(text, f'{kind[:-1]} "{name}"'))

    # --- nodes ---

    def add(self, graph: Graph, box: BoxDocument, name: str, said: NodeDocument, key: Key) -> None:
        made = self.made(graph, box, name, said, key)
        if made is None:
            return
        try:
            graph.add(made, name=name, **cast(NodeGiven, said.said()))
        except GraphError as error:
            given = (option for option in NODE_OPTIONS if (*key, option) in self.lines and option in str(error))
            self.wrong((*key, next(given, "type")), error, graph_path(key))
            if graph.nodes.get(name) is not made:
                graph.add(made, name=name)  # without its options, so that its edges are looked at, too
        if said.graph is not None and said.type and inside(made) is not None:
            self.fill_anew(made, said.graph, key)
        self.note(graph, made, said.position, said.notes)
        if isinstance(made, MissingNode):
            return
        for path, other in said.inside.items():
            step = _Step(self, made, path, other, (*key, "inside", path))
            self.loading.later.append((level_of(graph).depth, step))

    def made(self, graph: Graph, box: BoxDocument, name: str, said: NodeDocument, key: Key) -> Any:
        """Make a node that is in no graph yet; None if it cannot be, which is reported."""
        if said.file:
            kind: Any = self.parts.get(said.file)
            if kind is None:
                return None
        elif said.type:
            try:
                kind = registry.find(said.type)
            except registry.NotANodeType as error:
                self.wrong((*key, "type"), error, graph_path(key))
                return None
            except TargetError as error:
                where = f"{self.read.file}, line {self.lines.get((*key, 'type'), 0)}"
                self.loading.absent.append(
                    (self.read.file, self.lines.get((*key, "type"), 0), graph_path(key), str(error))
                )
                return missing_node(said, name, box.edges, str(error), where)
        else:
            assert said.graph is not None
            inner = said.graph
            kind = box_type(
                inner,
                graph_path(key),
                lambda owner, face: self.fill(face, inner, owner, (*key, "graph")),
                lambda what, port, sentence: self.wrong((*key, "graph", what, port), sentence),
                self.loading.find,
            )
        return self.node_of(kind, said, key)

    def node_of(self, kind: Any, said: NodeDocument, key: Key) -> Any:
        specs = kind._type.parameters
        values: dict[str, Any] = {}
        for name, data in said.parameters.items():
            at = (*key, "parameters", name)
            if name not in specs or not specs[name].is_given:
                known = [one for one, spec in specs.items() if spec.is_given]
                hint = "inputs are connected by edges, not given here" if name in kind._type.inputs else ""
                self.wrong(at, f'there is no parameter "{name}"; {hint or suggest(name, known)}')
                continue
            with self.told(at):
                values[name] = decoded_parameter(specs[name], data, self.loading.find)
            if name not in values:
                continue
            wrong = None if specs[name].size else specs[name].check(values[name])
            if wrong is not None:
                del values[name]
                self.wrong(at, f"{wrong}; correct the value, or take it out")
        try:
            return kind(**values)
        except (TypeError, ValueError) as error:
            if any(name not in values for name in said.parameters):
                return None  # it was told
            self.wrong((*key, "parameters"), error, graph_path(key))
            return None

    def fill_anew(self, made: Subgraph, box: BoxDocument, key: Key) -> None:
        """What is inside is not what the type builds: it is taken out first."""
        within = inside(made)
        assert within is not None
        within.promotions.become({})
        root = within.whole.root
        perform(root, [Disconnect(edge.source.path, edge.target.path) for edge in reversed(within.edges)])
        perform(root, [Remove(within.path_to(name)) for name in list(within.nodes)])
        self.fill(graph_of(within.face), box, made, (*key, "graph"))

    def note(self, graph: Graph, node: Node | None, position: list[Any] | None, notes: dict[str, Any]) -> None:
        """What editors noted."""
        noted = ({} if position is None else {"position": position}) | notes
        if noted:
            level_of(graph).whole.notes[node] = noted

    # --- edges ---

    def connect(self, level: Level, said: EdgeDocument, owner: Subgraph | None, key: Key) -> None:
        source = _end(level, said.source, owner, ("inputs", "slots"), source_at)
        target = _end(level, said.target, owner, ("outputs", "events"), target_at)
        where = f'"{said.source}" -> "{said.target}"'
        options = edge_as_meant(said.said(), target, where, partial(decoded, find=self.loading.find))
        declare_edge(level, source, target, options)

    def promote(self, graph: Graph, box: BoxDocument, owner: Subgraph | None, name: str, path: str, key: Key) -> None:
        if owner is None:
            return  # a whole graph has none, which was told
        if name not in owner.ports.parameters:
            raise GraphError(f'there is no parameter "{name}" to promote to; {suggest(name, owner.ports.parameters)}')
        node_name, dot, parameter = path.partition(".")
        node = graph.nodes.get(node_name)
        if not dot or node is None or parameter not in node.ports.parameters:
            known = [f"{one}.{each}" for one, inner in graph.nodes.items() for each in inner.ports.parameters]
            raise GraphError(f'"{path}" is no parameter inside; {suggest(path, known)}')
        graph.promote(owner.ports.parameters[name], node.ports.parameters[parameter])
        said = box.nodes[node_name].parameters if node_name in box.nodes else {}
        if parameter in said:  # which is another value than that of the subgraph

            def set_again() -> None:
                with self.told(key):
                    node._set_parameter(
                        parameter,
                        decoded_parameter(node._type.parameters[parameter], said[parameter], self.loading.find),
                    )

            self.loading.later.append((level_of(graph).depth, set_again))


class _Step:
    """Lets something be otherwise inside of a subgraph, when all is built."""

    def __init__(self, making: _Making, box: Node, path: str, said: InsideDocument, key: Key) -> None:
        self.making, self.box, self.path, self.said, self.key = making, box, path, said, key

    def __call__(self) -> None:
        making, said, key = self.making, self.said, self.key
        within = inside(self.box)
        with making.told(key):
            if within is None:
                raise GraphError("nothing is inside, for this is no subgraph; take these lines out")
            node = node_at(within, self.path)
            for name, data in said.parameters.items():
                with making.told((*key, "parameters", name)):
                    specs = node._type.parameters
                    if name not in specs:
                        raise GraphError(f'there is no parameter "{name}"; {suggest(name, specs)}')
                    node._set_parameter(name, decoded_parameter(specs[name], data, making.loading.find))
            if said.enabled is not None:
                set_options(node, msgspec.structs.replace(node._options, enabled=said.enabled))
            if said.group is not None:
                perform(within.whole.root, [Move(node.place.path, said.group or None)])
            if said.position is not None or said.notes:
                before = within.whole.notes.get(node, {})
                noted = ({} if said.position is None else {"position": said.position}) | said.notes
                within.whole.notes[node] = before | noted


def _end(
    level: Level,
    path: str,
    owner: Subgraph | None,
    kinds: tuple[str, str],
    at: Callable[[Level, str], Any],
) -> Any:
    """Find one end of an edge; a name alone is a port of the subgraph itself, or of the whole graph."""
    whole = path.removeprefix("/")
    if owner is None or "." in path or whole != path:
        return at(level, whole)
    for kind in kinds:
        ports = getattr(owner.ports, kind)
        if path in ports:
            return ports[path].inner
    if path in level.ports.by_name():
        return at(level, path)
    known = [name for kind in kinds for name in getattr(owner._type, kind)]
    raise GraphError(f'the subgraph has no "{path}" that could be here; {suggest(path, known)}')
