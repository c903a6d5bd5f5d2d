"""Let the robot follow a person: `python -m examples.follow_person --seed 1 --metres 300`."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated, Literal

import typer

import hfg
from examples.follow_person.judging import Judge
from examples.follow_person.mission import build
from examples.follow_person.running import carry_out
from examples.follow_person.showing import Showing
from examples.follow_person.world import Conditions

SHOWN_IN = Path("out", "follow_person")
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def _showing(folder: Path, graph: hfg.Graph) -> Showing:
    try:
        return Showing(folder, graph)
    except OSError as error:
        raise typer.BadParameter(
            f'nothing can be written to "{folder}": {error.strerror}; name a folder that you can write to',
            param_hint="'--report'",
        ) from None


@app.command()
def main(
    seed: Annotated[int, typer.Option(min=0, help="Decides what looks like chance.")] = 1,
    metres: Annotated[float, typer.Option(min=1, max=100_000, help="How far the person walks.")] = 300.0,
    course: Annotated[Literal["open", "dense"], typer.Option(help="How many trees there are.")] = "open",
    others: Annotated[int, typer.Option(min=0, max=30, help="How many other people there are.")] = 6,
    pace: Annotated[float, typer.Option(min=0.7, max=1.95, help="Of the person, on average, in m/s.")] = 1.9,
    speed: Annotated[float, typer.Option(min=0.5, max=5, help="Of the robot, at most, in m/s.")] = 2.5,
    steepness: Annotated[float, typer.Option(min=0, max=0.3, help="Of the steepest slope.")] = 0.12,
    noise: Annotated[float, typer.Option(min=0, max=0.2, help="Of the laser's ranges, in metres.")] = 0.02,
    drift: Annotated[float, typer.Option(min=0, max=10, help="Of wheels and inertial unit; 1 is usual.")] = 1.0,
    light: Annotated[float, typer.Option(min=0.05, max=3, help="How bright it is; 1 is a clear day.")] = 1.0,
    within: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=1, help="End it earlier when it takes longer than that.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write report.html there, with a map, distance and speed, and the graph."),
    ] = None,
    show: Annotated[
        bool, typer.Option("--show", help=f"Open the report in a browser; without --report it is in {SHOWN_IN}.")
    ] = False,
) -> None:
    """A robot follows a person outdoors; says in the end how it did."""
    conditions = Conditions(course, others, pace, speed, steepness, noise, drift, light)
    graph = build(seed, metres=metres, conditions=conditions)
    showing = _showing(report or SHOWN_IN, graph) if report is not None or show else None

    def begin(run: hfg.Run, judge: Judge) -> None:
        if showing is not None:
            showing.begin(run, judge)

    result = carry_out(graph, within_s=within, begin=begin)
    print(result)
    if result.error:
        print(result.error, file=sys.stderr)
    if showing is not None:
        showing.end(result)
        print(f"report: {showing.page}")
        if show and not webbrowser.open(showing.page.resolve().as_uri()):
            print("There is no browser here that could be opened: open the report in one elsewhere.", file=sys.stderr)
    sys.exit(0 if result.outcome in ("over", "late") else 1)


if __name__ == "__main__":
    app(prog_name="python -m examples.follow_person")
