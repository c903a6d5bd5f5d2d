"""The delivery robot's perception in the arena, without a mission: where it is, what it learns, how it drives."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.perception import laser, shape
from examples.fetch_delivery.perception.following import FollowPath, Limits, follow, held_back
from examples.fetch_delivery.perception.localising import Localise, Localiser
from examples.fetch_delivery.perception.planning import Path, PlanPath, plan
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Wall
from examples.fetch_delivery.perception.sighting import find_targets, read_digits
from examples.fetch_delivery.perception.signs import SignMap, delivery_station
from examples.fetch_delivery.perception.stations import StationMap, octagon_sides
from examples.fetch_delivery.world.faults import LostLocalisation, PushedRobot
from examples.fetch_delivery.world.simulation import Simulation
from hfg.nodes.robotics import Disk
from hfg.testing import fire

NOWHERE = Scan(np.full(271, 30.0), np.radians(np.linspace(-135, 135, 271)), 0.0)


def sure(*pose: float) -> Localised:
    return Localised(np.array(pose), np.eye(3) * 1e-4, 1.0, True, 0.0)


class Robot:
    """What a robot does ten times a second: localise, and sometimes look; `true` is for tests alone."""

    def __init__(self, world: Simulation, number: int = 0) -> None:
        self.world, self.number = world, number
        self.localise, self.signs, self.stations = Localise(), SignMap(), StationMap()
        self.localised: Any = None
        self.scan: Any = None
        self.learned: dict[str, Any] = {"signs": {}, "filling": [], "delivery": []}
        self.events: list[str] = []
        self.errors: list[tuple[float, bool, float, float]] = []  # time, whether it is sure, metres, radians
        self.turned: int | None = None  # by how many eighths its map is turned against the arena's

    def measure(self) -> None:
        self.scan = self.world.scan(self.number)
        fired = fire(self.localise, scan=self.scan, odometry=self.world.odometry(self.number))
        self.localised = fired.outputs.get("localised", self.localised)
        self.events += [name for name, _ in fired.events]
        if self.turned is None and self.localised is not None and self.localised.sure:
            self.turned = round((self.world.robots[self.number].theta - self.localised.pose[2]) / shape.TURN)
        if self.localised is not None:
            self.errors.append((self.world.now_s, self.localised.sure, *self.error()))

    def look(self) -> None:
        image = self.world.front_picture(self.number)
        targets, digits = find_targets.function(image), read_digits.function(image)
        self.learned |= fire(self.stations, targets=targets, localised=self.localised).outputs
        self.learned |= fire(self.signs, sightings=digits, localised=self.localised).outputs
        fire(self.localise, slot="signs", value=self.learned["signs"])
        self.events += [name for name, _ in fire(self.localise, slot="sightings", value=digits).events]

    def true(self) -> Any:
        """Its pose in its own map, as it really is."""
        body = self.world.robots[self.number]
        return self.in_map(np.array([body.x, body.y, body.theta]))

    def in_map(self, pose: Any) -> Any:
        """A pose of the arena in the map of the robot."""
        turn = -(self.turned or 0) * shape.TURN
        cos, sin = math.cos(turn), math.sin(turn)
        x, y = cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1]
        return np.array([x, y, math.remainder(pose[2] + turn, 2 * math.pi)])

    def error(self) -> tuple[float, float]:
        """How far off it believes to be: metres and radians."""
        off = self.localised.pose - self.true()
        return float(np.hypot(off[0], off[1])), abs(math.remainder(off[2], 2 * math.pi))


def drive(robot: Robot, goal: Any, limit_s: float = 30.0) -> Iterator[None]:
    """Go to a pose; looks every 0.4 s, as the mission does."""
    planner, follower = PlanPath(), FollowPath()
    fire(planner, slot="goal", value=np.asarray(goal, float))
    for tick in range(round(limit_s * 10)):
        robot.measure()
        if tick % 4 == 0:
            robot.look()
        others = laser.other_robots.function(robot.scan, robot.localised)
        planned = fire(planner, localised=robot.localised, others=others).outputs
        if "path" in planned:
            fire(follower, slot="path", value=planned["path"])
        fired = fire(follower, localised=robot.localised, scan=robot.scan)
        robot.world.command(robot.number, fired.outputs.get("command", Twist()))
        if ("arrived", None) in fired.events:
            return
        yield


def around(robot: Robot, steps: int, radius: float = 4.0) -> list[Any]:
    """Poses around the middle, counter-clockwise, looking at the wall."""
    begin = math.atan2(robot.localised.pose[1], robot.localised.pose[0])
    angles = [begin + (step + 1) * math.pi / 4 for step in range(steps)]
    return [np.array([radius * math.cos(at), radius * math.sin(at), at]) for at in angles]


def test_once_around_the_arena_the_robot_knows_where_it_is_and_where_all_stations_are() -> None:
    """A drifting robot at 0.6 m/s: within 5 cm and 2 degrees all the time, signs within 15 cm, nothing touched."""
    world = Simulation(3)
    robot = Robot(world)
    robot.measure()
    touched = 0
    outwards = around(robot, 8)
    inwards = [np.array([0.7 * x, 0.7 * y, at + math.pi]) for x, y, at in outwards[:2]]
    for goal in outwards + inwards:
        for _ in drive(robot, goal):
            world.step(0.1)
            touched += world.robots[0].contact
        assert np.hypot(*(robot.true() - goal)[:2]) < 0.08
    assert world.now_s < 100
    assert touched == 0
    assert max(off for *_, off, _ in robot.errors) < 0.05
    assert max(turned for *_, turned in robot.errors) < math.radians(2)
    assert robot.events == ["found"]
    for station in world.arena.stations:
        x, y, facing = robot.in_map(np.array([station.x, station.y, station.facing]))
        if station.kind == "delivery":
            found = delivery_station(robot.learned["signs"][station.number])
            known = robot.learned["delivery"]
        else:
            known = robot.learned["filling"]
            found = min(known, key=lambda one: math.hypot(one.x - x, one.y - y))
        assert len(known) == 4
        assert math.hypot(found.x - x, found.y - y) < 0.15
        assert abs(math.remainder(found.theta - facing, 2 * math.pi)) < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_wherever_a_robot_starts_it_finds_its_place_at_once(seed: int) -> None:
    """Among four robots, for five seconds of wild driving: within 5 cm and 2 degrees from the first scan on."""
    world = Simulation(seed, robots=4)
    rng = np.random.default_rng(seed)
    robots = [Robot(world, number) for number in range(4)]
    for tick in range(50):
        for robot in robots:
            robot.measure()
            if tick % 15 == 0:
                world.command(robot.number, Twist(*rng.uniform((-0.6, -0.6, -1.5), (0.6, 0.6, 1.5))))
            elif tick % 4 == 0:
                world.command(robot.number, world.robots[robot.number]._command)
        world.step(0.1)
    for robot in robots:
        assert all(certain for _, certain, _, _ in robot.errors)
        assert max(off for *_, off, _ in robot.errors) < 0.05
        assert max(turned for *_, turned in robot.errors) < math.radians(2)


@pytest.mark.parametrize(
    "fault",
    [
        LostLocalisation(at_s=20.0, dx=3.0, dy=2.0, turn=2.5),
        PushedRobot(at_s=20.0, dx=-0.3, dy=0.3, turn=0.4),
        PushedRobot(at_s=20.0, dx=-1.5, dy=0.5, turn=2.3),
    ],
    ids=["odometry jumps", "pushed", "carried away"],
)
def test_a_robot_that_is_lost_finds_itself_again(fault: Any) -> None:
    """With the digits that it has learned it knows which of the eight places is the right one, within 25 seconds."""
    world = Simulation(5, faults=(fault,))
    robot = Robot(world)
    robot.measure()
    goals = iter(around(robot, 40))
    while world.now_s < 45:
        for _ in drive(robot, next(goals), 15.0):
            world.step(0.1)
            if world.now_s > 45:
                break
        else:
            world.step(0.1)
    _, certain, off, turned = robot.errors[-1]
    assert certain
    assert off < 0.05
    assert turned < math.radians(2)
    wrong = [at for at, certain, off, turned in robot.errors if certain and (off > 0.05 or turned > math.radians(2))]
    assert wrong == []  # as long as it is not right it says so


def test_the_octagon_is_measured_from_a_scan() -> None:
    world = Simulation(1)
    robot = Robot(world)
    robot.measure()
    sides = octagon_sides.function(robot.scan, robot.localised)
    assert 1 <= len(sides) <= 4
    for side in sides:
        assert abs(math.hypot(side.x, side.y) - shape.OCTAGON_APOTHEM) < 0.03
        assert abs(math.remainder(side.theta - math.atan2(side.y, side.x), 2 * math.pi)) < 0.1


def test_other_robots_are_seen_by_the_laser_alone() -> None:
    world = Simulation(2, robots=4)
    robot = Robot(world)
    robot.measure()
    found = laser.other_robots.function(robot.scan, robot.localised)
    others = [robot.in_map(np.array([one.x, one.y, 0.0]))[:2] for one in world.robots[1:]]
    assert found
    for one in found:
        assert min(math.hypot(one.x - x, one.y - y) for x, y in others) < 0.05
    doubtful = Localised(robot.localised.pose, robot.localised.covariance, 0.3, False, 0.0)
    assert laser.other_robots.function(robot.scan, doubtful) == []


def test_the_wall_ahead_is_measured_also_askew() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        distance, angle = float(rng.uniform(0.4, 3)), float(rng.uniform(-0.6, 0.6))
        along = np.cos(NOWHERE.angles - angle)
        ranges = np.where(along > 0.05, distance / np.maximum(along, 0.05), 30.0) + rng.normal(0, 0.01, 271)
        ranges[130:133] = 0.3  # somebody's finger
        wall = laser.wall_ahead.function(Scan(ranges, NOWHERE.angles, 0.0))
        assert isinstance(wall, Wall)
        assert abs(wall.distance - distance) < 0.02
        assert abs(wall.angle - angle) < 0.04
    assert laser.wall_ahead.function(NOWHERE) is None
    assert laser.obstacle_ahead.function(NOWHERE) == math.inf


def test_a_path_leads_around_the_octagon_and_other_robots() -> None:
    start, goal, others = np.array([2.5, 0.0, 0.0]), np.array([-2.5, 0.3, 0.0]), [Disk(0.0, 2.2, 9)]
    path = plan(start, goal, others)
    assert path is not None
    assert path[-1].tolist() == [-2.5, 0.3]
    inside, outside = shape.distances(path)
    assert min(inside.min(), outside.min()) > 0.27
    assert np.hypot(*(path - (0, 2.2)).T).min() > 0.55
    assert path[:, 1].min() < -1.4  # the other way round is free
    assert plan(start, np.array([0.0, 0.5]), []) is None  # within the octagon
    assert plan(start, goal, [Disk(-2.5, 0.3, 9)]) is None  # somebody stands there


def test_nothing_is_driven_at_faster_than_the_robot_can_brake() -> None:
    ranges = NOWHERE.ranges.copy()
    ranges[125:146] = 0.6  # ahead
    ahead = Scan(ranges, NOWHERE.angles, 0.0)
    limits = Limits()
    forward = held_back(np.array([0.6, 0.0]), sure(3, 0, 0), ahead, limits)
    assert 0 < forward[0] <= math.sqrt(2 * limits.braking * (0.6 - 0.25 - limits.robot)) + 1e-6
    assert held_back(np.array([-0.6, 0.0]), sure(3, 0, 0), ahead, limits).tolist() == [-0.6, 0.0]
    aside = held_back(np.array([0.0, 0.6]), sure(3, 0, 0), ahead, limits)
    assert aside[1] > 0.5
    path = Path(np.array([(3.0, 0.0), (4.0, 0.0)]), 0.0)
    assert follow(path, sure(4.0, 0.0, 0.0), NOWHERE) is None
    step = follow(path, sure(3.0, 0.0, 0.0), NOWHERE)
    assert step is not None
    assert step.vx > 0.5


def test_a_robot_that_comes_no_nearer_says_so() -> None:
    node = FollowPath(patience=2.0)
    fire(node, slot="path", value=Path(np.array([(3.0, 0.0), (4.0, 0.0)]), 0.0))
    events = []
    for tick in range(50):
        fired = fire(node, localised=sure(3, 0, 0), scan=Scan(NOWHERE.ranges, NOWHERE.angles, tick / 10))
        events += [(tick, name) for name, _ in fired.events]
    assert [name for _, name in events] == ["blocked", "blocked"]
    assert events[0][0] == 21
    fire(node, slot="stop")
    outputs = [fire(node, localised=sure(3, 0, 0), scan=NOWHERE).outputs for _ in range(2)]
    assert outputs == [{"command": Twist()}, {}]


def test_a_scan_without_a_single_hit_is_no_reason_to_fail() -> None:
    for ranges in (NOWHERE.ranges, NOWHERE.ranges * np.nan):
        localiser, scan = Localiser(), Scan(ranges, NOWHERE.angles, 0.0)
        assert localiser.update(scan, Odometry(np.zeros(3), np.zeros(3), 0.0)) is None
        assert octagon_sides.function(scan, sure(3, 0, 0)) == []
        assert laser.other_robots.function(scan, sure(3, 0, 0)) == []


def test_a_doubtful_pose_teaches_nothing() -> None:
    doubtful = Localised(np.array([3.0, 0.0, 0.0]), np.eye(3) * 1e-4, 1.0, False, 0.0)
    sighting = Sighting("2", 2.9, 0.0, math.pi, 0.9)
    node = SignMap()
    for _ in range(5):
        assert fire(node, sightings=[sighting], localised=doubtful).outputs["signs"] == {}
    for _ in range(3):
        signs = fire(node, sightings=[sighting], localised=sure(3, 0, 0)).outputs["signs"]
    assert isinstance(signs[2], Sign)
    assert abs(signs[2].x - 5.9) < 0.01
    fire(node, slot="forget", value=2)
    assert fire(node, sightings=[], localised=doubtful).outputs["signs"] == {}
