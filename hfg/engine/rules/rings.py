"""Rings of nodes that wait for each other and that only full queues close: artificial deadlocks (rule F8).

A node that stands still waits for what others do. From a node that a full queue holds back we follow these waits. What
is left when all that may still happen is taken away is stuck permanently, whatever else runs. A ring of it that leads
through a full queue ends by one more place in that queue. This is the local deadlock of Geilen and Basten (2003),
found as a greatest fixed point.

A walk begins at nodes that a full queue has just come to hold back, or whose last walk ended at code or a timer that is
over now (`Core.suspects`). After an edit, and when a node can fire no more or again (`Core.waits_changed`), it begins
at all nodes that are held back. So a graph without full queues pays nothing, and of many nodes that are held back only
those are checked again for which something has changed. Depends on `agenda`.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any, Final, TypeAlias

from hfg.engine.model import Core
from hfg.engine.model.running_node import (
    AT_CONCURRENCY,
    BACKOFF,
    BETWEEN_FIRINGS,
    ENDED,
    FIRES_NO_MORE,
    FULL,
    RATE,
    RunningNode,
)
from hfg.engine.rules.agenda import freed, must_wait
from hfg.errors import QueueLimit, RunError
from hfg.graph.flat.order import strongly_connected
from hfg.ports.edges import AnyEdge, EventEdge
from hfg.trace import QueueGrown

_LOGGER = logging.getLogger("hfg.engine")

__all__ = ["grow_queue", "is_held", "look_at_all", "resolve", "smallest_at_rest"]

Action: TypeAlias = "tuple[RunningNode | None, str]"
"""What somebody waits for: that a worker does something. None stands for the other parts of a graph that is cut."""

_FIRE: Final = "fire"  # begins its next firing
_CALL: Final = "call"  # begins its next slot call
_TELL: Final = "tell"  # triggers an event
_RING: Final = "ring"  # the same, by a timer
_FINISH: Final = "finish"  # ends the firing or call in progress, and with it what follows (F5)
_ROOM: Final = "room"  # has room in each queue that its events fill
_HEAR: Final = "hear"  # gets a token for one of its slots

_ELSEWHERE: Final[Action] = (None, "elsewhere")


class _Wait:
    """Why an action does not happen now.

    Attributes:
      on: what it waits for.
      any_of: one of these suffices to let it happen; else all of them must, and none at all means: never.
    """

    __slots__ = ("any_of", "on")

    def __init__(self, on: list[Action], *, any_of: bool = False) -> None:
        self.on = on
        self.any_of = any_of


_NEVER = _Wait([], any_of=True)


def resolve(core: Core) -> bool:
    """Let each ring that has closed grow, as long as there are any; whether there were."""
    grew = False
    again: list[RunningNode] = []  # they are not told when the reason that keeps them out of rings changes
    while not core.over and (suspects := _take_suspects(core)):
        known: dict[RunningNode, bool] = {}
        again += [worker for worker in suspects if _plainly_goes_on(worker, known)]
        suspects = [worker for worker in suspects if not known[worker]]
        walk = _Walk(core)
        found = walk.smallest_of_rings(suspects)
        again += walk.watch(suspects)
        for edge in found:
            grow_queue(core, edge)
        if found:
            grew = True
            core.suspects.update(dict.fromkeys(again))
            again = []
    core.suspects.update(dict.fromkeys(again))
    return grew


def _take_suspects(core: Core) -> list[RunningNode]:
    """Return all that may have come to be in a ring; each is looked at once."""
    if not core.full_edges:
        suspects: Iterable[RunningNode] = ()
    else:
        suspects = core.workers if core.all_suspect else list(core.suspects)
    core.all_suspect = False
    core.suspects.clear()
    return [worker for worker in suspects if worker.room.full_edges]


def look_at_all(core: Core) -> None:
    """Nothing moves any more: all that full queues hold back are suspects."""
    if core.full_edges:
        core.waits_changed()
        for worker in core.workers:
            if worker.room.full_edges:
                is_held(worker)  # and if a rate does so too, its timer is set


def smallest_at_rest(core: Core) -> EventEdge | None:
    """F8, L1: where no part of a cut graph moves, the queue that is to grow here, if one closes a ring.

    The ring may lead through other parts, of which we know only that they wait as well.
    """
    held = [worker for worker in core.workers if worker.room.full_edges]
    found = _Walk(core, at_rest=True).smallest_of_rings(held) if held else []
    return min(found, key=_size, default=None)


def grow_queue(core: Core, edge: EventEdge) -> None:
    """F8: this queue gets one more place, or the run fails because it may not grow."""
    if edge.capacity_limit is not None and edge.capacity >= edge.capacity_limit:
        core.runtime.finish(
            "failed",
            QueueLimit(
                f'queue of "{edge.label}" holds {len(edge.queue)} signals, the nodes around it wait for each other, '
                f"and its capacity_limit = {edge.capacity_limit} forbids it to grow: raise the limit or let the "
                f"consumer take more than it is sent"
            ),
        )
        return
    edge.grow()
    declared = edge.capacity - edge.grown
    if edge.capacity == max(_OVERGROWN * declared, _SMALL) + 1:
        _report_overgrown(core, edge, declared)
    if core.trace_changes is not None:
        core.trace_changes(QueueGrown(core.now(), edge.label, edge.capacity))
    freed(edge)
    core.runtime.kick()


_OVERGROWN: Final = 8
"""A queue with so many times the declared capacity is reported, because its ring may grow for ever."""
_SMALL: Final = 64  # signals that no queue is reported for


def _report_overgrown(core: Core, edge: EventEdge, declared: int) -> None:
    """Log and report a queue that may grow forever; once for all queues of a ring."""
    ring = _ring_of(core, edge)
    is_reported = any(one.source in ring and one.target in ring for one in core.overgrown)
    core.overgrown.append(edge)
    if is_reported:
        return
    nodes = " -> ".join(worker.path for worker in ring)
    around = f"the nodes of the ring {nodes}" if ring else "nodes of several processes"
    what = (
        f'the queue of "{edge.label}" has grown from capacity={declared} to {edge.capacity}, because {around} wait for '
        f"each other (rule F8): declare capacity={2 * edge.capacity} if so many signals may be in transit at once; if "
        "it keeps growing, the ring is sent more than it takes: let one of its edges drop signals, or set "
        "capacity_limit="
    )
    _LOGGER.warning("%s", what)
    core.errors.append(RunError(what))


def _ring_of(core: Core, edge: EventEdge) -> list[RunningNode]:
    """Return the shortest way from the target of an edge back to it, with the source of the edge at both ends."""
    leads_to: dict[RunningNode, list[RunningNode]] = {}
    for one in core.edges:
        if one.source is not None and one.target is not None:
            leads_to.setdefault(one.source, []).append(one.target)
    came_from: dict[RunningNode, RunningNode] = {edge.target: edge.source}
    ahead = deque([edge.target])
    while ahead and edge.source not in came_from:
        worker = ahead.popleft()
        for after in leads_to.get(worker, ()):
            if after not in came_from:
                came_from[after] = worker
                ahead.append(after)
    if edge.source not in came_from:
        return []  # it leads through other processes
    ring = [edge.source]
    while len(ring) == 1 or ring[-1] is not edge.source:
        ring.append(came_from[ring[-1]])
    return ring[::-1]


class _Walk:
    """The waits, followed from some nodes that full queues hold back."""

    def __init__(self, core: Core, *, at_rest: bool = False) -> None:
        self._core = core
        self._at_rest = at_rest
        self._waits: dict[Action, _Wait] = {}
        self._may: dict[Action, RunningNode | None] = {}  # what may happen by itself: whose code or timer that is
        self._opened: dict[Action, Action | None] = {}  # what may happen, and by which other action that was found

    # --- rings ------------------------------------------------------------------------------------------------------

    def smallest_of_rings(self, held: Iterable[RunningNode]) -> list[EventEdge]:
        """Return for each ring its full queue with the smallest capacity; a ring that waits for another comes later."""
        self._follow([(worker, _ROOM) for worker in held])
        self._open()
        stuck = [action for action in self._waits if action not in self._opened]
        numbers = {action: number for number, action in enumerate(stuck)}
        leads_to = [[numbers[other] for other in self._waits[action].on if other in numbers] for action in stuck]
        part_of: dict[int, int] = {}
        before: set[int] = set()  # parts that are a ring, or wait for one
        found: list[EventEdge] = []
        for name, part in enumerate(strongly_connected(leads_to)):  # after those that they lead to
            part_of.update(dict.fromkeys(part, name))
            if any(part_of[other] in before for number in part for other in leads_to[number]):
                before.add(name)
                continue
            smallest = self._smallest_in({stuck[number] for number in part})
            if smallest is not None:
                before.add(name)
                found.append(smallest)
        return found

    def _smallest_in(self, ring: set[Action]) -> EventEdge | None:
        full = [
            edge
            for worker, what in ring
            if what == _ROOM and worker is not None and is_held(worker)
            for edge in _full_edges(worker)
            if _taking(edge) in ring
        ]
        return min(full, key=_size, default=None)

    # --- what may happen, and so is stuck in no ring ----------------------------------------------------------------

    def _follow(self, begin: Iterable[Action]) -> None:
        waiting = list(begin)
        while waiting:
            action = waiting.pop()
            if action in self._waits or action in self._may:
                continue
            wait = self._look(action)
            if isinstance(wait, _Wait):
                self._waits[action] = wait
                waiting += wait.on
            else:
                self._may[action] = wait

    def _open(self) -> None:
        """Take away the actions that may happen, and those that only wait for them."""
        asked_by: dict[Action, list[Action]] = {}
        missing: dict[Action, int] = {}
        for action, wait in self._waits.items():
            missing[action] = 1 if wait.any_of else len(wait.on)
            for other in wait.on:
                asked_by.setdefault(other, []).append(action)
        self._opened.update(dict.fromkeys(self._may))
        waiting = deque(self._may)
        while waiting:
            action = waiting.popleft()
            for other in asked_by.get(action, ()):
                missing[other] -= 1
                if missing[other] == 0:
                    self._opened[other] = action
                    waiting.append(other)

    def watch(self, held: Iterable[RunningNode]) -> list[RunningNode]:
        """Have these checked again when the reason that keeps them out of rings changes.

        Return those that no one tells.
        """
        again = []
        for worker in held:
            if not all([self._will_tell(reason, worker) for reason in self._reasons(worker)]):  # noqa: C419 - each
                again.append(worker)
            if (worker, _ROOM) not in self._opened:
                worker.room.notify_watchers()
        return again

    def _reasons(self, held: RunningNode) -> Iterator[Action]:
        """Return what may happen by itself, and who else is held back and has reasons of its own."""
        begin: Action = (held, _ROOM)
        if begin not in self._opened:
            yield begin
            return
        waiting, seen = [begin], {begin}
        while waiting:
            action = waiting.pop()
            if action in self._may or (action[1] == _ROOM and action != begin):
                yield action
                continue
            wait, by = self._waits[action], self._opened[action]
            for other in [by] if wait.any_of and by is not None else wait.on:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)

    def _will_tell(self, reason: Action, held: RunningNode) -> bool:
        """Whether the held one is looked at again when that has changed."""
        leaf = reason[0] if reason in self._waits else self._may[reason]
        if leaf is None or (leaf is held and reason in self._waits):
            return False
        if reason not in self._waits and not _goes_on(leaf, reason[1]):
            region: Any = leaf.region
            if region is None or not region.head.execution.in_flight:
                return False
            leaf = region.head  # whose wave is in a thread, or gives way
        leaf.room.be_watched_by(held)
        return True

    # --- what each action waits for ---------------------------------------------------------------------------------

    def _look(self, action: Action) -> _Wait | RunningNode | None:
        """Return what an action waits for, or the node that may do it by itself; None if no one reports its end."""
        worker, what = action
        if worker is None:
            return self._elsewhere()
        if what == _RING:
            return None
        if what == _ROOM:
            full = _full_edges(worker)
            return _Wait([_taking(edge) for edge in full]) if full else worker
        if worker.region is not None:
            worker.region.disarm()  # while it is armed, only its head says that a token is not processed
        if worker.node is None and worker.scope is None and not (worker is self._core.boundary and what == _CALL):
            return self._at_border(worker)
        if what == _FIRE:
            return _fire(worker)
        if what == _CALL:
            return _call(worker)
        if what == _TELL:
            return _tell(worker)
        return _finish(worker) if what == _FINISH else _hear(worker)

    def _at_border(self, worker: RunningNode) -> _Wait | RunningNode:
        """Nodes that stand for the graph's own ports, for other parts of it, or for the border of an iteration."""
        core = self._core
        if worker in core.outlets or worker in core.inlets:
            return _Wait([_ELSEWHERE]) if self._at_rest else worker
        if not worker.port_name or worker.blocked & ENDED:
            return _NEVER  # `start` has been triggered, and subscribers do not count
        return worker

    def _elsewhere(self) -> _Wait:
        """The other parts wait as well: for nodes that send to them, or take from them."""
        core = self._core
        sources = [edge.source for outlet in core.outlets for edge in outlet.in_edges]
        told = [(source, what) for source in sources for what in (_FIRE, _TELL)]
        return _Wait([*told, *(_taking(edge) for inlet in core.inlets for edge in inlet.all_out_edges())])


