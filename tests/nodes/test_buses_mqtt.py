"""MQTT with a real broker, mosquitto of Debian, that is started here, stopped and refuses; skipped without it."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

import hfg
from hfg.errors import RunError
from hfg.nodes import buses
from hfg.nodes.buses import Message
from tests.nodes.buses_outside import Seen, heard, sent, served, texts
from tests.nodes.test_buses_streams import free_port, play

MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(MOSQUITTO is None, reason="needs the Debian package mosquitto"),
]


class Mosquitto:
    """A broker of the test's own, which keeps its sessions in a folder."""

    def __init__(self, folder: Path, *lines: str) -> None:
        self.port = free_port()
        self.url = f"mqtt://127.0.0.1:{self.port}"
        self._settings = folder / "mosquitto.conf"
        keep = (
            "persistence true",
            f"persistence_location {folder}/",
            "autosave_interval 1",
            "autosave_on_changes true",
        )
        who = ("user root",) if os.geteuid() == 0 else ()
        listen = (f"listener {self.port} 127.0.0.1", "max_queued_messages 0", *(lines or ("allow_anonymous true",)))
        self._settings.write_text("\n".join((*listen, *keep, *who)) + "\n")
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        assert MOSQUITTO is not None
        self._process = subprocess.Popen(
            [MOSQUITTO, "-c", self._settings], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def stop(self, how: int = signal.SIGTERM) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait()
            self._process = None


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    made = Mosquitto(tmp_path)
    made.start()
    yield made
    made.stop()


def watched(graph: hfg.Graph, broker: Mosquitto, qos: int) -> tuple[buses.MqttSubscribe, Seen, Seen]:
    subscribe = graph.add(
        buses.MqttSubscribe(broker=broker.url, topic="hfg/#", qos=qos, longest_pause_s=0.2, session_s=3600)
    )
    seen, connected = heard(graph, subscribe.received, subscribe.connected)
    return subscribe, seen, connected


async def exchange(
    broker: Mosquitto, *, count: int, kills: int, qos: int, how: int = signal.SIGTERM
) -> tuple[set[str], hfg.Report]:
    """Publish through a broker that is stopped and started again so often; return what was heard."""
    hearing, saying = hfg.Graph("hearing"), hfg.Graph("saying")
    _, seen, subscribed = watched(hearing, broker, qos)
    publish = saying.add(buses.MqttPublish(broker=broker.url, topic="hfg/numbers", qos=qos, longest_pause_s=0.2))
    lost, _ = heard(saying, publish.disconnected, publish.connected)
    async with hfg.running(hearing) as run:
        await subscribed.until(bool)
        saying.connect(saying.add(texts(to=count)).out, publish.message)
        said = asyncio.create_task(hfg.run_async(saying))
        for number in range(kills):
            await seen.until(lambda seen, least=(number + 1) * count // (kills + 1): len(seen) >= least)  # type: ignore[misc]
            await asyncio.to_thread(broker.stop, how)
            await lost.until(lambda lost, least=number + 1: len(lost) >= least)  # type: ignore[misc]
            broker.start()
        report = await said
        if qos:
            await seen.until(lambda seen: len({one.value for one in seen}) == count)
        assert run.report().nodes["mqtt_subscribe"].own["connections"] == kills + 1
    return {one.value for one in seen.seen}, report


def test_with_qos_1_nothing_is_lost_when_the_broker_is_stopped_and_started_again(broker: Mosquitto) -> None:
    found, report = play(exchange(broker, count=200, kills=1, qos=1))
    assert found >= {str(number) for number in range(200)}
    own = report.nodes["mqtt_publish"].own
    assert own["sent"] == 200
    assert own["lost connections"] == 1


def test_with_qos_0_what_was_lost_is_what_was_sent_and_not_heard(broker: Mosquitto) -> None:
    found, report = play(exchange(broker, count=200, kills=0, qos=0))
    assert report.nodes["mqtt_publish"].own["sent"] == 200
    assert found - {"now"} <= {str(number) for number in range(200)}


def test_topics_go_with_the_messages(broker: Mosquitto) -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        _, seen, subscribed = watched(graph, broker, 1)
        saying = hfg.Graph("saying")
        publish = saying.add(buses.MqttPublish(broker=broker.url, topic="hfg/rest", form="json", retain=True))
        sent(saying, publish.message, [Message({"speed": 1}, "hfg/left"), [2]])
        async with hfg.running(graph):
            await subscribed.until(bool)
            await hfg.run_async(saying)
            await seen.until(lambda seen: len(seen) >= 2)
        assert [(one.address, one.value) for one in seen.seen] == [("hfg/left", '{"speed":1}'), ("hfg/rest", "[2]")]

    play(scene())


@pytest.mark.rule("F8")
def test_a_slow_graph_stops_reading_and_the_broker_keeps_what_is_to_come(broker: Mosquitto) -> None:
    async def scene() -> None:
        graph = hfg.Graph()
        subscribe, seen, subscribed = watched(graph, broker, 1)
        graph.connect(subscribe.received, graph.add(Seen(pause_s=0.005)).value, capacity=1)
        saying = hfg.Graph("saying")
        publish = saying.add(buses.MqttPublish(broker=broker.url, topic="hfg/numbers"), concurrency=8)
        saying.connect(saying.add(texts(to=200)).out, publish.message)
        async with hfg.running(graph):
            await subscribed.until(bool)
            report = await hfg.run_async(saying)
            assert report.nodes["mqtt_publish"].own["sent"] == 200
            assert len(seen.seen) < 150
            assert subscribe._inbox.qsize() <= 2 * 32
            await seen.until(lambda seen: any(one.value == "199" for one in seen))
        assert [one.value for one in seen.seen] == [str(number) for number in range(200)]

    play(scene())


# --- bad brokers ---


@pytest.mark.rule("L5")
def test_a_wrong_password_is_one_sentence_and_the_activity_goes_where_the_graph_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "users").touch()
    broker = Mosquitto(tmp_path, "allow_anonymous false", f"password_file {tmp_path}/users")
    broker.start()
    monkeypatch.setenv("BROKER", "hunter2")
    graph = hfg.Graph()
    subscribe = graph.add(
        buses.MqttSubscribe(broker=broker.url, user="robot", secret="env:BROKER", timeout_s=5.0), on_error="skip"
    )
    fallback = graph.add(Seen())
    graph.start.activates(subscribe.activate)
    graph.connect(subscribe.failed, fallback.value, active=True)
    try:
        report = hfg.run(graph)
    finally:
        broker.stop()
    assert report.nodes["seen"].active
    assert "hunter2" not in str(report)
    (error,) = report.errors
    assert f"{broker.url}: the broker refuses us: Not authorized; look at the parameters user and secret" in error


def test_no_broker_and_one_that_speaks_something_else_are_sentences(tmp_path: Path) -> None:
    async def garbage(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"\xff" * 100)

    async def scene() -> None:
        graph = hfg.Graph()
        graph.add(buses.MqttPublish(broker=f"mqtt://127.0.0.1:{free_port()}", attempts=2))
        with pytest.raises(RunError, match=r"mqtt://127.0.0.1:\d+: nothing listens there.*\(2 attempts\)"):
            await hfg.run_async(graph)
        async with served(garbage) as port:
            graph = hfg.Graph()
            graph.add(buses.MqttPublish(broker=f"mqtt://127.0.0.1:{port}", attempts=1, timeout_s=0.5))
            with pytest.raises(RunError, match=rf"mqtt://127.0.0.1:{port}: .*\(1 attempts\)"):
                await hfg.run_async(graph)

    play(scene())


@pytest.mark.rule("L5")
def test_a_password_is_not_sent_unencrypted_to_another_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BROKER", "hunter2")
    graph = hfg.Graph()
    graph.add(buses.MqttPublish(broker="mqtt://broker.example", secret="env:BROKER", user="robot"))
    with pytest.raises(RunError, match='the password would be sent unencrypted; write "mqtts://"'):
        hfg.run(graph)
