"""Lets debug runs check the facts that a graph states about activity.

A node counts if it is active, and so does each token with +1 that is in transit to it. The tokens that one firing or
call takes and sends belong together, so facts are judged when it is over (rules A5, A6). Depends on the engine.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, Final

from hfg.engine import Run
from hfg.errors import MonitorViolated
from hfg.graph.structure.facts import Fact
from hfg.graph.structure.level import inside
from hfg.graph.structure.naming import path_of
from hfg.nodetypes.node import Node
from hfg.trace import ActivityChanged, CallEnded, FiringEnded, StructureChanged, TokenSent, TraceEvent

__all__ = ["watch_facts"]

_STRETCH: Final = 16


def watch_facts(run: Run) -> None:
    """Let a run fail when a fact about its graph is violated. Facts about nodes in other processes are not checked."""
    run.trace(_Watch(run).see)


class _Watch:
    """The facts of one run."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.core = run._engine.core
        self.checks: list[_Check] = []
        self.find()

    def find(self) -> None:
        """Find the facts, and where their nodes are now."""
        begun = {check.fact for check in self.checks if check.has_begun}
        here = {worker.path for worker in self.core.workers}
        checks = [_Check(fact, self.core, has_begun=fact in begun) for fact in self.run.graph.facts]
        self.checks = [check for check in checks if check.paths <= here]

    def see(self, event: TraceEvent) -> None:
        """Follow the trace."""
        if isinstance(event, StructureChanged):
            self.find()
            return
        for check in self.checks:
            check.see(event)
            if check.has_begun and isinstance(event, FiringEnded | CallEnded):
                broken = check.broken(event.time)
                if broken:
                    self.checks = []
                    self.run._engine.finish("failed", MonitorViolated(broken))
                    return


class _Check:
    """One fact.

    Attributes:
      paths: all nodes that count.
      has_begun: activity has come to one of them.
    """

    def __init__(self, fact: Fact, core: Any, *, has_begun: bool) -> None:
        self.fact = fact
        self.paths = {path for node in fact.nodes for path in _paths_in(node)}
        self.has_begun = has_begun
        self._workers = [worker for worker in core.workers if worker.path in self.paths and worker.scope is None]
        self._into = {edge.label: edge for edge in core.edges if _target(edge.label) in self.paths}
        self._stretch: deque[str] = deque(maxlen=_STRETCH)

    def see(self, event: TraceEvent) -> None:
        """Note what shows how a violation came about."""
        if isinstance(event, ActivityChanged) and event.node in self.paths:
            change = "becomes active" if event.active else "is no longer active"
            self._note(event, f'"{event.node}" {change} ({event.cause})')
        elif isinstance(event, TokenSent) and event.token.activity == 1 and event.edge in self._into:
            self._note(event, f'"{event.edge}" gets +1')

    def _note(self, event: TraceEvent, text: str) -> None:
        self.has_begun = True
        self._stretch.append(f"\n  {event.time:.6g} s  {text}")

    def broken(self, now: float) -> str:
        """Say how the fact is violated; "" if it is not."""
        there = [f'"{one.path}" is active' for one in self._workers if one.active]
        there += [f'activity is in transit to "{one.path}"' for one in self._workers if one.brings_activity()]
        for label, edge in self._into.items():
            there += [f'activity lies on "{label}"' for token in edge.contents() if token.activity == 1]
        if len(there) == 1 or (not there and self.fact.claim == "at most one"):
            return ""
        return (
            f"the graph states that {self.fact}, but after {now:.6g} s {' and '.join(there) or 'none of them is'}; "
            f"correct the code or the edges by which the activity moves, or take the fact back{''.join(self._stretch)}"
        )


def _target(label: str) -> str:
    return label.rpartition(" -> ")[2].rpartition(".")[0]


def _paths_in(node: Node) -> Iterator[str]:
    """Yield the path of a node, or of all nodes inside a subgraph."""
    waiting = [node]
    for one in waiting:
        within = inside(one)
        if within is None:
            yield path_of(one)
        else:
            waiting += within.nodes.values()
