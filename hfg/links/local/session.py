"""The contract of `hfg.transport` between programs of one user on one computer.

Each session tells its neighbours which keys it wants, whom it announces and to which names it answers. Datagrams,
questions and answers go straight to those who want them. What a neighbour has told is forgotten with its connection.
Depends on everything else here.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from hfg.base.controls import cleaned
from hfg.base.logs import log
from hfg.base.private import is_of_this_user
from hfg.errors import MessageTooLarge, NoAnswer, QueryRefused, TransportError, in_words
from hfg.links.local.connection import Incoming, Outgoing, greet, introduce
from hfg.links.local.place import NAME_SIZE, Place, user_folder
from hfg.links.local.proof import Caller, Listener, Refused
from hfg.links.local.wire import LONGEST_HEADER, LONGEST_KEY, Frame, Kind
from hfg.transport import Answer, Buffer, Message, Presence, Receive, Traffic, Watch, size_of

_OPENS_S: Final = 1.0  # how long opening waits for neighbours that stand still
_CLOSES_S: Final = 1.0  # how long closing waits for neighbours that do not read
_AGAIN_S: Final = 0.02
_MOST_GREETED: Final = 16  # that are about to prove who they are
_MOST_TOLD: Final = 100_000  # keys, names and announcements of one neighbour
_LARGEST: Final = 64 * 2**20
_NUMBER: Final = struct.Struct("<Q")
_WIDE: Final = struct.Struct("<I")


class LocalTransport:
    """Makes sessions of this user on this computer."""

    async def open(
        self,
        *,
        folder: Path | str | None = None,
        realm: str = "default",
        host: str | None = None,
        largest_message: int = _LARGEST,
        **others: Any,
    ) -> LocalSession:
        """Begin a session on the running loop.

        Args:
          folder: the folder in which the sessions meet; None: that of the realm, for all programs of this user.
          realm: programs of other realms do not meet.
          host: what this computer is called; None: its own name.
          largest_message: the most bytes of header and payload together.
          **others: settings that there are not.

        Raises:
          TransportError: there is no such setting, the folder is not only this user's, or no such sockets exist.
        """
        if others:
            raise TransportError(f'the transport "local" has no setting "{next(iter(others))}"')
        place = Place(user_folder(realm) if folder is None else Path(folder))
        try:
            session = LocalSession(place, host or socket.gethostname(), largest_message)
        except BaseException:
            place.close()
            raise
        try:
            await session.meet()
        except BaseException:
            await session.close()
            raise
        return session


transport: Final = LocalTransport()
"""What the entry point names."""


class _Neighbour:
    """Another session of the place.

    Attributes:
      name: of its socket.
      outgoing: the connection over which this session sends to it.
      incoming: the connection over which it sends.
      making: the task that makes the outgoing one.
      wants: the keys of which it wants datagrams.
      announced: names and metadata, by its number for them.
      answers: names to which it answers.
      questions: those it was asked and has not answered.
      is_ready: it has told all of that.
    """

    def __init__(self, name: bytes) -> None:
        self.name = name
        self.outgoing: Outgoing | None = None
        self.incoming: Incoming | None = None
        self.making: asyncio.Task[None] | None = None
        self.questions: set[int] = set()
        self.forget()

    def forget(self) -> None:
        """What it has told does not hold any more."""
        self.wants: set[bytes] = set()
        self.announced: dict[bytes, tuple[str, bytes]] = {}
        self.answers: set[bytes] = set()
        self.is_ready = False

    @property
    def told(self) -> int:
        """How much it has told."""
        return len(self.wants) + len(self.announced) + len(self.answers)


class LocalSession:
    """One program's end; see `hfg.transport.Session`.

    Attributes:
      host: what this computer is called.
      largest_message: the most bytes of header and payload together.
      failed: how many callbacks have raised.
      is_closed: whether it is.
      refused: how many were turned away: other users, who cannot prove that they have the secret, and who has sent what
        is not a frame.
    """

    def __init__(self, place: Place, host: str, largest_message: int) -> None:
        self.host = host
        self.largest_message = largest_message
        self.failed = 0
        self.refused = 0
        self._place = place
        self._loop = asyncio.get_running_loop()
        self._name = secrets.token_bytes(NAME_SIZE)
        self._neighbours: dict[bytes, _Neighbour] = {}
        self._changed = asyncio.Event()  # somebody has become ready, or has gone
        self._tasks: set[asyncio.Task[None]] = set()
        self._greeted = 0
        self.is_closed = False
        self._receivers: dict[bytes, list[Receive]] = {}
        self._wanting: dict[bytes, tuple[_Neighbour, ...]] = {}
        self._own: list[tuple[bytes, Message]] = []  # datagrams of this session for itself
        self._announced: dict[bytes, tuple[str, bytes]] = {}
        self._watches: list[_Watching] = []
        self._handlers: dict[str, list[_Answering]] = {}
        self._questions: dict[int, tuple[str, asyncio.Future[bytes]]] = {}
        self._numbers = 0
        self._listener = place.listen(self._name)
        self._loop.add_reader(self._listener.fileno(), self._accept)

    # --- who is there -----------------------------------------------------------------------------------------------

    async def meet(self) -> None:
        """Connect to all who are there, and wait until they have told what they want."""
        for name in self._place.names():
            if name != self._name:
                self._approach(self._neighbour(name))
        try:
            async with asyncio.timeout(_OPENS_S):
                while any(not one.is_ready for one in self._neighbours.values()):
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            pass  # somebody stands still, and is heard of when it goes on

    def _neighbour(self, name: bytes) -> _Neighbour:
        return self._neighbours.setdefault(name, _Neighbour(name))

    def _approach(self, neighbour: _Neighbour) -> None:
        if neighbour.making is None and neighbour.outgoing is None and not self.is_closed:
            neighbour.making = self._start(self._make_way_to(neighbour))

    async def _make_way_to(self, neighbour: _Neighbour) -> None:
        """Connect, and tell all that a neighbour has to know; again and again while it is there and too busy."""
        pause_s = _AGAIN_S
        try:
            while neighbour.outgoing is None:
                try:
                    connected = self._place.connect(neighbour.name)
                    if connected is None:
                        break
                    neighbour.outgoing = await self._introduced(connected, neighbour)
                    self._tell_all(neighbour.outgoing)
                except Refused as problem:
                    self._refuse(f"a program in {self._place.folder} is not believed: {problem}")
                    break
                except OSError:  # it has no room for another connection, stands still, or has just gone
                    await asyncio.sleep(pause_s)
                    pause_s = min(2 * pause_s, 1.0)
        finally:
            neighbour.making = None
        if neighbour.outgoing is None:
            self._forget(neighbour)

    async def _introduced(self, connected: socket.socket, neighbour: _Neighbour) -> Outgoing:
        try:
            seals = await introduce(connected, Caller(self._place.secret, self._name, neighbour.name))
        except BaseException:
            connected.close()
            raise
        return Outgoing(connected, seals, partial(self._lost_way_to, neighbour))

    def _lost_way_to(self, neighbour: _Neighbour) -> None:
        neighbour.outgoing = None
        self._approach(neighbour)

    def _tell_all(self, outgoing: Outgoing) -> None:
        for key in self._receivers:
            outgoing.tell(Kind.WANT, key)
        for number, (name, metadata) in self._announced.items():
            outgoing.tell(Kind.ANNOUNCE, number, name.encode(), metadata)
        for name in self._handlers:
            outgoing.tell(Kind.ANSWER, name.encode())
        outgoing.tell(Kind.READY, b"")

    def _tell(self, kind: Kind, key: bytes, header: bytes = b"", payload: bytes = b"") -> None:
        for one in tuple(self._neighbours.values()):
            if one.outgoing is not None:
                one.outgoing.tell(kind, key, header, payload)

    def _accept(self) -> None:
        try:
            connected, _ = self._listener.accept()
        except OSError:  # it has gone again, or there are too many open files: it will come again
            return
        if self._greeted >= _MOST_GREETED or not is_of_this_user(connected):
            self._refuse("a program of another user was turned away" if self._greeted < _MOST_GREETED else "")
            connected.close()
            return
        connected.setblocking(False)
        self._greeted += 1
        self._start(self._greet(connected))

    async def _greet(self, connected: socket.socket) -> None:
        try:
            name, seals = await greet(connected, Listener(self._place.secret, self._name))
        except Refused as problem:
            self._refuse(f"a program in {self._place.folder} is not believed: {problem}")
            connected.close()
            return
        except BaseException as error:
            connected.close()
            if isinstance(error, OSError):
                return
            raise
        finally:
            self._greeted -= 1
        if self.is_closed:
            connected.close()
            return
        neighbour = self._neighbour(name)
        if neighbour.incoming is not None:  # its former connection is broken, and that is not told yet
            neighbour.incoming.close()
            self._unlearn(neighbour)
        take, gone = partial(self._take, neighbour), partial(self._gone, neighbour)
        neighbour.incoming = Incoming(connected, seals, self.largest_message, take, gone)
        self._approach(neighbour)

    def _refuse(self, why: str) -> None:
        self.refused += 1
        if why and self.refused == 1:
            log().warning("%s; more of the kind is counted", why)

    def _gone(self, neighbour: _Neighbour, misbehaved: str) -> None:
        """Nothing comes from it any more."""
        if misbehaved:
            self._refuse(f"a program in {self._place.folder} is not listened to any more: {misbehaved}")
        neighbour.incoming = None
        self._unlearn(neighbour)
        if neighbour.outgoing is not None:
            neighbour.outgoing.close()
            neighbour.outgoing = None
        if neighbour.making is None:
            self._forget(neighbour)

    def _unlearn(self, neighbour: _Neighbour) -> None:
        """Forget what it has told."""
        gone = list(neighbour.announced.values())
        for key in tuple(neighbour.wants):
            self._want(neighbour, key, wants=False)
        neighbour.forget()
        for number in tuple(neighbour.questions):
            self._settle(neighbour, number, NoAnswer("who was asked has gone"))
        self._show([Presence(name, b"", False) for name, _ in gone])
        self._changed.set()

    def _forget(self, neighbour: _Neighbour) -> None:
        """It is not there, unless it still sends."""
        if neighbour.incoming is None and self._neighbours.get(neighbour.name) is neighbour:
            del self._neighbours[neighbour.name]
        self._changed.set()

    # --- what comes -------------------------------------------------------------------------------------------------

    def _take(self, neighbour: _Neighbour, frames: list[Frame]) -> None:
        bursts: dict[bytes, list[Message]] = {}
        for one in frames:
            kind, key, header, payload = one
            if kind == Kind.DATAGRAM:
                burst = bursts.get(key)
                if burst is None:
                    bursts[key] = [(header, payload)]
                else:
                    burst.append((header, payload))
            else:
                try:
                    self._hear(neighbour, one, bursts)
                except (ValueError, struct.error):
                    self._refuse(f"a program in {self._place.folder} has sent what cannot be understood")
        self._deliver(bursts)

    def _hear(self, neighbour: _Neighbour, one: Frame, bursts: dict[bytes, list[Message]]) -> None:
        kind, key, header, payload = one
        if neighbour.told > _MOST_TOLD and kind in (Kind.WANT, Kind.ANNOUNCE, Kind.ANSWER):
            raise ValueError("too much")
        match kind:
            case Kind.WIDE:
                size = _WIDE.unpack(header)[0]
                bursts.setdefault(key, []).append((bytes(payload[:size]), payload[size:]))
            case Kind.WANT | Kind.UNWANT:
                self._want(neighbour, key, wants=kind == Kind.WANT)
            case Kind.ANNOUNCE:
                name, metadata = header.decode(), bytes(payload)
                neighbour.announced[key] = (name, metadata)
                self._show([Presence(name, metadata, True)])
            case Kind.WITHDRAW:
                gone = neighbour.announced.pop(key, None)
                self._show([] if gone is None else [Presence(gone[0], b"", False)])
            case Kind.ANSWER:
                neighbour.answers.add(key)
            case Kind.UNANSWER:
                neighbour.answers.discard(key)
            case Kind.ASK:
                self._be_asked(neighbour, key.decode(), header, bytes(payload))
            case Kind.TELL | Kind.REFUSE | Kind.GONE:
                self._settle(neighbour, _NUMBER.unpack(header)[0], _answer_of(kind, bytes(payload)))
            case Kind.READY:
                neighbour.is_ready = True
                self._changed.set()

    def _want(self, neighbour: _Neighbour, key: bytes, *, wants: bool) -> None:
        others = tuple(one for one in self._wanting.get(key, ()) if one is not neighbour)
        self._wanting[key] = (*others, neighbour) if wants else others
        if wants:
            neighbour.wants.add(key)
        else:
            neighbour.wants.discard(key)
            if not others:
                self._wanting.pop(key, None)

    def _deliver(self, bursts: dict[bytes, list[Message]]) -> None:
        for key, burst in bursts.items():
            for receive in tuple(self._receivers.get(key, ())):
                self._call(receive, burst, "the subscriber of", key)

    def _call(self, function: Callable[[Any], None], argument: Any, what: str, key: bytes) -> None:
        try:
            function(argument)
        except Exception:
            self.failed += 1
            log().exception('%s "%s" raised and goes on', what, key.decode(errors="replace"))

    def _show(self, changes: list[Presence]) -> None:
        for watch in tuple(self._watches) if changes else ():
            watch.show(changes)

    # --- the contract -----------------------------------------------------------------------------------------------

    def publisher(self, key: str, traffic: Traffic) -> LocalPublisher:
        """Make what puts datagrams on a key; see `Session.publisher`."""
        may_wait = traffic not in (Traffic.BULK, Traffic.BACKGROUND)
        return LocalPublisher(self, self._checked(key), may_wait=may_wait)

    def subscribe(self, key: str, receive: Receive) -> _Subscription:
        """Have all datagrams of one key from about now on; see `Session.subscribe`."""
        name = self._checked(key)
        if name not in self._receivers:
            self._tell(Kind.WANT, name)
        self._receivers.setdefault(name, []).append(receive)
        return _Subscription(partial(self._unsubscribe, name, receive))

    def _unsubscribe(self, key: bytes, receive: Receive) -> None:
        all_of_key = self._receivers.get(key, [])
        if receive in all_of_key:
            all_of_key.remove(receive)
            if not all_of_key:
                del self._receivers[key]
                self._tell(Kind.UNWANT, key)

    def announce(self, name: str, metadata: bytes = b"") -> _Subscription:
        """Say that somebody is here; see `Session.announce`."""
        self._checked(name)
        if any(other == name for other, _ in self._announced.values()):
            raise TransportError(f'"{name}" is announced by this session already: close that first')
        self._check_size(len(metadata), name)
        self._numbers += 1
        number = _NUMBER.pack(self._numbers)
        self._announced[number] = (name, metadata)
        self._tell(Kind.ANNOUNCE, number, name.encode(), metadata)
        self._show([Presence(name, metadata, True)])
        return _Subscription(partial(self._withdraw, number))

    def _withdraw(self, number: bytes) -> None:
        name, _ = self._announced.pop(number)
        self._tell(Kind.WITHDRAW, number)
        self._show([Presence(name, b"", False)])

    def watch(self, prefix: str, changed: Watch) -> _Watching:
        """Hear of all names at or below a prefix; see `Session.watch`."""
        self._checked(prefix)
        call = partial(self._call, changed, what="a watch of", key=prefix.encode())
        watch = _Watching(prefix, call, self._loop, self._watches.remove)
        self._watches.append(watch)
        theirs = [told for one in self._neighbours.values() for told in one.announced.values()]
        watch.show([Presence(name, metadata, True) for name, metadata in (*self._announced.values(), *theirs)])
        return watch

    def answer(self, name: str, handler: Answer) -> _Answering:
        """Answer the questions to a name; see `Session.answer`."""
        key = self._checked(name)
        one = _Answering(handler, lambda answering: self._unanswer(name, answering))
        if name not in self._handlers:
            self._tell(Kind.ANSWER, key)
        self._handlers.setdefault(name, []).append(one)
        return one

    def _unanswer(self, name: str, one: _Answering) -> None:
        all_of_name = self._handlers.get(name, [])
        if one in all_of_name:
            all_of_name.remove(one)
            if not all_of_name:
                del self._handlers[name]
                self._tell(Kind.UNANSWER, name.encode())

    async def ask(self, name: str, question: bytes = b"", *, timeout_s: float = 5.0) -> bytes:
        """Ask who answers to a name; see `Session.ask`."""
        key = self._checked(name)
        self._check_size(len(question), name)
        self._numbers += 1
        number = self._numbers
        reply: asyncio.Future[bytes] = self._loop.create_future()
        self._questions[number] = (name, reply)
        there = (one for one in self._neighbours.values() if key in one.answers and one.outgoing is not None)
        asked = next(there, None)
        try:
            if name in self._handlers:
                self._begin_answer(self._handlers[name][0], question, partial(_settle, reply))
            elif asked is None or asked.outgoing is None:
                raise NoAnswer(f'nobody answers to "{name}"')
            else:
                asked.questions.add(number)
                asked.outgoing.tell(Kind.ASK, key, _NUMBER.pack(number), question)
            async with asyncio.timeout(timeout_s):
                return await reply
        except TimeoutError:
            raise NoAnswer(f'"{name}" has not answered within {timeout_s} s') from None
        finally:
            del self._questions[number]
            if asked is not None:
                asked.questions.discard(number)

    def _settle(self, neighbour: _Neighbour, number: int, answer: bytes | TransportError) -> None:
        if number in neighbour.questions:
            neighbour.questions.discard(number)
            _settle(self._questions[number][1], answer)

    def _be_asked(self, neighbour: _Neighbour, name: str, number: bytes, question: bytes) -> None:
        def reply(answer: bytes | TransportError) -> None:
            if neighbour.outgoing is None:
                return
            if isinstance(answer, bytes):
                neighbour.outgoing.tell(Kind.TELL, b"", number, answer)
            else:
                kind = Kind.REFUSE if isinstance(answer, QueryRefused) else Kind.GONE
                neighbour.outgoing.tell(kind, b"", number, str(answer).encode("utf-8", "replace"))

        handlers = self._handlers.get(name)
        if handlers:
            self._begin_answer(handlers[0], question, reply)
        else:
            reply(NoAnswer(f'nobody answers to "{name}"'))

    def _begin_answer(
        self, answering: _Answering, question: bytes, reply: Callable[[bytes | TransportError], None]
    ) -> None:
        task = self._start(self._answer(answering, question, reply))
        answering.tasks.add(task)
        task.add_done_callback(answering.tasks.discard)

    async def _answer(
        self, answering: _Answering, question: bytes, reply: Callable[[bytes | TransportError], None]
    ) -> None:
        try:
            answer = bytes(await answering.handler(question))
            self._check_size(len(answer), "the answer")
        except asyncio.CancelledError:
            reply(NoAnswer("who answers has gone"))
            raise
        except Exception as error:
            reply(QueryRefused(str(error) or in_words(error)))
        else:
            reply(answer)

    async def close(self) -> None:
        """End all of it; see `Session.close`."""
        if self.is_closed:
            return
        self.is_closed = True
        self._loop.remove_reader(self._listener.fileno())
        self._listener.close()
        self._place.remove(self._name)
        for _, reply in self._questions.values():
            _settle(reply, NoAnswer("the session was closed meanwhile"))
        for watch in tuple(self._watches):
            watch.close()
        self._receivers.clear()
        for task in self._tasks:
            task.cancel()
        ways = [one.outgoing for one in self._neighbours.values() if one.outgoing is not None]
        await asyncio.gather(*self._tasks, *(way.flush(_CLOSES_S) for way in ways), return_exceptions=True)
        for one in tuple(self._neighbours.values()):
            if one.incoming is not None:
                one.incoming.close()
            if one.outgoing is not None:
                one.outgoing.close()
        self._neighbours.clear()
        self._wanting.clear()
        self._place.close()

    # --- for what it has made ---------------------------------------------------------------------------------------

    def wanted(self, key: bytes) -> bool:
        """Whether anybody has subscribed to a key, as far as this session knows."""
        return key in self._wanting or key in self._receivers

    def put(self, key: bytes, header: bytes, payload: Buffer, size: int, *, may_wait: bool) -> None:
        """Send a datagram to all who want it."""
        for neighbour in self._wanting.get(key, ()):
            outgoing = neighbour.outgoing
            if outgoing is None:
                continue
            if len(header) <= LONGEST_HEADER:
                outgoing.put(Kind.DATAGRAM, key, header, payload, size=size, may_wait=may_wait)
            else:
                wide, said = header + bytes(payload), _WIDE.pack(len(header))
                outgoing.put(Kind.WIDE, key, said, wide, size=len(wide), may_wait=may_wait)
        if key in self._receivers:
            if not self._own:
                self._loop.call_soon(self._deliver_own)
            self._own.append((key, (header, payload)))

    def _deliver_own(self) -> None:
        own, self._own = self._own, []
        bursts: dict[bytes, list[Message]] = {}
        for key, message in own:
            bursts.setdefault(key, []).append(message)
        self._deliver(bursts)

    def _start(self, work: Any) -> asyncio.Task[None]:
        task: asyncio.Task[None] = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _checked(self, key: str) -> bytes:
        if self.is_closed:
            raise TransportError("the session is closed: open another")
        if not key or not all(key.split("/")):
            raise TransportError(f'"{key}" is no key: it needs chunks that are not empty, with "/" between them')
        name = key.encode("utf-8", "surrogatepass")
        if len(name) > LONGEST_KEY:
            raise MessageTooLarge(f'"{key[:60]}..." has {len(name)} bytes, and the longest key has {LONGEST_KEY}')
        return name

    def _check_size(self, size: int, what: str) -> None:
        if size > self.largest_message:
            raise MessageTooLarge(
                f'a message of {size} bytes for "{what}" is too long, and at most {self.largest_message} are sent; '
                "send it in parts, or raise largest_message in the settings of all programs"
            )


def _answer_of(kind: int, told: bytes) -> bytes | TransportError:
    if kind == Kind.TELL:
        return told
    sentence = cleaned(told.decode(errors="replace"))
    return QueryRefused(sentence) if kind == Kind.REFUSE else NoAnswer(sentence)


def _settle(reply: asyncio.Future[bytes], answer: bytes | TransportError) -> None:
    if reply.done():
        return
    if isinstance(answer, bytes):
        reply.set_result(answer)
    else:
        reply.set_exception(answer)


class LocalPublisher:
    """Puts datagrams on one key; see `hfg.transport.Publisher`."""

    def __init__(self, session: LocalSession, key: bytes, *, may_wait: bool) -> None:
        self._session = session
        self._key = key
        self._largest = session.largest_message
        self._may_wait = may_wait
        self._is_closed = False

    @property
    def wanted(self) -> bool:
        """Whether anybody has subscribed to the key, as far as this session knows."""
        return not self._is_closed and self._session.wanted(self._key)

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram; see `Publisher.put`."""
        if self._is_closed or self._session.is_closed:
            raise TransportError(f'the publisher of "{self._key.decode(errors="replace")}" is closed; make another one')
        size = size_of(payload)
        if len(header) + size > self._largest:
            self._session._check_size(len(header) + size, self._key.decode(errors="replace"))
        self._session.put(self._key, header, payload, size, may_wait=self._may_wait)

    def close(self) -> None:
        """Stop it; what was put is still sent."""
        self._is_closed = True


