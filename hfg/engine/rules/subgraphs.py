"""The automatic slots of a dissolved subgraph: enable, disable, deactivate, reset for everything inside.

(rules F10, G2).

Depends on `node_lifecycle` and `activity`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from hfg.engine.model import RunningNode, Scope
from hfg.engine.rules import node_lifecycle, wiring
from hfg.engine.rules.activity import deactivate_inside, scopes_changed
from hfg.engine.rules.agenda import consider
from hfg.engine.rules.modifiers import derive_scopes
from hfg.engine.rules.node_lifecycle import when_idle
from hfg.trace import NodeEnabled

__all__ = ["disable_scope", "enable_scope", "run_slot"]

Action = Callable[[RunningNode, Callable[[], None]], None]


def run_slot(scope: Scope, name: str, then: Callable[[], None]) -> None:
    """Do to everything inside what the slot says."""
    if name == "deactivate":
        deactivate_inside(scope, "slot")
        if scope.worker is not None:
            scopes_changed(scope.worker.core)
        then()
    elif name == "disable":
        disable_scope(scope)
        then()
    elif name == "enable":
        enable_scope(scope, then)
    else:
        _each(scope.members, node_lifecycle.reset, then)


def _each(workers: Iterable[RunningNode], action: Action, then: Callable[[], None]) -> None:
    """Do it to those at rest, one after the other in order of adding; a node in a firing or call follows after it.

    Without recursion, because there may be thousands.
    """
    rest = iter(workers)
    inside = done_inside = False

    def step() -> None:
        nonlocal inside, done_inside
        if inside:
            done_inside = True
            return
        inside = True
        for worker in rest:
            if worker.busy or worker.has_concurrent_code():
                when_idle(worker, action, node_lifecycle.nothing)
                continue
            done_inside = False
            when_idle(worker, action, step)
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
    if core.trace_changes is not None and _is_alone_in_it(scope):
        core.trace_changes(NodeEnabled(core.now(), scope.path, False))
    wiring.refresh_via(scope)
    node_lifecycle.disable_around((*scope.inside(), scope.worker))
    derive_scopes(core)


def _is_alone_in_it(scope: Scope) -> bool:
    """Whether it makes a difference: inside a subgraph that is disabled itself it makes none."""
    around = scope.parent
    while around is not None:
        if not around.enabled:
            return False
        around = around.parent
    return True


def enable_scope(scope: Scope, then: Callable[[], None], fresh: Collection[RunningNode] = ()) -> None:
    """Enable the subgraph: nodes that were not disabled themselves start afresh, unless they are `fresh` already."""
    if scope.enabled or scope.worker is None:
        then()
        return
    scope.enabled = True
    core = scope.worker.core
    if core.trace_changes is not None and _is_alone_in_it(scope):
        core.trace_changes(NodeEnabled(core.now(), scope.path, True))
    wiring.refresh_via(scope)
    for owner in (*scope.inside(), scope.worker):
        if owner.scope is not None and all(one.enabled for one in owner.around):
            node_lifecycle.enable_around(owner)

    def finished() -> None:
        for worker in scope.members:
            consider(worker)
        then()

    meant = [worker for worker in scope.members if worker.own_enabled and all(one.enabled for one in worker.around)]
    for worker in meant:
        if worker in fresh:
            node_lifecycle.enable(worker, node_lifecycle.nothing, fresh=True)
    _each([worker for worker in meant if worker not in fresh], node_lifecycle.enable, finished)
