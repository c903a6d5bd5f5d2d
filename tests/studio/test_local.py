"""A run that another program of the same user steers, from a second terminal or a page (rule L5)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import socket
import sys
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.cli import main
from hfg.engine.face.watching import run_names, run_sockets
from hfg.errors import TargetError, UsageError
from hfg.studio.attaching import AttachedDoor, connected_to
from hfg.studio.local import FrameReader, framed
from hfg.studio.viewing import Frame
from tests.studio.page import live
from tests.studio.test_studio import HERE, scaled, ticking

pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="there are no Unix domain sockets")


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Give a folder for sockets, with a short name."""
    made = Path(tempfile.mkdtemp(prefix="hfg"))
    monkeypatch.setenv("XDG_STATE_HOME", str(made))
    yield
    shutil.rmtree(made)


@contextlib.asynccontextmanager
async def running() -> AsyncIterator[tuple[hfg.Run, str]]:
    """A run that others may look at, and its name."""
    graph = ticking()
    graph.add(scaled(), name="scaled")
    async with hfg.running(graph, watch="test") as run:
        with contextlib.closing(run_sockets()) as there:
            (name,) = run_names(there)
        yield run, name


class Client:
    """Another program that speaks the protocol."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._frames = FrameReader()
        self._heard: list[tuple[bytes, bool]] = []

    def say(self, data: bytes) -> None:
        self._writer.write(data + b"\n")

    async def frame(self) -> tuple[bytes, bool]:
        while not self._heard:
            data = await self._reader.read(1 << 16)
            if not data:
                raise ConnectionResetError
            self._heard += self._frames.feed(data)
        return self._heard.pop(0)

    async def until(self, kind: str) -> Any:
        while True:
            data, is_binary = await self.frame()
            if not is_binary and json.loads(data).get("t") == kind:
                return json.loads(data)

    async def close(self) -> None:
        self._writer.close()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()


async def visitor(name: str) -> Client:
    client = Client(*await asyncio.open_connection(sock=connected_to(name)))
    client.say(b'{"want":"studio"}')
    await client.frame()
    client.say(b'{"t":"join"}')
    return client


@pytest.mark.rule("L5")
@pytest.mark.rule("R4")
def test_another_program_edits_the_graph_while_it_runs() -> None:
    async def go() -> None:
        async with running() as (run, name):
            client = await visitor(name)
            snapshot = await client.until("snapshot")
            assert set(snapshot["tables"]["nodes"]) == {"clock", "count", "scaled"}
            assert snapshot["tables"]["studio"]["run"]["steerable"] is False
            command = {"do": "Add", "type": f"{HERE}:Count", "path": "more"}
            client.say(json.dumps({"t": "edit", "id": 1, "commands": [command]}).encode())
            assert (await client.until("ack"))["id"] == 1
            assert "more" in run.graph.nodes
            await client.close()

    live(go)


def test_binary_frames_come_through_the_socket() -> None:
    async def go() -> None:
        async with running() as (_, name):
            client = await visitor(name)
            client.say(b'{"t":"sub","sub":1,"topic":"measures","args":{"nodes":["count"]}}')
            while True:
                data, is_binary = await client.frame()
                if is_binary:
                    break
            assert len(data) == 16 + 124
            await client.close()

    live(go)


@pytest.mark.rule("L5")
@pytest.mark.parametrize("line", [b"nonsense", b'{"t":"edit"}', b"\xff\xfe", b"[" * 5000])
def test_who_does_not_keep_to_the_protocol_is_sent_away_and_the_run_goes_on(line: bytes) -> None:
    async def go() -> None:
        async with running() as (run, name):
            client = await visitor(name)
            client.say(line)
            with pytest.raises(ConnectionResetError):
                await client.until("never")
            await client.close()
            await run.trigger("clock.tick", 3)
            await run.wait_quiet()

    live(go)


def test_the_end_of_the_run_ends_the_connection() -> None:
    async def go() -> None:
        async with running() as (_, name):
            client = await visitor(name)
            await client.until("snapshot")
        with pytest.raises(ConnectionResetError):
            await client.until("never")
        await client.close()
        with pytest.raises(TargetError, match="is over, or never was"):
            connected_to(name)

    live(go)


class Outbox:
    """A page of the attached studio."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.more = asyncio.Event()
        self.end: tuple[int, str] | None = None

    def put(self, frame: Frame) -> None:
        self.frames.append(frame)
        self.more.set()

    def close(self, code: int, reason: str) -> None:
        self.end = code, reason
        self.more.set()

    async def until(self, true: Callable[[], bool]) -> None:
        while not true():
            self.more.clear()
            await self.more.wait()


