"""Beginning, ending, disabling and enabling single nodes (rules F10, A9 reset, X1 restart).

Each setup is followed by a teardown before the next one, whatever happens to a node meanwhile. Depends on `sending` and
`wiring`; hooks are run by the host, one after another.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from hfg.engine.model.contracts import Timer
from hfg.engine.model.running_node import BACKOFF, BETWEEN_FIRINGS, DISABLED, ENDED, REMOVED, TORN_DOWN, RunningNode
from hfg.engine.rules import doing, wiring
from hfg.engine.rules.agenda import consider, unblock
from hfg.engine.rules.modifiers import derive_scopes, discard
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import deferring_events, send_end
from hfg.engine.rules.sources import find_dead_sources
from hfg.errors import NodeError
from hfg.ports.edges import AnyEdge, BufferEdge, Edge, EventEdge
from hfg.trace import FiringEnded, NodeEnabled

__all__ = [
    "Then",
    "disable",
    "disable_around",
    "discard_initial",
    "enable",
    "enable_around",
    "end_tasks",
    "nothing",
    "reset",
    "restart",
    "set_up",
    "take_part",
    "tear_down",
    "when_idle",
]

Then = Callable[[NodeError | None], None]


def nothing() -> None:
    """A callback that does nothing."""


def when_idle(
    worker: RunningNode, action: Callable[[RunningNode, Callable[[], None]], None], then: Callable[[], None]
) -> None:
    """Do it when the node's firing or call in progress is over, and let none begin meanwhile (F9, F10)."""

    def begin() -> None:
        worker.be_busy("setup")
        action(worker, over)

    def over() -> None:
        worker.core.rules.idle_again(worker)
        then()

    if not worker.busy and not worker.is_on_fast_path() and not worker.has_concurrent_code():
        begin()
        return
    worker.when_idle(begin)


def _run_hook(worker: RunningNode, name: str, then: Then) -> None:
    hook = worker.node._hook(name) if worker.node is not None else None
    if hook is None:
        then(None)
        return

    def done(_result: object, error: BaseException | None) -> None:
        if error is None:
            then(None)
            return
        problem = NodeError(worker.path, f"{name}()", error)
        problem.__cause__ = error
        then(problem)

    worker.core.code.execute(worker, hook, (), done)


def _run_teardown(worker: RunningNode, then: Then) -> None:
    """Run `teardown()`; while the run continues, a limit ends it, as at the end of the run its caller does (X3)."""
    core = worker.core
    over = False
    timer: Timer | None = None

    def done(error: NodeError | None) -> None:
        nonlocal over
        over = True
        if timer is not None:
            timer.cancel()
        then(error)

    def give_up() -> None:
        core.code.interrupt(worker)
        done(NodeError(worker.path, "teardown()", f"it took longer than {limit_s:g} s and was given up"))

    _run_hook(worker, "teardown", lambda error: None if over else done(error))
    if not over and not core.over:
        limit_s = core.runtime.teardown_limit_s
        timer = core.after(limit_s, give_up)


def set_up(worker: RunningNode, then: Then) -> None:
    """Make new state for the node and run its `setup()`; `then(error)` follows."""
    if worker.node is None:
        then(None)
        return
    worker.lifecycle.open()
    try:
        worker.node._reset_states()
        if worker.core.recall is not None:
            worker.core.recall(worker)
    except Exception as error:  # a default that cannot be copied, a factory that fails
        problem = NodeError(worker.path, "its state", error)
        problem.__cause__ = error
        worker.lifecycle.opened()
        then(problem)
        return
    worker.core.rules.bind_ports(worker)

    def opened(error: NodeError | None) -> None:
        worker.lifecycle.opened()
        then(error)

    _run_hook(worker, "setup", opened)


def take_part(worker: RunningNode) -> None:
    """Let a node that was set up ahead take part: its signals since then leave now instead of being lost (R4, F10).

    A signal that an edge refuses (P5) is an error of `setup()`. If the node is disabled, its tasks end with its setup.
    """
    if worker.lifecycle.early is None:
        return
    end_tasks((worker,))
    kept = worker.lifecycle.take_part()
    worker.core.rules.bind_ports(worker)
    try:
        for send in kept:
            send()
    except Exception as error:
        problem = NodeError(worker.path, "setup()", error)
        problem.__cause__ = error
        worker.core.runtime.finish("failed", problem)


