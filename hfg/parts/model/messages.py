"""The messages between parts of a run other than tokens, in order and without loss, and their encoding.

    Whole -> part     Open, TellTime, Begin, Question, Reborn, Kept, Finish, Call, Close
    Part  -> whole    AskTime, Opened, Rest, Answer, Keep, Ended, Result, Seen, Logged, Closed
    Part  -> part     Speaks, Hears, Joins, GoesOn, Shares, Sees

All of it is data of declared types (rule L4). Depends on `agreement` and the trace.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, TypeAlias, Union

import msgspec

from hfg.engine.observing.report import EdgeReport, NodeReport
from hfg.engine.runtime.borders import Hearing
from hfg.monitors.violations import Point
from hfg.parts.model.agreement import Answer, Counted, Question, Rest
from hfg.parts.model.clocks import RunClock
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    CallEnded,
    CallStarted,
    DoEnded,
    DoStarted,
    EditWaits,
    ErrorRaised,
    FiringEnded,
    FiringRetried,
    FiringStarted,
    NodeEnabled,
    NodeEnded,
    QueueGrown,
    RunEnded,
    RunPaused,
    RunResumed,
    RunStarted,
    StructureChanged,
    TokenProcessed,
)
from hfg.transport import Buffer

Outcome: TypeAlias = Annotated[str, msgspec.Meta(pattern="^(done|failed|stalled|stopped|aborted|cancelled|until)$")]
"""How a run ends; see `Report`."""

Stream: TypeAlias = Annotated[int, msgspec.Meta(ge=-1, le=2**62)]
"""The stream of a position, which may be that of `UNKNOWN`."""

Label: TypeAlias = Annotated[str, msgspec.Meta(max_length=4096)]


class Message(msgspec.Struct, frozen=True, tag=True):
    """A message to another part."""


class OfAnEdge(Message, frozen=True):
    """A message between the two ends of an edge between parts.

    Attributes:
      label: label of the edge.
    """

    label: Label


class Untrue(Exception):
    """A message of a part that is valid but cannot be true; it changed nothing.

    Its text continues the words 'it was told that', as in 'an edge is ... that has no end there'.
    """


class Failed(msgspec.Struct, frozen=True):
    """An error in a part, as far as it can be sent to another.

    Attributes:
      kind: the class of the error in `hfg.errors`.
      text: its message.
      path: path of the node, if one failed, or "".
      what: where it failed.
      trace: the user's frames, as text.
    """

    kind: str
    text: str
    path: str = ""
    what: str = ""
    trace: str = ""


class Open(Message, frozen=True):
    """Make the part and set it up.

    Attributes:
      graph: the text of a graph file: the whole graph, of which it makes its part.
      options: of the run, as `hfg.run` takes them.
      incarnations: which incarnation of each part this is for.
      clock: of the run.
      allow: packages whose node types may be imported.
      shares_memory: large arrays may go through shared memory.
      calls: what was asked for already, to be done before the nodes are set up.
      kept: what the ledger has of previous incarnations of the part.
    """

    graph: str
    options: dict[str, Any]
    incarnations: dict[str, int]
    clock: RunClock
    allow: list[str]
    shares_memory: bool = False
    calls: list[Call] = []
    kept: bytes | None = None


class Opened(Message, frozen=True):
    """Setup of the part's nodes has finished, or failed."""

    part: str
    failed: Failed | None = None


class AskTime(Message, frozen=True):
    """Request for the time on the monotonic clock; `asked` is returned with the answer."""

    asked: float


class TellTime(Message, frozen=True):
    """The answer."""

    asked: float
    told: float


class Keep(Message, frozen=True):
    """Request to store the state of a part.

    Attributes:
      number: counts the requests of this incarnation.
      data: see `keeping`.
    """

    number: int
    data: bytes


class Kept(Message, frozen=True):
    """The state is stored: its consequences may be sent to others."""

    number: int


class Begin(Message, frozen=True):
    """All parts are set up: start."""


class Ask(Message, frozen=True):
    """Something that follows from quiet."""

    question: Question


class Told(Message, frozen=True):
    """The answer of a part to it."""

    answer: Answer


class Rests(Message, frozen=True):
    """Nothing moves in a part."""

    rest: Rest


class Finish(Message, frozen=True):
    """The run is over."""

    outcome: Outcome


class Ended(Message, frozen=True):
    """The run is over in a part."""

    part: str
    outcome: Outcome
    failed: Failed | None = None


class Call(Message, frozen=True):
    """A request from outside to the part.

    Attributes:
      number: number of the call; the result of number 0 is ignored.
      verb: a method of `serving`.
      arguments: by name.
    """

    number: int
    verb: str
    arguments: dict[str, Any]


class Result(Message, frozen=True):
    """The result of a call."""

    number: int
    value: Any = None
    failed: Failed | None = None


