"""Datagrams of links between processes of one host: from one event loop straight to the other's, over a local socket.

A datagram over the network of a transport wakes a thread of the transport on either side before the other event loop
has it; one over a socket that the loop itself listens to wakes that loop alone, which is a third of the delay. So links
between parts of one host go this way while it is open. All else stays with the session of the transport: discovery,
control, other hosts, and any datagram for which the way is not open yet or not any more. It may lose and delay
datagrams as that may, and a link repairs it.

The sockets are Linux's abstract ones: they have a name and no file, and are gone with their process, however it ends.
Either side serves none but its own user. Stands on the contract.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
import socket
import struct
import sys
from collections import deque
from collections.abc import Callable
from typing import Final, NoReturn

from hfg.errors import TransportError
from hfg.logs import log
from hfg.transport import Buffer, Closing, Datagrams, Message, Publisher, Receive, Traffic, size_of

__all__ = ["LocalEndpoint", "LocalRoute"]

_HEAD: Final = struct.Struct("<HII")  # bytes of the key, the header and the payload, which follow in this order
_PEER: Final = struct.Struct("3i")  # process, user and group of who is at the other end
_CHUNK: Final = 2**18  # bytes that are read at once
_LONGEST_KEY: Final = 4096
_LONGEST_HEADER: Final = 2**17
_MOST_UNSENT: Final = 2**26  # bytes that wait for a neighbour that does not read; what comes then is lost
_AGAIN_S: Final = 0.02  # how long a neighbour that could not be reached is left alone


def _address(name: str) -> bytes:
    """Give an abstract address for a name of any length."""
    return b"\0hfg-" + hashlib.blake2b(name.encode(), digest_size=20).hexdigest().encode()


def _is_of_this_user(connected: socket.socket) -> bool:
    _, user, _ = _PEER.unpack(connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
    return bool(user == os.geteuid())


class LocalEndpoint:
    """Where the processes of this host reach this one.

    Attributes:
      refused: how many have been turned away: other users, and those who sent what is no datagram.
      failed: how many receivers have raised.
    """

    def __init__(self, name: str, largest: int) -> None:
        """Listen, on the running loop.

        Args:
          name: by which others find it; it has none beside it.
          largest: the most bytes of header and payload together.

        Raises:
          TransportError: this system has no such sockets, or somebody has the name.
        """
        if sys.platform != "linux":
            raise TransportError("local sockets without a file are Linux's alone")
        self.refused = 0
        self.failed = 0
        self.largest = largest
        self._receivers: dict[bytes, list[Receive]] = {}
        self._incoming: set[_Incoming] = set()
        self._loop = asyncio.get_running_loop()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            self._listener.bind(_address(name))
            self._listener.listen()
        except OSError as error:
            self._listener.close()
            raise TransportError(f'no local socket can be had for "{name}": {error}') from error
        self._loop.add_reader(self._listener.fileno(), self._accept)

    def subscribe(self, key: str, receive: Receive) -> Closing:
        """Have all datagrams of one key that come this way; see `Session.subscribe`."""
        return _Subscription(self._receivers, key.encode(), receive)

    def close(self) -> None:
        """Hear nobody any more."""
        if self._listener.fileno() >= 0:
            self._loop.remove_reader(self._listener.fileno())
            self._listener.close()
        for one in list(self._incoming):
            one.close()
        self._receivers.clear()

    def _accept(self) -> None:
        try:
            connected, _ = self._listener.accept()
        except OSError:  # it has gone again, or there are too many open files: it will come again
            return
        connected.setblocking(False)
        if _is_of_this_user(connected):
            self._incoming.add(_Incoming(connected, self._loop, self.largest, self._deliver, self._gone))
        else:
            self.refused += 1
            connected.close()

    def _gone(self, one: _Incoming, misbehaved: bool) -> None:
        self._incoming.discard(one)
        self.refused += misbehaved

    def _deliver(self, bursts: dict[bytes, list[Message]]) -> None:
        for key, burst in bursts.items():
            for receive in tuple(self._receivers.get(key, ())):
                try:
                    receive(burst)
                except Exception:
                    self.failed += 1
                    log().exception('the subscriber of "%s" raised and goes on', key.decode(errors="replace"))


class _Subscription:
    def __init__(self, receivers: dict[bytes, list[Receive]], key: bytes, receive: Receive) -> None:
        self._receivers = receivers
        self._key = key
        self._receive: Receive | None = receive
        receivers.setdefault(key, []).append(receive)

    def close(self) -> None:
        """Stop it."""
        receive, self._receive = self._receive, None
        all_of_key = self._receivers.get(self._key, [])
        if receive in all_of_key:
            all_of_key.remove(receive)
            if not all_of_key:
                del self._receivers[self._key]


class _Refused(Exception):
    """What came is no datagram."""


class _Incoming:
    """A neighbour that has come, and takes its datagrams off the socket."""

    def __init__(
        self,
        connected: socket.socket,
        loop: asyncio.AbstractEventLoop,
        largest: int,
        deliver: Callable[[dict[bytes, list[Message]]], None],
        gone: Callable[[_Incoming, bool], None],
    ) -> None:
        self._socket = connected
        self._loop = loop
        self._largest = largest
        self._deliver = deliver
        self._gone = gone
        self._chunk = bytearray(_CHUNK)
        self._filled = 0  # bytes of it that are no whole datagram yet
        self._large: _Large | None = None
        loop.add_reader(connected.fileno(), self._read)

    def close(self, *, misbehaved: bool = False) -> None:
        """Hear it no more."""
        if self._socket.fileno() >= 0:
            self._loop.remove_reader(self._socket.fileno())
            self._socket.close()
            self._gone(self, misbehaved)

    def _read(self) -> None:
        """Take what is there: once, so that others have their turns, but of a large datagram as much as comes."""
        bursts: dict[bytes, list[Message]] = {}
        try:
            if self._large is None:
                self._filled += self._socket.recv_into(memoryview(self._chunk)[self._filled :]) or self._ended()
                self._part(bursts)
            while self._large is not None:
                if self._large.fill(self._socket.recv_into(self._large.rest) or self._ended()):
                    bursts.setdefault(self._large.key, []).append(self._large.message)
                    self._large = None
        except BlockingIOError:
            pass
        except OSError:
            self.close()
        except _Refused:
            self.close(misbehaved=True)
        if bursts:
            self._deliver(bursts)

    def _ended(self) -> NoReturn:
        raise ConnectionResetError("the neighbour has gone")

    def _part(self, bursts: dict[bytes, list[Message]]) -> None:
        """Give the whole datagrams that have come, and keep what is left of another."""
        chunk, filled = self._chunk, self._filled
        start = 0
        while filled - start >= _HEAD.size:
            of_key, of_header, of_payload = _HEAD.unpack_from(chunk, start)
            if not 0 < of_key <= _LONGEST_KEY or of_header > _LONGEST_HEADER or of_header + of_payload > self._largest:
                raise _Refused
            body = start + _HEAD.size
            value = body + of_key + of_header
            end = value + of_payload
            if end > filled:
                if end - start > _CHUNK and value <= filled:
                    self._begin_large(start, of_key, of_header, of_payload)
                    start = filled
                break
            key = bytes(chunk[body : body + of_key])
            message = (bytes(chunk[body + of_key : value]), bytes(chunk[value:end]))
            burst = bursts.get(key)
            if burst is None:
                bursts[key] = [message]
            else:
                burst.append(message)
            start = end
        if start:
            chunk[: filled - start] = chunk[start:filled]
            self._filled = filled - start

    def _begin_large(self, start: int, of_key: int, of_header: int, of_payload: int) -> None:
        """A payload that does not fit in what is read at once gets bytes of its own, which nobody copies."""
        body = start + _HEAD.size
        key = bytes(self._chunk[body : body + of_key])
        header = bytes(self._chunk[body + of_key : body + of_key + of_header])
        self._large = _Large(key, header, of_payload)
        here = memoryview(self._chunk)[body + of_key + of_header : self._filled]
        self._large.rest[: len(here)] = here
        self._large.fill(len(here))


class _Large:
    """A datagram whose payload is still coming.

    Attributes:
      key: of the datagram.
      rest: where what is still to come belongs.
    """

    def __init__(self, key: bytes, header: bytes, size: int) -> None:
        self.key = key
        self._header = header
        self._payload = memoryview(bytearray(size))
        self.rest = self._payload

    def fill(self, count: int) -> bool:
        """So many bytes more are there; give whether those are all."""
        self.rest = self.rest[count:]
        return not self.rest

    @property
    def message(self) -> Message:
        """All of it."""
        return self._header, self._payload.toreadonly()


class LocalRoute:
    """The way to one neighbour on this host, beside what the session of a transport offers; see `Datagrams`."""

    def __init__(self, endpoint: LocalEndpoint, session: Datagrams, neighbour: str) -> None:
        """Do nothing yet: the first datagram opens the way.

        Args:
          endpoint: where what comes back arrives.
          session: what cannot go this way goes over it.
          neighbour: the name of the other's endpoint.
        """
        self._endpoint = endpoint
        self._session = session
        self._neighbour = neighbour
        self._loop = asyncio.get_running_loop()
        self._socket: socket.socket | None = None
        self._not_before = 0.0
        self._unsent: deque[memoryview] = deque()
        self._waiting = 0  # bytes of it
        self._emptied: asyncio.Future[None] | None = None  # somebody waits until all has left

    @property
    def largest_message(self) -> int:
        """The most bytes of header and payload together."""
        return self._session.largest_message

    def lead_to(self, neighbour: str) -> None:
        """The neighbour has died; its next life has another name."""
        self._close()
        self._neighbour = neighbour
        self._not_before = 0.0

    def publisher(self, key: str, traffic: Traffic) -> Publisher:
        """Make what puts datagrams on a key; see `Session.publisher`."""
        may_wait = traffic not in (Traffic.BULK, Traffic.BACKGROUND)
        return _LocalPublisher(self, key, self._session.publisher(key, traffic), may_wait=may_wait)

    def subscribe(self, key: str, receive: Receive) -> Closing:
        """Have all datagrams of a key, whichever way they come; see `Session.subscribe`."""
        return _Both(self._endpoint.subscribe(key, receive), self._session.subscribe(key, receive))

    async def close(self, within_s: float = 1.0) -> None:
        """End it; what was put is still sent, if the neighbour takes it by then."""
        if self._unsent:
            self._emptied = self._loop.create_future()
            await asyncio.wait({self._emptied}, timeout=within_s)
        self._close()
        self._not_before = float("inf")

    def put(self, key: bytes, header: bytes, payload: Buffer, *, may_wait: bool) -> bool:
        """Send a datagram; False if it has to go another way.

        Args:
          key: on which it is put.
          header: of it.
          payload: of it.
          may_wait: it waits behind what has not left yet; else it is lost then, for nobody wants what is old, and if it
            is long it goes over the session, which has threads for that while a loop is busy.
        """
        connected = self._socket or self._connected()
        if connected is None or len(header) > _LONGEST_HEADER:
            return False
        size = size_of(payload)
        is_long = size > _CHUNK
        if not may_wait and (is_long or self._unsent):
            return not is_long
        head = _HEAD.pack(len(key), len(header), size) + key + header
        if is_long or self._unsent:
            self._stand_in_line(head if is_long else head + payload, payload if is_long else b"")
            return True
        return self._send(connected, head + payload)

    def _send(self, connected: socket.socket, datagram: bytes) -> bool:
        """Send it at once, as far as there is room; False if there is nobody any more."""
        try:
            sent = connected.send(datagram)
        except BlockingIOError:
            sent = 0
        except OSError:  # it has gone; who comes after it has another name
            self._close()
            return False
        if sent < len(datagram):
            self._stand_in_line(memoryview(datagram)[sent:])
        return True

    def _stand_in_line(self, *parts: Buffer) -> None:
        """Send it when all before it has left; what there is no room for in the line is lost, but never half of it."""
        size = sum(map(len, parts))
        if self._unsent and self._waiting + size > _MOST_UNSENT:
            return
        is_first = not self._unsent
        self._unsent.extend(memoryview(part) for part in parts if part)
        self._waiting += size
        if is_first and self._socket is not None:
            self._loop.add_writer(self._socket.fileno(), self._go_on)
            self._go_on()

    def _go_on(self) -> None:
        """There is room, perhaps: fill it, also what is made meanwhile, for the next turn may be long in coming."""
        assert self._socket is not None
        try:
            while self._unsent:
                sent = self._socket.send(self._unsent[0])
                self._waiting -= sent
                rest = self._unsent.popleft()[sent:]
                if rest:
                    self._unsent.appendleft(rest)
        except BlockingIOError:
            return
        except OSError:
            self._close()
            return
        self._loop.remove_writer(self._socket.fileno())
        self._tell_emptied()

    def _connected(self) -> socket.socket | None:
        now = self._loop.time()
        if now < self._not_before:
            return None
        self._not_before = now + _AGAIN_S
        new = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            new.connect(_address(self._neighbour))
            is_friend = _is_of_this_user(new)
        except OSError:  # it is not there yet, or not any more
            is_friend = False
        if not is_friend:
            new.close()
            return None
        self._socket = new
        return new

    def _close(self) -> None:
        if self._socket is not None:
            if self._unsent:
                self._loop.remove_writer(self._socket.fileno())
            self._socket.close()
            self._socket = None
        self._unsent.clear()
        self._waiting = 0
        self._tell_emptied()

    def _tell_emptied(self) -> None:
        if self._emptied is not None and not self._emptied.done():
            self._emptied.set_result(None)


class _LocalPublisher:
    """Puts datagrams on one key, straight if the way is open."""

    def __init__(self, route: LocalRoute, key: str, beside: Publisher, *, may_wait: bool) -> None:
        self._route = route
        self._key = key.encode()
        self._beside = beside
        self._largest = route.largest_message
        self._may_wait = may_wait
        self._is_closed = False

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram; see `Publisher.put`."""
        # What the session would refuse it refuses in its own words.
        refused = self._is_closed or len(header) + memoryview(payload).nbytes > self._largest
        if refused or not self._route.put(self._key, header, payload, may_wait=self._may_wait):
            self._beside.put(header, payload)

    def close(self) -> None:
        """Stop it."""
        self._is_closed = True
        self._beside.close()


class _Both:
    def __init__(self, one: Closing, other: Closing) -> None:
        self._all = (one, other)

    def close(self) -> None:
        """Stop both."""
        with contextlib.ExitStack() as stack:
            for one in self._all:
                stack.callback(one.close)
