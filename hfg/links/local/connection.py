"""One connection to another session of the same place: a socket that the event loop reads or writes.

Each session sends over the connections that it has made, and receives over those that others have made to it. Nothing
is read of anybody who is not of the same user, and nothing is believed or sent before both ends have proved that they
know the secret of the place.
Depends on `proof` and `wire`.
"""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from collections.abc import Callable
from typing import Final

from hfg.links.local.proof import CLAIM_SIZE, NONCE_SIZE, PROOF_SIZE, Caller, Listener, Refused, Seals
from hfg.links.local.wire import Frame, Inflow, frame
from hfg.transport import Buffer

GREETS_S: Final = 2.0
"""How long the other end may take to prove who it is."""

_MOST_UNSENT: Final = 2**26  # bytes that wait for a neighbour that does not read; what comes then is lost
_MOST_CONTROL: Final = 2**23  # bytes of what may not be lost; a neighbour with more than that is given up


async def _exactly(connected: socket.socket, size: int) -> bytes:
    """Receive so many bytes.

    Raises:
      ConnectionError: the other end has gone.
    """
    loop = asyncio.get_running_loop()
    got = b""
    while len(got) < size:
        more = await loop.sock_recv(connected, size - len(got))
        if not more:
            raise ConnectionResetError("it has gone before it had said who it is")
        got += more
    return got


async def introduce(connected: socket.socket, caller: Caller) -> Seals:
    """Prove who this is to whoever was connected to, and have that proved.

    Raises:
      Refused: it cannot prove it.
      OSError: it has gone, or takes longer than `GREETS_S`.
    """
    async with asyncio.timeout(GREETS_S):
        nonce = await _exactly(connected, NONCE_SIZE)
        await asyncio.get_running_loop().sock_sendall(connected, caller.claim(nonce))
        return caller.check(await _exactly(connected, PROOF_SIZE))


async def greet(connected: socket.socket, listener: Listener) -> tuple[bytes, Seals]:
    """Have whoever has connected prove who it is, and prove who this is; returns its name.

    Raises:
      Refused: it cannot prove it.
      OSError: it has gone, or takes longer than `GREETS_S`.
    """
    async with asyncio.timeout(GREETS_S):
        loop = asyncio.get_running_loop()
        await loop.sock_sendall(connected, listener.nonce)
        name, proof, seals = listener.check(await _exactly(connected, CLAIM_SIZE))
        await loop.sock_sendall(connected, proof)
        return name, seals


class Outgoing:
    """A connection that this session has made, over which it sends."""

    def __init__(self, connected: socket.socket, seals: Seals, gone: Callable[[], None]) -> None:
        """Begin to send.

        Args:
          connected: to somebody who has proved who it is.
          seals: of this connection.
          gone: called once when nothing can be sent any more, but for `close`.
        """
        self._socket = connected
        self._seals = seals
        self._gone = gone
        self._loop = asyncio.get_running_loop()
        self._unsent: deque[memoryview] = deque()
        self._waiting = 0  # bytes of it
        self._emptied: asyncio.Future[None] | None = None  # somebody waits until all has left

    @property
    def is_open(self) -> bool:
        """Whether anything can be sent."""
        return self._socket.fileno() >= 0

    def put(self, kind: int, key: bytes, header: bytes, payload: Buffer, *, size: int, may_wait: bool) -> None:
        """Send a datagram, or lose it.

        Args:
          kind: of the frame.
          key: on which it is put.
          header: of it.
          payload: of it.
          size: bytes of the payload.
          may_wait: it waits behind what has not left yet; else it is lost then, because it would be old.
        """
        if self._unsent and (not may_wait or self._waiting + size > _MOST_UNSENT):
            return
        self._send(*frame(self._seals, kind, key, header, payload))

    def tell(self, kind: int, key: bytes, header: bytes = b"", payload: Buffer = b"") -> None:
        """Send what may not be lost while the connection lasts."""
        if not self.is_open:
            return
        if self._waiting > _MOST_UNSENT + _MOST_CONTROL:
            self._lose()
            return
        self._send(*frame(self._seals, kind, key, header, payload))

    def _send(self, datagram: bytes, payload: Buffer) -> None:
        if self._unsent or payload:
            self._stand_in_line(datagram, payload)
            return
        try:
            sent = self._socket.send(datagram)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._lose()
            return
        if sent < len(datagram):
            self._stand_in_line(memoryview(datagram)[sent:])

    def _stand_in_line(self, *parts: Buffer) -> None:
        """Send it when all before it has left."""
        is_first = not self._unsent
        for part in parts:
            if part:
                view = memoryview(part).cast("B")
                self._unsent.append(view)
                self._waiting += len(view)
        if is_first and self.is_open:
            self._loop.add_writer(self._socket.fileno(), self._go_on)
            self._go_on()

    def _go_on(self) -> None:
        """There is room, perhaps: fill it, including what is made meanwhile: the next turn may be long in coming."""
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
            self._lose()
            return
        self._loop.remove_writer(self._socket.fileno())
        self._tell_emptied()

    async def flush(self, within_s: float) -> None:
        """Wait until all has left, or for so long."""
        if self._unsent:
            self._emptied = self._loop.create_future()
            await asyncio.wait({self._emptied}, timeout=within_s)

    def _lose(self) -> None:
        if self.is_open:
            self.close()
            self._gone()

    def close(self) -> None:
        """Send nothing more."""
        if self.is_open:
            if self._unsent:
                self._loop.remove_writer(self._socket.fileno())
            self._socket.close()
        self._unsent.clear()
        self._waiting = 0
        self._tell_emptied()

    def _tell_emptied(self) -> None:
        if self._emptied is not None and not self._emptied.done():
            self._emptied.set_result(None)


class Incoming:
    """A connection that another session has made, over which it sends."""

    def __init__(
        self,
        connected: socket.socket,
        seals: Seals,
        largest: int,
        take: Callable[[list[Frame]], None],
        gone: Callable[[str], None],
    ) -> None:
        """Begin to receive.

        Args:
          connected: to somebody who has proved who it is.
          seals: of this connection.
          largest: the most bytes of header and payload together.
          take: called with frames as they come.
          gone: called once when nothing comes any more, but for `close`; with what it has done wrong, if anything.
        """
        self._socket = connected
        self._inflow = Inflow(seals, largest)
        self._take = take
        self._gone = gone
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(connected.fileno(), self._read)

    @property
    def is_open(self) -> bool:
        """Whether anything can come."""
        return self._socket.fileno() >= 0

    def _read(self) -> None:
        """Take what is there: once, so that others have their turns, but of a long payload as much as comes."""
        frames: list[Frame] = []
        reason: str | None = None
        inflow = self._inflow
        try:
            while True:
                count = self._socket.recv_into(inflow.room)
                if not count:
                    reason = ""
                    break
                frames += inflow.take(count)
                if not inflow.is_in_long:
                    break
        except BlockingIOError:
            pass
        except OSError:
            reason = ""
        except Refused as problem:
            reason = str(problem)
        if frames:
            self._take(frames)
        if reason is not None and self.is_open:
            self.close()
            self._gone(reason)

    def close(self) -> None:
        """Receive nothing more."""
        if self.is_open:
            self._loop.remove_reader(self._socket.fileno())
            self._socket.close()
