"""The state of a reference machine: what lies on each edge, what each node is doing, and what has been observed.

Nothing is clever here: token lists are lists, flags are flags. `State` answers the questions that the rules ask about
one moment (is the edge live, is the
output free, may the node fire) and changes nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import EndOfStream, NodeError
from hfg.testing.reference.structure import ROOT, Edge, End, Leaf, Structure, is_box, whole
from hfg.testing.reference.waiting import MOMENT_S, hand_turned_loop
from hfg.trace import TraceEvent


@dataclass
class Lying:
    """A token on its edge; `place` orders what a node has to do (F9), `sender` gets activity back (A8)."""

    token: Token[Any]
    place: int
    sender: int
    since: float = 0.0
    unheard: bool = False  # came to a slot that listens only while its node is active, which it was not (T4)


@dataclass
class Line:
    """An edge and what lies on it."""

    edge: Edge
    capacity: int
    queue: list[Lying] = field(default_factory=list)  # untaken
    unprocessed: int = 0  # taken, but the producer still waits for it
    sequence: int = 0
    ended: bool = False  # END was taken: an optional input is absent from now on (F4)
    given_end: bool = False  # by F13, once
    operators: Any = None  # the run's end of what lies between event and queue (P9)
    completed: bool = False

    @property
    def delay(self) -> int:
        """How many initial tokens it began with; they make a delay of a synchronous edge (P7)."""
        return len(self.edge.initial)

    @property
    def slack(self) -> int:
        """How many tokens may lie on a synchronous edge while its producer is free: delay (P7) and buffer (P4)."""
        return self.delay + self.edge.buffer

    @property
    def under_way(self) -> int:
        """How many tokens count against the slack.

        A token that a consumer processes keeps the last relay of a buffer from forwarding; after a delay nothing waits
        for it.
        """
        return len(self.queue) + (0 if self.delay else self.unprocessed)

    @property
    def is_waited_for(self) -> bool:
        """Whether a token is processed as a whole: neither delay nor buffer ends the wave in front of the consumer."""
        return not self.edge.is_event and not self.slack


@dataclass(eq=False)
class Flight:
    """A firing or slot call in progress. `signals`: triggered in a thread, not at the loop yet."""

    station: Station
    what: Literal["firing", "call"]
    number: int
    kind: str
    stamp: float
    taken: list[Line] = field(default_factory=list)
    began: float = 0.0
    writes: dict[str, tuple[Any, int | None, float | None]] = field(default_factory=dict)
    right: bool = False  # the right of A3: activity left earlier in this firing or call
    in_thread: bool = False
    signals: list[tuple[str, Any, int | None, float | None]] = field(default_factory=list)
    task: Any = None
    stepped: bool = False  # its code has begun
    then: Callable[[Any, BaseException | None], None] | None = None  # what happens with the result
    result: Any = None
    error: BaseException | None = None
    waiting_for: str = ""  # an event whose queues have no room (trigger_wait)
    void: bool = False  # the node was disabled meanwhile: outputs go nowhere (F10)
    elements: list[dict[str, Any]] | None = None  # what an iterating subgraph has still to give inside (G4)
    results: dict[str, list[Any]] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)  # what it took, by input (X1)
    slot: str = ""
    line: Line | None = None  # the edge a slot call took its token from
    over: tuple[Any, NodeError | None] | None = None  # its outcome, while it waits until its outputs may leave (F14)
    over_since: int = 0
    leaving: bool = False
    waits_to_end: bool = False  # it ends the node as soon as the firings that began before it are over (F14)
    when_rested: Callable[[], None] | None = None  # called as soon as no code of a firing runs (F14)
    parameters: dict[str, Any] = field(default_factory=dict)  # as they were when it began
    attempts: int = 0  # at running its function (X1)
    triggered: bool = False  # an attempt has sent a signal, so there is no other
    again: Callable[[], None] | None = None  # makes the next attempt
    pause_until: float | None = None  # the pause before the next attempt


@dataclass(eq=False)
class Task:
    """A task that a node's code has started (X1); the `number` tells it from others of its node."""

    station: Station
    name: str
    number: int
    code: Any = None
    cancelled: bool = False
    waiting_for: str = ""  # an event whose queues have no room (trigger_wait)
    is_activity: bool = False  # the node's own do-activity (A15)
    stepped: bool = False  # its code has begun
    limit: float | None = None  # when it is left behind if it resists being cancelled (X3)


