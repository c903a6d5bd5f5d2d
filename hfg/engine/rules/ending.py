"""The end of a node: its `end()`, the values written there, and END after them (rules F2, F4, F12).

Depends on `releasing`; a node's code is run by the host.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from hfg.base.token import Marker, Token
from hfg.engine.model.running_node import DISABLED, RunningNode
from hfg.engine.rules.agenda import freed, idle_again
from hfg.engine.rules.modifiers import derive_scopes, touch
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import announce, put_outputs, send_automatic, send_end
from hfg.errors import EndOfStream, shown
from hfg.ports.edges import AnyEdge, EventEdge
from hfg.trace import FiringEnded, TokenDrained, TokenDropped

__all__ = ["drain_left", "drop_taken", "end", "end_itself", "ends_itself", "gave_back"]


def ends_itself(worker: RunningNode, error: BaseException | None) -> bool:
    """F2: the process function has raised `EndOfStream`, which is not an error: the node has ended."""
    return isinstance(error, EndOfStream) or (
        worker.is_source and isinstance(error, StopIteration | StopAsyncIteration)  # its generator has returned
    )


def end_itself(worker: RunningNode) -> None:
    """F2: end during a firing of its own; its values leave together with those of `end()` (F4)."""
    worker.execution.close_generator()  # nothing is left to close
    end(worker, (), ())


def end(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> None:
    """F4(1): `end()` is called, what it writes leaves as one full firing, END follows (F12 begins here)."""
    core = worker.core
    drop_taken(worker, edges, tokens)
    worker.counts.add_end_firing()
    worker.end()
    worker.execution.end_limit()
    drain_left(worker.in_edges)
    if (
        worker.ending is not None and worker.ending.deferred
    ):  # what was drained has yet to act, and subgraphs around are active by it meanwhile (G2)
        touch(core, worker.scopes)
        derive_scopes(core)
    hook = worker.node._hook("end") if worker.node is not None else None
    if hook is None:
        _ended(worker, None, None)
        return
    worker.be_busy("ending")
    core.code.execute(worker, hook, (), lambda result, error: _ended(worker, result, error))


def drop_taken(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> None:
    """F4(1): values that the ending firing has taken are dropped."""
    core = worker.core
    for edge, token in zip(edges, tokens, strict=True):
        if type(token.value) is not Marker:
            edge.count_dropped()
            if core.trace is not None:
                core.trace(TokenDropped(core.now(), edge.label, token, "ended"))


def gave_back(result: Any) -> TypeError:
    """F4: `end()` writes its last words, and gives nothing back."""
    return TypeError(f"end() gave back {shown(result)}, but it writes with send(): self.out.send(...)")


def drain_left(edges: Sequence[AnyEdge]) -> None:
    """F12: what still lies on inputs of an ended node is processed without a firing.

    All of it before any producer hears of that: one whose outputs are free by it may say END at once, and END is behind
    what lies here already (T4, P5).
    """
    joined = [edge for edge in edges if edge.joins()]
    drained = [edge for edge in joined if edge.untaken]
    for edge in drained:
        worker: RunningNode = edge.target
        core = worker.core
        for token in edge.clear():
            edge.count_drained()
            if core.trace is not None:
                core.trace(TokenDrained(core.now(), edge.label, token))
            if token.activity and worker.ending is not None and worker.ending.deferred is not None:
                worker.ending.defer(token.activity)
    for edge in drained:
        if type(edge) is EventEdge:
            freed(edge)
    release([edge for edge in joined if not isinstance(edge, EventEdge) and edge.unprocessed], drained=drained)


def _ended(worker: RunningNode, result: object, error: BaseException | None) -> None:
    core = worker.core
    worker.be_busy("firing")
    written = worker.take_written()
    if error is None and result is not None:
        error = gave_back(result)
    if error is not None:
        written = None
        then = partial(send_automatic, worker)  # it triggers `failed` before it may be disabled
        worker.core.rules.fail(worker, "end()", error, answer=False, then=then)
    if written is not None and any(entry is not None for entry in written):
        put_outputs(worker, written)
        announce(worker, written, processed=False)
    send_automatic(worker)
    if core.trace is not None:
        core.trace(FiringEnded(core.now(), worker.path, worker.counts.firings, "ended" if error is None else "failed"))
    release(worker.begin_releasing())
    stamp = worker.stamp
    worker.leave()  # the firing is over; END is not part of it (A3)
    assert worker.ending is not None
    if worker.ending.is_dead_source:  # during a firing, which is over now: no consumer of END is left (R5)
        worker.ending.take_deferred()
    elif worker.outputs.missing and not worker.blocked & DISABLED:
        worker.promise_end(stamp)
    else:
        worker.promise_end(stamp)
        send_end(worker)
    idle_again(worker)
