"""What whoever runs a graph does to change it (rule R4): the part of `Run` for edits. Stands on `edits`."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

from hfg.graph.editing.commands import Command

if TYPE_CHECKING:
    from hfg.engine.runtime.engine import Engine

__all__ = ["Editable"]


class Editable:
    """Edits of a run; one after the other, in the order they were asked for."""

    _engine: Engine

    async def edit(self, *commands: Command) -> None:
        """Change the graph while it runs: all of it, or when a command is refused, nothing.

        New nodes are set up first. The change takes effect at one moment, between firings of the nodes it touches, and
        then this returns; other nodes go on meanwhile. What lies on an edge that is removed is dropped and counts as
        processed; a new edge starts empty. Cancelled before it takes effect, it changes nothing.

        Raises:
          GraphError: a command cannot be carried out; the message says which and why.
          NodeError: the `setup()` of a node that comes failed; one that it was to replace is set up again.
          UsageError: it is an edit that only a graph at rest allows, or was asked for by code whose end it waits for.
          NotRunning: the run is over.
        """
        await self._engine.edits.edit(commands)

    async def undo(self) -> None:
        """Take the last edit back, be it of this run or from before; nodes that come back start afresh.

        Raises:
          UsageError: there is none, or the graph was changed by hand since.
        """
        await self._engine.edits.undo()

    async def redo(self) -> None:
        """Carry the edit out again that was undone last.

        Raises:
          UsageError: there is none.
        """
        await self._engine.edits.redo()

    async def reload(self, module: str | ModuleType) -> None:
        """Run a changed module again; its node types replace those of its nodes.

        Parameters, edges, what lies on them and activity stay; the nodes are torn down and set up.

        Raises:
          GraphError: the module fails, or a type does not fit; the graph goes on with what it has.
        """
        await self._engine.edits.reload(module)
