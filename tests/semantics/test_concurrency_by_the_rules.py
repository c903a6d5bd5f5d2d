"""Several firings of one node under way at once (rule F14), read by engine and oracle.

What is expected was counted out on paper from the rules alone. Each table gives how long the firing for each value
takes, in seconds, and when what is to be seen.
"""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from annotated_types import Interval

import hfg
from hfg import END, NO_MESSAGE
from hfg.testing import Recorder, replay
from hfg.testing.nodes import (
    Doubter,
    Tally,
    add,
    ascript,
    script,
    sink,
    slow_double,
)
from hfg.trace import CallEnded, CallStarted, ErrorRaised, FiringEnded, NodeEnabled
from tests.limits import patience
from tests.semantics.nodes import drive
from tests.semantics.readings import by_engine, sent, starts

Pauses = tuple[float, ...]


@hfg.node
async def takes(value: int, *, pauses: Pauses = (1.0,)) -> int:
    """Give the value when its pause is over: 1 has the first, 2 the second ..."""
    await asyncio.sleep(pauses[(value - 1) % len(pauses)])
    return value


OUT = "takes.out -> sink.value"


def line(pauses: Pauses, values: tuple[int | None, ...] = (1, 2, 3), behind: Any = None, **options: Any) -> hfg.Graph:
    """A source, who takes its time, and somebody behind."""
    graph = hfg.Graph()
    node = graph.add(takes(pauses=pauses), **options)
    graph.add(script(values=values)) >> node
    node >> graph.add(behind or sink(), name="sink", release="sequential")
    return graph


# --- how many


@pytest.mark.rule("F14", "F5", "P4")
@pytest.mark.parametrize(
    ("concurrency", "begin", "made"),
    [
        # One at a time; the source makes the next while the one before is under way, one more waits on the edge.
        pytest.param(1, [0, 1, 2, 3, 4], [0, 0, 1, 2, 3, 4], id="one"),
        # Two are taken at once, the third lies on the edge until both are over.
        pytest.param(2, [0, 0, 1, 1, 2], [0, 0, 0, 1, 1, 2], id="two"),
        pytest.param(5, [0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], id="all"),
    ],
)
def test_as_many_firings_begin_as_may_be_under_way(
    perform: Any, concurrency: int, begin: list[float], made: list[float]
) -> None:
    def build() -> hfg.Graph:
        return line((1.0,), (1, 2, 3, 4, 5), concurrency=concurrency, release="pipelined")

    assert perform(build, lambda seen: (starts(seen, "takes", kind="process"), starts(seen, "script"))) == (begin, made)


@pytest.mark.rule("F14")
@pytest.mark.parametrize(
    ("ordered", "begin", "given"),
    [
        # 2 is over at 1 and waits for 1, so it still is one of two; the third begins when both have left.
        pytest.param(True, [0, 0, 3], [(3, 1), (3, 2), (4, 3), (4, END)], id="in their order"),
        pytest.param(False, [0, 0, 1], [(1, 2), (2, 3), (3, 1), (3, END)], id="as they are over"),
    ],
)
def test_what_is_over_and_waits_for_its_turn_counts_among_them(
    perform: Any, ordered: bool, begin: list[float], given: list[tuple[float, Any]]
) -> None:
    def build() -> hfg.Graph:
        return line((3.0, 1.0, 1.0), concurrency=2, ordered=ordered)

    assert perform(build, lambda seen: (starts(seen, "takes", kind="process"), sent(seen, OUT))) == (begin, given)


# --- what leaves, and when


@pytest.mark.rule("F14")
@pytest.mark.parametrize(
    ("ordered", "given"),
    [
        pytest.param(True, [(3, 1), (3, 2), (3, 3), (3, END)], id="in their order"),
        pytest.param(False, [(1, 2), (2, 3), (3, 1), (3, END)], id="as they are over"),
    ],
)
def test_outputs_leave_in_order_or_as_they_are_over_and_end_behind_them_all(
    perform: Any, ordered: bool, given: list[tuple[float, Any]]
) -> None:
    def build() -> hfg.Graph:
        return line((3.0, 1.0, 2.0), concurrency=3, ordered=ordered)

    assert perform(build, lambda seen: sent(seen, OUT)) == given


