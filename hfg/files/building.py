"""Makes a graph of a graph file, and reports everything that is wrong with the file at once, with its lines.

First every included file is read, and everything that the files would import is checked; only then are node types
imported and the graph made. Problems that only follow from others are not reported. Depends on `reading`, `boxes`,
`missing` and `allowed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final

from typing_extensions import override

from hfg import registry
from hfg.base.bounds import NODES_AND_PORTS
from hfg.base.logs import Log
from hfg.encoding import find_reference
from hfg.errors import EngineInternalError, FileError, GraphError, HfgError, TargetError
from hfg.files.allowed import Allowed
from hfg.files.boxes import FileBox, file_box_type
from hfg.files.findings import Findings, graph_path
from hfg.files.missing import MissingNode, missing_node
from hfg.files.reading import Read, read_bytes, read_file
from hfg.graph.editing.boxes import box_type
from hfg.graph.editing.document import NODE_OPTIONS, PORT_KINDS, BoxDocument, Document, NodeDocument
from hfg.graph.editing.from_document import Builder, Key
from hfg.graph.editing.making import fitting
from hfg.graph.editing.steps import Multiplied, Steps
from hfg.graph.graph import Graph, Subgraph
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.node import Node

_LOGGER: Final = Log("hfg.files")
_current: ContextVar[_Loading | None] = ContextVar("hfg.files.loading", default=None)


def load(path: Path, allow: Iterable[str] = ()) -> Graph:
    """See `hfg.load`."""
    loading = _Loading(path, allow)
    read = loading.read(path.resolve(), str(path))
    if read is None:
        loading.findings.reject(f"{path} cannot be loaded")
        raise EngineInternalError(f"{path} was not read, and no problem was reported")
    graph = loading.graph(read, path.resolve())
    if unneeded := loading.allowed.unneeded():
        _LOGGER.warning("%s: %s", path, unneeded)
    return graph


def build(document: Document, beside: Path, allow: Iterable[str] = ()) -> Graph:
    """Make a graph of a document that does not come from a file.

    Args:
      document: what the graph is.
      beside: the path that the document would have as a file: included files are named relative to its folder.
      allow: packages whose node types may be imported.

    Raises:
      FileError: it cannot be made; `problems` lists everything.
    """
    loading = _Loading(beside, allow)
    return loading.graph(Read(document, {}, str(beside)), beside.resolve())


def build_text(text: str, file: Path, allow: Iterable[str] = ()) -> Graph:
    """Make a graph of the text of a graph file that is not on the disk.

    Args:
      text: what the file would contain.
      file: the path that the file would have; problems name it.
      allow: packages whose node types may be imported.

    Raises:
      FileError: it cannot be made; `problems` lists everything, with lines.
    """
    loading = _Loading(file, allow)
    read = read_bytes(text.encode(), file.name, loading.findings)
    loading.findings.reject(f"{file.name} cannot be loaded")
    if read is None:
        raise EngineInternalError(f"{file.name} was not read, and no problem was reported")
    return loading.graph(read, file.resolve())


def box_of_file(path: Path) -> type[FileBox]:
    """Read the type of the subgraphs that a file describes.

    Raises:
      FileError: it cannot be made.
    """
    loading = _Loading(path, ())
    found = loading.box(path.resolve(), str(path), [])
    loading.findings.reject(f"{path} cannot be loaded")
    if found is None:
        raise EngineInternalError(f"{path} was not read, and no problem was reported")
    return found


FileBox._read = staticmethod(box_of_file)


class _Loading:
    """Reads a file and all that it includes."""

    def __init__(self, path: Path, allow: Iterable[str]) -> None:
        self.findings = Findings()
        self.allowed = Allowed(path, allow)
        self.files: dict[Path, Read | None] = {}
        self.types: dict[Path, type[FileBox] | None] = {}
        self.sizes: dict[Path, int] = {}  # nodes of a file with those of the files that it includes
        self.multiplied = Multiplied()  # ports of vectors, of all files together
        self.absent: list[tuple[str, int, str, str]] = []  # file, line and path of types that are not there, and why
        self.later: list[tuple[int, int, Callable[[], None]]] = []  # see `Builder.later`, for all files together

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
        document = read.document
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
        with self.ours():
            self.build(level_of(graph), read, parts).finish()
        if self.findings.problems:  # else the graph has them in their places, and its check reports them
            for file, line, at, why in self.absent:
                self.findings.add(file, line, at, f"its type is not there: {why}; install what has it, or correct it")
        self.findings.reject(f"{read.file} cannot be loaded", self.allowed.wanted)
        return graph

    def build(self, level: Level, read: Read, parts: Mapping[str, type[FileBox]]) -> Builder:
        """Make what a file says at an empty level; whoever builds the outermost one also finishes it."""
        builder = _Builder(self, level, read, parts)
        builder.build(read.document)
        return builder

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
        """Return the types of the files that a document includes, by how it names them."""
        found: dict[str, type[FileBox]] = {}
        size = 0
        for key, node in _nodes(read.document, ()):
            size += 1
            if not node.file:
                continue
            box = found.get(node.file) or self.part(read, (*key, "file"), node.file, path, around)
            if box is None:
                continue
            size += self.sizes[box._file]
            if size > NODES_AND_PORTS.most:
                line = read.lines.get((*key, "file"), 0)
                sentence = f"with this file the graph has {size:,} nodes: {NODES_AND_PORTS.remedy}"
                self.findings.add(read.file, line, graph_path(key), sentence)
                break
            found[node.file] = box
        self.sizes[path] = size
        return found

    def part(self, read: Read, key: Key, named: str, path: Path, around: list[Path]) -> type[FileBox] | None:
        sentence = self.refusal_of_part(named, path, around)
        if sentence is not None:
            self.findings.add(read.file, read.lines.get(key, 0), graph_path(key[:-1]), sentence)
            return None
        return self.box((path.parent / named).resolve(), str(Path(read.file).parent / named), around)

    def refusal_of_part(self, named: str, path: Path, around: list[Path]) -> str | None:
        """Return why a file cannot be included; None if it may be."""
        try:
            other = (path.parent / named).resolve()
            is_there = other.is_file()
        except (OSError, ValueError, RuntimeError) as error:
            why = getattr(error, "strerror", None) or error
            return f'"{named:.80}" cannot be the name of a file ({why}); correct it'
        if Path(named).is_absolute() or not other.is_relative_to(self.allowed.project):
            return (
                f'"{named:.80}" is outside of the project {self.allowed.project.name}; '
                "put it beside this file or below the folder that has the pyproject.toml, and name it from here"
            )
        if other in around:
            ring = " -> ".join(one.name for one in [*around[around.index(other) :], other])
            return f"files that include each other have no end: {ring}; leave one of them out"
        if not is_there:
            return f'there is no file "{named:.80}" there; correct the name, from the folder of this file'
        return None

    def box(self, path: Path, file: str, around: list[Path]) -> type[FileBox] | None:
        """Return the type of the subgraphs that a file describes; None if it cannot be, which is reported."""
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
        """Return what a value refers to by "module:name".

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
    """Return what fills the inside of a subgraph: as a part of the file that is being loaded, or by itself."""

    def fill(_owner: Subgraph, graph: Graph) -> None:
        loading = _current.get()
        if loading is not None:
            loading.build(level_of(graph), read, parts)
            return
        loading = _Loading(path, ())
        with loading.ours():
            loading.build(level_of(graph), read, parts).finish()
        loading.findings.reject(f"{read.file} cannot be loaded")

    return fill


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
    """Return the modules that a graph needs for its nodes and operators, each with the first place that does."""
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
        for kind in PORT_KINDS:
            for name, text in getattr(box, kind).items():
                yield (*at, kind, name), text, True
        for name, parameter in box.parameters.items():
            yield (*at, "parameters", name, "type"), parameter.type, True
        for number, edge in enumerate(box.edges):
            for operator in edge.through:
                yield (*at, "edges", number), operator.type, False


