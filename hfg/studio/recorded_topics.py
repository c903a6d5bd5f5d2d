"""Topics of a recording: active nodes, the last values, and the times of firings, at the time of its cursor.

They have the names and frames of the topics of a run. The file is read when a frame is made, off the studio's loop.
Depends on `replaying` and `topics`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

import numpy as np
from typing_extensions import override

from hfg.engine.observing.sampling import Sample
from hfg.recording.chunks import Damaged
from hfg.recording.seeking import Found
from hfg.reporting.pictures import is_picture
from hfg.studio.conditions import part_of
from hfg.studio.following import Following
from hfg.studio.refusing import Refused
from hfg.studio.replaying import Replay
from hfg.studio.run_topics import RunTopic
from hfg.studio.sampled_topics import packed
from hfg.studio.showing import image_frame, number_in, shown_value
from hfg.studio.spans import Ways
from hfg.studio.tapped_topics import Values
from hfg.studio.topics import (
    MOST_NODES,
    MOST_VALUES,
    TOPICS,
    Args,
    Edges,
    Field,
    Inside,
    Nodes,
    Nothing,
    Path,
    Paths,
    Picture,
    Topics,
    View,
)

__all__ = ["RECORDED"]

_SECOND: Final = 10**9
_MOST_MOVES: Final = 256
_WAYS: Final = 8
"""Changes of activity before the cursor of which the ways are shown when it has jumped."""

_PLOT_NS: Final = 12 * _SECOND
_MOST_POINTS: Final = 2000
_PATIENCE_S: Final = 0.015
"""For the numbers of a plot in one frame; the next one has more of them."""

Make: TypeAlias = Callable[[], Any]


class _Topic(RunTopic):
    """A topic of a recording."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        assert isinstance(host.steering, Replay)
        self.replay = host.steering
        self.recorded = self.replay.recorded
        self.seeking = self.recorded.seeking

    @override
    def take(self) -> Any:
        try:
            return self.news()
        except OSError as error:
            raise Refused("file", f"{self.recorded.path} cannot be read: {error.strerror}") from None

    @override
    def news(self) -> Any:
        """Return nothing: how long firings took, and what was logged, is in no recording."""
        return None


