"""Virtual time: the clock jumps when nothing is ready and nothing is in flight."""

from __future__ import annotations

import asyncio
import threading

import anyio
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


@pytest.mark.rule("R6")
def test_equal_deadlines_ring_in_the_order_in_which_they_were_set() -> None:
    async def main() -> list[int]:
        loop = asyncio.get_running_loop()
        rang: list[int] = []
        timers = [loop.call_at(1.0 if number % 3 else 0.5, rang.append, number) for number in range(100)]
        for timer in timers[::7]:
            timer.cancel()
        loop.call_at(0.1 + 0.2, rang.append, -1)  # a sum of floats that means 0.3
        loop.call_at(0.3, rang.append, -2)
        await asyncio.sleep(2)
        return rang

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        left = [number for number in range(100) if number % 7]
        assert runner.run(main()) == [
            -1,
            -2,
            *(number for number in left if not number % 3),
            *(number for number in left if number % 3),
        ]


@pytest.mark.rule("R6")
def test_who_asks_again_at_a_moment_that_is_over_by_the_count_but_not_by_a_sum_of_floats_is_not_asked_for_ever() -> (
    None
):
    """As the deadlines of anyio are: it looks whether they have come, and sets its timer again if not."""
    asked: list[float] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(5.143333333)
        deadline, over = loop.time() + 5.0, loop.create_future()
        assert deadline > round(deadline, 9)

        def look() -> None:
            asked.append(loop.time())
            if loop.time() >= deadline or len(asked) > 9:
                over.set_result(None)
            else:
                loop.call_at(deadline, look)

        loop.call_at(deadline, look)
        await over

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(main())
    assert asked == [10.143333333, pytest.approx(10.143333335, abs=2e-9)]


@pytest.mark.rule("R6")
def test_virtual_time_counts_nanoseconds_so_that_sums_of_floats_make_no_noise() -> None:
    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        times = []
        for _ in range(30):
            await asyncio.sleep(0.1)
            times.append(loop.time())
        return times

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main()) == [number / 10 for number in range(1, 31)]


@pytest.mark.rule("R6")
@pytest.mark.parametrize("begin", [0.0, 0.1, 0.028571429, 3e7])
@pytest.mark.parametrize("limit", [0.2, 1 / 70, 1e-9, 3e-10, 1e-15])
def test_who_waits_again_until_his_moment_has_come_does_not_wait_for_ever(begin: float, limit: float) -> None:
    """As anyio's time limits do, whose deadline a clock of nanoseconds may never show."""

    async def main() -> bool:
        await asyncio.sleep(begin)
        with anyio.move_on_after(limit) as scope:
            await asyncio.Event().wait()
        return scope.cancelled_caught

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main())


def test_after_years_the_clock_still_moves() -> None:
    async def main() -> float:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(1e9)
        for _ in range(3):
            await asyncio.sleep(0.1)
        return loop.time()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main()) == pytest.approx(1e9 + 0.3, abs=1e-5)
