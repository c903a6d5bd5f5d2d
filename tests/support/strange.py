"""Values that cannot be inspected without harm: they raise when compared, printed, hashed or asked for a class.

The behaviour of a run must not depend on the behaviour of its values. `STRANGE` makes a new one of each, by name.
"""

from __future__ import annotations

import asyncio
import weakref
from collections.abc import Callable, Iterator
from typing import Any, Final, NoReturn

import numpy as np

import hfg

__all__ = ["ERRORS", "STRANGE", "Odd", "broken", "gives"]


class Odd(Exception):
    """What strange values raise."""


class _Touchy:
    """Raises whatever is asked of it."""

    def _raise(self, *arguments: object) -> NoReturn:
        raise Odd("hands off")

    __eq__ = __ne__ = __lt__ = __bool__ = __len__ = __iter__ = __contains__ = __getitem__ = _raise
    __repr__ = __str__ = __format__ = __hash__ = __int__ = __float__ = __index__ = __array__ = _raise
    __copy__ = __deepcopy__ = __reduce__ = __reduce_ex__ = __sizeof__ = _raise


class _OtherClass:
    """Says that it is of no class."""

    @property  # type: ignore[misc]
    def __class__(self) -> Any:
        raise Odd("of no class")


class _WrongClass:
    """Says that it is a list."""

    @property  # type: ignore[misc]
    def __class__(self) -> Any:
        return list


class _Text(str):
    """A text that cannot be looked at."""

    __slots__ = ()
    __eq__ = __hash__ = __repr__ = __str__ = __len__ = __iter__ = __format__ = _Touchy._raise


class _Number(int):
    """A number likewise."""

    __eq__ = __hash__ = __repr__ = __str__ = __bool__ = __add__ = __index__ = __int__ = _Touchy._raise


class _Mapping(dict[str, int]):
    """A mapping likewise."""

    __eq__ = __repr__ = __len__ = __iter__ = __getitem__ = __contains__ = items = keys = values = _Touchy._raise


class _List(list[int]):
    """A list likewise."""

    __eq__ = __repr__ = __len__ = __iter__ = __getitem__ = __contains__ = _Touchy._raise


class _Speechless(Exception):
    """An error without a text."""

    def __str__(self) -> str:
        raise Odd("no text")

    __repr__ = __str__


class _Grave(BaseException):
    """What is not meant to be caught."""


class _Dies:
    """Gone at once."""


def _round() -> list[Any]:
    found: list[Any] = []
    found.append(found)
    return found


def _deep() -> list[Any]:
    found: list[Any] = []
    for _ in range(20_000):
        found = [found]
    return found


def _closed() -> Iterator[int]:
    generator = (number for number in range(3))
    generator.close()
    return generator


def _released() -> memoryview:
    view = memoryview(b"abc")
    view.release()
    return view


def _of_objects() -> Any:
    found = np.empty(2, object)
    found[0] = _Text("text")
    return found


STRANGE: Final[dict[str, Callable[[], Any]]] = {
    "0-d array": lambda: np.array(3.0),
    "array": lambda: np.arange(4),
    "empty array": lambda: np.empty((0, 3)),
    "array of objects": _of_objects,
    "nan": lambda: float("nan"),
    "numpy scalar": lambda: np.float32(1.5),
    "not a time": lambda: np.datetime64("NaT"),
    "lone surrogate": lambda: "\ud800",
    "huge number": lambda: 10**5000,
    "list that holds itself": _round,
    "deep list": _deep,
    "closed generator": _closed,
    "view": lambda: memoryview(b"abc"),
    "released view": _released,
    "touchy": _Touchy,
    "list of touchy": lambda: [_Touchy()],
    "no class": _OtherClass,
    "wrong class": _WrongClass,
    "gone": lambda: weakref.proxy(_Dies()),
    "text": lambda: _Text("text"),
    "number": lambda: _Number(3),
    "mapping": lambda: _Mapping(a=1),
    "list": lambda: _List([1]),
    "speechless error": _Speechless,
    "class": lambda: _Touchy,
}
"""Values by what they are."""

ERRORS: Final[dict[str, Callable[[], BaseException]]] = {
    "speechless": _Speechless,
    "of several": lambda: ExceptionGroup("several", [_Speechless(), ValueError("one")]),
    "of a strange value": lambda: ValueError(_Touchy()),
    "stop iteration": StopIteration,
    "recursion": RecursionError,
    "lone surrogate": lambda: ValueError("\ud800"),
    "cancelled": asyncio.CancelledError,
    "grave": _Grave,
    "generator exit": GeneratorExit,
}
"""Errors that node code may raise, by what is odd about them."""


@hfg.node(outputs=Any)
def gives(*, what: str = "0-d array", count: int = 3) -> Iterator[Any]:
    """Yield a strange value again and again."""
    for _ in range(count):
        yield STRANGE[what]()


@hfg.node
def broken(value: Any, *, how: str = "speechless") -> int:
    """Fail in a strange way."""
    raise ERRORS[how]()
