"""Graphs with processes, run with real ones over Zenoh: their deaths, ends, logs and words (rules L2, X1, X3)."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hfg.parts.processes import launching
from hfg.parts.processes.rendezvous import Rendezvous
from tests.limits import patience

pytestmark = pytest.mark.slow

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

NODES = """
    import asyncio, logging, os, signal, sys
    from collections.abc import AsyncIterator, Iterator
    from pathlib import Path
    import hfg

    @hfg.node
    def numbers(*, count: int = 200) -> Iterator[int]:
        yield from range(count)

    @hfg.node
    async def relay(value: int, *, pids: str) -> int:
        with Path(pids).open("a") as file:
            file.write(f"{os.getpid()}\\n")
        await asyncio.sleep(0.005)
        return value

    @hfg.node
    def deadly(value: int, *, pids: str, how: str) -> int:
        '''Ends its process once, at 20.'''
        if value == 20 and not Path(pids).exists():
            Path(pids).write_text(str(os.getpid()))
            if how == "exit":
                os._exit(3)
            os.kill(os.getpid(), getattr(signal, how))
        return value

    @hfg.node
    def talks(value: int) -> None:
        print("printed", value)
        hfg.log().warning("logged %d", value)
"""


def program(folder: Path, body: str, *, cwd: Path | None = None) -> subprocess.Popen[str]:
    """Begin a program that has these nodes."""
    file = folder / "program.py"
    file.write_text(textwrap.dedent(NODES) + textwrap.dedent(body))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "TMPDIR": str(folder)}
    return subprocess.Popen(
        [sys.executable, str(file)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )


def wait_for(condition: Callable[[], object], within_s: float = 30.0) -> None:
    """Look until it holds; how fast that is depends on the machine alone."""
    end = time.monotonic() + patience(within_s)
    while not condition():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.02)


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{process}/stat").read_text().split()[2] != "Z" if Path("/proc").exists() else True


def nothing_is_left(folder: Path, pids: Path) -> None:
    wait_for(lambda: not any(is_there(int(line)) for line in set(pids.read_text().split())))
    wait_for(lambda: not list(folder.glob("hfg-*")))


CHAIN = """
    def build(pids: str) -> hfg.Graph:
        graph = hfg.Graph("chain")
        graph.group("far", process=True)
        source, one = graph.add(numbers(count={count})), graph.add(relay(pids=pids), group="far")
        graph.connect(source.out, one.value)
        graph.connect(one.out, graph.output("out", int))
        return graph
"""


class SlowSession:
    """One that is there after a while, with a file of its own."""

    def __init__(self) -> None:
        self.begun, self.may_go_on = asyncio.Event(), asyncio.Event()
        self.closed = False

    async def open(self, settings: object, folder: str) -> tuple[SlowSession, SlowSession]:
        self.begun.set()
        await self.may_go_on.wait()
        (Path(folder) / "secret").touch()
        return self, self

    async def close(self) -> None:
        self.closed = True


def test_who_is_interrupted_while_parts_begin_to_meet_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    async def scenario() -> None:
        slow = SlowSession()
        monkeypatch.setattr(launching, "open_sessions", slow.open)
        launcher = launching.ProcessLauncher()
        opening = asyncio.create_task(launcher.open())
        await slow.begun.wait()
        opening.cancel()
        await asyncio.wait({opening})
        closing = asyncio.create_task(launcher.close())
        await asyncio.sleep(0)
        slow.may_go_on.set()
        await closing
        assert slow.closed

    asyncio.run(scenario())
    assert not list(tmp_path.iterdir())


LEAVES_A_PROGRAM = """
    import asyncio
    from hfg.parts.processes.launching import ProcessLauncher
    async def main():
        await ProcessLauncher().open()
        raise KeyboardInterrupt
    asyncio.run(main())
"""
LEAVES_THE_COMMAND = """
    import os, signal
    import hfg
    from hfg.cli.execute import GraphRun
    from hfg.cli.interrupt import Interrupt
    from hfg.cli.options import RunFlags
    from hfg.parts.processes.rendezvous import Rendezvous
    def begin(run):
        begin.place = Rendezvous()
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
    with Interrupt.installed():
        GraphRun(hfg.Graph(), "it", RunFlags()).run(begin)
