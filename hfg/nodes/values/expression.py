"""Formulas that are written in a parameter: never handed to Python, so that they can do nothing but calculate.

Depends on functions and ports.
"""

from __future__ import annotations

import ast
import functools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeAlias

from annotated_types import MaxLen, Predicate

from hfg.nodetypes.functions import node
from hfg.ports import Inputs, Parameter

Calculation: TypeAlias = Callable[[Sequence[float]], float]

_NAMES: Final = "abcdefghijklmnopqrstuvwxyz"
_CONSTANTS: Final = {"pi": math.pi, "tau": math.tau, "inf": math.inf, "nan": math.nan}
_OPERATORS: Final[Mapping[type, Callable[..., float]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: math.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_FUNCTIONS: Final[Mapping[str, Callable[..., float]]] = {
    **{
        name: getattr(math, name)
        for name in (
            *("sqrt", "cbrt", "exp", "log", "log2", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
            *("sinh", "cosh", "tanh", "floor", "ceil", "trunc", "hypot", "degrees", "radians", "copysign"),
        )
    },
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
}
_DEEPEST: Final = 50


class _NoFormula(ValueError):
    """The text is not a formula."""


@functools.lru_cache(maxsize=256)
def read_formula(text: str) -> tuple[Calculation, int]:
    """Make a function of a formula, and say how many values it needs.

    Raises:
      ValueError: it is none; the message says where.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _NoFormula(
            f"{text!r:.80} is not a formula ({error.__class__.__name__}); write one as in 'a * 2 + b'"
        ) from None
    needed = 0

    def read(part: ast.expr, depth: int = 0) -> Calculation:
        nonlocal needed
        if depth > _DEEPEST:
            raise _NoFormula(f"{text!r:.80} is nested more than {_DEEPEST} deep; split it in two nodes")
        inner = functools.partial(read, depth=depth + 1)
        match part:
            case ast.Constant(value=bool() | int() | float() as number):
                # Floats alone: whole numbers of any size would let a formula eat all memory.
                value = float(number)
                return lambda values: value
            case ast.Name(id=name) if name in _CONSTANTS:
                value = _CONSTANTS[name]
                return lambda values: value
            case ast.Name(id=name) if len(name) == 1 and name in _NAMES:
                index = _NAMES.index(name)
                needed = max(needed, index + 1)
                return lambda values: values[index]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _applied(_OPERATORS[type(op)], [inner(operand)])
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _applied(_OPERATORS[type(op)], [inner(left), inner(right)])
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS and arguments:
                return _applied(_FUNCTIONS[name], [inner(argument) for argument in arguments])
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _OPERATORS for op in ops):
                return _compared([_OPERATORS[type(op)] for op in ops], [inner(left), *map(inner, others)])
            case ast.IfExp(test=test, body=body, orelse=orelse):
                asked, then, otherwise = inner(test), inner(body), inner(orelse)
                return lambda values: then(values) if asked(values) else otherwise(values)
            case ast.BoolOp(op=op, values=given):
                parts, either = list(map(inner, given)), isinstance(op, ast.Or)
                return lambda values: float((any if either else all)(one(values) for one in parts))
        raise _NoFormula(
            f"{ast.unparse(part)!r:.60} is not allowed in the formula {text!r:.80}; use numbers, the inputs a, b, "
            f"c ..., + - * / // % **, comparisons, `x if condition else y`, and {', '.join(_FUNCTIONS)}"
        )

    return read(tree), needed


def _applied(function: Callable[..., float], parts: Sequence[Calculation]) -> Calculation:
    return lambda values: float(function(*[part(values) for part in parts]))


def _compared(operators: Sequence[Callable[..., Any]], parts: Sequence[Calculation]) -> Calculation:
    def compare(values: Sequence[float]) -> float:
        found = [part(values) for part in parts]
        return float(all(op(one, other) for op, one, other in zip(operators, found[:-1], found[1:], strict=True)))

    return compare


def is_a_formula(text: str) -> bool:
    """Say whether it can be read."""
    try:
        read_formula(text)
    except ValueError:
        return False
    return True


@node(
    inputs={"values": Inputs(float, 2)},
    outputs=float,
    parameters={"formula": Parameter("a + b", MaxLen(1000), Predicate(is_a_formula))},
)
def expression(*values: float, formula: str) -> float:
    """Calculate a formula of the numbers at all inputs, which it calls a, b, c, and so on.

    The formula is no Python: it knows numbers, `pi`, `tau`, `inf` and `nan`, the operators `+ - * / // % **`, `not`,
    `and`, `or` and comparisons (true is 1, false 0), `x if condition else y`, and the functions `abs`, `min`, `max`,
    `round`, `sqrt`, `cbrt`, `exp`, `log`, `log2`, `log10`, `sin`, `cos`, `tan`, `asin`, `acos`, `atan`, `atan2`,
    `sinh`, `cosh`, `tanh`, `floor`, `ceil`, `trunc`, `hypot`, `degrees`, `radians` and `copysign`. Everything is
    calculated with floats. Fires once all inputs hold a token.

    Args:
      values: up to 26 numbers.
      formula: such as "hypot(a, b) if c > 0 else 0".

    Raises:
      ValueError: the formula names an input that the node does not have, or is not defined at these values.
      ZeroDivisionError: it divides by 0.
      OverflowError: a result, or a whole number, is too large for a float.
      TypeError: a function is given the wrong number of values.
    """
    calculation, needed = read_formula(formula)
    if needed > len(values):
        raise ValueError(
            f"the formula {formula!r:.80} needs the input {_NAMES[needed - 1]}, but there are {len(values)}: make the "
            f"node with values={needed}"
        )
    return calculation([float(value) for value in values])
