"""What leaves a node and what that changes (rules T, P4-P7, F3, F5, F6, F8, A3-A8, A12).

Plain functions over the run's state; they queue workers and never run a node's code, except the short hooks of
activity. Stands on `worker`, `core`.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from hfg.activity.rules import after_receipt, leaving
from hfg.engine.worker import CALLS_BLOCKED, ENDED, FULL, RATE, RunningEvent, Worker
from hfg.errors import EngineInternalError, QueueOverflow
from hfg.ports.edges import Edge, EventEdge, SyncEdge
from hfg.token import END, NO_MESSAGE, Marker, Token
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    ErrorRaised,
    EventTriggered,
    NodeEnded,
    TokenDrained,
    TokenDropped,
    TokenProcessed,
    TokenSent,
    TokenTaken,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hfg.engine.core import Core
    from hfg.engine.scopes import Scope

SAME_MOMENT_S = 1e-9  # times that differ by less are one: sums of floats do

__all__ = [
    "add_call",
    "arrived",
    "automatic",
    "block",
    "consider",
    "derive_scopes",
    "discard",
    "enqueue",
    "flush_automatic",
    "freed",
    "give_back",
    "must_wait",
    "note_full",
    "outputs_free",
    "put",
    "put_outputs",
    "queue",
    "receive",
    "release",
    "report_error",
    "send_end",
    "set_active",
    "take_from_reader",
    "touch",
    "trigger",
    "unblock",
    "unplace",
]


# --- who may move ---------------------------------------------------------------------------------------------------


def queue(worker: Worker) -> None:
    """Put it into its group's run queue, once."""
    if not worker.queued and not worker.busy:
        worker.queued = True
        worker.push(worker)


def consider(worker: Worker) -> None:
    """Something that F1 asks for has changed: give the next firing its place if all of it holds now (F9, D1)."""
    if worker.inputs.missing or worker.outputs.missing or worker.blocked or worker.placed:
        return
    if worker.paced and must_wait(worker):
        return
    worker.placed = True
    worker.ahead = len(worker.calls) if worker.calls else 0
    queue(worker)


def must_wait(worker: Worker) -> bool:
    """F11 and D7: nothing starts before the rate allows it; the timer is set only when something would."""
    when = worker.next_start
    if worker.is_source:
        for gate in worker.gates_over:
            if gate.idle_rate_hz is not None and not gate.state.active:
                when = max(when, worker.gate_next + 1.0 / gate.idle_rate_hz)
    core = worker.core
    if when <= core.now() + SAME_MOMENT_S:
        return False
    worker.blocked |= RATE

    def over() -> None:
        worker.rate_timer = None
        unblock(worker, RATE)

    worker.rate_timer = core.host.call_at(when, over)
    return True


def block(worker: Worker, reason: int) -> None:
    """Let no firing start; its place in the agenda is lost (D1)."""
    worker.blocked |= reason
    if reason == FULL:
        worker.placed = False  # a rate goes on holding it, and is to be over before a queue grows (F8)
    else:
        unplace(worker)


def unplace(worker: Worker) -> None:
    """What F1 asks for holds no more: no place, and no timer that would give one."""
    worker.placed = False
    if worker.rate_timer is not None:
        worker.rate_timer.cancel()
        worker.rate_timer = None
        worker.blocked &= ~RATE


def unblock(worker: Worker, reason: int) -> None:
    """Take one reason away and go on if it was the last."""
    if worker.blocked & reason:
        worker.blocked &= ~reason
        consider(worker)
        if worker.calls and not worker.blocked & CALLS_BLOCKED:
            queue(worker)


# --- synchronous edges ----------------------------------------------------------------------------------------------


def put_outputs(worker: Worker, written: Sequence[tuple[Any, int | None, float | None] | None] | None) -> None:
    """Put exactly one token on every live edge of every output, all together (F3), and let activity leave (A3, A5).

    Args:
      worker: whose firing is over.
      written: per output (value, explicit modifier, explicit stamp); None, or None in it, is NO_MESSAGE.
    """
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
        for edge in edges:
            modifier = leaving(may_carry, edge.active, explicit, value is NO_MESSAGE)
            carried = carried or (modifier == 1 and explicit is None)
            (for_slots if edge.target_kind == "slot" else for_inputs).append((edge, value, modifier, own_stamp))
    for edge, value, modifier, own_stamp in for_slots:
        put(edge, value, modifier, own_stamp)
    for edge, value, modifier, own_stamp in for_inputs:
        put(edge, value, modifier, own_stamp)
    if worker.outputs.missing:
        unplace(worker)
    if carried:
        _activity_left(worker)
    if worker.core.drained:
        _drained_act(worker.core)


