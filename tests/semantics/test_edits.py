"""Edits of a graph that runs (rule R4)."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import hfg
from hfg.errors import GraphError, NotRunning, RunError, UsageError
from hfg.testing import recorder
from hfg.testing.edits import drawn, random_edit
from hfg.testing.making import Allowed, SeededChooser, random_plan
from hfg.testing.planned import planned, planned_afresh

SEQUENCES = 100  # random graphs, each edited up to twelve times while it runs


@pytest.mark.rule("R4", "G1")
@pytest.mark.parametrize("block", range(10))
def test_the_plan_after_an_edit_is_the_plan_made_afresh(block: int) -> None:
    for seed in range(block * SEQUENCES // 10, (block + 1) * SEQUENCES // 10):
        with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
            runner.run(edited_at_random(seed))


async def edited_at_random(seed: int) -> None:
    plan, choose = random_plan(seed, Allowed(failures=False, waiting=seed % 2 == 0)), SeededChooser(seed)
    graph = plan.build()
    try:
        async with hfg.running(graph, policy="random", seed=seed, trace=recorder()) as run:
            for number in range(12):
                await some_time(choose)
                before = drawn(graph)
                try:
                    await one_edit(run, graph, choose, number)
                except NotRunning:
                    return
                except (GraphError, UsageError):
                    assert drawn(graph) == before
                    continue
                assert planned(run._engine) == planned_afresh(run._engine), f"seed {seed}, edit {number}"
            run.stop()
    except RunError:
        pass


async def some_time(choose: SeededChooser) -> None:
    for _ in range(choose.number(0, 10)):
        await asyncio.sleep(0)
    if choose.chance(40):
        await asyncio.sleep(0.004)


async def one_edit(run: Any, graph: hfg.Graph, choose: SeededChooser, number: int) -> None:
    what = choose.number(0, 9)
    if what == 0:
        await run.undo()
    elif what == 1:
        await run.redo()
    else:
        await run.edit(*random_edit(graph, choose, number))
