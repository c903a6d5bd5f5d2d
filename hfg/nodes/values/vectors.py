"""Calculating with vectors: lists of numbers and arrays with one axis. Depends on functions, ports and numpy."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Inputs, Output, Parameter, State
from hfg.types import Shape

VectorArray: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None)]
Vector: TypeAlias = Sequence[float] | Annotated[npt.NDArray[np.floating[Any] | np.integer[Any]], Shape(None)]
"""A list or tuple of numbers, or an array with one axis."""


def _array(values: Vector) -> VectorArray:
    # A list of them, for numpy reads bytes as a text.
    return np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=np.float64)


@node
def norm(vector: Vector, *, order: Literal["euclidean", "manhattan", "maximum"] = "euclidean") -> float:
    """Return the length of a vector.

    Args:
      vector: any number of numbers; an empty one has the length 0.
      order: the root of the sum of squares, the sum of the sizes, or the largest size.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::NormOfGenericVectorMessage.
    """
    array = np.abs(_array(vector))
    if not len(array):
        return 0.0
    with np.errstate(all="ignore"):
        if order == "manhattan":
            return float(array.sum())
        # hypot does not overflow where the squares would.
        return float(array.max()) if order == "maximum" else math.hypot(*array.tolist())


@node
def scale_vector(vector: Vector, *, factor: Annotated[float, Unit("1")] = 1.0) -> VectorArray:
    """Multiply each number of a vector by a factor.

    Args:
      vector: any number of numbers.
      factor: what each is multiplied by.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::ScaleGenericVectorMessage.
    """
    with np.errstate(all="ignore"):
        return _array(vector) * float(factor)


@node
def normalize(vector: Vector) -> VectorArray | None:
    """Return a vector of the same direction and length 1; silent for one without a direction.

    Args:
      vector: any number of numbers; one whose length is 0, infinite or NaN has no direction.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    array = _array(vector)
    largest = float(np.abs(array).max(initial=0.0))
    if largest == 0 or not math.isfinite(largest):
        return None
    array = array / largest  # so that squares neither overflow nor vanish
    return array / math.hypot(*array.tolist())


@node
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors.

    Args:
      a: the first vector.
      b: the second one, of the same length.

    Raises:
      ValueError: their lengths differ.
      OverflowError: a whole number is too large for a float.
    """
    one, other = _array(a), _array(b)
    _need_one_length([one, other])
    with np.errstate(all="ignore"):
        return float((one * other).sum())


@node(inputs={"vectors": Inputs(Vector, 2)}, outputs=VectorArray)
def add_vectors(*vectors: Any) -> VectorArray:
    """Return the sum of the vectors at all inputs.

    Args:
      vectors: any number of vectors of one length.

    Raises:
      ValueError: their lengths differ.
      OverflowError: a whole number is too large for a float.
    """
    arrays = [_array(vector) for vector in vectors]
    _need_one_length(arrays)
    with np.errstate(all="ignore"):
        total: VectorArray = np.sum(arrays, axis=0, dtype=np.float64)
    return total


def _need_one_length(arrays: Sequence[VectorArray]) -> None:
    lengths = [len(array) for array in arrays]
    if len(set(lengths)) > 1:
        raise ValueError(f"the vectors must be of one length, got {', '.join(map(str, lengths))}")


@dataclass(frozen=True)
class Extremum:
    """The outputs of `extremum`."""

    extremum: float
    index: int


@node(outputs=Extremum)
def extremum(values: Vector, *, which: Literal["maximum", "minimum"] = "maximum") -> Extremum | None:
    """Return the largest or smallest number of a vector and where it is; silent for an empty one.

    Of equal ones it is the first. NaNs are passed over; if there is nothing else it is silent too.

    Args:
      values: any number of numbers.
      which: "maximum" or "minimum".

    Returns:
      extremum: the number.
      index: its place, from 0.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::GenericVectorMessageGetExtremum.
    """
    array = _array(values)
    if np.isnan(array).all():
        return None
    index = int(np.nanargmax(array) if which == "maximum" else np.nanargmin(array))
    return Extremum(float(array[index]), index)


@node
def summarize(
    values: Vector, *, by: Literal["sum", "mean", "median", "std", "variance", "minimum", "maximum", "product"] = "mean"
) -> float | None:
    """Return one number that stands for a vector; silent for an empty one.

    Args:
      values: any number of numbers.
      by: how; "std" and "variance" are those of a sample, divided by n - 1, and 0 of a single number.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    array = _array(values)
    if not len(array):
        return None
    function = {"product": "prod", "minimum": "min", "maximum": "max", "variance": "var"}.get(by, by)
    of_a_sample = {"ddof": 1} if by in ("std", "variance") and len(array) > 1 else {}
    with np.errstate(all="ignore"):
        return float(getattr(np, function)(array, **of_a_sample))


class AddNoiseToVector(Node):
    """Add random numbers of the normal distribution to each number of a vector, in proportion to its size.

    Every run adds the same ones, and so do two nodes with the same seed.

    Attributes:
      vector: any number of numbers.
      relative_sigma: the standard deviation of the noise, as a part of the number.
      seed: another seed gives other numbers; with None, every run has different ones.
      noisy: the vector with the noise.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::ParameterVectorAddNoise.
    """

    vector = Input(Vector)
    noisy = Output(VectorArray)
    relative_sigma = Parameter(0.1, Interval(ge=0, le=1e6), unit="1")
    seed = Parameter[int | None](0, type=int | None)
    chance = State[random.Random | None](None)

    def process(self, vector: Vector) -> VectorArray:
        """Add it."""
        if self.chance is None:
            self.chance = random.Random(self.seed)
        array = _array(vector)
        noise = np.array([self.chance.gauss(0.0, 1.0) for _ in range(len(array))], dtype=np.float64)
        with np.errstate(all="ignore"):
            noisy: VectorArray = array * (1 + self.relative_sigma * noise)
        return noisy
