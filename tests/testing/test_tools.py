"""Recorder, invariants, explore, strategies, the pytest plugin."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
from hypothesis import HealthCheck, find, given, settings
from hypothesis.errors import NoSuchExample

import hfg
from hfg.base.token import NO_MESSAGE, Token
from hfg.testing import Recorder, ScheduleFailure, explore, graphs, recorder, reference_run, schedules, tokens
from hfg.testing.invariants import ALL, broken, of_graph
from hfg.testing.nodes import (
    Counter,
    Pulse,
    Relay,
    Script,
    Tally,
    add,
    double,
    script,
    sink,
    slow_double,
)
from hfg.testing.plans import GraphPlan
from hfg.trace import (
    ActivityChanged,
    CallStarted,
    FiringEnded,
    FiringStarted,
    NodeEnded,
    RunEnded,
    TokenProcessed,
    TokenSent,
    TokenTaken,
    TraceEvent,
)
from tests.support.making import Allowed, random_plan

# --- recorder


def relays() -> hfg.Graph:
    graph = hfg.Graph()
    source, relay, tally = graph.add(Script(count=2)), graph.add(Relay()), graph.add(Tally())
    graph.connect(source.out, relay.say)
    graph.connect(relay.said, tally.note, active=True)
    graph.start.activates(relay.activate)
    return graph


def test_a_recorder_answers_questions_about_a_run() -> None:
    seen = recorder()
    hfg.run(relays(), clock="virtual", trace=seen)
    assert seen.outcome == "done"
    assert seen.values("relay.said -> tally.note") == [1, 2]
    assert seen.values("relay.said") == [1, 2]
    assert seen.signals("script.seen") == [2]
    assert seen.taken("relay.said -> tally.note") == [1, 2]
    assert seen.calls("relay") == ["activate", "say", "say"]
    assert seen.firings("script") == 3
    assert [(node, active) for _, node, active in seen.activity()] == [
        ("relay", True),
        ("relay", False),
        ("tally", True),
    ]
    assert seen.activity("tally") == [(0.0, "tally", True)]
    assert seen.active_at_end() == ["tally"]
    assert seen.edges()[0] == "start -> relay.activate"


# --- invariants: each finds the fake that breaks it


def token(number: int, value: Any = 1, activity: int = 0) -> Token[Any]:
    return Token(value, activity, 0.0, number)


FAKES: list[tuple[str, list[TraceEvent]]] = [
    ("no token lost", [TokenSent(0, "e", token(1)), RunEnded(0, "done")]),
    ("no token lost", [TokenSent(0, "e", token(1)), TokenTaken(0, "e", token(1)), TokenTaken(0, "e", token(1))]),
    ("no token lost", [TokenTaken(0, "e", token(7))]),
    (
        "order is kept",
        [
            TokenSent(0, "e", token(1)),
            TokenSent(0, "e", token(2)),
            TokenTaken(0, "e", token(2)),
            TokenTaken(0, "e", token(1)),
        ],
    ),
    ("numbers rise", [TokenSent(0, "e", token(2))]),
    ("modifiers fit", [TokenSent(0, "e", token(1, NO_MESSAGE, 1))]),
    ("activity changes alternate", [ActivityChanged(0, "n", False, "token")]),
    ("one thing at a time", [FiringStarted(0, "n", 1, "process"), FiringStarted(0, "n", 2, "process")]),
    ("ended nodes rest", [NodeEnded(0, "n"), FiringStarted(0, "n", 2, "process")]),
    ("time never goes back", [NodeEnded(1.0, "n"), NodeEnded(0.5, "m")]),
]


@pytest.mark.parametrize(("name", "events"), FAKES)
def test_an_invariant_finds_what_breaks_it(name: str, events: list[TraceEvent]) -> None:
    assert any(sentence.startswith(name) for sentence in broken(events))


def test_every_invariant_has_a_fake_that_breaks_it() -> None:
    assert {name.replace(" ", "_") for name, _ in FAKES} == {invariant.__name__ for invariant in ALL}


@pytest.mark.rule("P4")
def test_two_unprocessed_tokens_on_a_synchronous_edge_are_found() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(script()).out, graph.add(sink()).value)
    edge = "script.out -> sink.value"
    one: list[TraceEvent] = [TokenSent(0, edge, token(1)), TokenProcessed(0, edge), TokenSent(0, edge, token(2))]
    assert not broken(one, of_graph(graph))
    assert broken([*one[:1], *one[2:]], of_graph(graph))


@pytest.mark.rule("F9", "F14")
def test_a_firing_more_than_allowed_and_one_amid_a_call_are_found() -> None:
    graph = hfg.Graph()
    graph.add(slow_double(), name="n", concurrency=2)
    two: list[TraceEvent] = [FiringStarted(0, "n", 1, "process"), FiringStarted(0, "n", 2, "process")]
    call: list[TraceEvent] = [CallStarted(0, "n", 1, "reset", "a.b -> n.reset")]
    third: list[TraceEvent] = [FiringStarted(0, "n", 3, "process")]
    assert not broken([*two, *call], of_graph(graph))
    assert broken([*two, *third], of_graph(graph))
    assert broken([*call, *third], of_graph(graph))
    assert not broken([*two, FiringEnded(0, "n", 1, "done"), *third], of_graph(graph))


@pytest.mark.rule("T1", "A7")
def test_a_modifier_on_an_edge_that_is_not_active_is_found() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(script()).out, graph.add(sink()).value)
    events: list[TraceEvent] = [TokenSent(0, "script.out -> sink.value", token(1, activity=1))]
    assert "is not active but carries 1" in "".join(broken(events, of_graph(graph)))


# --- explore


@pytest.mark.rule("F7")
def test_a_synchronous_graph_has_one_result() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        left, right, total = graph.add(script()), graph.add(script(values=(5, None, 6))), graph.add(add())
        graph.connect(left.out, total.a)
        graph.connect(right.out, total.b)
        graph.connect(total.out, graph.add(sink()).value)
        return graph

    found = explore(build, runs=20)
    assert (found.outcomes, found.results) == ({"done": 20}, 1)


@pytest.mark.slow
@pytest.mark.rule("F7", "R5")
def test_when_a_source_for_ended_nodes_is_given_up_is_no_result() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(add())
        graph.add(script(values=(1, 2)), name="short").out >> node.a
        graph.connect(graph.add(script(values=tuple(range(50))), name="long").out, node.b, buffer=9)
        graph.add(script(values=tuple(range(6))), name="other").out >> graph.add(double()).value
        return graph

    sent = {len(graph_run(build(), seed).tokens("long.out -> add.b")) for seed in range(6)}
    assert len(sent) > 1  # R5 cuts it off as soon as nobody is left: so far it has run ahead
    found = explore(build, runs=20)
    assert (found.outcomes, found.results) == ({"done": 20}, 1)


def graph_run(graph: hfg.Graph, seed: int) -> Recorder:
    trace = recorder()
    hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=trace)
    return trace


def racing() -> hfg.Graph:
    graph = hfg.Graph()
    tally = graph.add(Tally())
    for name in ("left", "right"):
        pulse = graph.add(Pulse(), name=name)
        graph.connect(graph.add(script(values=(1, 2)), name=f"{name}_source").out, pulse.value)
        graph.connect(pulse.pulse, tally.note)
    return graph


def test_a_result_that_depends_on_the_schedule_is_reported_with_its_seed() -> None:
    def order(trace: Recorder) -> list[str]:
        return [event.edge for event in trace.of(TokenTaken) if event.edge.endswith("tally.note")]

    with pytest.raises(ScheduleFailure, match="the result depends on the schedule") as caught:
        explore(racing, runs=20, result=order)
    again = recorder()
    hfg.run(racing(), clock="virtual", policy="random", seed=caught.value.seed, trace=again)
    assert order(again) == order(caught.value.trace)


def test_of_long_results_the_part_is_told_in_which_they_differ() -> None:
    def order(trace: Recorder) -> dict[str, object]:
        told = [event.edge for event in trace.of(TokenTaken) if event.edge.endswith("tally.note")]
        return {"outcome": trace.outcome, "order": ("tally.note", told)}

    with pytest.raises(ScheduleFailure, match=r"result\['order'\]\[1\]\[0\] is '(left|right)\.pulse -> tally\.note'"):
        explore(racing, runs=20, result=order)


def test_the_shortest_failing_schedule_is_reported() -> None:
    def left_first(events: list[TraceEvent]) -> list[str]:
        taken = [event.edge for event in events if isinstance(event, TokenTaken) and event.edge.endswith("tally.note")]
        return [] if taken[0].startswith("left") else ["right was first"]

    with pytest.raises(ScheduleFailure, match="left first: right was first") as caught:
        explore(racing, runs=20, invariants=[left_first])
    assert "its schedule" in str(caught.value)


def test_an_exploration_can_be_compared_with_the_oracle() -> None:
    assert explore(relays, runs=5, conform=True).outcomes == {"done": 5}


# --- strategies


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(graphs(), schedules())
def test_a_plan_builds_the_same_graph_each_time(plan: GraphPlan, seed: int) -> None:
    first, second = plan.build(), plan()
    assert [edge.label for edge in first.edges] == [edge.label for edge in second.edges]
    assert list(first.nodes) == list(second.nodes)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(graphs())
def test_a_plan_prints_as_the_program_that_builds_it(plan: GraphPlan) -> None:
    program: dict[str, Any] = {}
    exec(compile(repr(plan), "plan", "exec"), program)
    written, built = program["graph"], plan.build()
    assert list(written.nodes) == list(built.nodes)
    assert [(edge.label, edge.options) for edge in written.edges] == [
        (edge.label, edge.options) for edge in built.edges
    ]


@pytest.mark.slow
@given(tokens())
def test_silence_is_never_active(one: Token[Any]) -> None:
    assert one.value is not NO_MESSAGE or one.activity == 0


@pytest.mark.parametrize(
    "wanted",
    [
        "active=True",
        "initial=",
        "hfg.Subgraph",
        "graph.gate(",
        "on_error='restart'",
        "overflow=",
        "parameters[",
        "capacity=1",
        "active_for_s",
        "max_rate_hz",
        "release='pipelined'",
        "enabled=False",
    ],
)
def test_random_plans_contain_everything(wanted: str) -> None:
    assert any(wanted in repr(random_plan(seed)) for seed in range(400))


@pytest.mark.rule("G1", "F7")
@pytest.mark.parametrize("seed", range(30))
def test_grouping_nodes_changes_nothing_that_others_can_see(seed: int) -> None:
    """The oracle on the same plan with and without boxes."""
    allowed = Allowed(events=False, activity=False, failures=False, gates=False, disabling=False, readiness=False)
    plan = random_plan(seed, allowed)

    def seen(one: GraphPlan) -> list[tuple[str, list[Any]]]:
        report = reference_run(one.build(), seed=seed)
        paths = one.paths()
        names = {path: name for name, path in paths.items()}
        edges = []
        for label, sent in report.tokens.items():
            source, target = (end.rpartition(".") for end in label.split(" -> "))
            edges.append((f"{names[source[0]]}.{source[2]} -> {names[target[0]]}.{target[2]}", [t.value for t in sent]))
        return sorted(edges, key=lambda edge: edge[0])

    assert seen(plan) == seen(plan.flat())


@pytest.mark.slow
def test_hypothesis_shrinks_to_a_small_graph() -> None:
    small = find(
        graphs(),
        lambda plan: any(node.type == "Counter" for node in plan.nodes),
        settings=settings(deadline=None, derandomize=True, database=None),
    )
    assert len(small.nodes) <= 5
    assert not small.edges
    with pytest.raises(NoSuchExample):
        find(
            graphs(Allowed(events=False)),
            lambda plan: any("Relay" in n.type for n in plan.nodes),
            settings=settings(max_examples=20),
        )


# --- the pytest plugin


def test_hours_pass_in_no_time(virtual_time: Callable[[Coroutine[Any, Any, float]], float]) -> None:
    async def main() -> float:
        await asyncio.sleep(7200)
        return asyncio.get_running_loop().time()

    assert virtual_time(main()) >= 7200


def test_run_graph_gives_report_and_trace(run_graph: Callable[..., Any]) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(script()).out, graph.add(Counter()).value)
    ran = run_graph(graph)
    assert ran.report.outcome == "done"
    assert ran.trace.firings("counter") == 4


def test_run_graph_tells_a_failure(run_graph: Callable[..., Any]) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(script(values=(1,))).out, graph.add(add()).a)
    ran = run_graph(graph)
    assert ran.report is None
    assert type(ran.error) is hfg.errors.Stalled


def test_the_whole_thing_works_on_a_user_s_node() -> None:
    assert explore(lambda: _doubling(), runs=3).outcomes == {"done": 3}


def _doubling() -> hfg.Graph:
    graph = hfg.Graph()
    graph.connect(graph.add(script()).out, graph.add(double()).value)
    return graph
