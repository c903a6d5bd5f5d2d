"""`hfg play FILE --into TARGET`: runs a graph with a recording in place of its sources. Depends on `execute`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import show
from hfg.cli.execute import GraphRun
from hfg.cli.options import ForceOption, RunFlags, TableOption, VerboseOption, ViewFlags
from hfg.cli.record import told
from hfg.cli.viewing import Viewing
from hfg.engine import Run
from hfg.errors import GraphError, TargetError, UsageError
from hfg.graph import Graph
from hfg.recording import Playing, Recording, play_into
from hfg.recording import record as begin_recording


def play(
    file: Annotated[Path, typer.Argument(help="a recording, or a bag of ROS 2")],
    into: Annotated[str, typer.Option("--into", metavar="TARGET", help="The graph: module:graph or file.py.")],
    flags: RunFlags,
    views: ViewFlags,
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
    force: ForceOption = False,
    pickle: Annotated[bool, typer.Option("--pickle", help="Read pickled values, which runs code.")] = False,
    table: TableOption = True,
    verbose: VerboseOption = 0,
) -> int:
    """Play a recording into a graph, in place of the recorded sources."""
    ports = dict(_pair(one) for one in mapped or []) or None
    played: list[Playing] = []
    viewing = Viewing(views)

    def prepare(graph: Graph) -> None:
        played.append(_played(graph, file, ports, _factor(speed), pickle=pickle))

    running = GraphRun.load(into, flags, verbose=verbose, prepare=prepare)
    for path in played[0].rest:
        show.sentence(f'"{path}" is disabled: all its tokens went to nodes that are played')
    recordings: list[Recording] = []
    with running.table(table) as live:

        def begin(run: Run) -> None:
            if output is not None:
                recordings.append(begin_recording(run, output, force=force, pickle=pickle))
            viewing.begin(run)
            live.begin(run)

        running.run(begin)
        viewing.end()
    code = told(recordings[0]) if recordings else 0
    return running.ended(verbose=verbose) or code or int(played[0].is_damaged)


def _played(graph: Graph, file: Path, ports: dict[str, str] | None, speed: float | None, *, pickle: bool) -> Playing:
    try:
        return play_into(graph, file, ports=ports, speed=speed, pickle=pickle)
    except (UsageError, GraphError) as wrong:
        raise TargetError(str(wrong)) from None


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
