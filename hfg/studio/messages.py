"""What a page and the studio say to each other, version 1: JSON with the tag `t`.

A message with an `id` gets exactly one of `Ack`, `Reject` and `Answer`. Depends on msgspec and errors.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any, Final, Literal, TypeAlias

import msgspec
from msgspec import Meta

from hfg.engine.observing.encoding import encode as encode_anything
from hfg.errors import UsageError

__all__ = [
    "HEADER",
    "LONGEST",
    "SUBPROTOCOL",
    "VERSION",
    "Ack",
    "Act",
    "Answer",
    "Arrange",
    "Ask",
    "Break",
    "Condition",
    "Data",
    "Edit",
    "FromPage",
    "Gone",
    "Hello",
    "Join",
    "Journal",
    "Level",
    "Open",
    "Painted",
    "Patch",
    "Pause",
    "Proceed",
    "Redo",
    "Reject",
    "Reload",
    "Request",
    "Reread",
    "Reset",
    "Save",
    "Seek",
    "Snapshot",
    "Start",
    "Step",
    "Stop",
    "Subscribe",
    "Trigger",
    "Unbreak",
    "Undo",
    "Unsubscribe",
    "Visible",
    "encode",
    "read",
]

VERSION: Final = 1
SUBPROTOCOL: Final = "hfg.studio.v1"
LONGEST: Final = 4 << 20
"""Bytes of one message."""

HEADER: Final = struct.Struct("<BBHId")
"""In front of a binary frame: kind, flags, subscription, number of the frame, seconds on the run's clock."""

Number = Annotated[int, Meta(ge=0, le=2**53)]
Sub = Annotated[int, Meta(ge=1, le=0xFFFF)]
Text = Annotated[str, Meta(max_length=4096)]


# --- from the page ---


class _Message(msgspec.Struct, frozen=True, tag=True, tag_field="t", forbid_unknown_fields=True):
    """Something that a page says."""


class Join(_Message, frozen=True, tag="join"):
    """The first message: the page has nothing yet, or the state of a revision of this very studio."""

    boot: Text = ""
    rev: int = -1
    name: Text = ""


class Request(_Message, frozen=True):
    """A message that is answered."""

    id: Number


class Edit(Request, frozen=True, tag="edit"):
    """Carry commands out, all or none; edits of one gesture in a row are one step of the history."""

    commands: msgspec.Raw
    gesture: Text = ""


class Undo(Request, frozen=True, tag="undo"):
    """Take the last edit back, whoever made it."""


class Redo(Request, frozen=True, tag="redo"):
    """Carry out again what was undone last."""


class Start(Request, frozen=True, tag="start"):
    """Let the graph run; with `stay` it continues when it is quiet."""

    stay: bool = False


class Stop(Request, frozen=True, tag="stop"):
    """End the run."""


class Pause(Request, frozen=True, tag="pause"):
    """Start no new firing (R3)."""


class Proceed(Request, frozen=True, tag="proceed"):
    """Go on after a pause."""


class Reset(Request, frozen=True, tag="reset"):
    """Deactivate all nodes and trigger `start` again (A14)."""


class Step(Request, frozen=True, tag="step"):
    """One step of a node, or of all; only in a recording also back."""

    path: Text = ""
    back: bool = False


class Seek(Request, frozen=True, tag="seek"):
    """Show a recording as the run was at a time, in seconds after its begin."""

    at: float


class Trigger(Request, frozen=True, tag="trigger"):
    """Send a signal into a slot, or trigger an event."""

    path: Text
    value: Any = None
    activity: int | None = None


