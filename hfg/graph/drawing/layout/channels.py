"""Where lines run up and down between two columns: each on a track of its own, so ordered that few cross.

A wire is all that runs together: the lines of one kind from one dock. In each channel between two columns it has at
most one upright part, the trunk, from which it leaves to both sides.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

__all__ = ["Trunk", "tracks"]

_NEAR = 6.0  # two lines beside each other are told apart from here on
_OVERLAP = 40  # as bad as so many crossings


class Trunk(msgspec.Struct):
    """The part of a wire in one channel.

    Attributes:
      left: the heights at which it comes from or goes to the left.
      right: the same to the right.
      track: from the left, from 0; -1 if it runs straight through.
    """

    left: set[float]
    right: set[float]
    track: int = -1

    @property
    def top(self) -> float:
        """Where it begins."""
        return min(self.left | self.right)

    @property
    def bottom(self) -> float:
        """Where it ends."""
        return max(self.left | self.right)


def tracks(trunks: Sequence[Trunk]) -> int:
    """Give each trunk its track, and say how many there are."""
    upright = sorted((one for one in trunks if one.bottom > one.top), key=lambda one: (one.top, one.bottom))
    count = len(upright)
    spans = [(one.top - _NEAR, one.bottom + _NEAR) for one in upright]
    wanted = [[0] * count for _ in range(count)]  # how much worse it is if the first is not left of the second
    rivals: list[list[int]] = [[] for _ in range(count)]
    for first in range(count):
        for second in range(first + 1, count):
            if spans[second][0] >= spans[first][1]:
                break  # they are sorted by their upper ends
            rivals[first].append(second)
            rivals[second].append(first)
            cost = _cost(upright[second], upright[first]) - _cost(upright[first], upright[second])
            wanted[first][second], wanted[second][first] = max(cost, 0), max(-cost, 0)
    most = 0
    done: list[int] = []
    left_over = set(range(count))
    # What must be left of others goes first; in a circle of wishes that which loses least.
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
        taken = [upright[other].track for other in rivals[one] if upright[other].track >= 0]
        upright[one].track = max(taken, default=-1) + 1
        most = max(most, upright[one].track + 1)
        done.append(one)
    return most


def _cost(left: Trunk, right: Trunk) -> int:
    """What it costs to have the one left of the other: crossings, and lines that would lie on each other."""
    top, bottom = right.top, right.bottom
    cost = sum(top <= y <= bottom for y in left.right)
    top, bottom = left.top, left.bottom
    cost += sum(top <= y <= bottom for y in right.left)
    return cost + _OVERLAP * sum(abs(y - other) < _NEAR for y in left.right for other in right.left)