class _Builder(Builder):
    """Makes the contents of one file; reports instead of raising."""

    def __init__(self, loading: _Loading, level: Level, read: Read, parts: Mapping[str, type[FileBox]]) -> None:
        super().__init__(level, Steps(level, loading.find, loading.multiplied))
        self.loading = loading
        self.read = read
        self.parts = parts
        self.later = loading.later

    def wrong(self, key: Key, error: object, path: str = "") -> None:
        """Report a problem with the line of the innermost part of the file that has one."""
        lines = self.read.lines
        line = next((lines[key[:end]] for end in range(len(key), 0, -1) if key[:end] in lines), 0)
        where = path or graph_path(key)
        sentence = str(error).removeprefix(f'node "{where}": ').removeprefix(f"{where}: ")
        self.loading.findings.add(self.read.file, line, where, sentence)

    @override
    @contextmanager
    def refusing(self, key: Key, path: str = "") -> Iterator[None]:
        try:
            yield
        except FileError as error:  # of a file that is included by a type
            self.loading.findings.problems += error.problems  # type: ignore[arg-type]
        except (HfgError, ValueError) as error:  # the latter: a value that violates the limits of a parameter
            self.wrong(key, error, path)

    @override
    def lost(self, key: Key) -> Set[str]:
        return {str(one[-1]) for one in self.read.lost if one[:-2] == key}

    @override
    def may_differ(self, node: Node) -> bool:
        return not isinstance(node, MissingNode)

    @override
    def add(self, level: Level, name: str, node: Node, said: NodeDocument, key: Key) -> None:
        try:
            super().add(level, name, node, said, key)
        except GraphError as error:
            given = (one for one in NODE_OPTIONS if (*key, one) in self.read.lines and one in str(error))
            self.wrong((*key, next(given, "type")), error, graph_path(key))
            if level.nodes.get(name) is not node:
                self.steps.add(level, name, node, {})  # without its options, so that its edges are checked, too

    @override
    def make(self, level: Level, name: str, said: NodeDocument, key: Key, box: BoxDocument) -> Node | None:
        kind: Any = None
        if said.file:
            kind = self.parts.get(said.file)  # None if the file is wrong, which was reported
        elif said.type:
            try:
                kind = registry.find(said.type)
            except registry.NotANodeType as error:
                self.wrong((*key, "type"), error, graph_path(key))
            except TargetError as error:
                line = self.read.lines.get((*key, "type"), 0)
                self.loading.absent.append((self.read.file, line, graph_path(key), str(error)))
                return missing_node(said, name, box.edges, str(error), f"{self.read.file}, line {line}")
        else:
            assert said.graph is not None

            def report(what: str, port: str, sentence: str) -> None:
                self.wrong((*key, "graph", what, port), sentence)

            kind = box_type(level.whole.box_type, said.graph, {}, report, self.loading.find)
        return None if kind is None else self.node_of(kind, said, key)

    def node_of(self, kind: Any, said: NodeDocument, key: Key) -> Node | None:
        """Make a node of a type; each parameter that is wrong is reported in its line."""
        specs = kind._type.parameters
        values: dict[str, Any] = {}
        for name, data in said.parameters.items():
            at = (*key, "parameters", name)
            if name not in specs or not specs[name].is_given:
                known = [one for one, spec in specs.items() if spec.is_given]
                hint = "inputs are connected by edges, not given here" if name in kind._type.inputs else ""
                self.wrong(at, f'there is no parameter "{name}"; {hint or suggest(name, known)}')
                continue
            with self.refusing(at):
                value = fitting(specs[name], data, self.loading.find)
                problem = None if specs[name].size else specs[name].check(value)
                if problem is None:
                    values[name] = value
                else:
                    self.wrong(at, f"{problem}; correct the value, or remove it")
        try:
            node: Node = kind(**values)
        except (TypeError, ValueError) as error:
            if all(name in values for name in said.parameters):  # otherwise it was reported
                self.wrong((*key, "parameters"), error, graph_path(key))
            return None
        return node
