"""A path stands wherever a node or a port can be given, in the graph and in a run (rule G3)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import GraphError, NotRunning, UsageError
from tests.semantics.nodes import Clock, Ear, Keep, drive, forward, numbers, run, scale


class Box(hfg.Subgraph):
    data = hfg.Input(int)
    result = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.add(scale(factor=2))
        graph.connect(self.data.inner, "scale.value")
        graph.connect("scale.out", self.result.inner)


def lines() -> hfg.Graph:
    graph = hfg.Graph("lines")
    graph.add(numbers(count=3), name="src")
    graph.add(Box(), name="box")
    graph.add(Keep(), name="sink")
    return graph


@pytest.mark.rule("P1", "G3")
def test_edges_are_drawn_by_paths(fast: bool) -> None:
    graph = lines()
    edge = graph.connect("src.out", "box.data", buffer=2)
    graph.connect(graph["box"].result, "sink.value")
    assert edge.label == "src.out -> box.data"
    run(graph, fast)
    assert graph["sink"].values == [2, 4, 6]


def test_a_path_may_name_the_ports_of_the_graph_and_inner_sides() -> None:
    graph = lines()
    graph.connect(graph.input("in", int), "box.data")
    graph.connect("box.result", graph.output("out", int))
    graph.add(Ear(), name="ear")
    graph.connect("start", "ear.poke")
    graph.connect("ear.passed", "stop")
    box = graph["box"]
    assert graph["box.data.inner"] is box.data.inner
    assert graph["box.result.inner"] is box.result.inner
    assert graph[box.data.inner.path] is box.data.inner


@pytest.mark.parametrize(
    ("source", "target", "sentence"),
    [
        ("src.oot", "box.data", 'there is no "src.oot": "src" has no port "oot"; did you mean "out"?'),
        ("scr.out", "box.data", 'there is no "scr.out": graph "lines" has no node "scr"; did you mean "src"?'),
        ("src", "box.data", '"src" is no port; name a port of a node, as in "src.name"'),
        ("src.out", "box.data.outer", 'there is no "box.data.outer": only ".inner" may follow a port'),
        (
            "src.out",
            "sink.value.inner",
            'there is no "sink.value.inner": inputs, outputs, events and slots of a subgraph',
        ),
    ],
)
def test_a_path_that_leads_nowhere_says_where_it_ends(source: str, target: str, sentence: str) -> None:
    graph = lines()
    with pytest.raises(GraphError) as refused:
        graph.connect(source, target)
    assert sentence in str(refused.value)
    assert not graph.edges


def test_a_path_in_the_wrong_direction_is_refused_as_the_port_is() -> None:
    with pytest.raises(EdgeRefused, match='must be an output, event or parameter, got "sink.value"'):
        lines().connect("sink.value", "box.data")


@pytest.mark.parametrize("path", ["src.out.inner", "box.nothing.inner", "box.data.inner.inner"])
def test_an_inner_side_that_there_is_none_of_is_no_path(path: str) -> None:
    with pytest.raises(GraphError, match=f'there is no "{path}"'):
        lines()[path]


@pytest.mark.rule("A11")
def test_a_gate_is_set_by_paths() -> None:
    graph = lines()
    graph.add(Ear(), name="ear")
    gate = graph.gate("sink", by="ear")
    assert (gate.target, gate.by) == (graph["sink"], graph["ear"])
    with pytest.raises(GraphError, match='has no node "eer"; did you mean "ear"'):
        graph.gate("src", by="eer")


@pytest.mark.parametrize("given", [("src", "sink"), ("src",)])
def test_a_gate_has_to_say_who_works_while_whom_is_active(given: Any) -> None:
    with pytest.raises(UsageError, match=r"who works while whom is active.*write graph.gate\(detector, by=fetch\)"):
        lines().gate(*given)


def test_a_node_is_moved_by_its_path() -> None:
    graph = lines()
    graph.group("work", threads=1)
    graph.move("box/scale", group="work")
    assert graph["box/scale"]._options.group == "work"


@pytest.mark.rule("P8", "R3")
def test_a_run_takes_paths(fast: bool) -> None:
    async def main() -> list[Any]:
        graph = hfg.Graph()
        graph.add(Clock(), name="clock", max_rate_hz=1)
        graph.add(scale(factor=1), name="scale")
        keep = graph.add(Keep(), name="keep")
        graph.add(Ear(), name="ear")
        graph.connect("clock.out", "scale.value")
        graph.connect("scale.out", "keep.value")
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_for("clock.ticked")
            run.set("scale.factor", 10)
            await run.trigger("ear.hear", 5)
            run.wake("ear")
            with run.tap("scale.out") as tap:
                await anext(aiter(tap))
            await run.wait_outputs("clock")
            with pytest.raises(GraphError, match='"scale" has no parameter "factr"; did you mean "factor"'):
                run.set("scale.factr", 3)
            with pytest.raises(GraphError, match='has no port "heer"'):
                await run.trigger("ear.heer", 3)
        return [keep.values[1], graph["ear"].heard]

    assert drive(main) == [20, [5]]


@pytest.mark.parametrize("call", ["set", "tap", "pause", "break_at", "trigger"])
def test_behind_the_end_of_a_run_nothing_is_done_any_more(call: str, fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.add(forward(), name="node")
        graph.add(scale(), name="scale")
        ear = graph.add(Ear(), name="ear")
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_finished()
        calls: dict[str, Callable[[], Any]] = {
            "set": lambda: run.set("scale.factor", 3),
            "tap": lambda: run.tap("node.out"),
            "pause": run.pause,
            "break_at": lambda: run.break_at("node"),
            "trigger": lambda: asyncio.ensure_future(run.trigger(ear.hear, 3)),
        }
        with pytest.raises(NotRunning, match="the run is over"):
            await (calls[call]() or asyncio.sleep(0))

    drive(main)
