"""Playing recordings back: nodes that send recorded tokens at their recorded times.

The tokens of one node are played by one node, firing by firing: tokens that left together leave together again, with
their values, modifiers and stamps, including silence and the end of the stream. So a graph that a recording is played
into repeats its behaviour. A node of the graph is replaced by one with the same ports, parameters and options. Depends
on `choosing`, `stand_ins`, `tracks` and `reading`.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from weakref import WeakSet

import msgspec

from hfg.base.logs import Log
from hfg.errors import UsageError
from hfg.graph import Graph, commands
from hfg.graph.flat import flatten
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.ports.automatic import sent_of
from hfg.recording.choosing import Choice, Recorded, idle_nodes
from hfg.recording.messages import MARKERS
from hfg.recording.reading import CDR, File, RecordingInfo
from hfg.recording.stand_ins import How, stand_in
from hfg.recording.tracks import recorded_ports
from hfg.ros.messages import shared

_LOGGER = Log("hfg.recording")
_BESIDE: Final = b'"beside":true'
_PLAYBACK: Final = "hfg.nodes.recordings:Playback"
_WITHOUT_NUMBERS: Final = "1"  # the version of recordings in which firings have no numbers


def _spoke(file: File) -> tuple[set[str], set[str]]:
    """Return the ports that sent anything, and those among them that sent outside firings and slot calls."""
    markers = file.numbers_of(MARKERS)
    found: set[str] = set()
    beside: set[str] = set()
    for number, _, data in file.messages():
        if number not in markers:
            found.add(file.channels[number].topic)
            if _BESIDE in data and file.channels[number].message_encoding != CDR:
                beside.add(file.channels[number].topic)
        else:
            found.add(str(file.object_in(data).get("port")))
    return found, beside


class Playing(msgspec.Struct):
    """The changes that `play_into` has made to a graph.

    Attributes:
      played: paths of recorded ports, and where each is played.
      recomputed: recorded ports that the graph computes itself from the played tokens.
      silent: connected outputs of played nodes that were not recorded.
      rest: nodes that are disabled because all their tokens went to played nodes.
      missing: recorded ports that the graph does not have.
      live: sources of the graph that were not recorded, so their own code runs.
      gaps: what the recording itself lacks, as messages.
      is_damaged: whether part of it cannot be read, or was lost before it was recovered.
    """

    played: dict[str, str] = {}
    recomputed: list[str] = []
    silent: list[str] = []
    rest: list[str] = []
    missing: list[str] = []
    live: list[str] = []
    gaps: list[str] = []
    is_damaged: bool = False
    _told: WeakSet[Any] = msgspec.field(default_factory=WeakSet)

    @property
    def warnings(self) -> list[str]:
        """Differences from the recorded run, as messages; the report of the run lists them among its errors."""
        return [
            *self.gaps,
            *(f'"{port}" was recorded, but the graph has no such port, so it is not played' for port in self.missing),
            *(f'"{port}" was not recorded, so it is silent' for port in self.silent),
            *(f'source "{path}" was not recorded, so its own code runs' for path in self.live),
        ]

    def tell(self, engine: Any) -> None:
        """Put the warnings into the report of a run that plays, once."""
        if engine not in self._told:
            self._told.add(engine)
            engine.core.errors += map(UsageError, self.warnings)


def play_into(
    graph: Graph,
    file: str | os.PathLike[str],
    *,
    ports: Mapping[str, str] | None = None,
    speed: float | None = 1.0,
    pickle: bool = False,
) -> Playing:
    """Make a graph that is not running play a recording in its next run, in place of the nodes that were recorded.

    The first recorded nodes along the edges are played, mainly sources; the graph computes the tokens of the others
    itself. Nodes that fed only played nodes are disabled. Differences from the recorded run are logged, and listed in
    the report of the run.

    Args:
      graph: the graph; it is changed as by an edit, and `graph.undo()` reverts it.
      file: the recording.
      ports: maps recorded ports to ports of the graph. An output or event of the graph, {"camera.out": "front.image"},
        sends the recording of the other port, and all other ports are played under their own paths. An input or slot,
        {"camera.out": "detect.image"}, is fed; if there are only inputs and slots, nothing else is played.
      speed: recorded seconds per second of the run's clock; None: as fast as possible.
      pickle: allow reading pickled values, which runs code.

    Raises:
      UsageError: the file cannot be read, the graph lacks a port, or nothing of it can be played.
    """
    if speed is not None and not speed > 0:
        raise UsageError(f"speed= is a factor of the recorded speed, above 0, or None; got {speed!r}")
    path = os.fspath(Path(file).resolve())
    playing = Playing()
    with File(path) as recording:
        recorded = recorded_ports(recording)
        if any(one.message_encoding == CDR for one in recorded.values()):
            shared()  # takes part of a second, which would hold up the run
        spoke, beside = _spoke(recording)
        info = recording.info()
        playing.is_damaged = bool(info.losses)
        playing.gaps = _gaps(recording, info)
        uncounted = _with_one_output(recording) if recording.losses_met() else []
    sending, fed = _sorted(graph, path, recorded, ports or {})
    edit = _feed(graph, path, recorded, fed, speed, playing)
    if sending or not fed:
        own = {port: channel for port, channel in recorded.items() if port not in fed}
        how = How(path, speed, pickle, playing.tell)
        edit += _replace(graph, Recorded(own, spoke, beside, sending), how, playing)
    graph.edit(*edit)
    playing.gaps += _misaligned(uncounted, playing.played)
    for sentence in playing.warnings:
        _LOGGER.warning("%s", sentence)
    return playing


def _unnumbered(recording: File) -> list[str]:
    """Return nodes whose firings of several outputs have no numbers because an older version wrote the file."""
    if recording.metadata.get("hfg", {}).get("version") != _WITHOUT_NUMBERS:
        return []
    outputs = [one for one in recorded_ports(recording).values() if one.metadata.get("kind") == "output"]
    nodes = Counter(one.metadata.get("node", "") for one in outputs)
    return [node for node, count in nodes.items() if node and count > 1]


def _with_one_output(recording: File) -> list[str]:
    """Return nodes with one recorded output, whose tokens have no numbers."""
    outputs = [one for one in recorded_ports(recording).values() if one.metadata.get("kind") == "output"]
    return [node for node, count in Counter(one.metadata.get("node", "") for one in outputs).items() if count == 1]


def _misaligned(uncounted: list[str], played: Mapping[str, str]) -> list[str]:
    """Return warnings about joins that a loss may misalign, where several nodes are played without firing numbers."""
    nodes = {port.rpartition(".")[0] for port in played}
    return [
        f'firings of "{node}" have no numbers in the recording because only one output of it was recorded: '
        "lost firings are not played as silence, and later tokens may meet other tokens in a join"
        for node in uncounted
        if node in nodes and len(nodes) > 1
    ]


def _gaps(recording: File, info: RecordingInfo) -> list[str]:
    """Return what the recording lacks although it was sent."""
    found = [f"{info.path} is damaged: {loss}" for loss in info.losses]
    found += [
        f'firings of "{node}" have no numbers in the recording because an older version of hfg wrote it: they '
        "are distinguished by the order of their tokens"
        for node in _unnumbered(recording)
    ]
    left_out = [(port, count, "the disk was too slow") for port, count in info.left_out.items()]
    refused = [(port, count, "such values are not data") for port, count in info.refused.items()]
    for port, count, why in left_out + refused:
        tokens = "1 token is" if count == 1 else f"{count} tokens are"
        found.append(f'"{port}": {tokens} not in the recording: {why}')
    return found


def _sorted(
    graph: Graph, file: str, recorded: Mapping[str, Any], ports: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Separate mappings to sending ports from mappings to receiving ports.

    Raises:
      UsageError: there is no such recorded port, or no such port of the graph.
    """
    sending: dict[str, str] = {}
    fed: dict[str, str] = {}
    for source, target in ports.items():
        if source not in recorded:
            raise UsageError(f'no port "{source}" was recorded in {file}; {suggest(source, recorded)}')
        try:
            port: Any = graph[target]
        except Exception as error:  # any error in the path
            raise UsageError(f'the graph has no "{target}", into which "{source}" should be played: {error}') from None
        kind = getattr(port, "kind", "")
        if kind not in ("output", "event", "input", "slot", "parameter"):
            raise UsageError(
                f'"{source}" must be played into a port, but "{target}" is not a port; name one of its ports'
            )
        (sending if kind in ("output", "event") else fed)[source] = target
    return sending, fed


