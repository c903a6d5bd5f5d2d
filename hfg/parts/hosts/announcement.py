"""A run that all programs in a realm can find: the announcement of its main part, and its answers to requests.

Depends on `realm`, `requests` and a run's interface.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec

from hfg.engine import Run
from hfg.engine.face.watching import Door
from hfg.engine.face.watching import Question as Asked
from hfg.engine.observing.encoding import encode
from hfg.parts.hosts import requests
from hfg.parts.hosts.realm import RunIs, run_id, run_place
from hfg.parts.hosts.requests import serve
from hfg.transport import Session


class Announcement:
    """Announces a run and answers for it, until it is closed."""

    def __init__(
        self,
        session: Session,
        run: str,
        face: Run,
        parts: Callable[[], list[requests.PartIs]],
        restart: Callable[[str], Awaitable[None]],
    ) -> None:
        """Start.

        Args:
          session: session of the main part.
          run: the name by which its parts know it.
          face: the interface to it.
          parts: returns information about its parts.
          restart: ends the process of a part, and starts another.
        """
        self._run = face
        self._parts = parts
        self._restart = restart
        target = " ".join(sys.argv[1:] or sys.argv)[:200]
        self._door = Door(face, target, run_id(run))
        place = run_place(run)
        me = RunIs(run_id(run), face.graph.name, target, session.host, os.getpid())
        answers: dict[Any, Callable[[Any], Awaitable[Any]]] = {
            requests.Parts: self._tell,
            requests.Stop: self._stop,
            requests.Restart: self._begin_again,
            requests.Look: self._look,
        }
        self._open = [*serve(session, place, answers), session.announce(place, msgspec.msgpack.encode(me))]

    def close(self) -> None:
        """The run is over."""
        for one in reversed(self._open):
            one.close()

    async def _tell(self, _: requests.Parts) -> requests.PartsAre:
        return requests.PartsAre(self._parts())

    async def _stop(self, _: requests.Stop) -> requests.Done:
        self._run.stop()
        return requests.Done()

    async def _begin_again(self, request: requests.Restart) -> requests.Done:
        await self._restart(request.part)
        return requests.Done()

    async def _look(self, request: requests.Look) -> requests.Seen:
        answer = self._door.answer(request.question)
        if isinstance(answer, Asked):
            answer = msgspec.structs.replace(
                self._door.name,
                error="tokens at a port can be tapped only on the host of the main part: run hfg tap there",
            )
        return requests.Seen(encode(answer))
