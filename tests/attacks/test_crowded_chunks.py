"""A few kilobytes of a recording may unpack to millions of empty messages (rule L4)."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer

from hfg.cli import main
from hfg.recording import File, recover
from hfg.recording.chunks import content_of
from hfg.recording.seeking import Seeking

pytestmark = [pytest.mark.rule("L4"), pytest.mark.timeout(60)]


def message(channel: int, time: int) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22, channel, 0, time, 0)


def seeking(data: bytes) -> Seeking:
    """Return what finds the messages in one chunk that has no lists of them."""
    file: Any = SimpleNamespace(
        layout=SimpleNamespace(pieces=[SimpleNamespace(is_chunk=False)]),
        content=lambda _number: content_of(data, lambda _kind, _record: None),
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


@pytest.fixture(scope="module")
def crowded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 300 chunks, each of a thousand empty messages, and each within its limits."""
    file = tmp_path_factory.mktemp("crowded") / "crowded.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=31_000, compression=CompressionType.ZSTD)
        writer.start()
        channel = writer.register_channel("many", "json", 0)
        for number in range(300_000):
            writer.add_message(channel, 7, b"", 7, number % 2)
        writer.finish()  # type: ignore[no-untyped-call]
    return file


def fair(monkeypatch: pytest.MonkeyPatch, per_message: int = 31 + 512) -> range:
    """Set the limit so that a third of that recording is within it; returns how many messages that may be."""
    monkeypatch.setattr("hfg.recording.chunks._ALWAYS_BYTES", 100_000 * per_message)
    monkeypatch.setenv("HFG_MOST_RECORDING_RATIO", "0")
    return range(85_000, 100_001)


def test_all_chunks_together_cost_no_more_than_the_size_of_the_file_allows(
    crowded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with File(crowded) as recording:
        assert recording.info().losses == []
    fit = fair(monkeypatch)
    with File(crowded) as recording:
        found = recording.info()
    assert found.messages in fit
    assert "if you trust it, set HFG_MOST_RECORDING_RATIO to a larger number" in str(found.losses[0])
    assert sum(one.messages or 0 for one in found.losses) == 300_000 - found.messages
    assert len(found.losses) <= 101, "hundreds of damaged chunks are not a line each"


def test_what_is_read_again_costs_nothing_more(crowded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fit = fair(monkeypatch)
    with File(crowded) as recording:
        for _ in range(3):
            assert sum(1 for _ in recording.messages()) in fit


def test_a_studio_looks_at_no_more_of_it(crowded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fit = fair(monkeypatch, 31)  # it has lists, so messages are not looked at
    found = Seeking(File(crowded))
    try:
        assert sum(len(bodies) for _, bodies in found.parts(1)) in fit
        assert found.losses()
    finally:
        found.close()


@pytest.mark.parametrize("verb", ["info", "recover"])
def test_the_verbs_say_what_is_left_out(
    crowded: Path, tmp_path: Path, verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fair(monkeypatch)
    more = ["-o", str(tmp_path / "new.mcap")] if verb == "recover" else []
    assert main([verb, str(crowded), *more]) == (1 if verb == "info" else 0)
    assert "HFG_MOST_RECORDING_RATIO" in "".join(capsys.readouterr())


def test_what_is_recovered_is_whole(crowded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fit = fair(monkeypatch)
    count, losses = recover(crowded, tmp_path / "new.mcap")
    assert count in fit
    assert losses
