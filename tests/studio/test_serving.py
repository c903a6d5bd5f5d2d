"""Real servers: from the program's own, from the command, after a sudden end."""

from __future__ import annotations

import asyncio
import json
import re
import ssl
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx2
import pytest
import websockets

import hfg
from hfg.cli.certificates import make_authority, make_certificate
from hfg.errors import TargetError
from hfg.studio.crowding import MOST_CONNECTIONS
from hfg.studio.messages import SUBPROTOCOL
from hfg.studio.serving import Server, StudioDoor
from tests.limits import patience
from tests.studio.page import live, studio_of
from tests.studio.test_studio import doubling, ticking
from tools.browser import StudioProcess


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Keep the secrets of tests out of the user's folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


async def cookie_of(address: str) -> str:
    async with httpx2.AsyncClient() as client:
        answer = await client.get(address)
    return answer.headers["set-cookie"].partition(";")[0]


async def come_in(address: str, cookie: str = "") -> websockets.ClientConnection:
    """Open an address as a browser does."""
    base = address.partition("/?")[0]
    cookie = cookie or await cookie_of(address)
    return await websockets.connect(
        f"{base.replace('http', 'ws')}/ws",
        subprotocols=[SUBPROTOCOL],  # type: ignore[list-item]  # a text with a type of its own
        additional_headers={"Cookie": cookie},
        origin=base,  # type: ignore[arg-type]
    )


async def until(socket: websockets.ClientConnection, kind: str) -> Any:
    async with asyncio.timeout(patience(10)):
        while True:
            message = json.loads(await socket.recv())
            if message["t"] == kind:
                return message


async def ask(socket: websockets.ClientConnection, **message: Any) -> Any:
    await socket.send(json.dumps({"id": 1, **message}))
    return await until(socket, "reject" if message.get("refused") else "ack")


@pytest.mark.slow
def test_a_program_shows_its_own_run() -> None:
    async def main() -> None:
        async with hfg.running(ticking()) as run:
            page = run.studio()
            assert "<iframe" in page._repr_html_()
            async with await come_in(page.address) as socket:
                await socket.send('{"t":"join"}')
                snapshot = await until(socket, "snapshot")
                assert set(snapshot["tables"]["nodes"]) == {"clock", "count"}
                await ask(socket, t="pause")
                assert run.paused
            await page.close()

    live(main)


@pytest.mark.slow
def test_the_graph_goes_on_while_a_page_reads_nothing() -> None:
    async def main() -> None:
        async with hfg.running(ticking()) as run:
            page = run.studio()
            async with await come_in(page.address) as socket:
                await socket.send('{"t":"join"}')
                await socket.send('{"t":"sub","sub":1,"topic":"history","hz":60,"args":{"path":"clock.out"}}')
                for value in range(2000):
                    await run.trigger("clock.tick", value)
                await run.wait_quiet()
                assert run.graph["count"].calls == 2000
            await page.close()

    live(main)


@pytest.mark.slow
@pytest.mark.rule("L5")
def test_connections_that_send_nothing_give_way_to_a_page_and_are_few() -> None:
    async def main() -> None:
        async with hfg.running(ticking()) as run:
            page = run.studio()
            port = urlsplit(page.address).port
            crowd = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3 * MOST_CONNECTIONS)]
            async with await come_in(page.address) as socket:
                assert (await until(socket, "hello"))["boot"]
                gone = [await reader.read() for reader, _ in crowd[: 2 * MOST_CONNECTIONS]]
                assert not any(gone)
            for _, writer in crowd:
                writer.close()
            await page.close()

    live(main)


