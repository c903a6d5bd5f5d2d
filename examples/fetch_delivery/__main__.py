"""Run the delivery robots: `python -m examples.fetch_delivery --seed 1 --robots 1 --minutes 3`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from examples.fetch_delivery.mission import Robot, build
from examples.fetch_delivery.running import carry_out
from examples.fetch_delivery.world import FAULTS, Fault, fault

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def _known_faults(names: list[str] | None) -> list[str]:
    for name in names or []:
        if name not in FAULTS:
            raise typer.BadParameter(f"there is no fault {name!r}; there are {', '.join(FAULTS)}")
    return names or []


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
    within: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=1, help="End it earlier when it takes longer than that.")
    ] = None,
    machine: Annotated[
        bool, typer.Option("--machine", help="A state machine decides, not the flow of activity.")
    ] = False,
) -> None:
    """Robots deliver cubes in a simulated arena; says in the end how they did."""
    faults: tuple[Fault, ...] = tuple(fault(name) for name in fault_names or [])
    graph = build(seed, robots, faults=faults, kind=_kind(machine))
    result = carry_out(graph, 60 * minutes, within_s=within)
    print(result)
    if result.error:
        print(result.error, file=sys.stderr)
    sys.exit(0 if result.outcome in ("over", "late") else 1)


if __name__ == "__main__":
    app(prog_name="python -m examples.fetch_delivery")
