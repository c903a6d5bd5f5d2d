"""What follows when A(v) changes: hooks, automatic events, time-outs, gates, subgraphs (A9, A11, A12, A15, G2).

And reset (A14).

Only workers marked `watched` come here. Depends on `sending`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal

import msgspec

from hfg.base.token import Token
from hfg.engine.model import Core, Gate, Scope
from hfg.engine.model.running_node import BETWEEN_FIRINGS, RATE, RESTING, RunningNode
from hfg.engine.rules import doing
from hfg.engine.rules.agenda import consider, must_wait
from hfg.engine.rules.modifiers import automatic, set_active, touch
from hfg.engine.rules.sending import emit_automatic, send_automatic, trigger
from hfg.ports.edges import AnyEdge

__all__ = ["changed", "deactivate_inside", "gate_changed", "reset_activity", "rest", "scopes_changed"]


def changed(worker: RunningNode, active: bool) -> None:
    """A(v) has just become `active`."""
    core = worker.core
    automatic(worker, "activated" if active else "deactivated")
    _time_out_later(worker, active)
    gate_changed(worker.gates)
    if worker.scopes:
        touch(core, worker.scopes)
        for scope in worker.scopes:
            if scope.gates:
                _look_at(scope)
    if worker.has_hooks:
        _call_hooks(worker, active)
    if worker.busy in BETWEEN_FIRINGS:
        emit_automatic(worker)


def _call_hooks(worker: RunningNode, active: bool) -> None:
    """Call the node's hooks; the do-activity begins after `on_activated` (A15)."""
    if not doing.has(worker):
        _call_hook(worker, "on_activated" if active else "on_deactivated", None)
    elif active:
        doing.entering(worker)
        _call_hook(worker, "on_activated", doing.entered)
    else:
        doing.leave(worker)
        _call_hook(worker, "on_deactivated", None)


def _call_hook(worker: RunningNode, name: str, then: Callable[[RunningNode], None] | None) -> None:
    hook = worker.node._hook(name)
    if hook is None:
        if then is not None:
            then(worker)
        return

    def done(_result: object, error: BaseException | None) -> None:
        if error is not None:
            worker.core.rules.fail(worker, f"{name}()", error, answer=False)
        if then is not None:
            then(worker)

    worker.core.code.execute_hook(worker, hook, done)


def _time_out_later(worker: RunningNode, active: bool) -> None:
    """A12: the time runs from the change from 0 to 1; the timer counts only if the event leads somewhere."""
    limit = worker.active_for_s
    worker.time_activity(None)
    if active and limit is not None:
        core = worker.core
        leads = worker.timeout_leads_somewhere()
        worker.time_activity(core.runtime.call_at(core.now() + limit, lambda: _time_out(worker), counts=leads))


def _time_out(worker: RunningNode) -> None:
    worker.time_activity(None)
    event = worker.events.get("timeout")
    if event is None:
        return
    trigger(event, stamp=worker.core.now(), extend_right=False)
    worker.let_carry(False)  # after the sending, which may have given it (A3)
    scopes_changed(worker.core)
    if worker.busy in BETWEEN_FIRINGS:  # else after the firing (A9)
        send_automatic(worker)


def gate_changed(gates: Iterable[Gate]) -> None:
    """A11: sources rest while the state is inactive; the others look when they fire."""
    for gate in gates:
        for worker in gate.workers:
            if worker.is_source:
                rest(worker)


def rest(worker: RunningNode) -> None:
    """Let a source rest, or go on, as its gates say now."""
    if worker.blocked & RATE:
        worker.rate_over()
    if any(gate.idle_rate_hz is None and not gate.state.active for gate in worker.gates_over):
        if not worker.blocked & RESTING:
            worker.block(RESTING)
        return
    worker.allow(RESTING)
    if worker.fireable and must_wait(worker):  # throttled from now on (A11)
        worker.make_unfireable()
    else:
        consider(worker)


# --- subgraphs ------------------------------------------------------------------------------------------------------


def scopes_changed(core: Core) -> None:
    """G2: derive A(subgraph) again for all that were touched, then tell it.

    Inner ones first, the last of those side by side.
    """
    while core.dirty_scopes:
        for scope in core.dirty_scopes:
            _look_at(scope)
        scope = max(core.dirty_scopes, key=_index)
        core.dirty_scopes.remove(scope)
        if scope.told == scope.active:
            continue
        active = scope.tell()
        owner = scope.worker
        assert owner is not None
        # the scope's worker shows A(subgraph), but nothing is transferred by itself
        owner.become(active)
        automatic(owner, "activated" if active else "deactivated")
        _time_out_later(owner, active)
        send_automatic(owner)


def _look_at(scope: Scope) -> None:
    """Derive A(subgraph); what it gates follows at once."""
    if scope.look():
        gate_changed(scope.gates)


def _index(scope: Scope) -> float:
    return scope.index


def deactivate_inside(scope: Scope, cause: Literal["sent", "slot"]) -> None:
    """Take all activity from the inside: of nodes, and of tokens in transit."""
    if not scope.watched:
        scope.find_inner_edges()
    assert scope.worker is not None
    core = scope.worker.core
    for edge in scope.inner_edges:
        _strip(edge, also_taking=False)
        touch(core, edge.target.scopes)
    for worker in scope.members:
        _forget(worker)
        set_active(worker, False, cause)
        touch(core, worker.scopes)
    touch(core, (scope,))


def _forget(worker: RunningNode) -> None:
    """Take the right of A3, and what the tokens that were drained are to do (F12)."""
    worker.let_carry(False)
    if worker.ending is not None:
        worker.ending.strip()


def _strip(edge: AnyEdge, *, also_taking: bool) -> None:
    """Set the modifiers of what lies on an edge to 0 (A14): those of +1, also those of -1."""

    def stripped(token: Token[Any]) -> Token[Any]:
        if token.activity > 0 or (also_taking and token.activity):
            return msgspec.structs.replace(token, activity=0)
        return token

    edge.strip(stripped)


def reset_activity(core: Core) -> None:
    """A14: all A(v) := 0, modifiers := 0, the right of A3 ends, then `start` is triggered."""
    for edge in core.edges:
        _strip(edge, also_taking=True)
    for worker in core.workers:
        _forget(worker)
        if worker.scope is None:
            set_active(worker, False, "reset")
    touch(core, core.scopes)
    scopes_changed(core)
    assert core.boundary is not None
    start = core.boundary.events.get("start")
    if start is not None:
        trigger(start, explicit=1)
