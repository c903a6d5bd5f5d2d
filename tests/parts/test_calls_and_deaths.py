"""What was asked of a part that dies: it is asked again, or fails with one sentence; nobody waits for ever (L2, L3)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

import hfg
from hfg.errors import RunError
from tests.parts.mortal import mortal_parts
from tests.parts.test_from_outside import fed, through
from tests.semantics.nodes import drive

SOON_S = 5.0


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The parts of the next run, by name."""
    return mortal_parts(monkeypatch)


def asked(parts: dict[str, Any], call: Callable[[hfg.Run], Coroutine[Any, Any, Any]], dies_s: float) -> Any:
    """Ask something of a part, and kill it so long after that; or so long before."""

    async def main() -> Any:
        async with hfg.running(fed(), clock="virtual") as run:
            await asyncio.sleep(0.5)
            if dies_s < 0:
                parts["far"].kill()
                await asyncio.sleep(-dies_s)
            asking = asyncio.create_task(call(run))
            if dies_s >= 0:
                await asyncio.sleep(dies_s)
                parts["far"].kill()
            async with asyncio.timeout(SOON_S):
                return await asking

    return drive(main)


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("dies_s", [0.0, 0.0005, 0.0015, 0.003])
def test_a_signal_to_a_part_that_dies_has_arrived_or_fails_with_one_sentence(parts: Any, dies_s: float) -> None:
    try:
        asked(parts, lambda run: run.trigger("scaler.again", 3), dies_s)
    except RunError as error:
        said = str(error)
        assert 'the process of group "far" is gone' in said
        assert '"trigger" of "scaler.again" may have been done or not: look, and ask again' in said


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("dies_s", [-0.001, -0.05, -0.1, -0.104, -0.11])
def test_a_signal_to_a_part_that_is_dead_waits_for_its_next_life(parts: Any, dies_s: float) -> None:
    async def both(run: hfg.Run) -> Any:
        waiting = asyncio.create_task(run.wait_for("scaler.large"))
        await asyncio.sleep(0)
        await run.trigger("scaler.again", 77)
        return (await waiting).value

    assert asked(parts, both, dies_s) == 2 * 77


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("dies_s", [-0.05, 0.0, 0.0015, 0.003, 0.3])
def test_whoever_waits_for_a_signal_of_a_part_that_dies_waits_on_in_its_next_life(parts: Any, dies_s: float) -> None:
    async def wait(run: hfg.Run) -> Any:
        waiting = asyncio.create_task(run.wait_for("scaler.large"))
        await asyncio.sleep(1.0)
        await run.trigger("scaler.again", 78)
        return (await waiting).value

    assert asked(parts, wait, dies_s) == 2 * 78


@pytest.mark.rule("R3", "L2", "L3")
@pytest.mark.parametrize("dies_s", [-0.05, 0.0, 0.0015, 0.003, 0.01])
def test_a_pause_waits_for_the_next_life_of_a_part_and_holds_there(parts: Any, dies_s: float) -> None:
    async def pause(run: hfg.Run) -> Any:
        run.pause()
        await run.wait_paused()
        await asyncio.sleep(1.0)
        fed = asyncio.create_task(through(run, 4))
        await asyncio.sleep(0.5)
        assert not fed.done()
        run.resume()
        return await fed

    assert asked(parts, pause, dies_s) == [8]


@pytest.mark.rule("P8", "R7", "L2")
@pytest.mark.parametrize("dies_s", [-0.05, 0.0, 0.0015, 0.003])
def test_what_is_set_and_looked_at_holds_in_the_next_life(parts: Any, dies_s: float) -> None:
    async def look(run: hfg.Run) -> Any:
        run.set("scaler.gain", 7)
        tap = run.tap("scaler.out")
        await run.refresh()
        await asyncio.sleep(1.0)
        found = await through(run, 2)
        return found, (await anext(aiter(tap))).value

    assert asked(parts, look, dies_s) == ([14], 14)


@pytest.mark.rule("L2", "X1")
def test_whoever_waits_for_a_part_that_is_not_begun_again_hears_of_the_end(parts: Any) -> None:
    waiting: list[asyncio.Task[Any]] = []

    async def main() -> None:
        async with hfg.running(fed(), clock="virtual") as run:
            waiting.append(asyncio.create_task(run.wait_for("scaler.large")))
            waiting.append(asyncio.create_task(run.wait_inputs("scaler")))
            for _ in range(6):
                await asyncio.sleep(6.0)
                parts["far"].kill()
            await asyncio.sleep(SOON_S)

    with pytest.raises(RunError, match="it died 6 times within 60 s"):
        drive(main)
    assert [str(task.exception()) for task in waiting] == [
        'the run ended before "scaler.large" was triggered',
        "None",
    ]
