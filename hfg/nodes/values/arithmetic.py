"""Calculating with numbers: one, two or many at a time. Depends on functions and ports."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Final, Literal

from annotated_types import Interval, Unit

from hfg.nodetypes.functions import node
from hfg.ports import Inputs


@node
def add(a: float, b: float) -> float:
    """Return the sum of two numbers.

    Args:
      a: the first number.
      b: the second one.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return a + b


@node
def subtract(a: float, b: float) -> float:
    """Return the difference of two numbers, a - b.

    Args:
      a: what is subtracted from.
      b: what is subtracted.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return a - b


@node
def multiply(a: float, b: float) -> float:
    """Return the product of two numbers.

    Args:
      a: the first number.
      b: the second one.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::MultiplyValues.
    """
    return a * b


@node
def divide(a: float, b: float) -> float:
    """Return the quotient of two numbers, a / b.

    Args:
      a: the dividend.
      b: the divisor.

    Raises:
      ZeroDivisionError: b is 0.
      OverflowError: a whole number is too large for a float.
    """
    return a / b


@node
def modulo(a: float, b: float) -> float:
    """Return what is left of a after taking b as often as it goes; it has the sign of b, as in Python.

    Args:
      a: the dividend.
      b: the divisor.

    Raises:
      ZeroDivisionError: b is 0.
      OverflowError: a whole number is too large for a float.
    """
    return a % b


@node
def power(a: float, b: float) -> float:
    """Return a to the power of b, as a float.

    Args:
      a: the base.
      b: the exponent.

    Raises:
      ValueError: the base is negative and the exponent no whole number, or the base is 0 and the exponent negative.
      OverflowError: the result or a whole number is too large for a float.
    """
    return math.pow(a, b)


def _floor_divide(a: float, b: float) -> float:
    return a // b


_BINARY: Final[dict[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "//": _floor_divide,
    "%": lambda a, b: a % b,
    "**": math.pow,
    "min": min,
    "max": max,
    "atan2": math.atan2,
    "hypot": math.hypot,
    "copysign": math.copysign,
}


@node
def arithmetic(
    a: float,
    b: float,
    *,
    operation: Literal["+", "-", "*", "/", "//", "%", "**", "min", "max", "atan2", "hypot", "copysign"] = "+",
) -> float:
    """Combine two numbers by an operation that may be changed while the graph runs.

    Args:
      a: the first number.
      b: the second one.
      operation: "//" rounds down, "%" is what that leaves over, "**" is a to the power of b, "atan2" the angle in
        radians of the point (b, a), "hypot" the length of (a, b), "copysign" a with the sign of b.

    Raises:
      ZeroDivisionError: of "/", "//" and "%": b is 0.
      ValueError: of "**": the base is negative and the exponent no whole number, or 0 and the exponent negative.
      OverflowError: the result or a whole number is too large for a float.
    """
    return _BINARY[operation](a, b)


@node
def bitwise(a: int, b: int, *, operation: Literal["and", "or", "xor"] = "and") -> int:
    """Combine the bits of two whole numbers.

    Args:
      a: the first number.
      b: the second one, such as a mask.
      operation: which bits the result has: those of both, of either, or of exactly one.
    """
    return int(a & b if operation == "and" else a | b if operation == "or" else a ^ b)


# --- many numbers, one of each input ---


@node(inputs={"values": Inputs(float, 2)}, outputs=float)
def sum_of(*values: float) -> float:
    """Return the sum of the numbers at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of numbers.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::Sum.
    """
    return sum(values)


@node(inputs={"values": Inputs(float, 2)}, outputs=float)
def product_of(*values: float) -> float:
    """Return the product of the numbers at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of numbers.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::MultiplyValues.
    """
    return math.prod(values)


@node(inputs={"values": Inputs(float, 2)}, outputs=float)
def mean_of(*values: float) -> float:
    """Return the mean of the numbers at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of numbers.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return sum(values) / len(values)


@node(inputs={"values": Inputs(float, 2)}, outputs=float)
def smallest(*values: float) -> float:
    """Return the smallest of the numbers at all inputs; with a NaN, it is undefined.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of numbers.
    """
    return min(values)


@node(inputs={"values": Inputs(float, 2)}, outputs=float)
def largest(*values: float) -> float:
    """Return the largest of the numbers at all inputs; with a NaN, it is undefined.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of numbers.
    """
    return max(values)


# --- one number ---


@node
def negate(value: float) -> float:
    """Return a number with the other sign.

    Args:
      value: a number.

    CS::APEX: csapex::NegateNumber.
    """
    return -value


@node
def invert(value: float) -> float:
    """Return one divided by a number.

    Args:
      value: a number.

    Raises:
      ZeroDivisionError: it is 0.
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::InvertValues.
    """
    return 1 / value


@node
def absolute(value: float) -> float:
    """Return a number without its sign.

    Args:
      value: a number.
    """
    return abs(value)