class _Activity(_Topic):
    """The active nodes, and the changes since the frame before."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._seen: tuple[int, int, int] | None = None

    @override
    def news(self) -> Any:
        replay, course = self.replay, self.recorded.course
        seen = replay.at, replay.jumps, course.turn
        before, self._seen = self._seen, seen
        if seen == before:
            return None
        at = seen[0]
        active = {node: replay.seconds(since) for node, since in course.active(at).items()}
        goes_on = before is not None and before[1] == seen[1] and before[0] <= at
        if before is not None and goes_on:
            moves = course.moves(before[0], at, _MOST_MOVES)
            if not moves and before[2] == seen[2]:
                return None
        else:
            moves = course.moves(-1, at, _WAYS)
        return {"active": active, "moves": self._with_ways(moves, active), "lost": 0, "still": not goes_on}

    def _with_ways(self, moves: list[tuple[int, str, bool]], active: Mapping[str, float]) -> list[list[Any]]:
        ways = Ways(self.host.tables.of["edges"]) if moves else None
        near = {*active, *(node for _, node, _ in moves)}
        return [
            [self.replay.seconds(at), node, on, None, ways.to(node, near) if on and ways is not None else []]
            for at, node, on in moves
        ]


class _Seen(_Topic):
    """The last token that passed a port or an edge."""

    most_hz = 30.0

    def __init__(self, host: Following, path: str) -> None:
        super().__init__(host)
        self.channel = self.replay.channel_of(path)
        self._before: tuple[Found | None, int] | None = None

    @override
    def news(self) -> Any:
        at = self.replay.at
        found = self.seeking.latest(self.channel, at)
        now = found, self.recorded.course.edits_until(at)
        before, self._before = self._before, now
        return None if now == before else self.made(found, at)

    def made(self, found: Found | None, at: int) -> Make | None:
        """Return what makes the frame."""
        raise NotImplementedError


class _Value(_Seen):
    """The last value."""

    @override
    def made(self, found: Found | None, at: int) -> Make:
        if found is None:
            return lambda: None
        rate = float(self.seeking.count([self.channel], at - _SECOND, at))
        rest = {"rate_hz": rate, "seen": 1, "time": self.replay.seconds(found.time)}
        return lambda: {**self._shown(found), **rest}

    def _shown(self, found: Found) -> dict[str, Any]:
        try:
            return shown_value(self.replay.values.token(found))
        except (Damaged, OSError) as error:
            return {"kind": "other", "summary": "", "data": None, "shape": None, "dtype": None, "message": str(error)}


class _Image(_Seen):
    """The last picture."""

    credit = 1
    kind = 3

    def __init__(self, host: Following, path: str, size: int, quality: int) -> None:
        super().__init__(host, path)
        self._longest, self._quality = size, quality

    @override
    def made(self, found: Found | None, at: int) -> Make | None:
        if found is None:
            return None
        return lambda: image_frame(self._picture(found), self._longest, self._quality)

    def _picture(self, found: Found) -> np.ndarray[Any, Any]:
        try:
            value = self.replay.values.token(found).value
        except (Damaged, OSError):
            value = None  # the topic of values says why
        return value if is_picture(value) else np.zeros((3, 4), np.uint8)


class _Plot(_Topic):
    """Numbers over the last seconds before the cursor."""

    def __init__(self, host: Following, path: str, field: str) -> None:
        super().__init__(host)
        self.channel = self.replay.channel_of(path)
        self._field = field
        self._seen: Found | None = None
        self._is_whole = True
        self._is_first = True
        self._known: dict[Found, float | None] = {}

    @override
    def news(self) -> Any:
        at = self.replay.at
        found = self.seeking.latest(self.channel, at)
        if found == self._seen and self._is_whole and not self._is_first:
            return None
        self._seen, self._is_first, self._is_whole = found, False, True
        return lambda: self._numbers(at)

    def _numbers(self, at: int) -> dict[str, Any]:
        """Read backwards from the cursor for a moment; what was read is kept for the next frame."""
        until = time.monotonic() + _PATIENCE_S
        times, values = [], []
        known: dict[Found, float | None] = {}
        for found in self.seeking.messages(self.channel, at - _PLOT_NS, at):
            if found not in self._known:
                if known and time.monotonic() > until:
                    self._is_whole = False
                    break
                self._known[found] = self._number(found)
            number = known[found] = self._known[found]
            if number is not None:
                times.append(self.replay.seconds(found.time))
                values.append(number)
            if len(times) == _MOST_POINTS:
                break
        if len(self._known) > 4 * _MOST_POINTS:
            self._known = known
        return {"times": times[::-1], "values": values[::-1], "fresh": True}

    def _number(self, found: Found) -> float | None:
        try:
            return number_in(part_of(self.replay.values.token(found).value, self._field))
        except (Damaged, LookupError, OSError, TypeError, ValueError):
            return None


class _Load(_Topic):
    """How much was sent in the second before the cursor."""

    most_hz = 2.0

    @override
    def news(self) -> Any:
        at = self.replay.at
        return {"firings_hz": self.seeking.count(self.recorded.channels.values(), at - _SECOND, at), "groups": {}}


class _Rates(_Topic):
    """How often nodes sent something in the second before the cursor; how long they worked is not recorded."""

    kind = 1
    most_hz = 5.0

    def __init__(self, host: Following, nodes: list[str]) -> None:
        super().__init__(host)
        self._nodes = nodes
        self._at = -1

    @override
    def news(self) -> Any:
        at, before = self.replay.at, self._at
        if at == before:
            return None
        self._at = at
        return b"".join(packed(self._sample(path, at)) for path in self._nodes)

    def _sample(self, path: str, at: int) -> Sample:
        nodes = self.recorded.nodes
        inner = [path] if path in nodes else [one for one in nodes if one.startswith(f"{path}/")]
        rate = sum(max(self._count(port, at) for port in nodes[one]) for one in inner)
        return Sample(
            doing="signal",
            active=False,
            failed=0,
            done=0,
            p50_s=math.nan,
            p99_s=math.nan,
            rate_hz=float(rate),
            active_share=0.0,
            busy_share=0.0,
            newest_s=(),
        )

    def _count(self, port: str, at: int) -> int:
        return self.seeking.count([self.recorded.channels[port]], at - _SECOND, at)


class _Window(Args, frozen=True):
    """The stretch of time that a page shows, in seconds, and which spans it has already."""

    begin: float = 0.0
    end: float = 60.0
    turn: int = -1


class _Timeline(_Topic):
    """The cursor, when nodes were active, and when they sent something in the stretch of time that a page shows."""

    def __init__(self, host: Following, window: _Window) -> None:
        super().__init__(host)
        began, last = self.recorded.began, self.recorded.last
        self._begin, self._end = (int(min(max(began + one * 1e9, began), last)) for one in (window.begin, window.end))
        self._turn = window.turn
        self._is_first = True
        self._at = -1

    @override
    def news(self) -> Any:
        at, turn = self.replay.at, self.recorded.course.turn
        if at == self._at and turn == self._turn and not self._is_first:
            return None
        frame: dict[str, Any] = {"boxes": [], "now": self.replay.seconds(at), "lost": 0, "turn": turn}
        frame["length"] = self.replay.seconds(self.recorded.last)
        with_boxes, self._is_first, self._at = self._is_first, False, at
        with_spans, self._turn = turn != self._turn, turn
        groups = {path: node.group for path, node in self.host.tables.of["nodes"].items()} if with_boxes else {}

        def made() -> dict[str, Any]:
            if with_spans:
                frame["activity"] = self._spans()
            if with_boxes:
                frame["fresh"] = True
                frame["boxes"], frame["lost"] = self._boxes(groups)
            return frame

        return made

    def _spans(self) -> list[list[Any]]:
        seconds = self.replay.seconds
        return [
            [node, seconds(begin), None if end is None else seconds(end)]
            for node, begin, end in self.recorded.course.spans()
        ]

    def _boxes(self, groups: Mapping[str, str]) -> tuple[list[list[Any]], int]:
        ports = {number: path for path, number in self.recorded.channels.items()}
        marks, total = self.seeking.marks(ports, self._begin, self._end)
        nodes = {port: node for node, listed in self.recorded.nodes.items() for port in listed}
        rows: dict[tuple[str, int], list[Any]] = {}
        shown = 0
        for channel, times in marks.items():
            node = nodes[ports[channel]]
            group = groups.get(node, "loop")
            shown += len(times)
            for at in times.tolist():
                second = self.replay.seconds(at)
                rows.setdefault((node, at), [node, group, second, second])
        return sorted(rows.values(), key=lambda row: float(row[3])), max(0, total - shown)


RECORDED: Final[Topics] = {
    **TOPICS,
    "activity": (Nothing, lambda host, _: _Activity(host)),
    "measures": (Nodes, lambda host, args: _Rates(host, args.nodes[:MOST_NODES])),
    "flow": (Edges, lambda host, _: _Topic(host)),
    "node": (Path, lambda host, _: _Topic(host)),
    "load": (Nothing, lambda host, _: _Load(host)),
    "waits": (Inside, lambda host, _: _Topic(host)),
    "value": (Path, lambda host, args: _Value(host, args.path)),
    "values": (Paths, lambda host, args: Values(host, args.paths[:MOST_VALUES], _Value)),
    "image": (
        Picture,
        lambda host, args: _Image(host, args.path, min(max(args.size, 16), 2048), min(max(args.quality, 1), 100)),
    ),
    "history": (Field, lambda host, args: _Plot(host, args.path, args.field)),
    "timeline": (_Window, lambda host, args: _Timeline(host, args)),
    "view": (View, lambda host, _: _Topic(host)),
    "log": (Nothing, lambda host, _: _Topic(host)),
}
