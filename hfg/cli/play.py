"""`hfg play FILE --into TARGET`: runs a graph with what was recorded in the place of its sources.

Stands on `execute`, `live`, `target`, `settings`, `interrupt` and `show`.
"""

from __future__ import annotations

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
    UntilOption,
    VerboseOption,
)
from hfg.cli.record import told
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import Run
from hfg.engine.runtime.interrupt import named
from hfg.errors import GraphError, TargetError, UsageError
from hfg.recording import Recording, play_into
from hfg.recording import record as begin_recording

__all__ = ["play"]


def play(
    file: Annotated[Path, typer.Argument(help="a recording, as hfg record writes it")],
    into: Annotated[str, typer.Option("--into", metavar="TARGET", help="The graph: module:graph or file.py.")],
    mapped: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="FROM=TO",
            help="Play a recorded port into another port, as in camera.out=front.image. Can be repeated.",
        ),
    ] = None,
    speed: Annotated[str, typer.Option(help="Speed factor, or max for as fast as possible.")] = "1",
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE", help="Record the run again.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    pickle: Annotated[bool, typer.Option("--pickle", help="Read pickled values, which runs code.")] = False,
    clock: ClockOption = Clock.real,
    until: UntilOption = None,
    param: ParamOption = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    table: Annotated[bool, typer.Option(help="Show a live table of nodes (on a terminal and the real clock).")] = True,
    debug: DebugOption = False,
    verbose: VerboseOption = 0,
) -> int:
    """Play a recording into a graph, in place of the recorded sources."""
    show.set_debug(debug)
    records = show.Records(verbose, debug, virtual=clock is Clock.virtual)
    ports = dict(_pair(one) for one in mapped or [])
    graph = load_graph(into, arg or [], allow)
    records.loaded()
    try:
        playing = play_into(graph, file, ports=ports or None, speed=_factor(speed), pickle=pickle)
    except (UsageError, GraphError) as wrong:
        raise TargetError(str(wrong)) from None
    set_parameters(graph, param or [])
    for path in playing.rest:
        show.sentence(f'"{path}" rests: all that it sends went to what is played')
    interrupt = Interrupt.current or Interrupt()
    recordings: list[Recording] = []
    with live_table(table and clock is Clock.real) as live:
        interrupt.before_leaving.append(live.leave)

        def begin(run: Run) -> None:
            if output is not None:
                recordings.append(begin_recording(run, output, force=force, pickle=pickle))
            live.begin(run)

        report, error = execute(graph, into, clock, interrupt, begin, until_s=until, debug=debug)
    code = told(recordings[0]) if recordings else 0
    if error is not None:
        show.failure(error)
    if interrupt.count:
        show.sentence(f"{named(graph)}: interrupted; what came back is torn down")
    elif report is not None and error is None:
        show.report(graph.name, report, verbose)
    return 1 if error is not None or interrupt.count or playing.is_damaged else code


def _pair(text: str) -> tuple[str, str]:
    source, found, target = text.partition("=")
    if not (found and source and target):
        raise TargetError(f"--map takes FROM=TO, a recorded port and one of the graph, got {text!r}")
    return source.strip(), target.strip()


def _factor(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0 < speed < float("inf"):
        raise TargetError(f"--speed takes a number above 0, or max, got {text!r}")
    return speed
