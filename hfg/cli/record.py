"""`hfg record TARGET -o FILE`: runs a graph and records its ports. Depends on `execute`."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import show
from hfg.cli.execute import GraphRun
from hfg.cli.options import ForceOption, RunFlags, TableOption, TargetArgument
from hfg.engine import Run
from hfg.recording import Recording
from hfg.recording import record as begin_recording


class _Images(StrEnum):
    raw = "raw"
    png = "png"
    jpeg = "jpeg"


def record(
    target: TargetArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The recording, as in run.mcap.")],
    flags: RunFlags,
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
    force: ForceOption = False,
    table: TableOption = True,
) -> int:
    """Run a graph and record its ports for hfg play, hfg info and Foxglove. Ctrl-C ends the recording properly."""
    running = GraphRun.load(target, flags)
    recordings: list[Recording] = []
    with redirect_stdout(sys.stderr), running.table(table) as live:

        def begin(run: Run) -> None:
            how = {"lossless": lossless, "images": images.value, "pickle": pickle, "force": force}
            recordings.append(begin_recording(run, output, select=select or "*", **how))  # type: ignore[arg-type]
            recordings[0].when_failed = run.stop  # the run has no other purpose
            live.begin(run)

        running.run(begin)
    code = told(recordings[0]) if recordings else 1
    return running.ended() or code


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
