"""The folder in which programs of one user meet: a socket for each of them, and a secret that all of them read.

The secret is made by whoever comes first. Depends on `hfg.base.sockets`.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import socket
import stat
from pathlib import Path
from typing import Final

from hfg.base.private import MACHINE, state_folder
from hfg.base.sockets import SocketFolder
from hfg.errors import TransportError

NAME_SIZE: Final = 8
"""Bytes of the name of a session."""

_SECRET: Final = "secret"
_SECRET_SIZE: Final = 32
_SESSION: Final = re.compile(r"[0-9a-f]{16}")
_PENDING: Final = 16  # connections that the system keeps while the event loop is busy


def user_folder(realm: str) -> Path:
    """Return the folder in which all programs of this user meet that name the same realm."""
    named = hashlib.blake2b(realm.encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()
    return state_folder() / f"meet-{MACHINE}-{named}"


class Place:
    """A folder in which programs meet.

    Attributes:
      folder: its path.
      secret: known to whoever can read the folder.

    Raises:
      TransportError: it is not a folder of this user alone, or cannot be used.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._sockets = SocketFolder(folder)
        try:
            self.secret = self._read_secret()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Leave it."""
        self._sockets.close()

    def names(self) -> list[bytes]:
        """Return the names of all sessions that have a socket here, including those whose process was killed."""
        return [bytes.fromhex(one) for one in self._sockets.names() if _SESSION.fullmatch(one)]

    def listen(self, name: bytes) -> socket.socket:
        """Return a socket that listens under a name; it has the name only once it listens.

        Raises:
          TransportError: the folder is gone, or the disk is full.
        """
        return self._sockets.listen(name.hex(), _PENDING)

    def connect(self, name: bytes) -> socket.socket | None:
        """Return a connection to a session of this user; None if there is no such session, or none any more.

        Raises:
          BlockingIOError: the other is too busy to accept one now.
        """
        return self._sockets.connect(name.hex())

    def remove(self, name: bytes) -> None:
        """Remove the socket of a session."""
        self._sockets.remove(name.hex())

    def _read_secret(self) -> bytes:
        """Return the secret; the first to come makes it."""
        for _ in range(2):
            try:
                handle = os.open(_SECRET, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=self._sockets.handle)
            except FileNotFoundError:
                self._make_secret()
                continue
            except OSError as error:
                raise TransportError(f"{self.folder / _SECRET} cannot be read ({error.strerror}): remove it") from None
            with os.fdopen(handle, "rb") as file:
                found = os.fstat(handle)
                secret = file.read(_SECRET_SIZE + 1)
            is_ours = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o077
            if not is_ours or len(secret) != _SECRET_SIZE:
                raise TransportError(f"{self.folder / _SECRET} is not what hfg has written: remove it")
            return secret
        raise TransportError(f"{self.folder / _SECRET} disappears as soon as it is made: is somebody removing it?")

    def _make_secret(self) -> None:
        new = f"{_SECRET}-{secrets.token_hex(8)}"
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
            with os.fdopen(os.open(new, flags, 0o600, dir_fd=self._sockets.handle), "wb") as file:
                file.write(secrets.token_bytes(_SECRET_SIZE))
            with contextlib.suppress(FileExistsError):  # somebody else was first
                os.link(
                    new,
                    _SECRET,
                    src_dir_fd=self._sockets.handle,
                    dst_dir_fd=self._sockets.handle,
                    follow_symlinks=False,
                )
        except OSError as error:
            raise TransportError(f"{self.folder / _SECRET} cannot be written: {error.strerror}") from None
        finally:
            with contextlib.suppress(OSError):
                os.unlink(new, dir_fd=self._sockets.handle)