# --- what each action waits for ---------------------------------------------------------------------------------------


def _fire(worker: RunningNode) -> _Wait | RunningNode:
    """F1: all that its next firing waits for."""
    blocked = worker.blocked
    if _works_on_firing(worker) or blocked & BACKOFF:
        return worker
    on = _processing(worker)
    if blocked & FIRES_NO_MORE or worker.process is None:
        return _Wait(on) if worker.pending_end and on else _NEVER
    on += [_sending(edge) for edge in worker.live_inputs if not edge.untaken]
    if blocked & FULL and _counts(worker, on):
        on.append((worker, _ROOM))
    return _Wait(on) if on else worker


def _counts(worker: RunningNode, waits_for: list[Action]) -> bool:
    """Whether only F8 holds its next firing: not also a rate, a gate, `ready()` or a call."""
    if worker.room.waiting:
        return True
    if worker.blocked & ~(FULL | AT_CONCURRENCY) or worker.busy not in BETWEEN_FIRINGS:
        return False
    return bool(waits_for) or not (worker.paced and must_wait(worker))


def _call(worker: RunningNode) -> _Wait | RunningNode:
    """F9: all that its next slot call waits for."""
    if worker.blocked >= BACKOFF or _works(worker):
        return worker
    on: list[Action] = [(worker, _ROOM)] if worker.blocked & FULL else []
    if not worker.calls:
        on.append((worker, _HEAR))
    return _Wait(on) if on else worker