@pytest.mark.rule("F14", "F4")
@pytest.mark.parametrize(
    ("ordered", "given"),
    [
        pytest.param(True, [(2, 1), (2, NO_MESSAGE), (2, 2), (2, END)], id="in their order"),
        pytest.param(False, [(0, NO_MESSAGE), (1, 2), (2, 1), (2, END)], id="as they are over"),
    ],
)
def test_silence_has_its_turn_like_everything_else(perform: Any, ordered: bool, given: list[tuple[float, Any]]) -> None:
    def build() -> hfg.Graph:
        return line((2.0, 1.0), (1, None, 2), concurrency=3, ordered=ordered)

    assert perform(build, lambda seen: sent(seen, OUT)) == given


class Shares(hfg.Node):
    """Gives the value as many seconds later; its share is one at most, which a token may not know."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    share = hfg.Parameter(0.5, Interval(ge=0, le=1))

    async def process(self, value: int) -> int:
        await asyncio.sleep(value)
        return value


@pytest.mark.slow
@pytest.mark.rule("P8", "X1", "F14")
@pytest.mark.parametrize(
    ("options", "given"),
    [
        pytest.param({}, [(1, 1), (1, NO_MESSAGE), (1, NO_MESSAGE), (5, 4), (5, END)], id="one at a time"),
        pytest.param({"concurrency": 4}, [(1, 1), (1, NO_MESSAGE), (1, NO_MESSAGE), (4, 4), (4, END)], id="in order"),
        pytest.param(
            {"concurrency": 4, "ordered": False},
            [(0, NO_MESSAGE), (0, NO_MESSAGE), (1, 1), (4, 4), (4, END)],
            id="as they are over",
        ),
    ],
)
def test_a_firing_fails_whose_token_cannot_set_a_parameter(
    perform: Any, options: dict[str, Any], given: list[tuple[float, Any]]
) -> None:
    def build() -> hfg.Graph:
        graph, shares = hfg.Graph(), Shares()
        values, parts = graph.add(script(values=(1, 2, None, 4))), graph.add(script(values=(1, 7, 8, 0)), name="parts")
        graph.add(shares, name="shares", on_error="skip", **options)
        values >> shares.value
        graph.connect(parts.out, shares.ports.parameters["share"])
        graph.connect(shares.out, graph.add(sink(), name="sink").value)
        return graph

    def read(seen: Recorder) -> Any:
        failed = [
            event.number for event in seen.of(FiringEnded) if event.node == "shares" and event.outcome == "failed"
        ]
        return failed, len(seen.of(ErrorRaised)), sent(seen, "shares.out -> sink.value")

    assert perform(build, read) == ([2, 3], 2, given)


@pytest.mark.rule("F14", "P4", "F5")
@pytest.mark.parametrize("ordered", [True, False])
def test_outputs_still_wait_until_those_before_them_have_been_processed(perform: Any, ordered: bool) -> None:
    def build() -> hfg.Graph:
        return line((1.0,), behind=slow_double(pause_s=2.0), concurrency=3, ordered=ordered)

    found = perform(build, lambda seen: [time for time, _ in sent(seen, OUT)])
    assert found == [1, 3, 5, 7]


@pytest.mark.slow
@pytest.mark.rule("F14", "F1")
def test_no_firing_begins_while_the_outputs_hold_an_unprocessed_token(perform: Any) -> None:
    """All of F1 still holds, but for "not busy": what is over leaves before the next begins."""

    def build() -> hfg.Graph:
        return line((1.0,), (1, 2, 3, 4, 5), behind=slow_double(pause_s=2.0), concurrency=3)

    assert perform(build, lambda seen: starts(seen, "takes", kind="process")) == [0, 0, 0, 7, 7]


class Tells(hfg.Node):
    """Signals before and after its pause, and at the end says how many of its firings are over."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    before = hfg.Event(int)
    after = hfg.Event(int)
    pauses = hfg.Parameter[Pauses]((1.0,))
    over = hfg.State(0)

    async def process(self, value: int) -> int:
        self.before.trigger(value)
        await asyncio.sleep(self.pauses[(value - 1) % len(self.pauses)])
        self.after.trigger(value)
        self.over += 1
        return value

    def end(self) -> None:
        self.out.send(-self.over)


