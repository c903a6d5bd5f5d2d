"""What counts: cubes, and what a referee would note down."""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class Score:
    """The score of one robot; times are in seconds.

    Attributes:
      fetched: when it got which cube.
      delivered: when it has delivered which cube.
      wrong: when which cube was taken at a station with another digit.
      returned: when it gave which cube back at a filling station.
      reported: when the robot said that it cannot deliver the cube in its basket; its number, None if that is not read.
      contact_s: how long it has touched something.
      contacts: when each touch began.
      lamp_while_driving_s: how long its lamp was on while it drove.
      driven_m: how far it has driven.
    """

    fetched: list[tuple[float, int]] = field(default_factory=list)
    delivered: list[tuple[float, int]] = field(default_factory=list)
    wrong: list[tuple[float, int]] = field(default_factory=list)
    returned: list[tuple[float, int]] = field(default_factory=list)
    reported: list[tuple[float, int | None]] = field(default_factory=list)
    contact_s: float = 0.0
    contacts: list[float] = field(default_factory=list)
    lamp_while_driving_s: float = 0.0
    driven_m: float = 0.0

    def unaccounted(self) -> list[tuple[float, int]]:
        """Return the cubes that were returned silently: nothing was reported after they were fetched."""
        times = [time for time, _ in self.fetched]
        silent = []
        for when, number in self.returned:
            since = max(time for time in times if time < when)
            if not any(since <= time <= when and said in (number, None) for time, said in self.reported):
                silent.append((when, number))
        return silent

    def mistaken(self) -> list[tuple[float, int | None]]:
        """Return the reports of cubes that were delivered, before the report or after it."""
        fetched, wrong = [time for time, _ in self.fetched], []
        for when, number in self.reported:
            since = max((time for time in fetched if time <= when), default=0.0)
            until = min((time for time in fetched if time > when), default=math.inf)
            if any(since <= time < until for time, _ in self.delivered):
                wrong.append((when, number))
        return wrong

    def __str__(self) -> str:
        """Say it in a line."""
        return (
            f"{len(self.delivered)} delivered, {len(self.wrong)} wrong, {len(self.returned)} returned, "
            f"contact {self.contact_s:.1f} s, lamp while driving {self.lamp_while_driving_s:.1f} s, "
            f"{self.driven_m:.0f} m driven"
        )
