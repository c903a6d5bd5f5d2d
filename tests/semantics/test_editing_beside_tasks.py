"""Edits at the very moment in which code of a node has triggered for nobody (rules R4, F8)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg import commands as c
from hfg.testing import Recorder, recorder, replay
from hfg.testing.nodes import sink
from hfg.trace import EventTriggered, StructureChanged, TokenSent

MOMENT = 0.04


class Counting(hfg.Node):
    """Counts in a task, by steps that may be changed while it does."""

    counted = hfg.Event(int)
    step = hfg.Parameter(1)
    last = hfg.Parameter(3)

    def setup(self) -> None:
        self.start_soon(self.count())

    async def count(self) -> None:
        number = 0
        while number < self.last:
            await asyncio.sleep(0.02)
            number += self.step
            self.counted.trigger(number)


def graph() -> hfg.Graph:
    made = hfg.Graph("count")
    made.add(Counting(), name="counting")
    made.add(sink(), name="heard")
    return made


def edited(*commands: c.Command) -> Recorder:
    """Edit the run when it has counted to two, in the same moment; the oracle judges all of it."""
    trace = recorder()

    async def main() -> None:
        async with hfg.running(graph(), trace=trace) as run:
            await asyncio.sleep(MOMENT)
            while numbers(trace)[-1:] != [2]:
                await asyncio.sleep(0)
            await run.edit(*commands)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert next(event.time for event in trace if isinstance(event, StructureChanged)) == MOMENT
    replay(graph, trace)
    return trace


def numbers(trace: Recorder) -> list[int]:
    return [
        event.token.value for event in trace if isinstance(event, EventTriggered) and event.event.endswith("counted")
    ]


@pytest.mark.rule("R4")
def test_an_edge_that_an_edit_adds_carries_nothing_that_was_triggered_before_in_the_same_moment() -> None:
    trace = edited(c.Connect("counting.counted", "heard.value"))
    assert numbers(trace) == [1, 2, 3]
    sent = [event.token.value for event in trace if isinstance(event, TokenSent) and event.edge.startswith("counting")]
    assert sent == [3, hfg.END]


@pytest.mark.rule("R4", "P8")
def test_a_parameter_that_an_edit_sets_counts_for_what_a_task_does_next() -> None:
    assert numbers(edited(c.SetParameter("counting.step", 5))) == [1, 2, 7]


@pytest.mark.rule("R4", "P8", "R5")
def test_a_task_that_an_edit_shortens_at_the_moment_of_its_last_round_makes_that_round_still() -> None:
    assert numbers(edited(c.SetParameter("counting.last", 2))) == [1, 2, 3]
