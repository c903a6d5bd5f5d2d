"""Invariants of every run of every graph, as functions over its trace; each returns a list of violations.

They need no oracle, so they can be asked of a user's own graph: `explore(build, invariants=[no_token_lost, ...])`.
"""

from __future__ import annotations

import inspect
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from hfg.base.token import NO_MESSAGE
from hfg.errors import UsageError, in_words
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    CallEnded,
    CallStarted,
    FiringEnded,
    FiringStarted,
    NodeEnabled,
    NodeEnded,
    RunEnded,
    TokenDrained,
    TokenDropped,
    TokenProcessed,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

__all__ = [
    "ALL",
    "Invariant",
    "activity_changes_alternate",
    "activity_is_carried",
    "as_many_firings_as_allowed",
    "broken",
    "ended_nodes_rest",
    "modifiers_fit",
    "no_token_lost",
    "numbers_rise",
    "of_graph",
    "one_thing_at_a_time",
    "one_unprocessed_token",
    "order_is_kept",
    "time_never_goes_back",
]

Invariant = Callable[[list[TraceEvent]], Iterable[str] | None]
"""Gives sentences about what is wrong, or None; it may also `assert`."""


def no_token_lost(events: list[TraceEvent]) -> list[str]:
    """Every token that was put is taken, drained or dropped once if the run ends by itself (F8, P5)."""
    put: dict[str, list[int]] = defaultdict(list)
    gone: dict[str, list[int]] = defaultdict(list)
    for event in events:
        match event:
            case TokenSent(edge=edge, token=token):
                put[edge].append(token.sequence)
            case TokenTaken(edge=edge, token=token) | TokenDrained(edge=edge, token=token):
                gone[edge].append(token.sequence)
            case TokenDropped(edge=edge, token=token, reason=reason):
                if reason != "ended" or token.sequence not in gone[edge]:  # else taken, by the firing that ended (F4)
                    gone[edge].append(token.sequence)
    done = any(isinstance(event, RunEnded) and event.outcome == "done" for event in events)
    found = []
    for edge in {**put, **gone}:
        numbers = [number for number in gone[edge] if number]  # initial tokens have none
        if len(set(numbers)) != len(numbers):
            found.append(f'on "{edge}" a token was used twice: {_doubles(numbers)}')
        if strange := sorted(set(numbers) - set(put[edge])):
            found.append(f'on "{edge}" tokens were used that nobody sent: {strange}')
        if done and (lost := sorted(set(put[edge]) - set(numbers))) and not _left(events, edge):
            found.append(f'on "{edge}" tokens were lost: {lost}')
    return found


def order_is_kept(events: list[TraceEvent]) -> list[str]:
    """Tokens of one edge are used in the order in which they were put (P5)."""
    last: dict[str, int] = {}
    found = []
    for event in events:
        if isinstance(event, TokenTaken | TokenDrained) and event.token.sequence:
            if event.token.sequence <= last.get(event.edge, 0):
                found.append(f'on "{event.edge}" number {event.token.sequence} was used after {last[event.edge]}')
            last[event.edge] = event.token.sequence
    return found


def numbers_rise(events: list[TraceEvent]) -> list[str]:
    """The numbers on an edge are 1, 2, 3 ... (T5)."""
    last: dict[str, int] = defaultdict(int)
    found = []
    for event in events:
        if isinstance(event, TokenSent):
            if event.token.sequence != last[event.edge] + 1:
                found.append(f'on "{event.edge}" number {event.token.sequence} follows {last[event.edge]}')
            last[event.edge] = event.token.sequence
    return found


def one_unprocessed_token(synchronous: Iterable[str]) -> Invariant:
    """Make the invariant that the given edges hold at most one unprocessed token (P4)."""
    labels = frozenset(synchronous)

    def one_token(events: list[TraceEvent]) -> list[str]:
        held: dict[str, int] = defaultdict(int)
        found = []
        for event in events:
            edge = getattr(event, "edge", None)
            if edge not in labels:
                continue
            if isinstance(event, TokenSent):
                held[edge] += 1
                if held[edge] > 1:
                    found.append(f'"{edge}" holds {held[edge]} unprocessed tokens at number {event.token.sequence}')
            elif isinstance(event, TokenProcessed | TokenDrained) or (
                isinstance(event, TokenDropped) and event.reason == "disabled"
            ):
                held[edge] = max(0, held[edge] - 1)
        return found

    return one_token


