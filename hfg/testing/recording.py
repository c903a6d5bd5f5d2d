"""A recorder: takes the trace of a run and answers the questions that tests ask of it."""

from __future__ import annotations

from typing import Any, TypeVar

from hfg.base.token import Token
from hfg.trace import (
    ActivityChanged,
    CallStarted,
    EventTriggered,
    FiringStarted,
    RunEnded,
    TokenDrained,
    TokenDropped,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

__all__ = ["Recorder", "recorder"]

E = TypeVar("E", bound=TraceEvent)


class Recorder(list[TraceEvent]):
    """A list of trace events, with queries. Pass it to a run as `trace=`.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import script, sink
      >>> graph, seen = hfg.Graph(), Recorder()
      >>> _ = graph.add(script()) >> graph.add(sink())
      >>> report = hfg.run(graph, clock="virtual", trace=seen)
      >>> seen.values("script.out -> sink.value")
      [1, 2, 3, END]
      >>> seen.firings("sink")
      4
    """

    def __call__(self, event: TraceEvent) -> None:
        """Take one event."""
        self.append(event)

    def of(self, kind: type[E]) -> list[E]:
        """Return the events of one kind."""
        return [event for event in self if isinstance(event, kind)]

    def edges(self) -> list[str]:
        """Return the labels of all edges that tokens were sent over, in order of first use."""
        return list(dict.fromkeys(event.edge for event in self.of(TokenSent)))

    def tokens(self, edge: str) -> list[Token[Any]]:
        """Return every token that was put on an edge, given by its label or only its source, "camera.out"."""
        labels = self._labels(edge)
        first = labels[:1]
        return [event.token for event in self.of(TokenSent) if event.edge in first]

    def values(self, edge: str) -> list[Any]:
        """Return the values and markers that were put on an edge."""
        return [token.value for token in self.tokens(edge)]

    def signals(self, event: str) -> list[Any]:
        """Return the values of an event's signals, even if nothing was connected."""
        return [one.token.value for one in self.of(EventTriggered) if one.event == event]

    def taken(self, edge: str) -> list[Any]:
        """Return the values that firings and calls took from an edge."""
        return [event.token.value for event in self.of(TokenTaken) if event.edge in self._labels(edge)]

    def dropped(self, edge: str) -> list[Any]:
        """Return the values that were dropped on an edge."""
        return [event.token.value for event in self.of(TokenDropped) if event.edge in self._labels(edge)]

    def drained(self, edge: str) -> list[Any]:
        """Return the values that were drained on an edge (F12)."""
        return [event.token.value for event in self.of(TokenDrained) if event.edge in self._labels(edge)]

    def firings(self, node: str) -> int:
        """Return the number of firings of a node, including silent ones."""
        return sum(event.node == node for event in self.of(FiringStarted))

    def calls(self, node: str) -> list[str]:
        """Return the slots of a node that were called, in order."""
        return [event.slot for event in self.of(CallStarted) if event.node == node]

    def activity(self, node: str | None = None) -> list[tuple[float, str, bool]]:
        """Return each change of activity as (time, node, active), of one node or of all nodes."""
        return [
            (event.time, event.node, event.active) for event in self.of(ActivityChanged) if node in (None, event.node)
        ]

    def active_at_end(self) -> list[str]:
        """Return the nodes that were active at the end."""
        state = {event.node: event.active for event in self.of(ActivityChanged)}
        return [node for node, active in state.items() if active]

    @property
    def outcome(self) -> str | None:
        """How the run ended; None if it has not."""
        ends = self.of(RunEnded)
        return ends[-1].outcome if ends else None

    def _labels(self, edge: str) -> list[str]:
        known = dict.fromkeys(
            event.edge for event in self if isinstance(event, TokenSent | TokenTaken | TokenDropped | TokenDrained)
        )
        exact = [label for label in known if label == edge]
        return exact or [label for label in known if label.partition(" -> ")[0] == edge]


def recorder() -> Recorder:
    """Make an empty recorder."""
    return Recorder()
