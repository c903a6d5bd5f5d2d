"""A recording that was harmed, cut off, or means harm: what can be read is read, the rest is told, within bounds."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

import hfg
from hfg.cli.app import main
from hfg.errors import HfgError, UsageError
from hfg.nodes.recordings import Playback
from hfg.recording import File, RecordingInfo, play_into, record, recover, writing
from hfg.recording.layout import Layout
from hfg.recording.reading import RawMessage
from hfg.recording.values import CannotKeep, Codec
from tests.limits import patience
from tests.recording import damage
from tests.recording.conftest import build

pytestmark = pytest.mark.rule("L4")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return damage.chunked(tmp_path_factory.mktemp("recorded") / "run.mcap")


Written = Callable[[bytes], Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Puts bytes into a file."""

    def write(data: bytes) -> Path:
        file = tmp_path / "some.mcap"
        file.write_bytes(data)
        return file

    return write


def seen(file: Path) -> tuple[RecordingInfo, list[RawMessage]]:
    """What is known of a file, and its messages."""
    with File(file) as recording:
        return recording.info(), list(recording.messages())


def told(info: RecordingInfo) -> tuple[Any, ...]:
    """What a recording says of itself."""
    return info.graph, info.clock, info.began, info.outcome, info.library, info.commands, info.ports, info.left_out


def in_a_chunk(whole: bytes, number: int) -> int:
    """A place amid what is packed in a chunk."""
    piece = Layout(BytesIO(whole), len(whole)).pieces[number]
    return piece.begin + piece.length - 9


def flipped(data: bytes, at: int, by: int = 255) -> bytes:
    """With one byte that is another."""
    return data[:at] + bytes([data[at] ^ by]) + data[at + 1 :]


def _changed_in_silence(written: Written, whole: bytes, places: Iterator[int], random_: random.Random) -> list[int]:
    info, messages = seen(written(whole))
    found = []
    for at in places:
        file = written(flipped(whole, at, random_.randrange(1, 256)))
        try:
            now, those = seen(file)
        except HfgError:
            continue
        if (those != messages or told(now) != told(info)) and not now.losses:
            found.append(at)
    return found


@pytest.mark.slow
def test_no_byte_can_be_another_in_silence(whole: bytes, written: Written) -> None:
    """Each is tried in the soak; here those of the ends, and some between."""
    seed = random.Random(5)
    some = sorted(seed.sample(range(len(whole)), 150))
    assert _changed_in_silence(written, whole, iter(some), seed) == []


@pytest.mark.soak
def test_no_byte_at_all_can_be_another_in_silence(whole: bytes, written: Written) -> None:
    for seed in range(8):
        assert _changed_in_silence(written, whole, iter(range(len(whole))), random.Random(seed)) == []


def _wrong_cuts(written: Written, whole: bytes, places: Iterator[int]) -> list[int]:
    _, messages = seen(written(whole))
    found = []
    for length in places:
        now, those = seen(written(whole[:length]))
        if those != messages[: len(those)] or now.whole or not now.losses:
            found.append(length)
    return found


def test_a_file_that_was_cut_off_anywhere_gives_what_is_before_and_says_so(whole: bytes, written: Written) -> None:
    some = sorted(random.Random(6).sample(range(8, len(whole)), 100))
    assert _wrong_cuts(written, whole, iter(some)) == []


@pytest.mark.soak
def test_a_file_may_be_cut_off_at_each_byte(whole: bytes, written: Written) -> None:
    assert _wrong_cuts(written, whole, iter(range(8, len(whole)))) == []


def test_one_damaged_chunk_costs_that_chunk_and_its_messages_are_counted(whole: bytes, written: Written) -> None:
    before, messages = seen(written(whole))
    info, those = seen(written(flipped(whole, in_a_chunk(whole, 2))))
    (loss,) = info.losses
    assert loss.what.startswith(f"chunk 3 of {before.chunks} cannot be read: ")
    assert loss.messages == before.messages - info.messages > 0
    missing = [one for one in messages if one not in those]
    assert (loss.first_s, loss.last_s) == (missing[0][1] / 1e9, missing[-1][1] / 1e9)
    assert info.whole


