"""Streams: nothing is made without a subscriber or without credit, and what is shown is what the engine did."""

from __future__ import annotations

import asyncio
import itertools
import logging
import struct
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

import hfg
from hfg.base.token import Token
from hfg.studio.records import EdgeRecord
from hfg.studio.sampled_topics import _sample_of
from hfg.studio.showing import image_frame, shown_value
from hfg.studio.spans import Ways
from hfg.studio.viewing import Subscription
from tests.studio.page import Page, live, studio_of
from tests.studio.test_studio import doubling, ticking


class Lamp(hfg.Node):
    """Is active from `on` to `off`."""

    done = hfg.Event()

    @hfg.slot
    def on(self) -> None: ...

    @hfg.slot
    def off(self) -> None:
        self.done.trigger()


def lamps() -> hfg.Graph:
    """Two lamps, of which one hands its activity to the other."""
    graph = hfg.Graph("lamps")
    one, other = graph.add(Lamp(), name="one"), graph.add(Lamp(), name="other")
    one.done.activates(other.on)
    return graph


class Counting:
    """A topic that counts how often it is asked."""

    credit = 2
    kind = 0
    most_hz = 30.0

    def __init__(self) -> None:
        self.taken = 0
        self.closed = False

    def take(self) -> Any:
        self.taken += 1
        return {"n": self.taken}

    def time(self) -> float:
        return 1.5

    def close(self) -> None:
        self.closed = True


def test_a_frame_needs_credit_which_comes_back_when_it_is_painted() -> None:
    topic = Counting()
    stream = Subscription(1, topic, 10.0)
    assert stream.frame(0.0)
    assert stream.frame(1.0)
    assert stream.frame(2.0) is None
    assert topic.taken == 2  # nothing is made for a page that paints nothing
    stream.painted(1)
    assert stream.frame(3.0)
    assert stream.frame(4.0) is None
    stream.painted(10_000)  # of frames that were never sent
    assert stream.frame(5.0)
    assert stream.frame(6.0)
    assert stream.frame(7.0) is None


def test_frames_keep_to_their_rate() -> None:
    topic = Counting()
    stream = Subscription(1, topic, 10.0)
    times = []
    for step in range(60):
        now = 100 + step / 60
        if stream.frame(now):
            times.append(now)
            stream.painted(topic.taken)
    assert len(times) in (10, 11)


def beat(page: Page, times: int = 1) -> None:
    """Let the studio send what is due."""
    for stream in page.viewer.subscriptions.values():
        stream.due = 0.0
    for _ in range(times):
        page.viewer.beat(1e9)


def values(page: Page, sub: int) -> list[Any]:
    return [frame["value"] for frame in page.frames if frame["t"] == "data" and frame["sub"] == sub]


@pytest.mark.rule("A5")
def test_activity_says_who_is_active_and_by_which_edge_it_came() -> None:
    async def main() -> None:
        page = Page(studio_of(lamps())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=1, topic="activity")
        await page.ask("trigger", path="one.on", activity=1)
        run = page.studio.steering.run
        assert run is not None
        await run.wait_quiet()
        beat(page)
        assert list(values(page, 1)[-1]["active"]) == ["one"]
        await page.ask("trigger", path="one.off")
        await run.wait_quiet()
        beat(page)
        seen = values(page, 1)
        assert list(seen[-1]["active"]) == ["other"]
        assert [(path, on, via) for one in seen for _, path, on, _, via in one["moves"]] == [
            ("one", True, []),
            ("one", False, []),
            ("other", True, ["one.done -> other.on"]),
        ]
        await page.studio.close()

    live(main)


def test_nothing_is_sent_while_nobody_can_see_the_page() -> None:
    async def main() -> None:
        page = Page(studio_of(lamps())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=1, topic="activity")
        page.say(t="visible", on=False)
        await page.ask("trigger", path="one.on", activity=1)
        beat(page, 5)
        before = len(values(page, 1))
        page.say(t="visible", on=True)
        beat(page)
        assert len(values(page, 1)) == before + 1
        await page.studio.close()

    live(main)


