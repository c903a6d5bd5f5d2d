"""Types of users, of each kind that is encoded, for both forms: plain data and what goes over a wire."""

from __future__ import annotations

import dataclasses
import enum
from pathlib import Path
from typing import NamedTuple

import msgspec


class Mode(enum.Enum):
    FAST = 1
    GOOD = "x"


class Sides(enum.Flag):
    LEFT = 1
    RIGHT = 2


@dataclasses.dataclass
class Pose:
    x: float
    mode: Mode = Mode.FAST
    file: Path | None = None


class Plan(msgspec.Struct):
    poses: list[Pose]
    name: str = ""


class Found(NamedTuple):
    score: float
    label: str = "?"
