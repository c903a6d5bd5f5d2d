"""What a robot does not know before it looks: how large all is, and how badly wheels, laser and cameras measure."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

LIMITS: Final[dict[str, tuple[float, float]]] = {
    "radius": (5.0, 6.35),
    "octagon": (0.9, 1.6),
    "drift": (0.0, 5.0),
    "noise": (0.0, 0.05),
    "offset": (-0.1, 0.1),
    "light": (0.0, 2.0),
    "blur": (0.0, 5.0),
    "reach": (0.3, 0.9),
}
"""The least and the most of each value of `Surroundings`."""


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """The measures of one world; the usual ones are the defaults.

    Attributes:
      radius: of the outer wall, to its corners, in metres.
      octagon: from its middle to each side, in metres.
      drift: of the wheels, in times of the usual one.
      noise: of the laser, as standard deviation in metres.
      offset: by how many metres the laser measures too far.
      light: how bright it is, 1 as usual, 0 in the dark.
      blur: how long the cameras expose, in times of the usual time.
      reach: how far from a sign people reach a basket, in metres; to a filling station at most 0.75.
    """

    radius: float = 6.0
    octagon: float = 1.25
    drift: float = 1.0
    noise: float = 0.01
    offset: float = 0.0
    light: float = 1.0
    blur: float = 1.0
    reach: float = 0.9

    def __post_init__(self) -> None:
        """Refuse what is not a world."""
        for one in fields(self):
            least, most = LIMITS[one.name]
            value = getattr(self, one.name)
            if not least <= value <= most:
                raise ValueError(f"{one.name} of an arena is {least:g} to {most:g}, not {value:g}")


USUAL: Final = Surroundings()
