"""Access control: a token once, then a cookie; the right Host against rebinding, the right Origin against other pages.

A page that can create nodes can run code, so the token is worth as much as the user's shell (rule L5).
Depends on hosts.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable, Mapping
from typing import Final

from hfg.base.hosts import Hosts, is_loopback
from hfg.errors import TargetError

__all__ = ["Entrance", "is_loopback", "need_guarded"]

_POLICY: Final = (
    "default-src 'self'; script-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; "
    "connect-src 'self'; worker-src 'self' blob:; font-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors "
)
_NOTEBOOKS: Final = "http://localhost:* http://127.0.0.1:*"
_HEADERS: Final[Mapping[str, str]] = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}

_TOKEN_BYTES: Final = 24


def need_guarded(host: str, *, encrypted: bool, insecure: bool) -> None:
    """Refuse to be reached from other machines without encryption (rule L5).

    Raises:
      TargetError: it says what to write.
    """
    if is_loopback(host) or encrypted or insecure:
        return
    raise TargetError(
        f"--host {host} lets other machines in, and without encryption whoever listens on the network reads the token, "
        "with which one can run code here: give --certfile and --keyfile, or go through ssh -L, or write --insecure"
    )


class Entrance(Hosts):
    """Checks every request of one server.

    Attributes:
      token: what the address holds, once.
      cookie: the name of the cookie; it has the port, because cookies belong to hosts, whatever the port.
      headers: of every answer.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        encrypted: bool = False,
        names: Iterable[str] = (),
        embedded: bool = False,
        secret: str | None = None,
    ) -> None:
        """Make a token.

        Args:
          host: where the server listens.
          port: likewise.
          encrypted: it speaks TLS.
          names: further names of this machine that browsers may use.
          embedded: notebooks of this machine may show the page in a frame.
          secret: the value of the cookie; default: a new one.
        """
        super().__init__(host, port, encrypted=encrypted, names=names)
        policy = _POLICY + (_NOTEBOOKS if embedded else "'none'")
        self.headers = {"Content-Security-Policy": policy, **_HEADERS}
        self.token = secrets.token_urlsafe(_TOKEN_BYTES)
        self.cookie = f"hfg-{port}"
        self._secret = secret or secrets.token_urlsafe(_TOKEN_BYTES)

    def is_token(self, token: str) -> bool:
        """Return whether it is the token of the address."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def is_cookie(self, value: str | None) -> bool:
        """Return whether it is the cookie that the token was exchanged for."""
        return value is not None and hmac.compare_digest(value.encode(), self._secret.encode())

    def is_bearer(self, authorization: str | None) -> bool:
        """Return whether a program other than a browser gives the token; then it needs neither cookie nor origin."""
        kind, _, token = (authorization or "").partition(" ")
        return kind.lower() == "bearer" and self.is_token(token)

    @property
    def set_cookie(self) -> str:
        """The header that gives the cookie."""
        secure = "; Secure" if self.encrypted else ""
        return f"{self.cookie}={self._secret}; HttpOnly; SameSite=Strict; Path=/{secure}"
