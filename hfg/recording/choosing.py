"""Chooses the nodes that play a recording, and those that have nothing left to do. Depends on the flat graph."""

from __future__ import annotations

from collections.abc import Mapping, Set
from typing import Any, NamedTuple

from hfg.nodetypes.description import NodeType
from hfg.ports.automatic import AUTOMATIC_EVENTS, sent_of


class Recorded(NamedTuple):
    """The recorded ports.

    Attributes:
      ports: channels, by path of the port.
      spoke: ports that sent something.
      beside: ports that sent outside firings and slot calls.
      mapped: ports that are played as other ports of the graph.
    """

    ports: dict[str, Any]
    spoke: Set[str]
    beside: Set[str]
    mapped: dict[str, str]


class Choice:
    """Chooses the recorded nodes to play.

    These are sources, nodes with only slots that sent signals outside firings and slot calls, and the first nodes after
    anything unknown: sources that were not recorded, tokens from outside, ports that were left out. All other nodes
    repeat their work.
    """

    def __init__(self, of_node: dict[str, dict[str, str]], nodes: Mapping[str, Any], flat: Any) -> None:
        self._of_node = of_node
        self._nodes = nodes
        self._flat = flat
        self._chosen: set[str] = set()
        self._tainted: set[int] = set()  # edges with unknown tokens
        self._leaving: dict[str, list[Any]] = {path: [] for path in nodes}
        for edge in flat.edges:
            if edge.source.node >= 0:
                self._leaving[self._path(edge.source)].append(edge)

    def _path(self, end: Any) -> str:
        return str(self._flat.nodes[end.node].path) if end.node >= 0 else ""

    def _kind(self, path: str) -> NodeType:
        kind: NodeType = self._nodes[path].node._type
        return kind

    def choose(self, recorded: Recorded) -> list[str]:
        """Return the paths of the chosen nodes, in the order of the recording."""
        mapped = {target.rpartition(".")[0] for target in recorded.mapped.values()}
        for path, names in self._of_node.items():
            kind = self._kind(path)
            speaks = kind.process_kind == "none" and recorded.beside & set(names)
            if kind.is_source or speaks or path in mapped:
                self._chosen.add(path)
        unknown = self._unknown_from_the_beginning()
        while unknown:
            edge = unknown.pop()
            if edge.index not in self._tainted:
                self._tainted.add(edge.index)
                unknown += self._unknown_behind(self._path(edge.target), recorded.spoke)
        return [path for path in self._of_node if path in self._chosen]

    def _unknown_from_the_beginning(self) -> list[Any]:
        outside = [edge for edge in self._flat.edges if edge.source.node < 0]
        unknown = [edge for edge in outside if edge.source.kind != "event"]  # `start` is known
        for path, leaving in self._leaving.items():
            if path in self._chosen:
                unknown += self._unplayed(path)
            elif path not in self._of_node and self._kind(path).is_source:
                unknown += leaving
        return unknown

    def _unknown_behind(self, path: str, spoke: Set[str]) -> list[Any]:
        """Return the edges whose tokens are unknown because of unknown input to a node."""
        if not path or path in self._chosen:
            return []
        if not spoke & set(self._of_node.get(path, ())):
            return self._leaving[path]
        self._chosen.add(path)
        return self._unplayed(path)

    def _unplayed(self, path: str) -> list[Any]:
        return [edge for edge in self._leaving[path] if not _is_played(edge.source, self._of_node[path])]

    def kept(self) -> set[str]:
        """Return the paths of parameters of played sources whose edges stay because their values repeat."""
        return {
            edge.target.port.path
            for edge in self._flat.edges
            if edge.target.kind == "parameter" and edge.index not in self._tainted and self._is_source(edge.target)
        }

    def _is_source(self, end: Any) -> bool:
        path = self._path(end)
        return path in self._chosen and self._kind(path).is_source


def _is_played(source: Any, names: Mapping[str, str]) -> bool:
    """Return whether tokens from this output are played: recorded, or sent automatically."""
    name = sent_of(source.name) or source.name
    return name in names.values() or source.kind == "parameter" or name in AUTOMATIC_EVENTS


def idle_nodes(chosen: list[str], flat: Any, kept: Set[str]) -> list[str]:
    """Return the nodes without any remaining consumer: all their tokens went into firings of played nodes."""
    leads: dict[str, list[Any]] = {node.path: [] for node in flat.nodes if node.path not in chosen}
    for edge in flat.edges:
        if edge.source.node >= 0 and flat.nodes[edge.source.node].path in leads:
            leads[flat.nodes[edge.source.node].path].append(edge.target)
    idle: list[str] = []
    changed = True
    while changed:
        changed = False
        for path, targets in leads.items():
            if path not in idle and targets and all(_takes_nothing(end, flat, chosen, idle, kept) for end in targets):
                idle.append(path)
                changed = True
    return idle


def _takes_nothing(end: Any, flat: Any, chosen: list[str], idle: list[str], kept: Set[str]) -> bool:
    path = flat.nodes[end.node].path if end.node >= 0 else ""
    return path in idle or (path in chosen and end.kind in ("input", "parameter") and end.port.path not in kept)
