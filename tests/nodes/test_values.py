"""The family `values`: constants, generators, arithmetic, formulas, vectors, conversions; see also test_values_*.py."""

from __future__ import annotations

import json
import math
import statistics
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg
from hfg.nodes import values
from hfg.testing import fire
from hfg.testing.diagrams import check, run


def result(node: Any, **inputs: Any) -> Any:
    """Fire a node once and give its only output; None if it was silent."""
    found = fire(node, **inputs).outputs
    assert len(found) <= 1
    return next(iter(found.values()), None)


def everything(node: Any) -> list[Any]:
    """Run a source that ends and give what it sent."""
    graph = hfg.Graph()
    graph.add(node)
    (output,) = node.ports.outputs.values()
    graph.connect(output, graph.output("all", object))
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "done"
    return list(report.outputs["all"])


# --- constants ---


@pytest.mark.parametrize(
    ("made", "given_as", "comes"),
    [
        (values.ConstantBool, True, True),
        (values.ConstantInt, 3, 3),
        (values.ConstantFloat, 0.5, 0.5),
        (values.ConstantText, "on", "on"),
        (values.ConstantColour, hfg.Colour(255, 128, 0), (255, 128, 0)),
        (values.ConstantVector, (1, 2.5), np.array([1.0, 2.5])),
        (values.ConstantVector, [], np.zeros(0)),
        (values.ConstantMatrix, ((1, 2), (3, 4), (5, 6)), np.array([[1.0, 2], [3, 4], [5, 6]])),
        (values.ConstantMatrix, (), np.zeros((0, 0))),
    ],
)
def test_a_constant_gives_its_value_again_and_tells_of_a_new_one(made: Any, given_as: Any, comes: Any) -> None:
    node = made()
    assert fire(node).events == []
    fired = fire(node, parameters={"value": given_as})
    np.testing.assert_array_equal(fired.outputs["out"], comes)
    assert [name for name, _ in fired.events] == ["changed"]
    np.testing.assert_array_equal(fired.events[0][1], comes)
    again = fire(node)
    np.testing.assert_array_equal(again.outputs["out"], comes)
    assert again.events == []


@pytest.mark.rule("F2", "F11")
def test_a_constant_is_a_source_with_the_rate_of_its_option() -> None:
    found = run(values.ConstantInt(value=7), options={"max_rate_hz": 50})
    assert found == {"out": "7"}
    graph = hfg.Graph()
    constant = graph.add(values.ConstantInt(value=7), max_rate_hz=2)
    graph.connect(constant.out, graph.output("all", int))
    assert hfg.run(graph, clock="virtual", until_s=1.6).outputs["all"] == [7, 7, 7, 7]


def test_a_constant_joined_with_a_stream_is_a_value_for_each_token() -> None:
    graph = hfg.Graph()
    numbers, factor, product = (
        graph.add(values.IntRange(stop=3)),
        graph.add(values.ConstantInt(value=4)),
        graph.add(values.multiply()),
    )
    graph.connect(numbers.out, product.a)
    graph.connect(factor.out, product.b)
    graph.connect(product.out, graph.output("all", float))
    report = hfg.run(graph, clock="virtual")
    assert (report.outcome, report.outputs["all"]) == ("done", [0, 4, 8])


@pytest.mark.parametrize(
    ("made", "wrong"),
    [
        (values.ConstantColour, hfg.Colour(0, 0, 256)),
        (values.ConstantMatrix, ((1.0,), (1.0, 2.0))),
        (values.ConstantVector, (10**400,)),
        (values.ConstantInt, 0.5),
    ],
)
def test_a_constant_refuses_what_it_cannot_give(made: Any, wrong: Any) -> None:
    with pytest.raises(ValueError, match=r'parameter "constant_.*\.value" must'):
        made(value=wrong)


def test_a_constant_that_is_no_number_does_not_change_all_the_time() -> None:
    node = values.ConstantFloat(value=math.nan)
    assert [fire(node).events for _ in range(3)] == [[], [], []]


