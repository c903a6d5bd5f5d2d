"""The value of the cookie of a server, so that pages reconnect after a sudden end of the studio.

It lies in a folder that only this user can enter (rule L5), and is gone when the studio ends as it should.
Depends on `hfg.base.private`.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from typing import Final

from hfg.base.private import MACHINE, open_private, state_folder
from hfg.errors import TransportError

__all__ = ["forget_secret", "secret_of"]

_BYTES: Final = 24
_LENGTH: Final = len(secrets.token_urlsafe(_BYTES))


@contextlib.contextmanager
def _folder() -> Iterator[int]:
    """Open the folder; the handle is that of the folder that was checked."""
    handle = open_private(state_folder() / f"studio-{MACHINE}", "with the secrets of studios")
    try:
        yield handle
    finally:
        os.close(handle)


def secret_of(server: str) -> str:
    """Return the secret that a server of this kind and port had when it was killed, or else a new one."""
    new = secrets.token_urlsafe(_BYTES)
    try:
        with _folder() as folder:
            return _kept(folder, server) or _keep(folder, server, new)
    except (OSError, TransportError):  # pages then need the new address
        return new


def _kept(folder: int, server: str) -> str | None:
    try:
        number = os.open(f"{server}.key", os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
    except FileNotFoundError:
        return None
    with os.fdopen(number, encoding="ascii") as file:
        text = file.read(_LENGTH + 1)
    return text if len(text) == _LENGTH else None


def _keep(folder: int, server: str, secret: str) -> str:
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    with os.fdopen(os.open(f"{server}.key", flags, 0o600, dir_fd=folder), "w", encoding="ascii") as file:
        file.write(secret)
    return secret


def forget_secret(server: str) -> None:
    """A server ends as it should: its cookies are worth nothing from now on."""
    with contextlib.suppress(OSError, TransportError), _folder() as folder:
        os.unlink(f"{server}.key", dir_fd=folder)
