"""The world outside, for tests of `hfg.nodes.buses`: graphs at both ends, and servers that can be bad."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

import hfg


@hfg.node
def texts(*, to: int = 10, first: int = 0) -> Iterator[str]:
    """Give numbered texts."""
    yield from map(str, range(first, to))


@hfg.node
def things(*, of: list[Any] | None = None) -> Iterator[Any]:
    """Give what it was made with."""
    yield from of or []


class Seen(hfg.Node):
    """Keeps what comes; can be awaited."""

    value = hfg.Input(Any)
    pause_s = hfg.Parameter(0.0)
    seen = hfg.State(factory=list[Any])

    def setup(self) -> None:
        self.came = asyncio.Event()

    async def process(self, value: Any) -> None:
        await asyncio.sleep(self.pause_s)
        self.seen.append(value)
        self.came.set()

    async def until(self, enough: Callable[[list[Any]], bool]) -> list[Any]:
        """Wait until there is enough, half a minute at most."""
        async with asyncio.timeout(30):
            while not enough(self.seen):
                self.came.clear()
                await self.came.wait()
        return self.seen


def heard(graph: hfg.Graph, *events: Any, pause_s: float = 0.0) -> list[Seen]:
    """Keep what events send."""
    nodes = [graph.add(Seen(pause_s=pause_s)) for _ in events]
    for event, node in zip(events, nodes, strict=True):
        graph.connect(event, node.value)
    return nodes


def sent(graph: hfg.Graph, target: Any, values: Iterable[Any]) -> None:
    """Send values to an input."""
    graph.connect(graph.add(things(of=list(values))).out, target)


async def port_of(places: Seen) -> int:
    """Wait for the address of a server, and return its port."""
    found = await places.until(bool)
    return int(str(found[-1]).rpartition(":")[2])


@asynccontextmanager
async def served(
    meet: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Any], port: int = 0, **how: Any
) -> AsyncIterator[int]:
    """Serve TCP, and give the port; all connections end with it."""
    writers: list[asyncio.StreamWriter] = []

    async def met(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        try:
            await meet(reader, writer)
        finally:
            writer.close()

    server = await asyncio.start_server(met, "127.0.0.1", port, **how)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for one in writers:
            one.transport.abort()
        await asyncio.sleep(0)


def certified(place: Path, days: int) -> tuple[Path, Path]:
    """Write a certificate of this computer that holds until so many days from now, and its key; return their files."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    until = datetime.now(UTC) + timedelta(days=days)
    names = [x509.DNSName("localhost"), x509.IPAddress(ip_address("127.0.0.1"))]
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(until - timedelta(days=9))
        .not_valid_after(until)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .sign(key, hashes.SHA256())
    )
    files = place.with_suffix(".pem"), place.with_suffix(".key")
    files[0].write_bytes(made.public_bytes(serialization.Encoding.PEM))
    files[1].touch(0o600)
    secret = serialization.NoEncryption()
    plain = serialization.PrivateFormat.PKCS8
    files[1].write_bytes(key.private_bytes(serialization.Encoding.PEM, plain, secret))
    return files
