"""`hfg draw TARGET [OUT]`: shows what a graph looks like, without running it. Depends on `target` and `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from hfg.cli import show
from hfg.cli.options import LoadFlags, TargetArgument
from hfg.cli.target import load_graph
from hfg.errors import GraphError, UsageError


def draw(
    target: TargetArgument,
    flags: LoadFlags,
    out: Annotated[
        Path | None, typer.Argument(help="a file name that ends in .svg, .mmd or .dot; default: standard output")
    ] = None,
    depth: Annotated[int | None, typer.Option(metavar="N", help="Open N levels of subgraphs; 0 collapses all.")] = None,
    fold: Annotated[
        list[str] | None, typer.Option(metavar="PATH", help="Collapse this subgraph. Can be repeated.")
    ] = None,
    active: Annotated[
        list[str] | None, typer.Option(metavar="PATH", help="Show this node as active. Can be repeated.")
    ] = None,
    ports: Annotated[
        Literal["used", "all"], typer.Option(help="Ports to show in an SVG: those with edges, or all.")
    ] = "used",
    view: Annotated[
        Literal["states", "activity", "mission", "all"] | None,
        typer.Option(
            help="Only the states that can be reached; or, of an SVG: states and what feeds them, all with bundles, or "
            "each edge by itself."
        ),
    ] = None,
    format: Annotated[  # noqa: A002 - the word users know
        Literal["svg", "mmd", "dot"] | None,
        typer.Option("--format", help="SVG, Mermaid or Graphviz. Default: by the file name, or else Mermaid."),
    ] = None,
) -> int:
    """Draw a graph without running it."""
    show.set_debug(flags.debug)
    graph = load_graph(target, flags.arg, flags.allow)
    try:
        text = graph.draw(out, depth=depth, fold=fold or (), active=active, ports=ports, view=view, format=format)
    except (GraphError, UsageError) as error:
        show.sentence(str(error))
        return 2
    if out is None:
        show.write(text)
    return 0
