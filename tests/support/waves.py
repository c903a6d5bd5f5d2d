"""Do waves go depth first? A replay that also looks at who goes next under first-in first-out (rule R2).

The oracle permits every order of those that are enabled, so a replay alone says nothing of R2. Here the firings that a
sending enables over sequential edges of its own group are kept on a stack, one a group; while one of them may still
start, no other firing of its group may. Calls of slots, and waves among each other, are not looked at.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hfg.testing.conformance import Divergence, Replay
from hfg.testing.reference import Move
from hfg.testing.reference.state import Station
from hfg.trace import CallStarted, FiringStarted, TokenDrained, TokenSent, TraceEvent

__all__ = ["DepthFirst", "replay_depth_first"]


class DepthFirst(Replay):
    """A replay of a run whose groups all have the policy "fifo"."""

    def __init__(self, graph: Any, *, until_s: float | None = None) -> None:
        self._following: dict[
            str, list[tuple[Station, int]]
        ] = {}  # by group: who goes next, and its place; the top last
        super().__init__(graph, until_s=until_s)

    def _apply(self, move: Move) -> None:
        machine = self.machine
        before = {id(station): station.place for station in machine.stations}
        mark = len(machine.observed)
        super()._apply(move)
        called: dict[int, int] = {}  # by station: its first token in a slot
        last: dict[int, tuple[int, TokenSent]] = {}  # by station: the last token that this move has laid on its inputs
        seen = machine.observed_since(mark)
        drained = {(event.edge, event.token.sequence) for event in seen if isinstance(event, TokenDrained)}
        for at, event in enumerate(seen):
            if not isinstance(event, TokenSent) or (event.edge, event.token.sequence) in drained:
                continue
            line = machine.labels[event.edge]
            if not machine.is_called(line):
                last[line.edge.target.owner] = (at, event)
            elif self._is_sequential(event):
                called.setdefault(line.edge.target.owner, at)
        # Who has a call by the same sending does both in one turn.
        turns = {owner: min(at, called.get(owner, at)) for owner, (at, _) in last.items() if owner >= 0}
        for owner in sorted(turns, key=turns.__getitem__, reverse=True):
            station = machine.stations[owner]
            # What is busy is not enabled by what it gets now, but by the end of what it does (F1).
            idle = station.flight is None and station.path != move.node
            enabled = idle and station.place != before[id(station)]
            if enabled and station.place is not None and self._is_sequential(last[owner][1]):
                self._following.setdefault(station.leaf.options.group or "loop", []).append((station, station.place))

    def _is_sequential(self, event: TokenSent) -> bool:
        """Whether it was sent by an output of a node to another, over a sequential edge of one group."""
        machine = self.machine
        line = machine.labels[event.edge]
        source, target = line.edge.source, line.edge.target
        if line.edge.is_event or line.delay or source.owner < 0 or target.owner < 0:
            return False
        groups = {machine.stations[owner].leaf.options.group for owner in (source.owner, target.owner)}
        return len(groups) == 1 and not machine.is_pipelined(line)

    def _begin(self, event: FiringStarted | CallStarted) -> None:
        owner = self.machine.paths.get(event.node, -1)
        if isinstance(event, FiringStarted) and owner >= 0:
            station = self.machine.stations[owner]
            wanted = self._next_of(station.leaf.options.group or "loop")
            if wanted is not None and wanted is not station:
                raise Divergence(f'"{wanted.path}" was enabled by a wave and goes first (R2)', event, self)
        super()._begin(event)

    def _next_of(self, group: str) -> Station | None:
        """Who is on top of the stack and may start now; those that are not enabled any more are let go."""
        stack = self._following.get(group, [])
        while stack:
            station, place = stack[-1]
            if station.place == place and self.machine.may_fire(station.leaf.index):
                waits = station.flight is not None or self.machine.next_of(station.leaf.index) != Move(
                    "fire", station.path
                )
                return None if waits else station
            stack.pop()
        return None


def replay_depth_first(build: Any, events: Iterable[TraceEvent]) -> None:
    """Check the trace of a whole run as `replay` does, and that each wave goes depth first (R2).

    Args:
      build: makes the graph that was run, afresh.
      events: all events of the run; all its groups have the policy "fifo".

    Raises:
      Divergence: at the first event that the rules do not explain.
    """
    seen = list(events)
    replaying = DepthFirst(build())
    try:
        for event in seen:
            replaying.see(event)
        replaying.check_over()
    finally:
        replaying.machine.close()
