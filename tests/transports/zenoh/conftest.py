"""Sessions over Zenoh on loopback, at ports nobody has, closed whatever happens; and one set of certificates."""

from __future__ import annotations

import asyncio
import contextlib
import random
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from pathlib import Path
from typing import Any, Protocol, TypeVar

import pytest
import pytest_asyncio

from hfg.cli.certificates import make_authority, make_certificate
from hfg_transports.zenoh import Settings, Tls, ZenohSession, ZenohTransport
from tests.limits import patience

T = TypeVar("T")

PATIENCE_S = patience(20.0)
"""How long a slow machine may take for what takes milliseconds."""


def free_port() -> int:
    """Give a port of loopback that nobody listens at now.

    Below those that the system gives to outgoing connections: one of these, of any program, would take it in between.
    """
    while True:
        port = random.SystemRandom().randrange(12_000, 30_000)
        with socket.socket() as one, contextlib.suppress(OSError):
            one.bind(("127.0.0.1", port))
            return port


async def until(true: Callable[[], object]) -> None:
    """Wait for something that Zenoh tells nobody about, as that a subscription has got around."""
    async with asyncio.timeout(PATIENCE_S):
        while not true():
            await asyncio.sleep(0.005)


async def soon(waiting: Awaitable[T]) -> T:
    """Await something that should come soon."""
    async with asyncio.timeout(PATIENCE_S):
        return await waiting


async def put_until(came: Callable[[], object], *puts: Callable[[], None], again_s: float = 0.5) -> None:
    """Put datagrams until what they should cause has come.

    Any of them may be lost: the first ones, for that somebody wants them is known before the way there is, and long
    ones, which find no room when Zenoh's threads have no turn.
    """
    async with asyncio.timeout(PATIENCE_S):
        while not came():
            for put in puts:
                put()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(again_s):
                    await until(came)


def into(queue: asyncio.Queue[T]) -> Callable[[list[T]], None]:
    """Give what puts each of a burst into a queue."""

    def receive(burst: list[T]) -> None:
        for one in burst:
            queue.put_nowait(one)

    return receive


class Open(Protocol):
    """Opens a session that is closed when the test is over."""

    def __call__(self, **settings: Any) -> Coroutine[Any, Any, ZenohSession]: ...


@pytest_asyncio.fixture
async def open_one() -> AsyncIterator[Open]:
    async with contextlib.AsyncExitStack() as stack:

        async def opened(**settings: Any) -> ZenohSession:
            session = await ZenohTransport().open(**settings)
            stack.push_async_callback(session.close)
            return session

        yield opened


@pytest.fixture
def here() -> dict[str, Any]:
    """Settings of programs that meet at ports of their own."""
    return {
        "listen": (f"tcp/127.0.0.1:{free_port()}",),
        "meet": (f"tcp/127.0.0.1:{free_port()}",),
        "lease_s": 1.0,
        "insecure": True,
    }


@pytest_asyncio.fixture
async def two(open_one: Open, here: dict[str, Any]) -> tuple[ZenohSession, ZenohSession]:
    """Two programs without an agent, connected."""
    first, second = await open_one(**here), await open_one(**here)
    await until(lambda: first.connections() and second.connections())
    return first, second


class Certificates:
    """A folder of `hfg keys new`, with some that do not fit."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.other = folder / "other"
        for where in (folder, self.other):
            make_authority(where, days=3)
            make_certificate(where, "agent", "agent", hosts=["localhost", "127.0.0.1"], days=3)
            make_certificate(where, "worker", "worker", days=3)
        make_certificate(folder, "viewer", "viewer", days=3)
        make_certificate(folder, "expired", "agent", hosts=["localhost"], days=-1)
        make_certificate(folder, "elsewhere", "agent", hosts=["elsewhere.example"], days=3)

    def tls(self, name: str, *, folder: Path | None = None, **fields: Any) -> Tls:
        """Give what settings say of one of them."""
        where = folder or self.folder
        files = {
            "authority": str(self.folder / "authority.pem"),
            "certificate": str(where / f"{name}.pem"),
            "key": str(where / f"{name}.key"),
        }
        return Tls(**(files | fields))


@pytest.fixture(scope="session")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return Certificates(tmp_path_factory.mktemp("keys"))


def settings(**fields: Any) -> Settings:
    """Settings with a short lease."""
    return Settings(**({"lease_s": 1.0, "insecure": True} | fields))
