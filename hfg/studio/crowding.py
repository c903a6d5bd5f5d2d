"""Limits the connections that hold no page, because each takes a file handle of the run (L5).

A program can connect before it is asked for the token; where the system cannot tell its user, any program. A browser
sends its request at once, so the oldest connection gives way to a new one. Depends on uvicorn.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final, cast

from typing_extensions import override
from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["MOST_CONNECTIONS", "bounded_http"]

MOST_CONNECTIONS: Final = 100
"""Connections of one server that are no WebSocket."""


def bounded_http(most: int = MOST_CONNECTIONS) -> type[H11Protocol]:
    """Return the protocol of one server; its connections are counted together."""
    waiting: dict[BoundedHttp, None] = {}

    class BoundedHttp(H11Protocol):
        """HTTP, until the connection becomes a WebSocket."""

        @override
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(cast("asyncio.Transport", transport))
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
