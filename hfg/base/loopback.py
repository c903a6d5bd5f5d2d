"""Which user is at the other end of a TCP connection within this computer (rule L5). Depends on logs."""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
from typing import Any, Final

from typing_extensions import override

from hfg.base.logs import log

_HEAD: Final = struct.Struct("=IHHII")  # of a netlink message: size, kind, flags, number, port
_FOUND, _ASKS = 20, 1  # SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST
_WHAT: Final = struct.Struct("=BBBBI")  # family, protocol, extensions, padding, states
_PORTS: Final = struct.Struct("!HH")
_ANY: Final = struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)  # interface and cookie
_USER: Final = struct.Struct("=II")  # user and inode of the socket
_USER_AT: Final = _HEAD.size + 64
_SOCK_DIAG: Final = 4


class PeerUsers:
    """Asks Linux for the users of the connections of a listening socket.

    Raises:
      OSError: the system cannot tell.
    """

    def __init__(self, listening: socket.socket) -> None:
        if sys.platform != "linux":
            raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
        self._kernel = socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK, _SOCK_DIAG)
        nobody = ("::" if listening.family == socket.AF_INET6 else "0.0.0.0", 0)
        try:
            self._user(listening.family, listening.getsockname(), nobody)
        except OSError:
            self.close()
            raise

    def is_trusted(self, connected: socket.socket) -> bool:
        """Return whether this user or root is at the other end, and still there.

        A connection that its other end has closed has no user any more.
        """
        try:
            return self._user(connected.family, connected.getpeername(), connected.getsockname()) in (0, os.geteuid())
        except OSError:
            return False

    def _user(self, family: int, near: tuple[Any, ...], far: tuple[Any, ...]) -> int:
        """Return the user of a socket of this computer, by its two ends.

        Raises:
          OSError: the system does not know, or no process has the socket any more.
        """
        ends = _PORTS.pack(near[1], far[1]) + b"".join(
            socket.inet_pton(family, one[0]).ljust(16, b"\0") for one in (near, far)
        )
        asked = _WHAT.pack(family, socket.IPPROTO_TCP, 0, 0, 0xFFFFFFFF) + ends + _ANY
        self._kernel.send(_HEAD.pack(_HEAD.size + len(asked), _FOUND, _ASKS, 1, 0) + asked)
        answer = self._kernel.recv(4096)  # the kernel has answered before `send` returns
        if _HEAD.unpack_from(answer)[1] == _FOUND:
            user, inode = _USER.unpack_from(answer, _USER_AT)
            if inode:
                return int(user)
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))

    def close(self) -> None:
        """Ask no more."""
        self._kernel.close()


class OwnListener(socket.socket):
    """A TCP socket that accepts programs of this user and root only; those of all users where the system cannot tell.

    It looks before the event loop makes anything of a connection, so a flood costs little.

    Attributes:
      refused: how many were turned away.
    """

    refused = 0
    _users: PeerUsers | None = None

    @property
    def is_guarded(self) -> bool:
        """Whether the system tells it whose programs connect."""
        return self._users is not None

    @override
    def listen(self, backlog: int = socket.SOMAXCONN, /) -> None:
        super().listen(backlog)
        if self._users is None and sys.platform == "linux":
            try:
                self._users = PeerUsers(self)
            except OSError:  # the kernel was built without this, or the program may not ask it
                return

    @override
    def accept(self) -> tuple[socket.socket, Any]:
        """See `socket.accept`.

        Raises:
          ConnectionAbortedError: a program of another user has connected.
        """
        connected, address = super().accept()
        if self._users is None or self._users.is_trusted(connected):
            return connected, address
        connected.close()
        self.refused += 1
        if self.refused == 1:
            log().warning("port %d: a program of another user was turned away", self.getsockname()[1])
        raise ConnectionAbortedError(errno.ECONNABORTED, "a program of another user has connected")

    @override
    def close(self) -> None:
        if self._users is not None:
            self._users.close()
        super().close()
