"""The contract of `hfg.transport` over Zenoh: sessions, composed from the modules of this package.

All methods are called on one event loop and call back there. Opening and closing Zenoh's session block, and closing may
block for ten seconds if a receiver has stopped responding; so both have a thread, and closing is not waited for longer
than `CLOSE_S`. Depends on everything else here.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from hfg.base.logs import log
from hfg.errors import MessageTooLarge, NoAnswer, TransportError
from hfg.transport import Answer, Message, Receive, Traffic, Watch
from hfg_transports.zenoh import binding
from hfg_transports.zenoh.asking import Answerer, Question
from hfg_transports.zenoh.declaring import Declarations, Declared
from hfg_transports.zenoh.ending import close_at_the_end
from hfg_transports.zenoh.foreign import ForeignRouter
from hfg_transports.zenoh.inbox import Inbox, Mailbox
from hfg_transports.zenoh.names import Keys, escape, join
from hfg_transports.zenoh.opening import WAIT_S, open_session
from hfg_transports.zenoh.presence import Announcement, Watching, prefix_key, presence_key
from hfg_transports.zenoh.sending import Sender, ZenohPublisher, quality
from hfg_transports.zenoh.settings import Mode, Settings, read_settings
from hfg_transports.zenoh.versions import complaint, version_key

if TYPE_CHECKING:
    import zenoh

CLOSE_S: Final = 2.0
"""How long closing waits for those who stand still."""

_LONGEST_QUEUE: Final = 4
"""Messages of the largest size that a subscription keeps for a loop that is busy."""
_VERSIONS_S: Final = 1.0


class ZenohTransport:
    """Makes sessions over Zenoh."""

    foreign: Final = ForeignRouter
    """Sessions with programs that are not hfg's."""

    async def open(
        self,
        *,
        settings: Settings | Path | str | None = None,
        mode: Mode = "peer",
        wait_s: float = WAIT_S,
        **fields: Any,
    ) -> ZenohSession:
        """Begin a session on the running loop.

        Args:
          settings: the network, or the file that says it.
          mode: see `open_session`.
          wait_s: see `open_session`.
          **fields: of `Settings`, in place of those of `settings`.

        Raises:
          TransportError: it cannot be opened, see `open_session`; or there is a program of another version.
          FileError: something is wrong with the file.
        """
        chosen = await _chosen(settings, fields)
        if not _names_an_address(chosen):
            raise TransportError(
                "these settings name no address: write listen, connect or meet, or open a session of transport "
                '"local", which needs none on one computer'
            )
        return await _in_thread(lambda: _open(chosen, mode, wait_s), asyncio.get_running_loop())

    async def only_here(
        self, *, settings: Settings | Path | str | None = None, mode: Mode = "peer", **fields: Any
    ) -> dict[str, Any] | None:
        """Return what opens a session of transport "local" instead; None if these settings name an address.

        Raises:
          FileError: something is wrong with the file.
        """
        del mode
        chosen = await _chosen(settings, fields)
        if _names_an_address(chosen):
            return None
        return {"realm": chosen.realm, "host": chosen.host, "largest_message": chosen.largest_message}


async def _chosen(settings: Settings | Path | str | None, fields: dict[str, Any]) -> Settings:
    """Return settings, read from their file if needed, with some fields replaced."""
    if settings is None or isinstance(settings, Settings):
        chosen = settings or Settings()
    else:
        chosen = await asyncio.to_thread(read_settings, settings)
    if not fields:
        return chosen
    try:
        return msgspec.convert({**msgspec.structs.asdict(chosen), **fields}, Settings, from_attributes=True)
    except (msgspec.ValidationError, TypeError) as error:
        raise TransportError(f"{error}; see hfg_transports.zenoh.Settings") from None


def _names_an_address(settings: Settings) -> bool:
    return bool(settings.listen or settings.connect or settings.agents or settings.meet)


transport: Final = ZenohTransport()
"""What the entry point names."""


def _open(settings: Settings, mode: Mode, wait_s: float) -> Callable[[asyncio.AbstractEventLoop], ZenohSession]:
    """Open Zenoh's session and look who is there; in a thread."""
    raw = open_session(settings, mode, wait_s=wait_s)
    keys = Keys(settings.realm)
    for reply in raw.liveliness().get(f"{keys.versions}/**", timeout=_VERSIONS_S):
        if reply.ok is not None and (sentence := complaint(keys, str(reply.ok.key_expr), settings.realm)):
            raw.close()
            raise TransportError(sentence)

    def made(loop: asyncio.AbstractEventLoop) -> ZenohSession:
        try:
            return ZenohSession(raw, settings, loop)
        except BaseException:  # Zenoh's threads would keep the program from ending
            raw.close()
            raise

    return made


