"""Spectra: which frequencies samples consist of."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.nodes.values.vectors import Vector
from hfg.nodetypes.functions import node
from hfg.types import Named, Shape

Numbers: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None), Named("Numbers")]
"""One number each."""

Complex: TypeAlias = Annotated[npt.NDArray[np.complex128], Shape(None), Named("Complex")]
"""One complex number each."""

Rate = Annotated[float, Interval(gt=0), Unit("Hz")]


def _needed(samples: Any) -> Any:
    wave = np.asarray(samples if isinstance(samples, np.ndarray) else list(samples), np.float64)
    if not (len(wave) and np.isfinite(wave).all()):
        raise ValueError(f"a spectrum needs finite samples, at least one, got {len(wave)}: {wave[:3].tolist()}")
    return wave


@node(outputs={"frequencies": Numbers, "coefficients": Complex})
def fourier_transform(samples: Vector, *, rate: Rate = 10.0) -> tuple[Any, Any]:
    """Return the discrete Fourier transform of real samples (1-D FFT).

    Fires once per set of samples, such as those of `flow.Window`. The coefficient of frequency f is the sum of all
    samples x[k] exp(-2 pi i f k / rate).

    Args:
      samples: at a constant rate, in any unit.
      rate: how many samples there are per second.

    Returns:
      frequencies: from 0 to half of the rate, in Hz.
      coefficients: one for each frequency, in the unit of the samples.

    Raises:
      ValueError: there are no samples, or one is not finite or too large.
      OverflowError: a whole number is too large for a float.
    """
    wave = _needed(samples)
    with np.errstate(all="ignore"):
        found = np.fft.rfft(wave)
    if not np.isfinite(found).all():
        raise ValueError("the samples are so large that their sum is not finite")
    return np.fft.rfftfreq(len(wave), 1 / rate), found


@node(outputs={"frequencies": Numbers, "amplitudes": Numbers})
def spectrum(
    samples: Vector, *, rate: Rate = 10.0, window: Literal["hann", "none"] = "hann", mean: bool = False
) -> tuple[Any, Any]:
    """Return the amplitude spectrum of samples: how strong the vibration is at each frequency.

    Fires once per set of samples, such as those of `flow.Window`. A sine of amplitude A at one of the frequencies has
    the value A there. A window lets frequencies that lie between two of them leak less (F. Harris, On the Use of
    Windows for Harmonic Analysis with the Discrete Fourier Transform, 1978).

    Args:
      samples: at a constant rate, in any unit.
      rate: how many samples there are per second.
      window: "hann" fades the samples in and out.
      mean: keep the mean of the samples, which is at frequency 0; else it is taken off first.

    Returns:
      frequencies: from 0 to half of the rate, in Hz.
      amplitudes: one for each frequency, in the unit of the samples.

    Raises:
      ValueError: there are no samples, or one is not finite or too large.
      OverflowError: a whole number is too large for a float.
    """
    wave = _needed(samples)
    count = len(wave)
    # of n samples and not n - 1, so that frequencies of whole turns stay apart
    weights = (
        0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count) / count) if window == "hann" and count > 2 else np.ones(count)
    )
    with np.errstate(all="ignore"):
        found = np.abs(np.fft.rfft((wave if mean else wave - wave.mean()) * weights)) / weights.sum()
    if not np.isfinite(found).all():
        raise ValueError("the samples are so large that their sum is not finite")
    found[1 : (count + 1) // 2] *= 2  # the other half is at negative frequencies
    return np.fft.rfftfreq(count, 1 / rate), found
