"""A property test takes monitors: a violation fails it with its stretch, at the smallest example."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg
from hfg import monitors as m
from hfg.errors import MonitorViolated, UsageError
from hfg.testing import ScheduleFailure, explore, judge_run


@hfg.node
def levels(*, to: list[int] = [0]) -> Iterator[int]:  # noqa: B006
    yield from to


@hfg.node
def pump(level: int) -> bool:
    """Runs from 7 on."""
    return level >= 7


@hfg.node
def motor(on: bool) -> None: ...


def tank(to: list[int]) -> hfg.Graph:
    graph = hfg.Graph("tank")
    running = graph.add(pump())
    graph.connect(graph.add(levels(to=to), max_rate_hz=1).out, running.level)
    graph.connect(running.out, graph.add(motor()).on)
    return graph


DRY = m.never(m.sent("pump.out", lambda on: on) & m.at_least(2, m.sent("pump.out")))


def test_a_run_that_keeps_to_its_monitors_gives_its_report() -> None:
    assert judge_run(tank([1, 9, 2])).outcome == "done"
    assert judge_run(tank([1, 9, 2]), {"small": "never(sent(levels.out, value > 9))"}, until_s=1.5).outcome == "until"


def test_hypothesis_finds_the_smallest_example_that_violates_a_monitor_and_shows_its_stretch() -> None:
    found: list[list[int]] = []

    @settings(max_examples=300, deadline=None, database=None, derandomize=True)
    @given(st.lists(st.integers(0, 20), max_size=6))
    def keeps_dry(to: list[int]) -> None:
        try:
            judge_run(tank(to), {"dry": DRY})
        except MonitorViolated:
            found.append(to)
            raise

    with pytest.raises(MonitorViolated) as error:
        keeps_dry()
    assert found[-1] == [0, 7]
    assert str(error.value).splitlines() == [
        f'monitor "dry" is violated after 1 s: {DRY}',
        "  0 s  pump.out  False",
        "  1 s  pump.out  True",
    ]


def test_the_monitors_of_the_graph_judge_too_although_they_only_note() -> None:
    graph = tank([1, 9])
    graph.monitor("low", "never(sent(levels.out, value > 8))")
    with pytest.raises(MonitorViolated, match=r'monitor "low" is violated after 1 s(?s:.*)1 s  levels\.out  9'):
        judge_run(graph)


def test_a_condition_that_raises_fails_the_run() -> None:
    with pytest.raises(MonitorViolated, match='monitor "bad" has judged nothing since its condition raised ZeroDiv'):
        judge_run(tank([0]), {"bad": m.never(m.sent("levels.out", lambda level: 1 / level))})


def test_a_schedule_that_violates_a_monitor_is_found_with_the_stretch() -> None:
    def two() -> hfg.Graph:
        graph = hfg.Graph("two")
        for name in ("a", "b"):
            graph.connect(graph.add(levels(), name=name).out, graph.add(pump(), name=f"pump_{name}").level)
        return graph

    order = {"a_first": "precedes(sent(a.out), sent(b.out))"}
    with pytest.raises(ScheduleFailure, match=r'(?s)of 20 schedules fail.*monitor "a_first" is violated.*b\.out  0'):
        explore(two, runs=20, monitors=order)
    assert explore(two, runs=5, monitors={"any": "never(sent(a.out, value > 3))"}).runs == 5


@pytest.mark.parametrize(
    ("monitors", "sentence"),
    [
        ([DRY], "monitors= has properties by name"),
        ({"dry": 3}, 'monitor "dry" needs a property, such as never(formula), or its text, got 3'),
        ({"dry": "nevr(active(a))"}, 'monitor "dry": '),
        ({"dry": "never(sent(nobody.out))"}, "nobody"),
    ],
)
def test_what_cannot_judge_is_refused_in_one_sentence(monitors: Any, sentence: str) -> None:
    with pytest.raises(hfg.errors.HfgError, match=re.escape(sentence)):
        judge_run(tank([0]), monitors)
    with pytest.raises(hfg.errors.HfgError, match=re.escape(sentence)):
        explore(lambda: tank([0]), runs=1, monitors=monitors)


def test_only_a_graph_can_be_judged() -> None:
    build: Any = tank
    with pytest.raises(UsageError, match="judge_run takes a graph"):
        judge_run(build)
