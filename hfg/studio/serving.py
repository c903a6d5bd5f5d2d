"""The server's thread: its loop is not the graph's, so neither waits for the other.

Depends on uvicorn, `crowding`, `discreet` and `web`.
"""

from __future__ import annotations

import asyncio
import errno
import os
import socket
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

import uvicorn

from hfg.base.logs import Log
from hfg.base.loopback import OwnListener
from hfg.base.private import exposure_of_key
from hfg.errors import TargetError
from hfg.studio.cookies import forget_secret, secret_of
from hfg.studio.crowding import CrowdedListener, bounded_http
from hfg.studio.discreet import DiscreetWebSocket
from hfg.studio.entrance import Entrance, is_loopback, need_guarded
from hfg.studio.messages import LONGEST, FromPage, read
from hfg.studio.studio import Studio
from hfg.studio.viewing import Viewer
from hfg.studio.web import PageOutbox, application

__all__ = ["STATIC", "Server", "StudioDoor"]

STATIC: Final = Path(__file__).with_name("static")
"""The built page; HFG_STUDIO_STATIC names another folder, for those who work on the page."""

_LOGGER: Final = Log("hfg.studio")
_LOCALHOST: Final = ("127.0.0.1", "::1")
_NO_SUCH_ADDRESS: Final = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)


class _Visit:
    """One page, seen from the server's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, studio: Studio, viewer: Viewer) -> None:
        self._loop = loop
        self._studio = studio
        self._viewer = viewer

    def say(self, data: str | bytes) -> None:
        message: FromPage = read(data)
        self._call(self._studio.receive, self._viewer, message)

    def leave(self) -> None:
        self._call(self._studio.leave, self._viewer)

    def _call(self, do: Callable[..., object], *arguments: Any) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(do, *arguments)


class StudioDoor:
    """Lets pages into a studio on another loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop, studio: Studio) -> None:
        self._loop = loop
        self._studio = studio

    async def enter(self, outbox: PageOutbox) -> _Visit:
        """See `Door`."""

        async def entered() -> Viewer:
            return self._studio.enter(outbox)

        viewer = await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(entered(), self._loop))
        return _Visit(self._loop, self._studio, viewer)


class Server:
    """Serves pages from a thread of its own.

    Attributes:
      address: what the user opens, with the token.
      loop: of the thread, from `start` on.
      ports: those that are tried if none is given.
      longest: message of a page, in bytes.
      keeps_cookies: a page that comes back to the same port after a restart may enter again.
    """

    loop: asyncio.AbstractEventLoop
    ports: ClassVar[range] = range(8800, 8900)
    longest: ClassVar[int] = LONGEST
    keeps_cookies: ClassVar[bool] = True

    def __init__(
        self,
        door: Any,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        certfile: str | None = None,
        keyfile: str | None = None,
        insecure: bool = False,
        embedded: bool = False,
    ) -> None:
        """Take the port.

        Raises:
          TargetError: it is in use, other machines would come in unencrypted, or others know the key.
        """
        encrypted = certfile is not None
        need_guarded(host, encrypted=encrypted, insecure=insecure)
        if certfile is not None:
            _need_secret(keyfile or certfile)
        self._sockets = _listening(host, [*self.ports, 0] if port is None else [port])
        port = int(self._sockets[0].getsockname()[1])
        if sys.platform == "linux" and any(
            isinstance(one, OwnListener) and not one.is_guarded for one in self._sockets
        ):
            _LOGGER.warning(
                "port %d: this system does not tell whose programs connect (sock_diag), so only the token and the "
                "cookie keep other users of the computer away",
                port,
            )
        shown = socket.gethostname() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        names = () if shown == host else (shown,)
        # A cookie that the network may have heard opens no other server.
        kept = f"{port}-tls" if encrypted else f"{port}" if is_loopback(host) else ""
        self._kept = kept if self.keeps_cookies else ""
        secret = secret_of(self._kept) if self._kept else None
        self.entrance = Entrance(host, port, encrypted=encrypted, names=names, embedded=embedded, secret=secret)
        self.address = f"{'https' if encrypted else 'http'}://{shown}:{port}/?token={self.entrance.token}"
        app = self.application(door)
        self._server = uvicorn.Server(_config(app, self._sockets, certfile, keyfile, self.longest))
        self._thread = threading.Thread(target=self._live, name="hfg studio server", daemon=True)

    def application(self, door: Any) -> Any:
        """Return what answers requests."""
        return application(door, self.entrance, Path(os.environ.get("HFG_STUDIO_STATIC") or STATIC))

    def _live(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self.loop) as runner:
            runner.run(self._server.serve(sockets=self._sockets))

    def start(self) -> None:
        """Begin."""
        # The loop is named because it has to ask `OwnListener` for its connections; that of uvloop accepts them itself.
        self.loop = asyncio.SelectorEventLoop()
        self._thread.start()

    def ask_to_end(self) -> None:
        """End soon."""
        self._server.should_exit = True

    def join(self) -> None:
        """Wait until it has ended, 3 seconds at most."""
        self._thread.join(3.0)

    async def stop(self) -> None:
        """End, and wait until the server has ended."""
        self.ask_to_end()
        await asyncio.to_thread(self.join)
        for one in self._sockets:
            one.close()
        if self._kept:
            forget_secret(self._kept)


