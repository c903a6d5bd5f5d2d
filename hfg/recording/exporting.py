"""Writes a recording as a bag of ROS 2, for `ros2 bag play` and tools of ROS. Depends on `reading` and `hfg.ros`."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.records import Channel

from hfg.errors import HfgError, UsageError
from hfg.geometry import FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, Twist
from hfg.recording.messages import EVENTS, MARKERS, TokenReader
from hfg.recording.reading import CDR, File, Loss
from hfg.recording.rosmessages import type_of
from hfg.ros.messages import MessageType, message

_TYPES: Final[dict[str, tuple[Any, str]]] = {
    "hfg.bool": (bool, "std_msgs/msg/Bool"),
    "hfg.int": (int, "std_msgs/msg/Int64"),
    "hfg.float": (float, "std_msgs/msg/Float64"),
    "hfg.str": (str, "std_msgs/msg/String"),
    "hfg.Twist": (Twist, "geometry_msgs/msg/Twist"),
    "foxglove.RawImage": (np.ndarray, "sensor_msgs/msg/Image"),
    "foxglove.CompressedImage": (np.ndarray, "sensor_msgs/msg/Image"),
    "foxglove.LaserScan": (LaserScan, "sensor_msgs/msg/LaserScan"),
    "foxglove.PointCloud": (PointCloud, "sensor_msgs/msg/PointCloud2"),
    "foxglove.Grid": (Grid, "nav_msgs/msg/OccupancyGrid"),
    "foxglove.PoseInFrame": (PoseInFrame, "geometry_msgs/msg/PoseStamped"),
    "foxglove.FrameTransform": (FrameTransform, "geometry_msgs/msg/TransformStamped"),
    "foxglove.FrameTransforms": (list[FrameTransform], "tf2_msgs/msg/TFMessage"),
}
"""Type of the values, and of the messages, by the name of the schema in the recording."""


class Exported(NamedTuple):
    """The result of an export.

    Attributes:
      written: how many messages each topic has.
      left_out: how many values of each port are not in the bag.
      why: for each of these ports, the first reason.
      losses: the parts of the recording that cannot be read.
    """

    written: Counter[str]
    left_out: Counter[str]
    why: dict[str, str]
    losses: list[Loss]


class _Topic(NamedTuple):
    connection: Any
    encode: Callable[[bytes], bytes]


def export_bag(file: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Exported:
    """Write the values of a recording to a bag of ROS 2, a new folder with an MCAP file.

    The topic of "camera.out" is "/camera/out". Ports whose values have no message in ROS 2 are left out.

    Args:
      file: a recording, or a bag.
      folder: the new bag.

    Raises:
      UsageError: the recording cannot be read, or the folder exists or cannot be written.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
    except ImportError:
        raise UsageError('bags of ROS 2 need rosbags: pip install "hfg[ros2]"') from None
    done = Exported(Counter(), Counter(), {}, [])
    try:
        with (
            File(file) as recording,
            Writer(Path(folder), version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as bag,
        ):
            _export(recording, bag, done)
            done.losses.extend(recording.losses())
    except (WriterError, OSError) as error:
        raise UsageError(f"cannot write the bag {os.fspath(folder)}: {error}") from None
    return done


def _export(recording: File, bag: Any, done: Exported) -> None:
    topics: dict[int, _Topic | str] = {}
    for number, when, data in recording.messages():
        channel = recording.channels[number]
        if channel.topic in (MARKERS, EVENTS):
            continue
        topic = topics.get(number)
        if topic is None:
            topic = topics[number] = _topic(recording, channel, bag)
        try:
            if isinstance(topic, str):
                raise UsageError(topic)
            bag.write(topic.connection, when, topic.encode(data))
            done.written[topic.connection.topic] += 1
        except (HfgError, ValueError, KeyError, TypeError) as error:
            done.left_out[channel.topic] += 1
            done.why.setdefault(channel.topic, str(error))


def _topic(recording: File, channel: Channel, bag: Any) -> _Topic | str:
    """Return the topic of a port, or why it has none."""
    schema = recording.schemas.get(channel.schema_id)
    name = "" if schema is None else schema.name
    if channel.message_encoding == CDR and schema is not None:
        return _Topic(_connected(bag, channel.topic, type_of(schema)), bytes)
    if name not in _TYPES:
        return f"ROS 2 has no message for values of {channel.metadata.get('type') or name or 'an unknown type'}"
    hint, type_ = _TYPES[name]
    kind, reader = message(type_), TokenReader(name, hint, may_pickle=False)

    def encode(data: bytes) -> bytes:
        token = reader.token(recording.object_in(data))
        return kind.encode(token.value, stamp=token.stamp)

    return _Topic(_connected(bag, channel.topic, kind), encode)


def _connected(bag: Any, port: str, kind: MessageType) -> Any:
    return bag.add_connection(topic_of(port), kind.name, msgdef=kind.text, rihs01=kind.hash)


def topic_of(port: str) -> str:
    """Return the name of the topic that a port becomes.

    Examples:
      >>> topic_of("arm 2/camera.out"), topic_of("/scan")
      ('/arm_2/camera/out', '/scan')
    """
    parts = [re.sub(r"[^A-Za-z0-9_]", "_", part) for part in re.split(r"[./]", port) if part]
    return "".join(f"/{'_' if part[0].isdigit() else ''}{part}" for part in parts)
