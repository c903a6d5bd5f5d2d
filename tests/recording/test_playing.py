"""What was recorded comes out again: the same tokens on every edge, to the bit, as fast as one likes."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import UsageError
from hfg.graph.flat import flatten
from hfg.nodes.recordings import Playback
from hfg.recording import play_into, record
from hfg.recording.messages import Firings
from hfg.testing import Recorder
from hfg.testing.nodes import Script, Tally, ascript, double, sink
from tests.recording.conftest import build, camera, show
from tests.support.making import SYNCHRONOUS, Allowed, random_plan


def run(graph: hfg.Graph, file: Path | None = None) -> Recorder:
    """Run it in virtual time, recorded into the file."""
    seen = Recorder()
    begin = None if file is None else (lambda run: record(run, file, force=True))
    hfg.run(graph, clock="virtual", trace=seen, begin=begin)
    return seen


def mixed() -> hfg.Graph:
    """Sources of all kinds, signals, silence and activity."""
    graph = hfg.Graph("mixed")
    graph.add(ascript(values=(1, None, 3), pause_s=0.1)) >> graph.add(double()) >> graph.add(sink())
    source, tally = graph.add(Script(count=5), max_rate_hz=10), graph.add(Tally())
    graph.connect(source.out, tally.value, active=True)
    graph.connect(source.seen, tally.note, active=True)
    graph.start.activates(source.activate)
    return graph


@pytest.mark.rule("R6")
def test_a_run_played_into_its_graph_is_the_same_on_every_edge(tmp_path: Path) -> None:
    first = run(mixed(), tmp_path / "run.mcap")
    graph = mixed()
    playing = play_into(graph, tmp_path / "run.mcap")
    second = run(graph)
    assert sorted(playing.played) == ["ascript.out", "script.out", "script.seen"]
    assert playing.recomputed == ["double.out", "tally.full"]
    assert first.edges()
    for edge in first.edges():
        assert second.tokens(edge) == first.tokens(edge), edge
    assert second.activity() == first.activity()


def _outcome(graph: hfg.Graph, file: Path | None = None, clock: Any = "virtual") -> tuple[Recorder, str]:
    """Run it, and say how that went; a stall and an error are to be the same again, too."""
    seen = Recorder()
    begin = None if file is None else (lambda run: record(run, file, force=True))
    try:
        hfg.run(graph, clock=clock, trace=seen, begin=begin)
    except (hfg.errors.Stalled, hfg.errors.NodeError) as error:
        return seen, type(error).__name__
    return seen, "done"


def _differs(seed: int, allowed: Allowed, file: Path) -> list[str]:
    """Record one random graph and play it back; what is not the same."""
    plan = random_plan(seed, allowed)
    first, how = _outcome(plan.build(), file)
    graph = plan.build()
    playing = play_into(graph, file)
    second, how_again = _outcome(graph)
    resting = tuple(f"{path}." for path in playing.rest)
    played = {edge.label for edge in flatten(graph).edges if not _is_of(edge.label, resting)}
    found = [edge for edge in first.edges() if edge in played and second.tokens(edge) != first.tokens(edge)]
    found += [edge for edge in second.edges() if edge not in first.edges()]
    if [one for one in first.activity() if one[1] not in playing.rest] != second.activity():
        found.append("activity")
    return [*found, *([] if how == how_again else [f"{how}, then {how_again}"])]


def _is_of(edge: str, nodes: tuple[str, ...]) -> bool:
    return bool(nodes) and any(part.startswith(nodes) for part in edge.split(" -> "))


@pytest.mark.slow
@pytest.mark.rule("F7", "R6", "A3", "A5", "F9", "F13")
@pytest.mark.parametrize("allowed", [SYNCHRONOUS, Allowed()], ids=["synchronous", "with all that there is"])
def test_a_hundred_random_graphs_are_the_same_on_every_edge_when_they_are_played_back(
    tmp_path: Path, allowed: Allowed
) -> None:
    logging.disable(logging.CRITICAL)
    try:
        found = {seed: _differs(seed, allowed, tmp_path / "run.mcap") for seed in range(100)}
    finally:
        logging.disable(logging.NOTSET)
    assert {seed: differs for seed, differs in found.items() if differs} == {}


@pytest.mark.slow
@pytest.mark.rule("F3", "F7")
@pytest.mark.parametrize("speed", [None, 1.0], ids=["as fast as can be", "in its time"])
def test_random_graphs_recorded_on_the_real_clock_send_the_same_when_they_are_played_back(
    tmp_path: Path, speed: float | None
) -> None:
    logging.disable(logging.CRITICAL)
    try:
        found = {seed: _differs_on_the_real_clock(seed, tmp_path / "run.mcap", speed) for seed in range(60)}
    finally:
        logging.disable(logging.NOTSET)
    assert {seed: differs for seed, differs in found.items() if differs} == {}


def _differs_on_the_real_clock(seed: int, file: Path, speed: float | None) -> list[str]:
    """Record a graph on the real clock and play it back; the edges that differ, but for stamps."""
    plan = random_plan(seed, replace(SYNCHRONOUS, pairs=True, rates=False))
    first, how = _outcome(plan.build(), file, clock="real")
    graph = plan.build()
    play_into(graph, file, speed=speed)
    second, how_again = _outcome(graph)
    found = [edge for edge in second.edges() if not _begin_alike(_sent(first, edge), _sent(second, edge))]
    return [*found, *([] if how == how_again else [f"{how}, then {how_again}"])]


def _begin_alike(first: list[Any], second: list[Any]) -> bool:
    """A source that is given up, and one in a graph that stalls, may have come further once than again (F7)."""
    both = min(len(first), len(second))
    return first[:both] == second[:both]


def _sent(seen: Recorder, edge: str) -> list[tuple[Any, int]]:
    return [(token.value, token.activity) for token in seen.tokens(edge)]


def test_silence_stamps_and_the_end_are_played_at_their_times(tmp_path: Path) -> None:
    run(mixed(), tmp_path / "run.mcap")
    graph = hfg.Graph()
    player = graph.add(Playback(file=tmp_path / "run.mcap", port="ascript.out"), name="player")
    graph.connect(player.out, graph.add(sink()).ports.inputs["value"])
    seen = run(graph)
    sent = [event for event in seen.of(hfg_trace_sent()) if event.edge.startswith("player.out")]
    assert [(round(event.time, 9), event.token.stamp, event.token.value) for event in sent] == [
        (0.1, 0.0, 1),
        (0.2, 0.1, hfg.NO_MESSAGE),
        (0.3, 0.2, 3),
        (0.3, 0.3, hfg.END),
    ]


def hfg_trace_sent() -> type:
    """The event of a token that is sent."""
    from hfg.trace import TokenSent

    return TokenSent


@pytest.mark.parametrize(("speed", "seconds"), [(1.0, 0.2), (2.0, 0.1), (0.5, 0.4), (None, 0.0)])
def test_time_goes_faster_or_slower_as_one_likes(tmp_path: Path, speed: float | None, seconds: float) -> None:
    run(build(count=20), tmp_path / "run.mcap")
    graph = build()
    play_into(graph, tmp_path / "run.mcap", speed=speed)
    seen = run(graph)
    assert [value for value in seen.values("camera.out") if value is not hfg.END] == list(range(20))
    assert seen[-1].time == pytest.approx(seconds)


def test_a_recorded_port_feeds_any_other_that_is_named(tmp_path: Path) -> None:
    run(build(count=3), tmp_path / "run.mcap")
    graph = hfg.Graph()
    graph.add(camera(count=0), name="other") >> graph.add(show(), name="screen")
    playing = play_into(graph, tmp_path / "run.mcap", ports={"double.out": "screen.value"})
    seen = run(graph)
    assert playing.played == {"double.out": "screen.value"}
    assert seen.values("playback_0.out -> screen.value") == [0, 2, 4, hfg.END]


@pytest.mark.rule("X3", "R5")
def test_a_player_that_is_stopped_has_sent_what_was_due_and_leaves_the_file_closed(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    run(build(count=20), file)
    graph = hfg.Graph()
    player = graph.add(Playback(file=file, port="double.out"), name="player")
    screen = graph.add(show(), name="screen")
    graph.connect(player.out, screen.ports.inputs["value"])
    seen = Recorder()
    report = hfg.run(graph, clock="virtual", trace=seen, until_s=0.055)
    assert report.outcome == "until"
    assert seen.values("player.out -> screen.value") == [0, 2, 4, 6, 8, 10]
    assert player._recording._stream.closed
    again = build(count=20)
    play_into(again, file)
    again.connect(again.add(Stopper(), name="stopper").enough, again.stop)
    again.connect(again["double.out"], again["stopper.count"])
    second = Recorder()
    hfg.run(again, clock="virtual", trace=second)
    assert second.values("camera.out") == [0, 1, 2]
    assert again["camera"]._recording._stream.closed


class Stopper(hfg.Node):
    """Has enough after a few."""

    enough = hfg.Event()
    seen = hfg.State(0)

    @hfg.slot
    def count(self, value: int) -> None:
        """Take one."""
        self.seen += 1
        if self.seen == 3:
            self.enough.trigger()


def test_what_led_only_to_played_nodes_rests(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    hfg.run(build(count=3), clock="virtual", begin=lambda run: record(run, file, select="double"))
    graph = build()
    playing = play_into(graph, file)
    seen = run(graph)
    assert playing.rest == ["camera"]
    assert seen.firings("camera") == 0
    assert seen.values("double.out") == [0, 2, 4, hfg.END]


def test_playing_is_an_edit_that_can_be_undone(tmp_path: Path) -> None:
    run(build(count=3), tmp_path / "run.mcap")
    graph = build(count=5)
    play_into(graph, tmp_path / "run.mcap")
    graph.undo()
    assert run(graph).values("camera.out") == [0, 1, 2, 3, 4, hfg.END]


@hfg.node
def texts() -> Iterator[str]:
    """Give texts."""
    yield "a"


@hfg.node
def read(value: str) -> None:
    """Take one."""


def test_what_does_not_fit_is_said(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with pytest.raises(UsageError, match="cannot open the recording .*: No such file"):
        play_into(build(), file)
    file.write_bytes(b"no")
    with pytest.raises(UsageError, match="is not an MCAP file;"):
        play_into(build(), file)
    run(build(count=3), file)
    other = hfg.Graph("other")
    other.add(texts()) >> other.add(read())
    with pytest.raises(UsageError, match='graph "other" has none of the ports that were recorded .*"camera.out"'):
        play_into(other, file)
    with pytest.raises(UsageError, match='no port "camera.ou" was recorded .* did you mean "camera.out"'):
        play_into(build(), file, ports={"camera.ou": "double.value"})
    with pytest.raises(UsageError, match='the graph has no "double.valu"'):
        play_into(build(), file, ports={"camera.out": "double.valu"})
    with pytest.raises(UsageError, match="speed= is a factor of the"):
        play_into(build(), file, speed=0.0)


def test_a_type_that_no_longer_fits_names_port_and_value(tmp_path: Path) -> None:
    run(build(count=3), tmp_path / "run.mcap")
    graph = hfg.Graph()
    graph.add(texts(), name="camera") >> graph.add(read())
    play_into(graph, tmp_path / "run.mcap")
    with pytest.raises(hfg.errors.NodeError, match='"camera.out" in .* has the value 0, which is not str'):
        hfg.run(graph, clock="virtual")


# --- firings ----------------------------------------------------------------------------------------------------------


class Camera(hfg.Node):
    """Sends a picture and its number; every third picture is silence, and the fifth is the last."""

    image = hfg.Output(int)
    number = hfg.Output(int)
    count = hfg.State(0)

    def process(self) -> None:
        """Take one."""
        if self.count == 5:
            raise hfg.EndOfStream
        self.count += 1
        self.number.send(self.count)
        if self.count % 3:
            self.image.send(-self.count)


@hfg.node
def pair(image: int, number: int) -> str:
    """Join the two."""
    return f"{image} {number}"


def two_outputs(name: str = "camera", kind: type[hfg.Node] = Camera) -> hfg.Graph:
    """A source with two outputs and a join behind it."""
    graph = hfg.Graph("two")
    source, join = graph.add(kind(), name=name), graph.add(pair(), name="pair")
    first, second = source.ports.outputs.values()
    graph.connect(first, join.ports.inputs["image"])
    graph.connect(second, join.ports.inputs["number"])
    graph.connect(join.ports.outputs["out"], graph.output("out", str))
    return graph


PAIRS = ["-1 1", "-2 2", "-4 4", "-5 5"]


@pytest.mark.rule("F3")
@pytest.mark.parametrize("clock", ["real", "virtual"])
@pytest.mark.parametrize("select", ["*", "camera"])
def test_a_firing_of_a_source_with_two_outputs_is_one_firing_again(tmp_path: Path, clock: Any, select: str) -> None:
    file = tmp_path / "run.mcap"
    first = hfg.run(two_outputs(), clock=clock, begin=lambda run: record(run, file, select=select))
    graph = two_outputs()
    play_into(graph, file, speed=None)
    second = hfg.run(graph)
    assert first.outputs["out"] == second.outputs["out"] == PAIRS
    assert second.nodes["camera"].firings == first.nodes["camera"].firings


@pytest.mark.rule("F3")
def test_a_recording_without_numbers_of_firings_is_played_by_the_order_of_its_tokens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run.mcap"
    monkeypatch.setattr("hfg.recording.messages.Firings.number", lambda self, path: 0)  # as version 1 had it
    monkeypatch.setattr("hfg.recording.recording.VERSION", 1)
    hfg.run(two_outputs(), begin=lambda run: record(run, file))
    graph = two_outputs()
    playing = play_into(graph, file, speed=None)
    assert [gap.partition(" because")[0] for gap in playing.gaps] == [
        'firings of "camera" have no numbers in the recording'
    ]
    assert hfg.run(graph).outputs["out"] == PAIRS


class Mixed(Camera):
    """A camera whose second picture is no data."""

    image = hfg.Output(Any)

    def process(self) -> None:
        """Take one."""
        if self.count == 5:
            raise hfg.EndOfStream
        self.count += 1
        self.image.send(object() if self.count == 2 else -self.count)
        self.number.send(self.count)


@pytest.mark.rule("F3", "L2")
def test_silence_stands_in_for_a_value_that_cannot_be_recorded_so_that_joins_stay_aligned(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "run.mcap"
    hfg.run(two_outputs(kind=Mixed), begin=lambda run: record(run, file, select="camera"))
    graph = two_outputs()
    playing = play_into(graph, file, speed=None)
    report = hfg.run(graph)
    assert report.outputs["out"] == ["-1 1", "-3 3", "-4 4", "-5 5"]
    assert playing.gaps == ['"camera.image": 1 token is not in the recording: such values are not data']
    assert report.errors == playing.warnings
    assert playing.gaps[0] in caplog.text


def test_firings_between_which_tokens_were_left_out_are_not_put_together() -> None:
    firings = Firings()
    assert [firings.number(port) for port in ("a", "b", "a", "b", "a")] == [1, 1, 2, 2, 3]
    firings.end()  # there was no room for the rest of the third and the beginning of the fourth
    assert [firings.number(port) for port in ("b", "a")] == [4, 4]
    firings.end()
    firings.end()
    assert firings.number("a") == 5


# --- other graphs -----------------------------------------------------------------------------------------------------


class Webcam(hfg.Node):
    """Another camera: its ports have other names."""

    frame = hfg.Output(int)
    index = hfg.Output(int)

    def process(self) -> None:
        """Open the device."""
        raise AssertionError("the device is opened")


def test_outputs_are_played_as_those_that_a_map_names(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    hfg.run(two_outputs(), clock="virtual", begin=lambda run: record(run, file))
    graph = two_outputs("front", Webcam)
    playing = play_into(graph, file, ports={"camera.image": "front.frame", "camera.number": "front.index"})
    assert playing.played == {"camera.image": "front.frame", "camera.number": "front.index"}
    assert playing.recomputed == ["pair.out"]
    assert playing.warnings == []
    assert hfg.run(graph, clock="virtual").outputs["out"] == PAIRS


def test_recorded_ports_and_sources_that_have_no_counterpart_are_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "run.mcap"
    hfg.run(two_outputs(), clock="virtual", begin=lambda run: record(run, file))
    graph = two_outputs("front", Webcam)
    graph.add(texts()) >> graph.add(read())
    playing = play_into(graph, file, ports={"camera.image": "front.frame"})
    assert playing.warnings == [
        '"camera.number" was recorded, but the graph has no such port, so it is not played',
        '"front.index" was not recorded, so it is silent',
        'source "texts" was not recorded, so its own code runs',
    ]
    assert hfg.run(graph, clock="virtual").errors == playing.warnings
    assert all(sentence in caplog.text for sentence in playing.warnings)
    assert hfg.run(two_outputs(), clock="virtual").errors == []


def test_ports_of_two_recorded_nodes_cannot_be_played_by_one(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    graph = two_outputs()
    graph.add(camera(), name="other") >> graph.add(show())
    hfg.run(graph, clock="virtual", begin=lambda run: record(run, file))
    with pytest.raises(UsageError, match=", and the firings of one node come from one recorded node"):
        play_into(two_outputs("front", Webcam), file, ports={"camera.image": "front.frame", "other.out": "front.index"})
    with pytest.raises(UsageError, match='"camera.image" cannot be played as "pair.processed"'):
        play_into(two_outputs(), file, ports={"camera.image": "pair.processed"})
    with pytest.raises(UsageError, match='played into a port, but "pair" is not a port;'):
        play_into(two_outputs(), file, ports={"camera.image": "pair"})