def test_a_page_that_is_attached_sees_the_run_and_its_end() -> None:
    async def go() -> None:
        outbox = Outbox()
        async with running() as (run, name):
            visit = await AttachedDoor(name).enter(outbox)  # type: ignore[arg-type]  # it needs no more of one
            visit.say('{"t":\n"join"}')
            await outbox.until(lambda: any(b'"snapshot"' in bytes(frame.data) for frame in outbox.frames))  # type: ignore[arg-type]
            visit.say('{"t":"pause","id":1}')
            await outbox.until(lambda: run.paused)
            with pytest.raises(UsageError):
                visit.say("nonsense")
        await outbox.until(lambda: outbox.end is not None)
        assert outbox.end == (1001, "the run is over")
        visit.leave()

    live(go)


# --- the verbs ---


async def hfg_command(*arguments: str) -> int:
    return await asyncio.to_thread(main, list(arguments))


def steered(test: Callable[[hfg.Run], Awaitable[None]]) -> None:
    async def go() -> None:
        async with running() as (run, _):
            await test(run)

    live(go)


@pytest.mark.rule("R4")
def test_set_and_undo_change_parameters_of_a_run(capfd: pytest.CaptureFixture[str]) -> None:
    async def test(run: hfg.Run) -> None:
        assert await hfg_command("set", "ticking", "scaled.factor=7") == 0
        assert run.graph["scaled"].factor == 7
        assert await hfg_command("undo") == 0
        assert run.graph["scaled"].factor == 2
        assert await hfg_command("redo", "ticking") == 0
        assert run.graph["scaled"].factor == 7
        assert await hfg_command("set", "ticking", "scaled.factor=-1") == 2
        assert await hfg_command("set", "ticking", "scaled.factor") == 2
        assert run.graph["scaled"].factor == 7

    steered(test)
    said = capfd.readouterr().err
    assert "must be >= 0, got -1" in said
    assert "write PATH=VALUE" in said


@pytest.mark.rule("R3")
def test_pause_step_and_trigger_steer_a_run(capfd: pytest.CaptureFixture[str]) -> None:
    async def test(run: hfg.Run) -> None:
        assert await hfg_command("pause") == 0
        assert run.paused
        assert await hfg_command("trigger", "ticking", "clock.tick", "3") == 0
        assert await hfg_command("step", "--node", "clock") == 0
        assert await hfg_command("step") == 0
        assert await hfg_command("step") == 0
        assert run.graph["count"].calls == 1
        assert await hfg_command("resume") == 0
        assert not run.paused

    steered(test)
    clock, count, nothing = capfd.readouterr().out.splitlines()
    assert (clock, count) == ("clock", "count")
    assert nothing.startswith("nothing moved")


def test_edit_carries_commands_out_or_none(capfd: pytest.CaptureFixture[str]) -> None:
    async def test(run: hfg.Run) -> None:
        assert await hfg_command("edit", "ticking", '[{"do":"Remove","path":"count"}]') == 0
        assert list(run.graph.nodes) == ["clock", "scaled"]
        two = '[{"do":"Remove","path":"scaled"},{"do":"Remove","path":"nobody"}]'
        assert await hfg_command("edit", "ticking", two) == 2
        assert list(run.graph.nodes) == ["clock", "scaled"]
        assert await hfg_command("edit", "ticking", "Remove count") == 2

    steered(test)
    said = capfd.readouterr().err
    assert 'no node "nobody"' in said
    assert "the commands are not JSON" in said


# --- the graph in an editor ---


