"""Another user of the same computer cannot enter a studio, whatever he knows, nor stand in for one (rule L5)."""

from __future__ import annotations

import asyncio
import base64
import errno
import os
import socket
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from hfg.base.loopback import OwnListener
from hfg.cli.certificates import make_authority, make_certificate
from hfg.errors import TargetError
from hfg.studio.messages import SUBPROTOCOL
from hfg.studio.serving import Server, StudioDoor
from tests.studio.page import live, studio_of
from tests.studio.test_studio import doubling

pytest.importorskip("tests.attacks.another_user", exc_type=ImportError)
from tests.attacks.another_user import as_nobody

pytestmark = pytest.mark.rule("L5")

only_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can begin a process of another user"
)
LOCALHOST = ((socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1"))


def has_address(family: socket.AddressFamily, host: str) -> bool:
    try:
        with socket.socket(family) as one:
            one.bind((host, 0))
    except OSError:
        return False
    return True


HERE = [one for one in LOCALHOST if has_address(*one)]
only_both = pytest.mark.skipif(len(HERE) < 2, reason="this computer has one address of localhost only")


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Keep the secrets of tests out of the user's folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def asks(family: socket.AddressFamily, host: str, port: int, token: str) -> str:
    """Ask for the page with the right token; returns the first line of the answer, "" if there is none."""
    with socket.socket(family) as one:
        one.settimeout(10)
        try:
            one.connect((host, port))
            one.sendall(
                f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nAuthorization: Bearer {token}\r\n"
                "Connection: close\r\n\r\n".encode()
            )
            return one.recv(1000).partition(b"\r\n")[0].decode()
        except ConnectionError:
            return ""


@only_root
@pytest.mark.slow
@pytest.mark.parametrize(("family", "host"), HERE)
def test_a_program_of_another_user_gets_no_answer_even_with_the_token(family: socket.AddressFamily, host: str) -> None:
    async def main() -> None:
        server = Server(StudioDoor(asyncio.get_running_loop(), studio_of(doubling())))
        server.start()
        port, token = urlsplit(server.address).port, server.entrance.token
        assert port is not None
        theirs = await asyncio.to_thread(as_nobody, lambda: [asks(family, host, port, token) for _ in range(20)])
        mine = await asyncio.to_thread(asks, family, host, port, token)
        await server.stop()
        assert theirs == [""] * 20
        assert mine == "HTTP/1.1 200 OK"

    live(main)


def test_a_program_that_has_its_own_kind_of_loop_lets_nobody_past_the_check() -> None:
    """As with uvloop, whose servers accept connections without asking the socket."""

    class Policy(asyncio.DefaultEventLoopPolicy):
        def new_event_loop(self) -> asyncio.AbstractEventLoop:
            raise AssertionError("the server has taken the program's kind of loop")

    async def main() -> None:
        server = Server(StudioDoor(asyncio.get_running_loop(), studio_of(doubling())))
        asyncio.set_event_loop_policy(Policy())
        try:
            server.start()
            port, token = urlsplit(server.address).port, server.entrance.token
            assert port is not None
            assert await asyncio.to_thread(asks, *HERE[0], port, token) == "HTTP/1.1 200 OK"
            await server.stop()
        finally:
            asyncio.set_event_loop_policy(None)

    live(main)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells whose programs connect")
def test_it_is_said_if_the_system_does_not_tell_whose_programs_connect(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuses(*_: object) -> None:
        raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))

    async def main() -> None:
        server = Server(StudioDoor(asyncio.get_running_loop(), studio_of(doubling())))
        server.start()
        await server.stop()

    live(main)
    assert "whose programs connect" not in caplog.text
    monkeypatch.setattr("hfg.base.loopback.PeerUsers", refuses)
    live(main)
    assert len([one for one in caplog.records if "does not tell whose programs connect" in one.message]) == 1


def test_no_log_tells_the_token_or_the_cookie(caplog: pytest.LogCaptureFixture) -> None:
    """Programs log at level DEBUG, and others may read their logs."""

    async def main() -> tuple[str, str]:
        server = Server(StudioDoor(asyncio.get_running_loop(), studio_of(doubling())))
        server.start()
        entrance, port = server.entrance, urlsplit(server.address).port
        assert port is not None
        cookie = entrance.set_cookie.partition(";")[0]
        for proof in (
            f"Authorization: Bearer {entrance.token}",
            f"Cookie: {cookie}\r\nOrigin: http://localhost:{port}",
        ):
            assert await asyncio.to_thread(upgrades, port, proof) == "HTTP/1.1 101 Switching Protocols"
        assert await asyncio.to_thread(asks, *HERE[0], port, entrance.token) == "HTTP/1.1 200 OK"
        await server.stop()
        return entrance.token, cookie.partition("=")[2]

    with caplog.at_level("DEBUG", ""):
        for secret in asyncio.run(main()):
            assert secret not in caplog.text


def upgrades(port: int, proof: str) -> str:
    """Ask for the WebSocket; returns the first line of the answer."""
    with socket.create_connection(("127.0.0.1", port), 10) as one:
        one.sendall(
            f"GET /ws HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {base64.b64encode(bytes(16)).decode()}\r\n"
            f"Sec-WebSocket-Protocol: {SUBPROTOCOL}\r\n{proof}\r\n\r\n".encode()
        )
        return one.recv(1000).partition(b"\r\n")[0].decode()


@pytest.fixture
def listener() -> Iterator[OwnListener]:
    with OwnListener(socket.AF_INET) as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        yield one


@only_root
def test_the_user_of_a_connection_is_asked_for_before_anything_is_read(
    listener: OwnListener, caplog: pytest.LogCaptureFixture
) -> None:
    refusals: list[str] = []

    def accept_all() -> None:
        for _ in range(3):
            try:
                listener.accept()
            except ConnectionAbortedError as error:
                refusals.append(str(error))

    def knocks() -> str:
        with socket.socket() as one:
            one.settimeout(10)
            one.connect(listener.getsockname())
            return one.recv(1).decode()

    accepting = threading.Thread(target=accept_all)
    accepting.start()
    assert [as_nobody(knocks) for _ in range(3)] == [""] * 3
    accepting.join(10)
    assert len(refusals) == listener.refused == 3
    assert len([one for one in caplog.records if "another user was turned away" in one.message]) == 1


def test_whoever_has_gone_again_is_nobody_so_that_no_request_comes_in_behind_the_check(listener: OwnListener) -> None:
    """A connection that was closed belongs to no user; its request would still be read."""
    with socket.socket() as one:
        one.connect(listener.getsockname())
        one.sendall(b"GET / HTTP/1.1\r\n\r\n")
    with pytest.raises(ConnectionAbortedError):
        listener.accept()


def test_programs_of_this_user_are_let_in(listener: OwnListener) -> None:
    with socket.socket() as one:
        one.connect(listener.getsockname())
        connected, address = listener.accept()
        connected.close()
        assert address == one.getsockname()


@only_both
@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "::1"])
@pytest.mark.parametrize(("family", "taken"), HERE)
def test_nobody_else_can_have_the_other_address_of_localhost(
    host: str, family: socket.AddressFamily, taken: str
) -> None:
    """Browsers try ::1 first for "localhost", so another user who listens there would learn the token."""

    async def main() -> None:
        door = StudioDoor(asyncio.get_running_loop(), studio_of(doubling()))
        with socket.socket(family) as other:
            other.bind((taken, 0))
            other.listen()
            port = other.getsockname()[1]
            with pytest.raises(TargetError, match=f"port {port} of {taken} cannot be taken"):
                Server(door, host=host, port=port)
        server = Server(door, host=host)
        server.start()
        port = urlsplit(server.address).port
        for kind, address in HERE:
            assert port is not None
            with socket.socket(kind) as other:
                other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                with pytest.raises(OSError, match="in use"):
                    other.bind((address, port))
        await server.stop()

    live(main)


