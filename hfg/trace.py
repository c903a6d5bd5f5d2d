"""The events of a run: everything observable, as typed values (rule R7).

Recorders, taps, statistics, monitors and the studio use this one stream. Every event has `time`, in seconds on the
run's clock. Nodes are named by their path ("fetch/go_to"; the graph's own boundary is ""), ports by "path.port", edges
by "source -> target" as the plan names them after subgraphs are dissolved. In the JSON of `hfg run --trace`, a token
that holds a marker has "marker" in place of "value". Depends on `token`, not on the code that emits or consumes events.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import msgspec

from hfg.base.token import Token

__all__ = [
    "ActivityCause",
    "ActivityChanged",
    "ActivityLost",
    "CallEnded",
    "CallOutcome",
    "CallStarted",
    "Consumer",
    "DoEnded",
    "DoOutcome",
    "DoStarted",
    "DropReason",
    "EditWaits",
    "ErrorRaised",
    "EventTriggered",
    "FiringEnded",
    "FiringKind",
    "FiringOutcome",
    "FiringRetried",
    "FiringStarted",
    "NodeEnabled",
    "NodeEnded",
    "ParameterSet",
    "QueueGrown",
    "RunEnded",
    "RunPaused",
    "RunResumed",
    "RunStarted",
    "StructureChanged",
    "TokenDrained",
    "TokenDropped",
    "TokenProcessed",
    "TokenSent",
    "TokenTaken",
    "TraceEvent",
]


class TraceEvent(msgspec.Struct, frozen=True, tag=True):
    """An event at `time` (seconds on the run's clock)."""

    time: float


Consumer: TypeAlias = Callable[[TraceEvent], Any] | list[TraceEvent] | deque[TraceEvent]
"""A consumer of the events of a run: a function called with each, or a list to which they are appended."""

FiringKind: TypeAlias = Literal["process", "silent", "end"]
FiringOutcome: TypeAlias = Literal["done", "silent", "ended", "failed", "abandoned"]
DoOutcome: TypeAlias = Literal["completed", "cancelled", "failed"]
CallOutcome: TypeAlias = Literal["done", "failed", "abandoned"]
DropReason: TypeAlias = Literal["overflow", "disabled", "ended", "removed", "stopped"]
ActivityCause: TypeAlias = Literal["token", "sent", "slot", "reset", "returned"]


class RunStarted(TraceEvent, frozen=True):
    """All nodes are set up; `start` is about to be triggered."""


class RunEnded(TraceEvent, frozen=True):
    """Nothing runs any more; `outcome` as in the run's report."""

    outcome: str


class RunPaused(TraceEvent, frozen=True):
    """From now on no firing and no slot call starts (R3); `why`: "pause", or the path of a breakpoint."""

    why: str


class RunResumed(TraceEvent, frozen=True):
    """The run continues after a pause (R3)."""


class FiringStarted(TraceEvent, frozen=True):
    """The tokens of firing `number` (from 1, per node, silent ones counted) are taken.

    `kind`: the function is run ("process"), is skipped ("silent", F4), or the node ends ("end", its hook is called).
    """

    node: str
    number: int
    kind: FiringKind


class FiringEnded(TraceEvent, frozen=True):
    """The firing is over and its outputs have been sent.

    `outcome`: "done", "silent", "ended", "failed" (X1), "abandoned" (X2, a disabled node).
    """

    node: str
    number: int
    outcome: FiringOutcome


class FiringRetried(TraceEvent, frozen=True):
    """Attempt `attempt` (from 1) at a firing has failed with `error`; the next one starts after `pause_s` (X1)."""

    node: str
    number: int
    attempt: int
    error: str
    pause_s: float


class CallStarted(TraceEvent, frozen=True):
    """Slot call `number` (from 1, per node) of `slot` starts with the token from `edge`."""

    node: str
    number: int
    slot: str
    edge: str


class CallEnded(TraceEvent, frozen=True):
    """The slot call is over."""

    node: str
    number: int
    outcome: CallOutcome


class TokenSent(TraceEvent, frozen=True, gc=False):
    """A token, marker or not, was put on an edge and took the edge's next number."""

    edge: str
    token: Token[Any]


class TokenTaken(TraceEvent, frozen=True, gc=False):
    """A firing or call removed the token from its edge."""

    edge: str
    token: Token[Any]


class TokenProcessed(TraceEvent, frozen=True):
    """The producer's place on a synchronous edge is free again (F5)."""

    edge: str


class TokenDropped(TraceEvent, frozen=True, gc=False):
    """A token was discarded and counted: "overflow" (P5), "disabled" (F10), "ended" (F4, F13), "removed" (R4).

    "stopped" (left when the run ended).
    """

    edge: str
    token: Token[Any]
    reason: DropReason


class TokenDrained(TraceEvent, frozen=True, gc=False):
    """A token for a node that has ended was processed without a firing (F12); so was a marker for a slot (T4)."""

    edge: str
    token: Token[Any]


class EventTriggered(TraceEvent, frozen=True, gc=False):
    """An event was triggered; the token is the signal before an edge gives it a number."""

    event: str
    token: Token[Any]


class ActivityChanged(TraceEvent, frozen=True):
    """A(node) changed: by a token (A6), by sending (A5), by a slot (A7), by reset (A14), or was returned (A8)."""

    node: str
    active: bool
    cause: ActivityCause


class ActivityLost(TraceEvent, frozen=True):
    """A +1 was lost (A8): its sender is gone, a slot of a subgraph took it, or its node was removed."""

    edge: str


class DoStarted(TraceEvent, frozen=True):
    """The code of a node's do-activity starts (A15)."""

    node: str


class DoEnded(TraceEvent, frozen=True):
    """The do-activity has ended: it returned ("completed"), was cancelled, or failed (A15).

    There is no such event for a do-activity that the end of the run cuts short.
    """

    node: str
    outcome: DoOutcome


class NodeEnded(TraceEvent, frozen=True):
    """The node has sent END on all outputs and fires no more (F12)."""

    node: str


class NodeEnabled(TraceEvent, frozen=True):
    """The node, or the subgraph, was enabled or disabled (F10)."""

    node: str
    enabled: bool


class ErrorRaised(TraceEvent, frozen=True):
    """A node's code failed, or a subscriber or operator did; `policy` is the reaction (X1)."""

    node: str
    what: str
    error: str
    policy: str


class ParameterSet(TraceEvent, frozen=True):
    """A parameter has a new value, by a token (P8) or from outside."""

    node: str
    parameter: str
    value: Any


class QueueGrown(TraceEvent, frozen=True):
    """Rule F8 gave a queue one more place."""

    edge: str
    capacity: int


class EditWaits(TraceEvent, frozen=True):
    """An edit waits until work in progress has ended; `nodes` start nothing until it is done or abandoned (R4)."""

    nodes: tuple[str, ...]


class StructureChanged(TraceEvent, frozen=True):
    """The graph has changed (R4); events about the consequences follow.

    `change`: the commands as JSON (as text, if a parameter's value is not data), "undo" or "redo"; "" if a waiting edit
    was abandoned.
    """

    change: str