class Condition(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When a breakpoint holds: how what was sent, or a part of it ("pose.x", "0"), compares with a value."""

    op: Literal["==", "!=", "<", "<=", ">", ">=", "contains"]
    value: Any = None
    field: Text = ""


class Act(Request, frozen=True, tag="act"):
    """Carry out an action that a node offers (`hfg.panels`); what is not given is as the action suggests."""

    path: Text
    name: Text
    args: dict[str, Any] = {}


class Break(Request, frozen=True, tag="break"):
    """Pause whenever the run comes to a node, port or edge."""

    path: Text
    condition: Condition | None = None


class Unbreak(Request, frozen=True, tag="unbreak"):
    """Pause there no more."""

    path: Text


class Arrange(Request, frozen=True, tag="arrange"):
    """Let the layout place nodes of a level: the positions that users gave them are removed."""

    level: Text = ""
    paths: list[Text] | None = None


class Level(_Message, frozen=True, tag="level"):
    """The page shows a level, or no more; `deep` shows what is inside of its subgraphs, too."""

    path: Text
    open: bool = True
    view: Literal["", "activity", "mission", "all"] = ""
    deep: bool = False


class Ask(Request, frozen=True, tag="ask"):
    """Ask for something once; `asking` says what can be asked, and what the answer is."""

    what: Text
    args: dict[str, Any] = {}


class Subscribe(_Message, frozen=True, tag="sub"):
    """Send a topic from now on; the same number again takes the place of what it stood for."""

    sub: Sub
    topic: Text
    hz: Annotated[float, Meta(gt=0, le=60)] = 10.0
    args: dict[str, Any] = {}


class Unsubscribe(_Message, frozen=True, tag="unsub"):
    """Send it no more."""

    sub: Sub


class Painted(_Message, frozen=True, tag="painted"):
    """A frame is on the screen: the page can take another."""

    sub: Sub
    seq: Number


class Visible(_Message, frozen=True, tag="visible"):
    """Whether the page can be seen, or is in a hidden tab."""

    on: bool


class Open(Request, frozen=True, tag="open"):
    """Take another file of the folder, or a graph of `starters`; `discard` gives unsaved edits up."""

    path: Text = ""
    discard: bool = False
    starter: Text = ""


class Save(Request, frozen=True, tag="save"):
    """Write the file, or another one; `force` overwrites changes by another program."""

    path: Text = ""
    force: bool = False


class Journal(Request, frozen=True, tag="journal"):
    """Take up the edits that were not saved when the studio ended, or drop them."""

    take: bool


class Reread(Request, frozen=True, tag="reread"):
    """Take the file as it is on the disk, and give up what is not saved."""


class Reload(Request, frozen=True, tag="reload"):
    """Reload a changed module, and replace the nodes whose types it defines."""

    module: Text


FromPage: TypeAlias = (
    Join
    | Edit
    | Undo
    | Redo
    | Start
    | Stop
    | Pause
    | Proceed
    | Reset
    | Step
    | Seek
    | Trigger
    | Act
    | Break
    | Unbreak
    | Arrange
    | Level
    | Ask
    | Subscribe
    | Unsubscribe
    | Painted
    | Visible
    | Open
    | Save
    | Journal
    | Reread
    | Reload
)


# --- to the page ---


class Hello(msgspec.Struct, frozen=True, tag="hello", tag_field="t"):
    """The studio greets.

    Attributes:
      v: the version of the protocol.
      boot: differs whenever the studio was started.
      viewer: number of the page.
      name: of the graph.
      version: of hfg.
      read_only: why nothing can be changed; "" if it can.
      automatic: ports that every node has, and every subgraph, by kind.
      topics: what can be subscribed to.
      now: the studio's clock, seconds since 1970.
      level: the subgraph that a page shows first, "" for the whole graph.
    """

    v: int
    boot: str
    viewer: int
    name: str
    version: str
    read_only: str
    automatic: dict[str, list[dict[str, str]]]
    topics: list[str]
    now: float
    level: str = ""


class Snapshot(msgspec.Struct, frozen=True, tag="snapshot", tag_field="t"):
    """All tables."""

    rev: int
    tables: dict[str, dict[str, Any]]


class Patch(msgspec.Struct, frozen=True, tag="patch", tag_field="t"):
    """What has changed since the revision before: records that are there now, and those that are gone (None)."""

    rev: int
    ops: list[tuple[str, str, Any]]
    by: int = 0
    text: str = ""


class Ack(msgspec.Struct, frozen=True, tag="ack", tag_field="t"):
    """It is done; this revision contains it."""

    id: int
    rev: int


class Reject(msgspec.Struct, frozen=True, tag="reject", tag_field="t"):
    """It is refused; `message` is the whole sentence, the others are parts of it, and names of which one helps."""

    id: int
    code: str
    message: str
    path: str = ""
    expected: str = ""
    sent: str = ""
    reason: str = ""
    remedy: str = ""
    choices: tuple[str, ...] = ()


class Answer(msgspec.Struct, frozen=True, tag="answer", tag_field="t"):
    """What was asked for."""

    id: int
    value: Any


class Data(msgspec.Struct, frozen=True, tag="data", tag_field="t"):
    """One frame of a topic."""

    sub: int
    seq: int
    time: float
    value: Any


class Gone(msgspec.Struct, frozen=True, tag="gone", tag_field="t"):
    """A subscription is over."""

    sub: int
    message: str


_DECODER: Final[msgspec.json.Decoder[FromPage]] = msgspec.json.Decoder(FromPage)


def read(data: str | bytes) -> FromPage:
    """Read what a page says.

    Raises:
      UsageError: it is not a message of this protocol.
    """
    if len(data) > LONGEST:
        raise UsageError(f"a message has {LONGEST} bytes at most, got {len(data)}")
    try:
        return _DECODER.decode(data)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise UsageError(f"this is not a message of {SUBPROTOCOL}: {error}") from None


def encode(message: msgspec.Struct) -> bytes:
    """Write a message; never fails, whatever the values in it."""
    return encode_anything(message)
