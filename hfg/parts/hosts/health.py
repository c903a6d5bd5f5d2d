"""A health endpoint for supervisors: `GET /live` and `GET /ready`, each 200 or 503 with the state as JSON.

The answer comes from the event loop, so a loop that hangs gives none. Requests change nothing and learn only the state;
those of web pages, which have an origin, are refused. It has no library because that would be one
more package in each container for two lines of text. Depends on nothing of hfg but errors.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any, Final

from hfg.errors import UsageError

_LONGEST: Final = 4096  # bytes of a request's head
_PATIENCE_S: Final = 2.0  # until that has arrived
_MOST: Final = 32  # connections at once

State = Callable[[], tuple[bool, Mapping[str, Any]]]
"""Whether the program is ready, and more about it."""


def address_of(text: str) -> tuple[str, int]:
    """Return host and port of "host:port".

    Raises:
      UsageError: the text is something else.
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 65535:
        raise UsageError(
            f'"{text:.100}" cannot be an address for the health check: write host:port, as in 127.0.0.1:8080'
        )
    return host, int(port)


@asynccontextmanager
async def healthy(address: str, state: State) -> AsyncIterator[int]:
    """Answer inside the block, at this address only; gives the port.

    Args:
      address: "host:port"; port 0 takes a free one.
      state: asked at each request.

    Raises:
      UsageError: it is something else, or cannot be listened at.
    """
    host, port = address_of(address)
    open_now: set[asyncio.StreamWriter] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(open_now) >= _MOST:
            writer.transport.abort()
            return
        open_now.add(writer)
        try:
            with contextlib.suppress(OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                async with asyncio.timeout(_PATIENCE_S):
                    head = await reader.readuntil(b"\r\n\r\n")
                    writer.write(answer(head, state))
                    await writer.drain()
        finally:
            open_now.discard(writer)
            writer.close()

    try:
        server = await asyncio.start_server(serve, host, port, limit=_LONGEST)
    except OSError as error:
        raise UsageError(f"the health check cannot listen at {address}: {error.strerror}") from None
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for writer in tuple(open_now):
            writer.transport.abort()


def answer(head: bytes, state: State) -> bytes:
    """Return the answer to the head of a request."""
    line, *fields = head.decode("latin-1").split("\r\n")
    method, _, path = line.rpartition(" ")[0].partition(" ")
    if any(field.lower().startswith("origin:") for field in fields):
        return _response("403 Forbidden", {"error": "web pages get no answer here"})
    if method not in ("GET", "HEAD"):
        return _response("405 Method Not Allowed", {"error": "only GET is answered"})
    if path not in ("/live", "/ready"):
        return _response("404 Not Found", {"error": "there are /live and /ready"})
    is_ready, more = state()
    is_well = is_ready or path == "/live"
    return _response("200 OK" if is_well else "503 Service Unavailable", more, with_body=method == "GET")


def _response(status: str, told: Mapping[str, Any], *, with_body: bool = True) -> bytes:
    body = json.dumps(told).encode() + b"\n"
    head = f"HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\n"
    return f"{head}Cache-Control: no-store\r\nConnection: close\r\n\r\n".encode() + (body if with_body else b"")
