"""Short ways for joins and forks: a source or a plain function, any number of edges in and out.

As in `steps`, from which these are chosen: under every condition that they do not cover they hand over to
`firing.step`, whose outcome they equal. Stands on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hfg.engine.model.core import OF_ITS_OWN_KIND
from hfg.engine.model.worker import Worker
from hfg.engine.rules import ending, errors, firing
from hfg.engine.rules.agenda import consider, freed
from hfg.engine.rules.releasing import release
from hfg.errors import EndOfStream
from hfg.ports.edges import EventEdge, SyncEdge
from hfg.token import Marker, Token

__all__ = ["generator_step", "handle_step", "join_step"]

Step = Callable[[Worker], None]


def join_step(worker: Worker, taken: tuple[SyncEdge, ...], given: tuple[SyncEdge, ...]) -> Step:
    """A plain function with a value on each of its inputs, all from outputs."""
    core = worker.core
    process: Any = worker.process
    inputs = worker.inputs
    in_order = sorted(taken, key=lambda edge: edge.position)
    count = len(taken)
    sequential = taken[0].sequential
    silent_code = worker.silent_code
    general = firing.step
    carries = any(edge.active for edge in given)
    leave = _leaving(worker, given)

    def step(worker: Worker) -> None:
        if worker.special or not worker.placed or inputs.missing or worker.busy:
            general(worker)
            return
        values = []
        stamp = -1.0
        for edge in in_order:
            token: Any = edge.token
            if token.activity:
                general(worker)
                return
            if token.stamp > stamp:
                stamp = token.stamp
            values.append(token.value)
        worker.queued = worker.placed = False
        for edge in taken:
            edge.token = None
        inputs.missing = count
        worker.firings += 1
        core.speaker = worker
        worker.taken = taken
        if not silent_code:
            worker.busy = "firing"
            worker.stamp = stamp
        try:
            result = process(*values)
        except Exception as error:
            worker.busy = "firing"
            worker.stamp = stamp
            errors.fail(worker, f"firing {worker.firings}", error, answer=True)
            return
        if (
            type(result) in OF_ITS_OWN_KIND
            or worker.written is not None
            or worker.right
            or worker.calls
            or worker.events_due
            or worker.on_idle is not None
            or (carries and worker.active)
            or (result is not None and not given)
        ):
            worker.busy = "firing"
            worker.stamp = stamp
            firing.complete_firing(worker, result)
            return
        worker.busy = ""
        worker.stamp = None
        leave(result, stamp)
        if sequential and given:
            worker.held = True
        else:
            release(taken)

    return step


def handle_step(worker: Worker, taken: EventEdge, given: tuple[SyncEdge, ...]) -> Step:
    """A plain function whose only input is fed by an event."""
    core = worker.core
    process: Any = worker.process
    inputs = worker.inputs
    queue = taken.queue
    general = firing.step
    carries = any(edge.active for edge in given)
    leave = _leaving(worker, given)

    def step(worker: Worker) -> None:
        if worker.special or not worker.placed or inputs.missing or worker.busy or not taken.live or queue[0].activity:
            general(worker)
            return
        worker.queued = worker.placed = False
        token = queue.popleft()
        if not queue:
            inputs.missing = 1
        elif type(queue[0].value) is Marker:
            worker.special = True
        if taken.full:
            freed(taken)
        worker.firings += 1
        core.speaker = worker
        worker.taken = ()
        worker.busy = "firing"
        worker.stamp = token.stamp
        try:
            result = process(token.value)
        except Exception as error:
            errors.fail(worker, f"firing {worker.firings}", error, answer=True)
            return
        if (
            (result is None and given)
            or (result is not None and (type(result) in OF_ITS_OWN_KIND or not given))
            or worker.written is not None
            or worker.right
            or worker.calls
            or worker.events_due
            or worker.on_idle is not None
            or (carries and worker.active)
        ):
            firing.complete_firing(worker, result)
            return
        worker.busy = ""
        worker.stamp = None
        if given:
            leave(result, token.stamp)
            worker.held = True
        if not inputs.missing:
            consider(worker)

    return step


def generator_step(worker: Worker, given: tuple[SyncEdge, ...]) -> Step:
    """A generator with one output; its first firing, in which it begins, goes the general way."""
    core = worker.core
    general = firing.step
    now = core.now
    carries = any(edge.active for edge in given)
    leave = _leaving(worker, given)

    def step(worker: Worker) -> None:
        generator = worker.generator
        if generator is None or not worker.placed or worker.special or worker.busy or (worker.active and carries):
            general(worker)
            return
        worker.queued = worker.placed = False
        worker.firings += 1
        core.speaker = worker
        stamp = worker.stamp = now()
        worker.busy = "firing"
        try:
            value = next(generator)
        except (StopIteration, EndOfStream):
            ending.source_ended(worker)
            return
        except Exception as error:
            errors.fail(worker, f"firing {worker.firings}", error, answer=True)
            return
        if (
            type(value) in OF_ITS_OWN_KIND
            or worker.written is not None
            or worker.active
            or worker.right
            or worker.calls
        ):
            firing.complete_firing(worker, value)
            return
        worker.busy = ""
        worker.stamp = None
        leave(value, stamp)

    return step


def _leaving(worker: Worker, given: tuple[SyncEdge, ...]) -> Callable[[Any, float], None]:
    """Puts one value on every edge of an output that is free, without activity."""
    outputs = worker.outputs
    count = len(given)
    if count == 1:
        (only,) = given
        target: Worker = only.target
        waits = target.inputs

        def leave_alone(value: Any, stamp: float) -> None:
            only.sent = number = only.sent + 1
            only.token = Token(value, 0, stamp, number)
            only.held = True
            outputs.missing = 1
            waits.missing = missing = waits.missing - 1
            if not missing:
                consider(target)

        return leave_alone

    def leave(value: Any, stamp: float) -> None:
        outputs.missing = count
        for edge in given:
            edge.sent = number = edge.sent + 1
            edge.token = Token(value, 0, stamp, number)
            edge.held = True
            target = edge.target
            barrier = target.inputs
            barrier.missing -= 1
            if not barrier.missing:
                consider(target)

    return leave
