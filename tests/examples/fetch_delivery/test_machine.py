"""The delivery mission as a state machine: its states one by one, and runs held to the same as the graph."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from examples.fetch_delivery.__main__ import app
from examples.fetch_delivery.machine import Mission, Robot, compare
from examples.fetch_delivery.machine.conditions import conditions
from examples.fetch_delivery.machine.driving import Dock, GoTo, Move, Position
from examples.fetch_delivery.machine.mission import LIMITS, Orders, Senses
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station
from examples.fetch_delivery.perception.shape import Shape
from examples.fetch_delivery.world import Fault, fault
from examples.fetch_delivery.world.scanning import ANGLES
from hfg.nodes.robotics import Disk
from hfg.trace import EventTriggered, TraceEvent
from tests.examples.fetch_delivery.watching import Watch

SIGN = Sign(5.9, 0.65, math.pi, 0.05, 9.0)


def at(x: float, y: float = 0.0, theta: float = 0.0, stamp: float = 0.0, sure: bool = True) -> Localised:
    return Localised(np.array([x, y, theta]), np.eye(3) * 1e-4, 1.0, sure, stamp, Shape(6.0, 1.25))


def scanned(distance: float = 2.0, stamp: float = 0.0) -> Scan:
    return Scan(np.full(271, distance), ANGLES, stamp)


def rolled(x: float, y: float = 0.0, theta: float = 0.0) -> Odometry:
    return Odometry(np.array([x, y, theta]), np.zeros(3), 0.0)


def sense(now: float = 10.0, *, sure: bool = True, **known: Any) -> Senses:
    return Senses("", rolled(0.0), scanned(stamp=now), at(4.0, stamp=now, sure=sure), **known)


# How each state is come to: by events, or by a tick in which something is known.
CHOSEN = ["done", "done", {}]
READ = [*CHOSEN, "served"]
UNKNOWN, KNOWN = [*READ, {"basket": 3}], [*READ, {"basket": 3, "signs": {3: SIGN}}]
IN_VAIN = ["failed"] * 3
VISIT = {"go_to": 0, "position": 1, "dock": 2, "settle": 3, "wait": 4, "leave": 5}
WAYS: dict[str, list[Any]] = {
    "wait_for_start": [],
    "advance": ["done"],
    "fetch/select": ["done", "done"],
    "fetch/look_around": ["done", "done", "lost"],
    **{f"fetch/visit/{step}": [*CHOSEN, *["done"] * steps] for step, steps in VISIT.items()},
    "fetch/visit/retreat": [*CHOSEN, "done", "lost"],
    "read_cube": READ,
    "explore/view": UNKNOWN,
    "explore/look_around": [*UNKNOWN, "lost"],
    "explore/go_to": [*UNKNOWN, {}],
    **{f"deliver/visit/{step}": [*KNOWN, *["done"] * steps] for step, steps in VISIT.items()},
    "deliver/visit/retreat": [*KNOWN, "done", "lost"],
    "deliver/confirm": [*KNOWN, *IN_VAIN],
}


def in_state(state: str) -> Mission:
    mission = Mission()
    mission.senses = sense()
    for what in WAYS[state]:
        if isinstance(what, str):
            mission.trigger(what)
        else:
            mission.step(sense(**what))
    assert mission.state == state
    return mission


def led(mission: Mission, event: str, **known: Any) -> tuple[str, Orders]:
    """Let an event come, and say where that leads and what is ordered on the way."""
    mission.senses, mission.orders = sense(**known), Orders()
    mission.trigger(event)
    return mission.state, mission.orders


# --- the states


def test_the_ways_lead_to_all_states_and_each_but_the_first_has_a_limit() -> None:
    states = set(Mission().machine.get_nested_state_names())
    leaves = {state for state in states if not any(other.startswith(f"{state}/") for other in states)}
    assert leaves == WAYS.keys()
    unlimited = {leaf for leaf in leaves if sum(leaf.endswith(limit) for limit in LIMITS) != 1}
    assert unlimited == {"wait_for_start"}


@pytest.mark.parametrize(
    ("state", "after", "then"),
    [
        ("advance", 10, "fetch/select"),
        ("fetch/select", 5, "fetch/look_around"),
        ("fetch/look_around", 15, "fetch/select"),
        ("fetch/visit/go_to", 60, "fetch/select"),
        ("fetch/visit/position", 20, "fetch/visit/retreat"),
        ("fetch/visit/dock", 10, "fetch/visit/retreat"),
        ("fetch/visit/settle", 0.5, "fetch/visit/wait"),
        ("fetch/visit/wait", 20, "fetch/visit/retreat"),
        ("fetch/visit/leave", 6, "read_cube"),
        ("fetch/visit/retreat", 6, "fetch/select"),
        ("read_cube", 10, "fetch/select"),
        ("deliver/confirm", 4, "fetch/select"),
        ("explore/view", 5, "explore/look_around"),
        ("explore/look_around", 15, "read_cube"),
        ("explore/go_to", 15, "read_cube"),
        ("deliver/visit/wait", 20, "deliver/visit/retreat"),
        ("deliver/visit/leave", 6, "fetch/select"),
        ("deliver/visit/retreat", 6, "deliver/visit/go_to"),
    ],
)
def test_a_state_is_left_when_its_time_is_over(state: str, after: float, then: str) -> None:
    mission = in_state(state)
    mission.entered = 0.0
    mission.step(sense(after, sure=False))
    assert mission.state == state
    mission.step(sense(after + 0.1, sure=False))
    assert mission.state == then


def test_it_waits_for_the_word_start() -> None:
    mission = Mission()
    ready = sense()
    ready.message = "ready?"
    mission.step(ready)
    assert mission.state == "wait_for_start"
    ready.message = "start"
    mission.step(ready)
    assert mission.state == "advance"


@pytest.mark.parametrize("errand", ["fetch", "deliver"])
def test_the_lamp_is_on_while_it_waits_and_whatever_ends_that_switches_it_off(errand: str) -> None:
    mission = in_state(f"{errand}/visit/settle")
    state, orders = led(mission, "done")
    assert (state, orders.lamp, orders.ask) == (f"{errand}/visit/wait", True, True)
    for event, then in (("done", "leave"), ("lost", "retreat")):
        state, orders = led(in_state(f"{errand}/visit/wait"), event)
        assert (state, orders.lamp) == (f"{errand}/visit/{then}", False)


@pytest.mark.parametrize(
    ("errand", "basket", "then"),
    [("fetch", 0, "wait"), ("fetch", 2, "leave"), ("deliver", 2, "wait"), ("deliver", 0, "leave")],
)
def test_it_waits_for_a_cube_or_for_its_absence(errand: str, basket: int, then: str) -> None:
    mission = in_state(f"{errand}/visit/wait")
    mission.step(sense(10.1))
    assert mission.state == f"{errand}/visit/wait"
    mission.step(sense(10.2, basket=basket))
    assert mission.state == f"{errand}/visit/{then}"


def test_a_cube_whose_sign_is_known_is_delivered_and_else_its_sign_is_looked_for() -> None:
    for signs, then in (({3: SIGN}, "deliver/visit/go_to"), ({2: SIGN}, "explore/view")):
        mission = in_state("read_cube")
        mission.step(sense(basket=3, signs=signs))
        assert mission.state == then


def test_a_station_where_it_failed_is_not_chosen_again_at_once() -> None:
    mission = in_state("fetch/visit/retreat")
    first = mission.station
    assert led(mission, "failed")[0] == "fetch/select"
    mission.step(sense(11.0))
    assert mission.station != first
    assert led(mission, "failed", now=60.0)[0] == "fetch/select"
    mission.step(sense(60.1))
    assert mission.station == first


def test_a_cube_is_taken_to_its_station_three_times_then_the_sign_is_forgotten() -> None:
    mission = in_state("deliver/visit/retreat")
    for _ in range(2):
        assert led(mission, "failed")[0] == "deliver/visit/go_to"
    state, orders = led(mission, "failed")
    assert (state, orders.ask) == ("deliver/confirm", True)
    orders = mission.step(sense(basket=3))
    assert (mission.state, orders.forget, orders.report) == ("read_cube", 3, None)


def test_a_cube_that_was_brought_in_vain_twice_is_given_back_for_another_one() -> None:
    mission = in_state("deliver/visit/retreat")
    for _ in range(3):
        led(mission, "failed")
    for _ in range(2):
        mission.step(sense(basket=3, signs={3: SIGN}))
    for _ in range(2):
        assert led(mission, "failed")[0] == "deliver/visit/go_to"
    state, orders = led(mission, "failed")
    assert (state, orders.forget, orders.report) == ("deliver/confirm", None, None)
    orders = mission.step(sense(basket=3))
    assert (mission.state, orders.forget, orders.report) == ("fetch/select", 3, 3)
    mission.step(sense())
    for _ in range(4):
        mission.trigger("done")
    mission.step(sense(basket=3))
    assert mission.state == "fetch/visit/wait"


def test_a_cube_that_was_taken_when_the_robot_had_given_up_is_not_reported() -> None:
    mission = in_state("deliver/confirm")
    orders = [mission.step(sense(now, basket=0)) for now in (11.0, 15.1)]
    assert mission.state == "fetch/select"
    assert [one.report for one in orders] == [None, None]


def test_when_it_has_been_around_in_vain_it_gives_the_cube_back_for_another_one() -> None:
    mission = in_state("explore/view")
    for _ in range(16):
        mission.step(sense())
        assert led(mission, "done")[0] == "read_cube"
        mission.step(sense(basket=3))
    orders = mission.step(sense())
    assert (mission.state, orders.report) == ("fetch/select", 3)
    mission.step(sense())
    for _ in range(4):
        mission.trigger("done")
    mission.step(sense(basket=3))
    assert mission.state == "fetch/visit/wait"
    mission.step(sense(basket=1))
    assert mission.state == "fetch/visit/leave"


# --- what is done in them


def test_move_goes_the_given_way_and_stops() -> None:
    move = Move(x=1.0, y=1.0)
    command, end = move.step(rolled(2.0, 0.0, math.pi / 2))
    assert command == pytest.approx((0.4 / math.sqrt(2), 0.4 / math.sqrt(2), 0))
    assert end is None
    assert move.step(rolled(1.0, 1.0, math.pi / 2)) == (Twist(), "done")


def test_position_ends_when_it_has_stood_right_twice_or_has_seen_nothing_for_long() -> None:
    station, ahead = Station(5.0, 0.0, math.pi), Sighting("bullseye", 0.8, 0.0, math.nan, 1.0)
    position = Position(station)
    flat = Scan(0.8 / np.maximum(np.cos(ANGLES), 0.1), ANGLES, 0.0)
    assert position.step(at(4.2), flat, [ahead]) == (Twist(), None)
    assert position.step(at(4.2, stamp=0.1), flat, []) == (Twist(), "done")
    position = Position(station)
    assert [position.step(at(4.2, stamp=now), flat, [])[1] for now in (0.0, 3.0, 3.1)] == [None, None, "lost"]


def test_dock_stops_at_its_distance() -> None:
    assert Dock(speed=0.2).step(scanned(2.0)) == (Twist(0.2), None)
    assert Dock().step(scanned(0.32)) == (Twist(), "done")


def test_go_to_arrives_and_gives_up_when_it_comes_no_nearer() -> None:
    far = scanned(3.0)
    assert GoTo(np.array([4.0, 0.0, 0.0])).step(at(4.0), far, []) == (Twist(), "done")
    go_to = GoTo(np.array([3.0, 2.0, 0.0]))
    ends = [go_to.step(at(4.0, stamp=now), scanned(3.0, now), [])[1] for now in (0.0, 5.9, 6.1)]
    assert ends == [None, None, "blocked"]
    into_the_wall = GoTo(np.array([9.0, 0.0, 0.0]), lane=0.1)
    ends = [into_the_wall.step(at(4.0, stamp=now), scanned(3.0, now), [])[1] for now in (0.0, 7.9, 8.0)]
    assert ends == [None, None, "blocked"]


def test_go_to_waits_at_a_distance_for_a_station_that_is_taken_but_not_for_ever() -> None:
    go_to = GoTo(np.array([4.3, 0.0, 0.0]), lane=0.9, queueing=8.0)
    there = [Disk(5.2, 0.0, 9)]
    steps = [go_to.step(at(3.0, stamp=now), scanned(2.0, now), there) for now in (0.0, 7.0, 8.0, 8.1)]
    assert steps == [(Twist(), None), (Twist(), None), (Twist(), None), (Twist(), "blocked")]
    go_to = GoTo(np.array([4.3, 0.0, 0.0]), lane=0.9)
    command, end = go_to.step(at(3.0), scanned(2.0), [])
    assert (command.vx > 0.2, end) == (True, None)


# --- what both consist of


def test_lines_of_code_are_counted_without_comments_docstrings_imports_and_what_is_blank(tmp_path: Path) -> None:
    source = '''"""A module."""

import math  # not this

MOST = [
    1,  # these
    2,

]


@staticmethod
def one(x: int) -> str:
    """Say it.

    At length.
    """
    # nor this
    text = """two
