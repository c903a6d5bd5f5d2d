"""A connection with the world outside: alive as long as its node is active, and made again when it is lost (A15).

A protocol is a class with three methods: `address`, `link` and `read`, and `write` if it sends. The shared part is
here; decisions are in `_life`, which never waits. Depends on nodetype, ports and the flat graph.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack, suppress
from typing import Any, ClassVar, Final, Literal

import anyio
import msgspec
from annotated_types import Ge, Gt

from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.errors import TransportError, UsageError
from hfg.graph.flat import flatten
from hfg.graph.graph import graph_of
from hfg.graph.structure.level import level_of
from hfg.nodes.buses._failures import Lost, Refused, explained
from hfg.nodes.buses._forms import BadMessage, Form, from_bytes, to_bytes
from hfg.nodes.buses._life import Life
from hfg.nodetypes.counting import Counting
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter
from hfg.ports.events import EventPort

_FIRST_PAUSE_S: Final = 0.1
_CLOSING_S: Final = 2.0


class Message(msgspec.Struct, frozen=True):
    """A value, and where it came from or goes to.

    Attributes:
      value: its content.
      address: a topic, a client of a server, "host:port"; "" when it is sent: the usual one, or all.
    """

    value: Any
    address: str = ""


def parted(message: Any) -> tuple[Any, str]:
    """Return the value of a message, and its address; "" of a plain value."""
    return (message.value, message.address) if isinstance(message, Message) else (message, "")


class Connection(Counting, Node):
    """A connection that lives while its node is active.

    If nothing in the graph can activate the node, it lives for the whole run. When it is lost it is made again, after
    pauses that double from 0.1 s to the longest; an error that another attempt does not help against, such as a wrong
    password, is an error of the node (`on_error`). The report counts what passed and what was lost.

    Attributes:
      attempts: attempts in a row that may fail before the node does; 0: any number.
      longest_pause_s: the longest pause between two attempts.
      timeout_s: seconds that the other side has to answer.
      connected: the connection is open; the address.
      disconnected: it was lost or could not be made; why. Triggered once for each loss, and for each new reason.

    Raises:
      UsageError: the run is in virtual time, which does not wait for the world outside.
    """

    attempts = Parameter(0, Ge(0))
    longest_pause_s = Parameter(30.0, Gt(0), unit="s")
    timeout_s = Parameter(10.0, Gt(0), unit="s")
    connected = Event(str)
    disconnected = Event(str)

    is_real: ClassVar[bool] = True
    """Whether it reaches out of the process, so that virtual time cannot be had."""
    hears: ClassVar[tuple[str, ...]] = ("received",)
    """Events by which the other side is heard; with an edge at one of them, it decides when the connection ends."""

    breaks_all: ClassVar[bool] = True
    """Whether the end of the connection is the end of all that is being said."""

    # --- what a protocol says ---

    def address(self) -> str:
        """Return the address for people, without secrets."""
        raise NotImplementedError

    def link(self) -> AbstractAsyncContextManager[Any]:
        """Open it, and close it in the end.

        Raises `Refused` if another attempt does not help; other errors are tried again.
        """
        raise NotImplementedError

    async def read(self, link: Any) -> Any:
        """Hear the other side until it has ended well. Raises errors when the connection is lost."""
        raise NotImplementedError

    async def write(self, link: Any, message: Any) -> Any:
        """Say something; it has arrived as far as the protocol tells. Raises errors when the connection is lost."""
        raise NotImplementedError

    async def finish(self, link: Any) -> None:
        """Tell the other side that nothing more comes, where the protocol can."""

    # --- its life ---

    async def setup(self) -> None:
        """Begin, unless activity does.

        Raises:
          UsageError: the run is in virtual time.
        """
        self._counts: Counter[str] = Counter()
        self._link: Any = None
        self._scope = anyio.CancelScope()
        self._writing: set[anyio.CancelScope] = set()
        self._broken: BaseException | None = None
        self._changed = asyncio.Event()
        self._finishing = asyncio.Event()
        if self.is_real and isinstance(asyncio.get_running_loop(), VirtualTimeLoop):
            raise UsageError(
                f'"{self.place.path}" is connected with the world outside, which virtual time does not wait for: run '
                'it with clock="real", or put a source of your own in its place'
            )
        self._look_around()
        self._begin()
        if self._always:
            self.start_soon(self._live())

    def _look_around(self) -> None:
        """See who can activate the node and who hears it."""
        self._always, self._is_heard = True, False
        for flat in flatten(graph_of(level_of(self.place.graph).whole.root.face)).walk():
            for edge in flat.edges:
                if getattr(edge.target.port, "node", None) is self and (edge.active or edge.target.name == "activate"):
                    self._always = False
                if getattr(edge.source.port, "node", None) is self and edge.source.name in self.hears:
                    self._is_heard = True

    def _begin(self) -> None:
        self._life = Life(_FIRST_PAUSE_S, self.longest_pause_s, self.attempts, self.place.path)

    def on_activated(self) -> None:
        """Be ready for another life."""
        if not self._always:
            self._begin()

    def on_deactivated(self) -> None:
        """Let go of values that wait to be sent."""
        self._wake()

    async def do(self) -> Any:
        """Be connected (rule A15)."""
        return None if self._always else await self._live()

    async def _live(self) -> Any:
        life = self._life
        try:
            while True:
                life.connect()
                try:
                    return await self._once(life)
                except (Lost, Refused, OSError, EOFError, ExceptionGroup) as error:
                    pause_s = self._lost(life, explained(error))
                with anyio.move_on_after(pause_s):
                    await self._finishing.wait()
                if self._finishing.is_set():
                    return None
        finally:
            life.end()
            self._wake()

    async def _once(self, life: Life) -> Any:
        """Connect, and stay until the end of the connection. Return what it ended with."""
        stack = AsyncExitStack()
        self._broken = None
        try:
            async with asyncio.timeout(self.timeout_s):
                link = await stack.enter_async_context(self.link())
            life.open(asyncio.get_running_loop().time())
            with anyio.CancelScope() as self._scope:
                self._link = link
                self._wake()
                self.connected.trigger(self.address())
                if self._finishing.is_set():
                    await self._say_end()
                return await self.read(link)
            if self._broken is not None:
                raise self._broken
            return None
        finally:
            self._link = None
            for one in self._writing if self.breaks_all else ():
                one.cancel()
            with suppress(Exception):  # the connection may be broken
                async with asyncio.timeout(_CLOSING_S):
                    await stack.aclose()

    def _lost(self, life: Life, error: Lost | Refused) -> float:
        """Say that it is lost, and return the pause.

        Raises:
          TransportError: another attempt does not help, or there were enough.
        """
        said = f"{self.address()}: {error}"
        if life.is_open:
            self._counts["lost connections"] += 1
        if isinstance(error, Refused):
            self.disconnected.trigger(said)
            raise TransportError(said) from error
        retry = life.lose(str(error), asyncio.get_running_loop().time())
        if retry.is_news:
            self.log.warning("%s", said)
            self.disconnected.trigger(said)
        if retry.pause_s is None:
            raise TransportError(f"{said} ({life.failures} attempts)") from error
        return retry.pause_s

    @property
    def _lives(self) -> bool:
        return (self._always or self.active) and self._life.phase != "over"

    def _wake(self) -> None:
        """Let those look again who wait for a change."""
        self._changed.set()
        self._changed = asyncio.Event()

    # --- hearing ---

    async def hear(
        self, data: bytes | BadMessage, form: Form, event: EventPort[Any], *, address: str | None = None
    ) -> None:
        """Send a message of the other side on, and wait until the graph has room for more.

        Args:
          data: of the message, or why it has none.
          form: its form.
          event: by which it is sent; the event `invalid` if it is not of that form.
          address: makes it a `Message`.
        """
        try:
            if isinstance(data, BadMessage):
                raise data
            value = from_bytes(data, form)
        except BadMessage as error:
            self._counts["invalid"] += 1
            if self._counts["invalid"] == 1:
                self.log.warning("%s: %s", self.address(), error)
            await self._port("event", "invalid").trigger_wait(str(error))
            return
        self._counts["received"] += 1
        await event.trigger_wait(value if address is None else Message(value, address))

    # --- saying ---

    async def send(self, message: Any) -> Any:
        """Say something as soon as the connection is open, and return what `write` does; the edge is held until then.

        A message that was being sent when the connection was lost is sent again.
        """
        while True:
            link = await self._opened()
            if link is None:
                self._counts["not sent" if self._lives else "ignored"] += 1
                return None
            with anyio.CancelScope() as scope:
                self._writing.add(scope)
                try:
                    result = await self.write(link, message)
                    self._counts["sent"] += 1
                    return result
                except (Lost, Refused, OSError, EOFError) as error:
                    self._break(link, error)
                finally:
                    self._writing.discard(scope)
            self._counts["said again"] += 1
            await asyncio.sleep(0)  # the connection has to notice that it is over

    async def _opened(self) -> Any:
        """Return the open connection, or None if the node is not connected any more."""
        while self._lives:
            if self._link is not None:
                return self._link
            if getattr(self, "absent", "wait") == "pass":
                return None
            await self._changed.wait()
        return None

    def _break(self, link: Any, error: BaseException) -> None:
        if self._link is link:
            self._link, self._broken = None, error
            self._scope.cancel()

    async def end(self) -> None:
        """Report the end to the other side; if the graph does not hear the other side, close the connection."""
        self._finishing.set()
        if self._link is not None:
            await self._say_end()

    async def _say_end(self) -> None:
        if self._is_heard:
            await self.finish(self._link)
        else:
            self._scope.cancel()

    def statistics(self) -> Mapping[str, int]:
        """Count what passed and what was lost."""
        counts = getattr(self, "_counts", {})
        return {"connections": self._life.opened, **counts} if counts or hasattr(self, "_life") else {}


class Sender(Connection):
    """A connection by which values are sent.

    Attributes:
      message: each value. While the node is not active values pass by, counted as ignored.
      form: what a message is: "text", "bytes" or "json".
      absent: what to do with values while there is no connection: "wait" holds the edge, so that the graph waits;
        "pass" discards and counts them.
      most_bytes: of one message; a longer one is refused or skipped, and counted.
    """

    message = Input(Any, optional=True)
    form = Parameter("text", type=Form)
    absent = Parameter("wait", type=Literal["wait", "pass"])
    most_bytes = Parameter(2**20, Ge(1))

    async def process(self, message: Any) -> None:
        """Send it."""
        if message is not None:
            await self.send(self.packed(message))

    def packed(self, message: Any) -> Any:
        """Return what `write` takes."""
        return self.as_bytes(message)

    def as_bytes(self, value: Any) -> bytes:
        """Return a value as the bytes of a message.

        Raises:
          TypeError: it is not of that form.
          ValueError: it is too long, or has no form in JSON.
        """
        data = to_bytes(value, self.form)
        if len(data) > self.most_bytes:
            raise ValueError(
                f"a message has {len(data):,} bytes, and {self.most_bytes:,} may be sent: raise most_bytes"
            )
        return data
