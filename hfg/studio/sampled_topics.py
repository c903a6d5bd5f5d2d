"""Topics of samples: measures of nodes, flow of edges, load of groups, the timeline. Depends on `run_topics`."""

from __future__ import annotations

import struct
from collections import deque
from typing import Any, Final

from typing_extensions import override

from hfg.engine import Run
from hfg.engine.observing.sampling import BARS, Sample, Sampler
from hfg.engine.observing.statistics import NodeStatistics
from hfg.errors import GraphError
from hfg.graph import Edge
from hfg.studio.following import Following
from hfg.studio.places import place_at
from hfg.studio.refusing import Refused
from hfg.studio.run_topics import RunTopic

__all__ = ["Flows", "LoadTopic", "Measures", "NodeTopic", "SampledTopic", "TimelineTopic", "node_measures", "packed"]

_FAR_S: Final = 0.5
_INSIDE_S: Final = 0.25
_MOST_BOXES: Final = 400
"""In a frame: more than can be seen in a tenth of a second; what else there was is counted."""


class SampledTopic(RunTopic):
    """A topic of samples."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self.sampler: Sampler | None = None

    @override
    def attach(self, run: Run) -> None:
        self.sampler = run.sampler()

    @override
    def let_go(self) -> None:
        self.sampler = None


_MEASURE: Final = struct.Struct(f"<BBHIfffff{BARS}f")
_STATES: Final = {"working": 1, "disabled": 3, "ended": 4}
_IDLE: Final = ("signal", "unconnected", "start")


class Measures(SampledTopic):
    """The newest durations, the median and the rate of chosen nodes and subgraphs, packed."""

    kind = 1

    def __init__(self, host: Following, nodes: list[str]) -> None:
        super().__init__(host)
        self._nodes = nodes
        self._far: dict[str, NodeStatistics] = {}
        self._far_at = float("-inf")
        self._subgraphs: dict[str, tuple[float, Sample | None]] = {}

    @override
    def attach(self, run: Run) -> None:
        super().attach(run)
        self._far, self._far_at = {}, float("-inf")
        self._subgraphs.clear()

    @override
    def news(self) -> Any:
        if self.sampler is None:
            return None
        self.sampler.settle()
        return b"".join(packed(self._sampled(self.sampler, path)) for path in self._nodes)

    def _sampled(self, sampler: Sampler, path: str) -> Sample | None:
        return sampler.node(path) or self._far_away(path) or self._inside(sampler, path)

    def _inside(self, sampler: Sampler, path: str) -> Sample | None:
        """Return the sample of a subgraph; asked for four times per second, because it may have many nodes."""
        now = self.time()
        known = self._subgraphs.get(path)
        if known is None or not 0 <= now - known[0] < _INSIDE_S:
            nodes = self.host.tables.of["nodes"]
            inner = [one for one, node in nodes.items() if one.startswith(f"{path}/") and not node.subgraph]
            samples = [sample for one in inner if (sample := sampler.node(one)) is not None]
            known = self._subgraphs[path] = now, _sum_of(samples) if samples else None
        return known[1]

    def _far_away(self, path: str) -> Sample | None:
        """Return the last report about a node of another process; asked for twice per second."""
        if self.run is None or not any(group.process for group in self.host.graph.groups.values()):
            return None
        if self.time() - self._far_at > _FAR_S:
            self._far, self._far_at = self.run.statistics().nodes, self.time()
        said = self._far.get(path)
        return None if said is None else _sample_of(said)


def _sum_of(samples: list[Sample]) -> Sample:
    """Return how all nodes inside of a subgraph are: durations of the busiest, rates and shares of all."""
    busiest = max(samples, key=lambda one: one.busy_share)
    return busiest._replace(
        doing="working" if any(one.doing == "working" for one in samples) else "signal",
        active=any(one.active for one in samples),
        failed=sum(one.failed for one in samples),
        done=sum(one.done for one in samples),
        rate_hz=sum(one.rate_hz for one in samples),
        active_share=max(one.active_share for one in samples),
        busy_share=sum(one.busy_share for one in samples),
    )


def _sample_of(said: NodeStatistics) -> Sample:
    return Sample(
        doing=said.doing,
        active=said.active,
        failed=said.failed,
        done=said.firings + said.calls,
        p50_s=said.busy.p50_s,
        p99_s=said.busy.p99_s,
        rate_hz=said.rate_hz,
        active_share=said.active_share,
        busy_share=said.busy_share,
        newest_s=said.busy.last_s[-BARS:],
    )


def packed(sample: Sample | None) -> bytes:
    """Return what is measured of a node as a page reads it."""
    if sample is None:
        return bytes(_MEASURE.size)
    state = _STATES.get(sample.doing, 0 if sample.doing in _IDLE else 2)
    bars = sample.newest_s
    return _MEASURE.pack(
        (5 if sample.failed and sample.doing == "disabled" else state) | (128 if sample.active else 0),
        len(bars),
        min(sample.failed, 0xFFFF),
        sample.done & 0xFFFFFFFF,
        sample.p50_s,
        sample.p99_s,
        sample.rate_hz,
        sample.active_share,
        sample.busy_share,
        *bars,
        *((0.0,) * (BARS - len(bars))),
    )


_FLOW: Final = struct.Struct("<IIf")


class Flows(SampledTopic):
    """How much passes chosen edges, packed."""

    kind = 2
    most_hz = 10.0

    def __init__(self, host: Following, edges: list[str]) -> None:
        super().__init__(host)
        self._keys = edges
        self._edges: list[Edge | None] = []
        self._rev = -1
        self._before: dict[str, tuple[float, int]] = {}

    @override
    def news(self) -> Any:
        if self.sampler is None:
            return None
        if self._rev != self.host.tables.rev:  # they may be others
            self._rev = self.host.tables.rev
            self._edges = [self._found(key) for key in self._keys]
        self.sampler.settle()
        pairs = zip(self._keys, self._edges, strict=True)
        return b"".join(self._one(key, edge, self.sampler) for key, edge in pairs)

    def _found(self, key: str) -> Edge | None:
        try:
            found = place_at(self.host.graph, key)
        except GraphError:
            return None
        return found if isinstance(found, Edge) else None

    def _one(self, key: str, edge: Edge | None, sampler: Sampler) -> bytes:
        flow = None if edge is None else sampler.flow(edge)
        if flow is None:
            return bytes(_FLOW.size)
        now = self.time()
        at, sent = self._before.get(key, (now, flow.sent))
        if now - at >= 1.0 or key not in self._before:
            self._before[key] = now, flow.sent
        rate = (flow.sent - sent) / (now - at) if now > at else 0.0
        return _FLOW.pack(flow.sent & 0xFFFFFFFF, flow.untaken, rate)


class NodeTopic(RunTopic):
    """Everything that is measured of one node."""

    most_hz = 4.0

    def __init__(self, host: Following, path: str) -> None:
        super().__init__(host)
        self._path = path

    @override
    def news(self) -> Any:
        return None if self.run is None else node_measures(self.host, self._path)


def node_measures(host: Following, path: str) -> dict[str, Any]:
    """Return what is measured of one node.

    Raises:
      Refused: nothing runs, or no such node.
    """
    if host.steering.run is None:
        raise Refused("state", "the graph does not run, so nothing is measured")
    run = host.steering.run
    found = run.sampler().statistics(path) or run.statistics().nodes.get(path)  # of another process
    if found is None:
        raise Refused("unknown", f'no node at "{path}" runs', path)
    return {
        "doing": found.doing,
        "waiting": found.waiting,
        "p50_s": found.busy.p50_s,
        "p99_s": found.busy.p99_s,
        "max_s": found.busy.max_s,
        "latency_p50_s": found.latency.p50_s,
        "latency_p99_s": found.latency.p99_s,
        "rate_hz": found.rate_hz,
        "firings": found.firings,
        "calls": found.calls,
        "failed": found.failed,
        "queued": found.queued,
        "active": found.active,
        "active_share": found.active_share,
        "busy_share": found.busy_share,
        "tasks": list(found.tasks),
    }


class LoadTopic(SampledTopic):
    """How busy the groups are."""

    most_hz = 2.0

    @override
    def news(self) -> Any:
        if self.sampler is None:
            return None
        self.sampler.settle()
        loads = self.sampler.loads()
        return {
            "firings_hz": sum(one.rate_hz for one in loads.values()),
            "groups": {name: one._asdict() for name, one in loads.items()},
        }


class TimelineTopic(SampledTopic):
    """Firings and calls as they end; of very many in a short time only the newest."""

    most_hz = 10.0

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._boxes: deque[Any] = deque(maxlen=_MOST_BOXES)
        self._done = 0
        self._is_first = True

    @override
    def attach(self, run: Run) -> None:
        super().attach(run)
        assert self.sampler is not None
        self._is_first = True
        self._boxes.clear()
        self._done = self.sampler.done()
        self.sampler.note_boxes(self._boxes)

    @override
    def let_go(self) -> None:
        if self.sampler is not None:
            self.sampler.forget_boxes(self._boxes)
        super().let_go()

    @override
    def news(self) -> Any:
        if self.sampler is None:
            return None
        self.sampler.settle()
        boxes = [self._boxes.popleft() for _ in range(len(self._boxes))]
        done, self._done = self._done, self.sampler.done()
        rows = []
        for worker, ended, seconds in boxes:
            end = self.host.steering.since_begin(ended)
            rows.append([worker.path, worker.group.name, end - seconds, end])
        first, self._is_first = self._is_first, False
        before = {"activity": self.host.spans.rows()} if first else {}
        return {"boxes": rows, "now": self.time(), "lost": max(0, self._done - done - len(rows)), **before}