@pytest.mark.slow
@pytest.mark.rule("L5")
@pytest.mark.timeout(10)
def test_with_tls_connections_that_send_nothing_are_few_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are none of the server's yet, and each takes a file handle."""
    monkeypatch.setattr("asyncio.constants.SSL_HANDSHAKE_TIMEOUT", 1e6)  # those that may stay are not sent away
    make_authority(tmp_path, days=1)
    make_certificate(tmp_path, "here", "agent", hosts=["127.0.0.1"], days=1)
    trusting = ssl.create_default_context(cafile=str(tmp_path / "authority.pem"))

    async def main() -> None:
        door = StudioDoor(asyncio.get_running_loop(), studio_of(doubling()))
        certificate, key = str(tmp_path / "here.pem"), str(tmp_path / "here.key")
        server = Server(door, host="0.0.0.0", certfile=certificate, keyfile=key)
        server.start()
        port = urlsplit(server.address).port
        crowd = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3 * MOST_CONNECTIONS)]
        for _ in range(2):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trusting)
            writer.write(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n".encode())
            assert (await reader.read()).startswith(b"HTTP/1.1 401")
            writer.close()
        assert not any([await reader.read() for reader, _ in crowd[: 2 * MOST_CONNECTIONS]])
        for _, writer in crowd:
            writer.close()
        await server.stop()

    live(main)


@pytest.mark.slow
def test_a_port_in_use_is_said_in_words() -> None:
    async def main() -> None:
        studio = studio_of(doubling())
        door = StudioDoor(asyncio.get_running_loop(), studio)
        server = Server(door)
        server.start()
        port = int(re.findall(r":(\d+)/", server.address)[0])
        with pytest.raises(TargetError, match=f"port {port} of 127.0.0.1 cannot be taken"):
            Server(door, port=port)
        await server.stop()

    live(main)


@pytest.mark.slow
@pytest.mark.rule("L5")
@pytest.mark.timeout(120)
def test_after_a_sudden_end_edits_are_offered_to_pages_with_their_cookies_and_after_another_end_no_more(
    tmp_path: Path,
) -> None:
    hfg.save(doubling(), tmp_path / "doubling.hfg.yaml")

    async def edited(address: str, cookie: str) -> None:
        async with await come_in(address, cookie) as socket:
            await socket.send('{"t":"join"}')
            await until(socket, "snapshot")
            await ask(socket, t="edit", commands=[{"do": "SetParameter", "path": "scaled.factor", "value": 9}])

    async def taken_up(address: str, cookie: str) -> None:
        async with await come_in(address, cookie) as socket:
            await socket.send('{"t":"join"}')
            tables = (await until(socket, "snapshot"))["tables"]
            assert tables["studio"]["file"]["journal"]["changes"] == 1
            assert tables["nodes"]["scaled"]["parameters"]["factor"] == 2
            await ask(socket, t="journal", take=True)
            await ask(socket, t="save")

    async def refused(address: str, cookie: str) -> None:
        with pytest.raises(websockets.InvalidStatus):
            await come_in(address, cookie)
        async with await come_in(address) as socket:
            assert (await until(socket, "hello"))["boot"]

    with StudioProcess("doubling.hfg.yaml", "--allow", "tests", folder=tmp_path) as studio:
        first = studio.address
        cookie = asyncio.run(cookie_of(first))
        asyncio.run(edited(first, cookie))
        studio.kill()
        studio.start()
        assert studio.address != first  # the token is another one
        asyncio.run(taken_up(studio.address, cookie))
        studio.end()
        studio.start()
        asyncio.run(refused(studio.address, cookie))
    assert hfg.load(tmp_path / "doubling.hfg.yaml", allow=["tests"])["scaled"].factor == 9


@pytest.mark.slow
@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--host", "0.0.0.0"), "write --insecure"),
        (("run.mcap",), "cannot open the recording run.mcap: No such file or directory"),
        (("--into", "robot.py"), "--into names the graph of a recording"),
        (("--attach", "99999999"), "no graph that could be looked at runs in process 99999999"),
        (("missing.hfg.yaml",), "missing.hfg.yaml"),
    ],
)
def test_what_cannot_be_served_is_said_in_one_sentence(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    says: str,
) -> None:
    from hfg.cli import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert main(["studio", *arguments, "--no-browser"]) == 2
    said = capfd.readouterr().err
    assert says in said
    assert said.count("\n") == 1
