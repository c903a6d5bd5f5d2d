"""Programs that connect by a name: one publishes, the others subscribe, started in any order.

    hfg.publish("camera/front", camera.out)          # in one program
    hfg.subscribe("camera/front", viewer.picture)    # in another

Both ends have the type of the port that they are connected to, and say it when they meet. Programs of one user on one
computer need nothing else; other hosts and users are reached over Zenoh, with a settings file that names addresses.
"""

from __future__ import annotations

import os
import socket
from typing import Any, Literal

from annotated_types import Ge, Predicate

from hfg.base.clock import now
from hfg.base.token import END, Token
from hfg.encoding import type_fingerprint, wire_problem
from hfg.errors import EndOfStream, HfgError, UsageError
from hfg.graph import Graph
from hfg.graph.flat import flatten
from hfg.graph.graph import graph_of
from hfg.graph.structure.level import level_of
from hfg.links.offers import need_link_name
from hfg.links.pubsub import OutboxFile, Publication, Subscription
from hfg.nodes._sessions import share
from hfg.nodes.files.access import is_a_path
from hfg.nodetypes.counting import Counting
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, Source, Target
from hfg.types import describe

__all__ = ["Publish", "Subscribe", "publish", "subscribe"]


class Publish(Counting, Node):
    """Send all values to the programs that subscribe to a name.

    Subscribers that want every value get every value from the moment they join, once and in order, and slow this node
    down when they are slow; with `lossless=False` it does not wait. The connected port determines the type. Markers of
    silence and activity do not cross: an active edge belongs to one graph. The end does.

    Attributes:
      value: what is published, with its stamp.
      name: the common name of the programs, "camera/front".
      lossless: whether to wait for subscribers that want every value.
      window: how many values may be in transit to them.
      absent: what to do while there is no subscriber: "pass" discards values; "wait" waits, including for a successor
        of the last subscriber, so that nothing is lost by its death.
      outbox: a file for unacknowledged values, written before they are sent. A program that is killed and restarted
        resumes with them, and subscribers that kept running receive each value once. It waits as with absent="wait";
        empty: values in transit are lost with the program.
      transport: "local", "zenoh" or "memory"; empty: the environment variable HFG_TRANSPORT, else memory in virtual
        time, Zenoh if settings name an address, and local sockets if not.
      settings: the settings file of Zenoh, or the name of a network in memory; empty: HFG_SETTINGS, else none: programs
        of this user on this computer.

    Raises:
      UsageError: it is not connected to a port whose values can be sent to another process, the name is not valid, or
        an outbox is used with lossless=False.
      RunError: the outbox cannot be used.
      TransportError: the transport cannot be used, or a value is too large for it.
      EncodingError: a value is not of the type.
    """

    value = Input(Any)
    name = Parameter("link")
    lossless = Parameter(True)
    window = Parameter(8, Ge(1))
    absent = Parameter("pass", type=Literal["pass", "wait"])
    outbox = Parameter("", Predicate(is_a_path), save=True)
    transport = Parameter("")
    settings = Parameter("")

    async def setup(self) -> None:
        """Say what is published."""
        hint = _type_of(self)
        name = need_link_name(self.name)
        if self.outbox and not self.lossless:
            raise UsageError(
                f'"{name}" is published with lossless=False, which does not wait for subscribers, and with an outbox, '
                "from which nothing must get lost: use only one of the two"
            )
        self._share = share(_whole(self), self.transport, self.settings)
        session = await self._share.session()
        outbox = OutboxFile(self.outbox, name, type_fingerprint(hint)) if self.outbox else None
        try:
            self._end = Publication(
                session,
                name,
                hint,
                who=_who(self),
                lossless=self.lossless,
                window=self.window,
                absent=self.absent,
                outbox=outbox,
                complain=self.log.warning,
            )
        except HfgError:
            if outbox is not None:
                outbox.close()
            raise

    async def process(self, value: Token[Any]) -> None:
        """Publish it; wait while the subscribers have no room."""
        await self._end.send(value.value, value.stamp)

    async def end(self) -> None:
        """Say that nothing more comes, and wait until those who want every value have done with it."""
        await self._end.end(now())

    async def teardown(self) -> None:
        """Take part no more."""
        await _close(self)

    def statistics(self) -> dict[str, int]:
        """Say what has happened, in numbers: who is `here`, what was `sent` and `passed` by, `lost`, `refused` ..."""
        return _statistics(self)


class Subscribe(Counting, Node):
    """Send what another program publishes by a name: a source that waits for it.

    It waits for a publisher, and subscribes to the first one that matches; when this one has gone, to the next. The
    connected ports determine the type. Its tokens have the stamps of the publisher's clock.

    Attributes:
      out: what was published.
      name: the common name of the programs, "camera/front".
      overflow: "wait": every value, and the publisher waits for this program; otherwise the overflow policy, as on
        edges from events, and the publisher does not wait: "latest", "drop_oldest", "drop_newest", "error".
      capacity: how many values wait here.
      latest: begin with the latest value that was published before.
      at_end: what to do when the stream has ended: "end", or "wait" for another publisher.
      if_gone: what to do when a publisher has gone without an end: "wait" until one returns, or "end".
      transport: as for `Publish`.
      settings: as for `Publish`.

    Raises:
      UsageError: it is not connected to a port whose values can be sent to another process, or to ports of several
        types, or the name is not valid.
      TransportError: the transport cannot be used.
      QueueOverflow: a value was too many, under overflow="error".
    """

    out = Output(Any)
    name = Parameter("link")
    overflow = Parameter("wait", type=Literal["wait", "latest", "drop_oldest", "drop_newest", "error"])
    capacity = Parameter(8, Ge(1))
    latest = Parameter(False)
    at_end = Parameter("end", type=Literal["end", "wait"])
    if_gone = Parameter("wait", type=Literal["wait", "end"])
    transport = Parameter("")
    settings = Parameter("")

    async def setup(self) -> None:
        """Look who publishes."""
        hint = _type_of(self)
        self._share = share(_whole(self), self.transport, self.settings)
        self._end = Subscription(
            await self._share.session(),
            need_link_name(self.name),
            hint,
            who=_who(self),
            overflow=self.overflow,
            capacity=self.capacity,
            latest=self.latest,
            complain=self.log.warning,
        )

    async def process(self) -> None:
        """Wait for the next value and send it; the one before is done now (F5), which the publisher hears."""
        while True:
            token = await self._end.take()
            wish = self.if_gone if token is None else self.at_end
            if token is not None and token.value is not END:
                self.out.send(token.value, stamp=token.stamp)
                return
            if wish == "end":
                raise EndOfStream

    async def teardown(self) -> None:
        """Take part no more."""
        await _close(self)

    def statistics(self) -> dict[str, int]:
        """Say what has happened, in numbers: who is `here`, what was `received`, `lost`, `dropped`, `refused` ..."""
        return _statistics(self)


