"""Slot calls (rules F6, F9, A6, P8). Depends on `releasing`; a node's code is run by the host."""

from __future__ import annotations

from collections.abc import Coroutine
from types import CoroutineType
from typing import Any

from hfg.base.token import Token
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import builtin_slots, sharing
from hfg.engine.rules.agenda import idle_again
from hfg.engine.rules.modifiers import derive_scopes, lose, receive, touch
from hfg.engine.rules.releasing import make_room, release
from hfg.engine.rules.sending import send_automatic
from hfg.errors import UsageError
from hfg.ports.edges import AnyEdge, SyncEdge
from hfg.trace import CallEnded, CallOutcome, CallStarted, ParameterSet, TokenTaken

__all__ = ["await_call", "call", "finish_call", "refuse_coroutine", "set_parameter"]


def call(worker: RunningNode) -> None:
    """Take the oldest waiting slot token and run its handler (F9)."""
    core = worker.core
    edge = worker.take_call()
    token = edge.take()
    worker.begin_call(edge, token.stamp)
    if core.sharing is not None:
        sharing.taken(worker, (edge,), (token,))
        if core.over:
            return
    name = edge.port_name
    if core.trace is not None:
        now = core.now()
        core.trace(CallStarted(now, worker.path, worker.counts.calls, name, edge.label))
        core.trace(TokenTaken(now, edge.label, token))
    if token.activity:
        _receive(worker, edge, token.activity)
    make_room(edge)
    if edge.target_kind == "parameter":
        try:
            set_parameter(worker, name, token.value)
        except Exception as error:
            core.rules.fail_call(worker, name, error)
        else:
            finish_call(worker, "done")
    elif edge.while_active and not worker.active:  # T4: it was about to be active, or it was when the token came
        finish_call(worker, "done")
    elif edge.handler is not None and not (worker.group.threaded or core.sharing is not None):
        _call_at_once(worker, edge, token if edge.takes_token else token.value)
    else:
        _run_handler(worker, name, token)


def _call_at_once(worker: RunningNode, edge: AnyEdge, taken: object) -> None:
    """Run a plain handler on the loop, with the value or token: what `_run_handler` does, with fewer steps."""
    core = worker.core
    derive_scopes(core)
    core.current = worker
    try:
        result = edge.handler(taken)  # type: ignore[misc]  # it has one
    except Exception as error:
        core.current = None
        core.rules.fail_call(worker, edge.port_name, error)
        return
    core.current = None
    if type(result) is CoroutineType:
        await_call(worker, edge.port_name, result)
    else:
        finish_call(worker, "done")


def _receive(worker: RunningNode, edge: AnyEdge, modifier: int) -> None:
    """A6: what a call has taken acts, and by that on the subgraphs around."""
    if worker.scopes:
        touch(worker.core, worker.scopes)
    if worker.scope is None:
        receive(worker, (modifier,))
    elif modifier > 0:  # a subgraph has no activity but that of its nodes (G2)
        lose(edge)


def _run_handler(worker: RunningNode, name: str, token: Token[Any]) -> None:
    """Run the handler of a slot, or do what every node has one for."""
    core = worker.core
    handler = worker.handlers.get(name)
    if handler is None:
        builtin_slots.run(worker, name, token, lambda: finish_call(worker, "done"))
        derive_scopes(core)  # after the effects of `activate` (A7)
        return
    derive_scopes(core)
    ticket = worker.ticket

    def done(result: object, error: BaseException | None) -> None:
        if worker.ticket != ticket:
            return
        if type(result) is CoroutineType:
            if not worker.group.threaded:
                await_call(worker, name, result)
                return
            error = refuse_coroutine(worker, result)
        _over(worker, name, error)

    core.code.execute(worker, handler, (token,), done)


def await_call(worker: RunningNode, name: str, coroutine: Coroutine[Any, Any, Any]) -> None:
    """A handler that was called by a fast path turned out to wait."""

    def done(_result: object, error: BaseException | None) -> None:
        _over(worker, name, error)

    worker.core.code.drive(worker, coroutine, done)


def _over(worker: RunningNode, name: str, error: BaseException | None) -> None:
    """The handler's code is over."""
    if error is None:
        try:
            sharing.need_unchanged(worker)
        except UsageError as changed:
            error = changed
    if error is None:
        finish_call(worker, "done")
    else:
        worker.core.rules.fail_call(worker, name, error)


def refuse_coroutine(worker: RunningNode, coroutine: Coroutine[Any, Any, Any]) -> TypeError:
    """Close what came from a thread, where nothing can await it, and say what to do."""
    coroutine.close()
    return TypeError(
        f'it gave back a coroutine, but its group "{worker.group.name}" is a thread and async code runs on the loop; '
        "write `async def` and leave out group="
    )


def finish_call(worker: RunningNode, outcome: CallOutcome) -> None:
    """The automatic events follow (A9), then the call is over: a sequential O->S token is processed (F6)."""
    core = worker.core
    derive_scopes(core)
    if worker.events_due:
        send_automatic(worker)
    if core.trace is not None:
        core.trace(CallEnded(core.now(), worker.path, worker.counts.calls, outcome))
    edge = worker.end_call()
    if type(edge) is SyncEdge and edge.token is None:  # else it is the next one, which a pipelined edge has let in
        release((edge,))
    worker.leave()
    idle_again(worker)
    if core.sharing is not None:
        core.sharing.sweep()


def set_parameter(worker: RunningNode, name: str, value: object) -> None:
    """Set a parameter to the value of a token.

    Raises:
      ValueError: it is out of its limits, or what the value itself raises: an error of the firing or call (X1).
    """
    worker.node._set_parameter(name, value)
    if worker.core.trace_changes is not None:
        worker.core.trace_changes(ParameterSet(worker.core.now(), worker.path, name, worker.node._parameters[name]))
