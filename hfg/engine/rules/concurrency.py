"""Several firings of one node under way at once: how they go on, leave and end (rule F14).

A firing takes its tokens as any other (`firing.fire`) and is then a *flight*. When its code is over, what it sends
waits until the outputs are free and, where they are ordered, all that began earlier have left; it counts among those
under way until then, which is the back-pressure of such a node. Stands on `errors`, `ending` and `retries`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.token import Marker, Token
from hfg.engine.model import Flight, Flights
from hfg.engine.model.current import current_flight
from hfg.engine.model.worker import DISABLED, REMOVED, Worker
from hfg.engine.rules import errors, firing
from hfg.engine.rules.agenda import consider, idle_again
from hfg.engine.rules.calls import refuse_coroutine
from hfg.engine.rules.ending import drain_left, drop_taken, ends_itself, gave_back
from hfg.engine.rules.retries import try_again
from hfg.engine.rules.sending import flush_automatic, put_outputs, send_end, trigger
from hfg.errors import Failure, FiringTimeout, QueueLimit, UsageError
from hfg.trace import FiringEnded

__all__ = ["abandon", "begin", "land", "time_out", "triggering", "write"]

Emit = Callable[[Any, int | None, float | None], Any]


def _flights(worker: Worker) -> Flights:
    flights = worker.flights
    assert flights is not None
    return flights


def begin(
    worker: Worker, kind: str, edges: Sequence[Any], tokens: Sequence[Token[Any]], refused: Exception | None
) -> None:
    """A firing has taken its tokens: it goes on beside those that are under way.

    Args:
      worker: whose firing.
      kind: what becomes of it (F4).
      edges: from which it has taken.
      tokens: that it has taken.
      refused: why a parameter could not be set, so that it fails (P8); None: all could.
    """
    flights = _flights(worker)
    stamp = worker.stamp
    assert stamp is not None
    if kind == "end":  # behind all that are under way (F14)
        drop_taken(worker, edges, tokens)
        flights.end(worker.counts.firings, stamp)
        worker.crowd()
    else:
        flight = Flight(worker, worker.counts.firings, stamp)
        flights.begin(flight)
        worker.crowd()
        if kind == "process":
            _note_process(worker)
        if refused is not None:
            _failed(flight, refused)
        elif kind == "silent":
            worker.counts.add_silent()
            flight.be_over("silent")
            flights.over(flight)
        else:
            _begin_process(flight, edges, tokens)
    if worker.events_due is not None:
        flush_automatic(worker)
    worker.leave()
    idle_again(worker)
    land(worker)


def _note_process(worker: Worker) -> None:
    """What a firing whose function is to run means to the next one."""
    firing.note_start(worker)
    if not worker.inputs.missing:  # what the next firing asks for holds already: before the calls that come now (F9)
        consider(worker)


def _begin_process(flight: Flight, edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> None:
    """F4(3): the function is run."""
    worker = flight.worker
    if len(worker.out_names) > len(worker.type.outputs):
        flight.parameters = dict(worker.node._parameters)
    if worker.shape.remembers:
        flight.remember(firing.values_of(edges, tokens))
    flight.attempts.begin(tuple(firing.arguments_of(worker, edges, tokens)))
    _attempt(flight)


def _attempt(flight: Flight) -> None:
    """Run the function with what the firing has taken."""
    worker = flight.worker
    worker.core.code.execute_beside(flight, worker.process, flight.attempts.arguments, _when_done(flight))  # type: ignore[arg-type]


def _when_done(flight: Flight) -> Callable[[Any, BaseException | None], None]:
    """What follows when this attempt is over."""
    ticket = flight.ticket

    def done(result: Any, error: BaseException | None) -> None:
        if flight.ticket != ticket:
            return  # X2: it came too late, the attempt was given up
        if type(result) is CoroutineType and not flight.worker.group.threaded:
            flight.worker.core.code.drive_beside(flight, result, done)
            return
        flight.in_time()
        if error is None:
            _complete(flight, result)
        elif ends_itself(flight.worker, error):
            _found_end(flight)
        else:
            _failed(flight, error)

    return done


def _complete(flight: Flight, result: Any) -> None:
    """The function ran to its end: what it has written leaves when its turn comes."""
    worker = flight.worker
    try:
        if type(result) is CoroutineType:
            raise refuse_coroutine(worker, result)
        written = firing.merge(worker, result, flight.take_written(), flight.parameters)
    except Exception as error:
        _failed(flight, error)
        return
    flight.be_over("done", written)
    _over(flight)


def _found_end(flight: Flight) -> None:
    """F2: the node has ended, behind those of its firings that are under way; what this one wrote leaves then (F4)."""
    worker = flight.worker
    flights = _flights(worker)
    flights.forget(flight)
    if flights.ending is None:
        flights.end(flight.number, flight.stamp, flight.take_written())
    else:  # it has found that twice
        worker.counts.add_end_firing()
        _tell_end(flight, "ended")
    worker.crowd()
    _rest(worker)


def _failed(flight: Flight, error: BaseException) -> None:
    """X1, for this firing by itself: it is tried again, or the node's policy decides."""
    worker = flight.worker
    if isinstance(error, QueueLimit):
        worker.core.host.finish("failed", error)
        return

    def again() -> None:
        flight.attempts.again()
        _attempt(flight)

    flight.take_written()
    if try_again(worker, flight.attempts, flight.number, error, again):
        return
    worker.counts.add_failure()
    problem = errors.as_node_error(worker, f"firing {flight.number}", error)
    policy = errors.judge(worker, problem)
    if policy == "stop":
        return
    flight.fail(problem, errors.outcome_of(problem), answers=policy != "disable")
    restarts = errors.begin_over(worker, policy)
    _flights(worker).over(flight)
    if not flight.answers:
        _leave(flight)  # it sends nothing, so it need not wait for its turn
        _let_leave(worker)
    errors.follow(worker, policy, restarts=restarts)
    _rest(worker)


