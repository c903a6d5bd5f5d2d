"""What pages subscribe to. Each topic knows what is new since its last frame, and nothing is computed until one is due.

A topic outlives the run: with the next one it starts over. Depends on `following` and the engine's samples.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec
import numpy as np

from hfg.engine import Run
from hfg.engine.observing.sampling import BARS, Sample, Sampler
from hfg.engine.observing.taps import Tap
from hfg.errors import GraphError
from hfg.graph import Edge
from hfg.reporting.pictures import is_picture
from hfg.studio.conditions import part_of
from hfg.studio.following import Following
from hfg.studio.logs import LogKeeper
from hfg.studio.places import place_at
from hfg.studio.refusing import Refused
from hfg.studio.showing import image_frame, number_in, shown_value
from hfg.studio.spans import Ways
from hfg.trace import ActivityChanged, TraceEvent

__all__ = ["TOPICS", "make_topic", "node_measures"]

_MOST_NODES: Final = 2000
_MOST_MOVES: Final = 256
_NEAR: Final = 8
"""How many changes of activity before one may be its cause."""

_MOST_BOXES: Final = 400
"""In a frame: more than can be seen in a tenth of a second; what else there was is counted."""

_MOST_POINTS: Final = 2000


class _Topic:
    """A topic of the current run, and of the next one after it.

    Attributes:
      run: the run that it looks at now.
    """

    credit = 2
    kind = 0
    most_hz = 30.0

    def __init__(self, host: Following) -> None:
        self.host = host
        self.run: Run | None = None

    def time(self) -> float:
        """See `Topic`."""
        return self.host.steering.elapsed()

    def take(self) -> Any:
        """See `Topic`."""
        run = self.host.steering.run
        if run is not self.run:
            self.let_go()
            self.run = run
            if run is not None:
                self.attach(run)
        return self.news()

    def attach(self, run: Run) -> None:
        """A run has begun, or there is one."""

    def let_go(self) -> None:
        """The run is over."""

    def news(self) -> Any:
        """Return what is new."""
        raise NotImplementedError

    def close(self) -> None:
        """See `Topic`."""
        self.let_go()


class _Activity(_Topic):
    """The active nodes with the time of their activation, and the changes of activity."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._moves: deque[list[Any]] = deque(maxlen=_MOST_MOVES)
        self._count = 0
        self._is_new = True
        self._ways = Ways({})
        self._rev = -1
        host.listeners.add(self._event)

    def attach(self, run: Run) -> None:
        self._is_new = True

    def let_go(self) -> None:
        self._is_new = True
        self._moves.clear()
        self._count = 0

    def _event(self, event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged):
            via: list[str] = []
            if event.active:
                if self._rev != self.host.tables.rev:
                    self._rev, self._ways = self.host.tables.rev, Ways(self.host.tables.of["edges"])
                near = {*self.host.spans.active, *(move[1] for move in list(self._moves)[-_NEAR:])}
                via = self._ways.to(event.node, near)
            self._moves.append([self.host.steering.since_begin(event.time), event.node, event.active, event.cause, via])
            self._count += 1
            self._is_new = True

    def news(self) -> Any:
        if not self._is_new:
            return None
        self._is_new = False
        moves, lost = list(self._moves), self._count - len(self._moves)
        self._moves.clear()
        self._count = 0
        return {"active": dict(self.host.spans.active), "moves": moves, "lost": lost}

    def close(self) -> None:
        super().close()
        self.host.listeners.discard(self._event)


