"""Puts: at once, or for long payloads in a thread of their own, in the order of their publisher.

A put that finds no room is dropped by Zenoh, never waited for: the links repair loss, and Zenoh's blocking kind stands
still for seconds and then loses the message all the same. Even a dropping put of a few megabytes may take fifty
milliseconds, though, so longer datagrams go through a thread; later datagrams of the same publisher queue after them.
Depends on config and binding.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Final

from hfg.base.logs import log
from hfg.errors import MessageTooLarge, TransportError
from hfg.transport import Buffer, Traffic, size_of
from hfg_transports.zenoh.config import LONG

if TYPE_CHECKING:
    from collections.abc import Callable

    import zenoh

MOST_BYTES: Final = 128 * 2**20
"""What waits in the sender's thread; one message may always."""


class Sender:
    """The thread through which long payloads go; begun by the first.

    Attributes:
      dropped: what found no room.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._jobs: deque[tuple[Callable[[], None], int]] = deque()
        self._waiting = 0  # bytes; under the condition
        self._changed = threading.Condition()
        self._closing = False
        self._thread: threading.Thread | None = None

    def give(self, job: Callable[[], None], size: int) -> bool:
        """Have a job done after those given before; False if there is no room for its bytes."""
        with self._changed:
            if self._closing or (self._waiting and self._waiting + size > MOST_BYTES):
                self.dropped += 1
                return False
            self._jobs.append((job, size))
            self._waiting += size
            if self._thread is None:  # no daemon, see `ending`; a put that drops is never stuck
                self._thread = threading.Thread(target=self._work, name="hfg zenoh sender")
                self._thread.start()
            self._changed.notify()
        return True

    def close(self, wait_s: float) -> None:
        """Do what is left, but no longer than that; blocks."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join(wait_s)
        with self._changed:
            self._jobs.clear()

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._jobs:
                    if self._closing:
                        return
                    self._changed.wait()
                job, size = self._jobs.popleft()
            try:
                job()
            except (
                Exception
            ) as error:  # the session is closed, or Zenoh is at fault: nothing that the link cannot repair
                log().debug("a message could not be sent: %s", error)
            with self._changed:
                self._waiting -= size


def as_zenoh_takes_it(buffer: Buffer) -> bytes | bytearray:
    """Copy it, if it is a view: Zenoh takes bytes and bytearrays only."""
    return bytes(buffer) if isinstance(buffer, memoryview) else buffer


class ZenohPublisher:
    """Puts datagrams on one key; see `hfg.transport.Publisher`."""

    def __init__(
        self,
        key: str,
        publisher: zenoh.Publisher,
        sender: Sender,
        largest: int,
        closed: Callable[[ZenohPublisher], None],
    ) -> None:
        self.key = key
        self._tell_closed = closed
        self._publisher = publisher
        self._sender = sender
        self._largest = largest
        self._given = 0  # messages to the sender; written by the loop
        self._sent = 0  # those it has put; written by its thread
        self._closed = False

    @property
    def wanted(self) -> bool:
        """Whether the key has a subscriber, as far as this session knows."""
        return not self._closed and bool(self._publisher.matching_status)

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram; see `hfg.transport.Publisher.put`."""
        if self._closed:
            raise TransportError(f'the publisher of "{self.key}" is closed; make another one')
        size = len(header) + size_of(payload)
        if size > self._largest:
            raise MessageTooLarge(
                f'a message of {size} bytes for "{self.key}" is too long, and at most {self._largest} are sent; '
                "send it in parts, or raise largest_message in the settings of all programs"
            )
        if size <= LONG and self._given == self._sent:
            self._put(header, payload)
        elif self._sender.give(lambda: self._put_behind(header, payload), size):
            self._given += 1

    def close(self) -> None:
        """Stop it; what was put is still sent."""
        if not self._closed:
            self._closed = True
            self._tell_closed(self)
            if self._given == self._sent:
                self._undeclare()
            else:
                self._sender.give(self._undeclare, 0)

    def session_closed(self) -> None:
        """Refuse what is put from now on."""
        self._closed = True

    def _put(self, header: bytes, payload: Buffer) -> None:
        try:
            self._publisher.put(as_zenoh_takes_it(payload), attachment=header)
        except Exception as error:
            raise TransportError(
                f'nothing can be sent to "{self.key}" any more: {error}; open a new session'
            ) from error

    def _put_behind(self, header: bytes, payload: Buffer) -> None:
        try:
            self._put(header, payload)
        finally:
            self._sent += 1

    def _undeclare(self) -> None:
        self._publisher.undeclare()


def quality(library: Any, traffic: Traffic) -> dict[str, Any]:
    """Return how Zenoh sends a kind of traffic.

    Order holds within one priority only, so each kind has one. Express: sent without waiting for others to share a
    batch, which halves the delay and the throughput.
    """
    priority = library.Priority
    said = {
        Traffic.ACKNOWLEDGEMENTS: (priority.INTERACTIVE_HIGH, True),
        Traffic.TOKENS: (priority.DATA_HIGH, True),
        Traffic.BULK: (priority.DATA, False),
        Traffic.BACKGROUND: (priority.BACKGROUND, False),
    }
    urgency, express = said[traffic]
    return {"congestion_control": library.CongestionControl.DROP, "priority": urgency, "express": express}
