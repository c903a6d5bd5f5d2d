"""The static schedule of a region: who fires after whom in a wave, found by running rule R2 once without values.

At rest each member of a region fires exactly once a wave, silent or not, and over sequential edges R2 prescribes depth
first. So the order is known before any value is: *static scheduling of synchronous data flow* (Lee and Messerschmitt,
1987). Stands on `members`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.engine.fusion.members import may_be_called, may_be_inside
from hfg.engine.model.running_node import RunningNode
from hfg.ports.edges import BufferEdge, SyncEdge

__all__ = ["MOST_MEMBERS", "Schedule", "asks_who_hears", "schedule"]

MOST_MEMBERS = 64
"""Members of one region: Python compiles long functions slowly, and a wave is what the loop may have to wait for."""


class Schedule:
    """In which order the members of a region fire.

    Attributes:
      order: the members, the head first.
      position: of each member in `order`.
      outs: per member its live output edges in the order of their sending, each with the number of its output and the
        position of the member it leads to; None where it leaves the region.
      behind: per member who would stand in front of the run queue when its turn has come, the next one first.
      called: which members are slot calls, by their position; the others are firings.
      next_in_wave: those outside who would stand there when the last member has fired.
    """

    def __init__(
        self, order: list[RunningNode], behind: list[tuple[RunningNode, ...]], next_in_wave: tuple[RunningNode, ...]
    ) -> None:
        self.order = order
        self.position = {worker: number for number, worker in enumerate(order)}
        self.behind = behind
        self.called = frozenset(k for k, worker in enumerate(order) if worker.slot_edges)
        self.next_in_wave = next_in_wave
        self.outs: list[list[tuple[Any, int, int | None]]] = [
            [(edge, output, self._inside(edge, output)) for edge, output in _sending(worker)] for worker in order
        ]

    def local(self, edge: SyncEdge) -> str:
        """The local of a wave that holds what an edge between members carries."""
        source = self.position[edge.source]
        return f"v{source}_{next(output for one, output, _ in self.outs[source] if one is edge)}"

    def may_give_way(self) -> bool:
        """Whether no other member could fire while async code of one waits: then the wave may go on behind it."""
        return not any(
            worker.is_async and any(other in self.position for other in self.behind[k])
            for k, worker in enumerate(self.order)
        )

    def _inside(self, edge: SyncEdge | BufferEdge, output: int) -> int | None:
        """Where the edge leads to, if that is a member and the edge belongs to its waves."""
        return self.position.get(edge.target) if edge.depth_first and not asks_who_hears(edge.source, output) else None


def asks_who_hears(worker: RunningNode, output: int) -> bool:
    """Whether slots that listen only while they are active make each sending of the output another (T4)."""
    return bool(worker.listeners) and worker.listeners[output] is not None


def schedule(head: RunningNode) -> Schedule | None:
    """Find the members of the region that begins with the head, and their order; None if there is no such order."""
    inside = _closure(head)
    while inside:
        found = _simulate(head, inside)
        if len(found.order) == len(inside):
            return found
        inside = set(found.order)  # who was fed by one that has dropped out drops out as well
    return None


def _sending(worker: RunningNode) -> list[tuple[Any, int]]:
    """Its live edges with the number of their output, slots first (F9)."""
    edges = [(edge, output) for output, edges in enumerate(worker.out_edges) for edge in edges]
    return sorted(edges, key=lambda one: one[0].target_kind != "slot")


def _closure(head: RunningNode) -> set[RunningNode]:
    """The head and everybody whose inputs all come from here, at most `MOST_MEMBERS`."""
    inside, todo = {head}, [head]
    missing: dict[RunningNode, int] = {}
    while todo and len(inside) < MOST_MEMBERS:
        worker = todo.pop()
        for edge, output in reversed(_sending(worker)):
            target: RunningNode = edge.target
            if not edge.depth_first or target in inside or asks_who_hears(worker, output) or _is_inside_another(target):
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


def _is_inside_another(worker: RunningNode) -> bool:
    """Whether it belongs to a region that another leads."""
    return worker.region is not None and worker.region.head is not worker


def _simulate(head: RunningNode, inside: set[RunningNode]) -> Schedule:
    """Run R2 without values: a stack of those who are enabled, depth first.

    The region ends where somebody from outside would have to fire between two members: all that is enabled then is for
    the run queue.
    """
    left = _edges_left(inside)
    order: list[RunningNode] = []
    behind: list[tuple[RunningNode, ...]] = []
    reached: dict[RunningNode, bool] = {}  # those outside to whom something was sent: whether that was a call
    stack = [head]
    while stack:
        worker = stack.pop()
        if worker not in inside or _depends_on_values(worker, inside, reached):
            return Schedule(order, behind, (worker, *reversed(stack)))
        order.append(worker)
        behind.append(tuple(reversed(stack)))
        enabled: list[RunningNode] = []
        for edge, _ in _sending(worker):
            target: RunningNode = edge.target
            if not edge.depth_first:
                continue
            if edge.target_kind == "slot":
                enabled.append(target)
                continue
            left[target] -= 1
            if not left[target]:
                enabled.append(target)
        stack.extend(reversed(enabled))
    return Schedule(order, behind, ())


def _depends_on_values(worker: RunningNode, inside: set[RunningNode], reached: dict[RunningNode, bool]) -> bool:
    """Whether the place of somebody behind it does: a call by silence never comes, another token may."""
    for edge, _ in _sending(worker):
        if edge.depth_first and edge.target not in inside:
            calls = edge.target_kind == "slot"
            if reached.get(edge.target, False) or (calls and edge.target in reached):
                return True
            reached[edge.target] = calls or reached.get(edge.target, False)
    return False


def _edges_left(inside: Sequence[RunningNode] | set[RunningNode]) -> dict[RunningNode, int]:
    """How many edges lead from members to each target: the last token of them may enable it."""
    left: dict[RunningNode, int] = {}
    for worker in inside:
        for edge, _ in _sending(worker):
            if edge.depth_first and edge.target_kind != "slot":
                left[edge.target] = left.get(edge.target, 0) + 1
    return left
