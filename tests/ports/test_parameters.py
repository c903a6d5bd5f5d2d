"""Parameters: defaults, limits, and when they are checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

import annotated_types as at
import pytest

import hfg
from hfg.base.limits import limits_of
from hfg.errors import DeclarationError
from hfg.ports.specs import ParameterSpec


class Filter(hfg.Node):
    gain = hfg.Parameter(0.5, at.Interval(ge=0, le=1), unit="m/s")
    mode = hfg.Parameter("fast", choices=("fast", "good"))
    names = hfg.Parameter(["a"], at.Len(1, 3), type=list[str])
    steps = hfg.Parameter(4, at.MultipleOf(2))
    anything = hfg.Parameter(None)


def test_a_parameter_is_its_value_on_the_node_and_described_on_the_type() -> None:
    node = Filter(gain=1)
    assert (node.gain, node.mode, node.steps) == (1, "fast", 4)
    spec = Filter._type.parameters["gain"]
    assert (spec.type, spec.default, spec.unit, spec.limits) == (float, 0.5, "m/s", (at.Ge(0), at.Le(1)))
    assert isinstance(Filter.gain, hfg.Parameter)


@pytest.mark.parametrize(
    ("given", "wrong"),
    [
        ({"gain": 2.0}, "must be <= 1, got 2.0"),
        ({"gain": -1}, "must be >= 0, got -1"),
        ({"gain": "high"}, "must be of type float, got 'high'"),
        ({"gain": math.nan}, "must be >= 0, got nan"),
        ({"mode": "slow"}, "must be one of 'fast', 'good', got 'slow'"),
        ({"names": []}, "must have at least 1 items, got []"),
        ({"names": list("abcd")}, "must have at most 3 items"),
        ({"names": [1]}, r"must be of type list[str], got [1]"),
        ({"steps": 3}, "must be a multiple of 2, got 3"),
    ],
)
def test_limits_are_checked_when_a_node_is_made(given: dict[str, Any], wrong: str) -> None:
    with pytest.raises(ValueError, match="parameter") as caught:
        Filter(**given)
    assert str(caught.value).startswith(f'parameter "filter.{next(iter(given))}" ')
    assert wrong in str(caught.value)


@pytest.mark.rule("P8")
def test_limits_are_checked_on_every_set_and_the_old_value_stays() -> None:
    node = Filter()
    node.gain = 0.75
    port = node.ports.parameters["gain"]
    assert port.value == 0.75
    port.value = 1.0
    attempts: list[Callable[[], None]] = [
        lambda: setattr(node, "gain", 3),
        lambda: setattr(port, "value", 3),
        lambda: node._set_parameter("gain", 3),
    ]
    for refuse in attempts:
        with pytest.raises(ValueError, match=r'parameter "filter\.gain" must be <= 1, got 3'):
            refuse()
    assert node.gain == 1.0


def test_an_unknown_parameter_is_refused_with_those_that_exist() -> None:
    with pytest.raises(TypeError, match='filter has no parameter "gian"; its parameters are "gain", "mode", "names"'):
        Filter(gian=3)
    with pytest.raises(ValueError, match='no parameter "gian"'):
        Filter()._set_parameter("gian", 3)


def test_parameters_are_given_by_keyword_only() -> None:
    with pytest.raises(TypeError, match=r"Filter\(gain=\.\.\.\) takes its parameters by keyword only"):
        Filter(0.5)


def test_a_list_as_default_is_not_shared() -> None:
    one, other = Filter(), Filter()
    one.names.append("b")
    assert other.names == Filter().names == ["a"]


def test_a_default_that_breaks_its_limits_is_refused_at_once() -> None:
    with pytest.raises(DeclarationError, match='the default of parameter "gain" must be <= 1, got 7'):

        class Broken(hfg.Node):
            gain = hfg.Parameter(7, at.Le(1))


def test_what_is_no_limit_is_refused() -> None:
    with pytest.raises(DeclarationError, match="'m' is not a limit for a parameter"):
        hfg.Parameter(1.0, "m")


@pytest.mark.parametrize(
    ("limit", "good", "bad"),
    [
        (at.Gt(0), 1, 0),
        (at.Lt(0), -1, 0),
        (at.Interval(gt=0, lt=2), 1, 2),
        (at.Len(2), "ab", "a"),
        (slice(0, 2), "ab", "abc"),
        (at.MultipleOf(3), 6, 7),
        (at.Predicate(str.isidentifier), "abc", "a b"),
        (at.LowerCase, "abc", "ABC"),
        (at.IsFinite, 1.0, math.inf),
    ],
    ids=str,
)
def test_the_limits_of_annotated_types_are_understood(limit: Any, good: Any, bad: Any) -> None:
    metadata = getattr(limit, "__metadata__", (limit,))
    spec = ParameterSpec("p", Any, good, limits_of(metadata))
    assert spec.check(good) is None
    assert "must" in (spec.check(bad) or "")


def test_a_value_that_cannot_be_compared_is_told_not_thrown() -> None:
    spec = ParameterSpec("p", Any, 1, (at.Gt(0),))
    assert "cannot be compared with Gt(gt=0) (TypeError" in (spec.check("text") or "")


def test_metadata_of_others_is_left_alone() -> None:
    @hfg.node
    def scale(value: float, *, factor: Annotated[float, "a note", at.Gt(0), at.Unit("m")] = 1.0) -> float:
        return value * factor

    spec = scale()._type.parameters["factor"]
    assert (spec.type, spec.limits, spec.unit) == (float, (at.Gt(0),), "m")


def test_a_parameter_without_default_must_be_given() -> None:
    @hfg.node
    def scale(value: float, *, factor: float) -> float:
        return value * factor

    assert scale(factor=2)._process_call()(3) == 6
    with pytest.raises(TypeError, match='scale needs a value for its parameter "factor"'):
        scale()  # type: ignore[call-arg]


def test_none_as_default_allows_none() -> None:
    @hfg.node
    def scale(value: float, *, factor: float = None) -> float:  # type: ignore[assignment]  # noqa: RUF013
        return value

    assert scale()._type.parameters["factor"].type == float | None