def time_out(flight: Flight) -> None:
    """X2: the attempt has taken longer than `max_duration_s`: it is given up, its late result ignored."""
    worker = flight.worker
    flight.in_time()
    worker.core.code.interrupt_beside(flight)
    words = f"it took longer than max_duration_s = {worker.options.max_duration_s:g} s and was given up"
    _failed(flight, FiringTimeout(worker.path, f"firing {flight.number}", words))


def _over(flight: Flight) -> None:
    """Its code has come to its end."""
    _flights(flight.worker).over(flight)
    _rest(flight.worker)


def _rest(worker: Worker) -> None:
    """Code of a firing is over: those leave whose turn it is, and who waits until none works has its turn."""
    if worker.core.sharing is not None:
        worker.core.sharing.sweep()
    land(worker)
    _flights(worker).let_others()
    if worker.on_idle is not None and not worker.busy:
        worker.let_others()
        worker.crowd()
        consider(worker)


def land(worker: Worker) -> None:
    """Let those that are over leave whose turn it is; the end comes last."""
    flights = _flights(worker)
    if flights.leaving:
        return  # what it sends is processed at once: it goes on below
    _let_leave(worker)
    if worker.core.over:
        return
    worker.crowd()
    consider(worker)
    if flights.ending is not None:
        _end(worker)
    elif worker.pending_end:
        _send_end(worker)


def _let_leave(worker: Worker) -> None:
    """Let those that are over leave, as far as the outputs are free and the order allows."""
    flights, core = _flights(worker), worker.core
    if flights.leaving:
        return
    flights.begin_leaving(True)
    try:
        while not core.over:
            to_nobody = bool(worker.blocked & (DISABLED | REMOVED))
            if worker.outputs.missing and not to_nobody:
                break
            flight = flights.next_to_leave(to_nobody=to_nobody)
            if flight is None:
                break
            _leave(flight)
    finally:
        flights.begin_leaving(False)


def _leave(flight: Flight) -> None:
    """Its outputs leave (F3), its events follow (A9), and it is over."""
    worker = flight.worker
    written = flight.take_written()
    if worker.blocked & (DISABLED | REMOVED):
        written = None
    elif flight.answers:
        before = worker.send_as(flight.stamp)
        put_outputs(worker, written)
        worker.send_as(before)
    _flights(worker).leave(flight)
    if flight.failure is not None:
        _tell(worker, "failed", Failure(flight.failure, flight.taken))
    elif flight.outcome in ("done", "ended"):
        _announce(flight, written)
    _tell_end(flight, flight.outcome)
    if flight.number != _flights(worker).end_number:
        return
    assert worker.ending is not None
    if worker.ending.given_up:
        worker.ending.take_deferred()  # nobody is left who would hear END (R5)
    else:
        worker.promise_end(flight.stamp)


