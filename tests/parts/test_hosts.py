"""Agents as real processes: runs over two hosts from beginning to end, and whatever is killed (rules L2, L3, X3)."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hfg.cli import main
from tests.limits import patience
from tests.transports.zenoh.conftest import free_port

pytest.importorskip("zenoh", reason="hosts speak over Zenoh")

pytestmark = pytest.mark.timeout(300)  # ten processes begin one after the other, each of which imports all

ROBOT = """
    import asyncio, os
    from collections.abc import Iterator
    from pathlib import Path
    import hfg

    @hfg.node
    def numbers(*, count: int) -> Iterator[int]:
        yield from range(count)

    @hfg.node
    async def relay(value: int) -> int:
        await asyncio.sleep(0.01)
        print("relayed", value)
        return value

    @hfg.node
    def write(value: int, *, into: str) -> None:
        with Path(into).open("a") as file:
            file.write(f"{value}\\n")

    def build(into: str, count: int = 1_000_000) -> hfg.Graph:
        graph = hfg.Graph("robot")
        graph.group("far", host="arm")
        source, last = graph.add(numbers(count=count)), graph.add(write(into=into))
        middle = graph.add(relay(), group="far")
        graph.connect(source.out, middle.value)
        graph.connect(middle.out, last.value)
        return graph