def _hear(worker: RunningNode) -> _Wait:
    """A token at one of its slots: any will do."""
    return _Wait([_sending(edge) for edge in worker.called_by() if edge.live], any_of=True)


def _tell(worker: RunningNode) -> _Wait | None:
    """A signal of its own: by whatever code of it runs next."""
    if worker.tasks is not None and worker.tasks.move:
        return None
    on: list[Action] = [(worker, _CALL)]
    if worker.scope is None:
        on.append((worker, _FIRE))
    else:
        on += [(inside, _TELL) for inside in worker.scope.inside()]
    if worker.codes_waiting_for_room():
        on.append((worker, _ROOM))
    return _Wait(on, any_of=True)


def _finish(worker: RunningNode) -> _Wait | RunningNode:
    """F5, F6: that all is processed of the firing or call that has taken a token."""
    if _works(worker):
        return worker
    on = _processing(worker)
    if worker.room.waiting:
        on.append((worker, _ROOM))
    return _Wait(on) if on else worker


def _processing(worker: RunningNode) -> list[Action]:
    """F5: what its outputs wait for."""
    edges = [edge for edges in worker.out_edges for edge in edges if edge.unprocessed]
    return [_taking(edge) if edge.untaken else (edge.target, _FINISH) for edge in edges]


def _sending(edge: AnyEdge) -> Action:
    """Return the action that would put a token on this edge."""
    source: RunningNode = edge.source
    if type(edge) is not EventEdge:
        return source, _FIRE
    timeout = source.events.get("timeout") if source.active_timer is not None else None
    by_timer = edge.ripening or (timeout is not None and edge in timeout.edges)
    return source, _RING if by_timer else _TELL


