"""Parts on other hosts: agents are found, asked whether everything is available, and asked to start them.

Parts without a host start here, as processes that connect in the same realm. A lost connection has no immediate
consequences; the links wait. When the agent is gone, so are its parts; they restart as soon as it is back, and until
then the other parts wait for them as for a slow part (rules L1, L3). Depends on `realm`, `requests` and `peer_process`.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
from collections.abc import Mapping
from contextvars import ContextVar
from typing import Final, TypeVar

from hfg.base.logs import Log
from hfg.errors import HfgError, NoAnswer, QueryRefused, TransportError
from hfg.parts.hosts import requests
from hfg.parts.hosts.agent import WAITS_S
from hfg.parts.hosts.realm import FINDS_S, GONE_S, AgentIs, Realm, agent_place, myself, named
from hfg.parts.hosts.requests import Request, ask
from hfg.parts.processes.peer_process import Launched, Launcher
from hfg.transport import Session

_LOGGER = Log("hfg.parts")
_STARTS_S: Final = 20.0  # an agent may have to end a previous incarnation first
_ENDS_S: Final = 8.0
_AGAIN_S: Final = 0.2
_FIRST_INCARNATION: Final = 1

_T = TypeVar("_T")

deployed_as: ContextVar[str | None] = ContextVar("hfg.parts.deployed_as", default=None)
"""Name of this process's run, if an agent has started it."""


class AgentLauncher:
    """Starts parts through the agents of their hosts.

    Args:
      here: starts parts without a host, and opens the session.
      graph: the name of the graph, by which agents that serve one part of it are found.
    """

    shares_memory: bool
    is_in_realm = True

    def __init__(self, here: Launcher, graph: str = "") -> None:
        self.shares_memory = here.shares_memory
        self._graph = graph
        self._here = here
        self._session: Session | None = None
        self._realm: Realm | None = None

    @property
    def near(self) -> Session | None:
        """See `Launcher`."""
        return self._here.near

    async def open(self) -> Session:
        """See `Launcher`."""
        self._session = session = await self._here.open()
        self._realm = Realm(session)
        return session

    async def close(self) -> None:
        """See `Launcher`."""
        if self._realm is not None:
            self._realm.close()
        await self._here.close()

    # --- before anything begins -------------------------------------------------------------------------------------

    async def prepare(self, hosts: Mapping[str, str], modules: Mapping[str, str]) -> None:
        """See `Launcher`: all agents are asked at once, and all problems are reported."""
        abroad = sorted((host, part) for part, host in hosts.items() if host)
        if not abroad:
            return
        own = {module: path for module, path in modules.items() if _is_of_the_program(module)}
        found = await asyncio.gather(*(self._wrong_with(host, part, modules, own) for host, part in abroad))
        wrong = dict.fromkeys(sentence for sentences in found for sentence in sentences)  # an agent may serve several
        if wrong:
            raise TransportError("; and ".join(wrong))

    async def _wrong_with(self, host: str, part: str, modules: Mapping[str, str], own: Mapping[str, str]) -> list[str]:
        assert self._realm is not None
        try:
            agent = await self._realm.agent(host, part=(self._graph, part))
            if wrong := _versions(agent, myself("")):
                return [wrong]
            if own:
                module, path = next(iter(own.items()))
                return [
                    f'host "{host}" cannot import the type of "{path}", which is in the program itself '
                    f"({_in_words(module)}): move the node types into a module, and have that on all hosts"
                ]
            there = await self.ask(agent, requests.Check(sorted(modules)))
        except HfgError as error:
            return [str(error)]
        if not there.modules:
            return []
        first = there.modules[0]
        return [
            f'host "{host}" has no module {named(there.modules)}, which "{modules[first]}" needs: install '
            f"it for the Python of its agent, or put {first.replace('.', '/')}.py into {there.folder} there, "
            "the folder in which the agent was started"
        ]

    # --- a part -----------------------------------------------------------------------------------------------------

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Launched:
        """See `Launcher`: a first incarnation needs the agent to be there, any other waits for it."""
        if not host:
            return await self._here.launch(run, part, host, incarnations)
        assert self._realm is not None
        order = requests.Start(run, part, incarnations, sys.argv, logging.getLogger("hfg").getEffectiveLevel())
        is_first = incarnations[0] == _FIRST_INCARNATION
        while True:
            agent = await self._agent(part, host, FINDS_S if is_first else None)
            try:
                started = await self.ask(agent, order, timeout_s=_STARTS_S)
            except NoAnswer:
                if is_first:
                    raise
                await asyncio.sleep(_AGAIN_S)  # it has just gone, which will be reported soon
                continue
            return _RemotePart(self, agent, order, started.process)

    async def _agent(self, part: str, host: str, within_s: float | None) -> AgentIs:
        assert self._realm is not None
        if within_s is None and not self._realm.of(host, (self._graph, part)):
            _LOGGER.warning('group "%s" waits for the agent of host "%s" to be there again', part, host)
        return await self._realm.agent(host, within_s, (self._graph, part))

    def replaced(self, agent: AgentIs) -> bool:
        """Say whether another incarnation of an agent is there."""
        assert self._realm is not None
        return bool(self._realm.twins(agent))

    async def ask(self, agent: AgentIs, request: Request[_T], *, timeout_s: float = 5.0) -> _T:
        """Ask an agent.

        Raises:
          NoAnswer: it does not answer.
          TransportError: it refuses.
        """
        assert self._session is not None
        try:
            return await ask(self._session, agent_place(agent), request, timeout_s=timeout_s)
        except NoAnswer:
            raise NoAnswer(f'the agent of host "{agent.host}" does not answer; is it being ended?') from None
        except QueryRefused as error:
            raise TransportError(f'the agent of host "{agent.host}" refuses: {error}') from None


