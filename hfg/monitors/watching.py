"""Lets properties be judged while a run is in progress.

Each port that a formula names gets a tap, and only changes of activity are traced. So fused regions stay fused, and a
node that no formula names pays nothing. Depends on `properties`, `violations` and the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any, Final

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.engine.observing.consumers import Listener
from hfg.errors import GraphError, MonitorViolated, RunError, UsageError
from hfg.graph.structure.naming import suggest
from hfg.monitors.gathering import EVERY_S, Gathered, Known, Witness, here_and_now, is_afar
from hfg.monitors.listening import JUST_AFTER_S, Looker, OnViolation, Watch
from hfg.monitors.margins import MarginJudge
from hfg.monitors.properties import Property, Verdict
from hfg.monitors.violations import Point, Seen, Violation
from hfg.trace import ActivityChanged, RunEnded, StructureChanged, TraceEvent

_LOGGER = Log("hfg.monitors")
_MOST: Final = 100  # violations of a monitor that are kept; the others are counted


class Monitors:
    """The monitors of one run.

    Attributes:
      violations: each time at which a property has ceased to hold, in order; of each monitor the first 100.
      counts: how often each was violated, by the name of its monitor.
      broken: by monitor, the error of a condition that raised; such a monitor judges nothing more.
      gaps: by monitor, why it is not known whether it held all the time: a text for each process that has died.
      began: when they began, on the run's clock.
      now: returns the time on the run's clock.
      are_declared: the graph declares them.
    """

    def __init__(self, run: Run, *, are_declared: bool = False) -> None:
        self.are_declared = are_declared
        self.violations: list[Violation] = []
        self.counts: dict[str, int] = {}
        self.broken: dict[str, Exception] = {}
        self.gaps: dict[str, list[str]] = {}
        self._run = run
        self._engine = run._engine
        self.now = self._engine.now if self._engine.time.epoch is None else _clock(self._engine.time.epoch)
        self.began = self.now()
        self._watches: dict[str, Watch] = {}
        self._errors: dict[str, MonitorViolated] = {}
        self._timer: Any = None
        self._alarm = math.inf
        self._boxes: frozenset[str] = frozenset()

    @property
    def verdicts(self) -> dict[str, Verdict]:
        """What is known of each property, by the name of its monitor."""
        return {name: one.verdict for name, one in self._watches.items()}

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
          MonitorViolated: one was, a condition has raised, or a process has died; the message has the stretch of points
            that shows it.
        """
        for said in self.unknown():
            raise MonitorViolated(said) from next(iter(self.broken.values()), None)
        if self.violations:
            more = sum(self.counts.values()) - 1
            raise MonitorViolated(f"{self.violations[0]}" + (f"\n(and {more} more)" if more else ""))

    def unknown(self) -> list[str]:
        """Return why it is not known whether a property holds, a text for each reason."""
        raised = [
            f'monitor "{name}" has judged nothing since its condition raised {error!r}'
            for name, error in self.broken.items()
        ]
        return raised + [said for gaps in self.gaps.values() for said in gaps]

    # --- where they listen ------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        vars(self._run).setdefault("_monitors", []).append(self)  # there they last as long as it does
        self._engine.callbacks.glanced.append(self._glance)
        self._hear()

    def _hear(self) -> Listener:
        """Follow activity in this part of the run."""
        return self._run._parts.consumers.add(self._changed, changes_only=True)

    def _glance(self) -> list[tuple[str, str, int]]:
        return [(name, one.verdict.value, self.counts.get(name, 0)) for name, one in self._watches.items()]

    def _add(self, properties: Mapping[str, Property], on_violation: OnViolation) -> None:
        """Judge these, too, from now on; all of them, or none if one is refused."""
        afar, now = self._run._afar, self.now()
        added = [
            Gathered(self, afar, name, what, now, on_violation)
            if afar is not None and is_afar(afar, what)
            else Watch(self, name, what, now, on_violation)
            for name, what in properties.items()
        ]
        self._begin(added)

    def _begin(self, added: list[Watch]) -> None:
        self._find_boxes()
        looks = [
            (one, self._port(port) if isinstance(port, str) else port, look)
            for one in added
            for port, look in one.looks()
        ]
        for one, port, look in looks:
            one.ends.append(self._run._parts.taps.look(port, Looker(look)))
        for one in added:
            one.learn(set(Run.active(self._run)) - self._boxes)  # those of this part
            self._watches[one.name] = one
        self.plan()

    def _remove(self, name: str) -> None:
        """Judge one no more."""
        self._watches.pop(name).give_up()
        for said in (self.counts, self.broken, self.gaps):
            said.pop(name, None)  # one of this name that comes later says its own

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

    def need_node(self, path: str) -> None:
        """See `Owner`."""
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

    def plan(self) -> None:
        """See `Owner`. Wake up right after the next deadline; it keeps no run alive, as the engine does not know it."""
        due = min((one.due for one in self._watches.values()), default=math.inf)
        if due >= self._alarm or due == math.inf:  # an earlier alarm plans the next one
            return
        if self._timer is not None:
            self._timer.cancel()
        self._alarm = due
        loop = self._engine.loop
        self._timer = loop.call_at(loop.time() + (due - self.now()) + JUST_AFTER_S, self._ring)

    def _ring(self) -> None:
        self._timer, self._alarm = None, math.inf
        for one in list(self._watches.values()):
            one.pass_to(self.now())
        self.plan()

    def _end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        for one in self._watches.values():
            one.end(self.now())

    # --- what is found ------------------------------------------------------------------------------------------------

    def violated(self, one: Watch, t: float) -> None:
        """See `Owner`."""
        stretch = tuple(Seen(at - self.began, what, value) for at, what, value in one.ring)
        violation = Violation(one.name, str(one.what), t - self.began, stretch)
        count = self.counts[one.name] = self.counts.get(one.name, 0) + 1
        if count <= _MOST:
            self.violations.append(violation)
            _LOGGER.warning("%s", violation)
        if one.on_violation == "fail":
            self._fail(MonitorViolated(str(violation)))
            return
        self._report(violation, count)
        if callable(one.on_violation):
            one.on_violation(violation)

    def _fail(self, error: MonitorViolated) -> None:
        engine = self._engine
        if engine.ended_how is None:
            engine.finish("failed", error)
        elif engine.error is None:  # the last points came when the run was over
            engine.ended_how = ("failed", error)

    def _report(self, violation: Violation, count: int) -> None:
        """Let the report of the run have the first violation of a monitor, and how many there were."""
        if count == 1:
            self._errors[violation.monitor] = MonitorViolated(str(violation))
            self._engine.core.errors.append(self._errors[violation.monitor])
        else:
            error = self._errors[violation.monitor]
            first = next(one for one in self.violations if one.monitor == violation.monitor)
            error.args = (f"{first}\n(and {count - 1:,} more of this monitor)",)

    def broken_by(self, one: Watch, error: Exception) -> None:
        """See `Owner`."""
        self.broken[one.name] = error
        _LOGGER.warning('monitor "%s" judges nothing more, because its condition raised %r', one.name, error)
        one.give_up()

    # --- points of other parts --------------------------------------------------------------------------------------

    def gather(self, ask: Callable[[], None]) -> None:
        """See `Gatherer`."""
        engine = self._engine
        engine.quiet.hold()
        if engine.virtual:
            engine.loop.call_soon(ask)
        else:
            engine.loop.call_later(EVERY_S, ask)

    def gathered(self) -> None:
        """See `Gatherer`."""
        self._engine.quiet.unhold()
        self.plan()

    def unknown_since(self, one: Gathered, since: float, why: str) -> None:
        """See `Gatherer`."""
        said = f'monitor "{one.name}" is not known since {since - self.began:.6g} s: {why}'
        self.gaps.setdefault(one.name, []).append(said)
        self._engine.core.errors.append(RunError(said))
        _LOGGER.warning("%s", said)


