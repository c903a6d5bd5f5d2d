"""How a part of a run reaches others: over the session of a transport, or, on the same host, straight.

Stands on `hfg.links.local`.
"""

from __future__ import annotations

from hfg.errors import TransportError
from hfg.links.local import LocalEndpoint, LocalRoute
from hfg.logs import Log
from hfg.parts.running.channels import name_of
from hfg.transport import Datagrams, Session

__all__ = ["Ways"]

_LOGGER = Log("hfg.parts")


class Ways:
    """How a part reaches others: over the session, or on the same host straight."""

    def __init__(self, session: Session, run: str, here: str, lives: dict[str, int], beside: set[str]) -> None:
        """Listen to those on the same host, if there are any.

        Args:
          session: of the transport.
          run: by which name all parts of the run know it.
          here: the name of this part.
          lives: which life of each part this is for.
          beside: the parts on the same host that it has edges to or from.
        """
        self._session = session
        self._run = run
        self._routes: dict[str, LocalRoute] = {}
        self._endpoint: LocalEndpoint | None = None
        if not beside:
            return
        try:
            self._endpoint = endpoint = LocalEndpoint(self._name(here, lives[here]), session.largest_message)
        except TransportError as error:
            _LOGGER.debug("%s goes over the network alone: %s", name_of(here), error)
        else:
            self._routes = {
                other: LocalRoute(endpoint, session, self._name(other, lives[other])) for other in sorted(beside)
            }

    def _name(self, part: str, life: int) -> str:
        return f"{self._run}/{name_of(part)}/{life}"

    def to(self, other: str) -> Datagrams:
        """Give the way to another part."""
        return self._routes.get(other, self._session)

    def admit(self, other: str, life: int) -> None:
        """Another part has died and begins anew, as that life."""
        if other in self._routes:
            self._routes[other].lead_to(self._name(other, life))

    async def close(self) -> None:
        """End those that this has made."""
        for route in self._routes.values():
            await route.close()
        if self._endpoint is not None:
            self._endpoint.close()
