"""Topics of what passes a port or an edge: values, images, numbers for plots. Depends on `run_topics` and `showing`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final

import numpy as np
from typing_extensions import override

from hfg.engine import Run
from hfg.engine.observing.taps import Tap
from hfg.errors import HfgError
from hfg.reporting.pictures import is_picture
from hfg.studio.conditions import part_of
from hfg.studio.following import Following
from hfg.studio.places import place_at
from hfg.studio.run_topics import RunTopic
from hfg.studio.showing import image_frame, kind_of, number_in, shown_value, summary_of

__all__ = ["HistoryTopic", "ImageTopic", "TappedTopic", "ValueTopic", "Values"]

_MOST_POINTS: Final = 2000
_RATE_OVER_S: Final = 1.0


class TappedTopic(RunTopic):
    """What passes a port or an edge."""

    size = 1
    most_hz = 10.0

    def __init__(self, host: Following, path: str) -> None:
        super().__init__(host)
        self._path = path
        self.tap: Tap | None = None
        self._seen = 0
        self._rate: tuple[float, int, float | None] = (0.0, 0, None)  # since when, how many then, and the rate before
        if host.steering.run is not None:
            self.run = host.steering.run
            self.attach(self.run)  # a path that leads nowhere is refused at once

    @override
    def attach(self, run: Run) -> None:
        self.tap = run.tap(place_at(self.host.graph, self._path), size=self.size)
        self._seen = 0
        self._rate = self.time(), 0, None

    @override
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
        """Return how many pass per second, over the last one to two seconds; less in the first second."""
        assert self.tap is not None
        now, seen = self.time(), self.tap.seen
        since, before, last = self._rate
        so_far = (seen - before) / (now - since) if now > since else 0.0
        if now - since < _RATE_OVER_S:
            return so_far if last is None else last
        self._rate = now, seen, so_far
        return so_far


class ValueTopic(TappedTopic):
    """The newest value, in words and as far as it is small."""

    @override
    def news(self) -> Any:
        if not self.is_new() or self.tap is None or self.tap.latest is None:
            return None
        token, rate, seen = self.tap.latest, self.rate(), self.tap.seen
        return lambda: {**shown_value(token), "rate_hz": rate, "seen": seen}


class _Brief(TappedTopic):
    """The newest value on one line."""

    @override
    def news(self) -> Any:
        if not self.is_new() or self.tap is None or self.tap.latest is None:
            return None
        token = self.tap.latest
        return lambda: {"kind": kind_of(token), "summary": summary_of(token)}


class Values(RunTopic):
    """The newest values of many ports, each on one line; those that have not changed are left out."""

    most_hz = 4.0

    def __init__(
        self, host: Following, paths: Iterable[str], make: Callable[[Following, str], RunTopic] = _Brief
    ) -> None:
        super().__init__(host)
        self._topics: dict[str, RunTopic] = {}
        for path in paths:
            with suppress(HfgError):  # nothing passes there
                self._topics[path] = make(host, path)

    @override
    def take(self) -> Any:
        found = {}
        for path, topic in self._topics.items():
            with suppress(HfgError):
                if (value := topic.take()) is not None:
                    found[path] = value
        if not found:
            return None
        return lambda: {path: _line(make()) for path, make in found.items()}

    @override
    def close(self) -> None:
        for topic in self._topics.values():
            topic.close()


def _line(value: Any) -> Any:
    return None if value is None or value["kind"] in ("none", "marker") else value["summary"]


class ImageTopic(TappedTopic):
    """The newest image, small enough for the page."""

    credit = 1
    kind = 3
    most_hz = 15.0

    def __init__(self, host: Following, path: str, size: int, quality: int) -> None:
        super().__init__(host, path)
        self._longest, self._quality = size, quality

    @override
    def news(self) -> Any:
        if not self.is_new() or self.tap is None or self.tap.latest is None:
            return None
        value = self.tap.latest.value
        if not is_picture(value):
            return None
        assert isinstance(value, np.ndarray)
        return lambda: image_frame(value, self._longest, self._quality)


class HistoryTopic(TappedTopic):
    """Numbers over time, for a plot."""

    size = _MOST_POINTS

    def __init__(self, host: Following, path: str, field: str) -> None:
        self._field = field
        self._is_fresh = True
        super().__init__(host, path)

    @override
    def attach(self, run: Run) -> None:
        super().attach(run)
        self._is_fresh = True

    @override
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
