"""Which channels each line runs through: as few corners as there can be, no node below it, short.

A line leaves its port straight ahead, turns into a channel, perhaps from there into others, and comes straight to the
other port. All ways with at most three channels are tried; a longer one is needed only among nodes that the user has
placed. Lines of one net like to run together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, Literal, TypeAlias

import msgspec

from hfg.graph.drawing.layout.grid import Axis, Grid
from hfg.graph.drawing.layout.parts import Link, Side, Spot, Thing
from hfg.graph.drawing.layout.searching import search

Leg: TypeAlias = tuple[Literal["x", "y"], int]
"""A part of a way: along a strip of x, so up or down, or along one of y."""

_BEND: Final = 40.0  # as bad as that much more length
_TOGETHER: Final = 70.0  # the advantage of a channel in which the net runs already
_WRONG_SIDE: Final = 5000.0
_LOAD: Final = 4.0  # for each net that a channel has
_NARROW: Final = 12.0
_STUB: Final = 8.0  # from a comb to its ports


class End(msgspec.Struct, frozen=True):
    """Where a line leaves a thing: its point, and the strips there. Lines of a bundle meet in front of their ports."""

    x: float
    y: float
    side: Side
    strip_x: int
    strip_y: int

    @property
    def is_level(self) -> bool:
        """Whether it goes left or right from here."""
        return self.side in ("left", "right")


def ends_of(link: Link, grid: Grid) -> tuple[End, End]:
    """Return both ends of a line between two things."""
    assert link.tail is not None
    assert link.head is not None
    return _end(link.tail, link.tail_spots, grid), _end(link.head, link.head_spots, grid)


def _end(thing: Thing, spots: Sequence[Spot], grid: Grid) -> End:
    is_comb = len({id(spot) for spot in spots}) > 1
    if is_comb:
        spots = [one for one in thing.on(spots[0].side) if one.comb == spots[0].comb]
    places = [thing.where(spot) for spot in spots]
    x, y = (sum(place[axis] for place in places) / len(places) for axis in (0, 1))
    left, right, top, bottom = grid.covered[thing.number]
    side = spots[0].side
    stub = _STUB if is_comb else 0.0
    match side:
        case "left":
            return End(x - stub, y, side, left - 1, _between(grid.y, y, top, bottom))
        case "right":
            return End(x + stub, y, side, right + 1, _between(grid.y, y, top, bottom))
        case "top":
            return End(x, y - stub, side, _between(grid.x, x, left, right), top - 1)
        case "bottom":
            return End(x, y + stub, side, _between(grid.x, x, left, right), bottom + 1)


def _between(axis: Axis, at: float, first: int, last: int) -> int:
    return min(max(axis.find(at), first), last)


class _Router:
    """Finds ways; remembers what runs where."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.nets: dict[Leg, set[int]] = {}  # which nets run along a channel
        self.level: dict[tuple[int, int], int] = {}  # which net goes straight through a free place, from side to side
        self.upright: dict[tuple[int, int], int] = {}

    def way(self, link: Link) -> list[Leg]:
        """Return the best way for a line, and remember it."""
        tail, head = ends_of(link, self.grid)
        best: list[Leg] = []
        least = float("inf")
        for legs in self._ways(tail, head, link.net):
            cost = self._cost(legs, tail, head, link)
            if cost < least:
                least, best = cost, legs
        for leg in best:
            self.nets.setdefault(leg, set()).add(link.net)
        self._pass(best, tail, head, link.net)
        return best

    def _cost(self, legs: list[Leg], tail: End, head: End, link: Link) -> float:
        points = corners(legs, [self._middle(leg) for leg in legs], tail, head)
        cost = _BEND * (len(points) - 2)
        for (x1, y1), (x2, y2) in pairwise(points):
            cost += abs(x2 - x1) + abs(y2 - y1)
        for leg in legs:
            nets = self.nets.get(leg, ())
            cost += -_TOGETHER if link.net in nets else _LOAD * len(nets)
            axis = self.grid.x if leg[0] == "x" else self.grid.y
            if axis.width(leg[1]) < _NARROW:
                cost += _BEND
            if link.via and leg[0] == "x" and link.head is not None:
                lane = self.grid.covered[link.head.number][0]
                if (leg[1] < lane) != (link.via < 0):
                    cost += _WRONG_SIDE
        return cost

    def _middle(self, leg: Leg) -> float:
        return (self.grid.x if leg[0] == "x" else self.grid.y).middle(leg[1])

    # --- what is tried

    def _ways(self, tail: End, head: End, net: int) -> Iterator[list[Leg]]:
        straight = self._straight(tail, head, net)
        if straight:
            yield []
            if tail.is_level == head.is_level:
                return
        begins, ends = list(self._rays(tail, net)), list(self._rays(head, net))
        found = False
        for begin in begins:
            for end in ends:
                for legs in self._between(begin, end, tail, head):
                    found = True
                    yield legs
        if not found and not straight:
            ends_ = [(end.strip_x, end.strip_y, end.is_level) for end in (tail, head)]
            yield search(self.grid, *ends_) or []  # without any way the line runs below what the user has put there

    def _rays(self, end: End, net: int) -> Iterator[Leg]:
        """Yield the channels into which a line may turn that goes straight on from its port."""
        across, other = (self.grid.x, self.grid.y) if end.is_level else (self.grid.y, self.grid.x)
        strip, along = (end.strip_x, end.strip_y) if end.is_level else (end.strip_y, end.strip_x)
        step = 1 if end.side in ("right", "bottom") else -1
        count = 0
        passed = self.level if end.is_level else self.upright
        while 0 <= strip < len(across) and not other.busy[along] >> strip & 1 and count < self.grid.rays:
            place = (strip, along) if end.is_level else (along, strip)
            if across.is_channel[strip]:
                yield ("x" if end.is_level else "y"), strip
                count += 1
            elif passed.get(place, net) != net:
                return
            strip += step

    def _straight(self, tail: End, head: End, net: int) -> bool:
        """Whether both ends look at each other, or meet at one corner."""
        grid = self.grid
        if tail.is_level and head.is_level:
            ahead = tail.side == "right" and head.side == "left" and tail.x < head.x
            free = tail.strip_y == head.strip_y and grid.y.is_free(tail.strip_y, tail.strip_x, head.strip_x)
            return ahead and free and abs(tail.y - head.y) < 1 and self._may_pass(tail, head, net)
        if not tail.is_level and not head.is_level:
            ahead = tail.side == "bottom" and head.side == "top" and tail.y < head.y
            free = tail.strip_x == head.strip_x and grid.x.is_free(tail.strip_x, tail.strip_y, head.strip_y)
            return ahead and free and abs(tail.x - head.x) < 1 and self._may_pass(tail, head, net)
        one, other = (tail, head) if tail.is_level else (head, tail)
        ahead = (other.x > one.x) == (one.side == "right") and (one.y < other.y) == (other.side == "top")
        free = grid.y.is_free(one.strip_y, one.strip_x, other.strip_x)
        free = free and grid.x.is_free(other.strip_x, one.strip_y, other.strip_y)
        return ahead and free and self._may_pass(tail, head, net)

    def _may_pass(self, tail: End, head: End, net: int) -> bool:
        return all(passed.get(place, net) == net for passed, place in self._places([], tail, head))

    def _pass(self, legs: list[Leg], tail: End, head: End, net: int) -> None:
        for passed, place in self._places(legs, tail, head):
            passed[place] = net

    def _places(
        self, legs: list[Leg], tail: End, head: End
    ) -> Iterator[tuple[dict[tuple[int, int], int], tuple[int, int]]]:
        """Yield the places outside of channels that a line goes straight through."""
        for end, other, leg in ((tail, head, legs[0] if legs else None), (head, tail, legs[-1] if legs else None)):
            if end.is_level:
                last = other.strip_x if leg is None else leg[1]
                for strip in range(min(end.strip_x, last), max(end.strip_x, last) + 1):
                    if not self.grid.x.is_channel[strip]:
                        yield self.level, (strip, end.strip_y)
            else:
                last = other.strip_y if leg is None else leg[1]
                for strip in range(min(end.strip_y, last), max(end.strip_y, last) + 1):
                    if not self.grid.y.is_channel[strip]:
                        yield self.upright, (end.strip_x, strip)

    def _between(self, begin: Leg, end: Leg, tail: End, head: End) -> Iterator[list[Leg]]:
        """Yield the ways from one channel to another: they are the same, they cross, or one more leads over."""
        grid = self.grid
        own, cross = (grid.x, grid.y) if begin[0] == "x" else (grid.y, grid.x)
        from_ = tail.strip_y if begin[0] == "x" else tail.strip_x
        if begin[0] != end[0]:
            to = head.strip_x if begin[0] == "x" else head.strip_y
            if own.is_free(begin[1], from_, end[1]) and cross.is_free(end[1], begin[1], to):
                yield [begin, end]
            return
        to = head.strip_y if begin[0] == "x" else head.strip_x
        if begin == end:
            if own.is_free(begin[1], from_, to):
                yield [begin]
            return
        low, high = min(from_, to) - 4 * grid.rays, max(from_, to) + 4 * grid.rays
        for strip in range(max(low, 0), min(high + 1, len(cross))):
            if (
                cross.is_channel[strip]
                and cross.is_free(strip, begin[1], end[1])
                and own.is_free(begin[1], from_, strip)
                and own.is_free(end[1], strip, to)
            ):
                yield [begin, ("y" if begin[0] == "x" else "x", strip), end]


