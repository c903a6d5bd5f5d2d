"""Methods of search that need no package: random, grid, differential evolution. All ask and tell by generations.

A method sees numbers from 0 to 1 and losses, nothing else; with the same seed it asks for the same candidates, however
many processes evaluate them. Depends on `space` and `losses`.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Final, Protocol

from hfg.errors import UsageError
from hfg.graph.structure.naming import suggest
from hfg.tuning.losses import Loss, best_first, dominates
from hfg.tuning.packages import CovarianceMatrix, ParzenTrees
from hfg.tuning.space import Cell

_GRID_POINTS: Final = 5
_GENERATION: Final = 8


class Method(Protocol):
    """A method of search."""

    def ask(self) -> list[list[float]]:
        """Return the next generation; nothing if there is no other."""

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """Take the losses of the whole generation that was asked for last."""


class RandomSearch:
    """Candidates at random."""

    def __init__(self, cells: Sequence[Cell], seed: int, batch: int | None, first: Sequence[float] | None) -> None:
        self._random, self._cells, self._batch = random.Random(seed), len(cells), batch or _GENERATION

    def ask(self) -> list[list[float]]:
        """Return as many as a generation has."""
        return [[self._random.random() for _ in range(self._cells)] for _ in range(self._batch)]

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """Chance learns nothing."""


class Grid:
    """Every combination: all values of a whole number or a choice, five of any other number."""

    def __init__(self, cells: Sequence[Cell], seed: int, batch: int | None, first: Sequence[float] | None) -> None:
        self._left: Iterator[tuple[float, ...]] = itertools.product(*map(_points, cells))
        self._batch = batch or _GENERATION

    def ask(self) -> list[list[float]]:
        """Return the next ones."""
        return [list(point) for point in itertools.islice(self._left, self._batch)]

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """A grid learns nothing."""


def _points(cell: Cell) -> list[float]:
    if cell.levels:
        return [(index + 0.5) / cell.levels for index in range(cell.levels)]
    return [index / (_GRID_POINTS - 1) for index in range(_GRID_POINTS)]


class DifferentialEvolution:
    """Differential evolution: a candidate moves by the difference of two others, from the best one.

    R. Storn and K. Price, Differential evolution, 1997 (best/1/bin, with a new random factor each time). With several
    scores it is GDE3 (S. Kukkonen and J. Lampinen, 2005): "the best" is one of the Pareto front, both of two candidates
    stay of which none is better, and the population is cut to its size by fronts and crowding.
    """

    def __init__(self, cells: Sequence[Cell], seed: int, batch: int | None, first: Sequence[float] | None) -> None:
        self._random, self._cells = random.Random(seed), len(cells)
        self._size = max(batch or min(max(_GENERATION, 4 * len(cells)), 24), 4)
        self._first = None if first is None else list(first)
        self._members: list[list[float]] = []
        self._losses: list[Loss] = []

    def ask(self) -> list[list[float]]:
        """Return a challenger for each member; at first, the members."""
        if self._members:
            return [self._challenger(index) for index in range(self._size)]
        columns = [self._stratified() for _ in range(self._cells)]
        members = [list(point) for point in zip(*columns, strict=True)]
        if self._first is not None:
            members[0] = self._first
        return members

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """Let each challenger take the place of its member unless that is better."""
        if not self._members:
            self._members, self._losses = [list(one) for one in candidates], list(losses)
            return
        more: list[tuple[list[float], Loss]] = []
        for index, (candidate, loss) in enumerate(zip(candidates, losses, strict=True)):
            if dominates(loss, self._losses[index]) or loss == self._losses[index]:
                self._members[index], self._losses[index] = list(candidate), loss
            elif not dominates(self._losses[index], loss):
                more.append((list(candidate), loss))
        members = self._members + [one for one, _ in more]
        known = self._losses + [loss for _, loss in more]
        kept = best_first(known)[: self._size] if more else range(self._size)
        self._members, self._losses = [members[index] for index in kept], [known[index] for index in kept]

    def _stratified(self) -> list[float]:
        """Return one number from each of as many equal parts as there are members (a Latin hypercube's column)."""
        column = [(index + self._random.random()) / self._size for index in range(self._size)]
        self._random.shuffle(column)
        return column

    def _challenger(self, index: int) -> list[float]:
        ahead = best_first(self._losses)
        fronted = [one for one in ahead if not any(dominates(other, self._losses[one]) for other in self._losses)]
        base = self._members[self._random.choice(fronted)]
        one, other = self._random.sample([each for each in range(self._size) if each != index], 2)
        factor, always = self._random.uniform(0.5, 0.9), self._random.randrange(self._cells)
        return [
            _reflected(base[cell] + factor * (self._members[one][cell] - self._members[other][cell]))
            if self._random.random() < 0.8 or cell == always
            else self._members[index][cell]
            for cell in range(self._cells)
        ]


def _reflected(unit: float) -> float:
    """Reflect a number at the limits 0 and 1, so that candidates do not crowd there."""
    unit = -unit if unit < 0 else 2 - unit if unit > 1 else unit
    return min(max(unit, 0.0), 1.0)


_Maker = Callable[[Sequence[Cell], int, int | None, Sequence[float] | None], Method]

METHODS: Final[dict[str, _Maker]] = {
    "de": DifferentialEvolution,
    "cma": CovarianceMatrix,
    "tpe": ParzenTrees,
    "grid": Grid,
    "random": RandomSearch,
}
"""By the names that users write."""


def make_method(
    name: str, cells: Sequence[Cell], *, seed: int, batch: int | None, first: Sequence[float] | None, scores: int
) -> Method:
    """Return a method of search by its name.

    Args:
      name: see `METHODS`.
      cells: the numbers of the search.
      seed: of what looks like chance.
      batch: candidates of a generation; None for what is usual.
      first: a candidate to begin with.
      scores: how many scores there are.

    Raises:
      UsageError: there is no such method, it takes one score only, or its package is not installed.
    """
    if name not in METHODS:
        raise UsageError(f'there is no method "{name}"; {suggest(name, METHODS)}')
    if name == "cma" and scores > 1:
        raise UsageError(f'method "cma" takes one score, got {scores}: use "de", which finds a Pareto front')
    return METHODS[name](cells, seed, batch, first)
