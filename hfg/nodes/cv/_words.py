"""Reads `words.toml`: which functions of OpenCV are nodes, their categories, and the words that describe them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Final

_WORDS: Final[dict[str, Any]] = tomllib.loads(files("hfg.nodes.cv").joinpath("words.toml").read_text("utf-8"))


def _one_by_one(lists: Mapping[str, str]) -> dict[str, str]:
    return {name: key for key, names in lists.items() for name in names.split()}


CATEGORIES: Final[Mapping[str, tuple[str, ...]]] = {
    name: tuple(functions.split()) for name, functions in _WORDS["categories"].items()
}
"""The functions of each category. A function that OpenCV adds is found under "other"."""

NO_NODES: Final[Mapping[str, str]] = _one_by_one({one["because"]: one["functions"] for one in _WORDS["no_nodes"]})
"""Functions that take arrays and are no nodes for all that, with the reason."""

OVERLOADS: Final[Mapping[str, int]] = _WORDS["overloads"]
"""Which way to call a function is the node's; the first unless it stands here."""

OUTPUTS: Final[Mapping[str, Mapping[str, str]]] = _WORDS["outputs"]
"""What outputs are called instead of OpenCV's word for them."""

ABOUT: Final[Mapping[str, str]] = _WORDS["about"]
"""First lines of those that OpenCV does not describe, or in words that need the page around them."""

ARGUMENTS: Final[Mapping[str, Mapping[str, str]]] = _WORDS["arguments"]
"""What is said of arguments that a node takes in fewer kinds than OpenCV does, or that OpenCV says too much of."""

APEX: Final[Mapping[str, str]] = _WORDS["apex"]
"""The nodes of CS::APEX that a function stands for, in whole or for the most part."""

_UNITS: Final = _one_by_one(_WORDS["units"])


def unit_of(function: str, argument: str) -> str | None:
    """Return the unit of a real number: "1" for a plain number, "of the value" for that of the pixels or numbers."""
    own: Mapping[str, str] = _WORDS["units_of"].get(function, {})
    return own.get(argument) or _UNITS.get(argument)
