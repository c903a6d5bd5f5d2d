"""Other programs: started by a node, spoken with by their standard input and output. Depends on `_streams`."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Any, ClassVar, Final, Literal

from annotated_types import MinLen

from hfg.nodes.buses._failures import Lost, printable
from hfg.nodes.buses._secrets import NO_SECRETS
from hfg.nodes.buses._streams import StreamSender
from hfg.ports import Event, Parameter

_MOST_COMPLAINED: Final = 2000  # characters of what a program says about its failure


class Subprocess(StreamSender):
    """Run another program: values go to its standard input, and what it writes is heard.

    The program lives as long as the connection: it is asked to end (SIGTERM), and killed two seconds later; with the
    programs that it has started itself. When the inputs have ended its input is closed, and it is waited for. Its
    standard error is logged.

    Attributes:
      command: the program and its arguments, one by one; no shell reads them.
      directory: where it runs; empty: where this program does.
      environment: variables that are added to those of this program. Secrets come by the environment of this program.
      at_exit: what to do when it exits by itself: "end"; "restart" it after a pause; or restart it on "failure" only.
      received: each message that it writes to its standard output.
      exited: it has exited by itself; with its exit code, or minus the number of the signal that ended it.
    """

    command = Parameter[list[str]](["cat"], MinLen(1), type=list[str])
    directory = Parameter("", directory=True)
    environment = Parameter[Mapping[str, str]]({}, NO_SECRETS, type=Mapping[str, str])
    at_exit = Parameter("end", type=Literal["end", "restart", "failure"])
    received = Event(Any)
    exited = Event(int)
    hears: ClassVar[tuple[str, ...]] = ("received", "exited", "completed")

    def address(self) -> str:
        """Return the name of the program."""
        return f'program "{printable(self.command[0])}"'

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Any]:
        """Start it."""
        process = await asyncio.create_subprocess_exec(
            *self.command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            cwd=self.directory or None,
            env={**os.environ, **self.environment},
            start_new_session=True,
        )
        assert process.stdin is not None
        assert process.stderr is not None
        process.stdin.transport.set_write_buffer_limits(0)
        complaints = asyncio.create_task(self._complaints(process.stderr))
        try:
            yield process
        finally:
            _signal(process, signal.SIGTERM)
            try:
                async with asyncio.timeout(1.5):
                    await process.wait()
            except TimeoutError:
                pass
            finally:
                _signal(process, signal.SIGKILL)
                await process.wait()
                complaints.cancel()
                with suppress(asyncio.CancelledError):
                    await complaints

    async def _complaints(self, stream: asyncio.StreamReader) -> None:
        """Log what it says on its standard error, in memory that is bounded."""
        while data := await stream.read(_MOST_COMPLAINED):
            for line in data.decode(errors="replace").splitlines():
                self.log.warning("%s: %s", self.address(), printable(line))

    async def read(self, link: asyncio.subprocess.Process) -> int:
        """Hear it until it exits. Return its exit code."""
        assert link.stdout is not None
        async for message in self.messages(link.stdout):
            await self.hear(message, self.form, self.received)
        code = await link.wait()
        self._counts["exits"] += 1
        await self.exited.trigger_wait(code)
        if not self._finishing.is_set() and (self.at_exit == "restart" or (self.at_exit == "failure" and code)):
            raise Lost(f"it has exited with code {code}")
        return code

    async def write(self, link: asyncio.subprocess.Process, message: bytes) -> None:
        """Write to its standard input; what it does not take before it exits is not sent."""
        assert link.stdin is not None
        try:
            link.stdin.write(message)
            await link.stdin.drain()
        except OSError:
            await self._changed.wait()
            raise

    async def finish(self, link: asyncio.subprocess.Process) -> None:
        """Close its standard input."""
        assert link.stdin is not None
        link.stdin.close()


def _signal(process: asyncio.subprocess.Process, number: int) -> None:
    """Send a signal to the program and to those that it has started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number) if sys.platform != "win32" else process.terminate()
