"""Real processes over Zenoh: a producer, a relay without memory, a sink; killed, stopped, cut off, losing all along.

What must come out (L1, L2): every value once and in order in the sink's ledger, whatever happens to those in between.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import random
import signal
import time
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from hfg.links.running import LinkSender
from hfg_transports.zenoh import ZenohTransport
from tests.transports.chaos import Gremlin, Proxy
from tests.transports.zenoh import workers
from tests.transports.zenoh.conftest import free_port

pytestmark = pytest.mark.slow

OUTAGE_S = 1.4 * workers.LEASE_S
"""Longer than the lease: all sides give each other up."""


Fault = Callable[[random.Random], Awaitable[None]]


class Part:
    """A process and the proxy through which it reaches the agent."""

    def __init__(self, context: Any, proxy: Proxy, function: Callable[..., None], *more: Any) -> None:
        self.proxy = proxy
        self.life = 0
        self._context = context
        self._function = function
        self._more = more
        self._process: Any = None

    def start(self) -> None:
        self.life += 1
        arguments = (self.proxy.port, self.life, *self._more)
        self._process = self._context.Process(target=self._function, args=arguments, daemon=True)
        self._process.start()

    def kill(self) -> None:
        self._process.kill()
        self._process.join()

    async def kill_and_restart(self, source: random.Random) -> None:
        await asyncio.to_thread(self.kill)
        await asyncio.to_thread(self.start)

    async def stop(self, source: random.Random) -> None:
        os.kill(self._process.pid, signal.SIGSTOP)
        await asyncio.sleep(OUTAGE_S)
        os.kill(self._process.pid, signal.SIGCONT)

    async def cut(self, source: random.Random) -> None:
        self.proxy.cut(refuse=True)
        await asyncio.sleep(source.uniform(0.0, 0.3))
        self.proxy.heal()

    async def swallow(self, source: random.Random) -> None:
        self.proxy.swallow()
        await asyncio.sleep(OUTAGE_S)
        self.proxy.heal()


async def chaos(ledger: Path, counts: Mapping[str, int], tokens: int, seed: int) -> dict[str, list[float]]:
    """Send at least so many tokens until all that is to go wrong has; give how long each recovery took.

    A recovery is from the end of a fault until the next value is done at the sink.
    """
    port = free_port()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.transports.zenoh.workers"])
    agent = await ZenohTransport().open(
        mode="router", listen=(f"tcp/127.0.0.1:{port}",), insecure=True, lease_s=workers.LEASE_S
    )
    recoveries: dict[str, list[float]] = {name: [] for name in counts}
    async with Proxy(port) as to_relay, Proxy(port) as to_sink:
        relay, sink = Part(context, to_relay, workers.relay), Part(context, to_sink, workers.sink, str(ledger))
        sender = LinkSender(workers.lossy(agent, seed), workers.FIRST, epoch=1, window=64, probe_s=0.05)
        sender.admit("relay")
        over = asyncio.Event()

        def measured(name: str, fault: Fault) -> Fault:
            async def fault_and_recovery(source: random.Random) -> None:
                await fault(source)
                began, before = time.monotonic(), sender.released
                while sender.released == before and not over.is_set():
                    await asyncio.sleep(0.005)
                recoveries[name].append(time.monotonic() - began)

            return fault_and_recovery

        kinds = {
            f"{name} {which}": measured(f"{name} {which}", getattr(part, fault))
            for which, part in (("relay", relay), ("sink", sink))
            for name, fault in (("kill", "kill_and_restart"), ("stop", "stop"), ("cut", "cut"), ("hole", "swallow"))
        }
        gremlin = Gremlin(seed, kinds)
        sent = 0
        try:
            await asyncio.gather(asyncio.to_thread(relay.start), asyncio.to_thread(sink.start))
            while sender.released == 0:  # until all of them are there
                if sent == 0:
                    sent = sender.send_nowait((b"", (1).to_bytes(8, "little")))
                await asyncio.sleep(0.01)
            wrong = asyncio.create_task(gremlin.work(pause_s=(0.02, 0.3), counts=counts))
            while sent < tokens or not wrong.done():
                sent = await sender.send((b"", (sent + 1).to_bytes(8, "little")))
                while sender.free:  # what is sent in one turn travels together
                    sent = sender.send_nowait((b"", (sent + 1).to_bytes(8, "little")))
            await wrong
            await sender.wait_finished()
        finally:
            over.set()
            await asyncio.to_thread(relay.kill)
            await asyncio.to_thread(sink.kill)
            await sender.close()
            await agent.close()
        assert gremlin.done == counts
    return recoveries


def values_in(ledger: Path) -> list[tuple[int, ...]]:
    return list(workers.RECORD.iter_unpack(ledger.read_bytes()))


def each(count: int) -> dict[str, int]:
    return {f"{name} {which}": count for which in ("relay", "sink") for name in ("kill", "stop", "cut", "hole")}


@pytest.mark.rule("L1", "L2", "L3")
@pytest.mark.timeout(240)
def test_processes_are_killed_stopped_and_cut_off_and_each_value_arrives_once_and_in_order(tmp_path: Path) -> None:
    recoveries = asyncio.run(chaos(tmp_path / "ledger", each(1), 1000, seed=1))
    records = values_in(tmp_path / "ledger")
    assert records == [(1, number, number) for number in range(1, len(records) + 1)]
    assert len(records) >= 1000
    assert all(len(one) == 1 for one in recoveries.values())


@pytest.mark.soak
@pytest.mark.rule("L1", "L2", "L3")
@pytest.mark.timeout(3600)
def test_for_long(tmp_path: Path) -> None:
    """And it goes on within two seconds each time."""
    counts = each(25) | {"kill relay": 100, "kill sink": 100, "cut relay": 100, "cut sink": 100}
    recoveries = asyncio.run(chaos(tmp_path / "ledger", counts, 100_000, seed=2))
    records = values_in(tmp_path / "ledger")
    assert records == [(1, number, number) for number in range(1, len(records) + 1)]
    for name, took in recoveries.items():
        took.sort()
        print(f"{name}: {len(took)} times, p50 {took[len(took) // 2]:.2f} s, longest {took[-1]:.2f} s")
    print(f"{len(records)} tokens")
    assert max(one[-1] for one in recoveries.values()) < 2.0
