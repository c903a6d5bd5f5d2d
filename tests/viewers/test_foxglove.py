"""A client of Foxglove's protocol looks at a run over a WebSocket; whoever may not is refused, and the run goes on."""

from __future__ import annotations

import asyncio
import base64
import json
import logging
import random
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from types import SimpleNamespace
from typing import Any

import jsonschema
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

import hfg
from hfg.cli import main
from hfg.cli.viewing import Viewing
from hfg.errors import TargetError
from hfg.viewers import foxglove
from tests.limits import patience
from tests.viewers.robots import PICTURE, POINTS, robot

pytestmark = pytest.mark.slow
APP = "https://app.foxglove.dev"


class Running:
    """The robot, running in a thread, with its server."""

    def __init__(self, rate_hz: float = 30.0) -> None:
        self._is_there = threading.Event()
        self.report: hfg.Report | None = None
        self._rate_hz = rate_hz
        self._thread = threading.Thread(target=self._live)
        self._thread.start()
        assert self._is_there.wait(patience(10))

    def _live(self) -> None:
        def begin(run: hfg.Run) -> None:
            self.run, self.loop = run, asyncio.get_running_loop()
            self.page = run.foxglove(origins=["https://viewer.example"])
            self._is_there.set()

        self.report = asyncio.run(hfg.run_async(robot(self._rate_hz), begin=begin))

    @property
    def address(self) -> str:
        return str(self.page.address)

    def stop(self) -> None:
        self.loop.call_soon_threadsafe(self.run.stop)
        self._thread.join(patience(10))
        self.page.join()


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    made = Running()
    yield made
    made.stop()
    assert made.report is not None  # after all that was done to it
    assert made.report.outcome == "stopped"


def come_in(address: str, **how: Any) -> ClientConnection:
    how = {"subprotocols": ["foxglove.sdk.v1"], "max_size": None, "close_timeout": 0.2, **how}
    made: ClientConnection = connect(address, **how).__enter__()
    return made


class Client:
    """What Foxglove does, from its specification: subscribe to all that is advertised, and read."""

    def __init__(self, address: str, **how: Any) -> None:
        self.socket = come_in(address, **how)
        self.info = json.loads(self.socket.recv(timeout=patience(5)))
        self.channels = {one["id"]: one for one in json.loads(self.socket.recv(timeout=patience(5)))["channels"]}

    def subscribe(self, *topics: str) -> None:
        wanted = [number for number, one in self.channels.items() if one["topic"] in topics]
        subscriptions = [{"id": 70 + number, "channelId": number} for number in wanted]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    def messages(self) -> Iterator[tuple[dict[str, Any], int, dict[str, Any]]]:
        """Yield channel, time and message."""
        while True:
            data = self.socket.recv(timeout=patience(10))
            if isinstance(data, bytes) and data[0] == 1:
                _, number, ns = struct.unpack_from("<BIQ", data)
                yield self.channels[number - 70], ns, json.loads(data[13:])


