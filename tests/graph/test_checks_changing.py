"""The check that finds code which changes what it takes (rule T1)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.types import Array

pytestmark = pytest.mark.rule("T1")


def writes(image: Array) -> Array:
    image[0] = 1
    return image


def writes_deep_inside(frame: Any) -> Any:
    frame.pixels[0][1] = 1
    return frame


def adds_in_place(image: Array) -> Array:
    image[1:] += 1
    return image


def deletes(values: dict[str, int]) -> int:
    del values["a"]
    return len(values)


def sorts(values: list[int]) -> int:
    values.sort()
    return values[0]


def writes_the_result_into_it(image: Array) -> Array:
    np.negative(image, out=image)
    return image


def sets_a_field(frame: Any) -> Any:
    frame.stamp = 3
    return frame


async def writes_later(image: Array) -> Array:
    image[0] = 1
    return image


@pytest.mark.parametrize(
    "function",
    [
        writes,
        writes_deep_inside,
        adds_in_place,
        deletes,
        sorts,
        writes_the_result_into_it,
        sets_a_field,
        writes_later,
    ],
)
def test_code_that_changes_what_it_takes_is_a_warning(function: Callable[..., Any]) -> None:
    graph = hfg.Graph()
    graph.add(hfg.node(function)(), name="changer")
    graph.add(hfg.node(function)(), name="again")
    (found,) = [one for one in graph.check() if one.check == "changes-input" and one.path == "changer"]
    name = next(iter(function.__annotations__))
    assert found.severity == "warning"
    assert found.what == f'its code changes what it takes by "{name}"'
    line = function.__code__.co_firstlineno + 1
    assert found.remedy.startswith(f"change a copy in line {line}, as in {name} = {name}.copy()")


def copies_first(image: Array) -> Array:
    image = image.copy()
    image[0] = 1
    return image


def writes_into_its_own(image: Array) -> Array:
    result = np.zeros_like(image)
    result[0] = image[0]
    return result


def uses_the_result(values: list[int], more: dict[str, int]) -> int:
    return more.get("a", 0) + min(values)


def adds_numbers(value: int) -> int:
    value += 1
    return value


def sends_a_token(value: hfg.Token[int]) -> int:
    return value.value


@pytest.mark.parametrize(
    "function", [copies_first, writes_into_its_own, uses_the_result, adds_numbers, sends_a_token, np.add]
)
def test_code_that_changes_nothing_is_left_alone(function: Callable[..., Any]) -> None:
    graph = hfg.Graph()
    graph.add(hfg.node(function)())
    assert [one for one in graph.check() if one.check == "changes-input"] == []


def test_a_class_may_write_on_itself_and_not_into_what_it_takes() -> None:
    class Sums(hfg.Node):
        total = hfg.State(0)

        def process(self, values: list[int]) -> int:
            self.total += sum(values)
            values.append(self.total)
            return self.total

    graph = hfg.Graph()
    graph.add(Sums())
    (found,) = [one for one in graph.check() if one.check == "changes-input"]
    assert found.path == "sums"
    assert 'by "values"' in found.what
