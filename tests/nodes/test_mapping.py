"""The family `mapping`: maps compared with exact geometry of beams, matches with all poses, drives with the truth."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

import hfg
from hfg.geometry import Grid, LaserScan, PoseInFrame, Transform
from hfg.nodes import mapping
from hfg.nodes.estimation import Twist, moved_by
from hfg.nodes.robotics import expected_ranges
from hfg.testing import fire

ROOM = [(-4.0, -3.0), (4.0, -3.0), (4.0, 3.0), (1.0, 3.0), (1.0, 2.0), (-4.0, 2.0)]
BOX = [(1.5, -1.0), (2.5, -1.0), (2.5, -0.2), (1.5, -0.2)]
WALLS = np.array([[one[k - 1], one[k]] for one in (ROOM, BOX) for k in range(len(one))])
ANGLES = np.arange(-math.pi, math.pi, math.radians(2))


def seen(pose: Any, stamp: float = 0.0, noise: float = 0.0, seed: int = 0) -> LaserScan:
    ranges = expected_ranges.function(np.array(pose, float), ANGLES, WALLS)
    ranges = ranges + np.random.default_rng(seed).normal(0, noise, len(ranges)) if noise else ranges
    return LaserScan("laser", stamp, ranges, -math.pi, math.radians(2))


def at(x: float, y: float, yaw: float, stamp: float = 0.0, frame: str = "map") -> PoseInFrame:
    return PoseInFrame(frame, stamp, Transform.of(x, y, yaw=yaw))


# --- maps from known poses ---


def chord(start: Any, end: Any, cell: tuple[int, ...], side: float, corner: float) -> float:
    """How much of a line lies in a cell, by clipping."""
    low, way = 0.0, 1.0
    for axis in (0, 1):
        d = end[axis] - start[axis]
        a, b = corner + cell[axis] * side - start[axis], corner + (cell[axis] + 1) * side - start[axis]
        if abs(d) < 1e-12:
            if not a <= 0 <= b:
                return 0.0
            continue
        first, last = sorted((a / d, b / d))
        low, way = max(low, first), min(way, last)
    return max(0.0, way - low) * math.dist(start, end)


def test_cells_are_free_where_beams_pass_and_occupied_where_they_end() -> None:
    pose, scan = np.array([0.3, 0.1, 0.7]), seen((0.3, 0.1, 0.7))
    grid = fire(mapping.MapScans(cell=0.23, size=10.0), scan=scan, pose=at(*pose)).outputs["grid"]
    ends = pose[:2] + scan.ranges[:, None] * np.stack([np.cos(ANGLES + 0.7), np.sin(ANGLES + 0.7)], 1)
    occupied = {tuple(np.floor((end + 5.06) / 0.23).astype(int)) for end in ends}
    assert set(map(tuple, np.argwhere(grid.values > 60))) == occupied
    for cell in itertools.product(range(44), repeat=2):
        if cell in occupied:
            continue
        longest = max(chord(pose[:2], end, cell, 0.23, -5.06) for end in ends)
        if longest == 0:
            assert grid.values[cell] == -1
        elif longest > 0.18:  # three quarters of a cell
            assert grid.values[cell] == 40
    assert (grid.frame_id, grid.stamp, grid.origin.translation.tolist()) == (
        "map",
        0.0,
        pytest.approx([-5.06, -5.06, 0.0]),
    )


def test_probabilities_are_those_of_bayes() -> None:
    """A cell is hit, hit, passed, hit."""
    node = mapping.MapScans(cell=0.5, size=10.0, hit=0.8, miss=0.3, sure=0.99)
    odds = 1.0
    for distance in (2.2, 2.2, 4.0, 2.2):
        scan = LaserScan("laser", 0.0, np.array([distance]), 0.0, 0.1)
        grid = fire(node, scan=scan, pose=at(0.1, 0.1, 0.0)).outputs["grid"]
        odds *= 0.8 / 0.2 if distance < 4 else 0.3 / 0.7
        assert grid.values[14, 10] == round(100 * odds / (1 + odds))
    fire(node, slot="clear")
    assert fire(node, scan=scan, pose=at(9.0, 9.0, 0.0)).outputs["grid"].values.max() == -1


def test_beams_that_hit_nothing_clear_only_if_they_shall_and_no_number_never_does() -> None:
    for clear, known in ((0.0, False), (3.0, True)):
        for nothing in (math.inf, 30.0, math.nan):
            scan = LaserScan("laser", 0.0, np.array([nothing]), 0.0, 0.1)
            node = mapping.MapScans(cell=0.5, size=10.0, clear_range=clear)
            grid = fire(node, scan=scan, pose=at(0.1, 0.1, 0.0)).outputs["grid"]
            assert (grid.values[10:16, 10] == 40).all() == (known and not math.isnan(nothing))
            assert (grid.values[17:] == -1).all()


def test_a_pose_of_another_frame_and_a_map_that_is_too_large_are_refused() -> None:
    node = mapping.MapScans()
    fire(node, scan=seen((0, 0, 0)), pose=at(0, 0, 0))
    with pytest.raises(ValueError, match='the map is in frame "map", got a pose in frame "odom"'):
        fire(node, scan=seen((0, 0, 0)), pose=at(0, 0, 0, frame="odom"))
    with pytest.raises(ValueError, match="at most 25 million cells, got 10000 x 10000; take larger cells"):
        fire(mapping.MapScans(cell=1e-3, size=10.0), scan=seen((0, 0, 0)), pose=at(0, 0, 0))


# --- matching ---


def room_grid(cell: float = 0.05, origin: Transform | None = None) -> Grid:
    node = mapping.MapScans(cell=cell, size=12.0)
    for pose in [(0.0, 0.0, 0.0), (-2.0, -1.0, 1.0), (3.0, 1.0, 2.0), (3.2, -2.2, 0.5)]:
        for turn in (0.0, 0.01, 0.02):
            grid = fire(node, scan=seen((pose[0], pose[1], pose[2] + turn)), pose=at(pose[0], pose[1], pose[2] + turn))
    values: Grid = grid.outputs["grid"]
    return values if origin is None else Grid("map", 0.0, origin @ values.origin, cell, values.values)


def points_of(scan: LaserScan) -> np.ndarray:
    return np.stack([scan.ranges * np.cos(scan.angles), scan.ranges * np.sin(scan.angles)], 1)


def test_a_scan_is_found_on_the_map_from_a_guess_that_is_off() -> None:
    grid, rng = room_grid(), np.random.default_rng(2)
    for number in range(10):
        true = np.array([*rng.uniform(-1.5, 1.0, 2), rng.uniform(-3, 3)])
        guess = true + rng.uniform(-1, 1, 3) * [0.25, 0.25, 0.15]
        scan = points_of(seen(true, noise=0.01, seed=number))
        found = fire(mapping.match_scan_to_grid(), points=scan, guess=guess, grid=grid).outputs["out"]
        assert np.hypot(*(found.pose - true)[:2]) < 0.03
        assert abs(math.remainder(found.pose[2] - true[2], 2 * math.pi)) < 0.01
        assert found.share > 0.9


def test_the_grid_may_lie_anywhere_in_its_frame() -> None:
    shift = Transform.of(3.0, -2.0, yaw=0.8)
    true = np.array([0.2, -0.4, 0.3])
    scan = points_of(seen(true))
    pose = shift @ Transform.of(true[0], true[1], yaw=true[2])
    guess = np.array([*pose.translation[:2], pose.angles[2]]) + np.array([0.1, -0.15, 0.05])
    found = fire(mapping.match_scan_to_grid(), points=scan, guess=guess, grid=room_grid(origin=shift)).outputs["out"]
    assert np.hypot(*(found.pose[:2] - pose.translation[:2])) < 0.03
    assert found.pose[2] == pytest.approx(pose.angles[2], abs=0.01)


def test_the_search_finds_the_pose_that_is_best_of_all() -> None:
    """Each pose of the window is scored one by one, as the definition says."""
    from hfg.nodes.mapping._fields import _OUTLIERS, Field

    grid = room_grid(cell=0.1)
    corner = np.array([*grid.origin.translation[:2], 0.0])
    field = Field(grid.values >= 60, 0.1, corner, 0.1)
    middles = (np.argwhere(grid.values >= 60) + 0.5) * 0.1
    points = points_of(seen((0.5, 0.2, 0.4)))[::10]
    guess, prior = field.inside(np.array([0.4, 0.35, 0.45])), np.diag([3.0, 5.0, 40.0])
    found = field.searched(points, guess, prior, 0.2, 0.1)
    farthest = np.hypot(*points.T).max()
    count = math.ceil(0.1 / (0.1 / farthest))
    best, where = -math.inf, guess
    for i, j, turn in itertools.product(range(-2, 3), range(-2, 3), np.linspace(-0.1, 0.1, 2 * count + 1)):
        step = np.array([0.1 * i, 0.1 * j, turn])
        x, y, yaw = guess + np.array([0, 0, turn])
        placed = points @ np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + [x, y]
        total = -0.5 * step @ prior @ step
        for cell in np.floor(placed / 0.1).astype(int) + np.array([i, j]):
            far = min(field.reach, np.hypot(*(middles - (cell + 0.5) * 0.1).T).min())
            total += math.log(_OUTLIERS + (1 - _OUTLIERS) * math.exp(-0.5 * (far / 0.1) ** 2))
        if total > best:
            best, where = total, guess + step
    assert found.tolist() == pytest.approx(where.tolist())


def test_along_a_corridor_the_guess_decides_and_the_covariance_says_so() -> None:
    values = np.zeros((200, 60), np.int8)
    values[:, [10, 50]] = 100
    corridor = Grid("map", 0.0, Transform.of(), 0.05, values)
    walls = np.array([[x, y] for x in np.linspace(-2, 2, 60) for y in (-1.0, 1.0)])
    guess = np.array([5.0, 1.55, 0.03])
    before = np.diag([0.04, 0.04, 0.01])
    found = fire(mapping.match_scan_to_grid(), points=walls, guess=guess, grid=corridor, covariance=before).outputs[
        "out"
    ]
    assert found.pose.tolist() == pytest.approx([5.0, 1.525, 0.0], abs=0.02)
    assert found.covariance[0, 0] == pytest.approx(0.04, rel=0.05)
    assert found.covariance[1, 1] < 0.001


def test_where_there_is_nothing_to_match_the_guess_stays_and_empty_maps_are_refused() -> None:
    free = Grid("map", 2.0, Transform.of(), 0.1, np.zeros((30, 30), np.int8))
    guess = np.array([1.0, 1.0, 0.0])
    found = fire(mapping.match_scan_to_grid(), points=np.ones((9, 2)), guess=guess, grid=free).outputs["out"]
    assert (found.pose.tolist(), found.share) == (guess.tolist(), 0.0)
    empty = Grid("map", 2.0, Transform.of(), 0.1, np.zeros((0, 30), np.int8))
    with pytest.raises(ValueError, match='the grid in frame "map" at 2.000 s is empty, 0 x 30 cells: there is nothing'):
        fire(mapping.match_scan_to_grid(), points=np.ones((9, 2)), guess=guess, grid=empty)
    for wrong in (np.zeros((3, 3)), np.full((3, 3), np.nan), np.diag([1.0, 1.0, -1.0])):
        with pytest.raises(ValueError, match="symmetric, positive and not singular"):
            fire(mapping.match_scan_to_grid(), points=np.ones((9, 2)), guess=guess, grid=free, covariance=wrong)


# --- both at once ---


@hfg.node
def drive(*, steps: int = 200) -> Iterator[list[Any]]:
    """A round through the room, with odometry that turns six percent too far and drives six percent too short."""
    true, told = np.array([-2.0, -1.5, 0.0]), np.array([-2.0, -1.5, 0.0])
    for step in range(steps):
        stamp = step / 10
        mount = np.array([true[0] + 0.2 * math.cos(true[2]), true[1] + 0.2 * math.sin(true[2]), true[2] + 0.5])
        yield [seen(mount, stamp, 0.01, step), at(told[0], told[1], told[2], stamp, "odom"), true.copy()]
        turning = step % 50 >= 38
        twist = Twist(0.0 if turning else 0.6, 0.0, math.pi / 2 / 1.2 if turning else 0.0)
        for pose, way, turn in ((true, 1.0, 1.0), (told, 0.94, 1.06)):
            x, y, omega = moved_by(Twist(twist.vx * way, 0.0, twist.omega * turn), 0.1)
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            pose += [cos * x - sin * y, sin * x + cos * y, omega]


@pytest.mark.slow
def test_a_robot_knows_where_it_is_on_the_map_that_it_builds() -> None:
    node = mapping.SlamScans(cell=0.05, size=12.0, mount_x=0.2, mount_yaw=0.5)
    worst, drifted = 0.0, 0.0
    for scan, odometry, true in drive.function(steps=200):
        done = fire(node, scan=scan, odometry=odometry).outputs
        found = done["pose"].pose
        worst = max(worst, math.dist(found.translation[:2], true[:2]))
        drifted = max(drifted, math.dist(odometry.pose.translation[:2], true[:2]))
        assert abs(math.remainder(found.angles[2] - true[2], 2 * math.pi)) < 0.04
    assert worst < 0.08
    assert drifted > 0.5
    grid = done["grid"]
    middles = grid.origin.translation[:2] + (np.argwhere(grid.values > 60) + 0.5) * grid.cell
    along = WALLS[:, 1] - WALLS[:, 0]
    share = np.clip(((middles[:, None] - WALLS[:, 0]) * along).sum(2) / (along**2).sum(1), 0, 1)
    off = np.hypot(*(middles[:, None] - WALLS[:, 0] - share[..., None] * along).transpose(2, 0, 1)).min(1)
    assert np.quantile(off, 0.95) < 0.1


def test_scan_and_odometry_of_different_moments_are_refused() -> None:
    with pytest.raises(
        ValueError, match="the scan is of 1.000 s and the odometry of 0.500 s, more than slack_s = 0.1 s"
    ):
        fire(mapping.SlamScans(), scan=seen((0, 0, 0), 1.0), odometry=at(0, 0, 0, 0.5))
    with pytest.raises(ValueError, match="has left the map of 5 m; take a larger size"):
        fire(mapping.SlamScans(size=5.0), scan=seen((0, 0, 0)), odometry=at(9, 0, 0))


# --- files ---


def test_a_map_is_written_as_ros_reads_it_and_read_again(tmp_path: Path) -> None:
    values = np.array([[0, 100, -1], [25, 26, 64], [65, 10, 99], [-1, 0, 0]], np.int8)
    grid = Grid("map", 1.0, Transform.of(1.5, -2.0, yaw=0.3), 0.05, values)
    path = tmp_path / "maps" / "house.yaml"
    fire(mapping.save_map(), grid=grid, path=path)
    about = yaml.safe_load(path.read_text())
    assert (about["resolution"], about["negate"], about["image"]) == (0.05, 0, "house.png")
    assert about["origin"] == pytest.approx([1.5, -2.0, 0.3])
    # As map_server does it: (255 - pixel) / 255 compared with both thresholds; the last row has the least y.
    picture = cv2.imread(str(path.parent / about["image"]), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    assert picture.shape == (3, 4)
    read = fire(mapping.load_map(frame_id="house"), path=path).outputs["out"]
    for i, j in itertools.product(range(4), range(3)):
        share = (255 - int(picture[2 - j, i])) / 255
        ros = 100 if share > about["occupied_thresh"] else 0 if share < about["free_thresh"] else -1
        value = values[i, j]
        assert ros == (100 if value >= 65 else 0 if 0 <= value <= 25 else -1)
        assert read.values[i, j] == ros
    assert (read.frame_id, read.cell) == ("house", 0.05)
    assert read.origin.translation.tolist() == pytest.approx([1.5, -2.0, 0.0])
    assert read.origin.angles[2] == pytest.approx(0.3)


def test_maps_of_other_programs_are_read(tmp_path: Path) -> None:
    (tmp_path / "old.pgm").write_bytes(b"P5\n# by map_saver\n3 2\n255\n" + bytes([0, 205, 254, 254, 100, 50]))
    about = (
        "image: old.pgm\nresolution: 0.1\norigin: [-1, -2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (tmp_path / "old.yaml").write_text(about)
    read = fire(mapping.load_map(), path=tmp_path / "old.yaml").outputs["out"]
    assert read.values.tolist() == [[0, 100], [-1, -1], [100, 0]]
    (tmp_path / "old.yaml").write_text(about.replace("negate: 0", "negate: 1"))
    read = fire(mapping.load_map(), path=tmp_path / "old.yaml").outputs["out"]
    assert read.values.tolist() == [[100, 0], [-1, 100], [-1, 100]]
    (tmp_path / "old.yaml").write_text(about + "mode: scale\n")
    read = fire(mapping.load_map(), path=tmp_path / "old.yaml").outputs["out"]
    between = round(1 + 98 * (155 / 255 - 0.196) / (0.65 - 0.196))
    assert read.values.tolist() == [[0, 100], [between, 1], [100, 0]]
    (tmp_path / "raw.pgm").write_bytes(b"P5\n3 1\n255\n" + bytes([0, 100, 255]))
    (tmp_path / "raw.yaml").write_text("image: raw.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nmode: raw\n")
    assert fire(mapping.load_map(), path=tmp_path / "raw.yaml").outputs["out"].values.tolist() == [[0], [100], [-1]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [", "is not a map: it is not YAML"),
        ("- 1", 'is not a map of ROS: no "image", no "resolution", no "origin"; write one with mapping.save_map'),
        ("image: x.png\nresolution: 0\norigin: [0, 0, 0]", "resolution is 0 m, not a length"),
        ("image: x.png\nresolution: big\norigin: [0, 0, 0]", "resolution is 'big', not a number"),
        ("image: x.png\nresolution: 1\norigin: [0, 0]", "origin is \\[0, 0\\], not x, y and yaw"),
        ("image: x.png\nresolution: 1\norigin: [0, 0, 0]\nmode: odd", "mode is 'odd', not"),
        ("image: x.png\nresolution: 1\norigin: [0, 0, 0]", 'x.png" is not a picture: a map needs a PNG or PGM file'),
    ],
)
def test_a_file_that_is_no_map_is_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "x.png").write_bytes(b"no picture")
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(ValueError, match=message):
        fire(mapping.load_map(), path=tmp_path / "map.yaml")


def test_a_map_without_a_picture_or_cells_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("image: nowhere.png\nresolution: 1\norigin: [0, 0, 0]")
    with pytest.raises(FileNotFoundError, match=r'cannot read ".*nowhere.png"'):
        fire(mapping.load_map(), path=tmp_path / "map.yaml")
    empty = Grid("map", 1.0, Transform.of(), 0.05, np.zeros((0, 3), np.int8))
    with pytest.raises(ValueError, match='the map in frame "map" is empty'):
        fire(mapping.save_map(), grid=empty, path=tmp_path / "new.yaml")
    tilted = Grid("map", 1.0, Transform.of(roll=0.2), 0.05, np.zeros((3, 3), np.int8))
    with pytest.raises(ValueError, match="no room for an origin that is tilted"):
        fire(mapping.save_map(), grid=tilted, path=tmp_path / "new.yaml")
