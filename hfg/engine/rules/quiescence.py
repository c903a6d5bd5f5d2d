"""What happens when nothing moves: events end, the run ends or has stalled (rules F13, P9, R5).

Decides only; `run` asks when it sees that no code runs, no worker is queued and no timer is pending. Depends on
`ending` and `sources`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from hfg.base.token import END
from hfg.engine.model import Core
from hfg.engine.model.running_node import (
    BACKOFF,
    DEAD_SOURCE,
    DISABLED,
    ENDED,
    FULL,
    RATE,
    RECORDED,
    RESTING,
    UNREADY,
    UNWIRED,
    RunningNode,
)
from hfg.engine.rules.ending import drain_left
from hfg.engine.rules.modifiers import derive_scopes, receive
from hfg.engine.rules.sending import enqueue, put_outputs
from hfg.engine.rules.sources import find_dead_sources
from hfg.errors import Stalled
from hfg.ports.edges import AnyEdge, EventEdge

__all__ = [
    "complete_edge",
    "complete_operators",
    "end_events",
    "give_up",
    "node_ended",
    "only_dead_sources_in_flight",
    "only_waiting_for_room",
    "stall",
    "stalled",
    "stuck",
    "unread",
    "waits_for",
]


def complete_operators(core: Core) -> bool:
    """P9: before the run ends, each event with operators completes, so that they release the values they hold."""
    edges = [edge for edge in core.edges if type(edge) is EventEdge and edge.complete is not None]
    came_out = [complete_edge(edge) for edge in edges]  # each of them, not only up to the first
    return any(came_out)


def complete_edge(edge: EventEdge) -> bool:
    """Complete the operators of one edge; whether anything came out."""
    complete = edge.take_complete()
    if complete is None:
        return False
    before = edge.sent
    complete()
    return edge.sent != before


def end_events(core: Core) -> bool:
    """F13: all live event edges into inputs whose queue is empty get END, at the same moment and once.

    Likewise graph inputs that are not fed; not the nodes inside an iteration, where none ever ends (G4).
    """
    edges = [
        edge
        for edge in core.edges
        if type(edge) is EventEdge
        and edge.target_kind == "input"
        and (edge.target_port is None or edge.target_port.kind == "input")  # not that of a slot in another part (L1)
        and edge.source not in core.inlets  # who gets it from where the edge begins
        and edge.target.within is None
        and edge.live
        and not edge.end_sent
        and not edge.queue
        and not edge.target.blocked & ENDED
    ]
    feeds = [feed for feed in core.feeds if not feed.blocked & ENDED and not feed.outputs.missing]
    now = core.now()
    for edge in edges:
        edge.say_end()
        enqueue(edge, END, 0, now)
    for feed in feeds:
        feed.block(ENDED)
        put_outputs(feed, [(END, None, None)])
    return bool(edges or feeds)


def node_ended(worker: RunningNode) -> None:
    """A node is over: its operators complete (P9), and sources may have no consumer left (R5)."""
    for edge in worker.event_edges():
        complete_edge(edge)
    if any(edge.source.is_source for edge in worker.in_edges):
        find_dead_sources(worker.core)


def give_up(core: Core) -> bool:
    """R5: dead sources before which something lies count as ended from now on: it is drained (F12).

    So whoever has sent it may go on; whether there are any.
    """
    given_up = [
        source
        for source in core.sources
        if source in core.dead_sources and not source.blocked & ENDED and any(edge.untaken for edge in _joined(source))
    ]
    for source in given_up:
        source.end(is_dead_source=True)
    for source in given_up:
        drain_left([edge for edge in _joined(source) if edge.untaken])  # what it works on is its firing's affair
        assert source.ending is not None
        for modifier in source.ending.take_deferred():  # there is no END of its own for which they would wait
            receive(source, (modifier,))
    derive_scopes(core)
    return bool(given_up)


def _joined(worker: RunningNode) -> list[Any]:
    return [edge for edge in worker.in_edges if edge.joins()]


def only_dead_sources_in_flight(core: Core, *, threads_too: bool) -> bool:
    """R5: a source that feeds only ended nodes does not keep the run alive.

    Even while it waits or works in a thread.
    """
    busy = [worker for worker in core.workers if worker.codes_at_work()]
    return bool(busy) and all(
        worker in core.dead_sources and (threads_too or not worker.group.threaded) for worker in busy
    )


def only_waiting_for_room(core: Core) -> bool:
    """F8: all code in progress waits for room in full queues, and no node can make room, so the run may end."""
    return sum(worker.codes_waiting_for_room() for worker in core.workers) >= core.in_flight + core.tasks


def stall(core: Core) -> Stalled | None:
    """R5: say who waits for what, if a source is blocked or tokens lie where they can never be taken."""
    reasons = stuck(core)
    return stalled(reasons) if reasons else None


def stuck(core: Core) -> list[str]:
    """R5: who waits for what, now that nothing moves any more; none if all is well."""
    core.settle_barriers()
    lies: dict[RunningNode, list[AnyEdge]] = {}
    for edge in core.edges:
        if _lies_for_good(edge):
            lies.setdefault(edge.target, []).append(edge)
    reasons = [_why_stuck(target, edges) for target, edges in lies.items()]
    reasons.extend(
        f'source "{source.path}" has not ended and {waits_for(source)}'
        for source in core.sources
        if source not in core.dead_sources and not source.blocked & (ENDED | DISABLED | RESTING)
    )
    return reasons


def stalled(reasons: Sequence[str]) -> Stalled:
    """R5: what a run that stands still for these reasons fails with."""
    shown = "; ".join(reasons[:5]) + (f"; and {len(reasons) - 5} more" if len(reasons) > 5 else "")
    return Stalled(
        f"the run has stalled: {shown}. Nothing can change this from inside: connect or end what is "
        f"missing, or run with allow_idle=True "
        f"if something outside will"
    )


def unread(core: Core, read: Collection[RunningNode]) -> list[RunningNode]:
    """Return the graph outputs that are not read and that hold back a node that could move (P10).

    Args:
      core: the run, which is quiet.
      read: the outputs that are read now.
    """
    found = [worker for worker in core.readers if worker not in read and worker.inputs_ready()]
    if not found:
        return []
    core.settle_barriers()
    held = any(
        worker.outputs.missing and not worker.inputs.missing and not worker.blocked
        for worker in core.workers
        if not worker.is_boundary_output
    )
    held = held or any(feed.outputs.missing for feed in core.feeds)  # whose sender waits until it is processed
    return found if held else []


def _lies_for_good(edge: AnyEdge) -> bool:
    """Whether what lies on it is still to be taken, now that nothing moves any more."""
    target: RunningNode = edge.target
    return (
        edge.untaken > 0
        and target not in target.core.outlets  # what lies there lies before who is to take it, too, in another part
        and target.within is None  # what is kept inside of what iterates waits for its next firing (G4)
        and bool(edge.live or edge.source.blocked & DISABLED)
        and not target.blocked & (DISABLED | ENDED)
        and not (target.is_boundary_output and all(token.value is END for token in edge.contents()))
    )


def _why_stuck(target: RunningNode, edges: list[AnyEdge]) -> str:
    lies = ", ".join(f'"{edge.label}"' for edge in edges[:3]) + (" ..." if len(edges) > 3 else "")
    who = "" if target.is_boundary_output else f'"{target.path}" '
    return f"{who}{waits_for(target)}, while tokens lie on {lies}"


_WAITS = (
    (DISABLED, "is disabled"),
    (ENDED, "has ended"),
    (UNREADY, "says by ready() that it is not ready"),
    (FULL, "is held back by a full queue"),
    (RECORDED, "waits for its recorder"),
    (BACKOFF, "is being restarted"),
    (RESTING, "rests, for its gate is closed"),
    (DEAD_SOURCE, "has nobody left to work for"),
)


def waits_for(worker: RunningNode) -> str:
    """Say what keeps a node from moving, as the end of a sentence about it."""
    if worker.is_boundary_output:
        return f'graph output "{worker.port_name}" is not read (`async for value in run.read(...)` would)'
    blocked = worker.blocked
    if blocked & UNWIRED:
        return _lacks(worker)
    waits = next((words for bit, words in _WAITS if blocked & bit), None)
    if waits is not None:
        return waits
    if worker.inputs.missing:
        names = [edge.port_name for edge in worker.live_inputs if not edge.untaken]
        return "waits for " + ", ".join(f'"{name}"' for name in names)
    if worker.outputs.missing:
        edges = [edge.label for edge in worker.all_out_edges() if getattr(edge, "unprocessed", False)]
        return "waits until its token is processed on " + ", ".join(f'"{label}"' for label in edges[:3])
    return "is held back by its rate" if blocked & RATE else "cannot move"


def _lacks(worker: RunningNode) -> str:
    fed = {edge.port_name for edge in worker.live_inputs}
    names = [name for name in worker.mandatory_ports if name not in fed]
    if names:
        return "waits for its unconnected input " + ", ".join(f'"{name}"' for name in names)
    return "has no process function" if worker.process is None else "has no live input"
