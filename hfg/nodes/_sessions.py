"""The session of a transport that all nodes of one run share, opened by the first and closed by the last.

Which transport: what a node says, else the environment variable HFG_TRANSPORT, else the one in memory for runs in
virtual time; otherwise Zenoh if settings name an address, and local sockets if not. With which settings: what a node
says, else the file that HFG_SETTINGS names.
"""

from __future__ import annotations

import asyncio
import os
from typing import Any, Final, TypeAlias
from weakref import WeakKeyDictionary

from hfg.engine import VirtualTimeLoop
from hfg.graph import Graph
from hfg.parts.transports import open_session
from hfg.transport import Session

_Key: TypeAlias = tuple[str, str]

_OPEN: Final[WeakKeyDictionary[Graph, dict[_Key, _Shared]]] = WeakKeyDictionary()


class _Shared:
    def __init__(self, opening: asyncio.Task[Session]) -> None:
        self.opening = opening
        self.users = 0


class Share:
    """One node's share of a session; must be closed."""

    def __init__(self, graph: Graph, key: _Key, shared: _Shared) -> None:
        self._graph = graph
        self._key = key
        self._shared: _Shared | None = shared
        shared.users += 1

    async def session(self) -> Session:
        """Return it, once it is open.

        Raises:
          TransportError: it cannot be opened.
        """
        assert self._shared is not None
        return await asyncio.shield(self._shared.opening)

    async def give_back(self) -> None:
        """Need it no more; it is closed with the last share."""
        shared, self._shared = self._shared, None
        if shared is None:
            return
        shared.users -= 1
        if shared.users:
            return
        all_of_graph = _OPEN.get(self._graph, {})
        if all_of_graph.get(self._key) is shared:
            del all_of_graph[self._key]
        shared.opening.cancel()
        await asyncio.wait([shared.opening])
        if not shared.opening.cancelled() and shared.opening.exception() is None:
            await shared.opening.result().close()


def share(graph: Graph, name: str, settings: str) -> Share:
    """Return a share of the session of a run.

    Args:
      graph: the whole graph that runs.
      name: of the transport; "" as said above.
      settings: of the transport; "" as said above.
    """
    loop = asyncio.get_running_loop()
    if not name:
        name = os.environ.get("HFG_TRANSPORT", "") or ("memory" if isinstance(loop, VirtualTimeLoop) else "")
    if not settings and name != "memory":
        settings = os.environ.get("HFG_SETTINGS", "")
    all_of_graph = _OPEN.setdefault(graph, {})
    shared = all_of_graph.get((name, settings))
    if shared is None:
        opening = loop.create_task(_open(name, settings))
        shared = all_of_graph[name, settings] = _Shared(opening)
    return Share(graph, (name, settings), shared)


async def _open(name: str, settings: str) -> Session:
    said: dict[str, Any] = {}
    if settings:
        said = {"network" if name == "memory" else "settings": settings}
    return await open_session(name, **said)
