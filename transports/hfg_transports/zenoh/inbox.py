"""From other threads to the event loop, with one wake-up per burst.

What costs is not the message but waking the loop: 48,000 messages a second with a wake-up each, over a million with one
for all that has come meanwhile. So threads leave what they have in a mailbox, and the first to do so since the loop
last looked rings for it. Bounded: what a loop that hangs does not fetch is dropped and counted, which a transport may.
Depends on errors and logs.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from hfg.base.logs import log

MOST: Final = 100_000
"""Messages in one mailbox that the loop has not fetched."""

_Item = TypeVar("_Item")


class Inbox:
    """Rings for the loop; one for all mailboxes of a session.

    Attributes:
      failed: how many receivers have raised.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.failed = 0
        self._loop = loop
        self._filled: deque[Mailbox[object]] = deque()  # appended to by any thread
        self._rung = False  # set by any thread, cleared by the loop
        self._closed = False

    def ring(self, mailbox: Mailbox[object]) -> None:
        """Have the loop look into a mailbox; from any thread."""
        self._filled.append(mailbox)
        if self._rung or self._closed:
            return
        self._rung = True
        try:
            self._loop.call_soon_threadsafe(self._look)
        except RuntimeError:  # the loop is closed, so the inbox is not read any more
            self._closed = True

    def close(self) -> None:
        """Make no more callbacks."""
        self._closed = True
        self._filled.clear()

    def _look(self) -> None:
        # Cleared first: who leaves something from now on rings again, at worst for nothing. The other way round a
        # message that came between the last look and the clearing would lie there until the next one.
        self._rung = False
        for _ in range(len(self._filled)):  # what comes meanwhile waits for its own ring, so other callbacks have turns
            if self._closed:
                return
            mailbox = self._filled.popleft()
            try:
                mailbox.deliver()
            except Exception:
                self.failed += 1
                log().exception("%s raised and goes on", mailbox.whose)


class Mailbox(Generic[_Item]):
    """Where one thread leaves items for one receiver.

    Attributes:
      whose: what it receives, for logs.
      lost: how many came when it was full.
    """

    __slots__ = (
        "_bytes_in",
        "_bytes_out",
        "_closed",
        "_inbox",
        "_items",
        "_largest",
        "_listed",
        "_receive",
        "lost",
        "whose",
    )

    def __init__(self, inbox: Inbox, whose: str, receive: Callable[[list[_Item]], None], *, largest: int = 0) -> None:
        """Make one.

        Args:
          inbox: rings for it.
          whose: what it receives.
          receive: called on the loop with all that lies there.
          largest: how many bytes may lie there; 0: they are not counted.
        """
        self.whose = whose
        self.lost = 0
        self._inbox = inbox
        self._receive = receive
        self._largest = largest
        self._items: deque[tuple[_Item, int]] = deque()
        self._listed = False  # in the inbox's list: set by the thread, cleared by the loop
        self._bytes_in = 0  # written by the thread
        self._bytes_out = 0  # written by the loop; two counters, for one that both write would lose counts
        self._closed = False

    def leave(self, item: _Item, size: int = 0) -> None:
        """Leave an item, from one thread."""
        if self._closed:
            return
        if len(self._items) >= MOST or (self._largest and self._bytes_in - self._bytes_out + size > self._largest):
            self.lost += 1
            return
        self._bytes_in += size
        self._items.append((item, size))
        if not self._listed:
            self._listed = True
            self._inbox.ring(self)  # type: ignore[arg-type] # the inbox looks at none of its items

    def deliver(self) -> None:
        """Deliver queued messages to the receiver; on the loop."""
        self._listed = False  # before looking, as with the inbox's own flag
        fetch = self._items.popleft
        taken = [fetch() for _ in range(len(self._items))]
        if taken and not self._closed:
            self._bytes_out += sum(size for _, size in taken)
            self._receive([item for item, _ in taken])

    def close(self) -> None:
        """Deliver nothing any more; on the loop."""
        self._closed = True
        self._items.clear()