def tear_down(worker: RunningNode, then: Then) -> None:
    """Close the node's generator and run its `teardown()`, unless nothing was set up since the last time."""
    if worker.node is None or not worker.lifecycle.is_up:
        then(None)
        return
    if worker.concurrent is not None and worker.has_concurrent_code() and not worker.core.over:
        worker.concurrent.when_rested(
            lambda: tear_down(worker, then)
        )  # its firings continue during a call of `reset` (F14)
        return
    tasks = worker.tasks
    if tasks is not None and tasks.end(lambda: tear_down(worker, then)):
        return  # what its code has started comes to its end first
    of_task = None if tasks is None else tasks.take_problem()
    worker.lifecycle.close()
    generator = worker.execution.close_generator()

    def closed(_result: object, error: BaseException | None) -> None:
        problem = of_task
        if error is not None:
            problem = NodeError(worker.path, "closing its generator", error)
            problem.__cause__ = error
        _run_teardown(worker, then if problem is None else lambda later: then(later or problem))

    close = getattr(generator, "close", None) or getattr(generator, "aclose", None)
    if close is None:  # none, or an iterator that has nothing to close
        closed(None, None)
    else:
        worker.core.code.execute(worker, close, (), closed)


def disable(worker: RunningNode) -> None:
    """F10: discard what lies on its edges, and let producers neither send to it nor wait for it."""
    worker.enable_itself(False)
    if worker.blocked & DISABLED:
        return
    core = worker.core
    worker.block(DISABLED)
    if core.trace_changes is not None:
        core.trace_changes(NodeEnabled(core.now(), worker.path, False))
    end_tasks([worker])
    _settle_disabled([worker])
    derive_scopes(core)


def disable_around(workers: Iterable[RunningNode]) -> None:
    """A subgraph around them is disabled; their own flags stay (G2)."""
    newly = [worker for worker in workers if not worker.blocked & DISABLED]
    for worker in newly:
        worker.block(DISABLED)
    end_tasks(newly)
    _settle_disabled(newly)


def end_tasks(workers: Iterable[RunningNode]) -> None:
    """F10: tasks that the code of disabled nodes has started do not end by themselves, so they are cancelled.

    It lasts longer than the `setup()` of nodes that are disabled from the start, or reset while they are.
    """
    for worker in workers:
        if worker.blocked & DISABLED and worker.tasks is not None:
            worker.tasks.cancel()


def enable_around(owner: RunningNode) -> None:
    """The subgraphs around the worker of one are enabled; it has nothing to set up."""
    owner.allow(DISABLED)
    wiring.refresh(owner)


def _settle_disabled(workers: Sequence[RunningNode]) -> None:
    """Rewire the neighbours of nodes that were disabled, then empty their edges."""
    if not workers:
        return
    untaken = {edge for worker in workers for edges in worker.wired_out for edge in edges if edge.untaken}
    for worker in workers:  # first: returned activity may trigger, but not over edges that are dead now
        wiring.refresh(worker)
    with deferring_events(workers[0].core):
        for worker in workers:
            _empty(worker, untaken)
        for worker in workers:
            if worker.concurrent is not None:
                worker.core.rules.complete_firings(
                    worker
                )  # finished firings send to no one, so they need not wait for their turn (F14)
        for worker in workers:  # what consumers have taken is on edges that are dead, and holds no END (F5)
            if worker.pending_end and worker.busy in BETWEEN_FIRINGS:
                send_end(worker)
    find_dead_sources(workers[0].core)


def _empty(worker: RunningNode, untaken: Collection[Edge]) -> None:
    """Discard what lies on the edges of a disabled node; what lay there untaken holds its producers no more."""
    incoming = [one for one in worker.edges_in() if not (one.port_name == "enable" and one.target_kind == "slot")]
    outgoing = [edge for edges in worker.wired_out for edge in edges]
    for edge in (*incoming, *outgoing):
        discard(edge, "disabled")
    # a firing in progress is finished, but producers do not wait for it; what consumers have taken they finish
    worker.release_early()
    release([edge for edge in incoming if type(edge) is not EventEdge])
    for edge in (edge for edge in outgoing if edge in untaken):
        working = type(edge) is BufferEdge and edge.working
        release((edge,))
        if working:
            edge.go_on_working(True)


