"""What the paper's text says about its figures 2 to 14 and 17 to 19, checked on their graphs in examples/figures."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import ModuleType

import pytest

import hfg
from examples.figures import activity, data, hybrid, robot
from hfg import errors
from hfg.activity import StateMachine
from hfg.testing import Recorder, explore, recorder
from hfg.trace import CallStarted, FiringEnded, FiringStarted

MODULES: tuple[ModuleType, ...] = (data, hybrid, activity, robot)
FIGURES: list[Callable[[], hfg.Graph]] = [
    build
    for module in MODULES
    for name, build in vars(module).items()
    if inspect.isfunction(build) and (name.startswith("figure_") or name == "fork")
]


def trace(graph: hfg.Graph) -> Recorder:
    seen = recorder()
    hfg.run(graph, clock="virtual", trace=seen)
    return seen


def kinds(graph: hfg.Graph) -> set[tuple[str, str]]:
    """Give which kinds of ports are connected; edges of the graph's own ports do not count."""
    return {(edge.source.kind, edge.target.kind) for edge in graph.edges if edge.source is not graph.start}


@pytest.mark.parametrize("build", FIGURES, ids=lambda build: build.__name__)
def test_every_figure_is_sound_says_what_it_is_and_runs_the_same_under_every_schedule(
    build: Callable[[], hfg.Graph],
) -> None:
    assert build.__doc__
    assert not build().check()
    explore(build, runs=5)


# --- §3.1 and §3.2: data, and events


def test_figure_2_reads_from_each_input_and_writes_to_some_of_the_outputs() -> None:
    seen = trace(data.figure_2())
    assert seen.values("v_k.area -> area.value")[:3] == [6.0, 4.0, 30.0]
    assert seen.values("v_k.too_long -> too_long.value")[:3] == [hfg.NO_MESSAGE, 4.0, 6.0]


def test_figure_2_an_optional_input_is_ignored_while_it_is_not_connected_and_else_a_normal_one() -> None:
    graph = data.figure_2()
    graph.connect(graph.add(data.heights(), name="depths").out, graph["v_k.depth"])
    assert trace(graph).values("v_k.area -> area.value")[:3] == [18.0, 4.0, 150.0]


def test_figure_2_parameters_take_part_in_the_data_flow() -> None:
    graph = data.figure_2()
    graph.connect(graph.add(data.widths(), name="limits").out, graph["v_k.limit"])
    assert trace(graph).values("v_k.too_long -> too_long.value")[:3] == [3.0, hfg.NO_MESSAGE, hfg.NO_MESSAGE]


def test_figure_3_an_output_sends_to_many_inputs_and_an_input_has_one_output() -> None:
    graph = data.figure_3()
    seen = trace(graph)
    assert [seen.firings(f"v_{number}") for number in range(3)] == [4, 4, 4]
    with pytest.raises(errors.ConnectionError, match="takes one edge"):
        graph.connect(graph.add(data.heights()).out, graph["v_0.value"])


def test_figure_3_ports_are_typed() -> None:
    graph = data.figure_3()
    with pytest.raises(errors.ConnectionError, match="port types do not fit"):
        graph.connect(graph["v_k"].out, graph.add(data.Lamp()).blink)


def test_figure_4_slots_hear_many_events_and_events_reach_many_slots() -> None:
    seen = trace(data.figure_4())
    assert sorted(seen.taken("left.pressed -> red.blink") + seen.taken("right.pressed -> red.blink")) == [
        "left",
        "right",
    ]
    assert seen.taken("left.pressed -> green.blink") == ["left"]
    assert seen.taken("right.held -> green.blink") == ["right held"]


# --- §4: hybrid flow


def test_figure_5_has_only_the_edges_of_sdf_plus() -> None:
    assert kinds(hybrid.figure_5()) == {("output", "input"), ("event", "slot")}