@pytest.fixture
def editor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Let an editor be a program that does something with `text`; the path is where it keeps all that it was shown."""

    def made(does: str) -> Path:
        program, shown = tmp_path / "editor.py", tmp_path / "shown.txt"
        program.write_text(
            "import pathlib, sys\n"
            "path = pathlib.Path(sys.argv[1])\n"
            "text = path.read_text()\n"
            f"open({str(shown)!r}, 'a').write(text + '---')\n"
            f"{does}\n"
            "path.write_text(text)\n"
        )
        monkeypatch.delenv("VISUAL", raising=False)
        monkeypatch.setenv("EDITOR", f"{sys.executable} {program}")
        return shown

    return made


FACTOR = "text = text.replace('test_studio:scaled\\n', 'test_studio:scaled\\n    parameters:\\n      factor: 7\\n')"


@pytest.mark.rule("R4")
def test_what_one_changes_in_the_editor_is_one_step_of_the_history(
    editor: Callable[[str], Path], capfd: pytest.CaptureFixture[str]
) -> None:
    editor(FACTOR + "; text = text.replace('  - clock.out -> count.call\\n', '')")

    async def test(run: hfg.Run) -> None:
        assert await hfg_command("edit", "ticking") == 0
        assert run.graph["scaled"].factor == 7
        assert list(run.graph.edges) == []
        assert await hfg_command("undo") == 0
        assert run.graph["scaled"].factor == 2
        assert [edge.label for edge in run.graph.edges] == ["clock.out -> count.call"]

    steered(test)
    assert "edited, by 2 commands" in capfd.readouterr().out


def test_a_mistake_opens_the_editor_again_with_its_line_and_nothing_is_edited_meanwhile(
    editor: Callable[[str], Path],
) -> None:
    shown = editor(
        "wrong = 'clock.nix' in text\n"
        "text = text.replace('clock.nix', 'clock.out') if wrong else text.replace('clock.out', 'clock.nix')\n"
        "if wrong: " + FACTOR
    )

    async def test(run: hfg.Run) -> None:
        assert await hfg_command("edit", "ticking") == 0
        assert run.graph["scaled"].factor == 7

    steered(test)
    first, second, _ = shown.read_text().split("---")
    assert "#!" not in first
    assert second.startswith('#! ticking.hfg.yaml:11: "clock.nix -> count.call": there is no "clock.nix"')


@pytest.mark.rule("R4")
def test_what_others_edit_meanwhile_stays(editor: Callable[[str], Path]) -> None:
    command = [sys.executable, "-m", "hfg", "set", "ticking", "scaled.factor=5"]
    editor(
        f"import subprocess; subprocess.run({command!r}, check=True)\n"
        "text = text.replace('  - clock.out -> count.call\\n', '')"
    )

    async def test(run: hfg.Run) -> None:
        assert await hfg_command("edit", "ticking") == 0
        assert list(run.graph.edges) == []
        assert run.graph["scaled"].factor == 5

    steered(test)


def test_an_editor_that_changes_nothing_or_fails_edits_nothing(
    editor: Callable[[str], Path], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    editor("pass")

    async def test(run: hfg.Run) -> None:
        assert await hfg_command("edit", "ticking") == 0
        editor("sys.exit(3)")
        assert await hfg_command("edit", "ticking") == 2
        editor("text = text.replace('clock.out', 'clock.nix')")
        assert await hfg_command("edit", "ticking") == 2
        monkeypatch.setenv("EDITOR", "no-such-editor")
        assert await hfg_command("edit", "ticking") == 2
        assert len(list(run.graph.edges)) == 1

    steered(test)
    said = capfd.readouterr()
    assert "nothing was edited\n" in said.out
    assert "ended with code 3" in said.err
    assert "left as it was refused" in said.err
    assert 'the editor "no-such-editor" cannot be started' in said.err


# --- frames ---


def test_frames_are_put_together_however_they_come() -> None:
    frames = [(b'{"a":1}', False), (b"\n!3\nab", True), (b"", True), (b'{"b":2}', False)]
    data = b"".join(framed(one, is_binary=is_binary) for one, is_binary in frames)
    for size in (1, 2, 3, 7, 1000):
        reader = FrameReader()
        found = [one for at in range(0, len(data), size) for one in reader.feed(data[at : at + size])]
        assert found == frames


@pytest.mark.parametrize("data", [b"!\n", b"!-1\n", b"!99999999999999\n", b"!x\n"])
def test_a_length_that_cannot_be_is_refused(data: bytes) -> None:
    with pytest.raises(UsageError):
        FrameReader().feed(data)
