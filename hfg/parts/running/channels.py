"""Messages between the parts of a run, on a session of a transport: in order, and without loss.

Depends on `hfg.links` and `messages`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from hfg.base.logs import Log
from hfg.errors import TransportError
from hfg.links.running import LinkReceiver, LinkSender
from hfg.parts.model.messages import Message, Untrue, pack, unpack
from hfg.transport import Session

_LOGGER = Log("hfg.parts")
_WINDOW: Final = 64  # messages in transit
_MAIN: Final = "main"  # name of the part without a name, in keys


def name_of(part: str) -> str:
    """Return the name of a part in the keys of a transport."""
    return f"part {part}" if part else _MAIN


def called(part: str) -> str:
    """Return the name of a part for users: its group, or the main process."""
    return f'group "{part}"' if part else "the main process"


class Channel:
    """Messages between two parts, in order and without loss, in both directions.

    Messages that cannot leave at once wait in memory: there are few, and the sender continues.

    Attributes:
      refused: how many messages were malformed or cannot be true (L4).
    """

    def __init__(
        self,
        session: Session,
        run: str,
        here: str,
        there: str,
        incarnations: tuple[int, int],
        receive: Callable[[Message], None],
    ) -> None:
        """Open this end.

        Args:
          session: session of the transport.
          run: the name by which all parts know the run.
          here: the name of this part.
          there: the name of the other part.
          incarnations: the incarnations of both.
          receive: called with each message; it may raise `Untrue`.
        """
        self._there = there
        one, other = name_of(here), name_of(there)
        self.refused = 0
        self._receive = receive
        self._waiting: list[Message] = []
        self._is_closed = False
        there_from_here = f"{run}/{one}/{other}/{incarnations[0]}.{incarnations[1]}"
        here_from_there = f"{run}/{other}/{one}/{incarnations[1]}.{incarnations[0]}"
        self._out = LinkSender(session, there_from_here, epoch=incarnations[0], window=_WINDOW, released=self._send)
        self._out.admit(other, incarnations[1])
        self._in = LinkReceiver(
            session, here_from_there, consumer=one, incarnation=incarnations[0], arrived=self._arrived
        )

    @property
    def waiting(self) -> int:
        """Number of messages that have not left."""
        return len(self._waiting)

    def send(self, message: Message) -> None:
        """Send a message; it arrives when the other part is there. After `close`, it is lost."""
        if self._is_closed:
            return
        self._waiting.append(message)
        self._send()

    def _send(self) -> None:
        while self._waiting and self._out.free:
            self._out.send_nowait((b"", pack(self._waiting.pop(0))))

    def _arrived(self) -> None:
        for delivery in self._in.machine.take_all():
            message = unpack(delivery.token[1])
            self._in.done()
            if message is None:
                self.refuse("it has sent something that is not a message")
                continue
            try:
                self._receive(message)
            except Untrue as problem:
                self.refuse(f'it has sent "{type(message).__name__}", {problem}')

    def refuse(self, why: str) -> None:
        """Ignore a message; count it, and log the first one."""
        self.refused += 1
        if self.refused == 1:
            _LOGGER.warning("%s is not trusted: %s; further cases are only counted", called(self._there), why)

    async def flush(self, within_s: float) -> None:
        """Wait until the other part has received everything, at most for `within_s`."""
        try:
            async with asyncio.timeout(within_s):
                while self._waiting:
                    await self._out.wait_finished()
                await self._out.wait_finished()
        except (TimeoutError, TransportError):
            pass

    async def close(self) -> None:
        """Close the channel."""
        self._is_closed = True
        await self._out.close()
        await self._in.close()
