"""The transport within one process: sessions on one or several event loops, and faults to order, for tests.

Without faults it is perfect. A `Network` is what its sessions have in common; `faults` says what it does to datagrams,
by chances that a seed fixes, so that under virtual time a test with faults is the same each time. Connections are cut
and come back, sessions die without a word.

    network = Network(Faults(loss=0.2, delay_s=(0.0, 0.05)), seed=7)
    session = await network.open()
    network.cut(session)
"""

from __future__ import annotations

import asyncio
import logging
import random
import threading
from collections import defaultdict, deque
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from hfg.errors import MessageTooLarge, NoAnswer, QueryRefused, TransportError, in_words
from hfg.transport import Answer, Buffer, Message, Presence, Receive, Traffic, Watch

__all__ = ["Faults", "MemorySession", "Network", "transport"]

_log = logging.getLogger("hfg.transport.memory")
_MOST_WAITING: Final = 65_536  # datagrams of one session whose loop does not come round


@dataclass(frozen=True)
class Faults:
    """The effects of a network on datagrams, independently for each datagram and receiver.

    Attributes:
      loss: the chance that it never arrives.
      repetition: the chance that it arrives twice.
      reordering: the chance that it is held back for `held_s`, so that others overtake it.
      held_s: for how long.
      delay_s: how long it takes at least and at most; those of unequal delays overtake each other.
    """

    loss: float = 0.0
    repetition: float = 0.0
    reordering: float = 0.0
    held_s: float = 0.01
    delay_s: tuple[float, float] = (0.0, 0.0)


_Kept = TypeVar("_Kept", bound="_Part")


