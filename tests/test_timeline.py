"""A timeline holds what the trace format asks for: boxes that do not overlap on a row, arrows from box to box."""

from __future__ import annotations

import asyncio
import io
import itertools
import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.timeline import Timeline

Event = dict[str, Any]


@hfg.node
def camera(*, count: int = 5) -> Iterator[int]:
    """Give images."""
    yield from range(count)


@hfg.node
def blur(image: int) -> int:
    """Work."""
    return image


@hfg.node
async def ask(image: int) -> int:
    """Wait."""
    await asyncio.sleep(0.25)
    return image


@hfg.node
def faulty(value: int) -> None:
    """Fail once."""
    if value == 2:
        raise ValueError("two \ud800")


class Judge(hfg.Node):
    """Trigger one of two."""

    image = hfg.Input(int)
    good = hfg.Event(int)
    bad = hfg.Event(int)

    def process(self, image: int) -> None:
        """Decide."""
        (self.good if image % 2 else self.bad).trigger(image)


class Mode(hfg.Node):
    """A state."""

    switch = hfg.Event()

    @hfg.slot
    def begin(self, image: int) -> None:
        """Hand on."""
        self.switch.trigger()


def build(**late: Any) -> hfg.Graph:
    graph = hfg.Graph("demo")
    graph.group("vision", threads=1)
    source, filtered = graph.add(camera(), max_rate_hz=10), graph.add(blur(), group="vision")
    slow, judge = graph.add(ask()), graph.add(Judge(), group="vision")
    search, grasp = graph.add(Mode(), name="search"), graph.add(Mode(), name="grasp")
    for node in (filtered, slow):
        graph.connect(source.out, node.ports.inputs["image"])
    graph.connect(filtered.out, judge.image)
    graph.connect(slow.out, graph.add(faulty(), on_error="skip").ports.inputs["value"])
    graph.connect(judge.good, search.begin)
    graph.connect(judge.bad, grasp.begin, **late)
    graph.connect(search.switch, grasp.activate, active=True)
    graph.connect(grasp.switch, search.activate, active=True)
    graph.start.activates(search.activate)
    return graph


def timeline(graph: hfg.Graph, **options: Any) -> list[Event]:
    stream = io.BytesIO()
    hfg.run(graph, clock="virtual", trace=Timeline(stream, graph), **options)
    events: list[Event] = json.loads(stream.getvalue())
    return events


def of(events: list[Event], phase: str, pid: int = 1) -> list[Event]:
    return [event for event in events if event["ph"] == phase and event["pid"] == pid]


def rows(events: list[Event], pid: int) -> dict[int, str]:
    """The names of the rows."""
    return {event["tid"]: event["args"]["name"] for event in of(events, "M", pid) if event["name"] == "thread_name"}


@pytest.mark.rule("R7")
def test_groups_are_rows_and_firings_and_calls_are_boxes() -> None:
    events, report = timeline(build()), hfg.run(build(), clock="virtual")
    names = rows(events, 1)
    assert set(names.values()) == {"loop", "loop (2)", "vision"}
    boxes = of(events, "X")
    for path, node in report.nodes.items():
        mine = [box for box in boxes if box["name"] == path]
        assert len(mine) == node.firings, path
        assert {names[box["tid"]].partition(" ")[0] for box in mine} <= {
            "vision" if path in ("blur", "judge") else "loop"
        }
    assert sum(box["name"] == "search.begin" for box in boxes) == 2
    assert {box["cat"] for box in boxes} == {"firing", "call"}
    asked = [box for box in boxes if box["name"] == "ask" and box["args"]["outcome"] == "done"]
    assert [round(box["dur"] / 1e6, 3) for box in asked] == [0.25] * 5  # microseconds in the file


def test_boxes_on_a_row_do_not_overlap_and_no_two_events_share_a_moment() -> None:
    events = timeline(build())
    for row in rows(events, 1):
        boxes = sorted((box["ts"], box["ts"] + box["dur"]) for box in of(events, "X") if box["tid"] == row)
        assert all(before[1] < after[0] for before, after in itertools.pairwise(boxes))
    moments = [event["ts"] for event in events if "ts" in event and event["pid"] == 1]
    assert len(set(moments)) == len(moments)


def test_signals_are_arrows_from_the_box_that_sent_them_to_the_one_that_took_them() -> None:
    events = timeline(build())
    begins, ends = of(events, "s"), of(events, "f")
    assert len(begins) == len(ends) == 5 + 5  # each image is judged, each judgement switches
    boxes = of(events, "X")

    def around(arrow: Event) -> str:
        (box,) = [
            box for box in boxes if box["tid"] == arrow["tid"] and box["ts"] <= arrow["ts"] <= box["ts"] + box["dur"]
        ]
        assert events.index(box) < events.index(arrow)  # else a viewer would not find it
        return str(box["name"])

    pairs = {(around(begin), around(end)) for begin in begins for end in ends if begin["id"] == end["id"]}
    assert pairs == {
        ("judge", "search.begin"),
        ("judge", "grasp.begin"),
        ("search.begin", "grasp.activate"),
        ("grasp.begin", "search.activate"),
    }
    assert all(end["bp"] == "e" for end in ends)


