"""One level: rows and lanes, then ports, then ways, then tracks, and with these how wide everything becomes."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Final

from hfg.graph.drawing.layout.blocks import GRID, halves, place_level, room, rooms_beside, size, up
from hfg.graph.drawing.layout.grid import GUTTER, Grid
from hfg.graph.drawing.layout.parts import GAP, Link, Side, Spot, Thing, Work
from hfg.graph.drawing.layout.placing import place, spine_of
from hfg.graph.drawing.layout.routing import Leg, corners, ends_of, route
from hfg.graph.drawing.layout.tracks import Way, needed, tracks_of
from hfg.graph.drawing.seen import Kind, View

_GUTTER_PAD: Final = 12.0  # from a lane to the first track: there is room for a comb
_WITH_HEADS: Final = 20.0  # the same for the head of an arrow
_GAP_PAD: Final = 12.0  # from a row to the first track: there is room for the head of an arrow
_TALL: Final = 120.0  # such a thing is not in the middle of its row
_ALIKE: Final = 48.0  # things of one lane that are nearly as wide are made as wide
_ROUNDS: Final = 4
_STEP: Final = 12.0  # a step up or down of at most that is made straight
_SHIFT: Final = 9.0


def lay(work: Work, view: View, kind: Kind, inner_sizes: Mapping[str, tuple[float, float]]) -> None:
    """Lay out one level; `inner_sizes` says how large the inside of each open subgraph is."""
    for again in (False, True):
        for thing in work.things:
            size(thing, measured=view.measured, inner=inner_sizes.get(thing.shape.id))
        if again:
            break
        place(work)
        if kind == "all" or not work.has_rows:
            break
        for thing in work.things:
            for spot in thing.spots.values():
                spot.is_linked = False
        work.links = _jumping(work.links)
    _order_ports(work)
    inner = [link for link in work.links if link.tail is not None and link.head is not None]
    _Lanes(work, inner, _WITH_HEADS if kind == "activity" else _GUTTER_PAD).lay()
    if view.places:
        _keep_places(work.things, view)
        _lead(inner, Grid.of_places(work.things))
    work.width = max((one.x + one.width + one.right for one in work.things), default=0.0)
    work.height = max((one.y + one.height + one.bottom for one in work.things), default=0.0)


def _jumping(links: Sequence[Link]) -> list[Link]:
    """Let no data or signal run against the mission: what leads to the left or up is a tag at both its ends."""
    drawn: list[Link] = []
    jumps: list[tuple[Thing, Thing, Link]] = []
    for link in links:
        tail, head = link.tail, link.head
        if tail is None or head is None:
            drawn.append(link)
        elif link.is_active or tail.lane < head.lane or (tail.lane == head.lane and _may_turn(link)):
            drawn.append(link)
            for spot in (*link.tail_spots, *link.head_spots):
                spot.is_linked = True
        else:
            jumps.append((tail, head, link))
    for tail, head, link in jumps:
        for arrow, begin, end in zip(link.arrows, link.tail_spots, link.head_spots, strict=True):
            begin.tagged.append(f"→ {head.shape.name}")
            drawn.append(Link([arrow], tail, None, [begin], [], link.net, is_jump=True))
            if not (end.is_linked and end.comb >= 0):  # there is no room for a tag within a comb
                end.tagged.append(tail.shape.name)
                drawn.append(Link([arrow], None, head, [], [end], link.net, is_jump=True))
    return drawn


def _may_turn(link: Link) -> bool:
    """Whether a line within a lane is drawn: down it is, up only as data that no state is asked for."""
    assert link.tail is not None
    assert link.head is not None
    return link.tail.row < link.head.row or not (link.is_signal or link.head.shape.is_state)


# --- ports


def _order_ports(work: Work) -> None:
    """Say where ports on top and bottom are: on the spine, or on the side to which their lines go."""
    pulls: dict[int, list[float]] = {}
    for link in work.links:
        tail, head = link.tail, link.head
        if tail is None or head is None:
            continue
        for thing, other, spots in ((tail, head, link.tail_spots), (head, tail, link.head_spots)):
            # The further down the other end is, the further out: so lines from one side do not cross.
            pull = 100.0 * link.via if link.is_back else (10.0 + other.row / 100) * (other.lane - thing.lane) or 1.0
            for spot in spots:
                pulls.setdefault(id(spot), []).append(pull)
    for thing in work.things:
        for spot in thing.spots.values():
            found = pulls.get(id(spot))
            spot.pull = sum(found) / len(found) if found else 0.0
    spine = spine_of(work)
    for thing in work.things:
        _balance(thing, [spine.get((thing.number, side)) for side in ("top", "bottom")])
    lanes: dict[int, list[Thing]] = {}
    for thing in work.things:
        lanes.setdefault(thing.lane, []).append(thing)
    for things in lanes.values():
        _widths_of_lane([one for one in things if work.has_rows and one.shape.is_state], spine)
        _same_widths([one for one in things if not (work.has_rows and one.shape.is_state) and one.shape.look == "node"])
    for thing in work.things:
        has_spine = work.has_rows and thing.shape.is_state
        place_level(thing, {side: spine.get((thing.number, side)) for side in ("top", "bottom")} if has_spine else {})


def _balance(thing: Thing, spine: Sequence[Spot | None]) -> None:
    """Put ports from which no line leads on that side of the spine where there is more room."""
    for side in ("top", "bottom"):
        spots = [one for one in thing.spots.values() if one.side == side and one not in spine]
        for spot in spots:
            if not spot.pull:
                left = sum(room(one) for one in spots if one.pull < 0)
                spot.pull = -0.5 if left < sum(room(one) for one in spots if one.pull > 0) else 0.5


def _widths_of_lane(states: Sequence[Thing], spine: dict[tuple[int, Side], Spot]) -> None:
    """Make the states of a lane equally wide, with the spine in the middle if it can be there."""
    if not states:
        return
    rooms = [rooms_beside(one, {side: spine.get((one.number, side)) for side in ("top", "bottom")}) for one in states]
    left, right = max(one for one, _ in rooms), max(one for _, one in rooms)
    width = up(max(left + right, *(one.width for one in states if one.shape.look != "box"), 0.0))
    middle = width / 2 if left <= width / 2 >= right else left
    for thing in states:
        thing.spine = middle
        thing.width = max(width, thing.width) if thing.shape.look == "box" else width


def _same_widths(things: Sequence[Thing]) -> None:
    widest = max((one.width for one in things), default=0.0)
    for thing in things:
        if thing.width + _ALIKE >= widest:
            thing.width = widest


# --- lanes and rows


class _Lanes:
    """The grid of the things to place; its channels become as wide as their lines need."""

    def __init__(self, work: Work, links: list[Link], pad: float) -> None:
        self.work, self.links, self.pad = work, links, pad
        self.first = min((one.lane for one in work.things), default=0)
        self.lanes = max((one.lane for one in work.things), default=-1) - self.first + 1
        self.rows = max((one.row + one.span for one in work.things), default=0)
        self.grid = Grid.of_lanes(work.things, self.lanes, self.rows, self.first)
        self.counts: dict[str, dict[int, int]] = {"x": {}, "y": {}}

    def lay(self) -> None:
        """Find ways, then widen channels until all tracks have room."""
        self._stretch()
        _straighten(self.links)
        legs = route(self.links, self.grid)
        for _ in range(_ROUNDS):
            ways = _ways(self.links, legs, self.grid)
            is_more = False
            for axis in ("y", "x", "y", "x"):
                for strip, count in tracks_of(ways, self.grid, axis, fixed=False).items():
                    if count > self.counts[axis].get(strip, 0):
                        self.counts[axis][strip] = count
                        is_more = True
            if not is_more:
                break
            self._stretch()
        for _ in range(_ROUNDS):
            _draw(self.links, _settled(self.links, legs, self.grid, fixed=False))
            if not _part_ends(self.links):
                return
        _draw(self.links, _settled(self.links, legs, self.grid, fixed=False))

    def _stretch(self) -> None:
        by_lane: dict[int, list[Thing]] = {}
        for thing in self.work.things:
            by_lane.setdefault(thing.lane - self.first, []).append(thing)
        x = 0.0
        for strip in range(2 * self.lanes + 1):
            self.grid.x.edges[strip] = x
            if strip % 2:
                x = up(x, 4.0)
                x += self._lane(by_lane.get(strip // 2, []), x)
            else:
                least = GUTTER if 0 < strip < 2 * self.lanes else 0.0
                x += needed(self.counts["x"].get(strip, 0), least, self.pad)
        self.grid.x.edges[-1] = x
        heights = self._row_heights()
        y = 0.0
        for strip in range(2 * self.rows + 1):
            self.grid.y.edges[strip] = y
            y += heights[strip // 2][0] + heights[strip // 2][1] if strip % 2 else self._gap(strip)
        self.grid.y.edges[-1] = y
        for thing in self.work.things:
            self._put_down(thing, heights)

    def _lane(self, things: Iterable[Thing], x: float) -> float:
        """Put the things of a lane next to each other's edges, and say how wide it is."""
        things = list(things)
        states = [one for one in things if self.work.has_rows and one.shape.is_state]
        left = max((one.left for one in states), default=0.0)
        width = max((left + one.width + one.right for one in states), default=0.0)
        width = max(width, *(one.left + one.width + one.right for one in things), 0.0)
        for thing in things:
            if thing in states:
                thing.x = x + left
            elif thing.lane < 0:
                thing.x = x + width - thing.right - thing.width
            else:
                thing.x = x + thing.left
        return width

    def _row_heights(self) -> list[tuple[float, float]]:
        """Return how much each row needs above and below its middle line, on which most things have their middle."""
        found = [(0.0, 0.0)] * self.rows
        for thing in self.work.things:
            if thing.span == 1 and thing.height <= _TALL:
                above, below = found[thing.row]
                found[thing.row] = max(above, thing.top + thing.height / 2), max(below, thing.bottom + thing.height / 2)
        for thing in sorted(self.work.things, key=lambda one: one.span):
            need = thing.top + thing.height + thing.bottom
            last = thing.row + thing.span - 1
            rows = range(thing.row, last + 1)
            given = sum(sum(found[row]) for row in rows) + sum(self._gap(2 * row) for row in rows if row > thing.row)
            if given < need:
                found[last] = found[last][0], found[last][1] + need - given
        return [(up(above, 4.0), up(below, 4.0)) for above, below in found]

    def _gap(self, strip: int) -> float:
        least = GAP if 0 < strip < 2 * self.rows else 0.0
        return up(needed(self.counts["y"].get(strip, 0), least, _GAP_PAD), 4.0)

    def _put_down(self, thing: Thing, heights: Sequence[tuple[float, float]]) -> None:
        edges = self.grid.y.edges
        top = edges[2 * thing.row + 1]
        if thing.span == 1 and thing.height <= _TALL:
            thing.y = top + heights[thing.row][0] - thing.height / 2
        else:
            spare = edges[2 * (thing.row + thing.span)] - top - thing.top - thing.height - thing.bottom
            thing.y = top + thing.top + (spare / 2 // GRID * GRID if thing.span > 1 else 0.0)


# --- ways


def _ways(links: Sequence[Link], legs: Sequence[list[Leg]], grid: Grid) -> list[Way]:
    found = []
    for link, own in zip(links, legs, strict=True):
        axes = {"x": grid.x, "y": grid.y}
        found.append(Way(link.net, own, [axes[axis].middle(strip) for axis, strip in own], *ends_of(link, grid)))
    return found


def _settled(links: Sequence[Link], legs: Sequence[list[Leg]], grid: Grid, *, fixed: bool) -> list[Way]:
    """Choose tracks until the order of those of one axis fits to that of the other."""
    ways = _ways(links, legs, grid)
    before: list[list[float]] = []
    for _ in range(_ROUNDS):
        for axis in ("y", "x"):
            tracks_of(ways, grid, axis, fixed=fixed)
        if before == [way.at for way in ways]:
            break
        before = [list(way.at) for way in ways]
    return ways


def _lead(links: Sequence[Link], grid: Grid) -> None:
    """Find ways among things that have their places already."""
    _draw(links, _settled(links, route(links, grid), grid, fixed=True))


def _draw(links: Sequence[Link], ways: Sequence[Way]) -> None:
    for link, way in zip(links, ways, strict=True):
        link.points = corners(way.legs, way.at, way.tail, way.head)


def _straighten(links: Sequence[Link]) -> None:
    """Move ports that are the only one on their side, so that lines with a small step become straight."""
    for link in links:
        tail, head = link.tail, link.head
        assert tail is not None
        assert head is not None
        step = head.where(link.head_spots[0])[1] - tail.where(link.tail_spots[0])[1]
        if not 0 < abs(step) <= _STEP or link.tail_spots[0].side != "right" or link.head_spots[0].side != "left":
            continue
        for thing, spot, by in ((tail, link.tail_spots[0], step), (head, link.head_spots[0], -step)):
            if len(thing.on(spot.side)) == 1 and not spot.says and 10.0 <= spot.at + by <= thing.height - 10.0:
                spot.at += by
                break


def _part_ends(links: Sequence[Link]) -> bool:
    """Move ports whose lines would lie on each other: if two of them change sides in one channel, no tracks help."""
    ends: dict[tuple[bool, float], list[tuple[float, float, Link, Thing, Spot]]] = {}
    for link in links:
        assert link.tail is not None
        assert link.head is not None
        for thing, spot, points in (
            (link.tail, link.tail_spots[0], link.points[:2]),
            (link.head, link.head_spots[0], link.points[-2:]),
        ):
            (x1, y1), (x2, y2) = points
            low, high = (min(x1, x2), max(x1, x2)) if y1 == y2 else (min(y1, y2), max(y1, y2))
            ends.setdefault((y1 == y2, y1 if y1 == y2 else x1), []).append((low, high, link, thing, spot))
    is_moved = False
    for found in ends.values():
        found.sort(key=lambda end: end[0])
        for (_, high, link, thing, spot), (low, _, other, thing2, spot2) in pairwise(found):
            if low < high and link.net != other.net:
                is_moved = _shift(thing2, spot2) or _shift(thing, spot) or is_moved
    return is_moved


def _shift(thing: Thing, spot: Spot) -> bool:
    """Move a port along its side, away from others."""
    if spot.comb >= 0:
        return False
    length = thing.height if spot.side in ("left", "right") else thing.width
    taken = [other for other in thing.on(spot.side) if other is not spot]
    for step in (_SHIFT, -_SHIFT, 2 * _SHIFT, -2 * _SHIFT):
        at = spot.at + step
        if 8.0 <= at <= length - 8.0 and all(_is_clear(at, spot, other) for other in taken):
            spot.at = at
            return True
    return False


def _is_clear(at: float, spot: Spot, other: Spot) -> bool:
    if spot.side in ("left", "right"):
        return abs(at - other.at) >= _SHIFT
    own, others = halves(spot), halves(other)
    return at - other.at >= own[0] + others[1] if other.at < at else other.at - at >= own[1] + others[0]


# --- places that the user has chosen


def _keep_places(things: Sequence[Thing], view: View) -> None:
    """Put things where the user wants them; the others give way, and come along if they are fewer."""
    kept = [
        one
        for one in things
        if one.shape.path in view.places and (view.only is None or one.shape.path not in view.only)
    ]
    if not kept:
        return
    stay = [0.0] * (len(things) - len(kept))
    x, y = (
        statistics.median([*(view.places[one.shape.path][axis] - (one.x, one.y)[axis] for one in kept), *stay])
        for axis in (0, 1)
    )
    for thing in things:
        thing.x, thing.y = thing.x + round(x), thing.y + round(y)
    for thing in kept:
        thing.x, thing.y = view.places[thing.shape.path]
    done = list(kept)
    for thing in things:
        if thing not in kept:
            _give_way(thing, done)
            done.append(thing)


_STEPS: Final = sorted(
    ((dx, dy) for dx in range(-40, 41) for dy in range(-40, 41)), key=lambda one: (abs(one[0]) + abs(one[1]), one)
)


def _give_way(thing: Thing, others: Sequence[Thing]) -> None:
    """Move a thing to the nearest place where it lies on no other."""
    x, y = thing.x, thing.y
    for dx, dy in _STEPS:
        thing.x, thing.y = x + 4 * GRID * dx, y + 4 * GRID * dy
        if not any(_touches(thing, other) for other in others):
            return


def _touches(one: Thing, other: Thing) -> bool:
    apart_x = one.x - one.left >= other.x + other.width + other.right + GUTTER
    apart_x = apart_x or other.x - other.left >= one.x + one.width + one.right + GUTTER
    apart_y = one.y - one.top >= other.y + other.height + other.bottom + GAP
    return not (apart_x or apart_y or other.y - other.top >= one.y + one.height + one.bottom + GAP)
