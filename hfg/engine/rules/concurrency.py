"""Several firings of one node in progress at once: how they go on, leave and end (rule F14).

A firing takes its tokens as any other (`firing.fire`) and is then a *concurrent firing*. When its code is over, what it
sends waits until the outputs are free and, where they are ordered, all that began earlier have left. Until then it
counts among those in progress, which is the back-pressure of such a node. Depends on `errors`, `ending` and `retries`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.token import Marker, Token
from hfg.engine.model import ConcurrentFiring, ConcurrentFirings
from hfg.engine.model.current import current_firing
from hfg.engine.model.running_node import DISABLED, REMOVED, RunningNode
from hfg.engine.rules import errors, outputs
from hfg.engine.rules import firing as firings
from hfg.engine.rules.agenda import consider, idle_again
from hfg.engine.rules.calls import refuse_coroutine
from hfg.engine.rules.ending import drain_left, drop_taken, ends_itself, gave_back
from hfg.engine.rules.retries import try_again
from hfg.engine.rules.sending import put_outputs, send_automatic, send_end, trigger
from hfg.errors import Failure, FiringTimeout, QueueLimit, UsageError
from hfg.ports.edges import AnyEdge
from hfg.trace import FiringEnded

__all__ = ["abandon", "begin", "complete_firings", "time_out", "triggering", "write"]

Emit = Callable[[Any, int | None, float | None], Any]


def _flights(worker: RunningNode) -> ConcurrentFirings:
    concurrent = worker.concurrent
    assert concurrent is not None
    return concurrent


def begin(
    worker: RunningNode, kind: str, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]], refused: Exception | None
) -> None:
    """A firing has taken its tokens: it continues alongside those in progress.

    Args:
      worker: whose firing.
      kind: what becomes of it (F4).
      edges: from which it has taken.
      tokens: that it has taken.
      refused: why a parameter could not be set, so that it fails (P8); None: all could.
    """
    concurrent = _flights(worker)
    stamp = worker.stamp
    assert stamp is not None
    if kind == "end":  # after all that are in progress (F14)
        drop_taken(worker, edges, tokens)
        concurrent.end(ConcurrentFiring(worker, worker.counts.firings, stamp))
        worker.limit_concurrency()
    else:
        firing = ConcurrentFiring(worker, worker.counts.firings, stamp)
        concurrent.begin(firing)
        worker.limit_concurrency()
        if kind == "process":
            _note_process(worker)
        if refused is not None:
            _failed(firing, refused)
        elif kind == "silent":
            worker.counts.add_silent()
            firing.complete("silent")
            concurrent.over(firing)
        else:
            _begin_process(firing, edges, tokens)
    if worker.events_due is not None:
        send_automatic(worker)
    worker.leave()
    idle_again(worker)
    complete_firings(worker)


def _note_process(worker: RunningNode) -> None:
    """Prepare the next firing, after one whose function is about to run."""
    firings.note_start(worker)
    if not worker.inputs.missing:  # what the next firing asks for holds already: before the calls that come now (F9)
        consider(worker)


def _begin_process(firing: ConcurrentFiring, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> None:
    """F4(3): the function is run."""
    worker = firing.worker
    firing.begin(
        tuple(firings.arguments_of(worker, edges, tokens)),
        parameters=dict(worker.node._parameters) if len(worker.out_names) > len(worker.type.outputs) else None,
        taken=firings.values_of(edges, tokens) if worker.shape.remembers else None,
    )
    _attempt(firing)


def _attempt(firing: ConcurrentFiring) -> None:
    """Run the function with what the firing has taken."""
    worker = firing.worker
    worker.core.code.execute_concurrent(firing, worker.process, firing.attempts.arguments, _when_done(firing))  # type: ignore[arg-type]


def _when_done(firing: ConcurrentFiring) -> Callable[[Any, BaseException | None], None]:
    """What follows when this attempt is over."""
    ticket = firing.ticket

    def done(result: Any, error: BaseException | None) -> None:
        if firing.ticket != ticket:
            return  # X2: it came too late, the attempt was given up
        if type(result) is CoroutineType and not firing.worker.group.threaded:
            firing.worker.core.code.drive(firing.worker, result, done, firing)
            return
        firing.end_attempt()
        if error is None:
            _complete(firing, result)
        elif ends_itself(firing.worker, error):
            _found_end(firing)
        else:
            _failed(firing, error)

    return done


def _complete(firing: ConcurrentFiring, result: Any) -> None:
    """The function ran to its end: what it has written leaves when its turn comes."""
    worker = firing.worker
    try:
        if type(result) is CoroutineType:
            raise refuse_coroutine(worker, result)
        written = outputs.merge(worker, result, firing.take_written(), firing.parameters)
    except Exception as error:
        _failed(firing, error)
        return
    firing.complete("done", written)
    _over(firing)


def _found_end(firing: ConcurrentFiring) -> None:
    """F2: the node has ended, behind those of its firings that are under way; what this one wrote leaves then (F4)."""
    worker = firing.worker
    concurrent = _flights(worker)
    concurrent.leave(firing)
    if concurrent.ending is None:
        concurrent.end(ConcurrentFiring(worker, firing.number, firing.stamp, firing.take_written()))
    else:  # it has found that twice
        worker.counts.add_end_firing()
        _tell_end(firing, "ended")
    worker.limit_concurrency()
    _rest(worker)


def _failed(firing: ConcurrentFiring, error: BaseException) -> None:
    """X1, for this firing by itself: it is tried again, or the node's policy decides."""
    worker = firing.worker
    if isinstance(error, QueueLimit):
        worker.core.runtime.finish("failed", error)
        return

    def again() -> None:
        firing.attempts.again()
        _attempt(firing)

    firing.take_written()
    if try_again(worker, firing.attempts, firing.number, error, again):
        return
    worker.counts.add_failure()
    problem = errors.as_node_error(worker, f"firing {firing.number}", error)
    policy = errors.judge(worker, problem)
    if policy == "stop":
        return
    firing.complete(errors.outcome_of(problem), failure=problem, answers=policy != "disable")
    restarts = errors.begin_over(worker, policy)
    _flights(worker).over(firing)
    if not firing.answers:
        _leave(firing)  # it sends nothing, so it need not wait for its turn
        _let_leave(worker)
    errors.follow(worker, policy, restarts=restarts)
    _rest(worker)


