"""Graphs with processes, run as users run them; in virtual time all parts share the loop (rules L1, R5, X1)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import hfg
from hfg.parts.running.part import Part


@hfg.node
def numbers(*, count: int = 20) -> Iterator[int]:
    yield from range(count)


@hfg.node
def double(value: int) -> int:
    return 2 * value


@hfg.node
def add(a: int, b: int) -> int:
    return a + b


@hfg.node
def refuses(value: int, *, at: int = 3) -> int:
    if value == at:
        raise ValueError(f"no {value}")
    return value


@hfg.node
def pictures(*, count: int = 3) -> Iterator[npt.NDArray[np.uint8]]:
    for number in range(count):
        yield np.full((4, 5), number, np.uint8)


@hfg.node
def brightness(picture: npt.NDArray[np.uint8]) -> float:
    return float(picture.mean())


@hfg.node
def anything(value: int) -> Any:
    return value


class Looks(hfg.Node):
    """Says whether it is active when it fires."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return int(self.active)


@hfg.node
def takes(value: Any) -> int:
    return int(value)


def apart(**groups: Any) -> hfg.Graph:
    """Numbers come from the main part, are doubled in one process and added up in another."""
    graph = hfg.Graph("sums")
    graph.group("left", process=True, **groups)
    graph.group("right", process=True)
    source = graph.add(numbers())
    twice = graph.add(double(), group="left")
    total = graph.add(add(), group="right")
    graph.connect(source.out, twice.value)
    graph.connect(source.out, total.a)
    graph.connect(twice.out, total.b)
    graph.connect(total.out, graph.output("out", int))
    return graph


@pytest.mark.rule("L1", "F7", "R5")
def test_a_graph_in_three_parts_gives_what_it_gives_in_one_and_one_report() -> None:
    report = hfg.run(apart(), clock="virtual")
    assert report.outcome == "done"
    assert report.outputs == {"out": [3 * number for number in range(20)]}
    assert {path: node.firings for path, node in report.nodes.items()} == {"numbers": 21, "double": 21, "add": 21}
    assert {label: edge.sent for label, edge in report.edges.items()} == {
        "numbers.out -> double.value": 21,
        "numbers.out -> add.a": 21,
        "double.out -> add.b": 21,
        "add.out -> out": 21,
    }


@pytest.mark.rule("L1")
def test_threads_may_work_in_a_process_of_their_own() -> None:
    assert hfg.run(apart(threads=2), clock="virtual").outputs == {"out": [3 * number for number in range(20)]}


@pytest.mark.rule("L1", "L4")
def test_arrays_cross() -> None:
    graph = hfg.Graph()
    graph.group("vision", process=True)
    source, mean = graph.add(pictures()), graph.add(brightness(), group="vision")
    graph.connect(source.out, mean.picture)
    graph.connect(mean.out, graph.output("out", float))
    assert hfg.run(graph, clock="virtual").outputs == {"out": [0.0, 1.0, 2.0]}


@pytest.mark.rule("X1", "L1")
def test_a_node_that_fails_in_another_process_ends_the_run_and_is_named() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, picky = graph.add(numbers()), graph.add(refuses(), group="far")
    graph.connect(source.out, picky.value)
    with pytest.raises(hfg.errors.NodeError, match='node "refuses" failed in firing 4: ValueError: no 3') as caught:
        hfg.run(graph, clock="virtual")
    assert caught.value.path == "refuses"
    assert "in the process of group 'far'" in "\n".join(caught.value.__notes__)


@pytest.mark.rule("L4")
def test_a_port_of_any_type_cannot_cross_and_is_named_before_the_start() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, loose, last = graph.add(numbers()), graph.add(anything()), graph.add(takes(), group="far")
    graph.connect(source.out, loose.value)
    graph.connect(loose.out, last.value)
    with pytest.raises(hfg.errors.CheckFailed, match=r'"anything.out".*cannot cross'):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("A11", "L1")
def test_a_gate_between_two_processes_is_refused() -> None:
    graph = apart()
    graph.gate(graph["add"], by=graph["double"])
    with pytest.raises(hfg.errors.CheckFailed, match='it is gated by "double", and the two are in different processes'):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("A10", "L1")
def test_data_that_comes_before_a_part_begins_waits_until_start_is_on_its_edges(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begin, receive = Part.begin, Part.receive
    held: list[Part] = []
    early: list[int] = []

    def begin_later(part: Part) -> None:
        if part.name == "far":
            held.append(part)
        else:
            begin(part)

    def begin_now(part: Part, label: str, tokens: list[Any]) -> None:
        receive(part, label, tokens)
        if held:
            early.append(len(tokens))
            begin(held.pop())

    monkeypatch.setattr(Part, "begin", begin_later)
    monkeypatch.setattr(Part, "receive", begin_now)
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, looks = graph.add(numbers(count=3)), graph.add(Looks(), group="far")
    graph.connect(source.out, looks.value)
    graph.connect(looks.out, graph.output("active", int))
    graph.connect(graph.start, looks.activate, active=True)
    assert hfg.run(graph, clock="virtual").outputs["active"] == [1, 1, 1]
    assert early == [1]
