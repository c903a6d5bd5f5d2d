"""Monitors over several parts of a run: each part tells its points, and the main part judges them in their order.

A `Witness` hears in a part what a monitor names there, and tells the *points*, each with its time on the run's clock
and the atoms that are true; values stay where they are. In the main part a `Gathered` monitor keeps points until all
parts have said that nothing earlier is to come, which they are asked for when a point waits. So the order is that of
the run's clock, and no part says anything while nothing happens. Depends on `listening`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final, Protocol

from hfg.base.controls import escaped
from hfg.errors import UsageError
from hfg.monitors.compiling import Atom
from hfg.monitors.conditions import Condition
from hfg.monitors.formulas import Active, Previously, Sent, Since, Times
from hfg.monitors.listening import OnViolation, Owner, Watch
from hfg.monitors.margins import MarginJudge
from hfg.monitors.parsing import parse
from hfg.monitors.properties import Property, Verdict
from hfg.monitors.violations import Point

EVERY_S: Final = 0.01
"""Points of this time travel together."""
_MOST_WAITING: Final = 100_000  # points of a monitor, until a part answers
_LONGEST: Final = 200  # characters of a value that are sent
_ORDER: Final = count()
"""Numbers points of the same moment in the order in which they happen; in virtual time all parts are in one process."""

Known = tuple[float, int]
"""How far something is known: a time, and a number of `_ORDER`."""


class Far(Protocol):
    """A witness in another part of the run."""

    def known(self) -> asyncio.Future[Known]:
        """Ask up to when all its points are sent; they come before the answer."""

    def end(self) -> None:
        """Look no more."""


class Afar(Protocol):
    """The other parts of a run, for monitors in its main part."""

    main: str
    """The name of the main part."""

    def parts_of(self, path: str) -> set[str]:
        """Return the parts in which a node or port is, by its path; of a subgraph, those of the nodes inside.

        Raises:
          GraphError: there is none.
        """

    def look(self, part: str, atoms: Mapping[int, str], watch: Gathered) -> Far:
        """Let a part hear these atoms, by number, for a monitor."""


class _Telling(Watch):
    """Hears what a monitor names in one part, and tells each point instead of judging it."""

    def __init__(self, tell: Callable[[Point], None], *given: Any) -> None:
        super().__init__(*given)
        self._tell = tell
        self._numbers: Sequence[int] = range(len(self.judge.atoms))  # of the atoms, in the main part
        self._last: deque[tuple[float, str, object]] = deque(maxlen=1)
        self._append, self._point = self._last.append, self._told
        self._looks_ahead = False

    def _told(self, t: float, *truths: bool) -> bool:
        _, what, value = self._last[0]
        true = [number for number, holds in zip(self._numbers, truths, strict=True) if holds]
        self._tell(Point(t, next(_ORDER), what, _plain(value), true))
        return False

    def learn(self, active: set[str]) -> None:
        """See `Watch`; what is active before the first point is sent without being one."""
        super().learn(active)
        if any(self._truths):
            self._last.append((0.0, "", None))
            self._told(self._owner.now(), *self._truths)


class Witness(_Telling):
    """A monitor of the main part, as far as another part hears for it."""

    def __init__(self, tell: Callable[[Point], None], owner: Owner, atoms: Mapping[int, str]) -> None:
        """Begin to hear.

        Args:
          tell: takes each point.
          owner: who has it.
          atoms: what is to be heard, as text, by number.
        """
        super().__init__(tell, owner, "", parse(f"always({' | '.join(atoms.values())})"), 0.0, "note")
        self._numbers = list(atoms)


class Gathered(_Telling):
    """A monitor over several parts.

    Attributes:
      gaps: from when on it is not known what has happened, on the run's clock, and why.
    """

    def __init__(
        self, owner: Gatherer, afar: Afar, name: str, what: Property, began: float, on_violation: OnViolation
    ) -> None:
        """Begin to judge.

        Args:
          owner: who has it.
          afar: the other parts.
          name: see `Watch`, as the rest.
          what: the property.
          began: when, on the run's clock.
          on_violation: what follows a violation.
        """
        judge = what.judge(began)
        atoms = dict(enumerate(judge.atoms))
        places = {number: _places(afar, atom) for number, atom in atoms.items()}
        mine = {number for number, parts in places.items() if afar.main in parts}
        others = sorted(set().union(*places.values()) - {afar.main})
        if isinstance(judge, MarginJudge):
            raise UsageError(
                f'monitor "{name}" is measured, but of the process of group "{others[0]}" only the truth of conditions '
                "comes here: measure what passes ports of the main process"
            )
        told = {part: {n: _text(name, atoms[n], part) for n in atoms if part in places[n]} for part in others}
        super().__init__(partial(self.take, afar.main), owner, name, what, began, on_violation, mine)
        self.gaps: list[tuple[float, str]] = []
        self._gatherer = owner
        self._states = {number for number, atom in enumerate(self.judge.atoms) if isinstance(atom, Active)}
        self._held: dict[str, set[int]] = {}  # which of these hold in each part
        self._waiting: list[tuple[float, int, str, Point]] = []
        self._asked: set[str] = set()
        self._is_due = self._is_over = False
        self._end_at: float | None = None
        self._remembers = what.answer is not None or _remembers(what)
        self._known: dict[str, Known] = dict.fromkeys(others, (began, -1))
        self._open = set(others)
        self._far = {part: afar.look(part, told[part], self) for part in others}
        self.ends += [far.end for far in self._far.values()]

    @property
    def verdict(self) -> Verdict:
        """What is known: after a gap at most that it is violated."""
        found = self.judge.verdict
        return Verdict.UNKNOWN if self.gaps and found is not Verdict.VIOLATED else found

    @property
    def due(self) -> float:
        """See `Watch`; while parts are asked, none."""
        return float("inf") if self._is_due else self.judge.due

    # --- points come in ---------------------------------------------------------------------------------------------

    def take(self, part: str, point: Point) -> None:
        """A part tells a point."""
        if self._is_over:
            return
        if len(self._waiting) >= _MOST_WAITING:
            waited = ", ".join(f'"{one}"' for one in sorted(self._asked or self._far))
            self._lose(f"{_MOST_WAITING:,} points have come while the process of group {waited} has not answered")
            return
        if part in self._known:
            self._known[part] = point.time, point.number  # all that it has heard before has come
        heappush(self._waiting, (point.time, point.number, part, point))
        self._want()

    def pass_to(self, t: float) -> None:
        """See `Watch`: time has passed here, and the other parts are asked whether nothing has come there."""
        self._want()

    def _want(self) -> None:
        if not self._is_due and self._end_at is None and not self._is_over:
            self._is_due = True
            self._gatherer.gather(self._ask)

    def _ask(self) -> None:
        self._asked = set(self._far)
        for part, far in self._far.items():
            far.known().add_done_callback(partial(self._answered, part))

    def _answered(self, part: str, answer: asyncio.Future[Known]) -> None:
        self._asked.discard(part)
        if not answer.cancelled():
            error = answer.exception()
            if error is None:
                self._known[part] = max(self._known[part], answer.result())
            elif not self._is_over:
                self._lose(str(error), part)
        if not self._asked:
            self._is_due = False
            if not self._is_over and self._end_at is None:
                self._judge_until(min(self._known.values()))
            if self._waiting:
                self._want()
            self._gatherer.gathered()

    def _judge_until(self, known: Known) -> None:
        """Judge what nothing earlier can come before any more."""
        while self._waiting and self._waiting[0][:2] < known:
            _, _, part, point = heappop(self._waiting)
            self._judge(part, point)
        super().pass_to(known[0])

    def _judge(self, part: str, point: Point) -> None:
        self._held[part] = self._states.intersection(point.true)
        if not point.what:
            return
        held = set(point.true).union(*self._held.values())
        self.ring.append((point.time, escaped(point.what), point.value))
        if self.judge.point(point.time, *(number in held for number in range(len(self.judge.atoms)))):
            self._owner.violated(self, point.time)

    # --- what is lost -----------------------------------------------------------------------------------------------

    def gone(self, part: str, why: str) -> None:
        """A part has died: what happened there since it last told is lost. Another one takes its place.

        A property that remembers what was before is not judged any more. One that does not is: what it finds from now
        on is true, but it is not known whether it held all the time.
        """
        if self._is_over:
            return
        if self._remembers:
            self._lose(why, part)
        else:
            self._held.pop(part, None)
            self._note(why, self._known[part][0])

    def _lose(self, why: str, part: str | None = None) -> None:
        since = self._known[part] if part is not None else min(self._known.values())
        self._judge_until(min(self._known.values()))
        found = self.judge.verdict
        self.give_up()
        if found is Verdict.VIOLATED:
            self.judge.verdict = found
        self._note(f"{why}; nothing more is judged", since[0])

    def _note(self, why: str, since: float) -> None:
        self.gaps.append((since, why))
        self._gatherer.unknown_since(self, since, why)

    # --- the end ----------------------------------------------------------------------------------------------------

    def end(self, t: float) -> None:
        """See `Watch`: what happened before comes while the parts leave."""
        self._end_at = t

    def over(self, part: str) -> None:
        """A part has told everything."""
        self._open.discard(part)
        if not self._open and self._end_at is not None and not self._is_over:
            self._judge_until(here_and_now(self._end_at))
            self._is_over = True

    def give_up(self) -> None:
        """See `Watch`."""
        self._is_over = True
        self._waiting.clear()
        super().give_up()


class Gatherer(Owner, Protocol):
    """The monitors of a run, some of which are gathered."""

    def gather(self, ask: Callable[[], None]) -> None:
        """Call soon; until then and until `gathered`, the run stays open."""

    def gathered(self) -> None:
        """All has been answered."""

    def unknown_since(self, one: Gathered, since: float, why: str) -> None:
        """It is not known any more whether a property holds."""


def here_and_now(now: float) -> Known:
    """Return how far all is known that happens in this part."""
    return now, next(_ORDER)


def is_afar(afar: Afar, what: Property) -> bool:
    """Return whether a property names what is in other parts than the main one.

    Raises:
      GraphError: it names what is not there.
    """
    return any(_places(afar, atom) != {afar.main} for atom in what.atoms())


def _places(afar: Afar, atom: Atom) -> set[str]:
    return afar.parts_of(atom.port if isinstance(atom, Sent) else atom.node)


def _text(name: str, atom: Atom, part: str) -> str:
    """Return an atom as text, as another part reads it."""
    if isinstance(atom, Sent) and not (atom.when is None or isinstance(atom.when, Condition)):
        raise UsageError(
            f'monitor "{name}": the condition at "{atom.port}" is code, and the process of group "{part}" needs it: '
            f'write it as text, such as sent("{atom.port}", "value > 3")'
        )
    return str(atom)


def _remembers(what: Property) -> bool:
    asks = what.asks
    waiting = [] if asks is None else [asks]
    for one in waiting:
        waiting += one.parts()
    return any(isinstance(one, Previously | Since | Times) for one in waiting)


def _plain(value: object) -> bool | int | float | str | None:
    """Return a value that a message can carry; of one that is not plain, the name of its type."""
    if isinstance(value, type):
        return value.__name__
    if isinstance(value, str):
        return value[:_LONGEST]
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return f"{value:#x}"[:_LONGEST]
    return value  # type: ignore[return-value]  # `KEPT` has no other types
