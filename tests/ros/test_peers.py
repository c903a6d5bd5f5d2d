"""hfg's nodes with two implementations of rmw_zenoh that share no code with it, over a Zenoh router."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.geometry import LaserScan
from hfg.nodes.ros import RosPublish, RosService, RosServiceClient, RosSubscribe
from hfg.ros.messages import message, service
from tests.ros.conftest import PEERS, Process, Router, python_with, until
from tests.ros.ends import Keep, Say

pytestmark = [pytest.mark.slow, pytest.mark.asyncio]

IMAGE = np.arange(480 * 640 * 3, dtype=np.uint8).reshape(480, 640, 3)
SCAN = LaserScan("laser", 12.5, np.linspace(1, 5, 360).astype("f4").astype("f8"), -3.0, 0.5, 0.25, 8.0)
SET_BOOL = service("std_srvs/srv/SetBool")
TWIST = message("geometry_msgs/msg/Twist").decode(b"\0\1\0\0" + struct.pack("<6d", 0.5, 0, 0, 0, 0, -1))
VALUES: dict[str, tuple[str, Any]] = {
    "string": ("std_msgs/msg/String", "grüße"),
    "image": ("sensor_msgs/msg/Image", IMAGE),
    "twist": ("geometry_msgs/msg/Twist", TWIST),
    "scan": ("sensor_msgs/msg/LaserScan", SCAN),
}


class Flip(hfg.Node):
    out = hfg.Event(Any)

    @hfg.slot
    def request(self, value: hfg.Token[Any]) -> None:
        self.out.trigger(SET_BOOL.response.record(success=not value.value.data, message="hfg"), stamp=value.stamp)


@pytest.mark.parametrize(("name", "package"), [("pyzeros", "pyzeros"), ("sdk", "zenoh_ros2_sdk")])
async def test_topics_and_services_pass_both_ways(name: str, package: str, router: Router) -> None:
    peer = Process(python_with(package), str(PEERS / f"echo_{name}.py"), router.address)
    graph = hfg.Graph("hfg_peer")
    at = {"router": router.address}
    says, keeps, others = {}, {}, []
    told = {"ask": ("std_msgs/msg/String", "now"), **VALUES}
    for topic, (kind, _) in told.items():
        there, back = (
            (f"/{name}/ask", f"/{name}/told") if topic == "ask" else (f"/{name}/there/{topic}", f"/{name}/back/{topic}")
        )
        says[topic], keeps[topic] = graph.add(Say()), graph.add(Keep())
        publish = graph.add(RosPublish(topic=there, type=kind, **at))
        subscribe = graph.add(RosSubscribe(topic=back, type=kind, **at))
        graph.connect(says[topic].out, publish.value)
        graph.connect(subscribe.out, keeps[topic].value)
        others += [publish, subscribe]
    client = graph.add(RosServiceClient(name=f"/{name}/flip", type="std_srvs/srv/SetBool", **at))
    says["flip"], keeps["flip"] = graph.add(Say()), graph.add(Keep())
    graph.connect(says["flip"].out, client.request)
    graph.connect(client.response, keeps["flip"].value)
    server, flip = graph.add(RosService(name="/hfg/flip", type="std_srvs/srv/SetBool", **at)), graph.add(Flip())
    graph.connect(server.request, flip.request)
    graph.connect(flip.out, server.answer)
    try:
        async with hfg.running(graph) as run:
            peer.start()
            await until(lambda: all(node.statistics()["here"] for node in others))
            for topic, (_, value) in told.items():
                await run.trigger(says[topic].say, value)
            await run.trigger(says["flip"].say, SET_BOOL.request.record(data=True))
            await until(lambda: all(one.kept for one in keeps.values()))
            run.stop()
    finally:
        peer.kill()
    for topic, (_, value) in VALUES.items():
        np.testing.assert_equal(keeps[topic].kept, [value])
    assert [(one.success, one.message) for one in keeps["flip"].kept] == [(False, name)]
    assert keeps["ask"].kept == ["False hfg"]
    assert server.statistics()["answered"] == 1
    for node in others:
        numbers = node.statistics()
        assert not numbers.get("lost")
        assert not numbers["unfit"]
