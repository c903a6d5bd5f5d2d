"""The agents and runs in a realm.

An agent announces `agents/<host>/<incarnation>`, the main part of a run `runs/<run>`, each with a description of
itself. They answer `requests` at names below these. Depends on the contract of transports.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.metadata
import os
import platform
import uuid
from collections.abc import Callable, Iterable
from typing import Any, Final

import msgspec

from hfg.base.controls import cleaned
from hfg.base.logs import Log
from hfg.errors import TransportError
from hfg.transport import Presence, Session

_LOGGER = Log("hfg.parts")

AGENTS: Final = "agents"
RUNS: Final = "runs"

FINDS_S: Final = 3.0
"""How long it may take to find a program that is present."""

GONE_S: Final = 5.0
"""For how long agents and runs wait for each other when a connection is away; then the other counts as gone."""


def agent_place(agent: AgentIs) -> str:
    """Return the name under which an agent is announced."""
    return f"{AGENTS}/{agent.host}/{agent.incarnation}"


def run_id(run: str) -> str:
    """Return the name of a run for users, from the name by which its parts know it."""
    return run.rpartition("/")[2]


def run_place(run: str) -> str:
    """Return the name under which a run is announced."""
    return f"{RUNS}/{run_id(run)}"


# --- what they say of themselves ---


class AgentIs(msgspec.Struct, frozen=True):
    """An agent.

    Attributes:
      host: its name.
      incarnation: which incarnation of it.
      process: its process id.
      hfg, python: versions.
      serves: the graph and the group that it is for, "" for the main part; None: all groups of its host.
    """

    host: str
    incarnation: str
    process: int
    hfg: str
    python: str
    serves: tuple[str, str] | None = None


def myself(host: str, serves: tuple[str, str] | None = None) -> AgentIs:
    """Return the description of an agent in this process."""
    version = importlib.metadata.version("hfg")
    return AgentIs(host, uuid.uuid4().hex[:12], os.getpid(), version, platform.python_version(), serves)


class RunIs(msgspec.Struct, frozen=True):
    """A run.

    Attributes:
      run: what it is called.
      graph: the name of its graph.
      target: what the user calls it.
      host, process: of its main part.
    """

    run: str
    graph: str
    target: str
    host: str
    process: int


class Realm:
    """The programs in a realm, seen through an open session.

    Attributes:
      agents: by place.
      runs: by place.
    """

    def __init__(self, session: Session) -> None:
        """Begin to watch."""
        self.session = session
        self.agents: dict[str, AgentIs] = {}
        self.runs: dict[str, RunIs] = {}
        self._changed: set[asyncio.Future[None]] = set()
        self._watches = [
            session.watch(AGENTS, lambda seen: self._see(seen, self.agents, AgentIs)),
            session.watch(RUNS, lambda seen: self._see(seen, self.runs, RunIs)),
        ]

    def _see(self, seen: list[Presence], into: dict[str, Any], kind: type) -> None:
        for one in seen:
            if not one.present:
                into.pop(one.name, None)
                continue
            try:
                into[one.name] = cleaned(msgspec.msgpack.decode(one.metadata, type=kind))
            except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
                _LOGGER.warning('"%s" has an announcement that this version of hfg cannot read', one.name)
        changed, self._changed = self._changed, set()
        for waiting in changed:
            if not waiting.done():
                waiting.set_result(None)

    def of(self, host: str, part: tuple[str, str] | None = None) -> list[AgentIs]:
        """Return the agents with a name that serve a part, given as graph and group, or all parts; normally one."""
        return [agent for agent in self.agents.values() if agent.host == host and agent.serves in (None, part)]

    def twins(self, me: AgentIs) -> list[AgentIs]:
        """Return other agents that serve the same."""
        found = [agent for agent in self.agents.values() if (agent.host, agent.serves) == (me.host, me.serves)]
        return [agent for agent in found if agent.incarnation != me.incarnation]

    async def until(self, true: Callable[[], object], within_s: float | None) -> bool:
        """Wait until a condition on the present programs holds. Return whether it does."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                while not true():
                    await self.change()
        return bool(true())

    async def change(self) -> None:
        """Wait until a program comes or goes."""
        waiting = asyncio.get_running_loop().create_future()
        self._changed.add(waiting)
        await waiting

    async def agent(self, host: str, within_s: float | None = FINDS_S, part: tuple[str, str] | None = None) -> AgentIs:
        """Find the agent of a host that serves a part, given as graph and group, or all parts.

        Raises:
          TransportError: there is none, or more than one.
        """
        await self.until(lambda: self.of(host, part), within_s)
        found = self.of(host, part)
        if not found:
            raise TransportError(self._nobody(host))
        if len(found) > 1:
            processes = " and ".join(str(agent.process) for agent in found)
            raise TransportError(
                f'{len(found)} agents are named "{host}" (processes {processes} of their hosts); stop all but '
                'one, or rename one with host = "..." in its settings'
            )
        return found[0]

    def _nobody(self, host: str) -> str:
        others = named(agent.host for agent in self.agents.values())
        there = f"there are agents of {others}" if others else "no agent is there at all"
        return (
            f'host "{host}" has no agent that can be reached from here; {there}: run `hfg agent` on that host, with '
            f'host = "{host}" in its settings, the realm of these, and addresses by which the two find each other'
        )

    def close(self) -> None:
        """Watch no more."""
        for watch in self._watches:
            watch.close()


def named(names: Iterable[str]) -> str:
    """List names for a sentence."""
    return ", ".join(f'"{name}"' for name in sorted(set(names)))