def test_one_damaged_chunk_of_a_file_without_summary_costs_that_chunk(whole: bytes, written: Written) -> None:
    data = flipped(whole, in_a_chunk(whole, 2))
    head = Layout(BytesIO(whole), len(whole)).pieces[1].begin - 9
    info, those = seen(written(flipped(data[:-50], head + 5)))  # nor can the length of another be read
    assert not info.whole
    assert info.chunks == 4
    assert len(those) > 20
    assert [loss.messages for loss in info.losses if loss.messages]


def test_info_says_what_is_lost(whole: bytes, written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(written(flipped(whole, in_a_chunk(whole, 2))))]) == 1
    out = capsys.readouterr().out.splitlines()
    assert out[0].endswith("damaged, see below")
    assert out[-1].startswith("damaged: chunk 3 of 5 cannot be read: ")
    assert "20 messages lost, from 0." in out[-1]


def test_playing_goes_on_behind_a_damaged_chunk_and_the_report_says_so(
    whole: bytes, written: Written, caplog: pytest.LogCaptureFixture
) -> None:
    graph = build()
    playing = play_into(graph, written(flipped(whole, in_a_chunk(whole, 2))))
    assert len(playing.gaps) == 1
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "done"
    assert 20 < report.nodes["show"].firings < 40
    assert len(report.errors) == 1
    assert "is damaged: chunk 3 of 5 cannot be read" in report.errors[0]
    assert "20 messages lost" in report.errors[0]
    assert [one.message for one in caplog.records if one.levelname == "WARNING"] == report.errors


def test_a_source_that_plays_one_port_says_what_it_misses(whole: bytes, written: Written) -> None:
    graph = hfg.Graph("again")
    graph.add(Playback(file=written(flipped(whole, in_a_chunk(whole, 2))), port="camera.out"))
    report = hfg.run(graph, clock="virtual")
    assert ["chunk 3 of 5 cannot be read" in one for one in report.errors] == [True]