@dataclass(eq=False)
class Station:
    """A node in the machine: a fresh copy that does the work, and what the rules keep of it."""

    leaf: Leaf
    node: Any
    active: bool = False
    enabled: bool = True
    ending: bool = False  # `end()` has been called; END is due
    ended: bool = False
    given_up: bool = False  # by R5: counts as ended, though it has sent no END
    flights: list[Flight] = field(default_factory=list)  # firings in progress, in the order of their start
    place: int | None = None  # since when it is enabled for a firing (F9)
    timed: float | None = None  # when, if a timer made it so
    rested: bool = False  # it worked for ended nodes only and may have given its place away
    firings: int = 0
    calls: int = 0
    owed: list[Line] = field(default_factory=list)  # taken by the last firing, processed when the outputs are (F5)
    hold_until: float = float("-inf")  # F11
    grid: tuple[float, float] | None = None  # its beginning and its period (F11)
    to_set: list[tuple[str, Any]] = field(default_factory=list)  # parameters, as soon as its firing is over (P8)
    last_function: float = float("-inf")  # for the idle rate of a gate
    # "enable" or "reset": what a subgraph around it wants as soon as its firing or call is over; "rest": so a restart
    afterwards: str = ""
    resting_until: float | None = None  # the back-off of a restart
    restarts: int = 0
    iterator: Any = None
    unready: bool = False  # its `ready()` said no since its last firing or call (F1)
    # automatic events that arose: when, which, value, and the stamp unless it is the present
    changes: list[tuple[int, str, Any, float | None]] = field(default_factory=list)
    active_since: float | None = None  # None: not active, or its time-out is over
    drained_modifiers: list[int] = field(default_factory=list)  # wait until the own END is sent (F12)
    stamp: float = 0.0  # of the firing in which it ended
    set_up: bool = False
    opening: bool = False  # its `setup()` runs
    early: list[tuple[str, Any, int | None, float]] | None = None  # what it sends before it takes part (R4)
    tasks: list[Task] = field(default_factory=list)  # in progress, next to its firings
    tasks_begun: int = 0
    is_to_do: bool = False  # its do-activity has yet to begin (A15)
    stops_itself: bool = False  # `ready` raised EndOfStream

    @property
    def path(self) -> str:
        """The node's path."""
        return self.leaf.path

    @property
    def concurrency(self) -> int:
        """How many of its firings may be in progress at once (F14)."""
        return self.leaf.concurrency

    @property
    def is_concurrent(self) -> bool:
        """Whether that is more than one, so that its firings and calls do not exclude each other."""
        return self.concurrency > 1

    @property
    def flight(self) -> Flight | None:
        """The work in progress; of several firings the one that started first."""
        return self.flights[0] if self.flights else None

    @property
    def work(self) -> list[Flight | Task]:
        """All of its running code: firings, calls, tasks."""
        return [*self.flights, *self.tasks]

    @property
    def firings_under_way(self) -> list[Flight]:
        """Its firings in progress, including those that wait until their outputs may leave (F14)."""
        return [flight for flight in self.flights if flight.what == "firing"]

    @property
    def is_flying(self) -> bool:
        """Whether code of a firing is running.

        A finished firing that waits for its turn, or its end, does not count (F14).
        """
        return any(flight.over is None and not flight.waits_to_end for flight in self.firings_under_way)

    @property
    def is_amid(self) -> bool:
        """Whether it is within a firing or call, so that it cannot be torn down."""
        return self.is_calling or self.is_flying

    @property
    def is_calling(self) -> bool:
        """Whether a slot call is in progress."""
        return any(flight.what == "call" for flight in self.flights)

    @property
    def is_busy(self) -> bool:
        """Whether no firing may begin, because of work in progress (F1, F14)."""
        if not self.is_concurrent:
            return bool(self.flights) or bool(self.afterwards)  # its tasks come to their end first
        return self.is_calling or bool(self.afterwards) or len(self.firings_under_way) >= self.concurrency

    @property
    def is_restarting(self) -> bool:
        """Whether a failure has it restarted, now or as soon as none of its code is running (X1)."""
        return self.resting_until is not None or self.afterwards == "rest"

    @property
    def type(self) -> Any:
        """What is known of its type."""
        return self.node._type


