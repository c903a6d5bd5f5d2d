"""The agents and runs in a realm, and requests to them.

An agent announces `agents/<host>/<incarnation>`, the main part of a run `runs/<run>`, each with a description of
itself. They answer questions at names below these: names that start with "ro" only read, so viewers may use them; those
with "rw" change something. Questions and answers are data of declared types (rule L4). Depends on the contract of
transports.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.metadata
import os
import platform
import uuid
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, ClassVar, Final, TypeVar

import msgspec

from hfg.base.controls import cleaned
from hfg.base.logs import Log
from hfg.errors import TransportError, UsageError
from hfg.transport import Closing, Presence, Session

__all__ = [
    "AGENTS",
    "FINDS_S",
    "GONE_S",
    "RUNS",
    "AgentIs",
    "Begins",
    "Check",
    "Chunk",
    "Deploy",
    "Done",
    "End",
    "Gone",
    "Look",
    "Missing",
    "PartIs",
    "Parts",
    "PartsAre",
    "ReadLog",
    "Realm",
    "Restart",
    "RunIs",
    "Seen",
    "Start",
    "Started",
    "Stop",
    "Wait",
    "agent_place",
    "ask",
    "myself",
    "named",
    "run_id",
    "run_place",
    "serve",
]

_LOGGER = Log("hfg.parts")

AGENTS: Final = "agents"
RUNS: Final = "runs"

FINDS_S: Final = 3.0
"""How long it may take to find a program that is present."""

GONE_S: Final = 5.0
"""For how long agents and runs wait for each other when a connection is away; then the other counts as gone."""

_T = TypeVar("_T")


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
    """

    host: str
    incarnation: str
    process: int
    hfg: str
    python: str


def myself(host: str) -> AgentIs:
    """Return the description of an agent in this process."""
    return AgentIs(
        host, uuid.uuid4().hex[:12], os.getpid(), importlib.metadata.version("hfg"), platform.python_version()
    )


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


class PartIs(msgspec.Struct, frozen=True):
    """The main part's information about a part.

    Attributes:
      group: its name; "" is the main part.
      host, process: where it runs.
      state: "starting", "running", "returning" (it has died, and will be restarted).
      restarts: how often it was restarted.
      up_s: age of its process in seconds.
    """

    group: str
    host: str
    process: int
    state: str
    restarts: int
    up_s: float


# --- what an agent is asked ---


class Check(msgspec.Struct, frozen=True):
    """Which of these modules cannot be imported? -> Missing."""

    verb: ClassVar[str] = "rw/check"
    modules: list[str]


class Missing(msgspec.Struct, frozen=True):
    """The missing modules, and the folder in which the agent looks for modules."""

    modules: list[str]
    folder: str


class Start(msgspec.Struct, frozen=True):
    """Start a part -> Started. A repeated request starts it only once.

    Attributes:
      run, part: names of both.
      incarnations: its incarnation, and that of the main part.
      argv: arguments of the main program.
      level: level of the log records that it wants.
    """

    verb: ClassVar[str] = "rw/start"
    run: str
    part: str
    incarnations: tuple[int, int]
    argv: list[str]
    level: int


class Deploy(msgspec.Struct, frozen=True):
    """Run a graph: start its main part -> Started.

    Attributes:
      run: its name.
      target: the graph.
      arguments: arguments of `hfg run`.
      folder: folder of the target; "": the folder in which the agent was started.
    """

    verb: ClassVar[str] = "rw/deploy"
    run: str
    target: str
    arguments: list[str]
    folder: str


class Started(msgspec.Struct, frozen=True):
    """It has started, as this process."""

    process: int


class _OfAPart(msgspec.Struct, frozen=True):
    """A verb for one incarnation of a part of a run."""

    run: str
    part: str
    incarnation: int


class Begins(_OfAPart, frozen=True):
    """The nodes of a part are let go: it may be expected to answer from now on -> Done."""

    verb: ClassVar[str] = "rw/begins"


class Wait(_OfAPart, frozen=True):
    """Wait until a part is gone, for a limited time -> Gone."""

    verb: ClassVar[str] = "rw/wait"


class Gone(msgspec.Struct, frozen=True):
    """How it has ended; "" if it is still there."""

    how: str


class End(_OfAPart, frozen=True):
    """See to it that a part is gone -> Done."""

    verb: ClassVar[str] = "rw/end"


class ReadLog(msgspec.Struct, frozen=True):
    """The output of a run's parts on this host, from some byte on -> Chunk."""

    verb: ClassVar[str] = "ro/log"
    run: str
    offset: int


class Chunk(msgspec.Struct, frozen=True):
    """Whole lines, and the offset after them."""

    text: str
    offset: int


class Done(msgspec.Struct, frozen=True):
    """The request was executed."""


# --- what a run is asked ---


class Parts(msgspec.Struct, frozen=True):
    """Which parts have you -> PartsAre."""

    verb: ClassVar[str] = "ro/parts"


class PartsAre(msgspec.Struct, frozen=True):
    """They, the main part first."""

    parts: list[PartIs]


class Look(msgspec.Struct, frozen=True):
    """The request that `hfg top` sends through a socket -> Seen."""

    verb: ClassVar[str] = "ro/look"
    question: bytes


class Seen(msgspec.Struct, frozen=True):
    """The answer to it."""

    answer: bytes


class Stop(msgspec.Struct, frozen=True):
    """End well -> Done."""

    verb: ClassVar[str] = "rw/stop"


class Restart(msgspec.Struct, frozen=True):
    """End the process of a part and start another -> Done, when that is in progress."""

    verb: ClassVar[str] = "rw/restart"
    part: str


# --- asking and answering ---


async def ask(session: Session, place: str, request: Any, answer: type[_T], *, timeout_s: float = 5.0) -> _T:
    """Ask an agent or a run.

    Raises:
      NoAnswer: there is no answer, or not in time.
      QueryRefused: it refuses; with its message.
    """
    told = await session.ask(f"{place}/{request.verb}", msgspec.msgpack.encode(request), timeout_s=timeout_s)
    try:
        return cleaned(msgspec.msgpack.decode(told, type=answer))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise TransportError(f'"{place}" answers what this version of hfg cannot read: {error}') from None


def serve(session: Session, place: str, answers: Mapping[Any, Callable[[Any], Awaitable[Any]]]) -> list[Closing]:
    """Answer questions, each by its type."""

    def answering(kind: type, answer: Callable[[Any], Awaitable[Any]]) -> Callable[[bytes], Awaitable[bytes]]:
        async def reply(question: bytes) -> bytes:
            try:
                request: Any = msgspec.msgpack.decode(question, type=kind)
            except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
                raise UsageError(f"the question cannot be understood: {error}") from None
            return msgspec.msgpack.encode(await answer(request))

        return reply

    return [session.answer(f"{place}/{kind.verb}", answering(kind, answer)) for kind, answer in answers.items()]


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

    def of(self, host: str) -> list[AgentIs]:
        """Return the agents with a name; normally one."""
        return [agent for agent in self.agents.values() if agent.host == host]

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

    async def agent(self, host: str, within_s: float | None = FINDS_S) -> AgentIs:
        """Find the agent of a host.

        Raises:
          TransportError: there is none, or more than one.
        """
        await self.until(lambda: self.of(host), within_s)
        found = self.of(host)
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