def _need_secret(keyfile: str) -> None:
    """Check that no other user knows the key of a certificate.

    Raises:
      TargetError: one does, or there is no such file.
    """
    try:
        exposure = exposure_of_key(keyfile, Path(keyfile).stat())
    except OSError as error:
        raise TargetError(f"{keyfile} cannot be read: {error.strerror}; correct --keyfile") from None
    if exposure is not None:
        raise TargetError(f"--keyfile: {'; '.join(exposure)}")


def _config(
    app: Any, sockets: list[socket.socket], certfile: str | None, keyfile: str | None, longest: int
) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        http=bounded_http(sockets),
        ws=DiscreetWebSocket,
        ws_max_size=longest,
        ws_ping_interval=20.0,
        ws_per_message_deflate=False,
        log_config=None,
        access_log=False,
        lifespan="off",
        server_header=False,
        date_header=False,
        timeout_graceful_shutdown=1,
        ssl_certfile=certfile,
        ssl_keyfile=keyfile,
    )


def _listening(host: str, ports: Sequence[int]) -> list[socket.socket]:
    """Take the first free one of the ports; of "localhost", both addresses. Port 0 is any free one.

    Browsers and tunnels to "localhost" try both. Another user who has one of the two would learn the token.
    """
    first = "127.0.0.1" if host == "localhost" else host
    others = [one for one in _LOCALHOST if one != first] if first in _LOCALHOST else []
    last: OSError | None = None
    for one in ports:
        sockets = []
        try:
            sockets.append(_bound(first, one))
            for other in others:
                try:
                    sockets.append(_bound(other, sockets[0].getsockname()[1]))
                except OSError as error:
                    if error.errno not in _NO_SUCH_ADDRESS:
                        raise
        except OSError as error:
            for taken in sockets:
                taken.close()
            last = error
        else:
            return sockets
    assert last is not None
    where = "any port" if len(ports) > 1 else f"port {ports[0]}"
    raise TargetError(f"{where} of {last.filename} cannot be taken: {last.strerror}; name another one by --port")


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket that listens; on loopback, only to programs of this user.

    Raises:
      OSError: it cannot; the file name is the host.
    """
    kind = OwnListener if is_loopback(host) else CrowdedListener
    try:
        listening = kind(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((host, port))
            listening.listen()  # now: two sockets that only have the same address would both be content
        except BaseException:
            listening.close()
            raise
    except OSError as error:
        error.filename = host
        raise
    return listening
