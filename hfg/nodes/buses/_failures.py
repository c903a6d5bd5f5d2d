"""Why a connection cannot be made or has gone, as one clear error; whether another attempt helps. No dependencies."""

from __future__ import annotations

import errno
import os
import socket
import ssl
from typing import Final

_REASONS: Final = {
    errno.ECONNREFUSED: "nothing listens there; start the server, or correct the address",
    errno.ECONNRESET: "the other side has broken the connection off",
    errno.EPIPE: "the other side has gone",
    errno.EADDRINUSE: "the port is in use; stop the program that has it, or take another port",
    errno.EADDRNOTAVAIL: "this computer has no such address",
    errno.EACCES: "it is not permitted; ports below 1024 need a right, devices the right group",
    errno.EHOSTUNREACH: "there is no way to that computer",
    errno.ENETUNREACH: "there is no way to that network",
    errno.ENOENT: "there is no such file or device",
    errno.ENODEV: "the device was pulled out",
    errno.EIO: "the device was pulled out",
    errno.EMFILE: "too many files are open",
}
_FOR_GOOD: Final = (errno.EADDRNOTAVAIL, errno.EACCES)
_LONGEST: Final = 300


class Lost(Exception):
    """The connection cannot be made now, or was lost; trying again may help."""


class Refused(Exception):
    """The other side does not want us, or cannot be believed; trying again does not help."""


def printable(text: object) -> str:
    """Return a text of the other side that cannot steer a terminal, and is not endless."""
    said = "".join(one if one.isprintable() else "?" for one in str(text)[: _LONGEST + 1])
    return said if len(said) <= _LONGEST else said[: _LONGEST - 3] + "..."


def explained(error: BaseException) -> Lost | Refused:
    """Return an error of a library or of the system as one of ours."""
    if isinstance(error, Lost | Refused):
        return error
    if isinstance(error, ExceptionGroup):  # one for each address of a name
        return explained(error.exceptions[0])
    if isinstance(error, ssl.SSLCertVerificationError):
        return Refused(
            f"its certificate is not accepted: {printable(error.verify_message)}; renew it, or name the file of its "
            'authority by the parameter "ca_file"'
        )
    if isinstance(error, ssl.SSLError):
        return Lost(f"it does not speak TLS with us ({printable(error.reason or error)})")
    if isinstance(error, socket.gaierror):
        return Lost(f"the name cannot be found ({error.strerror})")
    if isinstance(error, TimeoutError) and error.errno is None:
        return Lost("it does not answer in time")
    if not isinstance(error, OSError) and (below := _below(error)) is not None:
        return explained(below)
    if isinstance(error, OSError) and error.errno is not None:
        why = _REASONS.get(error.errno) or os.strerror(error.errno)
        return Refused(why) if error.errno in _FOR_GOOD else Lost(why)
    return Lost(printable(error) or type(error).__name__)


def _below(error: BaseException) -> BaseException | None:
    """Return the system's error for which a library has raised its own."""
    found = error.__cause__ or error.__context__
    for _ in range(9):
        if found is None or isinstance(found, OSError | ExceptionGroup):
            return found
        found = found.__cause__ or found.__context__
    return None
