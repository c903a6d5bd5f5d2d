"""The oracle by hand: for each rule a small graph whose every token can be counted out on paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
import reactivex.operators as ops

import hfg
from hfg.base.token import END, NO_MESSAGE
from hfg.graph.structure.options import Release
from hfg.testing import ReferenceMachine, ReferenceReport, recorder, reference_run, replay
from hfg.testing.nodes import (
    AsyncRelay,
    Counter,
    Doubter,
    Failing,
    Greeter,
    Latch,
    Merge,
    OnlyTwice,
    Passing,
    Pulse,
    Relay,
    Scaled,
    Script,
    Stateful,
    Tally,
    Waiting,
    add,
    ascript,
    double,
    script,
    sink,
    slow_double,
    some,
)
from hfg.trace import ActivityChanged, CallStarted, FiringEnded, FiringStarted, TokenDropped, TokenProcessed, TokenSent

SEEDS = range(12)


def every_schedule(build: Callable[[], hfg.Graph], read: Callable[[ReferenceReport], Any]) -> Any:
    """Give what is read off a run, which must be the same for many schedules."""
    found = [read(reference_run(build(), seed=seed)) for seed in SEEDS]
    assert all(one == found[0] for one in found)
    return found[0]


def signs(report: ReferenceReport, edge: str) -> list[tuple[Any, int]]:
    return [(token.value, token.activity) for token in report.tokens[edge]]


def chain(*nodes: hfg.Node) -> hfg.Graph:
    graph = hfg.Graph()
    for earlier, later in pairwise(nodes):
        if earlier._place is None:
            graph.add(earlier)
        graph.add(later)
        graph.connect(next(iter(earlier.ports.outputs.values())), next(iter(later.ports.inputs.values())))
    return graph


# --- tokens and ports


@pytest.mark.rule("T2", "T3")
def test_none_is_silence_and_carries_nothing() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, target = graph.add(script(values=(1, None))), graph.add(sink())
        graph.connect(source.out, target.value, active=True)
        graph.start.activates(source.activate)
        return graph

    for seed in SEEDS:
        sent = signs(reference_run(build(), seed=seed), "script.out -> sink.value")
        assert [value for value, _ in sent] == [1, NO_MESSAGE, END]
        assert sent[1][1] == 0


@pytest.mark.rule("T4")
def test_markers_into_a_slot_are_processed_at_once_without_the_handler() -> None:
    graph = hfg.Graph()
    source, tally = graph.add(script(values=(1, None, 2))), graph.add(Tally())
    graph.connect(source.out, tally.note)
    report = reference_run(graph, seed=1)
    assert sum(isinstance(event, CallStarted) for event in report.events) == 2
    assert report.drained == {"script.out -> tally.note": 2}


@pytest.mark.rule("T5")
def test_stamps_come_from_the_newest_value_that_was_taken() -> None:
    graph = hfg.Graph()
    slow, fast = graph.add(ascript(values=(1, 2), pause_s=0.5)), graph.add(script(values=(10, 20)))
    total = graph.add(add())
    graph.connect(slow.out, total.a)
    graph.connect(fast.out, total.b)
    graph.connect(total.out, graph.add(sink()).value)
    report = reference_run(graph)
    assert [token.stamp for token in report.tokens["add.out -> sink.value"]] == [0.0, 0.5, 1.0]
    assert [token.sequence for token in report.tokens["add.out -> sink.value"]] == [1, 2, 3]


@pytest.mark.rule("P4", "F5")
@pytest.mark.parametrize(("release", "held"), [("sequential", 1), ("pipelined", 2)])
def test_a_synchronous_edge_holds_one_token_and_a_mode_says_until_when(release: Release, held: int) -> None:
    """With `sequential` one wave is in the graph, with `pipelined` one token on each edge."""
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2, 3)))
    middle, last = graph.add(double(), release=release), graph.add(sink(), release=release)
    source >> middle >> last
    unprocessed, most = 0, 0
    for event in reference_run(graph, choose=lambda moves: moves[0]).events:
        unprocessed += isinstance(event, TokenSent) - isinstance(event, TokenProcessed)
        most = max(most, unprocessed)
    assert most == held + (release == "sequential")


@pytest.mark.rule("P5")
@pytest.mark.parametrize(
    ("overflow", "kept", "lost"),
    [("drop_oldest", [1, 2], [0]), ("drop_newest", [0, 1], [2]), ("latest", [2], [0, 1])],
)
def test_a_full_queue_follows_its_policy(overflow: Any, kept: list[int], lost: list[int]) -> None:
    graph = hfg.Graph()
    source, pulse, target = graph.add(script(values=(3,))), graph.add(Pulse()), graph.add(sink())
    source >> pulse
    options: dict[str, Any] = {} if overflow == "latest" else {"capacity": 2}
    graph.connect(pulse.pulse, target.value, overflow=overflow, **options)
    report = reference_run(graph)
    seen = recorder()
    seen.extend(report.events)
    assert [value for value in seen.taken("pulse.pulse -> sink.value") if value is not END] == kept
    assert [event.token.value for event in report.events if isinstance(event, TokenDropped)] == lost


@pytest.mark.rule("P5")
def test_the_policy_error_is_raised_in_the_trigger_before_anything_is_sent() -> None:
    graph = hfg.Graph()
    source, pulse, target, other = (
        graph.add(script(values=(2,))),
        graph.add(Pulse(), on_error="skip"),
        graph.add(sink()),
        graph.add(Tally()),
    )
    source >> pulse
    graph.connect(pulse.pulse, other.note)
    graph.connect(pulse.pulse, target.value, overflow="error", capacity=1)
    report = reference_run(graph)
    assert report.values("pulse.pulse -> tally.note") == [0]


@pytest.mark.rule("P6")
def test_a_connected_optional_input_is_waited_for_and_absent_when_silent() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        merge = graph.add(Merge())
        graph.connect(graph.add(script(values=(1, 2))).out, merge.value)
        graph.connect(graph.add(script(values=(None, 5))).out, merge.right)
        graph.connect(merge.total, graph.add(sink()).value)
        return graph

    totals = every_schedule(build, lambda report: report.values("merge.total -> sink.value"))
    assert totals == [101, 7, END]


@pytest.mark.rule("P7")
def test_initial_tokens_make_a_ring_turn() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        total = graph.add(add())
        graph.connect(graph.add(script(values=(1, 2, 3))).out, total.a)
        graph.connect(total.out, total.b, initial=[10])
        return graph

    sums = every_schedule(build, lambda report: report.values("add.out -> add.b"))
    assert sums == [11, 13, 16, END]


@pytest.mark.slow
@pytest.mark.rule("P8")
def test_a_parameter_is_set_by_a_token_before_the_function_runs_and_sent_behind_it() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        scaled = graph.add(Scaled())
        graph.connect(graph.add(script(values=(1, 1, None))).out, scaled.value)
        graph.connect(graph.add(script(values=(5, None, 7))).out, scaled.ports.parameters["factor"])
        graph.connect(scaled.out, graph.add(sink(), name="values").value)
        graph.connect(scaled.ports.parameters["factor"], graph.add(sink(), name="factors").value)
        return graph

    found = every_schedule(
        build, lambda r: (r.values("scaled.out -> values.value"), r.values("scaled.factor -> factors.value"))
    )
    assert found == ([5, 5, NO_MESSAGE, END], [5, 5, NO_MESSAGE, END])


@pytest.mark.rule("P9")
def test_operators_stand_before_the_queue_and_complete_before_the_end() -> None:
    graph = hfg.Graph()
    source, target = graph.add(Script(count=6, every=1)), graph.add(sink())
    graph.connect(source.seen, target.value, through=[ops.buffer_with_count(4), ops.map(len)])
    report = reference_run(graph, seed=3)
    assert report.values("script.seen -> sink.value") == [4, 2, END]


@pytest.mark.rule("P9", "R6")
def test_operators_that_wait_use_the_run_s_time() -> None:
    graph = hfg.Graph()
    source, target = graph.add(Script(count=3, every=1), max_rate_hz=10.0), graph.add(sink())
    graph.connect(source.seen, target.value, through=[ops.debounce(0.15)])
    report = reference_run(graph)
    assert report.values("script.seen -> sink.value") == [3, END]


# --- firing


@pytest.mark.rule("F1")
def test_a_node_waits_until_its_inputs_are_there_and_its_outputs_free() -> None:
    graph = hfg.Graph()
    source, total = graph.add(script(values=(1,))), graph.add(add())
    graph.connect(source.out, total.a)
    machine = ReferenceMachine(graph)
    machine.start()
    assert [str(move) for move in machine.moves()] == ['fire "script"']
    machine.apply(machine.moves()[0])
    assert machine.outcome is None
    assert [str(move) for move in machine.moves()] == ["finish: stalled"]


@pytest.mark.rule("F1")
def test_ready_is_asked_last_and_again_after_calls() -> None:
    graph = hfg.Graph()
    gate, source = graph.add(OnlyTwice()), graph.add(script(values=(1, 2, 3)))
    graph.connect(source.out, gate.value)
    graph.connect(source.out, gate.more)
    report = reference_run(graph, seed=5)
    assert report.outcome == "done"
    assert sum(isinstance(event, FiringStarted) and event.node == "only_twice" for event in report.events) == 4


@pytest.mark.rule("F3")
def test_every_edge_of_every_output_gets_exactly_one_token_a_firing() -> None:
    graph = hfg.Graph()
    source, merge = graph.add(script(values=(4, None, 6))), graph.add(Merge())
    source >> merge.value
    graph.connect(merge.total, graph.add(sink()).value)
    graph.connect(merge.lefts, graph.add(sink()).value)
    report = reference_run(graph, seed=2)
    assert report.values("merge.total -> sink.value") == [104, NO_MESSAGE, 106, END]
    assert report.values("merge.lefts -> sink_2.value") == [NO_MESSAGE, NO_MESSAGE, NO_MESSAGE, END]


@pytest.mark.rule("F4")
def test_the_last_word_leaves_before_the_end_and_values_beside_it_are_dropped() -> None:
    graph = hfg.Graph()
    total, last = graph.add(add()), graph.add(Counter())
    graph.connect(graph.add(script(values=(1,))).out, total.a)
    graph.connect(graph.add(script(values=(1, 2))).out, total.b)
    graph.connect(total.out, last.value)
    graph.connect(last.out, graph.add(sink()).value)
    report = reference_run(graph, seed=4)
    assert report.values("counter.out -> sink.value") == [1, -1, END]
    assert report.dropped == {"script_2.out -> add.b": 1}


@pytest.mark.rule("F4")
def test_a_node_of_optional_inputs_ends_when_all_of_them_have() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        latch = graph.add(Latch())
        graph.connect(graph.add(script(values=(1,))).out, latch.first)
        graph.connect(graph.add(script(values=(7, None, 8))).out, latch.second)
        graph.connect(latch.out, graph.add(sink()).value)
        return graph

    found = every_schedule(build, lambda report: report.values("latch.out -> sink.value"))
    assert found == [1, NO_MESSAGE, 8, END]


@pytest.mark.rule("F6", "F9")
def test_a_slot_that_is_fed_by_an_output_holds_it_until_the_call_is_over() -> None:
    graph = hfg.Graph()
    source, relay = graph.add(script(values=(1, 2))), graph.add(AsyncRelay())
    graph.connect(source.out, relay.say)
    report = reference_run(graph, seed=6)
    second = [event.time for event in report.events if isinstance(event, FiringStarted) and event.number == 2]
    assert second == [0.005]


@pytest.mark.slow
@pytest.mark.rule("F7")
@pytest.mark.parametrize("release", ["auto", "sequential", "pipelined"])
def test_what_is_sent_depends_neither_on_the_schedule_nor_on_modes(release: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(script(values=(1, 2, 3, 4)))
        left, right = graph.add(some(), release=release), graph.add(double(), release=release)
        merge = graph.add(Merge(), release=release)
        source >> left
        source >> right
        graph.connect(right.out, merge.value)
        graph.connect(left.out, merge.right)
        graph.connect(merge.total, graph.add(sink()).value)
        return graph

    assert every_schedule(build, lambda report: report.values("merge.total -> sink.value")) == [102, 6, 106, 12, END]


@pytest.mark.rule("F8")
def test_a_queue_grows_only_when_nothing_else_can_move() -> None:
    graph = hfg.Graph()
    source, pulse, target = graph.add(script(values=(3, 3))), graph.add(Pulse()), graph.add(add())
    source >> pulse
    graph.connect(pulse.pulse, target.a, capacity=1)
    graph.connect(pulse.out, target.b)
    report = reference_run(graph)
    assert report.outcome == "done"
    assert report.grown == {"pulse.pulse -> add.a": 4}  # two places before the second firing, two before the end


@pytest.mark.rule("F8")
def test_growing_over_the_limit_is_a_failure() -> None:
    graph = hfg.Graph()
    source, pulse, target = graph.add(script(values=(3, 3))), graph.add(Pulse()), graph.add(add())
    source >> pulse
    graph.connect(pulse.pulse, target.a, capacity=1, capacity_limit=2)
    graph.connect(pulse.out, target.b)
    report = reference_run(graph)
    assert (report.outcome, type(report.error)) == ("failed", hfg.errors.QueueLimit)


@pytest.mark.rule("F9")
def test_calls_and_firings_of_a_node_go_in_order_and_of_one_sending_the_slot_first() -> None:
    graph = hfg.Graph()
    source, tally = graph.add(script(values=(1, 2))), graph.add(Tally())
    graph.connect(source.out, tally.value)
    graph.connect(source.out, tally.note)
    for seed in SEEDS:
        events = reference_run(graph, seed=seed).events
        order = [type(e).__name__ for e in events if isinstance(e, FiringStarted | CallStarted) and e.node == "tally"]
        assert order == ["CallStarted", "FiringStarted", "CallStarted", "FiringStarted", "FiringStarted"]


@pytest.mark.rule("F10")
def test_disabling_discards_what_waits_and_nobody_waits_for_the_node() -> None:
    graph = hfg.Graph()
    source, target, quick = graph.add(script(values=(1, 2, 3))), graph.add(add()), graph.add(sink())
    graph.connect(source.out, target.a)
    graph.connect(source.out, quick.value)
    graph.connect(source.processed, target.disable)
    report = reference_run(graph, choose=lambda moves: next((m for m in moves if m.kind == "call"), moves[0]))
    assert report.outcome == "done"
    assert report.values("script.out -> add.a") == [1]
    assert report.values("script.out -> sink.value") == [1, 2, 3, END]
    assert report.dropped == {"script.out -> add.a": 1}


@pytest.mark.rule("F11")
def test_the_rate_is_measured_between_starts_and_silence_is_free() -> None:
    graph = hfg.Graph()
    source, middle = graph.add(script(values=(2, 1, 4, 6))), graph.add(double(), max_rate_hz=10.0)
    graph.connect(graph.add(some(), name="some").out, middle.value)
    graph.connect(source.out, graph["some"].value)
    report = reference_run(graph)
    starts = [
        e.time for e in report.events if isinstance(e, FiringStarted) and e.node == "double" and e.kind == "process"
    ]
    assert starts == [0.0, 0.1, 0.2]


@pytest.mark.rule("F12")
def test_an_ended_node_drains_and_its_slots_go_on() -> None:
    graph = hfg.Graph()
    counter = graph.add(Counter())
    merge = graph.add(Merge())
    graph.connect(graph.add(script(values=())).out, merge.value)
    source = graph.add(script(values=(1, 2, 3)), max_rate_hz=10.0)
    graph.connect(source.out, merge.left)
    graph.connect(source.out, graph.add(sink()).value)
    graph.connect(graph.add(script(values=(1,)), max_rate_hz=10.0).out, counter.set)
    graph.connect(graph.add(script(values=())).out, counter.value)
    report = reference_run(graph)
    assert report.outcome == "done"
    assert report.drained["script_2.out -> merge.left"] == 3
    assert any(isinstance(event, CallStarted) and event.node == "counter" for event in report.events)


@pytest.mark.rule("F13")
def test_a_sink_that_is_fed_by_events_closes_properly() -> None:
    graph = hfg.Graph()
    source, counter = graph.add(Script(count=4)), graph.add(Counter())
    graph.connect(source.seen, counter.value)
    graph.connect(counter.out, graph.add(sink()).value)
    report = reference_run(graph, seed=8)
    assert report.values("script.seen -> counter.value") == [2, 4, END]
    assert report.values("counter.out -> sink.value") == [1, 2, -2, END]


# --- activity


@pytest.mark.rule("A1", "A3", "A5", "A10")
def test_activity_moves_along_active_edges_and_leaves_the_sender() -> None:
    graph = hfg.Graph()
    first, second = graph.add(Relay(), name="first"), graph.add(Relay(), name="second")
    source = graph.add(script(values=(1, 2)), max_rate_hz=10.0)
    graph.start.activates(first.activate)
    graph.connect(source.out, first.say)
    graph.connect(first.said, second.say, active=True)
    report = reference_run(graph)
    assert report.activity == [("first", True), ("first", False), ("second", True)]
    assert signs(report, "first.said -> second.say") == [(1, 1), (2, 0)]


@pytest.mark.rule("A3", "A5")
def test_one_firing_can_fork() -> None:
    """What leaves by events first does not take away the right of the outputs behind it."""
    graph = hfg.Graph()
    source, pulse = graph.add(script(values=(1,)), max_rate_hz=1.0), graph.add(Pulse())
    left, right = graph.add(Doubter(), name="left"), graph.add(sink(), name="right")
    graph.start.activates(pulse.activate)
    graph.connect(source.out, pulse.value)
    graph.connect(pulse.pulse, left.hear, active=True)
    graph.connect(pulse.out, right.value, active=True)
    report = reference_run(graph, choose=lambda moves: next((m for m in moves if m.kind == "call"), moves[0]))
    assert signs(report, "pulse.pulse -> left.hear") == [(0, 1)]
    assert signs(report, "pulse.out -> right.value")[0] == (1, 1)
    assert [change for change in report.activity if change[1]] == [("pulse", True), ("left", True), ("right", True)]


@pytest.mark.rule("A4")
def test_an_explicit_modifier_wins_and_a_token_passed_on_keeps_its_own() -> None:
    graph = hfg.Graph()
    source, greeter, passing = graph.add(script(values=(0, 1, 2))), graph.add(Greeter()), graph.add(Passing())
    source >> greeter
    graph.connect(greeter.out, passing.value, active=True)
    graph.connect(passing.out, graph.add(sink()).value, active=True)
    report = reference_run(graph)
    assert signs(report, "greeter.out -> passing.value") == [(0, 0), (1, -1), (2, 0), (END, 0)]
    assert signs(report, "passing.out -> sink.value") == [(0, 0), (1, -1), (2, 0), (END, 0)]


@pytest.mark.rule("A6")
def test_of_the_tokens_of_one_firing_only_the_net_change_counts() -> None:
    graph = hfg.Graph()
    merge = graph.add(Merge())
    plus, minus = graph.add(Greeter(every=9), name="plus"), graph.add(Greeter(), name="minus")
    graph.connect(graph.add(script(values=(1, 1))).out, minus.value)
    graph.connect(graph.add(script(values=(0, 0))).out, plus.value)
    graph.connect(minus.out, merge.left, active=True)
    graph.connect(plus.sign, merge.value, active=True)
    report = reference_run(graph)
    assert [change for change in report.activity if change[0] == "merge"] == [("merge", True)]


@pytest.mark.rule("A7")
def test_the_slots_activate_and_deactivate_act_on_any_edge() -> None:
    graph = hfg.Graph()
    node, source = graph.add(Stateful()), graph.add(Script(count=2, every=1), max_rate_hz=10.0)
    graph.connect(graph.start, node.activate)
    graph.connect(source.seen, node.deactivate)
    assert reference_run(graph).activity == [("stateful", True), ("stateful", False)]


@pytest.mark.rule("A8")
def test_discarded_activity_goes_back_to_its_sender() -> None:
    graph = hfg.Graph()
    relay, target = graph.add(Relay()), graph.add(sink())
    source = graph.add(script(values=(1,)), max_rate_hz=1.0)
    graph.start.activates(relay.activate)
    graph.connect(source.out, relay.say)
    graph.connect(relay.said, target.value, active=True)
    graph.connect(relay.processed, target.disable)
    graph.connect(relay.said, target.disable)
    order = ["call", "go on", "fire"]
    report = reference_run(graph, choose=lambda moves: min(moves, key=lambda m: [*order, m.kind].index(m.kind)))
    assert report.activity == [("relay", True), ("relay", False), ("relay", True)]
    causes = [event.cause for event in report.events if isinstance(event, ActivityChanged)]
    assert causes == ["token", "sent", "returned"]


@pytest.mark.rule("A9")
def test_processed_follows_the_outputs_and_carries_activity_only_if_they_did_not() -> None:
    graph = hfg.Graph()
    node, hearer = graph.add(Stateful()), graph.add(Doubter())
    graph.connect(graph.add(script(values=(1,)), max_rate_hz=1.0).out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.processed, hearer.hear, active=True)
    report = reference_run(graph, choose=lambda moves: next((m for m in moves if m.kind == "call"), moves[0]))
    assert signs(report, "stateful.processed -> doubter.hear") == [(None, 1)]
    assert report.activity == [("stateful", True), ("stateful", False), ("doubter", True)]


@pytest.mark.rule("A11")
@pytest.mark.parametrize(("idle", "kinds"), [(None, ["silent"] * 4), (5.0, ["process", "silent", "process", "silent"])])
def test_a_gate_makes_firings_silent_while_its_state_is_inactive(idle: float | None, kinds: list[str]) -> None:
    graph = hfg.Graph()
    source, node, state = (
        graph.add(script(values=(1, 2, 3, 4)), max_rate_hz=10.0),
        graph.add(double()),
        graph.add(Relay()),
    )
    source >> node
    graph.gate(node, by=state, idle_rate_hz=idle)
    events = reference_run(graph).events
    assert [e.kind for e in events if isinstance(e, FiringStarted) and e.node == "double"] == [*kinds, "end"]


@pytest.mark.rule("A11")
def test_a_suspended_source_rests_and_does_not_keep_the_run_alive() -> None:
    graph = hfg.Graph()
    source, state = graph.add(script()), graph.add(Relay())
    graph.connect(source.out, graph.add(sink()).value)
    graph.gate(source, by=state)
    report = reference_run(graph)
    assert (report.outcome, report.values("script.out -> sink.value")) == ("done", [])


@pytest.mark.rule("A12")
def test_a_time_out_moves_the_activity_once() -> None:
    graph = hfg.Graph()
    waiting, alarm = graph.add(Relay(), name="waiting", active_for_s=2.0), graph.add(Doubter(), name="alarm")
    graph.start.activates(waiting.activate)
    graph.connect(waiting.timeout, alarm.hear, active=True)
    report = reference_run(graph)
    assert report.activity == [("waiting", True), ("waiting", False), ("alarm", True)]
    assert [token.stamp for token in report.tokens["waiting.timeout -> alarm.hear"]] == [2.0]


@pytest.mark.rule("A14")
def test_resetting_activity_takes_it_from_nodes_and_tokens_and_starts_again() -> None:
    graph = hfg.Graph()
    first, second = graph.add(Relay(), name="first"), graph.add(Relay(), name="second")
    graph.start.activates(first.activate)
    graph.connect(first.activated, second.activate, active=True)
    machine = ReferenceMachine(graph, held_open=True)
    machine.start()
    while moves := machine.moves():
        machine.apply(moves[0])
    assert [station.active for station in machine.stations] == [False, True]
    machine.reset_activity()
    assert [station.active for station in machine.stations] == [False, False]
    assert [str(move) for move in machine.moves()] == ['call a slot of "first" over start -> first.activate']


# --- subgraphs


class Pair(hfg.Subgraph):
    value = hfg.Input(int)
    result = hfg.Output(int)
    told = hfg.Event(int)
    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(double()), graph.add(Counter())
        graph.connect(self.value.inner, first.value, active=True)
        graph.connect(first.out, second.value)
        graph.connect(second.out, self.result.inner)
        graph.connect(second.told, self.told.inner)
        graph.connect(self.begin.inner, second.tell)


@pytest.mark.rule("G1")
def test_relays_join_edges_which_are_active_if_all_parts_are() -> None:
    graph = hfg.Graph()
    source, pair, target = graph.add(script(values=(1, 2))), graph.add(Pair()), graph.add(sink())
    graph.connect(source.out, pair.value, active=True)
    graph.connect(pair.result, target.value)
    graph.connect(pair.told, graph.add(Tally()).note)
    report = reference_run(graph, seed=9)
    assert set(report.tokens) == {
        "script.out -> pair/double.value",
        "pair/double.out -> pair/counter.value",
        "pair/counter.out -> sink.value",
        "pair/counter.told -> tally.note",
    }
    assert report.values("pair/counter.out -> sink.value") == [1, 2, -2, END]
    assert report.values("pair/counter.told -> tally.note") == [-2]


@pytest.mark.rule("G2")
def test_a_subgraph_is_active_while_something_inside_is() -> None:
    graph = hfg.Graph()
    pair, watcher = graph.add(Pair()), graph.add(Doubter())
    graph.connect(pair.activated, watcher.hear, active=True)
    graph.connect(graph.start, pair.begin)
    inner = pair.graph
    inner.start.activates(inner["counter"].activate)
    report = reference_run(graph)
    assert report.activity == [("pair/counter", True), ("pair/counter", False), ("doubter", True)]


class EachDoubled(hfg.Subgraph):
    items = hfg.Input(int)
    offset = hfg.Input(int, optional=True, default=0)
    doubled = hfg.Output(int)
    even = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        twice, total, chosen = graph.add(double()), graph.add(add()), graph.add(some())
        graph.connect(self.items.inner, twice.value)
        graph.connect(self.items.inner, chosen.value)
        graph.connect(twice.out, total.a)
        graph.connect(self.offset.inner, total.b)
        graph.connect(total.out, self.doubled.inner)
        graph.connect(chosen.out, self.even.inner)


@hfg.node
def lists(*, values: tuple[list[int], ...]) -> Iterator[list[int]]:
    yield from values


@hfg.node
def show(value: list[int]) -> None:
    """Take it."""


def iterating() -> hfg.Graph:
    graph = hfg.Graph()
    source, each = graph.add(lists(values=([1, 2, 3], [], [4]))), graph.add(EachDoubled())
    graph.connect(source.out, each.ports.inputs["items"])
    graph.connect(graph.add(script(values=(10, 20, 30))).out, each.offset)
    graph.connect(each.doubled, graph.add(show(), name="all").value)
    graph.connect(each.even, graph.add(show(), name="even").value)
    return graph


@pytest.mark.slow
@pytest.mark.rule("G4")
def test_an_iterating_subgraph_gives_lists_of_what_came_out() -> None:
    found = every_schedule(
        iterating,
        lambda r: (r.values("each_doubled.doubled -> all.value"), r.values("each_doubled.even -> even.value")),
    )
    assert found == ([[12, 14, 16], [], [38], END], [[2], [], [4], END])


@pytest.mark.rule("G4")
@pytest.mark.parametrize("seed", range(10))
def test_the_engine_iterates_as_the_oracle_does(seed: int) -> None:
    seen = recorder()
    hfg.run(iterating(), clock="virtual", policy="random", seed=seed, trace=seen)
    replay(iterating, seen)


@pytest.mark.rule("P10")
@pytest.mark.parametrize("seed", range(5))
def test_outputs_of_the_graph_that_nobody_reads_are_collected(seed: int) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        values = graph.output("values", int)
        source = graph.add(Script(count=3))
        graph.connect(source.out, values)
        return graph

    machine = ReferenceMachine(build())
    machine.start()
    while moves := machine.moves():
        machine.apply(moves[0])
    assert machine.collected == {"values": [1, 2, 3]}
    seen = recorder()
    report = hfg.run(build(), clock="virtual", policy="random", seed=seed, trace=seen)
    assert report.outputs == {"values": [1, 2, 3]}
    replay(build, seen)


@pytest.mark.rule("P10")
def test_a_feed_puts_a_token_when_the_input_is_free_and_end_closes_it() -> None:
    graph = hfg.Graph()
    keys = graph.input("keys", int)
    graph.connect(keys, graph.add(double()).value)
    machine = ReferenceMachine(graph, held_open=True)
    machine.start()
    assert machine.moves() == []
    machine.feed("keys", 3)
    machine.feed("keys", 4)
    machine.feed("keys", END)
    taken = []
    while moves := machine.moves():
        taken.append(str(moves[0]))
        machine.apply(moves[0])
    assert taken == ["feed keys", 'fire "double"'] * 3


# --- errors and ends


@pytest.mark.rule("X1")
def test_skip_answers_silence_and_signals_failed() -> None:
    graph = hfg.Graph()
    source, failing = graph.add(script(values=(1, 3, 4))), graph.add(Failing(), on_error="skip")
    graph.connect(source.out, failing.value)
    graph.connect(failing.out, graph.add(sink()).value)
    graph.connect(failing.failed, graph.add(Doubter()).hear)
    report = reference_run(graph, seed=3)
    assert report.values("failing.out -> sink.value") == [1, NO_MESSAGE, 4, END]
    assert [type(value) for value in report.values("failing.failed -> doubter.hear")] == [hfg.Failure]


@pytest.mark.rule("X1")
def test_stop_fails_the_run() -> None:
    report = reference_run(chain(script(values=(3,)), Failing(), sink()))
    assert (report.outcome, str(report.error)) == (
        "failed",
        'node "failing" failed in firing 1: ValueError: cannot do 3',
    )


@pytest.mark.rule("X1")
def test_restart_waits_longer_each_time() -> None:
    graph = hfg.Graph()
    source, failing = graph.add(script(values=(3, 3, 1))), graph.add(Failing(), on_error="restart")
    graph.connect(source.out, failing.value)
    starts = [e.time for e in reference_run(graph).events if isinstance(e, FiringStarted) and e.node == "failing"]
    assert starts == [0.0, 0.1, pytest.approx(0.3), pytest.approx(0.3)]


@pytest.mark.rule("X2")
def test_a_firing_that_takes_too_long_is_given_up() -> None:
    graph = hfg.Graph()
    source, slow = (
        graph.add(script(values=(1,))),
        graph.add(slow_double(pause_s=5.0), max_duration_s=1.0, on_error="skip"),
    )
    source >> slow
    graph.connect(slow.out, graph.add(sink()).value)
    report = reference_run(graph)
    assert report.values("slow_double.out -> sink.value") == [NO_MESSAGE, END]
    ended = next(e for e in report.events if isinstance(e, FiringEnded) and e.node == "slow_double")
    assert ended.outcome == "abandoned"


@pytest.mark.rule("R5")
def test_tokens_that_can_never_be_taken_stall_the_run() -> None:
    graph = hfg.Graph()
    total = graph.add(add())
    graph.connect(graph.add(script(values=(1, 2))).out, total.a)
    report = reference_run(graph)
    assert report.outcome == "stalled"
    assert "script.out -> add.a" in str(report.error)


@pytest.mark.rule("R5")
def test_the_slot_stop_ends_the_run_well() -> None:
    graph = hfg.Graph()
    source = graph.add(Script(count=100), max_rate_hz=1.0)
    graph.connect(source.seen, graph.stop)
    assert reference_run(graph).outcome == "stopped"


@pytest.mark.rule("R6")
def test_time_goes_on_only_when_nothing_else_can() -> None:
    graph = hfg.Graph()
    source, waiting = graph.add(script(values=(2, 4))), graph.add(Waiting(pause_s=1.0))
    source >> waiting
    graph.connect(waiting.out, graph.add(sink()).value)
    for seed in SEEDS:
        report = reference_run(graph, seed=seed)
        assert [
            event.time for event in report.events if isinstance(event, FiringEnded) and event.node == "waiting"
        ] == [1.0, 2.0, 2.0]


@pytest.mark.rule("R6")
def test_until_ends_the_run_at_its_time() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(Script(count=100), max_rate_hz=2.0).out, graph.add(sink()).value)
    report = reference_run(graph, until_s=1.2)
    assert (report.outcome, report.events[-1].time) == ("until", 1.2)
    assert report.values("script.out -> sink.value") == [1, 2, 3]


class EachPlus(hfg.Subgraph):
    items = hfg.Input(int)
    results = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        self.items.inner >> graph.add(double()) >> self.results.inner


class EachOfEach(hfg.Subgraph):
    items = hfg.Input(list[int])
    results = hfg.Output(list[int])
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        self.items.inner >> graph.add(EachPlus()) >> self.results.inner


@hfg.node
def lists_of_lists() -> Iterator[list[list[int]]]:
    yield from ([[1, 2], []], [], [[3]])


@hfg.node
def show_all(value: list[list[int]]) -> None:
    """Take it."""


@pytest.mark.slow
@pytest.mark.rule("G3", "G4")
def test_what_iterates_may_hold_what_iterates() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(lists_of_lists()) >> graph.add(EachOfEach()) >> graph.add(show_all())
        return graph

    found = every_schedule(build, lambda report: report.values("each_of_each.results -> show_all.value"))
    assert found == [[[2, 4], []], [], [[6]], END]
