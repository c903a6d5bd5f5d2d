"""The controller: exact in virtual time, the same as by hand in plain asyncio, and not longer."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

import hfg
from examples import controller
from hfg.trace import FiringStarted
from tests.examples import plain_controller
from tests.examples.lengths import lines_of_code


def in_virtual_time(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def test_it_draws_the_same_curve_as_by_hand(capsys: pytest.CaptureFixture[str]) -> None:
    in_virtual_time(controller.steer)
    ours = capsys.readouterr().out.splitlines()
    in_virtual_time(plain_controller.steer)
    by_hand = capsys.readouterr().out.splitlines()
    assert len(ours) == 60
    assert ours == by_hand
    assert ours[19].startswith(" 2.0 s +1.058")
    assert ours[-1].startswith(" 6.0 s +0.534")


def test_it_is_no_longer_than_by_hand() -> None:
    assert lines_of_code(controller) <= lines_of_code(plain_controller)


@pytest.mark.rule("F11", "R6")
def test_steps_are_exact_in_virtual_time() -> None:
    trace: list[Any] = []
    hfg.run(controller.build(), clock="virtual", trace=trace.append)
    steps = [event.time for event in trace if isinstance(event, FiringStarted) and event.node == "cart"]
    assert steps == [number / 100 for number in range(601)]


@pytest.mark.rule("F11")
def test_a_late_step_does_not_make_those_behind_it_late() -> None:
    """Under a load that takes a part of every step the grid stays where it is."""

    class Busy(hfg.Node):
        position = hfg.Input(float)

        def process(self, position: float) -> None:
            loop = asyncio.get_running_loop()
            assert isinstance(loop, hfg.VirtualTimeLoop)
            loop.spend(0.0037)

    graph = controller.build()
    graph.connect(graph["cart.position"], graph.add(Busy()).position)
    trace: list[Any] = []
    hfg.run(graph, clock="virtual", trace=trace.append)
    steps = [event.time for event in trace if isinstance(event, FiringStarted) and event.node == "cart"]
    assert len(steps) == 601
    assert max(abs(step - number / 100) for number, step in enumerate(steps)) < 0.005
