"""A small supervisor, as systemd would be: it starts programs again when they end, later each time they end soon."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

FIRST_PAUSE_S, LONGEST_PAUSE_S, LIVES_S = 0.1, 2.0, 10.0

ROBOT = '''
"""Numbers, their running totals, and a file of these: with the number of each token, as a line may be written twice."""
from pathlib import Path
import hfg


class Numbers(hfg.Node):
    out = hfg.Output(int)
    count = hfg.Parameter(0)
    enough = hfg.Parameter("")
    given = hfg.State(0)

    def process(self) -> int:
        if self.given == self.count or (self.enough and Path(self.enough).exists()):
            raise hfg.EndOfStream
        self.given += 1
        return self.given - 1


class Total(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)
    total = hfg.State(0)

    def process(self, value: int) -> int:
        self.total += value
        return self.total


class Write(hfg.Node):
    value = hfg.Input(int)
    into = hfg.Parameter("")

    def process(self, value: hfg.Token[int]) -> None:
        with Path(self.into).open("a") as file:
            file.write(f"{value.sequence} {value.value}\\n")


def build(into: str, count: int = -1, enough: str = "", apart: bool = False, kept: str = "") -> hfg.Graph:
    """Let the totals run on host "right"; with `apart`, the source on "left" and the file on "right", too."""
    graph = hfg.Graph("robot")
    graph.group("arm", host="right", ledger=f"{kept}/arm.ledger" if kept else True)
    if apart:
        graph.group("eye", host="left", ledger=f"{kept}/eye.ledger" if kept else True)
    source = graph.add(Numbers(count=count, enough=enough), max_rate_hz=20, **({"group": "eye"} if apart else {}))
    total = graph.add(Total(), group="arm")
    write = graph.add(Write(into=into), **({"group": "arm"} if apart else {}))
    graph.connect(source.out, total.value)
    graph.connect(total.out, write.value)
    return graph
'''


class Supervised:
    """A program that is started again whenever it ends, unless it ends well and is to end so."""

    def __init__(self, command: Sequence[str], folder: Path, log: Path, *, ends: bool = False) -> None:
        self.command = command
        self.folder = folder
        self.log = log
        self.ends = ends
        self.starts = 0
        self.done = False
        self._pause_s = FIRST_PAUSE_S
        self._due = 0.0
        self.process: subprocess.Popen[bytes] | None = None

    def look(self) -> None:
        """Start it if it is due."""
        now = time.monotonic()
        if self.process is not None and self.process.poll() is not None:
            self.done = self.ends and self.process.returncode == 0
            self._pause_s = FIRST_PAUSE_S if now - self._due > LIVES_S else min(2 * self._pause_s, LONGEST_PAUSE_S)
            self._due = now + self._pause_s
            self.process = None
        if self.process is None and not self.done and now >= self._due:
            self.starts += 1
            self._due = now
            with self.log.open("ab") as log:
                self.process = subprocess.Popen(
                    self.command,
                    cwd=self.folder,
                    env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )

    def kill(self) -> None:
        """Kill it, and not what it has begun, which is to end by itself."""
        if self.process is not None:
            self.process.kill()

    def end(self) -> int | None:
        """End it by SIGTERM; gives its code."""
        process, self.process = self.process, None
        self.done = True
        if process is None:
            return None
        process.terminate()
        try:
            return process.wait(30)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            return process.wait()


def written(file: Path) -> dict[int, int]:
    """Return the written values by the number of their token; one that was written twice must be the same."""
    found: dict[int, int] = {}
    for line in file.read_text().splitlines() if file.exists() else ():
        number, value = map(int, line.split())
        assert found.setdefault(number, value) == value
    return found


def totals(count: int) -> list[int]:
    return [number * (number + 1) // 2 for number in range(count)]
