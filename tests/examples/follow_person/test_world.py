"""The outdoor world: what its sensors measure, held against geometry; what robot and people can do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from examples.follow_person.messages import Twist
from examples.follow_person.world import Conditions, Simulation
from examples.follow_person.world.course import KINDS, Course, Ground
from examples.follow_person.world.scanning import RINGS, Laser
from examples.follow_person.world.vehicle import Errors, Limits, Vehicle

EXACT = Errors(0.0, 0.0, 0.0, 0.0)


def flat() -> Ground:
    return Ground(0.0, np.random.default_rng(0))


def scanned(cylinders: list[list[float]], height: float = 0.8, turn: object = None) -> np.ndarray:
    laser = Laser(columns=360, noise=0.0, lost=0.0)
    rows = np.array(cylinders, np.float64).reshape(-1, 5)
    scan = laser.scan(
        (0.0, 0.0, height), np.eye(3) if turn is None else turn, flat(), rows, 0.0, np.random.default_rng(0)
    )
    return scan.ranges


def test_a_ray_that_looks_down_meets_level_ground_where_it_should() -> None:
    ranges = scanned([])
    for ring, elevation in enumerate(RINGS):
        expected = 0.8 / math.sin(-elevation) if elevation < 0 else math.inf
        if expected < 29:
            assert ranges[ring] == pytest.approx(expected, rel=0.02)
        else:
            assert np.isinf(ranges[ring]).all()


def test_a_trunk_is_as_far_away_as_its_front() -> None:
    ranges = scanned([[5.0, 0.0, 0.25, -1.0, 6.0]])
    ahead = 180  # the column that looks along x
    level = ranges[:, ahead] * np.cos(RINGS)
    assert level == pytest.approx(np.minimum(4.75, np.where(RINGS < 0, 0.8 / np.tan(-RINGS), np.inf)), rel=0.02)


def test_a_ray_passes_above_what_is_low_and_below_what_is_high() -> None:
    low, high = scanned([[5.0, 0.0, 0.25, 0.0, 0.5]]), scanned([[5.0, 0.0, 0.25, 1.1, 3.0]])
    up = RINGS > 0
    assert np.isinf(low[up, 180]).all()
    assert np.isinf(high[(RINGS > 0) & (4.75 * np.tan(RINGS) + 0.8 < 1.1), 180]).all()


def test_a_trunk_hides_what_is_behind_it() -> None:
    both = scanned([[5.0, 0.0, 0.25, -1.0, 6.0], [8.0, 0.0, 0.2, -1.0, 6.0]])
    alone = scanned([[5.0, 0.0, 0.25, -1.0, 6.0]])
    assert both[RINGS > 0, 180] == pytest.approx(alone[RINGS > 0, 180])


def test_rays_agree_with_a_slow_computation_when_the_robot_is_tilted() -> None:
    from hfg.geometry import Transform

    turn = Transform.of(roll=0.08, pitch=-0.06, yaw=0.7).turn
    cylinders = [[4.0, 3.0, 0.3, -2.0, 6.0], [-5.0, 1.0, 0.2, -2.0, 6.0], [2.0, -6.0, 0.25, -2.0, 6.0]]
    ranges = scanned(cylinders, 50.0, turn)  # high above the ground, so that only trunks could be met
    assert np.isinf(ranges).all()
    ranges = scanned([[x, y, r, -90.0, 90.0] for x, y, r, *_ in cylinders], 0.8, turn)
    angles = -math.pi + 2 * math.pi / 360 * np.arange(360)
    for ring in (0, 7, 15):
        for column in range(0, 360, 3):
            ray = turn @ (
                math.cos(RINGS[ring]) * math.cos(angles[column]),
                math.cos(RINGS[ring]) * math.sin(angles[column]),
                math.sin(RINGS[ring]),
            )
            steps = np.arange(0.3, 12.0, 0.002)
            places = steps[:, None] * ray
            inside = [np.hypot(places[:, 0] - x, places[:, 1] - y) < r for x, y, r, *_ in cylinders]
            met = np.any(inside, axis=0)
            if ray[2] < 0:
                met |= places[:, 2] + 0.8 < 0
            first = steps[int(met.argmax())] if met.any() else math.inf
            if first < 11.9:
                assert ranges[ring, column] == pytest.approx(first, abs=0.08)


def test_trees_keep_clear_of_the_way() -> None:
    for kind in KINDS.values():
        course = Course(kind, 0.1, np.random.default_rng(3))
        trees = course.trunks[course.trunks[:, 3] > 2]
        assert len(trees) == kind.trees
        off = trees[:, None, :2] - course.way.points[::5]
        assert np.hypot(off[..., 0], off[..., 1]).min() >= kind.clearance


def test_the_slope_is_the_derivative_of_the_height() -> None:
    ground = Ground(0.2, np.random.default_rng(1))
    for x, y in ((3.0, 4.0), (-20.0, 11.0)):
        along_x, along_y = ground.slope(x, y)
        assert along_x == pytest.approx((ground.height(x + 1e-4, y) - ground.height(x - 1e-4, y)) / 2e-4, abs=1e-6)
        assert along_y == pytest.approx((ground.height(x, y + 1e-4) - ground.height(x, y - 1e-4)) / 2e-4, abs=1e-6)


def driven(twist: Twist, seconds: float) -> Vehicle:
    robot = Vehicle(0.0, 0.0, 0.0, EXACT, Limits())
    for _ in range(round(10 * seconds)):
        robot.command(twist)
        robot.step(0.1)
    return robot


def test_the_robot_needs_time_to_become_fast_and_stops_when_nobody_commands_it() -> None:
    assert driven(Twist(2.5, 0.0, 0.0), 0.5).speed == pytest.approx(1.0)
    robot = driven(Twist(9.0, 0.0, 0.0), 3.0)
    assert robot.speed == pytest.approx(2.5)
    for _ in range(20):
        robot.step(0.1)
    assert robot.speed == 0


def test_the_robot_drives_arcs_and_cannot_turn_on_the_spot() -> None:
    robot = driven(Twist(1.0, 0.0, 0.5), 4.0)
    assert robot.omega == pytest.approx(0.5, rel=0.01)
    assert driven(Twist(0.0, 0.0, 1.0), 2.0).theta == 0
    sharp = driven(Twist(1.0, 0.0, 5.0), 3.0)
    assert sharp.omega / sharp.speed < 1.8


def test_the_gap_to_a_disk_is_that_to_the_edge_of_a_rectangle() -> None:
    robot = Vehicle(1.0, 2.0, math.pi / 2, EXACT, Limits())
    assert robot.gap(1.0, 4.0, 0.2) == pytest.approx(2.0 - 0.36 - 0.2)
    assert robot.gap(3.0, 2.0, 0.2) == pytest.approx(2.0 - 0.3 - 0.2)
    assert robot.gap(1.1, 2.0, 0.2) < 0


def test_the_same_seed_gives_the_same_world_whether_or_not_pictures_are_taken() -> None:
    one, other = Simulation(4), Simulation(4)
    for number in range(20):
        if number % 3 == 0:
            one.photo()
        for world in (one, other):
            world.command(Twist(1.0, 0.0, 0.1))
            world.step(0.1)
    assert np.array_equal(one.scan().ranges, other.scan().ranges)
    assert one.imu() == other.imu()
    assert not np.array_equal(Simulation(5).scan().ranges, other.scan().ranges)


@pytest.mark.slow
def test_people_walk_into_nothing() -> None:
    world = Simulation(2, Conditions(course="dense"))
    trunks = world.course.trunks
    nearest = math.inf
    for _ in range(900):
        world.step(0.1)
        for one in world.people.others:
            if one.speed > 0.1:
                off = trunks[:, :2] - (one.x, one.y)
                nearest = min(nearest, float((np.hypot(off[:, 0], off[:, 1]) - trunks[:, 2]).min()))
    assert nearest > 0.05


def test_a_picture_shows_the_person_in_the_colours_that_they_wear_and_the_light_dims_it() -> None:
    for light in (1.0, 0.5):
        world = Simulation(1, Conditions(others=0, steepness=0.0, light=light))
        world.step(0.1)
        picture = world.photo().picture
        shirt = picture[150:175, 235:245].reshape(-1, 3).mean(0)
        assert shirt == pytest.approx(255 * light * world.people.person.clothes[0], abs=12)


def test_a_tilted_robot_measures_its_tilt() -> None:
    world = Simulation(1, Conditions(drift=0.0))
    along_x, along_y = world.course.ground.slope(world.robot.x, world.robot.y)
    theta = world.robot.theta
    rise = math.cos(theta) * along_x + math.sin(theta) * along_y
    assert world.imu().pitch == pytest.approx(-math.atan(rise), abs=0.015)
