"""The connection of all ROS nodes of a run with one router in one domain: opened as soon as the router is there.

A graph starts without its router and continues when the router stops: the connection tries to reach it until it is
closed. Depends on `hfg.ros` and on the transport Zenoh, found by its name.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from typing import Any, Final

from hfg.base.controls import cleaned
from hfg.base.logs import log
from hfg.errors import TransportError, UsageError
from hfg.parts.transports import transport
from hfg.ros.graph import RosGraph
from hfg.ros.wire import Entity, Kind, Qos, need_domain, tokens_of

_ATTEMPT_S: Final = 1.0
_PAUSE_S: Final = 0.25
_LONGEST_PAUSE_S: Final = 2.0


def router_of(said: str) -> str:
    """Return the address of the router: what a node says, else the environment variable HFG_ROS_ROUTER (rule L5).

    Raises:
      UsageError: neither says one.
    """
    address = said or os.environ.get("HFG_ROS_ROUTER", "")
    if not address:
        raise UsageError(
            'no router is named: set the parameter router="tcp/localhost:7447", or the environment variable '
            "HFG_ROS_ROUTER; nothing is connected to unless a setting names its address"
        )
    return address


def domain_of(said: int) -> int:
    """Return the domain: what a node says, else ROS_DOMAIN_ID, else 0.

    Raises:
      UsageError: there is no such domain.
    """
    text = str(said) if said >= 0 else os.environ.get("ROS_DOMAIN_ID", "") or "0"
    try:
        return need_domain(int(text))
    except ValueError:
        raise UsageError(f"{text!r:.80} is not a domain of ROS 2: set domain, or ROS_DOMAIN_ID, to 0 to 232") from None


class Connection:
    """One session, and who is there.

    Args:
      address: of the router; see `hfg_transports.zenoh.foreign.ForeignRouter`.
      domain: its number.

    Attributes:
      where: the address, for messages.
      domain: see above.
      exposed: the addresses without authentication: any program that can connect there can publish and ask.
      graph: who is there.
      connected: whether the router is there.
      reconnected: how often it has come back.

    Raises:
      TransportError: the address cannot be used.
    """

    def __init__(self, address: str, domain: int) -> None:
        router = getattr(transport("zenoh"), "foreign")  # noqa: B009 - not a part of every transport
        self._router = router(address)
        self.where: str = self._router.where
        self.exposed: list[str] = self._router.exposed
        self.domain = domain
        self.graph = RosGraph()
        self.connected = False
        self.reconnected = 0
        self.session: Any = None
        self._was_connected = False
        self._members: dict[object, Callable[[Connection], Awaitable[None]]] = {}
        self._listeners: dict[object, Callable[[], None]] = {}
        self._nodes: dict[tuple[str, str], int] = {}
        self._next_id = 0
        self._changed = asyncio.Event()
        self._tried = asyncio.Event()
        self._opening = asyncio.get_running_loop().create_task(self._open())

    async def tried(self) -> None:
        """Wait until the router has been tried once, so that a run begins with a connection if it can."""
        await asyncio.wait([self._opening, asyncio.ensure_future(self._tried.wait())], return_when="FIRST_COMPLETED")
        if self._opening.done():
            self._opening.result()

    async def join(
        self, node: object, declare: Callable[[Connection], Awaitable[None]], changed: Callable[[], None]
    ) -> None:
        """Have a node's publishers and such declared, now or as soon as there is a session.

        Args:
          node: whose.
          declare: declares them; called once.
          changed: called when an entity or the router has come or gone.
        """
        self._listeners[node] = changed
        if self.session is None:
            self._members[node] = declare
        else:
            await declare(self)
            changed()

    def leave(self, node: object) -> None:
        """Tell a node nothing any more."""
        self._members.pop(node, None)
        self._listeners.pop(node, None)

    async def wait_changed(self) -> None:
        """Wait until an entity or the router comes or goes."""
        await self._changed.wait()

    def entity(self, kind: Kind, node: tuple[str, str], name: str, type_: Any, qos: Qos) -> Entity:
        """Make what a node of ROS is seen by; the node itself is declared with its first one."""
        if node not in self._nodes:
            self._nodes[node] = self._new_id()
            number = self._nodes[node]
            self.session.token(Entity(self.domain, self.session.name, number, number, "NN", *node).token)
        number = self._nodes[node]
        session = self.session.name
        return Entity(self.domain, session, number, self._new_id(), kind, *node, name, type_.name, type_.hash, qos)

    async def close(self) -> None:
        """End it."""
        self._opening.cancel()
        await asyncio.wait([self._opening])
        if self.session is not None:
            await self.session.close()

    def _new_id(self) -> int:
        self._next_id += 1
        return self._next_id - 1

    async def _open(self) -> None:
        pause_s = _PAUSE_S
        while self.session is None:
            try:
                self.session = await self._router.open(wait_s=_ATTEMPT_S)
            except TransportError as error:
                if not self._tried.is_set():
                    log().warning("ROS 2: %s; trying again until it is there", cleaned(str(error)))
                self._tried.set()
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
        self.session.watch_connection(self._router_told)
        self.session.watch(tokens_of(self.domain), self._graph_told)
        while self._members:
            await self._members.pop(next(iter(self._members)))(self)
        self._tell()
        self._tried.set()

    def _router_told(self, news: list[bool]) -> None:
        for is_there in news:
            if is_there and self._was_connected and not self.connected:
                self.reconnected += 1
                log().warning('ROS 2: the router at "%s" is there again', self.where)
            if self.connected and not is_there:
                log().warning('ROS 2: the router at "%s" has gone; trying to reach it again', self.where)
            self.connected = is_there
            self._was_connected = self._was_connected or is_there
        self._tell()

    def _graph_told(self, news: list[tuple[bool, str]]) -> None:
        self.graph.told(news)
        self._tell()

    def _tell(self) -> None:
        self._changed.set()
        self._changed.clear()
        for changed in list(self._listeners.values()):
            changed()
