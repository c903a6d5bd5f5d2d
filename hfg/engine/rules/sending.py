"""What leaves a node: one token per output edge, signals, END, automatic events (rules T, P4-P7, F3, F8, A3-A5, A9).

A sending is on all its edges before anything comes of it. Stands on `modifiers`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from hfg.activity.rules import asked_for, leaving
from hfg.engine.model.core import Core
from hfg.engine.model.worker import AMID_NOTHING, ENDED, RunningEvent, Worker
from hfg.engine.rules.agenda import add_call, arrived, let_follow, note_full
from hfg.engine.rules.listening import listens, may_listen
from hfg.engine.rules.modifiers import count_dropped, derive_scopes, drop, give_back, receive, set_active, touch
from hfg.errors import QueueOverflow
from hfg.ports.edges import Edge, EventEdge, SyncEdge
from hfg.token import END, NO_MESSAGE, Marker, Token
from hfg.trace import EventTriggered, NodeEnded, TokenDrained, TokenProcessed, TokenSent

__all__ = [
    "enqueue",
    "flush_automatic",
    "put",
    "put_outputs",
    "put_value",
    "send_end",
    "tell",
    "telling_behind",
    "trigger",
]


Written = Sequence[tuple[Any, int | None, float | None] | None] | None


def put_outputs(worker: Worker, written: Written) -> None:
    """Put exactly one token on every live edge of every output, all together (F3), and let activity leave (A3, A5).

    Args:
      worker: whose firing is over.
      written: per output (value, explicit modifier, explicit stamp); None, or None in it, is NO_MESSAGE.
    """
    core = worker.core
    since = len(core.followers)
    _put_outputs(worker, written)
    let_follow(core, since)
    _sent(core)


def put_value(worker: Worker, value: Any) -> None:
    """The same for a value without modifier and stamp of its own on the one output of a worker (`Shape.single`)."""
    shape, core = worker.shape, worker.core
    if worker.listeners or (shape.gives and (worker.active or worker.right)):
        put_outputs(worker, [(value, None, None)] if value is not None else None)
        return
    since = len(core.followers)
    stamp = worker.stamp
    if stamp is None:
        stamp = core.now()
    if value is None:
        value = NO_MESSAGE
    for edge in shape.outgoing:
        put(edge, value, 0, stamp)
    if worker.outputs.missing and (worker.placed or worker.rate_timer is not None):
        worker.unplace()
    if len(core.followers) > since:
        let_follow(core, since)
    if core.returned or core.drained or core.dirty_scopes:
        _sent(core)


def _put_outputs(worker: Worker, written: Written) -> None:
    may_carry = worker.active or worker.right
    stamp = worker.stamp
    if stamp is None:
        stamp = worker.core.now()
    for_slots: list[tuple[Edge, Any, int, float]] = []
    for_inputs: list[tuple[Edge, Any, int, float]] = []
    carried = False
    for position, edges in enumerate(worker.out_edges):
        if not edges:
            continue
        entry = written[position] if written is not None else None
        if entry is None:
            value, explicit, own_stamp = NO_MESSAGE, None, stamp
        else:
            value, explicit, given = entry
            own_stamp = stamp if given is None else given
        listeners = worker.listeners[position] if worker.listeners else None
        if listeners is not None:
            edges = listeners.who_hear()
        for edge in edges:
            modifier = leaving(may_carry, edge.active, explicit, value is NO_MESSAGE)
            carried = carried or modifier == 1
            (for_slots if edge.target_kind == "slot" else for_inputs).append((edge, value, modifier, own_stamp))
    for edge, value, modifier, own_stamp in for_slots:
        put(edge, value, modifier, own_stamp)
    for edge, value, modifier, own_stamp in for_inputs:
        put(edge, value, modifier, own_stamp)
    if worker.outputs.missing and (worker.placed or worker.rate_timer is not None):
        worker.unplace()
    if carried:
        _activity_left(worker)


def _activity_left(worker: Worker) -> None:
    """A5: the first sending that carried +1 took the activity.

    The right of A3 stays until the firing or call is over.
    """
    if not worker.active:
        return  # what it gave was none of its own (A4), or left before (A3)
    if worker.scope is not None:  # by its events it leaves everything inside (G2)
        worker.become(False)
        worker.node._active = False
        worker.core.upstairs.deactivate_inside(worker.scope, "sent")
    else:
        worker.keep_right(worker.stamp is not None)  # in a firing or call
        set_active(worker, False, "sent")


def put(edge: Any, value: Any, modifier: int, stamp: float) -> None:
    """Put one token on a synchronous edge."""
    token = Token(value, modifier, stamp, edge.number())
    target: Worker = edge.target
    core = target.core
    if core.trace is not None:
        core.trace(TokenSent(core.now(), edge.label, token))
    if edge.tap is not None:
        edge.tap(token)
    if edge.target_kind == "slot":
        if type(value) is Marker or (edge.while_active and modifier <= 0 and not listens(target)):
            _drain(edge, token)  # T4: processed at once, the handler is not called
            return
        if modifier > 0 and target.listened is not None:
            may_listen(target)
        edge.put(token)
        edge.waits.outputs.expect()
        add_call(target, edge)
    elif target.blocked & ENDED:
        _drain(edge, token)
        return
    elif type(edge) is SyncEdge:
        edge.put(token)
        edge.waits.outputs.expect()
        if type(value) is Marker:
            target.mark_special()
        arrived(edge)
    else:
        if edge.put(token):
            edge.waits.outputs.expect()
        elif core.trace is not None:
            core.trace(TokenProcessed(core.now(), edge.label))
        if type(value) is Marker:
            target.mark_special()
        if len(edge.queue) == 1:
            arrived(edge)
    if modifier > 0 and target.scopes:
        touch(core, target.scopes)


def _drain(edge: Edge, token: Token[Any]) -> None:
    """T4, F12: the token is processed at once, without a firing or call; its modifier acts behind the sending."""
    target: Worker = edge.target
    core = target.core
    into_slot = edge.target_kind == "slot"
    if not into_slot:
        edge.count_drained()
    if core.trace is not None:
        core.trace(TokenDrained(core.now(), edge.label, token))
    if token.activity:
        if target.deferred is not None and not into_slot:
            target.defer(token.activity)
            if target.scopes:
                touch(core, target.scopes)
        else:
            core.drained.append((target, token.activity))


def _sent(core: Core) -> None:
    """The sending is on its edges: activity that got nowhere goes back, what was drained acts, the rest follows."""
    if core.returned:
        returned, core.returned = core.returned, []
        for edge in returned:  # behind A5, which has taken it from the sender
            give_back(edge)
    drained = core.drained
    if drained:
        core.drained = []
        for target, modifier in drained:
            receive(target, (modifier,))
    if core.dirty_scopes:
        derive_scopes(core)
    for target, _ in drained:
        if target.busy in AMID_NOTHING:  # else it follows the firing or call under way
            tell(target)


def send_end(worker: Worker) -> None:
    """END leaves on all outputs; from here the node, which is amid nothing, is over (F4, F12)."""
    core = worker.core
    end = (END, None, None)
    with telling_behind(core):
        worker.send_end_now()
        since = len(core.followers)
        _put_outputs(worker, [end] * len(worker.out_edges))
        let_follow(core, since)
        worker.leave()  # no firing or call goes on that could use it: the next slot call must not (A3)
        _sent(core)
        if core.trace is not None:
            core.trace(NodeEnded(core.now(), worker.path))
        deferred = worker.take_deferred()
        for modifier in deferred:
            receive(worker, (modifier,))
        if deferred and worker.scopes:
            touch(core, worker.scopes)
    core.upstairs.node_ended(worker)


def trigger(
    event: RunningEvent,
    value: Any = None,
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
        return  # code that was under way at the end speaks to nobody
    if type(value) is Token:
        explicit = asked_for(explicit, value.activity)
        stamp = value.stamp if stamp is None else stamp
        value = value.value
    if stamp is None:
        stamp = core.now() if worker.stamp is None else worker.stamp
    edges = event.edges
    for edge in edges:
        if edge.overflow == "error" and edge.live and edge.overflows():
            raise QueueOverflow(
                f'queue of "{edge.label}" is full: {edge.capacity} signals wait, policy "error" allows no '
                f"more; nothing was sent: raise "
                f"capacity= or choose another overflow="
            )
    may_carry = worker.active or (extend_right and worker.right)
    carried = False
    loudest = 0 if explicit is None else explicit
    sends: list[tuple[EventEdge, int]] = []
    for edge in edges:
        if edge.live:
            modifier = leaving(may_carry, edge.active, explicit, False)
            if modifier == 1:
                carried = True
                loudest = 1
            sends.append((edge, modifier))
    port = event.port
    if core.trace is not None:
        core.trace(EventTriggered(core.now(), event.label, Token(value, loudest, stamp)))
    if port is not None and port._observers:
        core.heard.append((port, Token(value, loudest, stamp)))
    if event.tap:
        token = Token(value, loudest, stamp)
        for look in event.tap:
            look(token)
    for edge, modifier in sends:
        if edge.pipeline is not None:
            _into_operators(edge, Token(value, modifier, stamp))
        else:
            _append(edge, value, modifier, stamp)
    if carried:
        _activity_left(worker)
    _sent(core)
    if not core.pumping:
        core.host.kick()
    if core.heard:
        _tell_subscribers(core)


def _tell_subscribers(core: Core) -> None:
    """F3: they hear of signals that are on their edges, and in that order; what they trigger is heard of behind."""
    if core.telling:
        return
    core.telling = True
    try:
        while core.heard:
            port, token = core.heard.popleft()
            port._notify(token)
    finally:
        core.telling = False


def _into_operators(edge: EventEdge, token: Token[Any]) -> None:
    """P9: an operator that raises is an error of the edge, by the consumer's policy."""
    assert edge.pipeline is not None
    try:
        edge.pipeline(token)
    except Exception as error:
        edge.target.core.upstairs.operator_failed(edge, error)


