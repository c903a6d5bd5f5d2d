"""`hfg run TARGET`: runs a graph to its end and tells how it went.

Stands on the engine, `target`, `settings`, `interrupt` and `show`.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from hfg.cli import show
from hfg.cli.encoding import encode
from hfg.cli.interrupt import Interrupt
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import Report, VirtualTimeLoop, run_async
from hfg.errors import HfgError, TargetError, UsageError
from hfg.graph import Graph
from hfg.timeline import Timeline
from hfg.trace import TraceEvent

__all__ = ["Clock", "run"]


class Clock(StrEnum):
    """The clocks a run can have."""

    real = "real"
    virtual = "virtual"


def run(
    target: Annotated[str, typer.Argument(help="module:graph, file.py or file.py:graph")],
    clock: Annotated[Clock, typer.Option(help="virtual: as fast as the machine can, the same each time.")] = Clock.real,
    until: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="End the run at this time on its clock.")
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=VALUE", help="Set a parameter, as in lookup.tolerance=0.2; may be given several times."
        ),
    ] = None,
    policy: Annotated[str | None, typer.Option(help="Which node is next: fifo, priority, random ...")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the policy random.")] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write every event of the run, one JSON object a line; in .json, a timeline for Perfetto.",
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Write the report as JSON; what nodes print goes to standard error.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Check values against port types; show hfg's own frames in tracebacks.")
    ] = False,
    verbose: Annotated[
        int, typer.Option("-v", "--verbose", count=True, help="Report each node; twice, each edge.")
    ] = 0,
) -> int:
    """Run a graph to its end; Ctrl-C ends it earlier, twice at once."""
    show.set_debug(debug)
    _log_to_stderr(verbose, debug)
    if until is not None and until < 0:
        raise typer.BadParameter(f"--until: seconds are not negative, got {until:g}")
    graph = load_graph(target)
    set_parameters(graph, param or [])
    interrupt = Interrupt.current or Interrupt()
    with redirect_stdout(sys.stderr if json else sys.stdout), _writing(trace, graph, interrupt) as write:
        options = {"until_s": until, "debug": debug, "policy": policy, "seed": seed, "trace": write}
        report, error = _run(graph, clock, options, interrupt)
    if json and report is not None:
        show.json(report)
    if interrupt.count:
        show.sentence(f'graph "{graph.name}": interrupted; what came back is torn down')
        return 1
    if error is not None:
        show.failure(error)
    elif report is not None and (not json or verbose):
        show.report(graph.name, report, verbose)
    return 0 if error is None else 1


def _run(
    graph: Graph, clock: Clock, options: dict[str, Any], interrupt: Interrupt
) -> tuple[Report | None, HfgError | None]:
    """Run it on a loop of its own; a failed run's report comes with its error."""

    async def main() -> Report:
        task = asyncio.current_task()
        assert task is not None
        with interrupt.cancels(task):
            return await run_async(graph, clock=clock.value, **options)

    try:
        with asyncio.Runner(loop_factory=VirtualTimeLoop if clock is Clock.virtual else None) as runner:
            return runner.run(main()), None
    except UsageError as error:  # an unknown policy, for example: not the run's fault
        raise TargetError(str(error)) from None
    except HfgError as error:
        return getattr(error, "report", None), error
    except (asyncio.CancelledError, KeyboardInterrupt):
        if not interrupt.count:
            raise
        return None, None


@contextmanager
def _writing(file: Path | None, graph: Graph, interrupt: Interrupt) -> Iterator[Callable[[TraceEvent], None] | None]:
    """Open the trace file; it is whole however the run ends. One that ends in .json becomes a timeline."""
    if file is None:
        yield None
        return
    try:
        stream = file.open("wb")
    except OSError as error:
        raise TargetError(f"the trace cannot be written to {file}: {error.strerror}") from None
    with stream:
        if file.suffix == ".json":
            with Timeline(stream, graph) as timeline:
                interrupt.before_leaving.append(timeline.close)
                yield timeline
            return
        interrupt.before_leaving.append(stream.flush)
        yield lambda event: _write(stream.write, event)


def _write(write: Callable[[bytes], object], event: TraceEvent) -> None:
    write(encode(event) + b"\n")


def _log_to_stderr(verbosity: int, debug: bool) -> None:
    level = logging.DEBUG if debug else logging.INFO if verbosity else logging.WARNING
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s", stream=sys.stderr)
    logging.getLogger("hfg").setLevel(level)
