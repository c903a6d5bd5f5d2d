"""What the delivery robot sees in pictures: how exactly bull's-eyes and digits are placed, and cubes read."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest

from examples.fetch_delivery import signs
from examples.fetch_delivery.perception import cube, sighting
from examples.fetch_delivery.perception.records import Cube, Sighting
from examples.fetch_delivery.world.arena import Arena
from examples.fetch_delivery.world.rendering import Cube as Lying
from examples.fetch_delivery.world.rendering import Renderer
from hfg.testing import fire
from tests.nodes.panels import View, photograph


def photographs(
    seed: int, count: int, nearest: float, farthest: float, *, digits: bool
) -> list[tuple[str, View, list[Sighting]]]:
    """Signs in the middle 70 degrees, up to 52 degrees from the side: label, where it is, and what is seen."""
    rng = np.random.default_rng(seed)
    drawn = []
    height = signs.DIGIT_HEIGHT_M if digits else signs.BULLSEYE_HEIGHT_M
    for _ in range(count):
        ahead = float(rng.uniform(nearest, farthest))
        left = float(rng.uniform(-0.3, 0.3)) * ahead
        view = View(ahead, left, height - sighting.HEIGHT, float(rng.uniform(-0.9, 0.9)) + math.atan2(left, ahead))
        digit = int(rng.integers(1, 5))
        panel, side = (
            (signs.digit_sign(digit, 512), signs.DIGIT_M) if digits else (signs.bullseye(512), signs.BULLSEYE_M)
        )
        blur, shake, noise = float(rng.uniform(0.4, 1)), int(rng.integers(1, 5)), float(rng.uniform(1, 5))
        image = photograph(panel, side, view, rng, blur=blur, shake=shake, noise=noise)
        seen = (sighting.read_digits if digits else sighting.find_targets).function(image)
        drawn.append((str(digit) if digits else "bullseye", view, seen))
    return drawn


def near(view: View, seen: list[Sighting]) -> list[Sighting]:
    x, y = view.ahead + sighting.AHEAD, view.left
    return [one for one in seen if math.hypot(one.x - x, one.y - y) < 0.1 * view.ahead]


def facing_error(view: View, one: Sighting) -> float:
    return abs(math.remainder(one.facing - math.pi - view.turned, 2 * math.pi))


@pytest.mark.slow
def test_bullseyes_are_placed() -> None:
    """100 views, 0.5 to 4 m: 97 % found, range within 3 %, bearing 3 mrad; facing 9 degrees where known."""
    drawn = photographs(1, 100, 0.5, 4.0, digits=False)
    found = [(view, one) for _, view, seen in drawn for one in near(view, seen)]
    assert sum(len(seen) for *_, seen in drawn) == len(found) >= 0.97 * len(drawn)
    assert max(abs(one.x - sighting.AHEAD - view.ahead) / view.ahead for view, one in found) < 0.03
    bearings = [math.atan2(one.y, one.x - sighting.AHEAD) - math.atan2(view.left, view.ahead) for view, one in found]
    assert max(map(abs, bearings)) < 0.003
    close = [(view, one) for view, one in found if view.ahead < 1.3]
    known = [facing_error(view, one) for view, one in close if not math.isnan(one.facing)]
    assert len(known) > 0.7 * len(close)
    assert max(known) < 0.16


@pytest.mark.slow
def test_digits_are_read_and_placed() -> None:
    """150 views, 1.7 to 6.5 m: 97 % read, none wrong, range within 2 %, bearing within 4 mrad."""
    drawn = photographs(2, 150, 1.7, 6.5, digits=True)
    found = [(label, view, one) for label, view, seen in drawn for one in near(view, seen)]
    assert sum(len(seen) for *_, seen in drawn) == len(found) >= 0.97 * len(drawn)
    assert all(one.label == label for label, _, one in found)
    assert max(abs(one.x - sighting.AHEAD - view.ahead) / view.ahead for _, view, one in found) < 0.02
    bearings = [math.atan2(one.y, one.x - sighting.AHEAD) - math.atan2(view.left, view.ahead) for _, view, one in found]
    assert max(map(abs, bearings)) < 0.004
    assert max(facing_error(view, one) for _, view, one in found if view.ahead < 3) < 0.1


def test_other_characters_in_the_frame_are_no_digits() -> None:
    rng = np.random.default_rng(3)
    for character in "05678ABX?":
        panel = signs.digit_sign(1, 512)
        panel[80:432, 80:432] = 255
        cv2.putText(panel, character, (150, 380), cv2.FONT_HERSHEY_SIMPLEX, 11.2, 0, 51, cv2.LINE_AA)
        image = photograph(panel, signs.DIGIT_M, View(2.5, 0.2, 0.39, 0.2), rng)
        assert sighting.read_digits.function(image) == []


def test_a_bullseye_on_the_floor_is_none_of_a_station() -> None:
    image = photograph(signs.bullseye(512), signs.BULLSEYE_M, View(1.5, 0.0, -0.3, 0.0), np.random.default_rng(4))
    assert sighting.find_targets.function(image) == []


@pytest.mark.parametrize("kind", [sighting.find_targets, sighting.read_digits, cube.read_cube])
def test_what_is_no_picture_is_refused_and_noise_shows_nothing(kind: Any) -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(TypeError, match="uint8"):
        kind.function(np.zeros((480, 640)))
    with pytest.raises(ValueError, match="is empty"):
        kind.function(np.zeros((0, 640), np.uint8))
    noise = rng.integers(0, 256, (480, 640), dtype=np.uint8)
    for image in (noise, noise[:1, :1], np.zeros((480, 640), np.uint8)):
        assert kind.function(image) in ([], Cube("none"))


def basket(rng: np.random.Generator, station: int, *, scratched: bool = False) -> Any:
    """A cube in the basket: 0.15 to 0.25 m before the camera, turned by up to 23 degrees."""
    image = np.repeat(np.linspace(120, 160, 480)[:, None], 640, axis=1)
    if station:
        face: Any = signs.cube_face(station, 512)
        if scratched:
            face[:, 180:330] = 100
        ahead = float(rng.uniform(0.15, 0.25))
        view = View(
            ahead, float(rng.uniform(-0.02, 0.02)), float(rng.uniform(-0.02, 0.02)), float(rng.uniform(-0.4, 0.4))
        )
        corners = view.corners(signs.CUBE_M).astype(np.float32)
        square: Any = np.array([(0, 0), (512, 0), (512, 512), (0, 512)], np.float32)
        span = float(np.ptp(corners[:, 0]))
        while len(face) > 2 * span:
            face, square = cv2.pyrDown(face), square / 2
        turn = cv2.getPerspectiveTransform(square, corners)
        shown = cv2.warpPerspective(face, turn, (640, 480))
        there = cv2.warpPerspective(np.full_like(face, 255), turn, (640, 480)) > 128
        image[there] = shown[there]
    return np.clip(np.rint(image + rng.normal(0, 4, image.shape)), 0, 255).astype(np.uint8)


@pytest.mark.slow
def test_cubes_are_read_and_never_wrongly() -> None:
    """60 cubes: 95 % are read, none wrongly; those that are not are said to be unreadable, not gone."""
    rng = np.random.default_rng(6)
    stations = [int(one) for one in rng.integers(1, 5, 60)]
    found = [cube.read_cube.function(basket(rng, one)) for one in stations]
    assert all(
        one in (Cube("number", station), Cube("unreadable")) for one, station in zip(found, stations, strict=True)
    )
    assert sum(one.state == "number" for one in found) >= 0.95 * len(found)


@pytest.mark.slow
@pytest.mark.parametrize("light", [0.5, 0.7, 0.75, 0.8, 1.0, 1.2, 1.3])
def test_dim_and_bright_light_hide_no_cube_and_show_none_that_is_not_there(light: float) -> None:
    """24 cubes and 4 empty baskets for each light: nearly all are read, none is missed or misread."""
    rng = np.random.default_rng(8)
    camera = Renderer(Arena())

    def seen(lies: Lying | None, number: int) -> Cube:
        picture = camera.basket(lies, shake=(number, number)).astype(float) * light
        return cube.read_cube.function(np.clip(picture, 0, 255).astype(np.uint8))

    found = []
    for number in range(24):
        distance, left, yaw = rng.uniform((0.15, -0.02, -0.35), (0.21, 0.02, 0.35)).tolist()
        found.append((number % 4 + 1, seen(Lying(number % 4 + 1, distance, left, yaw), number)))
    assert all(one in (Cube("number", station), Cube("unreadable")) for station, one in found)
    assert sum(one.state == "number" for _, one in found) >= 23
    assert {seen(None, number) for number in range(4)} == {Cube("none")}


@pytest.mark.slow
def test_no_cube_and_a_scratched_one_are_told_apart() -> None:
    rng = np.random.default_rng(7)
    assert {cube.read_cube.function(basket(rng, 0)) for _ in range(8)} == {Cube("none")}
    assert {cube.read_cube.function(basket(rng, 1 + n % 4, scratched=True)) for n in range(8)} == {Cube("unreadable")}


def test_codes_that_are_on_no_cube_count_for_nothing() -> None:
    bars, text = signs.ean8("1111001")  # a right check digit, but printed on no cube
    row = np.repeat(np.array([0 if bar == "1" else 255 for bar in bars], np.uint8), 3)
    image = np.full((480, 640), 255, np.uint8)
    image[150:300, 200 : 200 + len(row)] = row
    assert text in cv2.barcode.BarcodeDetector().detectAndDecodeMulti(cv2.GaussianBlur(image, (5, 5), 1))[1]
    assert cube.read_cube.function(cv2.GaussianBlur(image, (5, 5), 1)) == Cube("unreadable")


def test_what_is_seen_twice_in_a_row_is_told_once() -> None:
    shown = {station: basket(np.random.default_rng(1), station) for station in (0, 2, 3)}
    node = cube.CubeWatch(times=2)
    told = [fire(node, image=shown[station]).events for station in (0, 0, 0, 2, 0, 3, 3, 3, 0, 0)]
    assert told == [[], [("none", None)], [], [], [], [], [("number", 3)], [], [], [("none", None)]]
    assert fire(node, image=shown[0]).events == []
    fire(node, slot="ask")
    assert [fire(node, image=shown[0]).events for _ in range(2)] == [[], [("none", None)]]


def test_a_cube_that_lies_askew_for_a_moment_is_not_called_unreadable() -> None:
    """Who has put it in askew sets it right; a smeared one stays unreadable, also when somebody asks meanwhile."""
    smeared, right = (Renderer(Arena()).basket(Lying(2, smeared=one)) for one in (True, False))
    node = cube.CubeWatch(times=2, doubtful=5)
    told = [fire(node, image=image).events for image in (*[smeared] * 4, right, right)]
    assert told == [[], [], [], [], [], [("number", 2)]]
    told = [fire(node, image=smeared).events for _ in range(5)]
    assert told == [[], [], [], [], [("unreadable", None)]]
    fire(node, slot="ask")
    assert [fire(node, image=smeared).events for _ in range(2)] == [[], [("unreadable", None)]]