def test_figure_5_a_node_takes_the_next_tokens_when_those_it_sent_have_been_processed() -> None:
    seen = trace(hybrid.figure_5())
    assert seen.values("compare.difference -> record.value")[:4] == [9, 18, 27, 36]
    first = next(place for place, one in enumerate(seen) if isinstance(one, FiringEnded) and one.node == "record")
    assert sum(isinstance(one, FiringStarted) and one.node == "camera" for one in seen[:first]) == 1


def test_figure_5_slots_are_handled_by_themselves() -> None:
    assert trace(hybrid.figure_5()).calls("record") == ["mark", "mark"]


def test_figure_6_connects_all_four_kinds_of_ports() -> None:
    graph = hybrid.figure_6()
    every = graph["v_k"]
    ports = (every.input, every.output, every.slot, every.event)
    assert [port.kind for port in ports] == ["input", "output", "slot", "event"]
    assert kinds(graph) == {("output", "input"), ("output", "slot"), ("event", "input"), ("event", "slot")}
    assert trace(graph).taken("v_k.event") == [1, 1, hfg.END]


def test_figure_7_is_figure_5_and_its_notation_shows_no_port_that_is_the_only_one() -> None:
    assert [edge.label for edge in hybrid.figure_7().edges] == [edge.label for edge in hybrid.figure_5().edges]
    assert "n0 --> n1" in hybrid.figure_7().draw()


def test_figure_9_needs_no_translation_nodes_and_gives_the_same_as_figure_8() -> None:
    with_nodes, without = hybrid.figure_8(size=5), hybrid.figure_9()
    assert kinds(with_nodes) == {("output", "input"), ("event", "slot")}
    assert kinds(without) == {("event", "input"), ("output", "slot")}
    assert (len(with_nodes.nodes), len(without.nodes)) == (5, 3)
    assert (len(with_nodes.edges), len(without.edges)) == (6, 3)
    heard = trace(with_nodes).taken("to_event.signal -> report.hear")
    assert heard == trace(without).taken("double.out -> report.hear")[:5] == [2, 4, 6, 8, 10]


def test_figure_8_drops_what_its_buffer_cannot_hold_and_figure_9_handles_every_event() -> None:
    small = hybrid.figure_8(size=2)
    assert trace(small).taken("to_event.signal -> report.hear") == [8, 10]
    assert small["buffer"].dropped == 3
    many = hybrid.figure_9()
    many["clicks.times"].value = 100  # more than the queue of an event edge holds at first
    assert trace(many).taken("double.out -> report.hear")[:100] == [2 * number for number in range(1, 101)]


def test_figure_10_handles_every_event_synchronously_and_answers_with_events() -> None:
    graph = hybrid.figure_10()
    assert {("event", "input"), ("output", "input"), ("event", "slot")} == kinds(graph)
    assert trace(graph).taken("answer.answered -> report.hear") == [8, 24, 48, 80, 120]


def test_figure_11_handles_each_stream_at_its_own_rate_without_waiting_for_the_others() -> None:
    graph = hybrid.figure_11()
    assert kinds(graph) == {("output", "slot")}
    seen = trace(graph)
    assert [seen.calls("v").count(slot) for slot in ("position", "obstacle", "command")] == [2, 4, 1]
    assert [round(one.time, 1) for one in seen.of(CallStarted) if one.slot == "obstacle"] == [0.0, 0.4, 0.8, 1.2]


# --- §5: activity


def test_figures_12_and_13_give_the_same_result_the_second_with_less() -> None:
    machine, flow = activity.figure_12(), activity.figure_13()
    trace(machine), trace(flow)
    assert machine["S_q"].begun_at == flow["S_q"].begun_at == [2.0]
    assert (len(machine.nodes), len(flow.nodes)) == (5, 4)
    assert (len(machine.edges), len(flow.edges)) == (6, 4)


