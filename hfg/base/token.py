"""Tokens, which travel along edges: a value or a marker, with its activity modifier, stamp and number (rules T1-T5).

A token never changes; fan-out shares its value. No dependencies.
"""

from __future__ import annotations

import enum
from typing import Final, Generic, TypeVar

import msgspec

T_co = TypeVar("T_co", covariant=True)


class Marker(enum.Enum):
    """Takes the place of a token's value (rules T3, T4); compare with `is`."""

    NO_MESSAGE = "NO_MESSAGE"
    END = "END"

    def __repr__(self) -> str:
        return self.value


NO_MESSAGE: Final = Marker.NO_MESSAGE
"""No value this time; only on synchronous edges."""

END: Final = Marker.END
"""No more values."""


class Token(msgspec.Struct, Generic[T_co], frozen=True):
    """One token.

    Attributes:
      value: the value that was sent, or a `Marker`.
      activity: the modifier a of the paper (eq. 8): +1 activates, -1 deactivates, 0 changes nothing.
      stamp: seconds on the run's clock (rule T5).
      sequence: its number on its edge, from 1; 0 if it has no number (initial tokens, signals seen before any edge).
    """

    value: T_co
    activity: int = 0
    stamp: float = 0.0
    sequence: int = 0

    @property
    def is_marker(self) -> bool:
        """Whether it carries a marker instead of a value."""
        return type(self.value) is Marker
