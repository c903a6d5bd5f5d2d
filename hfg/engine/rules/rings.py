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
from typing import Any, Final

from hfg.engine.model import Core
from hfg.engine.model.running_node import (
    BACKOFF,
    BETWEEN_FIRINGS,
    ENDED,
    FULL,
    RATE,
    RunningNode,
)
from hfg.engine.rules.agenda import freed
from hfg.engine.rules.waits import (
    CALL,
    ELSEWHERE,
    FIRE,
    NEVER,
    RING,
    ROOM,
    TELL,
    Action,
    Wait,
    full_edges,
    is_held,
    taking,
    wait_for,
    works,
    works_on_firing,
)
from hfg.errors import QueueLimit, RunError
from hfg.graph.flat.order import strongly_connected
from hfg.ports.edges import EventEdge
from hfg.trace import QueueGrown

_LOGGER = logging.getLogger("hfg.engine")

__all__ = ["grow_queue", "look_at_all", "resolve", "smallest_at_rest"]


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
        self._waits: dict[Action, Wait] = {}
        self._may: dict[Action, RunningNode | None] = {}  # what may happen by itself: whose code or timer that is
        self._opened: dict[Action, Action | None] = {}  # what may happen, and by which other action that was found

    # --- rings ------------------------------------------------------------------------------------------------------

    def smallest_of_rings(self, held: Iterable[RunningNode]) -> list[EventEdge]:
        """Return for each ring its full queue with the smallest capacity; a ring that waits for another comes later."""
        self._follow([(worker, ROOM) for worker in held])
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
            if what == ROOM and worker is not None and is_held(worker)
            for edge in full_edges(worker)
            if taking(edge) in ring
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
            if isinstance(wait, Wait):
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
            if (worker, ROOM) not in self._opened:
                worker.room.notify_watchers()
        return again

    def _reasons(self, held: RunningNode) -> Iterator[Action]:
        """Return what may happen by itself, and who else is held back and has reasons of its own."""
        begin: Action = (held, ROOM)
        if begin not in self._opened:
            yield begin
            return
        waiting, seen = [begin], {begin}
        while waiting:
            action = waiting.pop()
            if action in self._may or (action[1] == ROOM and action != begin):
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

    def _look(self, action: Action) -> Wait | RunningNode | None:
        """Return what an action waits for, or the node that may do it by itself; None if no one reports its end."""
        worker, what = action
        if worker is None:
            return self._elsewhere()
        if what == RING:
            return None
        if what == ROOM:
            full = full_edges(worker)
            return Wait([taking(edge) for edge in full]) if full else worker
        if worker.region is not None:
            worker.region.disarm()  # while it is armed, only its head says that a token is not processed
        if worker.node is None and worker.scope is None and not (worker is self._core.boundary and what == CALL):
            return self._at_border(worker)
        return wait_for(worker, what)

    def _at_border(self, worker: RunningNode) -> Wait | RunningNode:
        """Nodes that stand for the graph's own ports, for other parts of it, or for the border of an iteration."""
        core = self._core
        if worker in core.outlets or worker in core.inlets:
            return Wait([ELSEWHERE]) if self._at_rest else worker
        if not worker.port_name or worker.blocked & ENDED:
            return NEVER  # `start` has been triggered, and subscribers do not count
        return worker

    def _elsewhere(self) -> Wait:
        """The other parts wait as well: for nodes that send to them, or take from them."""
        core = self._core
        sources = [edge.source for outlet in core.outlets for edge in outlet.in_edges]
        told = [(source, what) for source in sources for what in (FIRE, TELL)]
        return Wait([*told, *(taking(edge) for inlet in core.inlets for edge in inlet.all_out_edges())])


# --- what each action waits for ---------------------------------------------------------------------------------------


# --- of one node ------------------------------------------------------------------------------------------------------


def _size(edge: EventEdge) -> tuple[int, float]:
    return edge.capacity, edge.index


def _goes_on(worker: RunningNode, what: str) -> bool:
    """Whether its code, or the timer of a rate that is the only delay, is in progress; both report their end."""
    if worker.execution.in_flight or (what == FIRE and worker.blocked & RATE):
        return True
    return worker.concurrent is not None and worker.concurrent.working > 0


# --- a short way: chains of full queues that end where something goes on ----------------------------------------------


def _plainly_goes_on(held: RunningNode, known: dict[RunningNode, bool]) -> bool:
    """Whether from full queue to full queue we come to a node that takes next, or is busy; `known`: what was found."""
    chain: dict[RunningNode, None] = {}
    worker = held
    while worker not in known:
        chain[worker] = None
        full = full_edges(worker)
        target, what = taking(full[0])
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
    return works(worker) if what == CALL else works_on_firing(worker)


def _has_only_to_have_room(worker: RunningNode, what: str) -> bool:
    if worker.busy not in BETWEEN_FIRINGS or not worker.room.full_edges or worker.paced:
        return False
    if what == CALL:
        return worker.blocked < BACKOFF
    return worker.blocked == FULL and not (worker.inputs.missing or worker.outputs.missing)
