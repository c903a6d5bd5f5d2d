"""Judges a run by the monitors and facts that its graph declares; they follow edits.

Depends on `watching` and `facts`.
"""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.errors import HfgError, UsageError
from hfg.graph.structure.level import Whole
from hfg.graph.structure.options import MonitorSpec
from hfg.monitors.facts import watch_facts
from hfg.monitors.violations import Violation
from hfg.monitors.watching import Monitors, monitors_of
from hfg.types import accepts

_LOGGER = Log("hfg.monitors")


def declared(run: Run) -> Monitors:
    """Return what the monitors have found that the graph of a run declares.

    Raises:
      UsageError: its graph declares none.
    """
    found = next((one for one in monitors_of(run) if one.are_declared), None)
    if found is None:
        raise UsageError(
            f'graph "{run.graph.name}" declares no monitor: write graph.monitor("dark", monitors.never(...)), or call '
            "monitors.watch(run, dark=...)"
        )
    return found


def judge(run: Run, whole: Whole) -> None:
    """Begin to judge a run by monitors, and in debug runs by facts, and follow edits; see `Whole.begin_run`.

    The main part of a run judges by the monitors; facts are checked in the part that has their nodes.
    """
    judging: _Declared | None = None
    checks_facts = run._engine.settings.debug

    def follow() -> None:
        nonlocal judging, checks_facts
        if whole.monitors and judging is None and not run._is_part:
            judging = _Declared(run, whole)
        if judging is not None:
            judging.follow()
        if whole.facts and checks_facts:
            checks_facts = False  # from now on they follow edits themselves
            watch_facts(run)

    whole.on_laws = follow
    follow()


class _Declared:
    """The monitors of a graph in one run."""

    def __init__(self, run: Run, whole: Whole) -> None:
        self.monitors = Monitors(run, are_declared=True)
        self.monitors._listen()
        self._run = run
        self._whole = whole
        self._specs: dict[str, MonitorSpec] = {}
        self._sending: set[asyncio.Task[None]] = set()

    def follow(self) -> None:
        """Judge by what is declared now. A changed monitor starts over."""
        wanted = self._whole.monitors
        for name, spec in list(self._specs.items()):
            if wanted.get(name) != spec:
                self.monitors._remove(name)
                del self._specs[name]
        for name, spec in wanted.items():
            if name not in self._specs:
                act = partial(self._trigger, spec.triggers) if spec.triggers else spec.on_violation
                self.monitors._add({name: spec.property}, act)
                self._specs[name] = spec

    def _trigger(self, path: str, violation: Violation) -> None:
        """Trigger a slot or event. The run stays open until the signal is there."""
        engine = self._run._engine
        engine.quiet.hold()
        task = asyncio.ensure_future(self._send(path, violation))
        self._sending.add(task)
        task.add_done_callback(self._sending.discard)
        task.add_done_callback(lambda _: engine.quiet.unhold())

    async def _send(self, path: str, violation: Violation) -> None:
        try:
            port: Any = self._run.graph[path]
            await self._run.trigger(port, str(violation) if accepts("", port.type) else None)
        except (HfgError, TypeError) as error:
            _LOGGER.warning('monitor "%s" could not trigger "%s": %s', violation.monitor, path, error)
