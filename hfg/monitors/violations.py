"""A violation of a property, with the points that led to it; and a point as a part of a run tells it to another.

Depends on nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

__all__ = ["Point", "Seen", "Violation"]


class Point(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """A point that a part of a run tells to the main part.

    Attributes:
      time: when, on the run's clock.
      number: of those at the same time, their order.
      what: the port or node; "": none, only what is active changes.
      value: what passed there, if it is plain and short; else what it is.
      true: the numbers of the atoms that are true.
    """

    time: float
    number: int
    what: str
    value: bool | int | float | str | None
    true: list[int]


@dataclass(frozen=True, slots=True)
class Seen:
    """A point that a monitor has judged.

    Attributes:
      after_s: seconds since the monitor began.
      what: the port or node.
      value: what passed the port, or whether the node is active; of a value that is not plain, its type.
    """

    after_s: float
    what: str
    value: object

    def __str__(self) -> str:
        shown = self.value.__name__ if isinstance(self.value, type) else repr(self.value)
        return f"{self.after_s:.6g} s  {self.what}  {shown:.80}"


@dataclass(frozen=True, slots=True)
class Violation:
    """A property did not hold.

    Attributes:
      monitor: the name of the monitor.
      what: the property.
      after_s: seconds since the monitor began.
      stretch: the last points that it has judged, the newest last.
    """

    monitor: str
    what: str
    after_s: float
    stretch: tuple[Seen, ...]

    def __str__(self) -> str:
        seen = "".join(f"\n  {one}" for one in self.stretch)
        return f'monitor "{self.monitor}" is violated after {self.after_s:.6g} s: {self.what}{seen}'
