"""Scenes: obstacles, tracks, paths and other things to show in a 3-D view. Depends on `records`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt

from hfg.base.values import Colour
from hfg.geometry.records import Frame, equal, need_header
from hfg.geometry.transforms import Coordinates, Transform, Vector3

ORANGE = Colour(240, 130, 30)


@dataclass(frozen=True, slots=True)
class Solid:
    """A box, a ball, or a cylinder.

    Attributes:
      kind: which of these.
      pose: of its middle; the axis of a cylinder is z.
      size: along its own x, y and z, in metres.
      colour: of all of it.
      opacity: 0 is invisible.

    Raises:
      ValueError: a length is negative or not finite.
    """

    kind: Literal["box", "ball", "cylinder"]
    pose: Transform
    size: Vector3
    colour: Colour = ORANGE
    opacity: Annotated[float, Ge(0)] = 1.0

    __eq__ = equal

    def __post_init__(self) -> None:
        if self.size.shape != (3,) or not (np.isfinite(self.size).all() and (self.size >= 0).all()):
            raise ValueError(f"a solid has three lengths, none below 0, got {self.size.tolist()}")


@dataclass(frozen=True, slots=True)
class Line:
    """Points that are connected in their order.

    Attributes:
      points: of the plane or of space.
      colour: of the line.
      width: in metres.
    """

    points: Coordinates
    colour: Colour = ORANGE
    width: Annotated[float, Gt(0)] = 0.03

    __eq__ = equal


@dataclass(frozen=True, slots=True)
class Label:
    """A text that faces whoever looks at it.

    Attributes:
      text: what it says.
      place: of its middle.
      colour: of the letters.
      height: of the letters, in metres.
    """

    text: str
    place: Vector3
    colour: Colour = ORANGE
    height: Annotated[float, Gt(0)] = 0.2

    __eq__ = equal


@dataclass(frozen=True, slots=True)
class Scene:
    """Things to look at. A scene takes the place of the one before on the same port.

    Attributes:
      frame_id: the frame of all coordinates.
      stamp: when it was so.
      solids: boxes, balls, cylinders.
      lines: such as paths.
      labels: texts.
      lifetime_s: after which it vanishes; 0 for never.

    Raises:
      ValueError: the frame has no name, or the stamp or the lifetime is not finite.
    """

    frame_id: Frame
    stamp: float
    solids: list[Solid] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    lifetime_s: Annotated[float, Ge(0)] = 0.0

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)
        if not (math.isfinite(self.lifetime_s) and self.lifetime_s >= 0):
            raise ValueError(f"the lifetime of a scene is a number of seconds from 0, got {self.lifetime_s}")
