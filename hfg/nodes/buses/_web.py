"""What WebSockets and HTTP have in common: who may knock, and how we say who we are. Depends on `_servers`."""

from __future__ import annotations

import base64
import hmac
from collections.abc import Mapping, Sequence
from typing import Final
from urllib.parse import urlsplit

from annotated_types import MinLen

from hfg.base.hosts import is_loopback
from hfg.nodes.buses._connection import Connection
from hfg.nodes.buses._failures import Refused
from hfg.nodes.buses._secrets import NO_SECRET, NO_SECRETS, SOURCE, secret_of
from hfg.nodes.buses._servers import Door
from hfg.ports import Parameter

DENIED: Final = (401, 403, 407)
"""Answers after which another attempt does not help."""


class WebClient(Connection):
    """A client of a web server.

    Attributes:
      url: where the server is.
      headers: headers that are added; none that has a secret.
      user: the name for a password; empty: the secret is a token ("Bearer").
      secret: where the password or token is: "env:NAME" or "file:PATH".
      ca_file: a file with the authorities that are believed; empty: those of this computer.
      insecure: the secret may be sent unencrypted to another computer.
    """

    url = Parameter("http://127.0.0.1", NO_SECRET, MinLen(1))
    headers = Parameter[Mapping[str, str]]({}, NO_SECRETS, type=Mapping[str, str])
    user = Parameter("")
    secret = Parameter("", SOURCE)
    ca_file = Parameter("")
    insecure = Parameter(False)

    def address(self) -> str:
        """Return where the server is."""
        return self.url

    def need_scheme(self, *schemes: str) -> bool:
        """Return whether the address is encrypted: of two schemes the second.

        Raises:
          Refused: it has another scheme, or no host.
        """
        parts = urlsplit(self.url)
        if parts.scheme not in schemes or not parts.hostname:
            raise Refused(f'"{self.url}" is not an address; write "{schemes[0]}://host" or "{schemes[1]}://host"')
        return parts.scheme == schemes[1]

    def all_headers(self) -> dict[str, str]:
        """Return the headers, with the credentials.

        Raises:
          Refused: the secret is not there, or would be sent unencrypted.
        """
        said = secret_of(self.secret)
        if not said:
            return dict(self.headers)
        parts = urlsplit(self.url)
        if parts.scheme in ("http", "ws") and not self.insecure and not is_loopback(parts.hostname or ""):
            raise Refused(f'the secret would be sent unencrypted; write "{parts.scheme}s://", or set insecure=True')
        name = base64.b64encode(f"{self.user}:{said}".encode()).decode()
        return {**self.headers, "Authorization": f"Basic {name}" if self.user else f"Bearer {said}"}


class WebDoor(Door):
    """A server that web pages can reach, too.

    Attributes:
      names: further names by which clients may call this server, as they stand in the address: "robot.local".
      origins: web pages of other servers that may connect: "https://panel.example".
      secret: where the token is that clients have to know ("Authorization: Bearer"): "env:NAME" or "file:PATH";
        empty: they need none.
    """

    names = Parameter[Sequence[str]]((), type=Sequence[str])
    origins = Parameter[Sequence[str]]((), type=Sequence[str])
    secret = Parameter("", SOURCE)

    def refusal(self, host: str, origin: str | None, authorization: str) -> tuple[int, str] | None:
        """Return the status and the reason if a request is refused: it is counted."""
        found = self._judged(host, origin, authorization)
        if found is not None:
            self._counts["refused"] += 1
            if self._counts["refused"] == 1:
                self.log.warning("%s: a request was refused: %s", self.address(), found[1])
        return found

    def _judged(self, host: str, origin: str | None, authorization: str) -> tuple[int, str] | None:
        bare = host.rpartition(":")[0] if host.rpartition(":")[2].isdecimal() else host
        if not self.hosts.is_host(host) and bare not in self.names:
            return 421, 'this server has another name; see the parameter "names"'
        if origin is not None and not self.hosts.is_origin(origin, host) and origin not in self.origins:
            return 403, 'pages of that origin may not connect; see the parameter "origins"'
        said = secret_of(self.secret)
        kind, _, token = authorization.partition(" ")
        if said and not (kind.lower() == "bearer" and hmac.compare_digest(token.encode(), said.encode())):
            return 401, "the token is missing or wrong"
        return None
