"""Runs one firing of a node for a function of OpenCV: checks and converts what comes, and tells what OpenCV refuses.

Depends on `_overrides`, which say what becomes of an argument.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import cv2
import numpy as np

from hfg.images import wrong_image
from hfg.nodes._making import Port, Setting, port_name
from hfg.nodes.cv import _overrides as overrides
from hfg.nodes.cv._overrides import Say
from hfg.nodes.cv._room import copy_with_room, with_room
from hfg.types import describe_value

_FARTHEST: Final = 32767
"""Coordinates beyond this are refused: OpenCV draws with numbers of 16 bits and would count for minutes."""


class Inlet(typing.NamedTuple):
    """An input with what becomes of its value."""

    port: Port
    argument: str
    say: Say
    copied: bool
    asked_for: bool  # OpenCV wants to be given None where there is nothing
    is_image: bool
    is_points: bool


class Knob(typing.NamedTuple):
    """A parameter with what becomes of its value; with `own` None is what OpenCV itself takes."""

    setting: Setting
    argument: str
    say: Say
    own: bool


class Calling:
    """Calls a function for the values of a firing.

    Args:
      name: of the function, as OpenCV has it.
      function: itself.
      inlets: what its inputs are for it.
      knobs: what its parameters are for it.
      given: arguments that are always the same.
      deadly: kinds of pixels and numbers of channels that end the process.
      results: types of its results, in the terms of OpenCV's stub.
      is_single: what it gives back is what is sent; else it is a tuple with something for each output.
    """

    def __init__(
        self,
        name: str,
        function: Callable[..., Any],
        inlets: Sequence[Inlet],
        knobs: Sequence[Knob],
        given: Mapping[str, Any],
        *,
        deadly: frozenset[tuple[str, int]],
        results: Sequence[str],
        is_single: bool,
    ) -> None:
        self._name = name
        self._node = port_name(name)
        self._function = function
        self._inlets = inlets
        self._knobs = knobs
        self._given = given
        self._deadly = deadly
        self._needs = overrides.NEEDS.get(name, ())
        self._results = results
        self._is_single = is_single
        self._lists = {place for place, kind in enumerate(results) if kind.startswith("Sequence[")}

    def __call__(self, *values: Any, **parameters: Any) -> Any:
        """Make one firing of it.

        Raises:
          TypeError: an input is of another kind than is declared.
          ValueError: the function refuses something, or would not survive it.
        """
        arguments = dict(self._given)
        inputs = self._take(values, arguments)
        for need in self._needs:
            wrong = need.wrong(inputs, {knob.argument: parameters[knob.setting.name] for knob in self._knobs})
            if wrong is not None:
                raise ValueError(f"{self._node}: {wrong}")
        self._convert(arguments, inputs, parameters)
        try:
            result = self._function(**arguments)
        except cv2.error as error:
            shown = ", ".join(f"{port} {describe_value(value)}" for port, value in inputs.items())
            raise ValueError(f"cv2.{self._name} refuses {shown}: {_reason(error)}") from None
        return self._shaped(result)

    def _take(self, values: Sequence[Any], arguments: dict[str, Any]) -> dict[str, Any]:
        """Check what comes by the inputs; give what has, by argument."""
        inputs: dict[str, Any] = {}
        for inlet, value in zip(self._inlets, values, strict=True):
            if value is None and inlet.port.optional:
                if inlet.asked_for:
                    arguments[inlet.argument] = None
                continue
            wrong = wrong_image(value, inlet.port.hint)
            if wrong is not None:
                raise TypeError(f'input "{inlet.port.name}" of {self._node}: {wrong}')
            _need_sound(self._node, inlet, value, self._deadly)
            inputs[inlet.argument] = value
            arguments[inlet.argument] = _handed(value, inlet)
        return inputs

    def _convert(self, arguments: dict[str, Any], inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
        """Make of inputs and parameters what OpenCV takes."""
        for inlet in self._inlets:
            if inlet.say.convert is not None and inlet.argument in inputs:
                arguments[inlet.argument] = inlet.say.convert(arguments[inlet.argument], inputs)
        for knob in self._knobs:
            value = parameters[knob.setting.name]
            if value is None and knob.own:
                continue
            arguments[knob.argument] = value if knob.say.convert is None else knob.say.convert(value, inputs)

    def _shaped(self, result: Any) -> Any:
        """Return the result as declared: OpenCV gives tuples where lists are meant."""
        if self._is_single:
            return _listed(result, self._results[0]) if 0 in self._lists else result
        if not self._lists:
            return result
        return tuple(
            _listed(one, self._results[place]) if place in self._lists else one for place, one in enumerate(result)
        )


def _handed(value: Any, inlet: Inlet) -> Any:
    """Return what OpenCV may read a little beyond, and write to if it does."""
    if isinstance(value, np.ndarray):
        return copy_with_room(value) if inlet.copied else with_room(value)
    if isinstance(value, list):
        return [with_room(one) if isinstance(one, np.ndarray) else one for one in value]
    return value


def _listed(found: Any, kind: str) -> list[Any]:
    """Make a list of what OpenCV gives as a tuple or an array; boxes are tuples."""
    if kind in ("Sequence[Rect]", "Sequence[Point]"):
        return [tuple(int(number) for number in one) for one in found]
    return [int(one) for one in found] if kind == "Sequence[int]" else list(found)


def _need_sound(node: str, inlet: Inlet, value: Any, deadly: frozenset[tuple[str, int]]) -> None:
    """Refuse what is of the declared type and yet harms OpenCV.

    Raises:
      ValueError: an array is empty, or a point is far outside of any picture.
      TypeError: this kind of pixel with this number of channels ends the process.
    """
    for array in value if isinstance(value, list) else (value,):
        if not isinstance(array, np.ndarray):
            continue
        if array.size == 0:
            raise ValueError(f'input "{inlet.port.name}" of {node} is empty: {describe_value(array)}')
        if inlet.is_image:
            channels = array.shape[2] if array.ndim == 3 else 1
            if deadly and (array.dtype.name, channels) in deadly:
                raise TypeError(
                    f'input "{inlet.port.name}" of {node}: {describe_value(array)} ends the process in this version of '
                    "OpenCV; convert it first"
                )
        elif inlet.is_points and array.shape[-1] in (2, 3) and array.size < 100_000 and _is_far(array):
            raise ValueError(f'input "{inlet.port.name}" of {node} has a point that is not within {_FARTHEST} pixels')


def _is_far(points: Any) -> bool:
    return not bool((np.abs(points.astype(np.float64)) <= _FARTHEST).all())  # NaN is far, too


def _reason(error: cv2.error) -> str:
    """Take places in the source and decoration off OpenCV's message."""
    text = str(getattr(error, "err", "") or error)
    return " ".join(text.replace("> ", " ").split()).rstrip(" .")