def enqueue(edge: EventEdge, value: Any, modifier: int, stamp: float) -> None:
    """One token on one event edge, a sending of its own."""
    _append(edge, value, modifier, stamp)
    _sent(edge.target.core)


def _append(edge: EventEdge, value: Any, modifier: int, stamp: float) -> None:
    """Put one token into the queue of an event edge, by its policy (P5, F8)."""
    token = Token(value, modifier, stamp, edge.number())
    target: Worker = edge.target
    core = target.core
    if core.trace is not None:
        core.trace(TokenSent(core.now(), edge.label, token))
    if edge.tap is not None:
        edge.tap(token)
    if edge.end_sent and value is not END:  # END came first: nobody waits for what comes behind it (F13)
        count_dropped(edge, token, "ended")
        if modifier > 0:
            core.returned.append(edge)
        return
    into_input = edge.target_kind == "input"
    if into_input and target.blocked & ENDED:
        _drain(edge, token)
        return
    if edge.while_active and modifier <= 0 and not listens(target):  # T4
        _drain(edge, token)
        return
    if modifier > 0 and target.listened is not None:
        may_listen(target)
    if edge.overflows():
        if edge.overflow == "drop_newest":
            drop(edge, token, "overflow")
            return
        drop(edge, edge.take(), "overflow")
        if not into_input:
            target.forget_call(edge)
        elif not edge.queue:  # for the input nothing has changed: it still holds a token
            edge.lay(token)
            return
    edge.lay(token)
    note_full(edge)
    if into_input:
        if type(value) is Marker:
            target.mark_special()
        if len(edge.queue) == 1:
            arrived(edge)
    else:
        add_call(target, edge)
    if modifier > 0 and target.scopes:
        touch(core, target.scopes)


def tell(worker: Worker) -> None:
    """Send the automatic events of a node that is amid nothing: at once, or behind a change of several edges."""
    late = worker.core.late
    if late is None:
        flush_automatic(worker)
    else:
        late.append(worker)


@contextmanager
def telling_behind(core: Core) -> Iterator[None]:
    """What arises by a change of several edges is told when all of it is done (F10, R4), by subgraphs last (G2)."""
    if core.late is not None:
        yield
        return
    late: list[Worker] = []
    core.late = late
    try:
        yield
        for worker in late:  # which grows by what these come to
            if worker.busy in AMID_NOTHING:
                flush_automatic(worker)
    finally:
        core.late = None
    derive_scopes(core)


def flush_automatic(worker: Worker) -> None:
    """A9: the automatic events follow as sendings of their own, in the order they arose (D3)."""
    while worker.events_due:
        for name, value in worker.take_events():
            event = worker.events.get(name)
            if event is not None:
                trigger(event, value, stamp=worker.core.now(), extend_right=False)  # T5: automatic signals: now