def time_out(firing: ConcurrentFiring) -> None:
    """X2: the attempt has taken longer than `max_duration_s`: it is given up, its late result ignored."""
    worker = firing.worker
    firing.end_attempt()
    worker.core.code.interrupt(worker, firing=firing)
    words = f"it took longer than max_duration_s = {worker.options.max_duration_s:g} s and was given up"
    _failed(firing, FiringTimeout(worker.path, f"firing {firing.number}", words))


def _over(firing: ConcurrentFiring) -> None:
    """Its code has come to its end."""
    _flights(firing.worker).over(firing)
    _rest(firing.worker)


def _rest(worker: RunningNode) -> None:
    """Code of a firing is over: those leave whose turn it is, and who waits until none works has its turn."""
    if worker.core.sharing is not None:
        worker.core.sharing.sweep()
    complete_firings(worker)
    _flights(worker).run_idle_callbacks()
    if worker.idle_callbacks is not None and not worker.busy:
        worker.run_idle_callbacks()
        worker.limit_concurrency()
        consider(worker)


def complete_firings(worker: RunningNode) -> None:
    """Let those that are over leave whose turn it is; the end comes last."""
    concurrent = _flights(worker)
    if concurrent.leaving:
        return  # its tokens are processed immediately: it continues below
    _let_leave(worker)
    if worker.core.over:
        return
    worker.limit_concurrency()
    consider(worker)
    if concurrent.ending is not None:
        _end(worker)
    elif worker.pending_end:
        _send_end(worker)


def _let_leave(worker: RunningNode) -> None:
    """Let those that are over leave, as far as the outputs are free and the order allows."""
    concurrent, core = _flights(worker), worker.core
    if concurrent.leaving:
        return
    concurrent.begin_leaving(True)
    try:
        while not core.over:
            to_nobody = bool(worker.blocked & (DISABLED | REMOVED))
            if worker.outputs.missing and not to_nobody:
                break
            firing = concurrent.next_to_leave(to_nobody=to_nobody)
            if firing is None:
                break
            _leave(firing)
    finally:
        concurrent.begin_leaving(False)


def _leave(firing: ConcurrentFiring) -> None:
    """Its outputs leave (F3), its events follow (A9), and it is over."""
    worker = firing.worker
    written = firing.take_written()
    if worker.blocked & (DISABLED | REMOVED):
        written = None
    elif firing.answers:
        before = worker.send_as(firing.stamp)
        put_outputs(worker, written)
        worker.send_as(before)
    _flights(worker).leave(firing)
    if firing.failure is not None:
        _tell(worker, "failed", Failure(firing.failure, firing.taken))
    elif firing.outcome in ("done", "ended"):
        _announce(firing, written)
    _tell_end(firing, firing.outcome)
    if firing is not _flights(worker).last:
        return
    assert worker.ending is not None
    if worker.ending.is_dead_source:
        worker.ending.take_deferred()  # no consumer of END is left (R5)
    else:
        worker.promise_end(firing.stamp)


