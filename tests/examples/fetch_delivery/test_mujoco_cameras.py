"""Pictures that MuJoCo has drawn: the same detectors recognise in them what they do in those of the light renderer.

Skipped where the package `mujoco` or OpenGL without a screen is missing; what is said then is tested everywhere.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.perception import cube, sighting
from examples.fetch_delivery.perception.records import Cube as Read
from examples.fetch_delivery.perception.records import Sighting
from examples.fetch_delivery.world import Simulation
from examples.fetch_delivery.world.arena import Arena, Station
from examples.fetch_delivery.world.mujoco_cameras import CamerasMissing, MujocoRenderer
from examples.fetch_delivery.world.rendering import Cube, Renderer, Round
from hfg.errors import HfgError
from tests.examples.fetch_delivery.watching import watched

ARENA = Arena((2, 3, 1, 4))
CLOSE = 0.03  # metres


@pytest.fixture(scope="module")
def cameras() -> Any:
    try:
        renderer = MujocoRenderer(ARENA)
    except CamerasMissing as missing:
        pytest.skip(str(missing))
    yield renderer
    renderer.close()


def before(station: Station, distance: float, aside: float, turn: float) -> tuple[float, float, float]:
    """Give the pose from which a robot looks at a station."""
    cos, sin = math.cos(station.facing), math.sin(station.facing)
    x, y = station.x + distance * cos - aside * sin, station.y + distance * sin + aside * cos
    return x, y, math.atan2(station.y - y, station.x - x) + turn


def views(rng: np.random.Generator, kind: str, nearest: float, farthest: float) -> Any:
    """Give each station of a kind, and three poses before it."""
    for station in ARENA.stations:
        for _ in range(3 * (station.kind == kind)):
            distance, aside, turn = rng.uniform((nearest, -0.4, -0.15), (farthest, 0.4, 0.15))
            yield station, before(station, float(distance), float(aside) * float(distance), float(turn))


def off(pose: tuple[float, float, float], seen: Sighting, x: float, y: float) -> float:
    """Give how far beside the truth something was seen."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return math.hypot(pose[0] + cos * seen.x - sin * seen.y - x, pose[1] + sin * seen.x + cos * seen.y - y)


def test_bullseyes_are_found_where_they_are(cameras: Renderer) -> None:
    """24 views from 0.8 to 2 m, up to 22 degrees from the side: all, within 3 cm."""
    rng = np.random.default_rng(1)
    for kind in ("filling", "delivery"):
        for station, pose in views(rng, kind, 0.8, 2.0):
            seen = sighting.find_targets.function(cameras.front(pose))
            assert min(off(pose, one, station.x, station.y) for one in seen) < CLOSE


def test_digits_are_read_where_they_are(cameras: Renderer) -> None:
    """24 views from 1.8 to 5.5 m: at least 20 are read, none wrong, within 3 cm."""
    rng = np.random.default_rng(2)
    read = []
    for station, pose in (*views(rng, "delivery", 1.8, 5.5), *views(rng, "delivery", 1.8, 5.5)):
        seen = sighting.read_digits.function(cameras.front(pose))
        for one in seen:
            hung = ARENA.station("delivery", int(one.label))
            at, far = math.atan2(hung.y, hung.x) + 0.11, math.hypot(hung.x, hung.y)
            assert off(pose, one, far * math.cos(at), far * math.sin(at)) < CLOSE
        read.append(str(station.number) in [one.label for one in seen])
    assert sum(read) >= 20


def test_cubes_are_read(cameras: Renderer) -> None:
    """24 cubes as people lay them into the basket: at least 23 are read, none wrong."""
    rng = np.random.default_rng(3)
    read = []
    for number in [1, 2, 3, 4] * 6:
        distance, left, yaw = rng.uniform((0.15, -0.02, -0.35), (0.21, 0.02, 0.35))
        picture = cameras.basket(Cube(number, float(distance), float(left), float(yaw)))
        seen = cube.read_cube.function(picture)
        assert seen in (Read("number", number), Read("unreadable"))
        read.append(seen.state == "number")
    assert sum(read) >= 23
    assert cube.read_cube.function(cameras.basket(None)) == Read("none")
    assert cube.read_cube.function(cameras.basket(Cube(2, smeared=True))) == Read("unreadable")


def test_what_hides_a_sign_hides_it_here_too(cameras: Renderer) -> None:
    station = ARENA.station("delivery", 3)
    pose = before(station, 2.5, 0.0, 0.0)
    labels = [one.label for one in sighting.read_digits.function(cameras.front(pose))]
    hidden = cameras.front(pose, hidden=frozenset({"digit 3"}))
    assert (labels, sighting.read_digits.function(hidden)) == (["3"], [])
    x, y = before(station, 1.0, 0.0, 0.0)[:2]
    behind = cameras.front(pose, around=(Round(x, y, 0.25, 0.42, 60),))
    assert sighting.find_targets.function(behind) == []
    assert len(sighting.find_targets.function(cameras.front(pose))) == 1


def test_pictures_are_those_of_the_light_renderer_but_for_the_light(cameras: Renderer) -> None:
    light = Renderer(ARENA)
    for pose in ((3.2, 3.2, math.pi / 4), (3.0, 0.1, math.pi)):
        one, other = light.front(pose).astype(float), cameras.front(pose).astype(float)
        assert np.corrcoef(one.ravel(), other.ravel())[0, 1] > 0.9
        assert np.array_equal(cameras.front(pose), other)


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_mission_works_before_these_cameras(cameras: Renderer) -> None:
    watch = watched(1, minutes=3, cameras="mujoco")
    (score,) = watch.simulation.scores
    assert watch.found == []
    assert len(score.delivered) >= 2
    assert score.wrong == []


# --- where they are missing


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(
        CamerasMissing, match=r"^MuJoCo's cameras need the package mujoco; pip install 'hfg\[mujoco\]'$"
    ):
        Simulation(1, cameras="mujoco")
    with pytest.raises(HfgError, match='node "world" failed in setup.*pip install'):
        hfg.run(build(cameras="mujoco"), clock="virtual", until_s=1)


def test_without_opengl_it_says_what_was_tried_and_what_to_do() -> None:
    pytest.importorskip("mujoco")
    program = "from examples.fetch_delivery.world import Simulation; Simulation(1, cameras='mujoco')"
    root = Path(__file__).parents[3]
    environment = os.environ | {"PYTHONPATH": str(root), "MUJOCO_GL": "disabled"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "CamerasMissing: MuJoCo cannot draw with MUJOCO_GL=disabled" in done.stderr
    assert "apt-get install libegl1" in done.stderr.splitlines()[-1]
