"""What one can do with a run works wherever its nodes live (rules L1, P8, P10, R3, R5, R7, A14)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from annotated_types import Interval

import hfg
from hfg.errors import NotRunning, UsageError
from hfg.recording import File, play_into
from hfg.recording import record as record_run
from hfg.testing.nodes import sink
from hfg.trace import FiringEnded, ParameterSet, RunEnded, RunStarted, TokenSent, TokenTaken, TraceEvent
from tests.semantics.nodes import drive


class Scaler(hfg.Node):
    """Multiplies; tells of what is large."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    large = hfg.Event(int)

    gain = hfg.Parameter(2, Interval(ge=0, le=100))

    def process(self, value: int) -> int:
        if value * self.gain > 50:
            self.large.trigger(value * self.gain)
        return value * self.gain

    @hfg.slot
    def again(self, value: int) -> None:
        self.large.trigger(value * self.gain)


@hfg.node
def numbers(*, count: int = 20) -> Iterator[int]:
    yield from range(count)


@hfg.node
def drop(value: Any) -> None:
    pass


@hfg.node
def loose(value: int) -> Any:
    return object()


def fed() -> hfg.Graph:
    """What is fed into the main part is scaled in another one and comes back."""
    graph = hfg.Graph("fed")
    graph.group("far", process=True)
    scaler = graph.add(Scaler(), name="scaler", group="far")
    graph.connect(graph.input("in", int), scaler.value)
    graph.connect(scaler.out, graph.output("out", int))
    return graph


def with_run(graph: hfg.Graph, body: Callable[[hfg.Run], Any], **options: Any) -> Any:
    async def main() -> Any:
        async with hfg.running(graph, clock="virtual", **options) as run:
            return await body(run)

    return drive(main)


async def through(run: hfg.Run, *values: int) -> list[int]:
    """Feed values, and give what comes out."""
    found: list[int] = []

    async def read() -> None:
        async for value in run.read("out"):
            found.append(value)
            if len(found) == len(values):
                return

    reading = asyncio.create_task(read())
    async with run.feed("in", end=False) as feed:
        for value in values:
            await feed.send(value)
    await reading
    return found


# --- bringing in ---


@pytest.mark.rule("P8", "L1")
def test_a_parameter_is_set_where_its_node_lives_behind_what_was_fed_before() -> None:
    async def body(run: hfg.Run) -> list[int]:
        first = await through(run, 1, 2)
        run.set("scaler.gain", 5)
        return first + await through(run, 3)

    assert with_run(fed(), body) == [2, 4, 15]


@pytest.mark.rule("P8", "L1")
def test_a_parameter_that_is_set_before_the_run_begins_holds_from_the_first_firing() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, scaler = graph.add(numbers(count=3)), graph.add(Scaler(), name="scaler", group="far")
    graph.connect(source.out, scaler.value)
    graph.connect(scaler.out, graph.output("out", int))
    report = hfg.run(graph, clock="virtual", begin=lambda run: run.set("scaler.gain", 10))
    assert report.outputs == {"out": [0, 10, 20]}
    assert scaler.gain == 10


@pytest.mark.rule("P8", "L1")
def test_what_this_side_can_refuse_is_refused_at_once_and_nothing_is_set() -> None:
    async def body(run: hfg.Run) -> list[int]:
        with pytest.raises(ValueError, match=r'parameter "scaler.gain" .*100'):
            run.set("scaler.gain", 101)
        with pytest.raises(hfg.errors.GraphError, match="gone"):
            run.set("scaler.gone", 1)
        return await through(run, 1)

    assert with_run(fed(), body) == [2]


def heard_of(place: str, value: int, **said: Any) -> hfg.Token[Any]:
    """Trigger a slot or event of another process from outside, and give what its event `large` says then."""

    async def body(run: hfg.Run) -> hfg.Token[Any]:
        heard = asyncio.create_task(run.wait_for("scaler.large"))
        await asyncio.sleep(0)
        await run.trigger(place, value, **said)
        return await heard

    token: hfg.Token[Any] = with_run(fed(), body)
    return token


@pytest.mark.rule("F8", "P10", "L1")
def test_a_signal_from_outside_goes_into_a_slot_of_another_process_and_an_event_comes_back() -> None:
    token = heard_of("scaler.again", 21, stamp=7.0)
    assert (token.value, token.stamp) == (42, 7.0)


