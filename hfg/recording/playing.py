"""Playing recordings back: nodes that send what was recorded, when it was.

What one node has sent is played by one node, firing by firing: the tokens that left together leave together again,
with their values, modifiers and stamps, silence and the end of the stream included; so a graph that is played into
does what it did. It fires when its next record is due (its `ready()` says so), and between that its slots are called
as ever. In the place of a node of the graph stands one with the same ports, parameters and options. Stands on the
engine, `reading` and `messages`.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import sys
import types
from collections.abc import Iterator, Mapping, Set
from pathlib import Path
from typing import Any, Final

import msgspec

from hfg.engine.model.worker import UNREADY
from hfg.engine.rules.agenda import unblock
from hfg.errors import EndOfStream, UsageError
from hfg.graph import Graph, commands
from hfg.graph.flat import flatten
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetype import Node, NodeType
from hfg.recording.messages import EVENTS, MARKERS, TokenReader
from hfg.recording.reading import File
from hfg.recording.values import CannotKeep
from hfg.token import END, NO_MESSAGE, Token
from hfg.types import accepts, describe

__all__ = ["Player", "Playing", "Track", "play_into", "recorded_ports"]

_SAME_MOMENT_S: Final = 1e-9
_PLAYBACK: Final = "hfg.nodes.recordings:Playback"


class _Record(msgspec.Struct):
    """One token of a recording: of which port, when it passed (in seconds of its clock), and what."""

    port: str
    kind: str
    when: float
    token: Token[Any]


class _Step(msgspec.Struct):
    """What a node does at one moment: a signal, or all outputs of one firing."""

    when: float
    signal: _Record | None
    sent: dict[str, Token[Any]]

    @property
    def ends(self) -> bool:
        """Whether the node ends with it."""
        return any(token.value is END for token in self.sent.values())

    @property
    def stamp(self) -> float:
        """Of the firing."""
        return max(token.stamp for token in self.sent.values())


class Track:
    """What is to be played of one node: its steps, read from the file as they are needed."""

    def __init__(self, file: File, ports: Mapping[str, Any], *, may_pickle: bool) -> None:
        """Choose what is played.

        Args:
          file: the recording.
          ports: paths of recorded ports, and the type of the port that sends what was recorded there.
          may_pickle: whether pickled values are read.
        """
        self._file = file
        self.began = file.began()
        self._readers: dict[int, tuple[Any, TokenReader, Any]] = {}
        self._paths = set(ports)
        self._exact = file.metadata.get("hfg", {}).get("clock") == "virtual"
        self._kinds: dict[str, str] = {}
        self._markers = frozenset(number for number, one in file.channels.items() if one.topic == MARKERS)
        for number, channel in file.channels.items():
            if channel.topic in ports:
                schema = file.schemas.get(channel.schema_id)
                hint = ports[channel.topic]
                reader = TokenReader(schema.name if schema is not None else "", hint, may_pickle=may_pickle)
                self._readers[number] = (channel, reader, hint)

    def steps(self) -> Iterator[_Step]:
        """Go through them."""
        sent: dict[str, Token[Any]] = {}
        when = 0.0
        for record in self._records():
            if sent and (record.kind == "event" or record.port in sent or record.when != when):
                yield _Step(when, None, sent)
                sent = {}
            if record.kind == "event":
                yield _Step(record.when, record, {})
            else:
                sent[record.port] = record.token
                when = record.when
        if sent:
            yield _Step(when, None, sent)

    def _records(self) -> Iterator[_Record]:
        for number, ns, data in self._file.messages(frozenset(self._readers) | self._markers):
            message = msgspec.json.decode(data)
            if number in self._markers:
                if message["port"] in self._paths:
                    marker = END if message["marker"] == "END" else NO_MESSAGE
                    token: Token[Any] = Token(marker, message.get("activity", 0), message["stamp"])
                    yield _Record(message["port"], "output", self._when(ns, message), token)
                continue
            channel, reader, hint = self._readers[number]
            try:
                token = reader.token(message)
            except (CannotKeep, KeyError, TypeError, ValueError, AttributeError) as error:
                raise UsageError(
                    f'a value of "{channel.topic}" in {self._file.path} cannot be read as {describe(hint)}: {error}'
                ) from None
            kind = "event" if channel.metadata.get("kind") == "event" else "output"
            if not accepts(token.value, hint) and not (token.value is None and kind == "event"):
                raise UsageError(
                    f'"{channel.topic}" in {self._file.path} has the value {token.value!r:.80}, which is no '
                    f"{describe(hint)}, as the port now says: record again, or map it to another port"
                )
            yield _Record(channel.topic, kind, self._when(ns, message), token)

    def _when(self, ns: int, message: dict[str, Any]) -> float:
        if not self._exact:
            return ns / 1e9
        passed = message.get("time")
        return float(message["stamp"] if passed is None else passed)


class Player:
    """Plays the steps of a track as the process function of one node."""

    def __init__(self, node: Node, track: Track, outputs: Mapping[str, str], speed: float | None) -> None:
        """Begin.

        Args:
          node: it sends.
          track: what.
          outputs: which recorded port is which of its outputs and events.
          speed: how much faster than it was; None: as fast as can be.
        """
        self._node = node
        self._outputs = outputs
        self._steps = track.steps()
        self._next: _Step | None = next(self._steps, None)
        self._began = track.began
        self._speed = speed
        run: Any = None if node._place is None else level_of(node._place.graph).whole.run
        self._engine: Any = None if run is None else run._engine
        self._worker: Any = None
        self._start: float | None = None  # when its graph began to move
        if run is not None:
            worker: Any = run._engine.worker_of(node)
            self._worker = worker
            # what it had for a rate is in the recording, and would only hold up who plays faster
            worker.options = msgspec.structs.replace(worker.options, max_rate_hz=None)
            worker.paced = bool(worker.gates_over)
        self._waits = False

    def ready(self) -> bool:
        """Whether a firing is due; if not, it is asked again when it is. Signals that are due are triggered.

        Raises:
          EndOfStream: there is nothing left.
        """
        self._signal()
        step = self._next
        if step is None:
            raise EndOfStream
        return self._is_due_or_waits(step)

    def play(self) -> None:
        """Send the outputs of one firing.

        Raises:
          EndOfStream: the stream ended here.
        """
        step = self._next
        if step is None:
            raise EndOfStream
        self._next = next(self._steps, None)
        if self._worker is not None:
            self._worker.stamp = step.stamp  # what leaves without a stamp of its own, silence too, has that of then
        if self._next is not None and self._next.signal is not None:
            self._is_due_or_waits(self._next, at_once=True)
        if step.ends:
            raise EndOfStream
        for path, token in step.sent.items():
            if token.value is not NO_MESSAGE:
                self._node._port("output", self._outputs[path]).send(
                    token.value, activity=token.activity, stamp=token.stamp
                )

    def _is_due_or_waits(self, step: _Step, *, at_once: bool = False) -> bool:
        if self._engine is None or (self._speed is None and not at_once):
            return True
        now = self._engine.now()
        due = now if self._speed is None else self._due(step.when)
        if due <= now + _SAME_MOMENT_S and not at_once:
            return True
        if not self._waits:
            self._waits = True
            self._engine.call_at(max(due, now), self._now_due)
        return False

    def _due(self, when: float) -> float:
        """When on the clock of this run that is which was `when` on that of the recording."""
        if self._start is None:
            self._start = self._engine.now()
        if self._speed == 1.0 and self._start == self._began:
            return when  # to the bit
        return self._start + (when - self._began) / (self._speed or 1.0)

    def _now_due(self) -> None:
        self._waits = False
        self._signal()
        unblock(self._worker, UNREADY)

    def _signal(self) -> None:
        """Trigger what comes next, as far as that are signals which are due."""
        while self._next is not None and self._next.signal is not None and self._is_due_or_waits(self._next):
            signal = self._next.signal
            self._next = next(self._steps, None)
            token = signal.token
            port = self._node._port("event", self._outputs[signal.port])
            port.trigger(token.value, activity=token.activity, stamp=token.stamp)


def _ready(self: Any) -> bool:
    ready: bool = self._player.ready()
    return ready


def _process(self: Any) -> None:
    self._player.play()


def _teardown(self: Any) -> None:
    recording = getattr(self, "_recording", None)
    if recording is not None:
        recording.close()


def _spoke(file: File) -> set[str]:
    """The ports that anything has passed, markers too."""
    markers = {number for number, one in file.channels.items() if one.topic == MARKERS}
    found: set[str] = set()
    for number, _, data in file.messages():
        if number not in markers:
            found.add(file.channels[number].topic)
        elif file.channels:
            found.add(msgspec.json.decode(data)["port"])
    return found


def recorded_ports(file: File) -> dict[str, Any]:
    """The channels of ports, by path."""
    return {one.topic: one for one in file.channels.values() if one.topic not in (MARKERS, EVENTS)}


# --- in the place of a node -------------------------------------------------------------------------------------------

_numbers = itertools.count(1)


def _stand_in(old: Node, file: str, names: dict[str, str], hints: dict[str, Any], how: _How) -> str:
    """Make a type with the ports and parameters of a node's, that plays what was recorded of it; gives its reference.

    Args:
      old: the node.
      file: the recording.
      names: paths of recorded ports, and which port of the node each is.
      hints: types of these ports.
      how: it is played.
    """
    kind = old._type
    qualname = f"Played{next(_numbers)}"

    def made(cls: type[Node]) -> NodeType:
        return dataclasses.replace(
            kind,
            origin=cls,
            module=__name__,
            qualname=qualname,
            doc=f"Plays what was recorded of {old.place.path}.",
            inputs={},
            states={},
            process_kind="function",
            result="fields" if kind.outputs else "none",
            fields=(),
            is_function=False,
            hooks=frozenset({"setup", "ready", "teardown"}),
            caller=lambda node: node.process,
        )

    def setup(self: Any) -> None:
        self._recording = File(file)
        track = Track(self._recording, hints, may_pickle=how.pickle)
        self._player = Player(self, track, names, how.speed)

    body = {
        "__module__": __name__,
        "__qualname__": qualname,
        "setup": setup,
        "ready": _ready,
        "process": _process,
        "teardown": _teardown,
        "_slot_call": lambda self, name: _hear_nothing,  # what its slots did is in what was recorded
    }
    made_class: Any = types.new_class(qualname, (Node,), {"_made": made}, lambda names: names.update(body))
    setattr(sys.modules[__name__], qualname, made_class)
    return f"{__name__}:{qualname}"


def _hear_nothing(_token: Token[Any]) -> None:
    pass


class _How(msgspec.Struct, frozen=True):
    speed: float | None
    pickle: bool


class Playing(msgspec.Struct):
    """What `play_into` has done to a graph.

    Attributes:
      played: paths of recorded ports, and where each is played.
      recomputed: recorded ports that the graph makes itself from what is played.
      silent: connected outputs of played nodes that were not recorded.
      rest: nodes that are disabled, for all that they send went to nodes that are played.
    """

    played: dict[str, str] = {}
    recomputed: list[str] = []
    silent: list[str] = []
    rest: list[str] = []


def play_into(
    graph: Graph,
    file: str | os.PathLike[str],
    *,
    ports: Mapping[str, str] | None = None,
    speed: float | None = 1.0,
    pickle: bool = False,
) -> Playing:
    """Let a graph at rest play a recording when it is run, in the place of the nodes that were recorded.

    Of the nodes that were recorded those are played that come first, above all sources; what others have sent the graph
    makes itself again. What fed only played nodes is disabled.

    Args:
      graph: is changed, as by an edit; `graph.undo()` takes it back.
      file: the recording.
      ports: which recorded ports feed which ports of the graph, {"camera.out": "detect.image"}; by default those of
        the same path are played.
      speed: how many recorded seconds pass in one second on the run's clock; None: as fast as can be.
      pickle: read values that were pickled, which runs code.

    Raises:
      UsageError: the file cannot be read, the graph lacks a port, or nothing of it can be played.
    """
    if speed is not None and not speed > 0:
        raise UsageError(f"speed= says how much faster than recorded it is played, above 0, or None; got {speed!r}")
    path = os.fspath(Path(file).resolve())
    with File(path) as recording:
        recorded = recorded_ports(recording)
        spoke = _spoke(recording)
    if ports:
        return _feed(graph, path, recorded, ports, speed)
    return _replace(graph, path, recorded, spoke, _How(speed, pickle))


def _feed(graph: Graph, file: str, recorded: dict[str, Any], ports: Mapping[str, str], speed: float | None) -> Playing:
    done = Playing()
    edit: list[commands.Command] = []
    drawn = {edge.target.path: edge for edge in _edges_within(graph)}
    for source, target in ports.items():
        if source not in recorded:
            raise UsageError(f'no port "{source}" was recorded in {file}; {suggest(source, recorded)}')
        try:
            graph[target]
        except Exception as error:  # whatever is wrong with the path
            raise UsageError(f'the graph lacks "{target}", to which "{source}" is to be played: {error}') from None
        around = target.rpartition("/")[0]
        name = f"{around}/playback_{len(edit)}" if around else f"playback_{len(edit)}"
        edge = drawn.get(target)
        options: dict[str, Any] = {}
        if edge is not None and getattr(edge.target, "kind", "") != "slot":
            edit.append(commands.Disconnect(edge.source.path, target))
            options = {"active": edge.active}
        edit.append(commands.Add(_PLAYBACK, name, {"file": file, "port": source, "speed": float(speed or 0.0)}))
        port = "signal" if recorded[source].metadata.get("kind") == "event" else "out"
        edit.append(commands.Connect(f"{name}.{port}", target, **options))
        done.played[source] = target
    graph.edit(*edit)
    return done


def _replace(graph: Graph, file: str, recorded: dict[str, Any], spoke: Set[str], how: _How) -> Playing:
    flat = flatten(graph)
    nodes = {node.path: node for node in flat.nodes}
    of_node: dict[str, dict[str, str]] = {}
    missing: list[str] = []
    for port, channel in recorded.items():
        about = channel.metadata
        path, name, kind = (
            about.get("node", port.rpartition(".")[0]),
            about.get("port", ""),
            about.get("kind", "output"),
        )
        if kind not in ("output", "event"):
            continue
        there = nodes.get(path)
        if there is None or name not in getattr(there.node._type, f"{kind}s"):
            missing.append(port)
        else:
            of_node.setdefault(path, {})[port] = name
    if not of_node:
        raise UsageError(
            f'graph "{graph.name}" has none of the ports that were recorded in {file} ({_listed(recorded)}): say which '
            'feeds which, as in --map "camera.out=detect.image" or ports={"camera.out": "detect.image"}'
        )
    onward = _onward(flat)
    # one that has never sent anything is played only if it could have without being fed
    speakers = {path for path, names in of_node.items() if nodes[path].node._type.is_source or spoke & set(names)}
    chosen = _first_of({path: names for path, names in of_node.items() if path in speakers}, nodes, onward)
    if not chosen:
        raise UsageError(f"nothing passed the ports that were recorded in {file}, so there is nothing to play")
    done = Playing()
    done.recomputed = [port for path, names in of_node.items() if path not in chosen for port in names]
    edit: list[commands.Command] = []
    for path in chosen:
        node, names = nodes[path].node, of_node[path]
        hints = {
            port: getattr(node._type, f"{recorded[port].metadata.get('kind', 'output')}s")[name].type
            for port, name in names.items()
        }
        hints = {port: Any if hint is None else hint for port, hint in hints.items()}
        edit += [commands.Disconnect(edge.source.path, edge.target.path) for edge in _edges_into(node)]
        edit.append(commands.Replace(path, _stand_in(node, file, names, hints, how)))
        done.played |= {port: port for port in names}
        done.silent += [
            f"{path}.{name}"
            for name in node._type.outputs
            if name not in names.values() and any(edge.label.startswith(f"{path}.{name} ") for edge in flat.edges)
        ]
    done.rest = _idle(chosen, flat)
    edit += [commands.Disable(path) for path in done.rest]
    graph.edit(*edit)
    done.silent += [port for port in missing if port.rpartition(".")[0] in chosen]
    return done


def _onward(flat: Any) -> dict[str, set[str]]:
    """For each node those to which it sends."""
    found: dict[str, set[str]] = {node.path: set() for node in flat.nodes}
    for edge in flat.edges:
        if edge.source.node >= 0 and edge.target.node >= 0:
            found[flat.nodes[edge.source.node].path].add(flat.nodes[edge.target.node].path)
    return found


def _first_of(of_node: dict[str, Any], nodes: dict[str, Any], onward: dict[str, set[str]]) -> list[str]:
    """Of the recorded nodes those to play: sources, and whom no other that is played leads to."""
    chosen: list[str] = []
    reached: set[str] = set()
    for path in sorted(of_node, key=lambda path: not nodes[path].node._type.is_source):
        if path in reached and not nodes[path].node._type.is_source:
            continue
        chosen.append(path)
        todo = [path]
        while todo:
            for other in onward[todo.pop()] - reached:
                reached.add(other)
                todo.append(other)
    return chosen


def _idle(chosen: list[str], flat: Any) -> list[str]:
    """Those who work for nobody any more: all that they send went into firings of nodes that are played."""
    leads: dict[str, list[Any]] = {node.path: [] for node in flat.nodes if node.path not in chosen}
    for edge in flat.edges:
        if edge.source.node >= 0 and flat.nodes[edge.source.node].path in leads:
            leads[flat.nodes[edge.source.node].path].append(edge.target)
    idle: list[str] = []
    changed = True
    while changed:
        changed = False
        for path, targets in leads.items():
            if path not in idle and targets and all(_takes_nothing(end, flat, chosen, idle) for end in targets):
                idle.append(path)
                changed = True
    return idle


def _takes_nothing(end: Any, flat: Any, chosen: list[str], idle: list[str]) -> bool:
    path = flat.nodes[end.node].path if end.node >= 0 else ""
    return path in idle or (path in chosen and end.kind in ("input", "parameter"))


def _edges_into(node: Node) -> list[Any]:
    """The edges on whose tokens the firings of a node wait, for one that plays fires when it did."""
    return [
        edge
        for edge in level_of(node.place.graph).face.edges
        if getattr(edge.target, "node", None) is node and edge.target.kind in ("input", "parameter")
    ]


def _edges_within(graph: Graph) -> list[Any]:
    found, todo = [], [graph]
    while todo:
        one = todo.pop()
        found += one.edges
        todo += [node._graph for node in one.nodes.values() if node._type.is_subgraph]  # type: ignore[attr-defined]
    return found


def _listed(names: Any) -> str:
    return ", ".join(f'"{name}"' for name in list(names)[:8]) or "none"
