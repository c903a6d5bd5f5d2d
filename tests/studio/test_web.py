"""Who may come in, and what is done about everybody else (rule L5): the web server, in process."""

from __future__ import annotations

import random
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from hfg.errors import TargetError, UsageError
from hfg.studio.entrance import Entrance, is_loopback, need_guarded
from hfg.studio.messages import LONGEST, SUBPROTOCOL, FromPage, read
from hfg.studio.web import PageOutbox, application

HOST = "127.0.0.1:8800"
ORIGIN = f"http://{HOST}"


class Listening:
    """Takes the place of the studio: keeps what pages say."""

    def __init__(self) -> None:
        self.said: list[FromPage] = []
        self.outboxes: list[PageOutbox] = []
        self.left = 0

    async def enter(self, outbox: PageOutbox) -> Listening:
        self.outboxes.append(outbox)
        return self

    def say(self, data: str | bytes) -> None:
        self.said.append(read(data))

    def leave(self) -> None:
        self.left += 1


@pytest.fixture
def door() -> Listening:
    return Listening()


@pytest.fixture
def entrance() -> Entrance:
    return Entrance("127.0.0.1", 8800)


@pytest.fixture
def client(door: Listening, entrance: Entrance, tmp_path: Path) -> Iterator[TestClient]:
    (tmp_path / "index.html").write_text("<!doctype html><title>page</title>")
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "main.js").write_text("1")
    with TestClient(application(door, entrance, tmp_path), base_url=ORIGIN, follow_redirects=False) as made:
        yield made


def come_in(client: TestClient, entrance: Entrance) -> None:
    assert "set-cookie" in client.get(f"/?token={entrance.token}").headers


def knock(client: TestClient, **headers: str) -> Any:
    cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    said = {"host": HOST, "origin": ORIGIN, "cookie": cookies, **headers}
    return client.websocket_connect("/ws", [SUBPROTOCOL], headers=said)


def until_gone(socket: Any) -> int:
    """Read until the server ends the connection, and return its code."""
    while True:
        try:
            socket.receive_text()
        except WebSocketDisconnect as gone:
            return gone.code


# --- by HTTP ---


@pytest.mark.rule("L5")
def test_the_token_is_exchanged_for_a_cookie_that_scripts_cannot_read(client: TestClient, entrance: Entrance) -> None:
    answer = client.get(f"/?token={entrance.token}")
    assert answer.status_code == 200
    assert 'http-equiv="refresh" content="0; url=/"' in answer.text
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith("hfg-8800=")
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
    assert entrance.token not in cookie
    assert client.get("/").text.startswith("<!doctype html>")


@pytest.mark.rule("L5")
def test_a_wrong_token_and_none_are_refused(client: TestClient) -> None:
    assert client.get("/?token=guess").status_code == 403
    assert client.get("/").status_code == 401
    assert client.get("/assets/main.js").status_code == 401


@pytest.mark.rule("L5")
def test_the_cookie_of_another_port_is_worth_nothing(client: TestClient, tmp_path: Path) -> None:
    other = Entrance("127.0.0.1", 8801)
    client.cookies.set("hfg-8801", other.set_cookie.partition("=")[2].partition(";")[0])
    assert client.get("/").status_code == 401
    client.cookies.set("hfg-8800", other.set_cookie.partition("=")[2].partition(";")[0])
    assert client.get("/").status_code == 401


@pytest.mark.rule("L5")
@pytest.mark.parametrize("host", ["evil.example:8800", "127.0.0.1:8801", "127.0.0.1", "", "127.0.0.1:8800.evil.com"])
def test_a_name_that_was_rebound_to_this_address_is_refused(client: TestClient, entrance: Entrance, host: str) -> None:
    come_in(client, entrance)
    assert client.get("/", headers={"host": host}).status_code == 421


