"""The delivery robot's perception in the arena, without a mission: where it is, what it learns, how it drives."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.mission.driving import GoTo
from examples.fetch_delivery.perception import laser
from examples.fetch_delivery.perception.following import FollowPath, GiveWay, Limits, Queue, follow, held_back
from examples.fetch_delivery.perception.localising import Localise, Localiser
from examples.fetch_delivery.perception.planning import Path, PlanPath, plan, queue
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Wall
from examples.fetch_delivery.perception.shape import TURN, Shape
from examples.fetch_delivery.perception.sighting import find_targets, read_digits
from examples.fetch_delivery.perception.signs import SignMap, delivery_station
from examples.fetch_delivery.perception.stations import StationMap, octagon_sides
from examples.fetch_delivery.world.faults import LostLocalisation, PushedRobot
from examples.fetch_delivery.world.simulation import Simulation
from examples.fetch_delivery.world.surroundings import Surroundings
from hfg.nodes.robotics import Disk
from hfg.testing import fire
from hfg.trace import ActivityChanged, TraceEvent

SHAPE = Shape(6.0, 1.25)
NOWHERE = Scan(np.full(271, 30.0), np.radians(np.linspace(-135, 135, 271)), 0.0)


def sure(*pose: float) -> Localised:
    return Localised(np.array(pose), np.eye(3) * 1e-4, 1.0, True, 0.0, SHAPE)


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
            self.turned = round((self.world.robots[self.number].theta - self.localised.pose[2]) / TURN)
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
        turn = -(self.turned or 0) * TURN
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.parametrize("noise", [0.01, 0.03])
@pytest.mark.parametrize(("radius", "octagon"), [(5.7, 1.375), (6.0, 1.25), (6.3, 1.125)])
def test_a_robot_measures_the_arena_in_its_first_scan_and_better_with_each_one(
    radius: float, octagon: float, noise: float
) -> None:
    """Within 8 cm after the first scan, and within 2 cm after five seconds of turning on the spot."""
    world = Simulation(3, surroundings=Surroundings(radius=radius, octagon=octagon, noise=noise))
    robot = Robot(world)
    robot.measure()
    first = robot.localised.shape
    assert max(abs(first.radius - radius), abs(first.octagon - octagon)) < 0.08
    for _ in range(50):
        world.command(0, Twist(0.0, 0.0, 1.0))
        world.step(0.1)
        robot.measure()
    last = robot.localised.shape
    assert max(abs(last.radius - radius), abs(last.octagon - octagon)) < 0.02
    assert robot.error()[0] < 0.05


def test_a_scan_that_shows_no_octagon_makes_no_map() -> None:
    round_about = Scan(np.full(271, 4.0), NOWHERE.angles, 0.0)
    assert Localiser().update(round_about, Odometry(np.zeros(3), np.zeros(3), 0.0)) is None


def test_the_octagon_is_measured_from_a_scan() -> None:
    world = Simulation(1)
    robot = Robot(world)
    robot.measure()
    sides = octagon_sides.function(robot.scan, robot.localised)
    assert 1 <= len(sides) <= 4
    for side in sides:
        assert abs(math.hypot(side.x, side.y) - SHAPE.octagon) < 0.03
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
    doubtful = Localised(robot.localised.pose, robot.localised.covariance, 0.3, False, 0.0, SHAPE)
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
    path = plan(SHAPE, start, goal, others)
    assert path is not None
    assert path[-1].tolist() == [-2.5, 0.3]
    inside, outside = SHAPE.distances(path)
    assert min(inside.min(), outside.min()) > 0.27
    assert np.hypot(*(path - (0, 2.2)).T).min() > 0.55
    assert path[:, 1].min() < -1.4  # the other way round is free
    assert plan(SHAPE, start, np.array([0.0, 0.5]), []) is None  # within the octagon
    assert plan(SHAPE, start, goal, [Disk(-2.5, 0.3, 9)]) is None  # somebody stands there


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
    doubtful = Localised(np.array([3.0, 0.0, 0.0]), np.eye(3) * 1e-4, 1.0, False, 0.0, SHAPE)
    sighting = Sighting("2", 2.9, 0.0, math.pi, 0.9)
    node = SignMap()
    for _ in range(5):
        assert fire(node, sightings=[sighting], localised=doubtful).outputs["signs"] == {}
    for _ in range(3):
        signs = fire(node, sightings=[sighting], localised=sure(3, 0, 0)).outputs["signs"]
    assert isinstance(signs[2], Sign)
    assert abs(signs[2].x - SHAPE.apothem) < 0.01  # it hangs on the wall, however far a camera says
    fire(node, slot="forget", value=2)
    assert fire(node, sightings=[], localised=doubtful).outputs["signs"] == {}


# --- among others


def standing(x: float, y: float) -> Disk:
    return Disk(x, y, 9)


def test_the_round_back_of_a_robot_is_no_wall() -> None:
    world = Simulation(1, robots=2)
    me, other = world.robots
    me.x, me.y, me.theta, other.x, other.y = 0.0, 3.0, math.pi / 2, 0.0, 4.0
    for _ in range(20):
        world.step(0.05)
        wall = laser.wall_ahead.function(world.scan(0))
        assert wall is None or abs(wall.distance - 2.97) < 0.05


def test_of_two_who_meet_both_paths_keep_to_the_right() -> None:
    there = plan(SHAPE, np.array([-2.0, 3.5]), np.array([2.0, 3.5]), [standing(0.0, 3.5)])
    back = plan(SHAPE, np.array([2.0, 3.5]), np.array([-2.0, 3.5]), [standing(0.0, 3.5)])
    assert there is not None
    assert back is not None
    assert there[np.abs(there[:, 0]) < 0.3][:, 1].max() < 3.0
    assert back[np.abs(back[:, 0]) < 0.3][:, 1].min() > 4.0


def test_a_path_leads_behind_one_who_crosses() -> None:
    start, goal = np.array([-2.5, 3.5]), np.array([2.5, 3.5])
    for vy in (0.5, -0.5):
        path = plan(SHAPE, start, goal, [Disk(0.0, 3.5, 9, 0.0, vy)])
        assert path is not None
        at = path[np.abs(path[:, 0]) < 0.2][:, 1]
        assert (at < 3.0).all() if vy > 0 else (at > 4.0).all()


@pytest.mark.slow
def test_who_finds_somebody_at_the_station_waits_at_a_distance_until_it_is_free() -> None:
    """The goal is 1.25 m before a station on the wall; somebody stands at the station, backs off and leaves."""
    planner, follower, waiter = PlanPath(lane=0.9, every=1), FollowPath(), Queue()
    fire(planner, slot="goal", value=np.array([4.7, 0.0, 0.0]))
    steps: list[Any] = [follower]  # of which the last is active

    def drive_with(others: list[Disk], pose: Any, seconds: float) -> tuple[Any, list[str]]:
        pose, events = np.array(pose), []
        for tick in range(round(10 * seconds)):
            me = Localised(pose, np.eye(3) * 1e-4, 1.0, True, tick / 10, SHAPE)
            planned = fire(planner, localised=me, others=others)
            for name, path in [*planned.outputs.items(), *planned.events]:
                begins, changes = (follower, waiter) if name == "path" else (waiter, follower)
                fire(begins, slot=name, value=path)
                if steps[-1] is changes:
                    ((_, way),) = fire(changes, slot=name, value=path, active=True).events
                    fire(begins, slot=name, value=way, active=True)
                    steps.append(begins)
            fired = fire(steps[-1], localised=me, scan=Scan(NOWHERE.ranges, NOWHERE.angles, tick / 10))
            events += [name for name, _ in fired.events]
            if "arrived" in events:
                break
            vx, vy, omega = fired.outputs.get("command", Twist())
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            pose = pose + 0.1 * np.array([cos * vx - sin * vy, sin * vx + cos * vy, omega])
        return pose, events

    waiting, events = drive_with([standing(5.6, 0.0)], (3.0, 3.0, 0.0), 20)
    assert events == []
    assert 1.1 < math.dist(waiting[:2], (4.7, 0.0)) < 1.8
    looks = math.atan2(-waiting[1], 5.6 - waiting[0])
    assert abs(math.remainder(waiting[2] - looks, 2 * math.pi)) < 0.1
    still, events = drive_with([standing(4.9, 0.0)], waiting, 3)  # it backs off, and needs the room
    assert (events, math.dist(still[:2], waiting[:2]) < 0.1) == ([], True)
    there, events = drive_with([standing(3.8, -2.0)], waiting, 8)
    assert events == ["arrived"]
    assert math.dist(there[:2], (4.7, 0.0)) < 0.06
    assert steps == [follower, waiter, follower]


def test_who_has_waited_for_long_at_a_station_says_so() -> None:
    waiter = Queue(patience=5.0)
    fire(waiter, slot="aside", value=Path(np.array([(3.0, 0.0), (3.0, 0.0)]), 0.0))
    told = []
    for tick in range(60):
        fired = fire(waiter, localised=sure(3, 0, 0), scan=Scan(NOWHERE.ranges, NOWHERE.angles, tick / 10))
        assert fired.outputs == {"command": Twist()}
        told += [(tick, name) for name, _ in fired.events]
    assert told == [(51, "blocked")]


@pytest.mark.rule("A3", "A5")
def test_waiting_behind_others_is_a_step_of_its_own_and_one_step_is_active_at_a_time() -> None:
    """A robot drives to a station that another one takes, waits, and goes on when it is free."""
    graph = hfg.Graph("queueing")
    steps: list[str] = []
    others, go_to = graph.add(Others(), max_rate_hz=10), graph.add(GoTo(lane=0.9), name="go_to")
    graph.connect(others.localised, go_to.localised)
    graph.connect(others.scan, go_to.scan)
    graph.connect(others.others, go_to.others)
    graph.start.activates(others.begin)
    others.goal.activates(go_to.go)

    def note(event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged) and event.active and event.node.startswith("go_to/"):
            steps.append(event.node.removeprefix("go_to/"))

    hfg.run(graph, clock="virtual", until_s=6, trace=note)
    assert steps == ["plan", "follow", "queue", "follow"]


class Others(hfg.Node):
    """A robot that stands still, and another one at its station between two seconds and four."""

    localised, scan = hfg.Output(Localised), hfg.Output(Scan)
    others = hfg.Output(list[Disk])
    goal = hfg.Event(Any)

    @hfg.slot
    def begin(self) -> None:
        self.goal.trigger(np.array([4.7, 0.0, 0.0]))

    def process(self) -> None:
        now = hfg.now()
        self.localised.send(sure(3.0, 3.0, 0.0))
        self.scan.send(Scan(NOWHERE.ranges, NOWHERE.angles, now))
        self.others.send([standing(5.6, 0.0)] if 2 < now < 4 else [])


def test_of_two_who_come_to_a_station_at_once_one_goes_on() -> None:
    goal, one, other = np.array([4.7, 0.0, 0.0]), np.array([4.3, 0.6, 0.0]), np.array([4.2, -0.6, 0.0])
    assert queue(SHAPE, one, goal, [standing(*other[:2])], 0.9) is None
    assert queue(SHAPE, other, goal, [standing(*one[:2])], 0.9) is not None
    assert queue(SHAPE, one, goal, [standing(3.0, 2.0)], 0.9) is None


def test_no_command_leads_into_a_robot_behind_or_one_that_comes() -> None:
    backwards, behind = Twist(-0.4, 0.0, 0.3), standing(-0.58, 0.0)
    held = fired_through(backwards, [behind])
    assert (round(held.vx, 3), held.omega) == (-0.141, 0.3)
    assert fired_through(backwards, [standing(-0.55, 0.0)]).vx == 0
    assert fired_through(backwards, [standing(0.55, 0.0)]) == backwards
    ahead, far = Twist(0.6, 0.0, 0.0), Disk(1.2, 0.0, 9)
    assert fired_through(ahead, [far]) == ahead
    assert fired_through(ahead, [far._replace(vx=-0.6)]).vx < 0.15
    along = fired_through(Twist(0.3, 0.3, 0.0), [standing(0.55, 0.0)])
    assert along == pytest.approx((0.0, 0.3, 0.0), abs=1e-9)


def fired_through(twist: Twist, around: list[Disk]) -> Twist:
    node = GiveWay()
    fire(node, slot="around", value=around)
    ((name, held),) = fire(node, slot="command", value=twist).events
    assert name == "held"
    assert isinstance(held, Twist)
    return held


def test_a_robot_that_has_gone_behind_is_remembered_in_the_map_and_in_the_own_frame() -> None:
    world = Simulation(2, robots=2)
    me, other = world.robots
    me.x, me.y, me.theta, other.x, other.y = 3.5, 0.0, 0.9, 4.5, 0.0  # from there it sees the octagon, too
    robot, node = Robot(world), laser.FollowRobots()
    command = Twist(0.0, 0.0, 1.5)
    for _ in range(16):
        robot.measure()
        seen = laser.other_robots.function(robot.scan, robot.localised)
        fired = fire(node, seen=seen, scan=robot.scan, localised=robot.localised).outputs
        world.command(0, command)
        world.step(0.1)
    assert seen == []
    (known,), (around,) = fired["others"], fired["around"]
    assert math.dist((known.x, known.y), robot.in_map(np.array([4.5, 0.0, 0.0]))[:2]) < 0.06
    assert abs(math.atan2(around.y, around.x)) > math.radians(140)
    lost = Localised(robot.localised.pose, robot.localised.covariance, 0.3, False, 0.0, SHAPE)
    assert fire(node, seen=[], scan=robot.scan, localised=lost).outputs == {"others": [], "around": []}


@pytest.mark.slow
def test_two_robots_that_drive_at_each_other_pass_without_touching() -> None:
    world = Simulation(4, robots=2)
    ends = [np.array([-2.2, 3.6, 0.0]), np.array([2.2, 3.6, math.pi])]
    drivers = []
    for number, (begin, end) in enumerate(zip(ends, reversed(ends), strict=True)):
        world.robots[number].x, world.robots[number].y, world.robots[number].theta = map(float, begin)
        robot = Robot(world, number)
        robot.measure()
        drivers.append((robot, PlanPath(), FollowPath(), laser.FollowRobots(), GiveWay()))
        fire(drivers[-1][1], slot="goal", value=robot.in_map(end))
    for _ in range(150):
        for robot, planner, follower, followed, give_way in drivers:
            robot.measure()
            seen = laser.other_robots.function(robot.scan, robot.localised)
            known = fire(followed, seen=seen, scan=robot.scan, localised=robot.localised).outputs
            fire(give_way, slot="around", value=known["around"])
            planned = fire(planner, localised=robot.localised, others=known["others"]).outputs
            if "path" in planned:
                fire(follower, slot="path", value=planned["path"])
            wanted = fire(follower, localised=robot.localised, scan=robot.scan).outputs.get("command", Twist())
            ((_, held),) = fire(give_way, slot="command", value=wanted).events
            world.command(robot.number, held)
        world.step(0.1)
    assert [score.contact_s for score in world.scores] == [0, 0]
    for (robot, *_), end in zip(drivers, reversed(ends), strict=True):
        body = world.robots[robot.number]
        assert math.dist((body.x, body.y), end[:2]) < 0.1
