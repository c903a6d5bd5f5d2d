"""A profile: how long the firings of each node took in a run, as a file for `hfg check --time --profile`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import msgspec

from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.base.whole import read_plain, write_whole
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.flat import flatten

__all__ = ["Measured", "Profile"]

_Seconds = Annotated[float, msgspec.Meta(ge=0)]


class Measured(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The firings and calls of a node.

    Attributes:
      count: how many were measured.
      mean_s: how long one took.
      p99_s: the 99th percentile.
      max_s: the longest.
    """

    count: Annotated[int, msgspec.Meta(ge=0)]
    mean_s: _Seconds
    p99_s: _Seconds
    max_s: _Seconds


class Profile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How long the firings of each node took in a run.

    Attributes:
      graph: its name.
      nodes: by path, those that did something.
    """

    graph: str
    nodes: dict[str, Measured]

    @classmethod
    def of(cls, graph: Graph, statistics: Any) -> Profile:
        """Return the profile of a run, by `run.statistics()`."""
        nodes: Mapping[str, Any] = statistics.nodes
        busy = {path: node.busy for path, node in nodes.items() if node.busy.count}
        return cls(graph.name, msgspec.convert(busy, dict[str, Measured], from_attributes=True))

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Profile:
        """Read a profile.

        Raises:
          UsageError: it cannot be read, or is not a profile; the message says why.
        """
        path, again = Path(file), "measure one with hfg run --profile"
        try:
            data = read_plain(path, GRAPH_FILE_BYTES.most + 1)
        except (OSError, ValueError) as error:
            said = error.strerror if isinstance(error, OSError) else error
            raise UsageError(f'the profile "{path}" cannot be read: {said}; {again}') from None
        if len(data) > GRAPH_FILE_BYTES.most:
            raise UsageError(f'the profile "{path}" is too large: {GRAPH_FILE_BYTES.remedy}')
        try:
            return msgspec.json.decode(data, type=cls)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise UsageError(f'"{path}" is not a profile: {error}; {again}') from None

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write it as JSON.

        Raises:
          OSError: the file cannot be written; an old one is unchanged.
        """
        text = msgspec.json.format(msgspec.json.encode(self), indent=1)
        write_whole(Path(file), lambda there: there.write(text + b"\n"))

    def durations(self, graph: Graph) -> dict[str, float]:
        """Return the longest firing of each node of a graph that was measured, for `analyse_time`.

        Raises:
          UsageError: none was, so the profile is of another graph.
        """
        paths = [node.path for node in flatten(graph).nodes]
        found = {path: self.nodes[path].max_s for path in paths if path in self.nodes}
        if not found:
            raise UsageError(
                f'the profile is of graph "{self.graph}", and knows no node of graph "{graph.name}"; measure one of '
                "this graph with hfg run --profile"
            )
        return found
