"""The fast path of signals: an event triggered into one slot, and the call that follows.

Closures in which everything that cannot change between two edits is a local. They are only a shortening: under every
condition they do not cover they hand over to `sending.trigger` and `firing.step`, whose outcome they must equal
(property: engine = oracle with `fast` on and off). Depends on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.token import Token
from hfg.engine.model import Core, Group, RunningEvent
from hfg.engine.model.running_node import NO_CALLS, RunningNode
from hfg.engine.rules import errors, firing
from hfg.engine.rules.agenda import add_call, freed, idle_again, note_full
from hfg.engine.rules.calls import await_call
from hfg.engine.rules.modifiers import derive_scopes, tell_activity
from hfg.engine.rules.putting import bring_activity
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import trigger
from hfg.ports.base import need_sendable
from hfg.ports.edges import AnyEdge, EventEdge, SyncEdge

__all__ = ["calls_step", "emitter"]

Step = Callable[[RunningNode], None]


def calls_step(worker: RunningNode) -> Step:
    """The step of a node that lives by its slots."""
    general = firing.step
    calls: Any = worker.calls
    steps = {edge: _call_step(worker, edge) for edge in worker.slot_edges}
    if len(set(steps.values())) == 1:
        return steps.popitem()[1]

    def step(worker: RunningNode) -> None:
        if calls:
            steps[calls[0]](worker)
            if worker.is_next and not (worker.busy or worker.queued):
                worker.clear_next()  # it stood in the queue only for this call (R2)
        else:
            general(worker)

    return step


def _call_step(worker: RunningNode, edge: SyncEdge | EventEdge) -> Step:
    """One edge into one slot with a plain handler."""
    if edge.handler is None:
        return firing.step
    if isinstance(edge, SyncEdge):
        return _token_step(worker, edge)
    return firing.step if edge.while_active or edge.takes_token else _signal_step(worker.group, worker.core)


def _signal_step(group: Group, core: Core) -> Step:
    """Signals into slots whose handlers take the value: one step for all nodes of a group that live by such slots.

    Because it is the same for all, it takes the next of them from the run queue itself: a *row of calls*, in which
    others have their turns too, and which ends where the pump would check timers and other groups.
    """
    if group.signal_step is not None:
        return group.signal_step
    general, flags, queued, take = firing.step, core.flags, group.policy, group.take
    ready, in_a_row = core.ready_groups, group.in_a_row
    amid = False  # the turn of another in a row; if it comes back here, that is one call: rows in rows have no end

    def step(worker: RunningNode) -> None:
        nonlocal amid
        given = more = group.budget - 1 if in_a_row and not amid else 0
        own: Step = step  # who is called here goes this way, whatever else it may do in turns of its own
        try:
            while True:
                if own is not step:  # a source, say: the row continues after it
                    amid = True
                    own(worker)
                    amid = False
                else:
                    edge: Any = worker.caller
                    calls: Any = worker.calls if edge is None else edge.queue
                    if not calls or worker.blocked >= NO_CALLS or worker.busy:
                        return general(worker)
                    # it stays `queued` while its handler runs, so that what that triggers cannot queue it a second time
                    if edge is None:
                        edge = calls.popleft()
                    handler = edge.handler  # what is called as a field is looked up the slow way
                    worker.counts.calls += 1
                    value, modifier, worker.stamp, _ = edge.queue.popleft()
                    if edge.full:
                        freed(edge)
                    if modifier:
                        _take_activity(worker, modifier > 0)
                    core.running_node = worker
                    try:
                        result = handler(value)
                    except Exception as error:
                        return _failed(worker, edge, error)
                    if result is not None and type(result) is CoroutineType:
                        return _waits(worker, edge, result)
                    worker.stamp = None
                    worker.may_carry = False
                    worker.queued = False
                    if calls or worker.idle_callbacks is not None:
                        idle_again(worker)
                if not more or flags or ready or not queued:
                    return None
                more -= 1
                worker = take()
                own = worker.step
        finally:
            if given:
                amid = False
                group.spend(given - more)

    group.signal_step = step
    return step


def _token_step(worker: RunningNode, edge: SyncEdge) -> Step:
    """A token that an output has sent is processed when the call is over, or takes it (F6)."""
    handler: Any = edge.handler
    core, general = worker.core, firing.step
    calls: Any = worker.calls
    lies: Any = edge  # what lies there is taken without a call
    held = (edge,) if edge.sequential else ()
    pipelined = () if held else (edge,)
    while_active, takes_token = edge.while_active, edge.takes_token

    def step(worker: RunningNode) -> None:
        if not calls or worker.blocked >= NO_CALLS or worker.busy:
            return general(worker)
        # it stays `queued` while its handler runs, so that what that triggers cannot queue it a second time
        calls.popleft()
        worker.counts.calls += 1
        token, lies.token = lies.token, None
        if pipelined:
            release(pipelined)
        if token.activity:
            _take_activity(worker, token.activity > 0)
        if not while_active or worker.active:  # T4: it was when the token came
            core.running_node = worker
            worker.stamp = token.stamp
            try:
                result = handler(token if takes_token else token.value)
            except Exception as error:
                return _failed(worker, edge, error)
            if result is not None and type(result) is CoroutineType:
                return _waits(worker, edge, result)
            worker.stamp = None
            worker.may_carry = False
        if held:
            release(held)
        worker.queued = False
        if calls or worker.is_next or worker.idle_callbacks is not None:
            idle_again(worker)
        return None

    return step


def _failed(worker: RunningNode, edge: AnyEdge, error: Exception) -> None:
    """The handler has raised: from here on the call is one like any other."""
    worker.resume_as_call(edge)
    errors.fail_call(worker, edge.port_name, error)


def _waits(worker: RunningNode, edge: AnyEdge, coroutine: CoroutineType[Any, Any, Any]) -> None:
    """The handler has given code that waits: from here on the call is one like any other."""
    worker.resume_as_call(edge)
    await_call(worker, edge.port_name, coroutine)


def emitter(event: RunningEvent, *, plainly: bool = False) -> Callable[..., None]:
    """Return the function behind a port's `trigger`: the fast path if one plain, unobserved edge leads into a slot.

    Otherwise `sending.trigger`.
    """
    interpreted = _interpreted_emitter(event)
    if plainly or not event.worker.core.fast or len(event.edges) != 1 or not _may_be_short(event, event.edges[0]):
        return interpreted
    return _slot_emitter(event, event.edges[0], interpreted)


def _may_be_short(event: RunningEvent, edge: EventEdge) -> bool:
    return (
        edge.target_kind == "slot"
        and not edge.while_active
        and edge.overflow == "wait"
        and edge.capacity > 1  # so one signal does not fill the queue
        and edge.pipeline is None
        and event.worker.within is None
        and not event.worker.watched
    )


def _interpreted_emitter(event: RunningEvent) -> Callable[..., None]:
    core = event.worker.core
    host = core.runtime

    def emit(value: object = None, *, activity: int | None = None, stamp: float | None = None) -> None:
        need_sendable(value, activity, stamp)
        if host.on_loop():
            trigger(event, value, activity, stamp)
        else:  # from a thread that the user has started, as drivers do
            host.bring_in(partial(trigger, event, value, activity, core.now() if stamp is None else stamp))

    return emit


def _slot_emitter(event: RunningEvent, edge: EventEdge, interpreted: Callable[..., None]) -> Callable[..., None]:
    worker, port = event.worker, event.port
    core, host = worker.core, worker.core.runtime
    watched = port._observers is not None
    target: RunningNode = edge.target
    queue, carries = edge.queue, edge.active

    # (keyword-only parameters would cost 20 ns; the type checker refuses positional ones)
    def emit(value: object = None, activity: int | None = None, stamp: float | None = None) -> None:
        # another node runs if this does not come from a fast path, but perhaps from a thread while the loop runs
        if (
            core.running_node is not worker
            or watched
            or not edge.live
            or activity is not None
            or stamp is not None
            or type(value) is Token
        ):
            interpreted(value, activity=activity, stamp=stamp)
            return
        stamp = worker.stamp
        if stamp is None:
            stamp = core.now()
        edge.sent = number = edge.sent + 1
        if carries and (worker.active or worker.may_carry):
            queue.append((value, 1, stamp, number))
            _give_activity(worker, target)
        else:
            queue.append((value, 0, stamp, number))
        if target.queued or target.busy or target.blocked >= NO_CALLS:
            edge.deepest = max(edge.deepest, len(queue))
            note_full(edge)
            add_call(target, edge)
        else:
            if target.caller is not edge:
                target.expect_call(edge)
            target.queued = True
            push = target.push
            push(target)
        if core.running_node is not worker:  # a thread was here after all, and perhaps the loop has gone to rest
            host.from_any_thread(host.kick)

    def look() -> None:
        nonlocal watched
        watched = port._observers is not None

    port._notify_on_subscription(look)
    return emit


def _take_activity(worker: RunningNode, active: bool) -> None:
    """A6: what the call brings acts before it; nothing depends on the activity of such a node but itself."""
    if worker.active != active:
        worker.become(active)
        if worker.core.trace_changes is not None:
            tell_activity(worker, "token")


def _give_activity(worker: RunningNode, target: RunningNode) -> None:
    """A5: what carries activity takes it from the sender; it stays its right until the call is over (A3)."""
    if worker.active:
        worker.give_away_activity()
        if worker.core.trace_changes is not None:
            tell_activity(worker, "sent")
    bring_activity(target)
    derive_scopes(worker.core)
