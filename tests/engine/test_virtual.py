"""Virtual time: the clock jumps when nothing is ready and nothing is in flight."""

from __future__ import annotations

import asyncio
import threading

import pytest

from hfg.engine.executing.virtual import VirtualTimeLoop


@pytest.mark.rule("R6")
def test_a_day_of_sleep_takes_no_time_and_ends_on_the_second() -> None:
    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        times = [loop.time()]
        await asyncio.sleep(86_400)
        times.append(loop.time())
        async with asyncio.timeout(5):
            await asyncio.sleep(1)
        times.append(loop.time())
        return times

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main()) == [0.0, 86_400.0, 86_401.0]


@pytest.mark.rule("R6")
def test_work_in_a_thread_holds_the_clock_so_that_no_timeout_fires_falsely() -> None:
    release = threading.Event()

    async def main() -> tuple[str, float]:
        loop = asyncio.get_running_loop()
        loop.call_later(0, release.set)
        async with asyncio.timeout(5):
            await asyncio.to_thread(release.wait)
        return "done", loop.time()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main()) == ("done", 0.0)