@pytest.mark.rule("F8", "P10", "L1")
def test_an_event_of_another_process_is_triggered_as_its_node_would() -> None:
    token = heard_of("scaler.large", 3, activity=1)
    assert (token.value, token.activity) == (3, 1)


@pytest.mark.rule("R5", "L1")
def test_a_signal_on_its_way_is_waited_for_before_the_run_ends() -> None:
    """The graph is quiet and nobody holds it open but for the signal."""
    graph = fed()
    heard: list[int] = []
    tasks = []

    def begin(run: hfg.Run) -> None:
        graph["scaler"].large.subscribe(lambda token: heard.append(token.value))
        tasks.append(asyncio.ensure_future(run.trigger("scaler.again", 4)))

    hfg.run(graph, clock="virtual", begin=begin)
    assert heard == [8]


@pytest.mark.rule("L1")
def test_a_value_of_the_wrong_type_is_refused_here() -> None:
    async def body(run: hfg.Run) -> None:
        with pytest.raises(TypeError, match='slot "scaler.again" expects int, got'):
            await run.trigger("scaler.again", "text")

    with_run(fed(), body)


@pytest.mark.rule("R5", "L1")
def test_whoever_waits_for_an_event_of_another_process_hears_of_the_end() -> None:
    async def body(run: hfg.Run) -> None:
        heard = asyncio.create_task(run.wait_for("scaler.large"))
        await asyncio.sleep(0)
        run.stop()
        with pytest.raises(NotRunning, match='the run ended before "scaler.large" was triggered'):
            await heard

    with_run(fed(), body)


@pytest.mark.rule("F5", "L1")
def test_barriers_of_another_process_are_waited_for() -> None:
    async def body(run: hfg.Run) -> list[str]:
        told: list[str] = []

        async def inputs() -> None:
            await run.wait_inputs("scaler")
            told.append("inputs")

        waiting = asyncio.create_task(inputs())
        await asyncio.sleep(1)
        told.append("fed")
        await through(run, 1)
        await waiting
        await run.wait_outputs("scaler")
        return told

    assert with_run(fed(), body) == ["fed", "inputs"]


@pytest.mark.rule("A14", "L1")
def test_activity_is_taken_away_in_all_processes() -> None:
    async def body(run: hfg.Run) -> Any:
        await run.trigger("scaler.again", 1, activity=1)
        await run.refresh()
        before = run.active()
        run.reset_activity()
        await run.refresh()
        return before, run.active()

    assert with_run(fed(), body) == (["scaler"], [])


@pytest.mark.rule("R5", "L1")
def test_quiet_is_that_of_the_whole() -> None:
    async def body(run: hfg.Run) -> int:
        for value in range(3):
            await run.trigger("scaler.again", value)
        await run.wait_quiet()
        await run.refresh()
        return run.report().nodes["scaler"].calls

    assert with_run(fed(), body) == 3


# --- looking ---


def counted(count: int = 5) -> hfg.Graph:
    graph = hfg.Graph("counted")
    graph.group("far", process=True)
    source, scaler = graph.add(numbers(count=count)), graph.add(Scaler(), name="scaler", group="far")
    graph.connect(source.out, scaler.value)
    graph.connect(scaler.out, graph.output("out", int))
    return graph


@pytest.mark.rule("R7", "L1")
def test_the_trace_shows_what_happens_in_all_processes_once() -> None:
    trace: list[TraceEvent] = []
    hfg.run(counted(), clock="virtual", trace=trace)
    for kind in (TokenSent, TokenTaken):
        for label in ("numbers.out -> scaler.value", "scaler.out -> out"):
            values = [event.token.value for event in trace if isinstance(event, kind) and event.edge == label]
            scale = 1 if label.startswith("numbers") else 2
            assert values == [*(scale * number for number in range(5)), hfg.END]
    ended = [event.number for event in trace if isinstance(event, FiringEnded) and event.node == "scaler"]
    assert ended == [1, 2, 3, 4, 5, 6]
    assert [type(event) for event in trace if isinstance(event, RunStarted | RunEnded)] == [RunStarted, RunEnded]