@pytest.mark.rule("L5")
def test_every_answer_has_the_headers_of_safety(client: TestClient, entrance: Entrance) -> None:
    for path in ("/", "/?token=x", f"/?token={entrance.token}", "/nothing"):
        answer = client.get(path)
        policy = answer.headers["content-security-policy"]
        assert "script-src 'self';" in policy
        assert "unsafe-eval" not in policy
        assert "unsafe-inline" not in policy.replace("style-src 'self' 'unsafe-inline'", "")
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert "access-control-allow-origin" not in answer.headers


@pytest.mark.rule("L5")
@pytest.mark.parametrize("path", ["/../secret", "/%2e%2e/secret", "/assets/..%2f..%2fsecret", "//etc/passwd"])
def test_no_file_outside_of_the_page_is_served(
    client: TestClient, entrance: Entrance, tmp_path: Path, path: str
) -> None:
    (tmp_path.parent / "secret").write_text("secret")
    come_in(client, entrance)
    answer = client.get(path)
    assert answer.status_code in (404, 405)
    assert "secret" not in answer.text


def test_files_are_revalidated_and_not_sent_twice(client: TestClient, entrance: Entrance) -> None:
    come_in(client, entrance)
    answer = client.get("/assets/main.js")
    assert answer.headers["cache-control"] == "no-cache"
    again = client.get("/assets/main.js", headers={"if-none-match": answer.headers["etag"]})
    assert again.status_code == 304


def test_nothing_can_be_changed_by_http(client: TestClient, entrance: Entrance) -> None:
    come_in(client, entrance)
    for method in ("POST", "PUT", "DELETE", "PATCH"):
        assert client.request(method, "/").status_code == 405


# --- by WebSocket ---


@pytest.mark.rule("L5")
def test_a_page_of_this_server_comes_in(client: TestClient, entrance: Entrance, door: Listening) -> None:
    come_in(client, entrance)
    with knock(client) as socket:
        socket.send_text('{"t":"join"}')
        socket.send_text("nonsense")
        assert until_gone(socket) == 1008
    assert len(door.said) == 1
    assert door.left == 1


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": ""},
        {"origin": "http://127.0.0.1:8801"},
        {"origin": "https://127.0.0.1:8800"},
        {"origin": "http://localhost:8800"},
        {"host": "evil.example:8800", "origin": "http://evil.example:8800"},
        {"cookie": "hfg-8800=guess"},
        {"authorization": "Bearer guess", "cookie": ""},
    ],
)
def test_other_pages_are_refused(
    client: TestClient, entrance: Entrance, door: Listening, headers: dict[str, str]
) -> None:
    come_in(client, entrance)
    with pytest.raises(WebSocketDisconnect), knock(client, **headers):
        pass
    assert not door.outboxes


@pytest.mark.rule("L5")
def test_a_program_with_the_token_needs_no_origin(client: TestClient, entrance: Entrance, door: Listening) -> None:
    headers = {"host": HOST, "authorization": f"Bearer {entrance.token}"}
    with client.websocket_connect("/ws", [SUBPROTOCOL], headers=headers) as socket:
        socket.send_text('{"t":"join"}')
        socket.send_text('{"t":"visible","on":true}')
    assert len(door.outboxes) == 1


def test_another_subprotocol_is_refused(client: TestClient, entrance: Entrance, door: Listening) -> None:
    come_in(client, entrance)
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect("/ws", ["chat"], headers={"host": HOST, "origin": ORIGIN}),
    ):
        pass
    assert not door.outboxes


@pytest.mark.rule("L5")
def test_a_frame_that_is_too_long_or_binary_ends_the_connection(
    client: TestClient, entrance: Entrance, door: Listening
) -> None:
    come_in(client, entrance)
    for kind, data in (("text", "x" * (LONGEST + 1)), ("bytes", b"\0" * 100)):
        with knock(client) as socket:
            socket.send({"type": "websocket.receive", kind: data})
            assert until_gone(socket) in (1008, 1009)
    assert not door.said


