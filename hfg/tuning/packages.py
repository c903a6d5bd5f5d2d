"""Methods of search by packages: CMA-ES by `cma`, tree-structured Parzen estimators by `optuna`.

The packages are imported when a method is made; both are extras. Depends on `space` and `losses`.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final

from hfg.errors import UsageError
from hfg.tuning.losses import Loss, as_numbers
from hfg.tuning.space import Cell

_GENERATION: Final = 8
_PARZEN_GENERATION: Final = 4
_LARGEST_SEED: Final = 2**31 - 1


class CovarianceMatrix:
    """CMA-ES: candidates around a mean, by a normal distribution that learns which way leads down.

    N. Hansen and A. Ostermeier, Completely derandomized self-adaptation in evolution strategies, 2001. When it can
    learn nothing more, it restarts with the mean elsewhere.
    """

    def __init__(self, cells: Sequence[Cell], seed: int, batch: int | None, first: Sequence[float] | None) -> None:
        self._cma = _package("cma", "tune", "cma")
        self._cells, self._seed = cells, seed
        self._batch = max(batch or _GENERATION, 4)
        self._known: list[Loss] = []
        self._begins = 0
        self._strategy = self._begin([0.5] * len(cells) if first is None else list(first))

    def _begin(self, mean: list[float]) -> Any:
        self._begins += 1
        seed = (self._seed * 1000 + self._begins) % _LARGEST_SEED + 1  # 0 would mean the time of day
        # cma needs two cells at least, so a single one gets a second without influence.
        mean = mean if len(mean) > 1 else [*mean, 0.5]
        options = {"seed": seed, "bounds": [0, 1], "popsize": self._batch, "verbose": -9}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return self._cma.CMAEvolutionStrategy([min(max(one, 0.0), 1.0) for one in mean], 0.25, options)

    def ask(self) -> list[list[float]]:
        """Return the next generation."""
        if self._strategy.stop():
            import random

            again = random.Random(self._seed * 1000 + self._begins)
            self._strategy = self._begin([again.random() for _ in self._cells])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._asked = self._strategy.ask()
        return [[float(unit) for unit in one[: len(self._cells)]] for one in self._asked]

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """Learn from the generation."""
        self._known += losses
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._strategy.tell(self._asked, [numbers[0] for numbers in as_numbers(losses, self._known)])


class ParzenTrees:
    """Tree-structured Parzen estimators: where good candidates lie densely and bad ones do not; good for choices.

    J. Bergstra, R. Bardenet, Y. Bengio and B. Kégl, Algorithms for hyper-parameter optimization, 2011.
    """

    def __init__(self, cells: Sequence[Cell], seed: int, batch: int | None, first: Sequence[float] | None) -> None:
        self._optuna = _package("optuna", "tpe", "tpe")
        self._optuna.logging.set_verbosity(self._optuna.logging.ERROR)
        self._batch, self._seed = batch or _PARZEN_GENERATION, seed
        self._study: Any = None
        self._first = None if first is None else list(first)
        self._cells = cells
        self._known: list[Loss] = []
        self._trials: list[Any] = []

    def ask(self) -> list[list[float]]:
        """Return the next generation."""
        if self._study is None:  # the number of scores is known when the first results arrive
            import random

            chance = random.Random(self._seed)
            asked = [[chance.random() for _ in self._cells] for _ in range(self._batch)]
            if self._first is not None:
                asked[0] = self._first
            return asked
        self._trials = [self._study.ask(self._distributions()) for _ in range(self._batch)]
        return [self._units(trial.params) for trial in self._trials]

    def tell(self, candidates: Sequence[Sequence[float]], losses: Sequence[Loss]) -> None:
        """Learn from the generation."""
        self._known += losses
        numbers = as_numbers(losses, self._known)
        if self._study is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of parts that the package calls experimental
                sampler = self._optuna.samplers.TPESampler(seed=self._seed, multivariate=True, constant_liar=True)
            self._study = self._optuna.create_study(directions=["minimize"] * len(numbers[0]), sampler=sampler)
            for candidate, values in zip(candidates, numbers, strict=True):
                parameters = {
                    str(index): int(unit * cell.options) if cell.options else unit
                    for index, (cell, unit) in enumerate(zip(self._cells, candidate, strict=True))
                }
                trial = self._optuna.trial.create_trial(
                    params=parameters, distributions=self._distributions(), values=list(values)
                )
                self._study.add_trial(trial)
            return
        for trial, values in zip(self._trials, numbers, strict=True):
            self._study.tell(trial, list(values))

    def _distributions(self) -> dict[str, Any]:
        kinds = self._optuna.distributions
        return {
            str(index): kinds.CategoricalDistribution(range(cell.options))
            if cell.options
            else kinds.FloatDistribution(0.0, 1.0)
            for index, cell in enumerate(self._cells)
        }

    def _units(self, parameters: dict[str, Any]) -> list[float]:
        found = []
        for index, cell in enumerate(self._cells):
            number = parameters[str(index)]
            found.append((number + 0.5) / cell.options if cell.options else float(number))
        return found


def _package(module: str, extra: str, method: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(
            f'method "{method}" needs the package {error.name or module}: pip install "hfg[{extra}]", or use "de", '
            "which needs none"
        ) from None