@node
def degrees_of(angle: float) -> float:
    """Turn an angle from radians into degrees.

    Args:
      angle: in radians.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return math.degrees(angle)


@node
def radians_of(angle: float) -> float:
    """Turn an angle from degrees into radians.

    Args:
      angle: in degrees.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::DegToRad.
    """
    return math.radians(angle)


def _sign(value: float) -> float:
    return (value > 0) - (value < 0) if value == value else value


_FUNCTIONS: Final[dict[str, Callable[[float], float]]] = {
    "sqrt": math.sqrt,
    "cbrt": math.cbrt,
    "square": lambda value: value * value,
    "exp": math.exp,
    "log": math.log,
    "log2": math.log2,
    "log10": math.log10,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "floor": math.floor,
    "ceil": math.ceil,
    "trunc": math.trunc,
    "sign": _sign,
}


@node
def function_of(
    value: float,
    *,
    function: Literal[
        "sqrt",
        "cbrt",
        "square",
        "exp",
        "log",
        "log2",
        "log10",
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "sinh",
        "cosh",
        "tanh",
        "floor",
        "ceil",
        "trunc",
        "sign",
    ] = "sqrt",
) -> float:
    """Return a function of a number, as Python's `math` has it.

    Args:
      value: a number; angles are in radians.
      function: which one; "log" is the natural logarithm, "trunc" rounds towards 0, "sign" is -1, 0 or 1.

    Raises:
      ValueError: the function is not defined there, such as the square root of a negative number.
      OverflowError: the result or a whole number is too large for a float, or it is infinite and is to be rounded.
    """
    return _FUNCTIONS[function](value)


@node
def scale(
    value: float, *, factor: Annotated[float, Unit("1")] = 1.0, offset: Annotated[float, Unit("of the value")] = 0.0
) -> float:
    """Return a number times a factor, plus an offset.

    Args:
      value: a number.
      factor: what it is multiplied by, first.
      offset: what is added then.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    return value * factor + offset


@node
def clamp(
    value: float,
    *,
    lower: Annotated[float, Unit("of the value")] = 0.0,
    upper: Annotated[float, Unit("of the value")] = 1.0,
) -> float:
    """Keep a number within limits.

    Args:
      value: a number; a NaN stays one.
      lower: what is given for anything below it.
      upper: what is given for anything above it; if the limits cross, this one holds.
    """
    return min(max(value, lower), upper)


@node
def map_range(
    value: float,
    *,
    from_low: Annotated[float, Unit("of the value")] = 0.0,
    from_high: Annotated[float, Unit("of the value")] = 1.0,
    to_low: Annotated[float, Unit("of the result")] = 0.0,
    to_high: Annotated[float, Unit("of the result")] = 100.0,
    clamped: bool = False,
) -> float:
    """Carry a number from one range over to another, in a straight line.

    Args:
      value: a number.
      from_low: what becomes `to_low`.
      from_high: what becomes `to_high`; it may be the smaller one.
      to_low: what `from_low` becomes.
      to_high: what `from_high` becomes.
      clamped: whether what lies outside of the range becomes its nearer end.

    Raises:
      ZeroDivisionError: `from_low` and `from_high` are the same.
      OverflowError: a whole number is too large for a float.
    """
    part = (value - from_low) / (from_high - from_low)
    if clamped:
        part = min(max(part, 0.0), 1.0) if part == part else part
    return to_low * (1 - part) + to_high * part


@node
def round_to(value: float, *, step: Annotated[float, Interval(gt=0), Unit("of the value")] = 1.0) -> float:
    """Round a number to the nearest multiple of a step; what lies in the middle goes to the even one.

    Args:
      value: a number; infinity and NaN stay what they are.
      step: the distance between the results, in the unit of the value.

    Raises:
      OverflowError: a whole number, or the number of steps, is too large for a float.
    """
    steps = value / step
    return round(steps) * step if math.isfinite(steps) else value


@node
def deadband(value: float, *, width: Annotated[float, Interval(ge=0), Unit("of the value")] = 0.1) -> float:
    """Return 0 for numbers near to it, and bring others nearer by as much, so that there is no jump.

    Args:
      value: a number, such as the deflection of a stick.
      width: what counts as near, on each side, in the unit of the value.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    if abs(value) <= width:
        return 0.0
    return value - math.copysign(width, value)


@node
def wrap_angle(angle: float, *, unit: Literal["rad", "deg"] = "rad", positive: bool = False) -> float:
    """Bring an angle into one turn: from minus a half to a half, or from 0 on.

    Args:
      angle: in the unit; infinity has no direction and becomes NaN.
      unit: "rad" or "deg".
      positive: from 0 to a whole turn instead of from minus half a turn (excluded) to half a turn.

    Raises:
      OverflowError: a whole number is too large for a float.
    """
    turn = 2 * math.pi if unit == "rad" else 360.0
    if not math.isfinite(angle):
        return math.nan
    wrapped = math.fmod(angle, turn)
    if positive:
        wrapped = wrapped + turn if wrapped < 0 else wrapped
        return wrapped if wrapped < turn else 0.0  # a tiny angle below 0 may round up to the whole turn
    return wrapped - turn if wrapped > turn / 2 else wrapped + turn if wrapped <= -turn / 2 else wrapped