class Parcel(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """A token as links carry it.

    Attributes:
      metadata, value: of `TokenCodec`.
      shown: text in place of the value, where that is only looked at and cannot be encoded.
    """

    metadata: bytes
    value: bytes
    shown: str | None = None


class Passed(msgspec.Struct, frozen=True, tag=True, gc=False):
    """An event of the trace that has a value in it.

    Attributes:
      time: see `TraceEvent`.
      kind: which event.
      place: an edge, an event or a node.
      parcel: the token.
      detail: why it was dropped; the name of the parameter.
    """

    time: float
    kind: Literal["sent", "taken", "dropped", "drained", "triggered", "set"]
    place: str
    parcel: Parcel
    detail: str = ""


PlainEvent: TypeAlias = (
    ActivityChanged
    | ActivityLost
    | CallEnded
    | CallStarted
    | DoEnded
    | DoStarted
    | EditWaits
    | ErrorRaised
    | FiringEnded
    | FiringRetried
    | FiringStarted
    | NodeEnabled
    | NodeEnded
    | QueueGrown
    | RunEnded
    | RunPaused
    | RunResumed
    | RunStarted
    | StructureChanged
    | TokenProcessed
)
"""An event of the trace that is data as it is."""

Sight: TypeAlias = PlainEvent | Passed


class Seen(Message, frozen=True):
    """Observed events or tokens, in order.

    Attributes:
      number: number of the call that asked for them.
      events: events of the trace.
      tokens: tokens at a tap or a breakpoint.
      count: how many have passed there so far, including skipped ones.
      points: what a monitor hears.
    """

    number: int
    events: list[Sight] = []
    tokens: list[Parcel] = []
    count: Counted = 0
    points: list[Point] = []


class Close(Message, frozen=True):
    """Tear down, report, and go."""


class Closed(Message, frozen=True):
    """The part is torn down.

    Attributes:
      part: its name.
      nodes: what its nodes have done, by path.
      edges: what was on its edges, by label; those to other parts have a half on each side.
      errors: failures that did not end the run.
      lost_activity: see `Report`.
      failed: what its teardown failed with.
      clock_within_s: by how much its clock differs from the run's at most; 0 where it is the same.
    """

    part: str
    nodes: dict[str, NodeReport]
    edges: dict[str, EdgeReport]
    errors: list[str]
    lost_activity: int
    failed: Failed | None = None
    clock_within_s: float = 0.0


class Speaks(OfAnEdge, frozen=True):
    """The producer of an edge is enabled or disabled from now on, after so many tokens."""

    speaking: bool
    total: Counted


class Hears(OfAnEdge, frozen=True):
    """How the consumer of an edge handles tokens from now on, having taken so many."""

    hearing: Hearing
    total: Counted


class Reborn(Message, frozen=True):
    """A part has died and is restarted: from now on this incarnation is trusted."""

    part: str
    incarnation: Counted


class Joins(OfAnEdge, frozen=True):
    """Where a restarted part resumes an edge, reported by the older incarnation at the other end.

    Attributes:
      total: from the producer: how many tokens are processed; from the consumer: how many have arrived.
      stream, number: the position of the last of them; or `UNKNOWN`.
      hearing: how the consumer handles tokens.
      ended: END was sent and has arrived; if reported by the producer, it is not included in the count.
    """

    total: Counted
    stream: Stream
    number: Counted
    hearing: Hearing = "open"
    ended: bool = False


class GoesOn(OfAnEdge, frozen=True):
    """The position after which a restarted producer resumes, once it is known.

    Attributes:
      stream, number: the position of the last processed token.
    """

    stream: Stream
    number: Counted


class Logged(Message, frozen=True):
    """A log record of a part, for the loggers of the main program.

    Attributes:
      logger: its name.
      level: level of the record.
      text: the whole message, with the trace of an exception if there is one.
      path: path of the node that logged it, or "".
      created: when, in seconds since 1970.
      file, line, function: where in the code.
    """

    logger: Annotated[str, msgspec.Meta(max_length=500)]
    level: Annotated[int, msgspec.Meta(ge=0, le=1000)]
    text: str
    path: str
    created: float
    file: str
    line: int
    function: str


class Shares(OfAnEdge, frozen=True):
    """Large arrays on an edge will be in shared memory, once its consumer has opened that.

    Attributes:
      segment: what the memory is called.
      lane: the number under which this incarnation of the consumer opens it.
    """

    segment: str
    lane: int


class Sees(OfAnEdge, frozen=True):
    """The consumer of an edge has opened it.

    Attributes:
      segment, lane: as they were offered.
      refused: why it could not; "" if it has.
    """

    segment: str
    lane: int
    refused: str = ""


pack: Final = msgspec.msgpack.Encoder().encode
"""Returns a message as bytes."""

KINDS: Final[tuple[type[Message], ...]] = tuple(
    kind for base in (Message, OfAnEdge) for kind in base.__subclasses__() if kind is not OfAnEdge
)
"""All kinds of messages."""

_decoder: Final[msgspec.msgpack.Decoder[Message]] = msgspec.msgpack.Decoder(Union[KINDS])  # noqa: UP007


def unpack(data: Buffer) -> Message | None:
    """Return the message in some bytes; None if they are not a message, however deeply nested or malformed."""
    try:
        return _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
