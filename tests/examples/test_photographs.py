"""The example with photographs finds what is in them, and its gate saves the work that it promises."""

from __future__ import annotations

from pathlib import Path

import pytest

import hfg
from examples import photographs
from hfg.trace import ActivityChanged, FiringStarted, TraceEvent

EVERYTHING = {"coins": (24, 0), "page": (0, 7)}


def watch(*, gated: bool, folder: str = "") -> tuple[list[photographs.Summary], list[TraceEvent]]:
    events: list[TraceEvent] = []
    report = hfg.run(photographs.build(gated=gated, folder=folder), clock="virtual", trace=events.append)
    assert report.outcome == "done"
    return report.outputs["reports"], events


def found(summaries: list[photographs.Summary]) -> dict[str, tuple[int, int]]:
    return {summary.name: (summary.circles, summary.lines) for summary in summaries}


def cleaned(events: list[TraceEvent]) -> int:
    firings = [event for event in events if isinstance(event, FiringStarted) and event.node == "measure/clean"]
    return sum(event.kind == "process" for event in firings)


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
