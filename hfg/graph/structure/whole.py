"""What all levels of one graph share: its groups, who is gated, its run, and what was edited."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from hfg.graph.structure.groups import Groups
from hfg.graph.structure.history import History
from hfg.nodetypes.node import Node

if TYPE_CHECKING:
    from hfg.graph.graph import Graph
    from hfg.graph.structure.level import Level

__all__ = ["Whole"]


class Whole:
    """The part of a graph that there is once, however many subgraphs it has.

    Attributes:
      root: the outermost level; it writes itself here.
      make_face: gives the graph that users see of a new level; the face stands above, so it hands this down.
      gated: nodes that have a gate, of which each has at most one (rule A11); written by the levels' `Gates`.
      run: the run it has, if any; a graph has one at a time.
      takes_commands: commands are being carried out, which a run follows and the history knows.
      notes: of editors, by node; None: those about the whole. Nothing else reads them, and they go with their node.
      history: of edits; what lies on it is the matter of who edits.
    """

    __slots__ = ("gated", "groups", "history", "make_face", "notes", "root", "run", "takes_commands")

    root: Level

    def __init__(self, make_face: Callable[[Level], Graph]) -> None:
        self.make_face = make_face
        self.groups = Groups()
        self.gated: set[Node] = set()
        self.run: object | None = None
        self.takes_commands = False
        self.notes: dict[Node | None, dict[str, Any]] = {}
        self.history: History[Any] = History(lambda: self.root.title)

    def begin_run(self, run: object) -> None:
        """From now on the structure is changed by commands alone."""
        self.run = run

    def end_run(self) -> None:
        """It may be changed by hand again."""
        self.run = None

    @contextmanager
    def taking_commands(self) -> Iterator[None]:
        """Let what is done inside count as done by commands."""
        before, self.takes_commands = self.takes_commands, True
        try:
            yield
        finally:
            self.takes_commands = before
