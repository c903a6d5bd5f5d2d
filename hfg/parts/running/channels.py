"""Messages between the parts of a run, on a session of a transport: in order, and without loss.

Stands on `hfg.links` and `messages`.
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

__all__ = ["Channel", "called", "name_of"]

_LOGGER = Log("hfg.parts")
_WINDOW: Final = 64  # messages on their way
_MAIN: Final = "main"  # what the part without a name is called in keys


def name_of(part: str) -> str:
    """Give what a part is called in the keys of a transport."""
    return f"part {part}" if part else _MAIN


def called(part: str) -> str:
    """Return what people call a part: by its group, or as the main process."""
    return f'group "{part}"' if part else "the main process"


class Channel:
    """Messages between two parts, in order and without loss, both ways.

    What cannot leave at once waits in memory: there is little of it, and whoever says something goes on.

    Attributes:
      refused: how much has come that is no message, or says what cannot be so (L4).
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
          receive: called with each message; it may raise `Untrue`.
        """
        self._there = there
        one, other = name_of(here), name_of(there)
        self.refused = 0
        self._receive = receive
        self._waiting: list[Message] = []
        self._is_closed = False
        there_from_here = f"{run}/{one}/{other}/{lives[0]}.{lives[1]}"
        here_from_there = f"{run}/{other}/{one}/{lives[1]}.{lives[0]}"
        self._out = LinkSender(session, there_from_here, epoch=lives[0], window=_WINDOW, released=self._send)
        self._out.admit(other, lives[1])
        self._in = LinkReceiver(session, here_from_there, consumer=one, incarnation=lives[0], arrived=self._arrived)

    @property
    def waiting(self) -> int:
        """How many messages have not left."""
        return len(self._waiting)

    def send(self, message: Message) -> None:
        """Say something; it arrives when the other is there. Nothing is heard of it once this is closed."""
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
                self.refuse("it has sent what is no message")
                continue
            try:
                self._receive(message)
            except Untrue as problem:
                self.refuse(f'it has said "{type(message).__name__}", {problem}')

    def refuse(self, why: str) -> None:
        """What has come changes nothing; it is counted, and logged the first time."""
        self.refused += 1
        if self.refused == 1:
            _LOGGER.warning("%s is not believed: %s; more of the kind is counted", called(self._there), why)

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
        self._is_closed = True
        await self._out.close()
        await self._in.close()