def test_recover_makes_a_complete_file_that_says_what_it_lacks(whole: bytes, written: Written, tmp_path: Path) -> None:
    damaged = written(flipped(whole, in_a_chunk(whole, 2)))
    before, messages = seen(damaged)
    count, losses = recover(damaged, tmp_path / "new.mcap")
    assert count == before.messages
    assert losses == before.losses
    after, those = seen(tmp_path / "new.mcap")
    assert sorted(those) == sorted(messages)
    assert after.whole
    assert after.losses == before.losses
    assert told(after)[:4] == told(before)[:4]
    with (tmp_path / "new.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == count == len(list(reader.iter_messages()))
        assert {one.name for one in reader.iter_metadata()} == {"hfg", "hfg:end", "hfg:recovered"}
    graph = build()
    play_into(graph, tmp_path / "new.mcap")
    assert "20 messages lost" in hfg.run(graph, clock="virtual").errors[0]


def test_recover_finishes_a_file_whose_process_was_killed(
    whole: bytes, written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = written(whole[: in_a_chunk(whole, 3)])
    assert main(["recover", str(cut), "-o", str(tmp_path / "new.mcap")]) == 0
    out = capsys.readouterr().out
    assert "it was cut off here; the number of lost messages is unknown" in out
    info, those = seen(tmp_path / "new.mcap")
    assert info.whole
    assert those == seen(cut)[1]


def test_recover_of_a_file_of_which_nothing_is_left_fails(
    whole: bytes, written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = written(whole[: in_a_chunk(whole, 0)])
    assert main(["recover", str(cut), "-o", str(tmp_path / "new.mcap")]) == 1
    assert "new.mcap: 0 messages of " in capsys.readouterr().out
    assert main(["info", str(tmp_path / "new.mcap")]) == 1


def test_playing_a_damaged_recording_fails_and_says_so(
    whole: bytes, written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "plays_damaged.py"
    target.write_text("from tests.recording.test_damaged import build\n\ngraph = build()\n")
    asked = ["--into", str(target), "--clock", "virtual"]
    assert main(["play", str(written(flipped(whole, in_a_chunk(whole, 2)))), *asked]) == 1
    assert capsys.readouterr().err.count("20 messages lost") == 1
    assert main(["play", str(written(whole)), *asked]) == 0


def test_recover_of_a_whole_file_loses_nothing(whole: bytes, written: Written, tmp_path: Path) -> None:
    _, losses = recover(written(whole), tmp_path / "new.mcap")
    assert losses == []
    assert seen(tmp_path / "new.mcap")[1] == seen(written(whole))[1]
    assert seen(tmp_path / "new.mcap")[0].losses == []


def test_recover_writes_over_nothing_unasked(whole: bytes, written: Written, tmp_path: Path) -> None:
    (tmp_path / "new.mcap").write_text("mine")
    with pytest.raises(UsageError, match="already exists"):
        recover(written(whole), tmp_path / "new.mcap")
    with pytest.raises(UsageError, match="is the recording itself"):
        recover(written(whole), written(whole), force=True)
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("name", damage.HOSTILE)
def test_what_lies_in_a_recording_is_told_and_what_is_around_it_is_read(name: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.mcap"
    file.write_bytes(damage.hostile(name))
    info, messages = seen(file)
    assert len(messages) >= 1
    assert info.losses
    text = "\n".join(map(str, info.losses))
    assert any(part in text for part in damage.HOSTILE[name][1].split("|")), text
    graph = hfg.Graph("again")
    graph.add(Playback(file=file, port="a.out"))
    assert hfg.run(graph, clock="virtual").errors or "descriptions" in text
    recover(file, tmp_path / "new.mcap")
    assert seen(tmp_path / "new.mcap")[1] == messages


def test_a_message_nested_without_end_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "deep.mcap").write_bytes(damage.with_message(b"[" * 100_000))
    graph = hfg.Graph("again")
    graph.add(Playback(file=tmp_path / "deep.mcap", port="a.out"))
    with pytest.raises(HfgError, match="is damaged: a message in it is not JSON"):
        hfg.run(graph, clock="virtual")


_BOUNDED = """
import resource, sys
from pathlib import Path
from hfg.recording import File
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for name in sys.argv[1:]:
    with File(name) as recording:
        recording.info()
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.slow
def test_a_few_kilobytes_cost_no_gigabytes(tmp_path: Path) -> None:
    files = []
    for number, name in enumerate(name for name in damage.HOSTILE if "unpacks" in name or "huge" in name):
        files.append(tmp_path / f"{number}.mcap")
        files[-1].write_bytes(damage.hostile(name))
    done = subprocess.run(
        [sys.executable, "-c", _BOUNDED, *map(str, files)],
        capture_output=True,
        text=True,
        check=True,
        timeout=patience(300),
    )
    assert int(done.stdout) < 100, f"{done.stdout} MiB more than before"


def test_a_limit_can_be_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: bytes, written: Written) -> None:
    monkeypatch.setenv("HFG_MOST_CHUNK_BYTES", "100")
    info, messages = seen(written(whole))
    assert not messages
    assert "the limit is 100; if you trust it, set HFG_MOST_CHUNK_BYTES to a larger number" in str(info.losses[0])
    monkeypatch.setenv("HFG_MOST_CHUNK_BYTES", "100000")
    assert seen(written(whole))[1]


def test_losses_are_in_the_json_of_info(whole: bytes, written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--json", str(written(flipped(whole, in_a_chunk(whole, 2))))]) == 1
    found = msgspec.json.decode(capsys.readouterr().out)
    assert [one["messages"] for one in found["losses"]] == [20]


def test_only_data_is_made_of_what_a_recording_names(tmp_path: Path) -> None:
    """An object with fields of somebody's choice could remove a file as it ends."""
    codec = Codec(Any)
    for name in ("tempfile:_TemporaryFileCloser", "subprocess:Popen", "builtins:object"):
        with pytest.raises(CannotKeep, match="is not data: only structs"):
            codec.decode({"$type": "object", "class": name, "fields": {"name": str(tmp_path)}})
        with pytest.raises(CannotKeep, match="is not data: only structs"):
            codec.decode({"$type": "enum", "class": name, "name": "RED"})


@pytest.mark.parametrize(
    "value",
    [
        '{"value": 1, "activity": 7, "stamp": 0.0}',
        '{"value": 1, "activity": [1], "stamp": 0.0}',
        '{"value": 1, "activity": 0, "stamp": "now"}',
        '{"value": {"$type": "array", "dtype": "O", "shape": [1], "data": "AAAAAAAAAAA="}, "stamp": 0.0}',
        '{"value": {"$type": "array", "dtype": "f8", "shape": [99999999999], "data": ""}, "stamp": 0.0}',
        '{"value": {"$type": "timedelta", "value": [99999999999, 0, 0]}, "stamp": 0.0}',
        '{"value": {"$type": "tuple"}, "stamp": 0.0}',
        '{"value": ' + "[" * 900 + "]" * 900 + ', "stamp": 0.0}',
    ],
)
def test_a_message_that_is_no_token_is_a_sentence(tmp_path: Path, value: str) -> None:
    (tmp_path / "bad.mcap").write_bytes(damage.with_message(value.encode()))
    graph = hfg.Graph("again")
    graph.add(Playback(file=tmp_path / "bad.mcap", port="a.out"))
    with pytest.raises(HfgError, match="is damaged: a message in it|a value of .* cannot be read as") as caught:
        hfg.run(graph, clock="virtual")
    assert isinstance(caught.value.__cause__, UsageError)


class Pairs(hfg.Node):
    """Sends multiples of a number by two outputs; a recording of that numbers its firings."""

    factor = hfg.Parameter(1)
    left = hfg.Output(int)
    right = hfg.Output(int)
    sent = hfg.State(0)

    def process(self) -> None:
        """Send the next one."""
        if self.sent == 40:
            raise hfg.EndOfStream
        self.sent += 1
        self.left.send(self.sent * self.factor)
        self.right.send(-self.sent * self.factor)


@hfg.node
def quotient(one: int, other: int) -> float:
    """Tells whether two tokens belong together."""
    return other / one


def joined() -> hfg.Graph:
    graph = hfg.Graph()
    one, other, far = graph.add(Pairs(), name="one"), graph.add(Pairs(factor=7), name="other"), graph.add(quotient())
    graph.connect(one.left, far.one)
    graph.connect(other.right, far.other)
    sums = graph.add(quotient(), name="near")
    graph.connect(one.right, sums.one)
    graph.connect(one.left, sums.other)
    graph.connect(other.left, graph.output("spare", int))
    graph.connect(far.out, graph.output("out", float))
    graph.connect(sums.out, graph.output("near", float))
    return graph


@pytest.mark.parametrize("number", range(1, 7))
def test_sources_stay_aligned_behind_a_chunk_that_is_lost(
    tmp_path: Path, written: Written, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """Firings that are lost are silence, as far as the numbers of others tell."""
    monkeypatch.setattr(writing, "_CHUNK_MESSAGES", 17)
    monkeypatch.setattr(writing, "_BATCH", 17)
    first = hfg.run(joined(), clock="virtual", begin=lambda run: record(run, tmp_path / "run.mcap"))
    assert first.outputs["out"] == [-7.0] * 40
    data = (tmp_path / "run.mcap").read_bytes()
    graph = joined()
    playing = play_into(graph, written(flipped(data, in_a_chunk(data, number))), speed=None)
    assert "is damaged" in playing.gaps[0]
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "done"
    assert 0 < len(report.outputs["out"]) < 40
    assert set(report.outputs["out"]) == {-7.0}
    assert set(report.outputs["near"]) == {-1.0}


def test_sources_of_one_output_have_no_numbers_and_that_is_said(
    tmp_path: Path, written: Written, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "_CHUNK_MESSAGES", 17)
    monkeypatch.setattr(writing, "_BATCH", 17)
    hfg.run(joined(), clock="virtual", begin=lambda run: record(run, tmp_path / "run.mcap", select=["*.left"]))
    data = (tmp_path / "run.mcap").read_bytes()
    said = [
        f'firings of "{node}" have no numbers in the recording because only one output of it was recorded: lost '
        "firings are not played as silence, and later tokens may meet other tokens in a join"
        for node in ("one", "other")
    ]
    assert play_into(joined(), written(data)).gaps == []
    assert play_into(joined(), written(flipped(data, in_a_chunk(data, 1)))).gaps[1:] == said
