"""The records of the tables that a page shows: plain data, replaced whole whenever something in them changes.

A page decides nothing: whatever it needs to show of a node, an edge or a run stands here. Depends on nothing.
"""

from __future__ import annotations

from typing import Any

import msgspec

__all__ = [
    "ActionRecord",
    "AnnotationRecord",
    "BreakpointRecord",
    "EdgeRecord",
    "FileRecord",
    "GateRecord",
    "GroupRecord",
    "HistoryRecord",
    "JournalOffer",
    "NodeRecord",
    "OwnPortRecord",
    "PortRecord",
    "ProblemRecord",
    "RunRecord",
    "StepRecord",
    "TypeRecord",
    "ViewRecord",
    "ViewersRecord",
]


class PortRecord(msgspec.Struct, frozen=True, gc=False):
    """A port of a node.

    Attributes:
      kind: "input", "output", "slot", "event" or "parameter".
      path: as in commands.
      type: in words; "" of a signal without a value.
      optional: the node fires without it.
      auto: every node has it (rule A9); such ports are listed only where an edge uses them.
      used: an edge begins or ends there.
    """

    name: str
    kind: str
    path: str
    type: str
    optional: bool = False
    auto: bool = False
    used: bool = False


class NodeRecord(msgspec.Struct, frozen=True):
    """A node or subgraph.

    Attributes:
      level: path of the subgraph around, "" at the top.
      type: key in the table of types.
      title: the name of its type, for people.
      group: where it runs.
      own_group: its own option `group`, or None.
      options: those that are not as usual, by name.
      parameters: values as data, as SetParameter takes them.
      locked: parameters that an edge sets, with the key of that edge.
      shown: parameters that an editor shows as the others are now.
      unnamed: a subgraph without a type of its own.
      inside: how many nodes are in it.
      missing: why its type is not there; "" if it is.
      activity: an active edge begins or ends here.
      notes: what editors keep about it.
    """

    path: str
    name: str
    level: str
    type: str
    title: str
    group: str
    own_group: str | None
    options: dict[str, Any]
    parameters: dict[str, Any]
    locked: dict[str, str]
    shown: list[str]
    enabled: bool
    subgraph: bool
    unnamed: bool
    inside: int
    ports: list[PortRecord]
    missing: str
    activity: bool
    notes: dict[str, Any]


class EdgeRecord(msgspec.Struct, frozen=True):
    """An edge.

    Attributes:
      level: path of the subgraph in which it lies.
      options: those that are not as usual, by name; operators as data.
      signal: it begins at an event.
      back: initial tokens lie on it.
    """

    source: str
    target: str
    level: str
    active: bool
    options: dict[str, Any]
    signal: bool
    back: bool


class AnnotationRecord(msgspec.Struct, frozen=True):
    """A note on the canvas, or a frame around nodes.

    Attributes:
      level: path of the subgraph that it lies on.
      at, size: where a note lies; a frame is where its nodes are.
      members: paths of the nodes in a frame.
    """

    level: str
    name: str
    kind: str
    text: str
    at: tuple[float, float]
    size: tuple[float, float]
    members: list[str]


class GateRecord(msgspec.Struct, frozen=True):
    """A gate: `target` rests while `by` is inactive."""

    target: str
    by: str
    idle_rate_hz: float | None
    level: str


class GroupRecord(msgspec.Struct, frozen=True):
    """A group; `number` gives its colour, 0 is the loop."""

    name: str
    number: int
    threads: int
    policy: str
    process: bool
    host: str


class OwnPortRecord(msgspec.Struct, frozen=True):
    """A port of the whole graph; inputs of the graph are sources inside it."""

    name: str
    kind: str
    type: str


class ViewRecord(msgspec.Struct, frozen=True):
    """A view that a node type offers."""

    name: str
    title: str
    doc: str


class ActionRecord(msgspec.Struct, frozen=True):
    """An action that a node type offers; `undoable`: it sets parameters, so that it can be taken back.

    Attributes:
      arguments: what people give to it, as parameters with the values that it suggests.
    """

    name: str
    label: str
    doc: str
    undoable: bool
    arguments: list[dict[str, Any]]


class TypeRecord(msgspec.Struct, frozen=True):
    """A node type.

    Attributes:
      docs: of its ports by "kind/name".
      ports: only of a type that was asked for by itself; so is `example`, lines of code that use it.
    """

    reference: str
    title: str
    category: str
    summary: str
    doc: str
    subgraph: bool
    source: bool
    parameters: list[dict[str, Any]]
    docs: dict[str, str]
    ports: list[dict[str, str]] = []
    views: list[ViewRecord] = []
    actions: list[ActionRecord] = []
    example: str = ""


class ProblemRecord(msgspec.Struct, frozen=True):
    """Something that is wrong; `fixes` are buttons: a text, and the message that does it, without its id."""

    path: str
    severity: str
    what: str
    why: str
    remedy: str
    check: str
    source: str
    at_s: float | None = None
    fixes: list[dict[str, Any]] = []


class BreakpointRecord(msgspec.Struct, frozen=True):
    """A breakpoint.

    Attributes:
      holds: the run is paused there now.
      condition: in words; "" without one.
      when: the condition as `Break` takes it.
      why_not: why the last value could not be compared.
    """

    path: str
    hits: int
    holds: bool
    condition: str
    when: dict[str, Any] | None = None
    why_not: str = ""


class RunRecord(msgspec.Struct, frozen=True):
    """The run.

    Attributes:
      state: "rest", "starting", "running", "paused", "stepping", "stopping" or "ended".
      outcome: how it ended: "done", "stopped", "failed" ...; "" before.
      elapsed_s: since it began, on its clock, at the time `at` of the studio's clock.
      why: of a pause: "pause", or the path of a breakpoint.
      error: what it failed with: message, path, what, remedy, traceback.
      number: which run of this studio it is, from 1.
      steerable: it can be started and ended from here.
      length_s: of a recording, whose state is "paused" or "running" while it is played; None: it is not a recording.
    """

    state: str = "rest"
    outcome: str = ""
    elapsed_s: float = 0.0
    at: float = 0.0
    why: str = ""
    error: dict[str, str] | None = None
    number: int = 0
    steerable: bool = True
    clock: str = "real"
    length_s: float | None = None


class StepRecord(msgspec.Struct, frozen=True):
    """One step of the history; `by`: which page, 0 is another program."""

    n: int
    text: str
    by: int
    at: float


class HistoryRecord(msgspec.Struct, frozen=True):
    """What can be undone and redone, the latest last; `calls`: actions that were carried out and cannot be undone."""

    done: list[StepRecord]
    undone: list[StepRecord]
    calls: list[StepRecord] = []


class JournalOffer(msgspec.Struct, frozen=True):
    """Edits that were not saved when a studio ended, and when that was (seconds since 1970)."""

    changes: int
    at: float


class FileRecord(msgspec.Struct, frozen=True):
    """The file of the graph.

    Attributes:
      name: of the file; without one, of the graph.
      graph: the name of the graph.
      path: relative to the folder; "" if there is none yet.
      kind: "yaml", "python", "recording" or "none".
      changes: edits since it was read or written.
      can_save: without another name.
      elsewhere: why saving does not simply overwrite it: another program has written it; "" if not.
    """

    name: str
    path: str
    folder: str
    kind: str
    changes: int
    can_save: bool
    elsewhere: str = ""
    graph: str = ""
    journal: JournalOffer | None = None


class ViewersRecord(msgspec.Struct, frozen=True):
    """How many pages are open."""

    count: int
