"""Ten thousand messages through servers that are killed twenty times, a gateway of 200 clients, and flat memory."""

from __future__ import annotations

import asyncio
import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.server import serve

import hfg
from hfg.nodes import buses
from tests.nodes.buses_outside import heard, port_of, served, texts
from tests.nodes.test_buses_mqtt import MOSQUITTO, Mosquitto, exchange
from tests.nodes.test_buses_streams import free_port

pytestmark = [pytest.mark.soak, pytest.mark.timeout(3000)]
COUNT, KILLS = 10_000, 20


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    if MOSQUITTO is None:
        pytest.skip("needs the Debian package mosquitto")
    made = Mosquitto(tmp_path)
    made.start()
    yield made
    made.stop()


def test_mqtt_with_qos_1_loses_nothing_through_twenty_stops_of_the_broker(broker: Mosquitto) -> None:
    found, report = asyncio.run(exchange(broker, count=COUNT, kills=KILLS, qos=1))
    print(report.nodes["mqtt_publish"].own)
    assert found >= {str(number) for number in range(COUNT)}
    assert report.nodes["mqtt_publish"].own["sent"] == COUNT


@pytest.mark.parametrize("kind", ["tcp", "websocket"])
def test_a_client_counts_what_it_says_and_hears_through_twenty_deaths_of_its_server(kind: str) -> None:
    """What is missing was accepted by the system and died with a connection: the server never had it."""

    async def scene() -> None:
        port, got = free_port(), set[str]()

        async def lines(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                got.add(line.decode().strip())

        async def messages(socket: Any) -> None:
            async for message in socket:
                got.add(message)

        graph = hfg.Graph()
        if kind == "tcp":
            client: Any = graph.add(buses.TcpClient(port=port, longest_pause_s=0.1))
        else:
            client = graph.add(buses.WebSocketClient(url=f"ws://127.0.0.1:{port}", longest_pause_s=0.1))
        graph.connect(graph.add(texts(to=COUNT), max_rate_hz=1000).out, client.message)
        lost, _ = heard(graph, client.disconnected, client.connected)
        async with hfg.running(graph) as run:
            for number in range(1, KILLS + 2):
                server = served(lines, port) if kind == "tcp" else serve(messages, "127.0.0.1", port)
                async with server as running:
                    while (own := run.report().nodes[client.place.path].own).get("sent", 0) < number * COUNT // (
                        KILLS + 1
                    ):
                        await asyncio.sleep(0.01)
                    if number > KILLS:  # the last one lives until it has heard all
                        await asyncio.sleep(1)
                    for one in getattr(running, "connections", ()):
                        one.transport.abort()
        missing = COUNT - len(got)
        print(kind, own, "missing", missing, "sentences", len(lost.seen))
        assert own["sent"] == COUNT
        assert own["lost connections"] >= KILLS
        assert 0 <= missing < COUNT // 20

    asyncio.run(scene())


@pytest.mark.parametrize("kind", [buses.TcpServer, buses.WebSocketServer])
def test_a_gateway_serves_200_clients(kind: Any) -> None:
    async def scene() -> None:
        from websockets.asyncio.client import connect

        graph = hfg.Graph()
        server = graph.add(kind())
        graph.connect(server.received, server.message)
        (places,) = heard(graph, server.connected)

        async def talk(port: int, name: int) -> int:
            if kind is buses.WebSocketServer:
                async with connect(f"ws://127.0.0.1:{port}") as socket:
                    for number in range(50):
                        await socket.send(f"{name} {number}")
                        assert await socket.recv() == f"{name} {number}"
                return 50
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            for number in range(50):
                writer.write(b"%d %d\n" % (name, number))
                assert await reader.readline() == b"%d %d\n" % (name, number)
            writer.close()
            return 50

        async with hfg.running(graph) as run:
            port = await port_of(places)
            assert sum(await asyncio.gather(*(talk(port, name) for name in range(200)))) == COUNT
            own = run.report().nodes[server.place.path].own
            print(own)
            assert (own["clients"], own["received"], own["sent"]) == (200, COUNT, COUNT)

    asyncio.run(scene())


def test_memory_stays_flat_while_a_connection_carries_messages_and_is_made_again() -> None:
    """Two minutes at full speed; the connection is broken off twice a second."""

    async def scene() -> None:
        port = free_port()

        async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                writer.write(line)
                await writer.drain()

        graph = hfg.Graph()
        client = graph.add(buses.TcpClient(port=port, longest_pause_s=0.1))
        graph.connect(graph.add(texts(to=10**9)).out, client.message)
        sizes: list[int] = []
        async with hfg.running(graph) as run:
            for _ in range(24):
                for _ in range(10):
                    async with served(echo, port):
                        await asyncio.sleep(0.5)
                gc.collect()
                sizes.append(_resident_kb())
            own = run.report().nodes["tcp_client"].own
        print(own, sizes)
        assert max(sizes[4:]) < sizes[4] * 1.05

    asyncio.run(scene())


def _resident_kb() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024