@pytest.mark.parametrize(
    ("made", "given_as", "comes"),
    [
        (values.BoolOnTrigger, True, True),
        (values.IntOnTrigger, 3, 3),
        (values.FloatOnTrigger, 0.5, 0.5),
        (values.TextOnTrigger, "on", "on"),
        (values.ColourOnTrigger, hfg.Colour(255, 128, 0), (255, 128, 0)),
        (values.VectorOnTrigger, (1, 2.5), np.array([1.0, 2.5])),
        (values.MatrixOnTrigger, ((1, 2),), np.array([[1.0, 2]])),
    ],
)
def test_a_value_on_trigger_is_given_at_each_signal(made: Any, given_as: Any, comes: Any) -> None:
    ((name, value),) = fire(made(value=given_as), slot="trigger").events
    assert name == "given"
    np.testing.assert_array_equal(value, comes)


def test_replace_by_keeps_the_step_of_a_stream() -> None:
    check(values.replace_by(by="x"), value="1-2|", expected={"out": "x-x|"})
    check(values.replace_by(by=None), value="1-2|", expected={"out": ".-.|"})


# --- generators ---


@settings(max_examples=20)
@given(st.integers(-30, 30), st.integers(-30, 30), st.integers(-7, 7).filter(bool))
def test_a_range_is_that_of_python(start: int, stop: int, step: int) -> None:
    assert everything(values.IntRange(start=start, stop=stop, step=step)) == list(range(start, stop, step))
    last = stop + (1 if step > 0 else -1)
    assert everything(values.IntRange(start=start, stop=stop, step=step, closed=True)) == list(range(start, last, step))


def test_a_range_of_floats_has_no_error_that_adds_up() -> None:
    assert everything(values.FloatRange()) == [number * 0.1 for number in range(10)]
    assert everything(values.FloatRange(closed=True))[-1] == 1.0
    assert len(everything(values.FloatRange(stop=1000.0, closed=True))) == 10_001
    assert everything(values.FloatRange(start=0.3, stop=0.0, step=-0.1)) == pytest.approx([0.3, 0.2, 0.1])
    assert everything(values.FloatRange(start=1.0, stop=0.0)) == []
    assert everything(values.FloatRange(start=1.0, stop=1.0, closed=True)) == [1.0]


@pytest.mark.parametrize(
    ("made", "step"), [(values.IntRange, 0), (values.FloatRange, 0.0), (values.FloatRange, math.nan)]
)
def test_a_range_refuses_a_step_that_leads_nowhere(made: Any, step: float) -> None:
    with pytest.raises(ValueError, match="must satisfy is_not_zero"):
        made(step=step)


def test_a_linear_space_meets_both_ends() -> None:
    assert everything(values.LinearSpace(start=1.0, stop=2.0, count=5)) == [1.0, 1.25, 1.5, 1.75, 2.0]
    assert everything(values.LinearSpace(start=1.0, count=1)) == [1.0]
    assert everything(values.LinearSpace(start=-1e308, stop=1e308, count=3)) == [-1e308, 0.0, 1e308]


def test_a_list_is_given_one_by_one() -> None:
    assert everything(values.ListSource(values=[1, "a", None, 2.5], times=2)) == [1, "a", 2.5, 1, "a", 2.5]
    assert everything(values.ListSource(times=0)) == []


RANDOM: list[Any] = [
    values.RandomUniform,
    values.RandomNormal,
    values.RandomInt,
    values.RandomBool,
    values.RandomChoice,
]


@pytest.mark.parametrize("made", RANDOM)
def test_chance_is_the_same_in_every_run_and_another_with_another_seed(made: Any) -> None:
    first = everything(made(count=50))
    assert len(first) == 50
    assert everything(made(count=50)) == first
    assert everything(made(count=50, seed=1)) != first
    assert everything(made(count=50, seed=None)) != first


