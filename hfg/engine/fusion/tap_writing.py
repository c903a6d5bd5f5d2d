"""Lines of a wave's text that serve taps on edges inside its region (rule R7).

A tap that must see each token immediately is called with it. A tap that may see tokens later gets all of them in one
call, in their order: at the end of the wave, before code that may itself send on a tapped edge, and at a side exit.
Depends on the model.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

from hfg.engine.model.tap import BatchTap, TokenTap, tap_inside
from hfg.ports.edges import AnyEdge

__all__ = ["Outs", "Passed", "TapWriter", "emit_rest"]

Outs: TypeAlias = list[list[tuple[Any, int, "int | None"]]]
Batch: TypeAlias = Callable[[tuple[Any, ...]], None]

_Say: TypeAlias = Callable[[str], None]


class Passed(NamedTuple):
    """A token that has passed from member to member and still has to be shown to a tap.

    Attributes:
      k: the member that has sent it.
      number: of the edge among those of the member.
      output: of the member.
      edge: over which it has passed.
      look: the tap; it gets the token even if it was removed meanwhile.
    """

    k: int
    number: int
    output: int
    edge: AnyEdge
    look: BatchTap


class TapWriter:
    """Writes the lines by which a wave tells who looks.

    Attributes:
      looks: who looks at the edges that lead from member to member; by member and edge, as in `Schedule.outs`.
      batch: taps that get the tokens of a wave together, in the order of their numbers in the text.
      untold: per member, the tokens that have passed before its call and that no tap has got.
    """

    def __init__(self, outs: Outs, say: _Say, *, real: bool) -> None:
        self._outs = outs
        self._say = say
        self._real = real
        self.looks: list[list[TokenTap | None]] = [
            [None if to is None else tap_inside(edge) for edge, _, to in out] for out in outs
        ]
        told = [look.batch for look in itertools.chain(*self.looks) if isinstance(look, BatchTap)]
        self.batch: list[Batch] = list(dict.fromkeys(told))
        self._waiting: list[Passed] = []
        self.untold: dict[int, list[Passed]] = {}

    def anybody_behind(self, k: int) -> bool:
        """Whether a tap is on an edge of member k or of a later one."""
        return any(look is not None for look in itertools.chain(*self.looks[k:]))

    def bind(self) -> None:
        """Find the taps and their edges once."""
        say = self._say
        for number in range(len(self.batch)):
            say(f"batch{number} = names.batch[{number}]")
        for k, looks in enumerate(self.looks):
            for number, look in enumerate(looks):
                if look is not None:
                    say(f"e{k}_{number} = names.edges[{k}][{number}]")
                if isinstance(look, BatchTap):
                    say(f"p{k}_{number} = names.looks[{k}][{number}].place")
                elif look is not None:
                    say(f"look{k}_{number} = names.looks[{k}][{number}]")

    def passed(self, k: int, number: int, output: int) -> None:
        """A token is sent from member to member."""
        look = self.looks[k][number]
        if isinstance(look, BatchTap):
            if self._real and not any(one.k == k for one in self._waiting):
                self._say(f"at{k} = monotonic() + epoch")
            self._waiting.append(Passed(k, number, output, self._outs[k][number][0], look))
        elif look is not None:
            self.emit()
            value = f"NO_MESSAGE if v{k}_{output} is None else v{k}_{output}"
            self._say(f"look{k}_{number}(Token({value}, 0, stamp, e{k}_{number}.sent + region.waves + done + 1))")

    def emit(self) -> None:
        """Show the taps the tokens that they have not got yet."""
        if not self._waiting:
            return
        self._say("nth = region.waves + done + 1")
        if not self._real:
            self._say("at = now()")
        for who, batch in enumerate(self.batch):
            told = [self._entries(one) for one in self._waiting if one.look.batch == batch]
            if told:
                self._say(f"batch{who}(({', '.join(told)}))")
        self._waiting.clear()

    def _entries(self, one: Passed) -> str:
        place, at = f"{one.k}_{one.number}", f"at{one.k}" if self._real else "at"
        return f"p{place}, v{one.k}_{one.output}, stamp, e{place}.sent + nth, {at}"

    def before_call(self, k: int) -> None:
        """Member k is called: a side exit from here has to tell the rest."""
        self.untold[k] = list(self._waiting)

    def branch(self) -> list[Passed]:
        """The lines that follow run, or others: `other_branch` is to begin with what this gives."""
        return list(self._waiting)

    def other_branch(self, waiting: list[Passed]) -> None:
        """The lines that follow run where those since `branch` do not."""
        self._waiting = waiting


def emit_rest(untold: Sequence[Passed], found: dict[str, Any], now: Callable[[], float]) -> None:
    """The wave has come to a side exit: tell what its locals hold. The counts of the edges are settled up to it."""
    for k, _, output, edge, look in untold:
        when = found[f"at{k}"] if f"at{k}" in found else now()
        look.batch((look.place, found[f"v{k}_{output}"], found["stamp"], edge.sent + 1, when))
