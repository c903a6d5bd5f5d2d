"""How far down everything is: as straight lines as the order in the columns and the room between them allow.

Column by column each member wants to be where its neighbours' lines lead straight to it. The best places that keep the
order are those of an isotonic regression, with medians rather than means: so one line of several is straight, instead
of none.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence

__all__ = ["Pulls", "placed"]

Pulls = list[tuple[int, float, float]]
"""Of one member: its neighbours, how far below its own place theirs wants to be, and how much that matters."""

_SWEEPS = 6
_SETTLING = 6
_STEP = 14.0  # smaller steps are to go
_NEARLY = 8.0  # how much more such a line is heeded
_IDLE = 0.001  # weight of staying


def placed(
    columns: Sequence[Sequence[int]],
    heights: Sequence[float],
    gap: Sequence[float],
    left: Sequence[Pulls],
    right: Sequence[Pulls],
) -> list[float]:
    """Give the upper end of each member.

    Args:
      columns: from left to right, the members of each from top to bottom.
      heights: of each member.
      gap: how far apart two neighbours are: the mean of what both want.
      left: of each member, to the column on its left.
      right: the same on its right.
    """
    place = [0.0] * len(heights)
    for column in columns:
        total = sum(heights[one] + gap[one] for one in column)
        at = -total / 2
        for one in column:
            place[one] = at
            at += heights[one] + gap[one]
    both = [one + other for one, other in zip(left, right, strict=True)]
    for sweep in range(_SWEEPS):
        forth = sweep % 2 == 0
        for column in columns if forth else reversed(columns):
            _settle(column, heights, gap, left if forth else right, place)
    for sweep in range(_SETTLING):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            _settle(column, heights, gap, both, place, straighten=sweep >= _SETTLING // 2)
    least = min(place, default=0.0)
    return [float(round(one - least)) for one in place]


def _settle(
    column: Sequence[int],
    heights: Sequence[float],
    gap: Sequence[float],
    pulls: Sequence[Pulls],
    place: list[float],
    *,
    straighten: bool = False,
) -> None:
    """Move the members of one column to the best places that keep order and room.

    To straighten is to heed most of all those lines that are nearly straight: small steps are ugly.
    """
    groups: list[tuple[list[tuple[float, float]], int, float]] = []  # wishes, how many members, where they are
    offsets = []
    offset = 0.0
    before = None
    for one in column:
        if before is not None:
            offset += heights[before] + (gap[before] + gap[one]) / 2
        before = one
        offsets.append(offset)
        here = place[one]
        wishes = sorted(
            (wish - offset, weight * _NEARLY if straighten and abs(wish - here) < _STEP else weight)
            for wish, weight in ((place[other] - below, weight) for other, below, weight in pulls[one])
        )
        wishes = wishes or [(place[one] - offset, _IDLE)]
        group = (wishes, 1, _median(wishes, place[one] - offset))
        while groups and groups[-1][2] > group[2]:
            upper = groups.pop()
            merged = upper[0]
            small = group[0]
            if len(merged) < len(small):
                merged, small = small, merged
            for wish in small:
                insort(merged, wish)
            group = (merged, upper[1] + group[1], _median(merged, (upper[2] + group[2]) / 2))
        groups.append(group)
    members = iter(zip(column, offsets, strict=True))
    for _, count, at in groups:
        for _ in range(count):
            one, offset = next(members)
            place[one] = at + offset


def _median(wishes: Sequence[tuple[float, float]], near: float) -> float:
    """Give the weighted median; if any place between two wishes is one, that which is nearest to `near`."""
    half = sum(weight for _, weight in wishes) / 2
    passed = 0.0
    for number, (wish, weight) in enumerate(wishes):
        passed += weight
        if passed > half + 1e-9:
            return wish
        if passed > half - 1e-9:
            upper = wishes[number + 1][0] if number + 1 < len(wishes) else wish
            return min(max(near, wish), upper)
    return wishes[-1][0]
