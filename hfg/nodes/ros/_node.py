"""What all nodes that speak with ROS 2 have in common: their connection, their names, and what they count.

Depends on `hfg.ros`.
"""

from __future__ import annotations

import asyncio
import os
from typing import Any

from annotated_types import Ge, Le

from hfg.base.controls import cleaned
from hfg.base.logs import log
from hfg.engine import VirtualTimeLoop
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.graph import graph_of
from hfg.graph.structure.level import level_of
from hfg.nodes._sessions import Share, share_of
from hfg.nodetypes.node import Node
from hfg.ports import Parameter
from hfg.ros.connection import Connection, domain_of, router_of
from hfg.ros.graph import sentence_of
from hfg.ros.names import full_name, need_namespace, need_node_name, node_name_of, remapping
from hfg.ros.wire import Entity, Kind, Qos

_MOST_TOLD = 1_000
_OTHER_END: dict[Kind, Kind] = {"MP": "MS", "MS": "MP", "SS": "SC", "SC": "SS"}


class RosNode(Node):
    """Base of the nodes that speak with ROS 2 over rmw_zenoh.

    Attributes:
      router: address of the Zenoh router, "tcp/localhost:7447", or a settings file of hfg (".toml") that names one with
        certificates; empty: the environment variable HFG_ROS_ROUTER.
      domain: number of the domain; -1: ROS_DOMAIN_ID, else 0.
      namespace: of the node in ROS, "/robot1"; empty: HFG_ROS_NAMESPACE, else none.
      node: its name in ROS; empty: the name of the graph. Nodes of one name are one node of ROS.

    Raises:
      UsageError: a name, type or domain cannot be used, or no router is named.
      TransportError: the address of the router cannot be used.
    """

    router = Parameter("")
    domain = Parameter(-1, Ge(-1), Le(232))
    namespace = Parameter("")
    node = Parameter("")

    _share: Share[Connection] | None = None
    _link: Connection | None = None

    @property
    def link(self) -> Connection:
        """The connection; there during a run."""
        assert self._link is not None
        return self._link

    async def connect(self, name: str) -> None:
        """Share the connection of the run, and find out the full name of a topic, service or action.

        Raises:
          UsageError: a name cannot be used, no router is named, or the run is in virtual time.
          TransportError: the address cannot be used.
        """
        if isinstance(asyncio.get_running_loop(), VirtualTimeLoop):
            raise UsageError(
                f'"{self.place.path}" speaks with programs that do not wait for virtual time: run with clock="real", '
                "or replace it with recorded values"
            )
        whole: Graph = graph_of(level_of(self.place.graph).whole.root.face)
        namespace = need_namespace(self.namespace or os.environ.get("HFG_ROS_NAMESPACE", ""))
        self._who = namespace, need_node_name(self.node or node_name_of(whole.name))
        rules = remapping(os.environ.get("HFG_ROS_REMAP", ""), *self._who)
        self._full = full_name(name, *self._who, rules)
        self._told: set[object] = set()
        self._unfit: set[Entity] = set()
        self._ends: list[Entity] = []
        self._open: list[Any] = []
        address, domain = router_of(self.router), domain_of(self.domain)

        async def opened() -> Connection:
            link = Connection(address, domain)
            if link.exposed:
                log().warning(
                    "insecure: no program is authenticated at %s, so any that can connect there can publish and ask",
                    " and ".join(f'"{one}"' for one in link.exposed),
                )
            return link

        self._share = share_of(whole, ("ros", address, domain), opened)
        self._link = await self._share.session()
        await self._link.tried()
        await self._link.join(self, self._declare, self.changed)

    async def _declare(self, link: Connection) -> None:
        """Declare what the node has, once there is a session."""

    def seen_as(self, kind: Kind, name: str, type_: Any, qos: Qos | None = None) -> Entity:
        """Make an end of this node, and be seen by it."""
        one = self.link.entity(kind, self._who, name, type_, qos or Qos())
        self._ends.append(one)
        self._open.append(self.link.session.token(one.token))
        return one

    def changed(self) -> None:
        """Look who is there: ends of other types are counted, and told once."""
        for mine in self._ends:
            for other in self.link.graph.unfit(mine, _OTHER_END[mine.kind]):
                self._unfit.add(other) if len(self._unfit) < _MOST_TOLD else None
                self.tell_once((mine.name, other.type, other.hash), sentence_of(mine, other))

    def tell_once(self, what: object, sentence: str) -> None:
        """Log a warning about something, the first time."""
        if what not in self._told and len(self._told) < _MOST_TOLD:
            self._told.add(what)
            self.log.warning("%s", cleaned(sentence))

    async def teardown(self) -> None:
        """Be seen no more, and give the connection back."""
        share, link, self._share = self._share, self._link, None
        if link is not None:
            self._last = self.statistics()
            link.leave(self)
            for one in reversed(self._open):
                one.close()
            self._link = None
        if share is not None:
            await share.give_back()

    def counts(self) -> dict[str, int]:
        """Return what a kind of node counts itself."""
        return {}

    def statistics(self) -> dict[str, int]:
        """Say what has happened, in numbers: who is `here`, whose types are `unfit`, how often it `reconnected` ..."""
        link = self._link
        if link is None:
            numbers: dict[str, int] = getattr(self, "_last", {})
            return numbers
        here = sum(len(link.graph.fit(one, _OTHER_END[one.kind])) for one in self._ends)
        common = {"here": here, "unfit": len(self._unfit), "connected": int(link.connected)}
        return {**self.counts(), **common, "reconnected": link.reconnected}
