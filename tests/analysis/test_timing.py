"""Deadlines are checked before a run: bounds from the graph, its groups and declared durations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.analysis.timing import TimeReport, analyse_time


@hfg.node
def tick() -> Iterator[int]:
    yield from range(10)


@hfg.node
def step(number: int) -> int:
    return number


class Detect(hfg.Node):
    number = hfg.Input(int)
    found = hfg.Event(int)

    def process(self, number: int) -> None:
        self.found.trigger(number)


def way(graph: hfg.Graph, name: str, rate_hz: float, *takes: float, **last: Any) -> None:
    """A source and a chain of steps, which take so long; options of the last one."""
    before = graph.add(tick(), name=name, max_rate_hz=rate_hz, takes_s=0.0, group=last.get("group"))
    for number, takes_s in enumerate(takes):
        options = last if number == len(takes) - 1 else {"group": last.get("group")}
        node = graph.add(step(), name=f"{name}_{number}", takes_s=takes_s, **options)
        graph.connect(before.out, node.number)
        before = node


def bounds(report: TimeReport) -> dict[str, float]:
    return {path.node: path.within_s for path in report.paths}


@pytest.mark.rule("R2")
def test_first_in_first_out_a_wave_waits_for_the_waves_of_all_others() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01, 0.02, deadline_s=0.05)
    way(graph, "lidar", 20, 0.01)
    report = analyse_time(graph)
    assert bounds(report) == pytest.approx({"camera_1": 0.04, "lidar_0": 0.04})
    assert report.load == pytest.approx({"loop": 0.5})
    assert [path.used for path in report.paths] == [pytest.approx(0.8), None]
    assert not report.problems
    assert next(iter(report.lines())) == "camera -> camera_1: 0.04 s  ████████████████░░░░ 80% of 0.05 s"


def test_a_deadline_that_can_be_missed_is_a_warning_and_priority_helps() -> None:
    def found(policy: Any) -> TimeReport:
        graph = hfg.Graph()
        graph.group("work", policy=policy)
        way(graph, "camera", 10, 0.02, 0.03, group="work")
        bumper = graph.add(tick(), name="bumper", max_rate_hz=10, takes_s=0.0, group="work", priority=2)
        stop = graph.add(step(), name="stop", takes_s=0.001, group="work", priority=2, deadline_s=0.04)
        graph.connect(bumper.out, stop.number)
        return analyse_time(graph)

    assert [problem.check for problem in found("fifo").problems] == ["deadline"]
    assert "can take 0.051 s, its deadline_s is 0.04" in str(found("fifo").problems[0])
    assert not found("priority").problems
    assert bounds(found("priority"))["stop"] == pytest.approx(0.031)  # one firing that has begun


@pytest.mark.rule("F5")
def test_over_groups_and_events_the_response_time_is_the_jitter_of_the_next() -> None:
    graph = hfg.Graph()
    graph.group("vision")
    camera = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.01)
    detect = graph.add(Detect(), name="detect", group="vision", takes_s=0.03)
    show = graph.add(step(), name="show", takes_s=0.005, deadline_s=0.1)
    graph.connect(camera.out, detect.number)
    graph.connect(detect.found, show.number)
    report = analyse_time(graph)
    assert bounds(report) == pytest.approx({"show": 0.06})  # 0.015 + 0.03 + 0.015: show and camera share the loop


def test_too_much_work_has_no_bound_and_says_so() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.2, deadline_s=1.0)
    report = analyse_time(graph)
    assert bounds(report) == {"camera_0": math.inf}
    assert [str(problem.what) for problem in report.problems] == [
        'group "loop" needs 200% of its time',
        'the way from "camera" has no bound, its deadline_s is 1',
    ]


def test_measured_durations_come_before_declared_ones_and_what_is_unknown_is_said() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01)
    graph.connect(graph["camera_0"].out, graph.add(step(), name="last").number)
    graph.connect(graph.add(tick(), name="free").out, graph.add(step(), name="idle").number)
    assert bounds(analyse_time(graph, {"camera_0": 0.04})) == pytest.approx({"last": 0.04})
    assert analyse_time(graph).assumptions[1:] == [
        "no time for last: declare takes_s",
        "no work from free: a source without max_rate_hz has no period",
    ]