def test_chance_is_distributed_as_it_says() -> None:
    uniform = everything(values.RandomUniform(low=2.0, high=4.0, count=2000))
    assert 2.0 <= min(uniform) < 2.01
    assert 3.99 < max(uniform) <= 4.0
    normal = np.array(everything(values.RandomNormal(mean=5.0, sigma=2.0, count=5000)))
    assert normal.mean() == pytest.approx(5.0, abs=0.1)
    assert normal.std() == pytest.approx(2.0, abs=0.1)
    assert set(everything(values.RandomInt(low=3, high=1, count=100))) == {1, 2, 3}
    assert everything(values.RandomBool(probability=1.0, count=5)) == [True] * 5
    assert 250 < sum(everything(values.RandomBool(probability=0.3, count=1000))) < 350
    assert set(everything(values.RandomChoice(choices=["a", "b"], count=50))) == {"a", "b"}


def test_noise_is_added_and_the_same_in_every_run() -> None:
    def noisy() -> list[float]:
        node = values.AddNoise(sigma=0.5)
        return [result(node, value=10.0) for _ in range(500)]

    found = noisy()
    assert found == noisy()
    assert np.mean(found) == pytest.approx(10.0, abs=0.1)
    assert np.std(found) == pytest.approx(0.5, abs=0.05)
    assert result(values.AddNoise(sigma=0.0), value=3.0) == 3.0


@pytest.mark.parametrize(
    ("shape", "heights"),
    [
        ("sine", [0, 1, 0, -1]),
        ("square", [1, 1, -1, -1]),
        ("triangle", [0, 1, 0, -1]),
        ("sawtooth", [0, 0.5, -1, -0.5]),
    ],
)
def test_a_wave_has_its_shape(shape: Any, heights: list[float]) -> None:
    node = values.waveform(shape=shape, frequency_hz=0.5, amplitude=2.0, offset=1.0)
    assert [result(node, time_s=time) for time in (0.0, 0.5, 1.0, 1.5)] == pytest.approx([1 + 2 * h for h in heights])
    assert result(values.waveform(shape="sine", phase=0.25), time_s=0.0) == pytest.approx(1.0)


# --- arithmetic ---


