"""`hfg check TARGET`: looks for mistakes without running. Depends on `target` and `show`."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from hfg.analysis.profile import Profile
from hfg.analysis.report import MAX_STATES, ActivityReport, analyse_activity
from hfg.analysis.timing import TimeReport, analyse_time
from hfg.cli import show
from hfg.cli.options import LoadFlags, TargetArgument
from hfg.cli.target import load_graph
from hfg.errors import CheckFailed, FileError, HfgError, MachineError, Problem, TargetError, UsageError
from hfg.graph import Graph
from hfg.graph.structure.refusals import keep_refusals, problem_of
from hfg.parts.model.costs import costs_of_deaths


def check(
    target: TargetArgument,
    flags: LoadFlags,
    activity: Annotated[
        bool, typer.Option("--activity", help="Also prove what may be active together, and show how activity moves.")
    ] = False,
    states: Annotated[
        int | None,
        typer.Option(
            "--states", min=1, help=f"How many states of a part of the graph --activity looks at ({MAX_STATES:,})."
        ),
    ] = None,
    time: Annotated[
        bool, typer.Option("--time", help="Also bound how long ways from sources with a rate take; see takes_s.")
    ] = False,
    profile: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="With --time: durations that hfg run --profile has measured."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the problems as JSON.")] = False,
) -> int:
    """Check a graph for errors without running it (exit code 1 if there are any)."""
    show.set_debug(flags.debug)
    if states is not None and not activity:
        raise TargetError(f"--states {states} bounds what --activity looks at, and --activity is not given; add it")
    if profile is not None and not time:
        raise TargetError(f"--profile {profile} has durations for --time, and --time is not given; add it")
    measured = None if profile is None else _loaded(profile)
    found = _Findings(target)
    with keep_refusals() as found.problems:
        graph = found.load(flags)
    if graph is not None:
        found.look_at(graph, MAX_STATES if states is None else states, activity=activity)
        if time:
            found.bound(graph, measured)
    if json:
        show.json(found.as_data(activity=activity))
    else:
        for line in found.lines():
            show.write(f"{line}\n")
    if found.refused_file is not None:
        show.wants(found.refused_file)
    return 1 if found.count("error") else 0


class _Findings:
    """What is wrong with a graph, and what it shows about itself."""

    def __init__(self, target: str) -> None:
        self.problems: list[Problem] = []
        self.refused_file: FileError | None = None
        self._name = target
        self._target = target
        self._costs: Sequence[Problem] = ()
        self._activity: ActivityReport | None = None
        self._time: TimeReport | None = None

    def load(self, flags: LoadFlags) -> Graph | None:
        """Build the graph; nothing where its code or its file is refused.

        Raises:
            TargetError: there is no such target, so nothing was looked at.
        """
        try:
            return load_graph(self._target, flags.arg, flags.allow)
        except TargetError as error:
            if not isinstance(error.__cause__, Exception):
                raise
            show.user_traceback(error.__cause__)
            self.problems += _unbuilt(self._target, error, error.__cause__)
        except FileError as error:
            self.problems += error.problems
            self.refused_file = error
        return None

    def look_at(self, graph: Graph, states: int, *, activity: bool) -> None:
        """Check a graph that could be built."""
        self._name = f'graph "{graph.name}"'
        refused = {problem.path.rpartition(" -> ")[2] for problem in self.problems}
        self.problems += [  # an input stays unconnected as a consequence of a refusal
            one for one in graph.check() if not (one.check == "unconnected-input" and one.path in refused)
        ]
        if activity and not self.count("error"):
            self._activity = analyse_activity(graph, max_states=states)
            self.problems += self._activity.problems
        if not self.count("error"):
            self._costs = list(costs_of_deaths(graph))

    def bound(self, graph: Graph, measured: Profile | None) -> None:
        """Bound how long ways take, by declared durations or by those of a profile.

        Raises:
            TargetError: the profile is of another graph.
        """
        if self.count("error"):
            return
        try:
            self._time = analyse_time(graph, None if measured is None else measured.durations(graph))
        except UsageError as error:
            raise TargetError(str(error)) from None
        self.problems += self._time.problems

    def count(self, severity: str) -> int:
        """Return how many problems are as severe as that."""
        return sum(problem.severity == severity for problem in self.problems)

    def as_data(self, *, activity: bool) -> object:
        """Return what `--json` writes."""
        problems = [*self.problems, *self._costs]
        if not (activity or self._time):
            return problems
        found = {"problems": problems, "activity": None if self._activity is None else self._activity.as_data()}
        return found if self._time is None else found | {"time": self._time}

    def lines(self) -> Iterator[str]:
        """Return what a person reads."""
        for cost in self._costs:
            yield f"{cost.path}: {cost.what} ({cost.why})" + (f"; {cost.remedy}" if cost.remedy else "")
        for problem in self.problems:
            yield f"{problem} [{problem.check}]"
        if self._activity is not None:
            yield from self._activity.lines()
        if self._time is not None:
            yield from self._time.lines()
        counts = [_count(self.count(severity), severity) for severity in ("error", "warning")]
        hints = self.count("hint")
        yield f"{self._name}: {', '.join(counts + ([_count(hints, 'hint')] if hints else []))}"


def _loaded(profile: Path) -> Profile:
    try:
        return Profile.load(profile)
    except UsageError as error:
        raise TargetError(str(error)) from None


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
