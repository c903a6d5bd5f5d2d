"""Edits of a run whose graph is cut: each takes effect in the one part it concerns; then all parts draw it.

Every part has the whole graph as a drawing, of which it runs its own nodes. So an edit is made by the engine of the
part whose nodes it concerns, and if it succeeds, the others apply it to their drawings (rules L1, R4). A restarted part
is sent the current drawing. Depends on `asking`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, Final

from hfg.engine.editing.edits import Edits
from hfg.engine.model.running_node import RunningNode
from hfg.errors import FileError, UsageError
from hfg.graph import Graph
from hfg.graph.editing import Transaction, history_of, prepare
from hfg.graph.editing.changes import Change, undo_all
from hfg.graph.editing.commands import Command, Copy, encode
from hfg.graph.flat import MAIN, Cutting, FlatGraph, cut, flatten
from hfg.graph.graph import graph_of
from hfg.graph.structure.history import MOST_STEPS
from hfg.parts.model.redrawing import Concern, concerned
from hfg.parts.steering.asking import Asking

Answer = Callable[..., Awaitable[Any]]

_ENDED: Final = "the run ended before the edit was made"


class Drawing:
    """The whole graph as all parts currently know it.

    Attributes:
      flat: the graph.
      cutting: of the same.
      text: the same as a graph file, for parts that start.
    """

    def __init__(self, flat: FlatGraph, cutting: Cutting, text: str, write: Callable[[Graph], str]) -> None:
        """Start with the running graph.

        Args:
          flat: the graph.
          cutting: of the same.
          text: of the same.
          write: returns the text of a graph.
        """
        self.flat = flat
        self.cutting = cutting
        self.text = text
        self.write = write

    def again(self) -> None:
        """The graph was edited."""
        graph = graph_of(self.flat.graph)
        self.flat = flatten(graph)
        self.cutting = cut(self.flat)
        self.text = self.write(graph)


class CutEdits:
    """Edits a graph that runs in several processes.

    Args:
      graph: the whole.
      edits: edits of the main part.
      asking: sends requests to the others.
      drawing: the drawing of the whole.
      answer: sends a request to a part and waits for its answer, or for the end of the run.
    """

    def __init__(self, graph: Graph, edits: Edits, asking: Asking, drawing: Drawing, answer: Answer) -> None:
        self._graph = graph
        self._edits = edits
        self._asking = asking
        self._drawing = drawing
        self._answer = answer
        self._known: deque[Transaction] = deque(maxlen=MOST_STEPS)  # which all parts have in their histories
        asking.when_gone(self._known.clear)

    async def edit(self, commands: Sequence[Command]) -> None:
        """See `Run.edit`."""
        _refuse_copies(commands)
        async with self._edits.lock.one():
            said = encode(commands)
            where = self._concern(prepare(self._graph, commands, check=False).changes)
            for part in self._asking.others:
                if part != where.part:  # that part makes the edit, and reports whether it can
                    await self._answer(part, _ENDED, "try_edit", commands=said)
            now, drawn = partial(self._edits.edit_now, commands), partial(draw, self._graph, commands)
            gone = await self._carry_out(where, "edit", now, drawn, commands=said)
        await self._edits.leave(gone)

    async def undo(self) -> None:
        """See `Run.undo`."""
        async with self._edits.lock.one():
            transaction = self._need_known("undo", history_of(self._graph).next_undo())
            where = self._concern(undo_all(transaction.changes))
            gone = await self._carry_out(where, "undo", self._edits.undo_now, partial(draw_undo, self._graph))
        await self._edits.leave(gone)

    async def redo(self) -> None:
        """See `Run.redo`."""
        async with self._edits.lock.one():
            transaction = self._need_known("redo", history_of(self._graph).next_redo())
            for change in transaction.changes:
                change.do()
            where = self._concern(transaction.changes)
            gone = await self._carry_out(where, "redo", self._edits.redo_now, partial(draw_redo, self._graph))
        await self._edits.leave(gone)

    def _need_known(self, verb: str, transaction: Transaction) -> Transaction:
        if transaction not in self._known:
            raise UsageError(
                f"cannot {verb} this: the edit was made before the run started, or before one of its "
                "processes did, which therefore does not know it; edit the graph as you want it"
            )
        return transaction

    def _concern(self, changes: Sequence[Change]) -> Concern:
        """Which part they concern; they were done to the drawing, to see that, and are taken back.

        Raises:
          HfgError: no run of several processes can follow them.
        """
        try:
            found = concerned(self._drawing.cutting, cut(flatten(self._graph)), changes)
            try:
                self._drawing.write(self._graph)
            except FileError as error:
                raise UsageError(f"the edit cannot be sent to the other processes of the run: {error}") from None
        finally:
            undo_all(changes)
        return found

    async def _carry_out(
        self,
        where: Concern,
        verb: str,
        now: Callable[[], Awaitable[list[RunningNode]]],
        drawn: Callable[[], None],
        **arguments: Any,
    ) -> list[RunningNode]:
        """Make the edit where it takes effect, then have all others draw it. Return the nodes to tear down here."""
        history = history_of(self._graph)
        before = history.done[-1:], history.undone[-1:]
        try:
            if where.part == MAIN:
                return await now()
            await self._there(where.part, verb, **arguments, empties=where.reshapes, drawn=drawn)
            return []
        finally:
            took_effect = (history.done[-1:], history.undone[-1:]) != before
            if took_effect:  # even if it is cancelled, or fails, afterwards
                if verb == "edit":
                    self._known.append(history.done[-1])
                self._asking.forget_parameters()  # the drawing has them, as they are by now
                self._drawing.again()
                self._asking.draw_again(self._drawing.flat, self._drawing.cutting)
                for part in self._asking.others:
                    if part != where.part:  # a part that starts just now is sent the current drawing
                        self._asking.tell_if_there(part, f"draw_{verb}", **arguments)

    async def _there(self, part: str, verb: str, *, drawn: Callable[[], None], **arguments: Any) -> None:
        """Have a part make the edit, then draw it here.

        An edit in another process cannot be cancelled; a cancelled caller waits for its result.
        """
        asked = asyncio.ensure_future(self._answer(part, _ENDED, verb, **arguments))
        cancelled: asyncio.CancelledError | None = None
        while not asked.done():
            try:
                await asyncio.wait({asked})
            except asyncio.CancelledError as error:
                cancelled = error
        asked.result()
        drawn()
        if cancelled is not None:
            raise cancelled


def _refuse_copies(commands: Sequence[Command]) -> None:
    """Refuse to copy nodes elsewhere: the current values of their parameters may differ from those drawn here (P8)."""
    for command in commands:
        if isinstance(command, Copy):
            raise UsageError(
                f'"{command.path}" may have parameter values in another process that are not drawn here, so '
                "it cannot be copied while the graph runs in several: Add a node of the same type"
            )


def draw(graph: Graph, commands: Sequence[Command]) -> None:
    """Carry out on a drawing what was done to the nodes elsewhere."""
    history_of(graph).note(prepare(graph, commands, check=False))


def try_to_draw(graph: Graph, commands: Sequence[Command]) -> None:
    """See whether commands can be carried out here, where other packages may be installed; changes nothing."""
    undo_all(prepare(graph, commands, check=False).changes)


def draw_undo(graph: Graph) -> None:
    """Undo on a drawing what was undone elsewhere."""
    history = history_of(graph)
    undo_all(history.next_undo().changes)
    history.undo_done()


def draw_redo(graph: Graph) -> None:
    """Carry out again on a drawing what was carried out again elsewhere."""
    history = history_of(graph)
    for change in history.next_redo().changes:
        change.do()
    history.redo_done()
