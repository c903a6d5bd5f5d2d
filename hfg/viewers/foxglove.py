"""The server for Foxglove: loopback only, with a token in the address, for chosen origins, and read-only.

It runs in a thread of its own, with the studio's server, so the graph does not wait for it. Depends on `channels`,
`looking`, starlette and the studio's server.
"""

from __future__ import annotations

import asyncio
import functools
import secrets
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, ClassVar, Final

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.websockets import WebSocket, WebSocketDisconnect
from typing_extensions import override

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.errors import TargetError, UsageError
from hfg.studio.entrance import is_loopback
from hfg.studio.serving import Server
from hfg.studio.web import listen
from hfg.viewers.channels import Channel, Channels
from hfg.viewers.looking import Looking, Viewer
from hfg.viewers.protocol import SUBPROTOCOLS

ORIGINS: Final = ("https://app.foxglove.dev", "file://")
"""Who may connect: Foxglove's web application; its desktop application, and Lichtblick's, whose page is a file."""

_LOGGER: Final = Log("hfg.viewers")
_GATHER_S: Final = 0.005
"""How long what passes is gathered before it is encoded."""

_PATIENCE_S: Final = 10.0
"""How long a viewer may read nothing although something waits for it."""

_LAST_S: Final = 1.0
"""How long viewers may take what is left when the run is over."""


class _Connection:
    """The connection to one viewer."""

    def __init__(self) -> None:
        self.wake = asyncio.Event()
        self._end: tuple[int, str] | None = None
        self._is_last = False

    def close(self, code: int, reason: str) -> None:
        """End it at once."""
        self._end = code, reason
        self.wake.set()

    def finish(self) -> None:
        """End it when everything is sent."""
        self._is_last = True
        self.wake.set()

    async def pump(self, socket: WebSocket, viewer: Viewer) -> None:
        """Send everything, until the end.

        Raises:
          TimeoutError: the viewer reads nothing.
        """
        while True:
            await self.wake.wait()
            self.wake.clear()
            while self._end is None and (message := viewer.take()) is not None:
                async with asyncio.timeout(_PATIENCE_S):
                    if isinstance(message, str):
                        await socket.send_text(message)
                    else:
                        await socket.send({"type": "websocket.send", "bytes": message})
            if self._end is None and self._is_last:
                self._end = 1001, "the run is over"
            if self._end is not None:
                async with asyncio.timeout(_PATIENCE_S):
                    await socket.close(*self._end)
                return


