"""Reads the type stub that the wheel of OpenCV ships: functions with the types of their arguments, and enumerations.

The stub has one function a line, so a regular expression does in milliseconds what Python's own parser needs a third of
a second for; that is why nothing of it is stored. Knows neither nodes nor ports.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import cv2

_FUNCTION = re.compile(r"^def (\w+)\((.*)\) -> (.+): \.\.\.$", re.MULTILINE)
_ENUMERATION = re.compile(r'^(\w+) = int\n"""One of \[(.*)\]"""$', re.MULTILINE)


class Argument(NamedTuple):
    """One argument; `type` is a word of the stub such as "MatLike", "Size" or "int"."""

    name: str
    type: str
    optional: bool


class Overload(NamedTuple):
    """One way to call a function."""

    name: str
    arguments: tuple[Argument, ...]
    returns: str


@functools.cache
def _text() -> str:
    return Path(cv2.__file__).with_name("__init__.pyi").read_text(encoding="utf-8")


@functools.cache
def overloads() -> Mapping[str, tuple[Overload, ...]]:
    """Return every function of the module with the ways to call it that take arrays, in the order of the stub."""
    found: dict[str, tuple[Overload, ...]] = {}
    for name, arguments, returns in _FUNCTION.findall(_text()):
        if "UMat" in arguments or "GpuMat" in arguments or "UMat" in returns:
            continue  # the same on a graphics card
        overload = Overload(name, tuple(map(_argument, _split(arguments))), _plain(returns))
        found[name] = (*found.get(name, ()), overload)
    return found


@functools.cache
def enumerations() -> Mapping[str, tuple[str, ...]]:
    """Return the names of the constants of each enumeration."""
    return {name: tuple(constants.split(", ")) for name, constants in _ENUMERATION.findall(_text())}


def _split(text: str) -> Iterator[str]:
    """Split at the commas that stand in no brackets."""
    depth, start = 0, 0
    for position, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            yield text[start:position].strip()
            start = position + 1
    if text[start:].strip():
        yield text[start:].strip()


def _argument(text: str) -> Argument:
    declared, _, default = text.partition(" = ")
    name, _, type_ = declared.partition(": ")
    return Argument(name, _plain(type_), bool(default))


def _plain(text: str) -> str:
    return text.replace("cv2.typing.", "").replace("_typing.", "").replace("cv2.", "")
