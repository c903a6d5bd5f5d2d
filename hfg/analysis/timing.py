"""Checks deadlines before a run: how long after a source has fired each node is done at most.

A source with a rate is a periodic task. Its wave in a group consists of all nodes of the group that it reaches over
synchronous edges. Where an edge leads to another group, or is an event edge, another task of the same period begins,
whose jitter is the response time up to there (holistic analysis, Tindell and Clark 1994). The bounds hold under the
assumptions that `TimeReport.assumptions` lists. Depends on `response` and the flat graph.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import msgspec

from hfg.analysis.response import Task, response_times, utilisation
from hfg.errors import Problem
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph, FlatNode, flatten

_ROUNDS = 200  # of the iteration over groups


class PathTime(msgspec.Struct, frozen=True):
    """How long a node takes to be done, counted from the firing of a source.

    Attributes:
      source: path of the source.
      node: path of the node.
      within_s: the bound in seconds; infinity if there is none.
      deadline_s: what the node declares; None if nothing.
    """

    source: str
    node: str
    within_s: float
    deadline_s: float | None

    @property
    def used(self) -> float | None:
        """The share of the deadline that the bound uses; above 1 it can be missed."""
        return None if self.deadline_s is None else self.within_s / self.deadline_s


class TimeReport(msgspec.Struct, frozen=True):
    """Result of the analysis.

    Attributes:
      paths: a bound for each node that a source with a rate reaches, of those that declare a deadline or end a path.
      load: by group, the share of its time that the declared durations need.
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
            bar = "" if path.used is None else f"  {_bar(path.used)} {path.used:.0%} of {path.deadline_s:g} s"
            said = "no bound" if path.within_s == math.inf else f"{path.within_s:.6g} s"
            yield f"{path.source} -> {path.node}: {said}{bar}"
        for group, load in self.load.items():
            yield f'group "{group}": {load:.0%} of its time'
        for assumption in self.assumptions:
            yield f"assumed: {assumption}"


def analyse_time(graph: Graph, durations: Mapping[str, float] | None = None) -> TimeReport:
    """Bound how long it takes from the firing of each source with a rate to the end of the firings that it causes.

    Args:
      graph: a graph without errors.
      durations: seconds by path of nodes, such as measured ones, `{path: node.busy.p99_s}` of `run.statistics()`. They
        come before what nodes declare as `takes_s`, or as the limit `max_duration_s`.

    Returns:
      Bounds under assumptions. They are no guarantee, because durations are declared or measured.
    """
    return _Analysis(flatten(graph), durations or {}).report()


@dataclass(eq=False)
class _Wave:
    """The nodes that one source starts in one group at one entry."""

    source: FlatNode
    group: str
    nodes: list[FlatNode]
    before: _Wave | None  # the one that starts it
    response_s: float = 0.0
    entries: list[FlatNode] = field(default_factory=list)


