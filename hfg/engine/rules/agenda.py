"""Which nodes may move: places in the agenda, run queues, and blocks that keep a node from firing (F1, F8, F9, F11).

Plain functions over the run's state; they queue nodes and never run a node's code. Depends on `running_node` and
`edges`.
"""

from __future__ import annotations

from hfg.engine.model import Core
from hfg.engine.model.records import SAME_MOMENT_S
from hfg.engine.model.running_node import DISABLED, FULL, NO_CALLS, UNREADY, RunningNode
from hfg.ports.edges import Edge, EventEdge

__all__ = [
    "add_call",
    "arrived",
    "consider",
    "freed",
    "idle_again",
    "make_fireable",
    "must_wait",
    "note_full",
    "queue_next_in_wave",
    "unblock",
]


def make_fireable(worker: RunningNode) -> bool:
    """Enable the next firing if all that it needs holds now (F1, F9); the node must still be queued."""
    if worker.blocked or worker.fireable or worker.inputs.missing or worker.outputs.missing:
        return False
    if worker.paced and must_wait(worker):
        return False
    worker.make_fireable()
    return True


def consider(worker: RunningNode) -> None:
    """Something that F1 asks for has changed: if all of it holds now, the next firing waits for its turn."""
    if make_fireable(worker):
        worker.enqueue()


def queue_next_in_wave(core: Core, since: int) -> None:
    """R2: what one sending has enabled over sequential edges of its group goes before all else of the group.

    Depth first, in the order of the outputs and edges: so the last of them goes in first.

    Args:
      core: the run.
      since: how many next_in_wave there were before the sending.
    """
    next_in_wave = core.next_in_wave
    core.ran_next += len(next_in_wave) - since
    while len(next_in_wave) > since:
        worker = next_in_wave.pop()
        worker.push_next(worker)


def must_wait(worker: RunningNode) -> bool:
    """F11 and A11: nothing starts before the rate allows it; the timer is set only when something would."""
    when = worker.rate.next_start
    if worker.is_source:
        for gate in worker.gates_over:
            if gate.idle_rate_hz is not None and not gate.state.active:
                when = max(when, worker.rate.gate_next + 1.0 / gate.idle_rate_hz)
    core = worker.core
    if when <= core.now() + SAME_MOMENT_S:
        return False

    def over() -> None:
        worker.rate_over()
        _go_on(worker)

    worker.wait_for_rate(when, over)
    return True


def unblock(worker: RunningNode, reason: int) -> None:
    """Take one reason away and go on if it was the last."""
    if worker.allow(reason):
        _go_on(worker)


def _go_on(worker: RunningNode) -> None:
    consider(worker)
    if worker.calls and worker.blocked < NO_CALLS:
        worker.enqueue()


def arrived(edge: Edge) -> None:
    """One more input of its target holds a token."""
    target: RunningNode = edge.target
    if edge.ended:  # an optional one that was absent since its END takes part again (F4)
        target.core.rules.rewire(target)
        return
    barrier = target.inputs
    if barrier.arrive():
        if barrier.waiters is not None:
            barrier.notify()
        if make_fireable(target):
            if edge.depth_first:
                target.run_next()
            else:
                target.enqueue()


def add_call(target: RunningNode, edge: Edge) -> None:
    """The newest token on the edge waits for a slot call (F9)."""
    target.expect_call(edge)
    if target.blocked >= NO_CALLS:
        return
    if edge.depth_first:
        target.run_next()
    else:
        target.enqueue()


def note_full(edge: EventEdge) -> None:
    """F8: a live `wait` edge that holds its capacity or more keeps its source from starting anything new."""
    if edge.fill():
        edge.source.room.fill()
        edge.source.block(FULL)


def freed(edge: EventEdge) -> None:
    """A token was taken from the queue: its source may go on if no other queue of it is full (F8)."""
    if edge.full and edge.free() and edge.source.room.free():
        unblock(edge.source, FULL)


def idle_again(worker: RunningNode, *, asked: bool = False) -> None:
    """A firing, call or question is over: see what is next."""
    worker.rest()
    if (
        worker.ending is not None
        and worker.ending.pending
        and (not worker.outputs.missing or worker.blocked & DISABLED)
    ):
        worker.core.rules.send_end(worker)  # its outputs became free during a slot call
    if worker.idle_callbacks is not None:
        worker.run_idle_callbacks()
        if worker.busy:
            return
    if not asked and worker.blocked & UNREADY:
        worker.allow(UNREADY)
    calls = bool(worker.calls) and worker.blocked < NO_CALLS
    if worker.is_next:
        left = worker.fireable or calls  # of the wave that has enabled it: that comes before all else (R2)
        if left and worker.queued:  # a reset came before the call for which it stands there: that goes first (F9)
            return
        worker.clear_next()
        if left:
            worker.enqueue_next()
            return
    if worker.fireable:
        worker.enqueue()
    else:
        consider(worker)
    if calls:
        worker.enqueue()
