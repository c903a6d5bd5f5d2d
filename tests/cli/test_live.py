"""The live table while a graph runs: in virtual time, and on a real terminal."""

from __future__ import annotations

import os
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import hfg
from hfg.cli import execute
from hfg.cli.live import EVERY_S, Live, live_table
from hfg.cli.terminal import Foot
from tests.cli.conftest import STEPS, Command
from tests.cli.screen import Screen
from tests.limits import patience


@hfg.node
def ticks() -> Iterator[int]:
    yield from range(1000)


@hfg.node
def faulty(tick: int) -> int | None:
    if tick % 2:
        raise ValueError(tick)
    return tick


class Watcher(hfg.Node):
    tick = hfg.Input(int)

    @hfg.slot
    def begin(self) -> None: ...

    def process(self, tick: int) -> None: ...


def build() -> hfg.Graph:
    graph = hfg.Graph("ticking")
    source = graph.add(ticks(), max_rate_hz=20)
    middle, last = graph.add(faulty(), on_error="skip"), graph.add(Watcher())
    graph.connect(source.out, middle.ports.inputs["tick"])
    graph.connect(middle.out, last.tick)
    graph.start.activates(last.begin)
    return graph


class Always(Foot):
    """A screen of 80 columns that always takes what is drawn, and remembers each picture."""

    def __init__(self, screen: Screen) -> None:
        super().__init__(screen)
        self.pictures: list[list[str]] = []
        self._screen = screen

    def is_ready(self) -> bool:
        return True

    def size(self) -> tuple[int, int]:
        return 80, 24

    def draw(self, lines: object, widths: list[int] | None = None) -> None:
        super().draw(lines, widths)  # type: ignore[arg-type]
        self.pictures.append(self._screen.shown)


@pytest.mark.rule("R7")
def test_the_table_is_drawn_four_times_a_second_and_the_run_is_the_same() -> None:
    foot = Always(Screen())
    live = Live(foot)
    watched = hfg.run(build(), clock="virtual", until_s=2.12, begin=live.begin)
    live.end()
    assert len(foot.pictures) == int(2.12 / EVERY_S)
    last = foot.pictures[-1]
    assert last[0] == "ticking  running  2.0 s  3 nodes  20 errors"
    assert last[1] == "active  watcher"
    assert [line.split()[:2] for line in last[3:]] == [
        ["node", "rate"],
        ["ticks", "20.0"],
        ["faulty", "20.0"],
        ["watcher", "20.5"],  # a slot call more
    ]
    assert watched == hfg.run(build(), clock="virtual", until_s=2.12)


def test_a_terminal_that_is_held_is_not_waited_for() -> None:
    termios = pytest.importorskip("termios")
    reading, writing = os.openpty()
    with os.fdopen(writing, "w") as stream, os.fdopen(reading, "rb"):
        foot = Foot(stream)
        assert foot.is_ready()
        termios.tcflow(writing, termios.TCOOFF)  # as Ctrl-S does
        assert not foot.is_ready()
        termios.tcflow(writing, termios.TCOON)
        assert foot.is_ready()


def test_the_table_is_for_terminals_and_the_real_clock_and_not_beside_json(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted: list[bool] = []

    @contextmanager
    def asked(wants: bool) -> Iterator[Live]:
        wanted.append(wants)
        with live_table(wants) as live:
            yield live

    monkeypatch.setattr(execute, "live_table", asked)
    for options in ((), ("--json",), ("--no-table",), ("--clock", "virtual")):
        command("run", "steps.py:build", "--until", "0", *options)
    assert wanted == [True, False, False, False]


class Terminal:
    """A process on a terminal of its own."""

    def __init__(self, folder: Path, *arguments: str, columns: int = 80, **environment: str) -> None:
        fcntl = pytest.importorskip("fcntl")
        termios = pytest.importorskip("termios")
        self._reading, writing = os.openpty()
        fcntl.ioctl(writing, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hfg", *arguments],
            cwd=folder,
            stdin=writing,
            stdout=writing,
            stderr=writing,
            start_new_session=True,
            env={**os.environ, "TERM": "xterm", "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        )
        os.close(writing)
        self.seen = ""

    def read_until(self, text: str) -> None:
        """Read until this has been seen since the last call, or the process is over."""
        until = time.monotonic() + patience(20)
        begun = len(self.seen)
        while text not in self.seen[begun:]:
            assert time.monotonic() < until, self.seen
            if select.select([self._reading], [], [], 0.1)[0]:
                try:
                    read = os.read(self._reading, 65536)
                except OSError:  # as Linux says that nobody writes any more
                    return
                if not read:
                    return
                self.seen += read.decode()

    def end(self) -> int:
        """Read all that comes; give the exit code."""
        self.read_until("\0")
        return self.process.wait(patience(10))

    def go_away(self) -> None:
        """Close the terminal, and say so as a kernel would."""
        os.close(self._reading)
        self.process.send_signal(signal.SIGHUP)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        with suppress(OSError):
            os.close(self._reading)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    code = STEPS.replace("count: int = 5", "count: int = 100_000").replace(
        "    @hfg.slot\n", "    def teardown(self) -> None:\n        open('torn down', 'w').close()\n\n    @hfg.slot\n"
    )
    (tmp_path / "steps.py").write_text(code, encoding="utf-8")
    return tmp_path


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    made: list[Terminal] = []
    yield made
    for one in made:
        one.close()


@pytest.mark.slow
def test_on_a_terminal_a_table_is_drawn_and_ctrl_c_leaves_none_of_it(folder: Path, terminals: list[Terminal]) -> None:
    terminal = Terminal(folder, "run", "steps.py:build")
    terminals.append(terminal)
    terminal.read_until("steps  running")
    terminal.read_until("step 3")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.end() == 1
    screen = Screen()
    screen.write(terminal.seen.replace("\r\n", "\n"))
    assert screen.shown[:3] == ["step 0", "step 1", "step 2"]
    assert all(line.startswith("step ") for line in screen.shown[:-1])
    assert screen.shown[-1] == 'hfg: graph "steps": interrupted; what came back is torn down'
    assert (folder / "torn down").exists()


@pytest.mark.slow
@pytest.mark.parametrize("way", ["terminated", "terminal gone"])
def test_a_process_that_is_to_end_tears_down(folder: Path, terminals: list[Terminal], way: str) -> None:
    terminal = Terminal(folder, "run", "steps.py:build")
    terminals.append(terminal)
    terminal.read_until("step 0")
    if way == "terminated":
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.end() == 1
    else:
        terminal.go_away()
        assert terminal.process.wait(patience(10)) == 1
    assert (folder / "torn down").exists()


@pytest.mark.slow
def test_a_dumb_terminal_has_no_table(folder: Path, terminals: list[Terminal]) -> None:
    terminal = Terminal(folder, "run", "steps.py:build", "--until", "0.3", TERM="dumb")
    terminals.append(terminal)
    assert terminal.end() == 0
    assert terminal.seen.startswith("step 0\r\nstep 1\r\n")
    assert "\x1b" not in terminal.seen
