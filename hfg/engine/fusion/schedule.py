"""The static schedule of a region: who fires after whom in a wave, found by running rule R2 once without values.

At rest, each member of a region fires exactly once per wave, silent or not, and over sequential edges R2 prescribes
depth first. So the order is known before any value is: *static scheduling of synchronous data flow* (Lee and
Messerschmitt, 1987). Depends on `members`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeAlias

from hfg.engine.fusion.members import is_alive, may_be_called, may_be_inside
from hfg.engine.model.running_node import RunningNode
from hfg.ports.edges import BufferEdge, SyncEdge

__all__ = ["MOST_MEMBERS", "Key", "Schedule", "Turn", "asks_who_hears", "is_only_called", "schedule", "takes_no_turns"]

MOST_MEMBERS = 64
"""Members of one region: Python compiles long functions slowly, and a wave is what the loop may have to wait for."""

Key: TypeAlias = tuple[int, int]
"""A sending: the position of the member that sends, and the number of the edge among those of the member."""

Turn: TypeAlias = tuple[RunningNode, "Key | None"]
"""Whose turn it is: a member's (None), or an outsider's, who has it if this sending has enabled it."""


class Schedule:
    """In which order the members of a region fire.

    Attributes:
      order: the members, the head first.
      position: of each member in `order`.
      outs: per member its live output edges in the order of their sending, each with the number of its output and the
        position of the member it leads to; None where it leaves the region.
      behind: per member who would stand in front of the run queue when its turn has come, the next one first.
      between: by position: the outsiders whose turns come right before that member's, if they are enabled.
      enables: per member the positions of those that its sending enables.
      called: which members are slot calls, by their position; the others are firings.
      calls: over which edges a value calls a member that is still to be enabled: which of both it does first depends
        on values, so the wave ends there; a marker is processed at once (T4).
      next_in_wave: the outsiders who would stand there when the last member has fired.
    """

    def __init__(
        self,
        order: list[RunningNode],
        behind: list[tuple[Turn, ...]],
        between: dict[int, list[Turn]],
        enables: list[list[RunningNode]],
        next_in_wave: tuple[Turn, ...],
    ) -> None:
        self.order = order
        self.position = {worker: number for number, worker in enumerate(order)}
        self.behind = behind
        self.between = between
        self.enables = [[self.position[one] for one in enabled if one in self.position] for enabled in enables]
        self.called = frozenset(k for k, worker in enumerate(order) if is_only_called(worker))
        self.next_in_wave = next_in_wave
        self.outs: list[list[tuple[Any, int, int | None]]] = [
            [(edge, output, self._inside(edge, output)) for edge, output in _sending(worker)] for worker in order
        ]

        self.calls = {
            (k, number)
            for k, out in enumerate(self.outs)
            for number, (edge, _, _) in enumerate(out)
            if self._odd(k, edge)
        }

    def _odd(self, k: int, edge: SyncEdge | BufferEdge) -> bool:
        """Whether an edge of member k calls a member that fires later, and is not enabled when k fires."""
        j = self.position.get(edge.target, -1)
        calls = edge.depth_first and edge.target_kind == "slot" and j not in self.called
        return calls and j > k and (edge.target, None) not in self.behind[k]

    def local(self, edge: SyncEdge) -> str:
        """The local of a wave that holds what an edge between members carries."""
        source = self.position[edge.source]
        return f"v{source}_{next(output for one, output, _ in self.outs[source] if one is edge)}"

    def fires_with_slots(self, k: int) -> bool:
        """Whether member k fires, and is called as well: then the order of both is to be kept (F9)."""
        return bool(self.order[k].slot_edges) and k not in self.called

    def may_give_way(self) -> bool:
        """Whether no other member could fire while async code of one waits: then the wave may continue after it."""
        return not any(
            worker.is_async and any(key is None for _, key in self.behind[k]) for k, worker in enumerate(self.order)
        )

    def _inside(self, edge: SyncEdge | BufferEdge, output: int) -> int | None:
        """Where the edge leads to, if that is a member and the edge belongs to its waves.

        A slot of a member that fires does not: its call has its turn like an outsider's.
        """
        if not edge.depth_first or asks_who_hears(edge.source, output):
            return None
        return (
            None if edge.target_kind == "slot" and not is_only_called(edge.target) else self.position.get(edge.target)
        )


def is_only_called(worker: RunningNode) -> bool:
    """Whether a member does not fire, but lives by a slot."""
    return bool(worker.slot_edges) and not worker.in_edges and not worker.is_source


def asks_who_hears(worker: RunningNode, output: int) -> bool:
    """Whether slots that listen only while they are active make each sending of the output another (T4)."""
    return bool(worker.listeners) and worker.listeners[output] is not None


def schedule(head: RunningNode) -> Schedule | None:
    """Find the members of the region that begins with the head, and their order; None if there is no such order."""
    inside = _closure(head)
    while inside:
        found = _simulate(head, inside, ends_outside=takes_no_turns(inside))
        if len(found.order) == len(inside):
            return found
        inside = set(found.order)  # who was fed by one that has dropped out drops out as well
    return None


def takes_no_turns(members: Collection[RunningNode]) -> bool:
    """Whether waves end where an outsider's turn comes: in a thread, and where async code may give way to others."""
    return any(worker.is_async or worker.group.threaded for worker in members)


