"""Means and their confidence intervals (Student 1908). No dependencies."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Final, NamedTuple

_T_95: Final = (
    *(12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228),
    *(2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086),
    *(2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042),
)
"""The 97.5 % quantile of Student's distribution with 1 to 30 degrees of freedom."""


class Mean(NamedTuple):
    """A mean.

    Attributes:
      value: the mean.
      within: half the width of its 95 % confidence interval; nan for fewer than two values.
      runs: how many values.
    """

    value: float
    within: float
    runs: int

    def __str__(self) -> str:
        """Return the mean with as many digits as the interval leaves sense in."""
        if not math.isfinite(self.within):
            return f"{self.value:.5g}"
        return f"{self.value:.4g} ± {self.within:.2g}"


def mean_of(values: Sequence[float]) -> Mean:
    """Return the mean of values, and half the width of its 95 % confidence interval if they are normal."""
    if not values:
        return Mean(math.nan, math.nan, 0)
    middle = statistics.fmean(values)
    if len(values) < 2:
        return Mean(middle, math.nan, len(values))
    spread = statistics.stdev(values) / math.sqrt(len(values))
    return Mean(middle, _t_95(len(values) - 1) * spread, len(values))


def paired(ones: Sequence[float], others: Sequence[float]) -> Mean:
    """Return the mean of the differences of pairs, such as of runs with the same seed: one minus other."""
    return mean_of([one - other for one, other in zip(ones, others, strict=True)])


def _t_95(freedom: int) -> float:
    if freedom <= len(_T_95):
        return _T_95[freedom - 1]
    z = statistics.NormalDist().inv_cdf(0.975)
    return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)  # Cornish and Fisher