class _Subscription:
    """What goes on until it is closed."""

    def __init__(self, end: Callable[[], None]) -> None:
        self._end: Callable[[], None] | None = end

    def close(self) -> None:
        """Stop it."""
        end, self._end = self._end, None
        if end is not None:
            end()


class _Watching:
    """What one watch is told."""

    def __init__(
        self,
        prefix: str,
        call: Callable[[list[Presence]], None],
        loop: asyncio.AbstractEventLoop,
        closed: Callable[[_Watching], None],
    ) -> None:
        self._prefix = prefix
        self._call = call
        self._loop = loop
        self._closed: Callable[[_Watching], None] | None = closed
        self._news: list[Presence] = []

    def show(self, changes: list[Presence]) -> None:
        """Tell of changes in the loop's next pass."""
        prefix = self._prefix
        mine = [one for one in changes if one.name == prefix or one.name.startswith(f"{prefix}/")]
        if mine and not self._news:
            self._loop.call_soon(self._tell)
        self._news += mine

    def _tell(self) -> None:
        news, self._news = self._news, []
        if self._closed is not None:
            self._call(news)

    def close(self) -> None:
        """Tell nothing more."""
        closed, self._closed = self._closed, None
        if closed is not None:
            closed(self)


class _Answering:
    """Answers to one name.

    Attributes:
      handler: gives the answers.
      tasks: answers under way.
    """

    def __init__(self, handler: Answer, closed: Callable[[_Answering], None]) -> None:
        self.handler = handler
        self.tasks: set[asyncio.Task[None]] = set()
        self._closed = closed

    def close(self) -> None:
        """Answer no more; who has asked and has no answer yet gets none."""
        self._closed(self)
        for task in self.tasks:
            task.cancel()
