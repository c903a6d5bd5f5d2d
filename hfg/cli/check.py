"""`hfg check TARGET`: looks for mistakes without running. Depends on `target` and `show`."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hfg.analysis.report import MAX_STATES, analyse_activity
from hfg.cli import show
from hfg.cli.options import AllowOption, ArgOption, TargetArgument
from hfg.cli.target import load_graph
from hfg.errors import SEVERITIES, CheckFailed, FileError, HfgError, MachineError, Problem, TargetError
from hfg.graph import Graph
from hfg.graph.structure.refusals import keep_refusals, problem_of
from hfg.parts.model.costs import costs_of_deaths

__all__ = ["check"]


def check(
    target: TargetArgument,
    arg: ArgOption = None,
    allow: AllowOption = None,
    activity: Annotated[
        bool, typer.Option("--activity", help="Also prove what may be active together, and show how activity moves.")
    ] = False,
    states: Annotated[
        int, typer.Option("--states", min=1, help="How many states of a part of the graph --activity looks at.")
    ] = MAX_STATES,
    json: Annotated[bool, typer.Option("--json", help="Write the problems as JSON.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """Check a graph for errors without running it (exit code 1 if there are any)."""
    show.set_debug(debug)
    graph: Graph | None = None
    refused_file: FileError | None = None
    with keep_refusals() as problems:
        try:
            graph = load_graph(target, arg or [], allow)
        except TargetError as error:
            if not isinstance(error.__cause__, Exception):
                raise  # there is no such target: nothing was looked at
            show.user_traceback(error.__cause__)
            problems += _unbuilt(target, error, error.__cause__)
        except FileError as error:
            problems += error.problems
            refused_file = error
    if graph is not None:
        refused = {problem.path.rpartition(" -> ")[2] for problem in problems}  # consequences of the refusals
        found = graph.check()
        problems += [one for one in found if not (one.check == "unconnected-input" and one.path in refused)]
    report = None
    if activity and graph is not None and not any(problem.severity == "error" for problem in problems):
        report = analyse_activity(graph, max_states=states)
        problems += report.problems
    counts = {severity: sum(problem.severity == severity for problem in problems) for severity in SEVERITIES}
    costs = [] if graph is None or counts["error"] else list(costs_of_deaths(graph))
    if json and activity:
        show.json({"problems": problems + costs, "activity": None if report is None else report.as_data()})
    elif json:
        show.json(problems + costs)
    else:
        for cost in costs:
            remedy = f"; {cost.remedy}" if cost.remedy else ""
            show.write(f"{cost.path}: {cost.what} ({cost.why}){remedy}\n")
        for problem in problems:
            show.write(f"{problem} [{problem.check}]\n")
        for line in [] if report is None else report.lines():
            show.write(f"{line}\n")
        name = target if graph is None else f'graph "{graph.name}"'
        show.write(f"{name}: {_count(counts['error'], 'error')}, {_count(counts['warning'], 'warning')}")
        show.write(f", {_count(counts['hint'], 'hint')}\n" if counts["hint"] else "\n")
    if refused_file is not None:
        show.wants(refused_file)
    return 1 if counts["error"] else 0


def _unbuilt(target: str, error: TargetError, cause: Exception) -> Sequence[Problem]:
    """Return the problems of a graph whose code failed."""
    why = "so the graph is not there to be checked"
    if isinstance(cause, CheckFailed | FileError | MachineError):
        return cause.problems
    if isinstance(cause, HfgError):
        return [problem_of(cause, target, why)]
    frames = [frame for frame in traceback.extract_tb(cause.__traceback__) if Path(frame.filename).exists()]
    where = f" at {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else ""
    return [
        Problem(
            path=target,
            severity="error",
            what=str(error),
            why=why,
            remedy=f"fix the code that builds it{where}",
            check="not-built",
        )
    ]


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
