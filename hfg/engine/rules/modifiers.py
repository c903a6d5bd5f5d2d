"""How activity changes a node, and how it is lost or returned (rules A5-A8, F10).

Depends on `agenda`; what follows from a change is decided further up.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.activity.rules import after_receipt
from hfg.base.token import Token
from hfg.engine.model import Core, Scope
from hfg.engine.model.running_node import REMOVED, RunningNode
from hfg.engine.rules.agenda import freed
from hfg.engine.rules.listening import may_listen
from hfg.ports.edges import AnyEdge, Edge, EventEdge
from hfg.trace import ActivityCause, ActivityChanged, ActivityLost, DropReason, ErrorRaised, TokenDropped

__all__ = [
    "automatic",
    "count_dropped",
    "derive_scopes",
    "discard",
    "drop",
    "give_back",
    "lose",
    "receive",
    "report_error",
    "set_active",
    "tell_activity",
    "touch",
]


def receive(worker: RunningNode, modifiers: Sequence[int]) -> None:
    """A6: only the net change counts."""
    active = after_receipt(worker.active, modifiers)
    if active != worker.active:
        set_active(worker, active, "token")


def set_active(worker: RunningNode, active: bool, cause: ActivityCause) -> None:
    """A(v) := active, and everything that follows a change."""
    if worker.active == active:
        return
    worker.become(active)
    if active and worker.listened is not None:
        may_listen(worker)
    core = worker.core
    tell_activity(worker, cause)
    if not worker.watched:
        return
    core.rules.activity_changed(worker, active)


def tell_activity(worker: RunningNode, cause: ActivityCause) -> None:
    """It has become active or inactive: report it to the consumers of the trace, if there are any (R7)."""
    core = worker.core
    if core.trace_changes is not None:
        core.trace_changes(ActivityChanged(core.now(), worker.path, worker.active, cause))


def touch(core: Core, scopes: Sequence[Scope]) -> None:
    """Something these subgraphs derive their activity from has changed."""
    for scope in scopes:
        if scope not in core.dirty_scopes:
            core.dirty_scopes.append(scope)


def derive_scopes(core: Core) -> None:
    """After a step that may have moved activity: derive A(subgraph) again where it is watched (G2).

    While several edges change, this waits for the end of the change.
    """
    if core.dirty_scopes and core.deferred_events is None:
        core.rules.scopes_changed(core)


def automatic(worker: RunningNode, name: str, value: object = None) -> None:
    """An automatic event has arisen; it leaves after the firing or call in progress, or at the next flush."""
    if name in worker.events:
        worker.expect_event(name, value)


def discard(edge: AnyEdge, reason: DropReason) -> None:
    """Take all tokens from an edge, count them and return their activity (F10, A8)."""
    tokens = edge.clear()
    target: RunningNode = edge.target
    if not tokens:
        return
    for token in tokens:
        drop(edge, token, reason)
    if not edge.joins():
        for _ in tokens:
            target.forget_call(edge)
    elif edge in target.live_inputs:
        target.inputs.expect()
        target.drop_firing()
    if type(edge) is EventEdge:
        freed(edge)


def drop(edge: Edge, token: Token[Any], reason: DropReason) -> None:
    """Count a token that goes nowhere; its activity goes back (A8)."""
    count_dropped(edge, token, reason)
    if token.activity > 0:
        give_back(edge)
        touch(edge.target.core, edge.target.scopes)


def count_dropped(edge: Edge, token: Token[Any], reason: DropReason) -> None:
    """Count a token that goes nowhere; what becomes of its activity is the caller's affair."""
    edge.count_dropped()
    core: Core = edge.target.core
    if core.trace is not None:
        core.trace(TokenDropped(core.now(), edge.label, token, reason))


def give_back(edge: Edge) -> None:
    """A8: activity is never lost unseen: the sender has it again, or its loss is counted."""
    sender: RunningNode = edge.source
    if sender in edge.target.core.inlets:
        return  # the sender is in another part, where the token lies as well and goes back from (L1)
    if sender.node is None or sender.scope is not None or sender.blocked & REMOVED:
        lose(edge)
    else:
        set_active(sender, True, "returned")


def lose(edge: Edge) -> None:
    """No node can have the activity that came over the edge: count it as lost."""
    core: Core = edge.target.core
    core.lost_activity += 1
    if core.trace_changes is not None:
        core.trace_changes(ActivityLost(core.now(), edge.label))


def report_error(worker: RunningNode, what: str, error: str, policy: str) -> None:
    """Tell whoever listens that a node's code failed."""
    core = worker.core
    if core.trace_changes is not None:
        core.trace_changes(ErrorRaised(core.now(), worker.path, what, error, policy))
