"""Images of 640 x 480 at 30 Hz on a topic of ROS 2, by hfg's node and by other programs: `make bench-ros`.

Measured: the processor time of the publishing process for one image, all threads together, without start and the first
tenth. Every program publishes the same array as sensor_msgs/msg/Image through a Zenoh router in a process of its own,
which has a subscription. Not measured: the router and the subscriber. Packages that are not installed are named.
"""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.goals import Goal, Side
from benchmarks.measure import Case

DISTRIBUTIONS = ("hfg", "eclipse-zenoh", "pyzeros", "zenoh-ros2-sdk")
SHOWS_CASES = True
RATE_HZ = 30
IMAGE = np.arange(480 * 640 * 3, dtype=np.uint8).reshape(480, 640, 3)
KIND = "sensor_msgs/msg/Image"

_ROUTER = """
import json, sys, zenoh
config = zenoh.Config()
said = {"mode": "router", "scouting/multicast/enabled": False, "listen/endpoints": [sys.argv[1]]}
for key, value in said.items():
    config.insert_json5(key, json.dumps(value))
with zenoh.open(config) as session:
    session.declare_subscriber("0/**", lambda sample: None)
    print("ready", flush=True)
    sys.stdin.read()
"""


@contextmanager
def router() -> Iterator[str]:
    """Run a router with a subscription, and yield its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    command = [sys.executable, "-c", _ROUTER, address]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield address
        process.kill()


class Meter:
    """Processor time from the end of the first tenth on."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._skipped = count // 10
        self._began = time.process_time()

    def passed(self, number: int) -> None:
        """Note that so many images were published."""
        if number == self._skipped:
            self._began = time.process_time()

    def us(self) -> dict[str, float]:
        """Return the microseconds for one image."""
        return {"us": (time.process_time() - self._began) / max(1, self.count - self._skipped) * 1e6}


def hfg_node(count: int) -> dict[str, float]:
    """A source and `RosPublish`."""
    import hfg
    from hfg.nodes.ros import RosPublish

    meter = Meter(count)

    @hfg.node
    async def camera() -> AsyncIterator[Any]:
        for number in range(count):
            yield IMAGE
            meter.passed(number + 1)

    with router() as address:
        graph = hfg.Graph("camera")
        publish = graph.add(RosPublish(topic="/image", type=KIND, router=address))
        graph.connect(graph.add(camera(), max_rate_hz=RATE_HZ).out, publish.value)
        hfg.run(graph)
        assert publish.statistics()["sent"] == count
        return meter.us()


async def _at_rate(count: int, publish: Callable[[], Awaitable[None]]) -> dict[str, float]:
    meter, begin = Meter(count), time.perf_counter()
    for number in range(count):
        await publish()
        meter.passed(number + 1)
        await asyncio.sleep(max(0.0, begin + (number + 1) / RATE_HZ - time.perf_counter()))
    return meter.us()


def pyzeros_publisher(count: int) -> dict[str, float]:
    """The publisher of pyzeros in an asyncio program."""
    import pyzeros
    import zenoh
    from ros2_pyterfaces.cydr.all_msgs import Image

    with router() as address:
        config = zenoh.Config()
        said = {"mode": "client", "scouting/multicast/enabled": False, "connect/endpoints": [address]}
        for key, value in said.items():
            config.insert_json5(key, json.dumps(value))
        Image().serialize()  # compiles it

        async def run() -> dict[str, float]:
            with pyzeros.auto_context(node="camera", zenoh_session=zenoh.open(config)):
                publisher = pyzeros.Pub(Image, "/image")

                async def publish() -> None:
                    data = IMAGE.reshape(-1)
                    publisher.publish(Image(height=480, width=640, encoding=b"bgr8", step=1920, data=data))

                return await _at_rate(count, publish)

        return asyncio.run(run())


def plain_zenoh(count: int) -> dict[str, float]:
    """Bytes as they are, put by Zenoh alone: what no program can do without."""
    import zenoh

    with router() as address:
        config = zenoh.Config()
        said = {"mode": "client", "scouting/multicast/enabled": False, "connect/endpoints": [address]}
        for key, value in said.items():
            config.insert_json5(key, json.dumps(value))
        with zenoh.open(config) as session:
            publisher = session.declare_publisher("0/image")

            async def publish() -> None:
                publisher.put(IMAGE.tobytes(), attachment=bytes(33))

            return asyncio.run(_at_rate(count, publish))


_OURS, _PEERS = "hfg RosPublish", "pyzeros Pub"
CASES: dict[str, Case] = {
    _OURS: Case(hfg_node, 300),
    _PEERS: Case(pyzeros_publisher, 300),
    "Zenoh, bytes": Case(plain_zenoh, 300),
}
GOALS = [Goal("processor time beside pyzeros", Side(_OURS, "us"), Side(_PEERS, "us"), 1.2)]
SKIPPED: dict[str, str] = {}
if find_spec("pyzeros") is None:
    SKIPPED[_PEERS] = "pyzeros is not installed"
    del CASES[_PEERS]
