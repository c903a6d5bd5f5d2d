"""A session with programs that are not hfg's, such as nodes of ROS 2: keys, bytes and attachments as they are.

It is a client of one router. Zenoh reconnects to a router that was lost, and repeats all declarations. All methods
are called on one event loop and call back there. Depends on opening, asking, inbox, sending, declaring and binding.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from hfg.base.logs import log
from hfg.errors import MessageTooLarge, NoAnswer, TransportError
from hfg.transport import Traffic
from hfg_transports.zenoh import binding
from hfg_transports.zenoh.asking import Question
from hfg_transports.zenoh.config import LONG
from hfg_transports.zenoh.declaring import Declarations, Declared
from hfg_transports.zenoh.ending import close_at_the_end
from hfg_transports.zenoh.inbox import Inbox, Mailbox
from hfg_transports.zenoh.opening import check_session, open_checked
from hfg_transports.zenoh.presence import Announcement
from hfg_transports.zenoh.sending import quality
from hfg_transports.zenoh.settings import Settings, is_loopback, read_settings

if TYPE_CHECKING:
    import zenoh

_CLOSE_S: Final = 2.0
_LONGEST_QUEUE: Final = 4
"""Messages of the largest size that a subscription keeps for a loop that is busy."""

_FOREVER_S: Final = 24 * 3600.0 * 365
_DIFFERENT: Final = {"timestamping/enabled": True}
"""Publishers that keep their last messages need stamps of Zenoh's own."""


class ForeignMessage(NamedTuple):
    """What came on a key."""

    key: str
    payload: bytes
    attachment: bytes


class ForeignRequest:
    """A request of another program; it must be answered or refused, once.

    Attributes:
      payload, attachment: what it says.
    """

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self.payload = b"" if query.payload is None else query.payload.to_bytes()
        self.attachment = b"" if query.attachment is None else query.attachment.to_bytes()
        self._query: zenoh.Query | None = query
        self._key = key

    def answer(self, payload: bytes | bytearray, attachment: bytes) -> None:
        """Answer it; long answers block while they are sent."""
        self._end(lambda query: query.reply(self._key, payload, attachment=attachment))

    def refuse(self, why: str) -> None:
        """Say why there is no answer."""
        self._end(lambda query: query.reply_err(why.encode(errors="replace")))

    def _end(self, say: Callable[[zenoh.Query], object]) -> None:
        query, self._query = self._query, None
        if query is None:
            return
        try:
            say(query)
        except Exception as error:  # who has asked is gone, or the session is
            log().debug("an answer could not be sent: %s", error)
        finally:
            with contextlib.suppress(Exception):
                query.drop()


class ForeignRouter:
    """The address of a router, checked.

    Args:
      address: "tcp/localhost:7447", or the path of a settings file of hfg (".toml") whose `connect` names the address,
        with certificates, a key, or `insecure = true`.

    Attributes:
      settings: the settings.
      where: the address, for messages.
      exposed: the addresses without authentication.

    Raises:
      TransportError: the address cannot be used.
      FileError: something is wrong with the file.
    """

    def __init__(self, address: str) -> None:
        if address.endswith(".toml"):
            self.settings = read_settings(Path(address))
        else:
            if address.startswith("tcp/") and not is_loopback(address):
                raise TransportError(
                    f'at "{address}" no end is authenticated, so any program on the network can send commands: write '
                    f'a settings file with connect = ["{address}"] and insecure = true if you trust them all, '
                    "or with tls/ and certificates, and pass its path"
                )
            self.settings = Settings(connect=(address,), insecure=True)
        if not self.settings.connect:
            raise TransportError(f'the settings "{address}" name no router: write connect = ["tls/robot.local:7447"]')
        self.where = " and ".join(self.settings.connect)
        self.exposed = check_session(self.settings, "client")

    async def open(self, *, wait_s: float) -> ForeignSession:
        """Open a session on the running loop.

        Raises:
          TransportError: no router is there within that time.
        """
        work = asyncio.to_thread(open_checked, self.settings, "client", wait_s=wait_s, more=_DIFFERENT)
        opening = asyncio.ensure_future(work)
        try:
            raw = await asyncio.shield(opening)
        except asyncio.CancelledError:
            opening.add_done_callback(_close_unwanted)
            raise
        return ForeignSession(raw, self.settings.largest_message)


