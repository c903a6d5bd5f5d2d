"""Presence: announcements and watches, over Zenoh's liveliness tokens.

A token is a key and nothing else, so what is announced with a name stands in the key. So does the session with a
number, since two sessions that announce one name are two: `<session>.<number>/<metadata>/<name ...>`. The name comes
last because a wildcard of many chunks matches only chunks without a leading `@`. Depends on names and the inbox.
"""

from __future__ import annotations

import base64
import binascii
from typing import TYPE_CHECKING, Final

from hfg.transport import Presence, Watch
from hfg_transports.zenoh.names import escape, join, unescape

if TYPE_CHECKING:
    from collections.abc import Callable

    from hfg_transports.zenoh.inbox import Mailbox

MOST: Final = 100_000
"""Tokens that one watch remembers; whoever declares more than that means harm."""

_NOTHING: Final = "-"


def presence_key(prefix: str, session: str, number: int, name: str, metadata: bytes) -> str:
    """Return the key of a token.

    Raises:
      MessageTooLarge: name and metadata do not fit into one.
    """
    said = base64.urlsafe_b64encode(metadata).decode().rstrip("=") if metadata else _NOTHING
    return join(prefix, f"{session}.{number}", said, escape(name))


def prefix_key(prefix: str, name: str) -> str:
    """Return what matches the tokens of all names at or below a name."""
    return join(prefix, "*", "*", *([escape(name)] if name else []), "**")


def read_presence_key(prefix: str, key: str) -> tuple[str, str, bytes] | None:
    """Return token, name and metadata of a key; None if it is not one of ours."""
    token, _, rest = key.removeprefix(f"{prefix}/").partition("/")
    said, _, name = rest.partition("/")
    if not key.startswith(prefix) or not (token and said and name):
        return None
    try:
        metadata = b"" if said == _NOTHING else base64.b64decode(said + "=" * (-len(said) % 4), b"-_", validate=True)
        return token, unescape(name), metadata
    except (binascii.Error, ValueError):
        return None


class Announcement:
    """A member of this session that is present until it is closed."""

    def __init__(self, undeclare: Callable[[], object]) -> None:
        self._undeclare: Callable[[], object] | None = undeclare

    def close(self) -> None:
        """Withdraw it."""
        undeclare, self._undeclare = self._undeclare, None
        if undeclare is not None:
            undeclare()


class Watching:
    """The names reported to one watch.

    Zenoh may tell of a token twice, by two ways or after a reconnection, and of the end of one that it never told of.
    """

    def __init__(self, prefix: str, changed: Watch) -> None:
        self._prefix = prefix
        self._changed = changed
        self._there: dict[str, str] = {}  # token -> name
        self.mailbox: Mailbox[tuple[bool, str]] | None = None

    def told(self, changes: list[tuple[bool, str]]) -> None:
        """Take what Zenoh has said: whether it is there, and the key; on the loop."""
        news = [presence for present, key in changes if (presence := self._news(present, key)) is not None]
        if news:
            self._changed(news)

    def _news(self, present: bool, key: str) -> Presence | None:
        read = read_presence_key(self._prefix, key)
        if read is None:
            return None
        token, name, metadata = read
        if present:
            if token in self._there or len(self._there) >= MOST:
                return None
            self._there[token] = name
            return Presence(name, metadata, True)
        if self._there.pop(token, None) is None:
            return None
        return Presence(name, b"", False)
