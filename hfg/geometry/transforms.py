"""Rigid transforms of space: a rotation as a unit quaternion, and a translation.

The formulas are those of J. Diebel, Representing Attitude (2006), with the scalar part last. Depends on numpy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from hfg.base.values import same
from hfg.images import OneOf
from hfg.types import Named, Shape

Vector3: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(3), Named("Vector3")]
"""x, y, z."""

Quaternion: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(4), Named("Quaternion")]
"""A rotation as x, y, z, w, of length 1. A quaternion and its negative are the same rotation."""

Coordinates: TypeAlias = Annotated[npt.NDArray[np.float64], OneOf((None, 2), (None, 3)), Named("Coordinates")]
"""Points of the plane or of space, one row of x, y or of x, y, z in metres for each."""

_UNIT: Final = 1e-12  # how far the square of a quaternion's length may be from 1 before it is scaled
_STRAIGHT: Final = 0.9995  # cosine of half an angle below which lines and arcs are the same to 1e-7


def _equal(one: object, other: object) -> bool:
    """Compare two records of arrays by their parts, which a dataclass cannot."""
    return same(one, other)


@dataclass(frozen=True, slots=True)
class Transform:
    """A rigid transform, or a pose: it takes coordinates of one frame to those of another one.

    As a pose it is where a thing is: it takes coordinates of the thing's own frame to those of the frame around it.

    Attributes:
      translation: where the origin goes, in metres.
      rotation: is scaled to length 1.

    Raises:
      ValueError: a number is not finite, the rotation has length 0, or there are more or fewer than 3 and 4 numbers.

    Examples:
      >>> laser = Transform.of(x=0.2, yaw=math.pi / 2)
      >>> laser.apply(np.array([[1.0, 0.0]])).round(6).tolist()
      [[0.2, 1.0]]
    """

    translation: Vector3
    rotation: Quaternion

    __eq__ = _equal

    def __post_init__(self) -> None:
        parts = [np.asarray(self.translation, np.float64), np.asarray(self.rotation, np.float64)]
        if parts[0].shape != (3,) or parts[1].shape != (4,):
            raise ValueError(
                "a transform has a translation of 3 numbers and a rotation of 4 (x, y, z, w), got "
                f"{parts[0].shape} and {parts[1].shape}"
            )
        with np.errstate(all="ignore"):
            square = float(parts[1] @ parts[1])
        if not (np.isfinite(parts[0]).all() and math.isfinite(square) and square > 1e-24):
            raise ValueError(
                "a transform has finite numbers and a rotation whose length is not 0, got "
                f"{parts[0].tolist()} and {parts[1].tolist()}"
            )
        if abs(square - 1) > _UNIT:
            parts[1] = parts[1] / math.sqrt(square)
        object.__setattr__(self, "translation", parts[0])
        object.__setattr__(self, "rotation", parts[1])

    @classmethod
    def of(
        cls, x: float = 0.0, y: float = 0.0, z: float = 0.0, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
    ) -> Transform:
        """Make one from a place and three angles: first roll about x, then pitch about y, then yaw about z, all fixed.

        Args:
          x: in metres.
          y: in metres.
          z: in metres.
          roll: about the x axis, in radians.
          pitch: about the y axis, in radians.
          yaw: about the z axis, in radians.
        """
        (cr, cp, cy), (sr, sp, sy) = ([f(a / 2) for a in (roll, pitch, yaw)] for f in (np.cos, np.sin))
        turn = [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
        return cls(np.array([x, y, z], np.float64), np.array(turn))

    @classmethod
    def of_matrix(cls, matrix: Any) -> Transform:
        """Make one from a matrix of 4 x 4, or 3 x 4, whose left part is a rotation.

        Raises:
          ValueError: it is not a right-handed rotation, to 1e-6.
        """
        matrix = np.asarray(matrix, np.float64)
        turn = matrix[:3, :3]
        right = matrix.shape in ((4, 4), (3, 4)) and np.isfinite(matrix).all()
        if not right or np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0:
            raise ValueError(f"a rigid transform is a right-handed rotation and a translation, got {matrix.tolist()}")
        # the largest part is computed by a root, and the others from it, so that nothing small is divided by
        trace = float(np.trace(turn))
        squares = np.array([*(1 + 2 * np.diag(turn) - trace), 1 + trace])
        one = int(squares.argmax())
        a, b = turn + turn.T, turn - turn.T
        lines = [
            [squares[0], a[0, 1], a[0, 2], b[2, 1]],
            [a[0, 1], squares[1], a[1, 2], b[0, 2]],
            [a[0, 2], a[1, 2], squares[2], b[1, 0]],
            [b[2, 1], b[0, 2], b[1, 0], squares[3]],
        ]
        return cls(matrix[:3, 3].copy(), np.array(lines[one]) / (2 * math.sqrt(squares[one])))

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """The same as a matrix of 4 x 4."""
        made = np.eye(4)
        made[:3, :3] = self.turn
        made[:3, 3] = self.translation
        return made

    @property
    def turn(self) -> npt.NDArray[np.float64]:
        """The rotation as a matrix of 3 x 3."""
        x, y, z, w = self.rotation.tolist()
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, as `of` takes them; pitch is between -pi/2 and pi/2."""
        x, y, z, w = self.rotation.tolist()
        sine = max(-1.0, min(1.0, 2 * (w * y - z * x)))
        if abs(sine) > 1 - 1e-12:  # straight up or down: roll and yaw turn about the same axis, so all is yaw
            return 0.0, math.copysign(math.pi / 2, sine), math.remainder(2 * math.atan2(z, w), 2 * math.pi)
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        return roll, math.asin(sine), math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    @property
    def is_planar(self) -> bool:
        """Whether it turns about z only, so that a plane at one height stays one."""
        return bool(np.abs(self.rotation[:2]).max() < 1e-9)

    def __matmul__(self, other: Transform) -> Transform:
        """Compose: first the other one, then this. With poses: where something is that the other one has in its frame.

        Raises:
          ValueError: a number of the result is too large for a float.
        """
        ax, ay, az, aw = self.rotation.tolist()
        bx, by, bz, bw = other.rotation.tolist()
        turned = [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
        with np.errstate(all="ignore"):
            moved = self.turn @ other.translation + self.translation
        return Transform(moved, np.array(turned))

    def inverse(self) -> Transform:
        """Return the transform that takes everything back."""
        with np.errstate(all="ignore"):
            back = -(self.turn.T @ self.translation)
        return Transform(back, self.rotation * np.array([-1.0, -1.0, -1.0, 1.0]))

    def apply(self, points: Any) -> npt.NDArray[np.float64]:
        """Return where points go.

        Args:
          points: n x 3, or n x 2 for points at height 0.

        Returns:
          n x 2 if the points are of the plane and the transform leaves them there (`is_planar`; its height does not
          count), else n x 3.
        """
        flat = points.shape[1] == 2
        keeps = 2 if flat and self.is_planar else 3
        with np.errstate(all="ignore"):  # what is not a number, or too large, stays so
            moved: npt.NDArray[np.float64] = points @ self.turn[:keeps, : points.shape[1]].T + self.translation[:keeps]
        return moved

    def between(self, other: Transform, share: float) -> Transform:
        """Return a transform on the way from this one to another: the place on a line, the rotation by slerp.

        Args:
          other: the end of the way.
          share: 0 is this one, 1 the other one.

        Raises:
          ValueError: the share is not finite.
        """
        a, b = self.rotation, other.rotation
        cosine = float(a @ b)
        if cosine < 0:  # the shorter way round
            b, cosine = -b, -cosine
        weights = 1 - share, share
        if cosine < _STRAIGHT:
            angle = math.acos(cosine)
            if not math.isfinite(share):
                raise ValueError(f"a share of the way is finite, got {share}")
            weights = math.sin((1 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
        with np.errstate(all="ignore"):
            place = (1 - share) * self.translation + share * other.translation
        return Transform(place, weights[0] * a + weights[1] * b)
