"""A subgraph that iterates over collections (rule G4): what its border knows of the firing under way.

The nodes inside are workers of the same run as all others. What is special is the border alone: it lets the next
element in when nothing inside moves any more by itself, and keeps what comes out. Plain state, decided over by
`rules.iterating`. Stands on nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Generic

from hfg.engine.model.contracts import Node, NodeT

__all__ = ["Iteration", "amid_element"]


class Iteration(Generic[NodeT]):
    """The border of one subgraph that iterates.

    Attributes:
      worker: the subgraph, which outside is one node that fires.
      members: those directly inside, the readers too; what iterates among them stands for its own inside.
      feeds: by which elements go in, one for each input with an edge inside.
      readers: by which results come out, one for each output with an edge inside.
      count: how many elements the firing under way has; None while there is none.
      position: how many of them have been let in.
    """

    __slots__ = (
        "_columns",
        "_moving",
        "_repeated",
        "_results",
        "_timers",
        "count",
        "feeds",
        "members",
        "position",
        "readers",
        "worker",
    )

    def __init__(self, worker: NodeT) -> None:
        self.worker = worker
        self.members: list[NodeT] = []
        self.feeds: list[NodeT] = []
        self.readers: list[NodeT] = []
        self.count: int | None = None
        self.position = 0
        self._columns: dict[str, list[Any]] = {}
        self._repeated: dict[str, Any] = {}
        self._results: dict[str, list[Any]] = {}
        self._moving = 0  # who was found moving last
        self._timers = 0  # of operators inside

    # --- who is inside ---

    def join(self, worker: NodeT) -> None:
        """Somebody is inside from now on."""
        worker.lie_within(self)
        self.members.append(worker)

    def leave(self, worker: NodeT) -> None:
        """Somebody is not any more."""
        self.members.remove(worker)

    def is_moving(self) -> bool:
        """Whether something inside happens now or will by itself, so that it is not quiet there.

        Asked after every step inside, so who was found moving last is looked at first, and then those behind it: in
        most graphs the next to move is the next in order of adding.
        """
        if self._timers:
            return True
        members = self.members
        count = len(members)
        at = self._moving
        for _ in range(count):
            if at >= count:
                at = 0
            if members[at].moves_by_itself():
                self._moving = at
                return True
            at += 1
        return False

    def set_timer(self) -> None:
        """An operator on an edge inside waits for its time."""
        self._timers += 1

    def timer_over(self) -> None:
        """It does not any more."""
        self._timers -= 1

    # --- the firing under way ---

    @property
    def is_under_way(self) -> bool:
        """Whether the subgraph is amid a firing."""
        return self.count is not None

    def begin(self, arguments: Mapping[str, Any], over: Collection[str]) -> None:
        """A firing begins, with these values.

        Args:
          arguments: by input.
          over: the inputs whose elements go in one by one; the others repeat.

        Raises:
          ValueError: the collections are of unequal length.
        """
        columns = {name: list(value) for name, value in arguments.items() if name in over}
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f'"{name}" has {length}' for name, length in lengths.items())
            raise ValueError(f"it iterates over inputs of unequal length: {shown} elements")
        self._columns = columns
        self._repeated = {name: value for name, value in arguments.items() if name not in columns}
        self._results = {name: [] for name in self.worker.type.outputs}
        self.position = 0
        self.count = next(iter(lengths.values()), 0)

    def next_element(self) -> bool:
        """Whether there is one more, which `value` gives from now on."""
        if self.position == self.count:
            return False
        self.position += 1
        return True

    def value(self, name: str) -> object:
        """What an input is of the present element."""
        column = self._columns.get(name)
        return self._repeated[name] if column is None else column[self.position - 1]

    def keep(self, name: str, value: object) -> None:
        """Something has come out; what comes between two firings is nobody's result."""
        if self.is_under_way:
            self._results[name].append(value)

    def end(self) -> dict[str, list[Any]]:
        """The firing is over: gives what came out, by output."""
        results = self._results
        self.count = None
        self._columns, self._repeated, self._results = {}, {}, {}
        return results


def amid_element(worker: Node) -> str:
    """Say which element a node inside of what iterates works on, as the end of a phrase; nothing for others."""
    said = ""
    around = worker.within
    while around is not None:
        if around.is_under_way:
            said += f', {"on" if not said else "in"} element {around.position} of "{around.worker.path}"'
        around = around.worker.within
    return said
