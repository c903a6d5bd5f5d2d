"""The family `flow`, as far as it takes time or is shared: delay, debounce, throttle, cache, memory cells."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

import hfg
from hfg.nodes import flow
from hfg.testing import fire
from hfg.testing.diagrams import check, run
from hfg.trace import QueueGrown


class Heard(hfg.Node):
    """Writes down what it is told, when and with which stamp."""

    told = hfg.State(factory=list[tuple[float, Any]])
    stamps = hfg.State(factory=list[float])

    @hfg.slot
    def hear(self, token: hfg.Token[Any]) -> None:
        self.told.append((round(hfg.elapsed(), 6), token.value))
        self.stamps.append(round(token.stamp, 6))


@hfg.node
def script(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    yield from values


@hfg.node
def numbers(*, to: int = 10) -> Iterator[int]:
    yield from range(to)


def heard_of(source: Any, graph: hfg.Graph) -> Heard:
    heard = graph.add(Heard())
    graph.connect(source, heard.hear)
    return heard


# --- delay ---


@pytest.mark.rule("F5")
def test_a_delay_takes_one_value_at_a_time_and_keeps_the_end_behind_it() -> None:
    check(flow.Delay(seconds=0.02), value="12--3|", expected={"out": "--1-2-(3|)"})
    check(flow.Delay(seconds=0), value="1-2|", expected={"out": "1-2|"})


@pytest.mark.rule("F14")
def test_a_delay_with_concurrency_is_as_fast_as_what_comes() -> None:
    how: dict[str, Any] = {"options": {"concurrency": 4}, "active": False}
    check(flow.Delay(seconds=0.03), value="123--4|---", expected={"out": "---123--(4|)"}, **how)


def test_values_by_the_slot_come_later_by_the_same_time_and_wait_for_nobody() -> None:
    check(flow.Delay(seconds=0.03), forward="12-3-----|", expected={"forwarded": "---12-3"})
    check(flow.Delay(seconds=0), forward="12-|", expected={"forwarded": "12"})


def test_a_delayed_value_keeps_its_stamp() -> None:
    graph = hfg.Graph()
    delay = graph.add(flow.Delay(seconds=2.0))
    source = graph.add(numbers(to=3), max_rate_hz=1)
    graph.connect(source.out, delay.forward)
    heard = heard_of(delay.forwarded, graph)
    hfg.run(graph, clock="virtual")
    assert heard.told == [(2.0, 0), (3.0, 1), (4.0, 2)]
    assert heard.stamps == [0.0, 1.0, 2.0]


@pytest.mark.rule("A3", "A4")
def test_activity_is_delayed_with_the_value_that_brought_it() -> None:
    found = run(flow.Delay(seconds=0.04), forward="1(+2)3-----|")
    assert found == {"forwarded": "----1(+2)3", "activity": "-+---~"}


def test_the_order_is_kept_when_the_delay_becomes_shorter() -> None:
    graph = hfg.Graph()
    delay, source = graph.add(flow.Delay(seconds=5.0)), graph.add(numbers(to=3), max_rate_hz=1)
    shorter = graph.add(script(values=(5.0, 1.0, 1.0)), name="shorter", max_rate_hz=1)
    graph.connect(shorter.out.sent, delay.ports.parameters["seconds"])
    wait = graph.add(flow.Delay(seconds=0.5), name="wait")
    graph.connect(source.out, wait.forward)
    graph.connect(wait.forwarded, delay.forward)
    heard = heard_of(delay.forwarded, graph)
    hfg.run(graph, clock="virtual")
    assert heard.told == [(5.5, 0), (5.5, 1), (5.5, 2)]


def test_what_a_delay_holds_is_given_before_the_run_ends_and_gone_behind_a_reset() -> None:
    check(flow.Delay(seconds=0.03), forward="12-", reset="--!", expected={"forwarded": ""})
    graph = hfg.Graph()
    delay = graph.add(flow.Delay(seconds=100.0))
    graph.connect(graph.add(numbers(to=1)).out, delay.forward)
    heard = heard_of(delay.forwarded, graph)
    assert hfg.run(graph, clock="virtual").duration_s == 100
    assert heard.told == [(100.0, 0)]


# --- debounce and throttle ---


def test_debounce_tells_the_last_value_of_a_burst() -> None:
    check(flow.Debounce(seconds=0.03), value="123----4-5----|", expected={"settled": "-----3------5"})
    check(flow.Debounce(seconds=0.03), value="1", expected={"settled": ""}, tick_s=0.01)


@pytest.mark.rule("A3", "A5")
def test_debounce_hands_on_the_activity_of_a_value_that_it_has_dropped() -> None:
    found = run(flow.Debounce(seconds=0.02), value="(+1)2-----|")
    assert found == {"settled": "---(+2)", "activity": "+--~"}


@pytest.mark.rule("F11")
def test_throttle_tells_the_newest_value_in_each_period() -> None:
    check(flow.Throttle(rate_hz=25.0), value="-1234--56------7--8|----", expected={"throttled": "-1---4---6-----7--8"})


def test_throttle_tells_nothing_twice_and_nothing_is_due_when_nothing_came() -> None:
    check(flow.Throttle(rate_hz=50.0), value="1----2----|", expected={"throttled": "1----2"})


@pytest.mark.rule("F11")
def test_the_grid_of_a_throttle_does_not_drift() -> None:
    graph = hfg.Graph()
    throttle, source = graph.add(flow.Throttle(rate_hz=10.0)), graph.add(numbers(to=400), max_rate_hz=37)
    graph.connect(source.out, throttle.value)
    heard = heard_of(throttle.throttled, graph)
    hfg.run(graph, clock="virtual")
    times = [time for time, _ in heard.told]
    assert times[:100] == pytest.approx([number / 10 for number in range(100)])
    assert heard.told[-1][1] == 399
    assert all(later - earlier > 0.09 for earlier, later in pairwise(times))


def test_a_throttle_slows_nobody() -> None:
    graph = hfg.Graph()
    throttle, source = graph.add(flow.Throttle(rate_hz=1.0)), graph.add(numbers(to=50), max_rate_hz=10)
    graph.connect(source.out, throttle.value)
    all_of_them, few = heard_of(source.out, graph), heard_of(throttle.throttled, graph)
    hfg.run(graph, clock="virtual")
    assert [time for time, _ in all_of_them.told] == pytest.approx([number / 10 for number in range(50)])
    assert few.told == [(0.0, 0), (1.0, 9), (2.0, 19), (3.0, 29), (4.0, 39), (5.0, 49)] or [
        value for _, value in few.told
    ] == [0, 10, 20, 30, 40, 49]


@pytest.mark.parametrize("kind", [flow.Debounce, flow.Throttle, flow.Delay])
def test_what_waits_for_time_belongs_on_the_loop(kind: type[hfg.Node]) -> None:
    graph = hfg.Graph()
    graph.group("thread", threads=1)
    node = graph.add(kind(), group="thread")
    slots = node.ports.slots
    for _ in range(2):
        graph.connect(graph.add(numbers(to=2)).out, slots["forward" if "forward" in slots else "value"])
    with pytest.raises(hfg.errors.HfgError, match="thread"):
        hfg.run(graph, clock="virtual")


# --- cache ---


def test_a_cache_plays_back_what_it_has_recorded() -> None:
    check(
        flow.Cache(rate_hz=50.0),
        value="123",
        play="----!-----|",
        expected={"played": "----1-2-3", "finished": "--------!"},
    )


def test_a_part_is_played_in_a_loop_until_pause() -> None:
    node = flow.Cache(rate_hz=50.0, first=1, last=-2, loop=True)
    check(node, value="1234", play="----!", pause="---------!--|", expected={"played": "----2-3-2", "finished": ""})


def test_a_cache_forgets_the_oldest_and_everything_on_demand() -> None:
    check(flow.Cache(rate_hz=100.0, size=2), value="123", play="----!---|", expected={"played": "----23"})
    check(
        flow.Cache(rate_hz=100.0),
        value="12",
        forget="---!",
        play="----!---|",
        expected={"played": "", "finished": "----!"},
    )
    node = flow.Cache(size=2)
    for value in range(3):
        fire(node, slot="value", value=value)
    assert node.buffered == 2


def test_play_begins_anew_and_what_comes_meanwhile_is_kept_for_the_next_time() -> None:
    check(
        flow.Cache(rate_hz=50.0),
        value="12---3",
        play="--!------!|--------",
        expected={"played": "--1-2----1-2-3", "finished": "----!--------!"},
    )
    check(flow.Cache(rate_hz=50.0), value="123", play="---!--!------|", expected={"played": "---1-21-2-3"})


def test_a_playback_waits_for_a_consumer_that_is_slow() -> None:
    graph = hfg.Graph()
    cache, slow = graph.add(flow.Cache(rate_hz=1000.0)), graph.add(flow.Delay(seconds=1.0), name="slow")
    graph.connect(graph.add(numbers(to=8)).out, cache.value)
    later = graph.add(flow.Delay(seconds=1.0), name="later")
    graph.connect(graph.add(script(values=(1,)), name="once").out, later.forward)
    graph.connect(later.forwarded, cache.play)
    graph.connect(cache.played, slow.value, capacity=2)
    heard = heard_of(slow.out, graph)
    grown: list[str] = []
    hfg.run(
        graph, clock="virtual", trace=lambda event: grown.append(event.edge) if isinstance(event, QueueGrown) else None
    )
    assert heard.told == [(2.0 + number, number) for number in range(8)]
    assert grown == []


# --- work in the background ---


class Fetch(flow.Background):
    """Takes as many seconds as the value says; fails at 13."""

    begun = hfg.State(factory=list[tuple[float, int]])

    async def work(self, value: int) -> str:
        self.begun.append((hfg.elapsed(), value))
        await asyncio.sleep(value)
        if value == 13:
            raise ValueError("thirteen")
        return f"got {value}"


def fetching(*values: int, **options: Any) -> tuple[hfg.Graph, Fetch, Heard]:
    graph = hfg.Graph()
    fetch = graph.add(Fetch(at_most=options.pop("at_most", 8)), name="fetch", **options)
    graph.connect(graph.add(script(values=values), name="urls").out, fetch.value)
    return graph, fetch, heard_of(fetch.done, graph)


def test_work_in_the_background_is_told_of_as_it_is_done_and_the_run_waits_for_it() -> None:
    graph, fetch, heard = fetching(3, 1, 2)
    assert hfg.run(graph, clock="virtual").duration_s == 3
    assert fetch.begun == [(0.0, 3), (0.0, 1), (0.0, 2)]
    assert heard.told == [(1.0, "got 1"), (2.0, "got 2"), (3.0, "got 3")]


def test_who_sends_waits_for_a_place_when_all_are_taken() -> None:
    graph, fetch, heard = fetching(3, 1, 2, at_most=2)
    hfg.run(graph, clock="virtual")
    assert fetch.begun == [(0.0, 3), (0.0, 1), (1.0, 2)]
    assert [value for _, value in heard.told] == ["got 1", "got 3", "got 2"]


@pytest.mark.rule("X1")
def test_what_work_raises_is_an_error_of_the_node() -> None:
    graph, _, _ = fetching(13)
    with pytest.raises(hfg.errors.NodeError, match='node "fetch" failed in task .*thirteen'):
        hfg.run(graph, clock="virtual")
    graph, _, heard = fetching(13, 2, 14, on_error="skip")
    hfg.run(graph, clock="virtual")
    assert heard.told == [(2.0, "got 2"), (14.0, "got 14")]


def test_a_place_is_free_again_when_work_has_failed() -> None:
    graph, _, heard = fetching(13, 1, at_most=1, on_error="skip")
    hfg.run(graph, clock="virtual")
    assert heard.told == [(14.0, "got 1")]


def test_work_is_cancelled_by_a_reset_and_its_places_are_free() -> None:
    graph = hfg.Graph()
    fetch = graph.add(Fetch(at_most=1), name="fetch")
    graph.connect(graph.add(script(values=(100, 2)), max_rate_hz=0.1).out, fetch.value)
    delay = graph.add(flow.Delay(seconds=5.0))
    graph.connect(graph.start, delay.forward)
    graph.connect(delay.forwarded, fetch.reset)
    heard = heard_of(fetch.done, graph)
    hfg.run(graph, clock="virtual")
    assert heard.told == [(12.0, "got 2")]


# --- memory cells ---


def test_a_cell_tells_its_value_when_asked() -> None:
    check(
        flow.MemoryCell(),
        set="-1-2",
        publish="!-!-!-!",
        clear="-----!",
        expected={"changed": "-1-2", "published": "--1-2", "empty": "!-----!", "cleared": "-----!"},
    )


def test_clearing_what_is_empty_tells_nothing() -> None:
    check(flow.MemoryCell(), clear="!", expected={"cleared": ""})


class Box(hfg.Subgraph):
    """A cell inside of a subgraph."""

    ask = hfg.slot(type=object)
    told = hfg.Event(Any)
    heard = hfg.Event(Any)

    def build(self, graph: hfg.Graph) -> None:
        cell = graph.add(flow.MemoryCell(name="goal"), name="inside")
        graph.connect(self.ask.inner, cell.publish)
        graph.connect(cell.published, self.told.inner)
        graph.connect(cell.changed, self.heard.inner)


def cells() -> tuple[hfg.Graph, Heard, Heard, Heard]:
    graph = hfg.Graph()
    outside, other = graph.add(flow.MemoryCell(name="goal"), name="outside"), graph.add(flow.MemoryCell(), name="other")
    box = graph.add(Box(), name="box")
    graph.connect(graph.add(script(values=(3, 5)), name="goals", max_rate_hz=1).out, outside.set)
    graph.connect(graph.add(numbers(to=3), name="asks", max_rate_hz=0.8).out, box.ask)
    return graph, heard_of(box.told, graph), heard_of(box.heard, graph), heard_of(other.changed, graph)


def test_cells_of_one_name_share_a_value_across_subgraphs() -> None:
    graph, told, changed, other = cells()
    hfg.run(graph, clock="virtual")
    assert told.told[-2:] == [(1.25, 5), (2.5, 5)]
    assert changed.told == [(0.0, 3), (1.0, 5)]
    assert other.told == []


def test_each_run_begins_without_values_and_graphs_share_nothing() -> None:
    graph, _, _, _ = cells()
    hfg.run(graph, clock="virtual")
    asking = hfg.Graph()
    cell = asking.add(flow.MemoryCell(name="goal"))
    asking.connect(asking.start, cell.publish)
    empty = heard_of(cell.empty, asking)
    hfg.run(asking, clock="virtual")
    assert empty.told == [(0.0, None)]
    graph["goals"].values = ()
    hfg.run(graph, clock="virtual")
    assert graph["heard"].told == []
