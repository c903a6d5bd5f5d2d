"""The family `logic`: truth values, comparisons, and events that they turn into and come from."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

from hfg.nodes import logic
from hfg.testing import fire
from hfg.testing.diagrams import check, run

TF = {"T": True, "F": False}


@pytest.mark.parametrize(
    ("made", "expected"),
    [
        (logic.logical_and, [False, False, False, True]),
        (logic.logical_or, [False, True, True, True]),
        (logic.logical_xor, [False, True, True, False]),
        (logic.logical_nand, [True, True, True, False]),
        (logic.logical_nor, [True, False, False, False]),
    ],
)
def test_operations_on_two_values_have_their_truth_tables(made: Any, expected: list[bool]) -> None:
    table = list(product([False, True], repeat=2))
    assert [fire(made(), values=list(row)).outputs["out"] for row in table] == expected


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        ("and", [False, False, False, True]),
        ("or", [False, True, True, True]),
        ("xor", [False, True, True, False]),
        ("nand", [True, True, True, False]),
        ("nor", [True, False, False, False]),
        ("xnor", [True, False, False, True]),
        ("implies", [True, True, False, True]),
    ],
)
def test_the_operation_of_a_boolean_is_a_parameter(operation: Any, expected: list[bool]) -> None:
    table = list(product([False, True], repeat=2))
    assert [fire(logic.boolean(operation=operation), a=a, b=b).outputs["out"] for a, b in table] == expected


def test_an_operation_that_does_not_exist_is_refused_where_the_node_is_made() -> None:
    with pytest.raises(ValueError, match=r'parameter "boolean.operation" must be of type'):
        logic.boolean(operation="but")  # type: ignore[arg-type]  # wrong by purpose


def test_operations_take_as_many_values_as_they_are_made_for() -> None:
    assert fire(logic.logical_and(values=4), values=[True] * 4).outputs["out"] is True
    assert fire(logic.logical_and(values=4), values=[True] * 3 + [False]).outputs["out"] is False
    assert fire(logic.logical_xor(values=3), values=[True] * 3).outputs["out"] is True
    assert fire(logic.at_least(values=5, count=3), values=[True, False, True, False, True]).outputs["out"] is True
    assert fire(logic.at_least(values=5, count=4), values=[True, False, True, False, True]).outputs["out"] is False


@pytest.mark.rule("F4")
def test_an_operation_waits_for_all_values_and_ends_with_the_first_input_that_does() -> None:
    lines: dict[str, Any] = {"values[0]": "T-T-T|", "values[1]": "-TF---|"}
    found = run(logic.logical_and(), values=TF, **lines)
    assert found == {"out": "-TF---|"}


def test_not_gives_the_opposite() -> None:
    check(logic.logical_not(), value="T-F|", values=TF, expected={"out": "F-T|"})


def test_choose_gives_one_of_both() -> None:
    assert fire(logic.choose(), condition=True, if_true="a", if_false=2).outputs["out"] == "a"
    assert fire(logic.choose(), condition=False, if_true="a", if_false=2).outputs["out"] == 2


@pytest.mark.parametrize("tolerance", [0.0, 0.5])
@pytest.mark.parametrize(("a", "b"), [(1, 1), (1, 1.25), (1, 3.0), (math.inf, math.inf), (-math.inf, math.inf)])
def test_exactly_one_of_smaller_equal_and_larger_holds(a: float, b: float, tolerance: float) -> None:
    def says(operation: Any) -> bool:
        return bool(fire(logic.compare(operation=operation, tolerance=tolerance), a=a, b=b).outputs["out"])

    assert [says("<"), says("=="), says(">")].count(True) == 1
    assert says("!=") is not says("==")
    assert says("<=") is (says("<") or says("=="))
    assert says(">=") is (says(">") or says("=="))
    assert says("==") is (abs(b - a) <= tolerance if a != b else True)


def test_a_nan_is_equal_to_nothing_and_neither_smaller_nor_larger() -> None:
    operation: Any
    for operation in ("==", "<", "<=", ">", ">="):
        assert fire(logic.compare(operation=operation, tolerance=1.0), a=math.nan, b=1.0).outputs["out"] is False
    assert fire(logic.compare(operation="!="), a=math.nan, b=math.nan).outputs["out"] is True


def test_whole_numbers_of_any_size_are_compared() -> None:
    assert fire(logic.compare(operation=">"), a=10**400, b=1.5).outputs["out"] is True
    with pytest.raises(OverflowError):
        fire(logic.compare(tolerance=1.0), a=10**400, b=1.5)


def test_equal_compares_any_values() -> None:
    assert fire(logic.equal(), a=[1, "a"], b=[1, "a"]).outputs["out"] is True
    assert fire(logic.equal(), a=1, b="1").outputs["out"] is False
    assert fire(logic.equal(), a=np.ones(3), b=np.ones(3)).outputs["out"] is True
    assert fire(logic.equal(), a=np.ones(3), b=np.ones((2, 3))).outputs["out"] is False
    assert fire(logic.equal(), a=np.ones(3), b=np.ones(4)).outputs["out"] is False


def test_the_threshold_itself_is_not_above_it() -> None:
    check(logic.threshold(threshold=2), value="123|", values=TF, expected={"out": "FFT|"})


@pytest.mark.parametrize(
    ("closed", "expected"),
    [("both", "FTTTF"), ("lower", "FTTFF"), ("upper", "FFTTF"), ("neither", "FFTFF")],
)
def test_limits_belong_to_a_range_as_it_says(closed: Any, expected: str) -> None:
    node = logic.in_range(lower=2, upper=4, closed=closed)
    check(node, value="12345|", values=TF, expected={"out": expected + "|"})


def test_hysteresis_stays_between_its_limits() -> None:
    check(
        logic.Hysteresis(low=3.0, high=6.0),
        value="4565343-7|",
        values=TF,
        expected={"is_high": "FFTTFFF-T|", "rose": "--6-----7", "fell": "----3"},
    )


def test_hysteresis_that_begins_high_falls_first() -> None:
    check(
        logic.Hysteresis(low=3.0, high=6.0, initially=True),
        value="5271|",
        values=TF,
        expected={"is_high": "TFTF|", "fell": "-2-1", "rose": "--7"},
    )


def test_hysteresis_with_limits_the_wrong_way_round_says_so() -> None:
    with pytest.raises(ValueError, match=r"the low limit 3 is above the high one 2"):
        fire(logic.Hysteresis(low=3, high=2), value=1.0)


def test_a_boolean_trigger_signals_each_value() -> None:
    check(logic.BooleanTrigger(), value="TTF|", values=TF, expected={"true": "!!", "false": "--!"})


def test_trigger_if_equal_signals_which_it_is() -> None:
    check(logic.TriggerIfEqual(wanted=3), value="13a|", expected={"equal": "-3", "unequal": "1-a"})


@pytest.mark.parametrize(
    ("initially", "rising", "falling", "changed"),
    [("unknown", "----!", "--!", "--F-T"), ("false", "!---!", "--!", "T-F-T"), ("true", "----!", "--!", "--F-T")],
)
def test_edges_are_changes(initially: str, rising: str, falling: str, changed: str) -> None:
    check(
        logic.Edges(initially=initially),
        value="TTFFT|",
        values=TF,
        expected={"rising": rising, "falling": falling, "changed": changed},
    )


def test_changed_signals_what_differs_from_the_value_before() -> None:
    check(logic.Changed(), value="1121a|", expected={"changed": "1-21a"})
    check(logic.Changed(first=False), value="1121|", expected={"changed": "--21"})


def test_stable_believes_what_came_several_times() -> None:
    check(logic.Stable(count=2), value="TFTTFTFF|", values=TF, expected={"stable": "...TTTTF|"})


def test_a_toggle_is_switched_by_its_slots() -> None:
    node = logic.Toggle()
    found = [fire(node).outputs["signal"]]
    assert fire(node, slot="toggle").events == [("changed", True)]
    found.append(fire(node).outputs["signal"])
    assert fire(node, slot="turn_on").events == []
    assert fire(node, slot="turn_off").events == [("changed", False)]
    found.append(fire(node).outputs["signal"])
    assert found == [False, True, False]


def test_a_toggle_tells_of_a_parameter_that_was_set_with_the_next_value() -> None:
    node = logic.Toggle()
    assert fire(node).events == []
    fired = fire(node, parameters={"value": True})
    assert (fired.outputs, fired.events) == ({"signal": True}, [("changed", True)])


def test_a_toggle_in_a_graph_runs_until_the_time_is_over() -> None:
    found = run(logic.Toggle(), toggle="--!--!", values=TF, options={"max_rate_hz": 100})
    assert found == {"signal": "FFFTTTF", "changed": "--T--F"}


def test_a_flip_flop_remembers_and_answers() -> None:
    check(
        logic.FlipFlop(),
        ask="a-a-a-a|",
        set="-!",
        clear="-----!",
        values=TF,
        expected={"answer": "F-T-T-F|", "changed": "-T---F"},
    )
    check(logic.FlipFlop(initially=True), toggle="!-!", values=TF, expected={"changed": "F-T"})


def test_event_and_waits_for_all() -> None:
    node = logic.EventAnd(event=3)
    for number in (0, 2, 0):
        assert fire(node, slot=f"event[{number}]").events == []
    assert fire(node, slot="event[1]").events == [("all", None)]
    assert fire(node, slot="event[1]").events == []
    fire(node, slot="forget")
    assert [fire(node, slot=f"event[{number}]").events for number in (0, 2)] == [[], []]
    assert fire(node, slot="event[1]").events == [("all", None)]
