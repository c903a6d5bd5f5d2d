"""`hfg top`: looking at a run in another process, and a door that keeps strangers out."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import hfg
from hfg.base.private import MACHINE
from hfg.cli import sockets, top
from hfg.cli.sockets import Line, runs
from hfg.engine.face import watching
from hfg.engine.face.watching import Question
from hfg.errors import TargetError
from tests.cli.conftest import Command
from tests.limits import patience

pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="there are no Unix domain sockets")


@hfg.node
def ticks() -> Iterator[int]:
    yield from range(10**9)


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a folder for sockets."""
    made = Path(tempfile.mkdtemp(prefix="hfg"))
    monkeypatch.setenv("XDG_STATE_HOME", str(made))
    monkeypatch.setattr(top, "_BETWEEN_S", 0.01)
    yield made / "hfg" / f"runs-{MACHINE}"
    shutil.rmtree(made)


@contextmanager
def running(name: str = "ticking") -> Iterator[asyncio.AbstractEventLoop]:
    """Run a graph in a thread, with a door."""
    ready = threading.Event()
    loops: list[asyncio.AbstractEventLoop] = []
    ends: list[asyncio.Event] = []

    async def live() -> None:
        graph = hfg.Graph(name)
        graph.add(ticks(), max_rate_hz=50)
        graph.monitor("rests", "never(active(ticks))")
        async with hfg.running(graph, watch=f"{name}.py"):
            loops.append(asyncio.get_running_loop())
            ends.append(asyncio.Event())
            ready.set()
            await ends[0].wait()

    thread = threading.Thread(target=lambda: asyncio.run(live()))
    thread.start()
    assert ready.wait(patience(10))
    try:
        yield loops[0]
    finally:
        loops[0].call_soon_threadsafe(ends[0].set)
        thread.join(patience(10))


@contextmanager
def renamed(place: Path, pid: int) -> Iterator[None]:
    """Let our socket look like that of another process."""
    own = place / f"{os.getpid()}.sock"
    own.rename(place / f"{pid}.sock")
    yield
    (place / f"{pid}.sock").unlink(missing_ok=True)


def test_the_only_run_is_found_and_shown(command: Command, place: Path) -> None:
    with running():
        for arguments in ((), ("ticking",), (str(os.getpid()),)):
            shown = command("top", *arguments)
            assert (shown.code, shown.err) == (0, "")
            assert shown.out.startswith("ticking  running  ")
            assert shown.out.splitlines()[-1].split()[0] == "ticks"
    assert list(place.iterdir()) == []


def test_json_has_the_same_numbers(command: Command) -> None:
    with running():
        told = json.loads(command("top", "--json").out)
    assert (told["graph"], told["outcome"]) == ("ticking", "running")
    (node,) = told["nodes"]
    assert (node["path"], node["group"], node["errors"]) == ("ticks", "loop", 0)
    assert told["monitors"] == [["rests", "holds", 0]]
    assert {"rate_hz", "busy_share", "queued", "active", "doing"} <= set(node)


def test_of_several_runs_one_must_be_named(command: Command, place: Path) -> None:
    with running("first"), renamed(place, 7), running("second"):
        shown = command("top")
        assert shown.code == 2
        assert [line.split() for line in shown.out.splitlines()[1:]] == [
            ["7", "first", "first.py"],
            [str(os.getpid()), "second", "second.py"],
        ]
        assert shown.err == "hfg: more than one graph runs: name its process, as in hfg top 7\n"
        assert command("top", "second").out.startswith("second  running")
        shown = command("top", "third")
        assert shown.code == 2
        there = f'there is "first" in process 7, "second" in process {os.getpid()}'
        assert f'no graph that could be looked at runs by the name "third"; {there}' in shown.err
        for verb in (("top",), ("tap", "out")):
            shown = command(verb[0], "4242", *verb[1:])
            assert (shown.code, shown.err.count("\n")) == (2, 1)
            assert f"no graph that could be looked at runs in process 4242; {there}" in shown.err
        shown = command("tap", "third", "ticks.out")
        assert (shown.code, shown.err.count("\n")) == (2, 1)
        assert 'no graph that could be looked at runs by the name "third"' in shown.err
        assert '"third" names a run: to run a graph, name its file' in shown.err
        assert there in shown.err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "no graph runs that could be looked at"),
        (("fetch",), "no graph runs that could be looked at"),
        (("4242",), "no graph that could be looked at runs in process 4242"),
    ],
)
def test_nothing_runs(command: Command, arguments: tuple[str, ...], sentence: str) -> None:
    shown = command("top", *arguments)
    assert (shown.code, shown.out, shown.err.count("\n")) == (2, "", 1)
    assert sentence in shown.err


def test_what_a_dead_process_left_is_removed(command: Command, place: Path) -> None:
    watching.run_sockets().close()
    for pid in (5, 6):
        with socket.socket(socket.AF_UNIX) as dead:
            dead.bind(str(place / f"{pid}.sock"))
    (place / "notes.sock").write_text("not ours")
    shown = command("top", "5")
    assert (shown.code, shown.err.count("\n")) == (2, 1)
    assert [file.name for file in sorted(place.iterdir())] == ["6.sock", "notes.sock"]
    with running():
        assert sorted(file.name for file in place.iterdir()) == [f"{os.getpid()}.sock", "notes.sock"]
        assert [answer.graph for answer in runs()] == ["ticking"]


