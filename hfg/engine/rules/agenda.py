"""Who may move: places in the agenda, run queues, and what keeps a node from firing (rules F1, F8, F9, F11).

Plain functions over the run's state; they queue workers and never run a node's code. Stands on `worker`, `core`.
"""

from __future__ import annotations

from collections import deque

from hfg.engine.model.core import Core
from hfg.engine.model.worker import CALLS_BLOCKED, DISABLED, FULL, RATE, UNREADY, Worker
from hfg.ports.edges import Edge, EventEdge

SAME_MOMENT_S = 1e-9  # times that differ by less are one: sums of floats do

__all__ = [
    "add_call",
    "arrived",
    "block",
    "cancel_limit",
    "consider",
    "freed",
    "idle_again",
    "let_follow",
    "must_wait",
    "note_full",
    "note_start",
    "place",
    "queue",
    "remove_call",
    "unblock",
    "unplace",
]


def queue(worker: Worker) -> None:
    """Put it into its group's run queue, once."""
    if not worker.queued and not worker.busy:
        worker.queued = True
        worker.push(worker)


def place(worker: Worker) -> bool:
    """Give the next firing its place if all that F1 asks for holds now (F9, D1); it is still to be queued."""
    if worker.inputs.missing or worker.outputs.missing or worker.blocked or worker.placed:
        return False
    if worker.paced and must_wait(worker):
        return False
    worker.placed = True
    worker.ahead = len(worker.calls) if worker.calls else 0
    return True


def consider(worker: Worker) -> None:
    """Something that F1 asks for has changed: if all of it holds now, the next firing waits for its turn."""
    if place(worker):
        queue(worker)


def _follow(worker: Worker) -> None:
    """It goes next, when the sending is over; behind an earlier call if it stands in the queue for one (F9).

    What is busy is not enabled by what it gets now, but by the end of what it does (F1).
    """
    if worker.queued:
        worker.follows = True
    elif not worker.busy:
        worker.queued = True
        worker.core.followers.append(worker)


def let_follow(core: Core, since: int) -> None:
    """R2: what one sending has enabled over sequential edges of its group goes before all else of the group.

    Depth first, in the order of the outputs and edges: so the last of them goes in first.

    Args:
      core: the run.
      since: how many followers there were before the sending.
    """
    followers = core.followers
    core.followed += len(followers) - since
    while len(followers) > since:
        worker = followers.pop()
        worker.push_next(worker)


def note_start(worker: Worker, rate_hz: float) -> None:
    """F11: a firing starts now; the next one may in the next period of the grid that the first one began.

    Each place of the grid is found from its beginning, so that errors of floats never add up.
    """
    now = worker.core.now()
    if worker.grid_start is None:
        worker.grid_start = now
    period = int((now - worker.grid_start + SAME_MOMENT_S) * rate_hz)
    worker.next_period = max(worker.next_period, period) + 1  # (a clock as large as the date has fewer digits)
    worker.next_start = worker.grid_start + worker.next_period / rate_hz


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
    worker.disturb()
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
        if not edge.follows:
            consider(target)
        elif place(target):
            _follow(target)


def add_call(target: Worker, edge: Edge) -> None:
    """The newest token on the edge waits for a slot call (F9)."""
    if target.calls is None:
        target.calls = deque()
    target.calls.append(edge)
    if target.blocked & CALLS_BLOCKED:
        return
    if edge.follows:
        _follow(target)
    else:
        queue(target)


def remove_call(target: Worker, edge: Edge) -> None:
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
        source.core.full_edges += 1
        block(source, FULL)


def freed(edge: EventEdge) -> None:
    """A token was taken from the queue: its source may go on if no other queue of it is full (F8)."""
    if edge.full and len(edge.queue) < edge.capacity:
        edge.full = False
        source: Worker = edge.source
        source.full_edges -= 1
        source.core.full_edges -= 1
        if not source.full_edges:
            if source.room_waiters is not None:
                waiters, source.room_waiters = source.room_waiters, None
                for waiter in waiters:
                    waiter()
            unblock(source, FULL)


def idle_again(worker: Worker, *, asked: bool = False) -> None:
    """A firing, call or question is over: see what is next."""
    worker.busy = ""
    if worker.pending_end and (not worker.outputs.missing or worker.blocked & DISABLED):
        worker.core.upstairs.send_end(worker)  # its outputs became free during a slot call
    if worker.on_idle is not None:
        _let_others(worker)
        if worker.busy:
            return
    if not asked:
        worker.blocked &= ~UNREADY
    if worker.follows:
        worker.follows = False
        if worker.placed or (worker.calls and not worker.blocked & CALLS_BLOCKED):
            _go_next(worker)
            return
    if worker.placed:
        queue(worker)
    else:
        consider(worker)
    if worker.calls and not worker.blocked & CALLS_BLOCKED:
        queue(worker)


def _go_next(worker: Worker) -> None:
    """What is left of the wave that has enabled it comes before all else of its group (R2)."""
    if not worker.queued and not worker.busy:
        worker.queued = True
        worker.follows = bool(worker.calls and worker.placed)
        worker.push_next(worker)
        worker.core.followed += 1


def _let_others(worker: Worker) -> None:
    """What waits until the node is not busy has its turn, before the next firing or call."""
    while worker.on_idle and not worker.busy:
        worker.on_idle.pop(0)()
    if not worker.on_idle:
        worker.on_idle = None
        worker.core.upstairs.choose_step(worker)


def cancel_limit(worker: Worker) -> None:
    """What has a time limit is over in time (X2)."""
    if worker.limit_timer is not None:
        worker.limit_timer.cancel()
        worker.limit_timer = None
