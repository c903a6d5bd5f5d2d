"""The edits of a graph that can be undone, and those that can be redone.

Two stacks of objects that only the code that edits interprets. Does not depend on graphs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Generic, TypeVar

from hfg.errors import UsageError

MOST_STEPS: Final = 1000
"""How many edits can be taken back; what was done before them is final. Each keeps 0.3 to 2 kB."""

Step = TypeVar("Step")


class History(Generic[Step]):
    """The edits of one graph.

    Attributes:
      done: the last edit last.
      undone: the one to be redone first last.
    """

    __slots__ = ("_by_hand", "_title", "done", "undone")

    def __init__(self, title: Callable[[], str]) -> None:
        """Begin without edits; `title` gives what messages call the graph."""
        self._title = title
        self.done: list[Step] = []
        self.undone: list[Step] = []
        self._by_hand = False  # a change by hand has made final what was edited before it

    def note(self, step: Step) -> None:
        """An edit was carried out."""
        self.done.append(step)
        del self.done[:-MOST_STEPS]
        self.undone.clear()
        self._by_hand = False

    def join_last(self, join: Callable[[Step, Step], Step]) -> None:
        """Make one step of the last two: what one gesture did is taken back at once."""
        assert len(self.done) > 1
        last = self.done.pop()
        self.done[-1] = join(self.done[-1], last)

    def changed_by_hand(self) -> None:
        """The graph was changed otherwise: taking back what was edited before would not lead back to where it was."""
        if self.done or self.undone:
            self._by_hand = True
            self.done.clear()
            self.undone.clear()

    def next_undo(self) -> Step:
        """Return what would be undone.

        Raises:
          UsageError: there is nothing.
        """
        return self._last(self.done, "undo", "nothing was edited by commands yet")

    def next_redo(self) -> Step:
        """Return what would be redone.

        Raises:
          UsageError: there is nothing.
        """
        return self._last(self.undone, "redo", "nothing was undone since the last edit")

    def _last(self, listed: list[Step], what: str, why: str) -> Step:
        if not listed:
            if self._by_hand:
                why = "the graph was changed by hand since, which is final"
            raise UsageError(f"{self._title()} has nothing to {what}: {why}")
        return listed[-1]

    def undo_done(self) -> None:
        """The last edit was undone."""
        self.undone.append(self.done.pop())

    def redo_done(self) -> None:
        """The last one that was undone was carried out again."""
        self.done.append(self.undone.pop())
