"""A node that an edit copies is copied as it is when the edit takes effect (rules R4, P8)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg import commands as c
from tests.semantics.nodes import drive, numbers


class Holds(hfg.Node):
    """Is amid a firing for long."""

    value = hfg.Input(int)

    async def process(self, value: int) -> None:
        await asyncio.sleep(5)


class Dial(hfg.Node):
    """Has parameters that others set."""

    level = hfg.Parameter(1)
    gain = hfg.Parameter(1)
    seen = hfg.Event(int)


def _dialled() -> hfg.Graph:
    graph = hfg.Graph()
    dial = graph.add(Dial(), name="dial")
    graph.connect(graph.add(numbers(count=1)).out, graph.add(Holds(), name="holds").value)
    graph.connect(graph.start, dial.enable)
    return graph


@pytest.mark.rule("R4", "P8")
@pytest.mark.parametrize(
    ("edits", "expected"),
    [
        ([], (9, 1)),
        ([c.SetParameter("copy.level", 5)], (5, 1)),
        ([c.SetParameter("dial.level", 6)], (9, 1)),
        ([c.SetParameter("dial.gain", 6)], (9, 1)),
    ],
)
def test_a_copy_has_the_values_of_the_moment_at_which_the_edit_takes_effect(
    edits: list[c.Command], expected: tuple[int, int]
) -> None:
    async def main() -> None:
        graph = _dialled()
        async with hfg.running(graph, clock="virtual") as run:
            await asyncio.sleep(1)
            await run.edit(c.SetParameter("dial.level", 2))
            editing = asyncio.create_task(run.edit(c.Copy("dial", "copy"), *edits, c.Disable("holds")))
            await asyncio.sleep(1)
            assert not editing.done()  # the node that it touches, too, is amid a firing
            run.set("dial.level", 9)
            await editing
            copy = graph["copy"]
            assert (copy.level, copy.gain) == expected
            await run.undo()
            await run.redo()
            assert (graph["copy"].level, graph["copy"].gain) == expected

    drive(main)


@pytest.mark.rule("R4")
def test_a_copy_of_what_the_same_edit_has_set_has_that() -> None:
    async def main() -> None:
        graph = _dialled()
        async with hfg.running(graph, clock="virtual") as run:
            await asyncio.sleep(1)
            await run.edit(c.SetParameter("dial.level", 6), c.Copy("dial", "copy"), c.Disable("holds"))
            assert (graph["copy"].level, graph["dial"].level) == (6, 6)

    drive(main)
