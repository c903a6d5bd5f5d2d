"""The fast path of signals: an event triggered into one slot, and the call that follows.

Closures in which everything that cannot change between two edits is a local. They are only a shortening: under every
condition they do not cover they hand over to `sending.trigger` and `firing.step`, whose outcome they must equal
(property: engine = oracle with `fast` on and off). Stands on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.engine.model.worker import CALLS_BLOCKED, RunningEvent, Worker
from hfg.engine.rules import errors, firing
from hfg.engine.rules.agenda import add_call, freed, idle_again, note_full
from hfg.engine.rules.calls import await_call
from hfg.engine.rules.modifiers import derive_scopes, tell_activity
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import bring_activity, trigger
from hfg.ports.edges import EventEdge, SyncEdge
from hfg.token import Token

__all__ = ["calls_step", "emitter"]

Step = Callable[[Worker], None]


def calls_step(worker: Worker) -> Step:
    """The step of a node that lives by its slots."""
    general = firing.step
    calls: Any = worker.calls
    steps = {edge: _call_step(worker, edge) for edge in worker.slot_edges}
    if len(steps) == 1:
        return steps.popitem()[1]

    def step(worker: Worker) -> None:
        if calls:
            steps[calls[0]](worker)
        else:
            general(worker)

    return step


def _call_step(worker: Worker, edge: SyncEdge | EventEdge) -> Step:
    """One edge into one slot, whose handler takes the value.

    A token that an output has sent is processed when the call is over, or takes it (F6).
    """
    handler: Any = edge.handler
    queue = edge.queue if type(edge) is EventEdge else None
    if handler is None or (edge.while_active and queue is not None):
        return firing.step
    core, general = worker.core, firing.step
    calls: Any = worker.calls
    lies: Any = edge  # a synchronous one, where there is no queue
    held = (edge,) if queue is None and lies.sequential else ()
    pipelined = (edge,) if queue is None and not held else ()
    while_active = edge.while_active

    def step(worker: Worker) -> None:
        if not calls or worker.blocked & CALLS_BLOCKED or worker.busy:
            general(worker)
            return
        # it stays `queued` while its handler runs, so that what that triggers cannot queue it a second time
        calls.popleft()
        worker.call_number += 1
        if queue is None:
            token, lies.token = lies.token, None
            if pipelined:
                release(pipelined)
        else:
            token = queue.popleft()
            if lies.full:
                freed(lies)
        if token.activity:
            _take_activity(worker, token.activity > 0)
        if not while_active or worker.active:  # T4: it was when the token came
            core.speaker = worker
            worker.stamp = token.stamp
            try:
                result = handler(token.value)
            except Exception as error:
                worker.be_amid_call(edge)
                errors.fail_call(worker, edge.port_name, error)
                return
            if type(result) is CoroutineType:
                worker.be_amid_call(edge)
                await_call(worker, edge.port_name, result)
                return
            worker.stamp = None
            worker.right = False
        if held:
            release(held)
        worker.queued = False
        if calls or worker.on_idle is not None:
            idle_again(worker)

    return step


def emitter(event: RunningEvent, *, plainly: bool = False) -> Callable[..., None]:
    """What a port's `trigger` does: the fast path for one plain edge into a slot that nobody watches.

    Else `sending.trigger`.
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
        and edge.pipeline is None
        and event.worker.within is None
        and not event.worker.watched
    )


def _interpreted_emitter(event: RunningEvent) -> Callable[..., None]:
    core = event.worker.core
    host = core.host

    def emit(value: object = None, *, activity: int | None = None, stamp: float | None = None) -> None:
        if host.on_loop():
            trigger(event, value, activity, stamp)
        else:  # from a thread that the user has started, as drivers do
            host.bring_in(partial(trigger, event, value, activity, core.now() if stamp is None else stamp))

    return emit


def _slot_emitter(event: RunningEvent, edge: EventEdge, interpreted: Callable[..., None]) -> Callable[..., None]:
    worker, port = event.worker, event.port
    core = worker.core
    host = core.host
    watched = port._observers is not None
    target: Worker = edge.target
    queue = edge.queue
    calls: Any = target.calls
    carries = edge.active
    alone = 0 if edge.capacity == 1 else 1  # so many signals fill no queue

    # (parameters by keyword alone would cost 20 ns; who gives them by position is refused by the type checker)
    def emit(value: object = None, activity: int | None = None, stamp: float | None = None) -> None:
        if (
            activity is not None
            or core.speaker is not worker  # not out of a fast path; perhaps a thread, while the loop is at work
            or watched
            or not edge.live
            or type(value) is Token
        ):
            interpreted(value, activity=activity, stamp=stamp)
            return
        if stamp is None:
            stamp = worker.stamp
            if stamp is None:
                stamp = core.now()
        edge.sent = number = edge.sent + 1
        if carries and (worker.active or worker.right):
            queue.append(Token(value, 1, stamp, number))
            _give_activity(worker, target)
        else:
            queue.append(Token(value, 0, stamp, number))
        if len(queue) > alone or target.busy:
            edge.deepest = max(edge.deepest, len(queue))
            note_full(edge)
            add_call(target, edge)
        else:
            calls.append(edge)
            if not target.queued:  # if it is blocked its step does nothing
                target.queued = True
                target.push(target)
        if core.speaker is not worker:  # a thread was here after all, and perhaps the loop has gone to rest
            host.from_any_thread(host.kick)

    def look() -> None:
        nonlocal watched
        watched = port._observers is not None

    port._look = look
    return emit


def _take_activity(worker: Worker, active: bool) -> None:
    """A6: what the call brings acts before it; nothing depends on the activity of such a node but itself."""
    if worker.active != active:
        worker.active = worker.node._active = active
        tell_activity(worker, "token")


def _give_activity(worker: Worker, target: Worker) -> None:
    """A5: what carries activity takes it from the sender; it stays its right until the call is over (A3)."""
    if worker.active:
        worker.give_away_activity()
        tell_activity(worker, "sent")
    bring_activity(target)
    derive_scopes(worker.core)
