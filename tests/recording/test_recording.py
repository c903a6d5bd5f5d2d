"""What passes is written, the file is one that the format's own reader likes, and whoever records is told the truth."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

import hfg
from hfg.errors import UsageError
from hfg.images import Color
from hfg.recording import File, Recording, RecordingInfo, record
from hfg.testing import Recorder
from hfg.testing.nodes import Script, Tally, double, script, sink
from tests.recording.conftest import build, camera, show


def recorded(graph: hfg.Graph, file: Path, **options: Any) -> Recording:
    """Run it in virtual time to its end."""
    found: list[Recording] = []
    hfg.run(graph, clock="virtual", begin=lambda run: found.append(record(run, file, **options)))
    assert found[0].error is None
    return found[0]


def info(file: Path) -> RecordingInfo:
    """What is known of it."""
    with File(file) as recording:
        return recording.info()


def messages(file: Path) -> list[tuple[str, int, Any]]:
    """Read it with the package's own reader, which looks at every checksum."""
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        found, checked = [], set()
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            body = json.loads(message.data)
            if channel.topic not in checked:  # one of each kind: the check is slow
                checked.add(channel.topic)
                jsonschema.validate(body, json.loads(schema.data))
            found.append((channel.topic, message.log_time, body))
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(found)
        list(reader.iter_metadata())
    return found


def test_values_markers_modifiers_and_signals_are_written_in_their_order(tmp_path: Path) -> None:
    graph = hfg.Graph("all")
    source, tally = graph.add(Script(), max_rate_hz=10), graph.add(Tally())
    graph.start.activates(source.activate)
    graph.connect(source.out, tally.value, active=True)
    graph.connect(source.seen, tally.note)
    recorded(graph, tmp_path / "run.mcap")
    found = [(topic, body) for topic, _, body in messages(tmp_path / "run.mcap") if not topic.startswith("hfg/events")]
    assert found == [
        ("script.out", {"value": 1, "activity": 1, "stamp": 0.0, "sequence": 1}),
        ("script.seen", {"value": 2, "activity": 0, "stamp": 0.1, "sequence": 0}),
        ("script.out", {"value": 2, "activity": 0, "stamp": 0.1, "sequence": 2}),
        ("script.out", {"value": 3, "activity": 0, "stamp": 0.2, "sequence": 3}),
        ("tally.full", {"value": 4, "activity": 0, "stamp": 0.2, "sequence": 0}),
        ("hfg/markers", {"port": "script.out", "marker": "END", "stamp": 0.3, "sequence": 4}),
    ]


def test_activity_parameters_and_the_graph_are_written_too(tmp_path: Path) -> None:
    graph = hfg.Graph("all")
    source, tally = graph.add(Script(), max_rate_hz=10), graph.add(Tally())
    graph.start.activates(source.activate)
    graph.connect(source.out, tally.value, active=True)

    async def main() -> None:
        async with hfg.running(graph) as run, run.record(tmp_path / "run.mcap"):
            run.set("script.count", 2)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    events = [body for topic, _, body in messages(tmp_path / "run.mcap") if topic == "hfg/events"]
    assert [(one["node"], one["active"]) for one in events if one["type"] == "ActivityChanged"] == [
        ("script", True),
        ("script", False),
        ("tally", True),
    ]
    assert [(one["parameter"], one["value"]) for one in events if one["type"] == "ParameterSet"] == [("count", 2)]
    commands = hfg.commands.decode(info(tmp_path / "run.mcap").commands)
    again = hfg.Graph("again")
    again.edit(*commands)
    assert list(again.nodes) == ["script", "tally"]


@pytest.mark.parametrize(
    ("select", "ports"),
    [
        ("*", ["camera.out", "double.out"]),
        ("camera", ["camera.out"]),
        (["double.*", "show.value"], ["double.out", "show.value"]),
        ("camera.processed", ["camera.processed"]),
    ],
)
def test_ports_are_selected_by_path_by_node_or_by_pattern(tmp_path: Path, select: Any, ports: list[str]) -> None:
    assert recorded(build(), tmp_path / "run.mcap", select=select).ports == ports


