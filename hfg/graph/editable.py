"""What edits a drawn graph: the part of `Graph` for commands (rule R4). `editing` does it."""

from __future__ import annotations

from types import ModuleType
from typing import Any, cast

from hfg.graph.commands import Command

__all__ = ["Editable"]


class Editable:
    """Edits of a graph at rest."""

    def edit(self, *commands: Command) -> None:
        """Carry commands out, all of them or, when one is refused, none; a graph that runs is edited by `run.edit`.

        Raises:
          GraphError: one cannot be; the message says which and why.
          UsageError: the graph runs, or is the inside of a subgraph.

        Example:
          >>> from hfg import Graph, commands
          >>> graph = Graph()
          >>> graph.edit(commands.Add("hfg.testing.nodes:double", "double", options={"max_rate_hz": 5}))
          >>> graph.undo()
          >>> graph.nodes
          {}
        """
        from hfg.graph.editing import edit

        edit(cast(Any, self), commands)

    def undo(self) -> None:
        """Take the last edit back: everything is exactly as before it.

        Raises:
          UsageError: there is none, or the graph was changed by hand since, or runs.
        """
        from hfg.graph.editing import undo

        undo(cast(Any, self))

    def redo(self) -> None:
        """Carry the edit out again that was undone last.

        Raises:
          UsageError: there is none, or the graph was changed since, or runs.
        """
        from hfg.graph.editing import redo

        redo(cast(Any, self))

    def reload(self, module: str | ModuleType) -> None:
        """Run a changed module again; its node types replace those of its nodes, parameters are kept.

        Raises:
          GraphError: the module fails, or a new type does not fit the edges; nothing was changed.
          UsageError: the graph runs: `run.reload` is for that.
        """
        from hfg.graph.editing import reload

        reload(cast(Any, self), module)
