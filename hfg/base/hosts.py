"""Which names a server on this computer has, and which requests were meant for it (rule L5).

A page of another origin can reach every server that its browser can, and a name of its own can be rebound to this
computer's address; so a server compares Host and Origin. No dependencies.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from typing import Final

_LOOPBACK: Final = ("localhost", "127.0.0.1", "[::1]")


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Hosts:
    """The names of one server.

    Args:
      host: where it listens.
      port: likewise.
      encrypted: it speaks TLS.
      names: further names of this machine.
    """

    def __init__(self, host: str, port: int, *, encrypted: bool = False, names: Iterable[str] = ()) -> None:
        self._scheme = "https" if encrypted else "http"
        named = f"[{host}]" if ":" in host else host
        hosts = {*_LOOPBACK, *names, *(() if _is_any(host) else (named,))}
        self._hosts = {f"{one}:{port}" for one in hosts} | (hosts if port == (443 if encrypted else 80) else set())
        self._any_host = _is_any(host)
        self.encrypted = encrypted

    def is_host(self, host: str) -> bool:
        """Return whether a request was meant for this server: another name may be rebound to its address."""
        return host in self._hosts or (self._any_host and _is_address(host))

    def is_origin(self, origin: str | None, host: str) -> bool:
        """Return whether a page of this very server asks."""
        return origin == f"{self._scheme}://{host}"


def _is_any(host: str) -> bool:
    return host in ("0.0.0.0", "::", "")


def _is_address(host: str) -> bool:
    """Whether a Host header is a plain address: no name can be rebound to that."""
    name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
