"""Messages and definitions of others are read, or refused with one sentence and in little memory (rule L4)."""

from __future__ import annotations

import random
import struct
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

from hfg.errors import EncodingError, UsageError
from hfg.ros import message
from hfg.ros.messages import MessageType, types_of
from hfg.ros.typestore import Types
from tests.ros.test_golden import GOLDEN

pytest.importorskip("rosbags", reason="rosbags is part of hfg[ros2]")

pytestmark = pytest.mark.rule("L4")
MOST_BYTES = 64 * 2**20
NAMES = sorted(GOLDEN["messages"])


def spoilt(data: bytes, chance: random.Random) -> bytes:
    """Return a message with a few bytes or a length that lies, cut off or longer."""
    made = bytearray(data)
    for _ in range(chance.randrange(1, 4)):
        at = chance.randrange(len(made))
        match chance.randrange(4):
            case 0:
                made[at] = chance.randrange(256)
            case 1 if len(made) >= 8:
                at = 4 * chance.randrange(1, len(made) // 4)
                struct.pack_into("<I", made, at, chance.choice([2**32 - 1, 2**31, 2**16, 0]))
            case 2:
                del made[at:]
                made = made or bytearray(b"\0")
            case _:
                made[at:at] = chance.randbytes(chance.randrange(9))
    return bytes(made)


def attack(count: int, seed: int) -> int:
    """Decode messages that are spoilt, and return how many are refused."""
    chance = random.Random(seed)
    reasons: list[tuple[str, str]] = []
    for _ in range(count):
        name = chance.choice(NAMES)
        data = spoilt(bytes.fromhex(chance.choice(GOLDEN["messages"][name])), chance)
        kind = message(name)
        try:
            kind.decode(data)
        except EncodingError as error:
            reasons.append((name, str(error)))
    assert [one for one in reasons if "\n" in one[1] or one[0] not in one[1]] == []
    return len(reasons)


def peak_of(work: Callable[[], object]) -> int:
    """Return how many bytes a call takes at most."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_spoilt_messages_are_read_or_refused() -> None:
    assert 100 < attack(300, seed=1) < 300


@pytest.mark.soak
def test_20_000_spoilt_messages_take_little_memory() -> None:
    for name in NAMES:
        message(name).pack(message(name).record())  # code that is made once
    assert peak_of(lambda: attack(20_000, seed=2)) < MOST_BYTES


def text(content: bytes, length: int | None = None) -> bytes:
    """Return a message of a string."""
    return b"\0\1\0\0" + struct.pack("<I", len(content) if length is None else length) + content


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("std_msgs/msg/String", text(b"\xff\xfe\0"), "codec can't decode byte 0xff"),
        ("std_msgs/msg/String", text(b"hi\0", 2**32 - 1), "Invalid string length 4294967295"),
        ("std_msgs/msg/String", text(b"hey"), "Missing string terminator"),
        ("std_msgs/msg/String", b"", "begins with , which is not plain CDR"),
        ("std_msgs/msg/String", b"\0\7\0\0" + bytes(8), "begins with 00 07 00 00, which is not plain CDR"),
        ("std_msgs/msg/Float64", b"\0\1\0\0" + bytes(100), "ends after 12 bytes, but there are 104"),
        ("std_msgs/msg/Int32MultiArray", b"\0\1\0\0" + b"\xff" * 16, "sequence"),
        ("geometry_msgs/msg/PoseStamped", b"\0\1\0\0", "has at least"),
    ],
)
def test_each_lie_of_a_message_is_refused(name: str, data: bytes, sentence: str) -> None:
    with pytest.raises(EncodingError, match=sentence):
        message(name).decode(data)


def test_a_message_of_many_small_values_is_refused_before_they_are_made() -> None:
    kind = Types().known | {"a/msg/Bits": [("bits", (4, ((2, "std_msgs/msg/Bool"), 0)))]}
    many = MessageType("a/msg/Bits", Types(kind))
    data = b"\0\1\0\0" + struct.pack("<I", 8_000_000) + bytes(8_000_000)

    def decode() -> None:
        with pytest.raises(EncodingError, match=r"can have 16,000,0\d\d values; the limit is 10,000,000"):
            many.unpack(data)

    assert peak_of(decode) < 2**20


def image(**fields: Any) -> bytes:
    """Return an image of 2 x 2 pixels with some fields that lie."""
    said = {"height": 2, "width": 2, "encoding": "mono8", "step": 2, "data": [1, 2, 3, 4], **fields}
    return message("sensor_msgs/msg/Image").pack(said)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"height": 2**31}, "pixels, the limit is"),
        ({"height": 3}, "do not fit into 4 bytes"),
        ({"step": 1}, "do not fit into 4 bytes"),
        ({"encoding": "yuv422"}, "the encoding 'yuv422' of the image is unknown here"),
    ],
)
def test_an_image_whose_size_lies_is_refused(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(EncodingError, match=sentence):
        message("sensor_msgs/msg/Image").decode(image(**fields))


def test_a_pose_of_no_number_is_refused_and_its_record_is_not() -> None:
    kind = message("geometry_msgs/msg/PoseStamped")
    data = kind.pack({"header": {"frame_id": "map"}, "pose": {"position": {"x": float("nan")}}})
    with pytest.raises(EncodingError, match="a transform has finite numbers"):
        kind.decode(data)
    record: Any = kind.unpack(data)
    assert record.header.frame_id == "map"


DEEP = "".join(f"{'=' * 80}\nMSG: a/D{number}\nD{number + 1} d\n" for number in range(40))


@pytest.mark.parametrize(
    ("definition", "sentence"),
    [
        ("a/Loop again\n", "contains itself"),
        (f"D0 d\n{DEEP}{'=' * 80}\nMSG: a/D40\nint8 x\n", "more than 32 messages in one another"),
        ("Nobody x\n", "is unknown"),
        ("int8[999999999999] x\n", "at most"),
        ("std_msgs/Header[100000] x\n", "at most"),
        ("int8 x\nint8 X\n", "two fields have the same name"),
        ("int8\n", "cannot be read"),
        ("\n".join(f"int8 x{number}" for number in range(2000)), "more than 1,000 fields"),
        ("#" * 2**21, "characters; at most"),
        ("int8 x\n" + "=" * 80 + "\nMSG: ../../a\nint8 y\n", "cannot be read"),
    ],
)
def test_a_definition_that_cannot_be_used_is_refused(definition: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        types_of("a/msg/Loop", definition)


def test_a_definition_of_a_bag_does_not_change_ours() -> None:
    other = types_of("std_msgs/msg/String", "int32 data\n")
    assert other.decode(b"\0\1\0\0\5\0\0\0") == other.record(5)
    assert message("std_msgs/msg/String").decode(text(b"hi\0")) == "hi"
    assert types_of("std_msgs/msg/String", "string data\n") is message("std_msgs/msg/String")
