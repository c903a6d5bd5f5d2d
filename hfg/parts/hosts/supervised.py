"""One part of a graph as a program of its own, for users whose supervisor starts and restarts programs.

It is an agent that serves this part only. The program of the main part waits until all others are there, in whichever
order they have been started, and then runs the graph; its end is the end of that program. Depends on `agent`.
"""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Mapping, Sequence
from typing import Any, Final

from hfg.base.logs import Log
from hfg.errors import RunError
from hfg.graph.flat import MAIN
from hfg.parts.hosts import requests
from hfg.parts.hosts.agent import Agent
from hfg.parts.hosts.realm import Realm, myself, named, run_place
from hfg.transport import Session

_LOGGER = Log("hfg.parts")
_FIRST_INCARNATION: Final = 1


class SupervisedPart:
    """Serves one part of a graph.

    Args:
      session: of the transport, on which all parts find each other.
      computer: starts the process of the part.
      graph: the name of the graph.
      part: the name of the group; "" is the main part.
      hosts: the host of each other part of the graph.
    """

    def __init__(self, session: Session, computer: Any, graph: str, part: str, hosts: Mapping[str, str]) -> None:
        self._session = session
        self._graph = graph
        self._part = part
        self._hosts = hosts
        self._agent = Agent(session, computer, myself(hosts.get(part) or session.host, (graph, part)))
        self._realm: Realm | None = None
        self._is_open = False
        self._run = ""

    async def open(self) -> None:
        """Announce the part.

        Raises:
          TransportError: another program serves it already.
        """
        self._realm = Realm(self._session)
        await self._agent.open()
        self._is_open = True

    def state(self) -> tuple[bool, dict[str, Any]]:
        """Return whether it is ready: other parts can find it; and for the main part, the run is in progress."""
        assert self._realm is not None
        told: dict[str, Any] = {"graph": self._graph, "part": self._part or "main"}
        if not self._is_open:
            return False, told | {"state": "starting"}
        if self._part != MAIN:
            return True, told | {"state": "running" if self._agent.hosts(self._part) else "waiting for a run"}
        if self._run and run_place(self._run) in self._realm.runs:
            return True, told | {"state": "running"}
        missing = self._missing()
        return False, told | ({"state": "waiting", "for": missing} if missing else {"state": "starting"})

    def _missing(self) -> list[str]:
        assert self._realm is not None
        realm = self._realm
        return sorted(part for part, host in self._hosts.items() if not realm.of(host, (self._graph, part)))

    async def run(self, target: str, arguments: Sequence[str], folder: str) -> None:
        """Run the graph as its main part, as soon as all others are there, to its end.

        Args:
          target: the graph.
          arguments: of `hfg run`.
          folder: folder of the target.

        Raises:
          RunError: the run has failed, or its process was killed.
        """
        assert self._realm is not None
        while missing := self._missing():
            _LOGGER.warning('graph "%s" waits for its parts %s', self._graph, named(missing))
            await self._realm.until(lambda: self._missing() != missing, None)
        self._run = f"hfg/{uuid.uuid4().hex[:12]}"
        await self._agent.deploy(requests.Deploy(self._run, target, list(arguments), folder))
        question = requests.Wait(self._run, MAIN, _FIRST_INCARNATION)
        while not (how := (await self._agent.wait(question)).how):
            pass
        if "has ended with code 0" not in how:
            raise RunError(f'the run of graph "{self._graph}" is over: {how}')

    async def serve(self) -> None:
        """Serve one of the other parts, for one run after the other."""
        await asyncio.get_running_loop().create_future()

    async def close(self) -> None:
        """End what was started, and leave."""
        self._is_open = False
        await self._agent.close()
        if self._realm is not None:
            self._realm.close()
