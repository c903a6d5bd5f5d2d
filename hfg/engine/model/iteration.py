"""The border of a subgraph that iterates over collections (rule G4), and the firing that it has in progress.

The nodes inside are nodes of the same run as all others. Only the border is special: it lets the next element in when
nothing inside moves any more, and collects the results. `rules.iterating` decides when.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic

from hfg.engine.model.contracts import NodeT

__all__ = ["Iteration", "amid_element"]


@dataclass(slots=True, eq=False)
class Iteration(Generic[NodeT]):
    """The border of one subgraph that iterates."""

    worker: NodeT  # the subgraph, which is one node for those outside
    members: list[NodeT] = field(default_factory=list)  # directly inside; an iterating one represents its own inside
    feeds: list[NodeT] = field(default_factory=list)  # elements go in here: one for each input with an edge inside
    readers: list[NodeT] = field(default_factory=list)  # results come out here: one for each such output
    count: int | None = None  # elements of the firing in progress; None: there is none
    position: int = 0  # how many of them have been let in
    _columns: dict[str, list[Any]] = field(default_factory=dict)
    _repeated: Mapping[str, Any] = field(default_factory=dict)
    _results: dict[str, list[Any]] = field(default_factory=dict)
    _moving: int = 0  # the member that was last found moving
    _timers: int = 0  # of operators inside

    # --- who is inside ---

    def join(self, worker: NodeT) -> None:
        """Add a member."""
        worker.be_within(self)
        self.members.append(worker)

    def leave(self, worker: NodeT) -> None:
        """Remove a member."""
        self.members.remove(worker)

    def is_moving(self) -> bool:
        """Return whether something inside happens now or will happen by itself, so that it is not quiet there.

        This is asked after every step inside. So the member that was last found moving comes first, and then those
        after it: in most graphs the next to move is the next in the order of adding.
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

    def count_timer(self, change: int) -> None:
        """One more operator on an edge inside waits for its time (1), or one fewer (-1)."""
        self._timers += change

    # --- the firing in progress ---

    @property
    def is_under_way(self) -> bool:
        """Whether the subgraph has a firing in progress."""
        return self.count is not None

    def begin(self, arguments: Mapping[str, Any], over: Collection[str]) -> None:
        """Start a firing.

        Args:
          arguments: values by input.
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
        self._repeated = arguments
        self._results = {name: [] for name in self.worker.type.outputs}
        self.position = 0
        self.count = next(iter(lengths.values()), 0)

    def next_element(self) -> bool:
        """Continue with the next element, if there is one. Return whether there is."""
        if self.position == self.count:
            return False
        self.position += 1
        return True

    def value(self, name: str) -> object:
        """Return the current element of an input, or the value that it repeats."""
        column = self._columns.get(name)
        return self._repeated[name] if column is None else column[self.position - 1]

    def keep(self, name: str, value: object) -> None:
        """Collect a result; a value that comes out between two firings belongs to none and is dropped."""
        if self.is_under_way:
            self._results[name].append(value)

    def end(self) -> dict[str, list[Any]]:
        """End the firing. Return the results by output."""
        results = self._results
        self.count = None
        self._columns, self._repeated, self._results = {}, {}, {}
        return results


def amid_element(worker: NodeT) -> str:
    """Return which element a node inside of a subgraph that iterates works on, as the end of a phrase; "" elsewhere."""
    said = ""
    around = worker.within
    while around is not None:
        if around.is_under_way:
            said += f', {"on" if not said else "in"} element {around.position} of "{around.worker.path}"'
        around = around.worker.within
    return said
