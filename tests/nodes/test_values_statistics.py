"""The family `values`: what can be said of a stream of numbers."""

from __future__ import annotations

import math
import statistics
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg
from hfg.nodes import values
from hfg.testing import fire
from hfg.testing.diagrams import check

NUMBERS = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30)


def answers(node: Any, numbers: list[float]) -> list[dict[str, Any]]:
    (name,) = node.ports.inputs
    inputs: list[dict[str, Any]] = [{name: number} for number in numbers]
    return [fire(node, **one).outputs for one in inputs]


def at(*samples: tuple[float, float]) -> list[Any]:
    """Tokens of values with their stamps."""
    return [hfg.Token(value, 0, stamp) for stamp, value in samples]


@settings(max_examples=30)
@given(NUMBERS)
def test_running_statistics_are_those_of_all_numbers(numbers: list[float]) -> None:
    last = answers(values.Statistics(), numbers)[-1]
    assert last["count"] == len(numbers)
    assert last["mean"] == pytest.approx(statistics.fmean(numbers), abs=1e-6)
    wanted = statistics.stdev(numbers) if len(numbers) > 1 else 0.0
    assert last["std"] == pytest.approx(wanted, rel=1e-6, abs=1e-3)
    assert last["variance"] == pytest.approx(last["std"] ** 2)


def test_statistics_of_numbers_that_hardly_differ_are_exact() -> None:
    assert answers(values.Statistics(), [1e9 + 1, 1e9 + 2, 1e9 + 3])[-1]["variance"] == 1.0


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_statistics_begin_anew_after_a_number_that_is_none(wrong: float) -> None:
    node = values.Statistics()
    assert math.isnan(answers(node, [1, wrong, 2])[-1]["std"])
    fire(node, slot="clear")
    assert answers(node, [2, 4])[-1] == {"mean": 3.0, "std": math.sqrt(2), "variance": 2.0, "count": 2}


def test_extremes_signal_new_ones() -> None:
    check(
        values.Extremes(),
        value="3145|",
        expected={"smallest": "3111|", "largest": "3345|", "new_smallest": "31", "new_largest": "3-45"},
    )
    node = values.Extremes()
    assert answers(node, [math.nan]) == [{}]
    assert answers(node, [2, math.nan]) == [{"smallest": 2, "largest": 2}] * 2
    fire(node, slot="clear")
    assert answers(node, [7]) == [{"smallest": 7, "largest": 7}]


def test_a_sum_goes_on_and_begins_anew() -> None:
    check(values.CumulativeSum(), value="12-3|", clear="--!", expected={"total": "13-3|"})


@pytest.mark.slow
@settings(max_examples=30)
@given(NUMBERS, st.integers(1, 8))
def test_the_window_holds_the_last_numbers(numbers: list[float], size: int) -> None:
    last = numbers[-size:]
    found = answers(values.WindowStatistics(size=size), numbers)[-1]
    assert found["mean"] == pytest.approx(statistics.fmean(last), abs=1e-6)
    assert found["median"] == statistics.median(last)
    assert found["std"] == pytest.approx(statistics.stdev(last) if len(last) > 1 else 0.0, rel=1e-6, abs=1e-3)
    assert (found["smallest"], found["largest"]) == (min(last), max(last))
    assert answers(values.MovingAverage(size=size), numbers)[-1]["mean"] == found["mean"]
    assert answers(values.MovingMedian(size=size), numbers)[-1]["median"] == found["median"]


def test_a_window_that_shrinks_forgets_the_oldest_and_clear_all() -> None:
    node = values.MovingAverage(size=3)
    assert [one["mean"] for one in answers(node, [3, 6, 9, 12])] == [3, 4.5, 6, 9]
    assert fire(node, value=15.0, parameters={"size": 1}).outputs == {"mean": 15.0}
    fire(node, slot="clear")
    assert answers(node, [1]) == [{"mean": 1.0}]
    for made in (values.MovingMedian, values.WindowStatistics):
        other: Any = made()
        answers(other, [100, 200])
        fire(other, slot="clear")
        assert answers(other, [1])[0]["median"] == 1.0


def test_a_single_wrong_number_does_not_move_the_median() -> None:
    assert [one["median"] for one in answers(values.MovingMedian(size=3), [1, 1, 99, 1, 2])] == [1, 1, 1, 1, 2]


def test_a_histogram_counts_into_bins() -> None:
    node = values.Histogram(lower=0.0, upper=10.0, bins=5)
    found = answers(node, [0.0, 1.9, 2.0, 10.0, 10.1, -0.1, math.nan])
    assert found[-1]["counts"] == [2, 1, 0, 0, 1]
    assert found[0]["counts"] == [1, 0, 0, 0, 0]
    fire(node, slot="clear")
    assert answers(node, [5.0])[0]["counts"] == [0, 0, 1, 0, 0]
    assert fire(node, value=1.0, parameters={"bins": 2}).outputs == {"counts": [1, 0]}
    with pytest.raises(ValueError, match=r"the upper limit 1.0 of the histogram is not above the lower one 2.0"):
        fire(values.Histogram(lower=2.0), value=1.0)


