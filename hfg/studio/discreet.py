"""WebSockets that do not tell the log who may enter: logs are kept, sent on, and often readable by others (L5).

Depends on uvicorn.
"""

from __future__ import annotations

from typing import Any

from typing_extensions import override
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

__all__ = ["DiscreetWebSocket"]


class DiscreetWebSocket(WebSocketsSansIOProtocol):
    """A WebSocket; at level DEBUG its library would log each header, and so the cookie and the token."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.conn.debug = False

    @override
    def handle_connect(self, event: Any) -> None:
        """Let the application end the connection at once, which ASGI has no message for."""
        super().handle_connect(event)
        if self.handshake_initiated and not self.handshake_complete:
            self.scope["state"]["abort"] = self.transport.abort
