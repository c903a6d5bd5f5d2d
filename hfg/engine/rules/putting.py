"""What becomes of one token on one edge: it lies there, is drained or dropped, or enables (P5, F12, F13, T4, G2).

`sending` decides which tokens are sent, and what follows when all of them are on their edges. Depends on `modifiers`.
"""

from __future__ import annotations

from typing import Any

from hfg.base.token import END, Marker, Token
from hfg.engine.model import Core
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.engine.rules.agenda import add_call, arrived, note_full
from hfg.engine.rules.listening import listens, may_listen
from hfg.engine.rules.modifiers import count_dropped, drop, touch
from hfg.ports.edges import ACTIVITY, AnyEdge, BufferEdge, EventEdge, Lying, SyncEdge
from hfg.trace import TokenDrained, TokenProcessed, TokenSent

__all__ = ["bring_activity", "put", "put_signal"]


def put(edge: SyncEdge | BufferEdge, value: object, modifier: int, stamp: float) -> None:
    """Put one token on a synchronous edge."""
    token = Token(value, modifier, stamp, edge.number())
    target: RunningNode = edge.target
    core = target.core
    if core.trace is not None or edge.tap is not None:
        _show(edge, token)
    if core.sharing is not None:
        core.sharing.sent(edge, token)
    slot = edge.target_kind == "slot"
    if _is_unheard(edge, value, modifier) if slot else target.blocked & ENDED:
        _drain(edge, (value, modifier, stamp, token.sequence))
        return
    if modifier > 0:
        bring_activity(target)
    if edge.put(token):
        edge.waits.outputs.expect()
    elif core.trace is not None:
        core.trace(TokenProcessed(core.now(), edge.label))
    if slot:
        add_call(target, edge)
        return
    if type(value) is Marker:
        target.mark_special()
    if type(edge) is SyncEdge or len(edge.queue) == 1:  # type: ignore[union-attr]
        arrived(edge)


def _show(edge: AnyEdge, token: Token[Any]) -> None:
    """The token is sent: whoever looks sees it (R7)."""
    core: Core = edge.target.core
    if core.trace is not None:
        core.trace(TokenSent(core.now(), edge.label, token))
    if edge.tap is not None:
        edge.tap(token)


def _is_unheard(edge: AnyEdge, value: object, modifier: int) -> bool:
    """T4: a slot is not called by a marker, nor while it does not listen: the token is processed at once."""
    return type(value) is Marker or (edge.while_active and modifier <= 0 and not listens(edge.target))


def bring_activity(target: RunningNode) -> None:
    """A token with +1 lies before a node: it is about to listen (T4), and subgraphs around it are to look (G2)."""
    if target.listened is not None:
        may_listen(target)
    if target.scopes:
        touch(target.core, target.scopes)


def _drain(edge: AnyEdge, lying: Lying) -> None:
    """T4, F12: the token is processed immediately, without a firing or call; its modifier acts after the sending."""
    target: RunningNode = edge.target
    core = target.core
    modifier = lying[ACTIVITY]
    into_slot = edge.target_kind == "slot"
    if not into_slot:
        edge.count_drained()
    if core.trace is not None:
        core.trace(TokenDrained(core.now(), edge.label, Token(*lying)))
    if modifier:
        if not into_slot and target.ending is not None and target.ending.deferred is not None:
            target.ending.defer(modifier)
            if target.scopes:
                touch(core, target.scopes)
        else:
            core.drained.append((target, modifier))


def put_signal(edge: EventEdge, value: object, modifier: int, stamp: float) -> None:
    """Put one token into the queue of an event edge, by its policy (P5, F8)."""
    lying = (value, modifier, stamp, edge.number())
    target: RunningNode = edge.target
    core = target.core
    if core.trace is not None or edge.tap is not None:
        _show(edge, Token(*lying))
    if core.sharing is not None:
        core.sharing.sent(edge, Token(*lying))
    if edge.end_sent and value is not END:  # END came first: no consumer waits for anything after it (F13)
        count_dropped(edge, Token(*lying), "ended")
        if modifier > 0:
            core.returned.append(edge)
        return
    joins = edge.joins()
    if target.blocked & ENDED if joins else _is_unheard(edge, value, modifier):
        _drain(edge, lying)
        return
    if modifier > 0:
        bring_activity(target)
    holds_one = bool(edge.queue)
    if edge.overflows() and not _has_made_room(edge, lying):
        return
    edge.lay(lying)
    note_full(edge)
    if not joins:
        add_call(target, edge)
        return
    if type(value) is Marker:
        target.mark_special()
    if not edge.live:  # its operators held it back until its sender was disabled (P9, F10)
        core.rules.rewire(target)
    elif not holds_one:
        arrived(edge)


def _has_made_room(edge: EventEdge, lying: Lying) -> bool:
    """P5: one token too many: the oldest goes, or this one does."""
    oldest = edge.overflow != "drop_newest"
    drop(edge, edge.take() if oldest else Token(*lying), "overflow")
    if oldest and not edge.joins():
        edge.target.forget_call(edge)
    return oldest