@pytest.mark.parametrize(
    ("node", "inputs", "expected"),
    [
        (values.add(), {"a": 2, "b": 3}, 5),
        (values.subtract(), {"a": 2, "b": 3}, -1),
        (values.multiply(), {"a": 2, "b": 3.5}, 7.0),
        (values.divide(), {"a": 3, "b": 2}, 1.5),
        (values.modulo(), {"a": -3, "b": 2}, 1),
        (values.power(), {"a": 2, "b": 10}, 1024.0),
        (values.arithmetic(operation="+"), {"a": 7, "b": 2}, 9),
        (values.arithmetic(operation="-"), {"a": 7, "b": 2}, 5),
        (values.arithmetic(operation="*"), {"a": 7, "b": 2}, 14),
        (values.arithmetic(operation="/"), {"a": 7, "b": 2}, 3.5),
        (values.arithmetic(operation="//"), {"a": 7, "b": 2}, 3),
        (values.arithmetic(operation="%"), {"a": 7, "b": 2}, 1),
        (values.arithmetic(operation="**"), {"a": 7, "b": 2}, 49),
        (values.arithmetic(operation="min"), {"a": 7, "b": 2}, 2),
        (values.arithmetic(operation="max"), {"a": 7, "b": 2}, 7),
        (values.arithmetic(operation="atan2"), {"a": 1, "b": 0}, math.pi / 2),
        (values.arithmetic(operation="hypot"), {"a": 3, "b": 4}, 5),
        (values.arithmetic(operation="copysign"), {"a": 3, "b": -4}, -3),
        (values.bitwise(operation="and"), {"a": 6, "b": 3}, 2),
        (values.bitwise(operation="or"), {"a": 6, "b": 3}, 7),
        (values.bitwise(operation="xor"), {"a": 6, "b": 3}, 5),
        (values.sum_of(values=3), {"values": [1, 2, 3.5]}, 6.5),
        (values.product_of(values=3), {"values": [1, 2, 3.5]}, 7.0),
        (values.mean_of(values=4), {"values": [1, 2, 3, 4]}, 2.5),
        (values.smallest(values=3), {"values": [2, 1, 3]}, 1),
        (values.largest(values=3), {"values": [2, 3, 1]}, 3),
        (values.negate(), {"value": 2.5}, -2.5),
        (values.invert(), {"value": 4}, 0.25),
        (values.absolute(), {"value": -4}, 4),
        (values.degrees_of(), {"angle": math.pi}, 180.0),
        (values.radians_of(), {"angle": 180}, math.pi),
        (values.scale(factor=2.0, offset=1.0), {"value": 3}, 7.0),
        (values.clamp(upper=2.0), {"value": 3}, 2.0),
        (values.clamp(upper=2.0), {"value": -1}, 0.0),
        (values.clamp(upper=2.0), {"value": 1.5}, 1.5),
        (values.clamp(lower=3.0, upper=2.0), {"value": 2.5}, 2.0),
        (values.map_range(from_low=4.0, from_high=20.0), {"value": 12}, 50.0),
        (values.map_range(from_low=4.0, from_high=20.0), {"value": 0}, -25.0),
        (values.map_range(from_low=4.0, from_high=20.0, clamped=True), {"value": 0}, 0.0),
        (values.map_range(to_low=1.0, to_high=-1.0), {"value": 0.25}, 0.5),
        (values.round_to(step=0.5), {"value": 1.3}, 1.5),
        (values.round_to(), {"value": 2.5}, 2.0),
        (values.round_to(), {"value": math.inf}, math.inf),
        (values.deadband(), {"value": 0.05}, 0.0),
        (values.deadband(width=0.25), {"value": 0.75}, 0.5),
        (values.deadband(width=0.25), {"value": -0.75}, -0.5),
        (values.wrap_angle(unit="deg"), {"angle": 190}, -170),
        (values.wrap_angle(unit="deg"), {"angle": -180}, 180),
        (values.wrap_angle(unit="deg"), {"angle": 540}, 180),
        (values.wrap_angle(unit="deg", positive=True), {"angle": -90}, 270),
        (values.wrap_angle(unit="deg", positive=True), {"angle": -1e-30}, 0),
        (values.wrap_angle(), {"angle": 3 * math.pi / 2}, -math.pi / 2),
        (values.to_int(), {"value": 2.5}, 2),
        (values.to_int(rounding="down"), {"value": -2.5}, -3),
        (values.to_int(rounding="up"), {"value": -2.5}, -2),
        (values.to_int(rounding="towards zero"), {"value": -2.5}, -2),
        (values.to_float(), {"value": 2}, 2.0),
    ],
)
def test_what_is_calculated(node: Any, inputs: dict[str, Any], expected: float) -> None:
    assert result(node, **inputs) == pytest.approx(expected)


def test_to_float_gives_a_float() -> None:
    assert type(result(values.to_float(), value=True)) is float


@pytest.mark.parametrize(
    ("function", "at", "expected"),
    [
        ("sqrt", 9, 3),
        ("cbrt", -8, -2),
        ("square", -3, 9),
        ("exp", 0, 1),
        ("log", math.e, 1),
        ("log2", 8, 3),
        ("log10", 100, 2),
        ("sin", math.pi / 2, 1),
        ("cos", math.pi, -1),
        ("tan", math.pi / 4, 1),
        ("asin", 1, math.pi / 2),
        ("acos", 1, 0),
        ("atan", 1, math.pi / 4),
        ("sinh", 0, 0),
        ("cosh", 0, 1),
        ("tanh", 0, 0),
        ("floor", -1.5, -2),
        ("ceil", -1.5, -1),
        ("trunc", -1.5, -1),
        ("sign", -7, -1),
    ],
)
def test_functions_of_one_number(function: Any, at: float, expected: float) -> None:
    assert result(values.function_of(function=function), value=at) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("node", "inputs", "error"),
    [
        (values.divide(), {"a": 1.0, "b": 0}, ZeroDivisionError),
        (values.modulo(), {"a": 1.0, "b": 0.0}, ZeroDivisionError),
        (values.invert(), {"value": 0.0}, ZeroDivisionError),
        (values.power(), {"a": -1.0, "b": 0.5}, ValueError),
        (values.power(), {"a": 10, "b": 400}, OverflowError),
        (values.add(), {"a": 10**400, "b": 0.5}, OverflowError),
        (values.function_of(), {"value": -1.0}, ValueError),
        (values.function_of(function="exp"), {"value": 1e4}, OverflowError),
        (values.map_range(from_low=1.0), {"value": 1.0}, ZeroDivisionError),
        (values.to_int(), {"value": math.nan}, ValueError),
        (values.to_int(), {"value": math.inf}, OverflowError),
        (values.dot(), {"a": [1.0], "b": [1.0, 2.0]}, ValueError),
        (values.add_vectors(), {"vectors": [[1.0], [1.0, 2.0]]}, ValueError),
        (values.to_json(), {"value": object()}, TypeError),
        (values.to_json(), {"value": "\ud800"}, ValueError),
        (values.decode_text(), {"data": b"\xff"}, ValueError),
        (values.encode_text(encoding="ascii"), {"text": "ü"}, ValueError),
        (values.to_bool(), {"value": NotImplemented}, ValueError),
    ],
)
def test_what_cannot_be_calculated_is_the_error_that_the_description_names(
    node: Any, inputs: dict[str, Any], error: type[Exception]
) -> None:
    with pytest.raises(error):
        fire(node, **inputs)
    assert error.__name__ in (node._type.doc or "")


