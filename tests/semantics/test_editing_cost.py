"""An edit of a running graph looks at what it touches, not at the whole graph (rule R4)."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.errors import GraphError
from hfg.testing.nodes import double
from tests.support.planned import planned, planned_afresh

TYPE = "hfg.testing.nodes:double"
BETWEEN = (
    commands.Disconnect("n9.out", "n10.value"),
    commands.Add(TYPE, "new"),
    commands.Connect("n9.out", "new.value"),
    commands.Connect("new.out", "n10.value"),
)


def chain(length: int) -> hfg.Graph:
    graph = hfg.Graph()
    nodes = [graph.add(double(), name=f"n{number}") for number in range(length)]
    for one, other in pairwise(nodes):
        graph.connect(one.out, other.value)
    graph.add(double(), name="spare")
    return graph


def calls_of(edit: Sequence[commands.Command], length: int) -> int:
    """How many functions of ours an edit and its undoing call, when the index of the plan is there."""
    count = 0

    def note(frame: Any, what: str, _argument: Any) -> None:
        nonlocal count
        count += what == "call" and "hfg" in frame.f_code.co_filename

    async def main() -> None:
        async with hfg.running(chain(length)) as run:
            await run.edit(*edit)
            await run.undo()
            await run.wait_quiet()
            sys.setprofile(note)
            try:
                await run.edit(*edit)
                await run.undo()
            finally:
                sys.setprofile(None)
            assert planned(run._engine) == planned_afresh(run._engine)

    asyncio.run(main())
    return count


@pytest.mark.rule("R4")
@pytest.mark.parametrize(
    "edit",
    [
        (commands.Add(TYPE, "new"),),
        (commands.Remove("spare"),),
        (commands.Remove("n10"),),
        (commands.Copy("n10", "new"),),
        (commands.Replace("n10", TYPE),),
        (commands.Rename("n10", "new"),),
        (commands.Connect("n3.out", "spare.value"),),
        (commands.Disconnect("n9.out", "n10.value"),),
        (commands.MakeActive("n9.out", "n10.value"),),
        BETWEEN,
    ],
    ids=lambda edit: " ".join(type(one).__name__ for one in edit),
)
def test_an_edit_costs_by_what_it_touches(edit: tuple[commands.Command, ...]) -> None:
    few, many = calls_of(edit, 20), calls_of(edit, 400)
    assert many < 1.5 * few  # places are found in logarithmic time


@pytest.mark.rule("R4", "P7")
def test_a_ring_that_edits_close_step_by_step_is_refused() -> None:
    async def main() -> None:
        graph = chain(4)
        async with hfg.running(graph) as run:
            await run.edit(commands.Connect("spare.out", "n0.value"))  # against the order of adding
            with pytest.raises(GraphError, match="ring of synchronous edges"):
                await run.edit(commands.Connect("n3.out", "spare.value"))
            await run.edit(commands.Disconnect("n1.out", "n2.value"))
            await run.edit(commands.Connect("n3.out", "spare.value"))
            with pytest.raises(GraphError, match="ring of synchronous edges"):
                await run.edit(commands.Connect("n1.out", "n2.value"))
            assert planned(run._engine) == planned_afresh(run._engine)

    asyncio.run(main())


@pytest.mark.rule("R4", "G1")
def test_who_was_replaced_and_enclosed_in_one_step_is_where_he_was_when_that_is_undone() -> None:
    async def main() -> None:
        async with hfg.running(chain(3)) as run:
            await run.edit(commands.Replace("n1", TYPE), commands.Enclose(("n0", "n1"), "box"))
            assert planned(run._engine) == planned_afresh(run._engine)
            await run.undo()
            assert planned(run._engine) == planned_afresh(run._engine)
            await run.redo()
            assert planned(run._engine) == planned_afresh(run._engine)

    asyncio.run(main())
