"""A driver for a robot of ROS 2, and a simulated robot to try it on; ROS itself is not needed.

    driver:  RosSubscribe /scan ──> drive ──> RosPublish /speed
                                      └─ near ──> RosServiceClient /stop ──> done
    robot:   RosSubscribe /speed ──> robot ──> RosPublish /scan,    RosService /stop <──> robot

Shown: topics and a service over rmw_zenoh, a message as a value of hfg (`LaserScan`), a router of Zenoh in Python. To
drive a robot, start `ros2 run rmw_zenoh_cpp rmw_zenohd` there, set HFG_ROS_ROUTER=tcp/localhost:7447, and run
`driver()` only. Run it with `python examples/ros/robot.py`.
"""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import numpy as np

import hfg
from hfg.geometry import LaserScan
from hfg.nodes.ros import RosPublish, RosService, RosServiceClient, RosSubscribe
from hfg.ros import service
from hfg_transports.zenoh import Settings, open_session

TRIGGER = "std_srvs/srv/Trigger"


class Robot(hfg.Node):
    """Drives towards a wall at 2 m, and measures how far it is, 20 times a second."""

    scan = hfg.Output(LaserScan)
    stopped = hfg.Event(object)
    distance_m = hfg.State(2.0)
    speed = hfg.State(0.0)

    async def process(self) -> None:
        await asyncio.sleep(0.05)
        self.distance_m -= 0.05 * self.speed
        self.scan.send(LaserScan("laser", hfg.now(), np.full(3, self.distance_m), -0.1, 0.1))

    @hfg.slot
    def drive(self, speed: float) -> None:
        self.speed = speed

    @hfg.slot
    def stop(self, request: hfg.Token[object]) -> None:
        self.speed = 0.0
        answer = service(TRIGGER).response.record(success=True, message=f"{self.distance_m:.1f} m")
        self.stopped.trigger(answer, stamp=request.stamp)


class Drive(hfg.Node):
    """Drives fast while the way is free, then stops, once."""

    scan = hfg.Input(LaserScan)
    speed = hfg.Output(float)
    near = hfg.Event(object)
    is_near = hfg.State(False)

    def process(self, scan: LaserScan) -> None:
        self.speed.send(0.0 if self.is_near else 4.0)
        if scan.ranges.min() < 1.0 and not self.is_near:
            self.is_near = True
            self.near.trigger(service(TRIGGER).request.record())


@hfg.node
def report(answer: Any) -> str:
    """Print how far from the wall the robot has stopped."""
    print("stopped before the wall:", answer.success)
    return str(answer.message)


def robot(**at: str) -> hfg.Graph:
    graph = hfg.Graph("robot")
    wheels = graph.add(Robot())
    speed = graph.add(RosSubscribe(topic="/speed", type="std_msgs/msg/Float64", **at))
    scans = graph.add(RosPublish(topic="/scan", type="sensor_msgs/msg/LaserScan", reliability="best_effort", **at))
    stop = graph.add(RosService(name="/stop", type=TRIGGER, **at))
    graph.connect(speed.out, wheels.drive)
    graph.connect(wheels.scan, scans.value)
    graph.connect(stop.request, wheels.stop)
    graph.connect(wheels.stopped, stop.answer)
    return graph


def driver(**at: str) -> hfg.Graph:
    graph = hfg.Graph("driver")
    drive, told = graph.add(Drive()), graph.add(report())
    scans = graph.add(RosSubscribe(topic="/scan", type="sensor_msgs/msg/LaserScan", depth=1, **at))
    speed = graph.add(RosPublish(topic="/speed", type="std_msgs/msg/Float64", **at))
    stop = graph.add(RosServiceClient(name="/stop", type=TRIGGER, **at))
    graph.connect(scans.out, drive.scan)
    graph.connect(drive.speed, speed.value)
    graph.connect(drive.near, stop.request)
    graph.connect(stop.response, told.answer)
    graph.connect(told.processed, graph.stop)
    return graph


async def main() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with open_session(Settings(listen=(address,), insecure=True), "router"):
        async with hfg.running(robot(router=address)) as simulated, hfg.running(driver(router=address)) as driving:
            await driving.wait_finished()
            simulated.stop()


if __name__ == "__main__":
    asyncio.run(main())
