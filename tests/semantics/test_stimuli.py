"""Engine and oracle under the same stimuli from outside, step by step."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

import hfg
from tests.semantics.nodes import Keep, drive
from tests.support.machines import EngineAgainstOracle


@pytest.mark.slow
@pytest.mark.rule("P10", "F10", "A4", "A7", "A9", "A14", "P8")
def test_what_comes_from_outside_has_the_same_effect() -> None:
    run_state_machine_as_test(
        EngineAgainstOracle,
        settings=settings(
            max_examples=60,
            stateful_step_count=12,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.mark.rule("P10", "F11")
def test_a_graph_is_not_quiet_while_somebody_has_a_token_for_a_free_input() -> None:
    graph = hfg.Graph()
    numbers, sink = graph.input("numbers", int), graph.add(Keep(), max_rate_hz=10)
    graph.connect(numbers, sink.value)

    async def main() -> list[int]:
        async with hfg.running(graph) as run, run.feed(numbers) as feed:
            sending = [asyncio.ensure_future(feed.send(value)) for value in (1, 2, 3)]
            await asyncio.sleep(0)
            await run.wait_quiet()
            seen = list(sink.values)
            await asyncio.gather(*sending)
            return seen

    assert drive(main) == [1, 2, 3]
