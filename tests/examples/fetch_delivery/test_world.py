"""The simulated arena: limits of what moves, truth of what is measured, equal worlds for equal seeds."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from examples.fetch_delivery import signs
from examples.fetch_delivery.messages import Twist
from examples.fetch_delivery.world import FAULTS, USUAL, Arena, Simulation, Surroundings, fault, scanning
from examples.fetch_delivery.world.operators import Operator
from examples.fetch_delivery.world.rendering import FOCAL_PX, Renderer
from examples.fetch_delivery.world.robots import Limits

CENTRE = (240, 320)  # of a picture: row, column


def place(simulation: Simulation, x: float, y: float, theta: float, robot: int = 0) -> None:
    """Put a robot somewhere."""
    body = simulation.robots[robot]
    body.x, body.y, body.theta = x, y, theta


def before(simulation: Simulation, kind: Any, number: int, distance: float, robot: int = 0) -> None:
    """Put a robot before a station, looking at it."""
    station = simulation.arena.station(kind, number)
    x, y = station.x + distance * math.cos(station.facing), station.y + distance * math.sin(station.facing)
    place(simulation, x, y, station.facing + math.pi, robot)


def drive(simulation: Simulation, twist: Twist, seconds: float, robot: int = 0) -> None:
    for _ in range(round(seconds / 0.1)):
        simulation.command(robot, twist)
        simulation.step(0.1)


# --- how robots move


@pytest.mark.parametrize("twist", [Twist(9, 0, 0), Twist(-3, 4, 9), Twist(0.2, -0.2, -9), Twist(0.5, 0.5, 1)])
def test_no_command_makes_a_robot_faster_or_rougher_than_its_motors_are(twist: Twist) -> None:
    simulation = Simulation(3, limits=Limits(speed=0.6, turning=1.5, acceleration=0.8))
    robot = simulation.robots[0]
    last = (0.0, 0.0)
    for tick in range(80):
        simulation.command(0, twist if tick < 40 else Twist(*(-value for value in twist)))
        simulation.step(0.05)
        if not robot.contact:
            assert math.dist((robot.vx, robot.vy), last) <= 0.8 * 0.05 + 1e-9
        assert robot.speed <= 0.6 + 1e-9
        assert abs(robot.omega) <= 1.5
        last = (robot.vx, robot.vy)


def test_a_robot_that_is_not_commanded_any_more_brakes() -> None:
    simulation = Simulation(1)
    drive(simulation, Twist(0, -0.5, 0.5), 1.5)
    assert simulation.robots[0].speed > 0.4
    simulation.step(1.5)
    assert simulation.robots[0].speed == simulation.robots[0].omega == 0


def test_a_robot_drives_in_its_own_frame() -> None:
    simulation = Simulation(1)
    place(simulation, 3.0, 0.0, math.pi / 2)
    drive(simulation, Twist(0.3, 0, 0), 4)
    assert simulation.robots[0].x == pytest.approx(3.0, abs=1e-6)
    assert 1.0 < simulation.robots[0].y < 1.2


@pytest.mark.parametrize("theta", [0.0, 1.0, 2.5, 4.0])
def test_walls_hold_and_touching_them_is_counted(theta: float) -> None:
    simulation = Simulation(1)
    place(simulation, 4.0, 0.0, theta)
    drive(simulation, Twist(0.6, 0, 0), 20)
    robot, score = simulation.robots[0], simulation.scores[0]
    assert 1.25 + 0.24 < math.hypot(robot.x, robot.y) < 6.0 - 0.24
    assert score.contact_s > 5
    assert score.contacts
    assert score.contacts[0] > 2


def test_robots_do_not_drive_through_each_other() -> None:
    simulation = Simulation(1, robots=2)
    place(simulation, 4.0, 0.0, 0.0, robot=0)
    place(simulation, 5.0, 0.0, math.pi, robot=1)
    for _ in range(40):
        simulation.command(0, Twist(0.6, 0, 0))
        simulation.command(1, Twist(0.6, 0, 0))
        simulation.step(0.1)
    one, other = simulation.robots
    assert math.dist((one.x, one.y), (other.x, other.y)) > 0.47
    assert all(score.contact_s > 1 for score in simulation.scores)


def test_a_robot_in_the_open_touches_nothing() -> None:
    simulation = Simulation(1)
    drive(simulation, Twist(0.3, 0, 0.08), 5)
    assert simulation.scores[0].contact_s == 0


# --- odometry


@pytest.mark.parametrize("seed", range(6))
def test_odometry_drifts_by_one_to_some_per_cent_of_the_way(seed: int) -> None:
    simulation = Simulation(seed)
    place(simulation, 4.0, 0.0, math.pi / 2)
    drive(simulation, Twist(0.5, 0, 0.125), 50)  # once round the octagon
    odometry, robot = simulation.odometry(0), simulation.robots[0]
    turned = robot.theta - math.pi / 2
    assert 0.002 < abs(odometry.pose[2] / turned - 1) < 0.04
    away = math.dist((odometry.pose[0], odometry.pose[1]), (robot.y - 0.0, -(robot.x - 4.0)))
    assert 0.01 < away < 1.5


def test_odometry_begins_at_nought_and_tells_the_velocity() -> None:
    simulation = Simulation(2)
    assert simulation.odometry(0).pose.tolist() == [0, 0, 0]
    drive(simulation, Twist(0.3, 0.1, 0.2), 3)
    assert simulation.odometry(0).twist == pytest.approx([0.3, 0.1, 0.2])
    assert simulation.odometry(0).stamp == pytest.approx(3.0)


def test_a_push_moves_the_robot_and_not_its_odometry_a_jump_the_other_way_round() -> None:
    pushed = Simulation(1, faults=(fault("pushed robot", at_s=1, dx=0.3, dy=0.0, turn=0.4),))
    misled = Simulation(1, faults=(fault("lost localisation", at_s=1, dx=0.6, dy=0.0, turn=0.5),))
    plain = Simulation(1)
    for simulation in (pushed, misled, plain):
        simulation.step(2.0)
    assert pushed.robots[0].theta == pytest.approx(plain.robots[0].theta + 0.4)
    assert math.dist((pushed.robots[0].x, pushed.robots[0].y), (plain.robots[0].x, plain.robots[0].y)) > 0.25
    assert pushed.odometry(0).pose.tolist() == plain.odometry(0).pose.tolist()
    assert misled.robots[0].x == plain.robots[0].x
    assert misled.odometry(0).pose[2] == pytest.approx(0.5)


# --- the laser


def segments_of(corners: list[tuple[float, float]]) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def by_hand(x: float, y: float, direction: float) -> float:
    """Cut a ray with every panel, one after the other."""
    wall = [(6.0 * math.cos(math.pi / 16 * i), 6.0 * math.sin(math.pi / 16 * i)) for i in range(32)]
    corner = 1.25 / math.cos(math.pi / 8)
    octagon = [
        (corner * math.cos(math.pi / 8 + math.pi / 4 * i), corner * math.sin(math.pi / 8 + math.pi / 4 * i))
        for i in range(8)
    ]
    dx, dy = math.cos(direction), math.sin(direction)
    best = math.inf
    for (ax, ay), (bx, by) in segments_of(wall) + segments_of(octagon):
        ex, ey = bx - ax, by - ay
        cross = dx * ey - dy * ex
        if abs(cross) > 1e-12:
            t, u = ((ax - x) * ey - (ay - y) * ex) / cross, ((ax - x) * dy - (ay - y) * dx) / cross
            if t > 0 and 0 <= u <= 1:
                best = min(best, t)
    return best


@pytest.mark.parametrize(("x", "y"), [(3.0, 0.5), (-1.6, 1.0), (0.3, -5.5)])
def test_rays_end_where_the_walls_are(x: float, y: float) -> None:
    directions = np.linspace(-3, 3, 60)
    measured = scanning.cast(Arena(), x, y, directions, np.empty((0, 3)))
    assert measured == pytest.approx([by_hand(x, y, direction) for direction in directions], abs=1e-6)


def test_the_laser_sees_other_robots_as_round() -> None:
    simulation = Simulation(1, robots=2)
    place(simulation, 3.0, 0.0, 0.0, robot=0)
    place(simulation, 4.5, 0.0, 0.0, robot=1)
    scan = simulation.scan(0)
    assert scan.ranges[135] == pytest.approx(1.25, abs=0.05)
    assert scan.ranges[135 + 8] < 1.5 < 2.5 < scan.ranges[135 + 11]  # 0.25 m at 1.5 m are 9.6 degrees


def test_ranges_are_noisy_by_a_centimetre() -> None:
    simulation = Simulation(5)
    robot = simulation.robots[0]
    truth = scanning.cast(simulation.arena, robot.x, robot.y, robot.theta + scanning.ANGLES, np.empty((0, 3)))
    errors = []
    for _ in range(20):
        simulation.step(0.1)
        errors.append(simulation.scan(0).ranges - truth)
    assert 0.009 < np.std(errors) < 0.011
    assert abs(np.mean(errors)) < 0.001


# --- other arenas


def test_an_arena_is_as_large_as_it_is_told_to_be() -> None:
    simulation = Simulation(1, surroundings=Surroundings(radius=5.7, octagon=1.4, noise=0.0))
    before(simulation, "filling", 0, 2.0)
    assert simulation.scan(0).ranges[135] == pytest.approx(2.0, abs=1e-6)
    assert math.hypot(simulation.robots[0].x, simulation.robots[0].y) == pytest.approx(3.4)
    place(simulation, 3.0, 0.0, math.radians(360 / 64))
    assert simulation.scan(0).ranges.max() < 2 * 5.7


def test_a_laser_can_measure_too_far_and_noisily() -> None:
    simulation = Simulation(5, surroundings=Surroundings(offset=0.03, noise=0.03))
    robot = simulation.robots[0]
    truth = scanning.cast(simulation.arena, robot.x, robot.y, robot.theta + scanning.ANGLES, np.empty((0, 3)))
    errors = []
    for _ in range(20):
        simulation.step(0.1)
        errors.append(simulation.scan(0).ranges - truth)
    assert np.std(errors) == pytest.approx(0.03, abs=0.002)
    assert np.mean(errors) == pytest.approx(0.03, abs=0.002)


def test_odometry_can_drift_more() -> None:
    off = []
    for drift in (0.0, 1.0, 3.0):
        simulation = Simulation(5, surroundings=Surroundings(drift=drift))
        place(simulation, 3.0, -3.0, math.pi / 2)
        drive(simulation, Twist(0.5), 8)
        body = simulation.robots[0]
        off.append(math.dist(body.odometry[:2], (body.y + 3.0, -(body.x - 3.0))))
    assert off[0] < 1e-6
    assert off[1] > 0.01
    assert off[2] == pytest.approx(3 * off[1], rel=0.2)


@pytest.mark.parametrize(("reach", "given"), [(USUAL.reach, 1), (0.4, 0)])
def test_people_reach_only_so_far(reach: float, given: int) -> None:
    simulation = Simulation(1, surroundings=Surroundings(reach=reach))
    before(simulation, "filling", 1, 0.5)
    simulation.set_lamp(0, True)
    for _ in range(200):
        simulation.step(0.1)
    assert len(simulation.scores[0].fetched) == given


def test_light_and_exposure_change_pictures() -> None:
    usual, dim, blurred = (
        Simulation(1, surroundings=one) for one in (USUAL, Surroundings(light=0.5), Surroundings(blur=4.0))
    )
    for simulation in (usual, dim, blurred):
        before(simulation, "filling", 1, 2.0)
        simulation.robots[0].omega = 1.0
    assert dim.front_picture(0).mean() == pytest.approx(usual.front_picture(0).mean() / 2, rel=0.05)
    sharp, soft = (np.abs(np.diff(one.front_picture(0).astype(int))).max() for one in (usual, blurred))
    assert soft < sharp


# --- the cameras


def test_a_bulls_eye_is_seen_where_it_hangs_and_as_large() -> None:
    simulation = Simulation(1)
    before(simulation, "filling", 1, 2.2)  # the camera is 0.2 m ahead
    picture = simulation.front_picture(0)
    assert picture.shape == (480, 640)
    row = CENTRE[0] + round(FOCAL_PX * 0.01 / 1.98)  # the sign hangs a centimetre lower
    assert picture[row, CENTRE[1]] < 40  # black in the middle
    across = 220 + np.flatnonzero(picture[row, 220:420] < 60)
    assert across.max() - across.min() == pytest.approx(FOCAL_PX * 0.24 * signs.RINGS_SHARE / 1.98, abs=2)
    assert (across.max() + across.min()) / 2 == pytest.approx(CENTRE[1], abs=1)


def test_a_sign_to_the_left_is_seen_on_the_left() -> None:
    simulation = Simulation(1)
    before(simulation, "delivery", 2, 2.5)
    digit = simulation.front_picture(0)[:230]
    columns = np.flatnonzero((digit > 240).sum(axis=0) > 20)
    assert 60 < columns.mean() < 260


@pytest.mark.parametrize("distance", [1.0, 2.5])
def test_a_hidden_digit_is_not_seen(distance: float) -> None:
    plain, hidden = Simulation(1), Simulation(1, faults=(fault("hidden sign", at_s=0, digit=2),))
    for simulation in (plain, hidden):
        before(simulation, "delivery", 2, distance)
    difference = np.abs(plain.front_picture(0).astype(int) - hidden.front_picture(0)).max(axis=0)
    changed = np.flatnonzero(difference > 30)
    assert (len(changed) > 50) == (distance == 2.5)  # from near the digit is out of sight anyway
    assert changed.size == 0 or changed.max() < CENTRE[1]


def test_who_stands_before_a_sign_hides_it() -> None:
    simulation = Simulation(1, robots=2)
    before(simulation, "filling", 2, 3.0, robot=0)
    before(simulation, "filling", 2, 1.5, robot=1)
    assert np.ptp(simulation.front_picture(0)[235:245, 310:330].astype(int)) < 60


def test_turning_blurs_a_picture() -> None:
    renderer = Renderer(Arena())
    sharp, blurred = renderer.front((3.5, 0, math.pi)), renderer.front((3.5, 0, math.pi), turning=1.5)
    across = [np.abs(np.diff(picture.astype(int)[243, 280:360])) for picture in (sharp, blurred)]  # over the bull's-eye
    assert across[0].max() > 80 > 60 > across[1].max()


@pytest.mark.slow
def test_nearly_every_cube_that_lies_well_can_be_read_and_no_smeared_one() -> None:
    renderer, reader = Renderer(Arena()), cv2.barcode.BarcodeDetector()
    operator = Operator(np.random.default_rng(7))
    read = []
    for _ in range(40):
        cube = operator._lay(int(len(read) % 4) + 1, False)
        _, texts, _, _ = reader.detectAndDecodeWithType(renderer.basket(cube))
        read.append(tuple(texts) == (signs.cube_code(cube.number),))
    assert np.mean(read) > 0.9
    smeared = operator._lay(3, True)
    assert not any(reader.detectAndDecodeWithType(renderer.basket(smeared))[1])
    assert not any(reader.detectAndDecodeWithType(renderer.basket(None))[1])


# --- the people, and what counts


def wait_for_handover(simulation: Simulation, at_most_s: float = 20.0) -> float | None:
    """Switch the lamp on; say after how long the cube in the basket has changed."""
    began, cube = simulation.now_s, simulation.cube(0)
    simulation.set_lamp(0, True)
    while simulation.cube(0) == cube and simulation.now_s < began + at_most_s:
        simulation.step(0.05)
    took_s = simulation.now_s - began
    simulation.set_lamp(0, False)
    simulation.step(0.05)
    return took_s if simulation.cube(0) != cube else None


@pytest.mark.slow
def test_operators_react_within_two_to_ten_seconds_but_now_and_then_later_or_not_at_all() -> None:
    operator, arena = Operator(np.random.default_rng(1)), Arena()
    station = arena.station("filling", 0)
    at, times = (station.x + 0.4, station.y), []
    for lamp in range(400):
        operator.watch(100.0 * lamp, False, at, None, arena)
        for tick in range(400):
            if operator.watch(100.0 * lamp + tick * 0.05, True, at, None, arena):
                times.append(tick * 0.05)
                break
    prompt = [time for time in times if time <= 10]
    assert min(times) >= 2
    assert max(times) <= 16.05
    assert 0.85 < len(prompt) / 400 < 0.97
    assert 0.005 < 1 - len(times) / 400 < 0.08


def test_nobody_comes_without_a_lamp_or_far_from_a_station() -> None:
    simulation = Simulation(1)
    before(simulation, "filling", 0, 0.36)
    simulation.step(20)
    assert simulation.cube(0) is None
    before(simulation, "filling", 0, 1.5)
    assert wait_for_handover(simulation) is None


def fetched(seed: int = 1, **options: Any) -> Simulation:
    """Give a world whose robot has got a cube."""
    simulation = Simulation(seed, **options)
    before(simulation, "filling", 0, 0.4)
    for _ in range(3):
        if wait_for_handover(simulation):
            return simulation
    raise AssertionError("three lamps in a row were overlooked")


def hand_in(simulation: Simulation, station: int) -> None:
    before(simulation, "delivery", station, 0.4)
    for _ in range(3):
        if wait_for_handover(simulation):
            return
    raise AssertionError("three lamps in a row were overlooked")


def test_a_cube_at_its_station_is_delivered_and_at_another_one_wrong() -> None:
    simulation = fetched()
    ((_, number),) = simulation.scores[0].fetched
    hand_in(simulation, number)
    assert [cube for _, cube in simulation.scores[0].delivered] == [number]
    assert simulation.scores[0].wrong == []
    simulation = fetched(2)
    ((_, number),) = simulation.scores[0].fetched
    hand_in(simulation, number % 4 + 1)
    assert [cube for _, cube in simulation.scores[0].wrong] == [number]
    assert simulation.scores[0].delivered == []


def test_who_brings_a_cube_back_gets_another_one() -> None:
    simulation = fetched()
    for _ in range(10):
        wait_for_handover(simulation)
    score = simulation.scores[0]
    assert len(score.fetched) == len(score.returned) + 1 > 3


def test_a_cube_that_comes_back_is_accounted_for_by_what_the_robot_has_reported_of_it() -> None:
    simulation = fetched()
    score = simulation.scores[0]
    ((_, number),) = score.fetched
    simulation.report(0, number % 4 + 1)
    wait_for_handover(simulation)
    assert score.unaccounted() == score.returned != []
    simulation.report(0, None)
    wait_for_handover(simulation)
    assert score.unaccounted() == score.returned[:1]


def test_a_lamp_while_driving_is_noted_down() -> None:
    simulation = Simulation(1)
    simulation.set_lamp(0, True)
    drive(simulation, Twist(0.3, 0, 0), 2)
    assert simulation.scores[0].lamp_while_driving_s > 1.5


def test_nobody_is_at_a_station_whose_operator_is_absent() -> None:
    simulation = Simulation(1, faults=(fault("absent operator", at_s=0, kind="filling", number=0),))
    before(simulation, "filling", 0, 0.36)
    assert wait_for_handover(simulation, 40) is None


def test_a_cube_can_be_unreadable() -> None:
    simulation = fetched(faults=(fault("unreadable cube", cube=1),))
    assert not any(cv2.barcode.BarcodeDetector().detectAndDecodeWithType(simulation.basket_picture(0))[1])


def test_a_crate_blocks_a_station_for_laser_and_wheels() -> None:
    simulation = Simulation(1, faults=(fault("blocked station", at_s=0, lasts_s=30, kind="filling", number=3),))
    before(simulation, "filling", 3, 2.0)
    assert simulation.scan(0).ranges[135] == pytest.approx(1.2, abs=0.05)
    drive(simulation, Twist(0.5, 0, 0), 5)
    assert simulation.scores[0].contact_s > 0.5


# --- equal seeds, equal worlds


def digest(seed: int) -> str:
    """Let two robots drive about and hash all that they measure."""
    simulation, text = Simulation(seed, robots=2, faults=(fault("pushed robot", at_s=2),)), hashlib.sha256()
    for step in range(40):
        for robot in (0, 1):
            simulation.command(robot, Twist(0.4, 0.1 * robot, 0.3))
            simulation.set_lamp(robot, step > 30)
        simulation.step(0.1)
        if step % 10 == 0:
            for robot in (0, 1):
                text.update(simulation.odometry(robot).pose.tobytes())
                text.update(simulation.scan(robot).ranges.tobytes())
                text.update(simulation.front_picture(robot).tobytes())
                text.update(simulation.basket_picture(robot).tobytes())
    return text.hexdigest()


@pytest.mark.slow
def test_equal_seeds_give_equal_worlds_in_another_process_with_another_hash_seed() -> None:
    root = Path(__file__).parents[3]
    program = "from tests.examples.fetch_delivery.test_world import digest; print(digest(4), digest(5))"
    environment = os.environ | {
        "PYTHONHASHSEED": "77",
        "PYTHONPATH": os.pathsep.join([str(root), str(root / "transports")]),
    }
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=root, capture_output=True, text=True, check=True
    )
    four, five = done.stdout.split()
    assert four == digest(4)
    assert four != five


def test_who_looks_less_often_lives_in_the_same_world() -> None:
    seen = []
    for every in (1, 5):
        simulation = Simulation(6)
        for step in range(20):
            simulation.command(0, Twist(0.3, 0, 0.2))
            simulation.step(0.1)
            if step % every == 0:
                simulation.front_picture(0)
                simulation.scan(0)
        seen.append((simulation.scan(0).ranges.tolist(), simulation.odometry(0).pose.tolist()))
    assert seen[0] == seen[1]


# --- what is refused


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: Simulation(robots=5), "one to four robots fit into the arena, not 5"),
        (lambda: Simulation(-1), "a seed is a whole number from 0, not -1"),
        (lambda: Simulation(start_s=math.inf), "the start is at 0 s or later, not at inf s"),
        (
            lambda: Simulation().step(0.03),
            "the arena moves on in ticks of 0.05 s, not by 0.03 s; step by a multiple of them",
        ),
        (
            lambda: Simulation().step(math.nan),
            "the arena moves on in ticks of 0.05 s, not by nan s; step by a multiple of them",
        ),
        (
            lambda: Simulation().command(0, Twist(math.nan)),
            "a robot can only be commanded finite velocities, not Twist(vx=nan",
        ),
        (lambda: Simulation().scan(1), "there is no robot 1; there are 1, counted from 0"),
        (lambda: Limits(speed=0), "a robot's limit of speed lies above 0 and up to 3.0, not at 0"),
        (lambda: Arena((1, 2, 3, 3)), "delivery stations bear the digits 1 to 4, each once, not (1, 2, 3, 3)"),
        (lambda: Arena().station("filling", 4), "there is no filling station 4; they are 0 to 3"),
        (lambda: fault("flood"), "there is no fault 'flood'; there are blocked station, absent operator,"),
        (
            lambda: fault("pushed robot", dz=1),
            "the fault 'pushed robot' has no value 'dz'; it has at_s, lasts_s, robot,",
        ),
        (lambda: fault("pushed robot", at_s=-1), "a fault begins at 0 s or later and lasts, not from -1 s for inf s"),
        (
            lambda: Simulation(faults=(fault("pushed robot", robot=3),)),
            "there is no robot 3; there are 1, counted from 0",
        ),
        (lambda: signs.ean8("12"), "a bar code EAN-8 has seven digits and a check digit behind them, not '12'"),
    ],
)
def test_what_is_out_of_range_is_refused_with_a_sentence(wrong: Any, sentence: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        wrong()
    assert str(refused.value).startswith(sentence)


def test_every_fault_can_be_made_by_its_name_alone() -> None:
    for name in FAULTS:
        Simulation(1, faults=(fault(name, at_s=0.2),)).step(0.5)