class State:
    """One moment of a run, and what can be asked about it."""

    structure: Structure

    def __init__(self, graph: Any) -> None:
        self.structure = whole(graph)
        self.graph = graph
        self.now = 0.0
        self.tick = 0
        self.calling_boxes: set[int] = set()  # with a slot call in progress because a node inside is in a thread
        self.stations = [Station(leaf, fresh(leaf)) for leaf in self.structure.leaves]
        self.take_lines([Line(edge, edge.capacity) for edge in self.structure.edges])
        self.box_enabled = [bool(box.options.enabled) for box in self.structure.boxes]
        self.box_active = [False] * len(self.structure.boxes)
        self.box_since: list[float | None] = [None] * len(self.structure.boxes)
        self.box_calls: dict[int, int] = {}
        self.loop = hand_turned_loop(lambda: self.now)
        self.held_open = False
        self.readers: set[str] = set()
        self.outcome: str | None = None
        self.in_timers = False  # whether timers cause the current step
        self.started = False  # whether the signals of `start` are on their edges (A10)
        self.error: BaseException | None = None
        self.observed: list[TraceEvent] = []
        self.lost_activity = 0
        self.returning: list[tuple[Line, int]] = []  # activity that got nowhere, and its sender (F13, A8)
        self.held: set[int] = set()  # stations that an edit waits for (R4), by identity
        self.edit_began: float | None = None  # when one that waits has set up the nodes that come
        for station in self.stations:
            station.enabled = bool(station.leaf.options.enabled)

    # --- edges

    def take_lines(self, lines: list[Line]) -> None:
        """Make these the edges of the graph, sorted by their ends."""
        self.lines = lines
        self._from: defaultdict[End, list[Line]] = defaultdict(list)
        self._sent: defaultdict[int, list[Line]] = defaultdict(list)
        self._out: defaultdict[int, list[Line]] = defaultdict(list)
        self._waiting: defaultdict[int, list[Line]] = defaultdict(list)
        self._joined: defaultdict[int, list[Line]] = defaultdict(list)
        self._called: defaultdict[int, list[Line]] = defaultdict(list)
        for line in lines:
            source, target = line.edge.source, line.edge.target
            self._from[source].append(line)
            self._sent[source.owner].append(line)
            if not line.edge.is_event:
                self._out[source.owner].append(line)
            elif line.edge.overflow == "wait":
                self._waiting[source.owner].append(line)
            if self.is_called(line):
                self._called[target.owner].append(line)
            elif target.kind in ("input", "parameter"):
                self._joined[target.owner].append(line)

    def lines_from(self, owner: int, kind: str, name: str) -> list[Line]:
        """Edges of one source, in order of connecting."""
        return self._from[End(owner, kind, name)]

    def lines_sent(self, owner: int) -> list[Line]:
        """All edges out of a node or subgraph."""
        return self._sent[owner]

    def lines_out(self, owner: int) -> list[Line]:
        """Synchronous edges out of a node: they belong to its outputs."""
        return self._out[owner]

    def lines_joined(self, owner: int) -> list[Line]:
        """Edges that a firing of the node takes from; a signal into a parameter takes no part (P8)."""
        return self._joined[owner]

    def lines_called(self, owner: int) -> list[Line]:
        """Edges whose tokens are worked on one by one."""
        return self._called[owner]

    def is_deaf(self, line: Line) -> bool:
        """Return whether it leads to a slot that listens only while its node is active, and that does not now (T4)."""
        target = line.edge.target
        if target.kind != "slot" or target.owner < 0:
            return False
        station = self.stations[target.owner]
        spec = station.type.slots.get(target.name)
        if spec is None or not spec.while_active or station.active:
            return False
        return not any(
            lying.token.activity == 1
            for other in self.lines
            if other.edge.target.owner == target.owner and self.is_called(other)
            for lying in other.queue
        )

    def is_called(self, line: Line) -> bool:
        """Return whether the edge leads into a slot, or a signal into a parameter."""
        kind = line.edge.target.kind
        return kind == "slot" or (kind == "parameter" and line.edge.is_event)

    def is_live(self, line: Line) -> bool:
        """A live edge: both ends are enabled, or the target port is an `enable` slot."""
        return self.is_enabled(line.edge.source.owner) and self.reaches(line)

    def reaches(self, line: Line) -> bool:
        """The same without its source: what that sent before it was disabled is still delivered (F10)."""
        target = line.edge.target
        if line.edge.via:
            around = (*self._boxes_around(line.edge.source.owner), *self._boxes_around(target.owner))
            if any(not self._box_open(box) for box in line.edge.via if box not in around):
                return False  # the edge only passes through it, and the ports there are disabled
        if self.is_outside(target.owner) or (target.kind == "slot" and target.name == "enable"):
            return True
        return self.is_enabled(target.owner)

    def _boxes_around(self, owner: int) -> tuple[int, ...]:
        """Return the subgraphs that a node or subgraph is in, itself included."""
        if is_box(owner):
            return (*self.structure.boxes[-2 - owner].boxes, -2 - owner)
        return self.stations[owner].leaf.boxes if owner >= 0 else ()

    def is_outside(self, owner: int) -> bool:
        """Return whether a port belongs to the world outside, of the graph or of an iterating subgraph."""
        return owner < 0 and not is_box(owner)

    def is_enabled(self, owner: int) -> bool:
        """A node is enabled if it and all subgraphs around it are."""
        if owner == ROOT:
            return True
        if is_box(owner):
            return self._box_open(-2 - owner)
        if owner < 0:  # the border of what iterates: a firing in progress is finished (F10)
            return True
        station = self.stations[owner]
        return station.enabled and station.afterwards != "enable" and self.is_enabled_around(owner)

    def is_enabled_around(self, index: int) -> bool:
        """Return whether all subgraphs around a node are enabled."""
        return all(self.box_enabled[box] for box in self.stations[index].leaf.boxes)

    def _box_open(self, box: int) -> bool:
        around = (*self.structure.boxes[box].boxes, box)
        return all(self.box_enabled[one] for one in around)

    def takes_part(self, line: Line) -> bool:
        """Whether a firing waits for the edge: a live one, or one with signals sent before the sender was disabled."""
        if self.is_live(line):
            return not (line.ended and not line.queue and self.is_optional(line))
        return line.edge.is_event and bool(line.queue) and self.is_enabled(line.edge.target.owner)

    def is_optional(self, line: Line) -> bool:
        """Parameters are optional inputs too (P8)."""
        target = line.edge.target
        return target.kind == "parameter" or bool(self.stations[target.owner].type.inputs[target.name].optional)

    def is_occupied(self, line: Line) -> bool:
        """Return whether the producer's token is not processed yet (P4, P7)."""
        if not self.is_live(line):
            return False
        return line.under_way > line.slack

    def outputs_are_free(self, owner: int) -> bool:
        """An output is free when all its live edges are (F5)."""
        return not any(self.is_occupied(line) for line in self.lines_out(owner))

    def full_lines(self, owner: int) -> list[Line]:
        """Live `wait` edges of the node that hold capacity or more untaken tokens (F8)."""
        return [line for line in self._waiting[owner] if self.is_live(line) and len(line.queue) >= line.capacity]

    # --- activity

    def is_active(self, owner: int) -> bool:
        """A(v); of a subgraph by G2: a node inside is active, or +1 is in transit inside or was drained (F12)."""
        if owner >= 0:
            return self.stations[owner].active
        if not is_box(owner):
            return False
        members = self.structure.boxes[-2 - owner].members
        stations = [self.stations[member] for member in members]
        return any(station.active or 1 in station.drained_modifiers for station in stations) or any(
            lying.token.activity == 1 for line in self.lines_inside(-2 - owner) for lying in line.queue
        )

    def lines_inside(self, box: int) -> list[Line]:
        """Edges with both ends inside a subgraph."""
        members = self.structure.boxes[box].members
        inner = [-2 - one.index for one in self.structure.boxes if box in one.boxes]
        inside = [*members, *inner]
        return [line for line in self.lines if line.edge.source.owner in inside and line.edge.target.owner in inside]

    # --- F1

    def may_fire(self, index: int, *, ignore: str = "") -> bool:
        """F1, all but "not busy": from then on the node has a place (F9).

        `ignore`: "queues" leaves F8 out; "timers" leaves out F11, A11 and back-off.
        """
        station = self.stations[index]
        if not self.is_enabled(index) or station.ending or station.ended:
            return False
        if station.is_concurrent and any(flight.kind == "end" for flight in station.flights):
            return False  # the last of its firings has begun
        if station.type.process_kind == "none" and station.leaf.inside is None:
            return False
        if station.type.is_source and not self.started:
            return False
        if not self.has_all_inputs(index) or not self.outputs_are_free(index):
            return False
        if "queues" not in ignore and self.full_lines(index):
            return False
        if "timers" not in ignore and (self.is_held_by_time(index) or self.is_resting(index)):
            return False
        if self.is_suspended_source(index):
            return False
        return not station.unready

    def has_all_inputs(self, index: int) -> bool:
        """A source or a live input edge; a live edge at each mandatory input; a token on all that take part."""
        station = self.stations[index]
        joined = self.lines_joined(index)
        waited = [line for line in joined if self.takes_part(line)]
        if not station.type.is_source and not waited:
            return False  # no live input edge, or all that there were have ended
        connected = {line.edge.target.name for line in waited if line.edge.target.kind == "input"}
        mandatory = {name for name, spec in station.type.inputs.items() if not spec.optional}
        return mandatory <= connected and all(line.queue for line in waited)

    def says_ready(self, station: Station) -> bool:
        """Ask `ready()`, last of all."""
        hook = station.node._hook("ready")
        if hook is None or station.stops_itself:
            return True
        try:
            return bool(hook())
        except EndOfStream:
            station.stops_itself = True
            return True

    def gates_of(self, index: int) -> Iterator[float | None]:
        """The idle rates of gates whose state node is inactive now; None suspends (A11)."""
        for gate in self.structure.gates:
            if index in gate.targets and not self.is_active(gate.by):
                yield gate.idle_rate_hz

    def is_suspended_source(self, index: int) -> bool:
        """Sources rest under a gate without an idle rate."""
        return self.stations[index].type.is_source and any(rate is None for rate in self.gates_of(index))

    def is_resting(self, index: int) -> bool:
        """A throttled source that has had its firing for now (A11)."""
        return self.stations[index].type.is_source and not self.within_idle_rate(index)

    def within_idle_rate(self, index: int) -> bool:
        """Return whether every gate allows a firing that runs the function now."""
        station = self.stations[index]
        return all(rate is not None and self.is_over(station.last_function + 1 / rate) for rate in self.gates_of(index))

    def is_held_by_time(self, index: int) -> bool:
        """F11's hold, within which no firing at all starts, or the back-off of a restart."""
        station = self.stations[index]
        return not self.is_over(station.hold_until) or station.resting_until is not None

    def is_over(self, moment: float) -> bool:
        """Return whether a moment has come."""
        return self.now + MOMENT_S >= moment

    # --- what is next for one node (F9)

    def next_call(self, owner: int) -> Line | None:
        """The edge with the oldest token that waits for a call; of a disabled node only `enable` answers."""
        waiting = [line for line in self.lines_called(owner) if line.queue]
        if not waiting or owner in self.calling_boxes:
            return None
        candidates = [line for line in waiting if (self.is_enabled(owner) or line.edge.target.name == "enable")]
        return min(candidates, key=lambda line: line.queue[0].place, default=None)


def fresh(leaf: Leaf) -> Any:
    """Make the copy of a node that does the work."""
    node = leaf.node._copy()
    node._place = leaf.node._place  # code may ask where it is
    return node


def newest(tokens: list[Token[Any]], otherwise: float) -> float:
    """T5: the newest stamp of the values that were taken, else of all that was taken."""
    values = [token.stamp for token in tokens if token.value is not NO_MESSAGE and token.value is not END]
    return max(values or [token.stamp for token in tokens] or [otherwise])