@given(st.floats(), st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_what_is_clamped_lies_between_the_limits(value: float, lower: float, upper: float) -> None:
    found = result(values.clamp(lower=min(lower, upper), upper=max(lower, upper)), value=value)
    assert math.isnan(found) if math.isnan(value) else min(lower, upper) <= found <= max(lower, upper)


@given(st.floats(-1e6, 1e6), st.booleans())
def test_a_wrapped_angle_has_the_same_direction(angle: float, positive: bool) -> None:
    found = result(values.wrap_angle(positive=positive), angle=angle)
    assert (0 <= found < 2 * math.pi) if positive else (-math.pi < found <= math.pi)
    assert (math.cos(found), math.sin(found)) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-6)


# --- formulas ---


@pytest.mark.parametrize(
    ("formula", "inputs", "expected"),
    [
        ("a + b", [1, 2], 3),
        ("a * 2 - b / 4", [1, 2], 1.5),
        ("-a ** 2 + +b", [3, 1], -8),
        ("a // b + a % b", [7, 2], 4),
        ("hypot(a, b) if a > 0 else 0", [3, 4], 5),
        ("hypot(a, b) if a > 0 else 0", [-3, 4], 0),
        ("1 < a < b", [2, 3], 1),
        ("a < 0 or b > 2", [2, 3], 1),
        ("not (a < 0 and b > 2)", [2, 3], 1),
        ("min(a, b, 0.5) + max(a, b)", [2, 3], 3.5),
        ("sin(pi / 2) + round(2.6) + abs(-1)", [0, 0], 5),
        (" a ", [4, 0], 4),
    ],
)
def test_a_formula_is_calculated(formula: str, inputs: list[float], expected: float) -> None:
    assert result(values.expression(formula=formula), values=inputs) == pytest.approx(expected)


def test_inputs_of_a_formula_are_letters() -> None:
    assert result(values.expression(values=4, formula="a + 10 * b + 100 * c + 1000 * d"), values=[1, 2, 3, 4]) == 4321
    with pytest.raises(
        ValueError, match=r"the formula 'a \+ d' needs the input d, but there are 3: make the node with values=4"
    ):
        fire(values.expression(values=3, formula="a + d"), values=[1, 2, 3])


@pytest.mark.parametrize(
    "formula",
    [
        "",
        "a +",
        "a = 1",
        "__import__('os')",
        "().__class__",
        "a.real",
        "a[0]",
        "[a for a in b]",
        "lambda: 1",
        "(a := 1)",
        "'x' * 9",
        "open",
        "x1",
        "sin(*a)",
        "round(a, ndigits=2)",
        "f'{a}'",
        "a @ b",
        "~a",
        "1j",
        "a if b",
        "sin()",
        "sin(" * 60 + "a" + ")" * 60,
        "-" * 100 + "a",
        "\0",
    ],
)
def test_a_formula_that_does_more_than_calculate_is_refused_where_it_is_set(formula: str) -> None:
    with pytest.raises(ValueError, match='parameter "expression.formula" must satisfy is_a_formula'):
        values.expression(formula=formula)


