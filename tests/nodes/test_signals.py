"""The family `signals`: streams filtered value by value, compared with SciPy over all of them and with formulas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import scipy.signal

import hfg
from hfg.nodes import signals
from hfg.testing import fire

WAVE = np.cumsum(np.random.default_rng(1).normal(0, 1, 300)) + 5.0


def filtered(node: Any, wave: Any) -> np.ndarray:
    return np.array([fire(node, value=float(one)).outputs["filtered"] for one in wave])


@pytest.mark.parametrize("order", [1, 2, 5])
@pytest.mark.parametrize(
    ("kind", "edges"), [("low", (2.0,)), ("high", (0.5,)), ("band", (1.0, 3.0)), ("stop", (1.0, 3.0))]
)
def test_butterworth_value_by_value_is_that_of_scipy_over_all(kind: Any, edges: tuple[float, ...], order: int) -> None:
    node = signals.Butterworth(kind=kind, order=order, cutoff=edges[0], upper=edges[-1], rate=20.0)
    name = {"low": "lowpass", "high": "highpass", "band": "bandpass", "stop": "bandstop"}[kind]
    sections = scipy.signal.butter(order, edges if len(edges) > 1 else edges[0], name, fs=20.0, output="sos")
    expected, _ = scipy.signal.sosfilt(sections, WAVE, zi=scipy.signal.sosfilt_zi(sections) * WAVE[0])
    assert np.allclose(filtered(node, WAVE), expected)


def test_at_its_cutoff_a_butterworth_lets_through_half_of_the_power() -> None:
    node = signals.Butterworth(kind="low", order=4, cutoff=2.0, rate=50.0)
    wave = np.sin(2 * math.pi * 2.0 * np.arange(400) / 50.0)
    assert np.sqrt(2 * np.mean(filtered(node, wave)[200:] ** 2)) == pytest.approx(math.sqrt(0.5), rel=1e-3)


def test_a_notch_takes_out_its_frequency_and_leaves_the_others() -> None:
    time = np.arange(500) / 100.0
    slow, hum = np.sin(2 * math.pi * 1.0 * time), np.sin(2 * math.pi * 25.0 * time)
    found = filtered(signals.Notch(frequency=25.0, quality=5.0, rate=100.0), slow + hum)
    assert np.abs(found - slow)[300:].max() < 0.02
    above, below = scipy.signal.iirnotch(25.0, 20.0, 100.0)
    state = scipy.signal.lfilter_zi(above, below) * WAVE[0]
    node = signals.Notch(frequency=25.0, quality=20.0, rate=100.0)
    assert np.allclose(filtered(node, WAVE), scipy.signal.lfilter(above, below, WAVE, zi=state)[0])


def test_a_lag_of_first_order_answers_a_step_by_an_exponential() -> None:
    node = signals.TransferFunction(numerator=[3.0], denominator=[0.5, 1.0], rate=200.0)
    time = np.arange(300) / 200.0
    assert np.abs(filtered(node, np.ones(300)) - 3 * (1 - np.exp(-time / 0.5))).max() < 0.02


def test_a_transfer_function_in_steps_is_its_difference_equation() -> None:
    node = signals.TransferFunction(variable="z", numerator=[0.2, 0.1], denominator=[2.0, -0.6, 0.4])
    expected: list[float] = []
    for k, _ in enumerate(WAVE):
        terms = 0.2 * (WAVE[k - 1] if k > 0 else 0) + 0.1 * (WAVE[k - 2] if k > 1 else 0)
        terms += 0.6 * (expected[k - 1] if k > 0 else 0) - 0.4 * (expected[k - 2] if k > 1 else 0)
        expected.append(terms / 2.0)
    assert np.allclose(filtered(node, WAVE), expected)


def test_a_second_order_system_rings_as_that_of_scipy_in_continuous_time() -> None:
    above, below = [4.0], [1.0, 0.8, 4.0]
    time, expected = scipy.signal.step((above, below), T=np.arange(400) / 50.0)
    node = signals.TransferFunction(numerator=above, denominator=below, rate=50.0)
    assert np.abs(filtered(node, np.ones(len(time))) - expected).max() < 0.05


def test_a_filter_begins_again_when_it_is_cleared_or_becomes_another_one() -> None:
    node = signals.Butterworth()
    filtered(node, WAVE)
    fire(node, slot="clear")
    assert filtered(node, [7.0, 7.0]).tolist() == pytest.approx([7.0, 7.0])


@pytest.mark.parametrize(
    ("node", "value", "message"),
    [
        (signals.Butterworth(), math.nan, "would keep a value that is not finite forever, got nan; leave it out"),
        (signals.Butterworth(cutoff=5.0), 1.0, "lie between 0 and half of the rate, 5 Hz, got 5 Hz"),
        (signals.Butterworth(kind="band", cutoff=3.0, upper=2.0), 1.0, "the frequencies of a filter rise"),
        (signals.Notch(frequency=6.0), 1.0, "a notch lies between 0 and half of the rate, 5 Hz"),
        (signals.TransferFunction(numerator=[1.0, 0.0, 0.0]), 1.0, "of no lower degree than the numerator"),
        (signals.TransferFunction(denominator=[0.0]), 1.0, "a denominator that is not 0"),
        (signals.TransferFunction(denominator=[-1.0, 20.0]), 1.0, "a pole at 2 \\* rate, 20 rad/s; take another rate"),
    ],
)
def test_what_no_filter_can_do_is_one_sentence(node: Any, value: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fire(node, value=value)


def test_a_system_that_is_not_stable_says_so_when_it_has_run_away() -> None:
    node = signals.TransferFunction(variable="z", numerator=[1.0], denominator=[1.0, -1e200])
    with pytest.raises(ValueError, match="not stable"):
        filtered(node, np.ones(9))


@hfg.node
def values(*, of: Any = ()) -> Iterator[float]:
    yield from of


def test_a_jump_becomes_a_ramp() -> None:
    graph = hfg.Graph()
    node: Any = graph.add(signals.LimitSlew(rise=2.0, fall=5.0))
    graph.connect(graph.add(values(of=[1.0] + [3.0] * 15 + [0.0] * 10), max_rate_hz=10).out, node.value)
    graph.connect(node.limited, graph.output("limited", Any))
    limited = np.array(hfg.run(graph, clock="virtual").outputs["limited"])
    assert limited[:16].tolist() == pytest.approx([min(3.0, 1.0 + 0.2 * k) for k in range(16)])
    assert limited[16:].tolist() == pytest.approx([max(0.0, 3.0 - 0.5 * (k + 1)) for k in range(10)])
    with pytest.raises(ValueError, match="needs finite values, got inf"):
        fire(signals.LimitSlew(), value=math.inf)


@pytest.mark.parametrize("count", [1, 2, 7, 64])
def test_the_transform_is_its_definition(count: int) -> None:
    wave = WAVE[:count]
    done = fire(signals.fourier_transform(rate=50.0), samples=wave.tolist()).outputs
    for frequency, found in zip(done["frequencies"], done["coefficients"], strict=True):
        expected = sum(x * np.exp(-2j * math.pi * frequency * k / 50.0) for k, x in enumerate(wave))
        assert found == pytest.approx(expected)
    assert done["frequencies"].tolist() == pytest.approx([50.0 * k / count for k in range(count // 2 + 1)])


@pytest.mark.parametrize("window", ["hann", "none"])
@pytest.mark.parametrize("count", [100, 101])
def test_a_sine_has_its_amplitude_at_its_frequency(window: Any, count: int) -> None:
    time = np.arange(count) / 50.0
    bins = [50.0 * k / count for k in (10, 30)]
    wave = 7.0 + 3.0 * np.sin(2 * math.pi * bins[0] * time + 0.4) + 0.5 * np.cos(2 * math.pi * bins[1] * time)
    done = fire(signals.spectrum(rate=50.0, window=window), samples=wave).outputs
    assert done["frequencies"][[10, 30]].tolist() == pytest.approx(bins)
    assert done["amplitudes"][[0, 10, 20, 30]].tolist() == pytest.approx([0, 3.0, 0, 0.5], abs=1e-9)
    kept = fire(signals.spectrum(rate=50.0, window=window, mean=True), samples=wave).outputs
    assert kept["amplitudes"][0] == pytest.approx(7.0)


def test_the_spectrum_is_that_of_scipy() -> None:
    for count in (64, 65):
        done = fire(signals.spectrum(rate=8.0), samples=WAVE[:count]).outputs
        frequencies, power = scipy.signal.periodogram(
            WAVE[:count], 8.0, scipy.signal.get_window("hann", count), detrend="constant", scaling="spectrum"
        )
        assert np.allclose(done["frequencies"], frequencies)
        assert np.allclose(done["amplitudes"][1 : (count + 1) // 2], np.sqrt(2 * power[1 : (count + 1) // 2]))


def test_samples_that_say_nothing_are_refused() -> None:
    for node in (signals.spectrum(), signals.fourier_transform()):
        for wrong in ([], [1.0, math.nan]):
            with pytest.raises(ValueError, match="a spectrum needs finite samples, at least one, got"):
                fire(node, samples=wrong)