def _activity_left(worker: Worker) -> None:
    """A5: the first sending that carried +1 took the activity.

    The right of A3 stays until the firing or call is over.
    """
    if worker.scope is not None:
        worker.active = worker.node._active = False  # whoever triggered takes it from everything inside (G2)
    elif worker.active:
        worker.right = worker.stamp is not None  # in a firing or call
        set_active(worker, False, "sent")
    derive_scopes(worker.core)


def put(edge: Any, value: Any, modifier: int, stamp: float) -> None:
    """Put one token on a synchronous edge."""
    edge.sent = number = edge.sent + 1
    token = Token(value, modifier, stamp, number)
    target: Worker = edge.target
    core = target.core
    if core.trace is not None:
        core.trace(TokenSent(core.now(), edge.label, token))
    if edge.target_kind == "slot":
        if type(value) is Marker:  # T4: processed at once, the handler is not called
            _drain(edge, token)
            return
        edge.token = token
        edge.held = True
        edge.source.outputs.missing += 1
        add_call(target, edge)
    elif target.blocked & ENDED:
        _drain(edge, token)
        return
    elif type(edge) is SyncEdge:
        if edge.token is not None or edge.held:
            raise EngineInternalError(f'a second token on synchronous edge "{edge.label}"')
        edge.token = token
        edge.held = True
        edge.source.outputs.missing += 1
        if type(value) is Marker:
            target.special = True
        arrived(edge)
    else:
        edge.queue.append(token)
        if len(edge.queue) > edge.delay:
            edge.held = True
            edge.source.outputs.missing += 1
        if type(value) is Marker:
            target.special = True
        if len(edge.queue) == 1:
            arrived(edge)
    if modifier > 0 and target.scopes:
        touch(core, target.scopes)


def arrived(edge: Edge) -> None:
    """One more input of its target holds a token."""
    target: Worker = edge.target
    if edge.ended:  # an optional one that was absent since its END takes part again (F4)
        target.core.upstairs.rewire(target)
        return
    barrier = target.inputs
    barrier.missing -= 1
    if not barrier.missing:
        if barrier.waiters is not None:
            barrier.notify()
        consider(target)


def add_call(target: Worker, edge: Edge) -> None:
    """The newest token on the edge waits for a slot call (F9)."""
    if target.calls is None:
        target.calls = deque()
    target.calls.append(edge)
    if not target.blocked & CALLS_BLOCKED:
        queue(target)


def _drain(edge: Edge, token: Token[Any]) -> None:
    """T4, F12: the token is processed at once, without a firing or call; its modifier acts behind the sending."""
    target: Worker = edge.target
    core = target.core
    into_slot = edge.target_kind == "slot"
    if not into_slot:
        edge.drained += 1
    if core.trace is not None:
        core.trace(TokenDrained(core.now(), edge.label, token))
    if token.activity:
        if target.deferred is not None and not into_slot:
            target.deferred.append(token.activity)
        else:
            core.drained.append((target, token.activity))


def _drained_act(core: Core) -> None:
    """The sending is on its edges: the modifiers of what was drained act; then what arose by that leaves."""
    drained, core.drained = core.drained, []
    for target, modifier in drained:
        receive(target, (modifier,))
    derive_scopes(core)
    for target, _ in drained:
        if not target.busy:  # else it follows the firing or call under way
            flush_automatic(target)


def release(edges: Sequence[Any]) -> None:
    """These tokens are processed: free the producers' places, and transitively what waited for them (F5).

    Without recursion.
    """
    stack: list[Any] = list(reversed(edges))
    while stack:
        edge = stack.pop()
        if not edge.held:
            continue
        edge.held = False
        producer: Worker = edge.source
        core = producer.core
        if core.trace is not None:
            core.trace(TokenProcessed(core.now(), edge.label))
        outputs = producer.outputs
        outputs.missing -= 1
        if not outputs.missing:
            stack.extend(reversed(outputs_free(producer)))