def test_a_value_is_shown_with_how_often_it_passes() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=2, topic="value", args={"path": "clock.out"})
        beat(page)
        assert values(page, 2) == []
        for value in (3, 4):
            await page.ask("trigger", path="clock.tick", value=value)
        assert page.studio.steering.run is not None
        await page.studio.steering.run.wait_quiet()
        beat(page)
        (shown,) = values(page, 2)
        assert (shown["kind"], shown["data"], shown["seen"]) == ("number", 4, 2)
        await page.studio.close()

    live(main)


def test_numbers_for_a_plot_come_each_once() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=3, topic="history", args={"path": "clock.out"})
        run = page.studio.steering.run
        assert run is not None
        for number in range(3):
            await page.ask("trigger", path="clock.tick", value=number)
            await run.wait_quiet()
            beat(page)
        assert [one["values"] for one in values(page, 3)] == [[0.0], [1.0], [2.0]]
        assert [one["fresh"] for one in values(page, 3)] == [True, False, False]
        await page.studio.close()

    live(main)


def test_measures_are_packed_in_the_order_of_the_nodes() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=4, topic="measures", args={"nodes": ["count", "nobody", "clock"]})
        beat(page)
        for _ in range(3):
            await page.ask("trigger", path="clock.tick", value=1)
        assert page.studio.steering.run is not None
        await page.studio.steering.run.wait_quiet()
        records: list[Any] = []
        while not records or records[0][1] < 3:  # bars are summed up twenty times per second
            beat(page)
            await asyncio.sleep(0.01)
            records = list(struct.iter_unpack("<BBHIfffff24f", page.binary[-1][2]))
        assert (page.binary[-1][0], len(records)) == (4, 3)
        count, nobody, clock = records
        assert (count[3], clock[3]) == (3, 3)
        assert count[1] == 3  # bars
        assert all(seconds > 0 for seconds in count[9:12])
        assert not any(nobody)
        await page.studio.close()

    live(main)


def test_a_node_of_another_process_has_the_measures_of_its_last_report() -> None:
    async def main() -> None:
        graph = ticking()
        page = Page(studio_of(graph)).join()
        await page.ask("start", stay=True)
        await page.ask("trigger", path="clock.tick", value=1)
        run = page.studio.steering.run
        assert run is not None
        await run.wait_quiet()
        known = run.statistics().nodes["count"]
        sample = _sample_of(known)
        assert (sample.done, sample.doing, sample.active) == (1, known.doing, False)
        assert sample.newest_s == known.busy.last_s
        await page.studio.close()

    live(main)


def test_the_flow_of_an_edge_is_counted_even_across_a_border() -> None:
    async def main() -> None:
        graph = ticking()
        graph.edit(hfg.commands.Enclose(("count",), "box"))
        page = Page(studio_of(graph)).join()
        await page.ask("start", stay=True)
        edges = list(page.tables["edges"])
        assert len(edges) == 2
        page.say(t="sub", sub=5, topic="flow", args={"edges": edges})
        await page.ask("trigger", path="clock.tick", value=1)
        assert page.studio.steering.run is not None
        await page.studio.steering.run.wait_quiet()
        beat(page)
        assert [one[:2] for one in struct.iter_unpack("<IIf", page.binary[-1][2])] == [(1, 0), (1, 0)]
        await page.studio.close()

    live(main)


def test_the_timeline_has_a_box_for_each_firing() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=6, topic="timeline")
        beat(page)
        for _ in range(2):
            await page.ask("trigger", path="clock.tick", value=1)
        assert page.studio.steering.run is not None
        await page.studio.steering.run.wait_quiet()
        beat(page)
        boxes = [box for one in values(page, 6) for box in one["boxes"]]
        assert sorted(box[0] for box in boxes) == ["clock", "clock", "count", "count"]
        assert all(box[1] == "loop" and 0 <= box[2] <= box[3] for box in boxes)
        assert sum(one["lost"] for one in values(page, 6)) == 0
        await page.studio.close()

    live(main)


def test_log_records_come_with_the_path_of_their_node() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        page.say(t="sub", sub=7, topic="log")
        logging.getLogger("hfg.node.scaled").warning("it is %s", "late", extra={"path": "scaled"})
        beat(page)
        ((_, level, path, text),) = values(page, 7)[0]["records"]
        assert (level, path, text) == ("warning", "scaled", "it is late")
        page.say(t="unsub", sub=7)
        assert not [one for one in logging.getLogger("hfg").handlers if type(one).__name__ == "LogKeeper"]

    live(main)


