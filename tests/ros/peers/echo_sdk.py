"""Echoes topics and serves a service with zenoh-ros2-sdk; see echo_pyzeros.py.

It would clone the definitions of messages from the network, so it is given those that rosbags has, and the hashes.
"""

from __future__ import annotations

import dataclasses
import os
import queue
import sys
import threading
from typing import Any

import zenoh_ros2_sdk
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_KILTED)
TYPES = {
    "string": "std_msgs/msg/String",
    "image": "sensor_msgs/msg/Image",
    "twist": "geometry_msgs/msg/Twist",
    "scan": "sensor_msgs/msg/LaserScan",
}
HOST, _, PORT = sys.argv[1].partition("/")[2].partition(":")
ROUTER = {"router_ip": HOST, "router_port": int(PORT), "node_name": "sdk_peer"}
SERVICE = {
    "srv_type": "std_srvs/srv/SetBool",
    "request_definition": "bool data\n",
    "response_definition": "bool success\nstring message\n",
}


def ends(kind: str) -> dict[str, Any]:
    text, _ = STORE.generate_msgdef(kind, ros_version=2)
    return {"msg_type": kind, "msg_definition": text, "type_hash": STORE.hash_rihs01(kind), **ROUTER}


def echo(name: str, kind: str) -> None:
    publisher = zenoh_ros2_sdk.ROS2Publisher(topic=f"/sdk/back/{name}", **ends(kind))

    def came(value: Any) -> None:
        publisher.publish(**{one.name: getattr(value, one.name) for one in dataclasses.fields(value)})

    zenoh_ros2_sdk.ROS2Subscriber(topic=f"/sdk/there/{name}", callback=came, **ends(kind))


for name, kind in TYPES.items():
    echo(name, kind)
told = zenoh_ros2_sdk.ROS2Publisher(topic="/sdk/told", **ends(TYPES["string"]))
server: Any = zenoh_ros2_sdk.ROS2ServiceServer(
    service_name="/sdk/flip",
    callback=lambda asked: server.response_msg_class(success=not asked.data, message="sdk"),
    **SERVICE,
    **ROUTER,
)
client = zenoh_ros2_sdk.ROS2ServiceClient(service_name="/hfg/flip", **SERVICE, **ROUTER)
wishes: queue.Queue[object] = queue.Queue()
zenoh_ros2_sdk.ROS2Subscriber(topic="/sdk/ask", callback=wishes.put, **ends(TYPES["string"]))


def ask() -> None:
    """Ask hfg's service whenever a message says so, and tell what it has answered."""
    while True:
        wishes.get()
        answer = client.call(data=True)
        told.publish(data=f"{answer.success} {answer.message}")


threading.Thread(target=ask, daemon=True).start()
print("ready", flush=True)
sys.stdin.read()
os._exit(0)  # its session has threads that nothing ends
