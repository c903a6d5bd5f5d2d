"""The short ways of the commonest shapes while somebody looks: they tell the trace and taps, and measure.

What they do is what the steps of the same names in `steps` do, and what they tell is what the general way tells, event
by event (property: the trace with `fast` on and off). Apart from those, so that nobody pays who is not looked at.
Stands on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from hfg.engine.model.core import OF_ITS_OWN_KIND
from hfg.engine.model.worker import Worker
from hfg.engine.rules import ending, errors, firing
from hfg.engine.rules.agenda import consider
from hfg.engine.rules.releasing import outputs_done, release
from hfg.errors import EndOfStream
from hfg.ports.edges import SyncEdge
from hfg.token import Token
from hfg.trace import FiringEnded, FiringStarted, TokenProcessed, TokenSent, TokenTaken

__all__ = ["general_step", "generator_step", "through_step"]

Step = Callable[[Worker], None]


def through_step(worker: Worker, taken: SyncEdge, given: SyncEdge | None, quick: Step | None) -> Step:
    """A plain function with one input and at most one output edge.

    When enough is measured it gives way to `quick`, the step that does not look; None: the trace is to be told anyway.
    """
    core = worker.core
    meter = worker.meter
    process: Any = worker.process if meter is None else meter.code
    inputs = worker.inputs
    outputs = worker.outputs
    producer: Worker = taken.source
    producer_outputs = producer.outputs
    sequential = taken.sequential
    silent_code = worker.silent_code
    general = firing.step
    of_its_own_kind = OF_ITS_OWN_KIND
    target: Any = given.target if given is not None else None
    target_inputs: Any = target.inputs if given is not None else None
    target_outputs: Any = target.outputs if given is not None else None
    carries = given is not None and given.active
    only = (taken,)
    trace = core.trace
    path = worker.path
    taken_label = taken.label
    given_label = given.label if given is not None else ""
    tap = given.tap if given is not None else None
    now = core.now
    host: Any = core.host
    epoch: Any = host.epoch

    def step(worker: Worker) -> None:
        if worker.special or not worker.placed or inputs.missing or worker.busy:
            general(worker)
            return
        token: Any = taken.token
        if token.activity or (carries and worker.active):
            general(worker)
            return
        worker.queued = worker.placed = False
        taken.token = None
        inputs.missing = 1
        worker.firings = number = worker.firings + 1
        core.current = worker
        at = 0.0
        if trace is not None:
            at = now() if epoch is None else monotonic() + epoch
            trace(FiringStarted(at, path, number, "process"))
            trace(TokenTaken(at, taken_label, token))
        if not silent_code:
            worker.busy = "firing"
            worker.stamp = token.stamp
            worker.taken = only
        began = monotonic()
        try:
            result = process(token.value)
        except Exception as error:
            if meter is not None:
                meter.took(monotonic() - began)
            errors.fail_taken(worker, token.stamp, only, error)
            return
        ended = monotonic()
        if trace is not None:
            at = now() if epoch is None else ended + epoch
        if meter is not None:
            meter.took(ended - began, (now() if epoch is None else ended + epoch) - token.stamp)
            if quick is not None and meter.left <= 0 and worker.step is step:
                worker.step = quick
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
            if trace is not None:
                trace(FiringEnded(at, path, number, "done"))
                trace(TokenProcessed(at, taken_label))
            taken.held = False
            producer_outputs.missing = missing = producer_outputs.missing - 1
            if not missing:
                outputs_done(producer, trace, at)
            return
        if type(result) in of_its_own_kind:
            worker.busy = "firing"
            worker.stamp = token.stamp
            worker.taken = only
            firing.complete_firing(worker, result)
            return
        given.sent = sent = given.sent + 1
        given.token = token = Token(result, 0, token.stamp, sent)
        given.held = True
        outputs.missing = 1
        if trace is not None:
            trace(TokenSent(at, given_label, token))
        if tap is not None:
            tap(token)
        target_inputs.missing = missing = target_inputs.missing - 1
        if not missing:
            if target.blocked or target_outputs.missing or target.placed or target.calls is not None or target.paced:
                consider(target)
            else:
                target.placed = True
                if not target.queued and not target.busy:
                    target.queued = True
                    target.push(target)
        if trace is not None:
            trace(FiringEnded(at, path, number, "done"))
        if sequential:
            worker.held = True
            worker.taken = only
        else:
            release(only)

    if quick is not None and meter is not None:
        meter.steps = (quick, step)
    return step


def general_step(worker: Worker, quick: Step) -> Step:
    """The general way, in which the wrapped code is measured, until enough is; then `quick`."""
    meter = worker.meter
    general = firing.step

    def step(worker: Worker) -> None:
        if meter.left <= 0 and worker.step is step:
            worker.step = quick
            quick(worker)
        else:
            general(worker)

    meter.steps = (quick, step)
    return step


def generator_step(worker: Worker, given: SyncEdge) -> Step:
    """A generator with one output edge, traced or tapped; what measures it wraps the generator itself."""
    core = worker.core
    outputs = worker.outputs
    target: Worker = given.target
    target_inputs = target.inputs
    general = firing.step
    of_its_own_kind = OF_ITS_OWN_KIND
    now = core.now
    carries = given.active
    trace = core.trace
    path = worker.path
    label = given.label
    tap = given.tap

    def step(worker: Worker) -> None:
        generator = worker.generator
        if generator is None or not worker.placed or worker.special or worker.busy or (worker.active and carries):
            general(worker)
            return
        worker.queued = worker.placed = False
        worker.firings = number = worker.firings + 1
        core.current = worker
        stamp = worker.stamp = now()
        worker.busy = "firing"
        if trace is not None:
            trace(FiringStarted(stamp, path, number, "process"))
        try:
            value = next(generator)
        except (StopIteration, EndOfStream):
            ending.source_ended(worker)
            return
        except Exception as error:
            errors.fail(worker, f"firing {number}", error, answer=True)
            return
        if (
            type(value) in of_its_own_kind
            or worker.written is not None
            or worker.active
            or worker.right
            or worker.calls
        ):
            firing.complete_firing(worker, value)
            return
        worker.busy = ""
        worker.stamp = None
        given.sent = sent = given.sent + 1
        given.token = token = Token(value, 0, stamp, sent)
        given.held = True
        outputs.missing = 1
        at = now()
        if trace is not None:
            trace(TokenSent(at, label, token))
        if tap is not None:
            tap(token)
        target_inputs.missing = missing = target_inputs.missing - 1
        if not missing:
            consider(target)
        if trace is not None:
            trace(FiringEnded(at, path, number, "done"))

    return step