def _feed(
    graph: Graph, file: str, recorded: Mapping[str, Any], ports: Mapping[str, str], speed: float | None, done: Playing
) -> list[commands.Command]:
    edit: list[commands.Command] = []
    drawn = {edge.target.path: edge for edge in _edges_within(graph)}
    for number, (source, target) in enumerate(ports.items()):
        around = target.rpartition("/")[0]
        name = f"{around}/playback_{number}" if around else f"playback_{number}"
        edge = drawn.get(target)
        options: dict[str, Any] = {}
        if edge is not None and getattr(edge.target, "kind", "") != "slot":
            edit.append(commands.Disconnect(edge.source.path, target))
            options = {"active": edge.active}
        edit.append(commands.Add(_PLAYBACK, name, {"file": file, "port": source, "speed": float(speed or 0.0)}))
        port = "signal" if recorded[source].metadata.get("kind") == "event" else "out"
        edit.append(commands.Connect(f"{name}.{port}", target, **options))
        done.played[source] = target
    return edit


def _replace(graph: Graph, recorded: Recorded, how: How, done: Playing) -> list[commands.Command]:
    flat = flatten(graph)
    nodes = {node.path: node for node in flat.nodes}
    of_node, done.missing = _ports_of_nodes(recorded, nodes)
    if not of_node:
        raise UsageError(
            f'graph "{graph.name}" has none of the ports that were recorded in {how.file} ({_listed(recorded.ports)}): '
            'say which port plays which, as in --map "camera.out=front.image" or ports={"camera.out": "front.image"}'
        )
    choice = Choice(of_node, nodes, flat)
    chosen = choice.choose(recorded)
    if not chosen:
        raise UsageError(f"the recorded ports in {how.file} sent nothing, so there is nothing to play")
    kept = choice.kept()
    done.rest = idle_nodes(chosen, flat, kept)
    edit: list[commands.Command] = []
    for path, names in of_node.items():
        ports = [port for port, name in names.items() if name]
        if path not in chosen:
            done.recomputed += ports
            continue
        node = nodes[path].node
        edit += [
            commands.Disconnect(edge.source.path, edge.target.path)
            for edge in _edges_into(node)
            if edge.target.path not in kept
        ]
        if _is_away(flat, nodes[path].options.group or "loop"):  # recordings are read in this process
            edit.append(commands.Move(path, "loop"))
        hints = {port: _hint(node._type, name) for port, name in names.items()}
        edit.append(commands.Replace(path, stand_in(node, names, hints, how)))
        done.played |= {port: recorded.mapped.get(port, port) for port in ports}
        done.silent += _silent(path, node, names, flat)
    done.live = [path for path, one in nodes.items() if one.node._type.is_source and path not in (*chosen, *done.rest)]
    return edit + [commands.Disable(path) for path in done.rest]


