"""Kalman filters: a state with its covariance, carried on in time and corrected by measurements.

An extended filter is the same, with Jacobians in the place of matrices: carry the state on by your own function, and
give `predict` and `correct` the Jacobian at the state.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval

from hfg.base.clock import now
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State
from hfg.types import Named, Shape

Vector: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None), Named("Vector")]
"""A state, or a measurement."""

Square: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, None), Named("Square")]
"""A covariance."""


def predict(state: Any, covariance: Any, transition: Any, noise: Any, *, moved: Any = None) -> tuple[Any, Any]:
    """Carry a state on in time.

    Args:
      state: n numbers.
      covariance: of it, n x n.
      transition: n x n; of an extended filter the Jacobian of its motion at the state.
      noise: what the motion adds to the covariance, n x n.
      moved: the state after the motion, if the filter is an extended one; without it, the transition moves the state.

    Returns:
      The state and its covariance.
    """
    after = transition @ state if moved is None else moved
    return after, transition @ covariance @ transition.T + noise


def correct(
    state: Any, covariance: Any, measured: Any, observation: Any, noise: Any, *, expected: Any = None
) -> tuple[Any, Any]:
    """Correct a state by a measurement.

    The covariance is computed in Joseph's form, which stays symmetric and positive in spite of rounding.

    Args:
      state: n numbers.
      covariance: of it, n x n.
      measured: m numbers.
      observation: m x n; of an extended filter the Jacobian of what is measured at the state.
      noise: covariance of the measurement, m x m.
      expected: what should be measured in this state, if the filter is an extended one; else the observation says.

    Returns:
      The state and its covariance.

    Raises:
      ValueError: the covariance of what is measured is singular or not finite.
    """
    off = measured - (observation @ state if expected is None else expected)
    spread = observation @ covariance @ observation.T + noise
    gain = np.linalg.solve(need_positive(spread), observation @ covariance).T
    left = np.eye(len(state)) - gain @ observation
    return state + gain @ off, left @ covariance @ left.T + gain @ noise @ gain.T


def need_positive(covariance: Any) -> Any:
    """Refuse a covariance that is singular.

    Raises:
      ValueError: it is.
    """
    try:
        factor = np.linalg.cholesky(covariance)
        sound = bool(np.isfinite(factor).all() and np.diag(factor).min(initial=math.inf) > 0)
    except np.linalg.LinAlgError:
        sound = False
    if not sound:
        raise ValueError(
            "the covariance of a measurement is singular or not finite, so it says nothing; give it some noise, got "
            f"{np.asarray(covariance).tolist()}"
        )
    return covariance


class KalmanFilter(Node):
    """Estimate a state from noisy measurements by a linear Kalman filter.

    Fires once per measurement: it carries the state on by one step, then corrects it. After R. Kalman, A New Approach
    to Linear Filtering and Prediction Problems (1960). The default is a place with a velocity, one step a second.

    Attributes:
      transition: how the state changes in one step, n x n.
      observation: what of the state is measured, m x n.
      process_noise: what a step adds to the covariance of the state, n x n.
      measurement_noise: covariance of a measurement, m x m.
      start: standard deviation of each part of the state before the first measurement, when it is 0.
      measured: m numbers; NaN for a step without a measurement.
      state: n numbers.
      covariance: of the state.

    Raises:
      ValueError: sizes do not fit together, or a covariance is singular or not finite.
    """

    transition = Parameter([[1.0, 1.0], [0.0, 1.0]], type=list[list[float]], unit="1")
    observation = Parameter([[1.0, 0.0]], type=list[list[float]], unit="1")
    process_noise = Parameter([[0.01, 0.0], [0.0, 0.01]], type=list[list[float]], unit="1")
    measurement_noise = Parameter([[1.0]], type=list[list[float]], unit="1")
    start = Parameter(1000.0, Interval(gt=0), unit="1")
    measured = Input(Vector)
    state = Output(Vector)
    covariance = Output(Square)

    known: State[Any] = State(None)

    def process(self, measured: Vector) -> None:
        """Carry on and correct."""
        matrices = [self.transition, self.observation, self.process_noise, self.measurement_noise]
        step, seen, adds, noise = _fitting(matrices, len(measured))
        start = np.zeros(len(step)), np.eye(len(step)) * self.start**2
        state, covariance = start if self.known is None else self.known
        with np.errstate(all="ignore"):
            known = predict(state, covariance, step, adds)
            if not np.isnan(measured).any():
                known = correct(*known, measured, seen, noise)
        if not all(np.isfinite(one).all() for one in known):
            raise ValueError(f"the state of a Kalman filter is finite, got {known[0].tolist()}")
        self.known = known
        self.state.send(known[0])
        self.covariance.send(known[1])


def _fitting(matrices: list[Any], measured: int) -> list[Any]:
    """Return matrices as arrays.

    Raises:
      ValueError: they do not fit together.
    """
    try:
        made = [np.array(one, np.float64) for one in matrices]
    except ValueError:
        made = []
    if made and made[0].ndim == 2:
        n, m = len(made[0]), measured
        if [one.shape for one in made] == [(n, n), (m, n), (n, n), (m, m)] and n > 0 and m > 0:
            return made
    raise ValueError(
        f"a state of n and a measurement of m = {measured} numbers need a transition of n x n, an observation of "
        f"m x n, and noises of n x n and m x m, got {[_size(one) for one in matrices]}"
    )


def _size(rows: Any) -> str:
    return f"{len(rows)} x {'/'.join(sorted({str(len(row)) for row in rows}))}"


class AlphaBeta(Node):
    """Smooth a value and estimate its rate of change by an alpha-beta filter.

    Fires once per value. It is a Kalman filter of a value with a rate whose gains are fixed.

    Attributes:
      alpha: how much of a deviation corrects the value.
      beta: how much of it corrects the rate.
      value: as measured; one that is not finite is left out.
      smooth: the value.
      rate: its change per second.
    """

    alpha = Parameter(0.5, Interval(gt=0, le=1), unit="1")
    beta = Parameter(0.1, Interval(ge=0, le=2), unit="1")
    value = Input(float)
    smooth = Output(float)
    rate = Output(float)

    known: State[tuple[float, float, float] | None] = State(None)

    def process(self, value: float) -> None:
        """Smooth it."""
        time = now()
        if self.known is None:
            if not math.isfinite(value):
                self.smooth.send(value)
                self.rate.send(0.0)
                return
            self.known = (value, 0.0, time)
        smooth, rate, last = self.known
        dt = time - last
        smooth += rate * dt
        off = value - smooth
        if math.isfinite(off):
            smooth += self.alpha * off
            rate += self.beta * off / dt if dt > 0 else 0.0
        self.known = (smooth, rate, time)
        self.smooth.send(smooth)
        self.rate.send(rate)
