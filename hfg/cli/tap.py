"""`hfg tap TARGET PATH`: runs a graph and prints the tokens that pass a port or an edge of it.

Stands on `execute`, `target`, `settings`, `interrupt` and `show`.
"""

from __future__ import annotations

import sys
from collections.abc import Awaitable
from contextlib import redirect_stdout
from typing import Annotated, Any

import typer

from hfg.cli import completing, show
from hfg.cli.encoding import encode, text
from hfg.cli.execute import execute
from hfg.cli.interrupt import Interrupt
from hfg.cli.options import Clock, ClockOption, DebugOption, ParamOption, TargetArgument, UntilOption
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import Run
from hfg.errors import GraphError, TargetError, UsageError
from hfg.token import Token

__all__ = ["tap"]

_KEPT = 10_000  # more than a graph sends between two turns of the loop


def tap(
    target: TargetArgument,
    path: Annotated[
        str,
        typer.Argument(
            help='a port, as in camera.out, or an edge, "camera.out -> detect.image"', autocompletion=completing.ports
        ),
    ],
    clock: ClockOption = Clock.real,
    until: UntilOption = None,
    limit: Annotated[int | None, typer.Option("-n", "--limit", min=1, help="End after so many tokens.")] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Print at most so many tokens a second, the newest.")
    ] = None,
    param: ParamOption = None,
    json: Annotated[bool, typer.Option("--json", help="Write each token as a JSON object.")] = False,
    debug: DebugOption = False,
) -> int:
    """Run a graph and print the tokens of a port or an edge, one a line; what nodes print goes to standard error."""
    show.set_debug(debug)
    records = show.Records(0, debug, virtual=clock is Clock.virtual)
    graph = load_graph(target)
    records.loaded()
    set_parameters(graph, param or [])
    interrupt = Interrupt.current or Interrupt()
    printer = _Printer(path, limit, rate, json)
    with redirect_stdout(sys.stderr):
        report, error = execute(graph, target, clock, interrupt, printer.begin, until_s=until, debug=debug)
    if printer.broken is not None:
        raise printer.broken
    if error is not None:
        show.failure(error)
    if printer.skipped and rate is None:
        show.sentence(f"{printer.skipped} tokens were skipped: more passed than could be printed")
    if not printer.seen and report is not None:
        show.sentence(f'no token passed "{path}" in {report.duration_s:.3f} s')
    if interrupt.count:
        show.sentence(f'graph "{graph.name}": interrupted; what came back is torn down')
    return 1 if error is not None or interrupt.count else 0


class _Printer:
    """Prints what passes.

    Attributes:
      seen: how many tokens have passed; known when the run is over.
      skipped: how many of them were not printed, but for those behind the limit.
      broken: why nothing can be printed any more.
    """

    def __init__(self, path: str, limit: int | None, rate_hz: float | None, json: bool) -> None:
        self._path = path
        self._limit = limit
        self._rate_hz = rate_hz
        self._json = json
        self._out = sys.stdout
        self.seen = 0
        self.skipped = 0
        self.broken: OSError | None = None

    def begin(self, run: Run) -> Awaitable[None]:
        """Look from now on."""
        try:
            looking = run.tap(self._path, size=_KEPT if self._rate_hz is None else None, max_rate_hz=self._rate_hz)
        except (UsageError, GraphError) as error:
            raise TargetError(str(error)) from None
        return self._print(run, looking, run.now())

    async def _print(self, run: Run, looking: Any, began: float) -> None:
        printed = 0
        try:
            async for token in looking:
                self._out.write(self._line(token, began))
                self._out.flush()
                printed += 1
                if printed == self._limit:
                    break
            else:
                self.skipped = looking.skipped
        except OSError as error:  # whoever read has had enough, as in hfg tap ... | head, or the disk is full
            self.broken = error
        self.seen = looking.seen
        looking.close()
        run.stop()

    def _line(self, token: Token[Any], began: float) -> str:
        if self._json:
            return encode(token).decode() + "\n"
        modifier = f"  ({token.activity:+d})" if token.activity else ""
        return f"{token.stamp - began:.3f} s  {text(token.value)}{modifier}\n"
