"""A replay accepts what the rules permit and says where a run leaves them; the fakes here break one rule each."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import hfg
from hfg.base.token import Token
from hfg.testing import Divergence, Recorder, recorder, replay
from hfg.testing.nodes import (
    Doubter,
    Relay,
    Script,
    Tally,
    ascript,
    double,
    script,
    sink,
    some,
)
from hfg.trace import (
    ActivityChanged,
    CallStarted,
    FiringStarted,
    NodeEnded,
    RunEnded,
    TokenProcessed,
    TokenSent,
    TraceEvent,
)
from tests.support.operators import through


def build() -> hfg.Graph:
    graph = hfg.Graph()
    source, middle, relay, tally = (
        graph.add(Script(count=3)),
        graph.add(double()),
        graph.add(Relay()),
        graph.add(Tally()),
    )
    graph.connect(source.out, middle.value)
    graph.connect(middle.out, relay.say)
    graph.connect(relay.said, tally.value, active=True)
    graph.start.activates(relay.activate)
    return graph


@pytest.fixture
def trace() -> Recorder:
    seen = recorder()
    hfg.run(build(), clock="virtual", trace=seen)
    return seen


def first(trace: Recorder, kind: type[TraceEvent]) -> int:
    return next(index for index, event in enumerate(trace) if isinstance(event, kind))


def test_a_run_of_the_engine_is_accepted(trace: Recorder) -> None:
    replay(build, trace)


def exchange_first_firing(trace: Recorder) -> None:
    """The middle fires before anything was sent to it."""
    index = first(trace, FiringStarted)
    trace[index] = FiringStarted(trace[index].time, "double", 1, "process")


def lose_a_token(trace: Recorder) -> None:
    del trace[first(trace, TokenSent)]


def never_free_an_edge(trace: Recorder) -> None:
    del trace[first(trace, TokenProcessed)]


def keep_activity(trace: Recorder) -> None:
    del trace[next(i for i, e in enumerate(trace) if isinstance(e, ActivityChanged) and not e.active)]


def carry_activity_where_none_is(trace: Recorder) -> None:
    sent = next(event for event in trace if isinstance(event, TokenSent) and event.edge.startswith("script"))
    old = sent.token
    trace[trace.index(sent)] = TokenSent(sent.time, sent.edge, Token(old.value, 1, old.stamp, old.sequence))


def forget_an_end(trace: Recorder) -> None:
    del trace[first(trace, NodeEnded)]


def call_twice(trace: Recorder) -> None:
    index = first(trace, CallStarted)
    trace.insert(index, trace[index])


def end_early(trace: Recorder) -> None:
    trace.insert(len(trace) // 2, RunEnded(0.0, "done"))


def end_otherwise(trace: Recorder) -> None:
    trace[-1] = RunEnded(trace[-1].time, "stalled")


def let_time_pass(trace: Recorder) -> None:
    started = next(event for event in trace if isinstance(event, FiringStarted))
    trace[trace.index(started)] = FiringStarted(5.0, started.node, 1, "process")


def stop_short(trace: Recorder) -> None:
    del trace[-1]


@pytest.mark.parametrize(
    "fault",
    [
        exchange_first_firing,
        lose_a_token,
        never_free_an_edge,
        keep_activity,
        carry_activity_where_none_is,
        forget_an_end,
        call_twice,
        end_early,
        end_otherwise,
        let_time_pass,
        stop_short,
    ],
)
def test_a_run_that_breaks_a_rule_is_found_out(trace: Recorder, fault: Callable[[Recorder], None]) -> None:
    fault(trace)
    with pytest.raises(Divergence, match=r"\(rules [A-Z0-9, -]+\)"):
        replay(build, trace)


def test_a_divergence_names_rule_event_and_what_was_permitted(trace: Recorder) -> None:
    exchange_first_firing(trace)
    with pytest.raises(Divergence) as caught:
        replay(build, trace)
    text = str(caught.value)
    assert "the run moved when the rules forbid it (rules F1" in text
    assert "FiringStarted double 1 process" in text
    assert 'permitted now: fire "script"' in text
    assert caught.value.found == FiringStarted(0.0, "double", 1, "process")


@pytest.mark.parametrize("seed", range(20))
def test_every_schedule_of_the_engine_is_accepted(seed: int) -> None:
    seen = recorder()
    hfg.run(build(), clock="virtual", policy="random", seed=seed, trace=seen)
    replay(build, seen)


@pytest.mark.rule("R6")
def test_a_run_that_is_cut_short_is_accepted() -> None:
    def endless() -> hfg.Graph:
        graph = hfg.Graph()
        graph.connect(graph.add(Script(count=10**6), max_rate_hz=10.0).out, graph.add(some()).value)
        return graph

    seen = recorder()
    hfg.run(endless(), clock="virtual", until_s=2.05, trace=seen)
    replay(endless, seen, until_s=2.05)


def test_a_graph_itself_will_do(trace: Recorder) -> None:
    graph, seen = hfg.Graph(), recorder()
    graph.connect(graph.add(script()).out, graph.add(sink()).value)
    hfg.run(graph, clock="virtual", trace=seen)
    replay(graph, seen)


@pytest.mark.rule("R6", "F11")
@pytest.mark.parametrize("policy", ["fifo", "random"])
def test_two_grids_that_meet_but_for_the_last_digit_are_accepted(policy: str) -> None:
    """The third place of a grid of 70 Hz, and the second of one that begins at its second, are a nanosecond apart."""

    def grids() -> hfg.Graph:
        graph = hfg.Graph()
        first = graph.add(script(values=(None, 0)), max_rate_hz=70.0)
        second = graph.add(Script(count=2), max_rate_hz=70.0, enabled=False)
        graph.connect(first.ports.events["out.sent"], second.enable)
        graph.connect(first.out, graph.add(sink()).value)
        return graph

    seen = recorder()
    hfg.run(grids(), clock="virtual", policy=policy, seed=1 if policy == "random" else None, trace=seen)
    starts = {event.node: event.time for event in seen.of(FiringStarted)}
    assert starts["sink"] - starts["script"] == 0
    assert 0 < starts["script"] - [event.time for event in seen.of(FiringStarted) if event.node == "script_2"][1] < 2e-9
    replay(grids, seen)


@pytest.mark.rule("P9", "R5")
def test_an_end_is_accepted_though_a_source_for_nobody_might_go_on_and_operators_have_nothing_to_give() -> None:
    def left_over() -> hfg.Graph:
        graph = hfg.Graph()
        source, tally, late = (
            graph.add(ascript(values=())),
            graph.add(Tally()),
            graph.add(Script(count=2), max_rate_hz=9.0),
        )
        graph.connect(source.out, tally.value)
        graph.connect(late.seen, source.ports.slots["reset"])
        graph.connect(graph.start, graph.add(Doubter()).hear, through=[through("skip", 1)])
        return graph

    seen = recorder()
    hfg.run(left_over(), clock="virtual", trace=seen)
    assert seen.firings("ascript") == 1
    replay(left_over, seen)


@pytest.mark.rule("A12", "R6")
@pytest.mark.parametrize("seed", range(10))
def test_a_time_out_at_the_moment_at_which_a_firing_is_over_is_accepted_before_it_and_behind_it(seed: int) -> None:
    def at_once() -> hfg.Graph:
        graph = hfg.Graph()
        source, tally = graph.add(ascript(values=(1, 1), pause_s=0.01), active_for_s=0.02), graph.add(Tally())
        graph.connect(source.ports.events["timeout"], tally.ports.slots["reset"])
        graph.connect(graph.start, source.ports.slots["activate"])
        return graph

    seen = recorder()
    hfg.run(at_once(), clock="virtual", policy="random", seed=seed, trace=seen)
    replay(at_once, seen)
