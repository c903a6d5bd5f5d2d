"""`hfg tap TARGET PATH`: prints the tokens that pass a port or an edge of a graph, which it runs or which runs already.

Depends on `execute` and `sockets`.
"""

from __future__ import annotations

import sys
from collections.abc import Awaitable
from contextlib import redirect_stdout
from itertools import islice
from typing import Annotated, Any, Final

import typer

from hfg.base.controls import escaped
from hfg.cli import completing, show
from hfg.cli.execute import GraphRun
from hfg.cli.options import Clock, RunFlags, TargetArgument
from hfg.cli.sockets import Line, find, is_process, which
from hfg.cli.target import names_code
from hfg.engine import Run
from hfg.engine.face.watching import Answer, Question
from hfg.engine.observing.encoding import line_of
from hfg.errors import GraphError, TargetError, UsageError

_KEPT: Final = 10_000  # more than a graph sends between two turns of the loop


def tap(
    target: TargetArgument,
    path: Annotated[
        str,
        typer.Argument(
            help='a port, as in camera.out, or an edge, "camera.out -> detect.image"', autocompletion=completing.ports
        ),
    ],
    flags: RunFlags,
    limit: Annotated[int | None, typer.Option("-n", "--limit", min=1, help="Stop after N tokens.")] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Print at most this many tokens per second, the newest.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write each token as a JSON object.")] = False,
) -> int:
    """Print the tokens that pass a port or an edge, one per line. Output of nodes goes to standard error.

    This runs the graph. If TARGET is a process id or the name of a running graph, as hfg top shows them, it watches
    that run instead.
    """
    show.set_debug(flags.debug)
    if there := _runs_already(target):
        if flags.param or flags.arg or flags.until is not None or flags.clock is not Clock.real:
            raise TargetError(
                f"the run {target} is only watched and not changed: leave out --param, --arg, --until and --clock"
            )
        if len(there) > 1:
            return which("tap", there)
        return _look_at(there[0].name, Question("tap", path, rate, json), limit)
    running = GraphRun.load(target, flags)
    printer = _Printer(path, limit, rate, json)
    with redirect_stdout(sys.stderr):
        running.run(printer.begin)
    if printer.broken is not None:
        raise printer.broken
    code = running.ended(reports=False)
    if printer.skipped and rate is None:
        tokens = "1 token was" if printer.skipped == 1 else f"{printer.skipped} tokens were"
        show.sentence(f"{tokens} skipped: more passed than could be printed")
    if not printer.seen and running.report is not None:
        show.sentence(f'no token passed "{path}" in {running.report.duration_s:.3f} s')
    return code


def _runs_already(target: str) -> list[Answer]:
    """The runs that a target means: a process, or the name of a graph, which is never that of a module.

    Otherwise a file that lies where one is would be carried out for the name of a run (rule L4).
    """
    if not is_process(target) and names_code(target):
        return []
    try:
        return find(target)
    except TargetError as error:
        if is_process(target):
            raise
        raise TargetError(
            f'{error}; "{target}" names a run: to run a graph, name its file, as in hfg tap {target}.py, or its '
            "module with the graph, as in package.module:graph"
        ) from None


def _look_at(name: str, question: Question, limit: int | None) -> int:
    """Print the tokens in the run of another process, until it is over or the limit is reached."""
    with Line(name) as line:
        if line.ask(question) is None:
            raise TargetError(f"the run in process {name} does not answer: a node blocks its loop")
        try:
            for text in islice(line.lines(), limit):
                show.write(text)
                sys.stdout.flush()
            if limit is None:
                show.sentence(f"the run in process {name} is over")
        except KeyboardInterrupt:  # how one leaves it
            pass
    return 0


class _Printer:
    """Prints what passes.

    Attributes:
      seen: how many tokens have passed; known when the run is over.
      skipped: how many of them were not printed, except those after the limit.
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
        return self._print(run, looking)

    async def _print(self, run: Run, looking: Any) -> None:
        printed = 0
        try:
            async for token in looking:
                self._out.write(escaped(line_of(token, looking.passed_s, json=self._json)))
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
