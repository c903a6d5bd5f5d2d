"""Clothes: colours of tracks in pictures that were taken at the same moment."""

from __future__ import annotations

import math
from typing import Any, Final, TypeAlias

import numpy as np

import hfg
from examples.follow_person.messages import Camera, Photo, Picture
from examples.follow_person.perception.records import Look, Scene
from hfg.geometry import Transform
from hfg.images import Color

Box: TypeAlias = tuple[int, int, int, int]
"""Left, upper edge, width, height, in pixels."""

_SHIRT: Final = (0.7, 0.4)  # metres below the top of a person
_TROUSERS: Final = (1.45, 1.1)
_HALF: Final = 0.09
_FEWEST: Final = 6  # pixels
_FAR_M: Final = 14.0
_NEAR_M: Final = 1.2
_LONGEST: Final = 8  # pictures after which an older one counts less


@hfg.node
def picture_of(seen: list[object]) -> Color:
    """Return only the picture, for nodes that know of nothing else.

    Args:
      seen: a picture and the scene of its moment.
    """
    photo: Any = seen[0]
    picture: Picture = photo.picture
    return picture


def pixel(camera: Camera, scene: Scene, x: float, y: float, z: float) -> tuple[float, float] | None:
    """Return where a place appears in a picture: column and row; None if it is not ahead.

    Args:
      camera: that took it.
      scene: of the same moment.
      x: of the place.
      y: of the place.
      z: above the ground below the robot.
    """
    ahead, left = scene.seen_from_robot(x, y)
    tilt = Transform.of(roll=scene.roll, pitch=scene.pitch).turn
    forward, aside, up = tilt.T @ (ahead, left, z) - (0.0, 0.0, camera.above)
    if forward < _NEAR_M:
        return None
    return float(camera.width / 2 - camera.focal * aside / forward), float(
        camera.height / 2 - camera.focal * up / forward
    )


def box_of(camera: Camera, scene: Scene, x: float, y: float, heights: tuple[float, float], half: float) -> Any:
    """Return the columns and rows between two heights of a person: left, upper, right, lower; None if out of sight."""
    ahead, _ = scene.seen_from_robot(x, y)
    low, high = pixel(camera, scene, x, y, heights[0]), pixel(camera, scene, x, y, heights[1])
    if low is None or high is None:
        return None
    wide = camera.focal * half / ahead
    box = (high[0] - wide, high[1], low[0] + wide, low[1])
    if box[0] < 0 or box[2] >= camera.width or box[3] < 0 or box[1] >= camera.height:
        return None
    return box


def look_of(photo: Photo, scene: Scene, x: float, y: float, top: float) -> Look | None:
    """Return the colours of a person in a picture; None if they are not to be seen."""
    colours = []
    for low, high in (_SHIRT, _TROUSERS):
        box = box_of(photo.camera, scene, x, y, (top - low, top - high), _HALF)
        if box is None:
            return None
        left, upper, right, lower = (max(0, round(one)) for one in box)
        part: Picture = photo.picture[upper : max(lower, upper + 1), left : max(right, left + 1)]
        if part.shape[0] * part.shape[1] < _FEWEST:
            return None
        blue, green, red = np.median(part.reshape(-1, 3), axis=0) + 1.0
        total = blue + green + red
        colours.append((float(blue / total), float(green / total)))
    return Look(colours[0], colours[1], 1)


class Clothes(hfg.Node):
    """Learn the colours of tracks, each from several pictures.

    Attributes:
      seen: a picture and the scene of the same moment.
      looks: by number of the track.
    """

    looks = hfg.Event(dict[int, Look])
    known: hfg.State[dict[int, Look]] = hfg.State(factory=dict[int, Look])

    @hfg.slot
    def seen(self, seen: list[object]) -> None:
        """Look at all tracks that are in the picture."""
        both: Any = seen
        photo, scene = both
        known: dict[int, Look] = {}
        for one in scene.tracks:
            before = self.known.get(one.number)
            if before is not None:
                known[one.number] = before
            far = math.dist(scene.pose[:2], (one.x, one.y))
            if one.missed or far > _FAR_M or one.number not in scene.tops:
                continue
            look = look_of(photo, scene, one.x, one.y, scene.tops[one.number])
            if look is not None:
                known[one.number] = look if before is None else before.mixed(look, 1 / min(before.seen + 1, _LONGEST))
        self.known = known
        self.looks.trigger(known)


def is_in(box: Box, camera: Camera, scene: Scene, x: float, y: float, top: float) -> bool:
    """Say whether a person stands where a detector has found a person in a picture."""
    at = pixel(camera, scene, x, y, top - 0.8)
    if at is None:
        return False
    left, upper, width, height = box
    return left <= at[0] <= left + width and upper <= at[1] <= upper + height