@settings(max_examples=30)
@given(st.lists(st.floats(-1e308, 1e308), min_size=1, max_size=20), st.integers(1, 7))
def test_every_number_within_the_limits_falls_into_one_bin(numbers: list[float], bins: int) -> None:
    found = answers(values.Histogram(lower=-1e308, upper=1e308, bins=bins), numbers)[-1]
    assert sum(found["counts"]) == len(numbers)


def test_exponential_smoothing_follows_by_a_part() -> None:
    node = values.ExponentialSmoothing(alpha=0.5)
    assert [one["smooth"] for one in answers(node, [4, 8, 8])] == [4.0, 6.0, 7.0]
    fire(node, slot="clear")
    assert answers(node, [1]) == [{"smooth": 1.0}]


def test_a_low_pass_follows_a_jump_by_its_time_constant_whatever_the_rate() -> None:
    for steps in (1, 7, 100):
        samples = at((0.0, 0.0), *((2.0 * (one + 1) / steps, 1.0) for one in range(steps)))
        found = answers(values.LowPass(time_constant_s=2.0), samples)
        assert found[-1]["smooth"] == pytest.approx(1 - math.exp(-1))
    assert [one["smooth"] for one in answers(values.LowPass(time_constant_s=0.0), at((0, 1.0), (0, 5.0)))] == [1.0, 5.0]
    node = values.LowPass()
    answers(node, at((0, 1.0)))
    fire(node, slot="clear")
    assert answers(node, at((1, 9.0))) == [{"smooth": 9.0}]


def test_a_derivative_is_by_the_stamps() -> None:
    found = answers(values.Derivative(), at((0, 1.0), (0.5, 2.0), (0.5, 7.0), (2.5, 1.0)))
    assert found == [{}, {"slope": 2.0}, {}, {"slope": -0.5}]


def test_a_derivative_in_a_graph_is_silent_for_the_first() -> None:
    check(values.Derivative(), tick_s=0.5, value="1-34|", values={"A": 2.0}, expected={"slope": ".-AA|"})


def test_differences_need_no_time() -> None:
    node = values.Difference()
    assert answers(node, [1, 4, 2]) == [{}, {"difference": 3}, {"difference": -2}]
    fire(node, slot="clear")
    assert answers(node, [1]) == [{}]


def test_an_integral_is_the_area_below_straight_lines() -> None:
    node = values.Integral()
    found = answers(node, at((0, 2.0), (1, 4.0), (1, 100.0), (3, 4.0)))
    assert [one["area"] for one in found] == [0.0, 3.0, 3.0, 11.0]
    fire(node, slot="clear")
    assert answers(node, at((9, 2.0), (10, 2.0))) == [{"area": 0.0}, {"area": 2.0}]


def test_a_derivative_forgets_on_demand() -> None:
    node = values.Derivative()
    answers(node, at((0, 1.0)))
    fire(node, slot="clear")
    assert answers(node, at((1, 5.0))) == [{}]


def test_control_has_its_three_parts() -> None:
    samples = at((0, 1.0), (1, 2.0), (2, 2.0))
    assert [one["command"] for one in answers(values.PID(kp=2.0), samples)] == [2.0, 4.0, 4.0]
    assert [one["command"] for one in answers(values.PID(kp=0.0, ki=1.0), samples)] == [0.0, 2.0, 4.0]
    assert [one["command"] for one in answers(values.PID(kp=0.0, kd=1.0), samples)] == [0.0, 1.0, 0.0]


def test_the_sum_of_a_control_does_not_wind_up() -> None:
    node = values.PID(kp=0.0, ki=1.0, upper=3.0)
    high = answers(node, at(*((time, 1.0) for time in range(100))))
    assert high[-1]["command"] == 3.0
    back = answers(node, at((100, -1.0), (101, -1.0)))
    assert [one["command"] for one in back] == [2.0, 1.0]
    fire(node, slot="clear")
    assert answers(node, at((200, 1.0))) == [{"command": 0.0}]


def test_a_control_brings_a_tank_to_its_level() -> None:
    node, level = values.PID(kp=0.8, ki=0.2, lower=0.0, upper=2.0), 0.0
    for step in range(400):
        command = fire(node, error=hfg.Token(5.0 - level, 0, step * 0.1)).outputs["command"]
        level += (command - 0.1 * level) * 0.1
    assert level == pytest.approx(5.0, abs=0.05)
