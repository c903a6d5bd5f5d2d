"""The place of those who took part in a former life of a publisher, until they are back. Stands on `running`."""

from __future__ import annotations

import asyncio
from collections.abc import Set
from typing import Final

from hfg.links.running import LinkSender

__all__ = ["Returning", "identity_of"]

_PLACE: Final = "(before)"
_IN_S: Final = 3.0  # once one of them is back: the lease of a connection, and some more


def identity_of(consumer: str) -> str:
    """Say who a consumer is, each time that he takes part."""
    return consumer.partition(".")[0]


class Returning:
    """Keeps all that is sent for those who may come back; each of them gets all of it, and takes what is new.

    Args:
      link: of those who get every value.
      expected: who they are.

    Attributes:
      expected: see above; who is not back yet.
      open: whether somebody is still waited for.
    """

    def __init__(self, link: LinkSender, expected: Set[str]) -> None:
        self.expected = set(expected)
        self.open = True
        self._link = link
        self._timer: asyncio.TimerHandle | None = None
        link.admit(_PLACE, 1, after=0)

    def back(self, consumer: str) -> None:
        """Somebody takes part: one of them, or an heir; from now on the others have little time left."""
        self.expected.discard(identity_of(consumer))
        if not self.expected:
            self.close()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(_IN_S, self.close)

    def close(self) -> None:
        """Wait for nobody any more. Does nothing the second time."""
        if self._timer is not None:
            self._timer.cancel()
        if self.open:
            self.open = False
            self.expected.clear()
            self._link.dismiss(_PLACE)
