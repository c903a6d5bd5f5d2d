"""All of the layout: what is not connected side by side, and in each part blocks in columns and lines in channels.

Lines reach a block on its left and leave it on its right, or the other way round where they go back. Those of docks on
top and bottom turn within the block's column: above and below it there is a track for each, so for the rest of the
layout a block is higher than it is, and all its lines meet its left and right.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TypeAlias

from msgspec.structs import replace

from hfg.graph.drawing.layout.blocks import Block, Line, Plan, Point
from hfg.graph.drawing.layout.channels import Trunk, tracks
from hfg.graph.drawing.layout.columns import columns
from hfg.graph.drawing.layout.docking import ENDS, TRACK, Turn, Way, docked
from hfg.graph.drawing.layout.ordering import Ties, ordered
from hfg.graph.drawing.layout.placing import Pulls, placed

__all__ = ["arrange"]

Wire: TypeAlias = tuple[int, int, Way, str]
"""Lines that run together as long as they can: from which block and dock, on which side, and of which kind."""

_BEFORE: Final = 22.0  # from the last track of a channel to the next column
_BEHIND: Final = 14.0  # from a column to the first track
_STRAIGHT: Final = 34.0  # the width of a channel without tracks
_GAP: Final = 20.0  # between two blocks
_WIRE_GAP: Final = 10.0  # between two lines that pass
_APART: Final = 34.0  # between what is not connected
_SMALL: Final = 60  # blocks and places where lines pass
_LARGE: Final = 600
_TRIES: Final = 2  # with docks in another order, for all but large drawings
_CROSSING: Final = 60.0  # as bad as lines longer by so much
_BROAD: Final = 1.7  # how broad a drawing of several parts is meant to be, against its height


def arrange(blocks: Sequence[Block], lines: Sequence[Line]) -> Plan:
    """Say where everything goes; blocks get the places of their docks that are not fixed."""
    plan = Plan(0.0, 0.0, [(0.0, 0.0)] * len(blocks), [[] for _ in lines], [[] for _ in lines], [None] * len(lines))
    parts = [_best(blocks, lines, members, inner) for members, inner in _parts(blocks, lines)]
    widest = max((part.width for part in parts), default=0.0)
    area = sum((part.width + _APART) * (part.height + _APART) for part in parts)
    room = max(widest, math.sqrt(area * _BROAD))
    x = y = row = 0.0
    for part in parts:
        if x and x + part.width > room:
            x, y, row = 0.0, y + row + _APART, 0.0
        part.into(plan, x, y)
        plan.width, plan.height = max(plan.width, x + part.width), max(plan.height, y + part.height)
        x, row = x + part.width + _APART, max(row, part.height)
    return plan


def _parts(blocks: Sequence[Block], lines: Sequence[Line]) -> Iterator[tuple[list[int], list[int]]]:
    """Give what is connected, in order of the first block of each; what has a rank is one part."""
    leader = list(range(len(blocks)))

    def find(one: int) -> int:
        while leader[one] != one:
            leader[one] = leader[leader[one]]
            one = leader[one]
        return one

    ranked = [number for number, block in enumerate(blocks) if block.rank]
    pairs = [(line.tail, line.head) for line in lines] + [(ranked[0], other) for other in ranked[1:]]
    for one, other in pairs:
        first, second = sorted((find(one), find(other)))
        leader[second] = first
    members: dict[int, list[int]] = {}
    for number in range(len(blocks)):
        members.setdefault(find(number), []).append(number)
    inner: dict[int, list[int]] = {root: [] for root in members}
    for number, line in enumerate(lines):
        inner[find(line.tail)].append(number)
    for root, found in members.items():
        yield found, inner[root]


def _best(blocks: Sequence[Block], lines: Sequence[Line], members: list[int], inner: list[int]) -> _Part:
    """Lay a part out a few times, each time with docks in the order of what they led to the time before."""
    number = {block: index for index, block in enumerate(members)}
    own = [blocks[one] for one in members]
    renumbered = [
        replace(line, tail=number[line.tail], head=number[line.head]) for line in (lines[one] for one in inner)
    ]
    column = columns(own, renumbered)
    best = part = _Part(members, inner, own, renumbered, column, [{} for _ in own])
    for _ in range(_TRIES if len(part.at_column) < _LARGE else 1):
        part = _Part(members, inner, own, renumbered, column, part.heights_of_partners())
        if part.cost < best.cost:
            best = part
    best.route()
    return best


class _Part:
    """The layout of one part.

    A member is a block, or a place where wires pass a column. Members have numbers: blocks those of `members`, places
    the next ones.
    """

    def __init__(
        self,
        members: list[int],
        inner: list[int],
        blocks: list[Block],
        lines: list[Line],
        column: list[int],
        partners: Sequence[Mapping[int, float]],
    ) -> None:
        self.members, self.inner, self.blocks, self.lines, self.column = members, inner, blocks, lines, column
        self.partners = partners  # how far down the other ends of a dock's lines are, by what is known
        self.ways: list[tuple[Way, Way]] = [self._ways(line) for line in self.lines]
        self.lowest_tier: dict[int, int] = {}
        for block, at in zip(blocks, column, strict=True):
            self.lowest_tier[at] = max(block.tier, self.lowest_tier.get(at, 0))
        self._dock()
        self._wires()
        self._place()

    def heights_of_partners(self) -> list[dict[int, float]]:
        """Give for each dock of each block how far down the lines from it lead, in the mean."""
        found: list[dict[int, list[float]]] = [{} for _ in self.blocks]
        for line, legs in zip(self.lines, self.legs, strict=True):
            (_, _, (behind, down)), (_, (before, up), _) = legs[0], legs[-1]
            found[line.tail].setdefault(line.tail_dock, []).append(self.y[behind] + down)
            found[line.head].setdefault(line.head_dock, []).append(self.y[before] + up)
        return [{dock: sum(heights) / len(heights) for dock, heights in docks.items()} for docks in found]

    # --- which lines turn where

    def _ways(self, line: Line) -> tuple[Way, Way]:
        """Say on which side of its block a line leaves the one and reaches the other."""
        tail, head = self.column[line.tail], self.column[line.head]
        leaves = self.blocks[line.tail].docks[line.tail_dock].side
        reaches = self.blocks[line.head].docks[line.head_dock].side
        to_right: Way = "E" if tail <= head else "W"
        from_left: Way = "W" if tail < head else "E"
        return (
            "E" if leaves == "right" else "W" if leaves == "left" else to_right,
            "W" if reaches == "left" else "E" if reaches == "right" else from_left,
        )

    def _dock(self) -> None:
        """Say where the docks of each block are, and how far down the member its lines meet it."""
        used: list[set[Turn]] = [set() for _ in self.blocks]
        for line, (leaves, reaches) in zip(self.lines, self.ways, strict=True):
            used[line.tail].add((line.tail_dock, leaves, line.kind))
            used[line.head].add((line.head_dock, reaches, ENDS))
        self.docked = [
            docked(block, turns, partners)
            for block, turns, partners in zip(self.blocks, used, self.partners, strict=True)
        ]
        self.heights = [one.height for one in self.docked]

    # --- wires

    def _wires(self) -> None:
        """Lead every line through channels, past the columns between; channel c lies right of column c."""
        self.tiers = [block.tier for block in self.blocks]
        self.at_column = list(self.column)
        self.widths = [block.width for block in self.blocks]
        self.passing: dict[tuple[Wire, int], int] = {}
        # of each line: the channel, the member and height where it enters it, the same where it leaves
        self.legs: list[list[tuple[int, tuple[int, float], tuple[int, float]]]] = []
        self.wire_of: list[Wire] = []
        self.label_at: list[int | None] = []
        for number, (line, (leaves, reaches)) in enumerate(zip(self.lines, self.ways, strict=True)):
            kind = line.kind if line.label is None else f"{line.kind} {number}"
            wire = (line.tail, line.tail_dock, leaves, kind)
            self.wire_of.append(wire)
            first = self.column[line.tail] - (leaves == "W")
            last = self.column[line.head] - (reaches == "W")
            passed = range(first + 1, last + 1) if first <= last else range(first, last, -1)
            labelled = passed[len(passed) // 2] if line.label is not None and passed else None
            at = (line.tail, self.docked[line.tail].meets[line.tail_dock, leaves, line.kind])
            legs = []
            channel = first
            label_at = None
            for column in passed:
                member = self._passing(wire, column)
                if column == labelled and line.label is not None:
                    label_at = member
                    self.widths[member], self.heights[member] = line.label.width, line.label.height
                there = (member, self.heights[member])
                legs.append((channel, at, there))
                at = there
                channel += 1 if first <= last else -1
            legs.append((channel, at, (line.head, self.docked[line.head].meets[line.head_dock, reaches, ENDS])))
            self.legs.append(legs)
            self.label_at.append(label_at)

    def _passing(self, wire: Wire, column: int) -> int:
        member = self.passing.get((wire, column))
        if member is None:
            member = self.passing[wire, column] = len(self.at_column)
            self.at_column.append(column)
            self.tiers.append(self._middle_tier(column))
            self.heights.append(0.0)
            self.widths.append(0.0)
        return member

    def _middle_tier(self, column: int) -> int:
        """What passes a column of blocks that have ranks goes below them."""
        return 1 + self.lowest_tier.get(column, -1)

    # --- up and down

    def _place(self) -> None:
        count, blocks = len(self.at_column), len(self.blocks)
        in_columns: list[list[int]] = [[] for _ in range(max(self.at_column, default=0) + 1)]
        for member, column in enumerate(self.at_column):
            in_columns[column].append(member)
        left, right, pulled_left, pulled_right = self._ties()
        gap = [_GAP if member < blocks or self.heights[member] else _WIRE_GAP for member in range(count)]
        # Of what crosses equally little that is taken whose lines are short; where that is cheap to find out.
        starts, most = (6, 4) if count < _SMALL else (2, 2) if count < _LARGE else (1, 1)
        self.cost = math.inf
        for order, crossings in ordered(in_columns, self.tiers, left, right, starts, most):
            y = placed(order, self.heights, gap, pulled_left, pulled_right)
            cost = _CROSSING * crossings + self._length(order, y)
            if cost < self.cost:
                self.cost, self.in_columns, self.y = cost, order, y
        self.height = max((y + height for y, height in zip(self.y, self.heights, strict=True)), default=0.0)

    def _ties(self) -> tuple[list[Ties], list[Ties], list[Pulls], list[Pulls]]:
        """Say for each member what it is tied to in the columns left and right of it, and how these pull it."""
        count, blocks = len(self.at_column), len(self.blocks)
        left: list[Ties] = [[] for _ in range(count)]
        right: list[Ties] = [[] for _ in range(count)]
        pulled_left: list[Pulls] = [[] for _ in range(count)]
        pulled_right: list[Pulls] = [[] for _ in range(count)]
        for (one, here), (other, there) in self._from_left_to_right():
            from_top, to_top = here / (self.heights[one] or 1.0), there / (self.heights[other] or 1.0)
            right[one].append((other, min(to_top, 0.999), min(from_top, 0.999)))
            left[other].append((one, min(from_top, 0.999), min(to_top, 0.999)))
            weight = (1.0, 2.0, 6.0)[(one >= blocks) + (other >= blocks)]
            pulled_right[one].append((other, here - there, weight))
            pulled_left[other].append((one, there - here, weight))
        for ties in (left, right, pulled_left, pulled_right):
            for one_ties in ties:
                one_ties.sort()  # what comes from a set has no order
        return left, right, pulled_left, pulled_right

    def _from_left_to_right(self) -> Iterator[tuple[tuple[int, float], tuple[int, float]]]:
        """Give both ends of what leads from a column into another, once each, in no order."""
        for channel, one, other in {leg for legs in self.legs for leg in legs}:
            if self.at_column[one[0]] != self.at_column[other[0]]:  # or it turns back in its channel
                yield (other, one) if self.at_column[one[0]] > channel else (one, other)

    def _length(self, order: list[list[int]], y: list[float]) -> float:
        """Say how long the upright parts of all lines are, and how high all is."""
        height = max((y[one[-1]] + self.heights[one[-1]] for one in order if one), default=0.0)
        return height / 2 + sum(
            abs(y[one] + here - y[other] - there) for legs in self.legs for _, (one, here), (other, there) in legs
        )

    # --- left and right

    def route(self) -> None:
        """Choose tracks for all lines, and with them how wide everything is."""
        trunks: dict[tuple[Wire, int], Trunk] = {}
        for wire, legs in zip(self.wire_of, self.legs, strict=True):
            for channel, *ends in legs:
                trunk = trunks.setdefault((wire, channel), Trunk(set(), set()))
                for member, down in ends:
                    is_left = self.at_column[member] == channel
                    (trunk.left if is_left else trunk.right).add(self.y[member] + down)
        last = len(self.in_columns) - 1
        by_channel: dict[int, list[Trunk]] = {}
        for (_, channel), trunk in trunks.items():
            by_channel.setdefault(channel, []).append(trunk)
        column_x: list[float] = []
        channel_x: dict[int, float] = {}
        x = 0.0
        for channel in range(-1, last + 1):
            if channel >= 0:
                column_x.append(x)
                x += max(self.widths[member] for member in self.in_columns[channel]) if self.in_columns[channel] else 0
            here = by_channel.get(channel, [])
            count = tracks(here)
            channel_x[channel] = x + _BEHIND
            if count:
                x += _BEHIND + (count - 1) * TRACK + _BEFORE
            elif 0 <= channel < last:
                x += _STRAIGHT
        self.width = x
        self.column_x = column_x
        self.column_w = [(max((self.widths[m] for m in members), default=0.0)) for members in self.in_columns]
        self.trunk_x = {key: channel_x[key[1]] + trunk.track * TRACK for key, trunk in trunks.items()}
        self.trunks = trunks

    def _block_at(self, member: int) -> Point:
        column = self.column[member]
        spare = self.column_w[column] - self.widths[member]
        rank = self.blocks[member].rank
        x = self.column_x[column] + (0.0 if rank == "first" else spare if rank == "last" else spare / 2)
        return round(x), self.y[member] + self.docked[member].upper

    # --- what comes of it

    def into(self, plan: Plan, x: float, y: float) -> None:
        """Write it into a plan, at a place."""
        for member, block in enumerate(self.members):
            left, top = self._block_at(member)
            plan.blocks[block] = (x + left, y + top)
            self.blocks[member].settle(self.docked[member].at)
        told: set[tuple[Wire, int]] = set()
        for number, index in enumerate(self.inner):
            plan.lines[index] = [(x + left, y + top) for left, top in self._corners(number)]
            wire = self.wire_of[number]
            for channel, *_ in self.legs[number]:
                if (wire, channel) not in told:
                    told.add((wire, channel))
                    plan.dots[index] += [(x + left, y + top) for left, top in self._dots(wire, channel)]
            member_at = self.label_at[number]
            if member_at is not None:
                column = self.at_column[member_at]
                left = self.column_x[column] + (self.column_w[column] - self.widths[member_at]) / 2
                plan.labels[index] = (x + left, y + self.y[member_at] + self.heights[member_at])

    def _corners(self, number: int) -> list[Point]:
        line = self.lines[number]
        found = self._at_dock(line.tail, line.tail_dock)
        for channel, (one, here), (other, there) in self.legs[number]:
            track = self.trunk_x[self.wire_of[number], channel]
            begins, ends = self.y[one] + here, self.y[other] + there
            if begins != ends:
                found += [(track, begins), (track, ends)]
            elif self.at_column[one] == self.at_column[other]:
                found.append((track, begins))
        last = self._at_dock(line.head, line.head_dock)
        if len(last) == 2:
            member = self.legs[number][-1][2]
            last[1] = (last[0][0], self.y[member[0]] + member[1])
        if len(found) >= 2 and self.blocks[line.tail].docks[line.tail_dock].side in ("top", "bottom"):
            first = self.legs[number][0][1]
            found[1] = (found[0][0], self.y[first[0]] + first[1])
        return _without_straight_corners([*found, *reversed(last)])

    def _at_dock(self, member: int, index: int) -> list[Point]:
        """Give where a dock is; on top and bottom also where its lines turn, whose height the caller knows."""
        block, dock = self.blocks[member], self.blocks[member].docks[index]
        at = self.docked[member].at[index]
        left, top = self._block_at(member)
        match dock.side:
            case "left":
                return [(left, top + at)]
            case "right":
                return [(left + block.width, top + at)]
            case "top":
                return [(left + at, top), (left + at, top)]
            case "bottom":
                return [(left + at, top + block.height), (left + at, top + block.height)]

    def _dots(self, wire: Wire, channel: int) -> Iterator[Point]:
        """Give where a trunk has three ways to go on."""
        trunk = self.trunks[wire, channel]
        if trunk.track < 0:
            return
        for y in sorted(trunk.left | trunk.right):
            if (y in trunk.left) + (y in trunk.right) + (y > trunk.top) + (y < trunk.bottom) > 2:
                yield self.trunk_x[wire, channel], y


def _without_straight_corners(points: Sequence[Point]) -> list[Point]:
    found: list[Point] = []
    for point in points:
        if found and point == found[-1]:
            continue
        if len(found) > 1:
            (x1, y1), (x2, y2) = found[-2], found[-1]
            if (x1 == x2 == point[0]) or (y1 == y2 == point[1]):
                found.pop()
        found.append(point)
    return found