class Network:
    """Shared state of sessions that can reach each other.

    Args:
      faults: what it does to datagrams; may be replaced at any time. Presence and questions are affected only by cuts.
      seed: of the chances.
      lease_s: after how long a session that was cut off is reported as gone.
      largest_message: the most bytes of a datagram.

    Attributes:
      faults: see above.
      lost: datagrams that were lost by the faults or a cut.
      overrun: datagrams that were lost because a session's loop did not come round.
    """

    def __init__(
        self,
        faults: Faults | None = None,
        *,
        seed: int = 0,
        lease_s: float = 1.0,
        largest_message: int = 2**26,
    ) -> None:
        self.faults = faults or _NONE
        self.lost = 0
        self.overrun = 0
        self.largest_message = largest_message
        self._lease_s = lease_s
        self._chance = random.Random(seed)
        self._lock = threading.RLock()
        self._sessions: list[MemorySession] = []
        self._subscriptions: dict[str, tuple[_Subscription, ...]] = {}
        self._names: dict[_Announcement, None] = {}
        self._watches: dict[_Watching, None] = {}
        self._answers: dict[str, list[_Answering]] = defaultdict(list)

    @property
    def sessions(self) -> tuple[MemorySession, ...]:
        """Those that are open, in the order in which they were opened."""
        return tuple(self._sessions)

    async def open(self, *, host: str = "here") -> MemorySession:
        """Begin a session on the running loop, of a program on that host."""
        session = MemorySession(self, asyncio.get_running_loop(), host)
        with self._lock:
            self._sessions.append(session)
        return session

    def cut(self, *sessions: MemorySession) -> None:
        """Cut sessions off from all others; none given: each from each. They still hear themselves."""
        with self._lock:
            for session in sessions or tuple(self._sessions):
                session.is_cut = True
            self._look_later()

    def heal(self, *sessions: MemorySession) -> None:
        """Let sessions hear each other again; none given: all."""
        with self._lock:
            for session in sessions or tuple(self._sessions):
                session.is_cut = False
            self._look_now()

    # --- what sessions do

    def reaches(self, one: MemorySession, other: MemorySession) -> bool:
        """Return whether a cut is between them."""
        return one is other or not (one.is_cut or other.is_cut)

    def put(self, sender: MemorySession, key: str, message: Message) -> None:
        """Let a datagram go to all who have subscribed to its key."""
        subscriptions = self._subscriptions.get(key, ())
        faults = self.faults
        for one in subscriptions:
            if not self.reaches(sender, one.session):
                self.lost += 1
            elif faults is _NONE or faults == _NONE:
                one.session.arrive(one, message)
            else:
                self._send_badly(faults, one, message)

    def _send_badly(self, faults: Faults, to: _Subscription, message: Message) -> None:
        with self._lock:
            if self._chance.random() < faults.loss:
                self.lost += 1
                return
            copies = 2 if self._chance.random() < faults.repetition else 1
            delays = [self._chance.uniform(*faults.delay_s) for _ in range(copies)]
            if self._chance.random() < faults.reordering:
                delays[0] += faults.held_s
        for delay in delays:
            to.session.arrive_later(delay, to, message)

    def subscribe(self, one: _Subscription) -> None:
        """Let it have what comes to its key."""
        with self._lock:
            self._subscriptions[one.key] = (*self._subscriptions.get(one.key, ()), one)

    def unsubscribe(self, one: _Subscription) -> None:
        """Let it have no more."""
        with self._lock:
            left = tuple(other for other in self._subscriptions.get(one.key, ()) if other is not one)
            if left:
                self._subscriptions[one.key] = left
            else:
                self._subscriptions.pop(one.key, None)

    def announce(self, one: _Announcement) -> None:
        """Report to all watchers that a name was announced."""
        with self._lock:
            if any(other.session is one.session and other.name == one.name for other in self._names):
                raise TransportError(f'"{one.name}" is announced by this session already: close that first')
            self._names[one] = None
            self._look_now()

    def withdraw(self, one: _Announcement) -> None:
        """Report to all watchers that a name has gone; for a session that is cut off, later."""
        with self._lock:
            self._names.pop(one, None)
            if one.session.is_cut:
                self._look_later()
            self._look_now(also_gone=not one.session.is_cut)

    def watch(self, one: _Watching) -> None:
        """Tell it who is there, and then of changes."""
        with self._lock:
            self._watches[one] = None
            self._look_now()

    def unwatch(self, one: _Watching) -> None:
        """Tell it nothing more."""
        with self._lock:
            self._watches.pop(one, None)

    def _look_now(self, *, also_gone: bool = True) -> None:
        for watch in tuple(self._watches):
            here = [one for one in self._names if watch.covers(one.name) and self.reaches(one.session, watch.session)]
            if also_gone:
                for gone in [one for one in watch.known if one not in self._names]:
                    watch.tell(gone, present=False)
            for new in [one for one in here if one not in watch.known]:
                watch.tell(new, present=True)

    def _look_later(self) -> None:
        """A session that is silent for a lease counts as gone for those that cannot reach it."""
        for watch in tuple(self._watches):
            watch.session.call_later(self._lease_s, self._expire, watch)

    def _expire(self, watch: _Watching) -> None:
        with self._lock:
            for one in list(watch.known):
                if one not in self._names or not self.reaches(one.session, watch.session):
                    watch.tell(one, present=False)

    def answer(self, one: _Answering) -> None:
        """Let it answer questions to its name."""
        with self._lock:
            self._answers[one.name].append(one)

    def unanswer(self, one: _Answering) -> None:
        """Let it answer no more."""
        with self._lock:
            if one in self._answers[one.name]:
                self._answers[one.name].remove(one)

    def answering(self, session: MemorySession, name: str) -> _Answering | None:
        """Return who answers to a name, of those that can be heard."""
        with self._lock:
            found = [one for one in self._answers.get(name, ()) if self.reaches(session, one.session)]
            return found[0] if found else None

    def forget(self, session: MemorySession) -> None:
        """A session is over."""
        with self._lock:
            if session in self._sessions:
                self._sessions.remove(session)


_NONE: Final = Faults()


