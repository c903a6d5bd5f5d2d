"""A few kilobytes of a recording may unpack to millions of empty messages (rule L4)."""

from __future__ import annotations

import struct
import tracemalloc
from types import SimpleNamespace
from typing import Any

import pytest

from hfg.recording.seeking import Seeking

pytestmark = [pytest.mark.rule("L4"), pytest.mark.timeout(60)]


def message(channel: int, time: int) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22, channel, 0, time, 0)


def seeking(data: bytes) -> Seeking:
    """Return what finds the messages in one chunk that has no lists of them."""
    file: Any = SimpleNamespace(
        layout=SimpleNamespace(pieces=[SimpleNamespace(is_chunk=False)]), unpacked=lambda _number: data
    )
    return Seeking(file)


def test_messages_without_lists_cost_little_more_than_their_bytes() -> None:
    data = message(1, 7) * 100_000
    tracemalloc.start()
    try:
        found = seeking(data)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found.count([1], 0, 7) == 100_000
    assert most < 4 * len(data)


def test_messages_without_lists_are_found_by_channel_and_time() -> None:
    found = seeking(message(2, 30) + message(1, 20) + message(2, 10) + message(65535, 2**64 - 1))
    assert [(one.time, one.place) for one in found.messages(2, 0, 40)] == [(30, 0), (10, 62)]
    assert [(one.time, one.place) for one in found.messages(1, 0, 40)] == [(20, 31)]
    assert found.last == 2**63 - 1, "a time that no other program can hold is the last"


def test_a_chunk_without_messages_has_none() -> None:
    assert seeking(b"").after([1], 0) is None
