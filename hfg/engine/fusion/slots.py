"""The fast path of signals: an event triggered into one slot, and the call that follows.

Closures in which everything that cannot change between two edits is a local. They are only a shortening: under every
condition they do not cover they hand over to `sending.trigger` and `firing.step`, whose outcome they must equal
(property: engine = oracle with `fast` on and off). Stands on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.engine.model.worker import CALLS_BLOCKED, RunningEvent, Worker
from hfg.engine.rules import errors, firing
from hfg.engine.rules.agenda import add_call, freed, idle_again, note_full
from hfg.engine.rules.calls import await_call, finish_call
from hfg.engine.rules.listening import may_listen
from hfg.engine.rules.modifiers import derive_scopes, touch
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import trigger
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


def _call_step(worker: Worker, edge: Any) -> Step:
    """One edge into one slot, whose handler takes the value."""
    handler: Any = edge.handler
    if handler is None:
        return firing.step
    if type(edge) is SyncEdge:
        return _call_by_output_step(worker, edge)
    if edge.while_active:
        return firing.step
    core = worker.core
    node = worker.node
    general = firing.step
    calls: Any = worker.calls
    queue = edge.queue
    gives = any(one.active for one in worker.event_edges())  # else it has no activity to give away

    def step(worker: Worker) -> None:
        if not calls or worker.blocked & CALLS_BLOCKED or worker.busy:
            general(worker)
            return
        # it stays `queued` while its handler runs, so that what that triggers cannot queue it a second time
        calls.popleft()
        token = queue.popleft()
        worker.call_number += 1
        if edge.full and len(queue) < edge.capacity:
            freed(edge)
        if token.activity:
            worker.active = node._active = token.activity > 0
        core.speaker = worker
        worker.stamp = token.stamp
        try:
            result = handler(token.value)
        except Exception as error:
            _call_taken(worker, edge)
            errors.fail_call(worker, edge.port_name, error)
            return
        if result is not None and type(result) is CoroutineType:
            _call_taken(worker, edge)
            await_call(worker, edge.port_name, result)
            return
        worker.stamp = None
        if gives:
            worker.right = False
        worker.queued = False
        if calls or worker.on_idle is not None:
            idle_again(worker)

    return step


def _call_by_output_step(worker: Worker, edge: SyncEdge) -> Step:
    """The same behind an output: its token is processed when the call is over, or takes it (F6)."""
    handler: Any = edge.handler
    core = worker.core
    general = firing.step
    calls: Any = worker.calls
    only = (edge,)
    sequential = edge.sequential
    while_active = edge.while_active

    def step(worker: Worker) -> None:
        token: Any = edge.token
        if not calls or worker.blocked & CALLS_BLOCKED or worker.busy or token.activity:
            general(worker)
            return
        calls.popleft()
        edge.token = None
        worker.call_number += 1
        if not sequential:
            release(only)
        if while_active and not worker.active:  # T4: it was when the token came
            _over(worker, only if sequential else (), calls)
            return
        core.speaker = worker
        worker.stamp = token.stamp
        try:
            result = handler(token.value)
        except Exception as error:
            _call_taken(worker, edge)
            errors.fail_call(worker, edge.port_name, error)
            return
        if result is not None and type(result) is CoroutineType:
            _call_taken(worker, edge)
            await_call(worker, edge.port_name, result)
            return
        if worker.right or worker.events_due:
            _call_taken(worker, edge)
            finish_call(worker, "done")
            return
        worker.stamp = None
        _over(worker, only if sequential else (), calls)

    return step


def _over(worker: Worker, held: tuple[SyncEdge, ...], calls: Collection[Any]) -> None:
    """A call by an output is over: its token is processed."""
    if held:
        release(held)
    worker.queued = False
    if calls or worker.on_idle is not None:
        idle_again(worker)


def _call_taken(worker: Worker, edge: EventEdge | SyncEdge) -> None:
    """A short call goes on as one like any other."""
    worker.queued = False
    worker.busy = "call"
    worker.call_edge = edge
    worker.ticket += 1


def emitter(event: RunningEvent, *, plainly: bool = False) -> Callable[..., None]:
    """What a port's `trigger` does: the fast path for one plain edge into a slot that nobody watches.

    Else `sending.trigger`.
    """
    worker = event.worker
    core = worker.core
    host = core.host
    edges = event.edges

    def emit_general(value: Any = None, *, activity: int | None = None, stamp: float | None = None) -> None:
        if host.on_loop():
            trigger(event, value, activity, stamp)
        else:  # from a thread that the user has started, as drivers do
            host.bring_in(partial(trigger, event, value, activity, core.now() if stamp is None else stamp))

    if plainly or not core.fast or len(edges) != 1:
        return emit_general
    edge = edges[0]
    target: Worker = edge.target
    node = worker.node
    if (
        edge.while_active
        or edge.target_kind != "slot"
        or edge.overflow != "wait"
        or edge.pipeline is not None
        or worker.watched
    ):
        return emit_general
    port = event.port
    watched = port._observers is not None
    queue = edge.queue
    calls: Any = target.calls
    carries = edge.active
    scopes = target.scopes
    tight = edge.capacity == 1

    # (parameters by keyword alone would cost 20 ns; who gives them by position is refused by the type checker)
    def emit(value: Any = None, activity: int | None = None, stamp: float | None = None) -> None:
        if (
            activity is not None
            or core.speaker is not worker  # not out of a short step; perhaps a thread, while the loop is at work
            or watched
            or not edge.live
            or type(value) is Token
        ):
            emit_general(value, activity=activity, stamp=stamp)
            return
        if stamp is None:
            stamp = worker.stamp
            if stamp is None:
                stamp = core.now()
        edge.sent = number = edge.sent + 1
        if not carries:
            queue.append(Token(value, 0, stamp, number))
        elif worker.active or worker.right:
            if target.listened is not None:
                may_listen(target)
            queue.append(Token(value, 1, stamp, number))
            if worker.active:
                worker.active = node._active = False
                worker.right = worker.stamp is not None
            if scopes:
                touch(core, scopes)
                derive_scopes(core)
        else:
            queue.append(Token(value, 0, stamp, number))
        if calls or tight or target.busy:  # else it is the only one that waits
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
