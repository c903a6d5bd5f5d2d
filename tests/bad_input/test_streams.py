"""Streams, clocks and logs used wrongly: one sentence with the path and the remedy."""

from __future__ import annotations

import pytest

import hfg
from tests.semantics.nodes import Ear, Keep, forward, numbers


class Box(hfg.Subgraph):
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(graph.add(numbers()).out, self.out.inner)


def test_a_subgraph_has_no_sent_of_its_own() -> None:
    graph = hfg.Graph()
    box, ear = graph.add(Box()), graph.add(Ear())
    with pytest.raises(
        hfg.errors.UsageError,
        match=r'^subgraph "box" has no event "out\.sent": outputs of a subgraph only forward tokens; declare a',
    ):
        graph.connect(box.out.sent, ear.hear)
    assert graph.edges == []


@pytest.mark.parametrize("path", ["forward.value.sent", "forward.out.sent.sent", "forward.other.sent", "keep.out.sent"])
def test_a_path_to_a_sent_that_is_not_there_is_refused(path: str) -> None:
    graph = hfg.Graph()
    graph.add(forward())
    graph.add(Keep())
    with pytest.raises(hfg.errors.GraphError, match=f'^there is no "{path}"'):
        graph[path]
    with pytest.raises(hfg.errors.GraphError, match=f'^there is no "{path}"'):
        graph.edit(hfg.commands.Connect(path, "keep.value"))


def test_an_active_edge_from_it_loses_nothing_either() -> None:
    graph = hfg.Graph()
    source, ear = graph.add(numbers()), graph.add(Ear())
    with pytest.raises(
        hfg.errors.ConnectionError, match=r'"numbers\.out\.sent" -> "ear\.hear": an active edge loses nothing'
    ):
        graph.connect(source.out.sent, ear.hear, active=True, overflow="latest")


def test_a_queue_on_the_output_itself_is_refused_with_the_event_beside_it() -> None:
    graph = hfg.Graph()
    source, keep = graph.add(numbers()), graph.add(Keep())
    with pytest.raises(
        hfg.errors.ConnectionError,
        match=r'or let the edge begin at the event beside it, "numbers\.out\.sent" \(rule P4\)$',
    ):
        graph.connect(source.out, keep.value, overflow="latest")


def test_types_are_those_of_the_output() -> None:
    graph = hfg.Graph()

    @hfg.node
    def read(text: str) -> None: ...

    with pytest.raises(hfg.errors.ConnectionError, match=r'"read\.text" expects str, "numbers\.out\.sent" sends int'):
        graph.connect(graph.add(numbers()).out.sent, graph.add(read()).text)


def test_a_slot_for_the_error_alone_is_refused_with_both_types() -> None:
    class Note(hfg.Node):
        @hfg.slot
        def write(self, error: hfg.errors.NodeError) -> None: ...

    graph = hfg.Graph()
    with pytest.raises(hfg.errors.ConnectionError, match='expects NodeError, "forward.failed" sends Failure'):
        graph.connect(graph.add(forward()).failed, graph.add(Note()).write)  # type: ignore[misc]


def test_elapsed_outside_a_run_names_what_to_ask() -> None:
    with pytest.raises(hfg.errors.NotRunning, match=r"call it in a node, or use run\.elapsed\(\)$"):
        hfg.elapsed()
