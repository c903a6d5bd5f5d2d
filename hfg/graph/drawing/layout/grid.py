"""The plane in strips: where things are, and what is free for lines between them.

Strips cut the plane twice, from left to right and from top to bottom. A thing covers some strips of both kinds. Lines
run along channels, the strips in which nothing has to be. In a drawing that is placed there is a channel between any
two lanes and any two rows, as wide as its lines need; among things placed by the user, whatever is free is one.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from hfg.graph.drawing.layout.parts import Thing

GUTTER: Final = 28.0  # between two lanes
_NARROWEST: Final = 8.0  # channel among things placed by the user
_ROOM: Final = 6.0
_WIDEST: Final = 200.0  # around things placed by the user


class Axis:
    """The strips along one axis.

    Attributes:
      edges: where each begins, and where the last one ends.
      is_channel: whether lines may run along it.
      busy: of each, the strips of the other axis that a thing covers there, as bits.
    """

    def __init__(self, edges: Sequence[float], is_channel: Sequence[bool]) -> None:
        self.edges = list(edges)
        self.is_channel = list(is_channel)
        self.busy = [0] * len(is_channel)

    def __len__(self) -> int:
        return len(self.is_channel)

    def middle(self, strip: int) -> float:
        """Return the middle of a strip."""
        return (self.edges[strip] + self.edges[strip + 1]) / 2

    def width(self, strip: int) -> float:
        """Return how wide a strip is."""
        return self.edges[strip + 1] - self.edges[strip]

    def find(self, at: float) -> int:
        """Return the strip at a place."""
        return min(max(bisect_right(self.edges, at) - 1, 0), len(self) - 1)

    def is_free(self, strip: int, first: int, last: int) -> bool:
        """Whether nothing lies in a strip from one strip of the other axis to another."""
        if first > last:
            first, last = last, first
        return not self.busy[strip] & (((1 << (last - first + 1)) - 1) << first)


class Grid:
    """Both axes, and which strips each thing covers: the first and last of x, and of y."""

    def __init__(self, x: Axis, y: Axis, covered: dict[int, tuple[int, int, int, int]], rays: int) -> None:
        self.x, self.y, self.covered = x, y, covered
        self.rays = rays  # into that many channels a line may turn from its port
        for left, right, top, bottom in covered.values():
            for strip in range(left, right + 1):
                x.busy[strip] |= ((1 << (bottom - top + 1)) - 1) << top
            for strip in range(top, bottom + 1):
                y.busy[strip] |= ((1 << (right - left + 1)) - 1) << left

    @classmethod
    def of_lanes(cls, things: Sequence[Thing], lanes: int, rows: int, first: int) -> Grid:
        """Return the grid for placing: channel, lane, channel ..., and the same with rows; `first` is a lane."""
        x = Axis([0.0] * (2 * lanes + 2), [number % 2 == 0 for number in range(2 * lanes + 1)])
        y = Axis([0.0] * (2 * rows + 2), [number % 2 == 0 for number in range(2 * rows + 1)])
        covered = {}
        for one in things:
            lane = 2 * (one.lane - first) + 1
            covered[one.number] = lane, lane, 2 * one.row + 1, 2 * (one.row + one.span) - 1
        return cls(x, y, covered, 3)

    @classmethod
    def of_places(cls, things: Sequence[Thing]) -> Grid:
        """Return the grid of what has its places: cut wherever a thing begins or ends."""
        boxes = {one.number: _outline(one) for one in things}
        cuts: list[list[float]] = []
        for low, high in ((0, 1), (2, 3)):
            found = sorted({box[side] for box in boxes.values() for side in (low, high)} or {0.0})
            cuts.append([found[0] - _WIDEST, *found, found[-1] + _WIDEST])
        x, y = (Axis(edges, [high - low >= _NARROWEST for low, high in pairwise(edges)]) for edges in cuts)
        covered = {
            number: (x.find(left), x.find(right - 0.5), y.find(top), y.find(bottom - 0.5))
            for number, (left, right, top, bottom) in boxes.items()
        }
        return cls(x, y, covered, 12)


def _outline(one: Thing) -> tuple[float, float, float, float]:
    """Return what a thing takes with some room around: left, right, top and bottom."""
    return one.x - _ROOM, one.x + one.width + _ROOM, one.y - _ROOM, one.y + one.height + _ROOM