def test_a_port_of_several_is_selected_by_its_path(tmp_path: Path) -> None:
    class Eyes(hfg.Node):
        seen = hfg.Outputs(int)

        def process(self) -> None:
            for port in self.seen:
                port.send(1)
            raise hfg.EndOfStream

    graph = hfg.Graph()
    eyes = graph.add(Eyes(seen=2), name="eyes")
    for port in eyes.seen:
        graph.connect(port, graph.add(show()).ports.inputs["value"])
    assert recorded(graph, tmp_path / "run.mcap", select="eyes.seen[1]").ports == ["eyes.seen[1]"]


def test_ports_inside_of_subgraphs_have_their_paths(tmp_path: Path) -> None:
    class Box(hfg.Subgraph):
        into = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            self.into.inner >> graph.add(double()) >> self.out.inner

    graph = hfg.Graph()
    box = graph.add(Box(), name="box")
    graph.connect(graph.add(camera()).out, box.into)
    graph.connect(box.out, graph.add(show()).ports.inputs["value"])
    assert recorded(graph, tmp_path / "run.mcap", select="box/*").ports == ["box/double.out"]


@hfg.node
def frames() -> Iterator[Color]:
    """Give pictures, all in the same memory once nobody needs the last one."""
    buffer = np.zeros((4, 6, 3), np.uint8)
    for number in range(3):
        buffer[:] = number
        yield buffer


@hfg.node
def look(image: Color) -> None:
    """Take it."""


@pytest.mark.parametrize("images", ["raw", "png"])
def test_images_have_the_schemas_of_foxglove_and_are_copied(tmp_path: Path, images: Any) -> None:
    graph = hfg.Graph()
    graph.add(frames()) >> graph.add(look())
    recorded(graph, tmp_path / "run.mcap", images=images)
    with (tmp_path / "run.mcap").open("rb") as stream:
        found = [
            (schema.name, json.loads(message.data))
            for schema, _, message in make_reader(stream).iter_messages(topics=["frames.out"])
            if schema is not None
        ]
    assert {name for name, _ in found} == {"foxglove.RawImage" if images == "raw" else "foxglove.CompressedImage"}
    if images == "raw":
        first = found[0][1]
        assert (first["width"], first["height"], first["encoding"], first["step"]) == (6, 4, "bgr8", 18)
    graph = hfg.Graph()
    graph.add(frames()) >> graph.add(look())
    hfg.recording.play_into(graph, tmp_path / "run.mcap")
    seen = Recorder()
    hfg.run(graph, clock="virtual", trace=seen)
    values = [value for value in seen.values("frames.out") if isinstance(value, np.ndarray)]
    assert [(value.shape, value.dtype, int(value.max())) for value in values] == [
        ((4, 6, 3), np.dtype(np.uint8), number) for number in range(3)
    ]


class Handle:
    """No data."""


@hfg.node
def handles() -> Iterator[Handle]:
    """Give what cannot be written."""
    yield Handle()


@hfg.node
def anything() -> Iterator[Any]:
    """Give data, and now and then none."""
    yield from (1, Handle(), 3)


@hfg.node
def take(value: Any) -> None:
    """Take it."""


def test_a_port_whose_values_are_no_data_is_refused_before_there_is_a_file(tmp_path: Path) -> None:
    graph = hfg.Graph()
    graph.add(handles()) >> graph.add(take())
    with pytest.raises(
        UsageError, match=r'values of "handles.out" cannot be recorded: .*Handle is not data.*pickle=True'
    ):
        recorded(graph, tmp_path / "run.mcap")
    assert not (tmp_path / "run.mcap").exists()


def test_a_value_that_is_no_data_is_left_out_told_once_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    graph = hfg.Graph()
    graph.add(anything()) >> graph.add(take())
    with caplog.at_level(logging.ERROR, "hfg.recording"):
        found = recorded(graph, tmp_path / "run.mcap")
    assert found.left_out == {"anything.out": 1}
    assert [one.message for one in caplog.records if one.name == "hfg.recording"] == [
        'values of "anything.out" cannot be recorded: tests.recording.test_recording.Handle is not data that JSON can '
        "hold; make it a dataclass, record without this port, or allow pickle=True, which other programs cannot read"
    ]
    assert info(tmp_path / "run.mcap").refused == {"anything.out": 1}