@pytest.mark.rule("R7", "P8", "L1")
def test_the_trace_shows_values_of_parameters_and_the_text_of_what_cannot_be_encoded() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, odd = graph.add(numbers(count=1)), graph.add(loose(), group="far")
    scaler = graph.add(Scaler(), name="scaler", group="far")
    graph.connect(source.out, odd.value)
    graph.connect(odd.out, graph.add(drop(), group="far").value)
    trace: list[TraceEvent] = []
    events: list[Any] = []

    def begin(run: hfg.Run) -> None:
        run.trace(events.append)
        run.set("scaler.gain", 9)

    hfg.run(graph, clock="virtual", trace=trace, begin=begin)
    assert [event.value for event in trace if isinstance(event, ParameterSet) and event.node == "scaler"] == [9]
    (shown, end) = [
        event.token.value for event in trace if isinstance(event, TokenSent) and event.edge == "loose.out -> drop.value"
    ]
    assert shown.startswith("<object object")
    assert end is hfg.END
    assert events == trace
    assert scaler.gain == 9


@pytest.mark.rule("R7", "L1")
def test_nobody_pays_for_a_trace_that_nobody_sees_any_more() -> None:
    async def body(run: hfg.Run) -> tuple[int, int]:
        seen: list[TraceEvent] = []
        listener = run.trace(seen)
        await through(run, 1)
        listener.remove()
        await through(run, 2)
        await run.wait_quiet()
        before = len(seen)
        await through(run, 3)
        return before, len(seen)

    before, after = with_run(fed(), body)
    assert before == after > 0


@pytest.mark.rule("R7", "L1")
@pytest.mark.parametrize("place", ["scaler.out", "numbers.out -> scaler.value", "scaler.value", "scaler.out -> out"])
def test_a_tap_sees_what_passes_in_another_process(place: str) -> None:
    async def main() -> list[Any]:
        graph = counted()
        taps: list[Any] = []
        report = asyncio.create_task(
            hfg.run_async(graph, clock="virtual", begin=lambda run: taps.append(run.tap(place)))
        )
        await asyncio.sleep(0)
        values = [token.value async for token in taps[0]]
        await report
        assert taps[0].seen == 6
        return values

    scale = 1 if "value" in place else 2
    assert drive(main) == [*(scale * number for number in range(5)), hfg.END]


@pytest.mark.rule("R7", "L1")
def test_a_tap_that_is_slow_loses_the_oldest_and_counts_them() -> None:
    taps: list[Any] = []
    hfg.run(counted(count=500), clock="virtual", begin=lambda run: taps.append(run.tap("scaler.out", size=3)))
    (tap,) = taps
    assert tap.seen == 501
    assert tap.skipped == 498
    assert tap.latest is not None
    assert tap.latest.value is hfg.END


@pytest.mark.rule("R7", "L1")
def test_a_tap_of_what_is_not_there_is_refused_at_once() -> None:
    async def body(run: hfg.Run) -> None:
        with pytest.raises(hfg.errors.GraphError, match="scaler.gone"):
            run.tap("scaler.gone")
        with pytest.raises(UsageError, match='"scaler" is a node'):
            run.tap("scaler")

    with_run(fed(), body)


@pytest.mark.rule("R7", "L1")
def test_statistics_and_glance_have_the_nodes_of_all_processes_in_their_order() -> None:
    async def body(run: hfg.Run) -> Any:
        first = run.statistics()
        assert first.ages_s == {}
        await through(run, 1, 2, 3)
        await run.refresh()
        now = run.statistics()
        glance = run.glance()
        assert now.nodes["scaler"].firings == 3
        assert now.nodes["scaler"].group == "far"
        assert now.groups["far"].firings == 3
        assert now.edges["in -> scaler.value"].sent == 3
        assert now.ages_s == {"far": 0.0}
        assert [(node.path, node.done, node.group) for node in glance.nodes] == [("scaler", 3, "far")]
        await asyncio.sleep(2)
        assert run.statistics().ages_s == {"far": 2.0}
        await asyncio.sleep(1)
        assert run.statistics().ages_s == {"far": 1.0}, "asking has brought newer ones"
        return run.report().errors

    assert with_run(fed(), body) == []


# --- holding it still ---


@pytest.mark.rule("R3", "L1")
def test_a_pause_holds_all_processes_and_a_step_is_made_where_the_node_lives() -> None:
    async def body(run: hfg.Run) -> None:
        run.pause()
        assert await run.wait_paused() == "pause"
        async with run.feed("in", end=False) as feed:
            sending = asyncio.create_task(feed.send(4))
            await asyncio.sleep(1)
            await run.refresh()
            assert run.report().nodes["scaler"].firings == 0
            wave = await run.step()
            await asyncio.sleep(1)
            step = await run.step("scaler") if not wave.moved else wave
            assert step.moved == ("scaler",)
            assert (await run.step("scaler")).why_not
            run.resume()
            assert [value async for value in first(run)] == [8]
            await sending

    async def first(run: hfg.Run) -> Any:
        async for value in run.read("out"):
            yield value
            return

    with_run(fed(), body)