def _sending(worker: RunningNode) -> list[tuple[Any, int]]:
    """Its live edges with the number of their output, slots first (F9)."""
    edges = [(edge, output) for output, edges in enumerate(worker.out_edges) for edge in edges]
    return sorted(edges, key=lambda one: one[0].target_kind != "slot")


def _closure(head: RunningNode) -> set[RunningNode]:
    """Return the head and all nodes whose inputs all come from the region, at most `MOST_MEMBERS`.

    Async members and those that are alive do not go together: it is the async ones that stay outside.
    """
    inside = _found(head, lambda worker: True)
    if any(worker.is_async for worker in inside) and any(map(_fires_alive, inside)):
        inside = _found(head, lambda worker: not (_fires_alive(worker) if head.is_async else worker.is_async))
    return inside


def _fires_alive(worker: RunningNode) -> bool:
    """Whether it is alive, and not only called; a source, which has no inputs, may announce its firings as well."""
    return is_alive(worker) and bool(worker.in_edges or worker.is_source)


def _found(head: RunningNode, fits: Callable[[RunningNode], bool]) -> set[RunningNode]:
    inside, todo = {head}, [head]
    missing: dict[RunningNode, int] = {}
    while todo and len(inside) < MOST_MEMBERS:
        worker = todo.pop()
        for edge, output in reversed(_sending(worker)):
            target: RunningNode = edge.target
            if not edge.depth_first or target in inside or asks_who_hears(worker, output) or not fits(target):
                continue
            if _is_inside_another(target, inside):
                continue
            if edge.target_kind == "slot":
                fed = may_be_called(target)
            elif target in missing or may_be_inside(target):
                missing[target] = missing.get(target, len(target.live_inputs)) - 1
                fed = not missing[target]
            else:
                continue
            if fed and len(inside) < MOST_MEMBERS:
                inside.add(target)
                if edge.target_kind != "slot":  # from which nothing is sent over outputs
                    todo.append(target)
    return inside


def _is_inside_another(worker: RunningNode, inside: set[RunningNode]) -> bool:
    """Whether it belongs to a region whose head is not taken in, or whose wave is in progress."""
    region = worker.region
    return region is not None and (region.running or not (region.head is worker or region.head in inside))


def _simulate(head: RunningNode, inside: set[RunningNode], *, ends_outside: bool) -> Schedule:
    """Run R2 without values: a stack of those who are enabled, depth first.

    Where an outsider may have its turn between two members, the wave looks whether it has, and gives it; or, with
    `ends_outside`, the region ends there: all that is enabled then is for the run queue.
    """
    left = _edges_left(inside)
    order: list[RunningNode] = []
    behind: list[tuple[Turn, ...]] = []
    between: dict[int, list[Turn]] = {}
    enables: list[list[RunningNode]] = []
    reached: dict[RunningNode, bool] = {}  # those outside to whom something was sent: whether that was a call
    stack: list[Turn] = [(head, None)]
    while stack:
        turn = stack.pop()
        worker, key = turn
        if ends_outside and (key is not None or _depends_on_values(worker, inside, reached)):
            return Schedule(order, behind, {}, enables, (turn, *reversed(stack)))
        if key is not None:
            between.setdefault(len(order), []).append(turn)
            continue
        order.append(worker)
        behind.append(tuple(reversed(stack)))
        enabled = [one for one in _enabled_by(worker, len(order) - 1, inside, left) if not _waits(one, inside, order)]
        enables.append([one for one, key in enabled if key is None])
        stack.extend(reversed(enabled))
    return Schedule(order, behind, between, enables, tuple(between.pop(len(order), ())))


def _waits(turn: Turn, inside: Collection[RunningNode], order: Sequence[RunningNode]) -> bool:
    """Whether a call of a member that is still to fire waits until it has, or is a side exit; see `Schedule.calls`."""
    worker, key = turn
    return key is not None and worker in inside and worker not in order


def _enabled_by(worker: RunningNode, k: int, inside: set[RunningNode], left: Counter[RunningNode]) -> list[Turn]:
    """Return the nodes that a sending of member k enables, in the order of its edges; outsiders only perhaps."""
    enabled: list[Turn] = []
    for number, (edge, _) in enumerate(_sending(worker)):
        target: RunningNode = edge.target
        if not edge.depth_first:
            continue
        slot = edge.target_kind == "slot"
        left[target] -= not slot
        if slot or not left[target]:  # of a join the last token
            inner = target in inside and (not slot or is_only_called(target))
            enabled.append((target, None if inner else (k, number)))
    return enabled


def _depends_on_values(worker: RunningNode, inside: set[RunningNode], reached: dict[RunningNode, bool]) -> bool:
    """Whether the place of a later node depends on it: silence never calls a slot, another token may."""
    for edge, _ in _sending(worker):
        if edge.depth_first and edge.target not in inside:
            calls = edge.target_kind == "slot"
            if reached.get(edge.target, False) or (calls and edge.target in reached):
                return True
            reached[edge.target] = calls or reached.get(edge.target, False)
    return False


def _edges_left(inside: Collection[RunningNode]) -> Counter[RunningNode]:
    """How many edges lead from members to each target: the last token of them may enable it."""
    edges = [edge for worker in inside for edge, _ in _sending(worker) if edge.depth_first]
    return Counter(edge.target for edge in edges if edge.target_kind != "slot")
