"""The example with photographs finds what is in them, and its gate saves the work that it promises."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from examples import photographs
from hfg.trace import ActivityChanged, FiringStarted, ParameterSet, TraceEvent

pytestmark = pytest.mark.slow

EVERYTHING = {"coins": (24, 0), "page": (0, 7)}


def watch(*, gated: bool, folder: str = "") -> tuple[list[photographs.Summary], list[TraceEvent]]:
    watched = photographs.watch(photographs.build(gated=gated, folder=folder), clock="virtual")
    return watched.summaries, watched.events


def found(summaries: list[photographs.Summary]) -> dict[str, tuple[int, int]]:
    return {summary.name: (summary.circles, summary.lines) for summary in summaries}


def cleaned(events: list[TraceEvent]) -> int:
    return photographs.Watched([], events, 0.0).cleaned


def looked_at(events: list[TraceEvent]) -> int:
    return sum(isinstance(event, FiringStarted) and event.node == "see" and event.kind == "process" for event in events)


@pytest.mark.rule("A11", "A5", "A6")
def test_gate_saves_most_of_the_measuring_and_loses_nothing(tmp_path: Path) -> None:
    summaries, events = watch(gated=True, folder=str(tmp_path))
    assert found(summaries) == EVERYTHING
    assert looked_at(events) == 36
    assert 6 <= cleaned(events) <= 12
    coins, page = summaries
    assert 44 < coins.diameter < 47
    assert 16 < page.spacing < 20
    assert {file.name for file in tmp_path.iterdir()} == {"coins.png", "page.png"}

    states = [event.node for event in events if isinstance(event, ActivityChanged) and event.active]
    assert states == ["search", *["measuring", "report", "search"] * 2]


def test_without_the_gate_every_picture_is_measured_and_the_same_is_found() -> None:
    summaries, events = watch(gated=False)
    assert found(summaries) == EVERYTHING
    assert cleaned(events) == looked_at(events) == 36


def test_timeline_shows_each_state_and_each_photograph() -> None:
    _, events = watch(gated=True)
    camera, search, measuring, report, seconds = photographs.timeline(events).splitlines()
    assert camera.split() == ["camera", *photographs.STREAM]
    for row in (search, measuring, report):
        assert "━" in row
    assert seconds.split() == ["0", "s", "3.0", "s"]


@pytest.mark.rule("P8")
def test_in_a_hurry_one_look_is_enough_after_the_first_report_and_the_timeline_has_all_groups(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    steered = photographs.watch(photographs.build(), file=file, hurry=True, clock="virtual")
    assert [summary.looks for summary in steered.summaries] == [3, 1]
    assert found(steered.summaries) == EVERYTHING
    assert "(one look)" in photographs.describe(steered.summaries[1])
    (changed,) = [event for event in steered.events if isinstance(event, ParameterSet)]
    assert (changed.node, changed.parameter, changed.value) == ("measuring", "looks", 1)
    rows = {event["args"]["name"] for event in json.loads(file.read_text()) if event["name"] == "thread_name"}
    assert {"camera", "circles", "lines", "measure", "loop"} <= rows
