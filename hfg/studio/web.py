"""The pages' server: static files, and a WebSocket for each page. Runs on a loop of its own (`serving`).

Depends on starlette and `entrance`; knows of the studio only how to enter it.
"""

from __future__ import annotations

import asyncio
import html
import time
from collections import deque
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any, Final, Protocol

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from hfg.base.logs import Log
from hfg.errors import HfgError, UsageError
from hfg.studio.entrance import Entrance
from hfg.studio.messages import LONGEST, SUBPROTOCOL
from hfg.studio.viewing import Frame

__all__ = ["Closing", "Door", "PageOutbox", "Visit", "application", "listen"]

_LOGGER: Final = Log("hfg.studio")
_MOST_FRAMES: Final = 1000
_MOST_BYTES: Final = 8 << 20
_BURST: Final = 400.0
_PER_SECOND: Final = 300.0
"""Messages of one page; one that sends more is read more slowly."""

_NOT_ALLOWED: Final = 4401
_Scope = MutableMapping[str, Any]


class Visit(Protocol):
    """A page in the studio; neither call waits."""

    def say(self, data: str | bytes) -> None:
        """The page says something.

        Raises:
          UsageError: it is not a message.
        """

    def leave(self) -> None:
        """The page is gone."""


class Closing(Protocol):
    """Ends the connection to a page."""

    def close(self, code: int, reason: str) -> None:
        """End it, when everything before is sent."""


class Door(Protocol):
    """The way into the studio."""

    async def enter(self, outbox: PageOutbox) -> Visit:
        """A page comes in."""


class PageOutbox:
    """Frames in transit to one page; filled from any thread, emptied on the server's loop.

    A page that takes nothing while the tables change is sent away: when it comes back it gets them as they are then.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._frames: deque[Frame] = deque()
        self._put = self._sent = 0  # bytes; each is written by one thread only
        self._wake = asyncio.Event()
        self._end: tuple[int, str] | None = None

    def put(self, frame: Frame) -> None:
        """See `Outbox`."""
        size = 0 if callable(frame.data) else len(frame.data)
        if self._end is not None:
            return
        if self._frames and (len(self._frames) >= _MOST_FRAMES or self._put - self._sent + size > _MOST_BYTES):
            self.close(1013, "the page is too slow; it comes back by itself")
            return
        self._put += size
        self._frames.append(frame)
        self._call(self._wake.set)

    def close(self, code: int, reason: str) -> None:
        """See `Outbox`."""
        if self._end is None:
            self._end = code, reason
            self._call(self._wake.set)

    def _call(self, do: Callable[[], object]) -> None:
        try:
            self._loop.call_soon_threadsafe(do)
        except RuntimeError:  # the server is gone
            self._frames.clear()

    async def pump(self, socket: WebSocket) -> None:
        """Send everything, until the page is sent away."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._frames:
                frame = self._frames.popleft()
                data = frame.data
                if callable(data):
                    data = await asyncio.to_thread(data) if frame.is_binary else data()
                else:
                    self._sent += len(data)
                await (socket.send_bytes(data) if frame.is_binary else socket.send_text(data.decode()))
            if self._end is not None:
                await socket.close(*self._end)
                return


class _Pace:
    """How fast a page may talk: what is more waits in the network."""

    def __init__(self) -> None:
        self._left = _BURST
        self._at = time.monotonic()

    async def wait(self) -> None:
        """Wait until the next message may be read."""
        now = time.monotonic()
        self._left = min(_BURST, self._left + (now - self._at) * _PER_SECOND) - 1.0
        self._at = now
        if self._left < 0:
            await asyncio.sleep(-self._left / _PER_SECOND)


