"""Whatever goes wrong leaves nothing running."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator

import pytest

from tests.limits import patience


def group_threads() -> list[str]:
    """The threads of thread groups that live."""
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("hfg group")]


@pytest.fixture(params=[True, False], ids=["fast", "plain"])
def fast(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture(autouse=True)
def _nothing_is_left(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No thread of a group, no task, no running loop is left behind."""
    left: list[str] = []
    close = asyncio.Runner.close

    def closing(runner: asyncio.Runner) -> None:
        loop = runner._loop  # type: ignore[attr-defined]
        if loop is not None and not loop.is_closed():
            tasks = [str(task) for task in asyncio.all_tasks(loop) if not task.done()]
            if not any("_run_to_end" in task for task in tasks):  # else the loop itself was broken off
                left.extend(tasks)
        close(runner)

    monkeypatch.setattr(asyncio.Runner, "close", closing)
    yield
    assert left == []
    until = time.monotonic() + patience(5)
    while group_threads() and time.monotonic() < until:
        time.sleep(0.01)
    assert group_threads() == []
