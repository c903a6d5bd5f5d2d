"""A mission from its beginning to its end: under a bar of progress, until its time is over or it is stopped."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import hfg
from examples.fetch_delivery.world import Score
from hfg.errors import HfgError

EVERY_S = 0.5  # of the arena's time, the bar moves on and the clock on the wall is looked at

Outcome = Literal["over", "late", "interrupted", "failed"]


@dataclass(frozen=True)
class Result:
    """How a mission went.

    Attributes:
      outcome: its time was "over", it was "late" by the clock on the wall, "interrupted" by Ctrl-C, or it "failed".
      simulated_s: how long it has run in the arena.
      took_s: how long that has taken.
      processor_s: CPU time of the run.
      scores: one for each robot; none if it failed before it began.
      error: a sentence, if it failed.
    """

    outcome: Outcome
    simulated_s: float
    took_s: float
    processor_s: float
    scores: Sequence[Score]
    error: str = ""

    def __str__(self) -> str:
        """Say it: a line for each robot, and one for the time."""
        lines = [f"robot {number}: {score}" for number, score in enumerate(self.scores)]
        speed = self.simulated_s / max(self.took_s, 1e-9)
        alone = self.simulated_s / max(self.processor_s, 1e-9)
        how = {"late": ", stopped because it got late", "interrupted": ", interrupted", "failed": ", then it failed"}
        minutes = f"{self.simulated_s / 60:.3g} minutes in {self.took_s:.0f} s, {speed:.1f} times real time"
        # What else the machine does slows the clock's figure down, and hardly that of the processor.
        minutes += f" ({alone:.1f} times by {self.processor_s:.0f} s of processor time)"
        return "\n".join([*lines, minutes + how.get(self.outcome, "")])


def carry_out(
    graph: hfg.Graph,
    seconds: float,
    *,
    clock: Literal["virtual", "real"] = "virtual",
    within_s: float | None = None,
    begin: Callable[[hfg.Run], object] | None = None,
) -> Result:
    """Run a mission. Neither Ctrl-C nor an error of the graph is raised: the result says it.

    A request to end (SIGTERM) is treated like Ctrl-C.

    Args:
      graph: with the arena as its node `world`.
      seconds: how long, in the arena's time.
      clock: by which it runs; processes need the real one.
      within_s: end it earlier when that has taken so long on the wall's clock; None lets it take what it takes.
      begin: called with the run before it begins, to look at it.
    """
    world: Any = graph["world"]
    watch = _Watch(seconds, within_s, lambda: world.simulation)
    outcome: Outcome = "over"
    error = ""
    with watch.bar, _ends_like_ctrl_c(signal.SIGTERM):

        def both(run: hfg.Run) -> None:
            watch.begin(run)
            if begin is not None:
                begin(run)

        try:
            hfg.run(graph, clock=clock, until_s=seconds, begin=both, block_warning_s=0)
        except KeyboardInterrupt:
            outcome = "interrupted"
        except HfgError as problem:
            outcome, error = "failed", str(problem)
        finally:
            watch.end()
    if outcome == "over" and watch.is_late:
        outcome = "late"
    simulation = world.simulation
    scores = () if simulation is None else tuple(simulation.scores)
    simulated_s = 0.0 if simulation is None else simulation.now_s
    worked_s = _processor_s() - watch.worked
    return Result(outcome, simulated_s, time.monotonic() - watch.began, worked_s, scores, error)


def _processor_s() -> float:
    """Return how long processors have worked for this process, and for those of its own that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@contextmanager
def _ends_like_ctrl_c(number: signal.Signals) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # Python lets no other handle signals
        yield
        return
    before = signal.signal(number, lambda _number, _frame: signal.raise_signal(signal.SIGINT))
    try:
        yield
    finally:
        signal.signal(number, before)


class _Watch:
    """Checks a mission twice per second of its own time: timers of the loop cost nothing in between."""

    def __init__(self, seconds: float, within_s: float | None, simulation: Callable[[], Any]) -> None:
        self.began, self.worked = time.monotonic(), _processor_s()
        self.is_late = False
        console = Console(file=sys.stderr)
        columns = (
            BarColumn(),
            TextColumn("{task.completed:.0f} of {task.total:.0f} s"),
            TextColumn("{task.description}"),
        )
        self.bar = Progress(*columns, TimeElapsedColumn(), console=console, disable=not console.is_terminal)
        self._task = self.bar.add_task("", total=seconds)
        self._within_s = within_s
        self._simulation = simulation
        self._run: hfg.Run | None = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, run: hfg.Run) -> None:
        self._run = run
        self._timer = asyncio.get_running_loop().call_later(EVERY_S, self._look)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._show()

    def _look(self) -> None:
        assert self._run is not None
        self._show()
        if self._within_s is not None and time.monotonic() - self.began > self._within_s:
            self.is_late = True
            self._run.stop()
            return
        self._timer = asyncio.get_running_loop().call_later(EVERY_S, self._look)

    def _show(self) -> None:
        simulation = self._simulation()
        if simulation is not None:
            delivered = " + ".join(str(len(score.delivered)) for score in simulation.scores)
            self.bar.update(self._task, completed=simulation.now_s, description=f"{delivered} delivered")
