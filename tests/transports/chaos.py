"""What breaks connections and programs, for tests: a proxy on loopback, and processes that are killed or stopped.

Neither needs a privilege. The proxy carries any TCP, so it knows nothing of what it breaks. A `Gremlin` draws what goes
wrong when, by its seed: two runs with one seed break the same things in the same order, though not at the same bytes.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Self

__all__ = ["Gremlin", "Program", "Proxy"]

_CHUNK = 64 * 1024
_AHEAD = 64  # chunks on their way in one direction


class Proxy:
    """Carries connections from its port to another one, until it is told otherwise.

    Attributes:
      port: where it listens; taken by itself.
      delay_s: how long each byte is on its way, in each direction.
      rate: bytes a second in each direction of each connection; None: as many as come.
    """

    def __init__(self, target: int) -> None:
        self.port = 0
        self.delay_s = 0.0
        self.rate: float | None = None
        self._target = target
        self._open = asyncio.Event()  # cleared: a black hole
        self._open.set()
        self._refusing = False
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._connected, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *exc: object) -> None:
        assert self._server is not None
        self._server.close()
        self.cut()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    @property
    def connections(self) -> int:
        """How many there are."""
        return len(self._writers) // 2

    def cut(self, *, refuse: bool = False) -> None:
        """Reset all connections; with `refuse` new ones too, until `heal`."""
        self._refusing = refuse
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    def swallow(self) -> None:
        """Carry nothing any more, without a word to either end: a black hole, until `heal`."""
        self._open.clear()

    def heal(self) -> None:
        """Carry again; what a black hole has held goes on first."""
        self._refusing = False
        self._open.set()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        if self._refusing:
            writer.transport.abort()
            return
        try:
            their_reader, their_writer = await asyncio.open_connection("127.0.0.1", self._target)
        except OSError:
            writer.transport.abort()
            return
        if self._refusing:  # meanwhile
            writer.transport.abort()
            their_writer.transport.abort()
            return
        both = {writer, their_writer}
        self._writers |= both
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._carry(reader, their_writer))
                group.create_task(self._carry(their_reader, writer))
        except* OSError:
            pass
        finally:
            self._writers -= both
            for one in both:
                one.transport.abort()

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Bytes are on their way while others come, so a delay costs no throughput."""
        loop = asyncio.get_running_loop()
        under_way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(_AHEAD)

        async def deliver() -> None:
            while True:
                due, chunk = await under_way.get()
                await asyncio.sleep(max(0.0, due - loop.time()))
                await self._open.wait()
                if not chunk:
                    raise ConnectionResetError("the other end has gone")
                writer.write(chunk)
                await writer.drain()

        delivering = asyncio.create_task(deliver())
        try:
            while not delivering.done():
                reading = asyncio.ensure_future(reader.read(_CHUNK))
                await asyncio.wait({reading, delivering}, return_when=asyncio.FIRST_COMPLETED)
                if not reading.done():
                    reading.cancel()
                    break
                chunk = reading.result()
                await under_way.put((loop.time() + self.delay_s, chunk))
                if not chunk:
                    break
                if self.rate is not None:
                    await asyncio.sleep(len(chunk) / self.rate)
            await delivering
        finally:
            delivering.cancel()
            with contextlib.suppress(asyncio.CancelledError, OSError):
                await delivering


class Program:
    """A process that can be killed, stopped, resumed and begun again."""

    def __init__(self, command: Sequence[str], *, environment: Mapping[str, str] | None = None) -> None:
        self.command = list(command)
        self.starts = 0
        self._environment = {**os.environ, **(environment or {})}
        self._process: asyncio.subprocess.Process | None = None

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.end()

    async def start(self) -> None:
        """Begin it; it must not be running."""
        assert self._process is None
        self._process = await asyncio.create_subprocess_exec(
            *self.command, stdout=asyncio.subprocess.PIPE, env=self._environment
        )
        self.starts += 1

    async def line(self) -> str:
        """Give the next line of what it says; empty once it has ended."""
        assert self._process is not None
        assert self._process.stdout is not None
        return (await self._process.stdout.readline()).decode().rstrip("\n")

    async def wait(self) -> int:
        """Wait until it ends by itself, and give its exit code."""
        assert self._process is not None
        return await self._process.wait()

    def kill(self) -> None:
        """Kill it, running or stopped."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()

    def stop(self) -> None:
        """Have it stand still in the middle of whatever it does."""
        self._signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Have it go on where it stood."""
        self._signal(signal.SIGCONT)

    async def end(self) -> int | None:
        """Kill it, wait until it is gone and give its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        if process.returncode is None:
            process.kill()
        await process.communicate()
        return process.returncode

    async def restart(self) -> None:
        """Kill it and begin it again."""
        await self.end()
        await self.start()

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(number)


class Gremlin:
    """Does what goes wrong, one thing after the other, at moments drawn by a seed.

    Attributes:
      done: how often each thing was done.
    """

    def __init__(self, seed: int, faults: Mapping[str, Callable[[random.Random], Awaitable[None]]]) -> None:
        """Make one.

        Args:
          seed: what it draws by.
          faults: by name, what does a fault and, if it has an end, ends it; given the source of what is drawn.
        """
        self.done: Counter[str] = Counter()
        self._random = random.Random(seed)
        self._faults = dict(faults)

    async def work(self, *, pause_s: tuple[float, float], counts: Mapping[str, int] | None = None) -> None:
        """Go on for ever, or until each fault was done as often as `counts` says.

        Args:
          pause_s: the shortest and the longest time between two faults.
          counts: how often each.
        """
        left = Counter(counts or {})
        while counts is None or left:
            await asyncio.sleep(self._random.uniform(*pause_s))
            names = sorted(self._faults if counts is None else left)
            name = self._random.choice(names)
            await self._faults[name](self._random)
            self.done[name] += 1
            if counts is not None:
                left[name] -= 1
                left += Counter()
