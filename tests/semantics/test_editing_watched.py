"""Taps and breakpoints are where they were when the graph is edited (rules R3, R4, G1)."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import UsageError
from hfg.testing.nodes import double, script, sink

EDITS: dict[str, tuple[c.Command, ...]] = {
    "rename": (c.Rename("middle", "other"),),
    "enclose": (c.Enclose(("middle",), "box"),),
    "enclose both ends": (c.Enclose(("middle", "sink"), "box"),),
    "replace": (c.Replace("middle", "hfg.testing.nodes:double"),),
    "make active": (c.MakeActive("middle.out", "sink.value"),),
    "draw it anew": (c.Disconnect("middle.out", "sink.value"), c.Connect("middle.out", "sink.value")),
    "move": (c.Move("middle", None), c.Rename("sink", "end")),
}
EDGE = "middle.out -> sink.value"


def line() -> hfg.Graph:
    graph = hfg.Graph("line")
    source, node, end = graph.add(script(values=tuple(range(100)))), graph.add(double(), name="middle"), sink()
    source >> node >> graph.add(end, name="sink")
    return graph


def drive(graph: hfg.Graph, body: Callable[[hfg.Run], Awaitable[Any]]) -> None:
    async def main() -> None:
        async with hfg.running(graph) as run:
            run.pause()
            await run.wait_paused()
            await body(run)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def place(graph: hfg.Graph, kind: str) -> Any:
    return {"port": "middle.out", "input": graph["sink.value"], "edge": EDGE, "drawn edge": graph.edges[1]}[kind]


@pytest.mark.rule("R4", "R3", "G1")
@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("kind", ["port", "input", "edge", "drawn edge"])
def test_a_tap_and_a_breakpoint_stay_at_their_place(kind: str, edit: str) -> None:
    graph = line()

    async def body(run: hfg.Run) -> None:
        tap = run.tap(place(graph, kind))
        point = run.break_at(place(graph, kind), when=lambda token: token.value == 20)
        for change in (run.edit(*EDITS[edit]), run.undo(), run.redo()):
            await change
        run.resume()
        assert await run.wait_paused() == point.path
        assert tap.latest is not None
        assert (tap.latest.value, tap.seen, point.hits) == (20, 11, 1)

    drive(graph, body)


@pytest.mark.rule("R4", "R3")
@pytest.mark.parametrize("edit", ["rename", "enclose", "replace"])
def test_a_breakpoint_at_a_node_is_called_as_the_node_is(edit: str) -> None:
    graph = line()

    async def body(run: hfg.Run) -> None:
        point = run.break_at("middle")
        await run.edit(*EDITS[edit])
        run.resume()
        path = await run.wait_paused()
        assert path == point.path == {"rename": "other", "enclose": "box/middle", "replace": "middle"}[edit]
        assert (await run.step(path)).moved == (path,)
        await run.undo()
        assert await run.wait_paused() == point.path == "middle"

    drive(graph, body)


@pytest.mark.rule("R4", "R3")
@pytest.mark.parametrize("where", ["middle", "middle.out", EDGE])
@pytest.mark.parametrize("boxed", [False, True])
def test_a_breakpoint_goes_with_its_node(where: str, boxed: bool) -> None:
    graph = line()

    async def body(run: hfg.Run) -> None:
        run.break_at(where)
        if boxed:
            await run.edit(c.Enclose(("middle",), "box"))
        await run.edit(c.Remove("box" if boxed else "middle"))
        assert run.breakpoints == []
        with pytest.raises((UsageError, hfg.errors.GraphError), match="there is no"):
            run.break_at(where)
        run.resume()
        await run.wait_finished()

    drive(graph, body)


@pytest.mark.rule("R3")
def test_a_condition_that_gives_no_truth_is_one_that_fails(caplog: pytest.LogCaptureFixture) -> None:
    class Undecided:
        def __bool__(self) -> bool:
            raise ValueError("perhaps")

    async def body(run: hfg.Run) -> None:
        run.break_at("middle.out", when=lambda _token: Undecided())
        run.resume()
        await run.wait_finished()
        assert run.breakpoints == []

    with caplog.at_level(logging.ERROR, logger="hfg.engine"):
        drive(line(), body)
    assert 'the condition of the breakpoint at "middle.out" failed' in caplog.text


# --- subgraphs that iterate ---


class Each(hfg.Subgraph):
    """Works on one element after the other."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        one, two = graph.add(double(), name="one"), graph.add(double(), name="two")
        graph.connect(self.value.inner, one.ports.inputs["value"])
        one >> two
        graph.connect(two.ports.outputs["out"], self.out.inner)


@hfg.node
def lists() -> Iterator[list[int]]:
    """Give a collection."""
    yield [1, 2, 3]


@hfg.node
def take(values: list[int]) -> None:
    """Take what was made of it."""


@pytest.mark.rule("R3", "G4")
def test_inside_of_what_iterates_one_can_pause_and_step_and_stop_at_nodes() -> None:
    graph = hfg.Graph()
    graph.add(lists()) >> graph.add(Each(), name="each", iterate_over=["value"]) >> graph.add(take())

    async def body(run: hfg.Run) -> None:
        point = run.break_at("each/two")
        run.resume()
        assert await run.wait_paused() == "each/two"
        await run.wait_quiet()
        assert (await run.step("each/two")).moved == ("each/two",)
        assert (await run.step("each/one")).moved == ("each/one",)
        assert (await run.step("take")).why_not == '"take" waits for "values"'
        at_edge = run.break_at("each/one.out", when=lambda token: token.value == 6)
        run.resume()
        assert await run.wait_paused() == "each/two"
        point.remove()
        run.resume()
        assert await run.wait_paused() == "each/one.out"
        assert at_edge.token is not None
        assert at_edge.token.value == 6
        run.resume()
        await run.wait_finished()
        assert point.hits == 2
        assert run.report().nodes["take"].firings == 2

    drive(graph, body)
