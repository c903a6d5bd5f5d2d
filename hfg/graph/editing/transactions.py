"""Transactions of commands, and the history of a graph: what was edited can be undone and redone exactly (rule R4).

There is one history for each graph, whether it runs or not: a run goes the same steps in between. Depends on
`performing` and `checks`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType

import msgspec

from hfg.errors import GraphError, Problem, UsageError
from hfg.graph.checks.checking import check_flat
from hfg.graph.editing.changes import Change, ParameterChange, undo_all
from hfg.graph.editing.commands import (
    Add,
    ChangeGroup,
    Command,
    Connect,
    Copy,
    Dissolve,
    Enclose,
    Move,
    Promote,
    Replace,
    SetEdge,
    SetMonitor,
    SetParameter,
)
from hfg.graph.editing.performing import perform
from hfg.graph.editing.reloading import reloaded
from hfg.graph.flat import flatten
from hfg.graph.structure.history import History
from hfg.graph.structure.level import HasLevel, level_of

_MAY_BREAK = (Add, ChangeGroup, Connect, Copy, Dissolve, Enclose, Move, Promote, Replace, SetEdge, SetMonitor)
"""Commands after which something may be wrong that only the whole shows."""


class Transaction(msgspec.Struct, frozen=True, eq=False):
    """Commands that were carried out together, and what they did."""

    commands: tuple[Command, ...]
    changes: tuple[Change, ...]

    def joined(self, later: Transaction) -> Transaction:
        """Return what both did as one; a parameter that both set is set once, because a drag sets it very often."""
        commands = {_target(command, number): command for number, command in enumerate(self.commands + later.commands)}
        changes: dict[object, Change] = {}
        for number, change in enumerate(self.changes + later.changes):
            key = (change.node, change.name) if isinstance(change, ParameterChange) else number
            first = changes.get(key)
            if isinstance(first, ParameterChange) and isinstance(change, ParameterChange):
                changes[key] = replace(first, after=change.after)
            else:
                changes[key] = change
        return Transaction(tuple(commands.values()), tuple(changes.values()))


def _target(command: Command, number: int) -> object:
    return command.path if isinstance(command, SetParameter) else number


def history_of(graph: HasLevel) -> History[Transaction]:
    """Return the history of a whole graph."""
    return level_of(graph).whole.history


def edit(graph: HasLevel, commands: Sequence[Command]) -> None:
    """See `Graph.edit`."""
    _need_rest(graph, "edit")
    history = history_of(graph)
    history.note(prepare(graph, commands))


def undo(graph: HasLevel) -> None:
    """See `Graph.undo`."""
    _need_rest(graph, "undo")
    history = history_of(graph)
    undo_all(history.next_undo().changes)
    history.undo_done()


def redo(graph: HasLevel) -> None:
    """See `Graph.redo`."""
    _need_rest(graph, "redo")
    history = history_of(graph)
    for change in history.next_redo().changes:
        change.do()
    history.redo_done()


def reload(graph: HasLevel, module: str | ModuleType) -> None:
    """See `Graph.reload`."""
    _need_rest(graph, "reload")
    with reloaded(graph, module) as commands:
        edit(graph, commands)


def prepare(graph: HasLevel, commands: Sequence[Command], *, check: bool = True) -> Transaction:
    """Carry commands out on the graph and check the whole.

    Raises:
      GraphError: a command is refused, or the graph would have an error that it has not now; nothing was changed.
    """
    before = _errors(graph) if check and may_break(commands) else None
    changes = perform(level_of(graph), commands)
    if before is not None:
        try:
            refuse_new_errors(before, _errors(graph))
        except GraphError:
            undo_all(changes)
            raise
    return Transaction(tuple(commands), tuple(changes))


def may_break(commands: Sequence[Command]) -> bool:
    """Return whether the whole is to be checked after these."""
    return any(isinstance(command, _MAY_BREAK) for command in commands)


def _errors(graph: HasLevel) -> list[Problem]:
    return [problem for problem in check_flat(flatten(graph)) if problem.severity == "error"]


def refuse_new_errors(before: Sequence[Problem], after: Sequence[Problem]) -> None:
    """Raise if there is an error that was not there before.

    Raises:
      GraphError: it says what the check says.
    """
    known = Counter(problem.check for problem in before)
    for problem in after:
        known[problem.check] -= 1
        if known[problem.check] < 0:
            new = next((one for one in after if one.check == problem.check and one not in before), problem)
            raise GraphError(f"the edit is refused because it would break the graph: {new}")


def _need_rest(graph: HasLevel, what: str) -> None:
    level = level_of(graph)
    if level.owner is not None:
        raise UsageError(
            f'{level.title} is edited with the whole graph: write graph.{what} of "{level.whole.root.name}", '
            f'with paths such as "{level.path}/node"'
        )
    if level.whole.run is not None:
        raise UsageError(f"{level.title} runs: write `await run.{what}(...)`, which the run follows")