def route(links: Sequence[Link], grid: Grid) -> list[list[Leg]]:
    """Return the legs of each line, in the order of the lines; the most important ones choose first."""
    router = _Router(grid)
    found: list[list[Leg]] = [[] for _ in links]

    def rank(number: int) -> tuple[bool, bool, int, int]:
        link = links[number]
        assert link.tail is not None
        assert link.head is not None
        far = abs(link.tail.row - link.head.row) + abs(link.tail.lane - link.head.lane)
        return not link.is_active, link.is_back, far, number

    for number in sorted(range(len(links)), key=rank):
        found[number] = router.way(links[number])
    return found


def corners(legs: Sequence[Leg], at: Sequence[float], tail: End, head: End) -> list[tuple[float, float]]:
    """Return the corners of a way whose legs run at these places."""
    x, y = tail.x, tail.y
    points = [(x, y)]
    for (axis, _), place in zip(legs, at, strict=True):
        x, y = (place, y) if axis == "x" else (x, place)
        points.append((x, y))
    if head.is_level:
        points.append((x, head.y))
    else:
        points.append((head.x, y))
    points.append((head.x, head.y))
    return _without_straight_corners(points)


def _without_straight_corners(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Leave out what is not a corner."""
    found: list[tuple[float, float]] = []
    for point in points:
        if found and point == found[-1]:
            continue
        if len(found) > 1:
            (x1, y1), (x2, y2) = found[-2], found[-1]
            if (x1 == x2 == point[0]) or (y1 == y2 == point[1]):
                found.pop()
        found.append(point)
    return found
