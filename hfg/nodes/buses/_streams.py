"""Streams of bytes: TCP as a client, a serial line. Depends on `_connection`; serial lines on pyserial-asyncio-fast."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, Final, Literal, NamedTuple

from annotated_types import Ge, Interval, MinLen

from hfg.nodes._extras import require
from hfg.nodes.buses._connection import Sender
from hfg.nodes.buses._failures import Lost, Refused
from hfg.nodes.buses._forms import BadMessage, Framing, Splitter, framed
from hfg.nodes.buses._secrets import client_tls
from hfg.ports import Event, Parameter

_CHUNK: Final = 65536


class Stream(NamedTuple):
    """Both directions of a stream."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter


class StreamSender(Sender):
    """A connection whose messages stand in a stream of bytes.

    Attributes:
      framing: "lines": a message is a line, without its end; "bytes": what arrives together.
      invalid: a message was skipped: too long, or not of the form; why.
    """

    framing = Parameter("lines", type=Framing)
    invalid = Event(str)

    async def messages(self, reader: asyncio.StreamReader) -> AsyncIterator[bytes | BadMessage]:
        """Yield the messages of a stream until it ends."""
        splitter = Splitter(self.framing, self.most_bytes)
        seen, data = 0, b"first"
        while data:
            data = await reader.read(_CHUNK)
            for message in splitter.feed(data) if data else splitter.finish():
                yield message
            for _ in range(splitter.too_long - seen):
                yield BadMessage(f"a line has more than {self.most_bytes:,} bytes, and was skipped")
            seen = splitter.too_long

    def as_bytes(self, value: Any) -> bytes:
        """Return a value as it stands in the stream."""
        return framed(super().as_bytes(value), self.framing)


class StreamClient(StreamSender):
    """One stream in each direction.

    Attributes:
      received: each message of the other side.
    """

    received = Event(Any)

    async def read(self, link: Stream) -> None:
        """Hear messages until the other side ends."""
        async for message in self.messages(link.reader):
            await self.hear(message, self.form, self.received)

    async def write(self, link: Stream, message: bytes) -> None:
        """Send a message; it has arrived when the system of this computer has it."""
        link.writer.write(message)
        await link.writer.drain()

    async def finish(self, link: Stream) -> None:
        """Say that nothing more comes."""
        if link.writer.can_write_eof():
            link.writer.write_eof()


@asynccontextmanager
async def closing(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> AsyncIterator[Stream]:
    """Close a stream in the end, after all data was written."""
    writer.transport.set_write_buffer_limits(0)  # so `drain` returns when the system has everything
    try:
        yield Stream(reader, writer)
    finally:
        writer.close()
        try:
            async with asyncio.timeout(1.0):
                await writer.wait_closed()
        except OSError:  # in time or not
            writer.transport.abort()


def keep_alive(connected: Any) -> None:
    """Let the system find out within two minutes that the other computer has gone."""
    for option, value in (("SO_KEEPALIVE", 1), ("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 15), ("TCP_KEEPCNT", 4)):
        level = socket.SOL_SOCKET if option.startswith("SO_") else socket.IPPROTO_TCP
        if hasattr(socket, option):
            connected.setsockopt(level, getattr(socket, option), value)


class TcpClient(StreamClient):
    """Speak with a TCP server: send values, and hear its messages.

    Without an address it looks on this computer. TCP does not tell what has arrived: what the system had taken over
    when a connection was lost may be lost, and the other side has to count.

    Attributes:
      host: where the server is; a name or an address.
      port: its port.
      tls: whether the connection is encrypted and the server has to prove itself; then the end of the inputs cannot be
        told, and the connection stays open as long as it is heard.
      ca_file: a file with the authorities that are believed; empty: those of this computer.
      at_end: what to do when the server closes the connection in an orderly way: "reconnect", or "end".
    """

    host = Parameter("127.0.0.1", MinLen(1))
    port = Parameter(7000, Interval(ge=1, le=65535))
    tls = Parameter(False)
    ca_file = Parameter("")
    at_end = Parameter("reconnect", type=Literal["reconnect", "end"])

    def address(self) -> str:
        """Return where the server is."""
        return f"{'tls' if self.tls else 'tcp'}://{_with_port(self.host, self.port)}"

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Stream]:
        """Connect."""
        tls = client_tls(self.ca_file) if self.tls else None
        reader, writer = await asyncio.open_connection(self.host, self.port, ssl=tls)
        keep_alive(writer.get_extra_info("socket"))
        async with closing(reader, writer) as stream:
            yield stream

    async def read(self, link: Stream) -> None:
        """Hear the server."""
        await super().read(link)
        if self.at_end == "reconnect" and not self._finishing.is_set():
            raise Lost("the server has closed the connection")


def _with_port(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


class SerialLine(StreamClient):
    """Speak with a device at a serial line, such as a USB adapter.

    A device that is pulled out is waited for. Needs `hfg[serial]`.

    Attributes:
      device: its file, such as "/dev/ttyUSB0", or a URL that pyserial understands.
      baud: bits per second.
      parity: "none", "even" or "odd".
      stop_bits: 1 or 2.

    Raises:
      ModuleNotFoundError: pyserial-asyncio-fast is not installed.
    """

    device = Parameter("/dev/ttyUSB0", MinLen(1))
    baud = Parameter(115200, Ge(50))
    parity = Parameter("none", choices=("none", "even", "odd"))
    stop_bits = Parameter(1, choices=(1, 2))

    async def setup(self) -> None:
        """See whether the package is there."""
        self._serial = require("serial_asyncio_fast", "serial")
        await super().setup()

    def address(self) -> str:
        """Return the device."""
        return self.device

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Stream]:
        """Open the device, for this program only."""
        try:
            reader, writer = await self._serial.open_serial_connection(
                url=self.device,
                baudrate=self.baud,
                parity=self.parity[0].upper(),
                stopbits=self.stop_bits,
                exclusive=True,
            )
        except ValueError as error:
            raise Refused(str(error)) from None
        async with closing(reader, writer) as stream:
            yield stream

    async def read(self, link: Stream) -> None:
        """Hear the device."""
        await super().read(link)
        raise Lost("the device was pulled out")