def _whole(node: Node) -> Graph:
    whole: Graph = graph_of(level_of(node.place.graph).whole.root.face)
    return whole


def _who(node: Node) -> str:
    return f'"{_whole(node).name}" (process {os.getpid()} on {socket.gethostname()})'


def _type_of(node: Publish | Subscribe) -> Any:
    """Return the type of the ports at the other end of the node's edges."""
    what = "published" if isinstance(node, Publish) else "subscribed to"
    named = f'"{need_link_name(node.name)}" cannot be {what} by "{node.place.path}"'
    ports: list[Any] = []
    for flat in flatten(_whole(node)).walk():
        for edge in flat.edges:
            here, there = (edge.target, edge.source) if isinstance(node, Publish) else (edge.source, edge.target)
            if getattr(here.port, "node", None) is node and here.name in ("value", "out"):
                ports.append(there.port)
    if not ports:
        raise UsageError(f"{named}: it is connected to no port that would say the type; connect it, or remove it")
    types: dict[str, Any] = {}
    for port in ports:
        hint = getattr(port, "type", Any)  # an observable says none
        path = getattr(port, "path", "an observable")
        problem = wire_problem(hint)
        if problem is not None:
            raise UsageError(f'{named}: a value of "{path}" cannot be sent: {problem}')
        types.setdefault(type_fingerprint(hint), port)
    if len(types) > 1:
        one, other = list(types.values())[:2]
        raise UsageError(
            f'{named}: "{one.path}" is of type {describe(one.type)} and "{other.path}" of {describe(other.type)}; '
            "take a node for each type"
        )
    return next(iter(types.values())).type


async def _close(node: Any) -> None:
    end, borrowed = getattr(node, "_end", None), getattr(node, "_share", None)
    node._share = None
    if end is not None:
        node._last = end.statistics()
        await end.close()
        node._end = None
    if borrowed is not None:
        await borrowed.give_back()


def _statistics(node: Any) -> dict[str, int]:
    end = getattr(node, "_end", None)
    numbers: dict[str, int] = getattr(node, "_last", {}) if end is None else end.statistics()
    return numbers


# --- as one call ---


def publish(name: str, source: Source[Any], **parameters: Any) -> Publish:
    """Publish a port's values to the programs that subscribe to a name.

    Args:
      name: the common name, "camera/front".
      source: an output or event, or the input of a whole graph; its type is the type of the published values.
      **parameters: parameters of `Publish`.

    Returns:
      The publishing node, which was added to the port's graph and connected to the port.

    Raises:
      UsageError: the port does not belong to a graph yet, or the name is not valid.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import script
      >>> graph = hfg.Graph()
      >>> source = graph.add(script())
      >>> hfg.publish("numbers", source.out).place.path
      'publish'
    """
    node = Publish(name=need_link_name(name), **parameters)
    graph = _graph_of(source, "publish")
    graph.add(node)
    graph.connect(source, node.value)
    return node


def subscribe(name: str, *targets: Target[Any], **parameters: Any) -> Subscribe:
    """Send the values that another program publishes under a name to ports.

    Args:
      name: the common name, "camera/front".
      *targets: inputs, slots or parameters of one type, or outputs of the whole graph; the type has to be the
        publisher's.
      **parameters: parameters of `Subscribe`.

    Returns:
      The subscribing source, which was added to the first port's graph and connected to all ports.

    Raises:
      UsageError: there is no port, it does not belong to a graph yet, or the name is not valid.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import double
      >>> graph = hfg.Graph()
      >>> twice = graph.add(double())
      >>> hfg.subscribe("numbers", twice.value, overflow="latest").place.path
      'subscribe'
    """
    if not targets:
        raise UsageError(
            f'"{name}" is subscribed to without a port: pass the ports that receive the values and determine '
            f'their type, as in hfg.subscribe("{name}", viewer.picture)'
        )
    node = Subscribe(name=need_link_name(name), **parameters)
    graph = _graph_of(targets[0], "subscribe")
    graph.add(node)
    for target in targets:
        graph.connect(node.out, target)
    return node


def _graph_of(port: Any, verb: str) -> Graph:
    graph = getattr(port, "graph", None)
    if not isinstance(graph, Graph):
        what = (
            f'"{port.path}" does not belong to a graph yet' if hasattr(port, "path") else f"{port!r:.80} is not a port"
        )
        raise UsageError(f"cannot {verb}: {what}; add its node with graph.add(...) and pass one of its ports")
    return graph
