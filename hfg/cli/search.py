"""What `hfg tune` and `hfg sweep` share: reading scores, seeds and constraints, and a bar of progress.

Depends on `target` and `hfg.tuning`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hfg.base.whole import need_writable, write_whole
from hfg.cli import show
from hfg.cli.target import load_graph, load_module
from hfg.cli.terminal import is_terminal
from hfg.errors import TargetError, UsageError
from hfg.graph import Graph
from hfg.tuning.evaluating import Told
from hfg.tuning.scores import ScoreLike

SeedsOption = Annotated[
    str | None, typer.Option(metavar="LIST", help="Run each candidate once with each of these seeds: 1..5, or 1,2,7.")
]
SeedParameterOption = Annotated[
    str | None, typer.Option(metavar="PATH", help='Where the seed goes. Default: all parameters with the name "seed".')
]
ConstraintOption = Annotated[
    list[str] | None,
    typer.Option(metavar="MODULE:NAME", help="Monitors that must hold: a dict, or a function that returns one."),
]
FaultOption = Annotated[
    list[str] | None,
    typer.Option(metavar="WHAT@SECONDS", help="An action of a node, or parameter=value, at a time. Can be repeated."),
]
ProcessesOption = Annotated[
    int | None, typer.Option(min=1, help="How many runs at a time; the result does not depend on it.")
]
JournalOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Keep all runs there, and continue from them if it exists.")
]
PatienceOption = Annotated[
    float | None, typer.Option(metavar="SECONDS", min=0.01, help="End a run that takes longer than this to compute.")
]


def builder(target: str, arg: Sequence[str] | None, allow: Sequence[str] | None) -> Callable[[], Graph]:
    """Return a function that builds the graph of a target again.

    Raises:
      TargetError: the target is a graph that is built already, which has one run only.
    """
    return partial(load_graph, target, arg or [], allow)


def scores_of(names: Sequence[str] | None) -> list[ScoreLike]:
    """Read scores: "module:function" is a function, everything else a port, a state or an output."""
    return [_named(name) if ":" in name else name for name in names or ()]


def constraints_of(names: Sequence[str] | None) -> dict[str, Any]:
    """Read monitors."""
    found: dict[str, Any] = {}
    for name in names or ():
        there = _named(name)
        some = there() if callable(there) else there
        if not isinstance(some, Mapping):
            raise TargetError(f"--constraint {name} is {some!r:.80}, not a dict of monitors by name")
        found.update(some)
    return found


def _named(name: str) -> Any:
    place, _, attribute = name.rpartition(":")
    module = load_module(place)
    if not hasattr(module, attribute):
        raise TargetError(f'{place} has no "{attribute}", which {name} names')
    return getattr(module, attribute)


def seeds_of(said: str | None) -> list[int]:
    """Read "1..5" or "1,2,7".

    Raises:
      TargetError: it is neither.
    """
    if said is None:
        return []
    low, dots, high = said.partition("..")
    try:
        return list(range(int(low), int(high) + 1)) if dots else [int(one) for one in said.split(",")]
    except ValueError:
        raise TargetError(f'"{said}" is not a list of seeds: write 1..5, or 1,2,7') from None


def need_place(file: Path | None) -> None:
    """Refuse a file that could not be written in the end.

    Raises:
      TargetError: it could not.
    """
    if file is not None:
        try:
            need_writable(file)
        except OSError as error:
            raise TargetError(f'"{file}" cannot be written: {error.strerror}') from None


def written(file: Path, text: str) -> None:
    """Write a text to a file."""
    write_whole(file, lambda stream: stream.write(text.encode()))


@contextmanager
def usage() -> Iterator[None]:
    """Let wrong use end with code 2."""
    try:
        yield
    except UsageError as error:
        raise TargetError(str(error)) from None


@contextmanager
def progress(total: int | None) -> Iterator[Callable[[Told, str], None]]:
    """Show a bar on a terminal; elsewhere nothing. The yielded function takes a run, and what is best so far."""
    if not is_terminal(sys.stderr):
        yield lambda told, words: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    # Without a thread of its own, as processes are forked meanwhile.
    bar = Progress(*columns, console=Console(file=sys.stderr), auto_refresh=False)
    with bar:
        task = bar.add_task("", total=total)

        def tell(told: Told, words: str) -> None:
            bar.update(task, advance=1, description=words, refresh=True)

        yield tell
    show.write("", to_stderr=True)
