"""Filters of a stream of numbers: each value is filtered when it comes, and the filter remembers the ones before."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np
from annotated_types import Interval

from hfg.base.token import Token
from hfg.nodes._extras import require
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State, slot

_Section: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
"""Numerator and denominator in powers of 1/z, as long as each other; the denominator begins with 1."""


class _Filtered(Node):
    """A filter of sections in a row, each in the transposed direct form II."""

    value = Input(float)
    filtered = Output(float)

    memory: State[list[list[float]] | None] = State(None)
    design: State[Any] = State(None)

    def process(self, value: float) -> float:
        """Filter one more."""
        if not math.isfinite(value):
            raise ValueError(f"a filter would keep a value that is not finite forever, got {value}; leave it out")
        sections = self._sections()
        if self.memory is None or self.design != sections:
            self.design, self.memory = sections, self._start(sections, float(value))
        wave = float(value)
        for (above, below), held in zip(sections, self.memory, strict=True):
            out = above[0] * wave + (held[0] if held else 0.0)
            for place in range(len(held)):
                later = held[place + 1] if place + 1 < len(held) else 0.0
                held[place] = later + above[place + 1] * wave - below[place + 1] * out
            wave = out
        if not math.isfinite(wave):
            self.memory = None
            raise ValueError(
                "what the filter sends is not finite any more: it is not stable, or the values are too large"
            )
        return wave

    @slot
    def clear(self) -> None:
        """Start over with the next value."""
        self.memory = None

    def _sections(self) -> tuple[_Section, ...]:
        raise NotImplementedError

    def _start(self, sections: tuple[_Section, ...], value: float) -> list[list[float]]:
        """Return the memory of a filter that has seen nothing but this value."""
        memory = []
        for above, below in sections:
            steady = sum(above) / sum(below) * value  # stable sections without an integrator
            held, later = [0.0] * (len(above) - 1), 0.0
            for place in range(len(held), 0, -1):
                later += above[place] * value - below[place] * steady
                held[place - 1] = later
            memory.append(held)
            value = steady
        return memory


class Butterworth(_Filtered):
    """Filter a stream of numbers by a Butterworth filter: low-pass, high-pass, band-pass or band-stop.

    Fires once per value. The values must come at a constant rate. The filter begins as if it had seen the first value
    forever. After S. Butterworth, On the Theory of Filter Amplifiers (1930); scipy.signal.butter designs it.

    Attributes:
      kind: which frequencies pass: below the cutoff, above it, or between it and the upper one; "stop" lets all others
        pass.
      order: how steep it is: 20 dB per decade and order.
      cutoff: where the amplitude is down by 3 dB.
      upper: the same for the other side of a band; "low" and "high" do not use it.
      rate: how many values there are per second.
      value: finite, in any unit.
      filtered: in the same unit.
      clear: starts over with the next value.

    Raises:
      ValueError: a value is not finite, or the frequencies do not lie in order between 0 and half of the rate.
    """

    kind = Parameter("low", type=Literal["low", "high", "band", "stop"])
    order = Parameter(2, Interval(ge=1, le=8))
    cutoff = Parameter(1.0, Interval(gt=0), unit="Hz")
    upper = Parameter(2.0, Interval(gt=0), unit="Hz")
    rate = Parameter(10.0, Interval(gt=0), unit="Hz")

    def _sections(self) -> tuple[_Section, ...]:
        edges = (self.cutoff,) if self.kind in ("low", "high") else (self.cutoff, self.upper)
        return _butterworth(self.kind, self.order, edges, self.rate)


@lru_cache(maxsize=256)
def _butterworth(kind: str, order: int, edges: tuple[float, ...], rate: float) -> tuple[_Section, ...]:
    shares = [2 * edge / rate for edge in edges]
    if not all(1e-9 < low < high < 1 - 1e-9 for low, high in zip([1e-8, *shares], [*shares, 1 - 1e-8], strict=True)):
        told = " and ".join(f"{edge:g} Hz" for edge in edges)
        raise ValueError(
            f"the frequencies of a filter rise and lie between 0 and half of the rate, {rate / 2:g} Hz, got {told}"
        )
    names = {"low": "lowpass", "high": "highpass", "band": "bandpass", "stop": "bandstop"}
    signal = require("scipy.signal", "robotics")
    rows = signal.butter(order, shares if len(shares) > 1 else shares[0], names[kind], output="sos")
    return tuple((tuple(row[:3].tolist()), tuple(row[3:].tolist())) for row in rows)


class Notch(_Filtered):
    """Take one frequency out of a stream of numbers, such as mains hum or the vibration of a motor, by a notch filter.

    Fires once per value. The values must come at a constant rate. The filter begins as if it had seen the first value
    forever. It has two poles and two zeros; scipy.signal.iirnotch designs it, after S. Orfanidis, Introduction to
    Signal Processing (1996), section 11.3.

    Attributes:
      frequency: the one that is taken out.
      quality: how narrow it is: the frequency by the width of what is taken out, measured at -3 dB.
      rate: how many values there are per second.
      value: finite, in any unit.
      filtered: in the same unit.
      clear: starts over with the next value.

    Raises:
      ValueError: a value is not finite, or the frequency does not lie between 0 and half of the rate.
    """

    frequency = Parameter(2.0, Interval(gt=0), unit="Hz")
    quality = Parameter(10.0, Interval(ge=0.1, le=1e4), unit="1")
    rate = Parameter(10.0, Interval(gt=0), unit="Hz")

    def _sections(self) -> tuple[_Section, ...]:
        return _notch(self.frequency, self.quality, self.rate)


@lru_cache(maxsize=256)
def _notch(frequency: float, quality: float, rate: float) -> tuple[_Section, ...]:
    share = 2 * frequency / rate
    if not 1e-8 < share < 1 - 1e-8 or share / quality >= 1:
        raise ValueError(
            f"a notch lies between 0 and half of the rate, {rate / 2:g} Hz, and is narrower than that, got "
            f"{frequency:g} Hz with a width of {frequency / quality:g} Hz"
        )
    above, below = require("scipy.signal", "robotics").iirnotch(share, quality)
    return ((tuple(above.tolist()), tuple(below.tolist())),)


class TransferFunction(_Filtered):
    """Let a stream of numbers pass through a linear system that is given by its transfer function.

    Fires once per value. The values must come at a constant rate. The system begins at rest. A function of s becomes
    one of z by the bilinear transform (A. Tustin, 1947), which is what scipy.signal.bilinear does. The default is a lag
    of first order, 1 / (s + 1), whose time constant is 1 s.

    Attributes:
      variable: "s" for a system in continuous time, in rad/s; "z" for one in steps.
      numerator: coefficients, highest power first.
      denominator: coefficients, highest power first; not of a lower degree than the numerator.
      rate: how many values there are per second.
      value: finite; the function of time that enters.
      filtered: the function of time that leaves.
      clear: puts the system at rest.

    Raises:
      ValueError: a value or a coefficient is not finite, the numerator has a higher degree than the denominator, the
        denominator is 0, or the system is not stable and has run away.
    """

    variable = Parameter("s", type=Literal["s", "z"])
    numerator = Parameter([1.0], type=list[float], unit="1")
    denominator = Parameter([1.0, 1.0], type=list[float], unit="1")
    rate = Parameter(10.0, Interval(gt=0), unit="Hz")

    def _sections(self) -> tuple[_Section, ...]:
        return _discrete(self.variable, tuple(self.numerator), tuple(self.denominator), self.rate)

    def _start(self, sections: tuple[_Section, ...], value: float) -> list[list[float]]:
        return [[0.0] * (len(above) - 1) for above, _ in sections]


@lru_cache(maxsize=256)
def _discrete(
    variable: str, numerator: tuple[float, ...], denominator: tuple[float, ...], rate: float
) -> tuple[_Section, ...]:
    above, below = (np.trim_zeros(np.array(one, np.float64), "f") for one in (numerator, denominator))
    if not (np.isfinite(above).all() and np.isfinite(below).all() and 0 < len(below) >= len(above)):
        raise ValueError(
            "a transfer function has finite coefficients, and a denominator that is not 0 and of no lower degree than "
            f"the numerator, got {list(numerator)} / {list(denominator)}"
        )
    if not len(above):
        above = np.zeros(1)
    degree = len(below)
    if variable == "s" and degree > 1:
        with np.errstate(all="ignore"):
            above, below = require("scipy.signal", "robotics").bilinear(above, below, rate)
    if len(below) < degree or not (np.isfinite(above).all() and np.isfinite(below).all()):
        raise ValueError(f"a transfer function has a pole at 2 * rate, {2 * rate:g} rad/s; take another rate")
    above = np.concatenate([np.zeros(len(below) - len(above)), above])
    with np.errstate(all="ignore"):
        above, below = above / below[0], below / below[0]
    return ((tuple(above.tolist()), tuple(below.tolist())),)


class LimitSlew(Node):
    """Limit how fast a value rises and falls (slew): a jump becomes a ramp.

    Fires once per value; times are those of the tokens' stamps. The first value passes as it is.

    Attributes:
      rise: greatest increase in each second.
      fall: greatest decrease in each second.
      value: finite, in any unit.
      limited: in the same unit.
      clear: lets the next value pass as it is.

    Raises:
      ValueError: a value is not finite.
    """

    rise = Parameter(1.0, Interval(gt=0), unit="of the value")
    fall = Parameter(1.0, Interval(gt=0), unit="of the value")
    value = Input(float)
    limited = Output(float)

    known: State[tuple[float, float] | None] = State(None)

    def process(self, value: Token[float]) -> float:
        """Come as near to it as there is time."""
        wanted = float(value.value)
        if not math.isfinite(wanted):
            raise ValueError(f"the limit of a slope needs finite values, got {wanted}; leave it out")
        if self.known is None:
            self.known = wanted, value.stamp
            return wanted
        before, last = self.known
        dt = max(0.0, value.stamp - last)
        now = min(max(wanted, before - self.fall * dt), before + self.rise * dt)
        self.known = now, max(last, value.stamp)
        return now

    @slot
    def clear(self) -> None:
        """Forget the last value."""
        self.known = None
