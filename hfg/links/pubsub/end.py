"""The common part of the publishing and the subscribing end: their identity, and their reports about others.

Depends on `offers`.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Iterator
from typing import Any, Final

from hfg.encoding import TokenCodec
from hfg.links.offers import Seen, introduce, read_introduction, read_name
from hfg.transport import Presence, Session

MOST: Final = 1_000
"""Publishers of one name, consumers of one publisher, and sentences about them, that are taken note of."""


class _News:
    """An event for changes: waiting code checks again."""

    def __init__(self) -> None:
        self._event = asyncio.Event()

    def tell(self) -> None:
        """Report a change."""
        self._event.set()

    async def wait(self) -> None:
        """Wait until it has since the last time."""
        await self._event.wait()
        self._event.clear()


class End:
    """One of two ends that connect by a name.

    Args:
      session: of the transport, on the running loop.
      name: the common name of the programs.
      hint: the declared type of the values.
      who: the owner of this end, for messages.
      lossless: whether it takes part in the link that delivers every value.
      stream: identity of the stream of all incarnations of this publisher, if it has an outbox.
      complain: called with each message about an end that does not match, once.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        hint: Any,
        who: str,
        *,
        lossless: bool,
        complain: Callable[[str], None],
        stream: str = "",
    ) -> None:
        said = introduce(hint, who, lossless=lossless, stream=stream)
        mine = read_introduction(said)
        assert mine is not None
        self.name = name
        self._session = session
        self._hint = hint
        self._said = said
        self._mine = mine
        self._complain = complain
        self._told: set[str] = set()
        self._codec = TokenCodec[Any](hint, what=f'a value of "{name}"')
        self._id = secrets.token_hex(8)
        self._closed = False
        self._news = _News()

    def _seen(self, presences: list[Presence]) -> Iterator[tuple[Seen, Presence]]:
        """Yield the announcements, except those that do not come from such ends."""
        for one in presences:
            seen = read_name(self.name, one.name)
            if seen is not None:
                yield seen, one

    def _tell_once(self, sentence: str) -> None:
        if sentence not in self._told and len(self._told) < MOST:
            self._told.add(sentence)
            self._complain(sentence)
