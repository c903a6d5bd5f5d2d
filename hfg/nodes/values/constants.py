"""Values that are set by hand, and change while the graph runs: as sources, and given out at a signal.

Depends on nodetype and ports.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from annotated_types import Predicate

from hfg.base.values import Colour
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Output, Parameter, State, slot
from hfg.ports.events import EventPort
from hfg.types import Shape

T = TypeVar("T")

VectorArray: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None)]
MatrixArray: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, None)]
Rows: TypeAlias = Sequence[Sequence[float]]


def has_floats(value: Any) -> bool:
    """Say whether numpy can make an array of it: no rows of different length, no numbers that are too large."""
    try:
        np.asarray(value, dtype=np.float64)
    except (ValueError, OverflowError):
        return False
    return True


def as_array(values: Any, axes: int) -> npt.NDArray[np.float64]:
    """Make an array of numbers; an empty one has as many axes as others."""
    array = np.asarray(values, dtype=np.float64)
    return array if array.ndim == axes else array.reshape((0,) * axes)


class _Constant(Node):
    """Sends its value again and again.

    `told` is the value that `changed` sent last, in a list because it may be anything.
    """

    told = State(factory=list[Any])
    value: Parameter[Any]
    changed: Event[Any]

    def process(self) -> Any:
        """Return the value."""
        return self._give(self.value, self.value, self.changed)

    def _give(self, found: Any, value: T, changed: EventPort[T]) -> T:
        """Return a value that is made of what the parameter was found to be, which can be compared."""
        if self.told and self.told[0] is not found and self.told[0] != found:  # a NaN differs from itself
            changed.trigger(value)
        self.told = [found]
        return value


class ConstantBool(_Constant):
    """Send a truth value that is set by hand; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send.
      out: the value.
      changed: the new value, when it is sent for the first time.
    """

    value = Parameter(False)
    out = Output(bool)
    changed = Event(bool)


class ConstantInt(_Constant):
    """Send a whole number that is set by hand; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send.
      out: the value.
      changed: the new value, when it is sent for the first time.

    CS::APEX: csapex::IntInput.
    """

    value = Parameter(0)
    out = Output(int)
    changed = Event(int)


class ConstantFloat(_Constant):
    """Send a number that is set by hand; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send.
      out: the value.
      changed: the new value, when it is sent for the first time.

    CS::APEX: csapex::DoubleInput.
    """

    value = Parameter(0.0, unit="of the value")
    out = Output(float)
    changed = Event(float)


class ConstantText(_Constant):
    """Send a text that is set by hand; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send.
      out: the value.
      changed: the new value, when it is sent for the first time.

    CS::APEX: csapex::TextInput.
    """

    value = Parameter("")
    out = Output(str)
    changed = Event(str)


class ConstantVector(_Constant):
    """Send a vector that is set by hand, as an array; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send, any number of numbers.
      out: the value, an array of float64 with one axis.
      changed: the new value, when it is sent for the first time.

    CS::APEX: csapex::VectorInput.
    """

    value = Parameter[Sequence[float]](
        (0.0, 0.0, 0.0), Predicate(has_floats), type=Sequence[float], unit="of the value"
    )
    out = Output(VectorArray)
    changed = Event(VectorArray)

    def process(self) -> VectorArray:
        """Return the value."""
        return self._give(tuple(self.value), as_array(self.value, 1), self.changed)


class ConstantMatrix(_Constant):
    """Send a matrix that is set by hand, as an array; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send, row by row, all rows of one length.
      out: the value, an array of float64, rows x columns.
      changed: the new value, when it is sent for the first time.

    CS::APEX: csapex::MatrixInput.
    """

    value = Parameter[Rows](((1.0, 0.0), (0.0, 1.0)), Predicate(has_floats), type=Rows, unit="of the value")
    out = Output(MatrixArray)
    changed = Event(MatrixArray)

    def process(self) -> MatrixArray:
        """Return the value."""
        return self._give(tuple(map(tuple, self.value)), as_array(self.value, 2), self.changed)


class ConstantColour(_Constant):
    """Send a colour that is set by hand; an endless source.

    It sends the value as often as its consumers and `max_rate_hz` allow. Joined with a stream, it provides one value
    per token. A new value takes effect with the next firing.

    Attributes:
      value: the value to send: red, green and blue, 0 to 255 each.
      out: the value.
      changed: the new value, when it is sent for the first time.
    """

    value = Parameter(Colour(255, 255, 255))
    out = Output(Colour)
    changed = Event(Colour)


# --- given out at a signal ---


class _OnTrigger(Node):
    """Sends its value at each signal."""

    value: Parameter[Any]
    given: Event[Any]

    @slot
    def trigger(self) -> None:
        """Send the value."""
        self.given.trigger(self._given())

    def _given(self) -> Any:
        return self.value


class BoolOnTrigger(_OnTrigger):
    """Send a truth value at each signal.

    Attributes:
      value: the value to send.
      trigger: any token makes the node send the value.
      given: the value.
    """

    value = Parameter(False)
    given = Event(bool)


class IntOnTrigger(_OnTrigger):
    """Send a whole number at each signal.

    Attributes:
      value: the value to send.
      trigger: any token makes the node send the value.
      given: the value.
    """

    value = Parameter(0)
    given = Event(int)


class FloatOnTrigger(_OnTrigger):
    """Send a number at each signal.

    Attributes:
      value: the value to send.
      trigger: any token makes the node send the value.
      given: the value.
    """

    value = Parameter(0.0, unit="of the value")
    given = Event(float)


class TextOnTrigger(_OnTrigger):
    """Send a text at each signal.

    Attributes:
      value: the value to send.
      trigger: any token makes the node send the value.
      given: the value.
    """

    value = Parameter("")
    given = Event(str)


class VectorOnTrigger(_OnTrigger):
    """Send a vector at each signal, as an array.

    Attributes:
      value: the value to send, any number of numbers.
      trigger: any token makes the node send the value.
      given: the value, an array of float64 with one axis.
    """

    value = Parameter[Sequence[float]](
        (0.0, 0.0, 0.0), Predicate(has_floats), type=Sequence[float], unit="of the value"
    )
    given = Event(VectorArray)

    def _given(self) -> Any:
        return as_array(self.value, 1)


class MatrixOnTrigger(_OnTrigger):
    """Send a matrix at each signal, as an array.

    Attributes:
      value: the value to send, row by row, all rows of one length.
      trigger: any token makes the node send the value.
      given: the value, an array of float64, rows x columns.
    """

    value = Parameter[Rows](((1.0, 0.0), (0.0, 1.0)), Predicate(has_floats), type=Rows, unit="of the value")
    given = Event(MatrixArray)

    def _given(self) -> Any:
        return as_array(self.value, 2)


class ColourOnTrigger(_OnTrigger):
    """Send a colour at each signal.

    Attributes:
      value: the value to send: red, green and blue, 0 to 255 each.
      trigger: any token makes the node send the value.
      given: the value.
    """

    value = Parameter(Colour(255, 255, 255))
    given = Event(Colour)


@node
def replace_by(value: object, *, by: Any = 0) -> Any:
    """Return the same value for each token, whatever came: a constant in step with a stream.

    Args:
      value: anything; silence stays silence.
      by: what is given instead, of any type; None makes the stream silent.
    """
    return by
