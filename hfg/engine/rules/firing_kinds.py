"""Whether a firing runs the function, is silent, or is the last one of its node (F4, A11)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.engine.model.records import SAME_MOMENT_S
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules.wiring import rewire
from hfg.ports.edges import AnyEdge
from hfg.trace import FiringKind

__all__ = ["kind_of"]


def kind_of(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> FiringKind:
    """F4: what becomes of a firing; a closed gate makes it silent (A11)."""
    for edge, token in zip(edges, tokens, strict=True):
        edge.end(token.value is END)
    if any(edge.ended for edge in worker.in_edges):
        if any(edge.ended and edge.mandatory for edge in edges) or _all_ended(worker, edges):
            return "end"
        if any(edge.ended for edge in edges):
            rewire(worker)
    if _lacks_values(edges, tokens) or (worker.gates_over and _is_held_by_gate(worker)):
        return "silent"
    return "process"


def _lacks_values(edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> bool:
    """F4(2): a mandatory input holds NO_MESSAGE, or there is none and no input holds a value."""
    absent = bool(edges)
    for edge, token in zip(edges, tokens, strict=True):
        if edge.mandatory and token.value is NO_MESSAGE:
            return True
        if edge.mandatory or type(token.value) is not Marker:
            absent = False
    return absent


def _is_held_by_gate(worker: RunningNode) -> bool:
    """A11: a gate over it is closed, and no throttled firing is due; sources rest instead."""
    return not worker.is_source and any(
        not gate.state.active and not _idle_turn(worker, gate.idle_rate_hz) for gate in worker.gates_over
    )


def _idle_turn(worker: RunningNode, idle_rate_hz: float | None) -> bool:
    """A11: a throttled node runs its function as often as the idle rate allows."""
    return idle_rate_hz is not None and worker.core.now() + SAME_MOMENT_S >= worker.rate.gate_next + 1.0 / idle_rate_hz


def _all_ended(worker: RunningNode, taking_part: Sequence[Any]) -> bool:
    """F4(1): every live input has ended; edges with initial tokens do not count, and one other must have.

    Args:
      worker: whose inputs.
      taking_part: the edges of this firing; also one whose source was disabled and that still delivers (F10).
    """
    live = [edge for edge in worker.in_edges if edge in taking_part or (edge.live and edge.joins())]
    counted = [edge for edge in live if not getattr(edge, "initial", ())]
    return bool(counted) and all(edge.ended for edge in counted)
