"""Where everything is drawn: the layout of each level that a page shows, made off the graph's loop.

Laying out reads the graph, which an edit may change meanwhile: then the result is thrown away, and the layout starts
over. Depends on the drawing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any, Final, Protocol, cast

import msgspec

from hfg.base.logs import Log
from hfg.graph import Graph, drawing
from hfg.graph.drawing import View
from hfg.graph.drawing.seen import Kind
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.studio.tables import Tables
from hfg.studio.viewing import Shown

__all__ = ["Layouts", "lay_out", "positions"]

_LOGGER: Final = Log("hfg.studio")


class _Host(Protocol):
    tables: Tables

    @property
    def graph(self) -> Graph: ...

    def take_layout(self, key: str, record: object) -> None: ...


class Layouts:
    """Keeps the layouts that pages want as the graph is."""

    def __init__(self, host: _Host) -> None:
        self._host = host
        self._wanted: set[Shown] = set()
        self._made: dict[str, object] = {}  # by key: what the layout depends on
        self._working: asyncio.Task[None] | None = None

    def want(self, levels: Iterable[Shown]) -> None:
        """These levels are shown, as the graph is now."""
        self._wanted = set(levels)
        for key in [key for key in self._made if key not in {one.key for one in self._wanted}]:
            del self._made[key]
            self._host.take_layout(key, None)
        self._begin()

    def _begin(self) -> None:
        if self._working is None and self._next() is not None:
            self._working = asyncio.create_task(self._work(), name="hfg studio layout")
            self._working.add_done_callback(self._worked)

    def _worked(self, task: asyncio.Task[None]) -> None:
        self._working = None
        if task.cancelled():
            return
        if task.exception() is not None:
            _LOGGER.error("a level cannot be laid out", exc_info=task.exception())
        self._begin()  # levels are left if that was an error, and some were wanted since the task has ended

    def _next(self) -> tuple[Shown, object] | None:
        """Return a level that is not drawn as it is, and what its layout depends on."""
        for level in sorted(self._wanted):
            cause = self._cause(level)
            if self._made.get(level.key) != cause:
                return level, cause
        return None

    def _cause(self, level: Shown) -> object:
        """What a layout depends on: the records of the level, or of all levels in it."""
        path, tables = level.path, self._host.tables.of
        if path and path not in tables["nodes"]:
            return None

        def is_seen(one: Any) -> bool:
            return one.level == path or (level.deep and (not path or one.level.startswith(f"{path}/")))

        nodes = [
            (one.path, one.type, one.group, one.enabled, one.inside, one.options, one.notes.get("position"), one.ports)
            for one in tables["nodes"].values()
            if is_seen(one)
        ]
        edges = [one for one in tables["edges"].values() if is_seen(one)]
        return nodes, edges, [one for one in tables["gates"].values() if is_seen(one)]

    async def _work(self) -> None:
        while (found := self._next()) is not None:
            level, cause = found
            key = level.key
            if cause is None:
                self._made[key] = None
                self._host.take_layout(key, None)
                continue
            try:
                drawn = await asyncio.to_thread(lay_out, self._host.graph, level)
            except Exception:
                if self._cause(level) == cause:
                    self._made[key] = cause  # it will not do better the next time
                    raise
                continue  # the graph changed while it was read
            if self._cause(level) == cause:
                self._made[key] = cause
                self._host.take_layout(key, drawn)


def positions(level: Level) -> dict[str, tuple[float, float]]:
    """Return where people have put nodes of a level, by path."""
    found = {}
    for node in level.nodes.values():
        place = level.whole.notes.get(node, {}).get("position")
        if isinstance(place, list | tuple) and len(place) == 2 and all(isinstance(one, int | float) for one in place):
            found[node.place.path] = float(place[0]), float(place[1])
    return found


def lay_out(graph: Graph, shown: Shown) -> dict[str, Any]:
    """Draw one level with its subgraphs closed; or all levels in it, without the places that people chose."""
    root = level_of(graph)
    level = root if not shown.path else inside(node_at(root, shown.path))
    assert level is not None
    kind = cast("Kind | None", shown.view or None)
    places = {} if shown.deep else positions(level)
    measured = kind != "activity"  # states have names only there
    seen = View(kind, depth=None if shown.deep else 0, all_ports=not shown.deep, measured=measured, places=places)
    drawn: dict[str, Any] = msgspec.to_builtins(drawing.lay_out(level.face, seen))
    return {**drawn, "level": shown.path, "fixed": list(places), "deep": shown.deep}
