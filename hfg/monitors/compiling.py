"""Turns formulas into one function, which has a local for each part and a variable for what it has to remember.

| operator | remembers |
| --- | --- |
| `once`, `since` from 0 s on | the newest witness: one number |
| the same without an upper bound | the oldest witness: one number |
| the same with both | the witnesses younger than the upper bound |
| `at_least(n)` | the newest n |

Depends on `formulas`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any, Final

from hfg.monitors.formulas import (
    Active,
    And,
    Fired,
    Formula,
    Not,
    Or,
    Previously,
    Sent,
    Since,
    Times,
    atoms_of,
)

Atom = Active | Sent | Fired
Step = Callable[..., tuple[bool, ...]]
"""Called at each point with its time in seconds and the truth of each atom; returns the truth of each formula."""

_NEVER: Final = -math.inf


def compiled(formulas: Iterable[Formula]) -> tuple[list[Atom], Step]:
    """Compile formulas.

    Returns:
      The atoms, in the order in which the function takes them, and the function, which remembers.
    """
    formulas = list(formulas)
    atoms = list(dict.fromkeys(atom for formula in formulas for atom in atoms_of(formula)))
    writer = _Writer(atoms)
    results = [writer.write(formula) for formula in formulas]
    scope: dict[str, Any] = {"deque": deque, "INF": math.inf, "NEVER": _NEVER}
    exec(writer.text(results), scope)
    step: Step = scope["make"]()
    return atoms, step


class _Writer:
    """Writes the text of the function, part by part."""

    def __init__(self, atoms: list[Atom]) -> None:
        self._names = {atom: f"a{number}" for number, atom in enumerate(atoms)}
        self._numbers = count()
        self._lines: list[str] = []
        self._states: dict[str, str] = {}  # by name: its first value
        self._done: dict[Formula, str] = {}  # a part that stands in several places is computed once

    def write(self, formula: Formula) -> str:
        """Write the lines for a formula. Return what holds its truth."""
        if isinstance(formula, Active | Sent | Fired):
            return self._names[formula]
        found = self._done.get(formula)
        if found is None:
            found = self._done[formula] = self._write(formula)
        return found

    def _write(self, formula: Formula) -> str:
        number = next(self._numbers)
        value, state = f"v{number}", f"s{number}"
        match formula:
            case Not(of):
                self._say(f"{value} = not {self.write(of)}")
            case And(one, other):
                self._say(f"{value} = {self.write(one)} and {self.write(other)}")
            case Or(one, other):
                self._say(f"{value} = {self.write(one)} or {self.write(other)}")
            case Previously(of):
                held = self.write(of)
                self._states[state] = "False"
                self._say(f"{value} = {state}", f"{state} = {held}")
            case Times(times, of, within_s):
                held = self.write(of)
                self._states[state] = f"deque((), {times})"
                self._say(f"if {held}: {state}.append(t)")
                self._say(f"{value} = len({state}) == {times} and t - {state}[0] <= {_number(within_s)}")
            case Since():
                self._since(value, state, formula)
            case _:
                raise TypeError(f"no operator of monitors: {formula!r}")
        return value

    def _since(self, value: str, state: str, formula: Since) -> None:
        """Remember of all witnesses the one that counts longest; if there is no such one, all that count."""
        holds = None if formula.holds is None else self.write(formula.holds)
        began = self.write(formula.began)
        at_least_s, within_s = formula.at_least_s, formula.within_s
        if at_least_s == 0:
            self._states[state] = "NEVER"
            forget, note, held = f"{state} = NEVER", f"{state} = t", f"t - {state} <= {_number(within_s)}"
            held = f"{state} != NEVER" if within_s == math.inf else held
        elif within_s == math.inf:
            self._states[state] = "INF"
            forget, note = f"{state} = INF", f"{state} = min({state}, t)"
            held = f"t - {state} >= {_number(at_least_s)}"
        else:
            self._states[state] = "deque()"
            forget, note = f"{state}.clear()", f"{state}.append(t)"
            held = f"bool({state}) and t - {state}[0] >= {_number(at_least_s)}"
        if holds is not None:
            self._say(f"if not {holds}: {forget}")
        self._say(f"if {began}: {note}")
        if self._states[state] == "deque()":
            self._say(f"while {state} and t - {state}[0] > {_number(within_s)}: {state}.popleft()")
        self._say(f"{value} = {held}")

    def _say(self, *lines: str) -> None:
        self._lines += lines

    def text(self, results: list[str]) -> str:
        """Return the text of the whole function."""
        atoms = "".join(f", {name}" for name in self._names.values())
        plain = [state for state, first in self._states.items() if not first.startswith("deque")]
        body = [f"nonlocal {', '.join(plain)}"] if plain else []
        body += [*self._lines, f"return ({''.join(f'{result}, ' for result in results)})"]
        made = "".join(f"    {state} = {first}\n" for state, first in self._states.items())
        return (
            f"def make():\n{made}    def step(t{atoms}):\n"
            + "".join(f"        {line}\n" for line in body)
            + "    return step\n"
        )


def _number(seconds: float) -> str:
    return "INF" if seconds == math.inf else repr(seconds)