class _Guard:
    """In front of everything: refuses requests that may not come in, and adds the security headers to every answer."""

    def __init__(self, app: Callable[..., Awaitable[None]], entrance: Entrance) -> None:
        self._app = app
        self._entrance = entrance

    async def __call__(self, scope: _Scope, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        refusal = self._refusal(connection, scope["type"] == "websocket")
        if scope["type"] == "websocket":
            if refusal is not None:
                await receive()
                await send({"type": "websocket.close", "code": _NOT_ALLOWED, "reason": refusal[1]})
                return
            await self._app(scope, receive, send)
            return
        answer: Any = self._app if refusal is None else PlainTextResponse(refusal[1] + "\n", refusal[0])
        if refusal is None and "token" in connection.query_params:
            # After a redirect the browser would keep the cookie back (SameSite=Strict), because a file has led here.
            leads = f'<!doctype html><meta http-equiv="refresh" content="0; url={html.escape(connection.url.path)}">'
            answer = HTMLResponse(leads, 200, {"set-cookie": self._entrance.set_cookie})

        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                headers = [(name, value) for name, value in message.get("headers", []) if name != b"cache-control"]
                message["headers"] = headers + [
                    (n.lower().encode(), v.encode()) for n, v in self._entrance.headers.items()
                ]
            await send(message)

        await answer(scope, receive, with_headers)

    def _refusal(self, connection: HTTPConnection, is_socket: bool) -> tuple[int, str] | None:
        entrance, headers = self._entrance, connection.headers
        host = headers.get("host", "")
        if not entrance.is_host(host):
            return 421, "this studio is not called that: use the address that it has printed"
        if entrance.is_bearer(headers.get("authorization")):
            return None
        token = connection.query_params.get("token")
        if token is not None and not is_socket:
            return None if entrance.is_token(token) else (403, "this is not the token of this studio")
        if not entrance.is_cookie(connection.cookies.get(entrance.cookie)):
            return 401, "open the address that the studio has printed: it holds the token"
        if is_socket and not entrance.is_origin(headers.get("origin"), host):
            return 403, "another page asks"
        return None


class _Files(StaticFiles):
    """The built page; "/" is its index."""

    async def get_response(self, path: str, scope: Any) -> Response:
        try:
            return await super().get_response(path, scope)
        except HTTPException as error:
            if error.status_code == 404 and path in (".", "index.html"):
                return PlainTextResponse(
                    "The page of the studio is not in this installation: install hfg from a wheel, or build it with "
                    "npm ci && npm run build in web/\n",
                    200,
                )
            raise


def application(door: Door, entrance: Entrance, static: Path) -> Any:
    """Make the server's application."""

    async def page(socket: WebSocket) -> None:
        if SUBPROTOCOL not in socket.scope.get("subprotocols", ()):
            await socket.close(1008, f"the subprotocol is {SUBPROTOCOL}")
            return
        await socket.accept(SUBPROTOCOL)
        outbox = PageOutbox()
        try:
            visit = await door.enter(outbox)
        except HfgError as error:
            await socket.close(1013, str(error)[:100])
            return
        pump = asyncio.create_task(outbox.pump(socket), name="hfg studio page")
        try:
            await listen(socket, visit, outbox, pump)
        finally:
            visit.leave()
            pump.cancel()

    routes = [
        WebSocketRoute("/ws", page),
        Mount("/", _Files(directory=static, html=True, check_dir=False)),
    ]
    return _Guard(Starlette(routes=routes), entrance)


async def listen(socket: WebSocket, visit: Visit, outbox: Closing, pump: asyncio.Task[None]) -> None:
    """Read what a page says until one side is gone."""
    pace = _Pace()
    pump.add_done_callback(_told)
    try:
        while socket.client_state == WebSocketState.CONNECTED and not pump.done():
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("text")
            if data is None:
                outbox.close(1008, "a page says text")
                continue
            if len(data) > LONGEST:
                outbox.close(1009, f"a message has {LONGEST} bytes at most")
                continue
            try:
                visit.say(data)
            except UsageError as error:
                outbox.close(1008, str(error)[:100])
            await pace.wait()
    except (WebSocketDisconnect, RuntimeError):
        return


def _told(task: asyncio.Task[None]) -> None:
    """Log failures, except of a page that left while a frame was sent to it."""
    error = None if task.cancelled() else task.exception()
    if error is not None and not isinstance(error, WebSocketDisconnect | RuntimeError | OSError):
        _LOGGER.error("a page could not be sent something", exc_info=error)