@pytest.mark.rule("R3", "L1")
@pytest.mark.parametrize("place", ["scaler", "scaler.out", "scaler.out -> out", "in -> scaler.value"])
def test_a_breakpoint_anywhere_pauses_all_processes(place: str) -> None:
    async def body(run: hfg.Run) -> None:
        point = run.break_at(place)
        assert run.breakpoints == [point]
        async with run.feed("in", end=False) as feed:
            sending = asyncio.create_task(feed.send(4))
            assert await run.wait_paused() == place
            assert run.paused
            assert point.hits == 1
            point.remove()
            assert run.breakpoints == []
            run.resume()
            async for value in run.read("out"):
                assert value == 8
                break
            await sending

    with_run(fed(), body)


@pytest.mark.rule("R3", "L1")
def test_steps_that_cannot_be_are_refused_as_in_one_process() -> None:
    async def body(run: hfg.Run) -> None:
        with pytest.raises(UsageError, match=r"scaler cannot step while the run is not paused: run.pause\(\) first"):
            await run.step("scaler")
        with pytest.raises(UsageError, match="cannot go to the process of group"):
            run.break_at("scaler.out", when=lambda token: True)

    with_run(fed(), body)


# --- the end ---


@pytest.mark.rule("R5", "L1")
def test_the_slot_stop_ends_all_wherever_it_is_reached() -> None:
    graph = counted(count=10_000)
    graph.connect(graph["scaler"].large, graph.stop)
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "stopped"
    assert report.nodes["scaler"].firings < 1000


@pytest.mark.rule("A10", "L1")
def test_the_slot_abort_fails_the_run_wherever_it_is_reached() -> None:
    graph = counted(count=10_000)
    graph.connect(graph["scaler"].large, graph.abort)
    with pytest.raises(hfg.errors.Aborted):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("R4", "L1")
def test_new_code_and_recordings_of_a_graph_in_several_processes_are_refused_and_change_nothing() -> None:
    async def body(run: hfg.Run) -> list[int]:
        said = 'graph "fed" cannot be given new code while it runs in several processes .*"far".*: end the run'
        with pytest.raises(UsageError, match=said):
            await run.reload("tests")
        for record in (run.record, partial(record_run, run)):
            for select in ("*", "scaler", ["scaler.large"]):
                with pytest.raises(UsageError, match=r'(?s)\(group "far"\), .* without "scaler\..*take process=True'):
                    record("never.mcap", select=select)
        with pytest.raises(hfg.errors.HfgError):
            run.graph.reload("tests")
        return await through(run, 1)

    assert with_run(fed(), body) == [2]
    assert not Path("never.mcap").exists()


@pytest.mark.rule("L1")
def test_ports_of_the_main_process_are_recorded(tmp_path: Path) -> None:
    graph = counted(count=5)
    graph.add(sink(), name="here")
    graph.connect(graph["numbers"].out, graph["here"].value)
    hfg.run(graph, clock="virtual", begin=lambda run: run.record(tmp_path / "a.mcap", select="numbers"))
    with File(tmp_path / "a.mcap") as recording:
        assert [(port.path, port.values) for port in recording.info().ports] == [("numbers.out", 5)]


@pytest.mark.rule("L1")
def test_a_recorded_node_of_another_process_is_played_in_the_main_one(tmp_path: Path) -> None:
    def build(group: str) -> hfg.Graph:
        graph = hfg.Graph("played")
        graph.group("far", process=True)
        source, scaler = graph.add(numbers(count=3), group=group), graph.add(Scaler(), name="scaler", group="far")
        graph.connect(source.out, scaler.value)
        graph.connect(scaler.out, graph.output("out", int))
        return graph

    whole = build("loop")
    whole.move("scaler", group="loop")
    hfg.run(whole, clock="virtual", begin=lambda run: run.record(tmp_path / "a.mcap"))
    graph = build("far")
    play_into(graph, tmp_path / "a.mcap")
    assert hfg.run(graph, clock="virtual").outputs["out"] == [0, 2, 4]
