"""What leaves a node: one token per output edge, signals, END, automatic events (rules T, P4-P7, F3, F8, A3-A5, A9).

A sending is on all its edges before anything comes of it. Depends on `modifiers`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

from hfg.activity.rules import asked_for, leaving
from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.engine.model import Core, RunningEvent
from hfg.engine.model.running_node import BETWEEN_FIRINGS, DISABLED, RATE, RunningNode
from hfg.engine.rules.agenda import queue_next_in_wave
from hfg.engine.rules.modifiers import (
    automatic,
    derive_scopes,
    give_back,
    receive,
    set_active,
    touch,
)
from hfg.engine.rules.putting import put, put_signal
from hfg.errors import QueueOverflow
from hfg.ports.edges import BufferEdge, EventEdge, SyncEdge
from hfg.trace import EventTriggered, NodeEnded

__all__ = [
    "activity_left",
    "announce",
    "deferring_events",
    "emit_automatic",
    "enqueue",
    "put_arrived",
    "put_outputs",
    "put_value",
    "send_automatic",
    "send_end",
    "sent",
    "trigger",
    "trigger_from_task",
    "unwrapped",
]


Entry: TypeAlias = tuple[Any, int | None, float | None]
"""What was written to an output, or is to be triggered: the value, an explicit modifier, an explicit stamp."""

Written: TypeAlias = Sequence[Entry | None] | None
"""Per output what was written in a firing; None, or None in it, is NO_MESSAGE."""

_SILENCE: Entry = (NO_MESSAGE, None, None)


def unwrapped(value: object, explicit: int | None = None, stamp: float | None = None) -> Entry:
    """A received token that is passed on keeps what it carries, unless something else is asked for (A4, T5)."""
    if type(value) is not Token:
        return (value, explicit, stamp)
    return (value.value, asked_for(explicit, value.activity), value.stamp if stamp is None else stamp)


def put_outputs(worker: RunningNode, written: Written) -> None:
    """Put exactly one token on every live edge of every output, all together (F3), and let activity leave (A3, A5).

    Args:
      worker: whose firing is over.
      written: per output (value, explicit modifier, explicit stamp).
    """
    core = worker.core
    since = len(core.next_in_wave)
    _put_outputs(worker, written)
    queue_next_in_wave(core, since)
    sent(core)


def put_value(worker: RunningNode, value: object) -> None:
    """The same for a value without modifier and stamp of its own on the one output of a worker (`Shape.single`)."""
    shape, core = worker.shape, worker.core
    if value is None:
        value = NO_MESSAGE
    if worker.listeners or (shape.gives and (worker.active or worker.may_carry)):
        put_outputs(worker, [(value, None, None)])
        return
    since = len(core.next_in_wave)
    stamp = worker.stamp
    if stamp is None:
        stamp = core.now()
    for edge in shape.outgoing:
        put(edge, value, 0, stamp)
    if worker.outputs.missing and (worker.fireable or worker.blocked & RATE):
        worker.drop_firing()
    if len(core.next_in_wave) > since:
        queue_next_in_wave(core, since)
    if core.returned or core.drained or core.dirty_scopes:
        sent(core)


def put_arrived(worker: RunningNode, value: object, modifier: int, stamp: float) -> None:
    """The same for a token that has come from another part of the graph: `worker` stands for that, and has one edge."""
    if worker.listeners:
        put_outputs(worker, [(value, modifier, stamp)])
        return
    core = worker.core
    since = len(core.next_in_wave)
    edge = worker.out_edges[0][0]
    put(edge, value, leaving(False, edge.active, modifier, value is NO_MESSAGE), stamp)
    if worker.outputs.missing and worker.fireable:
        worker.drop_firing()
    if len(core.next_in_wave) > since:
        queue_next_in_wave(core, since)
    if core.returned or core.drained or core.dirty_scopes:
        sent(core)


def _put_outputs(worker: RunningNode, written: Written) -> None:
    carried = False
    for edge, value, modifier, stamp in _tokens(worker, written):
        carried = carried or modifier == 1
        put(edge, value, modifier, stamp)
    if worker.outputs.missing and (worker.fireable or worker.blocked & RATE):
        worker.drop_firing()
    if carried:
        activity_left(worker)


def _tokens(worker: RunningNode, written: Written) -> list[tuple[SyncEdge | BufferEdge, Any, int, float]]:
    """What is to be put on which edge, those into slots first (F9); by A3 and A4 each has its modifier."""
    may_carry = worker.active or worker.may_carry
    present = worker.stamp
    if present is None:
        present = worker.core.now()
    for_slots: list[tuple[SyncEdge | BufferEdge, Any, int, float]] = []
    for_inputs: list[tuple[SyncEdge | BufferEdge, Any, int, float]] = []
    for position, edges in enumerate(worker.out_edges):
        if not edges:
            continue
        value, explicit, stamp = (written[position] if written is not None else None) or _SILENCE
        listeners = worker.listeners[position] if worker.listeners else None
        for edge in edges if listeners is None else listeners.who_hear():
            modifier = leaving(may_carry, edge.active, explicit, value is NO_MESSAGE)
            tokens = for_slots if edge.target_kind == "slot" else for_inputs
            tokens.append((edge, value, modifier, present if stamp is None else stamp))
    return for_slots + for_inputs


def activity_left(worker: RunningNode) -> None:
    """A5: the first sending that carried +1 took the activity.

    The right of A3 stays until the firing or call is over.
    """
    if not worker.active:
        return  # the activity was not its own (A4), or left before (A3)
    if worker.scope is not None:  # by its events it leaves everything inside (G2)
        worker.become(False)
        worker.core.rules.deactivate_inside(worker.scope, "sent")
    else:
        worker.let_carry(worker.stamp is not None)  # in a firing or call
        set_active(worker, False, "sent")


def sent(core: Core) -> None:
    """The sending is on its edges: activity that got nowhere goes back, what was drained acts, the rest follows."""
    if core.returned:
        returned, core.returned = core.returned, []
        for edge in returned:  # after A5, which has taken it from the sender
            give_back(edge)
    drained = core.drained
    if drained:
        core.drained = []
        for target, modifier in drained:
            receive(target, (modifier,))
    if core.dirty_scopes:
        derive_scopes(core)
    for target, _ in drained:
        if target.busy in BETWEEN_FIRINGS:  # else it follows the firing or call in progress
            emit_automatic(target)


def announce(worker: RunningNode, written: Written, *, processed: bool = True) -> None:
    """A9: what has left by the outputs is told behind them where somebody asks; then that the firing is `processed`.

    The value goes with the stamp of its token. A modifier is for the outputs alone: these are sendings of their own.
    """
    own_stamp = worker.core.now() if worker.stamp is None else worker.stamp
    for name, position in worker.shape.announced:
        if position is None:
            if processed:
                automatic(worker, name)
            continue
        entry = None if written is None or worker.blocked & DISABLED else written[position]
        if entry is not None and type(entry[0]) is not Marker:
            value, _, stamp = entry
            automatic(worker, name, Token(value, 0, own_stamp if stamp is None else stamp))


def send_end(worker: RunningNode) -> None:
    """END leaves on all outputs; from here on the node, which is idle, is over (F4, F12)."""
    core = worker.core
    end = (END, None, None)
    with deferring_events(core):
        assert worker.ending is not None
        worker.send_as(worker.ending.stop_pending())
        since = len(core.next_in_wave)
        _put_outputs(worker, [end] * len(worker.out_edges))
        queue_next_in_wave(core, since)
        worker.leave()  # no firing or call is in progress that could use it, and the next slot call must not (A3)
        sent(core)
        if core.trace_changes is not None:
            core.trace_changes(NodeEnded(core.now(), worker.path))
        deferred = worker.ending.take_deferred()
        for modifier in deferred:
            receive(worker, (modifier,))
        if deferred and worker.scopes:
            touch(core, worker.scopes)
    core.rules.node_ended(worker)


def trigger(
    event: RunningEvent,
    value: object = None,
    explicit: int | None = None,
    stamp: float | None = None,
    *,
    extend_right: bool = True,
) -> None:
    """Send a signal on every live edge of an event, at once (F8, T2, T5); activity leaves by A3 and A5.

    Raises:
      QueueOverflow: an edge with policy `error` is full; nothing was sent (P5).
    """
    worker = event.worker
    core = worker.core
    if core.over:
        return  # code that was in progress at the end has no listeners
    value, explicit, stamp = unwrapped(value, explicit, stamp)
    if stamp is None:
        stamp = core.now() if worker.stamp is None else worker.stamp
    signals = _signals(event, explicit, may_carry=worker.active or (extend_right and worker.may_carry))
    carried = any([modifier == 1 for _, modifier in signals])  # noqa: C419 - few, and a list is faster
    _show_signal(event, Token(value, 1 if carried else explicit or 0, stamp))
    for edge, modifier in signals:
        if edge.pipeline is not None:
            _into_operators(edge, Token(value, modifier, stamp))
        else:
            put_signal(edge, value, modifier, stamp)
    if core.returned:
        with deferring_events(core):  # those of an idle sender follow what comes back to it (A8, A9)
            if carried:
                activity_left(worker)
            sent(core)
    else:
        if carried:
            activity_left(worker)
        sent(core)
    if not core.pumping:
        core.runtime.kick()
    if core.to_notify:
        _notify_subscribers(core)


def trigger_from_task(
    event: RunningEvent, value: object = None, explicit: int | None = None, stamp: float | None = None
) -> None:
    """A task of the node sends a signal: a sending of its own, with the present as its stamp (T5, A3, A9).

    If it takes the activity of the node, a firing or call that is in progress has no right to that by A3.
    """
    worker = event.worker
    right = worker.may_carry
    value, explicit, stamp = unwrapped(value, explicit, stamp)
    trigger(event, value, explicit, worker.core.now() if stamp is None else stamp, extend_right=False)
    if not right:
        worker.let_carry(False)


def _signals(event: RunningEvent, explicit: int | None, *, may_carry: bool) -> list[tuple[EventEdge, int]]:
    """On which edges a signal leaves, and with which modifier (A3, A4); none of it if one of them refuses it (P5)."""
    signals: list[tuple[EventEdge, int]] = []
    for edge in event.edges:
        if not edge.live:
            continue
        if edge.overflow == "error" and edge.overflows():
            raise QueueOverflow(
                f'queue of "{edge.label}" is full: {edge.capacity} signals wait, policy "error" allows no '
                f"more; nothing was sent: raise capacity= or choose another overflow="
            )
        signals.append((edge, leaving(may_carry, edge.active, explicit, False)))
    return signals


def _show_signal(event: RunningEvent, signal: Token[Any]) -> None:
    """Taps on the event see the signal now; subscribers get it when it is on its edges (F3)."""
    core, port = event.worker.core, event.port
    if core.trace is not None:
        core.trace(EventTriggered(core.now(), event.label, signal))
    if port is not None and port._observers:
        core.to_notify.append((port, signal))
    for look in event.tap or ():
        look(signal)


def _notify_subscribers(core: Core) -> None:
    """F3: they hear of signals that are on their edges, and in that order; what they trigger is heard of behind."""
    if core.notifying:
        return
    core.notifying = True
    try:
        while core.to_notify:
            port, token = core.to_notify.popleft()
            port._notify(token)
    finally:
        core.notifying = False


def _into_operators(edge: EventEdge, token: Token[Any]) -> None:
    """P9: an operator that raises is an error of the edge, by the consumer's policy."""
    assert edge.pipeline is not None
    try:
        edge.pipeline(token)
    except Exception as error:
        edge.target.core.rules.operator_failed(edge, error)


