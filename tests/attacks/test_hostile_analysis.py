"""A small graph file makes the analysis of activity take neither all memory nor forever (rule L4)."""

from __future__ import annotations

import pytest

import hfg
from hfg.analysis import game, reach
from hfg.errors import GraphError
from hfg.nodes.activity import Wait

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
