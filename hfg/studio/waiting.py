"""Nodes that have been waiting for a second or more, with the reason, and edges that are full.

A mark in the page appears only after a second, so that waiting for the next token of a stream is not reported.
Depends on `sampled_topics`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

from typing_extensions import override

from hfg.engine import Run
from hfg.engine.observing.glance import NodeGlance
from hfg.engine.observing.sampling import Sampler
from hfg.graph import Edge
from hfg.studio.following import Following
from hfg.studio.places import place_at
from hfg.studio.records import EdgeRecord
from hfg.studio.sampled_topics import SampledTopic
from hfg.studio.spans import around, node_of

__all__ = ["WaitsTopic", "places_of"]

_AFTER_S: Final = 1.0
_MOST_EDGES: Final = 32
"""Edges that are looked at in one frame: each costs a search over the edges of the run."""


class _Still(NamedTuple):
    """A node: what it is doing, and since when its state and its count of firings are the same."""

    doing: str
    done: int
    since: float

    @property
    def kind(self) -> str:
        """The first word of what it is doing."""
        return self.doing.partition(" ")[0]

    @property
    def port(self) -> str:
        """The port that it waits for, if it is one."""
        return self.doing.partition(" ")[2]


class WaitsTopic(SampledTopic):
    """Waiting nodes of a level with the reason and since when; full edges with their tokens, places and since when.

    Nodes inside of closed subgraphs are looked at, too: they may be the ones that wait until an edge of the level is
    taken from.
    """

    most_hz = 2.0

    def __init__(self, host: Following, level: str) -> None:
        super().__init__(host)
        self._level = level
        self._still: dict[str, _Still] = {}
        self._full_since: dict[str, float] = {}
        self._told: Any = None

    @override
    def attach(self, run: Run) -> None:
        super().attach(run)
        self._still.clear()
        self._full_since.clear()
        self._told = None

    @override
    def news(self) -> Any:
        if self.sampler is None or self.run is None or self.run.paused:
            return None
        edges = self.host.tables.of["edges"]
        waiting = dict(self._waiting(self.run.glance().nodes))
        full = dict(self._full(self.sampler, waiting, edges))
        found = {"nodes": {path: [self._words(path, one), one.since] for path, one in waiting.items()}, "edges": full}
        if found == self._told:
            return None
        self._told = found
        return found

    def _waiting(self, nodes: Iterable[NodeGlance]) -> Iterator[tuple[str, _Still]]:
        now = self.time()
        inside = f"{self._level}/" if self._level else ""
        for node in nodes:
            path = node.path
            if not path.startswith(inside):
                continue
            before = self._still.get(path)
            if before is None or before[:2] != (node.doing, node.done):
                before = self._still[path] = _Still(node.doing, node.done, now)
            if now - before.since >= _AFTER_S and before.kind in _WORDS:
                yield path, before

    def _words(self, path: str, still: _Still) -> str:
        port = still.port
        if still.kind != "output":
            return _WORDS[still.kind].format(port)
        edges = self.host.tables.of["edges"].values()
        targets = [edge.target for edge in edges if edge.source == f"{path}.{port}"]
        takers = dict.fromkeys(target.rpartition("/")[2].partition(".")[0] for target in targets)
        return f"waits until {' and '.join(takers)} took {port}" if takers else _WORDS["output"].format(port)

    def _full(
        self, sampler: Sampler, waiting: Mapping[str, _Still], edges: Mapping[str, EdgeRecord]
    ) -> Iterator[tuple[str, list[Any]]]:
        """Yield the edges of the level because of which a node before them waits."""
        now, before = self.time(), self._full_since
        self._full_since = {}
        here = {key: edge for key, edge in edges.items() if edge.level == self._level}
        held = _held_by([path for path, one in waiting.items() if one.kind in ("output", "queue")], here.values())
        near = [key for key, edge in here.items() if node_of(edge.source) in held and self._stands(edge, now)]
        for key in near[:_MOST_EDGES]:
            edge = place_at(self.host.graph, key)
            flow, places = sampler.flow(edge), places_of(edge)
            if flow is None:
                continue
            works = not here[key].signal and self._still[node_of(here[key].target)].doing == "working"
            tokens = flow.untaken + works  # the one that it works on still has its place
            if tokens >= places:
                since = self._full_since[key] = before.get(key, now)
                yield key, [tokens, places, since]

    def _stands(self, edge: EdgeRecord, now: float) -> bool:
        """Whether the node at the end of an edge has taken nothing for a while, though it may be able to."""
        still = self._still.get(node_of(edge.target))
        if still is None or now - still.since < _AFTER_S:
            return False
        return (
            edge.signal
            or still.doing == "working"
            or (still.kind == "input" and not edge.target.endswith(f".{still.port}"))
        )


def _held_by(waiting: Iterable[str], edges: Iterable[EdgeRecord]) -> set[str]:
    """Return nodes of a level that wait to send, the subgraphs around such nodes, and all that get data from them."""
    onward: dict[str, list[str]] = {}
    for edge in edges:
        if not edge.signal:
            onward.setdefault(node_of(edge.source), []).append(node_of(edge.target))
    found: set[str] = set()
    ahead = [path for node in waiting for path in (node, *around(node))]
    while ahead:
        path = ahead.pop()
        if path not in found:
            found.add(path)
            ahead += onward.get(path, ())
    return found


_WORDS: Final = {
    "input": "waits for {}",
    "output": "waits until {} is taken",
    "queue": "waits until a queue of its signals has room",
    "turn": "waits for its turn: others of its group are running",
    "recorder": "waits for the recorder",
    "restart": "waits for the restart of its process",
}
"""By the first word of what a node is doing; everything else, such as resting at a closed gate, is not waiting."""


def places_of(edge: Edge) -> int:
    """Return how many tokens fit on an edge before its source waits."""
    if edge.source.kind in ("event", "slot"):
        return 1 if edge.options.overflow == "latest" else edge.options.capacity
    return 1 + edge.options.buffer
