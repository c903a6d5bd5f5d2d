"""Writes tests/ros/golden.json.gz: bytes and hashes of ROS 2's own serialization, which tests compare with ours.

Runs where rclpy is, not where hfg is; there are wheels of both Kilted and Fast DDS for Python 3.11:

    pip install ros-rclpy ros-rmw-fastrtps-cpp ros-sensor-msgs ros-nav-msgs ros-visualization-msgs ros-diagnostic-msgs \
        ros-stereo-msgs ros-trajectory-msgs ros-std-srvs numpy
    ROS_AUTOMATIC_DISCOVERY_RANGE=OFF python tools/ros_golden.py tests/ros/golden.json.gz

For each message there are two examples: with the defaults, and with numbers and strings from a seeded generator. Bytes
that the reader ignores are 0, because Fast CDR leaves its padding as it finds it.
"""

from __future__ import annotations

import gzip
import importlib
import json
import random
import site
import sys
from pathlib import Path
from typing import Any

LENGTH = 2
"""Items of a sequence."""


def scalar(kind: str, chance: random.Random) -> Any:
    """Return a number, string or byte of a type of IDL."""
    if kind == "boolean":
        return chance.random() < 0.5
    if kind in ("float", "double"):
        return float(chance.randrange(-1000, 1000)) / 8
    if kind == "octet":
        return bytes([chance.randrange(256)])
    if kind.startswith("uint"):
        return chance.randrange(2 ** int(kind[4:]))
    bits = int(kind[3:])
    return chance.randrange(-(2 ** (bits - 1)), 2 ** (bits - 1))


def made(slot: Any, chance: random.Random) -> Any:
    """Return a value of the type of a field."""
    kind = type(slot).__name__
    if kind == "BasicType":
        return scalar(slot.typename, chance)
    if kind in ("UnboundedString", "BoundedString"):
        text = "".join(chance.choice("aé ß0") for _ in range(chance.randrange(6)))
        return text if kind == "UnboundedString" else text[: slot.maximum_size // 2]
    if kind == "NamespacedType":
        return filled(getattr(importlib.import_module(".".join(slot.namespaces)), slot.name), chance)
    count = slot.size if kind == "Array" else min(LENGTH, getattr(slot, "maximum_size", LENGTH))
    return [made(slot.value_type, chance) for _ in range(count)]


def filled(kind: Any, chance: random.Random) -> Any:
    """Return a message with other values than the defaults."""
    message = kind()
    for field, slot in zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True):
        if field != "structure_needs_at_least_one_member":
            setattr(message, field, made(slot, chance))
    return message


def without_padding(data: bytes, kind: Any) -> bytes:
    """Return the bytes with 0 where a change changes nothing."""
    from rclpy.serialization import deserialize_message

    message, bare = deserialize_message(data, kind), bytearray(data)

    def is_read(place: int, bit: int) -> bool:
        changed = bytearray(data)
        changed[place] ^= bit
        try:
            return bool(deserialize_message(bytes(changed), kind) != message)
        except Exception:  # it is a length
            return True

    for place in range(4, len(data)):
        if not any(is_read(place, bit) for bit in (1, 2, 128)):
            bare[place] = 0
    return bytes(bare)


def main(out: str) -> None:
    """Write the file."""
    from rclpy.serialization import serialize_message

    messages: dict[str, Any] = {}
    hashes: dict[str, str] = {}
    for file in sorted(Path(sys.prefix, "share").rglob("*.json")):
        package, kind, name = file.parts[-3], file.parts[-2], file.stem
        if kind not in ("msg", "srv", "action"):
            continue
        told = json.loads(file.read_text())
        hashes |= {one["type_name"]: one["hash_string"] for one in told["type_hashes"]}
        if kind != "msg":
            continue
        cls = getattr(importlib.import_module(f"{package}.msg"), name)
        chance = random.Random(f"{package}/{name}")
        examples = [cls(), filled(cls, chance)]
        messages[f"{package}/msg/{name}"] = [without_padding(serialize_message(one), cls).hex() for one in examples]
    text = json.dumps({"hashes": hashes, "messages": messages}, sort_keys=True, separators=(",", ":"))
    Path(out).write_bytes(gzip.compress(text.encode(), 9, mtime=0))
    print(len(messages), "messages,", len(hashes), "hashes, of", site.getsitepackages()[0])


if __name__ == "__main__":
    main(sys.argv[1])
