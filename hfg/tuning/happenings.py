"""Something that happens in a run at a time: an action of a node, as the studio offers it, or a parameter that changes.

Depends on panels and the engine.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from hfg.encoding import read_text
from hfg.engine import Run
from hfg.errors import EncodingError, HfgError, UsageError
from hfg.graph import Graph
from hfg.graph.structure.naming import suggest
from hfg.panels import Change, actions_of
from hfg.tuning.space import find_parameters

_MOST_S: Final = 1e9


@dataclass(frozen=True)
class Happening:
    """What happens.

    Attributes:
      name: as users write it.
      at_s: when, in seconds of the run.
      act: does it to a run.
    """

    name: str
    at_s: float
    act: Callable[[Run], Any]

    def begin(self, run: Run) -> None:
        """Let it happen in a run that begins: before anything else if its time is 0."""
        loop = asyncio.get_running_loop()
        loop.call_later(self.at_s, self._act, run)

    def _act(self, run: Run) -> None:
        answer = self.act(run)
        if asyncio.iscoroutine(answer):
            run._engine.loop.create_task(answer)


def read_happening(graph: Graph, text: str) -> Happening:
    """Read what happens, as in "world.push_robot@30" or "world.light=0.1@30".

    Args:
      graph: has the node.
      text: the path of an action that the type of a node declares (`hfg.panels`), or a parameter and its value; after
        "@", when, in seconds.

    Raises:
      UsageError: there is no such action or parameter, or the value does not fit.
    """
    what, at, when = text.partition("@")
    try:
        at_s = float(when) if at else 0.0
    except ValueError:
        at_s = -1.0
    if not 0 <= at_s <= _MOST_S:
        raise UsageError(f'"{text}": after "@" stands a time in seconds, as in {what}@30')
    path, equals, value = what.strip().partition("=")
    act = _setting(graph, path, value) if equals else _action(graph, path)
    return Happening(text, at_s, act)


def _setting(graph: Graph, path: str, text: str) -> Callable[[Run], Any]:
    known = find_parameters(graph)
    if path not in known:
        raise UsageError(f'graph "{graph.name}" has no parameter "{path}"; {suggest(path, known)}')
    spec = known[path].spec
    try:
        value = spec.read_text(text)
    except EncodingError as error:
        raise UsageError(str(error)) from None
    wrong = spec.check(value)
    if wrong is not None:
        raise UsageError(f'parameter "{path}" {wrong}')
    return lambda run: run.set(path, value)


def _action(graph: Graph, path: str) -> Callable[[Run], Any]:
    place, _, name = path.rpartition(".")
    try:
        node: Any = graph[place]
    except (HfgError, LookupError):
        raise UsageError(f'there is no node "{place}" for "{path}"; {suggest(place, graph.nodes)}') from None
    actions = actions_of(type(node))
    if name not in actions:
        there = suggest(name, actions) if actions else "it declares none"
        raise UsageError(f'node "{place}" has no action "{name}"; {there}; or set a parameter: {place}.NAME=VALUE')
    action = actions[name]
    if isinstance(action, Change):
        return lambda run: [run.set(f"{place}.{one}", value) for one, value in action.values.items()]
    slot = node.ports.slots[action.slot]
    value = _default_of(slot.type, path)
    return lambda run: run.trigger(slot, value)


def _default_of(kind: Any, path: str) -> Any:
    """Return the value that the studio suggests for a call: the defaults of a record."""
    if kind in (None, object, Any):
        return None
    try:
        return kind()
    except TypeError:
        try:
            return read_text("", kind, where=path)
        except EncodingError:
            raise UsageError(f'action "{path}" needs a value that has no default; set a parameter instead') from None
