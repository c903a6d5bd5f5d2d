"""The automatic slots of a dissolved subgraph: enable, disable, deactivate, reset for everything inside.

(rules F10, G2).

Stands on `lifecycle` and `activity`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hfg.engine import lifecycle, wiring
from hfg.engine.activity import deactivate_inside, scopes_changed
from hfg.engine.agenda import block, consider
from hfg.engine.lifecycle import when_idle
from hfg.engine.scopes import Scope
from hfg.engine.worker import DISABLED, Worker
from hfg.trace import NodeEnabled

__all__ = ["disable_scope", "enable_scope", "run_slot"]

Action = Callable[[Worker, Callable[[], None]], None]


def run_slot(scope: Scope, name: str, then: Callable[[], None]) -> None:
    """Do to everything inside what the slot says."""
    if name == "deactivate":
        deactivate_inside(scope)
        if scope.members:
            scopes_changed(scope.members[0].core)
        then()
    elif name == "disable":
        then()
        disable_scope(scope)
    elif name == "enable":
        enable_scope(scope, then)
    else:
        _each(scope.members, lambda worker, done: when_idle(worker, lifecycle.reset, done), then)


def _each(workers: Sequence[Worker], action: Action, then: Callable[[], None]) -> None:
    """One after the other, in order of adding; without recursion, for there may be thousands."""
    rest = iter(workers)
    inside = done_inside = False

    def step() -> None:
        nonlocal inside, done_inside
        if inside:
            done_inside = True
            return
        inside = True
        for worker in rest:
            done_inside = False
            action(worker, step)
            if not done_inside:
                inside = False
                return
        then()

    step()


def disable_scope(scope: Scope) -> None:
    """Disable the subgraph: its nodes are disabled by it, their own flags and activity stay (G2)."""
    if not scope.enabled or scope.worker is None:
        return
    scope.enabled = False
    core = scope.worker.core
    if core.trace is not None and _is_alone_in_it(scope):
        core.trace(NodeEnabled(core.now(), scope.path, False))
    for worker in scope.members:
        if not worker.blocked & DISABLED:
            block(worker, DISABLED)
            lifecycle.settle_disabled(worker)
    wiring.refresh_via(scope)


def _is_alone_in_it(scope: Scope) -> bool:
    """Whether it makes a difference: inside a subgraph that is disabled itself it makes none."""
    around = scope.parent
    while around is not None:
        if not around.enabled:
            return False
        around = around.parent
    return True


def enable_scope(scope: Scope, then: Callable[[], None]) -> None:
    """Enable the subgraph: the nodes that were not disabled themselves start afresh."""
    if scope.enabled or scope.worker is None:
        then()
        return
    scope.enabled = True
    core = scope.worker.core
    if core.trace is not None and _is_alone_in_it(scope):
        core.trace(NodeEnabled(core.now(), scope.path, True))
    wiring.refresh_via(scope)

    def one(worker: Worker, done: Callable[[], None]) -> None:
        if worker.own_enabled and all(around.enabled for around in worker.around):
            when_idle(worker, lifecycle.enable, done)
        else:
            done()

    def finished() -> None:
        for worker in scope.members:
            consider(worker)
        then()

    _each(scope.members, one, finished)