class _Server(Server):
    """The server of one run. Call its methods on its loop, unless they say otherwise."""

    ports: ClassVar[range] = range(8765, 8800)
    longest: ClassVar[int] = 1 << 20
    keeps_cookies: ClassVar[bool] = False

    def __init__(self, run: Run, origins: Iterable[str], host: str, port: int | None) -> None:
        self._origins = frozenset(origins)
        self._strangers: set[str] = set()
        self._connections: dict[Viewer, _Connection] = {}
        self._told: dict[Channel, None] = {}
        self._is_over = False
        super().__init__(None, host=host, port=port)
        self.address = self.address.replace("http://", "ws://", 1)
        channels = Channels(run, lambda channel: self._soon(self._tell, channel))
        engine = run._engine

        def wish(number: int, wanted: bool) -> None:
            with suppress(RuntimeError):  # the run's loop is closed
                engine.from_any_thread(functools.partial(channels.wish, number, wanted=wanted))

        self._looking = Looking(
            channels.of.values(),
            wish,
            virtual=engine.virtual,
            name=f"hfg {run.graph.name}",
            session=secrets.token_hex(8),
        )
        channels.when_changed = lambda new, gone: self._soon(self._looking.change, new, gone)
        self.close_channels = channels.close

    def _soon(self, do: Callable[..., object], *arguments: Any) -> None:
        """Do this on the server's loop; called from any thread."""
        with suppress(RuntimeError):  # the server has ended
            self.loop.call_soon_threadsafe(do, *arguments)

    def finish(self) -> None:
        """The run is over: end when viewers have what is left. Called from any thread."""
        self._soon(self._finish)

    def _finish(self) -> None:
        self._is_over = True
        self._deliver()
        for connection in self._connections.values():
            connection.finish()
        self.loop.call_later(_LAST_S if self._connections else 0, self.ask_to_end)

    def _tell(self, channel: Channel) -> None:
        if not self._told:
            self.loop.call_later(_GATHER_S, self._deliver)
        self._told[channel] = None

    def _deliver(self) -> None:
        told, self._told = self._told, {}
        for channel in told:
            self._looking.deliver(channel)

    # --- who comes ----------------------------------------------------------------------------------------------------

    @override
    def application(self, door: Any) -> Any:
        async def answer(scope: Any, receive: Any, send: Any) -> None:
            refusal = self._refusal(HTTPConnection(scope), scope)
            if refusal is not None:
                await PlainTextResponse(refusal[1] + "\n", refusal[0])(scope, receive, send)
                return
            scope["query_string"] = b""  # or the token would be logged
            await self._page(WebSocket(scope, receive, send))

        return answer

    def _refusal(self, connection: HTTPConnection, scope: Any) -> tuple[int, str] | None:
        origin, token = connection.headers.get("origin"), connection.query_params.get("token")
        if scope["type"] != "websocket":
            return (
                426,
                "this is for Foxglove: open connection, Foxglove WebSocket, and the address that hfg has printed",
            )
        if not self.entrance.is_host(connection.headers.get("host", "")):
            return 421, "this server is not called that: use the address that it has printed"
        if not (token is not None and self.entrance.is_token(token)):
            scope["query_string"] = b""
            return 401, "use the address that hfg has printed, with its token"
        if origin is not None and origin not in self._origins:
            self._tell_of(origin)
            return 403, "pages of this origin may not look"
        if not set(SUBPROTOCOLS) & set(scope["subprotocols"]):
            return 400, f"the subprotocol is {' or '.join(SUBPROTOCOLS)}"
        return None

    def _tell_of(self, origin: str) -> None:
        if origin not in self._strangers and len(self._strangers) < 10:
            self._strangers.add(origin)
            _LOGGER.warning(
                "a page of %r has the address of the viewers' server, and was refused: to let it in, add "
                "--foxglove-origin, or origins= in a program",
                origin[:80],
            )

    async def _page(self, socket: WebSocket) -> None:
        asked = socket.scope["subprotocols"]
        await socket.accept(next(one for one in SUBPROTOCOLS if one in asked))
        connection = _Connection()
        try:
            if self._is_over:
                raise UsageError("the run is over")
            viewer = self._looking.enter(connection.wake.set)
        except UsageError as error:
            await socket.close(1013, str(error))
            return
        self._connections[viewer] = connection
        pump = asyncio.create_task(connection.pump(socket, viewer), name="hfg viewer")
        pump.add_done_callback(functools.partial(_ended, socket, viewer))
        try:
            await listen(socket, viewer, connection, pump)
        finally:
            del self._connections[viewer]
            viewer.leave()
            pump.cancel()


def _ended(socket: WebSocket, viewer: Viewer, pump: asyncio.Task[None]) -> None:
    error = None if pump.cancelled() else pump.exception()
    if isinstance(error, TimeoutError):
        _LOGGER.warning(
            "a viewer has read nothing for %g s and was sent away, after %d messages that it was too slow for; the run "
            "has not waited for it",
            _PATIENCE_S,
            viewer.skipped,
        )
        socket.state.abort()
    elif error is not None and not isinstance(error, WebSocketDisconnect | RuntimeError | OSError):
        _LOGGER.error("a viewer could not be sent something", exc_info=error)
        socket.state.abort()


class FoxglovePage:
    """The server for viewers of one run; it ends with the run.

    Attributes:
      address: for Foxglove; it holds a token, so give it only to people who may see what passes in the graph.
    """

    def __init__(self, server: _Server) -> None:
        self._server = server
        self.address = server.address

    async def close(self) -> None:
        """End the server; the run continues."""
        self._server.close_channels()
        await self._server.stop()

    def join(self) -> None:
        """When the run is over, wait until viewers have the last messages: one second at most."""
        self._server.join()

    def __repr__(self) -> str:
        return f"<viewers of a run at {self.address.partition('?')[0]}>"


def serve_run(
    run: Run, *, host: str = "127.0.0.1", port: int | None = None, origins: Iterable[str] = ()
) -> FoxglovePage:
    """Implement `Run.foxglove`."""
    if not is_loopback(host):
        raise TargetError(
            f"viewers are served on this machine only, at 127.0.0.1, and not at {host}: messages are not encrypted; "
            "from another machine, go through ssh -L"
        )
    server = _Server(run, {*ORIGINS, *origins}, host, port)
    run._engine.callbacks.finished.append(server.finish)
    server.start()
    return FoxglovePage(server)