def _is_away(flat: Any, group: str) -> bool:
    spec = flat.groups.get(group)
    return spec is not None and spec.process


def _ports_of_nodes(recorded: Recorded, nodes: Mapping[str, Any]) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Return node and port for each recorded port; "" for the event that shows that a source has fired.

    Returns:
      The mapping, by path of the node and of the recorded port, and the recorded ports that no node here has.
    """
    of_node: dict[str, dict[str, str]] = {}
    missing: list[str] = []
    origins: dict[str, str] = {}  # the recorded node that each node plays
    for port, channel in recorded.ports.items():
        about = channel.metadata
        if about.get("kind", "output") not in ("output", "event"):
            continue
        origin, name = about.get("node", port.rpartition(".")[0]), about.get("port", "")
        path, place = origin, "" if about.get("source") == "true" and name == "processed" else sent_of(name) or name
        if port in recorded.mapped:
            path, _, place = recorded.mapped[port].rpartition(".")
        there = nodes.get(path)
        if there is None or (place and place not in there.node._type.outputs and place not in there.node._type.events):
            missing.append(port)
        elif origins.setdefault(path, origin) != origin:
            if port not in recorded.mapped:
                missing.append(port)
                continue
            raise UsageError(
                f'"{port}" cannot be played as "{recorded.mapped[port]}": "{path}" already plays '
                f'"{origins[path]}", and the firings of one node come from one recorded node'
            )
        else:
            of_node.setdefault(path, {})[port] = place
    for port in recorded.mapped.keys() & set(missing):
        raise UsageError(
            f'"{port}" cannot be played as "{recorded.mapped[port]}", which is a port of a subgraph or an '
            "automatic event; name an output or event that an inner node declares"
        )
    return of_node, missing


def _silent(path: str, node: Node, names: Mapping[str, str], flat: Any) -> list[str]:
    """Return outputs of a played node that were not recorded although they have edges."""
    return [
        f"{path}.{name}"
        for name in node._type.outputs
        if name not in names.values() and any(edge.label.startswith(f"{path}.{name} ") for edge in flat.edges)
    ]


def _hint(kind: NodeType, name: str) -> Any:
    """Return the type of the values of a node's port."""
    spec: Any = kind.outputs.get(name) or kind.events.get(name)
    return Any if spec is None or spec.type is None else spec.type


def _edges_into(node: Node) -> list[Any]:
    """Return the edges that the firings of a node wait for; a played node fires by its recorded times instead."""
    return [
        edge
        for edge in level_of(node.place.graph).edges
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