"""


class Cell:
    """A folder with a graph, settings of two hosts, and what was begun there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.written = folder / "written"
        arm, base = free_port(), free_port()
        (folder / "robot.py").write_text(textwrap.dedent(ROBOT))
        usual = f'realm = "{folder.name}"\ninsecure = true\nlease_s = 1.0\n'
        (folder / "arm.toml").write_text(f'{usual}host = "arm"\nlisten = ["tcp/127.0.0.1:{arm}"]\n')
        agents = f'agents = ["tcp/127.0.0.1:{arm}"]\n'
        (folder / "base.toml").write_text(f'{usual}host = "base"\nlisten = ["tcp/127.0.0.1:{base}"]\n{agents}')
        (folder / "user.toml").write_text(f'{usual}host = "desk"\nconnect = ["tcp/127.0.0.1:{arm}"]\n')
        self.begun: list[subprocess.Popen[str]] = []

    def begin(self, *arguments: str) -> subprocess.Popen[str]:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "XDG_STATE_HOME": str(self.folder)}
        process = subprocess.Popen(
            [sys.executable, "-m", "hfg", *arguments],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.begun.append(process)
        return process

    def agents(self, *hosts: str) -> list[subprocess.Popen[str]]:
        """Begin some, and wait until they are there."""
        begun = [self.begin("agent", "--settings", f"{host}.toml") for host in hosts]
        for host, process in zip(hosts, begun, strict=True):
            assert process.stdout is not None
            assert "WARNING" in (said := process.stdout.readline())
            assert "insecure: nobody proves who he is" in said
            assert process.stdout.readline() == f'agent of host "{host}" is ready, process {process.pid}\n'
        return begun

    def values(self) -> list[int]:
        return [int(line) for line in self.written.read_text().split()] if self.written.exists() else []

    def come(self, more: int = 5) -> None:
        """Wait until more values have come."""
        until = len(self.values()) + more
        wait_for(lambda: len(self.values()) >= until)

    def processes(self) -> list[int]:
        """Those that were begun by what was begun here, but for what waits there to be needed."""
        return [one for one in children_of([one.pid for one in self.begun]) if not is_spare(one)]


def children_of(processes: list[int]) -> list[int]:
    """All processes below these that live."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if fields[0] != "Z":
                    parents[int(entry.name)] = int(fields[1])
    found = set(processes)
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return sorted(found - set(processes))


def is_spare(process: int) -> bool:
    try:
        about = Path(f"/proc/{process}")
        is_or_was = (about / "cmdline").read_bytes().endswith(b"\0spare\0")
        return is_or_was and not (about / "comm").read_text().startswith("hfg ")
    except OSError:
        return False


def is_there(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition: Callable[[], object], within_s: float = 120.0) -> None:
    """Look until it holds; how fast that is depends on the machine alone."""
    end = time.monotonic() + patience(within_s)
    while not condition():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.02)


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cell]:
    if not Path("/proc").exists():
        pytest.skip("looks at processes as Linux has them")
    monkeypatch.chdir(tmp_path)
    one = Cell(tmp_path)
    try:
        yield one
    finally:
        left = children_of([process.pid for process in one.begun])
        for pid in [*left, *(process.pid for process in one.begun)]:  # first all: who lives holds the pipe open
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        for process in one.begun:
            assert process.stdout is not None
            with process:  # not `communicate`: it would leave out what `readline` has taken and not given
                said = process.stdout.read()
            print(f"--- process {process.pid}: {process.args!r}\n{said}")


def shared_memory() -> set[str]:
    return {file.name for file in Path("/dev/shm").glob("hfg-*")} if Path("/dev/shm").exists() else set()


@pytest.mark.slow
@pytest.mark.rule("L1", "L2", "L3")
def test_a_run_is_deployed_looked_at_restarted_and_stopped_from_another_host(
    cell: Cell, capsys: pytest.CaptureFixture[str]
) -> None:
    before = shared_memory()

    def command(*arguments: str) -> str:
        code = main([*arguments, "--settings", "user.toml"])
        said = capsys.readouterr()
        assert code == 0, said.err
        return said.out

    def seen() -> dict[str, Any]:
        (run,) = json.loads(command("ps", "--json"))["runs"]
        return {part["group"]: part for part in run["parts"]}

    agents = cell.agents("arm", "base")
    run = command("deploy", "robot.py", "--on", "base", "--arg", f"into={cell.written}").strip()
    cell.come()
    first = seen()
    assert {group: (part["host"], part["state"]) for group, part in first.items()} == {
        "": ("base", "running"),
        "far": ("arm", "running"),
    }
    os.kill(first["far"]["process"], signal.SIGKILL)
    wait_for(lambda: not is_there(first["far"]["process"]))
    cell.come(20)
    command("restart", "robot/far")
    cell.come(20)
    assert seen()["far"]["restarts"] == 2
    top = json.loads(command("top", "robot", "--json"))
    assert (top["graph"], top["outcome"]) == ("robot", "running")
    lines = command("logs", run).splitlines()
    assert any(line.endswith(" arm far: relayed 3") for line in lines)
    there = cell.processes()
    assert len(there) == 2
    assert any(" arm far: hfg: process " in line and "SIGKILL" in line for line in lines)
    command("stop", run)
    wait_for(lambda: not any(is_there(pid) for pid in there))
    assert cell.values() == list(range(len(cell.values()))), "nothing is lost or doubled by a kill and a restart"
    for agent in agents:
        agent.terminate()
    for agent in agents:
        assert agent.wait(timeout=patience(60)) == 0
    assert shared_memory() <= before


@pytest.mark.soak
@pytest.mark.rule("L2", "L3", "X3")
def test_whoever_is_killed_nothing_is_left_and_the_rest_goes_on(cell: Cell) -> None:
    (agent,) = cell.agents("arm")
    killed = cell.begin("run", "robot.py", "--arg", f"into={cell.written}", "--settings", "user.toml")
    cell.come()
    (orphan,) = cell.processes()
    killed.kill()
    cell.written.unlink()
    run = cell.begin("run", "robot.py", "--arg", f"into={cell.written}", "--settings", "user.toml")
    cell.come()
    wait_for(lambda: not is_there(orphan))  # its agent has not heard of the main part for a while
    (part,) = cell.processes()
    agent.kill()
    wait_for(lambda: not is_there(part))
    (agent,) = cell.agents("arm")  # at the same port
    cell.come(20)
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=patience(60)) == 1
    assert cell.values() == list(range(len(cell.values())))
    wait_for(lambda: not cell.processes())
    agent.send_signal(signal.SIGINT)
    assert agent.wait(timeout=patience(60)) == 0
