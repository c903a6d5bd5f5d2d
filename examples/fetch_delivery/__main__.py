"""Run the delivery robots: `python -m examples.fetch_delivery --seed 1 --robots 1 --minutes 3`."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated, Literal

import typer

import hfg
from examples.fetch_delivery.mission import Robot, build
from examples.fetch_delivery.running import carry_out
from examples.fetch_delivery.showing import Showing
from examples.fetch_delivery.world import FAULTS, LIMITS, USUAL, Cameras, Fault, Surroundings, fault

SHOWN_IN = Path("out", "fetch_delivery")
_MEASURES = ", ".join(f"{name} ({getattr(USUAL, name):g})" for name in LIMITS)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def _known_faults(names: list[str] | None) -> list[str]:
    for name in names or []:
        if name not in FAULTS:
            raise typer.BadParameter(f"there is no fault {name!r}; there are {', '.join(FAULTS)}")
    return names or []


def _surroundings(settings: list[str]) -> Surroundings:
    values = {}
    for setting in settings:
        name, _, value = setting.partition("=")
        if name not in LIMITS:
            raise typer.BadParameter(f"an arena has no {name!r}; it has {', '.join(LIMITS)}", param_hint="'--param'")
        try:
            values[name] = float(value)
        except ValueError:
            problem = f"write a number behind {name}, such as {name}={getattr(USUAL, name):g}, not {setting!r}"
            raise typer.BadParameter(problem, param_hint="'--param'") from None
    try:
        return Surroundings(**values)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="'--param'") from None


def _kind(machine: bool) -> type[Robot]:
    if not machine:
        return Robot
    try:
        from examples.fetch_delivery.machine import Robot as Machine
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("transitions"):
            raise
        raise typer.BadParameter("--machine needs the package transitions; pip install 'hfg[examples]'") from None
    return Machine


def _showing(folder: Path, graph: hfg.Graph, seed: int, robots: int, seconds: float) -> Showing:
    try:
        return Showing(folder, graph, seed, robots, seconds)
    except OSError as error:
        raise typer.BadParameter(
            f'nothing can be written to "{folder}": {error.strerror}; name a folder that you can write to',
            param_hint="'--report'",
        ) from None


@app.command()
def main(
    seed: Annotated[int, typer.Option(min=0, help="Decides what looks like chance.")] = 1,
    robots: Annotated[int, typer.Option(min=1, max=4, help="How many.")] = 1,
    minutes: Annotated[float, typer.Option(min=0.01, max=600, help="How long, in the arena's time.")] = 3.0,
    fault_names: Annotated[
        list[str] | None,
        typer.Option(
            "--fault", metavar="NAME", help=f"Goes wrong after 30 s: {', '.join(FAULTS)}.", callback=_known_faults
        ),
    ] = None,
    params: Annotated[
        list[str] | None,
        typer.Option(
            "--param",
            metavar="NAME=VALUE",
            help=f"Makes the arena other than usual: {_MEASURES}.",
        ),
    ] = None,
    within: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=1, help="End it earlier when it takes longer than that.")
    ] = None,
    cameras: Annotated[
        Cameras, typer.Option(help="What draws the pictures; mujoco needs a package and OpenGL.")
    ] = "light",
    machine: Annotated[
        bool, typer.Option("--machine", help="A state machine decides, not the flow of activity.")
    ] = False,
    cut: Annotated[
        bool, typer.Option("--cut", help="Perception and control run in processes of their own, on the real clock.")
    ] = False,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record what the arena tells the robots, as MCAP.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write report.html there, with a video from above, ways, pictures and graph."),
    ] = None,
    show: Annotated[
        bool, typer.Option("--show", help=f"Open the report in a browser; without --report it is in {SHOWN_IN}.")
    ] = False,
) -> None:
    """Robots deliver cubes in a simulated arena; says in the end how they did."""
    faults: tuple[Fault, ...] = tuple(fault(name) for name in fault_names or [])
    if cut and (record is not None or report is not None or show):
        raise typer.BadParameter("a run in several processes cannot be recorded or shown; leave --cut or that out")
    surroundings = _surroundings(params or [])
    graph = build(seed, robots, faults=faults, cut=cut, kind=_kind(machine), cameras=cameras, surroundings=surroundings)
    showing = None
    if report is not None or show:
        showing = _showing(report or SHOWN_IN, graph, seed, robots, 60 * minutes)

    def begin(run: hfg.Run) -> None:
        if record is not None:
            run.record(record, select="world", images="png", force=True)
        if showing is not None:
            showing.begin(run)

    clock: Literal["virtual", "real"] = "real" if cut else "virtual"
    result = carry_out(graph, 60 * minutes, clock=clock, within_s=within, begin=begin)
    print(result)
    if result.error:
        print(result.error, file=sys.stderr)
    if showing is not None:
        showing.end(result)
        for note in showing.notes:
            print(note, file=sys.stderr)
        if showing.page.exists():
            print(f"report: {showing.page}")
        if show and not webbrowser.open(showing.page.resolve().as_uri()):
            print("There is no browser here that could be opened: open the report in one elsewhere.", file=sys.stderr)
    is_well = result.outcome in ("over", "late") and (showing is None or showing.is_whole)
    sys.exit(0 if is_well else 1)


if __name__ == "__main__":
    app(prog_name="python -m examples.fetch_delivery")
