"""Values of one type into another: texts into numbers and back, numbers into whole ones, anything into JSON.

A text that cannot be read is an event, not an error of the graph, because texts come from outside. Depends on nodetype,
functions, ports, msgspec and numpy.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from annotated_types import Interval

from hfg.encoding.plain import json_value
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter


class ParseInt(Node):
    """Read whole numbers; other texts are silent and signalled.

    Blanks around it and underscores between digits are allowed, as in Python.

    Attributes:
      text: such as " -12 ".
      base: of the digits, 2 to 36; 0 reads prefixes such as 0x.
      number: what it says.
      invalid: a text that is not a whole number.

    CS::APEX: csapex::StringToInt, csapex::TextConvert.
    """

    text = Input(str)
    number = Output(int)
    invalid = Event(str)
    base = Parameter(10, Interval(ge=0, le=36))

    def process(self, text: str) -> int | None:
        """Read it."""
        try:
            return int(text, self.base)
        except ValueError:  # also of more digits than Python reads, and of base 1
            self.invalid.trigger(text)
            return None


class ParseFloat(Node):
    """Read numbers; other texts are silent and signalled.

    Attributes:
      text: such as "1.5e3".
      finite: whether "inf" and "nan" are not numbers.
      decimal_comma: whether the comma stands before the fraction, and points are not part of a number.
      number: what it says.
      invalid: a text that is not a number.
    """

    text = Input(str)
    number = Output(float)
    invalid = Event(str)
    finite = Parameter(False)
    decimal_comma = Parameter(False)

    def process(self, text: str) -> float | None:
        """Read it."""
        try:
            if self.decimal_comma and "." in text:
                raise ValueError
            number = float(text.replace(",", ".", 1) if self.decimal_comma else text)
        except ValueError:
            self.invalid.trigger(text)
            return None
        if self.finite and not math.isfinite(number):
            self.invalid.trigger(text)
            return None
        return number


_WORDS: Final = {
    **dict.fromkeys(("true", "yes", "on", "1", "t", "y"), True),
    **dict.fromkeys(("false", "no", "off", "0", "f", "n"), False),
}


class ParseBool(Node):
    """Read truth values; other texts are silent and signalled.

    True is true, yes, on, t, y or 1, false is false, no, off, f, n or 0, in small or large letters.

    Attributes:
      text: such as "Yes".
      truth: what it says.
      invalid: a text that is neither.
    """

    text = Input(str)
    truth = Output(bool)
    invalid = Event(str)

    def process(self, text: str) -> bool | None:
        """Read it."""
        found = _WORDS.get(text.strip().casefold())
        if found is None:
            self.invalid.trigger(text)
        return found


class ParseJson(Node):
    """Read JSON; other texts are silent and signalled.

    A plain `null` is silent because None is not a value in a graph; inside lists and objects it is None.

    Attributes:
      text: one JSON value.
      parsed: lists, dicts, texts, numbers and truth values.
      invalid: a text that is not JSON, or nested too deeply.
    """

    text = Input(str)
    parsed = Output(Any)
    invalid = Event(str)

    def process(self, text: str) -> Any:
        """Read it."""
        try:
            return json_value(text.encode())
        except (ValueError, RecursionError):
            self.invalid.trigger(text)
            return None


def plain(value: Any) -> Any:
    """Return what JSON has instead of a value of numpy.

    Raises:
      TypeError: there is nothing.
    """
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(
        f"{type(value).__name__} has no form in JSON; make a dict, a dataclass or a msgspec.Struct of it before"
    )


def json_bytes(value: Any) -> bytes:
    """Write a value as JSON.

    Raises:
      TypeError: it cannot be represented in JSON.
      ValueError: nor has a number, text or key in it, or it is nested too deeply.
    """
    try:
        return msgspec.json.encode(value, enc_hook=plain)
    except (OverflowError, RecursionError, UnicodeError, msgspec.MsgspecError) as error:
        raise ValueError(f"{value!r:.80} has no form in JSON ({type(error).__name__}: {error})") from None


@node
def to_json(value: object, *, indent: Annotated[int, Interval(ge=0, le=16)] = 0) -> str:
    """Write a value as JSON.

    Dicts, lists, tuples, sets, dataclasses, msgspec structs, arrays, dates and enumerations are understood; NaN and
    infinity become null.

    Args:
      value: anything that can be represented in JSON.
      indent: blanks for each level, on lines of their own; 0 is one line.

    Raises:
      TypeError: it cannot be represented in JSON.
      ValueError: a number, text or key in it has none, or it is nested too deeply.
    """
    data = json_bytes(value)
    return (msgspec.json.format(data, indent=indent) if indent else data).decode()


@node
def to_int(value: float, *, rounding: Literal["nearest", "down", "up", "towards zero"] = "nearest") -> int:
    """Make a whole number of a number.

    Args:
      value: a number.
      rounding: how; "nearest" takes the even one of two that are as near.

    Raises:
      ValueError: a NaN is not a number.
      OverflowError: infinity is not a whole number.
    """
    match rounding:
        case "down":
            return math.floor(value)
        case "up":
            return math.ceil(value)
        case "towards zero":
            return math.trunc(value)
        case _:
            return round(value)


@node
def to_float(value: float) -> float:
    """Convert an integer or boolean to a float, for nodes that accept only floats.

    Args:
      value: a number.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return float(value)


@node
def to_bool(value: object) -> bool:
    """Make a truth value of anything: 0, nothing and what is empty are false.

    Args:
      value: an array is true if any of its elements is.

    Raises:
      ValueError: the value cannot say whether it is true.
    """
    if isinstance(value, np.ndarray):
        return bool(value.any())
    try:
        return bool(value)
    except Exception as error:
        raise ValueError(f"a {type(value).__name__} is neither true nor false: {error}") from None


@node
def to_text(value: object, *, exact: bool = False) -> str:
    """Write a value as a text, as `str` does.

    Args:
      value: anything.
      exact: whether as `repr` does, in which texts have quotes.
    """
    return repr(value) if exact else str(value)


@node
def type_name(value: object) -> str:
    """Name the type of a value.

    Args:
      value: anything.
    """
    return type(value).__name__


@node
def encode_text(text: str, *, encoding: Literal["utf-8", "latin-1", "ascii", "utf-16"] = "utf-8") -> bytes:
    """Make bytes of a text.

    Args:
      text: any text.
      encoding: how.

    Raises:
      ValueError: the encoding has no bytes for a character.
    """
    return text.encode(encoding)


@node
def decode_text(
    data: bytes,
    *,
    encoding: Literal["utf-8", "latin-1", "ascii", "utf-16"] = "utf-8",
    errors: Literal["strict", "replace", "ignore"] = "strict",
) -> str:
    """Make a text of bytes.

    Args:
      data: the bytes.
      encoding: how the text was written.
      errors: what to do with invalid bytes: raise an error, insert a replacement character, or omit them.

    Raises:
      ValueError: the bytes are not text of that encoding, and errors are strict.
    """
    return data.decode(encoding, errors)
