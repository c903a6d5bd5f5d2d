"""Ctrl-C in a real process: the run ends, torn down; a second one ends it at once.

What the nodes are busy with lasts for ever, so a run that waited for it would not end at all.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hfg.base.starting import is_command
from tests.limits import patience

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")

GRAPH = """
import asyncio, threading, time
import hfg

class Busy(hfg.Node):
    def setup(self) -> None: print("up", flush=True)
    def teardown(self) -> None: print("down", flush=True)
    @hfg.slot
    {prefix}def begin(self) -> None:
        print("begun", flush=True)
        {code}

graph = hfg.Graph("busy")
graph.group("thread", threads=1)
node = graph.add(Busy(), group="{group}")
graph.connect(graph.start, node.begin)
"""


REPORTED = """
import asyncio
import hfg

class Busy(hfg.Node):
    @hfg.slot
    async def begin(self) -> None:
        print("begun", flush=True)
        {code}

graph = hfg.Graph("busy")
graph.start.activates(graph.add(Busy()).begin)
"""


class Process:
    """`hfg run` in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[str] | None = None
        self.said: list[str] = []

    def run(self, code: str, *options: str) -> None:
        """Run a file, and wait until it says "begun"."""
        file = self._folder / "busy.py"
        file.write_text(code, encoding="utf-8")
        command = [sys.executable, "-m", "hfg", "run", str(file), *options]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.said.append(line.strip())
            if line.strip() == "begun":
                return
        raise AssertionError(self._process.communicate())

    def run_node(self, code: str, *options: str, group: str = "loop") -> None:
        """Run a graph whose one node is busy with `code`."""
        prefix = "async " if "await" in code else ""
        self.run(GRAPH.format(code=code, group=group, prefix=prefix), *options)

    def interrupt(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGINT)

    def end(self) -> tuple[int, str]:
        """Give the exit code, and what went to standard error."""
        assert self._process is not None
        out, err = self._process.communicate(timeout=patience(40))
        self.said += out.split()
        return self._process.returncode, err

    def kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            self._process.communicate()


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Process]:
    """Give a process that does not outlive the test."""
    process = Process(tmp_path)
    yield process
    process.kill()


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["real", "virtual"])
def test_a_node_that_waits_is_cancelled_and_torn_down(process: Process, clock: str) -> None:
    process.run_node("await asyncio.Event().wait()", "--clock", clock)
    process.interrupt()
    code, err = process.end()
    assert code == 1
    assert "down" in process.said
    assert "Traceback" not in err


@pytest.mark.slow
@pytest.mark.parametrize("code", ["time.sleep(1e6)", "while True: pass", "threading.Event().wait()"])
def test_a_node_that_blocks_the_loop_is_broken_into(process: Process, code: str) -> None:
    process.run_node(code)
    process.interrupt()
    returned, err = process.end()
    assert returned == 1
    assert "down" in process.said
    assert "interrupted" in err


@pytest.mark.slow
def test_a_thread_that_does_not_come_back_is_left_behind(process: Process) -> None:
    process.run_node("time.sleep(1e6)", group="thread")
    process.interrupt()
    code, err = process.end()
    assert code == 1
    assert "interrupted" in err


@pytest.mark.slow
def test_a_teardown_that_does_not_end_in_time_is_named(process: Process) -> None:
    code = GRAPH.format(code="await asyncio.Event().wait()", group="loop", prefix="async ")
    process.run(code.replace("def teardown(self) -> None: ", "async def teardown(self): await asyncio.sleep(1e6); "))
    process.interrupt()
    returned, err = process.end()
    assert returned == 1
    assert 'node "busy" failed in teardown(): it took longer than' in err
    assert "interrupted" in err


@pytest.mark.slow
def test_second_interrupt_ends_at_once(process: Process) -> None:
    process.run_node("time.sleep(1e6)", group="thread")
    process.interrupt()
    time.sleep(0.1)  # so that the system sees two signals
    process.interrupt()
    code, err = process.end()
    assert code == 1
    assert "twice" in err


WAITS = "import threading\nprint('begun', flush=True)\nthreading.Event().wait()\n"


@pytest.mark.slow
def test_interrupt_while_the_target_is_imported(process: Process) -> None:
    process.run(WAITS)
    process.interrupt()
    code, err = process.end()
    assert (code, err) == (1, "hfg: interrupted\n")


@pytest.mark.slow
def test_interrupt_while_the_graph_is_built(process: Process) -> None:
    process.run("import hfg\n\n\ndef build() -> hfg.Graph:\n" + textwrap.indent(WAITS, "    "))
    process.interrupt()
    code, err = process.end()
    assert (code, err) == (1, "hfg: interrupted\n")


@pytest.mark.slow
def test_interrupt_while_hfg_itself_is_imported(
    process: Process, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "reactivex.py").write_text(WAITS, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    process.run("")
    process.interrupt()
    code, err = process.end()
    assert (code, err) == (1, "hfg: interrupted\n")


@pytest.mark.parametrize(
    ("argv", "given", "is_ours"),
    [
        (["-m"], ["python", "-m", "hfg", "run"], True),
        (["-m"], ["python", "-X", "dev", "-m", "hfg"], True),
        (["/usr/bin/hfg", "run"], ["python", "/usr/bin/hfg", "run"], True),
        (["-m"], ["python", "-m", "pytest"], False),
        (["-m"], ["python", "-m"], False),
        (["robot.py"], ["python", "robot.py"], False),
        ([""], ["python"], False),
        ([], ["python"], False),
    ],
)
def test_only_the_command_takes_the_signal_while_it_is_imported(
    argv: list[str], given: list[str], is_ours: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", argv)
    monkeypatch.setattr(sys, "orig_argv", given)
    assert is_command() is is_ours


@pytest.mark.slow
def test_the_trace_is_whole_after_an_interrupt(process: Process, tmp_path: Path) -> None:
    trace = tmp_path / "run.trace.jsonl"
    process.run_node("await asyncio.Event().wait()", "--trace", str(trace))
    process.interrupt()
    process.end()
    lines = trace.read_text(encoding="utf-8").splitlines()
    assert '"RunStarted"' in lines[0]
    assert '"RunEnded"' in lines[-1]


@pytest.mark.slow
@pytest.mark.parametrize("code", ["await asyncio.sleep(1e6)", "while True: pass"], ids=["waits", "does not wait"])
def test_the_page_of_an_interrupted_run_has_what_was_seen(process: Process, tmp_path: Path, code: str) -> None:
    page = tmp_path / "run.html"
    process.run(REPORTED.format(code=code), "--report", str(page))
    process.interrupt()
    assert process.end()[0] == 1
    text = page.read_text(encoding="utf-8")
    assert '<p class="outcome bad">' in text
    assert '"path":"busy"' in text
    assert text.endswith("</html>\n")
