"""Signals: filters of streams that are sampled at a constant rate, limits of their slope, and spectra.

_filters    Butterworth, Notch, TransferFunction, LimitSlew
_spectra    fourier_transform, spectrum

A zero-order hold is `flow.SampleAndHold` with a `time.Ticker`, control with anti-windup is `values.PID`. Filters are
designed by SciPy.
"""

from __future__ import annotations

from hfg.nodes.signals._filters import Butterworth, LimitSlew, Notch, TransferFunction
from hfg.nodes.signals._spectra import fourier_transform, spectrum

__all__ = ["Butterworth", "LimitSlew", "Notch", "TransferFunction", "fourier_transform", "spectrum"]
