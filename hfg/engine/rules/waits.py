"""What each action of a node waits for: the steps that a walk in `rings` follows (rule F8). Depends on `agenda`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

from hfg.engine.model.running_node import AT_CONCURRENCY, BACKOFF, BETWEEN_FIRINGS, FIRES_NO_MORE, FULL, RunningNode
from hfg.engine.rules.agenda import must_wait
from hfg.ports.edges import AnyEdge, EventEdge

__all__ = [
    "CALL",
    "ELSEWHERE",
    "FINISH",
    "FIRE",
    "HEAR",
    "NEVER",
    "RING",
    "ROOM",
    "TELL",
    "Action",
    "Wait",
    "full_edges",
    "is_held",
    "processing",
    "taking",
    "wait_for",
    "works",
    "works_on_firing",
]

Action: TypeAlias = "tuple[RunningNode | None, str]"
"""A node and what it is to do. Without a node, it is done by the other parts of a graph that is cut."""

FIRE: Final = "fire"  # begins its next firing
CALL: Final = "call"  # begins its next slot call
TELL: Final = "tell"  # triggers an event
RING: Final = "ring"  # triggers an event by a timer
FINISH: Final = "finish"  # ends the firing or call in progress, and with it what follows (F5)
ROOM: Final = "room"  # has room in each queue that its events fill
HEAR: Final = "hear"  # gets a token for one of its slots
ELSEWHERE: Final[Action] = (None, "elsewhere")


class Wait:
    """Why an action does not happen now.

    Attributes:
      on: what it waits for.
      any_of: one of these suffices to let it happen; else all of them must, and none at all means: never.
    """

    __slots__ = ("any_of", "on")

    def __init__(self, on: list[Action], *, any_of: bool = False) -> None:
        self.on = on
        self.any_of = any_of


NEVER = Wait([], any_of=True)


def wait_for(worker: RunningNode, what: str) -> Wait | RunningNode | None:
    """Return what an action of a node waits for, or the node that will perform it without help."""
    return _WAITS[what](worker)


def _fire(worker: RunningNode) -> Wait | RunningNode:
    """F1: all that its next firing waits for."""
    blocked = worker.blocked
    if works_on_firing(worker) or blocked & BACKOFF:
        return worker
    on = processing(worker)
    if blocked & FIRES_NO_MORE or worker.process is None:
        return Wait(on) if worker.pending_end and on else NEVER
    on += [_sending(edge) for edge in worker.live_inputs if not edge.untaken]
    if blocked & FULL and _counts(worker, on):
        on.append((worker, ROOM))
    return Wait(on) if on else worker


def _counts(worker: RunningNode, waits_for: list[Action]) -> bool:
    """Whether only F8 holds its next firing: not also a rate, a gate, `ready()` or a call."""
    if worker.room.waiting:
        return True
    if worker.blocked & ~(FULL | AT_CONCURRENCY) or worker.busy not in BETWEEN_FIRINGS:
        return False
    return bool(waits_for) or not (worker.paced and must_wait(worker))


def _call(worker: RunningNode) -> Wait | RunningNode:
    """F9: all that its next slot call waits for."""
    if worker.blocked >= BACKOFF or works(worker):
        return worker
    on: list[Action] = [(worker, ROOM)] if worker.blocked & FULL else []
    if not worker.calls:
        on.append((worker, HEAR))
    return Wait(on) if on else worker


def _hear(worker: RunningNode) -> Wait:
    """A token at one of its slots: any will do."""
    return Wait([_sending(edge) for edge in worker.called_by() if edge.live], any_of=True)


def _tell(worker: RunningNode) -> Wait | None:
    """A signal of its own: by whatever code of it runs next."""
    if worker.tasks is not None and worker.tasks.move:
        return None
    on: list[Action] = [(worker, CALL)]
    if worker.scope is None:
        on.append((worker, FIRE))
    else:
        on += [(inside, TELL) for inside in worker.scope.inside()]
    if worker.codes_waiting_for_room():
        on.append((worker, ROOM))
    return Wait(on, any_of=True)


def _finish(worker: RunningNode) -> Wait | RunningNode:
    """F5, F6: that all is processed of the firing or call that has taken a token."""
    if works(worker):
        return worker
    on = processing(worker)
    if worker.room.waiting:
        on.append((worker, ROOM))
    return Wait(on) if on else worker


_WAITS: Final[dict[str, Callable[[RunningNode], Wait | RunningNode | None]]] = {
    FIRE: _fire,
    CALL: _call,
    TELL: _tell,
    FINISH: _finish,
    HEAR: _hear,
}


def processing(worker: RunningNode) -> list[Action]:
    """F5: what its outputs wait for."""
    edges = [edge for edges in worker.out_edges for edge in edges if edge.unprocessed]
    return [taking(edge) if edge.untaken else (edge.target, FINISH) for edge in edges]


def _sending(edge: AnyEdge) -> Action:
    """Return the action that would put a token on this edge."""
    source: RunningNode = edge.source
    if type(edge) is not EventEdge:
        return source, FIRE
    timeout = source.events.get("timeout") if source.active_timer is not None else None
    by_timer = edge.ripening or (timeout is not None and edge in timeout.edges)
    return source, RING if by_timer else TELL


def taking(edge: AnyEdge) -> Action:
    """Return the action that would take the oldest token from this edge."""
    target: RunningNode = edge.target
    called = edge.target_kind == "slot" or (edge.target_kind == "parameter" and type(edge) is EventEdge)
    return target, CALL if called else FIRE


def full_edges(worker: RunningNode) -> list[EventEdge]:
    """Return the full queues that its events fill."""
    return [edge for edge in worker.event_edges() if edge.full]


def works(worker: RunningNode) -> bool:
    """Whether a firing or call is in progress that does not only wait for room."""
    if worker.concurrent is None:
        return worker.busy not in BETWEEN_FIRINGS and not worker.room.waiting  # an edit that holds it changes no wait
    unfinished = sum(not started.outcome for started in worker.concurrent)
    return unfinished + (worker.busy not in BETWEEN_FIRINGS) > worker.room.waiting


def works_on_firing(worker: RunningNode) -> bool:
    """The same, but for a slot call that excludes firings (F9)."""
    return works(worker) and (worker.concurrent is not None or worker.busy != "call")


def is_held(worker: RunningNode) -> bool:
    """Whether only a full queue holds it back: code that waits for room, a slot call, or its next firing.

    A rate that holds it too is to be over first.
    """
    if worker.codes_waiting_for_room():
        return True
    if not worker.blocked & FULL or worker.busy not in BETWEEN_FIRINGS:
        return False
    if worker.calls and worker.blocked < BACKOFF:
        return True
    if worker.blocked != FULL or worker.process is None or any(not edge.untaken for edge in worker.live_inputs):
        return False
    return not processing(worker) and not (worker.paced and must_wait(worker))
