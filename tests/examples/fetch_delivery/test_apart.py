"""The same mission in one process, cut into several, and played from a recording: the same decisions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import hfg
from examples.fetch_delivery.__main__ import app
from examples.fetch_delivery.messages import Twist
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world import Simulation
from hfg.recording import File, play_into
from hfg.trace import ActivityChanged, EventTriggered, TraceEvent

pytestmark = pytest.mark.slow

SHARED = Path("/dev/shm")


def segments() -> set[str]:
    return {file.name for file in SHARED.glob("hfg-run-*-edge_*")}


class Decisions:
    """What a robot decides, seen through the trace of a run.

    Attributes:
      steps: each step that became active, with the time.
      commands: each velocity that was commanded, with the time.
      shared: edges whose arrays lay in shared memory meanwhile, by the names of their segments.
    """

    def __init__(self) -> None:
        self.steps: list[tuple[float, str]] = []
        self.commands: list[tuple[float, Twist]] = []
        self.shared: set[str] = set()
        self._before = segments()

    def __call__(self, event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged) and event.active:
            self.steps.append((event.time, event.node))
            self.shared |= segments() - self._before
        elif isinstance(event, EventTriggered) and event.event == "robot_0/give_way.held":
            self.commands.append((event.time, event.token.value))

    def to_the_same_effect(self, other: Decisions) -> bool:
        return (self.steps, self.commands) == (other.steps, other.commands)


def decided(graph: hfg.Graph, seconds: float, **options: Any) -> Decisions:
    """Run a mission."""
    decisions = Decisions()
    hfg.run(graph, until_s=seconds, trace=decisions, **({"clock": "virtual"} | options))
    return decisions


def place(graph: hfg.Graph) -> tuple[float, float, float]:
    """Say where the robot really is."""
    simulation: Simulation = graph["world"].simulation
    robot = simulation.robots[0]
    return robot.x, robot.y, robot.theta


def lasts_until(decisions: Decisions, step: str) -> bool:
    return any(path.endswith(step) for _, path in decisions.steps)


@pytest.mark.rule("L1", "L4", "R6")
@pytest.mark.timeout(180)
def test_cut_into_perception_and_control_the_mission_is_the_same_to_the_bit() -> None:
    """In virtual time the parts share a loop, but every token between them becomes bytes and is checked."""
    whole, parts = build(2), build(2, cut=True)
    decisions = decided(whole, 10)
    assert lasts_until(decisions, "fetch/visit/go_to/follow")
    assert len(decisions.commands) > 50
    assert decided(parts, 10).to_the_same_effect(decisions)
    assert place(parts) == place(whole)


@pytest.mark.parametrize("robots", [1, 4])
def test_nothing_is_wrong_with_a_mission_that_is_cut(robots: int) -> None:
    assert [problem for problem in build(1, robots, cut=True).check() if problem.severity == "error"] == []


@pytest.mark.soak
@pytest.mark.rule("L1", "F5")
@pytest.mark.timeout(900)
def test_in_processes_of_their_own_perception_and_control_decide_the_same_in_the_same_order() -> None:
    """Their clock is the real one, so not at the same moments; who measures waits for who understands."""
    alone = decided(build(1), 25)
    parts = build(1, cut=True)
    decisions = decided(parts, 60, clock="real")
    steps = [step for _, step in alone.steps]
    assert lasts_until(alone, "read_cube")
    assert [step for _, step in decisions.steps[: len(steps)]] == steps
    score = parts["world"].simulation.scores[0]
    assert len(score.fetched) >= 1
    assert score.wrong == []
    assert len(decisions.shared) >= 2  # pictures lie there, those of the front camera once for each who looks at them


@pytest.mark.rule("R6")
@pytest.mark.timeout(180)
def test_a_recorded_mission_is_decided_the_same_way_when_it_is_played_back(tmp_path: Path) -> None:
    """Recorded is what the arena tells the robot. An arena with another seed is replaced by the recording."""
    file = tmp_path / "run.mcap"
    decisions = decided(build(1), 12, begin=lambda run: run.record(file, select="world", images="png"))
    assert lasts_until(decisions, "fetch/visit/dock")
    again = build(2)
    playing = play_into(again, file)
    assert {port.partition(".")[0] for port in playing.played} == {"world"}
    assert decided(again, 12).to_the_same_effect(decisions)
    assert not decided(build(2), 2).to_the_same_effect(decided(build(1), 2))


def test_a_recording_holds_scans_and_pictures_that_others_can_read(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    result = CliRunner().invoke(app, ["--minutes", "0.05", "--record", str(file)])
    assert result.exit_code == 0
    with File(file) as recording:
        ports = {port.path: port for port in recording.info().ports}
    assert ports["world.scan[0]"].values >= 29
    assert ports["world.front[0]"].values > 0
    assert file.stat().st_size < 4e6


def test_a_run_in_several_processes_is_neither_recorded_nor_shown() -> None:
    result = CliRunner().invoke(app, ["--cut", "--report", "nowhere"])
    assert result.exit_code == 2
    assert "a run in several processes cannot be recorded or shown" in " ".join(result.output.split())
