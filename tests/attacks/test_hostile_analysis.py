"""A small graph file makes an analysis take neither all memory nor forever (rule L4)."""

from __future__ import annotations

import pytest

import hfg
from hfg.analysis import game, reach, searching, timing
from hfg.analysis.playing import Play
from hfg.analysis.response import Effort, Task, response_times
from hfg.errors import GraphError, UsageError
from hfg.graph.flat import flatten
from hfg.nodes.activity import Wait
from hfg.testing.nodes import Relay, Script

pytestmark = [pytest.mark.rule("L4"), pytest.mark.timeout(60)]


def parts(number: int) -> hfg.Graph:
    """Return a graph of parts, each of which has very many states."""
    graph = hfg.Graph("parts")
    for part in range(number):
        nodes = [graph.add(Wait(), name=f"wait_{part}_{one}") for one in range(3)]
        graph.start.activates(nodes[0].begin)
        for node in nodes:
            for other in nodes:
                node.done.activates(other.begin)
    return graph


def test_all_parts_together_have_one_share_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reach, "_BYTES_PER_STATE", 1000)
    found = hfg.analyse_activity(parts(20), max_states=100)
    assert found.regions[0].states == 100
    assert sum(one.states for one in found.regions) * reach._STATE_BYTES <= 100 * 1000 + 20 * reach._STATE_BYTES
    assert found.may_be_active("wait_19_2"), "what was not looked at counts as possible"
    assert found.regions[-1].at_most_one.holds is None


def test_more_active_edges_than_the_limit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_ACTIVE_EDGES", "19")
    hfg.analyse_activity(parts(1))
    with pytest.raises(GraphError, match="has 20 edges that activate, too many .* set HFG_MOST_ACTIVE_EDGES"):
        hfg.analyse_activity(parts(2))


def test_the_ways_in_which_edges_may_fail_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(game, "_MOST_GIVEN", 1000)
    graph = hfg.Graph("fan")
    first = graph.add(Wait(), name="first")
    graph.start.activates(first.begin)
    for number in range(100):
        first.done.activates(graph.add(Wait(), name=f"wait_{number}", on_error="disable").begin)
    with pytest.raises(GraphError, match='"first" sends activity in too many ways'):
        hfg.analyse_activity(graph)


@pytest.mark.parametrize("policy", ["fifo", "priority", "deadline", "fair"])
def test_rates_that_ask_for_very_many_steps_have_no_bound(policy: str) -> None:
    tasks = [Task(1000.0, (1e-5,)), *[Task(0.001, (0.99999e-3 / 20,), deadline_s=0.001)] * 20]
    effort = Effort(10_000)
    assert max(response_times(tasks, policy, effort)) == float("inf")
    assert effort.steps > -1_000_000, "what is looked at is counted before"


@pytest.mark.parametrize("policy", ["fifo", "priority", "deadline", "fair"])
@pytest.mark.parametrize("jitter_s", [0.0, 1e300])
def test_numbers_beyond_all_numbers_have_no_bound(policy: str, jitter_s: float) -> None:
    tasks = [Task(1e-308, (0.0,), jitter_s, deadline_s=1.0), Task(float("inf"), (1e300,), deadline_s=1.0)]
    assert max(response_times(tasks, policy)) == float("inf")


def test_signals_that_double_without_end_have_no_bound() -> None:
    graph = hfg.Graph("doubled")
    first = graph.add(Script(), max_rate_hz=1)
    last = graph.add(Relay(), takes_s=1)
    graph.connect(first.seen, last.say)
    for _ in range(1100):
        relay = graph.add(Relay(), takes_s=1)
        graph.connect(last.said, relay.say)
        graph.connect(last.said, relay.hand_on)
        last = relay
    assert timing.analyse_time(graph).paths[-1].within_s == float("inf")


def test_sources_that_reach_too_many_nodes_together_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph("crowd")
    relay = graph.add(Relay())
    for _ in range(6):
        graph.connect(graph.add(Script(), max_rate_hz=1).seen, relay.say)
    monkeypatch.setattr(timing, "_MOST_REACHED", 12)
    timing.analyse_time(graph)
    monkeypatch.setattr(timing, "_MOST_REACHED", 11)
    with pytest.raises(UsageError, match="reach more than 11 nodes"):
        timing.analyse_time(graph)


def test_where_pairs_of_places_are_too_much_work_all_may_be_active_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seventy nodes that all activate each other kept it busy for minutes."""
    graph = hfg.Graph()
    first, second = (graph.add(Wait(), name=name) for name in ("first", "second"))
    graph.start.activates(first.begin)
    first.done.activates(second.begin)
    second.done.activates(first.begin)
    made = game.Game(flatten(graph))
    play = Play(made, made.nodes)
    exact = searching.pairs_together(play)
    monkeypatch.setattr(searching, "_MOST_WORK", 0)
    all_of_them = searching.pairs_together(play)
    assert any(others != sum(all_of_them) for others in exact.values())
    assert set(exact) <= set(all_of_them)
    assert set(all_of_them.values()) == {sum(all_of_them)}
