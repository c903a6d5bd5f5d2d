"""When nodes were active in a run, and by which edges activity moves. Depends on the trace."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator
from typing import Any, Final

from hfg.studio.records import EdgeRecord

__all__ = ["Spans", "Ways", "around", "node_of"]

_KEPT: Final = 2000


class Spans:
    """The times for which nodes were active, the newest ones.

    Attributes:
      active: the nodes that are active, with the time of their activation.
    """

    def __init__(self) -> None:
        self.active: dict[str, float] = {}
        self._over: deque[list[Any]] = deque(maxlen=_KEPT)

    def begin(self, active: Iterable[str], at: float) -> None:
        """A run has begun, or is seen for the first time."""
        self.active = dict.fromkeys(active, at)
        self._over.clear()

    def end(self, at: float) -> None:
        """The run is over."""
        for node in list(self.active):
            self.change(node, at, active=False)

    def change(self, node: str, at: float, *, active: bool) -> None:
        """The activity of a node has changed."""
        if active:
            self.active[node] = at
        else:
            began = self.active.pop(node, None)
            if began is not None:
                self._over.append([node, began, at])

    def rows(self) -> list[list[Any]]:
        """Return node, begin and end of each span, in seconds since the run began; None is the end of an open span."""
        return [*self._over, *([node, began, None] for node, began in self.active.items())]


class Ways:
    """The active edges of a graph, by the node or subgraph to which they lead."""

    def __init__(self, edges: dict[str, EdgeRecord]) -> None:
        self._into: dict[str, list[tuple[str, str]]] = {}
        for key, edge in edges.items():
            if edge.active:
                self._into.setdefault(node_of(edge.target), []).append((key, node_of(edge.source)))

    def to(self, node: str, near: Collection[str]) -> list[str]:
        """Return the edges by which activity may have come to a node, also those into subgraphs around it.

        Args:
          node: the path of the node that became active.
          near: paths of nodes that are active or just were.
        """
        others = [one for one in near if one != node]
        from_here = {outer for one in others for outer in (one, *around(one))}
        found = []
        for target in (node, *around(node)):
            inside = f"{target}/"
            if target != node and any(one.startswith(inside) for one in others):
                break  # it has moved inside this subgraph
            boxes = set(around(node))
            found += [key for key, source in self._into.get(target, ()) if source in from_here or source in boxes]
        return found


def around(path: str) -> Iterator[str]:
    """Yield the paths of the subgraphs around a node, the innermost first."""
    while "/" in path:
        path = path.rpartition("/")[0]
        yield path


def node_of(port: str) -> str:
    """Return the path of the node that a port belongs to."""
    boxes, slash, last = port.rpartition("/")
    return f"{boxes}{slash}{last.partition('.')[0]}"
