"""The family `time`: all of it in virtual time, to the instant."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.nodes import flow, time
from hfg.testing import fire
from hfg.testing.diagrams import run


class Heard(hfg.Node):
    """Writes down what it is told, when and with which stamp."""

    told = hfg.State(factory=list[tuple[float, Any]])
    stamps = hfg.State(factory=list[float])

    @hfg.slot
    def hear(self, token: hfg.Token[Any]) -> None:
        self.told.append((round(hfg.elapsed(), 6), token.value))
        self.stamps.append(round(token.stamp, 6))


class Slow(hfg.Node):
    """Takes its time with each value."""

    seconds = hfg.Parameter(2.5)
    began = hfg.State(factory=list[tuple[float, Any]])

    async def process(self, value: Any) -> None:
        self.began.append((hfg.elapsed(), value))
        await asyncio.sleep(self.seconds)


@hfg.node
def script(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    yield from values


def heard_of(source: Any, graph: hfg.Graph) -> Heard:
    heard = graph.add(Heard())
    graph.connect(source, heard.hear)
    return heard


# --- sources ---


@pytest.mark.rule("F11")
def test_a_ticker_ticks_on_a_grid_and_ends_behind_its_count() -> None:
    graph = hfg.Graph()
    heard = heard_of(graph.add(time.Ticker(period_s=0.5, phase_s=0.2, count=4)).tick, graph)
    assert hfg.run(graph, clock="virtual").outcome == "done"
    assert heard.told == [(0.2, 0), (0.7, 1), (1.2, 2), (1.7, 3)]
    assert heard.stamps == [0.2, 0.7, 1.2, 1.7]


@pytest.mark.parametrize(("rate_hz", "told"), [(1.1e-308, [(0.0, 0)]), (1e308, [(0.0, 0), (1e-9, 1)])])
def test_a_ticker_has_periods_that_can_be_reckoned_with(rate_hz: float, told: list[tuple[float, int]]) -> None:
    graph = hfg.Graph()
    heard = heard_of(graph.add(time.Ticker(rate_hz=rate_hz, count=len(told))).tick, graph)
    hfg.run(graph, clock="virtual", until_s=1.0)
    assert [number for _, number in heard.told] == [number for _, number in told]
    assert [at for at, _ in heard.told] == pytest.approx([at for at, _ in told], abs=1e-8)


@pytest.mark.rule("F11")
def test_a_ticker_does_not_drift() -> None:
    graph = hfg.Graph()
    heard = heard_of(graph.add(time.Ticker(rate_hz=3.0)).tick, graph)
    hfg.run(graph, clock="virtual", until_s=100.1)
    assert heard.told[-1] == (100.0, 300)
    assert [at for at, _ in heard.told] == [round(number / 3, 6) for number in range(301)]


@pytest.mark.rule("F11")
def test_a_late_tick_does_not_move_the_grid_and_missed_ones_are_not_made_up() -> None:
    graph = hfg.Graph()
    slow = graph.add(Slow())
    graph.connect(graph.add(time.Ticker(period_s=1.0, count=4)).tick, slow.ports.inputs["value"])
    hfg.run(graph, clock="virtual")
    assert slow.began == [(0.0, 0), (2.5, 2), (5.0, 5), (7.5, 7)]


@pytest.mark.rule("P8")
def test_a_new_period_holds_from_the_next_tick_on() -> None:
    graph = hfg.Graph()
    ticker = graph.add(time.Ticker(period_s=1.0, count=5))
    new = graph.add(time.Schedule(instants_s=(1.5,)))
    halved = graph.add(time.shift(offset_s=-1.0))
    graph.connect(new.instant, halved.time)
    graph.connect(halved.out.sent, ticker.ports.parameters["period_s"])
    heard = heard_of(ticker.tick, graph)
    hfg.run(graph, clock="virtual")
    assert [number for _, number in heard.told] == [0, 1, 2, 3, 4]
    assert [at for at, _ in heard.told][-2:] == [2.5, 3.0]


def test_a_ticker_begins_anew_when_it_is_reset() -> None:
    graph = hfg.Graph()
    ticker = graph.add(time.Ticker(period_s=1.0, count=3))
    graph.connect(graph.add(time.Schedule(instants_s=(1.25,))).instant, ticker.reset)
    heard = heard_of(ticker.tick, graph)
    hfg.run(graph, clock="virtual")
    assert [number for _, number in heard.told][-3:] == [0, 1, 2]


def test_a_schedule_gives_each_moment_when_it_comes() -> None:
    graph = hfg.Graph()
    heard = heard_of(graph.add(time.Schedule(instants_s=(2.0, 0.5, 0.5, -1.0))).instant, graph)
    assert hfg.run(graph, clock="virtual").duration_s == 2
    assert heard.told == [(0.0, -1.0), (0.5, 0.5), (0.5, 0.5), (2.0, 2.0)]
    assert heard.stamps == [0.0, 0.5, 0.5, 2.0]


def test_a_schedule_gives_what_has_passed_at_once() -> None:
    graph = hfg.Graph()
    slow = graph.add(Slow())
    graph.connect(graph.add(time.Schedule(instants_s=(1.0, 2.0, 5.0))).instant, slow.ports.inputs["value"])
    hfg.run(graph, clock="virtual")
    assert slow.began == [(1.0, 1.0), (3.5, 2.0), (6.0, 5.0)]


def test_an_empty_schedule_ends_at_once() -> None:
    assert run(time.Schedule()) == {"instant": "|"}


def test_a_clock_gives_the_time_at_its_rate() -> None:
    graph = hfg.Graph()
    heard = heard_of(graph.add(time.Clock(), max_rate_hz=2).time, graph)
    hfg.run(graph, clock="virtual", until_s=1.6)
    assert heard.told == [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.5, 1.5)]


# --- stamps ---


def test_times_and_stamps_of_what_arrives() -> None:
    graph = hfg.Graph()
    source = graph.add(script(values=("a", "b")), max_rate_hz=1)
    delayed = graph.add(flow.Delay(seconds=0.25))
    graph.connect(source.out, delayed.value)
    told = {}
    for made in (time.now(), time.elapsed(), time.stamp_of(), time.age()):
        node = graph.add(made)
        graph.connect(delayed.out, node.ports.inputs["value"])
        told[node.place.name] = heard_of(node.out, graph)
    hfg.run(graph, clock="virtual")
    assert {name: [value for _, value in heard.told] for name, heard in told.items()} == {
        "now": [0.25, 1.25],
        "elapsed": [0.25, 1.25],
        "stamp_of": [0.0, 1.0],
        "age": [0.25, 0.25],
    }


@pytest.mark.rule("T5")
def test_a_stamp_can_be_set() -> None:
    graph = hfg.Graph()
    setter = graph.add(time.SetStamp())
    graph.connect(graph.add(script(values=("a", None, "c")), name="values").out, setter.value)
    graph.add(script(values=(7, 8.0, 9.0)), name="stamps")
    graph.connect("stamps.out", "set_stamp.stamp")
    heard = heard_of(setter.out, graph)
    hfg.run(graph, clock="virtual")
    assert [value for _, value in heard.told] == ["a", "c"]
    assert heard.stamps == [7.0, 9.0]


# --- durations ---


def test_times_are_compared_and_shifted() -> None:
    assert fire(time.shift(offset_s=-0.5), time=2.0).outputs == {"out": 1.5}
    assert fire(time.duration(), later=5.0, earlier=3.5).outputs == {"out": 1.5}


def test_without_an_earlier_time_the_present_counts() -> None:
    graph = hfg.Graph()
    since = graph.add(time.duration())
    graph.connect(graph.add(script(values=(0.0, 0.0, 5.0)), max_rate_hz=1).out, since.later)
    heard = heard_of(since.out, graph)
    hfg.run(graph, clock="virtual")
    assert [value for _, value in heard.told] == [0.0, -1.0, 3.0]


def test_a_stopwatch_measures_between_two_signals() -> None:
    graph = hfg.Graph()
    watch = graph.add(time.Stopwatch())
    graph.connect(graph.add(time.Schedule(instants_s=(1.0, 5.0, 6.0)), name="begin").instant, watch.begin)
    graph.connect(graph.add(time.Schedule(instants_s=(0.5, 3.0, 4.0, 8.5)), name="stop").instant, watch.stop)
    heard = heard_of(watch.measured, graph)
    hfg.run(graph, clock="virtual")
    assert heard.told == [(3.0, 2.0), (8.5, 2.5)]


def test_a_stopwatch_may_go_by_the_stamps() -> None:
    node = time.Stopwatch(by_stamp=True)
    fire(node, slot="begin", value=hfg.Token(None, 0, 1.0))
    assert fire(node, slot="stop", value=hfg.Token(None, 0, 1.75)).events == [("measured", 0.75)]
    assert fire(node, slot="stop", value=hfg.Token(None, 0, 2.0)).events == []


def stamped(node: hfg.Node, *stamps: float) -> list[Any]:
    name = next(iter(node.ports.outputs))
    return [fire(node, value=hfg.Token("x", 0, stamp)).outputs.get(name) for stamp in stamps]


def test_the_time_between_values_is_that_of_their_stamps() -> None:
    assert stamped(time.SinceLast(), 1.0, 1.5, 1.25) == [None, 0.5, -0.25]


def test_the_rate_is_a_mean_over_the_last_values() -> None:
    assert stamped(time.RateMeter(size=3), 0.0, 0.5, 1.0, 1.25) == [None, 2.0, 2.0, pytest.approx(2 / 0.75)]
    assert stamped(time.RateMeter(), 1.0, 1.0, 2.0) == [None, None, 2.0]
    with pytest.raises(ValueError, match="must be >= 2"):
        time.RateMeter(size=1)


# --- watching ---


def watched(*instants: float, **parameters: Any) -> tuple[list[Any], list[Any], float]:
    graph = hfg.Graph()
    deadline = graph.add(time.Deadline(**parameters))
    graph.connect(graph.add(time.Schedule(instants_s=instants)).instant, deadline.beat)
    missed, back = heard_of(deadline.missed, graph), heard_of(deadline.back, graph)
    report = hfg.run(graph, clock="virtual")
    return missed.told, back.told, report.duration_s


def test_what_does_not_come_in_time_is_missed_once_and_told_when_it_is_back() -> None:
    assert watched(0.5, 1.0, 4.0, 4.5) == ([(2.0, 1.0), (5.5, 1.0)], [(4.0, 3.0)], 5.5)


def test_a_watch_begins_with_the_run_or_with_the_first_value() -> None:
    assert watched(2.0)[:2] == ([(1.0, 1.0), (3.0, 1.0)], [(2.0, 2.0)])
    assert watched(2.0, from_start=False)[:2] == ([(3.0, 1.0)], [])
    assert watched(from_start=False)[:2] == ([], [])


def test_a_watch_ends_with_its_input_and_takes_silence_for_none() -> None:
    found = run(time.Deadline(seconds=0.03), value="1-2----3-|------")
    assert found == {"out": "1-2----3-|", "missed": "-----?", "back": "-------?"}  # ?: how many seconds
    graph = hfg.Graph()
    deadline = graph.add(time.Deadline(seconds=1.5))
    graph.connect(graph.add(script(values=(1, None, None, 4)), max_rate_hz=1).out, deadline.value)
    missed = heard_of(deadline.missed, graph)
    hfg.run(graph, clock="virtual")
    assert missed.told == [(1.5, 1.5)]


def test_a_sign_of_life_behind_the_end_begins_no_watch() -> None:
    node = time.Deadline(from_start=False)
    fire(node, hook="end")
    assert fire(node, slot="beat").events == []
    assert node.alarm.due is None


@pytest.mark.rule("A3", "A5")
def test_an_active_watch_hands_its_activity_on_when_something_is_missed() -> None:
    found = run(time.Deadline(seconds=0.02), beat="(+!)-----|")
    assert found["activity"] == "+-~"
    assert found["missed"].startswith("--(+")


def test_a_watch_that_is_paused_counts_on() -> None:
    async def main() -> list[Any]:
        graph = hfg.Graph()
        deadline = graph.add(time.Deadline(seconds=1.0))
        missed = heard_of(deadline.missed, graph)
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.5)
            run.pause()
            await asyncio.sleep(2.0)
            assert missed.told == []
            run.resume()
            await run.wait_quiet()
            return missed.told

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == [(2.5, 1.0)]