def test_a_formula_that_would_eat_the_machine_is_only_an_error() -> None:
    with pytest.raises(OverflowError):
        fire(values.expression(formula="9 ** 9 ** 9 ** 9"), values=[1, 2])
    with pytest.raises(ZeroDivisionError):
        fire(values.expression(formula="a / b"), values=[1, 0])
    with pytest.raises(TypeError):
        fire(values.expression(formula="sin(a, b)"), values=[1, 0])


def test_a_formula_changes_while_the_graph_runs() -> None:
    node = values.expression()
    assert result(node, values=[2, 3]) == 5
    assert fire(node, values=[2, 3], parameters={"formula": "a * b"}).outputs == {"out": 6}
    with pytest.raises(ValueError, match="is_a_formula"):
        fire(node, values=[2, 3], parameters={"formula": "exit()"})
    assert result(node, values=[2, 3]) == 6


# --- vectors ---


@pytest.mark.parametrize("vector", [[3, -4], (3.0, -4.0), np.array([3, -4]), np.array([3, -4], dtype=np.float32)])
def test_a_vector_may_be_a_list_or_an_array(vector: Any) -> None:
    assert result(values.norm(), vector=vector) == 5.0
    assert result(values.norm(order="manhattan"), vector=vector) == 7.0
    assert result(values.norm(order="maximum"), vector=vector) == 4.0
    np.testing.assert_array_equal(result(values.scale_vector(factor=2.0), vector=vector), [6.0, -8.0])
    np.testing.assert_allclose(result(values.normalize(), vector=vector), [0.6, -0.8])
    assert result(values.dot(), a=vector, b=[1, 1]) == -1.0
    np.testing.assert_array_equal(result(values.add_vectors(), vectors=[vector, [1, 1]]), [4.0, -3.0])
    assert fire(values.extremum(), values=vector).outputs == {"extremum": 3.0, "index": 0}
    assert fire(values.extremum(which="minimum"), values=vector).outputs == {"extremum": -4.0, "index": 1}


def test_an_array_with_two_axes_is_no_vector() -> None:
    with pytest.raises(TypeError, match="norm"):
        fire(values.norm(), vector=np.zeros((2, 2)))


def test_vectors_without_an_answer_are_silent() -> None:
    assert result(values.norm(), vector=[]) == 0.0
    for nothing in ([], [0.0], [math.inf], [math.nan]):
        assert result(values.normalize(), vector=nothing) is None
    assert fire(values.extremum(), values=[]).outputs == {}
    assert fire(values.extremum(), values=[math.nan]).outputs == {}
    assert fire(values.extremum(), values=[math.nan, 2]).outputs == {"extremum": 2.0, "index": 1}
    assert result(values.summarize(), values=[]) is None


def test_lengths_do_not_overflow_where_squares_would() -> None:
    assert result(values.norm(), vector=[3e200, 4e200]) == pytest.approx(5e200)
    np.testing.assert_allclose(result(values.normalize(), vector=[3e-200, 4e-200]), [0.6, 0.8])


@pytest.mark.parametrize(
    ("by", "expected"),
    [
        ("sum", 10),
        ("mean", 2.5),
        ("median", 2.5),
        ("std", math.sqrt(5 / 3)),
        ("variance", 5 / 3),
        ("minimum", 1),
        ("maximum", 4),
        ("product", 24),
    ],
)
def test_one_number_stands_for_a_vector(by: Any, expected: float) -> None:
    assert result(values.summarize(by=by), values=[1, 2, 3, 4]) == pytest.approx(expected)


def test_a_standard_deviation_is_that_of_a_sample_everywhere() -> None:
    numbers = [1.0, 2.0, 4.0, 8.5]
    wanted = statistics.stdev(numbers)
    running, window = values.Statistics(), values.WindowStatistics()
    for number in numbers:
        last, last_window = fire(running, value=number).outputs, fire(window, value=number).outputs
    assert last["std"] == pytest.approx(wanted)
    assert last_window["std"] == pytest.approx(wanted)
    assert result(values.summarize(by="std"), values=numbers) == pytest.approx(wanted)
    assert result(values.summarize(by="variance"), values=numbers) == pytest.approx(wanted**2)
    assert result(values.summarize(by="std"), values=[3.0]) == 0.0


