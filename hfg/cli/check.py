"""`hfg check TARGET`: looks for mistakes without running. Stands on `target` and `show`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from hfg.cli import show
from hfg.cli.target import load_graph

__all__ = ["check"]


def check(
    target: Annotated[str, typer.Argument(help="module:graph, file.py or file.py:graph")],
    json: Annotated[bool, typer.Option("--json", help="Write the problems as JSON.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """Look for mistakes in a graph without running it; exit code 1 if there are errors."""
    show.set_debug(debug)
    graph = load_graph(target)
    problems = graph.check()
    errors = sum(problem.severity == "error" for problem in problems)
    if json:
        show.json(problems)
    else:
        for problem in problems:
            sys.stdout.write(f"{problem}\n")
        warnings = len(problems) - errors
        sys.stdout.write(f'graph "{graph.name}": {_count(errors, "error")}, {_count(warnings, "warning")}\n')
    return 1 if errors else 0


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
