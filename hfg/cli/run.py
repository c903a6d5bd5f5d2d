"""`hfg run TARGET`: runs a graph to its end and reports how it went. Depends on `execute`."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, TextIO

import typer

from hfg.base.whole import GrowingFile, need_writable
from hfg.cli import show
from hfg.cli.execute import GraphRun
from hfg.cli.options import (
    MonitorOption,
    RunFlags,
    SettingsOption,
    TableOption,
    TargetArgument,
    VerboseOption,
    ViewFlags,
)
from hfg.cli.viewing import Viewing
from hfg.engine import Run
from hfg.engine.observing.encoding import encode
from hfg.engine.observing.report import RunPage
from hfg.engine.runtime.settings import RunFields
from hfg.errors import GraphError, TargetError
from hfg.graph import Graph
from hfg.monitors import declared
from hfg.timeline import Timeline
from hfg.trace import TraceEvent

_TRACES: Final = ("", ".jsonl", ".json")


def run(
    target: TargetArgument,
    flags: RunFlags,
    views: ViewFlags,
    options: RunFields,  # those that declare a flag
    monitor: MonitorOption = None,
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
    profile: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write how long the firings of each node took, for hfg check --time."),
    ] = None,
    pictures: Annotated[int, typer.Option(metavar="N", help="With --report: show at most N images.")] = 24,
    table: TableOption = True,
    json: Annotated[
        bool, typer.Option("--json", help="Write the report as JSON. Output of nodes goes to standard error.")
    ] = False,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Afterwards, tell for each node whether it was fused, and if not, why."),
    ] = False,
    verbose: VerboseOption = 0,
) -> int:
    """Run a graph. Ctrl-C stops it; a second Ctrl-C stops it immediately."""
    running = GraphRun.load(target, flags, verbose=verbose)
    viewing = Viewing(views)
    _declare(running.graph, monitor or ())
    if profile is not None:
        _need_writable(profile)
    output = _Output(sys.stdout)
    unwritten: list[str] = []
    pages: list[RunPage] = []
    runs: list[Run] = []
    with (
        redirect_stdout(sys.stderr if json else output),
        _writing(trace, running, unwritten) as write,
        running.table(table and not json) as live,
    ):

        def begin(run: Run) -> None:
            runs.append(run)
            output.when_broken = partial(asyncio.get_running_loop().call_soon_threadsafe, run.stop)
            if report_file is not None:
                pages.append(run.report_page(report_file, pictures=pictures))
                running.interrupt.before_leaving.append(pages[0].write)
            if profile is not None:
                run.statistics()  # starts the measuring of times
            viewing.begin(run)
            live.begin(run)

        running.run(begin, trace=write, settings=settings, **options.said())
        viewing.end()
    for page in pages:
        if page.error is not None:
            show.sentence(f'the report "{page.path}" cannot be written: {page.error.strerror}')
            unwritten.append(str(page.path))
    if profile is not None and runs and not _save(runs[0], profile):
        unwritten.append(str(profile))
    if output.broken is not None:
        raise output.broken
    if json and running.report is not None:
        show.json(running.report)
    for explained in runs if explain else ():
        show.explanations(explained.explain())
    violated = monitor and any(declared(one).violations for one in runs)
    return running.ended(verbose=verbose, reports=not json or verbose > 0) or int(bool(unwritten or violated))


def _need_writable(profile: Path) -> None:
    try:
        need_writable(profile)
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else error
        raise TargetError(f"the profile cannot be written to {profile}: {said}") from None


def _save(run: Run, profile: Path) -> bool:
    """Write the profile of a run; says if that is not possible any more."""
    from hfg.analysis.profile import Profile  # imports all analyses

    try:
        Profile.of(run.graph, run.statistics()).save(profile)
    except OSError as error:
        show.sentence(f'the profile "{profile}" cannot be written: {error.strerror}')
        return False
    return True


def _declare(graph: Graph, properties: Iterable[str]) -> None:
    """Declare the monitors that are given in the call, with their names or numbered."""
    for number, text in enumerate(properties, 1):
        name, equals, rest = text.partition("=")
        named = bool(equals) and name.isidentifier()
        try:
            graph.monitor(name if named else f"monitor_{number}", rest if named else text)
        except GraphError as error:
            raise TargetError(str(error)) from None


@contextmanager
def _writing(
    file: Path | None, running: GraphRun, unwritten: list[str]
) -> Iterator[Callable[[TraceEvent], None] | None]:
    """Open the trace file; it is complete however the run ends, or listed in `unwritten`.

    One that ends in .json becomes a timeline.
    """
    if file is None:
        yield None
        return
    if file.suffix not in _TRACES:
        raise TargetError(
            f"the trace cannot be written as {file}: name it {file.with_suffix('.jsonl').name}, one JSON object "
            f"per line, or {file.with_suffix('.json').name}, a timeline"
        )
    try:
        stream: Any = _Stream(file)
    except OSError as error:
        raise TargetError(f"the trace cannot be written to {file}: {error.strerror}") from None
    try:
        if file.suffix == ".json":
            with Timeline(stream, running.graph) as timeline:
                running.interrupt.before_leaving += [timeline.close, stream.close]
                yield timeline
        else:
            running.interrupt.before_leaving.append(stream.close)
            yield lambda event: _write(stream.write, event)
    finally:
        stream.close()
        unwritten += [str(file)] * stream.is_broken


class _Stream:
    """A file whose disk may become full: this is reported once, and the run continues.

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
        """Move it to its name, if it is complete."""
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
    """Replaces standard output: when its reader is gone, as in `hfg run ... | head`, the run is stopped.

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
