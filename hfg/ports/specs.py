"""The description of a parameter, as data, and its checks of values.

Depends on `kinds`, `conditions`, limits, types and values, not on ports.
"""

from __future__ import annotations

import os
import typing
from collections.abc import Collection
from fnmatch import fnmatch
from typing import Any, Final

import msgspec
import numpy as np

from hfg import encoding
from hfg.base.limits import breaks, numbers_within
from hfg.base.values import Colour, Span, same
from hfg.errors import shown
from hfg.ports.conditions import Condition
from hfg.ports.kinds import ParameterKind, kind_of_type, shape_of
from hfg.types import accepts, bare_type, describe, describe_value

__all__ = ["REQUIRED", "ParameterSpec", "Required"]


class Required:
    """Takes the place of the default of a parameter that has none."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED: Final = Required()


class ParameterSpec(msgspec.Struct, frozen=True):
    """The description of a parameter, read by files, the studio, the command line and the runner.

    Attributes:
      limits: annotated-types constraints, opened: `Interval` as `Ge`, `Le` ... Limits on numbers hold for each element.
      unit: shown to users, "m/s".
      choices: the only allowed values, or None; for the kind "choices", the only allowed members.
      trigger: no value, but a slot and an event of this name (§3.1 of the paper).
      size: the number of ports of a vector of this name; set when a node is made, and not a port itself.
      labels: the labels of the choices, one each, or empty.
      step: how much an editor changes the value per step; not a limit.
      group: the group in which it is shown, "filter" or "filter/details".
      help: its meaning, if the declaration has one; otherwise the docstring may have it (`NodeType.help_of`).
      shown_if: it is shown if all of these hold (`NodeType.is_shown`). It has its value even while hidden.
      read_only: set by the node's own code and shown to users: progress, a text. It has an output and no input (rule
        P8).
      pattern: the file names that it accepts, "*.png *.jpg".
      directory: the path must be a directory.
      save: the path is written to.
    """

    name: str
    type: Any
    default: Any
    limits: tuple[Any, ...] = ()
    unit: str | None = None
    choices: tuple[Any, ...] | None = None
    trigger: bool = False
    size: bool = False
    labels: tuple[str, ...] = ()
    step: float | None = None
    group: str | None = None
    help: str | None = None
    shown_if: tuple[Condition, ...] = ()
    read_only: bool = False
    pattern: str | None = None
    directory: bool = False
    save: bool = False

    @property
    def kind(self) -> ParameterKind:
        """What an editor shows for it."""
        if self.trigger:
            return "trigger"
        if self.read_only:
            return "progress" if None not in numbers_within(self.limits) else "output text"
        kind = kind_of_type(self.type, self.choices is not None)
        return "path" if kind == "text" and self.says_path else kind

    @property
    def says_path(self) -> bool:
        """Whether its declaration has options for paths, whatever its type."""
        return self.pattern is not None or self.directory or self.save

    @property
    def minimum(self) -> Any:
        """The smallest number; `limits` tell whether it is itself allowed. None without a minimum."""
        return numbers_within(self.limits)[0]

    @property
    def maximum(self) -> Any:
        """The largest number; `limits` tell whether it is itself allowed. None without a maximum."""
        return numbers_within(self.limits)[1]

    @property
    def shape(self) -> tuple[int | None, ...] | None:
        """The shape of a vector or matrix, None for an axis of any length."""
        return shape_of(self.type)

    @property
    def is_port(self) -> bool:
        """Whether its value can be read while a node exists and, unless it is read-only, set (rule P8)."""
        return not (self.trigger or self.size)

    @property
    def is_given(self) -> bool:
        """Whether users set its value, so that files keep it."""
        return not (self.trigger or self.read_only)

    def label(self, value: Any) -> str:
        """Return the label of a choice."""
        for number, one in enumerate(self.choices or ()):
            if number < len(self.labels) and same(one, value):
                return self.labels[number]
        return value if isinstance(value, str) else repr(value)

    def encode(self, value: Any) -> Any:
        """Return a value as plain data, as files and commands hold it. A choice that has a label becomes its label.

        Raises:
          EncodingError: the value cannot be represented as data.
        """
        if self.labels and self.kind == "choice":
            label = self.label(value)
            if same(self._labelled(label), (value,)):
                return label
        return encoding.encode(value, self.type)

    def decode(self, data: Any, find: encoding.Find | None = None) -> Any:
        """Return the value that plain data represents. Limits are not checked; use `check`.

        Args:
          data: the result of `encode`, or data that a person wrote.
          find: as for `hfg.encoding.decode`.

        Raises:
          EncodingError: it does not represent a value of the parameter's type.
        """
        chosen = self._labelled(data)
        if chosen:
            return chosen[0]
        return encoding.decode(data, self.type, where=f'parameter "{self.name}"', find=find)

    def read_text(self, text: str, find: encoding.Find | None = None) -> Any:
        """Return the value that a string represents, as typed on the command line.

        Raises:
          EncodingError: it does not represent a value of the parameter's type.
        """
        chosen = self._labelled(text)
        if chosen:
            return chosen[0]
        return encoding.read_text(text, self.type, where=f'parameter "{self.name}"', find=find)

    def _labelled(self, data: Any) -> tuple[Any, ...]:
        """Return the choice with this label; nothing if the data is a choice itself, or there is no such label."""
        if type(data) is not str or self.kind != "choice" or any(same(data, one) for one in self.choices or ()):
            return ()
        return next(((one,) for label, one in zip(self.labels, self.choices or (), strict=False) if label == data), ())

    def check(self, value: Any) -> str | None:
        """Return what is wrong with a value ("must be <= 1, got 3"), or None."""
        if not accepts(value, self.type):
            return f"must be {self._asked()}, got {_shown(value)}"
        if value is None:
            return self._check_choice(value) if self.choices is not None and not accepts(None, self.type) else None
        if self.choices is not None:
            wrong = self._check_choice(value)
            if wrong is not None:
                return wrong
        if isinstance(value, Span) and not value.low <= value.high:
            return f"must have low <= high, got {_shown(value)}"
        for limit in self.limits:
            wrong = breaks(limit, value)
            if wrong is not None:
                return f"{wrong}, got {_shown(value)}"
        if isinstance(value, Colour) and not all(type(part) is int and 0 <= part <= 255 for part in value):
            return f"must have red, green and blue from 0 to 255, got {value!r}"
        return self._check_name(value) if self.pattern is not None else None

    def _asked(self) -> str:
        bare = bare_type(self.type)
        if bare is Colour:
            return 'a colour, as in hfg.Colour(255, 128, 0) or hfg.Colour.of("#ff8000")'
        if self.kind == "interval":
            return f"hfg.Span(low, high) of {describe((*typing.get_args(bare), Any)[0])}"
        shape = self.shape
        said = f"of type {describe(self.type)}"
        return said if shape is None or typing.get_origin(bare) is tuple else f"{said} and shape {_shape(shape)}"

    def _check_choice(self, value: Any) -> str | None:
        several = self.kind == "choices" and isinstance(value, Collection)
        for one in value if several else (value,):
            if not any(_is_choice(one, known) for known in self.choices or ()):
                return f"must {'hold only' if several else 'be one of'} {self._allowed()}, got {_shown(one)}"
        return None

    def _allowed(self) -> str:
        """Return the choices, each with its label if it differs from the choice."""
        named = zip(self.choices or (), self.labels or self.choices or (), strict=True)
        return ", ".join(repr(one) if _speaks(one, label) else f"{one!r} ({label})" for one, label in named)

    def _check_name(self, value: Any) -> str | None:
        name = os.fspath(value).replace("\\", "/").rpartition("/")[2]
        patterns = str(self.pattern).split()
        if any(fnmatch(name.lower(), one.lower()) for one in patterns):
            return None
        return f"must be a file name like {' or '.join(patterns)}, got {str(value)!r}"


def _is_choice(value: Any, known: Any) -> bool:
    numbers = isinstance(value, int | float) and isinstance(known, int | float)
    return bool(value == known) if numbers else same(value, known)


def _speaks(value: Any, label: Any) -> bool:
    """Return whether a value needs no label because it equals its label, or has a name itself."""
    return str(label) == str(value) or not isinstance(value, bool | int | float | str) or hasattr(value, "name")


def _shown(value: Any) -> str:
    """Return a value on one line, short enough for a message."""
    if issubclass(type(value), np.ndarray):
        return describe_value(value)
    told = " ".join(shown(value, 1000).split())
    return told if len(told) <= 120 else told[:119] + "…"


def _shape(shape: tuple[int | None, ...]) -> str:
    return "x".join("any" if axis is None else str(axis) for axis in shape)
