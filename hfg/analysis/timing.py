"""Checks deadlines before a run: how long after a source has fired each node is done at most.

A source with a rate is a periodic task. It causes waves, see `waves`; a wave that follows others is a task of the same
period, whose jitter is the response time up to there (holistic analysis, Tindell and Clark 1994). The bounds hold
under the assumptions that `TimeReport.assumptions` lists. Depends on `response`, `waves` and the flat graph.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import msgspec

from hfg.analysis.response import Effort, Task, response_times, utilisation
from hfg.analysis.waves import Reach, Wave, reach_of
from hfg.base.bars import bar
from hfg.errors import Problem, UsageError
from hfg.graph import Graph
from hfg.graph.flat import FlatEdge, FlatGraph, FlatNode, flatten
from hfg.graph.flat.deadlines import declared_deadlines, urgencies

_ROUNDS: Final = 200  # of the iteration over groups
_MOST_FIRINGS: Final = 1000  # of a node that are kept apart in one wave
_MOST_REACHED: Final = 500_000  # nodes by all sources with a rate together
_LOOP: Final = "loop"


class PathTime(msgspec.Struct, frozen=True):
    """How long a node takes to be done, counted from the firing of a source.

    Attributes:
      source: path of the source.
      node: path of the node.
      within_s: the bound in seconds; infinity if there is none.
      deadline_s: the earliest that is declared; None if there is none.
      by: who declares it: "" for the node, the label of an edge, or 'group "loop"'.
    """

    source: str
    node: str
    within_s: float
    deadline_s: float | None
    by: str = ""

    @property
    def used(self) -> float | None:
        """The share of the deadline that the bound uses; above 1 it can be missed."""
        return None if self.deadline_s is None else self.within_s / self.deadline_s


class TimeReport(msgspec.Struct, frozen=True):
    """Result of the analysis.

    Attributes:
      paths: a bound for each node that a source with a rate reaches, of those that have a deadline or end a path.
      load: by group, the share of its time that the durations need; groups without threads are part of "loop".
      assumptions: what the bounds assume, and nodes about which nothing is known.
      problems: deadlines that can be missed, and groups with too much work.
    """

    paths: list[PathTime]
    load: dict[str, float]
    assumptions: list[str]
    problems: list[Problem]

    def lines(self) -> Iterator[str]:
        """Yield the report for people: a bar of the budget used for each deadline."""
        for path in self.paths:
            share = "" if path.used is None else f"  {bar(path.used, 20)} {path.used:.0%} of {path.deadline_s:g} s"
            said = "no bound" if path.within_s == math.inf else f"{path.within_s:.6g} s"
            yield f"{path.source} -> {path.node}: {said}{share}" + (f", by {path.by}" if path.by else "")
        for group, load in self.load.items():
            yield f'group "{group}": {load:.0%} of its time'
        for assumption in self.assumptions:
            yield f"assumed: {assumption}"


def analyse_time(graph: Graph, durations: Mapping[str, float] | None = None) -> TimeReport:
    """Bound how long it takes from the firing of each source with a rate to the end of the firings that it causes.

    Args:
      graph: a graph without errors.
      durations: seconds by path of nodes, such as measured ones; `Profile.durations()` has those of a run. They come
        before what nodes declare as `takes_s`, or as the limit `max_duration_s`.

    Returns:
      Bounds under assumptions. They are no guarantee, because durations are declared or measured.

    Raises:
      UsageError: a duration is not a number of seconds, or belongs to no node of the graph, or sources with a rate
        reach more than 500,000 nodes, each counted for each source.
    """
    flat = flatten(graph)
    durations = durations or {}
    known = {node.path for node in flat.nodes}
    for path, seconds in durations.items():
        if type(seconds) not in (int, float) or not 0 <= seconds < math.inf:
            raise UsageError(f'the duration of "{path}" must be seconds from 0 on, got {seconds!r:.80}')
        if path not in known:
            raise UsageError(f'there is a duration of "{path}", and the graph has no such node: leave it out')
    return _Analysis(flat, durations).report()


class _Analysis:
    def __init__(self, flat: FlatGraph, durations: Mapping[str, float]) -> None:
        self.flat = flat
        self.durations = durations
        self.urgencies = urgencies(flat)
        self.unknown: dict[str, None] = {}
        self._effort = Effort()
        sources = [node for node in flat.nodes if node.node._type.is_source]
        self.unrated = [node.path for node in sources if node.options.max_rate_hz is None]
        edges_from: list[list[FlatEdge]] = [[] for _ in flat.nodes]
        for edge in flat.edges:
            if edge.source.node >= 0 and edge.target.node >= 0:
                edges_from[edge.source.node].append(edge)
        self.senders = {index for index, edges in enumerate(edges_from) if edges}
        self.reaches: list[Reach] = []
        reached = 0
        for node in sources:
            if node.options.max_rate_hz is not None:
                self.reaches.append(reach_of(flat, node, edges_from, self._processor))
                reached += len(self.reaches[-1].into)
            if reached > _MOST_REACHED:
                raise UsageError(
                    f"the sources of the graph reach more than {_MOST_REACHED:,} nodes, each counted for "
                    "each source, too many to bound their times: look at parts of the graph"
                )
        self.processors: dict[str, list[Wave]] = {}
        for reach in self.reaches:
            for wave in reach.waves:
                self.processors.setdefault(wave.processor, []).append(wave)

    def report(self) -> TimeReport:
        if not self._settle():
            for waves in self.processors.values():
                for wave in waves:
                    wave.response_s = math.inf
        load = {name: utilisation([self._task(wave) for wave in waves]) for name, waves in self.processors.items()}
        paths = [path for reach in self.reaches for path in self._paths(reach)]
        return TimeReport(paths, load, self._assumptions(), [*_overloads(load), *_misses(paths)])

    # --- tasks --------------------------------------------------------------------------------------------------------

    def _processor(self, node: FlatNode) -> str:
        """Return with what a node shares its time: groups without threads share the loop."""
        group = _group(node)
        spec = self.flat.groups.get(group)
        return group if spec is not None and (spec.threads or spec.process) else _LOOP

    def _policy(self, waves: list[Wave]) -> str:
        """Return the policy of a processor; where several groups share it, nothing is known of their order."""
        groups = {_group(node) for wave in waves for node, _ in wave.nodes}
        spec = self.flat.groups.get(next(iter(groups)))
        return "fair" if len(groups) > 1 else "fifo" if spec is None else spec.policy

    def _takes(self, node: FlatNode) -> float:
        options = node.options
        found = self.durations.get(
            node.path, options.takes_s if options.takes_s is not None else options.max_duration_s
        )
        if found is None:
            self.unknown[node.path] = None
            return 0.0
        return found

    def _task(self, wave: Wave) -> Task:
        rate = wave.source.options.max_rate_hz
        assert rate is not None
        firings: list[float] = []
        for node, times in wave.nodes:
            takes_s = self._takes(node)
            firings += [takes_s] * min(times, _MOST_FIRINGS)
            if times > _MOST_FIRINGS:
                firings.append((times - _MOST_FIRINGS) * takes_s)
        deadlines = {self.urgencies.get(node.index) for node, _ in wave.nodes}
        deadline = next(iter(deadlines)) if len(deadlines) == 1 else None
        priorities = [node.options.priority for node, _ in wave.nodes]
        return Task(
            period_s=1 / rate,
            firings_s=tuple(firings),
            jitter_s=wave.begins_s,
            lowest=min(priorities),
            highest=max(priorities),
            # its age counts from the source on, the deadline of a task from its begin
            deadline_s=math.inf if deadline is None or wave.before else deadline,
            in_order=wave.in_order,
        )

    # --- bounds -------------------------------------------------------------------------------------------------------

    def _settle(self) -> bool:
        """Repeat until no response time changes: each is the jitter of what it starts."""
        for _ in range(_ROUNDS):
            changed = False
            for waves in self.processors.values():
                can_go_on = self._effort.spend(sum(len(wave.nodes) for wave in waves))
                if not can_go_on or any(wave.begins_s == math.inf for wave in waves):
                    bounds = [math.inf] * len(waves)
                else:
                    bounds = response_times([self._task(wave) for wave in waves], self._policy(waves), self._effort)
                for wave, bound in zip(waves, bounds, strict=True):
                    changed = changed or bound > wave.response_s + 1e-9
                    wave.response_s = max(bound, wave.response_s)
            if not changed:
                return True
        return False

    def _paths(self, reach: Reach) -> Iterator[PathTime]:
        for wave in reach.waves:
            for node, _ in wave.nodes:
                ends = node.index not in self.senders
                declared = declared_deadlines(self.flat, node, reach.into[node.index], ends=ends)
                earliest = min(declared, default=None)
                if ends or earliest is not None:
                    yield PathTime(wave.source.path, node.path, wave.response_s, *(earliest or (None,)))

    def _assumptions(self) -> list[str]:
        said = ["each group has a processor of its own, and each firing triggers each of its events at most once"]
        on_loop = [
            name for name, spec in self.flat.groups.items() if not (name == _LOOP or spec.threads or spec.process)
        ]
        if on_loop:
            said[0] = said[0].replace(
                "each group has", f"each group but {', '.join(on_loop)}, which share the loop, has"
            )
        several = [name for name, spec in self.flat.groups.items() if spec.threads > 1]
        if several:
            said.append(f"one thread in each group ({', '.join(several)} has several, which only helps)")
        late = [reach.waves[0].source.path for reach in self.reaches if _may_be_held_up(reach)]
        if late:
            said.append(f"nothing holds up {', '.join(late)}, though what follows can take longer than a period")
        limited = {
            node.path
            for reach in self.reaches
            for wave in reach.waves
            for node, _ in wave.nodes
            if node is not wave.source and node.options.max_rate_hz is not None
        }
        if limited:
            said.append(f"nothing waits for the max_rate_hz of {', '.join(sorted(limited))}")
        ringed = [reach.waves[0].source.path for reach in self.reaches if reach.has_rings]
        if ringed:
            said.append(f"what {', '.join(ringed)} causes goes round rings once")
        if self.unknown:
            said.append(f"no time for {', '.join(self.unknown)}: declare takes_s")
        if self.unrated:
            said.append(f"no work from {', '.join(self.unrated)}: a source without max_rate_hz has no period")
        return said


def _group(node: FlatNode) -> str:
    return node.options.group or _LOOP


def _may_be_held_up(reach: Reach) -> bool:
    """Return whether a source may have to wait until its last token is processed (rule F1)."""
    rate = reach.waves[0].source.options.max_rate_hz
    return rate is not None and any(1 / rate < wave.response_s < math.inf for wave in reach.waves)


def _overloads(load: Mapping[str, float]) -> Iterator[Problem]:
    for group, share in load.items():
        if share > 1:
            yield _problem(
                group, f'group "{group}" needs {share:.0%} of its time', "its waves pile up without end",
                "lower the rates of its sources, or move nodes to another group",
            )  # fmt: skip


def _misses(paths: list[PathTime]) -> Iterator[Problem]:
    for path in paths:
        if path.used is not None and path.used > 1:
            said = "has no bound" if path.within_s == math.inf else f"can take {path.within_s:.6g} s"
            by = f" (by {path.by})" if path.by else ""
            yield _problem(
                path.node, f'the way from "{path.source}" {said}, its deadline_s is {path.deadline_s:g}{by}',
                "work of other waves comes first, or takes too long",
                "give it a higher priority or a group of its own, or a later deadline",
            )  # fmt: skip


def _problem(path: str, what: str, why: str, remedy: str) -> Problem:
    fields: dict[str, Any] = {"path": path, "severity": "warning", "what": what, "why": why, "remedy": remedy}
    return Problem(**fields, check="deadline")
