"""Processes in a row are edited and die at random; each value comes out once, in order (rules R4, L2, L3)."""

from __future__ import annotations

import asyncio
import logging
import os
import random
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import RunError, UsageError
from tests.parts.mortal import mortal_parts
from tests.parts.test_edits import HERE, more
from tests.parts.test_from_outside import through, with_run

pytestmark = pytest.mark.slow

SEEDS = int(os.environ.get("HFG_SOAK_EDITS", "2000"))
VALUES = 80
SOON_S = 60.0  # of virtual time
APART = 1000  # what a node that comes adds is a multiple of it, so that one can see which value it was


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Processes that die are told of each time."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def row(processes: int) -> hfg.Graph:
    """So many processes in a row, three nodes in each, each of which adds 1."""
    graph = hfg.Graph("row")
    port: Any = graph.input("in", int)
    for number in range(processes):
        graph.group(f"p{number}", process=True)
        for name in "abc":
            node: Any = graph.add(more(by=1), name=f"{name}{number}", group=f"p{number}")
            graph.connect(port, node.value)
            port = node.out
    graph.connect(port, graph.output("out", int))
    return graph


def a_node_between(run: hfg.Run, choose: random.Random, process: int, step: int) -> list[Any]:
    """Commands that put one more node into a process."""
    name, before = f"x{step}", f"{choose.choice('ab')}{process}"
    edge = next(edge for edge in run.graph.edges if edge.source.path.startswith(f"{before}."))
    source, target = edge.source.path, edge.target.path
    return [
        c.Disconnect(source, target),
        c.Add(f"{HERE}:more", name, parameters={"by": APART * 10**step}, options={"group": f"p{process}"}),
        c.Connect(source, f"{name}.value"),
        c.Connect(f"{name}.out", target),
    ]


async def edit_and_kill(run: hfg.Run, choose: random.Random, processes: int, parts: dict[str, Any]) -> int:
    """A few edits, undos and deaths, one after the other or all at once; gives how many edits were made."""
    made = 0
    kinds = ["edit", "edit", "undo", "redo", "kill", "edit and kill"][: choose.choice([4, 6])]
    for step in range(choose.randint(1, 6)):
        await asyncio.sleep(choose.choice([0.0, 0.001, 0.003, 0.01, 0.05, 0.15]))
        kind, process = choose.choice(kinds), choose.randrange(processes)
        if kind == "kill":
            parts[f"p{process}"].kill()
            continue
        doing = run.undo() if kind == "undo" else run.redo() if kind == "redo" else None
        if doing is None:
            doing = run.edit(*a_node_between(run, choose, process, step))
        asked = asyncio.create_task(doing)
        if kind == "edit and kill":
            await asyncio.sleep(choose.choice([0.0, 0.001, 0.002, 0.004, 0.006, 0.01]))
            parts[f"p{choose.randrange(processes)}"].kill()
        try:
            async with asyncio.timeout(SOON_S):
                await asked
        except (UsageError, RunError):
            continue  # nothing to undo, or the process has died
        made += 1
    return made


def check(seed: int, monkeypatch: pytest.MonkeyPatch) -> int:
    choose = random.Random(seed)
    processes = choose.randint(1, 3)
    parts = mortal_parts(monkeypatch, seed)

    async def body(run: hfg.Run) -> int:
        reading = asyncio.create_task(through(run, *range(VALUES)))
        made = await edit_and_kill(run, choose, processes, parts)
        async with asyncio.timeout(SOON_S):
            found = await reading
        assert [value % APART for value in found] == [value + 3 * processes for value in range(VALUES)], seed
        drawn = sum(node._parameters["by"] for node in run.graph.nodes.values())
        async with asyncio.timeout(SOON_S):
            assert await through(run, 0) == [drawn], seed
        return made

    done: int = with_run(row(processes), body)
    return done


@pytest.mark.rule("R4", "L1", "L2", "L3")
@pytest.mark.parametrize("block", range(4))
def test_edits_and_deaths_at_random_lose_and_double_nothing(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert sum(check(seed, monkeypatch) for seed in range(10 * block, 10 * block + 10)) > 5


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_many_edits_and_deaths_lose_and_double_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(10_000, 10_000 + SEEDS):
        check(seed, monkeypatch)
