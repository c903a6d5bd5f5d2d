"""Types of ROS 2: hashes, bytes, values, definitions from files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.errors import EncodingError, UsageError
from hfg.geometry import LaserScan
from hfg.ros import goals
from hfg.ros.messages import action, message, service

pytest.importorskip("rosbags", reason="rosbags is part of hfg[ros2]")

HASHES = {  # the design document of rmw_zenoh, and what pyzeros computes
    message("std_msgs/msg/String"): "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    message("geometry_msgs/msg/Twist"): "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    service("example_interfaces/srv/AddTwoInts"): (
        "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
    ),
    service("std_srvs/srv/SetBool"): "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
}


@pytest.mark.parametrize("type_", HASHES, ids=lambda one: one.name)
def test_hashes_of_messages_and_services_are_those_of_ros(type_: Any) -> None:
    assert type_.hash == HASHES[type_]


def test_text_is_encoded_as_cdr() -> None:
    text = message("std_msgs/msg/String")
    assert text.encode("hi") == b"\0\1\0\0" + b"\3\0\0\0" + b"hi\0"
    assert text.decode(text.encode("hi")) == "hi"


@pytest.mark.parametrize(
    ("shape", "dtype"), [((3, 4, 3), "u1"), ((3, 4), "u1"), ((3, 4, 4), "u1"), ((3, 4), "u2"), ((3, 4), "f4")]
)
def test_images_return_as_they_were(shape: tuple[int, ...], dtype: str) -> None:
    image = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    kind = message("sensor_msgs/msg/Image")
    again = kind.decode(kind.encode(image))
    assert again.dtype == image.dtype
    np.testing.assert_array_equal(again, image)


def test_padded_red_green_blue_images_of_others_become_blue_green_red() -> None:
    kind = message("sensor_msgs/msg/Image")
    record = kind.record(
        header=message("std_msgs/msg/Header").decode(message("std_msgs/msg/Header").encode({"frame_id": "cam"})),
        height=2, width=1, encoding="rgb8", is_bigendian=0, step=4, data=np.arange(8, dtype=np.uint8),
    )  # fmt: skip
    assert kind.decode(kind.encode(record)).tolist() == [[[2, 1, 0]], [[6, 5, 4]]]


def test_a_scan_returns_as_it_was() -> None:
    scan = LaserScan("laser", 12.25, np.array([1.0, 2.0, np.inf]), -1.5, 0.5, 0.25, 8.0)
    kind = message("sensor_msgs/msg/LaserScan")
    assert kind.decode(kind.encode(scan)) == scan


def test_records_are_made_of_mappings_and_filled_with_defaults() -> None:
    twist = message("geometry_msgs/msg/Twist")
    record: Any = twist.unpack(twist.encode({"linear": {"x": 1.5}}))
    assert (record.linear.x, record.linear.y, record.angular.z) == (1.5, 0.0, 0.0)
    assert twist.unpack(twist.encode(record)) == record


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("std_msgs/msg/String", 3, "must be a string, found 3"),
        ("geometry_msgs/msg/Twist", {"linaer": {}}, "no field 'linaer'"),
        ("geometry_msgs/msg/Twist", "fast", "cannot be sent as geometry_msgs/msg/Twist"),
        ("sensor_msgs/msg/Image", np.zeros((2, 2), "i8"), "no images of int64"),
    ],
)
def test_other_values_are_refused_with_a_reason(name: str, value: object, sentence: str) -> None:
    with pytest.raises(EncodingError, match=sentence):
        message(name).encode(value)


@given(
    st.binary(max_size=80), st.sampled_from(["std_msgs/msg/String", "sensor_msgs/msg/Image", "tf2_msgs/msg/TFMessage"])
)
def test_bytes_of_others_are_a_value_or_an_encoding_error(data: bytes, name: str) -> None:
    for one in (data, b"\0\1\0\0" + data):
        try:
            message(name).decode(one)
        except EncodingError as error:
            assert name in str(error)  # noqa: PT017 - most bytes are none


def test_definitions_come_from_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "arm_msgs"
    for kind, name, text in (
        ("msg", "Grip", "# how to hold\nfloat64 force\nLimits[] limits\n"),
        ("msg", "Limits", "float32 low\nfloat32 high\nstring<=5 unit\n"),
        ("srv", "Open", "Grip grip\n---\nbool done\n"),
    ):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        (folder / kind / f"{name}.{kind}").write_text(text)
    monkeypatch.setenv("HFG_ROS_PATH", str(tmp_path))
    grip = message("arm_msgs/msg/Grip")
    record = grip.decode(grip.encode({"force": 2.5, "limits": [{"low": 1.0, "unit": "N"}]}))
    assert (record.force, record.limits[0].low, record.limits[0].unit) == (2.5, 1.0, "N")
    assert service("arm_msgs/srv/Open").response.decode(b"\0\1\0\0\1").done


@pytest.mark.parametrize(
    ("kind", "name", "sentence"),
    [
        (message, "nobody_msgs/msg/Unknown", "HFG_ROS_PATH names no folder"),
        (message, "String", "not a type name"),
        (message, "std_srvs/srv/SetBool", 'not of the kind "msg"'),
        (service, "std_msgs/msg/String", 'not of the kind "srv"'),
    ],
)
def test_unknown_types_are_refused(kind: Any, name: str, sentence: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HFG_ROS_PATH", raising=False)
    with pytest.raises(UsageError, match=sentence):
        kind(name)


def test_goals_are_written_as_the_types_of_an_action_are() -> None:
    kind, goal_id = action("example_interfaces/action/Fibonacci"), bytes(range(16))
    who = {"goal_id": {"uuid": list(goal_id)}}
    sent = goals.goal_request(goal_id, kind.goal.encode({"order": 3}))
    assert sent == kind.send_goal.request.encode({**who, "goal": {"order": 3}})
    assert goals.result_request(goal_id) == kind.get_result.request.encode(who)
    cancel = service("action_msgs/srv/CancelGoal").request
    assert goals.cancel_request(goal_id) == cancel.encode({"goal_info": who})
    told = kind.feedback_message.encode({**who, "feedback": {"sequence": [1, 1]}})
    told_id, feedback = goals.read_feedback(told)
    assert told_id == goal_id
    assert kind.feedback.decode(feedback).sequence.tolist() == [1, 1]
    assert goals.is_accepted(kind.send_goal.response.encode({"accepted": True}))
    assert not goals.is_accepted(kind.send_goal.response.encode({}))
    status, result = kind.read_result(kind.get_result.response.encode({"status": 4, "result": {"sequence": [1]}}))
    assert status == goals.Status.SUCCEEDED
    assert result.sequence.tolist() == [1]
    for short in (b"", b"\0\1\0\0"):
        with pytest.raises(EncodingError, match="too short"):
            goals.is_accepted(short)
        with pytest.raises(EncodingError, match="too short"):
            goals.read_feedback(short)
