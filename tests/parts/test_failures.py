"""What has failed in one process is answered for in another (rules X1, L4)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import hfg
from hfg.errors import FiringTimeout, NodeError
from tests.semantics.nodes import drive

Picture = npt.NDArray[np.uint8]


@hfg.node
def numbers(*, count: int = 4) -> Iterator[int]:
    yield from range(count)


@hfg.node
def picture(value: int) -> Picture:
    return np.full((4, 6, 3), value, np.uint8)


@hfg.node
def loose(value: int) -> Any:
    return object()


class Broken(ValueError):
    """An error of a user's own."""


@hfg.node
def faulty(value: int, image: Picture, thing: Any) -> int:
    if value % 2:
        raise Broken(f"{value} is odd")
    return value


@hfg.node
async def slow(value: int) -> int:
    await asyncio.sleep(10.0)
    return value


class Watch(hfg.Node):
    """Keeps what it hears of failures."""

    out = hfg.Output(int)
    failure = hfg.Input(hfg.Failure)
    seen: list[hfg.Failure] = []  # noqa: RUF012 - of the test, which has no other way in

    def process(self, failure: hfg.Failure) -> int:
        self.seen.append(failure)
        return failure.taken["value"]  # type: ignore[no-any-return]


@pytest.fixture
def seen() -> Iterator[list[hfg.Failure]]:
    Watch.seen.clear()
    yield Watch.seen
    Watch.seen.clear()


def watched() -> hfg.Graph:
    graph = hfg.Graph("watched")
    graph.group("far", process=True)
    source, image, thing = graph.add(numbers(), max_rate_hz=10), graph.add(picture()), graph.add(loose(), group="far")
    works = graph.add(faulty(), group="far", on_error="skip")
    watch = graph.add(Watch())
    graph.connect(source.out, image.value)
    graph.connect(source.out, thing.value)
    graph.connect(source.out, works.value)
    graph.connect(image.out, works.image)
    graph.connect(thing.out, works.thing)
    graph.connect(works.failed, watch.failure)
    graph.connect(watch.out, graph.output("out", int))
    return graph


@pytest.mark.rule("X1", "L4")
def test_a_failure_crosses_with_what_was_taken_and_without_what_cannot(seen: list[hfg.Failure]) -> None:
    graph = watched()
    assert [problem for problem in graph.check() if problem.severity == "error"] == []
    assert hfg.run(graph, clock="virtual").outputs == {"out": [1, 3]}
    error, taken = seen[0]
    assert type(error) is NodeError
    assert (error.path, error.what) == ("faulty", "firing 2")
    assert str(error) == 'node "faulty" failed in firing 2: Broken: 1 is odd'
    assert error.__cause__ is None
    assert taken.keys() == {"value", "image"}
    assert np.array_equal(taken["image"], np.full((4, 6, 3), 1, np.uint8))
    where, left_out = error.__notes__
    assert where.startswith("in another process:\n")
    assert "raise Broken" in where
    assert "hfg/engine" not in where
    assert left_out.startswith('"thing" is not among what it had taken: ')
    assert "Any cannot be sent" in left_out


@pytest.mark.rule("X1", "X2", "L4")
def test_a_firing_that_took_too_long_is_one_elsewhere_too(seen: list[hfg.Failure]) -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    works, watch = graph.add(slow(), group="far", on_error="skip", max_duration_s=0.5), graph.add(Watch())
    graph.connect(graph.add(numbers(count=1)).out, works.value)
    graph.connect(works.failed, watch.failure)
    graph.connect(watch.out, graph.output("out", int))
    assert hfg.run(graph, clock="virtual").outputs == {"out": [0]}
    assert type(seen[0].error) is FiringTimeout


@pytest.mark.rule("X1", "L4", "R7")
def test_whoever_waits_for_a_failure_or_looks_at_it_is_told_the_same(seen: list[hfg.Failure]) -> None:
    async def main() -> Any:
        async with hfg.running(watched(), clock="virtual") as run:
            tap = run.tap("faulty.failed")
            waited = await run.wait_for("faulty.failed")
            tapped = await anext(aiter(tap))
            return waited.value, tapped.value

    waited, tapped = drive(main)
    assert str(waited.error) == str(tapped.error) == 'node "faulty" failed in firing 2: Broken: 1 is odd'
    assert waited.taken.keys() == tapped.taken.keys() == {"value", "image"}


class Handing(hfg.Node):
    """Triggers failures of its own making."""

    value = hfg.Input(int)
    told = hfg.Event(hfg.Failure)

    def process(self, value: int) -> None:
        self.told.trigger(hfg.Failure(NodeError("elsewhere", "firing 9", "of its own"), {"value": value}))


@pytest.mark.rule("L4", "X1")
def test_what_was_taken_elsewhere_has_no_declared_type_and_is_left_out() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    hands = graph.add(Handing(), group="far")
    graph.connect(graph.add(numbers(count=1)).out, hands.value)
    graph.connect(hands.told, graph.output("out", hfg.Failure))
    ((error, taken),) = hfg.run(graph, clock="virtual").outputs["out"]
    assert (str(error), taken) == ('node "elsewhere" failed in firing 9: of its own', {})
    assert '"value" is not among what it had taken' in error.__notes__[1]