def _announce(firing: ConcurrentFiring, written: list[Any] | None) -> None:
    """A9: what has left is told where somebody asks, then that the firing is `processed`; each with its stamp."""
    worker = firing.worker
    for name, position in worker.shape.announced:
        entry = None if position is None or written is None else written[position]
        if position is None and firing.outcome == "done":
            _tell(worker, name, None)
        elif entry is not None and type(entry[0]) is not Marker:
            _tell(worker, name, Token(entry[0], 0, firing.stamp if entry[2] is None else entry[2]))


def _tell(worker: RunningNode, name: str, value: Any) -> None:
    """A9: an automatic event of this firing; those of a call that is in progress follow that."""
    event = worker.events.get(name)
    if event is not None:
        trigger(event, value, stamp=None if type(value) is Token else worker.core.now(), extend_right=False)


def _tell_end(firing: ConcurrentFiring, outcome: Any) -> None:
    worker = firing.worker
    if worker.core.trace is None:
        return
    if outcome == "done" and worker.blocked & DISABLED:
        outcome = "abandoned"  # its outputs went nowhere (F10)
    worker.core.trace(FiringEnded(worker.core.now(), worker.path, firing.number, outcome))


def _end(worker: RunningNode) -> None:
    """F4: all others have left, so the node ends; a slot call may be in progress meanwhile."""
    concurrent, core = _flights(worker), worker.core
    if concurrent:
        return
    firing = concurrent.take_ending()
    worker.counts.add_end_firing()
    worker.end()
    drain_left(worker.in_edges)
    hook = worker.node._hook("end")
    concurrent.begin(firing)
    if hook is None:
        _ended(firing, None, None)
    else:
        core.code.execute_concurrent(firing, hook, (), partial(_ended, firing))


def _ended(firing: ConcurrentFiring, result: Any, error: BaseException | None) -> None:
    """Its `end()` is over: what that has written leaves when the outputs are free, and END behind it."""
    worker = firing.worker
    concurrent = _flights(worker)
    written = firing.take_written()
    if error is None and result is not None:
        error = gave_back(result)
    if error is not None:
        written = None
        errors.fail(worker, "end()", error, answer=False)
    if written is not None and not any(entry is not None for entry in written):
        written = None
    firing.complete("ended" if error is None else "failed", written, answers=written is not None)
    concurrent.over(firing)
    if written is None:
        _leave(firing)
    _rest(worker)


def _send_end(worker: RunningNode) -> None:
    """F4: END leaves as soon as the outputs are free, a slot call in progress or not."""
    if worker.outputs.missing and not worker.blocked & DISABLED:
        return
    before = worker.stamp
    send_end(worker)
    worker.send_as(before)


def abandon(worker: RunningNode) -> None:
    """R4: the node has another code now, or is gone: what firings of the old one have to send goes nowhere."""
    concurrent = _flights(worker)
    for firing in concurrent:
        if firing.outcome:
            concurrent.leave(firing)
            _tell_end(firing, "abandoned")
    worker.limit_concurrency()


# --- what the code of a firing does by itself -------------------------------------------------------------------------


def write(worker: RunningNode, position: int, value: Any, activity: int | None, stamp: float | None) -> None:
    """A node's code writes to an output: it leaves with the firing whose code that is (F3).

    Raises:
      UsageError: it is that of no firing that goes on (also of a slot handler, F9), or writes twice.
    """
    firing = current_firing.get()
    if firing is None or firing.worker is not worker:
        outputs.write(worker, position, value, activity, stamp)  # in end(), or not at all
        return
    if firing.outcome:
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written behind the end of its firing: outputs '
            "belong to process() and end(); trigger an event instead"
        )
    entry = outputs.entry_of(worker, position, firing.written, value, activity, stamp)
    if entry is not None:
        firing.write(position, entry)


def triggering(worker: RunningNode, emit: Emit) -> Emit:
    """What triggers an event of a worker whose firings go on beside each other, or may be tried again.

    The firing is noted, for it cannot be repeated (X1), and its stamp goes along (T5).
    """

    def noted(value: Any, activity: int | None, stamp: float | None) -> Any:
        firing = current_firing.get()
        if firing is not None and firing.worker is worker:
            firing.attempts.mark_triggered()
            if stamp is None and type(value) is not Token and not firing.outcome:
                stamp = firing.stamp
        elif worker.attempts is not None:
            worker.attempts.mark_triggered()
        return emit(value, activity, stamp)

    return noted