@pytest.mark.rule("L5")
def test_ten_thousand_fuzzed_messages_are_refused_in_words_and_nothing_else() -> None:
    choose = random.Random(1)
    seeds = [
        '{"t":"edit","id":7,"commands":[{"do":"Connect","source":"a.out","target":"b.image"}],"gesture":"x"}',
        '{"t":"sub","sub":3,"topic":"value","hz":10,"args":{"path":"blur.out"}}',
        '{"t":"painted","sub":3,"seq":12}',
        '{"t":"break","id":1,"path":"a","condition":{"op":"<","value":3,"field":"x.y"}}',
        '{"t":"join","boot":"","rev":-1}',
    ]
    understood = 0
    for _ in range(10_000):
        data = bytearray(choose.choice(seeds).encode())
        for _ in range(choose.randrange(1, 6)):
            place = choose.randrange(len(data))
            match choose.randrange(4):
                case 0:
                    data[place] = choose.randrange(256)
                case 1:
                    del data[place : place + choose.randrange(8)]
                case 2:
                    data[place:place] = bytes(choose.randrange(256) for _ in range(choose.randrange(1, 9)))
                case 3:
                    data[place:place] = choose.choice((b"[" * 500, b'{"t":', b"1e999", b"null", b'"\\ud800"'))
            data = data or bytearray(b"{")
        try:
            read(bytes(data))
            understood += 1
        except UsageError:
            pass
    assert 0 < understood < 10_000


# --- how fast, how much ---


def test_a_page_that_takes_nothing_is_sent_away_and_keeps_nothing(
    client: TestClient, entrance: Entrance, door: Listening
) -> None:
    from hfg.studio.viewing import Frame

    come_in(client, entrance)
    with knock(client) as socket:
        socket.send_text('{"t":"join"}')
        (outbox,) = door.outboxes
        full = threading.Event()
        outbox._loop.call_soon_threadsafe(full.wait)  # until then nothing is written
        for _ in range(3000):
            outbox.put(Frame(b'"' + b"x" * 10_000 + b'"'))
        full.set()
        assert until_gone(socket) == 1013


def test_a_flood_of_messages_is_read_more_and_more_slowly(monkeypatch: pytest.MonkeyPatch) -> None:
    import asyncio

    from hfg.studio import web

    waited: list[float] = []

    async def sleep(seconds: float) -> None:
        waited.append(seconds)

    monkeypatch.setattr("hfg.studio.web.asyncio.sleep", sleep)
    monkeypatch.setattr("hfg.studio.web.time.monotonic", lambda: 0.0)

    async def flood() -> None:
        pace = web._Pace()
        for _ in range(1000):
            await pace.wait()

    asyncio.run(flood())
    assert len(waited) == 600
    assert waited == sorted(waited)


# --- which addresses ---


@pytest.mark.rule("L5")
def test_other_machines_come_in_only_encrypted_or_by_a_word_for_it() -> None:
    need_guarded("127.0.0.1", encrypted=False, insecure=False)
    need_guarded("0.0.0.0", encrypted=True, insecure=False)
    need_guarded("robot.local", encrypted=False, insecure=True)
    for host in ("0.0.0.0", "::", "192.168.1.7", "robot.local"):
        with pytest.raises(TargetError, match="--certfile and --keyfile, or go through ssh -L, or write --insecure"):
            need_guarded(host, encrypted=False, insecure=False)


def test_this_machine_is_known_by_all_its_own_names() -> None:
    assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.1.2.3", "::1")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "10.0.0.1", "localhost.evil.example", "")))


@pytest.mark.rule("L5")
def test_where_every_address_is_served_a_name_still_is_not() -> None:
    entrance = Entrance("0.0.0.0", 8800)
    assert entrance.is_host("192.168.1.7:8800")
    assert entrance.is_host("[fe80::1]:8800")
    assert not entrance.is_host("evil.example:8800")


@pytest.mark.rule("L5")
def test_a_cookie_goes_over_encrypted_ways_alone_where_there_are_such() -> None:
    assert "Secure" in Entrance("robot", 8800, encrypted=True).set_cookie
