"""What the robot derives from its sensors: things that stand, bodies, clothes; and the paths that it plans."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from examples.follow_person.messages import Camera, Imu, Photo, Twist
from examples.follow_person.mission.lattice import RADIUS, along_trail, is_free, search
from examples.follow_person.perception.bodies import level_cloud, make_scene, upright_bodies
from examples.follow_person.perception.clothes import look_of, pixel
from examples.follow_person.perception.records import Look, Scene
from examples.follow_person.perception.standing import Standing
from hfg.geometry import PointCloud, PoseInFrame, Transform
from hfg.nodes.estimation import Track

HERE = np.zeros(3)
NOBODY = np.zeros((0, 2))


def scene(*tracks: Track, pose: Any = HERE, tops: dict[int, float] | None = None) -> Scene:
    return Scene(0.0, np.array(pose, np.float64), 0.0, 0.0, 0.0, list(tracks), tops or {})


def blob(x: float, y: float, seed: int = 0) -> Any:
    return np.array([x, y]) + np.random.default_rng(seed).uniform(-0.1, 0.1, (20, 2))


# --- things that stand


def test_what_is_hit_again_and_again_stands_and_somebody_who_walks_by_does_not() -> None:
    known = Standing()
    for number in range(40):
        walker = blob(3.0 + 0.15 * number, 1.0, number)
        stands = known.split(np.vstack([blob(5.0, 0.0, number), walker]), HERE, NOBODY, 0.6)
    assert stands[:20].mean() > 0.9
    assert not stands[20:].any()


def test_nothing_is_learned_around_those_who_have_moved_even_if_they_stop() -> None:
    known = Standing()
    for number in range(40):
        stands = known.split(blob(5.0, 0.0, number), HERE, np.array([[5.0, 0.0]]), 0.6)
    assert not stands.any()


def test_a_place_through_which_one_can_see_is_forgotten_soon_and_one_that_is_hidden_is_not() -> None:
    wall = np.stack([np.full(40, 8.0), np.linspace(-2.0, 2.0, 40)], 1)
    before = np.stack([np.full(40, 3.0), np.linspace(-1.0, 1.0, 40)], 1)
    for behind, still_stands in ((wall, False), (before, True)):
        known = Standing()
        for number in range(30):
            known.split(blob(5.0, 0.0, number), HERE, NOBODY, 0.6)
        for _ in range(6):
            known.split(behind, HERE, NOBODY, 0.6)
        again = known.split(np.vstack([behind, blob(5.0, 0.0, 1)]), HERE, NOBODY, 0.6)
        assert bool(again[len(behind) :].any()) is still_stands


# --- bodies


def test_a_levelled_cloud_has_up_as_up() -> None:
    turn = Transform.of(roll=0.1, pitch=-0.05)
    ground = np.array([[2.0, 1.0, 0.0], [-3.0, 2.0, 0.0]])  # in the level frame of the robot
    measured = (ground @ turn.turn) - (0.0, 0.0, 0.8)
    levelled: Any = level_cloud.function(PointCloud("laser", 0.0, measured), Imu(0.0, 0.1, -0.05), above=0.8)
    assert levelled.points == pytest.approx(ground, abs=1e-9)


def test_a_body_is_upright_and_not_too_wide() -> None:
    person = np.column_stack([np.full(8, 4.0), np.linspace(-0.2, 0.2, 8)])
    hedge = np.column_stack([np.full(8, 6.0), np.linspace(-2.0, 2.0, 8)])
    stone = np.column_stack([np.full(8, 8.0), np.linspace(-0.2, 0.2, 8)])
    tall, low = np.linspace(0.2, 1.7, 8), np.linspace(0.1, 0.4, 8)
    numbers = np.repeat(np.arange(3, dtype=np.int32), 8)
    cloud = PointCloud(
        "odom", 0.0, np.vstack([person, hedge, stone]), {"cluster": numbers, "height": np.r_[tall, tall, low]}
    )
    found: Any = upright_bodies.function(cloud, PoseInFrame("odom", 0.0, Transform.of()), deep=0.1)
    assert found.points == pytest.approx(np.array([[4.1, 0.0]]), abs=0.01)
    assert found.fields["top"] == pytest.approx([1.7])


def test_a_scene_knows_how_high_its_tracks_are() -> None:
    tracks = [Track(1, 4.0, 0.0, 0, 0, 0.1, 5, 0, True), Track(2, 4.0, 3.0, 0, 0, 0.1, 5, 2, True)]
    bodies = PointCloud("odom", 0.0, np.array([[4.05, 0.0]]), {"top": np.array([1.7])})
    made: Any = make_scene.function(
        tracks, bodies, PoseInFrame("odom", 0.0, Transform.of(x=1.0, yaw=0.5)), Imu(0, 0, 0), Twist(0.0, 0.0, 0.0)
    )
    assert made.tops == {1: 1.7}
    assert made.pose == pytest.approx([1.0, 0.0, 0.5])


# --- clothes


def test_a_pixel_is_where_a_pinhole_camera_would_show_it() -> None:
    camera = Camera(480, 360, 300.0, 0.9)
    assert pixel(camera, scene(), 3.0, 0.0, 0.9) == pytest.approx((240.0, 180.0))
    assert pixel(camera, scene(), 3.0, 1.0, 1.9) == pytest.approx((140.0, 80.0))
    assert pixel(camera, scene(), -3.0, 0.0, 0.9) is None


def test_clothes_look_the_same_in_half_of_the_light() -> None:
    camera = Camera()
    looks = []
    for light in (1.0, 0.5):
        picture = np.zeros((camera.height, camera.width, 3), np.uint8)
        picture[:] = (np.array([30, 160, 90]) * light).astype(np.uint8)
        look = look_of(Photo(picture, 0.0, camera), scene(), 4.0, 0.0, 1.7)
        assert look is not None
        looks.append(look)
    assert looks[0].differs(looks[1]) < 0.02
    assert looks[0].differs(Look((0.4, 0.2), (0.3, 0.3), 1)) > 0.2


# --- paths


def planned(blocked: Any, goal: tuple[float, float], *, backward: bool = False) -> Any:
    from scipy.ndimage import distance_transform_edt

    clear = distance_transform_edt(~blocked) * 0.1 if blocked.any() else np.full(blocked.shape, np.inf)
    return search(clear, 0.1, goal, backward=backward, margin=0.05)


def test_a_path_goes_round_what_is_in_the_way_at_a_distance() -> None:
    blocked = np.zeros((200, 200), bool)
    blocked[125:135, 90:112] = True  # ahead of the robot, which is in the middle
    path = planned(blocked, (6.0, 0.0))
    assert path is not None
    assert np.hypot(*(path[-1, :2] - (6.0, 0.0))) < 0.7
    places = np.argwhere(blocked) * 0.1 - 10.0 + 0.05
    off = path[:, None, :2] - places
    assert np.hypot(off[..., 0], off[..., 1]).min() > RADIUS


def test_only_a_planner_that_may_drive_back_leaves_a_dead_end() -> None:
    blocked = np.zeros((200, 200), bool)
    blocked[95:112, 92:94] = blocked[95:112, 106:108] = True
    blocked[110:112, 92:108] = True  # a pocket, open at the back
    goal = (4.0, 0.0)
    assert planned(blocked, goal) is None
    path = planned(blocked, goal, backward=True)
    assert path is not None
    assert path[:, 2].min() == -1
    assert math.dist(path[-1, :2], goal) < 0.7


def test_a_path_along_the_trail_ends_before_the_person_and_is_free_where_nothing_stands() -> None:
    trail = [(0.3 * step - 2.0, 0.4) for step in range(30)]
    path = along_trail(trail, 2.0)
    assert path[0] == pytest.approx([0.0, 0.0])
    assert trail[-1][0] - path[-1, 0] == pytest.approx(2.0, abs=0.31)
    clear = np.full((200, 200), 5.0)
    assert is_free(clear, 0.1, path, 0.1)
    clear[128:133, 102:107] = 0.2  # around x = 3, y = 0.4
    assert not is_free(clear, 0.1, path, 0.1)


def test_a_trail_that_is_far_away_or_leads_back_is_not_followed() -> None:
    assert along_trail([(0.3 * step, 4.0) for step in range(20)], 2.0) is None
    assert along_trail([(-0.3 * step, 0.0) for step in range(20)], 2.0) is None
