"""A folder with local sockets of programs of one user, each of which has a name (rule L5).

Only the user can enter the folder, which is checked each time it is opened. Sockets are reached through the handle that
was checked, so replacing the folder later leads no program astray, and paths may have any length.
Depends on `private`.
"""

from __future__ import annotations

import contextlib
import os
import re
import socket
from pathlib import Path
from typing import Final

from hfg.base.private import MEETING, is_of_this_user, open_private, require_peer_credentials
from hfg.errors import TransportError

SOCKET_FILE: Final = re.compile(r"([0-9a-f-]+)\.(sock|new)")
"""Names of the files of sockets; one that is not listening yet is a ".new"."""


class SocketFolder:
    """An open folder with sockets.

    Args:
      folder: its path; it is created if needed.
      purpose: what the folder is for, in error messages.

    Attributes:
      folder: its path.
      handle: of the folder that was checked.

    Raises:
      TransportError: others can enter or replace it, or the system does not tell who is at the other end of a socket.
    """

    def __init__(self, folder: Path, purpose: str = MEETING) -> None:
        require_peer_credentials()
        self.folder = folder
        self.handle = open_private(folder, purpose)

    def close(self) -> None:
        """Leave it."""
        if self.handle >= 0:
            os.close(self.handle)
            self.handle = -1

    def names(self) -> list[str]:
        """Return the names of all sockets, including those whose process was killed."""
        found = (SOCKET_FILE.fullmatch(file.name) for file in os.scandir(self.handle))
        return [one[1] for one in found if one and one[2] == "sock"]

    def listen(self, name: str, pending: int) -> socket.socket:
        """Return a socket that listens under a name; it has the name only once it listens.

        Raises:
          TransportError: the folder is gone, or the disk is full.
        """
        listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(f"{name}.new", dir_fd=self.handle)  # of a process that was killed
            listening.bind(self._path(f"{name}.new"))
            listening.listen(pending)
            os.rename(f"{name}.new", f"{name}.sock", src_dir_fd=self.handle, dst_dir_fd=self.handle)
        except OSError as error:
            listening.close()
            raise TransportError(f"no socket can be made in {self.folder}: {error.strerror}") from None
        return listening

    def connect(self, name: str) -> socket.socket | None:
        """Return a connection to a socket of this user, which does not block; None if no process listens there.

        Raises:
          BlockingIOError: the other is too busy to accept one now.
        """
        connected = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            connected.connect(self._path(f"{name}.sock"))
            if is_of_this_user(connected):
                return connected
        except BlockingIOError:
            connected.close()
            raise
        except ConnectionRefusedError:
            self.remove(name)  # its process was killed
        except OSError:
            pass
        connected.close()
        return None

    def remove(self, name: str) -> None:
        """Remove a socket."""
        with contextlib.suppress(OSError):
            os.unlink(f"{name}.sock", dir_fd=self.handle)

    def _path(self, file: str) -> str:
        return f"/proc/self/fd/{self.handle}/{file}"
