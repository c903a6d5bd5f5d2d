"""Which port of a node is meant by a name in a file: by number, with or without the automatic ports, or a parameter's.

In CS::APEX every node has the events activated, deactivated and processed, and the slots enable and disable; triggers
among its parameters follow, then what it declares. Older files leave them out. Depends on
`table`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from hfg.files.apex.table import TypeRule

AUTOMATIC: Final[dict[str, tuple[str, ...]]] = {
    "event": ("activated", "deactivated", "processed"),
    "slot": ("enable", "disable"),
}
_PORT: Final = re.compile(r"(in|out|event|slot|trigger)_(.+)", re.DOTALL)
_RELAYS: Final = {"relayin": "out", "relayout": "in", "relayevent": "slot", "relayslot": "event"}
_SOURCES: Final = ("out", "event")


class Missing(Exception):
    """Why there is no such port."""


class Ports:
    """The ports of one node.

    Attributes:
      own: by kind, their names here in the order of their numbers, triggers first, automatic ones left out.
      uses_automatic: by kind, whether numbers count automatic ports.
      doubtful: numbers that could be meant both ways, of which nothing in the file says more.
    """

    def __init__(self, rule: TypeRule, numbers: Iterable[tuple[str, int]], counts: dict[str, int], old: bool) -> None:
        triggers = list(rule.triggers.values())
        self.rule = rule
        self.own: dict[str, list[str]] = {
            "in": rule.inputs,
            "out": rule.outputs,
            "slot": [*triggers, *rule.slots],
            "event": [*([""] * len(triggers)), *rule.events],
        }
        self.sizes: dict[str, int] = {}
        used = list(numbers)
        for kind, names in self.own.items():
            if names and names[-1].endswith("[]"):
                fixed = len(names) - 1
                said = counts.get(kind)
                most = max((number for one, number in used if one == kind), default=-1) + 1 - fixed
                self.sizes[names[-1].removesuffix("[]")] = max(most, 0) if said is None else max(said, most)
        self.uses_automatic = {
            kind: not old or any(number >= len(self.own[kind]) for one, number in used if one == kind)
            for kind in AUTOMATIC
        }
        self.doubtful = {
            kind: old and not self.uses_automatic[kind] and any(one == kind for one, _ in used) for kind in AUTOMATIC
        }

    def name(self, kind: str, number: int) -> str:
        """Name a port here.

        Raises:
          Missing: there is none.
        """
        if kind in AUTOMATIC and self.uses_automatic[kind]:
            automatic = AUTOMATIC[kind]
            if number < len(automatic):
                return automatic[number]
            number -= len(automatic)
        names = self.own[kind]
        if names and names[-1].endswith("[]") and number >= len(names) - 1:
            name = names[-1].removesuffix("[]")
            return f"{name}[{number - len(names) + 1}]"
        word = {"in": "input", "out": "output"}.get(kind, kind)
        if number >= len(names):
            raise Missing(f"{self.rule.type} has no {word} for number {number}")
        if not names[number]:
            raise Missing(f"{self.rule.type} has nothing like the {word} of number {number}")
        return names[number]


def parts(port: str) -> tuple[str, str]:
    """Take a port's name apart into its kind, and its number or the name of a parameter.

    Raises:
      Missing: it is no name of a port.
    """
    relay, _, number = port.partition("_")
    if relay in _RELAYS and number.isdecimal():
        return _RELAYS[relay], f"relay {number}"
    found = _PORT.fullmatch(port)
    if found is None:
        raise Missing(f'"{port}" is no name of a port')
    return ("event" if found[1] == "trigger" else found[1]), found[2]


def is_source(kind: str) -> bool:
    """Return whether connections begin there."""
    return kind in _SOURCES