lines"""
    return text


class Two:
    """Nothing else."""
'''
    (tmp_path / "counted_module.py").write_text(source)
    spec = importlib.util.spec_from_file_location("counted_module", tmp_path / "counted_module.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert compare.code_lines(module) == 4 + 5 + 1
    assert compare.code_lines(module, only=["one"]) == 5
    assert compare.code_lines(module, without=["one", "Two"]) == 4
    with pytest.raises(ValueError, match="counted_module has no Three"):
        compare.code_lines(module, only=["Three"])


def test_what_is_counted_is_what_is_there() -> None:
    graph, machine = compare.structure("activity"), compare.structure("machine")
    leaves = len(WAYS)
    assert (machine["states"], machine["nodes"], machine["subgraphs"]) == (leaves, 2, 0)
    assert machine["time-outs"] == leaves - 1
    assert graph["states"] > leaves  # what an entry action does here is a state there
    assert graph["nodes"] >= graph["states"]


def test_tables_go_into_a_page_between_their_marks() -> None:
    page = "a\n<!-- counted -->\nold\n<!-- end -->\nb\n<!-- measured -->\n<!-- end -->\n"
    page = compare.put_into(page, "counted", "| new |")
    page = compare.put_into(page, "measured", "| n |")
    assert page == "a\n<!-- counted -->\n| new |\n<!-- end -->\nb\n<!-- measured -->\n| n |\n<!-- end -->\n"
    with pytest.raises(ValueError, match="no place for the table 'counted'"):
        compare.put_into("a page", "counted", "| new |")


@pytest.mark.slow
def test_missions_of_both_sorts_are_measured() -> None:
    head, _, *rows = compare.measured(compare.missions([3], 0.02), 0.02).splitlines()
    assert "0.02 simulated minutes, seeds 3" in head
    assert rows[0] == "| cubes delivered | 0 | 0 | 0 |"
    firings = [float(cell) for cell in rows[5].split("|")[2:5]]
    assert firings[0] > 10 * firings[1]
    assert firings[2] == pytest.approx(firings[0] - firings[1], rel=0.01)


# --- the whole


def test_without_the_package_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in [name for name in sys.modules if name.startswith(("examples.fetch_delivery.machine", "transitions"))]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "transitions", None)
    with pytest.raises(SystemExit) as end:
        app(["--machine", "--minutes", "0.01"])
    assert end.value.code == 2
    told = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "--machine needs the package transitions; pip install 'hfg[examples]'" in told


class MachineWatch(Watch):
    """Takes the states of the machine for active steps: the same is demanded of both."""

    def _look(self, event: TraceEvent) -> None:
        if isinstance(event, EventTriggered) and event.event.endswith("control.entered"):
            robot, _, _ = event.event.partition("/")
            self.enters(robot, event.token.value)


def watched(seed: int, minutes: float, *faults: Fault) -> MachineWatch:
    watch = MachineWatch(build(seed, kind=Robot, faults=faults))
    watch.carry_out(minutes, conditions)
    return watch


def test_nothing_is_wrong_with_the_graph_around_it() -> None:
    assert [problem for problem in build(1, 4, kind=Robot).check() if problem.severity != "hint"] == []


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_it_fetches_a_cube_and_keeps_to_what_is_demanded_of_the_graph_too() -> None:
    watch = watched(seed=1, minutes=0.41)
    (score,) = watch.simulation.scores
    assert watch.found == []
    assert score.lamp_while_driving_s == score.contact_s == 0
    states = [state.removeprefix("robot_0/") for _, state in watch.steps]
    assert states[:9] == ["wait_for_start", "advance", "fetch/select", *(f"fetch/visit/{step}" for step in VISIT)]
    assert len(score.fetched) == 1


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("seed", range(1, 4))
def test_one_robot_alone_delivers_for_ten_minutes(seed: int) -> None:
    watch = watched(seed, minutes=10)
    (score,) = watch.simulation.scores
    assert watch.found == []
    assert len(score.delivered) >= 7
    assert score.wrong == []
    assert score.lamp_while_driving_s == 0
    assert score.contact_s < 6


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("seed", "minutes", "wrong", "number"),
    [
        pytest.param(1, 2.5, fault("hidden sign", at_s=0, digit=1), 1, id="hidden sign"),
        pytest.param(
            2, 5, fault("absent operator", at_s=0, kind="delivery", number=2), 2, id="nobody at a delivery station"
        ),
    ],
)
def test_a_cube_that_cannot_be_delivered_is_reported_and_given_back(
    seed: int, minutes: float, wrong: Fault, number: int
) -> None:
    watch = watched(seed, minutes, wrong)
    (score,) = watch.simulation.scores
    assert watch.found == []
    assert score.wrong == []
    assert [cube for _, cube in score.reported] == [cube for _, cube in score.returned] == [number]
    assert score.delivered