def _taking(edge: AnyEdge) -> Action:
    """Return the action that would take the oldest token from this edge."""
    target: RunningNode = edge.target
    called = edge.target_kind == "slot" or (edge.target_kind == "parameter" and type(edge) is EventEdge)
    return target, _CALL if called else _FIRE


# --- of one node ------------------------------------------------------------------------------------------------------


def _size(edge: EventEdge) -> tuple[int, float]:
    return edge.capacity, edge.index


def _full_edges(worker: RunningNode) -> list[EventEdge]:
    return [edge for edge in worker.event_edges() if edge.full]


def _works(worker: RunningNode) -> bool:
    """Whether a firing or call is in progress that does not only wait for room."""
    if worker.concurrent is None:
        return worker.busy not in BETWEEN_FIRINGS and not worker.room.waiting  # an edit that holds it changes no wait
    unfinished = sum(not started.outcome for started in worker.concurrent)
    return unfinished + (worker.busy not in BETWEEN_FIRINGS) > worker.room.waiting


def _works_on_firing(worker: RunningNode) -> bool:
    """The same, but for a slot call that excludes firings (F9)."""
    return _works(worker) and (worker.concurrent is not None or worker.busy != "call")


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
    return not _processing(worker) and not (worker.paced and must_wait(worker))


