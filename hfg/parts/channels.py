"""Messages between the parts of a run, and tokens over the edges between them, on a session of a transport.

A `Channel` is a pair of exact links for messages. `Carrier` connects a part with the links of its edges. Both know
which life of each part is meant, so that nobody listens to one that has died. Stands on `hfg.links`, `part` and
`messages`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

import msgspec

from hfg.encoding import TokenCodec
from hfg.engine.runtime.borders import Hearing
from hfg.errors import EncodingError, RunError, TransportError
from hfg.graph.flat import CutEdge
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.parts.messages import Hears, Message, Speaks, pack, unpack
from hfg.parts.part import Part
from hfg.token import Token
from hfg.transport import Session

__all__ = ["Carrier", "Channel", "name_of"]

_WINDOW: Final = 64  # messages on their way
_MAIN: Final = "main"  # what the part without a name is called in keys


def name_of(part: str) -> str:
    """Give what a part is called in the keys of a transport."""
    return f"part {part}" if part else _MAIN


class Channel:
    """Messages between two parts, in order and without loss, both ways.

    What cannot leave at once waits in memory: there is little of it, and whoever says something goes on.
    """

    def __init__(
        self,
        session: Session,
        run: str,
        here: str,
        there: str,
        lives: tuple[int, int],
        receive: Callable[[Message], None],
    ) -> None:
        """Open this end.

        Args:
          session: of the transport.
          run: by which name all parts of the run know it.
          here: the name of this part.
          there: that of the other.
          lives: which life of each this is.
          receive: called with each message.
        """
        one, other = name_of(here), name_of(there)
        self._receive = receive
        self._waiting: list[Message] = []
        self._out = LinkSender(session, f"{run}/{one}/{other}", epoch=lives[0], window=_WINDOW, released=self._send)
        self._out.admit(other, lives[1])
        self._in = LinkReceiver(
            session, f"{run}/{other}/{one}", consumer=one, incarnation=lives[0], arrived=self._arrived
        )

    def send(self, message: Message) -> None:
        """Say something; it arrives when the other is there."""
        self._waiting.append(message)
        self._send()

    def _send(self) -> None:
        while self._waiting and self._out.free:
            self._out.send_nowait((b"", pack(self._waiting.pop(0))))

    def _arrived(self) -> None:
        for delivery in self._in.machine.take_all():
            try:
                message = unpack(delivery.token[1])
            except msgspec.DecodeError:
                message = None  # from nobody of this run
            self._in.done()
            if message is not None:
                self._receive(message)

    async def flush(self, within_s: float) -> None:
        """Wait until the other has all that was said, or for so long."""
        try:
            async with asyncio.timeout(within_s):
                while self._waiting:
                    await self._out.wait_finished()
                await self._out.wait_finished()
        except (TimeoutError, TransportError):
            pass

    async def close(self) -> None:
        """End it."""
        await self._out.close()
        await self._in.close()


class Carrier:
    """Carries the tokens of a part over its edges to and from others."""

    def __init__(
        self,
        part: Part,
        session: Session,
        run: str,
        lives: dict[str, int],
        edges: list[CutEdge],
        say: Callable[[str, Message], None],
    ) -> None:
        """Connect the part.

        Args:
          part: nothing of which has begun yet.
          session: of the transport.
          run: by which name all parts of the run know it.
          lives: which life of each part this is for.
          edges: those between it and others.
          say: brings a message to another part.
        """
        self._links: list[Any] = []
        outgoing: dict[str, _Outgoing] = {}
        incoming: dict[str, _Incoming] = {}
        for edge in edges:
            key = f"{run}/edge/{edge.edge.index}"
            link: _Outgoing | _Incoming
            if edge.source == part.name:
                link = outgoing[edge.label] = _Outgoing(part, session, key, lives, edge, say)
            else:
                link = incoming[edge.label] = _Incoming(part, session, key, lives, edge, say)
            self._links.append(link)
        part.connect(outgoing, incoming)

    async def close(self) -> None:
        """End all links."""
        for link in self._links:
            await link.close()


class _Outgoing:
    """The near end of the link of an edge that leaves."""

    def __init__(
        self,
        part: Part,
        session: Session,
        key: str,
        lives: dict[str, int],
        edge: CutEdge,
        say: Callable[[str, Message], None],
    ) -> None:
        self._part = part
        self._edge = edge
        self._say = say
        self._codec = TokenCodec[Any](edge.hint, what=f'the value of "{edge.edge.source.port.path}"')
        self._sender: LinkSender | BoundedSender
        if edge.guarantee == "exact":
            self._sender = sender = LinkSender(
                session, key, epoch=lives[part.name], window=edge.window, released=self._released
            )
            sender.admit(name_of(edge.target), lives[edge.target])
        else:
            self._sender = BoundedSender(session, key, epoch=lives[part.name])

    def room(self) -> int:
        """See `Outgoing`."""
        sender = self._sender
        if isinstance(sender, BoundedSender):
            return self._edge.window * 4
        return self._edge.window - sender.machine.unfinished

    def send(self, tokens: list[Token[Any]]) -> None:
        """See `Outgoing`."""
        try:
            for token in tokens:
                self._sender.send_nowait(self._codec.encode(token))
        except (EncodingError, TransportError) as error:
            problem = RunError(
                f'edge "{self._edge.label}" cannot carry a value to {name_of(self._edge.target)}: {error}'
            )
            problem.__cause__ = error
            self._part.finish("failed", problem)

    def speaks(self, speaking: bool, total: int) -> None:
        """See `Outgoing`."""
        self._say(self._edge.target, Speaks(self._edge.label, speaking, total))

    def _released(self) -> None:
        assert isinstance(self._sender, LinkSender)
        self._part.be_taken(self._edge.label, self._sender.released)

    async def close(self) -> None:
        """End it."""
        await self._sender.close()


class _Incoming:
    """The near end of the link of an edge that comes in."""

    def __init__(
        self,
        part: Part,
        session: Session,
        key: str,
        lives: dict[str, int],
        edge: CutEdge,
        say: Callable[[str, Message], None],
    ) -> None:
        self._part = part
        self._edge = edge
        self._say = say
        self._done = 0
        self._codec = TokenCodec[Any](edge.hint, what=f'the value of "{edge.edge.source.port.path}"')
        self._receiver: LinkReceiver | BoundedReceiver
        if edge.guarantee == "exact":
            self._receiver = LinkReceiver(
                session, key, consumer=name_of(part.name), incarnation=lives[part.name], arrived=self._arrived
            )
        else:
            self._receiver = BoundedReceiver(session, key, arrived=self._arrived)

    def _arrived(self) -> None:
        tokens = []
        for delivery in self._receiver.machine.take_all():
            metadata, value = delivery.token
            try:
                token = self._codec.decode(metadata, value)
            except EncodingError as error:
                problem = RunError(f'edge "{self._edge.label}" brought what it cannot: {error}')
                problem.__cause__ = error
                self._part.finish("failed", problem)
                return
            tokens.append((token.value, token.activity, token.stamp))
        if tokens:
            self._part.receive(self._edge.label, tokens)

    def taken(self, total: int) -> None:
        """See `Incoming`."""
        if isinstance(self._receiver, LinkReceiver):
            self._receiver.done(total - self._done)
        self._done = total

    def hears(self, hearing: Hearing, total: int) -> None:
        """See `Incoming`."""
        self._say(self._edge.source, Hears(self._edge.label, hearing, total))

    async def close(self) -> None:
        """End it."""
        await self._receiver.close()
