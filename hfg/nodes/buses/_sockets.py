"""TCP as a server, and UDP. Depends on `_servers` and `_streams`."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, ClassVar, Final

import anyio
from annotated_types import Ge, Interval

from hfg.nodes.buses._connection import Message, Sender, parted
from hfg.nodes.buses._failures import Lost
from hfg.nodes.buses._forms import BadMessage
from hfg.nodes.buses._servers import Clients, Gateway
from hfg.nodes.buses._streams import Stream, StreamSender, keep_alive
from hfg.ports import Event, Parameter

_OVERFLOWS: Final = 40  # SO_RXQ_OVFL of Linux: the system counts the datagrams that it had no room for
_COUNT: Final = struct.Struct("=I")
_ANSWERS: Final = 256  # bytes for what the system says about a datagram


class TcpServer(Gateway, StreamSender):
    """Serve TCP clients: hear each of them, and answer one or all.

    A client that says more than the graph takes is slowed down; one that takes nothing for `timeout_s` is broken off.

    Attributes:
      linger_s: how long a client that has said its last can still be answered.
    """

    linger_s = Parameter(1.0, Ge(0), unit="s")
    hears: ClassVar[tuple[str, ...]] = Gateway.hears

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Clients]:
        """Listen."""
        listening, tls = self.open_door()
        clients = Clients(self, self._say, lambda one: one.writer.transport.abort())
        under_way: set[asyncio.Task[Any]] = set()

        async def met(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            under_way.add(task)
            writer.transport.set_write_buffer_limits(0)
            keep_alive(writer.get_extra_info("socket"))
            try:
                await self.serve(clients, Stream(reader, writer), self._until_gone(reader))
            except asyncio.CancelledError:
                pass  # the server goes
            finally:
                under_way.discard(task)
                writer.close()

        server = await asyncio.start_server(met, sock=listening, ssl=tls)
        try:
            yield clients
        finally:
            server.close()
            for one in list(under_way):
                one.cancel()
            await asyncio.gather(*under_way, return_exceptions=True)

    async def _until_gone(self, reader: asyncio.StreamReader) -> AsyncIterator[bytes | BadMessage]:
        async for message in self.messages(reader):
            yield message
        await asyncio.sleep(self.linger_s)

    async def _say(self, client: Stream, data: bytes) -> None:
        client.writer.write(data)
        await client.writer.drain()


class Udp(Sender):
    """Send and hear datagrams.

    UDP promises nothing: what the system has no room for is counted ("overflowed"); what the network loses is
    unknown. A slow graph lets the system's queue overflow.

    Attributes:
      host: where messages go that name no address.
      port: its port.
      bind: the address of this computer at which it hears; empty: this computer only.
      bind_port: the port at which it hears; 0: any free one, so that only answers are heard.
      broadcast: messages may go to all computers of a network.
      message: what is sent: a `Message` to its address, "host:port", anything else to `host`.
      received: a `Message` with what a datagram says, and the address that it came from.
      invalid: a datagram was skipped: too long, or not of the form; why.
    """

    host = Parameter("127.0.0.1")
    port = Parameter(7000, Interval(ge=1, le=65535))
    bind = Parameter("")
    bind_port = Parameter(0, Interval(ge=0, le=65535))
    broadcast = Parameter(False)
    most_bytes = Parameter(1472, Interval(ge=1, le=65507))
    received = Event(Message)
    invalid = Event(str)

    def address(self) -> str:
        """Return where it hears."""
        return f"udp://{self.bind or '127.0.0.1'}:{getattr(self, '_port_taken', 0) or self.bind_port}"

    def packed(self, message: Any) -> tuple[bytes, tuple[str, int]]:
        """Return the bytes, and where they go."""
        value, to = parted(message)
        host, _, port = to.rpartition(":") if to else (self.host, ":", str(self.port))
        if not host or not port.isdecimal():
            raise ValueError(f'"{to}" is not the address of a datagram; write "host:port"')
        return self.as_bytes(value), (host.strip("[]"), int(port))

    @asynccontextmanager
    async def link(self) -> AsyncIterator[socket.socket]:
        """Take a port."""
        here = self.bind or ("::1" if ":" in self.host else "127.0.0.1" if self._is_near() else "")
        with socket.socket(socket.AF_INET6 if ":" in (here or self.host) else socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.setblocking(False)
            if self.broadcast:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            one.setsockopt(socket.SOL_SOCKET, _OVERFLOWS, 1)
            one.bind((here, self.bind_port))
            self._port_taken = one.getsockname()[1]
            yield one

    def _is_near(self) -> bool:
        """Return whether it needs no more than this computer: answers of others come only where others are asked."""
        return bool(self.bind_port) or self.host in ("localhost", "127.0.0.1")

    async def read(self, link: socket.socket) -> None:
        """Hear datagrams."""
        overflowed = 0
        while True:
            await anyio.wait_readable(link)
            try:
                data, said, _, sender = link.recvmsg(self.most_bytes + 1, _ANSWERS)
            except BlockingIOError:
                continue
            except ConnectionError:
                continue  # an earlier datagram of ours found no receiver
            for level, kind, count in said:
                if (level, kind) == (socket.SOL_SOCKET, _OVERFLOWS):
                    (lost,) = _COUNT.unpack_from(count)
                    self._counts["overflowed"] += lost - overflowed
                    overflowed = lost
            heard = data if len(data) <= self.most_bytes else BadMessage("a datagram is too long, and was skipped")
            await self.hear(heard, self.form, self.received, address=_named(sender))

    async def write(self, link: socket.socket, message: tuple[bytes, tuple[str, int]]) -> None:
        """Send a datagram; the system has it then."""
        data, to = message
        try:
            await asyncio.get_running_loop().sock_sendto(link, data, to)
        except OSError as error:
            if isinstance(error, ConnectionError):
                self._counts["found nobody"] += 1
                return
            raise Lost(f"a datagram to {to[0]} cannot be sent: {error.strerror}") from None


def _named(sender: tuple[Any, ...]) -> str:
    host, port = sender[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
