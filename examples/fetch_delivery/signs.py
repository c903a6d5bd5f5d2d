"""What is printed on the signs of the stations and on the cubes: known to those who print and to those who read.

A bull's-eye hangs at every station, beside that of a delivery station a digit in a frame; a cube bears the number of
its station as bar code EAN-8 on every side.
"""

from __future__ import annotations

import cv2
import numpy as np

from examples.fetch_delivery.messages import Picture

BULLSEYE_M = 0.24  # side of the panel
BULLSEYE_HEIGHT_M = 0.35  # of its centre
DIGIT_M = 0.5
DIGIT_HEIGHT_M = 0.75
CUBE_M = 0.06
RINGS_SHARE = (
    0.84  # of the panel is the diameter of the outermost ring: without a white margin it would melt with the wall
)
FRAME_SHARE = 0.84  # of the panel is the side of a digit's frame, along the middle of its line

_SEVEN = ("0001101", "0011001", "0010011", "0111101", "0100011", "0110001", "0101111", "0111011", "0110111", "0001011")


def bullseye(size: int = 256) -> Picture:
    """Print the sign for precise positioning: five rings, black outside."""
    panel = np.full((size, size), 255, np.uint8)
    centre = (size // 2, size // 2)
    for ring in range(5, 0, -1):
        radius = int(size * RINGS_SHARE / 2 * ring / 5)
        cv2.circle(panel, centre, radius, 0 if ring % 2 else 255, -1, cv2.LINE_AA)
    return panel


def digit_sign(digit: int, size: int = 256) -> Picture:
    """Print a digit in a frame, with a white margin outside."""
    panel = np.full((size, size), 255, np.uint8)
    margin, line = round(size * 0.086), round(size * 0.047)
    cv2.rectangle(panel, (margin, margin), (size - margin - 1, size - margin - 1), 0, line)
    scale, stroke = size / 256 * 5.6, max(1, round(size * 0.1))
    (width, height), _ = cv2.getTextSize(str(digit), cv2.FONT_HERSHEY_SIMPLEX, scale, stroke)
    at = ((size - width) // 2, (size + height) // 2)
    cv2.putText(panel, str(digit), at, cv2.FONT_HERSHEY_SIMPLEX, scale, 0, stroke, cv2.LINE_AA)
    return panel


def ean8(digits: str) -> tuple[str, str]:
    """Return the bars of seven digits as a text of 0 and 1, and the eight digits that a reader says.

    Raises:
      ValueError: if these are not seven digits.
    """
    if len(digits) != 7 or not digits.isdecimal():
        raise ValueError(f"a bar code EAN-8 has seven digits and a check digit behind them, not {digits!r}")
    numbers = [int(digit) for digit in digits]
    numbers.append((10 - (3 * sum(numbers[0::2]) + sum(numbers[1::2])) % 10) % 10)
    left = "".join(_SEVEN[number] for number in numbers[:4])
    right = "".join(_SEVEN[number] for number in numbers[4:]).translate(str.maketrans("01", "10"))
    return f"101{left}01010{right}101", "".join(map(str, numbers))


def cube_code(station: int) -> str:
    """Return the eight digits on the cubes for a station."""
    return ean8(f"{station}" * 4 + "000")[1]


def cube_face(station: int, size: int = 512) -> Picture:
    """Print one side of a cube: the bar code of its station, and the number for people."""
    bars, _ = ean8(f"{station}" * 4 + "000")
    quiet = "0" * 9
    row = np.array([0 if bar == "1" else 255 for bar in quiet + bars + quiet], np.uint8)
    face = np.full((size, size), 255, np.uint8)
    code = cv2.resize(row[None], (size, int(size * 0.55)), interpolation=cv2.INTER_NEAREST)
    top = int(size * 0.1)
    face[top : top + len(code)] = code
    scale, stroke = size / 256 * 2.2, max(1, round(size * 0.023))
    at = (size // 2 - round(size * 0.09), size - round(size * 0.055))
    cv2.putText(face, str(station), at, cv2.FONT_HERSHEY_SIMPLEX, scale, 0, stroke, cv2.LINE_AA)
    return face
