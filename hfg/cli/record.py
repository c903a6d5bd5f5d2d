"""`hfg record TARGET -o FILE`: runs a graph and writes what passes its ports.

Stands on `execute`, `live`, `target`, `settings`, `interrupt` and `show`.
"""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

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
    TargetArgument,
    UntilOption,
)
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import Run
from hfg.engine.runtime.interrupt import named
from hfg.recording import Recording
from hfg.recording import record as begin_recording

__all__ = ["record", "told"]


class _Images(StrEnum):
    raw = "raw"
    png = "png"
    jpeg = "jpeg"


def record(
    target: TargetArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The recording, as in run.mcap.")],
    select: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN",
            help="Ports or nodes, as in 'camera/*' or detect.out. Can be repeated. Default: all outputs and events.",
        ),
    ] = None,
    lossless: Annotated[bool, typer.Option(help="Let nodes wait for a slow disk, or skip tokens instead.")] = True,
    images: Annotated[_Images, typer.Option(help="Image format; png is lossless.")] = _Images.raw,
    pickle: Annotated[bool, typer.Option("--pickle", help="Pickle values that are not plain data.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    clock: ClockOption = Clock.real,
    until: UntilOption = None,
    param: ParamOption = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    table: Annotated[bool, typer.Option(help="Show a live table of nodes (on a terminal and the real clock).")] = True,
    debug: DebugOption = False,
) -> int:
    """Run a graph and record its ports for hfg play, hfg info and Foxglove. Ctrl-C ends the recording properly."""
    show.set_debug(debug)
    records = show.Records(0, debug, virtual=clock is Clock.virtual)
    graph = load_graph(target, arg or [], allow)
    records.loaded()
    set_parameters(graph, param or [])
    interrupt = Interrupt.current or Interrupt()
    recordings: list[Recording] = []
    with redirect_stdout(sys.stderr), live_table(table and clock is Clock.real) as live:
        interrupt.before_leaving.append(live.leave)

        def begin(run: Run) -> None:
            recordings.append(
                begin_recording(
                    run,
                    output,
                    select=select or "*",
                    lossless=lossless,
                    images=images.value,
                    pickle=pickle,
                    force=force,
                )
            )
            recordings[0].when_failed = run.stop  # for what is a run that nobody records?
            live.begin(run)

        report, error = execute(graph, target, clock, interrupt, begin, until_s=until, debug=debug)
    code = told(recordings[0]) if recordings else 1
    if error is not None:
        show.failure(error)
    if interrupt.count:
        show.sentence(f"{named(graph)}: interrupted; what came back is torn down")
    elif report is not None and error is None:
        show.report(graph.name, report, 0)
    return 1 if error is not None or interrupt.count else code


def told(recording: Recording) -> int:
    """Report the result of a recording; returns the exit code."""
    if recording.error is not None:
        readable = "it opens up to its last chunk" if recording.chunks_written else "nothing in it can be read"
        show.sentence(f"the recording in {recording.path} is not whole: {_why(recording.error)}; {readable}")
        return 1
    size = recording.bytes_written
    shown = f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{size / 1e3:.1f} kB"
    ports = f"{len(recording.ports)} port{'s' * (len(recording.ports) != 1)}"
    tokens = f"{recording.tokens} token{'s' * (recording.tokens != 1)}"
    show.sentence(f"{recording.path}: {tokens} of {ports}, {shown}")
    if recording.held_s:
        show.sentence(f"nodes waited {recording.held_s:.3f} s for the disk; --no-lossless would have left tokens out")
    left_out = recording.left_out
    for path, count in left_out.items():
        show.sentence(f'"{path}": {count} token{"s are" if count != 1 else " is"} not in the recording')
    return 0


def _why(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{type(error).__name__}: {error}"