def test_a_subscription_lives_on_in_the_next_run() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        page.say(t="sub", sub=1, topic="value", args={"path": "clock.out"})
        for value in (1, 2):
            await page.ask("start", stay=True)
            beat(page)
            await page.ask("trigger", path="clock.tick", value=value)
            assert page.studio.steering.run is not None
            await page.studio.steering.run.wait_quiet()
            beat(page)
            await page.ask("stop")
            await page.state("ended")
        assert [one["data"] for one in values(page, 1)] == [1, 2]

    live(main)


@pytest.mark.parametrize(
    ("topic", "args", "says"),
    [
        ("value", {"path": "nobody.out"}, 'no node "nobody"'),
        ("value", {}, "path"),
        ("value", {"path": "clock.out", "more": 1}, "more"),
        ("gossip", {}, "a page subscribes to one of"),
    ],
)
def test_what_cannot_be_subscribed_to_is_said_in_words(topic: str, args: dict[str, Any], says: str) -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=9, topic=topic, args=args)
        (gone,) = page.frames
        assert gone["t"] == "gone"
        assert says in gone["message"]
        assert not page.viewer.subscriptions
        await page.studio.close()

    live(main)


def test_a_page_has_a_bounded_number_of_subscriptions_and_requests() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        for sub in range(1, 400):
            page.say(t="sub", sub=sub, topic="activity")
        assert len(page.viewer.subscriptions) == 256
        page.cut()
        assert not page.studio.listeners

    live(main)


def test_the_engine_does_nothing_for_pages_without_subscriptions() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        run = page.studio.steering.run
        assert run is not None
        core = run._engine.core
        assert core.trace is None  # only changes are traced
        assert all(worker.meter is None for worker in core.workers)
        assert page.studio._beating is None
        await page.studio.close()

    live(main)


# --- values ---


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (3, "number"),
        (np.float32(2.5), "number"),
        (True, "number"),
        ("text", "text"),
        (None, "none"),
        ([1, 2], "list"),
        ({"a": 1}, "record"),
        ([{"a": 1}], "table"),
        (np.zeros((9, 9), np.uint8), "image"),
        (np.zeros((3, 3)), "array"),
        (object(), "other"),
        (hfg.END, "marker"),
    ],
)
def test_every_value_is_shown(value: object, kind: str) -> None:
    shown = shown_value(Token(value, stamp=1.0))
    assert shown["kind"] == kind
    assert isinstance(shown["summary"], str)


class Hostile:
    def __repr__(self) -> str:
        raise RuntimeError("no")

    def __len__(self) -> int:
        raise RuntimeError("no")


def test_values_that_cannot_be_shown_say_so() -> None:
    assert "Hostile" in shown_value(Token(Hostile()))["summary"]
    five = shown_value(Token(np.zeros((480, 640, 5), np.uint8)))
    assert five["message"] == "This picture cannot be shown: it has 5 channels. Its shape is 480 x 640 x 5."
    assert shown_value(Token("x" * 100_000))["data"] is None


@pytest.mark.parametrize("shape", [(480, 640), (480, 640, 3), (480, 640, 4), (480, 640, 1)])
def test_images_are_made_small_enough_for_the_page(shape: tuple[int, ...]) -> None:
    frame = image_frame(np.full(shape, 200, np.uint8), 160, 75)
    assert struct.unpack_from("<HH", frame) == (640, 480)
    assert frame[4:6] in (b"\xff\xd8", b"\x89P")
    assert len(frame) < 20_000


def test_the_timeline_begins_with_the_activity_so_far() -> None:
    async def main() -> None:
        page = Page(studio_of(lamps())).join()
        await page.ask("start", stay=True)
        run = page.studio.steering.run
        assert run is not None
        await page.ask("trigger", path="one.on", activity=1)
        await page.ask("trigger", path="one.off")
        await run.wait_quiet()
        page.say(t="sub", sub=1, topic="timeline")
        beat(page, 2)
        first, *others = values(page, 1)
        assert [(node, end is None) for node, _, end in first["activity"]] == [("one", False), ("other", True)]
        assert all("activity" not in one for one in others)
        await page.ask("stop")
        await page.state("ended")
        assert page.studio.spans.active == {}

    live(main)


# --- where activity comes from ---