"""


@pytest.mark.parametrize("leaves", [LEAVES_A_PROGRAM, LEAVES_THE_COMMAND], ids=["program", "command"])
def test_who_leaves_at_once_without_an_end_leaves_no_folder(tmp_path: Path, leaves: str) -> None:
    """As by a second Ctrl-C, or when tearing down takes too long behind the first."""
    left = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(leaves)],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        stderr=subprocess.PIPE,
        timeout=patience(60),
    )
    assert b"KeyboardInterrupt" in left.stderr or b"interrupted twice: left at once" in left.stderr
    assert not list(tmp_path.glob("hfg-meet-*"))


def test_the_next_run_removes_what_runs_have_left_that_were_killed_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, lives, young = Rendezvous(), Rendezvous(), Rendezvous()
    others = [tmp_path / "hfg-something", tmp_path / "hfg-meet-notes", tmp_path / f"{left.folder.name}-of-mine"]
    for other in others:
        other.mkdir()
        (other / "secret").touch()
    for place in (left, young):
        (place.folder / "secret").touch()
        assert place._lock is not None
        os.close(place._lock)  # as the end of a process does
        place._lock = None
    for folder in (left.folder, lives.folder, *others):
        os.utime(folder, (0, 0))
    following = Rendezvous()
    found = {folder.name for folder in tmp_path.iterdir()}
    assert found == {one.name for one in (lives.folder, young.folder, following.folder, *others)}
    for place in (left, lives, young, following):
        place.leave()
    assert sorted(tmp_path.iterdir()) == sorted(others)
    assert all((other / "secret").exists() for other in others)


def test_a_process_that_is_forked_from_a_run_leaves_its_folder_alone(tmp_path: Path) -> None:
    forks = """
        import os, sys
        from hfg.parts.processes.rendezvous import Rendezvous
        place = Rendezvous()
        if not os.fork():
            sys.exit()
        os.wait()
        assert place.folder.exists()
    """
    left = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(forks)], env=os.environ | {"TMPDIR": str(tmp_path)}, timeout=patience(60)
    )
    assert left.returncode == 0
    assert not list(tmp_path.iterdir())


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("how", ["exit", "SIGKILL"])
def test_a_process_that_dies_is_begun_again_and_nothing_is_lost(tmp_path: Path, how: str) -> None:
    pids = tmp_path / "pids"
    running = program(
        tmp_path,
        f"""
    if __name__ == "__main__":
        graph = hfg.Graph()
        graph.group("far", process=True)
        source, one = graph.add(numbers()), graph.add(deadly(pids={str(pids)!r}, how={how!r}), group="far")
        graph.connect(source.out, one.value)
        graph.connect(one.out, graph.output("out", int))
        report = hfg.run(graph)
        assert report.outputs == {{"out": list(range(200))}}, report.outputs
        print(report.errors)
    """,
    )
    out, err = running.communicate(timeout=patience(60))
    assert running.returncode == 0, err
    assert 'the process of group "far" was restarted 1 times' in out
    assert ("has ended with code 3" if how == "exit" else "was ended by SIGKILL") in err
    nothing_is_left(tmp_path, pids)


@pytest.mark.rule("L2")
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="this system does not tell the children of a process")
def test_a_process_that_waits_already_takes_the_place_of_one_that_dies(tmp_path: Path) -> None:
    running = program(
        tmp_path,
        f"""
    from hfg.parts.processes import standby

    waiting = []

    def spare() -> int:
        for child in Path(f"/proc/{{os.getpid()}}/task/{{os.getpid()}}/children").read_text().split():
            if Path(f"/proc/{{child}}/cmdline").read_bytes().endswith(b"\\0spare\\0"):
                return int(child)
        return 0

    @hfg.node
    async def patient(*, count: int = 40) -> AsyncIterator[int]:
        while not spare():
            await asyncio.sleep(0.01)
        waiting.append(spare())
        for number in range(count):
            yield number

    @hfg.node
    def where(value: int, *, flag: str) -> int:
        if value == 20 and not Path(flag).exists():
            Path(flag).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()

    if __name__ == "__main__":
        standby.AFTER_S = 0.0
        graph = hfg.Graph()
        graph.group("far", process=True)
        source, one = graph.add(patient()), graph.add(where(flag={str(tmp_path / "flag")!r}), group="far")
        graph.connect(source.out, one.value)
        graph.connect(one.out, graph.output("out", int))
        found = hfg.run(graph).outputs["out"]
        assert len(found) == 40
        assert found[0] != found[-1] == waiting[0], (found, waiting)
        print(*found, spare())
    """,
    )
    out, err = running.communicate(timeout=patience(60))
    assert running.returncode == 0, err
    *processes, last_spare = map(int, out.split())
    assert last_spare == 0
    wait_for(lambda: not any(is_there(process) for process in processes))


@pytest.mark.rule("L2", "X2")
def test_a_process_whose_loop_stands_still_is_ended_and_begun_again(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    running = program(
        tmp_path,
        f"""
    if __name__ == "__main__":
        os.environ["HFG_PROCESS_SILENCE_S"] = "3"
        graph = hfg.Graph()
        graph.group("far", process=True)
        source, one = graph.add(numbers()), graph.add(deadly(pids={str(pids)!r}, how="SIGSTOP"), group="far")
        graph.connect(source.out, one.value)
        graph.connect(one.out, graph.output("out", int))
        assert hfg.run(graph).outputs == {{"out": list(range(200))}}
    """,
    )
    _, err = running.communicate(timeout=patience(60))
    assert running.returncode == 0, err
    assert "was ended by SIGKILL because its event loop has been blocked for" in err
    nothing_is_left(tmp_path, pids)


@pytest.mark.rule("R4", "L1", "L2")
def test_a_real_process_is_edited_dies_and_is_as_it_was_edited(tmp_path: Path) -> None:
    """Values go on all the time; from some value on each goes the new way, also through the next process."""
    running = program(
        tmp_path,
        """
    from hfg import commands as c

    @hfg.node
    def add(value: int, *, by: int = 0) -> int:
        return value + by

    @hfg.node
    def whose(value: int) -> tuple[int, int]:
        return value, os.getpid()

    async def main() -> None:
        graph = hfg.Graph()
        graph.group("far", process=True)
        one, two = graph.add(add(), name="one", group="far"), graph.add(whose(), name="two", group="far")
        graph.connect(graph.input("in", int), one.value)
        graph.connect(one.out, two.value)
        graph.connect(two.out, graph.output("out", tuple[int, int]))
        found = []
        async with hfg.running(graph) as run:
            async def read() -> None:
                async for value in run.read("out"):
                    found.append(value)
                    if len(found) == 300:
                        return

            reading = asyncio.create_task(read())
            async with run.feed("in", end=False) as feed:
                for number in range(300):
                    await feed.send(number)
                    if number == 100:
                        await run.edit(
                            c.Disconnect("one.out", "two.value"),
                            c.Add("__main__:add", "new", parameters={"by": 1000}, options={"group": "far"}),
                            c.Connect("one.out", "new.value"),
                            c.Connect("new.out", "two.value"),
                        )
                    if number == 200:
                        os.kill(found[-1][1], signal.SIGKILL)
                await reading
        values = [value for value, _ in found]
        switch = values.index(next(value for value in values if value >= 1000))
        assert values == [*range(switch), *range(1000 + switch, 1300)], values
        assert len({pid for _, pid in found}) == 2

    if __name__ == "__main__":
        asyncio.run(main())
    """,
    )
    _, err = running.communicate(timeout=patience(60))
    assert running.returncode == 0, err


@pytest.mark.rule("X3")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_however_the_main_process_ends_nothing_is_left(tmp_path: Path, how: signal.Signals) -> None:
    pids = tmp_path / "pids"
    running = program(
        tmp_path,
        CHAIN.format(count=1_000_000)
        + f"""
    if __name__ == "__main__":
        hfg.run(build({str(pids)!r}))
    """,
    )
    try:
        wait_for(lambda: pids.exists() and len(pids.read_text().split()) > 10)
        running.send_signal(how)
        running.communicate(timeout=patience(30))
    finally:
        running.kill()
    nothing_is_left(tmp_path, pids)


@pytest.mark.rule("X1")
def test_a_program_that_cannot_be_imported_by_its_workers_is_told_so_in_one_sentence(tmp_path: Path) -> None:
    running = program(
        tmp_path,
        """
    if __name__ != "__main__":
        raise ImportError("not here")
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, last = graph.add(numbers()), graph.add(talks(), group="far")
    graph.connect(source.out, last.value)
    try:
        hfg.run(graph)
    except hfg.errors.RunError as error:
        print(error)
    """,
    )
    out, err = running.communicate(timeout=patience(60))
    assert 'the process of group "far" cannot import' in out, err
    assert "not here" in out


@pytest.mark.rule("R7")
def test_what_nodes_print_and_log_elsewhere_is_seen_here(tmp_path: Path) -> None:
    running = program(
        tmp_path,
        """
    if __name__ == "__main__":
        logging.basicConfig(format="%(name)s %(levelname)s %(message)s", stream=sys.stderr)
        graph = hfg.Graph()
        graph.group("far", process=True)
        source, last = graph.add(numbers(count=2)), graph.add(talks(), group="far")
        graph.connect(source.out, last.value)
        hfg.run(graph)
    """,
    )
    out, err = running.communicate(timeout=patience(60))
    assert running.returncode == 0, err
    assert out.split("\n") == ["printed 0", "printed 1", ""]
    assert [line for line in err.split("\n") if "logged" in line] == [
        "hfg.node.talks WARNING logged 0",
        "hfg.node.talks WARNING logged 1",
    ]


@pytest.mark.rule("L5")
def test_a_process_of_a_group_runs_nothing_that_lies_in_the_current_folder(tmp_path: Path) -> None:
    """Another user may have put it there."""
    anywhere = tmp_path / "anywhere"
    anywhere.mkdir()
    (anywhere / "msgspec.py").write_text("raise SystemExit('code of another user')")
    running = program(
        tmp_path,
        """
    @hfg.node
    def numbers() -> Iterator[int]:
        yield from range(3)

    @hfg.node
    def where(value: int) -> int:
        return value

    if __name__ == "__main__":
        graph = hfg.Graph()
        graph.group("far", process=True)
        source, one = graph.add(numbers()), graph.add(where(), group="far")
        graph.connect(source.out, one.value)
        graph.connect(one.out, graph.output("out", int))
        print(*hfg.run(graph).outputs["out"])
    """,
        cwd=anywhere,
    )
    out, err = running.communicate(timeout=patience(60))
    assert (running.returncode, out.split()) == (0, ["0", "1", "2"]), err
