"""Pictures of the cameras, with the results drawn in."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from examples.fetch_delivery import signs
from examples.fetch_delivery.messages import Picture
from examples.fetch_delivery.perception.records import Sighting
from examples.fetch_delivery.perception.sighting import AHEAD, FOCAL, HEIGHT, MIDDLE

TARGET: Final = (60, 130, 255)  # blue, green, red
DIGIT: Final = (90, 200, 60)
_FONT: Final = cv2.FONT_HERSHEY_SIMPLEX


def ahead(picture: Picture, targets: list[Sighting], digits: list[Sighting], width: int = 480) -> Picture:
    """Draw the bull's-eyes and digits that were found into a picture of the front camera."""
    scale = width / picture.shape[1]
    drawn = _coloured(picture, width)
    for one in targets:
        u, v, size = _place(one, signs.BULLSEYE_HEIGHT_M, signs.BULLSEYE_M * signs.RINGS_SHARE, scale)
        cv2.circle(drawn, (u, v), size // 2 + 3, TARGET, 2, cv2.LINE_AA)
        _label(drawn, f"{one.distance:.1f} m", (u, v + size // 2 + 20), TARGET)
    for one in digits:
        u, v, size = _place(one, signs.DIGIT_HEIGHT_M, signs.DIGIT_M * signs.FRAME_SHARE, scale)
        half = size // 2 + 3
        cv2.rectangle(drawn, (u - half, v - half), (u + half, v + half), DIGIT, 2, cv2.LINE_AA)
        _label(drawn, f"{one.label}: {one.distance:.1f} m", (u, v - half - 7), DIGIT)
    return drawn


def basket(picture: Picture, cube: int | None, width: int = 480) -> Picture:
    """Write what was read into a picture of the basket camera."""
    drawn = _coloured(picture, width)
    says = "?" if cube is None else f"cube {cube}" if cube else "empty"
    _label(drawn, says, (50, drawn.shape[0] - 12), DIGIT if cube else TARGET)
    return drawn


def _coloured(picture: Picture, width: int) -> Picture:
    height = round(picture.shape[0] * width / picture.shape[1])
    if width != picture.shape[1]:
        picture = np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        picture = np.asarray(cv2.medianBlur(picture, 3), np.uint8)  # noise is most of what a video has to store
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)


def _place(one: Sighting, height: float, size: float, scale: float) -> tuple[int, int, int]:
    """Return where a sign is in the picture, and how large: back the way that perception has come."""
    far = max(one.x - AHEAD, 0.05)
    u = MIDDLE[0] - FOCAL * one.y / far
    v = MIDDLE[1] + FOCAL * (HEIGHT - height) / far
    return round(u * scale), round(v * scale), round(FOCAL * size / far * scale)


def _label(picture: Picture, text: str, at: tuple[int, int], colour: tuple[int, int, int]) -> None:
    size = 0.6 if picture.shape[1] > 400 else 0.5
    (width, _), _ = cv2.getTextSize(text, _FONT, size, 1)
    at = (max(2, min(at[0] - width // 2, picture.shape[1] - width - 2)), at[1])
    cv2.putText(picture, text, at, _FONT, size, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(picture, text, at, _FONT, size, colour, 1, cv2.LINE_AA)