def discard_initial(edges: Iterable[AnyEdge]) -> None:
    """F10 for a node that is disabled from the start: discard the tokens that disabling it now would discard."""
    for edge in edges:
        if edge.target.blocked & DISABLED or (edge.source.blocked & DISABLED and type(edge) is BufferEdge):
            discard(edge, "disabled")


def enable(worker: RunningNode, then: Callable[[], None], *, fresh: bool = False) -> None:
    """F10: the node starts from scratch, unless it is `fresh` already; A(v) is kept.

    In the back-off of a restart that sets it up, when it is over.
    """
    core = worker.core
    itself = worker.enable_itself(True)
    if not worker.blocked & DISABLED or not all(scope.enabled for scope in worker.around):
        then()
        return

    def up() -> None:
        if not worker.own_enabled or not all(scope.enabled for scope in worker.around):
            take_part(worker)  # over edges that are dead
            then()  # disabled again meanwhile
            return
        worker.allow(DISABLED | ENDED)
        _not_ended(worker)
        if itself and core.trace_changes is not None:  # else the subgraph around it was, and that is reported
            core.trace_changes(NodeEnabled(core.now(), worker.path, True))
        wiring.refresh(worker)
        take_part(worker)
        consider(worker)
        find_dead_sources(core)
        doing.afresh(worker)
        then()

    if fresh:
        up()
    else:
        _afresh(worker, up, ahead=True)


def _afresh(worker: RunningNode, then: Callable[[], None], *, ahead: bool = False) -> None:
    """Teardown of what is set up, then setup; a failure ends the run. A restart in progress does it later (X1).

    Args:
      worker: of the node.
      then: what follows.
      ahead: it takes part when that follows, and not before.
    """
    host = worker.core.runtime

    def down(error: NodeError | None) -> None:
        if worker.core.over:  # its tasks came to their end with the run: nothing is set up any more
            worker.core.errors += [] if error is None else [error]
        elif error is not None:
            host.finish("failed", error)
        else:
            if ahead:
                worker.lifecycle.wait_to_take_part()
            set_up(worker, up)

    def up(error: NodeError | None) -> None:
        if error is not None:
            host.finish("failed", error)
        else:
            then()

    if worker.blocked & BACKOFF:
        then()
    else:
        tear_down(worker, down)


def _not_ended(worker: RunningNode) -> None:
    """It starts afresh; a firing that was to end it behind others whose turn has not come is over with that (F14)."""
    concurrent, core = worker.concurrent, worker.core
    if concurrent is not None and concurrent.ending is not None and core.trace is not None:
        core.trace(FiringEnded(core.now(), worker.path, concurrent.ending.number, "abandoned"))
    worker.start_over()


def reset(worker: RunningNode, then: Callable[[], None]) -> None:
    """The slot `reset`: teardown, setup, not ended; tokens and A(v) stay (A9)."""

    def up() -> None:
        _not_ended(worker)
        unblock(worker, ENDED)
        wiring.refresh(worker)
        find_dead_sources(worker.core)
        end_tasks((worker,))
        doing.afresh(worker)
        then()

    _afresh(worker, up)


def restart(worker: RunningNode, backoff_s: float) -> None:
    """X1: teardown, a pause, setup; a node that is disabled by then is set up when it is enabled.

    The caller has blocked it with `BACKOFF`.
    """
    core = worker.core

    def down(worker: RunningNode, then: Callable[[], None]) -> None:
        tear_down(worker, lambda _error: then())

    def rested() -> None:
        worker.lifecycle.end_rest()
        when_idle(worker, up, nothing)

    def up(worker: RunningNode, then: Callable[[], None]) -> None:
        if worker.blocked & (DISABLED | REMOVED):
            over(None, then)
        else:
            set_up(worker, lambda error: over(error, then))

    def over(error: NodeError | None, then: Callable[[], None]) -> None:
        if error is not None:
            core.runtime.finish("failed", error)
        elif not worker.blocked & TORN_DOWN:
            worker.allow(BACKOFF)  # before those that wait have their turn: they may enable or reset it
            doing.afresh(worker)
            then()

    def rest() -> None:
        worker.lifecycle.rest(core.after(backoff_s, rested))

    when_idle(worker, down, rest)
