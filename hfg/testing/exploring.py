"""Explore a graph: run it under many schedules and look for one that breaks something."""

from __future__ import annotations

import inspect
import random
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import hfg
from hfg.errors import MonitorViolated, RunError, UsageError, in_words
from hfg.graph import Graph
from hfg.monitors import Property, watch
from hfg.testing.conformance import Divergence, describe, replay
from hfg.testing.invariants import Invariant, broken, of_graph
from hfg.testing.judging import properties_of, violated_in
from hfg.testing.recording import Recorder
from hfg.testing.reference.structure import dissolve
from hfg.trace import CallStarted, FiringStarted, TokenDrained

__all__ = ["Exploration", "ScheduleFailure", "explore"]


@dataclass(frozen=True)
class Exploration:
    """What was found: nothing wrong.

    Attributes:
      runs: how many schedules were tried.
      outcomes: how often runs ended how.
      results: how many different results there were; 1 where rule F7 holds.
    """

    runs: int
    outcomes: dict[str, int]
    results: int


class ScheduleFailure(AssertionError):
    """A schedule breaks an invariant, or gives another result than the first one.

    Attributes:
      seed: `hfg.run(build(), clock="virtual", policy="random", seed=seed)` does it again.
      trace: of that run.
    """

    def __init__(self, why: str, seed: int, trace: Recorder) -> None:
        self.seed = seed
        self.trace = trace
        decisions = [event for event in trace if isinstance(event, FiringStarted | CallStarted)]
        schedule = [f"    {describe(event)}" for event in decisions[:40]]
        if len(decisions) > 40:
            schedule.append(f"    ... and {len(decisions) - 40} more")
        again = f'hfg.run(build(), clock="virtual", policy="random", seed={seed})'
        super().__init__(
            "\n".join([why, f"  again with {again}", f"  its schedule ({len(decisions)} decisions):", *schedule])
        )


@dataclass
class _Tried:
    seed: int
    trace: Recorder
    outcome: str
    result: Any
    wrong: list[str]
    error: str = ""

    @property
    def length(self) -> int:
        return sum(isinstance(event, FiringStarted | CallStarted) for event in self.trace)


def explore(
    build: Callable[[], Graph],
    *,
    runs: int = 100,
    invariants: Iterable[Invariant] | None = None,
    monitors: Mapping[str, Property | str] | None = None,
    result: Callable[[Recorder], Any] | None = None,
    seed: int = 0,
    until_s: float | None = None,
    conform: bool = False,
    debug: bool = True,
) -> Exploration:
    """Run a graph under many seeded schedules in virtual time.

    Args:
      build: a function that returns a new graph for every run.
      runs: number of schedules, at least 1.
      invariants: functions that take a trace and return a description of each problem, or use `assert`. Default: all of
        `hfg.testing.invariants`.
      monitors: what must hold in every run, by name: properties, or their texts. The monitors that the graph declares
        judge each run, too. A violation is a failure with the stretch that shows it.
      result: a function that takes a trace and returns what must be the same for every schedule. Default: how the run
        ended and, if the graph has only synchronous edges, the sequences of tokens that were used (rule F7).
      seed: seed of the schedules.
      until_s: end every run at this time.
      conform: also compare each run with the reference oracle.
      debug: check every value against the type of its port, and that shared values are not modified.

    Returns:
      Counts of runs, outcomes and results.

    Raises:
      ScheduleFailure: a schedule fails; the error has the shortest one that was found.
      UsageError: there is nothing to explore.

    Examples:
      >>> from hfg.testing.nodes import double, script, sink
      >>> def build() -> Graph:
      ...     graph = hfg.Graph()
      ...     _ = graph.add(script()) >> graph.add(double()) >> graph.add(sink())
      ...     return graph
      >>> explore(build, runs=5)
      Exploration(runs=5, outcomes={'done': 5}, results=1)
    """
    graph = _built(build)
    _need_counts(runs, seed)
    checks = of_graph(graph) if invariants is None else _need_functions(invariants)
    if result is not None and not callable(result):
        raise UsageError(f"result= is a function that takes a trace, got {result!r:.80}")
    measure = result or _default_result(graph)
    properties = properties_of(monitors)
    seeds = random.Random(seed)
    outcomes: Counter[str] = Counter()
    first = failing = other = None  # of all traces only these are kept: a thousand do not fit into memory
    failures = 0
    for _ in range(runs):
        one = _try(build, seeds.randrange(2**31), checks, properties, measure, until_s, conform, debug)
        first = first or one
        outcomes[one.outcome] += 1
        if one.wrong:
            failures += 1
            failing = _shorter(failing, one)
        elif one.result != first.result:
            other = _shorter(other, one)
    if failing is not None:
        raise ScheduleFailure(
            f"{failures} of {runs} schedules fail:\n  " + "\n  ".join(failing.wrong), failing.seed, failing.trace
        )
    if first is not None and other is not None:
        raise ScheduleFailure(
            f"the result depends on the schedule:\n{_difference(first, other)}", other.seed, other.trace
        )
    return Exploration(runs, dict(outcomes), min(runs, 1))