class _RemotePart:
    """A part that an agent has started."""

    def __init__(self, launcher: AgentLauncher, agent: AgentIs, order: requests.Start, process: int) -> None:
        self.process = process
        self._launcher = launcher
        self._agent = agent
        self._which = (order.run, order.part, order.incarnations[0])
        self._telling: asyncio.Task[requests.Done] | None = None

    async def wait(self) -> str:
        """See `Launched`.

        The agent is asked again and again, until it reports how the part has ended or is gone itself.
        """
        loop = asyncio.get_running_loop()
        silent_since: float | None = None
        while True:
            try:
                told = await self._launcher.ask(self._agent, requests.Wait(*self._which), timeout_s=WAITS_S + FINDS_S)
            except TransportError:
                silent_since = loop.time() if silent_since is None else silent_since
                if self._launcher.replaced(self._agent) or loop.time() - silent_since > GONE_S:
                    return f'the agent of host "{self._agent.host}" is gone'
                await asyncio.sleep(_AGAIN_S)
                continue
            silent_since = None
            if told.how:
                return told.how

    def begins(self) -> None:
        """See `Launched`."""
        self._telling = asyncio.create_task(self._launcher.ask(self._agent, requests.Begins(*self._which)))
        # its end is reported by `wait`
        self._telling.add_done_callback(lambda told: told.cancelled() or told.exception())

    async def end(self) -> None:
        """See `Launched`. An agent that cannot be reached ends the part by itself when it no longer sees the run."""
        if self._telling is not None:
            self._telling.cancel()
        with contextlib.suppress(TransportError):
            await self._launcher.ask(self._agent, requests.End(*self._which), timeout_s=_ENDS_S)


def _versions(there: AgentIs, here: AgentIs) -> str:
    """Say that an agent is of another version; "" if it is not."""
    if there.hfg != here.hfg:
        return (
            f'host "{there.host}" has hfg {there.hfg} (Python {there.python}), and here is hfg {here.hfg} '
            f"(Python {here.python}): install the same hfg on all hosts, and restart the agent"
        )
    if there.python.rpartition(".")[0] != here.python.rpartition(".")[0]:
        _LOGGER.warning('host "%s" has Python %s, and here is Python %s', there.host, there.python, here.python)
    return ""


def _is_of_the_program(module: str) -> bool:
    return module in ("__main__", "__hfg_main__") or module.startswith("hfg_target_")


def _in_words(module: str) -> str:
    file = getattr(sys.modules.get(module), "__file__", None)
    return str(file or module)
