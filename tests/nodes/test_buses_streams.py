"""Streams and datagrams with real ends on this computer: TCP, UDP, a pseudo terminal for a serial line, programs."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import ssl
import tty
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import RunError
from hfg.nodes import buses
from hfg.nodes.buses import Message
from tests.nodes.buses_outside import Seen, certified, heard, port_of, sent, served, texts

pytestmark = pytest.mark.slow


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def play(scene: Any) -> Any:
    async def limited() -> Any:
        async with asyncio.timeout(40):
            return await scene

    return asyncio.run(limited())


def are(count: int, seen: list[Any]) -> bool:
    return len(seen) >= count


async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while line := await reader.readline():
        writer.write(line)
        await writer.drain()


# --- TCP ---


def test_a_client_says_lines_and_hears_the_answers_and_ends_with_its_input() -> None:
    async def scene() -> None:
        async with served(echo) as port:
            graph = hfg.Graph()
            client = graph.add(buses.TcpClient(port=port))
            graph.connect(graph.add(texts(to=300)).out, client.message)
            (seen,) = heard(graph, client.received)
            report = await hfg.run_async(graph)
            assert seen.seen == [str(number) for number in range(300)]
            assert report.nodes["tcp_client"].own == {"connections": 1, "sent": 300, "received": 300}

    play(scene())


def test_a_client_survives_the_death_of_its_server_and_what_it_hears_is_counted() -> None:
    """One kill of the many in `tests/soak`: each message was heard, or the server knows that it did not get there."""

    async def scene() -> None:
        port, got = free_port(), set[str]()
        graph = hfg.Graph()
        client = graph.add(buses.TcpClient(port=port, longest_pause_s=0.2))
        graph.connect(graph.add(texts(to=300), max_rate_hz=500).out, client.message)
        seen, lost = heard(graph, client.received, client.disconnected)

        async def hear(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                got.add(line.decode().strip())
                writer.write(line)

        async with hfg.running(graph) as run:
            async with served(hear, port):
                await seen.until(lambda seen: len(seen) >= 100)
            await lost.until(bool)
            async with served(hear, port):
                await seen.until(lambda seen: "299" in seen)
            own = run.report().nodes["tcp_client"].own
        assert own["connections"] == 2
        assert own["lost connections"] >= 1
        assert own["sent"] == 300
        assert own["received"] == len(seen.seen) <= len(got) <= 300

    play(scene())


def test_a_gateway_answers_each_client_and_tells_who_comes_and_goes() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        server = graph.add(buses.TcpServer(linger_s=0.0))
        graph.connect(server.received, server.message)
        places, joined, left = heard(graph, server.connected, server.joined, server.left)

        async def talk(port: int, number: int) -> bytes:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"client %d\n" % number)
            line = await reader.readline()
            writer.close()
            return line

        async with hfg.running(graph) as run:
            port = await port_of(places)
            answers = await asyncio.gather(*(talk(port, number) for number in range(20)))
            assert answers == [b"client %d\n" % number for number in range(20)]
            await left.until(lambda left: len(left) == 20)
            assert sorted(joined.seen) == sorted(left.seen)
            assert run.report().nodes["tcp_server"].own == {"connections": 1, "clients": 20, "received": 20, "sent": 20}

    play(scene())


def test_a_client_that_takes_nothing_is_broken_off_and_the_others_go_on() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        server = graph.add(buses.TcpServer(timeout_s=0.3, framing="bytes", form="bytes", most_bytes=2**24))
        places, joined = heard(graph, server.connected, server.joined)
        feed_in = graph.input("out", bytes)
        graph.connect(feed_in, server.message)
        async with hfg.running(graph) as run, run.feed(feed_in) as feed:
            port = await port_of(places)
            _, stuck = await asyncio.open_connection("127.0.0.1", port, limit=1)
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            await joined.until(lambda joined: len(joined) == 2)
            stuck.transport.pause_reading()  # type: ignore[attr-defined]
            hearing = asyncio.create_task(reader.readexactly(2**24))
            await feed.send(bytes(2**24))
            assert len(await hearing) == 2**24
            assert run.report().nodes["tcp_server"].own["too slow"] == 1
            writer.close()
            stuck.transport.abort()

    play(scene())


def test_a_line_that_is_too_long_and_garbage_are_skipped_and_told() -> None:
    async def chatter(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"x" * 5000 + b"\n\xff\xfe\ngood\n")

    async def scene() -> None:
        async with served(chatter) as port:
            graph = hfg.Graph()
            client = graph.add(buses.TcpClient(port=port, most_bytes=100, at_end="end"))
            received, invalid = heard(graph, client.received, client.invalid)
            report = await hfg.run_async(graph)
            assert received.seen == ["good"]
            assert len(invalid.seen) == 2
            assert report.nodes["tcp_client"].own["invalid"] == 2

    play(scene())


def test_no_server_and_a_port_in_use_are_sentences_with_the_address() -> None:
    port = free_port()
    graph = hfg.Graph()
    graph.add(buses.TcpClient(port=port, attempts=2))
    with pytest.raises(RunError, match=rf"tcp://127.0.0.1:{port}: nothing listens there.*\(2 attempts\)"):
        hfg.run(graph)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        graph = hfg.Graph()
        graph.add(buses.TcpServer(port=port, attempts=1))
        with pytest.raises(RunError, match=rf"tcp://127.0.0.1:{port}: the port is in use; stop the program"):
            hfg.run(graph)


@pytest.mark.rule("L5")
def test_a_server_does_not_serve_other_computers_unencrypted_unless_that_is_written_out() -> None:
    graph = hfg.Graph()
    graph.add(buses.TcpServer(host="0.0.0.0"))
    with pytest.raises(RunError, match="other computers would be served without encryption: set .* insecure=True"):
        hfg.run(graph)


def test_tls_holds_and_an_expired_certificate_is_refused_at_once(tmp_path: Path) -> None:
    async def scene(name: str, days: int) -> Any:
        certificate, key = certified(tmp_path / name, days)
        tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        tls.load_cert_chain(certificate, key)
        async with served(echo, ssl=tls) as port:
            graph = hfg.Graph()
            client = graph.add(buses.TcpClient(port=port, tls=True, ca_file=str(certificate)))
            sent(graph, client.message, ["hello"])
            (seen,) = heard(graph, client.received)
            graph.connect(seen.processed, graph.stop)
            await hfg.run_async(graph)
            return seen.seen

    assert play(scene("good", 1)) == ["hello"]
    with pytest.raises(RunError, match="tls://127.0.0.1:.*its certificate is not accepted: certificate has expired"):
        play(scene("expired", -1))


# --- UDP ---


def test_datagrams_go_there_and_back_with_their_addresses() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        answers, asks = graph.add(buses.Udp(), name="answers"), graph.add(buses.Udp(), name="asks")
        graph.connect(answers.received, answers.message)
        places, seen = heard(graph, answers.connected, asks.received)
        feed_in = graph.input("out", Message)
        graph.connect(feed_in, asks.message)
        async with hfg.running(graph) as run, run.feed(feed_in) as feed:
            port = await port_of(places)
            for number in range(50):
                await feed.send(Message(str(number), f"127.0.0.1:{port}"))
            await seen.until(lambda seen: len(seen) == 50)
            assert [one.value for one in seen.seen] == [str(number) for number in range(50)]
            assert {one.address for one in seen.seen} == {f"127.0.0.1:{port}"}

    play(scene())


def test_datagrams_that_a_slow_graph_has_no_room_for_are_counted() -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        hears = graph.add(buses.Udp(form="bytes"))
        slow = graph.add(Seen())
        graph.connect(hears.received, slow.value)
        (places,) = heard(graph, hears.connected)
        async with hfg.running(graph) as run:
            port = await port_of(places)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood:  # the loop does not turn meanwhile
                for _ in range(2000):
                    flood.sendto(bytes(1000), ("127.0.0.1", port))
                await slow.until(bool)
                await asyncio.sleep(0)
                flood.sendto(b"last", ("127.0.0.1", port))
            await slow.until(lambda seen: bool(seen) and seen[-1].value == b"last")
            own = run.report().nodes["udp"].own
            assert own["overflowed"] > 0
            assert own["received"] + own["overflowed"] == 2001

    play(scene())


# --- a serial line ---


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    try:
        yield ours, os.ttyname(theirs)
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_serial_line_is_spoken_with(terminal: tuple[int, str]) -> None:
    async def scene() -> None:
        ours, name = terminal
        graph = hfg.Graph()
        line = graph.add(buses.SerialLine(device=name, baud=9600))
        sent(graph, line.message, ["hello"])
        (seen,) = heard(graph, line.received)
        async with hfg.running(graph):
            said = await asyncio.to_thread(os.read, ours, 100)
            assert said == b"hello\n"
            os.write(ours, b"temperature 21\r\nhumid")
            os.write(ours, b"ity 40\r\n")
            await seen.until(lambda seen: len(seen) == 2)
            assert seen.seen == ["temperature 21", "humidity 40"]

    play(scene())


def test_a_device_that_is_pulled_out_is_waited_for(tmp_path: Path) -> None:
    async def scene() -> None:
        place = tmp_path / "device"
        ends = [pty.openpty() for _ in range(2)]
        for _, theirs in ends:
            tty.setraw(theirs)
        graph = hfg.Graph()
        line = graph.add(buses.SerialLine(device=str(place), longest_pause_s=0.1))
        seen, lost, opened = heard(graph, line.received, line.disconnected, line.connected)
        async with hfg.running(graph) as run:
            await lost.until(bool)
            for number, (ours, theirs) in enumerate(ends):
                place.symlink_to(os.ttyname(theirs))
                await opened.until(partial(are, number + 1))
                os.close(theirs)
                os.write(ours, b"%d\n" % number)
                await seen.until(partial(are, number + 1))
                place.unlink()
                os.close(ours)
                await lost.until(partial(are, number + 2))
            assert run.report().nodes["serial_line"].own["connections"] == 2
        assert "there is no such file or device" in lost.seen[0]

    play(scene())


# --- programs ---


def test_a_program_is_spoken_with_and_its_exit_is_an_event() -> None:
    graph = hfg.Graph()
    program = graph.add(buses.Subprocess(command=["sed", "-u", "s/^/said /"]))
    graph.connect(graph.add(texts(to=100)).out, program.message)
    received, exited = heard(graph, program.received, program.exited)
    report = hfg.run(graph)
    assert received.seen == [f"said {number}" for number in range(100)]
    assert exited.seen == [0]
    assert report.nodes["subprocess"].own["sent"] == 100


def test_a_program_that_fails_is_started_again_until_there_were_enough_attempts() -> None:
    graph = hfg.Graph()
    program = graph.add(buses.Subprocess(command=["sh", "-c", "echo x; exit 3"], at_exit="failure", attempts=2))
    received, exited = heard(graph, program.received, program.exited)
    with pytest.raises(RunError, match=r'program "sh": it has exited with code 3 \(2 attempts\)'):
        hfg.run(graph)
    assert received.seen == ["x", "x"]
    assert exited.seen[0] == 3


@pytest.mark.rule("A15")
def test_a_program_ends_with_the_activity_and_those_that_it_has_started_too(tmp_path: Path) -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        program = graph.add(buses.Subprocess(command=["sh", "-c", "sleep 1000 & echo $!; wait"]))
        graph.start.activates(program.activate)
        (seen,) = heard(graph, program.received)
        async with hfg.running(graph) as run:
            child = int((await seen.until(bool))[0])
            await run.trigger(program.deactivate)
            while Path(f"/proc/{child}/stat").exists() and " Z " not in Path(f"/proc/{child}/stat").read_text():
                await asyncio.sleep(0.01)
            assert not run.active()

    play(scene())


def test_a_program_that_is_not_there_is_a_sentence() -> None:
    graph = hfg.Graph()
    graph.add(buses.Subprocess(command=["/no/such/program"], attempts=1))
    with pytest.raises(RunError, match='program "/no/such/program": there is no such file or device'):
        hfg.run(graph)
