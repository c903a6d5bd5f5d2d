"""Who is above whom in each column, so that few lines cross: barycentres, then neighbours change places.

What is ordered are blocks and the places where lines pass a column; each has its ports at different heights, so a port
counts as a fraction of its block.
"""

from __future__ import annotations

import random
from bisect import bisect_right, insort
from collections.abc import Sequence

__all__ = ["Ties", "ordered"]

Ties = list[tuple[int, float, float]]
"""Of one member: its neighbours in the next column, where on them (0 to 1) and where on itself a line meets."""

_SWEEPS = 8
_SWAPS = 6
_SLACK = 1  # an order with one crossing more may have much shorter lines


def ordered(
    columns: Sequence[Sequence[int]],
    tiers: Sequence[int],
    left: Sequence[Ties],
    right: Sequence[Ties],
    starts: int = 1,
    most: int = 1,
) -> list[tuple[list[list[int]], int]]:
    """Give some of the best orders found: the members of each column from top to bottom, and how many lines cross.

    Args:
      columns: the members of each column, in the order in which they were declared.
      tiers: of each member; those of a lower one are above in any case.
      left: of each member, to the column on its left.
      right: the same on its right.
      starts: how many first orders are tried; what is found depends on it.
      most: how many are given at most.
    """
    found: dict[tuple[tuple[int, ...], ...], int] = {}
    chance = random.Random(0)  # a graph is drawn alike each time
    for start in range(starts):
        order = [list(column) for column in columns]
        for column in order:
            if start == 1:
                column.reverse()
            elif start > 1:
                chance.shuffle(column)
            column.sort(key=lambda one: tiers[one])
        _improve(order, tiers, left, right, found)
    best = sorted(found, key=lambda order: found[order])[:most]  # stable: what was found first is first
    return [
        ([list(column) for column in order], found[order]) for order in best if found[order] <= found[best[0]] + _SLACK
    ]


def _improve(
    order: list[list[int]],
    tiers: Sequence[int],
    left: Sequence[Ties],
    right: Sequence[Ties],
    found: dict[tuple[tuple[int, ...], ...], int],
) -> None:
    """Sweep forth and back, and note each order that is as good as the best so far, or nearly."""
    place = [0.0] * len(tiers)
    for column in order:
        _note(column, place)
    fewest = _crossings(order, right, place)
    found.setdefault(tuple(map(tuple, order)), fewest)
    for sweep in range(_SWEEPS):
        forth = sweep % 2 == 0
        ties = left if forth else right
        for column in order if forth else reversed(order):
            _sort(column, tiers, ties, place)
        _swap(order, tiers, left, right, place)
        crossings = _crossings(order, right, place)
        if crossings <= fewest + _SLACK:
            found.setdefault(tuple(map(tuple, order)), crossings)
        fewest = min(fewest, crossings)


def _note(column: Sequence[int], place: list[float]) -> None:
    for index, one in enumerate(column):
        place[one] = float(index)


def _sort(column: list[int], tiers: Sequence[int], ties: Sequence[Ties], place: list[float]) -> None:
    """Order a column by where its members' neighbours are; who has none stays where he is."""
    wish = {}
    known = []
    for one in column:
        if ties[one]:
            wish[one] = sum(place[other] + there - 0.001 * here for other, there, here in ties[one]) / len(ties[one])
            known.append(one)
    known.sort(key=lambda one: wish[one])
    sorted_ = iter(known)
    column[:] = [next(sorted_) if one in wish else one for one in column]
    column.sort(key=lambda one: tiers[one])
    _note(column, place)


def _swap(
    columns: Sequence[list[int]],
    tiers: Sequence[int],
    left: Sequence[Ties],
    right: Sequence[Ties],
    place: list[float],
) -> None:
    """Let neighbours in a column change places as long as lines cross less by that."""
    waiting = set(range(len(columns)))
    for _ in range(_SWAPS):
        again: set[int] = set()
        for number in sorted(waiting):
            column = columns[number]
            heights = {one: [sorted(place[o] + t for o, t, _ in ties[one]) for ties in (left, right)] for one in column}
            for index in range(len(column) - 1):
                upper, lower = column[index], column[index + 1]
                if tiers[upper] != tiers[lower]:
                    continue
                saved = 0
                for above, below in zip(heights[upper], heights[lower], strict=True):
                    saved += _above(below, above) - _above(above, below)
                if saved > 0:
                    column[index], column[index + 1] = lower, upper
                    place[upper], place[lower] = place[lower], place[upper]
                    again |= {number - 1, number, number + 1}
        waiting = again & set(range(len(columns)))
        if not waiting:
            return


def _above(one: Sequence[float], other: Sequence[float]) -> int:
    """How many pairs there are in which the first is above the second."""
    if len(one) == 1 and len(other) == 1:
        return one[0] < other[0]
    return sum(len(other) - bisect_right(other, height) for height in one)


def _crossings(columns: Sequence[Sequence[int]], right: Sequence[Ties], place: Sequence[float]) -> int:
    total = 0
    for column in columns:
        lines = sorted((place[one] + here, place[other] + there) for one in column for other, there, here in right[one])
        seen: list[float] = []
        for number, (_, there) in enumerate(lines):
            total += number - bisect_right(seen, there)
            insort(seen, there)
    return total
