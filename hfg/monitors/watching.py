"""Lets properties be judged while a run is in progress.

Each port that a formula names gets a tap, and only changes of activity are traced. So fused regions stay fused, and a
node that no formula names pays nothing. Depends on `properties`, `violations` and the engine.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any, Final, Literal

from hfg.base.logs import Log
from hfg.base.token import Marker, Token
from hfg.engine import Run
from hfg.errors import GraphError, MonitorViolated, UsageError
from hfg.graph.structure.naming import suggest
from hfg.monitors.formulas import Active, Fired, Sent
from hfg.monitors.margins import MarginJudge
from hfg.monitors.properties import Judge, Property, Verdict
from hfg.monitors.violations import Seen, Violation
from hfg.trace import ActivityChanged, RunEnded, StructureChanged, TraceEvent

_LOGGER = Log("hfg.monitors")
_STRETCH: Final = 32
_MOST: Final = 100  # violations of a monitor that are kept; the others are counted
_JUST_AFTER_S: Final = 1e-9  # what comes at the moment of a deadline is in time
_KEPT: Final = frozenset({bool, int, float, str, type(None)})  # of others, which may be large, only the type

OnViolation = Literal["note", "fail"] | Callable[["Violation"], object]


class Monitors:
    """The monitors of one run.

    Attributes:
      violations: each time at which a property has ceased to hold, in order; of each monitor the first 100.
      counts: how often each was violated, by the name of its monitor.
      broken: by monitor, the error of a condition that raised; such a monitor judges nothing more.
      began: when they began, on the run's clock.
      now: returns the time on the run's clock.
      are_declared: the graph declares them.
    """

    def __init__(self, run: Run, *, are_declared: bool = False) -> None:
        self.are_declared = are_declared
        self.violations: list[Violation] = []
        self.counts: dict[str, int] = {}
        self.broken: dict[str, Exception] = {}
        self._run = run
        self._engine = run._engine
        self.now = self._engine.now if self._engine.time.epoch is None else _clock(self._engine.time.epoch)
        self.began = self.now()
        self._watches: dict[str, _Watch] = {}
        self._errors: dict[str, MonitorViolated] = {}
        self._timer: Any = None
        self._alarm = math.inf
        self._boxes: frozenset[str] = frozenset()

    @property
    def verdicts(self) -> dict[str, Verdict]:
        """What is known of each property, by the name of its monitor."""
        return {name: one.judge.verdict for name, one in self._watches.items()}

    @property
    def properties(self) -> dict[str, Property]:
        """What is judged, by the name of its monitor."""
        return {name: one.what for name, one in self._watches.items()}

    @property
    def margins(self) -> dict[str, float]:
        """How far the run is from violating each property that is `measured`, by the name of its monitor."""
        judges = {name: one.judge for name, one in self._watches.items()}
        return {name: judge.margin for name, judge in judges.items() if isinstance(judge, MarginJudge)}

    def check(self) -> None:
        """See that no property was violated; open ones are not.

        Raises:
          MonitorViolated: one was, or a condition has raised; the message has the stretch of points that shows it.
        """
        for name, error in self.broken.items():
            raise MonitorViolated(
                f'monitor "{name}" has judged nothing since its condition raised {error!r}'
            ) from error
        if self.violations:
            more = sum(self.counts.values()) - 1
            raise MonitorViolated(f"{self.violations[0]}" + (f"\n(and {more} more)" if more else ""))

    # --- where they listen ------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        vars(self._run).setdefault("_monitors", []).append(self)  # there they last as long as it does
        self._engine.callbacks.glanced.append(self._glance)
        self._run.trace(self._changed, changes_only=True)

    def _glance(self) -> list[tuple[str, str, int]]:
        return [(name, one.judge.verdict.value, self.counts.get(name, 0)) for name, one in self._watches.items()]

    def _add(self, properties: Mapping[str, Property], on_violation: OnViolation) -> None:
        """Judge these, too, from now on; all of them, or none if one is refused."""
        self._find_boxes()
        now = self.now()
        added = [_Watch(self, name, what, now, on_violation) for name, what in properties.items()]
        looks = [
            (one, self._port(port) if isinstance(port, str) else port, look)
            for one in added
            for port, look in one.looks()
        ]
        for one, port, look in looks:
            one.ends.append(self._run._parts.taps.look(port, _Looker(look)))
        for one in added:
            one.learn(set(self._run.active()) - self._boxes)
            self._watches[one.name] = one
        self._plan()

    def _remove(self, name: str) -> None:
        """Judge one no more."""
        self._watches.pop(name).give_up()
        self.counts.pop(name, None)  # one of this name that comes later says its own

    def _port(self, path: str) -> Any:
        found = self._run.graph[path]
        if not hasattr(found, "kind"):
            raise UsageError(
                f'"{path}" is not a port: sent() takes one, such as "{path}.out"; active() and fired() a node'
            )
        return found

    def _find_boxes(self) -> None:
        """Subgraphs have no activity of their own: theirs is that of the nodes inside (G2)."""
        self._boxes = frozenset(worker.path for worker in self._engine.core.workers if worker.scope is not None)

    def _need_node(self, path: str) -> None:
        workers = self._engine.core.workers
        if not any(worker.path == path or worker.path.startswith(path + "/") for worker in workers):
            known = [worker.path for worker in workers if worker.node is not None]
            raise GraphError(f'there is no node "{path}" in this process; {suggest(path, known)}')

    def _changed(self, event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged):
            if event.node not in self._boxes:
                for one in self._watches.values():
                    one.activity(event.node, event.active)
        elif isinstance(event, StructureChanged):
            self._find_boxes()
        elif isinstance(event, RunEnded):
            self._end()

    # --- time ---------------------------------------------------------------------------------------------------------

    def _plan(self) -> None:
        """Wake up right after the next deadline. This keeps no run alive: the engine does not know of it."""
        due = min((one.judge.due for one in self._watches.values()), default=math.inf)
        if due >= self._alarm or due == math.inf:  # an earlier alarm plans the next one
            return
        if self._timer is not None:
            self._timer.cancel()
        self._alarm = due
        loop = self._engine.loop
        self._timer = loop.call_at(loop.time() + (due - self.now()) + _JUST_AFTER_S, self._ring)

    def _ring(self) -> None:
        self._timer, self._alarm = None, math.inf
        for one in list(self._watches.values()):
            one.pass_to(self.now())
        self._plan()

    def _end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        for one in self._watches.values():
            one.pass_to(self.now())

    # --- what is found ------------------------------------------------------------------------------------------------

    def _violated(self, one: _Watch, t: float) -> None:
        stretch = tuple(Seen(at - self.began, what, value) for at, what, value in one.ring)
        violation = Violation(one.name, str(one.what), t - self.began, stretch)
        count = self.counts[one.name] = self.counts.get(one.name, 0) + 1
        if count <= _MOST:
            self.violations.append(violation)
            _LOGGER.warning("%s", violation)
        if one.on_violation == "fail":
            self._engine.finish("failed", MonitorViolated(str(violation)))
            return
        self._report(violation, count)
        if callable(one.on_violation):
            one.on_violation(violation)

    def _report(self, violation: Violation, count: int) -> None:
        """Let the report of the run have the first violation of a monitor, and how many there were."""
        if count == 1:
            self._errors[violation.monitor] = MonitorViolated(str(violation))
            self._engine.core.errors.append(self._errors[violation.monitor])
        else:
            error = self._errors[violation.monitor]
            first = next(one for one in self.violations if one.monitor == violation.monitor)
            error.args = (f"{first}\n(and {count - 1:,} more of this monitor)",)

    def _break(self, one: _Watch, error: Exception) -> None:
        self.broken[one.name] = error
        _LOGGER.warning('monitor "%s" judges nothing more, because its condition raised %r', one.name, error)
        one.give_up()


def _clock(epoch: float) -> Callable[[], float]:
    """Return the clock of a run on the real clock, as the loop has it, with one call less."""
    return lambda: monotonic() + epoch


class _Looker:
    """Sees the tokens of one port for one monitor."""

    def __init__(self, put: Callable[[Token[Any]], None]) -> None:
        self.put = put

    def end(self) -> None:
        """See `Looker` of the engine."""


class _Watch:
    """One monitor: its judge, the truth of each atom at present, and the last points."""

    def __init__(self, monitors: Monitors, name: str, what: Property, began: float, on_violation: OnViolation) -> None:
        self.name = name
        self.what = what
        self.on_violation = on_violation
        self.judge: Judge = what.judge(began)
        self.ring: deque[tuple[float, str, object]] = deque(maxlen=_STRETCH)
        self.ends: list[Callable[[], None]] = []
        self._monitors = monitors
        self._truths = [False] * len(self.judge.atoms)
        self._looks_ahead = what.answer is not None
        self._inside: dict[int, set[str]] = {}  # by atom: which nodes are active that count for it
        for number, atom in enumerate(self.judge.atoms):
            if isinstance(atom, Active | Fired):
                monitors._need_node(atom.node)
            if isinstance(atom, Active):
                self._inside[number] = set()

    def looks(self) -> list[tuple[Any, Callable[[Token[Any]], None]]]:
        """Return the ports that it names, each with what is to see its tokens: one point for all that name it."""
        found: dict[str, list[tuple[int, Callable[[Any], object] | None]]] = {}
        for number, atom in enumerate(self.judge.atoms):
            if isinstance(atom, Sent):
                found.setdefault(atom.port, []).append((number, atom.when))
            elif isinstance(atom, Fired):
                found.setdefault(f"{atom.node}.processed", []).append((number, None))
        return [(port, self._look(port, atoms)) for port, atoms in found.items()]

    def _age(self, number: int) -> float | None:
        """Return how old a token must be for an atom; exactly that old is not older, whatever is lost by rounding."""
        atom = self.judge.atoms[number]
        is_aged = isinstance(atom, Sent) and atom.older_than_s is not None
        return atom.older_than_s + _JUST_AFTER_S if is_aged else None  # type: ignore[union-attr,operator]

    def _look(self, port: str, atoms: list[tuple[int, Callable[[Any], object] | None]]) -> Callable[[Token[Any]], None]:
        truths, append, point, now = self._truths, self.ring.append, self.judge.point, self._monitors.now
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
                self._monitors._break(self, error)
                return
            t = now()
            for number, older in ages:
                truths[number] = truths[number] and t - token.stamp > older
            append((t, port, value if kind in _KEPT else kind))
            if point(t, *truths):
                self._monitors._violated(self, t)
            if self._looks_ahead:
                self._monitors._plan()
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
            t = self._monitors.now()
            self.ring.append((t, path, active))
            if self.judge.point(t, *self._truths):
                self._monitors._violated(self, t)
            if self._looks_ahead:
                self._monitors._plan()

    def pass_to(self, t: float) -> None:
        """Time has passed without a point."""
        if self.judge.pass_to(t):
            self._monitors._violated(self, t)

    def give_up(self) -> None:
        """Judge nothing more, since a condition has raised."""
        for end in self.ends:
            end()
        self._inside.clear()
        self.judge.give_up()


def monitors_of(run: Run) -> tuple[Monitors, ...]:
    """Return all monitors of a run, in this process."""
    return tuple(vars(run).get("_monitors", ()))


def watch(run: Run, *, on_violation: OnViolation = "note", **properties: Property) -> Monitors:
    """Judge properties of a run from now on; call it in `begin=` to judge all of it.

    Args:
      run: what is judged.
      on_violation: "note" logs each violation and keeps it; "fail" ends the run with it; a function is called with it.
      properties: what is to hold, by the name of its monitor.

    Returns:
      What they have found; it stays valid after the run.

    Raises:
      UsageError: something is not a property, or a path is not that of a port.
      GraphError: there is no such node or port.

    Examples:
      >>> from collections.abc import Iterator
      >>> import hfg
      >>> from hfg import monitors as m
      >>> @hfg.node
      ... def countdown() -> Iterator[int]:
      ...     yield from (3, 2, 1)
      >>> @hfg.node
      ... def start(left: int) -> None:
      ...     pass
      >>> graph = hfg.Graph()
      >>> source = graph.add(countdown())
      >>> graph.connect(source.out, graph.add(start()).left)
      <edge countdown.out -> start.left>
      >>> found = []
      >>> low = m.sent(source.out, lambda left: left < 2)
      >>> report = hfg.run(graph, begin=lambda run: found.append(m.watch(run, low=m.never(low))))
      >>> [(violation.monitor, violation.stretch[-1].value) for violation in found[0].violations]
      [('low', 1)]
    """
    for name, what in properties.items():
        if not isinstance(what, Property):
            raise UsageError(
                f'monitor "{name}" needs a property, such as always(formula) or never(formula), got {what!r}'
            )
    if on_violation not in ("note", "fail") and not callable(on_violation):
        raise UsageError(f'on_violation is "note", "fail" or a function that takes a Violation, got {on_violation!r}')
    monitors = Monitors(run)
    monitors._add(properties, on_violation)
    monitors._listen()
    return monitors
