"""The mission comes to its end under every schedule, never loses its way, and copes with what goes wrong.

"Never loses its way" is said by invariants over the trace: one step is active at a time or handed over just now, what
drives never disagrees, the lamp shows the state, and nothing is tried for ever.
"""

from __future__ import annotations

import asyncio
import re
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import hfg
from examples import mission
from hfg.errors import Aborted
from hfg.testing import Recorder, explore
from hfg.testing.invariants import Invariant, of_graph
from hfg.trace import ActivityChanged, CallStarted, FiringStarted, TokenSent, TokenTaken, TraceEvent

# --- What must hold in every run.


def moments(events: list[TraceEvent]) -> Iterator[tuple[float, set[str], int, str]]:
    """Give what holds whenever time goes on: who is active, how many hand-overs are under way, the lamp's colour."""
    active: set[str] = set()
    under_way, lamp, now = 0, "red", 0.0
    for event in events:
        if event.time > now:
            yield now, active, under_way, lamp
            now = event.time
        match event:
            case ActivityChanged(node=node, active=became):
                (active.add if became else active.discard)(node)
            case TokenSent(token=token):
                under_way += token.activity
            case TokenTaken(token=token):
                under_way -= token.activity
            case CallStarted(node="arena", slot="green" | "red" as slot):
                lamp = slot


def one_step_is_active_whenever_time_passes(events: list[TraceEvent]) -> list[str]:
    return [
        f"at {now} s {sorted(active)} are active, and {under_way} hand-overs under way"
        for now, active, under_way, _ in moments(events)
        if (len(active), under_way) != (1, 0)
    ]


def activity_is_never_doubled(events: list[TraceEvent]) -> list[str]:
    active: set[str] = set()
    found = []
    for event in events:
        if isinstance(event, ActivityChanged):
            (active.add if event.active else active.discard)(event.node)
            if len(active) > 1:
                found.append(f"at {event.time} s {sorted(active)} are active at once")
    return found


def commands_never_disagree(events: list[TraceEvent]) -> list[str]:
    """Whatever the streams that converge at the wheels: one command a moment, and from the step that is active."""
    found, commands = [], 0
    active: set[str] = set()
    for event in events:
        if isinstance(event, ActivityChanged):
            (active.add if event.active else active.discard)(event.node)
        elif isinstance(event, FiringStarted) and event.node == "arena":
            commands = 0
        elif isinstance(event, CallStarted) and event.slot == "drive":
            commands += 1
            sender = event.edge.partition(".")[0]
            if commands > 1 or sender not in active:
                found.append(f"at {event.time} s command {commands} of this moment, from {sender}; active: {active}")
    return found


def the_lamp_shows_the_state(events: list[TraceEvent]) -> list[str]:
    return [
        f"at {now} s the lamp is {lamp} while {sorted(active)} are active"
        for now, active, _, lamp in moments(events)
        if (lamp == "green") != any(node.endswith("/wait") for node in active)
    ]


def nothing_is_tried_for_ever(events: list[TraceEvent]) -> list[str]:
    """Each visit sets off three times at most, and so many views are there to explore."""
    calls = Counter((event.node, event.slot) for event in events if isinstance(event, CallStarted))
    return [
        f"{node} set off {calls[node, 'begin']} times"
        for node, visits, limit in [
            ("fetch/go_to", calls["fetch/tries", "begin"], 3),
            ("deliver/go_to", calls["deliver/tries", "begin"], 3),
            ("explore", 1, len(mission.VIEWS)),
        ]
        if calls[node, "begin"] > visits * limit
    ]


OURS: list[Invariant] = [
    one_step_is_active_whenever_time_passes,
    activity_is_never_doubled,
    commands_never_disagree,
    the_lamp_shows_the_state,
    nothing_is_tried_for_ever,
]


VARIATIONS: dict[str, dict[str, Any]] = {
    "nobody heeds the lamp at first": {"ignored": 2},
    "nobody heeds the lamp at one station": {"ignored": 3},
    "the wheels are blocked": {"stuck_s": (15.0, 45.0)},
    "the wheels are blocked while exploring": {"cubes": (4,), "stuck_s": (40.0, 75.0)},
    "the wheels stay blocked": {"stuck_s": (15.0, 10_000.0)},
    "four cubes": {"cubes": (4, 3, 1, 2)},
    "a cube for a station that is not there": {"cubes": (9,)},
}


