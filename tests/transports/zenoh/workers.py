"""Programs of their own for the chaos test: a relay without memory, and a sink whose effects are its ledger."""

from __future__ import annotations

import asyncio
import os
import random
import struct
from pathlib import Path
from typing import Any

from hfg.links.running import LinkReceiver, LinkSender
from hfg.transport import Position
from hfg_transports.zenoh import ZenohSession, ZenohTransport

LEASE_S = 1.0
WINDOW = 64
RECORD = struct.Struct("<QQQ")  # stream, sequence, value
FIRST, SECOND = "chaos/first", "chaos/second"


class Lossy:
    """Loses one in five of what is put, and sends one in ten twice."""

    def __init__(self, publisher: Any, source: random.Random) -> None:
        self._publisher = publisher
        self._random = source
        self.close = publisher.close

    def put(self, header: bytes, payload: Any = b"") -> None:
        drawn = self._random.random()
        if drawn >= 0.2:
            self._publisher.put(header, payload)
            if drawn >= 0.9:
                self._publisher.put(header, payload)


def lossy(session: ZenohSession, seed: int) -> ZenohSession:
    publisher, source = session.publisher, random.Random(seed)
    session.publisher = lambda key, traffic: Lossy(publisher(key, traffic), source)  # type: ignore[assignment, method-assign, return-value]
    return session


async def _opened(port: int, seed: int) -> ZenohSession:
    address = (f"tcp/127.0.0.1:{port}",)
    while True:
        try:
            session = await ZenohTransport().open(
                mode="client", connect=address, insecure=True, lease_s=LEASE_S, wait_s=5.0
            )
        except (
            Exception
        ):  # the connection is cut or swallowed just now; whatever it is, the test waits no longer than it says
            continue
        return lossy(session, seed)


def relay(port: int, life: int) -> None:
    """Pass tokens on with their positions; done when the next one is."""

    async def main() -> None:
        session = await _opened(port, 1000 + life)
        passed = 0  # the last number that is done onward

        def released() -> None:
            nonlocal passed
            if passed and onward.released > passed:
                receiver.done(onward.released - passed)
                passed = onward.released

        receiver = LinkReceiver(session, FIRST, consumer="relay", incarnation=life, capacity=WINDOW)
        onward = LinkSender(session, SECOND, epoch=life, window=WINDOW, inherits=True, released=released, probe_s=0.05)
        onward.admit("sink")
        async for token in receiver:
            if not passed:
                passed = token.position.sequence - 1
                if not passed:  # numbers begin at 1, so nothing is done before the first
                    await onward.send(token.token, token.position)
                    await onward.wait_finished()
                    receiver.done()
                    passed = token.position.sequence
                    continue
            await onward.send(token.token, token.position)

    asyncio.run(main())


def sink(port: int, life: int, ledger: str) -> None:
    """Write each value to a file; one append is effect and record at once."""
    whole = Path(ledger).read_bytes() if Path(ledger).exists() else b""
    last = RECORD.unpack(whole[-RECORD.size :]) if whole else None

    async def main() -> None:
        session = await _opened(port, 2000 + life)
        file = os.open(ledger, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        position = Position(last[0], last[1]) if last else None
        receiver = LinkReceiver(session, SECOND, consumer="sink", incarnation=life, ledger=position, capacity=WINDOW)
        async for token in receiver:
            value = int.from_bytes(bytes(token.value), "little")
            os.write(file, RECORD.pack(token.position.stream, token.position.sequence, value))
            receiver.done()

    asyncio.run(main())