def edge(source: str, target: str) -> EdgeRecord:
    return EdgeRecord(source, target, "", True, {}, True, False)


def test_activity_that_moves_between_subgraphs_comes_by_the_edges_of_all_levels() -> None:
    ways = Ways(
        {
            "out": edge("a/x.done", "a.done.inner"),
            "over": edge("a.done", "b.begin"),
            "in": edge("b.begin.inner", "b/y.begin"),
            "other": edge("c.done", "b.begin"),
            "within": edge("b/y.done", "b/z.begin"),
        }
    )
    assert ways.to("b/y", ["a/x", "b/y"]) == ["in", "over"]
    assert ways.to("b/z", ["b/y", "a/x"]) == ["within"]
    assert ways.to("b/y", ["c"]) == ["in", "other"]


def test_streams_together_have_a_small_share_of_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page that wants everything gets fewer frames; the graph does not wait."""

    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        now = [100.0]
        pauses: list[float] = []
        loop = asyncio.get_running_loop()
        monkeypatch.setattr(time, "thread_time", lambda: now[0])
        monkeypatch.setattr(loop, "call_later", lambda pause, *_: pauses.append(pause))

        def work(_: float) -> None:
            now[0] += 0.3

        page.say(t="sub", sub=1, topic="activity")
        monkeypatch.setattr(page.viewer, "beat", work)
        page.studio._beat()
        monkeypatch.undo()
        assert pauses[0] == 1 / 60
        assert pauses[1] == pytest.approx(10.0)

    live(main)


@hfg.node
async def stuck(value: int) -> int:
    """Never finish."""
    await asyncio.Event().wait()
    return value


def held_up() -> hfg.Graph:
    """A source whose numbers nobody takes, and next to it one that goes on."""
    graph = hfg.Graph("held_up")
    numbers, twice = graph.add(counting(), name="numbers"), graph.add(stuck(), name="stuck")
    graph.connect(numbers.out, twice.value)
    return graph


@hfg.node
def counting() -> Iterator[int]:
    """Count."""
    yield from itertools.count()


def test_what_waits_is_reported_with_the_edge_that_holds_it_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.studio.waiting._AFTER_S", 0.0)

    async def main() -> None:
        page = Page(studio_of(held_up())).join()
        await page.ask("start", stay=True)
        page.say(t="sub", sub=1, topic="waits", args={"level": ""})
        while not values(page, 1):
            beat(page)
            await asyncio.sleep(0.01)
        found = values(page, 1)[-1]
        assert {path: says for path, (says, _) in found["nodes"].items()} == {"numbers": "waits until stuck took out"}
        assert {key: full[:2] for key, full in found["edges"].items()} == {"numbers.out -> stuck.value": [1, 1]}
        seen = len(values(page, 1))
        beat(page, times=5)
        assert len(values(page, 1)) == seen  # nothing is new
        await page.studio.close()

    live(main)


def test_values_of_many_ports_come_together_and_only_those_that_are_new() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        run = page.studio.steering.run
        assert run is not None
        page.say(t="sub", sub=1, topic="values", args={"paths": ["clock.out", "count.call", "nobody.out"]})
        await page.ask("trigger", path="clock.tick", value=7)
        await run.wait_quiet()
        beat(page)
        await page.ask("trigger", path="count.call", value=8)
        await run.wait_quiet()
        beat(page)
        assert values(page, 1) == [{"clock.out": "7", "count.call": "7"}, {"count.call": "8"}]
        await page.studio.close()

    live(main)


def test_values_are_short_enough_for_one_line() -> None:
    def line(value: Any) -> str:
        return str(shown_value(Token(value))["summary"])

    assert line(3.14159265) == "3.142"
    assert line("two\nlines") == "two lines"
    assert line(np.zeros((480, 640), np.uint8)) == "image, 640 x 480"
    assert line(np.zeros((3, 4, 5))) == "float64, 4 x 3 x 5"
    assert line(np.array([0.25, 2.0])) == "(0.25, 2)"
    assert line(Reading(1.23456, np.zeros(9), "far")) == "level 1.23, rays 9 numbers, words 'far'"
    assert line([Reading(1.0, np.zeros(9), "far")] * 3) == "3 x Reading"
    assert line(True) == "True"


class Reading(NamedTuple):
    """A record."""

    level: float
    rays: Any
    words: str
