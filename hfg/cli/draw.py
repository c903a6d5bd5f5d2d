"""`hfg draw TARGET [OUT]`: shows what a graph looks like, without running it. Stands on `target` and `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from hfg.cli import show
from hfg.cli.options import AllowOption, ArgOption, TargetArgument
from hfg.cli.target import load_graph
from hfg.errors import GraphError, UsageError

__all__ = ["draw"]


def draw(
    target: TargetArgument,
    out: Annotated[
        Path | None, typer.Argument(help="a file that ends in .svg, .mmd or .dot; without it, standard output")
    ] = None,
    depth: Annotated[
        int | None, typer.Option(metavar="N", help="Show so many subgraphs inside each other open; 0 folds all.")
    ] = None,
    fold: Annotated[
        list[str] | None, typer.Option(metavar="PATH", help="Show this subgraph folded; may be given more than once.")
    ] = None,
    active: Annotated[
        list[str] | None, typer.Option(metavar="PATH", help="Show this node as active; may be given more than once.")
    ] = None,
    ports: Annotated[
        Literal["used", "all"], typer.Option(help="Which ports an SVG shows: those that edges lead to, or all.")
    ] = "used",
    arg: ArgOption = None,
    allow: AllowOption = None,
    format: Annotated[  # noqa: A002 - the word users know
        Literal["svg", "mmd", "dot"] | None,
        typer.Option("--format", help="SVG, Mermaid or Graphviz; by default what the file ends in, else Mermaid."),
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """Draw a graph without running it."""
    show.set_debug(debug)
    graph = load_graph(target, arg or [], allow)
    try:
        text = graph.draw(out, depth=depth, fold=fold or (), active=active, ports=ports, format=format)
    except (GraphError, UsageError) as error:
        show.sentence(str(error))
        return 2
    if out is None:
        show.write(text)
    return 0
