"""An extended Kalman filter whose models are functions of yours."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from annotated_types import Interval

from hfg.base.clock import now
from hfg.nodes.estimation._kalman import Square, Vector, correct, need_positive, predict
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State


def coasting(state: Vector, control: Vector, dt: float) -> Vector:
    """Return a state after some time, if its first half is a place and its second half the velocity.

    Args:
      state: as many places as velocities.
      control: is not used.
      dt: in seconds.
    """
    half = len(state) // 2
    return np.concatenate([state[:half] + dt * state[half : 2 * half], state[half:]])


def first_half(state: Vector) -> Vector:
    """Return the places of a state of places and velocities, which is what is measured of it."""
    return state[: len(state) // 2]


class ExtendedKalmanFilter(Node):
    """Estimate a state by an extended Kalman filter (EKF), from models that you give as functions.

    Fires once per measurement: the state is carried on by the time since the last one, then corrected. Jacobians that
    you do not give are differences of the functions. After A. Gelb (ed.), Applied Optimal Estimation (1974), section
    6.1. The default is a place in the plane with a velocity, of which the place is measured; this is a Kalman filter.

    Attributes:
      motion: function of the state, the control and the seconds that have passed; returns the state after them.
      measurement: function of the state; returns what should be measured.
      motion_jacobian: function of the same as `motion`; returns the derivative of its result, n x n.
      measurement_jacobian: function of the state; returns the derivative of what should be measured, m x n.
      process_noise: what a second adds to the covariance of the state, n x n.
      measurement_noise: covariance of a measurement, m x m.
      start: the state before the first measurement, n numbers.
      start_sigma: its standard deviations, n numbers.
      angles: which numbers of a measurement are angles, from 0; their differences are taken round the circle.
      gate: a measurement whose Mahalanobis distance is greater does not correct.
      measured: m numbers; NaN for none, when the state is only carried on.
      control: what the motion needs to know, such as a velocity; empty without it.
      state: n numbers.
      covariance: of the state, n x n.
      distance: Mahalanobis distance of the measurement from what was expected; NaN without one.

    Raises:
      ValueError: a function returns something of another size or not finite, sizes do not fit together, or a covariance
        is singular or not finite.
    """

    motion = Parameter(coasting, type=Callable[[Vector, Vector, float], Vector])
    measurement = Parameter(first_half, type=Callable[[Vector], Vector])
    motion_jacobian = Parameter(None, type=Callable[[Vector, Vector, float], Square] | None)
    measurement_jacobian = Parameter(None, type=Callable[[Vector], Square] | None)
    process_noise = Parameter(np.diag([0.01, 0.01, 0.1, 0.1]).tolist(), type=list[list[float]], unit="1")
    measurement_noise = Parameter([[0.01, 0.0], [0.0, 0.01]], type=list[list[float]], unit="1")
    start = Parameter([0.0, 0.0, 0.0, 0.0], type=list[float], unit="1")
    start_sigma = Parameter([100.0, 100.0, 10.0, 10.0], type=list[float], unit="1")
    angles = Parameter([], type=list[int])
    gate = Parameter(math.inf, Interval(gt=0), unit="1")
    measured = Input(Vector)
    control = Input(Vector, optional=True)
    state = Output(Vector)
    covariance = Output(Square)
    distance = Output(float)

    known: State[Any] = State(None)
    last: State[float | None] = State(None)

    def process(self, measured: Vector, control: Vector | None) -> None:
        """Carry on and correct."""
        given = np.zeros(0) if control is None else control
        step, noise = (
            self._sized(self.process_noise, len(self.start)),
            self._sized(self.measurement_noise, len(measured)),
        )
        time = now()
        dt = 0.0 if self.last is None else time - self.last
        with np.errstate(all="ignore"):
            state, covariance = self._begun() if self.known is None else self.known
            if dt > 0:
                state, covariance = self._moved(state, covariance, given, dt, step)
            distance = math.nan
            if not np.isnan(measured).any():
                state, covariance, distance = self._corrected(state, covariance, measured, noise)
        if not (np.isfinite(state).all() and np.isfinite(covariance).all()):
            raise ValueError(f"the state of an extended Kalman filter is finite, got {state.tolist()}")
        self.known, self.last = (state, covariance), time
        self.state.send(state)
        self.covariance.send(covariance)
        self.distance.send(distance)

    def _begun(self) -> tuple[Any, Any]:
        state, sigma = np.array(self.start, np.float64), np.array(self.start_sigma, np.float64)
        if state.shape != sigma.shape or not len(state):
            raise ValueError(
                f"each number of the state has a standard deviation, got {len(state)} in start and {len(sigma)} in "
                "start_sigma"
            )
        return state, np.diag(sigma**2)

    def _moved(self, state: Any, covariance: Any, control: Any, dt: float, noise: Any) -> tuple[Any, Any]:
        after = _called("motion", self.motion(state, control, dt), state.shape)
        if self.motion_jacobian is None:
            jacobian = _difference(lambda at: self.motion(at, control, dt), state, after, "motion")
        else:
            jacobian = _called("motion_jacobian", self.motion_jacobian(state, control, dt), covariance.shape)
        return predict(state, covariance, jacobian, noise * dt, moved=after)

    def _corrected(self, state: Any, covariance: Any, measured: Any, noise: Any) -> tuple[Any, Any, float]:
        expected = _called("measurement", self.measurement(state), measured.shape)
        if self.measurement_jacobian is None:
            jacobian = _difference(self.measurement, state, expected, "measurement", self.angles)
        else:
            given = self.measurement_jacobian(state)
            jacobian = _called("measurement_jacobian", given, (len(measured), len(state)))
        off = _wrapped(measured - expected, self.angles)
        spread = need_positive(jacobian @ covariance @ jacobian.T + noise)
        distance = math.sqrt(max(0.0, float(off @ np.linalg.solve(spread, off))))
        if distance > self.gate:
            return state, covariance, distance
        state, covariance = correct(state, covariance, expected + off, jacobian, noise, expected=expected)
        return state, covariance, distance

    def _sized(self, rows: Any, count: int) -> Any:
        try:
            matrix = np.array(rows, np.float64)
        except ValueError:
            matrix = np.zeros(0)
        if matrix.shape != (count, count):
            raise ValueError(
                f"a state of {len(self.start)} numbers has a process_noise of as many rows and columns, and a "
                f"measurement of m numbers a measurement_noise of m x m, got {len(rows)} rows for {count}"
            )
        return matrix


def _called(name: str, result: Any, shape: tuple[int, ...]) -> Any:
    """Return what a function has returned, as an array."""
    try:
        found = np.asarray(result, np.float64)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != shape or not np.isfinite(found).all():
        wanted = " x ".join(map(str, shape))
        size = " x ".join(map(str, found.shape))
        raise ValueError(f'the function "{name}" returns {wanted} finite numbers, got {size}: {found.tolist()!r:.100}')
    return found


def _difference(function: Any, at: Any, value: Any, name: str, angles: Any = ()) -> Any:
    """Return the Jacobian of a function by central differences."""
    columns = []
    for axis, place in zip(np.eye(len(at)), at.tolist(), strict=True):
        step = 1e-6 * max(1.0, abs(place))
        both = [_called(name, function(at + sign * step * axis), value.shape) for sign in (1, -1)]
        columns.append(_wrapped(both[0] - both[1], angles) / (2 * step))
    return np.stack(columns, 1)


def _wrapped(off: Any, angles: Any) -> Any:
    """Take some numbers round the circle."""
    if any(not 0 <= one < len(off) for one in angles):
        raise ValueError(f"angles are numbers of a measurement, from 0 to {len(off) - 1}, got {list(angles)}")
    chosen = list(angles)
    off[chosen] = np.remainder(off[chosen] + math.pi, 2 * math.pi) - math.pi
    return off