def story(trace: Recorder) -> tuple[object, ...]:
    """What became active when, what was delivered, and how it ended."""
    return trace.activity(), trace.signals("arena.delivered"), home(trace), trace.outcome


def outline(trace: Recorder) -> tuple[object, ...]:
    """The same without times: which of two timers of one moment rings first may shift them by a step of the arena."""
    return steps(trace), trace.signals("arena.delivered"), home(trace), trace.outcome


def steps(trace: Recorder) -> list[str]:
    return [node for _, node, active in trace.activity() if active]


def home(trace: Recorder) -> bool:
    position: complex = trace.values("arena.pose")[-1]
    return abs(position - mission.HOME) < 0.1


def watched(graph: hfg.Graph, *, until_s: float | None = None, trace: Recorder | None = None) -> Recorder:
    """Run it and hold it to all invariants; give the trace, or fill the one that is given."""
    trace = Recorder() if trace is None else trace
    try:
        hfg.run(graph, clock="virtual", trace=trace, until_s=until_s)
    finally:
        assert not [sentence for look in OURS for sentence in look(trace) or ()]
    return trace


# --- Under every schedule.


@pytest.mark.slow
@pytest.mark.rule("A3", "A5", "A6", "F9", "R6")
def test_the_mission_is_the_same_under_fifty_schedules() -> None:
    found = explore(partial(mission.build, cubes=(4,)), runs=50, invariants=OURS, result=story, debug=False)
    assert found.outcomes == {"stopped": 50}


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_the_mission_is_the_same_under_a_thousand_schedules() -> None:
    general = of_graph(mission.build())
    found = explore(mission.build, runs=1000, invariants=[*general, *OURS], result=story)
    assert found.outcomes == {"stopped": 1000}


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", VARIATIONS)
def test_whatever_goes_wrong_no_schedule_loses_the_way(name: str) -> None:
    build = partial(mission.build, **VARIATIONS[name])
    explore(build, runs=100, invariants=[*of_graph(build()), *OURS], result=outline)


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", VARIATIONS)
def test_whatever_goes_wrong_the_oracle_permits_every_move(name: str) -> None:
    explore(partial(mission.build, **VARIATIONS[name]), runs=1, conform=True, result=outline)


# --- What it does.


@pytest.mark.slow
def test_two_cubes_are_delivered_and_the_robot_is_home_again() -> None:
    trace = watched(mission.build())
    assert trace.outcome == "stopped"
    assert trace.signals("arena.delivered") == [2, 4]
    assert home(trace)
    assert trace.active_at_end() == ["go_home"]


def test_a_station_whose_sign_was_seen_is_not_searched() -> None:
    assert "explore" not in steps(watched(mission.build(cubes=(2,))))


@pytest.mark.rule("A3")
def test_an_unknown_station_is_explored_view_by_view_until_its_sign_is_seen() -> None:
    trace = watched(mission.build(cubes=(4,)))
    assert [step for step in steps(trace) if step in ("lookup", "explore", "deliver/tries")] == [
        *["lookup", "explore"] * 2,
        "lookup",
        "deliver/tries",
    ]
    assert trace.signals("arena.delivered") == [4]


@pytest.mark.rule("A12")
def test_a_lamp_that_nobody_heeds_is_shown_again_until_the_third_time() -> None:
    trace = watched(mission.build(cubes=(2,), ignored=2))
    assert steps(trace).count("fetch/wait") == 3
    assert steps(trace).count("fetch/retreat") == 2
    assert trace.signals("arena.delivered") == [2]
    assert home(trace)


@pytest.mark.slow
def test_after_three_tries_the_robot_goes_on_to_the_next_station() -> None:
    trace = watched(mission.build(cubes=(2, 4), ignored=3))
    assert steps(trace).count("fetch/tries") == 5  # three times, giving up, and once at the next
    assert trace.signals("arena.delivered") == [2]
    assert home(trace)


