"""A forked process has one thread of the program: whatever belongs to the others must not hold it up, nor it them."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import pytest

import hfg
from hfg.tuning import tune
from hfg.tuning.workers import Died, Workers, in_process
from tests.limits import patience

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent.parent


def answer(work: object) -> bytes | Died:
    """Let a worker do it, within a time."""
    assert callable(work)
    with Workers(lambda _: str(work()).encode(), processes=1, patience_s=patience(5)) as workers:
        (found,) = workers.in_order([b""])
    assert not isinstance(found, Died), found
    return found


def test_a_process_leaves_the_garbage_of_its_parent_alone() -> None:
    """As a Zenoh session that nobody closed: its finalizer waits for threads that a forked process does not have."""
    here = os.getpid()

    class Session:
        def __init__(self) -> None:
            self.me = self

        def __del__(self) -> None:
            if os.getpid() != here:
                threading.Event().wait()

    gc.disable()
    try:
        Session()
        answer(gc.collect)
    finally:
        gc.enable()


@contextmanager
def stuck_stream() -> Iterator[TextIO]:
    """Give a stream into which another thread writes more than its reader takes: it holds the stream's lock."""
    reader, writer = os.pipe()
    os.set_blocking(writer, True)
    with os.fdopen(reader, "rb") as there, os.fdopen(writer, "w") as stream:
        full = threading.Event()

        def write() -> None:
            full.set()
            stream.write("x" * 1_000_000)
            stream.flush()

        thread = threading.Thread(target=write)
        thread.start()
        full.wait()
        first = there.read(1)  # the thread is in the middle of its writing
        try:
            yield stream
        finally:
            rest = len(first)
            while rest < 1_000_000:
                rest += len(there.read1())
            thread.join()


def test_a_stream_that_another_thread_writes_to_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    with stuck_stream() as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        answer(lambda: print("told"))
        monkeypatch.undo()


def test_a_log_that_another_thread_writes_to_holds_nobody_up() -> None:
    log = logging.getLogger("hfg.tests.forks")
    with stuck_stream() as stream:
        handler = logging.StreamHandler(stream)
        log.addHandler(handler)
        answer(lambda: log.error("told"))
        log.removeHandler(handler)


def killing_itself(_: bytes) -> bytes:
    os.kill(os.getpid(), signal.SIGUSR1)
    return b""


def test_signals_to_a_process_do_not_reach_the_loop_of_the_program() -> None:
    handled: list[int] = []
    here, there = socket.socketpair()
    here.setblocking(False)
    there.setblocking(False)
    before = signal.signal(signal.SIGUSR1, lambda number, _: handled.append(number))
    descriptor = signal.set_wakeup_fd(there.fileno())
    try:
        died = in_process(killing_itself, b"")
    finally:
        signal.set_wakeup_fd(descriptor)
        signal.signal(signal.SIGUSR1, before)
    assert str(died) == "its process ended by signal SIGUSR1"
    with here, there, pytest.raises(BlockingIOError):
        here.recv(1)
    assert not handled


def test_threads_of_opencv_hold_nobody_up() -> None:
    cv2 = pytest.importorskip("cv2")
    np = pytest.importorskip("numpy")
    image = np.random.default_rng(1).integers(0, 255, (1000, 1000, 3), np.uint8)

    def blur() -> int:
        return int(cv2.GaussianBlur(cv2.medianBlur(image, 5), (31, 31), 5).sum())

    threads = cv2.getNumThreads()
    cv2.setNumThreads(4)
    try:
        assert answer(blur) == str(blur()).encode()
    finally:
        cv2.setNumThreads(threads)


# --- searches where a program has a loop, threads, and a graph that runs ---


@hfg.node
def square(*, x: float = 2.0) -> Iterator[float]:
    yield x * x


def build() -> hfg.Graph:
    graph = hfg.Graph("square")
    graph.connect(graph.add(square(), name="square").out, graph.output("squared", float))
    return graph


def found() -> float:
    best = tune(build, ["square.x=-1..1"], minimize="squared", evaluations=9, processes=2, patience_s=patience(10)).best
    assert not best.failed, best.why
    return best.means[0].value


def test_a_search_works_inside_a_running_loop_and_beside_it() -> None:
    async def main() -> list[float]:
        beside = asyncio.create_task(asyncio.to_thread(found))
        return [found(), await beside]

    first, second = asyncio.run(main())
    assert first == second < 1


def test_processes_of_several_threads_do_not_wait_for_each_other() -> None:
    """A process that had the other's end of a pipe would keep it open until it ends itself."""
    reader, writer = os.pipe()

    def waits(_: bytes) -> bytes:
        return os.read(reader, 1)

    def quick(_: bytes) -> bytes:
        return b"done"

    with ThreadPoolExecutor() as pool:
        slow = pool.submit(in_process, waits, b"")
        answers = [one.result(timeout=patience(20)) for one in [pool.submit(in_process, quick, b"") for _ in range(12)]]
        os.write(writer, b"x")
        assert slow.result() == b"x"
    assert answers == [b"done"] * 12
    os.close(reader)
    os.close(writer)


def test_a_search_works_in_a_node_of_a_graph_that_runs() -> None:
    @hfg.node
    def searched(*, seed: int = 1) -> Iterator[float]:
        yield found()

    graph = hfg.Graph("outer")
    graph.connect(graph.add(searched(), group="work").out, graph.output("best", float))
    graph.group("work", threads=1)
    assert hfg.run(graph, clock="virtual").outputs["best"] == [found()]


# --- killed, and continued ---

PROGRAM = """
import sys
from tests.tuning.test_forks import build
from hfg.tuning import tune

found = tune(build, ["square.x=-9..9"], minimize="squared", evaluations=24, processes=2, journal=sys.argv[1],
             told=lambda run: print("run", flush=True))
print(repr(found.best.values["square.x"]), [one.means[0].value for one in found.evaluations], flush=True)
"""


def search(journal: Path, runs: int | None) -> str:
    """Search in a program of its own; kill it after some runs, or return what it says in the end."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(journal)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        last = ""
        for number, line in enumerate(program.stdout, 1):
            last = line
            if number == runs:
                program.kill()
    assert program.returncode == (0 if runs is None else -signal.SIGKILL)
    return last


@pytest.mark.parametrize("kills", [3, pytest.param(10, marks=pytest.mark.soak)])
@pytest.mark.timeout(300)
def test_a_search_that_is_killed_again_and_again_ends_with_the_same_result(tmp_path: Path, kills: int) -> None:
    for number in range(1, kills + 1):
        search(tmp_path / "killed", number * 20 // kills)
    assert search(tmp_path / "killed", None) == search(tmp_path / "whole", None)
    assert (tmp_path / "killed").read_bytes() == (tmp_path / "whole").read_bytes()