def enqueue(edge: EventEdge, value: object, modifier: int, stamp: float) -> None:
    """One token on one event edge, a sending of its own."""
    put_signal(edge, value, modifier, stamp)
    sent(edge.target.core)


def emit_automatic(worker: RunningNode) -> None:
    """Send the automatic events of an idle node: now, or after a change of several edges."""
    late = worker.core.deferred_events
    if late is None:
        send_automatic(worker)
    else:
        late.append(worker)


@contextmanager
def deferring_events(core: Core) -> Iterator[None]:
    """Automatic events of a change of several edges follow when all of it is done (F10, R4), subgraphs last (G2)."""
    if core.deferred_events is not None:
        yield
        return
    late: list[RunningNode] = []
    core.deferred_events = late
    try:
        yield
        for worker in late:  # which grows by what these come to
            if worker.busy in BETWEEN_FIRINGS:
                send_automatic(worker)
    finally:
        core.deferred_events = None
    derive_scopes(core)


def send_automatic(worker: RunningNode) -> None:
    """A9: the automatic events follow as sendings of their own, in the order they arose."""
    while worker.events_due:
        for name, value in worker.take_events():
            event = worker.events.get(name)
            if event is not None:
                stamp = None if type(value) is Token else worker.core.now()  # T5: automatic signals: now, but `sent`
                trigger(event, value, stamp=stamp, extend_right=False)
