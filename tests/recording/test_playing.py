"""What was recorded comes out again: the same tokens on every edge, to the bit, as fast as one likes."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest

import hfg
from hfg.errors import UsageError
from hfg.graph.flat import flatten
from hfg.nodes.recordings import Playback
from hfg.recording import play_into, record
from hfg.testing import Recorder
from hfg.testing.making import SYNCHRONOUS, Allowed, random_plan
from hfg.testing.nodes import Script, Tally, ascript, double, sink
from tests.recording.conftest import build, camera, show


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


def _outcome(graph: hfg.Graph, file: Path | None = None) -> tuple[Recorder, str]:
    """Run it, and say how that went; a stall and an error are to be the same again, too."""
    seen = Recorder()
    begin = None if file is None else (lambda run: record(run, file, force=True))
    try:
        hfg.run(graph, clock="virtual", trace=seen, begin=begin)
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
    with pytest.raises(UsageError, match="cannot be opened: No such file"):
        play_into(build(), file)
    file.write_bytes(b"no")
    with pytest.raises(UsageError, match="is no MCAP file"):
        play_into(build(), file)
    run(build(count=3), file)
    other = hfg.Graph("other")
    other.add(texts()) >> other.add(read())
    with pytest.raises(UsageError, match='graph "other" has none of the ports that were recorded .*"camera.out"'):
        play_into(other, file)
    with pytest.raises(UsageError, match='no port "camera.ou" was recorded .* did you mean "camera.out"'):
        play_into(build(), file, ports={"camera.ou": "double.value"})
    with pytest.raises(UsageError, match='the graph lacks "double.valu"'):
        play_into(build(), file, ports={"camera.out": "double.valu"})
    with pytest.raises(UsageError, match="speed= says how much faster"):
        play_into(build(), file, speed=0.0)


def test_a_type_that_no_longer_fits_names_port_and_value(tmp_path: Path) -> None:
    run(build(count=3), tmp_path / "run.mcap")
    graph = hfg.Graph()
    graph.add(texts(), name="camera") >> graph.add(read())
    play_into(graph, tmp_path / "run.mcap")
    with pytest.raises(hfg.errors.NodeError, match='"camera.out" in .* has the value 0, which is no str'):
        hfg.run(graph, clock="virtual")