def _close_unwanted(opened: asyncio.Future[zenoh.Session]) -> None:
    if not opened.cancelled() and opened.exception() is None:
        threading.Thread(target=opened.result().close, name="hfg zenoh close").start()


class ForeignPublisher:
    """Puts messages on one key."""

    def __init__(self, publisher: Any, *, waits: bool, withdraw: Callable[[], None]) -> None:
        self._publisher = publisher
        self._waits = waits
        self._withdraw = withdraw

    async def put(self, payload: bytes | bytearray, attachment: bytes) -> None:
        """Send one; in a thread if that may take time.

        Raises:
          TransportError: the session is closed.
        """
        try:
            if self._waits or len(payload) > LONG:
                await asyncio.to_thread(self._publisher.put, payload, attachment=attachment)
            else:
                self._publisher.put(payload, attachment=attachment)
        except Exception as error:
            raise TransportError(f"nothing can be sent any more: {error}; open a new session") from error

    def close(self) -> None:
        """Stop it."""
        self._withdraw()


class ForeignSession:
    """One program's end.

    Attributes:
      name: Zenoh's id of it.
      largest_message: the most bytes of a message.
      refused: how many messages came that were longer.
    """

    def __init__(self, raw: zenoh.Session, largest_message: int) -> None:
        self.name = str(raw.zid())
        self.largest_message = largest_message
        self.refused = 0
        self._raw = raw
        self._loop = asyncio.get_running_loop()
        self._library = binding.load()
        self._inbox = Inbox(self._loop)
        self._mailboxes: list[Mailbox[Any]] = []
        self._declarations = Declarations()
        self._questions: set[Question] = set()
        self._replies: Mailbox[tuple[Question, Any]] = Mailbox(self._inbox, "answers", _settle)
        self._closed = False
        close_at_the_end(self)

    @property
    def lost(self) -> int:
        """How many messages were dropped because the loop did not fetch them."""
        return sum(one.lost for one in self._mailboxes)

    def watch_connection(self, changed: Callable[[list[bool]], None]) -> Announcement:
        """Hear whether the router is there, now and on each change."""
        mailbox: Mailbox[bool] = Mailbox(self._inbox, "the watch over the connection", changed)
        return self._until_closed(mailbox, binding.watch_connections(self._raw, mailbox.leave))

    def publisher(self, key: str, *, waits: bool, kept: int) -> ForeignPublisher:
        """Make what puts messages on a key.

        Args:
          key: where.
          waits: whether a put waits while the connection has no room; otherwise Zenoh drops the message untold.
          kept: how many messages are kept for those who subscribe later.
        """
        control = self._library.CongestionControl
        said = {"congestion_control": control.BLOCK if waits else control.DROP}
        if kept:
            made = binding.keeping_publisher(self._raw, key, kept, **said)
        else:
            made = self._raw.declare_publisher(key, **said)
        kept_one: Declared = self._declarations.keep(made)
        return ForeignPublisher(made, waits=waits, withdraw=lambda: self._declarations.withdraw(kept_one))

    def subscribe(self, key: str, receive: Callable[[list[ForeignMessage]], None], *, history: int = 0) -> Announcement:
        """Have the messages on a key, and up to so many that each publisher has kept."""
        room = _LONGEST_QUEUE * self.largest_message
        mailbox: Mailbox[ForeignMessage] = Mailbox(self._inbox, f'the subscriber of "{key}"', receive, largest=room)

        def arrived(sample: zenoh.Sample) -> None:  # in Zenoh's thread, which is this subscription's own
            attachment = sample.attachment
            size = len(sample.payload) + (0 if attachment is None else len(attachment))
            if size > self.largest_message:
                self.refused += 1
                return
            header = b"" if attachment is None else attachment.to_bytes()
            mailbox.leave(ForeignMessage(str(sample.key_expr), sample.payload.to_bytes(), header), size)

        handler = binding.callback(arrived)
        if history:
            return self._until_closed(mailbox, binding.catching_subscriber(self._raw, key, handler, history))
        return self._until_closed(mailbox, self._raw.declare_subscriber(key, handler))

    def token(self, key: str) -> Announcement:
        """Be seen under a key."""
        token = self._declarations.keep(self._raw.liveliness().declare_token(key))
        return Announcement(lambda: self._declarations.withdraw(token))

    def watch(self, pattern: str, changed: Callable[[list[tuple[bool, str]]], None]) -> Announcement:
        """Hear whose tokens come and go, those that are there already first."""
        mailbox: Mailbox[tuple[bool, str]] = Mailbox(self._inbox, f'the watch over "{pattern}"', changed)
        put = self._library.SampleKind.PUT

        def told(sample: zenoh.Sample) -> None:  # in Zenoh's thread
            mailbox.leave((sample.kind == put, str(sample.key_expr)))

        subscriber = self._raw.liveliness().declare_subscriber(pattern, binding.callback(told), history=True)
        return self._until_closed(mailbox, subscriber)

    def serve(self, key: str, receive: Callable[[list[ForeignRequest]], None]) -> Announcement:
        """Have the requests to a key."""
        room = _LONGEST_QUEUE * self.largest_message
        mailbox: Mailbox[ForeignRequest] = Mailbox(self._inbox, f'who serves "{key}"', receive, largest=room)

        def arrived(query: zenoh.Query) -> None:  # in Zenoh's thread
            if query.payload is not None and len(query.payload) > self.largest_message:
                self.refused += 1
                query.drop()
                return
            request = ForeignRequest(query, key)
            mailbox.leave(request, len(request.payload))

        return self._until_closed(mailbox, self._raw.declare_queryable(key, binding.callback(arrived), complete=True))

    async def ask(self, key: str, payload: bytes | bytearray, attachment: bytes, *, timeout_s: float | None) -> bytes:
        """Return the first answer to a request; cancelling withdraws it.

        Raises:
          NoAnswer: no program serves the key, the server or the router has gone, or the time is over.
          QueryRefused: the server answers with an error.
        """
        if len(payload) > self.largest_message:
            raise MessageTooLarge(
                f"a request of {len(payload)} bytes is too long, at most {self.largest_message} are sent; raise "
                "largest_message in the settings"
            )
        if self._closed:
            raise NoAnswer("the session is closed")
        asked = Question(key, self._loop, self._replies)
        cancelling = self._library.CancellationToken()
        self._questions.add(asked)
        try:
            self._raw.get(
                key,
                binding.network_callback(asked.on_reply, asked.on_end),
                payload=payload,
                attachment=attachment,
                timeout=_FOREVER_S if timeout_s is None else timeout_s + 1,  # ours counts; this frees what Zenoh keeps
                target=self._library.QueryTarget.ALL_COMPLETE,
                consolidation=self._library.ConsolidationMode.NONE,
                cancellation_token=cancelling,
                **quality(self._library, Traffic.ACKNOWLEDGEMENTS),
            )
            async with asyncio.timeout(timeout_s):
                await asyncio.wait([asked.future])
            return asked.future.result()
        except TimeoutError:
            raise NoAnswer(f"no answer has come within {timeout_s:g} s; is the server busy?") from None
        finally:
            self._questions.discard(asked)
            if not asked.future.done():  # cancelling waits for Zenoh's thread
                asked.future.cancel()
                threading.Thread(target=cancelling.cancel, name="hfg zenoh cancel").start()

    def _until_closed(self, mailbox: Mailbox[Any], declared: Declared) -> Announcement:
        self._mailboxes.append(mailbox)
        self._declarations.keep(declared)

        def close() -> None:
            mailbox.close()
            self._declarations.withdraw(declared)

        return Announcement(close)

    async def close(self) -> None:
        """End all of it."""
        if self._closed:
            return
        self._closed = True
        self._inbox.close()
        for asked in list(self._questions):
            asked.settle(NoAnswer("the session was closed"))
        closing = asyncio.ensure_future(asyncio.to_thread(self.close_raw))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_CLOSE_S):
                await asyncio.shield(closing)

    def close_raw(self) -> None:
        """Close Zenoh's session, from any thread; blocks."""
        self._declarations.withdraw_all()
        with contextlib.suppress(Exception):
            self._raw.close()


def _settle(replies: list[tuple[Question, Any]]) -> None:
    for question, said in replies:
        question.settle(said)