@pytest.mark.rule("R7")
@pytest.mark.parametrize("subprotocol", ["foxglove.sdk.v1", "foxglove.websocket.v1"])
def test_a_client_gets_channels_schemas_and_messages_that_it_can_read(running: Running, subprotocol: str) -> None:
    client = Client(running.address, subprotocols=[subprotocol], origin=APP)
    with closing(client.socket):
        assert client.socket.subprotocol == subprotocol
        assert client.info["op"] == "serverInfo"
        assert client.info["capabilities"] == []  # nothing can be changed
        wanted = {
            "camera.out": "foxglove.RawImage",
            "laser.out": "foxglove.LaserScan",
            "lidar.out": "foxglove.PointCloud",
            "tree.out": "foxglove.FrameTransforms",
            "half.out": "hfg.float",
            "hfg/activity": "hfg.activity",
        }
        known = {one["topic"]: one["schemaName"] for one in client.channels.values()}
        assert wanted.items() <= known.items()
        assert known["hfg/log"] == "foxglove.Log"
        client.subscribe(*wanted, "hfg/log")
        seen: dict[str, dict[str, Any]] = {}
        for channel, ns, message in client.messages():
            assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
            jsonschema.validate(message, json.loads(channel["schema"]))
            assert abs(ns / 1e9 - running.run.now()) < patience(20)
            seen[channel["topic"]] = message
            if wanted.keys() <= seen.keys():
                break
        running.loop.call_soon_threadsafe(logging.getLogger("hfg.robot").warning, "a wheel is loose")
        line = next(message for channel, _, message in client.messages() if channel["topic"] == "hfg/log")
        assert line["message"] == "a wheel is loose"
    camera = seen["camera.out"]
    assert (camera["width"], camera["height"], camera["encoding"], camera["step"]) == (640, 480, "bgr8", 1920)
    assert base64.b64decode(camera["data"]) == PICTURE.tobytes()
    cloud = np.frombuffer(base64.b64decode(seen["lidar.out"]["data"]), np.float32).reshape(-1, 3)
    assert np.array_equal(cloud, POINTS)
    assert seen["laser.out"]["ranges"] == [1.0, 0.0, 2.0]
    [link] = seen["tree.out"]["transforms"]
    assert (link["parent_frame_id"], link["child_frame_id"]) == ("map", "base")
    assert seen["hfg/activity"]["active"] == ["drive"]
    assert seen["half.out"]["value"] > 0


@pytest.mark.rule("L5")
def test_who_may_not_look_is_refused_before_anything_is_said(running: Running, caplog: Any) -> None:
    address = running.address
    bare, _, token = address.partition("?token=")
    for url, how, status, says in (
        (bare, {}, 401, "token"),
        (f"{bare}?token=", {}, 401, "token"),
        (f"{bare}?token={token[:-1]}", {}, 401, "token"),
        (f"{bare}?token=\u00fc", {}, 401, "token"),
        (bare, {"origin": APP}, 401, "token"),
        (address, {"origin": "http://evil.example"}, 403, "origin"),
        (address, {"origin": "https://app.foxglove.dev.evil.example"}, 403, "origin"),
        (address, {"origin": "null"}, 403, "origin"),
        (address, {"subprotocols": ["chat"]}, 400, "foxglove.sdk.v1"),
        (address, {"subprotocols": None}, 400, "foxglove.sdk.v1"),
    ):
        with pytest.raises(InvalidStatus) as refused:
            come_in(url, **how)
        assert refused.value.response.status_code == status, (url, how)
        assert says in refused.value.response.body.decode()
    assert "'http://evil.example' has the address" in caplog.text
    assert token not in caplog.text
    for origin in (APP, "file://", "https://viewer.example", None):
        come_in(address, origin=origin).close()


@pytest.mark.rule("L5")
def test_another_name_for_the_server_and_a_browser_are_told_what_to_do(running: Running) -> None:
    host, port = running.address.partition("//")[2].partition("/")[0].split(":")
    token = running.address.partition("?")[2]
    upgrade = (
        "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"
    )
    for name, more, says in (("rebound.example", upgrade, b" 421 "), (host, "Connection: close\r\n", b" 426 ")):
        with socket.create_connection((host, int(port)), timeout=patience(5)) as made:
            made.sendall(f"GET /?{token} HTTP/1.1\r\nHost: {name}:{port}\r\n{more}\r\n".encode())
            assert says in made.recv(1000)


