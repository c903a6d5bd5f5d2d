"""A recording that somebody has forged is read or refused with a sentence, in bounded time (rule L4)."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hfg import comparing
from hfg.errors import GraphError, UsageError
from hfg.graph import commands
from hfg.recording import File, mcap
from hfg.recording.chunks import Damaged
from hfg.recording.mcap import MAGIC
from hfg.recording.tracks import Track
from hfg.recording.values import CannotKeep, Codec
from hfg.studio import recorded
from hfg.studio.recorded import Recorded, Values
from tests.recording.damage import chunk, of_record

pytestmark = [pytest.mark.rule("L4"), pytest.mark.timeout(120)]

NODE = {"do": "Add", "type": "hfg.testing.nodes:double", "path": "a"}
PRIME = 2**61 - 1
"""Whole numbers that it divides have the hash 0."""


def token(value: object, **more: object) -> bytes:
    return json.dumps({"value": value, "activity": 0, "stamp": 0.5, "sequence": 1, **more}).encode()


def event(said: str) -> bytes:
    return said.encode()


def forged(
    file: Path,
    *messages: tuple[int, bytes],
    about: dict[str, str] | None = None,
    made: object = (NODE,),
    events: int = 1,
) -> Path:
    """Write a recording: channel 1 is that of a port, 2 and further ones are those of events."""
    text, texts, blob = mcap._text, mcap._texts, mcap._blob
    out = [MAGIC, of_record(1, text(""), text("hfg"))]
    of_port = {"kind": "output", "node": "a", "port": "out", "type": "int"}
    for number, (topic, told) in enumerate([("a.out", of_port), *[("hfg/events", {})] * events], 1):
        out.append(of_record(3, struct.pack("<H", number), text("s"), text("jsonschema"), blob(b"{}")))
        out.append(of_record(4, struct.pack("<HH", number, number), text(topic), text("json"), texts(told)))
    said = made if isinstance(made, str) else json.dumps(made)
    described = {"graph": "g", "version": "2", "clock": "virtual", "began": "0.0", "commands": said}
    out.append(of_record(12, text("hfg"), texts(described | (about or {}))))
    body = b"".join(
        of_record(5, struct.pack("<HIQQ", channel, 1, at, at), data) for at, (channel, data) in enumerate(messages, 1)
    )
    out.append(chunk(len(body), "", body))
    out += [of_record(15, struct.pack("<I", 0)), of_record(2, struct.pack("<QQI", 0, 0, 0)), MAGIC]
    file.write_bytes(b"".join(out))
    return file


def read_whole(file: Path) -> Recorded:
    """Open a recording as a studio does, and read it to its end."""
    found = Recorded(file)
    found.graph_after(len(found.course.edits))
    for _ in found.course.read():
        pass
    found.close()
    return found


@pytest.mark.parametrize("time", ["1e300", "-1e300", "1e18", '"soon"', "null"])
@pytest.mark.parametrize(
    "said",
    [
        '{"type": "RunStarted", "time": TIME}',
        '{"type": "ActivityChanged", "time": TIME, "node": "a", "active": true}',
        '{"type": "ParameterSet", "time": TIME, "node": "a", "parameter": "x", "value": 1}',
        '{"type": "RunEnded", "time": TIME}',
    ],
)
def test_a_time_that_no_clock_shows_ends_no_studio(tmp_path: Path, said: str, time: str) -> None:
    read_whole(forged(tmp_path / "a.mcap", (2, event(said.replace("TIME", time))), (1, token(1))))


@pytest.mark.parametrize("began", ["1e300", "inf", "nan", "-inf", "soon"])
def test_a_begin_that_is_no_time_ends_no_studio(tmp_path: Path, began: str) -> None:
    found = read_whole(forged(tmp_path / "a.mcap", (1, token(1)), about={"began": began}))
    assert found.began == found.last == 1


def test_events_on_two_channels_end_no_studio(tmp_path: Path) -> None:
    begins = event('{"type": "RunStarted", "time": 0.0}')
    assert read_whole(forged(tmp_path / "a.mcap", (2, begins), (1, token(1)), events=2)).course.is_complete


DEEP = '[{"do": "Note", "path": "", "name": "n", "value": ' + "[" * 100_000


def test_commands_that_are_nested_without_end_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the description of its graph cannot be read"):
        Recorded(forged(tmp_path / "a.mcap", (1, token(1)), made=DEEP))
    with pytest.raises(GraphError, match="not a list of commands"):
        commands.decode(DEEP)


def test_gaps_of_a_graph_are_found_without_trying_each_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []
    decode: Any = vars(recorded)["decode"]

    def counts(data: Any, **rest: Any) -> Any:
        found = decode(data, **rest)
        tried.append(len(found))
        return found

    monkeypatch.setattr(recorded, "decode", counts)
    nodes = [{**NODE, "path": f"a{number}"} for number in range(400)]
    nodes[200] = {**NODE, "type": "nowhere:T", "path": "gap"}
    found = Recorded(forged(tmp_path / "a.mcap", (1, token(1)), made=nodes))
    assert len(found.gaps) == 1
    assert "gap" in found.gaps[0]
    assert set(found.graph_after(0).nodes) == {*(f"a{number}" for number in range(400) if number != 200), "gap"}
    assert len(tried) < 50
    found.close()


def test_of_very_many_gaps_only_some_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded, "_MOST_GAPS", 5)
    nodes = [{**NODE, "type": "nowhere:T", "path": f"a{number}"} for number in range(30)]
    found = Recorded(forged(tmp_path / "a.mcap", (1, token(1)), made=nodes))
    assert len(found.gaps) == 6
    assert "the rest of it is not shown" in found.gaps[-1]
    found.close()


def packed(dtype: str, data: bytes, shape: object = (2,)) -> dict[str, Any]:
    return {"$type": "array", "dtype": dtype, "shape": shape, "data": base64.b64encode(data).decode()}


@pytest.mark.parametrize(
    "value",
    [
        packed("|b1", b"\1\2"),
        packed("<U1", b"\xff" * 8),
        packed([["a", "|b1"], ["b", "<i4"]], (b"\2" + bytes(4)) * 2),  # type: ignore[arg-type]
        {"$type": "number", "dtype": "|b1", "data": base64.b64encode(b"\7").decode()},
    ],
)
def test_bytes_that_numpy_must_not_see_become_no_array(value: object) -> None:
    with pytest.raises(CannotKeep, match="holds values other than 0 and 1|holds an invalid character"):
        Codec(Any).decode(value)


@pytest.mark.parametrize("kind", ["set", "frozenset", "dict"])
def test_numbers_with_one_hash_become_no_set(kind: str) -> None:
    """To put thirty thousand of them into a set takes minutes, and a million takes days."""
    many: list[Any] = [number * PRIME for number in range(1000)]
    value = {"$type": kind, "value": [[one, 1] for one in many] if kind == "dict" else many}
    with pytest.raises(ValueError, match="have the same hash"):
        Codec(Any).decode(value)
    good: list[Any] = [number * 2**40 for number in range(1000)]
    value = {"$type": kind, "value": [[one, 1] for one in good] if kind == "dict" else good}
    assert len(Codec(Any).decode(value)) == 1000
    twice = {"$type": "set", "value": [1] * 5000}
    assert Codec(Any).decode(twice) == {1}


def test_a_value_that_cannot_be_read_is_shown_as_what_it_says(tmp_path: Path) -> None:
    found = Recorded(forged(tmp_path / "a.mcap", (1, token(packed("|b1", b"\1\2")))))
    values = Values(found)
    values.types_of(found.graph_after(0))
    (message,) = found.seeking.messages(1, -1, 9)
    assert values.token(message).value["$type"] == "array"
    found.close()


def firings(file: Path) -> Iterator[Any]:
    with File(file) as recording:
        recording.losses()
        yield from Track(recording, {"a.out": int}, may_pickle=False).firings()


def test_a_number_of_a_firing_that_is_none_is_damage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a message in it is not a token"):
        list(firings(forged(tmp_path / "a.mcap", (1, token(1, firing="many")))))


def test_lost_firings_are_not_put_in_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.recording.tracks._MOST_LOST_IN_ALL", 150)
    file = forged(tmp_path / "a.mcap", *((1, token(1, firing=100 * number)) for number in range(1, 20)))
    damaged = file.read_bytes()
    at = damaged.rindex(of_record(15, struct.pack("<I", 0)))
    file.write_bytes(damaged[:at] + chunk(40, "lz4", b"hello") + damaged[at:])
    assert len(list(firings(file))) == 99 + 19


@pytest.mark.parametrize("garbage", range(120, 240, 9))
def test_a_chunk_behind_garbage_is_found_without_mapping_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, garbage: int
) -> None:
    """If another user cuts a file that is mapped into memory, the process ends."""
    monkeypatch.setattr("hfg.recording.layout._PIECE", 200)
    file = forged(tmp_path / "a.mcap", (1, token(1)))
    good = file.read_bytes()
    with File(file) as recording:
        (piece,) = recording.layout.pieces
    begin = piece.begin - 9
    file.write_bytes(good[:begin] + b"\xff" * garbage + good[begin:])
    with File(file) as recording:
        assert [one.length for one in recording.layout.pieces] == [piece.length]


def test_a_file_that_has_become_shorter_is_damaged(tmp_path: Path) -> None:
    file = forged(tmp_path / "a.mcap", (1, token("x" * 100_000)))
    with File(file) as recording:
        file.write_bytes(b"")
        with pytest.raises(Damaged, match="the file has become shorter"):
            recording.layout._head(50_000, recording.layout.size)


@pytest.mark.parametrize(
    ("messages", "about", "made"),
    [
        ([(1, token(1))], {}, "nonsense"),
        ([(1, token(1))], {}, "5"),
        ([(1, token(1))], {}, "[" * 100_000),
        ([(1, token(1))], {"edges": "[" * 100_000}, (NODE,)),
        *[([(1, token(1))], {"began": began}, (NODE,)) for began in ("1e300", "nan", "-inf", "-9e18")],
        ([(1, b'{"shape": 5}')], {}, (NODE,)),
    ],
)
def test_a_forged_recording_is_compared_in_both_directions(
    tmp_path: Path, messages: list[tuple[int, bytes]], about: dict[str, str], made: object
) -> None:
    good = comparing.read_recording(forged(tmp_path / "good.mcap", (1, token(1)), (1, token(2))))
    bad = comparing.read_recording(forged(tmp_path / "bad.mcap", *messages, about=about, made=made))
    for found in (comparing.compare(good, bad), comparing.compare(bad, good)):
        assert found.first is not None
        assert "first difference" in "\n".join(found.lines())
        assert "first that differs" in comparing.page(found)
