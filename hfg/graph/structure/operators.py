"""Operators on edges that can be found by name (rule P9), so that commands, and later files, can say them.

An edge may have any reactivex operator; one made by a function that `operator` knows carries the name of that
function and its arguments. Depends on errors.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Final, Generic, ParamSpec

from reactivex import Observable, operators
from typing_extensions import override

from hfg.errors import DeclarationError, GraphError
from hfg.nodetypes.description import look_up

P = ParamSpec("P")
Operator = Callable[[Observable[Any]], Observable[Any]]

_OPERATORS: Final = "reactivex.operators"


class NamedOperator:
    """A reactivex operator, and how it was made.

    Attributes:
      made_by: the function.
      arguments: what that was given by position.
      parameters: what it was given by name.
    """

    __slots__ = ("_operator", "arguments", "made_by", "parameters")

    def __init__(
        self,
        made_by: OperatorFunction[...],
        arguments: tuple[Any, ...],
        parameters: dict[str, Any],
        operator: Operator,
    ) -> None:
        self.made_by = made_by
        self.arguments = arguments
        self.parameters = parameters
        self._operator = operator

    def __call__(self, source: Observable[Any]) -> Observable[Any]:
        """Return what comes out of it."""
        return self._operator(source)

    @override
    def __eq__(self, other: object) -> bool:
        return isinstance(other, NamedOperator) and self._said() == other._said()

    @override
    def __hash__(self) -> int:
        return hash(self.made_by.name)  # what it was given need not have one

    def _said(self) -> tuple[Any, ...]:
        return self.made_by.reference or self.made_by, self.arguments, self.parameters

    @override
    def __repr__(self) -> str:
        said = [*map(repr, self.arguments), *(f"{name}={value!r}" for name, value in self.parameters.items())]
        return f"{self.made_by.name}({', '.join(said)})"


class OperatorFunction(Generic[P]):
    """A function that makes operators which know their name."""

    def __init__(self, function: Callable[P, Operator]) -> None:
        if not callable(function):
            raise DeclarationError(
                f"hfg.operator takes a function that gives a reactivex operator, got {function!r}; "
                "write it above `def smoothed(seconds: float): return ops.debounce(seconds)`"
            )
        self._function = function
        self.name = getattr(function, "__qualname__", type(function).__name__)
        self.module = getattr(function, "__module__", "")
        self.__doc__ = function.__doc__
        self.__name__ = self.name

    def __call__(self, *arguments: P.args, **parameters: P.kwargs) -> NamedOperator:
        """Make an operator, for `through=[...]` of an edge.

        Raises:
          DeclarationError: the function gave something else.
        """
        made = self._function(*arguments, **parameters)
        if not callable(made):
            raise DeclarationError(
                f"operator {self.name} gave {made!r}, which is not a reactivex operator; "
                "let it return one, as in `return ops.debounce(seconds)`"
            )
        return NamedOperator(self, arguments, parameters, made)

    @property
    def reference(self) -> str | None:
        """Where it is found, "module:name"; None for what is made inside of functions."""
        found = None if "<" in self.name else look_up(self.module, self.name)
        known = found is self or (self.module == _OPERATORS and found is self._function)
        return f"{self.module}:{self.name}" if known else None

    @override
    def __repr__(self) -> str:
        return f"<operator {self.name}>"


def operator(function: Callable[P, Operator]) -> OperatorFunction[P]:
    """Let a function make reactivex operators that commands can say by name (rule P9).

    The function stands at the top of a module and is given plain data. Those of reactivex itself need no module:
    `hfg.operator(ops.debounce)(0.2)`.

    Raises:
      DeclarationError: it is not a function.

    Examples:
      >>> from reactivex import operators as ops
      >>> operator(ops.debounce)(0.2)
      debounce(0.2)
    """
    return OperatorFunction(function)


def find_operator(
    reference: str, arguments: tuple[Any, ...], parameters: Mapping[str, Any], where: str
) -> NamedOperator:
    """Make an operator by the name of its function.

    Raises:
      GraphError: there is no such function, or it refuses what it is given; the message begins with `where`.
    """
    module, colon, name = reference.partition(":")
    if not (module and colon and name):
        raise GraphError(
            f'{where}: "{reference}" is not a reference to an operator; write "my_robot.operators:smoothed"'
        )
    try:
        importlib.import_module(module)
    except Exception as error:  # code of users raises what it likes
        raise GraphError(
            f'{where}: operator "{reference}": importing "{module}" failed ({type(error).__name__}: {error})'
        ) from error
    found = look_up(module, name)
    if module == _OPERATORS:  # it has many imported names in addition to its own functions
        found = OperatorFunction(found) if name in operators.__all__ else None
    if not isinstance(found, OperatorFunction):
        what = f'module "{module}" has no "{name}"' if found is None else f"it is {found!r:.60}, no operator"
        raise GraphError(f'{where}: operator "{reference}": {what}; write @hfg.operator above a function of this name')
    try:
        return found(*arguments, **parameters)
    except Exception as error:
        raise GraphError(f'{where}: operator "{reference}" cannot be made: {type(error).__name__}: {error}') from error
