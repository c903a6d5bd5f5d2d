"""Another part of a run, as seen from the main part: its process, whether it is there, and its final report.

A `Launcher` starts processes, here or on other hosts. Depends on `channels` and `deaths`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from typing import Any, Protocol

from hfg.errors import HfgError, UsageError
from hfg.parts.model.deaths import Deaths
from hfg.parts.model.messages import Begin, Closed, Message
from hfg.parts.running.channels import Channel
from hfg.transport import Session


class Launched(Protocol):
    """One other part, wherever it runs.

    Attributes:
      process: the id of its process; 0 if it has none.
    """

    process: int

    async def wait(self) -> str:
        """Wait until it is gone. Return a message about how, as in 'process 1234 was killed by SIGKILL'."""

    def begins(self) -> None:
        """Its nodes are set up and let go: from now on it may be expected to answer."""

    async def end(self) -> None:
        """See to it that it is gone, whatever it does."""


class Launcher(Protocol):
    """Starts the other parts, and provides the session for messages to them.

    Attributes:
      shares_memory: whether large arrays between parts of one host may go through shared memory.
      is_in_realm: whether other programs can find and control the run on that session.
      near: once open: the session for parts on this host; None if the main part's session reaches them.
    """

    shares_memory: bool
    is_in_realm: bool

    @property
    def near(self) -> Session | None:
        """See above."""

    async def open(self) -> Session:
        """Return the session of the main part."""

    async def prepare(self, hosts: Mapping[str, str], modules: Mapping[str, str]) -> None:
        """Check that everything needed is available, before anything is started.

        Args:
          hosts: the host of each part; "" is this one.
          modules: modules that will be imported there, each with a place in the graph that needs it.

        Raises:
          TransportError: something is missing.
        """

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Launched:
        """Start a part, which then serves (see `worker`).

        Args:
          run: the name by which all parts know the run.
          part: its name.
          host: its host; "" is this one.
          incarnations: its incarnation, and that of the main part.

        Raises:
          HfgError: it cannot be started; nothing is left of it.
        """

    async def close(self) -> None:
        """End the session, and everything else that was started."""


class PeerProcess:
    """Another part, as seen from the main part.

    Attributes:
      name: name of its group.
      closed: done when it has reported, or is gone.
      report: its final report.
      deaths: history of its processes' deaths.
      state: "starting", "running", or "returning": it is gone, and will be restarted.
      restarts: how often it was restarted.
      is_told: there is a process that receives messages, and knows the state of other parts as of its start.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._launched: Launched | None = None
        self._opened: asyncio.Future[None] | None = None
        self.closed: asyncio.Future[None]
        self.report: Closed | None = None
        self.deaths = Deaths()
        self.state = "starting"
        self.restarts = 0
        self._since = 0.0
        self._is_restarted = False
        self.is_told = False
        self._returning: asyncio.Task[None] | None = None
        self._keeping: asyncio.Task[None] | None = None
        self._channel: Channel
        self._watching: asyncio.Task[None] | None = None
        self._leaves = False
        self._gone = False
        self._was_let_go = False

    def begin(self, channel: Channel) -> None:
        """By this it is spoken to."""
        self._channel = channel
        self._not_opened()
        self.closed = asyncio.get_running_loop().create_future()

    def _not_opened(self) -> None:
        """Prepare for another incarnation to be set up; code that waits for the setup keeps waiting."""
        if self._opened is None or self._opened.done():
            self._opened = asyncio.get_running_loop().create_future()

    async def wait_opened(self) -> None:
        """Wait until a incarnation of it is set up.

        Raises:
          HfgError: that has failed.
        """
        assert self._opened is not None
        await asyncio.shield(self._opened)

    def live(self, launched: Launched, gone: Callable[[str], None]) -> None:
        """A process runs it from now on; `gone` is called when it is gone without having been asked to leave."""
        self._launched = launched
        self._since = asyncio.get_running_loop().time()

        async def watch() -> None:
            how = await launched.wait()
            self._gone = True
            if not self.closed.done():
                self.closed.set_result(None)
            if not self._leaves:
                self.is_told = False
                self.state = "returning"
                self._not_opened()
                gone(how)

        self._watching = asyncio.create_task(watch(), name=f"hfg process of {self.name}")
        self.is_told = True
        self._was_let_go = False

    @property
    def is_there(self) -> bool:
        """Whether it was started, and is not gone."""
        return self._launched is not None and not self._gone

    @property
    def is_leaving(self) -> bool:
        """Whether it was told to leave."""
        return self._leaves

    @property
    def is_keeping(self) -> bool:
        """Whether its last state is still being written to its ledger."""
        return self._keeping is not None and not self._keeping.done()

    @property
    def process(self) -> int:
        """The id of its process; 0 if it has none."""
        return 0 if self._launched is None else self._launched.process

    @property
    def up_s(self) -> float:
        """For how long that is there."""
        return asyncio.get_running_loop().time() - self._since if self.process else 0.0

    def died(self) -> float | None:
        """Record its death. Return the pause before the restart in seconds, or None: it is not restarted."""
        asked, self._is_restarted = self._is_restarted, False
        return 0.0 if asked else self.deaths.died(asyncio.get_running_loop().time())

    async def restart(self) -> None:
        """End its process on request. This does not count as a death, but has the same consequences.

        Raises:
          UsageError: it is not running.
        """
        if self._launched is None or self.state != "running":
            raise UsageError(f'the process of group "{self.name}" is {self.state}: nothing is to be restarted')
        self._is_restarted = True
        self.state = "returning"
        await self._launched.end()

    def let_go(self) -> None:
        """Start its nodes, if they are set up and not started."""
        if self.state != "running" or self._was_let_go:
            return
        self._was_let_go = True
        self.say(Begin())
        if self._launched is not None:
            self._launched.begins()

    def say(self, message: Message) -> None:
        """Say something to it."""
        self._channel.send(message)

    def keep(self, keep: Callable[[Callable[[Message], None]], Coroutine[Any, Any, None]]) -> None:
        """Write to its ledger with `keep`, which gets the connection to the current process, and to no later one."""
        keeping = keep(self._channel.send)
        self._keeping = asyncio.get_running_loop().create_task(keeping, name=f"hfg ledger of {self.name}")

    def answer(self, error: HfgError | None) -> None:
        """It is set up, or setup has failed."""
        opened = self._opened
        if opened is not None and not opened.done():
            if error is None:
                self.restarts += self.state == "returning"
                self.state = "running"
                opened.set_result(None)
            else:
                opened.set_exception(error)
                opened.exception()  # possibly nothing awaits it any more

    async def bury(self) -> None:
        """See to it that nothing is left of a incarnation that is over."""
        if self._launched is not None:
            await self._launched.end()
            self._launched = None
        self._gone = False
        await self._channel.close()
        if self._keeping is not None:
            await asyncio.wait({self._keeping})

    def come_back(self, returning: Coroutine[Any, Any, None]) -> None:
        """Start its next incarnation with `returning`; one that died during setup is no longer awaited."""
        if self._returning is not None:
            self._returning.cancel()
        self._returning = asyncio.get_running_loop().create_task(returning, name=f"hfg return of {self.name}")

    async def stay_away(self) -> None:
        """Begin no other incarnation."""
        if self._returning is not None:
            self._returning.cancel()
            await asyncio.wait({self._returning})

    def leaves(self) -> None:
        """It is told to leave: from now on it may be gone."""
        self._leaves = True

    def close(self, report: Closed) -> None:
        """It has sent its report, and leaves."""
        self.report = report
        if not self.closed.done():
            self.closed.set_result(None)

    async def end(self) -> None:
        """See to it that nothing is left of it."""
        self._leaves = True
        if self._launched is not None:
            await self._launched.end()
        if self._keeping is not None:
            await asyncio.wait({self._keeping})
        if self._watching is not None:
            self._watching.cancel()
            await asyncio.wait({self._watching})
        if self._launched is not None or hasattr(self, "_channel"):
            await self._channel.close()