def test_a_run_that_ends_meanwhile_is_over(place: Path) -> None:
    with running():
        line = Line(str(os.getpid()))
        assert line.ask(Question("glance")) is not None
    with line, pytest.raises(TargetError, match="is over"):
        line.ask(Question("glance"))


def test_a_run_that_blocks_its_loop_is_waited_for(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "_PATIENCE_S", 0.02)
    free = threading.Event()
    with running() as loop, Line(str(os.getpid())) as line:
        loop.call_soon_threadsafe(free.wait)
        assert line.ask(Question("glance")) is None
        assert command("top", str(os.getpid())).err == "hfg: the run does not answer: a node blocks its loop\n"
        free.set()
        while (answer := line.ask(Question("glance"))) is None:
            pass
        assert answer.glance is not None


@pytest.mark.slow
@pytest.mark.parametrize(
    "question", [b"nonsense\n", b'{"want":"everything"}\n', b'{"want":"name","more":1}\n', b"[]\n", b"\xff\n"]
)
def test_a_question_that_makes_no_sense_gets_an_error(place: Path, question: bytes) -> None:
    with running(), socket.socket(socket.AF_UNIX) as stranger:
        stranger.settimeout(5)
        stranger.connect(str(place / f"{os.getpid()}.sock"))
        stranger.sendall(question)
        assert b'{"error":"the question cannot be understood' in stranger.recv(1000)


@pytest.mark.asyncio
async def test_who_knocks_at_the_very_moment_a_run_ends_is_seen_out(place: Path) -> None:
    """The loop hears of the knock and of the end in one pass, of the end first: what it has let in then is not lost."""
    loop, over, graph = asyncio.get_running_loop(), asyncio.Event(), hfg.Graph("ticking")
    graph.add(ticks(), max_rate_hz=50)
    async with hfg.running(graph, watch=False) as run:
        with socket.socket(socket.AF_UNIX) as stranger:
            stranger.settimeout(5)
            async with asyncio.timeout(5):
                async with watching.watched(run, "ticking.py"):
                    stranger.connect(str(place / f"{os.getpid()}.sock"))
                    loop.call_soon(over.set)
                    await over.wait()
            assert stranger.recv(1) == b""
        run.stop()


@pytest.mark.parametrize("noise", [b"x" * 5000, b'{"want":"glance"}\n' * 5])
def test_whoever_talks_too_much_is_shown_the_door(place: Path, noise: bytes) -> None:
    with running(), socket.socket(socket.AF_UNIX) as stranger:
        stranger.settimeout(5)
        stranger.connect(str(place / f"{os.getpid()}.sock"))
        stranger.sendall(noise)
        with suppress(ConnectionResetError):
            assert stranger.recv(1000) == b""
        assert [answer.graph for answer in runs()] == ["ticking"]


def test_only_so_many_may_look_at_once() -> None:
    with running():
        lines = [Line(str(os.getpid())) for _ in range(watching._MOST_GUESTS + 1)]
        answers = [line.ask(Question("name")) for line in lines[:-1]]
        assert all(answer is not None for answer in answers)
        with pytest.raises(TargetError, match="is over"):
            lines[-1].ask(Question("name"))
        for line in lines:
            with line:
                pass


@pytest.mark.parametrize("wrong", ["open to others", "a link", "a file"])
def test_a_folder_that_others_could_enter_is_not_used(
    command: Command, place: Path, wrong: str, caplog: pytest.LogCaptureFixture
) -> None:
    place.parent.mkdir()
    if wrong == "a file":
        place.write_text("")
    elif wrong == "a link":
        (place.parent / "elsewhere").mkdir(mode=0o700)
        place.symlink_to(place.parent / "elsewhere")
    else:
        place.mkdir()
        place.chmod(0o755)
    shown = command("top")
    assert (shown.code, shown.err.count("\n")) == (2, 1)
    sentence = "can be entered by others: write chmod 700" if wrong == "open to others" else "cannot be used"
    assert f"in which hfg top and hfg tap find runs, {sentence}" in shown.err
    with caplog.at_level("INFO", "hfg.engine"), running():
        pass  # a run goes on all the same
    assert "hfg top cannot look at this run" in caplog.text


def test_the_path_of_the_folder_may_be_longer_than_a_socket_s(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(place.parent / ("x" * 120)))
    with running():
        assert [answer.graph for answer in runs()] == ["ticking"]


def test_a_folder_made_without_a_umask_is_for_its_user_only(place: Path) -> None:
    before = os.umask(0)
    try:
        watching.run_sockets().close()
    finally:
        os.umask(before)
    assert [one.stat().st_mode & 0o777 for one in (place, place.parent)] == [0o700, 0o700]


def test_a_run_of_the_command_opens_a_door_on_the_real_clock_only(command: Command, place: Path) -> None:
    with Path("steps.py").open("a", encoding="utf-8") as file:
        file.write(
            "import pathlib\n\n"
            "class Looks(hfg.Node):\n"
            "    @hfg.slot\n"
            f"    def look(self) -> None:\n        print(len(list(pathlib.Path({str(place)!r}).glob('*.sock'))))\n\n"
            "def looking() -> hfg.Graph:\n"
            "    graph = hfg.Graph('looking')\n"
            "    graph.connect(graph.start, graph.add(Looks()).look)\n"
            "    return graph\n"
        )
    assert command("run", "steps.py:looking").out == "1\n"
    assert command("run", "steps.py:looking", "--clock", "virtual").out == "0\n"
    assert list(place.iterdir()) == []
