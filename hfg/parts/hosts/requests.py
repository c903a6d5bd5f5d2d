"""Requests to agents and runs, and the answers to them: data of declared types (rule L4).

The name of a verb that starts with "ro" only reads, so viewers may use it; one with "rw" changes something. Depends on
the contract of transports.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, ClassVar, Generic, TypeVar, get_args

import msgspec

from hfg.base.controls import cleaned
from hfg.errors import TransportError, UsageError
from hfg.transport import Closing, Session

Answer = TypeVar("Answer")


class Request(msgspec.Struct, Generic[Answer], frozen=True):
    """A request; the type argument is the type of its answer.

    Attributes:
      verb: its name.
    """

    verb: ClassVar[str]


# --- answers ---


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


class Missing(msgspec.Struct, frozen=True):
    """The missing modules, and the folder in which the agent looks for modules."""

    modules: list[str]
    folder: str


class Started(msgspec.Struct, frozen=True):
    """It has started, as this process."""

    process: int


class Gone(msgspec.Struct, frozen=True):
    """How it has ended; "" if it is still there."""

    how: str


class Chunk(msgspec.Struct, frozen=True):
    """Whole lines, and the offset after them."""

    text: str
    offset: int


class Done(msgspec.Struct, frozen=True):
    """The request was executed."""


class PartsAre(msgspec.Struct, frozen=True):
    """The parts, the main part first."""

    parts: list[PartIs]


class Seen(msgspec.Struct, frozen=True):
    """The answer to `Look`."""

    answer: bytes


# --- what an agent is asked ---


class Check(Request[Missing], frozen=True):
    """Which of these modules cannot be imported?"""

    verb: ClassVar[str] = "rw/check"
    modules: list[str]


class Start(Request[Started], frozen=True):
    """Start a part. A repeated request starts it only once.

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


class Deploy(Request[Started], frozen=True):
    """Run a graph: start its main part.

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


class _OfAPart(Request[Answer], Generic[Answer], frozen=True):
    """A verb for one incarnation of a part of a run."""

    run: str
    part: str
    incarnation: int


class Begins(_OfAPart[Done], frozen=True):
    """The nodes of a part are let go: it may be expected to answer from now on."""

    verb: ClassVar[str] = "rw/begins"


class Wait(_OfAPart[Gone], frozen=True):
    """Wait until a part is gone, for a limited time."""

    verb: ClassVar[str] = "rw/wait"


class End(_OfAPart[Done], frozen=True):
    """See to it that a part is gone."""

    verb: ClassVar[str] = "rw/end"


class ReadLog(Request[Chunk], frozen=True):
    """The output of a run's parts on this host, from some byte on."""

    verb: ClassVar[str] = "ro/log"
    run: str
    offset: int


# --- what a run is asked ---


class Parts(Request[PartsAre], frozen=True):
    """Which parts does the run have?"""

    verb: ClassVar[str] = "ro/parts"


class Look(Request[Seen], frozen=True):
    """The request that `hfg top` sends through a socket."""

    verb: ClassVar[str] = "ro/look"
    question: bytes


class Stop(Request[Done], frozen=True):
    """End the run normally."""

    verb: ClassVar[str] = "rw/stop"


class Restart(Request[Done], frozen=True):
    """End the process of a part and start another. The answer comes when that is in progress."""

    verb: ClassVar[str] = "rw/restart"
    part: str


# --- asking and answering ---


async def ask(session: Session, place: str, request: Request[Answer], *, timeout_s: float = 5.0) -> Answer:
    """Ask an agent or a run.

    Raises:
      NoAnswer: there is no answer, or not in time.
      QueryRefused: it refuses; with its message.
    """
    told = await session.ask(f"{place}/{request.verb}", msgspec.msgpack.encode(request), timeout_s=timeout_s)
    try:
        answer: Answer = cleaned(msgspec.msgpack.decode(told, type=_type_of_answer(request)))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise TransportError(f'"{place}" answers what this version of hfg cannot read: {error}') from None
    return answer


def _type_of_answer(request: Request[Any]) -> Any:
    base: Any = type(request).__orig_bases__[0]  # type: ignore[attr-defined]
    return get_args(base)[0]


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
