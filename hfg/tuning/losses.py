"""Which of two candidates is better: failures first, then scores; with several scores, Pareto's order.

K. Deb, An efficient constraint handling method for genetic algorithms, 2000; K. Deb, A. Pratap, S. Agarwal and T.
Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, 2002. No dependencies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class Loss(NamedTuple):
    """How bad a candidate is.

    Attributes:
      failed: the share of its runs that failed, from 0 to 1.
      scores: smaller is better; of a candidate that failed, nothing.
    """

    failed: float
    scores: tuple[float, ...] = ()


def dominates(one: Loss, other: Loss) -> bool:
    """Return whether a candidate is better.

    It fails less often, or is better in one score and at least equal in all others.
    """
    if one.failed or other.failed:
        return one.failed < other.failed
    pairs = list(zip(one.scores, other.scores, strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def front(losses: Sequence[Loss]) -> list[int]:
    """Return the indices of the candidates that no other is better than; of equal ones, the first."""
    return [
        index
        for index, one in enumerate(losses)
        if not any(dominates(other, one) or (other == one and place < index) for place, other in enumerate(losses))
    ]


def best_first(losses: Sequence[Loss]) -> list[int]:
    """Return all indices, the best candidate first: front by front, in each of them the loneliest first."""
    left, ordered = list(range(len(losses))), list[int]()
    while left:
        chosen = [left[index] for index in front([losses[one] for one in left])]
        lonely = _distances([losses[one] for one in chosen])
        ordered += [chosen[index] for index in sorted(range(len(chosen)), key=lambda one: (-lonely[one], chosen[one]))]
        left = [one for one in left if one not in chosen]
    return ordered


def _distances(losses: Sequence[Loss]) -> list[float]:
    """Return how far each is from its neighbours along the front; its ends are infinitely far."""
    distances = [0.0] * len(losses)
    for number in range(len(losses[0].scores)):
        order = sorted(range(len(losses)), key=lambda index: losses[index].scores[number])
        width = losses[order[-1]].scores[number] - losses[order[0]].scores[number]
        distances[order[0]] = distances[order[-1]] = math.inf
        for before, index, after in zip(order, order[1:], order[2:], strict=False):
            if width > 0:
                distances[index] += (losses[after].scores[number] - losses[before].scores[number]) / width
    return distances


def as_numbers(losses: Sequence[Loss], known: Sequence[Loss]) -> list[tuple[float, ...]]:
    """Return scores for a method that knows only numbers: who failed gets more than the worst, by how often it failed.

    Args:
      losses: of the candidates.
      known: of all candidates so far, these included.
    """
    good = [one.scores for one in known if not one.failed]
    count = max((len(scores) for scores in good), default=1)
    worst = [max((scores[number] for scores in good), default=0.0) for number in range(count)]
    width = [w - min((scores[number] for scores in good), default=0.0) for number, w in enumerate(worst)]
    return [
        one.scores
        if not one.failed
        else tuple(w + max(d, 1e-9 + 0.1 * abs(w)) * (1 + one.failed) for w, d in zip(worst, width, strict=True))
        for one in losses
    ]
