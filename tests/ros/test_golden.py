"""Bytes and hashes are those of rclpy: `tools/ros_golden.py` has written golden.json.gz with Kilted's own wheels."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from hfg.ros import message
from hfg.ros.definitions import hash_of
from hfg.ros.messages import shared

pytest.importorskip("rosbags", reason="rosbags is part of hfg[ros2]")

GOLDEN: Any = json.loads(gzip.decompress((Path(__file__).parent / "golden.json.gz").read_bytes()))

SPARE = 64


def test_messages_of_the_common_packages_have_the_bytes_of_rclpy() -> None:
    known = sorted(set(GOLDEN["messages"]) & set(shared().known))
    assert len(known) >= 150
    for name in known:
        kind = message(name)
        for text in GOLDEN["messages"][name]:
            expected = bytes.fromhex(text)
            ours = kind.pack(kind.unpack(expected))
            # rclpy appends unused bytes after some sequences
            assert (name, expected[: len(ours)].hex()) == (name, ours.hex())
            assert len(expected) - len(ours) <= SPARE


def test_defaults_are_those_of_rclpy() -> None:
    for name in sorted(set(GOLDEN["messages"]) & set(shared().known)):
        kind = message(name)
        assert (name, kind.record()) == (name, kind.unpack(bytes.fromhex(GOLDEN["messages"][name][0])))


def test_types_have_the_hashes_of_ros() -> None:
    known = {name: one for name, one in GOLDEN["hashes"].items() if name in shared().known}
    assert len(known) >= 165
    for name, expected in known.items():
        assert (name, hash_of(name, shared().known)) == (name, expected)