def _goes_on(worker: RunningNode, what: str) -> bool:
    """Whether its code, or the timer of a rate that is the only delay, is in progress; both report their end."""
    if worker.execution.in_flight or (what == _FIRE and worker.blocked & RATE):
        return True
    return worker.concurrent is not None and worker.concurrent.working > 0


# --- a short way: chains of full queues that end where something goes on ----------------------------------------------


def _plainly_goes_on(held: RunningNode, known: dict[RunningNode, bool]) -> bool:
    """Whether from full queue to full queue we come to a node that takes next, or is busy; `known`: what was found."""
    chain: dict[RunningNode, None] = {}
    worker = held
    while worker not in known:
        chain[worker] = None
        full = _full_edges(worker)
        target, what = _taking(full[0])
        if len(full) > 1 or target is None or target in chain:
            known[worker] = False
        elif _takes_next(target, what):
            known[worker] = True
        elif not _has_only_to_have_room(target, what):
            known[worker] = False
        else:
            worker = target
    known.update(dict.fromkeys(chain, known[worker]))
    return known[held]


def _takes_next(worker: RunningNode, what: str) -> bool:
    if worker.queued and not worker.group.threaded:
        return True
    return _works(worker) if what == _CALL else _works_on_firing(worker)


def _has_only_to_have_room(worker: RunningNode, what: str) -> bool:
    if worker.busy not in BETWEEN_FIRINGS or not worker.room.full_edges or worker.paced:
        return False
    if what == _CALL:
        return worker.blocked < BACKOFF
    return worker.blocked == FULL and not (worker.inputs.missing or worker.outputs.missing)