def _announce(flight: Flight, written: list[Any] | None) -> None:
    """A9: what has left is told where somebody asks, then that the firing is `processed`; each with its stamp."""
    worker = flight.worker
    for name, position in worker.shape.announced:
        entry = None if position is None or written is None else written[position]
        if position is None and flight.outcome == "done":
            _tell(worker, name, None)
        elif entry is not None and type(entry[0]) is not Marker:
            _tell(worker, name, Token(entry[0], 0, flight.stamp if entry[2] is None else entry[2]))


def _tell(worker: Worker, name: str, value: Any) -> None:
    """A9: an automatic event of this firing; those of a call that is under way follow that."""
    event = worker.events.get(name)
    if event is not None:
        trigger(event, value, stamp=None if type(value) is Token else worker.core.now(), extend_right=False)


def _tell_end(flight: Flight, outcome: Any) -> None:
    worker = flight.worker
    if worker.core.trace is None:
        return
    if outcome == "done" and worker.blocked & DISABLED:
        outcome = "abandoned"  # its outputs went nowhere (F10)
    worker.core.trace(FiringEnded(worker.core.now(), worker.path, flight.number, outcome))


def _end(worker: Worker) -> None:
    """F4: all others have left, so the node ends; a slot call may be under way meanwhile."""
    flights, core = _flights(worker), worker.core
    if flights:
        return
    flight = Flight(worker, flights.end_number, flights.take_ending())
    flight.be_given(flights.end_written)
    worker.counts.add_end_firing()
    worker.end()
    drain_left(worker.in_edges)
    hook = worker.node._hook("end")
    flights.begin(flight)
    if hook is None:
        _ended(flight, None, None)
    else:
        core.code.execute_beside(flight, hook, (), partial(_ended, flight))


def _ended(flight: Flight, result: Any, error: BaseException | None) -> None:
    """Its `end()` is over: what that has written leaves when the outputs are free, and END behind it."""
    worker = flight.worker
    flights = _flights(worker)
    written = flight.take_written()
    if error is None and result is not None:
        error = gave_back(result)
    if error is not None:
        written = None
        errors.fail(worker, "end()", error, answer=False)
    if written is not None and not any(entry is not None for entry in written):
        written = None
    flight.be_over("ended" if error is None else "failed", written)
    flights.over(flight)
    if written is None:
        flight.say_nothing()
        _leave(flight)
    _rest(worker)


def _send_end(worker: Worker) -> None:
    """F4: END leaves as soon as the outputs are free, a slot call under way or not."""
    if worker.outputs.missing and not worker.blocked & DISABLED:
        return
    before = worker.stamp
    send_end(worker)
    worker.send_as(before)


def abandon(worker: Worker) -> None:
    """R4: the node has another code now, or is gone: what firings of the old one have to send goes nowhere."""
    flights = _flights(worker)
    for flight in flights:
        if flight.outcome:
            flights.leave(flight)
            _tell_end(flight, "abandoned")
    worker.crowd()


# --- what the code of a firing does by itself -------------------------------------------------------------------------


def write(worker: Worker, position: int, value: Any, activity: int | None, stamp: float | None) -> None:
    """A node's code writes to an output: it leaves with the firing whose code that is (F3).

    Raises:
      UsageError: it is that of no firing that goes on (also of a slot handler, F9), or writes twice.
    """
    flight = current_flight.get()
    if flight is None or flight.worker is not worker:
        firing.write(worker, position, value, activity, stamp)  # in end(), or not at all
        return
    if flight.outcome:
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written behind the end of its firing: outputs '
            "belong to process() and end(); trigger an event instead"
        )
    entry = firing.entry_of(worker, position, flight.written, value, activity, stamp)
    if entry is not None:
        flight.write(position, entry)


def triggering(worker: Worker, emit: Emit) -> Emit:
    """What triggers an event of a worker whose firings go on beside each other, or may be tried again.

    The firing is noted, for it cannot be repeated (X1), and its stamp goes along (T5).
    """

    def noted(value: Any, activity: int | None, stamp: float | None) -> Any:
        flight = current_flight.get()
        if flight is not None and flight.worker is worker:
            flight.attempts.has_triggered()
            if stamp is None and type(value) is not Token and not flight.outcome:
                stamp = flight.stamp
        elif worker.attempts is not None:
            worker.attempts.has_triggered()
        return emit(value, activity, stamp)

    return noted
