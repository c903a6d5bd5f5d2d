"""Faults that can be injected, by name; one at a time, for a while.

Names and what they do are in `FAULTS`; `fault("pushed robot", at_s=40)` makes one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Something goes wrong at a time.

    Attributes:
      at_s: when it begins.
      lasts_s: how long it lasts; what happens in a moment ignores it.
    """

    at_s: float = 30.0
    lasts_s: float = math.inf

    def __post_init__(self) -> None:
        """Refuse times that never come."""
        if not (math.isfinite(self.at_s) and self.at_s >= 0 and self.lasts_s > 0):
            raise ValueError(f"a fault begins at 0 s or later and lasts, not from {self.at_s} s for {self.lasts_s} s")

    def lasts(self, now_s: float) -> bool:
        """Return whether it is in progress."""
        return self.at_s <= now_s < self.at_s + self.lasts_s


@dataclass(frozen=True, kw_only=True)
class BlockedStation(Fault):
    """A crate stands before a station."""

    kind: Literal["filling", "delivery"] = "filling"
    number: int = 0


@dataclass(frozen=True, kw_only=True)
class AbsentOperator(Fault):
    """Nobody looks after a station."""

    kind: Literal["filling", "delivery"] = "filling"
    number: int = 0


@dataclass(frozen=True, kw_only=True)
class UnreadableCube(Fault):
    """One of the cubes that a robot gets, counted from 1, has a smeared bar code."""

    robot: int = 0
    cube: int = 1


@dataclass(frozen=True, kw_only=True)
class HiddenSign(Fault):
    """Something hangs before the digit of a delivery station."""

    digit: int = 1


@dataclass(frozen=True, kw_only=True)
class PushedRobot(Fault):
    """Somebody pushes a robot: its wheels do not notice. The push is as seen from the robot."""

    robot: int = 0
    dx: float = -0.3
    dy: float = 0.3
    turn: float = 0.4


@dataclass(frozen=True, kw_only=True)
class LostLocalisation(Fault):
    """The odometry of a robot jumps; the robot does not move."""

    robot: int = 0
    dx: float = 0.6
    dy: float = -0.4
    turn: float = 0.5


FAULTS: dict[str, type[Fault]] = {
    "blocked station": BlockedStation,
    "absent operator": AbsentOperator,
    "unreadable cube": UnreadableCube,
    "hidden sign": HiddenSign,
    "pushed robot": PushedRobot,
    "lost localisation": LostLocalisation,
}


def fault(name: str, **values: Any) -> Fault:
    """Make a fault by its name.

    Raises:
      ValueError: if there is none of that name, or it has no such value.
    """
    if name not in FAULTS:
        raise ValueError(f"there is no fault {name!r}; there are {', '.join(FAULTS)}")
    known = FAULTS[name].__dataclass_fields__
    for unknown in values.keys() - known.keys():
        raise ValueError(f"the fault {name!r} has no value {unknown!r}; it has {', '.join(known)}")
    return FAULTS[name](**values)
