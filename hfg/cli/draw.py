"""`hfg draw TARGET [OUT]`: shows what a graph looks like, without running it. Stands on `target` and `show`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from hfg.cli import show
from hfg.cli.options import AllowOption, ArgOption, TargetArgument
from hfg.cli.target import load_graph
from hfg.errors import UsageError
from hfg.graph.drawing import FORMATS

__all__ = ["draw"]


def draw(
    target: TargetArgument,
    out: Annotated[
        Path | None, typer.Argument(help="a file that ends in .mmd or .dot; without it, standard output")
    ] = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    format: Annotated[  # noqa: A002 - the word users know
        Literal["mmd", "dot"], typer.Option("--format", help="What goes to standard output: Mermaid or Graphviz.")
    ] = "mmd",
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """Draw a graph without running it."""
    show.set_debug(debug)
    graph = load_graph(target, arg or [], allow)
    if out is None:
        sys.stdout.write(FORMATS[f".{format}"](graph))
        return 0
    try:
        graph.draw(out)
    except UsageError as error:
        show.sentence(str(error))
        return 2
    return 0
