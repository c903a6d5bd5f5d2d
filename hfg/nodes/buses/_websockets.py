"""WebSockets, as a client and as a server. Depends on `_web`, and on websockets when it is used."""

from __future__ import annotations

import asyncio
import http
import logging
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Any, ClassVar, Final, Literal

from annotated_types import MinLen

from hfg.nodes._extras import require
from hfg.nodes.buses._connection import Sender
from hfg.nodes.buses._failures import Lost, Refused, printable
from hfg.nodes.buses._secrets import NO_SECRET, client_tls
from hfg.nodes.buses._servers import Clients, Gateway
from hfg.nodes.buses._web import DENIED, WebClient, WebDoor
from hfg.ports import Event, Parameter

_PING_S: Final = 20.0
_WAITING: Final = 4  # messages that the library reads ahead


def _library() -> Any:
    """Return the package, which says in the log what this module says in its own words."""
    require("websockets", "websockets")
    for name in ("websockets.client", "websockets.server"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return require("websockets.exceptions", "websockets")


@contextmanager
def _explaining(errors: Any) -> Iterator[None]:
    """Raise errors of the library as ours."""
    try:
        yield
    except errors.InvalidStatus as error:
        status = error.response.status_code
        kind = Refused if status in DENIED else Lost
        raise kind(f"the server answers with status {status}{_said(status)}") from None
    except (errors.InvalidURI, errors.InvalidHandshake) as error:
        raise Lost(f"it is no WebSocket server ({printable(error)})") from None
    except errors.ConnectionClosed as error:
        raise Lost(f"the connection was closed ({printable(error)})") from None


def _said(status: int) -> str:
    if status not in DENIED:
        return ""
    return f" ({http.HTTPStatus(status).phrase}); look at the parameters user and secret"


class WebSocketClient(WebClient, Sender):
    """Speak with a WebSocket server: send values, and hear its messages.

    A server that does not answer pings for 20 s is given up. Messages that the system had accepted may be lost with a
    connection. Needs `hfg[websockets]`.

    Attributes:
      url: where the server is: "ws://host:port/path", or "wss://" if it is encrypted and the server proves itself.
      at_end: what to do when the server closes the connection in an orderly way: "reconnect", or "end".
      received: each message of the server.
      invalid: a message was skipped because it is not of the form; why.

    Raises:
      ModuleNotFoundError: websockets is not installed.
    """

    url = Parameter("ws://127.0.0.1:8000", NO_SECRET, MinLen(1))
    at_end = Parameter("reconnect", type=Literal["reconnect", "end"])
    received = Event(Any)
    invalid = Event(str)

    async def setup(self) -> None:
        """See whether the package is there."""
        self._errors = _library()
        await super().setup()

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Any]:
        """Connect."""
        from websockets.asyncio.client import connect

        encrypted = self.need_scheme("ws", "wss")
        connecting = connect(
            self.url,
            additional_headers=await asyncio.to_thread(self.all_headers),
            ssl=client_tls(self.ca_file) if encrypted else None,
            max_size=self.most_bytes,
            max_queue=_WAITING,
            compression=None,
            proxy=None,
            open_timeout=None,
            close_timeout=1.0,
            ping_interval=_PING_S,
            ping_timeout=_PING_S,
            write_limit=0,
        )
        connecting.process_redirect = lambda exc: exc  # type: ignore[method-assign]  # the graph says where to go
        with _explaining(self._errors):
            async with connecting as socket:
                yield socket

    async def read(self, link: Any) -> None:
        """Hear the server."""
        with _explaining(self._errors):
            try:
                while True:
                    await self.hear(await link.recv(decode=False), self.form, self.received)
            except self._errors.ConnectionClosedOK:
                if self.at_end == "reconnect" and not self._finishing.is_set():
                    raise Lost("the server has closed the connection") from None

    async def write(self, link: Any, message: bytes) -> None:
        """Send a message; it has arrived when the system of this computer has it."""
        with _explaining(self._errors):
            await link.send(message, text=self.form != "bytes")

    async def finish(self, link: Any) -> None:
        """Close: a WebSocket has no other way to say that nothing more comes."""
        await link.close()


class WebSocketServer(WebDoor, Gateway):
    """Serve WebSocket clients, browsers too: hear each of them, and answer one or all.

    A client that says more than the graph takes is slowed down; one that takes nothing for `timeout_s`, or does not
    answer pings for 20 s, is broken off. A page of another server is refused unless `origins` has it. Needs
    `hfg[websockets]`.

    Raises:
      ModuleNotFoundError: websockets is not installed.
    """

    scheme: ClassVar[str] = "ws"
    hears: ClassVar[tuple[str, ...]] = Gateway.hears

    async def setup(self) -> None:
        """See whether the package is there."""
        self._errors = _library()
        await super().setup()

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Clients]:
        """Listen."""
        from websockets.asyncio.server import serve

        listening, tls = self.open_door()
        clients = Clients(self, self._say, lambda one: one.transport.abort())

        async def met(socket: Any) -> None:
            await self.serve(clients, socket, self._messages(socket))

        server = await serve(
            met,
            sock=listening,
            ssl=tls,
            process_request=self._judge,
            max_size=self.most_bytes,
            max_queue=_WAITING,
            compression=None,
            open_timeout=self.timeout_s,
            close_timeout=1.0,
            ping_interval=_PING_S,
            ping_timeout=_PING_S,
            write_limit=0,
            server_header=None,
        )
        try:
            yield clients
        finally:
            server.close()
            for one in list(server.handler_tasks):
                one.cancel()
            await server.wait_closed()

    async def _judge(self, socket: Any, request: Any) -> Any:
        """Refuse requests that were not meant for this server, or come from strange pages."""
        try:
            said = [request.headers.get(name) for name in ("Host", "Origin", "Authorization")]
        except LookupError:  # one of them twice
            self._counts["refused"] += 1
            return socket.respond(400, "a header stands there twice\n")
        refused = await asyncio.to_thread(self.refusal, said[0] or "", said[1], said[2] or "")
        return None if refused is None else socket.respond(refused[0], f"{refused[1]}\n")

    async def _messages(self, socket: Any) -> AsyncIterator[bytes]:
        try:
            while True:
                yield await socket.recv(decode=False)
        except self._errors.ConnectionClosed as error:
            if error.rcvd is None and error.sent is not None and error.sent.code in (1007, 1009):
                self._counts["too long"] += error.sent.code == 1009
                self.log.warning("%s: a client was broken off: %s", self.address(), printable(error))

    async def _say(self, client: Any, data: bytes) -> None:
        try:
            await client.send(data, text=self.form != "bytes")
        except self._errors.ConnectionClosed as error:
            raise EOFError(str(error)) from None