def test_wrong_wishes_are_refused_with_the_remedy(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with pytest.raises(UsageError, match='no port matches "foo\\*"; the sending ports are "camera.out", "double.out"'):
        recorded(build(), file, select="foo*")
    with pytest.raises(UsageError, match='there is no port "camera.ou" to record; did you mean "camera.out"'):
        recorded(build(), file, select="camera.ou")
    with pytest.raises(UsageError, match="select= is empty; it selects the ports"):
        recorded(build(), file, select=[])
    with pytest.raises(UsageError, match="cannot write the recording to .*nowhere"):
        recorded(build(), tmp_path / "nowhere" / "run.mcap")
    file.write_text("mine")
    with pytest.raises(UsageError, match="already exists: choose another name, or overwrite it with"):
        recorded(build(), file)
    assert file.read_text() == "mine"
    recorded(build(), file, force=True)
    assert messages(file)


def test_two_may_record_one_run_and_one_of_them_only_a_part(tmp_path: Path) -> None:
    graph = build(count=30)

    async def main() -> None:
        async with hfg.running(graph) as run:
            async with run.record(tmp_path / "part.mcap", select="camera"):
                run.record(tmp_path / "whole.mcap")
                await asyncio.sleep(0.1)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    whole = [body["value"] for topic, _, body in messages(tmp_path / "whole.mcap") if topic == "camera.out"]
    part = [body["value"] for topic, _, body in messages(tmp_path / "part.mcap") if topic == "camera.out"]
    assert whole == list(range(30))
    assert part == list(range(10))


def test_a_node_that_comes_by_an_edit_is_recorded_too(tmp_path: Path) -> None:
    graph = build(count=30)

    async def main() -> None:
        async with hfg.running(graph) as run:
            run.record(tmp_path / "run.mcap")
            await run.edit(
                hfg.commands.Add("hfg.testing.nodes:double", "again"),
                hfg.commands.Add("hfg.testing.nodes:sink", "last"),
                hfg.commands.Connect("double.out", "again.value"),
                hfg.commands.Connect("again.out", "last.value"),
            )
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert [body["value"] for topic, _, body in messages(tmp_path / "run.mcap") if topic == "again.out"][-1] == 4 * 29


class SlowDisk:
    """Holds every chunk back until it may go on."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.mark.slow
def test_without_loss_nothing_is_missing_however_far_the_disk_is_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hfg.recording.recorder.MOST_ITEMS", 100)
    monkeypatch.setattr("hfg.recording.recorder._WAKE_AFTER", 30)
    for clock in ("virtual", "real"):
        graph = build(count=5000, rate=None)
        found: list[Recording] = []
        file = tmp_path / f"{clock}.mcap"
        hfg.run(graph, clock=clock, begin=lambda run, file=file, found=found: found.append(record(run, file)))  # type: ignore[misc]
        assert found[0].left_out == {}
        assert found[0].held_s > 0
        values = [body["value"] for topic, _, body in messages(file) if topic == "camera.out"]
        assert values == list(range(5000))


def test_what_there_is_no_time_for_is_counted_in_the_file_and_the_rest_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hfg.recording.recorder.MOST_ITEMS", 100)
    monkeypatch.setattr("hfg.recording.recorder._WAKE_AFTER", 30)
    found = recorded(build(count=5000, rate=None), tmp_path / "run.mcap", lossless=False)
    assert found.held_s == 0
    left_out = found.left_out.get("camera.out", 0)
    values = [body["value"] for topic, _, body in messages(tmp_path / "run.mcap") if topic == "camera.out"]
    ends = [body["port"] for topic, _, body in messages(tmp_path / "run.mcap") if topic == "hfg/markers"]
    assert left_out > 0
    assert left_out + len(values) + ends.count("camera.out") == 5001  # its END among them
    assert values == sorted(values)
    assert info(tmp_path / "run.mcap").left_out["camera.out"] == left_out


def test_a_full_disk_ends_the_recording_and_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Full:
        def __init__(self, stream: Any) -> None:
            self._stream = stream
            self._left = 3000

        def write(self, data: bytes) -> int:
            if len(data) > self._left:
                raise OSError(28, "No space left on device")
            self._left -= len(data)
            return int(self._stream.write(data))

        def __getattr__(self, name: str) -> Any:
            return getattr(self._stream, name)

    monkeypatch.setattr("hfg.recording.writing._CHUNK_BYTES", 1000)
    monkeypatch.setattr("hfg.recording.recording.open_new", lambda path, force: Full(path.open("xb")))
    found: list[Recording] = []
    report = hfg.run(
        build(count=20_000, rate=None),
        clock="virtual",
        begin=lambda run: found.append(record(run, tmp_path / "run.mcap")),
    )
    assert report.outcome == "done"
    assert isinstance(found[0].error, OSError)
    assert "is incomplete, writing has stopped:" in caplog.text


@pytest.mark.parametrize("cut", [1, 40, 300])
def test_a_file_opens_up_to_its_last_whole_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cut: int) -> None:
    monkeypatch.setattr("hfg.recording.writing._CHUNK_BYTES", 500)
    monkeypatch.setattr("hfg.recording.writing._BATCH", 20)
    file = tmp_path / "run.mcap"
    recorded(build(count=200), file)
    whole = info(file)
    data = file.read_bytes()
    end = data.rindex(b"hfg:end")
    file.write_bytes(data[: end - cut])
    found = info(file)
    assert whole.whole
    assert not found.whole
    assert 0 < found.messages <= whole.messages
    assert found.chunks >= whole.chunks - 2
    graph = build()
    hfg.recording.play_into(graph, file)
    assert hfg.run(graph, clock="virtual").outcome == "done"


@pytest.mark.rule("R7", "F7")
@pytest.mark.parametrize("fuse_after", [0, 10**9])
def test_taps_see_the_same_tokens_in_fused_regions(fuse_after: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A region makes a token where somebody looks, numbered as its edge does, silence included."""
    from hfg.testing.nodes import some

    graph = hfg.Graph()
    source, even, twice, last = (
        graph.add(script(values=tuple(range(40)))),
        graph.add(some()),
        graph.add(double()),
        graph.add(sink()),
    )
    source >> even >> twice >> last
    seen: dict[str, list[Any]] = {}

    class Looker:
        def __init__(self, path: str) -> None:
            self.tokens = seen.setdefault(path, [])

        def put(self, token: Any) -> None:
            self.tokens.append(token)

        def end(self) -> None:
            pass

    def begin(run: hfg.Run) -> None:
        for path in ("script.out", "some.out", "double.out"):
            run._parts.taps.look(path, Looker(path))

    monkeypatch.setattr("hfg.engine.runtime.settings.FUSE_AFTER", fuse_after)
    hfg.run(graph, clock="virtual", begin=begin)
    for path, factor in (("script.out", 1), ("some.out", 1), ("double.out", 2)):
        tokens = seen[path]
        assert [token.sequence for token in tokens] == list(range(1, 42))
        values = [None if token.is_marker else token.value for token in tokens[:-1]]
        silent = path != "script.out"
        assert values == [None if silent and number % 2 else factor * number for number in range(40)]
        assert tokens[-1].value is hfg.END


@hfg.node
async def ends_later() -> AsyncIterator[int]:
    """Give one value, and end after its code has let others go on."""
    yield 1
    await asyncio.sleep(0)


@pytest.mark.rule("F7", "R6")
@pytest.mark.parametrize(("source", "waited"), [(ends_later, True), (camera, None)])
def test_an_end_says_whether_the_source_had_waited_before_it(tmp_path: Path, source: Any, waited: bool | None) -> None:
    graph = hfg.Graph("ends")
    graph.add(source(), name="source") >> graph.add(show())
    recorded(graph, tmp_path / "run.mcap")
    ends = [body.get("waited") for topic, _, body in messages(tmp_path / "run.mcap") if topic == "hfg/markers"]
    assert ends == [waited]