class _Sampled(_Topic):
    """A topic of samples."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self.sampler: Sampler | None = None

    def attach(self, run: Run) -> None:
        self.sampler = run.sampler()

    def let_go(self) -> None:
        self.sampler = None


_MEASURE: Final = struct.Struct(f"<BBHIfffff{BARS}f")
_STATES: Final = {"working": 1, "disabled": 3, "ended": 4}
_IDLE: Final = ("signal", "unconnected", "start")


class _Measures(_Sampled):
    """The newest durations, the median and the rate of chosen nodes, packed."""

    kind = 1

    def __init__(self, host: Following, nodes: list[str]) -> None:
        super().__init__(host)
        self._nodes = nodes

    def news(self) -> Any:
        if self.sampler is None:
            return None
        self.sampler.settle()
        return b"".join(_packed(self.sampler.node(path)) for path in self._nodes)


def _packed(sample: Sample | None) -> bytes:
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


class _Flows(_Sampled):
    """How much passes chosen edges, packed."""

    kind = 2
    most_hz = 10.0

    def __init__(self, host: Following, edges: list[str]) -> None:
        super().__init__(host)
        self._keys = edges
        self._edges: list[Edge | None] = []
        self._rev = -1
        self._before: dict[str, tuple[float, int]] = {}

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


class _Node(_Topic):
    """Everything that is measured of one node."""

    most_hz = 4.0

    def __init__(self, host: Following, path: str) -> None:
        super().__init__(host)
        self._path = path

    def news(self) -> Any:
        return None if self.run is None else node_measures(self.host, self._path)


def node_measures(host: Following, path: str) -> dict[str, Any]:
    """Return what is measured of one node.

    Raises:
      Refused: nothing runs, or no such node.
    """
    if host.steering.run is None:
        raise Refused("state", "the graph does not run, so nothing is measured")
    found = host.steering.run.sampler().statistics(path)
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


class _Load(_Sampled):
    """How busy the groups are."""

    most_hz = 2.0

    def news(self) -> Any:
        if self.sampler is None:
            return None
        self.sampler.settle()
        loads = self.sampler.loads()
        return {
            "firings_hz": sum(one.rate_hz for one in loads.values()),
            "groups": {name: one._asdict() for name, one in loads.items()},
        }


class _Tapped(_Topic):
    """What passes a port or an edge."""

    size = 1
    most_hz = 10.0

    def __init__(self, host: Following, path: str) -> None:
        super().__init__(host)
        self._path = path
        self.tap: Tap | None = None
        self._seen = 0
        self._rate = (0.0, 0, 0.0)  # since when, how many then, how many per second before
        if host.steering.run is not None:
            self.run = host.steering.run
            self.attach(self.run)  # a path that leads nowhere is refused at once

    def attach(self, run: Run) -> None:
        self.tap = run.tap(place_at(self.host.graph, self._path), size=self.size)
        self._seen = 0

    def let_go(self) -> None:
        if self.tap is not None:
            self.tap.close()
            self.tap = None

    def is_new(self) -> bool:
        """Whether something has passed since the last frame."""
        if self.tap is None or self.tap.seen == self._seen:
            return False
        self._seen = self.tap.seen
        return True

    def rate(self) -> float:
        """Return how many pass a second, over the last one to two seconds."""
        assert self.tap is not None
        now, seen = self.time(), self.tap.seen
        since, before, last = self._rate
        if now - since >= 1.0:
            last = (seen - before) / (now - since)
            self._rate = now, seen, last
        return last


class _Value(_Tapped):
    """The newest value, in words and as far as it is small."""

    def news(self) -> Any:
        if not self.is_new() or self.tap is None or self.tap.latest is None:
            return None
        token, rate, seen = self.tap.latest, self.rate(), self.tap.seen
        return lambda: {**shown_value(token), "rate_hz": rate, "seen": seen}


class _Image(_Tapped):
    """The newest image, small enough for the page."""

    credit = 1
    kind = 3
    most_hz = 15.0

    def __init__(self, host: Following, path: str, size: int, quality: int) -> None:
        super().__init__(host, path)
        self._longest, self._quality = size, quality

    def news(self) -> Any:
        if not self.is_new() or self.tap is None or self.tap.latest is None:
            return None
        value = self.tap.latest.value
        if not is_picture(value):
            return None
        assert isinstance(value, np.ndarray)
        return lambda: image_frame(value, self._longest, self._quality)


class _History(_Tapped):
    """Numbers over time, for a plot."""

    size = _MOST_POINTS

    def __init__(self, host: Following, path: str, field: str) -> None:
        self._field = field
        self._is_fresh = True
        super().__init__(host, path)

    def attach(self, run: Run) -> None:
        super().attach(run)
        self._is_fresh = True

    def news(self) -> Any:
        taken = [] if self.tap is None else self.tap.take()
        if not taken:
            return None
        times, values = [], []
        for at, token in taken:
            try:
                number = None if token.is_marker else number_in(part_of(token.value, self._field))
            except (LookupError, TypeError, ValueError):
                number = None
            if number is not None:
                times.append(at)
                values.append(number)
        fresh, self._is_fresh = self._is_fresh, False
        return {"times": times, "values": values, "fresh": fresh}


class _Timeline(_Sampled):
    """Firings and calls as they end; of very many in a short time only the newest."""

    most_hz = 10.0

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._boxes: deque[Any] = deque(maxlen=_MOST_BOXES)
        self._done = 0
        self._is_first = True

    def attach(self, run: Run) -> None:
        super().attach(run)
        assert self.sampler is not None
        self._is_first = True
        self._boxes.clear()
        self._done = self.sampler.done()
        self.sampler.note_boxes(self._boxes)

    def let_go(self) -> None:
        if self.sampler is not None:
            self.sampler.forget_boxes(self._boxes)
        super().let_go()

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


class _Log(_Topic):
    """Records of hfg's loggers."""

    most_hz = 5.0

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._keeper = LogKeeper(self.time)

    def news(self) -> Any:
        return self._keeper.take()

    def close(self) -> None:
        self._keeper.close()