def test_figure_12_is_two_graphs_that_talk_by_events_alone() -> None:
    graph = activity.figure_12()
    across = [
        (edge.source.kind, edge.target.kind)
        for edge in graph.edges
        if edge.source is not graph.start and edge.source.node.place.name[0] != edge.target.node.place.name[0]
    ]
    assert across == [("event", "slot"), ("event", "slot")]
    assert not any(edge.active for edge in graph.edges)


def test_figure_13_the_signals_of_the_inactive_buffer_carry_nothing_and_the_next_one_carries_the_activity() -> None:
    seen = trace(activity.figure_13())
    assert [token.activity for token in seen.tokens("v_b.relayed -> S_q.hear")[:4]] == [0, 0, 1, 0]
    assert seen.activity("v_b") == [(1.5, "v_b", True), (2.0, "v_b", False)]
    assert seen.active_at_end() == ["S_q"]


@pytest.mark.parametrize("node_type", [activity.Relay, activity.Prepare])
def test_figure_13_its_nodes_know_nothing_of_activity(node_type: type) -> None:
    assert "active" not in inspect.getsource(node_type).partition('"""')[2].partition('"""')[2]


@pytest.mark.rule("A13")
def test_figure_14_is_the_machine_it_was_made_of() -> None:
    graph = activity.figure_14()
    assert StateMachine.of(graph) == activity.MACHINE
    assert [edge.label for edge in graph.edges if edge.active] == [
        "start -> s_0.enter",
        "s_0.begin -> s_1.enter",
        "s_1.found -> s_2.enter",
        "s_2.lost -> s_1.enter",
        "s_2.arrived -> s_3.enter",
    ]


def test_activity_can_be_in_two_places_and_then_the_graph_is_no_machine() -> None:
    assert trace(activity.fork()).active_at_end() == ["position", "orientation"]
    with pytest.raises(errors.MachineError, match='activity forks to "position" and "orientation"'):
        StateMachine.of(activity.fork())


# --- §6.1: parts of a robot


def test_figure_17a_only_the_start_signal_moves_the_activity() -> None:
    graph = robot.figure_17a()
    assert trace(graph).activity() == [(0.0, "streq", True), (1.0, "streq", False), (1.0, "next", True)]
    assert graph["next"].begun_at == [1.0]


def test_figure_17b_exactly_one_message_passes_the_gate_and_it_is_active() -> None:
    graph = robot.figure_17b()
    seen = trace(graph)
    passed = [token for token in seen.tokens("gate.forwarded -> export.message") if token.value is True]
    assert [token.activity for token in passed] == [1]
    assert graph["export"].sent == [True]
    assert graph["next"].begun_at == [1.0]


def test_figure_18_takes_the_way_of_a_known_or_of_an_unknown_sign() -> None:
    known, unknown = robot.figure_18(7), robot.figure_18(99)
    trace(known)
    assert (known["explore"].searched, known["navigate"].goals) == ([7, 7], [(1.0, 2.0)])
    hfg.run(unknown, clock="virtual", until_s=10)
    assert not unknown["navigate"].goals
    assert len(unknown["explore"].searched) == 13


def test_figure_19_fetches_looks_up_finds_and_delivers_with_one_active_node_at_a_time() -> None:
    seen = trace(robot.figure_19())
    active: set[str] = set()
    way: list[str] = []
    for _, path, is_active in seen.activity():
        active = active | {path} if is_active else active - {path}
        assert len(active) <= 1
        if is_active and path.partition("/")[0] != (way or [""])[-1]:
            way.append(path.partition("/")[0])
    looking = ["map_lookup", "find_delivery"] * 5
    assert way == ["wait_for_start", "explore", "fetch_cube", *looking, "map_lookup", "deliver_cube", "fetch_cube"]
    assert active == {"fetch_cube/check_cube"}


def test_figure_19_needs_no_search_for_a_station_that_it_has_seen() -> None:
    graph = robot.figure_19()
    graph["cube_detection.seen"].value = (0, 0, 0, 0, 7, 7, 7, 7, 0)
    assert trace(graph).calls("find_delivery") == []