@pytest.mark.slow
@pytest.mark.rule("A12")
def test_a_drive_that_is_blocked_times_out_and_is_tried_again() -> None:
    trace = watched(mission.build(cubes=(2,), stuck_s=(15.0, 45.0)))
    assert len(trace.signals("fetch/go_to.timeout")) == 1
    assert trace.signals("arena.delivered") == [2]
    assert home(trace)


@pytest.mark.slow
@pytest.mark.rule("A10", "A12")
def test_wheels_that_stay_blocked_end_the_mission_in_failure() -> None:
    trace = Recorder()
    with pytest.raises(Aborted, match=r"go_home\.timeout"):
        watched(mission.build(stuck_s=(15.0, 10_000.0)), trace=trace)
    assert steps(trace).count("fetch/go_to") == 6  # three times at each of two stations
    assert trace[-1].time < 300


@pytest.mark.rule("A10")
def test_a_number_that_belongs_nowhere_ends_the_mission_in_failure_when_all_is_explored() -> None:
    trace = Recorder()
    with pytest.raises(Aborted):
        watched(mission.build(cubes=(9,)), trace=trace)
    assert steps(trace).count("explore") == len(mission.VIEWS)


@pytest.mark.rule("A10")
def test_abort_ends_the_mission_whatever_is_active() -> None:
    graph = mission.build()
    graph["referee"].ports.parameters["says"].value = ((1.0, "start"), (19.5, "abort"))
    trace = Recorder()
    with pytest.raises(Aborted):
        watched(graph, trace=trace)
    assert trace[-1].time == 20.5
    assert trace.active_at_end() == ["fetch/wait"]


@pytest.mark.slow
@pytest.mark.rule("A3")
def test_a_start_that_never_comes_leaves_the_robot_where_it_is() -> None:
    graph = mission.build()
    graph["referee"].ports.parameters["says"].value = ((1.0, "ready?"), (2.0, "wait"))
    trace = watched(graph, until_s=120)
    assert trace.outcome == "until"
    assert steps(trace) == ["wait_for_start"]
    assert home(trace)
    assert not [call for call in trace.of(CallStarted) if call.slot == "drive"]


@pytest.mark.slow
@pytest.mark.rule("A3")
def test_a_start_that_comes_again_changes_nothing() -> None:
    graph = mission.build(cubes=(2,))
    graph["referee"].ports.parameters["says"].value = ((3.2, "start"), (3.1, "start"), (20.0, "start"))
    assert steps(watched(graph)) == steps(watched(mission.build(cubes=(2,))))


@pytest.mark.slow
def test_somebody_outside_can_send_the_robot_off() -> None:
    """`running` holds the run open, so the driver has all the time it wants."""
    graph = mission.build(cubes=(2,))
    graph["referee"].ports.parameters["says"].value = ()

    async def drive() -> hfg.Report:
        async with hfg.running(graph) as run:
            await asyncio.sleep(500)
            assert run.active() == ["wait_for_start"]
            await run.trigger(graph["wait_for_start"].deactivate)
            await run.trigger(graph["stations"].next, activity=+1)
            return await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        report = runner.run(drive())
    assert report.outcome == "stopped"
    assert report.nodes["go_home"].active


def test_the_story_is_told_in_virtual_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    hfg.run(mission.build(cubes=(2,)), clock="virtual")
    told = capsys.readouterr().out.splitlines()
    assert told[:4] == [
        "   0.0 s  wait_for_start",
        '   1.0 s  the referee says "ready?"',
        '   3.2 s  the referee says "start"',
        "   3.2 s  advance",
    ]
    assert "cube 2 is delivered" in told[-5]
    assert told[-1].endswith("go_home")


def test_the_page_about_it_shows_lines_that_are_in_it() -> None:
    root = Path(__file__).parents[2]
    source = {line.strip() for line in (root / "examples/mission.py").read_text(encoding="utf-8").splitlines()}
    page = (root / "docs/mission.md").read_text(encoding="utf-8")
    for fragment in re.findall(r"```python no-run\n(.*?)```", page, re.DOTALL):
        assert set(filter(None, fragment.splitlines())) <= source
