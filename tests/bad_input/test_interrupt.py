"""Ctrl-C in a program that calls hfg.run: it ends with a sentence, torn down; a second one does not wait for that.

What the nodes are busy with lasts for ever, so a program that waited for it would not end at all.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import pytest

from tests.limits import patience

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")

PROGRAM = """
import asyncio, sys, threading, time
import hfg

WHERE = sys.argv[1]

def begun() -> None:
    print("begun", flush=True)

class First(hfg.Node):
    def setup(self) -> None: print("up", flush=True)
    def teardown(self) -> None: print("down", flush=True)

class Setup(hfg.Node):
    def setup(self) -> None:
        begun(); time.sleep(1e6)

class AsyncSetup(hfg.Node):
    async def setup(self) -> None:
        begun(); await asyncio.sleep(1e6)

class Waits(hfg.Node):
    @hfg.slot
    async def begin(self) -> None:
        begun(); await asyncio.Event().wait()

class Blocks(hfg.Node):
    @hfg.slot
    def begin(self) -> None:
        begun(); time.sleep(1e6)

class Teardown(hfg.Node):
    def teardown(self) -> None:
        begun(); time.sleep(1e6)

class AsyncTeardown(hfg.Node):
    async def teardown(self) -> None:
        begun(); await asyncio.sleep(1e6)

graph = hfg.Graph("busy")
graph.add(First())
if WHERE == "thread":
    graph.group("work", threads=1)
    node = graph.add(Blocks(), group="work")
else:
    kinds = {"setup": Setup, "async setup": AsyncSetup, "wait": Waits, "block": Blocks, "teardown": Teardown}
    node = graph.add((kinds | {"async teardown": AsyncTeardown})[WHERE]())
if hasattr(node, "begin"):
    graph.connect(graph.start, node.begin)
try:
    hfg.run(graph, block_warning_s=0)
finally:
    print("after", graph._run, flush=True)
"""

PLACES = ["setup", "async setup", "wait", "block", "thread", "teardown", "async teardown"]


class Ended(NamedTuple):
    code: int
    said: list[str]
    error: str


def interrupted(where: str, presses: int) -> Ended:
    """Start the program, press Ctrl-C so often once it is where it should be, and see how it ends."""
    command = [sys.executable, "-c", PROGRAM, where]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line.strip())
            if line.strip() == "begun":
                break
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        if presses == 2:
            time.sleep(0.1)
            process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=patience(40))
        return Ended(process.returncode, said + out.splitlines(), error)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


@pytest.fixture(scope="module")
def outcomes() -> Iterator[dict[tuple[str, int], Future[Ended]]]:
    """All of them side by side, since they mostly wait."""
    with ThreadPoolExecutor(4) as pool:
        yield {(where, presses): pool.submit(interrupted, where, presses) for presses in (1, 2) for where in PLACES}


@pytest.mark.slow
@pytest.mark.rule("X3")
@pytest.mark.parametrize("where", PLACES)
def test_one_press_tears_down_and_ends_with_a_sentence(
    where: str, outcomes: dict[tuple[str, int], Future[Ended]]
) -> None:
    ended = outcomes[where, 1].result()
    assert ended.code != 0
    assert ended.error.splitlines()[-1].startswith('KeyboardInterrupt: graph "busy" was interrupted; ')
    assert ended.error.count("Traceback") == 1
    assert ended.said[-1] == "after None"
    assert "down" in ended.said


@pytest.mark.slow
@pytest.mark.rule("X3")
@pytest.mark.parametrize("where", PLACES)
def test_a_second_press_ends_at_once(where: str, outcomes: dict[tuple[str, int], Future[Ended]]) -> None:
    """No limit is waited out, of those that a single press names."""
    ended = outcomes[where, 2].result()
    assert "did not come back" not in ended.error
    assert "took longer than" not in ended.error
    assert ended.error.splitlines()[-1].startswith('KeyboardInterrupt: graph "busy" was interrupted; ')
    assert ended.said[-1] == "after None"


@pytest.mark.slow
def test_a_thread_that_is_left_behind_is_named(outcomes: dict[tuple[str, int], Future[Ended]]) -> None:
    assert (
        'node "blocks" failed in slot begin, call 1: its thread did not come back'
        in outcomes["thread", 1].result().error
    )
