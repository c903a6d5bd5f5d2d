"""How things look on a terminal: one-sentence errors, tracebacks that begin in the user's code, tables, JSON.

Depends on rich and `encoding`; knows reports and problems, no verbs.
"""

from __future__ import annotations

import logging
import shlex
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

import msgspec

from hfg.base.clock import current_elapsed
from hfg.base.controls import escaped
from hfg.base.frames import is_machinery, is_standard
from hfg.errors import EngineInternalError, FileError, NodeError, TeardownError

if TYPE_CHECKING:
    from hfg.engine.fusion.explaining import Explanation
    from hfg.engine.observing.report import Report

_WIDTH_OF_A_FILE = 200
_debug = False
_arguments: Sequence[str] = ()


def set_arguments(arguments: Sequence[str]) -> None:
    """Remember how the command was called."""
    global _arguments  # one process, one command
    _arguments = arguments


def set_debug(debug: bool) -> None:
    """Show hfg's own frames too, from now on."""
    global _debug  # one process, one terminal
    _debug = debug


_logged: set[str] = set()
_MOST_LOGGED: Final = 1000
"""Warnings that were shown when they came; what a run reports at its end is not shown a second time."""


class Records:
    """Writes log records to standard error, whatever that is when they come: time, level, path, sentence.

    The user's own logging has the word: where the program has set some up, that shows what hfg tells, too.
    """

    def __init__(self, verbosity: int, debug: bool, *, virtual: bool = False) -> None:
        """Show those of hfg from now on: warnings, from verbosity 1 more; in virtual time with the run's seconds."""
        _logged.clear()
        self._handler = logging.StreamHandler(_StandardError())
        self._handler.setFormatter(_Line(virtual))
        self._hfg = logging.getLogger("hfg")
        self._hfg.setLevel(logging.DEBUG if debug else logging.INFO if verbosity else logging.WARNING)
        self._hfg.addHandler(self._handler)

    def loaded(self) -> None:
        """The user's program is there: unless it has handlers of its own, show the records of its loggers, too."""
        self._hfg.removeHandler(self._handler)
        root = logging.getLogger()
        if not root.handlers:
            root.addHandler(self._handler)


class _Line(logging.Formatter):
    """One record: the time of day, or of the run in virtual time, then where it comes from."""

    def __init__(self, virtual: bool) -> None:
        super().__init__("%(told)s %(levelname)s %(where)s: %(message)s")
        self._virtual = virtual

    def format(self, record: logging.LogRecord) -> str:
        if self._virtual:
            clock = current_elapsed.get()  # none where the run has not begun
            record.told = f"{0.0 if clock is None else clock():.3f} s"
        else:
            record.told = f"{self.formatTime(record, '%H:%M:%S')}.{int(record.msecs):03d}"
        record.where = getattr(record, "path", None) or record.name
        if record.levelno >= logging.WARNING and len(_logged) < _MOST_LOGGED:
            _logged.add(record.getMessage())
        return super().format(record)


class _StandardError:
    """Standard error as it is now: a live table stands in for it at times."""

    def write(self, text: str) -> None:
        write(text, to_stderr=True)

    def flush(self) -> None:
        sys.stderr.flush()


def write(text: str, *, to_stderr: bool = False) -> None:
    """Write a text to standard output; whatever verbs write comes by here, so that no name or value steers a terminal.

    Output of nodes does not come by here.
    """
    (sys.stderr if to_stderr else sys.stdout).write(escaped(text))


def sentence(text: str) -> None:
    """Write one sentence to standard error."""
    with suppress(OSError):  # the terminal is gone
        write(f"hfg: {text}\n", to_stderr=True)


def wants(error: FileError) -> None:
    """Say which command lets a graph file import what it wants to."""
    if error.wants:
        allowed = [part for module in error.wants for part in ("--allow", module)]
        command = shlex.join(["hfg", *_arguments, *allowed])
        sentence(f"it wants to run code of {', '.join(error.wants)}; if you trust that: {command}")


def failure(error: BaseException) -> None:
    """Tell what went wrong in a run: the user's frames first, then the sentence."""
    for one in error.errors if isinstance(error, TeardownError) else [error]:
        if isinstance(one, NodeError) or _debug:
            user_traceback(one.__cause__ or one)
        elif isinstance(one, EngineInternalError):
            write("".join(traceback.format_exception(one)), to_stderr=True)
        sentence(str(one))


