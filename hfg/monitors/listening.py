"""One monitor in a run: what it hears at the ports and nodes that its property names, and its judge.

Depends on `properties` and `violations`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from typing import Any, Final, Literal, Protocol

from hfg.base.token import Marker, Token
from hfg.monitors.formulas import Active, Fired, Sent
from hfg.monitors.properties import Judge, Property, Verdict
from hfg.monitors.violations import Violation

_STRETCH: Final = 32
JUST_AFTER_S: Final = 1e-9
"""What comes at the moment of a deadline is in time."""
KEPT: Final = frozenset({bool, int, float, str, type(None)})
"""Types of values that are kept; of others, which may be large, only the type is."""

OnViolation = Literal["note", "fail"] | Callable[[Violation], object]


class Owner(Protocol):
    """The monitors of a run; see `Monitors`."""

    now: Callable[[], float]

    def need_node(self, path: str) -> None:
        """See that there is a node to hear."""

    def violated(self, one: Watch, t: float) -> None:
        """The property of a monitor has ceased to hold."""

    def broken_by(self, one: Watch, error: Exception) -> None:
        """A condition of a monitor has raised."""

    def plan(self) -> None:
        """A deadline may have changed."""


class Looker:
    """Sees the tokens of one port for one monitor."""

    def __init__(self, put: Callable[[Token[Any]], None]) -> None:
        self.put = put

    def end(self) -> None:
        """See `Looker` of the engine."""


class Watch:
    """One monitor: its judge, the truth of each atom at present, and the last points.

    Attributes:
      name, what, on_violation: as it was given.
      judge: judges the points.
      ring: the last points: time, place and value.
      ends: end its looking.
    """

    def __init__(
        self,
        owner: Owner,
        name: str,
        what: Property,
        began: float,
        on_violation: OnViolation,
        here: Collection[int] | None = None,
    ) -> None:
        """Begin to judge.

        Args:
          owner: who has it.
          name: for people.
          what: the property.
          began: when, on the run's clock.
          on_violation: what follows a violation.
          here: the numbers of the atoms to be heard in this part of the run; None: all.
        """
        self.name = name
        self.what = what
        self.on_violation = on_violation
        self.judge: Judge = what.judge(began)
        self.ring: deque[tuple[float, str, object]] = deque(maxlen=_STRETCH)
        self.ends: list[Callable[[], None]] = []
        self._owner = owner
        self._append, self._point = self.ring.append, self.judge.point
        self._truths = [False] * len(self.judge.atoms)
        self._looks_ahead = what.answer is not None
        self._inside: dict[int, set[str]] = {}  # by atom: which nodes are active that count for it
        self._here = [(number, atom) for number, atom in enumerate(self.judge.atoms) if here is None or number in here]
        for number, atom in self._here:
            if isinstance(atom, Active | Fired):
                owner.need_node(atom.node)
            if isinstance(atom, Active):
                self._inside[number] = set()

    @property
    def verdict(self) -> Verdict:
        """What is known."""
        return self.judge.verdict

    @property
    def due(self) -> float:
        """When time is to be passed on, if no point comes."""
        return self.judge.due

    def looks(self) -> list[tuple[Any, Callable[[Token[Any]], None]]]:
        """Return the ports that it names, each with what is to see its tokens: one point for all that name it."""
        found: dict[str, list[tuple[int, Callable[[Any], object] | None]]] = {}
        for number, atom in self._here:
            if isinstance(atom, Sent):
                found.setdefault(atom.port, []).append((number, atom.when))
            elif isinstance(atom, Fired):
                found.setdefault(f"{atom.node}.processed", []).append((number, None))
        return [(port, self._look(port, atoms)) for port, atoms in found.items()]

    def _age(self, number: int) -> float | None:
        """Return how old a token must be for an atom; exactly that old is not older, whatever is lost by rounding."""
        atom = self.judge.atoms[number]
        is_aged = isinstance(atom, Sent) and atom.older_than_s is not None
        return atom.older_than_s + JUST_AFTER_S if is_aged else None  # type: ignore[union-attr,operator]

    def _look(self, port: str, atoms: list[tuple[int, Callable[[Any], object] | None]]) -> Callable[[Token[Any]], None]:
        truths, append, point, now = self._truths, self._append, self._point, self._owner.now
        numbers = [number for number, _ in atoms]
        ages = [(number, older) for number in numbers if (older := self._age(number)) is not None]

        def put(token: Token[Any]) -> None:
            value = token.value
            kind = type(value)
            if kind is Marker:
                return
            try:
                for number, when in atoms:
                    truths[number] = when is None or bool(when(value))
            except Exception as error:
                self._owner.broken_by(self, error)
                return
            t = now()
            for number, older in ages:
                truths[number] = truths[number] and t - token.stamp > older
            append((t, port, value if kind in KEPT else kind))
            if point(t, *truths):
                self._owner.violated(self, t)
            if self._looks_ahead:
                self._owner.plan()
            for number in numbers:
                truths[number] = False

        return put

    def learn(self, active: set[str]) -> None:
        """These nodes are active when it begins."""
        for number, inside in self._inside.items():
            inside.update(path for path in active if self._counts(number, path))
            self._truths[number] = bool(inside)

    def _counts(self, number: int, path: str) -> bool:
        atom: Any = self.judge.atoms[number]
        return path == atom.node or path.startswith(f"{atom.node}/")

    def activity(self, path: str, active: bool) -> None:
        """A(node) has changed."""
        changed = False
        for number, inside in self._inside.items():
            if self._counts(number, path):
                inside.symmetric_difference_update({path} if (path in inside) != active else ())
                changed = changed or self._truths[number] != bool(inside)
                self._truths[number] = bool(inside)
        if changed:
            t = self._owner.now()
            self._append((t, path, active))
            if self._point(t, *self._truths):
                self._owner.violated(self, t)
            if self._looks_ahead:
                self._owner.plan()

    def pass_to(self, t: float) -> None:
        """Time has passed without a point."""
        if self.judge.pass_to(t):
            self._owner.violated(self, t)

    def end(self, t: float) -> None:
        """The run has ended."""
        self.pass_to(t)

    def give_up(self) -> None:
        """Judge nothing more, since a condition has raised."""
        for end in self.ends:
            end()
        self._inside.clear()
        self.judge.give_up()
