"""Runs of one's own programs can be looked at, where they ask for that; and nobody has to read to the end."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.base.private import MACHINE
from hfg.cli import top
from hfg.cli.sockets import Line, runs
from hfg.engine.face.watching import Question
from tests.cli.conftest import Command
from tests.limits import patience

needs_sockets = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="there are no Unix domain sockets")


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a folder for sockets."""
    made = Path(tempfile.mkdtemp(prefix="hfg"))
    monkeypatch.setenv("XDG_STATE_HOME", str(made))
    monkeypatch.delenv("HFG_WATCH", raising=False)
    monkeypatch.setattr(top, "_BETWEEN_S", 0.01)
    yield made / "hfg" / f"runs-{MACHINE}"
    shutil.rmtree(made)


@hfg.node
def ticks() -> Iterator[int]:
    yield from range(10**9)


def ticking(name: str = "ticking") -> hfg.Graph:
    graph = hfg.Graph(name)
    graph.add(ticks(), max_rate_hz=200)
    graph.connect(graph["ticks"].out, graph.output("ticks", int))
    return graph


@contextmanager
def program(**options: Any) -> Iterator[None]:
    """A program that runs a graph, as far as others can see it."""
    begun: list[tuple[asyncio.AbstractEventLoop, hfg.Run]] = []
    ready = threading.Event()

    def begin(run: hfg.Run) -> None:
        begun.append((asyncio.get_running_loop(), run))
        asyncio.get_running_loop().call_soon(ready.set)

    thread = threading.Thread(target=lambda: hfg.run(ticking(), begin=begin, **options))
    thread.start()
    assert ready.wait(patience(10))
    try:
        yield
    finally:
        loop, run = begun[0]
        loop.call_soon_threadsafe(run.stop)
        thread.join(patience(10))


@needs_sockets
def test_a_program_that_asks_for_it_is_seen_while_it_runs() -> None:
    with program(watch=True):
        (found,) = runs()
        assert (found.graph, found.pid) == ("ticking", os.getpid())
        assert found.target == sys.argv[0]
        with Line(found.name) as line:
            answer = line.ask(Question("glance"))
            assert answer is not None
            assert answer.glance is not None
    assert runs() == []


@needs_sockets
def test_the_environment_may_ask_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with program():
        assert runs() == []
    monkeypatch.setenv("HFG_WATCH", "1")
    with program():
        assert len(runs()) == 1
    with program(watch=False):
        assert runs() == []
    hfg.run(hfg.Graph(), clock="virtual")  # where nobody can look; what the environment says is no order
    monkeypatch.setenv("HFG_WATCH", "0")
    with program():
        assert runs() == []


@needs_sockets
def test_two_runs_of_one_process_are_two() -> None:
    with program(watch="one"):
        with program(watch="two"):
            assert [(one.name, one.target) for one in runs()] == [
                (f"{os.getpid()}", "one"),
                (f"{os.getpid()}-2", "two"),
            ]
        assert [one.target for one in runs()] == ["one"]


@needs_sockets
def test_top_lists_what_runs_and_shows_one(command: Command) -> None:
    with program(watch=True), program(watch=True):
        several = command("top")
        assert several.code == 2
        assert f"{os.getpid()}-2" in several.out
        one = command("top", f"{os.getpid()}-2", "--json")
        assert json.loads(one.out)["graph"] == "ticking"


@needs_sockets
def test_a_block_that_runs_a_graph_is_seen_too() -> None:
    async def main() -> list[str]:
        async with hfg.running(ticking(), watch=True):
            return [one.graph for one in await asyncio.to_thread(runs)]

    assert asyncio.run(main()) == ["ticking"]


@needs_sockets
@pytest.mark.parametrize("json_lines", [False, True])
def test_tap_prints_what_passes_a_port_of_a_run_elsewhere(command: Command, json_lines: bool) -> None:
    with program(watch=True):
        options = ["--json"] if json_lines else []
        shown = command("tap", str(os.getpid()), "ticks.out", "--limit", "3", *options)
    assert shown.code == 0
    lines = shown.out.splitlines()
    if json_lines:
        values = [json.loads(line)["value"] for line in lines]
    else:
        values = [int(line.split()[-1]) for line in lines]
    assert values == [values[0], values[0] + 1, values[0] + 2]


