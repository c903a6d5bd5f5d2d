"""Limits the connections that hold no page, because each takes a file handle of the run (L5).

A program can connect before it is asked for the token; where the system cannot tell its user, any program. A browser
sends its request at once, so the oldest connection gives way to a new one. This also holds for connections that do not
speak TLS yet. Depends on uvicorn.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, Final, cast

from typing_extensions import override
from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["MOST_CONNECTIONS", "CrowdedListener", "bounded_http"]

MOST_CONNECTIONS: Final = 100
"""Connections of one server that are no WebSocket."""


class CrowdedListener(socket.socket):
    """A TCP socket that counts the connections that are not made yet, because they have not done their part of TLS.

    Attributes:
      coming: they by their addresses, the oldest first.
    """

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.coming: dict[Any, socket.socket] = {}

    @override
    def accept(self) -> tuple[socket.socket, Any]:
        connected, address = super().accept()
        self.coming = {one: there for one, there in self.coming.items() if there.fileno() >= 0}
        self.coming[address] = connected
        if len(self.coming) > MOST_CONNECTIONS:
            oldest = self.coming.pop(next(iter(self.coming)))
            with suppress(OSError):  # it has gone
                oldest.shutdown(socket.SHUT_RDWR)  # not closed: the event loop does that, when it sees the end
        return connected, address


def bounded_http(listeners: Iterable[socket.socket] = (), most: int = MOST_CONNECTIONS) -> type[H11Protocol]:
    """Return the protocol of one server; its connections are counted together."""
    crowded = [one for one in listeners if isinstance(one, CrowdedListener)]
    waiting: dict[BoundedHttp, None] = {}

    class BoundedHttp(H11Protocol):
        """HTTP, until the connection becomes a WebSocket."""

        @override
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(cast("asyncio.Transport", transport))
            for one in crowded:
                one.coming.pop(transport.get_extra_info("peername"), None)
            waiting[self] = None
            if len(waiting) > most:
                oldest = next(iter(waiting))
                del waiting[oldest]
                oldest.transport.abort()

        @override
        def connection_lost(self, exc: Exception | None) -> None:
            waiting.pop(self, None)
            super().connection_lost(exc)

        @override
        def handle_websocket_upgrade(self, event: Any) -> None:
            waiting.pop(self, None)
            super().handle_websocket_upgrade(event)

    return BoundedHttp
