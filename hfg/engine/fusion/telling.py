"""What the text of a wave says to those who look at edges inside of its region (rule R7).

Who must see each token at once is called with one. Who may be told later is told of all that has passed by one call,
in the order in which it has: at the end of the wave, before code runs that may itself send something somebody looks at,
and at a side exit. Stands on the model.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, TypeAlias

from hfg.engine.model.looks import Look, WaveLook, look_inside

__all__ = ["Outs", "Passed", "Telling", "looks_of", "tell_rest", "together_of"]

Outs: TypeAlias = list[list[tuple[Any, int, "int | None"]]]
Passed: TypeAlias = tuple[int, int, int]
"""A token that has passed: the member that has sent it, which of its live edges, which of its outputs."""

_Say: TypeAlias = Callable[[str], None]


class Telling:
    """Writes the lines by which a wave tells who looks.

    Attributes:
      looks: who looks at the edges that lead from member to member; by member and edge, as in `Schedule.outs`.
      untold: what has passed before the call of each member, and nobody has been told.
    """

    def __init__(self, outs: Outs, say: _Say, *, real: bool) -> None:
        self._outs = outs
        self._say = say
        self._real = real
        self.looks = looks_of(outs)
        self._together = _together(self.looks)
        self._waiting: list[Passed] = []
        self.untold: dict[int, list[Passed]] = {}

    def anybody_behind(self, k: int) -> bool:
        """Whether somebody looks at what member k or one behind it sends."""
        return any(look is not None for look in itertools.chain(*self.looks[k:]))

    def bind(self) -> None:
        """Who looks, and what they are told of, is found once."""
        say = self._say
        for number in range(len(self._together)):
            say(f"together{number} = names.together[{number}]")
        for k, looks in enumerate(self.looks):
            for number, look in enumerate(looks):
                if look is not None:
                    say(f"e{k}_{number} = names.edges[{k}][{number}]")
                if type(look) is WaveLook:
                    say(f"p{k}_{number} = names.looks[{k}][{number}].place")
                elif look is not None:
                    say(f"look{k}_{number} = names.looks[{k}][{number}]")

    def passed(self, k: int, number: int, output: int) -> None:
        """A token is sent from member to member."""
        look = self.looks[k][number]
        if type(look) is WaveLook:
            if self._real and not any(one == k for one, _, _ in self._waiting):
                self._say(f"at{k} = monotonic() + epoch")
            self._waiting.append((k, number, output))
        elif look is not None:
            self.tell()
            value = f"NO_MESSAGE if v{k}_{output} is None else v{k}_{output}"
            self._say(f"look{k}_{number}(Token({value}, 0, stamp, e{k}_{number}.sent + region.waves + done + 1))")

    def tell(self) -> None:
        """Who is not told yet is told now."""
        if not self._waiting:
            return
        self._say("nth = region.waves + done + 1")
        if not self._real:
            self._say("at = now()")
        for together, who in self._together.items():
            told = [
                f"p{k}_{number}, v{k}_{output}, stamp, e{k}_{number}.sent + nth, {f'at{k}' if self._real else 'at'}"
                for k, number, output in self._waiting
                if self.looks[k][number].together == together  # type: ignore[union-attr]  # only these wait
            ]
            if told:
                self._say(f"{who}(({', '.join(told)}))")
        self._waiting.clear()

    def before_call(self, k: int) -> None:
        """Member k is called: a side exit from here has to tell the rest."""
        self.untold[k] = list(self._waiting)

    def branch(self) -> list[Passed]:
        """The lines that follow run, or others: `other_branch` is to begin with what this gives."""
        return list(self._waiting)

    def other_branch(self, waiting: list[Passed]) -> None:
        """The lines that follow run where those since `branch` do not."""
        self._waiting = waiting


def looks_of(outs: Outs) -> list[list[Look | None]]:
    """Who looks at the edges that lead from member to member."""
    return [[None if to is None else look_inside(edge) for edge, _, to in out] for out in outs]


def _together(looks: list[list[Look | None]]) -> dict[Callable[[tuple[Any, ...]], None], str]:
    """Those who are told of a wave together, each with its name in the text."""
    found = dict.fromkeys(look.together for look in itertools.chain(*looks) if type(look) is WaveLook)
    return {together: f"together{number}" for number, together in enumerate(found)}


def together_of(looks: list[list[Look | None]]) -> list[Callable[[tuple[Any, ...]], None]]:
    """The same, in the order of their names."""
    return list(_together(looks))


def tell_rest(outs: Outs, untold: list[Passed], found: dict[str, Any], now: Callable[[], float]) -> None:
    """The wave has come to a side exit: tell what its locals hold. The counts of the edges are settled up to it."""
    for k, number, output in untold:
        edge = outs[k][number][0]
        look: Any = look_inside(edge)
        when = found[f"at{k}"] if f"at{k}" in found else now()
        look.together((look.place, found[f"v{k}_{output}"], found["stamp"], edge.sent + 1, when))
