"""A recording as the studio shows it: its graph at any time, its ports, and the values of its tokens.

Depends on the floor of recordings and on the graph.
"""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Iterable
from typing import Any, Final

from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.base.token import Token
from hfg.encoding.plain import json_value
from hfg.errors import GraphError, HfgError, UsageError
from hfg.files.missing import missing_node
from hfg.graph import Graph
from hfg.graph.editing import history_of
from hfg.graph.editing.commands import Add, Command, Connect, decode, encode, read
from hfg.graph.editing.document import EdgeDocument, NodeDocument
from hfg.graph.flat import flatten
from hfg.graph.structure.adding import add
from hfg.graph.structure.edge import end_path
from hfg.graph.structure.level import inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.recording.chunks import Damaged
from hfg.recording.course import Course
from hfg.recording.messages import EVENTS, TokenReader
from hfg.recording.reading import File, nanoseconds_in, number_in
from hfg.recording.seeking import Found, Seeking
from hfg.recording.tracks import recorded_ports

__all__ = ["Recorded", "Values"]

_KEPT_BYTES: Final = 64 * 2**20
_MOST_KEPT: Final = 256
_MOST_GAPS: Final = 100
"""Parts of a graph that cannot be built: to find each takes a check of all that was built (rule L4)."""


class Recorded:
    """A recording that is open.

    Attributes:
      path: of its file, as the user wrote it.
      seeking: its messages by time.
      course: what happened besides tokens.
      began: when the run began, in nanoseconds.
      last: when its last message was sent.
      channels: of the recorded ports, by path.
      nodes: the recorded ports of each node, by its path.
      gaps: what of the graph or the file is not there, as sentences.
    """

    def __init__(self, path: str | os.PathLike[str], graph: Graph | None = None, *, allow: Iterable[str] = ()) -> None:
        """Open it.

        Args:
          path: its file.
          graph: the graph as it was when the run began; None: as the recording describes it.
          allow: further packages that the types of the graph may be from.

        Raises:
          UsageError: it is not a recording of hfg, or does not describe its graph.
        """
        file = File(path)
        try:
            self.path = str(path)
            self._about = file.metadata.get("hfg", {})
            if not self._about:
                raise UsageError(f"{path} holds no graph, because hfg did not write it; hfg info shows what it holds")
            self._allow = tuple(allow)
            self.gaps: list[str] = []
            if graph is None:
                self._commands = encode(_commands(self._about.get("commands", ""), self.path))
                graph = self._built()
            else:
                self._commands = encode(graph.as_commands())
                _forget_edits(graph)
            self._first: Graph | None = graph
            self.seeking = Seeking(file)
            self.course = Course(self.seeking)
            self.channels: dict[str, int] = {name: one.id for name, one in recorded_ports(file).items()}
            self.began = self._beginning()
            self.last = max(self.seeking.last, self.began)
            self.nodes: dict[str, list[str]] = {}
            for name, one in recorded_ports(file).items():
                self.nodes.setdefault(str(one.metadata.get("node", "")), []).append(name)
            self.settings = _settings(self._about.get("nodes", ""))
        except BaseException:
            file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self.seeking.close()

    @property
    def name(self) -> str:
        """The name of the graph."""
        return self._about.get("graph") or "graph"

    def _beginning(self) -> int:
        seeking = self.seeking
        events = min(seeking.file.numbers_of(EVENTS), default=0)
        first = seeking.after([events], -1)
        found = None if first is None else seeking.latest(events, first)
        if found is not None:
            try:
                event = seeking.file.object_in(seeking.read(found))
                if event.get("type") == "RunStarted":
                    return nanoseconds_in(event.get("time"))
            except (Damaged, UsageError):
                pass  # the description of the run says it, too
        said = nanoseconds_in(self._about.get("began", 0.0))
        return said if 0 < said <= seeking.first else seeking.first

    # --- the graph ----------------------------------------------------------------------------------------------------

    def graph_after(self, edits: int) -> Graph:
        """Return the graph as it was after its first edits, the number of which is given."""
        graph, self._first = self._first or self._built(), None
        for _, change in self.course.edits[:edits]:
            try:
                if change == "undo":
                    graph.undo()
                elif change == "redo":
                    graph.redo()
                elif change:
                    graph.edit(*decode(change, allow=self._allow))
            except HfgError as error:
                self._misses(f"an edit of the graph cannot be repeated: {error}")
        return graph

    def _built(self) -> Graph:
        graph = Graph(self._about.get("graph") or "graph")
        try:
            graph.edit(*decode(self._commands, allow=self._allow))
        except HfgError:
            graph = Graph(graph.name)
            self._build_in_parts(graph)
        _forget_edits(graph)
        return graph

    def _build_in_parts(self, graph: Graph) -> None:
        """Build a graph of which some types are not there."""
        commands = read(self._commands)
        left = [commands]
        while left and len(self.gaps) < _MOST_GAPS:
            some = left.pop()
            try:
                graph.edit(*decode(encode(some), allow=self._allow))
            except HfgError as error:
                if len(some) > 1:
                    left += [some[len(some) // 2 :], some[: len(some) // 2]]
                    continue
                self._misses(str(error))
                if isinstance(some[0], Add):
                    _stand_in(graph, some[0], commands, str(error))
        if left:
            self._misses("more of the graph cannot be built, and the rest of it is not shown")

    def _misses(self, what: str) -> None:
        if what not in self.gaps:
            self.gaps.append(what)

    def origins(self, graph: Graph) -> dict[str, str]:
        """Return the recorded port from which that comes which passes a port or an edge, by its path."""
        found: dict[str, str] = {}
        for flat in flatten(graph).walk():
            for edge in flat.edges:
                if not edge.segments:
                    continue
                source = end_path(edge.segments[0].source)
                if source not in self.channels:
                    continue
                found.setdefault(edge.label, source)
                for segment in edge.segments:
                    for place in (segment.label, end_path(segment.source), end_path(segment.target)):
                        found.setdefault(place, source)
        return found | {path: path for path in self.channels}


def _forget_edits(graph: Graph) -> None:
    """Let the history begin with the run."""
    history = history_of(graph)
    history.done.clear()
    history.undone.clear()


def _commands(text: str, path: str) -> list[Command]:
    if not text:
        raise UsageError(
            f"{path} does not describe its graph, because some of its types cannot be found by name; "
            f"name the graph: hfg studio {path} --into robot.py"
        )
    if len(text) > GRAPH_FILE_BYTES.most:
        raise UsageError(f"the description of the graph in {path} has {len(text):,} bytes, {GRAPH_FILE_BYTES.remedy}")
    try:
        return list(read(text))
    except GraphError as error:
        raise UsageError(f"{path} is damaged: the description of its graph cannot be read ({error})") from None


def _stand_in(graph: Graph, command: Add, commands: Iterable[Command], why: str) -> None:
    """Put something in the place of a node whose type is not there."""
    around, _, name = command.path.rpartition("/")
    root = level_of(graph)
    try:
        level = root if not around else inside(node_at(root, around))
        if level is None:
            return
        here = len(around) + 1 if around else 0
        edges = [
            EdgeDocument(one.source[here:], one.target[here:], **_operators(one))
            for one in commands
            if isinstance(one, Connect) and one.source.startswith(around) and one.target.startswith(around)
        ]
        node = missing_node(NodeDocument(type=command.type), name, edges, why, "the recording")
        add(level, node, name, {})
    except HfgError:
        return  # it cannot be drawn; the list of problems names it


def _operators(command: Connect) -> dict[str, Any]:
    return {"active": True} if command.active else {}


def _settings(text: str) -> dict[tuple[str, str], Any]:
    """Return the parameters at the begin of the run, by node and name."""
    try:
        nodes = json_value(text.encode())
        return {
            (path, name): value for path, node in nodes.items() for name, value in node.get("parameters", {}).items()
        }
    except (AttributeError, RecursionError, ValueError):
        return {}


class Values:
    """Tokens of a recording, decoded; the newest are kept. They can be asked for from any thread."""

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded
        self._lock = threading.Lock()
        self._kept: OrderedDict[Found, tuple[Token[Any], int]] = OrderedDict()
        self._bytes = 0
        self._readers: dict[int, TokenReader] = {}

    def types_of(self, graph: Graph) -> None:
        """Read values from now on as the types of the graph's ports say."""
        readers = {}
        file = self._recorded.seeking.file
        for path, number in self._recorded.channels.items():
            schema = file.schemas.get(file.channels[number].schema_id)
            try:
                hint: Any = graph[path].type
            except (AttributeError, HfgError):
                hint = Any
            readers[number] = TokenReader("" if schema is None else schema.name, hint, may_pickle=False)
        with self._lock:
            self._readers = readers
            self._kept.clear()
            self._bytes = 0

    def token(self, found: Found) -> Token[Any]:
        """Return a token; a value whose type is not there is what its JSON says.

        Raises:
          Damaged: it cannot be read, and why.
        """
        with self._lock:
            known = self._kept.get(found)
            if known is not None:
                self._kept.move_to_end(found)
                return known[0]
            reader = self._readers[found.channel]
        data = self._recorded.seeking.read(found)
        try:
            message = json_value(data)
            token = _token(reader, message)
        except Exception as error:  # the data may make numpy or OpenCV raise anything
            raise Damaged(f"this value cannot be read: {error}") from None
        with self._lock:
            self._kept[found] = token, len(data)
            self._bytes += len(data)
            while len(self._kept) > 1 and (self._bytes > _KEPT_BYTES or len(self._kept) > _MOST_KEPT):
                self._bytes -= self._kept.popitem(last=False)[1][1]
        return token


def _token(reader: TokenReader, message: dict[str, Any]) -> Token[Any]:
    try:
        return reader.token(message)
    except Exception:
        if "value" not in message:
            raise
        activity, number = message.get("activity", 0), message.get("sequence", 0)
        return Token(message["value"], activity, number_in(message.get("stamp")), number)