def outputs_free(worker: Worker) -> Sequence[Any]:
    """All its tokens are processed: it may go on; gives back the edges that are released by that (F5 sequential)."""
    released: Sequence[Any] = ()
    if worker.held:
        worker.held = False
        released = [upstream for upstream in worker.taken if upstream.sequential]
    if worker.outputs.waiters is not None:
        worker.outputs.notify()
    if worker.pending_end and not worker.busy:
        send_end(worker)
    else:
        consider(worker)
    return released


def send_end(worker: Worker) -> None:
    """END leaves on all outputs; from here the node is over (F4, F12)."""
    core = worker.core
    worker.pending_end = False
    end = (END, None, None)
    worker.stamp = worker.end_stamp
    put_outputs(worker, [end] * len(worker.out_edges))
    worker.stamp = None
    if core.trace is not None:
        core.trace(NodeEnded(core.now(), worker.path))
    deferred, worker.deferred = worker.deferred, None
    for modifier in deferred or ():
        receive(worker, (modifier,))
    derive_scopes(core)
    flush_automatic(worker)
    core.upstairs.node_ended(worker)


def take_from_reader(worker: Worker) -> Token[Any]:
    """Take the token that lies before a reader; its place is free at once."""
    edge = worker.live_inputs[0]
    token: Token[Any]
    if isinstance(edge, SyncEdge):
        token = edge.token  # type: ignore[assignment]  # the caller has seen that one lies there
        edge.token = None
    else:
        token = edge.queue.popleft()
    if not edge.untaken:
        worker.inputs.missing += 1
    worker.placed = False
    core = worker.core
    if core.trace is not None:
        core.trace(TokenTaken(core.now(), edge.label, token))
    if isinstance(edge, EventEdge):
        freed(edge)
    elif isinstance(edge, SyncEdge) or (edge.held and len(edge.queue) <= edge.delay):
        release((edge,))
    return token


# --- events ---------------------------------------------------------------------------------------------------------


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
        explicit = value.activity if explicit is None else explicit
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
            if modifier == 1 and explicit is None:
                carried = True
                loudest = 1
            sends.append((edge, modifier))
    port = event.port
    if core.trace is not None:
        core.trace(EventTriggered(core.now(), event.label, Token(value, loudest, stamp)))
    if port is not None and port._observers:
        port._notify(Token(value, loudest, stamp))
    for edge, modifier in sends:
        if edge.pipeline is not None:
            _into_operators(edge, Token(value, modifier, stamp))
        else:
            _append(edge, value, modifier, stamp)
    if carried:
        _activity_left(worker)
    if core.drained:
        _drained_act(core)
    if not core.pumping:
        core.host.kick()


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
    core = edge.target.core
    if core.drained:
        _drained_act(core)


def _append(edge: EventEdge, value: Any, modifier: int, stamp: float) -> None:
    """Put one token into the queue of an event edge, by its policy (P5, F8)."""
    edge.sent = number = edge.sent + 1
    token = Token(value, modifier, stamp, number)
    target: Worker = edge.target
    core = target.core
    if core.trace is not None:
        core.trace(TokenSent(core.now(), edge.label, token))
    into_input = edge.target_kind == "input"
    if into_input and target.blocked & ENDED:
        _drain(edge, token)
        return
    if edge.overflows():
        if edge.overflow == "drop_newest":
            _drop(edge, token, "overflow")
            return
        _drop(edge, edge.queue.popleft(), "overflow")
        if not into_input:
            _remove_call(target, edge)
        elif not edge.queue:  # for the input nothing has changed: it still holds a token
            edge.queue.append(token)
            return
    edge.queue.append(token)
    note_full(edge)
    if into_input:
        if type(value) is Marker:
            target.special = True
        if len(edge.queue) == 1:
            arrived(edge)
    else:
        add_call(target, edge)
    if modifier > 0 and target.scopes:
        touch(core, target.scopes)


def _remove_call(target: Worker, edge: Edge) -> None:
    """The call of the edge's oldest token will not come: the token was dropped."""
    assert target.calls is not None
    position = target.calls.index(edge)
    del target.calls[position]
    if position < target.ahead:
        target.ahead -= 1