def test_noise_of_a_vector_is_in_proportion() -> None:
    node = values.AddNoiseToVector(relative_sigma=0.1)
    found = np.array([result(node, vector=[0.0, 1.0, 100.0]) for _ in range(500)])
    assert found.std(axis=0) == pytest.approx([0.0, 0.1, 10.0], rel=0.1)
    again = values.AddNoiseToVector(relative_sigma=0.1)
    np.testing.assert_array_equal(result(again, vector=[0.0, 1.0, 100.0]), found[0])


# --- one type into another ---


@pytest.mark.parametrize(
    ("node", "text", "expected"),
    [
        (values.ParseInt(), " -12 ", -12),
        (values.ParseInt(base=16), "ff", 255),
        (values.ParseInt(base=0), "0x10", 16),
        (values.ParseInt(), "1.5", None),
        (values.ParseInt(), "9" * 5000, None),
        (values.ParseInt(base=1), "1", None),
        (values.ParseFloat(), "1.5e3", 1500.0),
        (values.ParseFloat(), "inf", math.inf),
        (values.ParseFloat(finite=True), "inf", None),
        (values.ParseFloat(finite=True), "nan", None),
        (values.ParseFloat(decimal_comma=True), "1,5", 1.5),
        (values.ParseFloat(decimal_comma=True), "1.500", None),
        (values.ParseFloat(), "1,5", None),
        (values.ParseFloat(), "", None),
        (values.ParseBool(), " Yes", True),
        (values.ParseBool(), "OFF", False),
        (values.ParseBool(), "maybe", None),
        (values.ParseJson(), '{"a": [1, null, "x"]}', {"a": [1, None, "x"]}),
        (values.ParseJson(), "[1,", None),
        (values.ParseJson(), "NaN", None),
        (values.ParseJson(), "[" * 100_000, None),
        (values.ParseJson(), "\ud800", None),
    ],
)
def test_a_text_is_read_or_signalled(node: Any, text: str, expected: Any) -> None:
    fired = fire(node, text=text)
    assert next(iter(fired.outputs.values()), None) == expected
    assert fired.events == ([("invalid", text)] if expected is None else [])


def test_null_alone_is_silent_and_no_error() -> None:
    fired = fire(values.ParseJson(), text="null")
    assert (fired.outputs, fired.events) == ({}, [])


@pytest.mark.rule("T2")
def test_an_invalid_text_is_silence_on_the_output() -> None:
    check(values.ParseInt(), text="a-z|", values={"z": "12", "Z": 12}, expected={"number": ".-Z|", "invalid": "a"})


def test_json_is_written_of_what_has_a_form_in_it() -> None:
    value = {"a": (1, 2.5), "b": np.arange(3), "c": np.float32(0.5), "d": {1}, "e": None}
    assert json.loads(result(values.to_json(), value=value)) == {
        "a": [1, 2.5],
        "b": [0, 1, 2],
        "c": 0.5,
        "d": [1],
        "e": None,
    }
    assert result(values.to_json(indent=2), value=[1]) == "[\n  1\n]"
    assert result(values.to_json(), value=math.nan) == "null"


def test_anything_is_written_as_text_or_asked_whether_it_is_true() -> None:
    assert result(values.to_text(), value="a") == "a"
    assert result(values.to_text(exact=True), value="a") == "'a'"
    assert result(values.type_name(), value=[1]) == "list"
    assert [result(values.to_bool(), value=value) for value in (0, "", [0], np.zeros(2), np.eye(2))] == [
        *(False, False, True, False, True)
    ]
    assert result(values.encode_text(), text="ü") == b"\xc3\xbc"
    assert result(values.decode_text(), data=b"\xc3\xbc") == "ü"
    assert result(values.decode_text(errors="replace"), data=b"a\xff") == "a\ufffd"
