"""HTTP, as a client and as a server. Depends on `_web`; on httpx2, and on Starlette and uvicorn, when they are used."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import Any, ClassVar, Final
from urllib.parse import urlsplit

import msgspec
from annotated_types import Ge, MinLen

from hfg.errors import TransportError, UsageError
from hfg.nodes._extras import require
from hfg.nodes.buses._connection import Sender
from hfg.nodes.buses._failures import explained, printable
from hfg.nodes.buses._secrets import NO_SECRET, client_tls
from hfg.nodes.buses._web import WebClient, WebDoor
from hfg.ports import Events, Output, Parameter, slot

_REPEATABLE: Final = ("GET", "HEAD", "OPTIONS", "PUT", "DELETE")
"""Methods that mean the same when a server hears them twice (RFC 9110, 9.2.2)."""
_ROUTE: Final = re.compile(r"(GET|POST|PUT|PATCH|DELETE) (/\S*)")


class Request(msgspec.Struct, frozen=True):
    """What a client asks.

    Attributes:
      url: of a client: a path below the node's `url`, or a whole address on the same server; of a server: the path.
      method: "GET", "POST" ...
      body: bytes that are sent along.
      headers: by their names, in small letters in a server.
      query: the values after the question mark, by name.
      values: of a server: the parts of the path that its route names.
      number: of a server: by which the answer finds its way.
    """

    url: str = ""
    method: str = "GET"
    body: bytes = b""
    headers: dict[str, str] = {}
    query: dict[str, str] = {}
    values: dict[str, str] = {}
    number: int = 0


class Response(msgspec.Struct, frozen=True):
    """What a server answers.

    Attributes:
      status: 200 is well, from 400 on the client is wrong, from 500 on the server.
      body: bytes.
      headers: by their names, in small letters in a client.
      number: of a server: that of the request.
    """

    status: int = 200
    body: bytes = b""
    headers: dict[str, str] = {}
    number: int = 0


class HttpClient(WebClient, Sender):
    """Ask an HTTP server, and send its answers on.

    A request that found no server is repeated after a pause. So is a GET, HEAD, OPTIONS, PUT or DELETE that was broken
    off. Any other request that was broken off fails the firing, because the server may have acted on it. An answer of
    any status is an answer. Redirections are not followed. With `concurrency` several requests are in flight at a time.
    Needs `hfg[http]`.

    Attributes:
      url: of the server; addresses of requests begin there.
      message: a `Request`, a text with the path for GET, or with `method` set anything of the form as its body.
      method: of messages that are no `Request`; empty: "GET", with the message as the path.
      response: the answer.
      most_bytes: of a body; a longer answer fails the firing.

    Raises:
      ModuleNotFoundError: httpx2 is not installed.
      TransportError: a request was broken off that must not be repeated, or the answer is too long.
    """

    url = Parameter("http://127.0.0.1:8000", NO_SECRET, MinLen(1))
    method = Parameter("", choices=("", "GET", "POST", "PUT", "PATCH", "DELETE"))
    response = Output(Response)
    hears: ClassVar[tuple[str, ...]] = ()
    breaks_all: ClassVar[bool] = False

    async def setup(self) -> None:
        """See whether the package is there."""
        self._httpx = require("httpx2", "http")
        self._client: Any = None
        await super().setup()

    async def process(self, message: Any) -> Response | None:  # type: ignore[override]  # a sender that is answered
        """Ask, and wait for the answer."""
        found: Response | None = None if message is None else await self.send(self.packed(message))
        return found

    def packed(self, message: Any) -> Request:
        """Return the request."""
        if isinstance(message, Request):
            return message
        return Request("", self.method, self.as_bytes(message)) if self.method else Request(str(message))

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Any]:
        """Make ready to ask; the server is found with the first request."""
        encrypted = self.need_scheme("http", "https")
        if self._client is None:
            self._client = self._httpx.AsyncClient(
                base_url=self.url,
                headers={"Accept-Encoding": "identity", **await asyncio.to_thread(self.all_headers)},
                verify=client_tls(self.ca_file) if encrypted else False,
                timeout=self.timeout_s,
                trust_env=False,
                follow_redirects=False,
            )
        yield self._client  # other requests in flight continue when one finds no server

    async def teardown(self) -> None:
        """Close all connections."""
        client, self._client = getattr(self, "_client", None), None
        if client is not None:
            await client.aclose()

    async def read(self, link: Any) -> None:
        """Wait: a server speaks when it is asked."""
        await asyncio.Event().wait()

    async def write(self, link: Any, message: Request) -> Response:
        """Ask."""
        near, here = urlsplit(message.url), urlsplit(self.url)
        if (near.scheme or near.netloc) and (near.scheme, near.netloc) != (here.scheme, here.netloc):
            raise ValueError(f'"{printable(message.url)}" is on another server than "{self.url}"; use a node for each')
        try:
            async with asyncio.timeout(self.timeout_s):
                return await self._asked(link, message)
        except (self._httpx.ConnectError, self._httpx.ConnectTimeout) as error:
            raise explained(error) from error
        except (self._httpx.TransportError, TimeoutError) as error:
            if message.method in _REPEATABLE:
                raise explained(error) from error
            raise TransportError(
                f"{self.url}: {message.method} {printable(message.url)} was broken off, and the server may have "
                f"acted on it ({printable(error) or 'no answer in time'})"
            ) from error

    async def _asked(self, link: Any, message: Request) -> Response:
        body = bytearray()
        async with link.stream(
            message.method, message.url, content=message.body, headers=message.headers, params=message.query or None
        ) as found:
            async for part in found.aiter_raw():
                body += part
                if len(body) > self.most_bytes:
                    raise TransportError(f"{self.url}: an answer has more than {self.most_bytes:,} bytes (most_bytes)")
            return Response(found.status_code, bytes(body), dict(found.headers))


class HttpServer(WebDoor):
    """Serve HTTP: each route is an event, and answers come by a slot.

    A request waits until the graph has room for it, then for its answer. A request from a page of another server is
    refused unless `origins` has it. Needs `hfg[studio]`.

    Attributes:
      routes: one for each event: "GET /status", "POST /jobs/{id}".
      asked: one for each route: a request.
      most_bytes: of the body of a request.
      most_waiting: requests without an answer; more are refused and counted.

    Raises:
      ModuleNotFoundError: Starlette or uvicorn is not installed.
    """

    routes = Parameter[Sequence[str]](("GET /",), type=Sequence[str])
    asked = Events(Request, 1)
    most_bytes = Parameter(2**20, Ge(0))
    most_waiting = Parameter(100, Ge(1))
    scheme: ClassVar[str] = "http"
    hears: ClassVar[tuple[str, ...]] = ()

    async def setup(self) -> None:
        """See whether the packages are there, and the routes fit the events."""
        require("starlette", "studio")
        require("uvicorn", "studio")
        wrong = next((one for one in self.routes if not _ROUTE.fullmatch(one)), None)
        if wrong is not None:
            raise UsageError(f'"{wrong}" is not a route; write "GET /path" or "POST /path/{{name}}"')
        if len(self.routes) != len(self.asked):
            count = len(self.routes)
            raise UsageError(f"there are {count} routes and {len(self.asked)} events: make the node with asked={count}")
        self._waiting: dict[int, asyncio.Future[Response]] = {}
        self._last = 0
        await super().setup()

    @slot
    def answer(self, response: Response) -> None:
        """Answer the request whose number the answer has."""
        waiting = self._waiting.pop(response.number, None)
        if waiting is None or waiting.done():
            self._counts["answered too late"] += 1
        else:
            waiting.set_result(response)

    @asynccontextmanager
    async def link(self) -> AsyncIterator[None]:
        """Listen."""
        listening, tls = self.open_door()
        server = serving(
            self._application(),
            limit_concurrency=self.most_clients,
            ssl_certfile=self.certificate if tls else None,
            ssl_keyfile=(self.key or None) if tls else None,
        )
        running = asyncio.create_task(server.serve(sockets=[listening]))
        try:
            yield None
        finally:
            for one in self._waiting.values():
                one.cancel()
            server.should_exit = True
            await asyncio.wait([running])
            listening.close()

    def _application(self) -> Any:
        from starlette.applications import Starlette
        from starlette.routing import Route

        routes = []
        for number, (method, path) in enumerate(one.split(" ") for one in self.routes):
            routes.append(Route(path, partial(self._meet, number), methods=[method]))
        return Starlette(routes=routes)

    async def _meet(self, route: int, request: Any) -> Any:
        """Let the graph answer a request."""
        from starlette.responses import Response as Answer

        said = [request.headers.get(name) for name in ("host", "origin", "authorization")]
        refused = await asyncio.to_thread(self.refusal, said[0] or "", said[1], said[2] or "")
        if refused is not None:
            return Answer(refused[1], refused[0])
        body = bytearray()
        async for part in request.stream():
            body += part
            if len(body) > self.most_bytes:
                self._counts["too long"] += 1
                return Answer("the body is too long", 413)
        found = await self._answered(route, request, bytes(body))
        return Answer(found.body, found.status, {"Cache-Control": "no-store", **found.headers})

    async def _answered(self, route: int, request: Any, body: bytes) -> Response:
        if len(self._waiting) >= self.most_waiting:
            self._counts["turned away"] += 1
            return Response(503, b"too many requests wait")
        self._last += 1
        number = self._last
        values = {name: str(value) for name, value in request.path_params.items()}
        asked = Request(
            request.url.path, request.method, body, dict(request.headers), dict(request.query_params), values, number
        )
        waiting: asyncio.Future[Response] = asyncio.get_running_loop().create_future()
        self._waiting[number] = waiting
        try:
            async with asyncio.timeout(self.timeout_s):
                await self.put((route, asked))
                await asyncio.wait([waiting])
                return waiting.result()
        except TimeoutError:
            self._counts["not answered"] += 1
            return Response(504, b"no answer in time")
        except asyncio.CancelledError:
            if waiting.cancelled():
                return Response(503, b"the server ends")
            raise
        finally:
            self._waiting.pop(number, None)

    async def take(self, heard: tuple[int, Request]) -> None:
        """Send a request on."""
        route, asked = heard
        self._counts["received"] += 1
        await self.asked[route].trigger_wait(asked)


def serving(application: Any, **settings: Any) -> Any:
    """Return a server that does not handle the program's signals."""
    import uvicorn

    class Server(uvicorn.Server):
        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            yield

    return Server(
        uvicorn.Config(
            application,
            http="h11",
            ws="none",
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
            **settings,
        )
    )
