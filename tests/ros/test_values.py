"""Messages become values of hfg and back; records are values that can be recorded, sent and compared."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pytest

import hfg
from hfg.base.token import Token
from hfg.base.values import same
from hfg.encoding import TokenCodec, wire_problem
from hfg.errors import EncodingError
from hfg.geometry import FrameTransform, Grid, PointCloud, PoseInFrame, Transform, Twist
from hfg.recording import play_into, record
from hfg.ros import message
from hfg.testing import Recorder
from hfg.types import accepts

pytest.importorskip("rosbags", reason="rosbags is part of hfg[ros2]")

AT = Transform.of(1.0, -2.0, 0.5, yaw=0.25)
POINTS = np.array([[1.0, 2.0, 3.0], [np.nan, 0.5, -4.0]])
COLUMNS: dict[str, Any] = {"intensity": np.array([0.5, 1.0], np.float32), "ring": np.array([3, 65535], np.uint16)}

VALUES: list[tuple[str, Any]] = [
    ("sensor_msgs/msg/PointCloud2", PointCloud("laser", 2.5, POINTS, COLUMNS)),
    ("nav_msgs/msg/OccupancyGrid", Grid("map", 2.5, AT, 0.5, np.array([[0, 100, -1], [1, 2, 3]], np.int8))),
    ("geometry_msgs/msg/PoseStamped", PoseInFrame("map", 2.5, AT)),
    ("geometry_msgs/msg/PoseStamped", PoseInFrame("no_frame", -0.25, AT)),
    ("geometry_msgs/msg/Pose", AT),
    ("geometry_msgs/msg/Transform", AT),
    ("geometry_msgs/msg/TransformStamped", FrameTransform("map", "base", AT, 2.5)),
    ("tf2_msgs/msg/TFMessage", [FrameTransform("map", "base", AT, 2.5), FrameTransform("base", "arm", AT, 3.0)]),
    ("geometry_msgs/msg/Twist", Twist(0.5, -0.25, 1.0)),
    ("rosgraph_msgs/msg/Clock", 1_700_000_000.5),
    ("std_msgs/msg/Byte", 200),
    ("std_msgs/msg/Char", 200),
    ("std_msgs/msg/UInt64", 2**64 - 1),
]


@pytest.mark.parametrize(("name", "value"), VALUES, ids=[name for name, _ in VALUES])
def test_a_value_returns_as_it_was(name: str, value: Any) -> None:
    kind = message(name)
    again = kind.decode(kind.encode(value))
    assert same(again, value), again
    assert accepts(again, kind.value_type)


def test_a_picture_is_compressed_and_nearly_the_same() -> None:
    kind = message("sensor_msgs/msg/CompressedImage")
    picture = np.full((8, 16, 3), (10, 120, 240), np.uint8)
    data = kind.encode(picture, stamp=2.5, frame_id="front")
    whole: Any = kind.unpack(data)
    assert (whole.format, whole.header.frame_id, kind.stamp(data)) == ("jpeg", "front", 2.5)
    np.testing.assert_allclose(kind.decode(data).astype(int), picture.astype(int), atol=3)
    depth = np.arange(6, dtype=np.uint16).reshape(2, 3)
    np.testing.assert_array_equal(kind.decode(kind.encode(depth)), depth)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("geometry_msgs/msg/PoseStamped", PoseInFrame("map", 2.0**40, AT), "from 1970 to 2038"),
        ("nav_msgs/msg/OccupancyGrid", Grid("map", 0.0, AT, 0.5, np.zeros((2, 2))), "int8 in each cell"),
        ("std_msgs/msg/UInt8", 256, "must be an integer from 0 to 255, found 256"),
        ("std_msgs/msg/Bool", 1, "must be true or false"),
        ("sensor_msgs/msg/JointState", {"position": ["far"]}, "JointState.position must be a row of float64"),
        ("sensor_msgs/msg/CompressedImage", np.zeros((2, 2)), "cannot be compressed"),
        ("geometry_msgs/msg/PoseWithCovariance", {"covariance": [1.0]}, "must have 36 items, found 1"),
        ("std_msgs/msg/Int32MultiArray", {"data": [0.5]}, "must be a row of int32"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(name: str, value: Any, sentence: str) -> None:
    with pytest.raises(EncodingError, match=sentence):
        message(name).encode(value)


def test_a_twist_out_of_the_plane_is_no_value_but_a_record() -> None:
    kind = message("geometry_msgs/msg/Twist")
    data = kind.encode({"linear": {"z": 1.0}})
    with pytest.raises(EncodingError, match="moves out of the plane"):
        kind.decode(data)
    whole: Any = kind.unpack(data)
    assert whole.linear.z == 1.0


if TYPE_CHECKING:
    JOINTS: TypeAlias = Any
else:
    JOINTS = message("sensor_msgs/msg/JointState").record


@hfg.node
def joints(*, count: int = 3) -> Iterator[JOINTS]:
    """Give the joints of an arm."""
    for one in range(count):
        yield JOINTS(name=["elbow", "wrist"], position=np.array([one, 0.5]))


@hfg.node
def elbow(state: JOINTS) -> float:
    """Return where the elbow is."""
    return float(state.position[state.name.index("elbow")])


@hfg.node
def move(angle: float) -> None:
    """Take it."""


def test_records_are_checked_recorded_and_played(tmp_path: Path) -> None:
    runs = []
    for name in ("first", "second"):
        graph = hfg.Graph("arm")
        graph.add(joints(), max_rate_hz=10) >> graph.add(elbow()) >> graph.add(move())
        if name == "second":
            play_into(graph, tmp_path / "first.mcap")
        seen = Recorder()
        file = tmp_path / f"{name}.mcap"

        def begin(run: hfg.Run, file: Path = file) -> None:
            record(run, file)

        hfg.run(graph, clock="virtual", trace=seen, begin=begin)
        runs.append(seen)
    assert [edge for edge in runs[0].edges() if runs[0].tokens(edge) != runs[1].tokens(edge)] == []
    assert len(runs[1].tokens("joints.out -> elbow.state")) >= 3


def test_records_cross_to_another_process() -> None:
    state = JOINTS(name=["elbow"], position=np.array([0.5]))
    assert wire_problem(JOINTS) is None
    codec = TokenCodec(JOINTS)
    assert codec.decode(*codec.encode(Token(state))).value == state
    assert pickle.loads(pickle.dumps(state)) == state