def telling(pauses: Pauses, **options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    node, before, after = graph.add(Tells(pauses=pauses), **options), graph.add(Tally()), graph.add(Tally())
    graph.add(script(values=(1, 2, 3))) >> node.value
    graph.connect(node.before, before.note)
    graph.connect(node.after, after.note)
    node.out >> graph.add(sink()).value
    return graph


@pytest.mark.slow
@pytest.mark.rule("F14", "F3")
def test_signals_leave_when_they_are_triggered_though_the_outputs_wait(perform: Any) -> None:
    def build() -> hfg.Graph:
        return telling((3.0, 1.0, 2.0), concurrency=3)

    def read(seen: Recorder) -> Any:
        return sorted(sent(seen, "tells.before -> tally.note")), sent(seen, "tells.after -> tally_2.note")

    assert perform(build, read) == ([(0, 1), (0, 2), (0, 3)], [(1, 2), (2, 3), (3, 1)])


@pytest.mark.slow
@pytest.mark.rule("F14", "F4")
@pytest.mark.parametrize("ordered", [True, False])
def test_the_last_word_is_said_when_all_firings_are_over_and_leaves_behind_them(perform: Any, ordered: bool) -> None:
    def build() -> hfg.Graph:
        return telling((3.0, 1.0, 2.0), concurrency=3, ordered=ordered)

    def read(seen: Recorder) -> Any:
        return sent(seen, "tells.out -> sink.value")[-2:]

    assert perform(build, read) == [(3, -3), (3, END)]


@pytest.mark.rule("F14", "A9")
def test_processed_follows_the_outputs_of_each_firing(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = line((3.0, 1.0, 2.0), concurrency=3)
        graph.connect(graph["takes"].processed, graph.add(Doubter()).hear)
        return graph

    assert perform(build, lambda seen: sent(seen, "takes.processed -> doubter.hear")) == [(3, None)] * 3


# --- F7


@pytest.mark.slow
@pytest.mark.rule("F7", "F14")
@pytest.mark.parametrize("concurrency", [1, 2, 3, 8])
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_in_their_order_nobody_sees_how_many_there_were(perform: Any, concurrency: int, release: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(takes(pauses=(0.3, 0.0, 0.2, 0.1)), concurrency=concurrency)
        source, total = graph.add(script(values=(4, None, 1, 3, 2, None, None, 1))), graph.add(add(), release=release)
        source >> node
        graph.connect(node.out, total.a)
        graph.connect(source.out, total.b, buffer=9)
        graph.connect(total.out, graph.add(sink()).value)
        return graph

    expected = [8, NO_MESSAGE, 2, 6, 4, NO_MESSAGE, NO_MESSAGE, 2, END]
    assert perform(build, lambda seen: seen.values("add.out -> sink.value")) == expected


@hfg.node
async def chained(value: int, back: int) -> int:
    await asyncio.sleep(1.0)
    return value + back


@pytest.mark.rule("F14", "P7")
def test_a_ring_lets_as_many_begin_as_it_has_tokens(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(chained(), concurrency=8)
        graph.connect(graph.add(script(values=(1, 2, 3, 4))).out, node.value)
        graph.connect(node.out, node.back, initial=[0, 0])
        graph.connect(node.out, graph.add(sink()).value)
        return graph

    def read(seen: Recorder) -> Any:
        return starts(seen, "chained", kind="process"), seen.values("chained.out -> sink.value")

    assert perform(build, read) == ([0, 0, 1, 1], [1, 2, 4, 6, END])


# --- errors and limits, each by itself


@hfg.node
async def fails(value: int, *, pauses: Pauses = (1.0,), at: int = 2) -> int:
    await asyncio.sleep(pauses[(value - 1) % len(pauses)])
    if value == at:
        raise ValueError(f"cannot do {value}")
    return value


def failing(pauses: Pauses, at: int = 2, **options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    node = graph.add(fails(pauses=pauses, at=at), concurrency=3, **options)
    graph.add(script(values=(1, 2, 3))) >> node
    node >> graph.add(sink())
    graph.connect(node.failed, graph.add(Doubter()).hear)
    return graph


FAILING = "fails.out -> sink.value"


@pytest.mark.rule("F14", "X1")
@pytest.mark.parametrize(
    ("ordered", "given"),
    [
        pytest.param(True, [(3, 1), (3, NO_MESSAGE), (3, 3), (3, END)], id="in their order"),
        pytest.param(False, [(1, NO_MESSAGE), (2, 3), (3, 1), (3, END)], id="as they are over"),
    ],
)
def test_a_firing_that_fails_is_silent_in_its_turn_and_the_others_go_on(
    perform: Any, ordered: bool, given: list[tuple[float, Any]]
) -> None:
    def build() -> hfg.Graph:
        return failing((3.0, 1.0, 2.0), ordered=ordered, on_error="skip")

    def read(seen: Recorder) -> Any:
        return sent(seen, FAILING), [event.time for event in seen.of(ErrorRaised)], len(seen.signals("fails.failed"))

    assert perform(build, read) == (given, [1], 1)


@pytest.mark.rule("F14", "X1")
def test_an_error_stops_the_run_at_once_whoever_is_before_it(perform: Any) -> None:
    def build() -> hfg.Graph:
        return failing((3.0, 1.0, 2.0))

    found = perform(build, lambda seen: (seen.outcome, sent(seen, FAILING), seen[-1].time))
    assert found == ("failed", [], 1)


@pytest.mark.rule("F14", "X1", "F10")
def test_a_node_that_an_error_disables_sends_nothing_any_more(perform: Any) -> None:
    def build() -> hfg.Graph:
        return failing((3.0, 2.0, 1.0), ordered=False, on_error="disable")

    def read(seen: Recorder) -> Any:
        over = [(event.time, event.number, event.outcome) for event in seen.of(FiringEnded) if event.node == "fails"]
        over = [one for one in over if one[2] != "ended"]  # END may have been taken before, or not
        return sent(seen, FAILING), [event.time for event in seen.of(NodeEnabled)], over

    assert perform(build, read) == ([(1, 3)], [2], [(1, 3, "done"), (2, 2, "failed"), (3, 1, "abandoned")])


@pytest.mark.rule("F14", "X1")
def test_a_restart_waits_for_the_firings_that_are_under_way(perform: Any) -> None:
    """Failed at 1, it is torn down when the first is over, at 3, and rests from then on; nothing begins in between."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(fails(pauses=(3.0, 1.0, 1.0)), concurrency=2, on_error="restart", restart_backoff_s=0.5)
        graph.add(script(values=(1, 2, 3))) >> node
        node >> graph.add(sink())
        return graph

    found = perform(build, lambda seen: (sent(seen, FAILING), starts(seen, "fails", kind="process")))
    assert found == ([(3, 1), (3, NO_MESSAGE), (4.5, 3), (4.5, END)], [0, 0, 3.5])


@pytest.mark.rule("F14", "X2")
@pytest.mark.parametrize(
    ("ordered", "given"),
    [
        pytest.param(True, [(1, 1), (2, NO_MESSAGE), (2, 3), (2, END)], id="in their order"),
        pytest.param(False, [(1, 1), (1.5, 3), (2, NO_MESSAGE), (2, END)], id="as they are over"),
    ],
)
def test_each_firing_has_its_own_time_limit(perform: Any, ordered: bool, given: list[tuple[float, Any]]) -> None:
    def build() -> hfg.Graph:
        return line((1.0, 9.0, 1.5), concurrency=3, ordered=ordered, max_duration_s=2.0, on_error="skip")

    assert perform(build, lambda seen: sent(seen, OUT)) == given


@pytest.mark.rule("F14", "X2")
def test_the_time_limit_is_for_the_code_not_for_the_wait_behind_it(perform: Any) -> None:
    """Behind the slow one the second waits for two seconds, beyond the limit of the code."""

    def build() -> hfg.Graph:
        return line((1.0,), behind=slow_double(pause_s=4.0), concurrency=3, max_duration_s=1.5)

    assert perform(build, lambda seen: (seen.outcome, [time for time, _ in sent(seen, OUT)])) == ("done", [1, 5, 9, 13])


# --- rates, gates, slots


@pytest.mark.rule("F14", "F11")
def test_a_rate_says_how_often_they_begin(perform: Any) -> None:
    def build() -> hfg.Graph:
        return line((1.0,), (1, 2, 3, 4), concurrency=8, max_rate_hz=4.0)

    found = perform(build, lambda seen: (starts(seen, "takes", kind="process"), sent(seen, OUT)))
    assert found == ([0, 0.25, 0.5, 0.75], [(1, 1), (1.25, 2), (1.5, 3), (1.75, 4), (1.75, END)])


class Listens(hfg.Node):
    """Takes a second for each value, and for each word."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    heard = hfg.Event(int)

    async def process(self, value: int) -> int:
        await asyncio.sleep(1.0)
        return value

    @hfg.slot
    async def hear(self, word: int) -> None:
        self.heard.trigger(word)
        await asyncio.sleep(1.0)


class Rings(hfg.Node):
    """Triggers its event after a while, as often as is wanted."""

    rung = hfg.Event(int)
    times = hfg.Parameter(1)
    after_s = hfg.Parameter(0.5)
    at = hfg.State(0)

    async def process(self) -> None:
        if self.at == self.times:
            raise hfg.EndOfStream
        await asyncio.sleep(0.0 if self.at else self.after_s)
        self.at += 1
        self.rung.trigger(self.at)


def listening(slot: str, times: int = 1, **options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    node: Any = graph.add(Listens(), **options)
    graph.add(script(values=(1, 2))) >> node.value
    node.out >> graph.add(sink()).value
    rings = graph.add(Rings(times=times))
    graph.connect(rings.rung, getattr(node, slot))
    return graph


@pytest.mark.rule("F14", "F9")
@pytest.mark.parametrize(
    ("concurrency", "called"),
    [
        # Behind the firing under way; the next has lost its place by the outputs of that.
        pytest.param(1, [1.0, 2.0], id="one"),
        pytest.param(2, [0.5, 1.5], id="two"),
    ],
)
def test_slot_calls_wait_for_one_another_but_for_no_firing(perform: Any, concurrency: int, called: list[float]) -> None:
    def build() -> hfg.Graph:
        return listening("hear", 2, concurrency=concurrency, release="pipelined")

    def read(seen: Recorder) -> Any:
        return [event.time for event in seen.of(CallStarted) if event.node == "listens"]

    assert perform(build, read) == called


@pytest.mark.rule("F14", "F10")
@pytest.mark.parametrize(
    ("concurrency", "disabled", "given"),
    [
        # The call of `disable` waits for the firing under way, whose outputs leave before.
        pytest.param(1, 1, [(1, 1)], id="one"),
        pytest.param(2, 0.5, [], id="two"),
    ],
)
def test_disabling_applies_to_every_firing_under_way(
    perform: Any, concurrency: int, disabled: float, given: list[tuple[float, Any]]
) -> None:
    def build() -> hfg.Graph:
        return listening("disable", concurrency=concurrency)

    def read(seen: Recorder) -> Any:
        return [event.time for event in seen.of(NodeEnabled)], sent(seen, "listens.out -> sink.value")

    assert perform(build, read) == ([disabled], given)


@pytest.mark.slow
@pytest.mark.rule("F14", "A11")
def test_behind_a_closed_gate_each_firing_is_silent_in_its_turn(perform: Any) -> None:
    """The gate closes behind the second: what has begun goes on, what begins then is silent and leaves behind it."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node, state, rings = graph.add(takes(), concurrency=4), graph.add(Tally()), graph.add(Rings(after_s=0.6))
        graph.add(ascript(values=(1, 2, 3), pause_s=0.25)) >> node
        node >> graph.add(sink())
        graph.start >> state.activate
        graph.connect(rings.rung, state.deactivate)
        graph.gate(node, by=state)
        return graph

    def read(seen: Recorder) -> Any:
        return starts(seen, "takes", kind="silent"), sent(seen, OUT)

    assert perform(build, read) == ([0.75], [(1.25, 1), (1.5, 2), (1.5, NO_MESSAGE), (1.5, END)])


# --- the end of the run


@pytest.mark.rule("F14", "X3")
def test_stopping_the_run_cancels_every_firing_under_way() -> None:
    cancelled: list[int] = []

    class Endless(hfg.Node):
        value = hfg.Input(int)

        async def process(self, value: int) -> None:
            try:
                await asyncio.Event().wait()
            finally:
                cancelled.append(value)

    async def main() -> None:
        graph = hfg.Graph()
        node = graph.add(Endless(), concurrency=3)
        graph.add(script(values=(1, 2, 3))) >> node.value
        async with hfg.running(graph) as run:
            await asyncio.sleep(1.0)
            run.stop()

    drive(main)
    assert sorted(cancelled) == [1, 2, 3]


# --- threads


@pytest.mark.rule("F14", "R1")
def test_in_a_group_with_several_threads_they_really_run_at_the_same_time() -> None:
    """Nobody comes through before three are there."""
    meeting = threading.Barrier(3)

    def meets(value: int) -> int:
        meeting.wait(patience(30))
        return value

    graph = hfg.Graph()
    graph.group("wide", threads=3)
    node = graph.add(hfg.node(meets)(), group="wide", concurrency=3)
    out = graph.output("out", int)
    graph.add(script(values=(1, 2, 3, 4, 5, 6))) >> node
    graph.connect(node.out, out)
    assert hfg.run(graph).outputs["out"] == [1, 2, 3, 4, 5, 6]


@pytest.mark.rule("F14", "R1")
@pytest.mark.parametrize(
    ("threads", "concurrency", "most"),
    [pytest.param(4, 1, 1, id="never with itself"), pytest.param(2, 2, 2, id="never more than threads")],
)
def test_no_more_run_at_once_than_the_node_and_its_group_allow(threads: int, concurrency: int, most: int) -> None:
    lock = threading.Lock()
    running, seen = [0], [0]

    def counts(value: int) -> int:
        with lock:
            running[0] += 1
            seen[0] = max(seen[0], running[0])
        threading.Event().wait(0.001)
        with lock:
            running[0] -= 1
        return value

    graph = hfg.Graph()
    graph.group("wide", threads=threads)
    node = graph.add(hfg.node(counts)(), group="wide", concurrency=concurrency)
    out = graph.output("out", int)
    graph.add(script(values=tuple(range(20)))) >> node
    graph.connect(node.out, out)
    assert hfg.run(graph).outputs["out"] == list(range(20))
    assert 1 <= seen[0] <= most


# --- what such a node cannot have


class Hesitates(hfg.Node):
    value = hfg.Input(int)

    def ready(self) -> bool:
        return True

    async def process(self, value: int) -> None: ...


def with_an_active_edge_in() -> hfg.Graph:
    graph = hfg.Graph()
    node = graph.add(takes(), concurrency=2)
    graph.connect(graph.add(script()).out, node.value, active=True)
    return graph


def with_an_active_edge_out() -> hfg.Graph:
    graph = hfg.Graph()
    node = graph.add(takes(), concurrency=2)
    graph.add(script()) >> node
    graph.connect(node.out, graph.add(sink()).value, active=True)
    return graph


def with_an_active_edge_into_a_slot() -> hfg.Graph:
    graph = hfg.Graph()
    node = graph.add(takes(), concurrency=2)
    graph.add(script()) >> node
    graph.start.activates(node.activate)
    return graph


def with_ready() -> hfg.Graph:
    graph = hfg.Graph()
    graph.add(script()) >> graph.add(Hesitates(), concurrency=2).value
    return graph


@pytest.mark.rule("F14")
@pytest.mark.parametrize(
    "build", [with_an_active_edge_in, with_an_active_edge_out, with_an_active_edge_into_a_slot, with_ready]
)
def test_it_has_no_active_edge_and_no_ready(build: Any) -> None:
    with pytest.raises(hfg.errors.GraphError, match=r"concurrency"):
        hfg.run(build(), clock="virtual")


@pytest.mark.rule("F14", "R5")
def test_firings_that_wait_for_a_place_that_never_comes_are_no_work_under_way(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks, never = graph.add(slow_double(), concurrency=2), graph.add(add(), name="never")
        graph.connect(graph.add(script(values=(1, 2, 3))).out, asks.value)
        graph.connect(asks.out, never.a)
        return graph

    found = perform(build, lambda seen: (seen.outcome, seen.values("slow_double.out -> never.a")))
    assert found == ("stalled", [2])


# --- who is reset, or enabled again, amid its firings


class Opened(hfg.Node):
    """Answers when its pause is over, and tells what has happened since it was set up."""

    value = hfg.Input(int)
    out = hfg.Output(list)
    pauses: hfg.Parameter[Pauses] = hfg.Parameter((1.0,))

    def setup(self) -> None:
        self.since = ["up"]

    def teardown(self) -> None:
        self.since.append("down")

    async def process(self, value: int) -> list[str]:
        await asyncio.sleep(self.pauses[(value - 1) % len(self.pauses)])
        self.since.append("gave")
        return list(self.since)

    @hfg.slot
    def ask(self) -> None:
        self.since.append("asked")


@hfg.node
async def keeps(value: Any, *, for_s: float = 0.0) -> None:
    await asyncio.sleep(for_s)


def called_amid(pauses: Pauses, *slots: str, concurrency: int = 2, for_s: float = 0.0) -> hfg.Graph:
    """Its firings begin at 0; its slots are called at 0.5, 0.75 ... by outputs."""
    graph = hfg.Graph()
    node = graph.add(Opened(pauses=pauses), name="node", concurrency=concurrency)
    graph.connect(graph.add(script(values=(1, 2, 3))).out, node.value)
    node >> graph.add(keeps(for_s=for_s), name="behind", release="sequential")
    for number, slot in enumerate(slots):
        caller = graph.add(ascript(values=(1,), pause_s=0.5 + number / 4), name=f"caller{number}")
        graph.connect(caller.out, node.ports.slots[slot])
    return graph


def calls_of(seen: Recorder, node: str) -> list[tuple[float, float]]:
    """When its calls began and ended."""
    began = [event.time for event in seen.of(CallStarted) if event.node == node]
    return list(zip(began, [event.time for event in seen.of(CallEnded) if event.node == node], strict=True))


ANSWERS = "node.out -> behind.value"


@pytest.mark.slow
@pytest.mark.rule("F14", "A9", "F9")
def test_a_reset_begins_at_once_and_is_over_behind_the_code_of_all_firings(perform: Any) -> None:
    """No firing and no other call begins meanwhile, and nobody works on what was torn down under its hands."""

    def build() -> hfg.Graph:
        return called_amid((3.0, 1.0, 1.0), "reset", "ask")

    given = [(3, ["up", "gave", "gave"]), (3, ["up", "gave"]), (4, ["up", "asked", "gave"]), (4, END)]
    assert perform(build, lambda seen: sent(seen, ANSWERS)) == given
    assert perform(build, lambda seen: calls_of(seen, "node")) == [(0.5, 3), (3, 3)]
    assert perform(build, lambda seen: starts(seen, "node", kind="process")) == [0, 0, 3]


@pytest.mark.slow
@pytest.mark.rule("F14", "A9")
def test_a_reset_does_not_wait_for_what_is_over_and_has_not_left(perform: Any) -> None:
    """The second is over at 0.25 and waits behind the first, which the consumer keeps for five seconds."""

    def build() -> hfg.Graph:
        return called_amid((0.125, 0.25, 1.0), "reset", for_s=5.0)

    assert perform(build, lambda seen: calls_of(seen, "node")) == [(0.5, 0.5)]
    assert perform(build, lambda seen: [time for time, _ in sent(seen, ANSWERS)[:2]]) == [0.125, 5.125]


@pytest.mark.rule("F14", "A9", "F4")
def test_a_reset_before_the_turn_of_its_end_has_come_ends_that() -> None:
    """It has not ended then (A9), and the firing that was to end it is told to be over.

    The engine takes END as soon as it can; by the rules it may as well lie there until the others are over.
    """
    seen = by_engine(called_amid((0.25, 0.25, 0.25), "reset", concurrency=4, for_s=5.0), 0)
    over = [(event.time, event.number, event.outcome) for event in seen.of(FiringEnded) if event.node == "node"]
    assert over == [(0.25, 1, "done"), (0.5, 4, "abandoned"), (5.25, 2, "done"), (10.25, 3, "done")]
    assert END not in [value for _, value in sent(seen, ANSWERS)]
    assert seen.outcome == "done"
    replay(lambda: called_amid((0.25, 0.25, 0.25), "reset", concurrency=4, for_s=5.0), seen)


@pytest.mark.slow
@pytest.mark.rule("F14", "F10")
def test_who_is_enabled_again_amid_its_firings_comes_back_behind_them(perform: Any) -> None:
    def build() -> hfg.Graph:
        return called_amid((3.0, 1.0), "disable", "enable")

    assert perform(build, lambda seen: calls_of(seen, "node")) == [(0.5, 0.5), (0.75, 3)]
    assert perform(build, lambda seen: [(event.time, event.enabled) for event in seen.of(NodeEnabled)]) == [
        (0.5, False),
        (3, True),
    ]


@pytest.mark.slow
@pytest.mark.rule("F14", "G2")
def test_a_reset_of_a_subgraph_waits_for_none_of_its_firings(perform: Any) -> None:
    """Each node inside is reset as soon as none of its firings is under way; the call is over at once."""

    def build() -> hfg.Graph:
        class Box(hfg.Subgraph):
            value = hfg.Input(int)
            out = hfg.Output(list)

            def build(self, graph: hfg.Graph) -> None:
                node = graph.add(Opened(pauses=(3.0, 1.0)), name="node", concurrency=2)
                graph.connect(self.value.inner, node.value)
                graph.connect(node.out, self.out.inner)

        graph = hfg.Graph()
        box = graph.add(Box(), name="box")
        graph.add(script(values=(1, 2, 3))) >> box
        box >> graph.add(keeps(), name="behind")
        graph.connect(graph.add(ascript(values=(1,), pause_s=0.5)).out, box.reset)
        return graph

    def read(seen: Recorder) -> Any:
        return calls_of(seen, "box"), sent(seen, "box/node.out -> behind.value")

    given = [(3, ["up", "gave", "gave"]), (3, ["up", "gave"]), (6, ["up", "gave"]), (6, END)]
    assert perform(build, read) == ([(0.5, 0.5)], given)