class MemorySession:
    """One program's end of a network."""

    def __init__(self, network: Network, loop: asyncio.AbstractEventLoop, host: str) -> None:
        self.network = network
        self.host = host
        self.is_cut = False
        self._loop = loop
        self._thread = threading.get_ident()
        self._failed = 0
        self._closed = False
        self._inbox: deque[tuple[_Subscription | _Watching, Any]] = deque()
        self._awake = False
        self._parts: dict[_Part, None] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._asked: set[asyncio.Future[bytes]] = set()

    @property
    def largest_message(self) -> int:
        """The most bytes of header and payload together."""
        return self.network.largest_message

    @property
    def failed(self) -> int:
        """How many callbacks have raised."""
        return self._failed

    def publisher(self, key: str, traffic: Traffic) -> _Publisher:
        """Make what puts datagrams on a key; `traffic` makes no difference here."""
        del traffic
        self._check_open()
        return self._keep(_Publisher(self, _checked(key)))

    def subscribe(self, key: str, receive: Receive) -> _Subscription:
        """Have all datagrams of one key that are put from now on."""
        self._check_open()
        one = self._keep(_Subscription(self, _checked(key), receive))
        self.network.subscribe(one)
        return one

    def announce(self, name: str, metadata: bytes = b"") -> _Announcement:
        """Announce a name."""
        self._check_open()
        one = _Announcement(self, _checked(name), metadata)
        self.network.announce(one)
        return self._keep(one)

    def watch(self, prefix: str, changed: Watch) -> _Watching:
        """Hear of all names at or below `prefix`."""
        self._check_open()
        one = self._keep(_Watching(self, _checked(prefix), changed))
        self.network.watch(one)
        return one

    def answer(self, name: str, handler: Answer) -> _Answering:
        """Answer the questions to a name."""
        self._check_open()
        one = self._keep(_Answering(self, _checked(name), handler))
        self.network.answer(one)
        return one

    async def ask(self, name: str, question: bytes = b"", *, timeout_s: float = 5.0) -> bytes:
        """Ask who answers to a name."""
        self._check_open()
        if len(question) > self.largest_message:
            raise MessageTooLarge(f"a question of {len(question)} bytes: this network carries {self.largest_message}")
        answering = self.network.answering(self, _checked(name))
        if answering is None:
            raise NoAnswer(f'nobody answers to "{name}"')
        reply: asyncio.Future[bytes] = self._loop.create_future()
        self._asked.add(reply)
        try:
            answering.put(self, question, reply)
            async with asyncio.timeout(timeout_s):
                return await reply
        except TimeoutError:
            raise NoAnswer(f'"{name}" has not answered within {timeout_s} s') from None
        finally:
            self._asked.discard(reply)

    async def close(self) -> None:
        """End all of it."""
        tasks = tuple(self._tasks)
        self.die()
        await asyncio.gather(*tasks, return_exceptions=True)

    def die(self) -> None:
        """End at once and without a word, as a process that is killed."""
        if self._closed:
            return
        self._closed = True
        for part in tuple(self._parts):
            part.close()
        for task in self._tasks:
            task.cancel()
        for reply in self._asked:
            if not reply.done():
                reply.set_exception(NoAnswer("the session was closed meanwhile"))
        self._inbox.clear()
        self.network.forget(self)

    # --- what the network does

    def arrive(self, sink: _Subscription | _Watching, item: Any) -> None:
        """Take something for one of the callbacks; from any thread."""
        if len(self._inbox) >= _MOST_WAITING and isinstance(sink, _Subscription):
            self.network.overrun += 1
            return
        self._inbox.append((sink, item))
        if not self._awake:
            self._awake = True
            self.call_soon(self._drain)

    def arrive_later(self, delay_s: float, sink: _Subscription, message: Message) -> None:
        """Take it after a while."""
        if delay_s > 0:
            self.call_later(delay_s, self.arrive, sink, message)
        else:
            self.arrive(sink, message)

    def call_soon(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call it on this session's loop; from any thread."""
        try:
            if threading.get_ident() == self._thread:
                self._loop.call_soon(function, *arguments)
            else:
                self._loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:  # the loop is closed, so no one listens any more
            self._closed = True

    def call_later(self, delay_s: float, function: Callable[..., object], *arguments: Any) -> None:
        """The same, after a while."""
        if threading.get_ident() == self._thread and not self._loop.is_closed():
            self._loop.call_later(delay_s, function, *arguments)
        else:
            self.call_soon(self._loop.call_later, delay_s, function, *arguments)

    def _drain(self) -> None:
        """Deliver all messages for each callback at once."""
        self._awake = False
        bursts: dict[_Subscription | _Watching, list[Any]] = {}
        for _ in range(len(self._inbox)):
            sink, item = self._inbox.popleft()
            if sink in bursts:
                bursts[sink].append(item)
            else:
                bursts[sink] = [item]
        for sink, burst in bursts.items():
            if sink.is_open:
                try:
                    sink.call(burst)
                except Exception:
                    self._failed += 1
                    _log.exception("a callback of a session raised")

    def start(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Run what answers a question."""
        task = self._loop.create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _keep(self, part: _Kept) -> _Kept:
        self._parts[part] = None
        return part

    def drop(self, part: _Part) -> None:
        """It was closed by itself."""
        self._parts.pop(part, None)

    def _check_open(self) -> None:
        if self._closed:
            raise TransportError("the session is closed: open another")


class _Part:
    """Something that lasts in a session until it is closed."""

    def __init__(self, session: MemorySession) -> None:
        self.session = session
        self.is_open = True

    def close(self) -> None:
        """Stop it."""
        if self.is_open:
            self.is_open = False
            self.session.drop(self)
            self._end()

    def _end(self) -> None:
        pass


class _Publisher(_Part):
    def __init__(self, session: MemorySession, key: str) -> None:
        super().__init__(session)
        self.key = key

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram to all who have subscribed to the key."""
        if not self.is_open:
            raise TransportError(f'the publisher of "{self.key}" is closed')
        network = self.session.network
        if len(header) + len(payload) > network.largest_message:
            raise MessageTooLarge(
                f"a datagram of {len(header) + len(payload)} bytes: this network carries {network.largest_message}"
            )
        network.put(self.session, self.key, (header, payload))


class _Subscription(_Part):
    def __init__(self, session: MemorySession, key: str, receive: Receive) -> None:
        super().__init__(session)
        self.key = key
        self.call = receive

    def _end(self) -> None:
        self.session.network.unsubscribe(self)


class _Announcement(_Part):
    def __init__(self, session: MemorySession, name: str, metadata: bytes) -> None:
        super().__init__(session)
        self.name = name
        self.metadata = metadata

    def _end(self) -> None:
        self.session.network.withdraw(self)


class _Watching(_Part):
    def __init__(self, session: MemorySession, prefix: str, changed: Watch) -> None:
        super().__init__(session)
        self.prefix = prefix
        self.call = changed
        self.known: dict[_Announcement, None] = {}

    def covers(self, name: str) -> bool:
        """Return whether a name is at or below the prefix."""
        return name == self.prefix or name.startswith(f"{self.prefix}/")

    def tell(self, who: _Announcement, *, present: bool) -> None:
        """Tell of one who has come or gone."""
        if present:
            self.known[who] = None
        else:
            self.known.pop(who, None)
        self.session.arrive(self, Presence(who.name, who.metadata if present else b"", present))

    def _end(self) -> None:
        self.session.network.unwatch(self)


class _Answering(_Part):
    def __init__(self, session: MemorySession, name: str, handler: Answer) -> None:
        super().__init__(session)
        self.name = name
        self.handler = handler
        self._open: dict[asyncio.Future[bytes], MemorySession] = {}

    def put(self, asker: MemorySession, question: bytes, reply: asyncio.Future[bytes]) -> None:
        """Take a question, from the asker's thread."""
        self._open[reply] = asker
        self.session.call_soon(self._begin, asker, question, reply)

    def _begin(self, asker: MemorySession, question: bytes, reply: asyncio.Future[bytes]) -> None:
        if self.is_open:
            self.session.start(self._answer(asker, question, reply))

    async def _answer(self, asker: MemorySession, question: bytes, reply: asyncio.Future[bytes]) -> None:
        try:
            answer = await self.handler(question)
        except Exception as error:
            self._reply(asker, reply, QueryRefused(str(error) or in_words(error)))
        else:
            self._reply(asker, reply, bytes(answer))

    def _reply(self, asker: MemorySession, reply: asyncio.Future[bytes], answer: bytes | TransportError) -> None:
        self._open.pop(reply, None)
        if self.session.network.reaches(self.session, asker):
            asker.call_soon(_settle, reply, answer)

    def _end(self) -> None:
        self.session.network.unanswer(self)
        for reply, asker in tuple(self._open.items()):
            self._reply(asker, reply, NoAnswer(f'who answered to "{self.name}" has gone'))


def _settle(reply: asyncio.Future[bytes], answer: bytes | TransportError) -> None:
    if reply.done():
        return
    if isinstance(answer, bytes):
        reply.set_result(answer)
    else:
        reply.set_exception(answer)


def _checked(key: str) -> str:
    if not key or not all(key.split("/")):
        raise TransportError(f'"{key}" is no key: it needs chunks that are not empty, with "/" between them')
    return key


class _Memory:
    """What the entry point names: sessions on networks that are known by name in this process."""

    def __init__(self) -> None:
        self._networks: dict[str, Network] = {}

    def network(self, name: str = "default") -> Network:
        """Return the network of a name, to set its faults and to cut sessions off."""
        return self._networks.setdefault(name, Network())

    async def open(self, *, network: Network | str = "default", host: str = "here") -> MemorySession:
        """Begin a session on a network, or on that of a name."""
        return await (self.network(network) if isinstance(network, str) else network).open(host=host)


transport: Final = _Memory()
"""The transport itself; see `hfg.transport.Transport`."""