def note_full(edge: EventEdge) -> None:
    """F8: a live `wait` edge that holds its capacity or more keeps its source from starting anything new."""
    if edge.overflow == "wait" and not edge.full and len(edge.queue) >= edge.capacity and edge.live:
        edge.full = True
        source: Worker = edge.source
        source.full_edges += 1
        block(source, FULL)


def freed(edge: EventEdge) -> None:
    """A token was taken from the queue: its source may go on if no other queue of it is full (F8)."""
    if edge.full and len(edge.queue) < edge.capacity:
        edge.full = False
        source: Worker = edge.source
        source.full_edges -= 1
        if not source.full_edges:
            if source.room_waiters is not None:
                waiters, source.room_waiters = source.room_waiters, None
                for waiter in waiters:
                    waiter()
            unblock(source, FULL)


# --- activity -------------------------------------------------------------------------------------------------------


def receive(worker: Worker, modifiers: Sequence[int]) -> None:
    """A6: only the net change counts."""
    active = after_receipt(worker.active, modifiers)
    if active != worker.active:
        set_active(worker, active, "token")


def set_active(worker: Worker, active: bool, cause: Any) -> None:
    """A(v) := active, and everything that follows a change."""
    if worker.active == active:
        return
    worker.active = active
    core = worker.core
    node = worker.node
    if node is not None:
        node._active = active
    if core.trace is not None:
        core.trace(ActivityChanged(core.now(), worker.path, active, cause))
    if not worker.watched:
        return
    core.upstairs.activity_changed(worker, active)


def touch(core: Core, scopes: Sequence[Scope]) -> None:
    """Something these subgraphs derive their activity from has changed."""
    for scope in scopes:
        if scope not in core.dirty_scopes:
            core.dirty_scopes.append(scope)


def derive_scopes(core: Core) -> None:
    """After a step that may have moved activity: derive A(subgraph) anew where it is watched (G2)."""
    if core.dirty_scopes:
        core.upstairs.scopes_changed(core)


def flush_automatic(worker: Worker) -> None:
    """A9: the automatic events follow as sendings of their own, in the order they arose (D3)."""
    while worker.events_due:
        due, worker.events_due = worker.events_due, None
        for name, value in due:
            event = worker.events.get(name)
            if event is not None:
                trigger(event, value, stamp=worker.core.now(), extend_right=False)  # T5: automatic signals: now


def automatic(worker: Worker, name: str, value: Any = None) -> None:
    """An automatic event has arisen; it leaves after the firing or call under way, or at the next flush."""
    if name in worker.events:
        if worker.events_due is None:
            worker.events_due = []
        worker.events_due.append((name, value))


# --- what is discarded ----------------------------------------------------------------------------------------------


def discard(edge: Any, reason: Any) -> None:
    """Take everything from an edge, counted and with its activity given back (F10, A8)."""
    tokens = edge.clear()
    target: Worker = edge.target
    if not tokens:
        return
    for token in tokens:
        _drop(edge, token, reason)
    if edge.target_kind == "slot" or (edge.target_kind == "parameter" and type(edge) is EventEdge):
        for _ in tokens:
            _remove_call(target, edge)
    elif edge in target.live_inputs:
        target.inputs.missing += 1
        unplace(target)
    if type(edge) is EventEdge:
        freed(edge)


def _drop(edge: Edge, token: Token[Any], reason: Any) -> None:
    edge.dropped += 1
    core: Core = edge.target.core
    if core.trace is not None:
        core.trace(TokenDropped(core.now(), edge.label, token, reason))
    if token.activity > 0:
        give_back(edge)
        touch(core, edge.target.scopes)


def give_back(edge: Edge) -> None:
    """A8: activity is never lost unseen: the sender has it again, or its loss is counted."""
    sender: Worker = edge.source
    core: Core = edge.target.core
    if sender.node is None:
        core.lost_activity += 1
        if core.trace is not None:
            core.trace(ActivityLost(core.now(), edge.label))
        return
    set_active(sender, True, "returned")


def report_error(worker: Worker, what: str, error: BaseException, policy: str) -> None:
    """Tell whoever listens that a node's code failed."""
    core = worker.core
    if core.trace is not None:
        core.trace(ErrorRaised(core.now(), worker.path, what, f"{type(error).__name__}: {error}", policy))
