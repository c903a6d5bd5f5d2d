"""The live table while a graph runs: four times a second a glance, drawn at the foot of the terminal.

Depends on `terminal`, `table` and the engine.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from hfg.cli.table import View
from hfg.cli.terminal import Foot, is_terminal
from hfg.engine import Run

EVERY_S: Final = 0.25


class Live:
    """Draws one run, from `begin` until `end`; without a foot, nothing."""

    def __init__(self, foot: Foot | None) -> None:
        self._foot = foot
        self._view = View()
        self._run: Run | None = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, run: Run) -> None:
        """Draw this run from now on; to be called on its loop."""
        if self._foot is not None:
            self._run = run
            self._view = View()
            self._view.look(run.glance())  # measuring begins, and rates have something to begin with
            self._again()

    def refresh(self) -> None:
        """Look and draw, unless the terminal takes nothing at the moment."""
        if self._run is not None and self._foot is not None and self._foot.is_ready():
            self._view.look(self._run.glance())
            columns, height = self._foot.size()
            self._foot.draw(self._view.lines(columns, height, coloured=self._foot.coloured))

    def end(self) -> None:
        """Draw no more."""
        if self._timer is not None:
            self._timer.cancel()

    def leave(self) -> None:
        """The process is about to be left: take the table away, from whatever thread."""
        if self._foot is not None:
            self._foot.leave()

    def _again(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(EVERY_S, self._tick)

    def _tick(self) -> None:
        self.refresh()
        self._again()


@contextmanager
def live_table(wanted: bool = True) -> Iterator[Live]:
    """Keep a table below what is printed inside the block; where there is no terminal for it, nothing happens.

    Examples:
      >>> import hfg
      >>> with live_table() as live:
      ...     report = hfg.run(hfg.Graph(), begin=live.begin)
    """
    if not wanted or not is_terminal(sys.stdout, sys.stderr):
        yield Live(None)
        return
    foot = Foot(sys.stderr)
    live = Live(foot)
    with foot.beneath():
        try:
            yield live
        finally:
            live.end()