class _Analysis:
    def __init__(self, flat: FlatGraph, durations: Mapping[str, float]) -> None:
        self.flat = flat
        self.durations = durations
        self.unknown: list[str] = []
        self.unrated = [
            node.path for node in flat.nodes if node.node._type.is_source and node.options.max_rate_hz is None
        ]
        self.waves = [
            wave
            for node in flat.nodes
            if node.node._type.is_source and node.options.max_rate_hz is not None
            for wave in self._waves(node)
        ]

    # --- waves --------------------------------------------------------------------------------------------------------

    def _waves(self, source: FlatNode) -> list[_Wave]:
        """Return what a source starts; each node is entered once, so cycles end."""
        first = _Wave(source, _group(source), [], None, entries=[source])
        found, entered = [first], {source.index}
        for wave in found:  # grows
            waiting = list(wave.entries)
            while waiting:
                node = waiting.pop(0)
                wave.nodes.append(node)
                for edge in self.flat.edges:
                    target = edge.target.node
                    if edge.source.node != node.index or target < 0 or target in entered:
                        continue
                    entered.add(target)
                    other = self.flat.nodes[target]
                    if edge.source.kind == "output" and _group(other) == wave.group and not edge.options.initial:
                        waiting.append(other)
                    else:
                        found.append(_Wave(source, _group(other), [], wave, entries=[other]))
        return found

    def _takes(self, node: FlatNode) -> float:
        options = node.options
        found = self.durations.get(
            node.path, options.takes_s if options.takes_s is not None else options.max_duration_s
        )
        if found is None:
            self.unknown.append(node.path)
            return 0.0
        return found

    def _task(self, wave: _Wave) -> Task:
        rate = wave.source.options.max_rate_hz
        assert rate is not None
        deadlines = {node.options.deadline_s for node in wave.nodes}
        priorities = [node.options.priority for node in wave.nodes]
        deadline = next(iter(deadlines)) if len(deadlines) == 1 else None
        return Task(
            period_s=1 / rate,
            firings_s=tuple(self._takes(node) for node in wave.nodes),
            jitter_s=0.0 if wave.before is None else wave.before.response_s,
            lowest=min(priorities),
            highest=max(priorities),
            # its age counts from the source on, the deadline of a task from its begin
            deadline_s=math.inf if deadline is None or wave.before is not None else deadline,
        )

    # --- bounds -------------------------------------------------------------------------------------------------------

    def report(self) -> TimeReport:
        groups: dict[str, list[_Wave]] = {}
        for wave in self.waves:
            groups.setdefault(wave.group, []).append(wave)
        settled = self._settle(groups)
        if not settled:
            for wave in self.waves:
                wave.response_s = math.inf
        load = {name: utilisation([self._task(wave) for wave in waves]) for name, waves in groups.items()}
        paths = list(self._paths())
        return TimeReport(paths, load, self._assumptions(), [*_overloads(load), *_misses(paths)])

    def _settle(self, groups: Mapping[str, list[_Wave]]) -> bool:
        """Repeat until no response time changes: each is the jitter of what it starts."""
        for _ in range(_ROUNDS):
            changed = False
            for name, waves in groups.items():
                spec = self.flat.groups.get(name)
                if any(wave.before is not None and wave.before.response_s == math.inf for wave in waves):
                    bounds = [math.inf] * len(waves)
                else:
                    policy = "fifo" if spec is None else spec.policy
                    bounds = response_times([self._task(wave) for wave in waves], policy)
                for wave, bound in zip(waves, bounds, strict=True):
                    changed = changed or bound > wave.response_s + 1e-9
                    wave.response_s = max(bound, wave.response_s)
            if not changed:
                return True
        return False

    def _paths(self) -> Iterator[PathTime]:
        senders = {edge.source.node for edge in self.flat.edges if edge.target.node >= 0}
        for wave in self.waves:
            for node in wave.nodes:
                if node.options.deadline_s is not None or node.index not in senders:
                    yield PathTime(wave.source.path, node.path, wave.response_s, node.options.deadline_s)

    def _assumptions(self) -> list[str]:
        said = ["each group has a processor of its own, and each firing triggers each of its events at most once"]
        several = [name for name, spec in self.flat.groups.items() if spec.threads > 1]
        if several:
            said.append(f"one thread in each group ({', '.join(several)} has several, which only helps)")
        unknown = list(dict.fromkeys(self.unknown))
        if unknown:
            said.append(f"no time for {', '.join(unknown)}: declare takes_s")
        if self.unrated:
            said.append(f"no work from {', '.join(self.unrated)}: a source without max_rate_hz has no period")
        return said


def _group(node: FlatNode) -> str:
    return node.options.group or "loop"


def _bar(used: float) -> str:
    filled = 20 if used >= 1 else round(20 * used)
    return "█" * filled + "░" * (20 - filled)


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
            yield _problem(
                path.node, f'the way from "{path.source}" {said}, its deadline_s is {path.deadline_s:g}',
                "work of other waves comes first, or takes too long",
                "give it a higher priority or a group of its own, or a later deadline",
            )  # fmt: skip


def _problem(path: str, what: str, why: str, remedy: str) -> Problem:
    fields: dict[str, Any] = {"path": path, "severity": "warning", "what": what, "why": why, "remedy": remedy}
    return Problem(**fields, check="deadline")
