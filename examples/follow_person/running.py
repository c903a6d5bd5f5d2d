"""A run from its beginning to its end: under a bar of progress, until the person has walked far enough."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import hfg
from examples.follow_person.judging import Judge, Verdict
from examples.follow_person.world import Score
from hfg.errors import HfgError

EVERY_S = 0.1  # of the world's time, the judge looks

Outcome = Literal["over", "late", "interrupted", "failed"]


@dataclass(frozen=True)
class Result:
    """How a run went.

    Attributes:
      outcome: the person has walked far enough ("over"), it was "late" by the clock on the wall, "interrupted" by
        Ctrl-C, or it "failed".
      simulated_s: how long it has run in the world.
      took_s: how long that has taken.
      processor_s: processor time of the run.
      score: what happened in the world; None if it failed before it began.
      verdict: whether the robot followed the right person.
      error: a sentence, if it failed.
    """

    outcome: Outcome
    simulated_s: float
    took_s: float
    processor_s: float
    score: Score | None
    verdict: Verdict
    error: str = ""

    def __str__(self) -> str:
        """Say it in a few lines."""
        lines = []
        if self.score is not None:
            lines += [str(self.score), str(self.verdict)]
        how = {"late": ", stopped because it got late", "interrupted": ", interrupted", "failed": ", then it failed"}
        speed = self.simulated_s / max(self.took_s, 1e-9)
        alone = self.simulated_s / max(self.processor_s, 1e-9)
        lines.append(
            f"{self.simulated_s:.0f} s in {self.took_s:.0f} s, {speed:.1f} times real time "
            f"({alone:.1f} times by {self.processor_s:.0f} s of processor time){how.get(self.outcome, '')}"
        )
        return "\n".join(lines)


def carry_out(
    graph: hfg.Graph,
    *,
    within_s: float | None = None,
    begin: Callable[[hfg.Run, Judge], object] | None = None,
    until_s: float | None = None,
) -> Result:
    """Run it in virtual time. Neither Ctrl-C nor an error of the graph is raised: the result says it.

    Args:
      graph: with the world as its node `world`.
      within_s: end it earlier when it has taken so long; None lets it take what it takes.
      begin: called with the run before it begins, to look at it.
      until_s: end it then, in the world's time.
    """
    world: Any = graph["world"]
    watch = _Watch(graph, within_s)
    outcome: Outcome = "over"
    error = ""
    with watch.bar:

        def both(run: hfg.Run) -> None:
            watch.begin(run)
            if begin is not None:
                begin(run, watch.judge)

        try:
            hfg.run(graph, clock="virtual", begin=both, block_warning_s=0, until_s=until_s)
        except KeyboardInterrupt:
            outcome = "interrupted"
        except HfgError as problem:
            outcome, error = "failed", str(problem)
        finally:
            watch.end()
    if outcome == "over" and watch.is_late:
        outcome = "late"
    simulation = world.simulation
    return Result(
        outcome,
        0.0 if simulation is None else simulation.now_s,
        time.monotonic() - watch.began,
        _processor_s() - watch.worked,
        None if simulation is None else simulation.score,
        watch.judge.verdict(),
        error,
    )


def _processor_s() -> float:
    times = os.times()
    return times.user + times.system


class _Watch:
    """Looks ten times a second of the world's time; timers of the loop cost nothing in between."""

    def __init__(self, graph: hfg.Graph, within_s: float | None) -> None:
        self.began, self.worked = time.monotonic(), _processor_s()
        self.is_late = False
        self.judge = Judge(graph)
        console = Console(file=sys.stderr)
        columns = (BarColumn(), TextColumn("{task.completed:.0f} of {task.total:.0f} m"), TimeElapsedColumn())
        self.bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self._world: Any = graph["world"]
        self._task = self.bar.add_task("", total=self._world.metres)
        self._within_s = within_s
        self._run: hfg.Run | None = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, run: hfg.Run) -> None:
        self._run = run
        self._timer = asyncio.get_running_loop().call_later(EVERY_S, self._look)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _look(self) -> None:
        assert self._run is not None
        if self._world.simulation is not None:
            self.judge.look()
            self.bar.update(self._task, completed=self._world.simulation.score.walked_m)
        if self._within_s is not None and time.monotonic() - self.began > self._within_s:
            self.is_late = True
            self._run.stop()
            return
        if not self._world.is_over:
            self._timer = asyncio.get_running_loop().call_later(EVERY_S, self._look)
