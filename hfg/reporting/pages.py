"""The page of a run in progress: it observes the run from its start, and writes its file when the run is over.

Depends on `observing`, `html` and the engine.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any, Final

from hfg.base.logs import Log
from hfg.base.whole import need_writable, write_whole
from hfg.engine import Run, VirtualTimeLoop
from hfg.errors import UsageError
from hfg.monitors.watching import monitors_of
from hfg.reporting.drawn import Drawn
from hfg.reporting.html import Page
from hfg.reporting.observing import Observed
from hfg.reporting.sections import Sections
from hfg.trace import RunEnded, TraceEvent

_LOG = Log("hfg.engine")
_MOST_PICTURES: Final = 1000
_LONGEST_SIDE: Final = 4096


class ReportPage(Sections):
    """A page about a run; `run.report_page` makes it.

    Attributes:
      path: path of the file.
      error: why the file could not be written at the end; None if it was written.
    """

    def __init__(self, run: Run, path: Path, observed: Observed, say_when: bool) -> None:
        super().__init__(f'the report of graph "{run.graph.name}"')
        self.path = path
        self.error: OSError | None = None
        self._run = run
        self._observed = observed
        self._when = time.time() if say_when else None
        # Drawn now: when a run is interrupted, there is no time for it at the end.
        self._drawn = Drawn(run.graph)
        self._edits = 0
        self._outcome: str | None = None

    def __call__(self, event: TraceEvent) -> None:
        """Process one event of the run."""
        self._observed(event)
        if isinstance(event, RunEnded):
            self._outcome = event.outcome
            self.write()

    def write(self) -> None:
        """Write the page with the run so far. Also called at the end of the run.

        A full disk is logged and recorded in `error`.
        """
        try:
            write_whole(self.path, lambda file: file.write(self.text().encode(errors="replace")))
            self.error = None
        except OSError as error:
            self.error = error
            _LOG.error('the report "%s" cannot be written: %s', self.path, error.strerror)

    def text(self) -> str:
        """Return the page with the run so far."""
        run, observed = self._run, self._observed
        if observed.edits != self._edits:
            self._edits, self._drawn = observed.edits, Drawn(run.graph)
        refused = {path: one.reason for path, one in run.explain().items() if one.refused}
        return Page(
            run.graph,
            self._drawn,
            observed,
            run.report(),
            run.statistics(),
            run.error,
            self._outcome,
            self._when,
            self.sections(),
            refused,
            monitors_of(run),
        ).text()


def report_page(run: Run, file: str | os.PathLike[str], *, pictures: int, picture_size: int) -> ReportPage:
    """Implement `Run.report_page`, which documents the arguments."""
    title = f'the report of graph "{run.graph.name}"'
    if not isinstance(file, str | os.PathLike):
        raise UsageError(f'{title} needs a file, as in run.report_page("run.html"), got {file!r:.80}')
    path = Path(file)
    _need_whole(title, "pictures", pictures, 0, _MOST_PICTURES)
    _need_whole(title, "picture_size", picture_size, 16, _LONGEST_SIDE)
    try:
        need_writable(path)  # better reported now than when the run is over
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else error
        raise UsageError(
            f'{title} cannot be written to "{path}": {said}; name a file in a folder that you can write to'
        ) from error
    run.statistics()  # starts the measuring of times
    made = ReportPage(run, path, Observed(pictures, picture_size), say_when=not _is_virtual(run))
    run.trace(made)
    return made


def _is_virtual(run: Run) -> bool:
    loop: Any = run._engine.loop
    return isinstance(loop, VirtualTimeLoop)


def _need_whole(title: str, name: str, value: object, least: int, most: int) -> None:
    if type(value) is not int or not least <= value <= most:
        raise UsageError(f"{title}: {name}= must be an integer from {least} to {most}, got {value!r}")
