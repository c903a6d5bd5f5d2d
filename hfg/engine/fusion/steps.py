"""Shorter ways for the common shapes.

A closure per worker in which everything that cannot change between two edits is a local (figures in docs/speed.md).

A step is only a shortening: under every condition it does not cover it hands over to `firing.step`, whose outcome it
must equal (property: engine = oracle with `fast` on and off). A worker's step is chosen anew whenever its wiring or
somebody's interest in the trace changes. Stands on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.engine.fusion import joins, watched
from hfg.engine.model.core import OF_ITS_OWN_KIND, PENDING
from hfg.engine.model.worker import CALLS_BLOCKED, ENDED, RunningEvent, Worker
from hfg.engine.rules import errors, firing
from hfg.engine.rules.agenda import add_call, consider, freed, note_full
from hfg.engine.rules.calls import await_call
from hfg.engine.rules.modifiers import derive_scopes, touch
from hfg.engine.rules.releasing import outputs_done, release
from hfg.engine.rules.sending import trigger
from hfg.ports.edges import EventEdge, SyncEdge
from hfg.token import Token

__all__ = ["choose", "emitter"]

Step = Callable[[Worker], None]


def choose(worker: Worker) -> None:
    """Give the worker the shortest step that is right for its present shape, behind its breakpoint if it has one."""
    _choose(worker)
    if worker.halt is not None:
        worker.step = worker.halt(worker.step)


def _choose(worker: Worker) -> None:
    core = worker.core
    if worker.is_boundary_output:
        worker.step = worker.process or _leave_lying
        return
    worker.step = firing.step
    if worker.iteration is None and core.inside is not None:
        worker.step = core.inside.step
    if not core.fast or core.debug or worker.options is None or worker.group.threaded:
        return
    if worker.gates_over or worker.iteration is not None or worker.ready_hook is not None or worker.observed:
        return
    if worker.on_idle is not None:
        return
    traced = core.trace is not None
    options = worker.options
    if (
        options.max_rate_hz
        or options.max_duration_s
        or worker.scopes
        or worker.watched
        or (worker.type.parameters and _parameters_wired(worker))
    ):
        return
    if worker.slot_edges and not worker.in_edges and not worker.is_source:
        if not traced:
            worker.step = _calls_step(worker)
        return
    if worker.slot_edges or "processed" in worker.events:
        return
    outs = [edge for edges in worker.out_edges for edge in edges]
    if any(
        type(edge) is not SyncEdge or edge.target_kind != "input" or edge.ended or edge.target.blocked & ENDED
        for edge in outs
    ):
        return
    if any(edge.target.is_boundary_output and edge.target.process is None for edge in outs):
        return  # a reader waits at its barrier
    if worker.type.result == "fields" or (outs and worker.type.result != "single"):
        return
    traced = traced or any(edge.tap is not None for edge in outs)
    if worker.is_source:
        if worker.type.process_kind != "generator" or worker.process is None or not outs:
            return
        if not traced:
            worker.step = joins.generator_step(worker, tuple(outs))
        elif len(outs) == 1:
            worker.step = watched.generator_step(worker, outs[0])
        return
    if len(outs) > 1 or len(worker.in_edges) > 1 or any(type(edge) is EventEdge for edge in worker.in_edges):
        if not traced:
            worker.step = wide = _wide(worker, tuple(outs))
            if worker.meter is not None and wide is not firing.step:
                worker.step = watched.general_step(worker, wide)
        return
    if (
        len(worker.in_edges) == 1
        and len(worker.live_inputs) == 1
        and len(worker.unset) == 1
        and not worker.wants_token[0]
    ):
        edge = worker.live_inputs[0]
        if (
            type(edge) is SyncEdge
            and edge.target_kind == "input"
            and edge.mandatory
            and worker.type.process_kind in ("function", "async")
        ):
            given = outs[0] if outs else None
            if not worker.is_async:
                quick = None if traced else _through_step(worker, edge, given)
                if quick is not None:
                    worker.step = quick
                if traced or worker.meter is not None:
                    worker.step = watched.through_step(worker, edge, given, quick)
            elif not traced:
                worker.step = _async_step(worker, edge, given)


def _wide(worker: Worker, outs: tuple[Any, ...]) -> Step:
    """A plain function with several edges, or behind an event."""
    edges = worker.live_inputs
    whole = len(edges) == len(worker.in_edges) == len(worker.unset) and not any(worker.wants_token)
    if not whole or worker.is_async or worker.type.process_kind != "function":
        return firing.step
    if any(edge.target_kind != "input" for edge in edges):
        return firing.step
    if len(edges) == 1 and type(edges[0]) is EventEdge:
        return joins.handle_step(worker, edges[0], outs) if edges[0].mandatory else firing.step
    if all(type(edge) is SyncEdge and edge.sequential == edges[0].sequential for edge in edges):
        return joins.join_step(worker, edges, outs)
    return firing.step


def _leave_lying(worker: Worker) -> None:
    """A graph output: its token lies there until somebody reads it (P10)."""
    worker.queued = False


def _parameters_wired(worker: Worker) -> bool:
    return len(worker.out_names) > len(worker.type.outputs) or any(
        edge.target_kind == "parameter" for edge in worker.in_edges
    )


def _through_step(worker: Worker, taken: SyncEdge, given: SyncEdge | None) -> Step:
    """A plain function with one input and at most one output edge: the shape of a pipeline."""
    core = worker.core
    node = worker.node
    process: Any = worker.process if worker.meter is None else worker.meter.code
    inputs = worker.inputs
    outputs = worker.outputs
    producer: Worker = taken.source
    producer_outputs = producer.outputs
    sequential = taken.sequential
    silent_code = worker.silent_code  # it cannot send by itself, so nobody needs to know that it runs
    general = firing.step
    target: Any = given.target if given is not None else None
    target_inputs: Any = target.inputs if given is not None else None
    target_outputs: Any = target.outputs if given is not None else None
    carries = given is not None and given.active
    only = (taken,)
    plain: Any = None  # the type of the last result that simply left

    def step(worker: Worker) -> None:
        nonlocal plain
        if worker.special or not worker.placed or inputs.missing or worker.busy:
            general(worker)
            return
        worker.queued = worker.placed = False
        token: Any = taken.token
        taken.token = None
        inputs.missing = 1
        if token.activity:
            worker.active = node._active = token.activity > 0
        worker.firings += 1
        core.speaker = worker
        if not silent_code:
            worker.busy = "firing"
            worker.stamp = token.stamp
            worker.taken = only
        try:
            result = process(token.value)
        except Exception as error:
            errors.fail_taken(worker, token.stamp, only, error)
            return
        if not silent_code:
            if worker.written is not None or worker.right:
                firing.complete_firing(worker, result)
                return
            worker.busy = ""
            worker.stamp = None
        if given is None:
            if result is not None or worker.calls or worker.events_due:
                worker.busy = "firing"
                worker.stamp = token.stamp
                worker.taken = only
                firing.complete_firing(worker, result)
                return
            # the sink's firing is over: what it took is processed
            taken.held = False
            producer_outputs.missing = missing = producer_outputs.missing - 1
            if not missing:
                outputs_done(producer)
            return
        if type(result) is not plain:  # one look for all results of the same type
            if type(result) in OF_ITS_OWN_KIND:
                worker.busy = "firing"
                worker.stamp = token.stamp
                worker.taken = only
                firing.complete_firing(worker, result)
                return
            plain = type(result)
        given.sent = number = given.sent + 1
        if carries and worker.active:
            worker.active = node._active = False
            given.token = Token(result, 1, token.stamp, number)
        else:
            given.token = Token(result, 0, token.stamp, number)
        given.held = True
        outputs.missing = 1
        target_inputs.missing = missing = target_inputs.missing - 1
        if not missing:
            if target.blocked or target_outputs.missing or target.placed or target.calls is not None or target.paced:
                consider(target)
            else:
                target.placed = True
                if not target.queued and not target.busy:
                    target.queued = True
                    target.push(target)
        if sequential:
            worker.held = True
            worker.taken = only
        else:
            release(only)

    return step


def _async_step(worker: Worker, taken: SyncEdge, given: SyncEdge | None) -> Step:
    """The same for an async function: it starts at once, and what it gives back leaves by the same short way.

    Now or later.
    """
    core = worker.core
    host = core.host
    node = worker.node
    process: Any = worker.process
    inputs = worker.inputs
    outputs = worker.outputs
    start = worker.carrier.start
    general = firing.step
    target: Any = given.target if given is not None else None
    carries = given is not None and given.active
    only = (taken,)

    def leave(result: Any, error: BaseException | None) -> None:
        if error is not None:
            errors.fail(worker, f"firing {worker.firings}", error, answer=True)
            return
        if (
            given is None
            or type(result) in OF_ITS_OWN_KIND
            or worker.step is not step  # somebody has begun to watch, or the wiring has changed
            or worker.written is not None
            or worker.right
            or worker.calls
            or worker.events_due
            or (carries and worker.active)
        ):
            firing.complete_firing(worker, result)
            return
        stamp: Any = worker.stamp
        worker.busy = ""
        worker.stamp = None
        given.sent = number = given.sent + 1
        given.token = Token(result, 0, stamp, number)
        given.held = True
        outputs.missing = 1
        worker.placed = False
        barrier = target.inputs
        barrier.missing -= 1
        if not barrier.missing:
            consider(target)
        if taken.sequential:
            worker.held = True
        else:
            release(only)

    late = host.late(worker, leave)

    def step(worker: Worker) -> None:
        if worker.special or not worker.placed or inputs.missing or worker.busy:
            general(worker)
            return
        worker.queued = worker.placed = False
        token: Any = taken.token
        taken.token = None
        inputs.missing = 1
        if token.activity:
            worker.active = node._active = token.activity > 0
        worker.firings += 1
        core.speaker = worker
        worker.busy = "firing"
        worker.stamp = token.stamp
        worker.taken = only
        try:
            result = start(process(token.value), late)
        except Exception as error:
            leave(None, error)
            return
        if result is PENDING:
            host.begin(worker)
        else:
            leave(result, None)

    return step


def _calls_step(worker: Worker) -> Step:
    """A node that lives by its slots."""
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


def _call_step(worker: Worker, edge: EventEdge) -> Step:
    """One edge into one slot, whose handler takes the value."""
    handler: Any = edge.handler
    if handler is None or type(edge) is not EventEdge:
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
        if calls and not worker.blocked & CALLS_BLOCKED:
            worker.push(worker)
        else:
            worker.queued = False

    return step


def _call_taken(worker: Worker, edge: EventEdge) -> None:
    """A short call goes on as one like any other."""
    worker.queued = False
    worker.busy = "call"
    worker.call_edge = edge
    worker.ticket += 1


def emitter(event: RunningEvent, *, plainly: bool = False) -> Callable[..., None]:
    """What a port's `trigger` does: the short way for one plain edge into a slot that nobody watches.

    Else `sending.trigger`.
    """
    worker = event.worker
    core = worker.core
    host: Any = core.host
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
    if edge.target_kind != "slot" or edge.overflow != "wait" or edge.pipeline is not None or worker.watched:
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