def user_traceback(error: BaseException | None) -> None:
    """Write a traceback without the frames of hfg and of what lies between it and the user's code."""
    if error is None:
        return
    shown = traceback.TracebackException.from_exception(error)
    if not _debug:
        _filter(shown)
        if _is_empty(shown):
            return  # nothing of the user's in it, and its sentence follows
    write("".join(shown.format()), to_stderr=True)


def _filter(shown: traceback.TracebackException) -> None:
    kept: list[traceback.FrameSummary] = []
    ours = False
    for frame in shown.stack:
        # Calls of Python's library by hfg belong to hfg.
        ours = is_machinery(frame.filename) or (ours and is_standard(frame.filename))
        if not ours:
            kept.append(frame)
    shown.stack = traceback.StackSummary.from_list(kept)
    for other in (shown.__cause__, shown.__context__, *(shown.exceptions or ())):
        if other is not None:
            _filter(other)
    # If hfg has replaced the error, the other one reports it.
    if shown.__cause__ is not None and _is_empty(shown.__cause__):
        shown.__cause__, shown.__suppress_context__ = None, True
    if shown.__context__ is not None and _is_empty(shown.__context__):
        shown.__context__ = None


def _is_empty(shown: traceback.TracebackException) -> bool:
    """Whether a filtered error has no frame of the user's, nor of what led to it; a wrong line of code is one."""
    return not (
        shown.stack
        or shown.__cause__
        or (shown.__context__ and not shown.__suppress_context__)
        or shown.exceptions
        or issubclass(shown.exc_type, SyntaxError)
    )


def json(value: Any) -> None:
    """Write JSON to standard output, indented for people."""
    from hfg.engine.observing.encoding import encode

    write(msgspec.json.format(encode(value), indent=2).decode() + "\n")


def table(title: str, columns: Iterable[str], rows: Iterable[Iterable[Any]], *, to_stderr: bool = False) -> None:
    """Write a table; numbers stand to the right."""
    from rich.console import Console  # most verbs draw none
    from rich.table import Table
    from rich.text import Text

    cells = [[escaped(str(cell)) for cell in row] for row in rows]
    drawn = Table(title=Text(escaped(title)), title_justify="left", title_style="bold", box=None, pad_edge=False)
    for index, column in enumerate(columns):
        numbers = bool(cells) and all(row[index].replace(".", "").isdigit() for row in cells)
        drawn.add_column(column, justify="right" if numbers else "left", overflow="fold")
    for row in cells:
        drawn.add_row(*map(Text, row))
    stream = sys.stderr if to_stderr else sys.stdout
    Console(file=stream, width=None if stream.isatty() else _WIDTH_OF_A_FILE).print(drawn)


def explanations(found: Mapping[str, Explanation]) -> None:
    """Tell on standard error how each node did its work: fused, with which others, or why not."""
    rows = []
    first: dict[tuple[str, ...], str] = {}
    for path, one in found.items():
        head = first.setdefault(one.members, path) if one.fused else ""
        same = f", see {head}" if head not in ("", path) else ""
        others = (
            "" if same or len(one.members) < 2 else f": {', '.join(member for member in one.members if member != path)}"
        )
        rows.append((path, f"{one}{same}{others}"))
    table("how nodes did their work", ("node", "how"), rows, to_stderr=True)


def report(name: str, result: Report, verbosity: int) -> None:
    """Tell on standard error how a run went: a line; from verbosity 1 its nodes, from 2 its edges."""
    for error in result.errors:
        if error not in _logged:
            sentence(error)
    sentence(f'graph "{name}": {result.outcome} after {result.duration_s:.3f} s, {result.firings} firings')
    if result.lost_activity:
        sentence(f'graph "{name}": activity was lost {result.lost_activity} times')
    if verbosity:
        nodes = [
            (
                path,
                node.firings,
                node.silent,
                node.calls,
                node.failed,
                "yes" if node.active else "",
                "yes" if node.ended else "",
            )
            for path, node in result.nodes.items()
        ]
        table("nodes", ("node", "firings", "silent", "calls", "failed", "active", "ended"), nodes, to_stderr=True)
    edges = [
        (label, edge.sent, edge.dropped, edge.lost, edge.drained, edge.untaken, edge.grown)
        for label, edge in result.edges.items()
        if verbosity > 1 or edge.dropped or edge.lost or edge.grown
    ]
    if verbosity and edges:
        table("edges", ("edge", "sent", "dropped", "lost", "drained", "untaken", "grown"), edges, to_stderr=True)
