"""The loop in which `hfg.run` runs on the real clock keeps fractions of a millisecond (rule F11)."""

from __future__ import annotations

import asyncio
import select
import selectors
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from tests.limits import patience

needs_epoll = pytest.mark.skipif(not hasattr(selectors, "EpollSelector"), reason="only epoll waits by the millisecond")


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """For how long was waited by the microsecond."""
    found: list[float] = []
    real = select.select

    def noted(*arguments: Any) -> Any:
        found.append(arguments[3])
        return real(*arguments)

    monkeypatch.setattr(select, "select", noted)
    return found


@needs_epoll
@pytest.mark.rule("F11")
def test_it_waits_for_fractions_of_a_millisecond(waits: list[float]) -> None:
    async def main() -> None:
        for _ in range(50):
            await asyncio.sleep(0.0009)

    with asyncio.Runner(loop_factory=hfg.PunctualLoop) as runner:
        runner.run(main())
    assert any(0 < wait < 0.001 for wait in waits)


@pytest.mark.rule("F11")
def test_a_run_on_the_real_clock_is_in_it() -> None:
    loops: list[asyncio.AbstractEventLoop] = []

    @hfg.node
    def ticks() -> Iterator[int]:
        loops.append(asyncio.get_running_loop())
        yield 1

    graph = hfg.Graph()
    graph.add(ticks(), max_rate_hz=1000)
    hfg.run(graph)
    assert type(loops[0]) is hfg.PunctualLoop


def test_what_comes_from_another_thread_wakes_it() -> None:
    async def main() -> str:
        loop = asyncio.get_running_loop()
        came: asyncio.Future[str] = loop.create_future()
        threading.Thread(target=lambda: loop.call_soon_threadsafe(came.set_result, "woken")).start()
        async with asyncio.timeout(patience(20)):
            return await came

    with asyncio.Runner(loop_factory=hfg.PunctualLoop) as runner:
        assert runner.run(main()) == "woken"


@needs_epoll
def test_where_select_does_not_know_the_descriptor_epoll_waits_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*arguments: Any) -> Any:
        raise ValueError("filedescriptor out of range in select()")

    monkeypatch.setattr(select, "select", refuses)
    monkeypatch.setattr("hfg.engine.executing.punctual._MOST_DESCRIPTORS", 0)
    with asyncio.Runner(loop_factory=hfg.PunctualLoop) as runner:
        runner.run(asyncio.sleep(0.001))
