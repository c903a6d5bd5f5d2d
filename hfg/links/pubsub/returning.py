"""Keeps the places of consumers of a previous incarnation of a publisher until they are back. Depends on `running`."""

from __future__ import annotations

import asyncio
from collections.abc import Set
from typing import Final

from hfg.links.running import LinkSender

_PLACE: Final = "(before)"
_IN_S: Final = 3.0  # once one of them is back: the lease of a connection, and some more


def identity_of(consumer: str) -> str:
    """Say who a consumer is, each time that he takes part."""
    return consumer.partition(".")[0]


class Returning:
    """Keeps all sent values for consumers that may come back; each of them gets all values, and takes the new ones.

    Args:
      link: the link for consumers that want every value.
      expected: their identities.

    Attributes:
      expected: see above; those that are not back yet.
      open: whether any of them is still awaited.
    """

    def __init__(self, link: LinkSender, expected: Set[str]) -> None:
        self.expected = set(expected)
        self.open = True
        self._link = link
        self._timer: asyncio.TimerHandle | None = None
        link.admit(_PLACE, 1, after=0)

    def back(self, consumer: str) -> None:
        """Record that a consumer joined: one of them, or a successor. From now on the others have little time left."""
        self.expected.discard(identity_of(consumer))
        if not self.expected:
            self.close()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(_IN_S, self.close)

    def close(self) -> None:
        """Stop waiting. A second call does nothing."""
        if self._timer is not None:
            self._timer.cancel()
        if self.open:
            self.open = False
            self.expected.clear()
            self._link.dismiss(_PLACE)
