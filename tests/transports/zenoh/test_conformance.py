"""What any transport does, over Zenoh: among peers, and through an agent over connections that can be cut."""

from __future__ import annotations

import random
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

from hfg.testing.transports import TransportTests
from hfg.transport import Buffer, Publisher, Traffic
from hfg_transports.zenoh import ZenohSession, ZenohTransport
from tests.transports.chaos import Proxy
from tests.transports.zenoh.conftest import PATIENCE_S, free_port, until

LOSS, REPETITION = 0.2, 0.1


class Lossy:
    """A publisher that loses and repeats: TCP never does, so this is how a test sees it done."""

    def __init__(self, publisher: Publisher, faults: Faults) -> None:
        self._publisher = publisher
        self._faults = faults

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        faults = self._faults
        if faults.on and faults.random.random() < LOSS:
            return
        self._publisher.put(header, payload)
        if faults.on and faults.random.random() < REPETITION:
            self._publisher.put(header, payload)

    def close(self) -> None:
        self._publisher.close()


class Faults:
    def __init__(self) -> None:
        self.on = False
        self.random = random.Random(1)

    def reach(self, session: ZenohSession) -> ZenohSession:
        publisher = session.publisher

        def lossy(key: str, traffic: Traffic) -> Any:
            return Lossy(publisher(key, traffic), self)

        session.publisher = lossy  # type: ignore[method-assign]
        return session


class ZenohTests(TransportTests):
    patience_s = PATIENCE_S
    lease_s = 2.0
    faults: Faults

    def disturb(self, sessions: list[Any]) -> bool:
        self.faults.on = True
        return True

    def calm(self, sessions: list[Any]) -> None:
        self.faults.on = False


class TestPeers(ZenohTests):
    @asynccontextmanager
    async def sessions(self, count: int) -> AsyncIterator[list[Any]]:
        self.faults = Faults()
        settings: dict[str, Any] = {
            "listen": (f"tcp/127.0.0.1:{free_port()}",),
            "meet": (f"tcp/127.0.0.1:{free_port()}",),
            "largest_message": 5_000_000,
            "insecure": True,
        }
        async with AsyncExitStack() as stack:
            opened = []
            for _ in range(count):
                session = await ZenohTransport().open(**settings)
                stack.push_async_callback(session.close)
                opened.append(self.faults.reach(session))
            await until(lambda: all(len(one.connections()) >= count - 1 for one in opened))
            yield opened


class TestClientsOfAnAgent(ZenohTests):
    """Each through a proxy of its own, so one can vanish."""

    @asynccontextmanager
    async def sessions(self, count: int) -> AsyncIterator[list[Any]]:
        self.faults = Faults()
        self.proxies: dict[str, Proxy] = {}
        port = free_port()
        async with AsyncExitStack() as stack:
            agent = await ZenohTransport().open(
                mode="router", listen=(f"tcp/127.0.0.1:{port}",), insecure=True, lease_s=1.0
            )
            stack.push_async_callback(agent.close)
            opened = []
            for _ in range(count):
                proxy = await stack.enter_async_context(Proxy(port))
                session = await ZenohTransport().open(
                    mode="client",
                    connect=(f"tcp/127.0.0.1:{proxy.port}",),
                    insecure=True,
                    largest_message=5_000_000,
                    lease_s=1.0,
                )
                stack.push_async_callback(session.close)
                self.proxies[session.name] = proxy
                opened.append(self.faults.reach(session))
            yield opened

    async def kill(self, session: ZenohSession) -> bool:
        self.proxies[session.name].swallow()
        return True
