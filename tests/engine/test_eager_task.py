"""The dormant task of an async node: whatever asks for the current task works before and after the first suspension."""

from __future__ import annotations

import asyncio
import contextvars
from typing import Any

import anyio
import pytest

from hfg.engine.executing.eager_task import EagerTask
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model.core import PENDING

variable: contextvars.ContextVar[str] = contextvars.ContextVar("variable", default="unset")


def carried(code: Any, *more: Any) -> list[Any]:
    """Run coroutine functions one after the other in one eager_task, from a callback as the engine does.

    Gives back what became of each.
    """
    outcomes: list[Any] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        eager_task = EagerTask(loop, "test", contextvars.copy_context())
        for one in (code, *more):
            over = loop.create_future()

            def done(result: Any, error: BaseException | None, over: asyncio.Future[Any] = over) -> None:
                over.set_result(error if error is not None else result)

            def begin(one: Any = one, done: Any = done) -> None:
                try:
                    result = eager_task.start(one(), done)
                except Exception as error:
                    done(None, error)
                    return
                if result is not PENDING:
                    done(result, None)

            loop.call_soon(begin)
            outcomes.append(await over)
        eager_task.cancel()
        await asyncio.wait([eager_task.task], timeout=1)
        assert eager_task.task.done()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(main())
    return outcomes


async def plain() -> int:
    return 1


async def suspending() -> int:
    await asyncio.sleep(0)
    await asyncio.sleep(1)
    return 2


async def timed_out() -> str:
    try:
        async with asyncio.timeout(1):
            await asyncio.sleep(10)
    except TimeoutError:
        return "timeout"
    return "slept"


async def timed_out_at_once() -> str:
    try:
        async with asyncio.timeout(0):
            await asyncio.sleep(10)
    except TimeoutError:
        return "timeout"
    return "slept"


async def moved_on() -> bool:
    with anyio.move_on_after(1) as scope:
        await anyio.sleep(10)
    return scope.cancelled_caught


async def with_group() -> list[int]:
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(suspending()) for _ in range(2)]
    async with anyio.create_task_group() as other:
        other.start_soon(anyio.sleep, 1)
    return [task.result() for task in tasks]


async def with_variable() -> str:
    token = variable.set("inside")
    await asyncio.sleep(0)
    value = variable.get()
    variable.reset(token)
    return value


async def failing() -> None:
    await asyncio.sleep(0)
    raise ValueError("late")


async def current() -> bool:
    before = asyncio.current_task()
    await asyncio.sleep(0)
    return before is not None and before is asyncio.current_task()


@pytest.mark.parametrize(
    ("code", "outcome"),
    [
        (plain, 1),
        (suspending, 2),
        (timed_out, "timeout"),
        (timed_out_at_once, "timeout"),
        (moved_on, True),
        (with_group, [2, 2]),
        (with_variable, "inside"),
        (current, True),
    ],
)
@pytest.mark.rule("R1")
def test_code_that_asks_for_its_task_works_from_the_first_step_on(code: Any, outcome: Any) -> None:
    assert carried(code) == [outcome]


def test_one_carrier_takes_firing_after_firing_whatever_became_of_the_last() -> None:
    first, *rest = carried(failing, timed_out, plain, suspending, timed_out_at_once, failing, with_variable)
    assert isinstance(first, ValueError)
    assert rest[:4] == ["timeout", 1, 2, "timeout"]
    assert isinstance(rest[4], ValueError)
    assert rest[5] == "inside"


def test_a_cancelled_firing_does_not_cancel_the_next() -> None:
    outcomes: list[Any] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        eager_task = EagerTask(loop, "test", contextvars.copy_context())
        for cancel in (True, False):
            over: asyncio.Future[Any] = loop.create_future()

            def done(result: Any, error: BaseException | None, over: asyncio.Future[Any] = over) -> None:
                over.set_result(error or result)

            assert eager_task.start(suspending(), done) is PENDING
            if cancel:
                eager_task.cancel()
            outcomes.append(await over)
        assert eager_task.task.cancelling() == 0
        eager_task.cancel()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(main())
    assert isinstance(outcomes[0], asyncio.CancelledError)
    assert outcomes[1] == 2