def modifiers_fit(events: list[TraceEvent]) -> list[str]:
    """NO_MESSAGE never carries a modifier (T3), and there are only three (eq. 8)."""
    return [
        f'on "{event.edge}" {event.token.value!r} carries {event.token.activity}'
        for event in events
        if isinstance(event, TokenSent)
        and (event.token.activity not in (-1, 0, 1) or (event.token.value is NO_MESSAGE and event.token.activity != 0))
    ]


def activity_changes_alternate(events: list[TraceEvent]) -> list[str]:
    """A(v) begins at 0 and changes are changes (A1)."""
    state: dict[str, bool] = defaultdict(bool)
    found = []
    for event in events:
        if isinstance(event, ActivityChanged):
            if state[event.node] == event.active:
                found.append(f'"{event.node}" became {"active" if event.active else "inactive"} twice')
            state[event.node] = event.active
    return found


def activity_is_carried(active_edges: Iterable[str]) -> Invariant:
    """Make the invariant that only the given edges carry modifiers (T1, A7)."""
    labels = frozenset(active_edges)

    def carried(events: list[TraceEvent]) -> list[str]:
        return [
            f'"{event.edge}" is not active but carries {event.token.activity}'
            for event in events
            if isinstance(event, TokenSent) and event.token.activity != 0 and event.edge not in labels
        ]

    return carried


def one_thing_at_a_time(events: list[TraceEvent]) -> list[str]:
    """Firings and calls of one node never overlap (F9)."""
    return _overlaps(events, {})


def as_many_firings_as_allowed(concurrency: Mapping[str, int]) -> Invariant:
    """Make the invariant that nodes do one thing at a time (F9), but for those that may have several firings (F14).

    Their calls wait for no firing, but for each other, and no firing begins during a call.

    Args:
      concurrency: how many firings of a node may be in progress at once, by its path; 1 for all others.
    """
    several = dict(concurrency)

    def within_limits(events: list[TraceEvent]) -> list[str]:
        return _overlaps(events, several)

    return within_limits


def _overlaps(events: list[TraceEvent], concurrency: Mapping[str, int]) -> list[str]:
    calls: dict[str, str] = {}
    firings: dict[str, dict[int, str]] = defaultdict(dict)
    found = []
    for event in events:
        if isinstance(event, FiringStarted | CallStarted) and event.node:
            most = concurrency.get(event.node, 1)
            amid = [calls[event.node]] if event.node in calls else []
            if len(firings[event.node]) >= most and (isinstance(event, FiringStarted) or most == 1):
                amid += firings[event.node].values()
            if amid:
                found.append(f'"{event.node}" began {_name(event)} during {", ".join(amid)}')
            if isinstance(event, FiringStarted):
                firings[event.node][event.number] = _name(event)
            else:
                calls[event.node] = _name(event)
        elif isinstance(event, FiringEnded):
            firings[event.node].pop(event.number, None)
        elif isinstance(event, CallEnded):
            calls.pop(event.node, None)
    return found


def ended_nodes_rest(events: list[TraceEvent]) -> list[str]:
    """A node that has ended fires no more, unless it is set up again (F12)."""
    ended: set[str] = set()
    busy: set[str] = set()
    afresh: set[str] = set()  # after their current code, because a subgraph around them is reset
    found = []
    for event in events:
        if isinstance(event, NodeEnded) and event.node not in afresh:
            ended.add(event.node)
        elif isinstance(event, NodeEnabled) or (isinstance(event, CallStarted) and event.slot in ("reset", "enable")):
            meant = f"{event.node}/"
            ended = {node for node in ended if not (node == event.node or node.startswith(meant))}
            afresh |= {node for node in busy if node.startswith(meant)}
        elif isinstance(event, FiringStarted) and event.node in ended:
            found.append(f'"{event.node}" fired after its end')
        if isinstance(event, FiringStarted | CallStarted):
            busy.add(event.node)
            afresh.discard(event.node)
        elif isinstance(event, FiringEnded | CallEnded):
            busy.discard(event.node)
    return found


