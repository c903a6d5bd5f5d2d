"""Running a machine to its end under a chosen or a random schedule, and what it did."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hfg.base.token import Token
from hfg.errors import UsageError
from hfg.testing.reference.machine import Move, ReferenceMachine
from hfg.trace import ActivityChanged, QueueGrown, TokenDrained, TokenDropped, TokenSent, TraceEvent


@dataclass(frozen=True)
class ReferenceReport:
    """What a reference run did.

    Attributes:
      outcome: as in the report of a run: "done", "stopped", "until", "failed", "stalled", "aborted"; "waiting" if code
        waits for what never comes.
      tokens: what was put on each edge, in order.
      activity: each change of A(v): path and new value, in order.
      dropped, drained, grown: how often, by edge.
      events: everything that was seen.
      moves: the schedule that was taken; `choose` can take it again.
      error: why the run failed.
    """

    outcome: str
    tokens: dict[str, list[Token[Any]]]
    activity: list[tuple[str, bool]]
    dropped: dict[str, int]
    drained: dict[str, int]
    grown: dict[str, int]
    events: list[TraceEvent] = field(repr=False)
    moves: list[Move] = field(repr=False)
    error: BaseException | None = None

    def values(self, edge: str) -> list[Any]:
        """Return the values and markers on one edge."""
        return [token.value for token in self.tokens[edge]]


def reference_run(
    graph: Any,
    *,
    seed: int | None = None,
    choose: Callable[[list[Move]], Move] | None = None,
    until_s: float | None = None,
    max_moves: int = 100_000,
) -> ReferenceReport:
    """Run a graph by the letter of the rules, in virtual time.

    Args:
      graph: as built; it is not changed, its nodes are copied.
      seed: takes a random permitted move each time; without it the first.
      choose: takes the moves itself.
      until_s: ends the run at that time.
      max_moves: for graphs that would never end.

    Raises:
      RuntimeError: after `max_moves` moves the run is not over.
      UsageError: it is not a graph.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import script, sink
      >>> graph = hfg.Graph()
      >>> _ = graph.add(script()) >> graph.add(sink())
      >>> reference_run(graph).values("script.out -> sink.value")
      [1, 2, 3, END]
    """
    machine = ReferenceMachine(graph, until_s=until_s)
    if choose is not None and not callable(choose):
        raise UsageError(f"choose= is a function that takes a list of moves and gives one back, got {choose!r:.80}")
    pick = choose or (random.Random(seed).choice if seed is not None else lambda moves: moves[0])
    taken: list[Move] = []
    machine.start()
    while moves := machine.moves():
        if len(taken) == max_moves:
            machine.close()
            raise RuntimeError(f"the run is not over after {max_moves} moves; give until_s, or bound its sources")
        taken.append(pick(moves))
        machine.apply(taken[-1])
    return _report(machine, taken)


def _report(machine: ReferenceMachine, moves: list[Move]) -> ReferenceReport:
    events = machine.observed
    tokens: dict[str, list[Token[Any]]] = {line.edge.label: [] for line in machine.lines}
    for event in events:
        if isinstance(event, TokenSent):
            tokens[event.edge].append(event.token)
    return ReferenceReport(
        outcome=machine.outcome or "waiting",
        tokens=tokens,
        activity=[(event.node, event.active) for event in events if isinstance(event, ActivityChanged)],
        dropped=dict(
            Counter(event.edge for event in events if isinstance(event, TokenDropped) and event.reason != "stopped")
        ),
        drained=dict(Counter(event.edge for event in events if isinstance(event, TokenDrained))),
        grown=dict(Counter(event.edge for event in events if isinstance(event, QueueGrown))),
        events=events,
        moves=moves,
        error=machine.error,
    )