def test_a_studio_finds_a_port_although_all_usual_ones_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = other.getsockname()[1]
            monkeypatch.setattr("hfg.studio.serving.Server.ports", range(port, port + 1))
            server = Server(StudioDoor(asyncio.get_running_loop(), studio_of(doubling())))
            server.start()
            assert urlsplit(server.address).port not in (port, 0)
            await server.stop()

    live(main)


@pytest.fixture
def certificate(tmp_path: Path) -> dict[str, Any]:
    make_authority(tmp_path, days=1)
    make_certificate(tmp_path, "here", "agent", hosts=["localhost"], days=1)
    return {"certfile": str(tmp_path / "here.pem"), "keyfile": str(tmp_path / "here.key")}


def test_a_certificate_whose_key_others_know_is_refused(certificate: dict[str, Any]) -> None:
    """Whoever has the key can pose as the studio, and is given the token."""
    Path(certificate["keyfile"]).chmod(0o644)

    async def main() -> None:
        door = StudioDoor(asyncio.get_running_loop(), studio_of(doubling()))
        with pytest.raises(TargetError, match=r"--keyfile: other users can read or change .*here.key; write chmod 600"):
            Server(door, **certificate)
        with pytest.raises(TargetError, match="nowhere.key cannot be read: No such file or directory; correct"):
            Server(door, certfile=certificate["certfile"], keyfile="nowhere.key")

    live(main)


def test_a_cookie_that_the_network_has_heard_opens_no_other_studio(certificate: dict[str, Any]) -> None:
    """One that is killed leaves its cookie to the next one at its port."""

    async def main() -> None:
        door = StudioDoor(asyncio.get_running_loop(), studio_of(doubling()))
        cookies = []
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
        how: dict[str, Any]
        for how in ({"host": "0.0.0.0", "insecure": True}, {"host": "0.0.0.0", **certificate}, {}) * 2:
            server = Server(door, port=port, **how)
            cookies.append(server.entrance.set_cookie.partition(";")[0])
            for listening in server._sockets:  # it is killed
                listening.close()
        open_1, encrypted_1, here_1, open_2, encrypted_2, here_2 = cookies
        assert (encrypted_1, here_1) == (encrypted_2, here_2), "pages come back by themselves"
        assert len({open_1, open_2, encrypted_1, here_1}) == 4

    live(main)
