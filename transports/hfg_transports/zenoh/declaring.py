"""What a session has declared: subscribers, queryables and tokens, each kept until it is withdrawn. Depends on logs."""

from __future__ import annotations

from typing import Protocol, TypeVar

from hfg.base.logs import log


class Declared(Protocol):
    """Something that Zenoh tells other sessions about."""

    def undeclare(self) -> object:
        """Take it back; raises if the session is closed."""


_Some = TypeVar("_Some", bound=Declared)


class Declarations:
    """Keeps declarations, because Zenoh withdraws a token without references; from any thread."""

    def __init__(self) -> None:
        self._kept: dict[Declared, None] = {}

    def keep(self, declared: _Some) -> _Some:
        """Keep something, and return it."""
        self._kept[declared] = None
        return declared

    def withdraw(self, declared: Declared) -> None:
        """Withdraw something, unless it is withdrawn already."""
        try:
            del self._kept[declared]
        except KeyError:
            return
        try:
            declared.undeclare()
        except Exception as error:
            log().debug("Zenoh could not withdraw something: %s", error)

    def withdraw_all(self) -> None:
        """Withdraw everything, the last first, before the session is closed.

        While Zenoh closes a session, it connects to peers that others gossip about, keeps these connections as long as
        the process lives, and declares there what it still has. So the others would never learn that the session has
        ended. See https://github.com/eclipse-zenoh/zenoh/pull/2733; the empty connections remain until that is fixed.
        """
        for declared in reversed(list(self._kept)):
            self.withdraw(declared)