# --- by name ---


class _Args(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Arguments of a topic."""


class _Nothing(_Args, frozen=True):
    pass


class _Nodes(_Args, frozen=True):
    nodes: list[str]


class _Edges(_Args, frozen=True):
    edges: list[str]


class _Path(_Args, frozen=True):
    path: str


class _Picture(_Args, frozen=True):
    path: str
    size: int = 320
    quality: int = 75


class _Field(_Args, frozen=True):
    path: str
    field: str = ""


TOPICS: Final[Mapping[str, tuple[type[_Args], Callable[[Following, Any], _Topic]]]] = {
    "activity": (_Nothing, lambda host, _: _Activity(host)),
    "measures": (_Nodes, lambda host, args: _Measures(host, args.nodes[:_MOST_NODES])),
    "flow": (_Edges, lambda host, args: _Flows(host, args.edges[:_MOST_NODES])),
    "node": (_Path, lambda host, args: _Node(host, args.path)),
    "load": (_Nothing, lambda host, _: _Load(host)),
    "value": (_Path, lambda host, args: _Value(host, args.path)),
    "image": (
        _Picture,
        lambda host, args: _Image(host, args.path, min(max(args.size, 16), 2048), min(max(args.quality, 1), 100)),
    ),
    "history": (_Field, lambda host, args: _History(host, args.path, args.field)),
    "timeline": (_Nothing, lambda host, _: _Timeline(host)),
    "log": (_Nothing, lambda host, _: _Log(host)),
}


def make_topic(host: Following, name: str, args: dict[str, Any]) -> _Topic:
    """Make the topic of a subscription.

    Raises:
      HfgError: there is none of this name, or not with these arguments.
    """
    if name not in TOPICS:
        raise Refused("unknown", f'a page subscribes to one of {", ".join(TOPICS)}, got "{name:.40}"')
    fields, make = TOPICS[name]
    try:
        return make(host, msgspec.convert(args, fields))
    except msgspec.ValidationError as error:
        raise Refused(
            "usage", f'"{name}" has {", ".join(fields.__struct_fields__) or "no arguments"}: {error}'
        ) from None
