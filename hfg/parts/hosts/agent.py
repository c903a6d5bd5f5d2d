"""An agent: starts parts of runs on its host on request, and ends those whose run is gone (rules L2, X3).

It makes no decisions about a run. The main part decides whether a part that has died is restarted, and requests its
next incarnation; the agent ensures that the previous one is gone by then. The owner of the host starts and stops the
agent, and everything that it has started ends with it. Depends on `realm`; `hosting` starts the processes.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any, Final, Protocol, TypeAlias

import msgspec

from hfg.base.logs import Log
from hfg.errors import HfgError, TransportError, UsageError, in_words
from hfg.parts.hosts import requests
from hfg.parts.hosts.realm import GONE_S, AgentIs, Realm, agent_place, myself, run_id, run_place
from hfg.parts.hosts.requests import serve
from hfg.parts.processes.peer_process import Launched
from hfg.transport import Closing, Session

_LOGGER = Log("hfg.agent")

WAITS_S: Final = 10.0
"""How long a question for the end of a part is kept; it is asked again then."""

_LOOKS_S: Final = 0.5  # time to look for another agent of the same name before announcing this one
_MAIN: Final = ""
Order: TypeAlias = requests.Start | requests.Deploy
_FIRST_INCARNATION: Final = 1


class Computer(Protocol):
    """The agent's interface to the computer that it runs on."""

    async def part(self, order: requests.Start) -> Launched:
        """Start a part.

        Raises:
          HfgError: it cannot be started.
        """

    async def main(self, order: requests.Deploy) -> Launched:
        """Begin the main part of a run."""

    def missing(self, modules: list[str]) -> requests.Missing:
        """Return the modules that cannot be imported."""

    def read_log(self, run: str, offset: int) -> requests.Chunk:
        """Return output of the parts of a run."""

    def forget(self, run: str) -> None:
        """No part of a run is here any more: nothing of it is to be left."""

    async def close(self) -> None:
        """Refuse to start anything from now on."""


class _Incarnation:
    """One incarnation of a part of a run.

    Attributes:
      incarnation: its number.
      begun: done when it has a process.
      gone: done when it has ended; how it ended.
    """

    def __init__(self, incarnation: int) -> None:
        loop = asyncio.get_running_loop()
        self.incarnation = incarnation
        self.begun: asyncio.Future[Launched] = loop.create_future()
        self.gone: asyncio.Future[str] = loop.create_future()
        self.task: asyncio.Task[None]

    @property
    def is_there(self) -> bool:
        """Whether it has a process."""
        return self.begun.done() and self.begun.exception() is None and not self.gone.done()

    async def end(self) -> None:
        """See to it that it is gone."""
        with contextlib.suppress(HfgError):
            hosted = await asyncio.shield(self.begun)
            await hosted.end()
        await asyncio.shield(self.gone)