def test_malformed_oversized_and_many_frames_end_that_viewer_only(running: Running) -> None:
    chance = random.Random(7)
    good = b'{"op":"subscribe","subscriptions":[{"id":3,"channelId":4}]}'

    def reason(*frames: str | bytes) -> tuple[int, str]:
        with closing(come_in(running.address)) as made, suppress(ConnectionClosed):
            for frame in frames:
                made.send(frame)
            while True:
                made.recv(timeout=patience(10))
        assert made.close_code is not None
        return made.close_code, made.close_reason or ""

    code, said = reason("{}")
    assert code == 1008
    assert "not a message of Foxglove" in said
    assert reason(b"\x01binary")[0] == 1008  # as a client that publishes
    assert reason("x" * (1 << 20) + "y")[0] == 1009
    with closing(come_in(running.address)) as flooding:
        for _ in range(450):
            flooding.send('{"op": "getParameters"}')
        flooding.send(good.decode())
        while not isinstance(flooding.recv(timeout=patience(10)), bytes):
            pass  # it is read more slowly, and then it is served
    for _ in range(60):  # bytes that are no frames of a WebSocket
        with closing(come_in(running.address)) as made:
            raw = bytearray(struct.pack(">BB", 0x81, 0x80 | len(good)) + bytes(4) + good)
            for _ in range(chance.randrange(1, 6)):
                raw[chance.randrange(len(raw))] = chance.randrange(256)
            with suppress(OSError):
                made.socket.sendall(raw)
    client = Client(running.address)
    with closing(client.socket):
        client.subscribe("number.out")
        assert next(client.messages())[2]["value"] > 0


@pytest.mark.rule("R7")
def test_a_viewer_that_stops_reading_is_dropped_and_the_graph_has_not_waited(
    monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    monkeypatch.setattr(foxglove, "_PATIENCE_S", 0.2)
    running = Running(rate_hz=200.0)
    stuck = Client(running.address, max_queue=1)  # reads what it asks for, and no more
    stuck.subscribe("camera.out")
    reading = Client(running.address)
    reading.subscribe("number.out", "hfg/log")
    numbers = []
    for channel, _, message in reading.messages():
        if channel["topic"] == "hfg/log":
            assert "has read nothing for 0.2 s and was sent away" in message["message"]
            break
        numbers.append(message["sequence"])
    running.stop()
    assert "has read nothing" in caplog.text
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))  # the other one has missed nothing
    camera = next(one for one in running.page._server._looking.channels.values() if one.topic == "camera.out")
    assert camera.made < camera.passed
    assert running.report is not None
    for one in (stuck, reading):
        one.socket.close()


@pytest.mark.rule("L5")
def test_the_command_line_serves_viewers_and_refuses_what_makes_no_sense(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    target = "tests.viewers.robots:robot"
    seen: list[Any] = []

    def look(self: Any, _run: Any) -> None:
        begin(self, _run)
        client = Client(self._page.address)
        client.subscribe("hfg/events")
        client.socket.send('{"op": "getParameters"}')
        client.socket.recv(timeout=patience(5))  # the answer: the subscription before it has arrived
        seen.append(client)

    begin = Viewing.begin
    monkeypatch.setattr(Viewing, "begin", look)
    assert main(["run", target, "--clock", "virtual", "--until", "0.1", "--foxglove", "--no-table"]) == 0
    said = capsys.readouterr().err
    assert "Foxglove WebSocket, ws://127.0.0.1:87" in said
    [client] = seen
    assert client.info["capabilities"] == ["time"]
    found = []
    with closing(client.socket), suppress(ConnectionClosed):
        while True:
            found.append(client.socket.recv(timeout=patience(5)))
    assert any(one[0] == 2 for one in found if isinstance(one, bytes))  # the clock of the run, which is not ours
    assert client.socket.close_reason == "the run is over"
    for arguments, says in (
        (["--foxglove-at", "0.0.0.0:8765"], "on this machine only"),
        (["--foxglove-at", "8765x"], "takes ADDRESS:PORT"),
        (["--foxglove-origin", "https://x.example"], "--foxglove is missing"),
    ):
        monkeypatch.setattr(Viewing, "begin", begin)
        assert main(["run", target, "--until", "0", "--no-table", *arguments]) == 2
        assert says in capsys.readouterr().err


def test_only_loopback_addresses_are_served() -> None:
    with pytest.raises(TargetError, match="ssh -L"):
        foxglove.serve_run(SimpleNamespace(), host="192.168.0.7")  # type: ignore[arg-type]