def time_never_goes_back(events: list[TraceEvent]) -> list[str]:
    """Time stands still or advances (R6)."""
    return [
        f"{type(later).__name__} at {later.time} after {earlier.time}"
        for earlier, later in pairwise(events)
        if later.time < earlier.time
    ]


ALL: Final[tuple[Invariant, ...]] = (
    no_token_lost,
    order_is_kept,
    numbers_rise,
    modifiers_fit,
    activity_changes_alternate,
    one_thing_at_a_time,
    ended_nodes_rest,
    time_never_goes_back,
)
"""Those that need to know nothing of the graph."""


def of_graph(graph: Any) -> list[Invariant]:
    """Return all invariants, those included that ask which edges are active or synchronous."""
    from hfg.testing.reference.structure import dissolve, whole

    edges = dissolve(graph).edges
    synchronous = [
        edge.label
        for edge in edges
        if not edge.is_event and not edge.initial and not edge.buffer and edge.target.owner != -1
    ]
    several = {leaf.path: leaf.options.concurrency for leaf in whole(graph).leaves}
    return [
        *(invariant for invariant in ALL if invariant is not one_thing_at_a_time),
        as_many_firings_as_allowed(several),
        one_unprocessed_token(synchronous),
        activity_is_carried(edge.label for edge in edges if edge.active),
    ]


def broken(events: list[TraceEvent], invariants: Iterable[Invariant] = ALL) -> list[str]:
    """Ask all of them; give every sentence that says what is wrong. One that raises says so, too.

    Raises:
      UsageError: an invariant returned something else.
    """
    return [f"{_title(invariant)}: {sentence}" for invariant in invariants for sentence in _asked(invariant, events)]


def _asked(invariant: Invariant, events: list[TraceEvent]) -> list[str]:
    try:
        found: object = invariant(events)
        if found is None:
            return []
        if not isinstance(found, str | bytes) and isinstance(found, Iterable):
            sentences = list(found)
            if all(isinstance(one, str) for one in sentences):
                return sentences
            found = next(one for one in sentences if not isinstance(one, str))
    except Exception as error:
        return [_raised(error)]
    if inspect.iscoroutine(found):
        found.close()
        raise UsageError(f'invariant "{_title(invariant)}" is async: let a plain function look at the trace')
    raise UsageError(
        f'invariant "{_title(invariant)}" returned {found!r:.80}: let it return a list of problems about what is '
        "wrong, empty if nothing is, or assert what holds"
    )


def _raised(error: Exception) -> str:
    """Return what it raised, and where, because an `assert` often has no message."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1]
    return f"{in_words(error)} ({Path(last.filename).name}, line {last.lineno}: {last.line})"


def _title(invariant: Invariant) -> str:
    return str(getattr(invariant, "__name__", type(invariant).__name__)).replace("_", " ")


def _name(event: FiringStarted | CallStarted) -> str:
    return f"firing {event.number}" if isinstance(event, FiringStarted) else f"call {event.number} of {event.slot}"


def _doubles(numbers: list[int]) -> list[int]:
    return sorted({number for number in numbers if numbers.count(number) > 1})


def _left(events: list[TraceEvent], edge: str) -> bool:
    """Return whether activity on the edge was accounted for otherwise, or may stay at a disabled node."""
    lost = any(isinstance(event, ActivityLost) and event.edge == edge for event in events)
    target = edge.partition(" -> ")[2].rpartition(".")[0]
    return lost or any(
        isinstance(event, NodeEnabled) and not event.enabled and target.startswith(event.node) for event in events
    )
