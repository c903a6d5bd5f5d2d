"""Where lines run within their channel: each net on a track of its own, so ordered that few cross.

A trunk is all that one net has in one channel. The sides on which it is entered and left determine which trunk must be
left of which.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec

from hfg.graph.drawing.layout.grid import Grid
from hfg.graph.drawing.layout.routing import End, Leg

PITCH: Final = 9.0
_NEAR: Final = 8.0  # two lines next to each other can be distinguished from here on
_OVERLAP: Final = 40  # as bad as N crossings


class _Trunk(msgspec.Struct):
    """What a net has in one channel.

    Attributes:
      low: where it comes from or goes to one side, left or up.
      high: the same on the other side.
      ports: what of both is at a port, so that it cannot move.
      track: from the left or the top, from 0.
    """

    low: set[float] = set()
    high: set[float] = set()
    ports: set[float] = set()
    track: int = -1

    @property
    def span(self) -> tuple[float, float]:
        both = self.low | self.high
        return min(both), max(both)


class Way(msgspec.Struct):
    """A line with its legs, and where each runs."""

    net: int
    legs: list[Leg]
    at: list[float]
    tail: End
    head: End


def tracks_of(ways: Sequence[Way], grid: Grid, axis: str, *, fixed: bool) -> dict[int, int]:
    """Return each way its place in all channels of one axis; also say how many tracks each channel has."""
    by_channel: dict[int, dict[int, _Trunk]] = {}
    for way in ways:
        for number, (along, strip) in enumerate(way.legs):
            if along == axis:
                trunk = by_channel.setdefault(strip, {}).setdefault(way.net, _Trunk())
                _meet(trunk, way, number, (grid.x if axis == "x" else grid.y).middle(strip))
    counts = {}
    strips = grid.x if axis == "x" else grid.y
    places: dict[tuple[int, int], float] = {}
    for strip, trunks in by_channel.items():
        counts[strip] = _tracks(list(trunks.values()))
        room = strips.width(strip)
        pitch = PITCH if not fixed else min(PITCH, room / (counts[strip] + 1))
        first = strips.middle(strip) - pitch * (counts[strip] - 1) / 2
        for net, trunk in trunks.items():
            places[strip, net] = first + pitch * trunk.track
    for way in ways:
        for number, (along, strip) in enumerate(way.legs):
            if along == axis:
                way.at[number] = places[strip, way.net]
    return counts


def _meet(trunk: _Trunk, way: Way, number: int, middle: float) -> None:
    """Note where a way comes into a channel and where it leaves it, and on which side."""
    axis = way.legs[number][0]
    for step, end in ((-1, way.tail), (1, way.head)):
        near, beyond = number + step, number + 2 * step
        here = (end.y if axis == "x" else end.x) if not 0 <= near < len(way.legs) else way.at[near]
        there = (end.x if axis == "x" else end.y) if not 0 <= beyond < len(way.legs) else way.at[beyond]
        (trunk.low if there < middle else trunk.high).add(here)
        if not 0 <= near < len(way.legs):
            trunk.ports.add(here)


def needed(count: int, least: float, pad: float) -> float:
    """Return how wide a channel with that many tracks is."""
    return max(least, PITCH * (count - 1) + 2 * pad) if count else least


def _tracks(trunks: Sequence[_Trunk]) -> int:
    """Return each trunk its track, and say how many there are."""
    upright = sorted(trunks, key=lambda one: one.span)
    count = len(upright)
    spans = [(low - _NEAR, high + _NEAR) for low, high in (one.span for one in upright)]
    wanted = [[0] * count for _ in range(count)]  # how much worse it is if the first is not left of the second
    rivals: list[list[int]] = [[] for _ in range(count)]
    for first in range(count):
        for second in range(first + 1, count):
            if spans[second][0] >= spans[first][1]:
                break  # they are sorted by where they begin
            rivals[first].append(second)
            rivals[second].append(first)
            cost = _cost(upright[second], upright[first]) - _cost(upright[first], upright[second])
            wanted[first][second], wanted[second][first] = max(cost, 0), max(-cost, 0)
    most = 0
    left_over = set(range(count))
    # A trunk that must be left of others goes first; in a circle of wishes the one that loses least.
    against = [sum(wanted[other][one] for other in rivals[one]) for one in range(count)]
    behind = [sum(wanted[one][other] for other in rivals[one]) for one in range(count)]
    while left_over:
        one = min(
            left_over,
            key=lambda one: (
                (against[one], -behind[one], one) if against[one] == 0 else (against[one] - behind[one] + 10**9, 0, one)
            ),
        )
        left_over.remove(one)
        for other in rivals[one]:
            against[other] -= wanted[one][other]
            behind[other] -= wanted[other][one]
        placed = [other for other in rivals[one] if upright[other].track >= 0]
        taken = {upright[other].track for other in placed}
        track = max((upright[other].track for other in placed if wanted[other][one]), default=-1) + 1
        while track in taken:  # to be left of those that do not mind costs nothing
            track += 1
        upright[one].track = track
        most = max(most, upright[one].track + 1)
    return most


def _cost(left: _Trunk, right: _Trunk) -> int:
    """What it costs to have the one left of the other: crossings, and lines that would lie on each other."""
    low, high = right.span
    cost = sum(low <= at <= high for at in left.high)
    low, high = left.span
    cost += sum(low <= at <= high for at in right.low)
    ends = [(at, other) for at in left.high & left.ports for other in right.low & right.ports]
    return cost + _OVERLAP * sum(abs(at - other) < _NEAR for at, other in ends)
