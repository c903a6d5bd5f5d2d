"""WebSockets and HTTP with real ends on this computer: in step, through a death, and with guests that are refused."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx2
import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.typing import Origin

import hfg
from hfg.errors import RunError, UsageError
from hfg.nodes import buses
from hfg.nodes.buses import Message, Request, Response
from tests.nodes.buses_outside import Seen, heard, port_of, sent, served, texts
from tests.nodes.test_buses_streams import free_port, play

pytestmark = pytest.mark.slow


# --- WebSockets ---


def test_a_client_speaks_with_a_server_that_dies_once_and_hears_the_rest_from_the_next() -> None:
    async def scene() -> None:
        port, got = free_port(), set[str]()

        async def echo(socket: Any) -> None:
            async for message in socket:
                got.add(message)
                await socket.send(message)

        graph = hfg.Graph()
        client = graph.add(buses.WebSocketClient(url=f"ws://127.0.0.1:{port}/talk", longest_pause_s=0.2))
        graph.connect(graph.add(texts(to=300), max_rate_hz=500).out, client.message)
        seen, lost = heard(graph, client.received, client.disconnected)
        async with hfg.running(graph) as run:
            async with serve(echo, "127.0.0.1", port) as server:
                await seen.until(lambda seen: len(seen) >= 100)
                for one in server.connections:
                    one.transport.abort()
            await lost.until(bool)
            async with serve(echo, "127.0.0.1", port):
                await seen.until(lambda seen: "299" in seen)
            own = run.report().nodes["web_socket_client"].own
        assert own["connections"] == 2
        assert own["sent"] == 300
        assert own["received"] == len(seen.seen) <= len(got) <= 300

    play(scene())


@pytest.mark.rule("L5")
def test_a_server_knows_its_clients_and_refuses_strange_pages_names_and_tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GATE", "hunter2")

    async def scene() -> None:
        graph = hfg.Graph()
        server = graph.add(
            buses.WebSocketServer(secret="env:GATE", origins=["https://panel.example"], form="json", most_bytes=1000)
        )
        graph.connect(server.received, server.message)
        (places,) = heard(graph, server.connected)
        key = {"Authorization": "Bearer hunter2"}
        async with hfg.running(graph) as run:
            url = f"ws://127.0.0.1:{await port_of(places)}"
            for how in (
                {"additional_headers": key, "origin": "https://evil.example"},
                {"additional_headers": {**key, "Host": "evil.example"}},
                {"additional_headers": {"Authorization": "Bearer wrong"}},
                {},
            ):
                with pytest.raises(InvalidStatus, match=r"HTTP 4\d\d"):
                    await connect(url, **how)
            async with connect(url, additional_headers=key, origin=Origin("https://panel.example")) as socket:
                await socket.send('{"speed": 1}')
                assert await socket.recv() == '{"speed":1}'
            async with connect(url, additional_headers=key) as socket:
                await socket.send("x" * 2000)
                with pytest.raises(ConnectionClosedError, match="message too big"):
                    await socket.recv()
            assert run.report().nodes["web_socket_server"].own["refused"] == 4

    play(scene())


def test_a_wrong_token_is_refused_at_once_and_a_server_of_something_else_is_asked_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("WRONG", "wrong")

    async def garbage(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"\x00\xff garbage\r\n\r\n")

    def refuse(socket: Any, request: Any) -> Any:
        return socket.respond(401, "no\n")

    async def nobody(socket: Any) -> None: ...

    async def scene() -> None:
        async with serve(nobody, "127.0.0.1", 0, process_request=refuse) as server:
            port = next(iter(server.sockets)).getsockname()[1]
            graph = hfg.Graph()
            graph.add(buses.WebSocketClient(url=f"ws://127.0.0.1:{port}", secret="env:WRONG"))
            with pytest.raises(RunError, match=r"status 401 \(Unauthorized\); look at the parameters user and secret"):
                await hfg.run_async(graph)
        async with served(garbage) as port:
            graph = hfg.Graph()
            graph.add(buses.WebSocketClient(url=f"ws://127.0.0.1:{port}", attempts=2))
            with pytest.raises(RunError, match=r"it is no WebSocket server .*\(2 attempts\)"):
                await hfg.run_async(graph)

    play(scene())


# --- HTTP ---


@hfg.node
def answered(request: Request) -> Response:
    """Say again what was asked."""
    said = f"{request.method} {request.values} {request.query} ".encode() + request.body
    return Response(201, said, {"X-Kind": "echo"}, request.number)


def door(**how: Any) -> tuple[hfg.Graph, buses.HttpServer, Seen]:
    graph = hfg.Graph()
    server = graph.add(buses.HttpServer(routes=["GET /state", "POST /jobs/{name}"], asked=2, **how))
    for event in server.asked:
        node = graph.add(answered())
        graph.connect(event, node.request)
        graph.connect(node.out, server.answer)
    (places,) = heard(graph, server.connected)
    return graph, server, places


def test_routes_are_events_and_answers_are_slots() -> None:
    async def scene() -> None:
        graph, _, places = door()
        async with hfg.running(graph) as run:
            port = await port_of(places)
            asking = hfg.Graph()
            client = asking.add(buses.HttpClient(url=f"http://127.0.0.1:{port}"))
            sent(
                asking, client.message, ["/state", Request("/jobs/wash", "POST", b"now", query={"fast": "1"}), "/none"]
            )
            seen = asking.add(Seen())
            asking.connect(client.response, seen.value)
            report = await hfg.run_async(asking)
            first, second, third = seen.seen
            assert (first.status, first.body, first.headers["x-kind"]) == (201, b"GET {} {} ", "echo")
            assert second.body == b"POST {'name': 'wash'} {'fast': '1'} now"
            assert third.status == 404
            assert report.nodes["http_client"].own == {"connections": 1, "sent": 3}
            assert run.report().nodes["http_server"].own == {"connections": 1, "received": 2}

    play(scene())


@pytest.mark.rule("L5")
def test_a_server_refuses_what_is_not_meant_for_it_too_long_or_not_answered() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        server = graph.add(buses.HttpServer(routes=["POST /job"], timeout_s=0.2, most_bytes=100))
        places, _ = heard(graph, server.connected, server.asked[0])
        async with hfg.running(graph) as run:
            url = f"http://127.0.0.1:{await port_of(places)}/job"
            async with httpx2.AsyncClient(trust_env=False) as client:
                found = [
                    (await client.post(url, content=body, headers=headers)).status_code
                    for body, headers in (
                        (b"", {"Origin": "https://evil.example"}),
                        (b"", {"Host": "evil.example"}),
                        (b"x" * 101, {}),
                        (b"never answered", {}),
                    )
                ]
            assert found == [403, 421, 413, 504]
            own = run.report().nodes["http_server"].own
            assert (own["refused"], own["too long"], own["not answered"]) == (2, 1, 1)

    play(scene())


def test_a_get_is_asked_again_when_the_server_breaks_off_and_a_post_is_not() -> None:
    async def scene() -> None:
        asked: list[bytes] = []

        async def break_off(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            asked.append((await reader.readuntil(b"\r\n\r\n")).split(b" ")[0])
            if len(asked) > 2:
                writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok")

        async with served(break_off) as port:
            for message, outcome in (
                (Request("/a"), "ok"),
                (Request("/a", "POST"), "the server may have acted on it"),
            ):
                graph = hfg.Graph()
                client = graph.add(buses.HttpClient(url=f"http://127.0.0.1:{port}", longest_pause_s=0.1))
                sent(graph, client.message, [message])
                seen = graph.add(Seen())
                graph.connect(client.response, seen.value)
                if message.method == "GET":
                    report = await hfg.run_async(graph)
                    assert seen.seen[0].body == outcome.encode()
                    assert report.nodes["http_client"].own["said again"] == 2
                    asked.clear()
                else:
                    with pytest.raises(RunError, match=outcome):
                        await hfg.run_async(graph)
                    assert asked == [b"POST"]

    play(scene())


@pytest.mark.rule("L5")
def test_a_client_takes_its_secret_to_no_other_server() -> None:
    graph = hfg.Graph()
    client = graph.add(buses.HttpClient(url="http://127.0.0.1:9"))
    sent(graph, client.message, ["http://evil.example/"])
    with pytest.raises(RunError, match="is on another server"):
        hfg.run(graph)


def test_routes_have_to_fit_the_events() -> None:
    graph = hfg.Graph()
    graph.add(buses.HttpServer(routes=["GET /a", "GET /b"]))
    with pytest.raises((RunError, UsageError), match="2 routes and 1 events: make the node with asked=2"):
        hfg.run(graph)


def test_messages_for_clients_that_have_gone_are_counted() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        server = graph.add(buses.WebSocketServer())
        sent(graph, server.message, [Message("hello", "17")])
        report = await hfg.run_async(graph)
        assert report.nodes["web_socket_server"].own["no such client"] == 1

    play(scene())
