"""What servers have in common: where they listen, whom they let in, and a line of what their clients say.

Depends on `_connection` and hosts.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from typing import Any, ClassVar, Final

import anyio
from annotated_types import Ge, Interval

from hfg.base.hosts import Hosts, is_loopback
from hfg.base.loopback import OwnListener
from hfg.nodes.buses._connection import Connection, Message, Sender, parted
from hfg.nodes.buses._failures import Refused
from hfg.nodes.buses._forms import BadMessage
from hfg.nodes.buses._secrets import server_tls
from hfg.ports import Event, Parameter
from hfg.ports.events import EventPort

_ANY: Final = ("0.0.0.0", "::")


class Door(Connection):
    """A server, which lives while its node is active.

    Attributes:
      host: where it listens; empty: on this computer only, for programs of this user; otherwise an address of this
        computer, which lets in whoever can reach it.
      port: its port; 0: any free one, which `connected` tells.
      certificate: a file with its certificate; empty: it does not encrypt.
      key: a file with the key of the certificate, which only this user can read; empty: it is in the same file.
      insecure: other computers may be served without encryption, which is logged at each start.
      most_clients: connections at a time; more are turned away and counted.
    """

    host = Parameter("")
    port = Parameter(0, Interval(ge=0, le=65535))
    certificate = Parameter("")
    key = Parameter("")
    insecure = Parameter(False)
    most_clients = Parameter(1000, Ge(1))

    scheme: ClassVar[str] = "tcp"

    def address(self) -> str:
        """Return where it listens."""
        here = self.host or "127.0.0.1"
        here = f"[{here}]" if ":" in here else here
        return f"{self.scheme}{'s' if self.certificate else ''}://{here}:{getattr(self, '_port_taken', 0) or self.port}"

    def open_door(self) -> tuple[socket.socket, ssl.SSLContext | None]:
        """Return a socket that listens, and what the server proves itself with.

        Raises:
          Refused: other computers would be served without encryption, or the certificate cannot be used.
          OSError: the port is in use.
        """
        self._port_taken = 0
        self._line: asyncio.Queue[Any] = asyncio.Queue(1)
        tls = server_tls(self.certificate, self.key)
        host = self.host or "127.0.0.1"
        if not is_loopback(host) and tls is None:
            if not self.insecure:
                raise Refused(
                    "other computers would be served without encryption: set the parameters certificate and key, or "
                    "insecure=True"
                )
            self.log.warning("%s: it serves other computers without encryption (insecure=True)", self.address())
        kind = socket.socket if self.host else OwnListener
        listening = kind(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((host, self.port))
            listening.listen()
            listening.setblocking(False)
        except BaseException:
            listening.close()
            raise
        self._port_taken = listening.getsockname()[1]
        self.hosts = Hosts(host, self._port_taken, encrypted=tls is not None)
        return listening, tls

    async def put(self, heard: Any) -> None:
        """Let the graph have something that a client says; the client waits until it has room."""
        await self._line.put(heard)

    async def read(self, link: Any) -> None:
        """Hear all clients, in the order in which they come."""
        while True:
            await self.take(await self._line.get())

    async def take(self, heard: Any) -> None:
        """Send on what a client has said."""
        raise NotImplementedError


class Gateway(Door, Sender):
    """A server whose clients are spoken with one by one.

    Attributes:
      message: what is sent: a `Message` to the client that it names, anything else to all clients.
      received: a `Message` with what a client said, and the name of the client.
      joined: a client has come; its name.
      left: a client has gone; its name.
      invalid: a message was skipped: too long, or not of the form; why.
    """

    received = Event(Message)
    joined = Event(str)
    left = Event(str)
    invalid = Event(str)
    hears: ClassVar[tuple[str, ...]] = ("received", "joined", "left")

    def packed(self, message: Any) -> tuple[bytes, str]:
        """Return the bytes, and the client that they go to."""
        value, to = parted(message)
        return self.as_bytes(value), to

    async def serve(self, clients: Clients, client: Any, messages: AsyncIterator[bytes | BadMessage]) -> None:
        """Hear one client until it goes."""
        name = clients.admit(client)
        if name is None:
            return
        try:
            await self.put((self.joined, name, None))
            with suppress(OSError, EOFError):  # it has gone
                async for message in messages:
                    await self.put((self.received, name, message))
        finally:
            del clients.here[name]
        await self.put((self.left, name, None))

    async def take(self, heard: tuple[EventPort[Any], str, bytes | BadMessage | None]) -> None:
        """Send on what a client has said or done."""
        event, name, message = heard
        if message is None:
            await event.trigger_wait(name)
        else:
            await self.hear(message, self.form, event, address=name)

    async def write(self, link: Clients, message: tuple[bytes, str]) -> None:
        """Send to one client or all."""
        await link.say(message[1], message[0])


class Clients:
    """The clients of a server by their names, and sending to one or all of them.

    Args:
      node: whose they are; it counts.
      say: sends to one.
      drop: breaks one off.
    """

    def __init__(self, node: Door, say: Callable[[Any, bytes], Awaitable[None]], drop: Callable[[Any], None]) -> None:
        self.here: dict[str, Any] = {}
        self._node, self._say, self._drop = node, say, drop
        self._last = 0

    def admit(self, client: Any) -> str | None:
        """Return the name of a new client; None if there are too many."""
        if len(self.here) >= self._node.most_clients:
            self._node._counts["turned away"] += 1
            return None
        self._last += 1
        self._node._counts["clients"] += 1
        name = str(self._last)
        self.here[name] = client
        return name

    async def say(self, name: str, data: bytes) -> None:
        """Send to one client, or to all; one that takes nothing for too long is broken off, and counted."""
        chosen = list(self.here) if not name else [name] if name in self.here else []
        if name and not chosen:
            self._node._counts["no such client"] += 1
        if len(chosen) == 1:
            await self._one(chosen[0], data)
        elif chosen:
            async with anyio.create_task_group() as group:
                for one in chosen:
                    group.start_soon(self._one, one, data)

    async def _one(self, name: str, data: bytes) -> None:
        client = self.here.get(name)
        try:
            async with asyncio.timeout(self._node.timeout_s):
                await self._say(client, data)
        except TimeoutError:
            self._node._counts["too slow"] += 1
            self._node.log.warning("%s: client %s took nothing for too long", self._node.address(), name)
            self._drop(client)
        except (OSError, EOFError):
            self._node._counts["gone while sending"] += 1
