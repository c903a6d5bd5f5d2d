"""Code that does not end when it is cancelled: a run ends all the same, and its report names the node (X2, X3)."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from tests.semantics.nodes import drive, run


async def stays() -> None:
    while True:
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.sleep(1e6)


class Sinks(hfg.Node):
    value = hfg.Input(int)

    def process(self, value: int) -> None:
        """Take it."""

    @hfg.slot
    def hear(self) -> None:
        """Take activity."""


class Closes(Sinks):
    async def teardown(self) -> None:
        await stays()


class Greets(Sinks):
    async def on_activated(self) -> None:
        await stays()


class Works(Sinks):
    async def process(self, value: int) -> None:  # type: ignore[override]
        await stays()


class Later(hfg.Node):
    """Speaks after a second."""

    now = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        await asyncio.sleep(1)
        self.now.trigger()


@hfg.node
def once() -> Iterator[int]:
    yield 1


def graph(node: Any, **options: Any) -> tuple[hfg.Graph, Later]:
    made = hfg.Graph()
    made.connect(made.add(once()).out, made.add(node, name="node", **options).value)
    later = made.add(Later())
    made.connect(made.start, later.begin)
    return made, later


GIVEN_UP = 'node "node" failed in teardown(): it took longer than 5 s and was given up'


@pytest.mark.rule("R4", "X3")
@pytest.mark.parametrize("command", [c.Remove("node"), c.Replace("node", f"{__name__}:Sinks")])
def test_an_edit_takes_effect_though_a_teardown_does_not_end(command: c.Command) -> None:
    made, _ = graph(Closes())

    async def main() -> tuple[float, hfg.Report]:
        async with hfg.running(made) as running:
            await asyncio.sleep(2)
            await running.edit(command)
            over = running.elapsed()
            await running.wait_finished()
        return over, running.report()

    over, report = drive(main)
    assert over == 7
    assert report.errors == [GIVEN_UP]


@pytest.mark.rule("A9", "X3")
def test_a_reset_whose_teardown_does_not_end_fails_the_run() -> None:
    made, later = graph(Closes())
    made.connect(later.now, made["node"].reset)
    with pytest.raises(hfg.errors.NodeError, match=r"took longer than 5 s"):
        run(made)


@pytest.mark.rule("X1", "X3")
def test_a_restart_goes_on_though_the_teardown_does_not_end() -> None:
    class FailsOnce(Closes):
        def process(self, value: int) -> None:
            raise ValueError("no")

    made, _ = graph(FailsOnce(), on_error="restart")
    with pytest.raises(hfg.errors.TeardownError, match="took longer than 5 s"):  # the second one, at the end
        run(made)


@pytest.mark.rule("X3")
def test_a_hook_of_activity_that_does_not_end_is_named_and_left_behind() -> None:
    made, _ = graph(Greets())
    made.connect(made.start, made["node"].hear, active=True)

    async def main() -> None:
        with pytest.raises(
            hfg.errors.TeardownError, match=r'"node" failed in on_activated\(\): it was cancelled and did'
        ):
            await hfg.run_async(made, until_s=3)
        await asyncio.sleep(0)
        assert [task for task in asyncio.all_tasks() if task is not asyncio.current_task()] == []

    drive(main)


@pytest.mark.rule("X2", "X3")
def test_a_firing_that_was_given_up_and_does_not_end_keeps_no_run_open() -> None:
    made, _ = graph(Works(), max_duration_s=1.0, on_error="skip")
    report = run(made)
    assert report.outcome == "done"
    assert report.errors == [
        'node "node" failed in firing 1: it took longer than max_duration_s = 1 s and was given up'
    ]
