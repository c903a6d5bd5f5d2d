"""The session of a transport that all nodes of one run share, opened by the first and closed by the last.

Which transport: what a node says, else the environment variable HFG_TRANSPORT, else the one in memory for runs in
virtual time; otherwise Zenoh if settings name an address, and local sockets if not. With which settings: what a node
says, else the file that HFG_SETTINGS names.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Coroutine
from typing import Any, Final, Generic, Protocol, TypeAlias, TypeVar
from weakref import WeakKeyDictionary

from hfg.engine import VirtualTimeLoop
from hfg.graph import Graph
from hfg.parts.transports import open_session
from hfg.transport import Session

_Key: TypeAlias = tuple[object, ...]


class _Closable(Protocol):
    async def close(self) -> None: ...


_S = TypeVar("_S", bound=_Closable)

_OPEN: Final[WeakKeyDictionary[Graph, dict[_Key, _Shared[Any]]]] = WeakKeyDictionary()


class _Shared(Generic[_S]):
    def __init__(self, opening: asyncio.Task[_S]) -> None:
        self.opening = opening
        self.users = 0


class Share(Generic[_S]):
    """One node's share of a session; must be closed."""

    def __init__(self, graph: Graph, key: _Key, shared: _Shared[_S]) -> None:
        self._graph = graph
        self._key = key
        self._shared: _Shared[_S] | None = shared
        shared.users += 1

    async def session(self) -> _S:
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
        _OPEN.get(self._graph, {}).pop(self._key, None)
        shared.opening.cancel()
        await asyncio.wait([shared.opening])
        if not shared.opening.cancelled() and shared.opening.exception() is None:
            await shared.opening.result().close()


def share(graph: Graph, name: str, settings: str) -> Share[Session]:
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
    return share_of(graph, (name, settings), lambda: _open(name, settings))


def share_of(graph: Graph, key: _Key, opening: Callable[[], Coroutine[Any, Any, _S]]) -> Share[_S]:
    """Return a share of what all nodes of a run with one key have in common.

    Args:
      graph: the whole graph that runs.
      key: what tells it from others.
      opening: opens it, if no node has done so.
    """
    all_of_graph = _OPEN.setdefault(graph, {})
    shared = all_of_graph.get(key)
    if shared is None:
        task = asyncio.get_running_loop().create_task(opening())
        shared = all_of_graph[key] = _Shared(task)
    return Share(graph, key, shared)


async def _open(name: str, settings: str) -> Session:
    said: dict[str, Any] = {}
    if settings:
        said = {"network" if name == "memory" else "settings": settings}
    return await open_session(name, **said)
