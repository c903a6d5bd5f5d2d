"""`hfg run TARGET`: runs a graph to its end and tells how it went.

Stands on `execute`, `live`, `target`, `settings`, `interrupt` and `show`.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, TextIO

import typer

from hfg.base.whole import GrowingFile
from hfg.cli import show
from hfg.cli.execute import execute
from hfg.cli.interrupt import Interrupt
from hfg.cli.live import live_table
from hfg.cli.options import (
    AllowOption,
    ArgOption,
    Clock,
    ClockOption,
    DebugOption,
    ParamOption,
    SettingsOption,
    TargetArgument,
    UntilOption,
    VerboseOption,
    with_run_options,
)
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import Run
from hfg.engine.observing.encoding import encode
from hfg.engine.observing.report import RunPage
from hfg.engine.runtime.interrupt import named
from hfg.errors import HfgError, TargetError
from hfg.graph import Graph
from hfg.timeline import Timeline
from hfg.trace import TraceEvent

__all__ = ["run"]

_TRACES: Final = ("", ".jsonl", ".json")


@with_run_options
def run(
    target: TargetArgument,
    clock: ClockOption = Clock.real,
    until: UntilOption = None,
    param: ParamOption = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    settings: SettingsOption = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write every event of the run, one JSON object per line; to a .json file, a timeline for Perfetto.",
        ),
    ] = None,
    report_file: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="FILE",
            help="Write a report page, one HTML file: drawing, activity, counts, images.",
        ),
    ] = None,
    pictures: Annotated[int, typer.Option(metavar="N", help="With --report: show at most N images.")] = 24,
    table: Annotated[bool, typer.Option(help="Show a live table of nodes (on a terminal and the real clock).")] = True,
    json: Annotated[
        bool, typer.Option("--json", help="Write the report as JSON. Output of nodes goes to standard error.")
    ] = False,
    debug: DebugOption = False,
    verbose: VerboseOption = 0,
    **options: Any,  # those that declare a flag
) -> int:
    """Run a graph. Ctrl-C stops it; a second Ctrl-C stops it immediately."""
    show.set_debug(debug)
    records = show.Records(verbose, debug, virtual=clock is Clock.virtual)
    graph = load_graph(target, arg or [], allow)
    records.loaded()
    set_parameters(graph, param or [])
    interrupt = Interrupt.current or Interrupt()
    output = _Output(sys.stdout)
    unwritten: list[str] = []
    with (
        redirect_stdout(sys.stderr if json else output),
        _writing(trace, graph, interrupt, unwritten) as write,
        live_table(table and not json and clock is Clock.real) as live,
    ):
        interrupt.before_leaving.append(live.leave)

        pages: list[RunPage] = []

        def begin(run: Run) -> None:
            output.when_broken = partial(asyncio.get_running_loop().call_soon_threadsafe, run.stop)
            if report_file is not None:
                pages.append(run.report_page(report_file, pictures=pictures))
                interrupt.before_leaving.append(pages[0].write)
            live.begin(run)

        report, error = execute(
            graph,
            target,
            clock,
            interrupt,
            begin,
            until_s=until,
            debug=debug,
            trace=write,
            settings=settings,
            **options,
        )
    for page in pages:
        if page.error is not None:
            show.sentence(f'the report "{page.path}" cannot be written: {page.error.strerror}')
            unwritten.append(str(page.path))
    if output.broken is not None:
        raise output.broken
    if json and report is not None:
        show.json(report)
    if error is None and report is not None and not interrupt.count and (not json or verbose):
        show.report(graph.name, report, verbose)
    return _ended(graph, error, interrupt) or (1 if unwritten else 0)


def _ended(graph: Graph, error: HfgError | None, interrupt: Interrupt) -> int:
    """Say what went wrong, if anything did."""
    if error is not None:
        show.failure(error)
    if interrupt.count:
        show.sentence(f"{named(graph)}: interrupted; what came back is torn down")
    return 1 if interrupt.count or error is not None else 0


@contextmanager
def _writing(
    file: Path | None, graph: Graph, interrupt: Interrupt, unwritten: list[str]
) -> Iterator[Callable[[TraceEvent], None] | None]:
    """Open the trace file; it is whole however the run ends, or among those unwritten.

    One that ends in .json becomes a timeline.
    """
    if file is None:
        yield None
        return
    if file.suffix not in _TRACES:
        raise TargetError(
            f"the trace cannot be written as {file}: name it {file.with_suffix('.jsonl').name}, one JSON object a "
            f"line, or {file.with_suffix('.json').name}, a timeline"
        )
    try:
        stream: Any = _Stream(file)
    except OSError as error:
        raise TargetError(f"the trace cannot be written to {file}: {error.strerror}") from None
    try:
        if file.suffix == ".json":
            with Timeline(stream, graph) as timeline:
                interrupt.before_leaving += [timeline.close, stream.close]
                yield timeline
        else:
            interrupt.before_leaving.append(stream.close)
            yield lambda event: _write(stream.write, event)
    finally:
        stream.close()
        unwritten += [str(file)] * stream.is_broken


class _Stream:
    """A file whose disk may become full: that is told once, and the run goes on.

    Attributes:
      is_broken: whether it lacks something.
    """

    def __init__(self, file: Path) -> None:
        self._file = GrowingFile(file, append=False, at_once=False)
        self._path = file
        self._is_closed = False
        self.is_broken = False

    def write(self, data: bytes) -> None:
        """Append an event."""
        if not (self.is_broken or self._is_closed):
            self._try(lambda: self._file.write(data))

    def flush(self) -> None:
        """Hand it to the system."""
        self._try(self._file.flush)

    def close(self) -> None:
        """Give it its name, if it is whole."""
        if not self._is_closed:
            self._is_closed = True
            self._try(self._file.complete)

    def _try(self, call: Callable[[], object]) -> None:
        try:
            call()
        except OSError as error:
            if not self.is_broken:
                self.is_broken = True
                part = f"; what could be written is in {self._file.place}" if self._file.place.suffix == ".part" else ""
                show.sentence(f"the trace in {self._path} is not whole: {error.strerror}{part}")


class _Output:
    """Stands in for standard output: when nobody reads it any more, as in `hfg run ... | head`, the run is stopped.

    Attributes:
      broken: why nothing can be written any more.
      when_broken: called then, from whatever thread has written.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.broken: BrokenPipeError | None = None
        self.when_broken: Callable[[], object] = lambda: None

    def write(self, text: str) -> int:
        self._try(partial(self._stream.write, text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, call: Callable[[], object]) -> None:
        if self.broken is None:
            try:
                call()
            except BrokenPipeError as error:
                self.broken = error
                self.when_broken()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _write(write: Callable[[bytes], object], event: TraceEvent) -> None:
    write(encode(event) + b"\n")
