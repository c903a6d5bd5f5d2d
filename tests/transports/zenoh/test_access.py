"""Who may do what, by the name in the certificate: the agent lets a viewer look and nothing else."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any, NamedTuple

import pytest
import pytest_asyncio
import zenoh

from hfg.errors import NoAnswer
from hfg.transport import Message, Presence, Traffic
from hfg_transports.zenoh import Access, ZenohSession
from hfg_transports.zenoh.names import Keys
from tests.limits import patience
from tests.transports.zenoh.conftest import Certificates, Open, free_port, into, put_until, soon, until

pytestmark = pytest.mark.asyncio


class System(NamedTuple):
    worker: ZenohSession
    other: ZenohSession
    viewer: ZenohSession


@pytest_asyncio.fixture
async def system(open_one: Open, certificates: Certificates) -> AsyncIterator[System]:
    """An agent with access control, two workers and a viewer."""
    common: dict[str, Any] = {
        "listen": (f"tls/localhost:{free_port()}",),
        "access": Access(write=("agent", "worker"), read=("viewer",)),
    }
    await open_one(**common, mode="router", tls=certificates.tls("agent"))
    sessions = [
        await open_one(**common, mode="client", tls=certificates.tls(name)) for name in ("worker", "worker", "viewer")
    ]
    yield System(*sessions)


@pytest.mark.slow
async def test_the_agent_knows_its_clients_by_their_certificates(system: System) -> None:
    assert [one.certificate for one in system.viewer.connections()] == ["agent"]


@pytest.mark.slow
async def test_a_viewer_sees_values_and_who_is_there_and_asks_for_what_may_be_read(system: System) -> None:
    values: asyncio.Queue[Message] = asyncio.Queue()
    presences: asyncio.Queue[Presence] = asyncio.Queue()
    system.viewer.subscribe("camera", into(values))
    system.viewer.watch("", into(presences))
    system.worker.announce("vision", b"1")
    assert await soon(presences.get()) == Presence("vision", b"1", True)
    publisher = system.worker.publisher("camera", Traffic.TOKENS)
    await until(lambda: publisher.wanted)
    await put_until(lambda: not values.empty(), lambda: publisher.put(b"head", b"body"))
    assert values.get_nowait() == (b"head", b"body")

    async def graph(question: bytes) -> bytes:
        return b"the graph"

    system.worker.answer("vision/ro/graph", graph)
    assert await answered(system.viewer, "vision/ro/graph") == b"the graph"


async def answered(session: ZenohSession, name: str) -> bytes:
    """Ask until the answerer has got around."""
    async with asyncio.timeout(patience(20)):
        while True:
            try:
                return await session.ask(name)
            except NoAnswer:
                await asyncio.sleep(0.01)


@pytest.mark.slow
async def test_what_a_viewer_would_write_reaches_nobody(system: System) -> None:
    steered: list[str] = []

    def answering(name: str) -> Any:
        async def answer(question: bytes) -> bytes:
            steered.append(name)
            return b"done"

        return answer

    values: list[Message] = []
    presences: list[Presence] = []
    fence = asyncio.Event()
    system.worker.subscribe("camera", values.extend)
    system.worker.watch("", presences.extend)
    names = ("vision/rw/stop", "vision/stop", "ro/rw/stop", "vision/ro/a/rw/stop", "vision/ro", "ro")
    for name in (*names, "vision/ro/graph"):
        system.worker.answer(name, answering(name))
    system.worker.subscribe("fence", lambda burst: fence.set())
    assert await answered(system.viewer, "vision/ro/graph") == b"done"
    steered.clear()
    publisher = system.viewer.publisher("camera", Traffic.TOKENS)
    for _ in range(10):
        publisher.put(b"forged")
    system.viewer.announce("vision", b"forged")
    for name in names:
        with pytest.raises(NoAnswer):
            await system.viewer.ask(name, timeout_s=1)
    raw: zenoh.Session = system.viewer._raw
    questions = Keys("default").questions
    for pattern in (f"{questions}/**", "**", f"{questions}/vision/*/stop"):
        for reply in raw.get(pattern, target=zenoh.QueryTarget.ALL, timeout=1.0):
            assert "/ro/" in str(reply.result)
    for name in names:  # they are there, and answer whoever may ask
        assert await answered(system.other, name) == b"done"
    fences = system.other.publisher("fence", Traffic.TOKENS)
    await until(lambda: fences.wanted)
    await put_until(fence.is_set, lambda: fences.put(b""))
    assert values == []
    assert presences == []
    assert steered == list(names)
