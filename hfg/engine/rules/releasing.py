"""When a sent token counts as processed, and which nodes continue then (rules F5, P7, P10).

Depends on `sending`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from hfg.base.token import Token
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules.agenda import consider, freed
from hfg.engine.rules.sending import send_end
from hfg.ports.edges import AnyEdge, BufferEdge, EventEdge, SyncEdge
from hfg.trace import TokenProcessed, TokenTaken

__all__ = ["make_room", "outputs_free", "release", "take_from_reader"]


def release(edges: Sequence[SyncEdge | BufferEdge], *, drained: Collection[Any] = ()) -> None:
    """These tokens are processed: free the producers' places where there is room now (F5, P4, P7).

    And transitively what waited for them, without recursion.

    Args:
      edges: where they lay.
      drained: the edges whose tokens were drained, which was reported already (F12).
    """
    left: list[Any] | None = None  # which are to be released before the next of the edges
    for edge in edges:
        while True:
            if edge.release():
                producer: RunningNode = edge.waits
                core = producer.core
                if core.trace is not None and edge not in drained:
                    core.trace(TokenProcessed(core.now(), edge.label))
                if producer.outputs.arrive():
                    freed_by_that = outputs_free(producer)
                    if freed_by_that:
                        left = [*(left or ()), *reversed(freed_by_that)]
            if not left:
                break
            edge = left.pop()


def make_room(edge: AnyEdge) -> None:
    """Its oldest token has been taken: that frees its place, unless the edge is sequential (F5, F6)."""
    if isinstance(edge, EventEdge):
        freed(edge)
    elif not edge.sequential:
        release((edge,))


def outputs_free(worker: RunningNode) -> Sequence[Any]:
    """All its tokens are processed: it may continue. Return the edges that this releases (F5 sequential)."""
    released = worker.outputs_free()
    if worker.outputs.waiters is not None:
        worker.outputs.notify()
    if worker.concurrent is not None:
        worker.core.rules.complete_firings(worker)
    elif worker.ending is not None and worker.ending.pending and worker.busy in ("", "edit"):
        send_end(worker)
    else:
        consider(worker)
    return released


def take_from_reader(worker: RunningNode) -> Token[Any]:
    """Take the token that lies before a reader; its place is free at once."""
    edge = worker.live_inputs[0]
    token: Token[Any] = edge.take()
    if not edge.untaken:
        worker.inputs.expect()
    worker.make_unfireable()
    core = worker.core
    if core.trace is not None:
        core.trace(TokenTaken(core.now(), edge.label, token))
    if isinstance(edge, EventEdge):
        freed(edge)
    else:
        release((edge,))
    return token