class Agent:
    """The agent of a host.

    Attributes:
      me: its description of itself.
    """

    def __init__(self, session: Session, computer: Computer, me: AgentIs | None = None) -> None:
        """Prepare it.

        Args:
          session: of the transport, on which parts of runs find each other.
          computer: the computer that it runs on.
          me: its description; by default, it serves all parts of the session's host.
        """
        self.me: AgentIs = me or myself(session.host)
        self._session = session
        self._computer = computer
        self._charges: dict[tuple[str, str], _Incarnation] = {}
        self._leaving: dict[str, asyncio.TimerHandle] = {}  # runs of which nothing is heard
        self._tasks: set[asyncio.Task[None]] = set()
        self._answers: list[Closing] = []
        self._announced: Closing | None = None
        self._realm: Realm | None = None
        self._is_closing = False
        self._warned = False

    # --- being there ------------------------------------------------------------------------------------------------

    async def open(self) -> None:
        """Look for other agents, then announce this one.

        Raises:
          TransportError: another agent has the name.
        """
        name, session = self.me.host, self._session
        self._realm = realm = Realm(session)
        if await realm.until(lambda: realm.twins(self.me), _LOOKS_S):
            other = realm.twins(self.me)[0]
            if self.me.serves is not None:
                raise TransportError(f"another program (process {other.process} of its host) serves this part already")
            raise TransportError(
                f'another agent is already named "{name}" (process {other.process} of its host): stop that '
                'one, or give this one another name by host = "..." in its settings'
            )
        self._answers = serve(
            session,
            agent_place(self.me),
            {
                requests.Check: self._check,
                requests.Start: self._start,
                **({} if self.me.serves else {requests.Deploy: self.deploy}),
                requests.Begins: self._begins,
                requests.Wait: self.wait,
                requests.End: self._end,
                requests.ReadLog: self._read_log,
            },
        )
        self._announced = session.announce(agent_place(self.me), msgspec.msgpack.encode(self.me))
        self._spawn(self._look_after_runs(realm))

    async def _look_after_runs(self, realm: Realm) -> None:
        """Check the runs whenever a program comes or goes."""
        while True:
            for run in {run for run, part in self._charges if part != _MAIN}:
                self._look_at(run)
            twins = realm.twins(self.me)
            if twins and not self._warned:
                self._warned = True
                _LOGGER.warning(
                    'another agent is also named "%s" (process %d of its host), so neither gets parts of '
                    "runs: stop one of the two, or give it another name",
                    self.me.host,
                    twins[0].process,
                )
            await realm.change()

    def _look_at(self, run: str) -> None:
        """Start the timeout of a run that is absent; stop it if the run is present."""
        assert self._realm is not None
        if run_place(run) in self._realm.runs:
            leaving = self._leaving.pop(run, None)
            if leaving is not None:
                leaving.cancel()
        elif run not in self._leaving:
            loop = asyncio.get_running_loop()
            self._leaving[run] = loop.call_later(GONE_S, lambda: self._spawn(self._abandon(run)))

    async def _abandon(self, run: str) -> None:
        """The main part of a run is gone: so are the others."""
        self._leaving.pop(run, None)
        parts = [(key, charge) for key, charge in self._charges.items() if key[0] == run and key[1] != _MAIN]
        if parts:
            _LOGGER.warning("run %s is not heard of any more: its parts are ended", run_id(run))
        await asyncio.gather(*(self._let_go(key, charge) for key, charge in parts))

    async def close(self) -> None:
        """End everything that was started here, and withdraw the announcement."""
        self._is_closing = True
        if self._announced is not None:
            self._announced.close()
        mains = [(key, charge) for key, charge in self._charges.items() if key[1] == _MAIN]
        await asyncio.gather(*(self._let_go(key, charge) for key, charge in mains))  # they ask for the end of others
        await asyncio.gather(*(self._let_go(key, charge) for key, charge in list(self._charges.items())))
        await self._computer.close()
        for timer in self._leaving.values():
            timer.cancel()
        for answer in self._answers:
            answer.close()
        if self._realm is not None:
            self._realm.close()
        for task in self._tasks:
            task.cancel()

    def _spawn(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work, name="hfg agent")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # --- what it is asked -------------------------------------------------------------------------------------------

    async def _check(self, request: requests.Check) -> requests.Missing:
        return self._computer.missing(request.modules)

    async def _start(self, order: requests.Start) -> requests.Started:
        if self.me.serves is not None and order.part != self.me.serves[1]:
            raise UsageError(f'here is only group "{self.me.serves[1]}", not group "{order.part}"')
        return await self._take((order.run, order.part), order.incarnations[0], order)

    async def deploy(self, order: requests.Deploy) -> requests.Started:
        """Start the main part of a run."""
        return await self._take((order.run, _MAIN), _FIRST_INCARNATION, order)

    async def _take(self, key: tuple[str, str], incarnation: int, order: Order) -> requests.Started:
        if self._is_closing:
            raise UsageError(f'the agent of host "{self.me.host}" is being ended')
        charge = self._charges.get(key)
        if charge is None or charge.incarnation < incarnation:
            former, charge = charge, _Incarnation(incarnation)
            self._charges[key] = charge
            charge.task = asyncio.create_task(self._run(charge, former, key, order), name=f"hfg part {key[1]}")
            if isinstance(order, requests.Start):
                self._look_at(key[0])
        elif charge.incarnation > incarnation:
            raise UsageError(f'incarnation {incarnation} of group "{key[1]}" is over: {charge.incarnation} has started')
        return requests.Started((await asyncio.shield(charge.begun)).process)

    async def _run(
        self,
        charge: _Incarnation,
        former: _Incarnation | None,
        key: tuple[str, str],
        order: Order,
    ) -> None:
        """Run one incarnation: wait for the end of the previous one, start it, and wait for its end."""
        try:
            if former is not None:
                await former.end()
            if isinstance(order, requests.Deploy):
                hosted = await self._computer.main(order)
            else:
                hosted = await self._computer.part(order)
        except Exception as error:
            known = error if isinstance(error, HfgError) else TransportError(f"it cannot be started: {in_words(error)}")
            charge.begun.set_exception(known)
            charge.begun.exception()  # possibly nothing awaits it any more
            charge.gone.set_result(str(known))
            return
        charge.begun.set_result(hosted)
        _LOGGER.info("run %s, %s: process %d", run_id(key[0]), key[1] or "main part", hosted.process)
        how = await hosted.wait()
        charge.gone.set_result(f'{how} on host "{self.me.host}"')
        if key[1] == _MAIN:
            self._charges.pop(key, None)
            self._done_with(key[0])

    def _of(self, request: requests.Begins | requests.Wait | requests.End) -> _Incarnation | None:
        charge = self._charges.get((request.run, request.part))
        return charge if charge is not None and charge.incarnation == request.incarnation else None

    async def _begins(self, request: requests.Begins) -> requests.Done:
        charge = self._of(request)
        if charge is not None and charge.begun.done() and charge.begun.exception() is None:
            charge.begun.result().begins()
        return requests.Done()

    def hosts(self, part: str) -> str:
        """Return the name of the run whose part has a process here; "" if none has."""
        return next((run for (run, name), charge in self._charges.items() if name == part and charge.is_there), "")

    async def wait(self, request: requests.Wait) -> requests.Gone:
        """Wait a limited time until a part is gone."""
        charge = self._of(request)
        if charge is None:
            return requests.Gone(f'the agent of host "{self.me.host}" has no process of it')
        await asyncio.wait({charge.gone}, timeout=WAITS_S)
        return requests.Gone(charge.gone.result() if charge.gone.done() else "")

    async def _end(self, request: requests.End) -> requests.Done:
        charge = self._of(request)
        if charge is not None:
            await self._let_go((request.run, request.part), charge)
        return requests.Done()

    async def _let_go(self, key: tuple[str, str], charge: _Incarnation) -> None:
        await charge.end()
        if self._charges.get(key) is charge:
            del self._charges[key]
            self._done_with(key[0])

    def _done_with(self, run: str) -> None:
        if not any(key[0] == run for key in self._charges):
            leaving = self._leaving.pop(run, None)
            if leaving is not None:
                leaving.cancel()
            self._computer.forget(run)

    async def _read_log(self, request: requests.ReadLog) -> requests.Chunk:
        return self._computer.read_log(request.run, request.offset)