@pytest.mark.slow
def test_activity_has_rows_of_its_own() -> None:
    events = timeline(build())
    names = rows(events, 2)
    assert set(names.values()) == {"search", "grasp"}
    spans = sorted((box["ts"], box["ts"] + box["dur"], names[box["tid"]]) for box in of(events, "X", 2))
    assert len(spans) == 5
    assert all(before[2] != after[2] for before, after in itertools.pairwise(spans))
    assert all(abs(before[1] - after[0]) < 1 for before, after in itertools.pairwise(spans))


def test_errors_and_dropped_tokens_are_marks() -> None:
    marks = of(timeline(build(overflow="drop_newest", capacity=1), until_s=0.95), "i")
    assert marks[0]["name"] == "error in faulty"
    assert marks[0]["args"] == {"what": "firing 3", "error": "ValueError: two ?"}


def test_what_is_under_way_at_the_end_is_closed() -> None:
    events = timeline(build(), until_s=0.3)
    last = [box for box in of(events, "X") if box["name"] == "ask"][-1]
    assert last["args"]["outcome"] == "in progress at the end: until"


def test_the_file_is_whole_when_the_run_fails(tmp_path: Path) -> None:
    graph = hfg.Graph("failing")
    graph.connect(graph.add(camera()).out, graph.add(faulty()).ports.inputs["value"])
    file = tmp_path / "run.json"
    with pytest.raises(hfg.errors.NodeError):
        hfg.run(graph, clock="virtual", trace=Timeline(file, graph))
    events = json.loads(file.read_text(encoding="utf-8"))
    assert [mark["name"] for mark in of(events, "i")] == ["error in faulty"]


@pytest.mark.parametrize("make", [str, Path])
def test_a_file_that_cannot_be_written_is_refused_before_the_run(make: Any, tmp_path: Path) -> None:
    with pytest.raises(hfg.errors.UsageError, match="cannot write the timeline to .*nowhere.*: No such file"):
        Timeline(make(tmp_path / "nowhere" / "run.json"), build())
    with pytest.raises(hfg.errors.UsageError, match="cannot write the timeline to .*: Is a directory"):
        Timeline(make(tmp_path), build())


def test_a_disk_that_is_full_does_not_end_the_run(caplog: pytest.LogCaptureFixture) -> None:
    class Full(io.BytesIO):
        left = 5

        def write(self, data: Any) -> int:
            self.left -= 1
            if self.left < 0:
                raise OSError(28, "No space left on device")
            return super().write(data)

    graph = build()
    with caplog.at_level(logging.ERROR):
        report = hfg.run(graph, clock="virtual", trace=Timeline(Full(), graph))
    assert report.outcome == "done"
    told = [record.getMessage() for record in caplog.records if record.name == "hfg.engine"]
    assert told == ["a consumer of the trace failed and was removed"]


def test_a_timeline_that_is_left_before_the_end_can_be_read(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    graph = build()

    async def main() -> None:
        with Timeline(file, graph) as seen:
            async with hfg.running(graph) as run:
                run.trace(seen)
                await asyncio.sleep(0.1)
                seen.close()
                await asyncio.sleep(0.1)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert of(json.loads(file.read_text(encoding="utf-8")), "X")


def edited(graph: hfg.Graph, *steps: tuple[c.Command, ...]) -> list[Event]:
    """Edit a run every 100 ms and end it after as long."""
    stream = io.BytesIO()

    async def main() -> None:
        async with hfg.running(graph, trace=Timeline(stream, graph)) as run:
            for commands in steps:
                await asyncio.sleep(0.1)
                await run.edit(*commands)
            await asyncio.sleep(0.1)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    events: list[Event] = json.loads(stream.getvalue())
    return events


@pytest.mark.rule("R7", "R4")
@pytest.mark.parametrize(
    ("commands", "times"),
    [
        ((c.Rename("mode", "other"),), {"mode": 0.1, "other": 0.1}),
        ((c.Enclose(("mode",), "box"),), {"mode": 0.1, "box/mode": 0.1}),
        ((c.Remove("mode"),), {"mode": 0.1}),
        ((c.Replace("mode", "hfg.testing.nodes:Pulse"),), {"mode": 0.2}),
        ((c.Rename("mode", "aside"), c.Rename("camera", "mode")), {"mode": 0.1, "aside": 0.1}),
    ],
)
def test_active_times_end_under_the_name_they_began_with(
    commands: tuple[c.Command, ...], times: dict[str, float]
) -> None:
    graph = hfg.Graph()
    graph.start.activates(graph.add(Mode(), name="mode").activate)
    graph.add(camera(count=20), max_rate_hz=100) >> graph.add(blur())
    events = edited(graph, commands)
    names = rows(events, 2)
    assert {names[box["tid"]]: round(box["dur"] / 1e6, 3) for box in of(events, "X", 2)} == times


@pytest.mark.rule("R7", "R4")
def test_groups_keep_their_rows_when_all_their_nodes_move() -> None:
    graph = hfg.Graph()
    for name in ("one", "other"):
        graph.group(name, threads=0)
    graph.add(camera(count=25), max_rate_hz=100, group="one") >> graph.add(blur(), group="one")
    events = edited(graph, (c.Move("camera", "other"), c.Move("blur", "other")), (c.Move("blur", "one"),))
    names = rows(events, 1)
    assert sorted(names.values()) == ["one", "other"]
    assert {(box["name"], names[box["tid"]]) for box in of(events, "X")} == {
        ("camera", "one"),
        ("blur", "one"),
        ("camera", "other"),
        ("blur", "other"),
    }