async def _in_thread(
    work: Callable[[], Callable[[asyncio.AbstractEventLoop], ZenohSession]], loop: asyncio.AbstractEventLoop
) -> ZenohSession:
    """Wait for a session that a thread opens; one that is no longer awaited is closed."""
    opened = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return (await asyncio.shield(opened))(loop)
    except asyncio.CancelledError:
        opened.add_done_callback(lambda done: None if done.cancelled() or done.exception() else _give_up(done.result()))
        raise


def _give_up(made: Callable[[asyncio.AbstractEventLoop], ZenohSession]) -> None:
    loop = asyncio.get_running_loop()
    loop.create_task(made(loop).close())  # noqa: RUF006 - the session keeps it


class ZenohSession:
    """One program's end; see `hfg.transport.Session`.

    Attributes:
      settings: it was opened with.
      name: by which Zenoh tells it from all other sessions.
    """

    def __init__(self, raw: zenoh.Session, settings: Settings, loop: asyncio.AbstractEventLoop) -> None:
        self.settings = settings
        self.name = str(raw.zid())
        self._raw = raw
        self._loop = loop
        self._library = binding.load()
        self._keys = Keys(settings.realm)
        self._inbox = Inbox(loop)
        self._sender = Sender()
        self._publishers: set[ZenohPublisher] = set()
        self._mailboxes: list[Mailbox[Any]] = []
        self._answerers: set[Answerer] = set()
        self._questions: set[Question] = set()
        self._announced: set[str] = set()
        self._declarations = Declarations()
        self._announcements = 0
        self._lost = 0  # of mailboxes that are closed
        self._refused = 0
        self._closing: asyncio.Future[None] | None = None
        self._replies: Mailbox[tuple[Question, Any]] = Mailbox(self._inbox, "answers", _settle)
        versions: Mailbox[str] = Mailbox(self._inbox, "the watch over versions", self._version_told)
        self._warned: set[str] = set()
        told = binding.callback(lambda sample: versions.leave(str(sample.key_expr)))
        keep = self._declarations.keep
        keep(raw.liveliness().declare_subscriber(f"{self._keys.versions}/**", told, history=True))
        keep(raw.liveliness().declare_token(version_key(self._keys, self.name)))
        close_at_the_end(self)

    # --- what it says of itself ---

    @property
    def host(self) -> str:
        """The name of this computer, according to the settings."""
        return self.settings.host

    @property
    def largest_message(self) -> int:
        """The most bytes of header and payload together."""
        return self.settings.largest_message

    @property
    def failed(self) -> int:
        """How many callbacks have raised."""
        return self._inbox.failed

    @property
    def lost(self) -> int:
        """How many messages were dropped here: the loop did not fetch them, or the sender had no room."""
        return self._lost + sum(one.lost for one in self._mailboxes) + self._sender.dropped

    @property
    def refused(self) -> int:
        """How many messages came that were longer than `largest_message`."""
        return self._refused

    def connections(self) -> list[binding.Connection]:
        """Return the links to other sessions, with the names in their certificates."""
        return [] if self._closing is not None else binding.connections(self._raw)

    # --- datagrams ---

    def publisher(self, key: str, traffic: Traffic) -> ZenohPublisher:
        """Make what puts datagrams on a key; see `hfg.transport.Session.publisher`."""
        full = self._key(self._keys.data, key)
        raw = self._raw.declare_publisher(full, **quality(self._library, traffic))
        publisher = ZenohPublisher(key, raw, self._sender, self.largest_message, self._publishers.discard)
        self._publishers.add(publisher)
        return publisher

    def subscribe(self, key: str, receive: Receive) -> Announcement:
        """Have the datagrams of a key; see `hfg.transport.Session.subscribe`."""
        full = self._key(self._keys.data, key)
        room = _LONGEST_QUEUE * self.largest_message
        mailbox: Mailbox[Message] = Mailbox(self._inbox, f'the subscriber of "{key}"', receive, largest=room)
        largest, leave = self.largest_message, mailbox.leave

        def arrived(sample: zenoh.Sample) -> None:  # in Zenoh's thread, which is this subscription's own
            attachment = sample.attachment
            header = attachment.to_bytes() if attachment is not None else b""
            size = len(header) + len(sample.payload)
            if size > largest:
                self._refused += 1
            else:
                leave((header, sample.payload.to_bytes()), size)

        return self._until_closed(mailbox, self._raw.declare_subscriber(full, binding.callback(arrived)))

    # --- presence ---

    def announce(self, name: str, metadata: bytes = b"") -> Announcement:
        """Announce a name; see `hfg.transport.Session.announce`."""
        self._check_open()
        if name in self._announced:
            raise TransportError(f'"{name}" is announced by this session already; take another name')
        self._announcements += 1
        key = presence_key(self._keys.presences, self.name, self._announcements, name, metadata)
        token = self._declarations.keep(self._raw.liveliness().declare_token(key))
        self._announced.add(name)

        def withdraw() -> None:
            self._announced.discard(name)
            self._declarations.withdraw(token)

        return Announcement(withdraw)

    def watch(self, prefix: str, changed: Watch) -> Announcement:
        """Hear who is there; see `hfg.transport.Session.watch`."""
        self._check_open()
        watching = Watching(self._keys.presences, changed)
        mailbox: Mailbox[tuple[bool, str]] = Mailbox(self._inbox, f'the watch over "{prefix}"', watching.told)
        put = self._library.SampleKind.PUT

        def told(sample: zenoh.Sample) -> None:  # in Zenoh's thread
            mailbox.leave((sample.kind == put, str(sample.key_expr)))

        subscriber = self._raw.liveliness().declare_subscriber(
            prefix_key(self._keys.presences, prefix), binding.callback(told), history=True
        )
        return self._until_closed(mailbox, subscriber)

    # --- questions ---

    def answer(self, name: str, handler: Answer) -> Announcement:
        """Answer the questions to a name; see `hfg.transport.Session.answer`."""
        full = self._key(self._keys.questions, name)
        answerer = Answerer(full, name, handler, self._sender, self.largest_message)
        mailbox: Mailbox[zenoh.Query] = Mailbox(self._inbox, f'who answers to "{name}"', answerer.asked)
        queryable = self._raw.declare_queryable(full, binding.callback(mailbox.leave), complete=True)
        self._answerers.add(answerer)
        answering = self._until_closed(mailbox, queryable)

        def close() -> None:
            self._answerers.discard(answerer)
            answerer.close()
            answering.close()

        return Announcement(close)

    async def ask(self, name: str, question: bytes = b"", *, timeout_s: float = 5.0) -> bytes:
        """Ask who answers to a name; see `hfg.transport.Session.ask`."""
        full = self._key(self._keys.questions, name)
        if len(question) > self.largest_message:
            raise MessageTooLarge(
                f'a question of {len(question)} bytes to "{name}" is too long, the longest has '
                f"{self.largest_message}; ask in parts, or raise largest_message in the settings of all programs"
            )
        asked = Question(name, self._loop, self._replies)
        self._questions.add(asked)
        try:
            self._raw.get(
                full,
                binding.network_callback(asked.on_reply, asked.on_end),
                payload=question,
                timeout=timeout_s + 1,  # ours is the one that counts; this frees what Zenoh keeps
                **quality(self._library, Traffic.ACKNOWLEDGEMENTS),
            )
            async with asyncio.timeout(timeout_s):
                return await asked.future
        except TimeoutError:
            raise NoAnswer(f'"{name}" has not answered within {timeout_s:g} s; is it busy?') from None
        finally:
            self._questions.discard(asked)

    # --- the end ---

    async def close(self) -> None:
        """End all of it; see `hfg.transport.Session.close`."""
        if self._closing is None:
            self._closing = self._loop.create_future()
            self._stop()
            threading.Thread(target=self._close_in_thread, name="hfg zenoh close").start()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_S):
                await asyncio.shield(self._closing)

    def _stop(self) -> None:
        self._inbox.close()
        for publisher in self._publishers:
            publisher.session_closed()
        for answerer in list(self._answerers):
            answerer.close()
        for asked in list(self._questions):
            asked.settle(NoAnswer(f'the session was closed while "{asked.name}" was asked'))

    def close_raw(self) -> None:
        """Close Zenoh's session, from any thread; blocks.

        Zenoh raises if a receiver has not responded for ten seconds; this is not an error of the sender.
        """
        self._sender.close(CLOSE_S / 2)
        self._declarations.withdraw_all()
        with contextlib.suppress(Exception):
            self._raw.close()

    def _close_in_thread(self) -> None:
        self.close_raw()
        with contextlib.suppress(RuntimeError):  # the loop is closed by now
            self._loop.call_soon_threadsafe(self._closed_raw)

    def _closed_raw(self) -> None:
        if self._closing is not None and not self._closing.done():
            self._closing.set_result(None)

    # --- what they share ---

    def _check_open(self) -> None:
        if self._closing is not None:
            raise TransportError("the session is closed; open another one")

    def _key(self, prefix: str, name: str) -> str:
        self._check_open()
        return join(prefix, escape(name))

    def _until_closed(self, mailbox: Mailbox[Any], declared: Declared) -> Announcement:
        """Keep what was declared until it is closed."""
        self._mailboxes.append(mailbox)
        self._declarations.keep(declared)

        def close() -> None:
            mailbox.close()
            self._lost += mailbox.lost
            self._mailboxes.remove(mailbox)
            self._declarations.withdraw(declared)

        return Announcement(close)

    def _version_told(self, told: list[str]) -> None:
        for key in told:
            sentence = complaint(self._keys, key, self.settings.realm)
            if sentence is not None and sentence not in self._warned:
                self._warned.add(sentence)
                log().warning("%s", sentence)


def _settle(answers: list[tuple[Question, Any]]) -> None:
    for question, result in answers:
        question.settle(result)