@needs_sockets
def test_tap_shows_seconds_since_the_run_began_and_finds_a_run_by_its_name(command: Command) -> None:
    with program(watch=True):
        time.sleep(0.05)  # the run is older than the tap: that is what is to be seen
        shown = command("tap", "ticking", "ticks.out", "--limit", "2")
        with Line(str(os.getpid())) as line:
            now = line.ask(Question("glance"))
        several = command("tap", "ticking", "ticks.out", "--until", "1")
    assert now is not None
    assert now.glance is not None
    first, second = (float(line.split()[0]) for line in shown.out.splitlines())
    assert 0.05 <= first < second <= now.glance.duration_s + 0.001
    assert "the run ticking is only watched and not changed" in several.err
    with program(watch=True), program(watch=True):
        listed = command("tap", "ticking", "ticks.out")
    assert listed.code == 2
    assert f"as in hfg tap {os.getpid()}" in listed.err


@needs_sockets
def test_tap_ends_with_the_run_and_says_so(command: Command) -> None:
    shown: list[Any] = []
    with program(watch=True):
        thread = threading.Thread(target=lambda: shown.append(command("tap", str(os.getpid()), "ticks.out")))
        thread.start()
        while not any(guest for guest in runs()):
            pass
    thread.join(patience(10))
    assert shown[0].code in (0, 2)  # it came before the end, or behind it
    assert "is over" in shown[0].err or "no graph" in shown[0].err


@needs_sockets
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("tick.out",), 'graph "ticking" has no node "tick"; did you mean "ticks"?'),
        (
            ("ticks.out", "--until", "3"),
            "is only watched and not changed: leave out --param, --arg, --until and --clock",
        ),
        (
            ("ticks.out", "--param", "ticks.count=3"),
            "is only watched and not changed: leave out --param, --arg, --until and --clock",
        ),
    ],
)
def test_what_a_run_elsewhere_has_not_is_one_sentence(
    command: Command, arguments: tuple[str, ...], sentence: str
) -> None:
    with program(watch=True):
        shown = command("tap", str(os.getpid()), *arguments)
    assert shown.code == 2
    assert sentence in shown.err
    assert shown.err.count("\n") == 1


@needs_sockets
def test_nothing_to_tap(command: Command) -> None:
    shown = command("tap", "4711", "camera.out")
    assert (shown.code, shown.out) == (2, "")
    assert shown.err.startswith("hfg: no graph that could be looked at runs in process 4711")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"watch": 3}, "watch must be True or False, or what hfg top shows as the program, got 3"),
        ({"watch": ""}, "watch must be True or False, or what hfg top shows as the program, got ''"),
        ({"watch": True, "clock": "virtual"}, "watch= needs the real clock: in virtual time a run is over before"),
    ],
)
def test_a_watch_that_cannot_be_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(hfg.errors.UsageError) as raised:
        hfg.run(hfg.Graph(), **options)
    assert str(raised.value).startswith(sentence)


def test_an_environment_that_nobody_understands_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_WATCH", "yes")
    with pytest.raises(hfg.errors.UsageError, match='HFG_WATCH is "yes": set it to 1'):
        hfg.run(hfg.Graph())


PRINTS = """
from collections.abc import Iterator

import hfg


@hfg.node
def lines() -> Iterator[int]:
    number = 0
    while True:
        number += 1
        print("line", number{flush})
        yield number


graph = hfg.Graph("talks")
graph.add(lines(){rate})
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="pipes are others elsewhere")
@pytest.mark.parametrize("flush", ["", ", flush=True"])
def test_whoever_reads_may_have_enough(tmp_path: Path, flush: str) -> None:
    file = tmp_path / "talks.py"
    file.write_text(PRINTS.format(flush=flush, rate=", max_rate_hz=5000"), encoding="utf-8")
    command = [sys.executable, "-m", "hfg", "run", str(file), "--no-table"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == b"line 1\n"
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(patience(20)) == 1