class Witnessing(Monitors):
    """A monitor of the main part, as far as this part of the run hears for it."""

    def __init__(self, run: Run, atoms: Mapping[int, str], tell: Callable[[Point], None]) -> None:
        """Begin to hear.

        Args:
          run: of this part.
          atoms: what is to be heard, as text, by number.
          tell: takes each point.

        Raises:
          HfgError: an atom is malformed, or what it names is not there.
        """
        super().__init__(run)
        self._tell = tell
        self._error: Exception | None = None
        self._witness = Witness(tell, self, atoms)
        self._begin([self._witness])
        self._listener = self._hear()

    def known(self) -> Known:
        """Return up to when all points are sent.

        Raises:
          UsageError: a condition has raised, so nothing more is heard.
        """
        if self._error is not None:
            raise UsageError(f"its condition raised {self._error!r}")
        return here_and_now(self.now())

    def broken_by(self, one: Watch, error: Exception) -> None:
        """See `Monitors`; the main part asks when a point comes, and hears of it then."""
        self._error = error
        one.give_up()
        self._tell(Point(*here_and_now(self.now()), "", None, []))

    def leave(self) -> None:
        """Hear nothing more."""
        self._witness.give_up()
        self._listener.remove()


def _clock(epoch: float) -> Callable[[], float]:
    """Return the clock of a run on the real clock, as the loop has it, with one call less."""
    return lambda: monotonic() + epoch


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