def _built(build: object) -> Graph:
    """Make the graph once, to see whether it can be made."""
    again = "explore(build) takes the function that builds the graph, for each run has a graph of its own"
    if isinstance(build, Graph):
        raise UsageError(f'{again}; got graph "{build.name}": write def build() -> hfg.Graph: ... around it')
    if not callable(build):
        raise UsageError(f"{again}; got {build!r:.80}")
    try:
        inspect.signature(build).bind()
    except (TypeError, ValueError) as error:
        raise UsageError(f"{again}, without arguments: {error}; write explore(lambda: build(...))") from None
    graph = build()
    if inspect.iscoroutine(graph):
        graph.close()
        raise UsageError(f"{again}; this one is async: let a plain function build it")
    if not isinstance(graph, Graph):
        raise UsageError(f"{again}; this one returned {graph!r:.80}: return the graph")
    return graph


def _need_counts(runs: object, seed: object) -> None:
    if type(runs) is not int or runs < 1:
        raise UsageError(f"runs= is how many schedules to try, 1 at least, got {runs!r}: nothing would be explored")
    if type(seed) is not int:
        raise UsageError(f"seed= is a whole number, got {seed!r}")


def _need_functions(invariants: object) -> list[Invariant]:
    if not isinstance(invariants, Iterable) or isinstance(invariants, str):
        raise UsageError(f"invariants= is a list of functions, got {invariants!r:.80}: write invariants=[...]")
    found = list(invariants)
    for one in found:
        if not callable(one) or isinstance(one, type):
            raise UsageError(f"an invariant is a function that takes a trace, got {one!r:.80}")
    return found


def _shorter(known: _Tried | None, new: _Tried) -> _Tried:
    return new if known is None or new.length < known.length else known


def _difference(first: _Tried, other: _Tried) -> str:
    where, one, two = _parting(first.result, other.result)
    failed = [f"\n  with seed {run.seed} it failed: {run.error}" for run in (first, other) if run.error]
    said = f"  result{where} is {one!r} with seed {first.seed}\n  result{where} is {two!r} with seed {other.seed}"
    return said + "".join(failed)


def _parting(one: Any, two: Any) -> tuple[str, Any, Any]:
    """Go down to the first part in which two results differ; whole results may fill pages."""
    if isinstance(one, list | tuple) and type(one) is type(two):
        parts = [(f"[{index}]", *pair) for index, pair in enumerate(zip(one, two, strict=False))]
        rest = min(len(one), len(two))
        parts.append((f"[{rest}:]", one[rest:], two[rest:]))
    elif isinstance(one, dict) and isinstance(two, dict) and one.keys() == two.keys():
        parts = [(f"[{key!r}]", one[key], two[key]) for key in one]
    else:
        return "", one, two
    for where, left, right in parts:
        if left != right:
            if where.endswith(":]"):
                return where, left, right
            inside, *pair = _parting(left, right)
            return where + inside, *pair
    return "", one, two


def _try(
    build: Callable[[], Graph],
    seed: int,
    checks: list[Invariant],
    properties: Mapping[str, Property],
    measure: Callable[[Recorder], Any],
    until_s: float | None,
    conform: bool,
    debug: bool,
) -> _Tried:
    trace = Recorder()
    outcome, failed = "failed", ""
    wrong: list[str] = []
    options: dict[str, Any] = {"policy": "random", "seed": seed, "until_s": until_s, "trace": trace, "debug": debug}
    runs: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        runs.append(run)
        if properties:
            watch(run, on_violation="note", **properties)

    try:
        outcome = hfg.run(build(), clock="virtual", begin=begin, **options).outcome
    except RunError as error:
        outcome, failed = trace.outcome or type(error).__name__, str(error)
        wrong = [failed] if isinstance(error, MonitorViolated) else []
    wrong = [said for run in runs for said in violated_in(run)] or wrong  # facts of the graph are not monitors
    wrong += broken(trace, checks)
    if conform and not wrong:
        try:
            replay(build, trace, until_s=until_s)
        except Divergence as divergence:
            wrong = [str(divergence)]
    measured = None
    try:
        measured = measure(trace)
    except Exception as error:
        wrong.append(f"result: {in_words(error)}")
    return _Tried(seed, trace, outcome, measured, wrong, failed)


def _default_result(graph: Graph) -> Callable[[Recorder], Any]:
    edges = dissolve(graph).edges
    if any(edge.is_event for edge in edges):
        return lambda trace: trace.outcome
    sources = {leaf.index for leaf in dissolve(graph).leaves if leaf.node._type.is_source}
    labels = [edge.label for edge in edges if edge.target.owner not in sources]
    return lambda trace: (trace.outcome, {label: _needed(trace, label) for label in labels})


def _needed(trace: Recorder, label: str) -> list[tuple[str, int]]:
    """Return the tokens that had a use: F7 leaves open where a source that sends only to ended nodes stops (R5)."""
    drained = {event.token.sequence for event in trace.of(TokenDrained) if event.edge == label}
    return [(repr(t.value), t.activity) for t in trace.tokens(label) if t.sequence not in drained]
