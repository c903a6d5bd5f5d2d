"""Does a run do what the rules say? Its trace is replayed on the reference machine (rules T to X, F9, R5, R6).

The trace's decisions (which node fires, which slot is called, when a waiting firing resumes, when time advances) drive
the machine; everything else in it must be exactly what the machine sees. Inside one decision the order is left open
where the rules leave it open; nothing of one decision may be missing when the next one comes.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, Final

from hfg.base.token import END, Token
from hfg.errors import Failure, shown
from hfg.testing.reference import Move, ReferenceMachine
from hfg.testing.reference.state import Task
from hfg.testing.reference.waiting import TEARDOWN_LIMIT_S
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    CallEnded,
    CallStarted,
    DoEnded,
    DoStarted,
    EditWaits,
    ErrorRaised,
    EventTriggered,
    FiringEnded,
    FiringRetried,
    FiringStarted,
    NodeEnabled,
    NodeEnded,
    ParameterSet,
    QueueGrown,
    RunEnded,
    RunPaused,
    RunResumed,
    RunStarted,
    StructureChanged,
    TokenDrained,
    TokenDropped,
    TokenProcessed,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

__all__ = ["Divergence", "Replay", "describe", "key", "replay", "token_key", "value_key"]

_RULES: Final[dict[type[TraceEvent], str]] = {
    FiringStarted: "F1, F4, F5, F8, F9, F11, A11",
    FiringEnded: "F3, F4, X1",
    FiringRetried: "X1, X2",
    CallStarted: "F6, F8, F9",
    CallEnded: "F6, F9",
    TokenSent: "F3, T2-T5, A3-A5, P5, P8, F13",
    TokenTaken: "F1, F3, F6",
    TokenProcessed: "F5, P4, P7",
    TokenDropped: "P5, F4, F10, R5",
    TokenDrained: "F12, T4",
    EventTriggered: "F3, F8, A9, A12",
    ActivityChanged: "A5-A8, A14, G2",
    ActivityLost: "A8",
    NodeEnded: "F4, F12",
    NodeEnabled: "F10, A9",
    ErrorRaised: "X1, X2",
    ParameterSet: "P8",
    QueueGrown: "F8",
    RunEnded: "R5",
    RunStarted: "A10",
}
_STEPS: Final = ("go on", "task", "time out")
_LONGEST: Final = 100_000
_PLACE: Final = re.compile(r" at 0x[0-9a-f]+")
_SAME_TIME: Final = 1.5e-9  # one step of the grid of nanoseconds, whatever floats make of the difference


class Divergence(AssertionError):
    """A run did something else than the rules say.

    Attributes:
      found: the event of the run that does not fit, or None if something is missing.
      expected: what the rules say would be seen of the last decision and was not.
    """

    def __init__(self, why: str, found: TraceEvent | None, replay: Replay) -> None:
        self.found = found
        self.expected = list(replay.expected)
        rule = _RULES.get(type(found or (self.expected[0] if self.expected else RunEnded(0.0, ""))), "?")
        parts = [f"{why} (rules {rule})"]
        if found is not None:
            parts.append(f"  the run:   {describe(found)}")
        if self.expected:
            parts += [
                "  expected of the last decision, not seen:",
                *(f"    {describe(event)}" for event in self.expected[:8]),
            ]
        moves = replay.machine.moves()
        parts += ["  permitted now: " + (", ".join(map(str, moves[:8])) or "nothing")]
        parts += ["  last events of the run:", *(f"    {describe(event)}" for event in replay.seen[-12:])]
        parts += [
            "  last events of the reference:",
            *(f"    {describe(event)}" for event in replay.machine.observed[-12:]),
        ]
        super().__init__("\n".join(parts))


def replay(build: Any, events: Iterable[TraceEvent], *, until_s: float | None = None) -> None:
    """Check the trace of a complete run against the reference oracle, event by event.

    Args:
      build: a function that returns a new graph equal to the one that ran, or that graph.
      events: all events of the run.
      until_s: the value that was given to the run.

    Raises:
      Divergence: the rules do not explain an event; the error names the first one.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import script, sink
      >>> graph, trace = hfg.Graph(), []
      >>> _ = graph.add(script()) >> graph.add(sink())
      >>> report = hfg.run(graph, clock="virtual", trace=trace.append)
      >>> replay(graph, trace)
    """
    seen = list(events)
    replaying = Replay(build() if callable(build) else build, until_s=until_s)
    try:
        for event in seen:
            replaying.see(event)
        replaying.check_over()
    finally:
        replaying.machine.close()


class Replay:
    """A reference machine that follows a run. Pass it each event with `see`."""

    def __init__(self, graph: Any, *, until_s: float | None = None, held_open: bool = False) -> None:
        self.machine = ReferenceMachine(graph, until_s=until_s, held_open=held_open)
        self.seen: list[TraceEvent] = []
        self._paused = False  # time may go on although nodes are enabled (R3)
        self.expected: list[TraceEvent] = []
        self._delays: set[str] = set()
        self._unheard: Counter[tuple[Any, ...]] = Counter()  # without edges; so far only of the reference
        self._torn_down: dict[str, TraceEvent] = {}  # nodes whose do-activity has ended for an edit that is to come
        self._look_at_edges()
        self._expect(self.machine.start())

    def _look_at_edges(self) -> None:
        lines = self.machine.lines
        events = [line.edge.source for line in lines if line.edge.source.kind == "event"]
        self._connected = {self.machine.event_path(source.owner, source.name) for source in events}
        self._delays |= {line.edge.label for line in lines if line.slack}  # including removed ones

    def see(self, event: TraceEvent) -> None:
        """Take the next event of the run.

        Raises:
          Divergence: the rules do not explain it.
        """
        if isinstance(event, RunPaused | RunResumed):
            self._paused = isinstance(event, RunPaused)
        if self._is_idle(event):
            if isinstance(event, EventTriggered):
                self._keep_up(event)
            return
        if self._was_torn_down(event):
            return
        if event.time > self.machine.now + _SAME_TIME:
            self._let_time_go(event)
        elif event.time > self.machine.now and not self.expected:
            # Neighbours in the grid of nanoseconds are one moment (R6), and the stamps are of the clock of the run: it
            # may be ahead by the last digit to what the reference would permit already.
            self._apply(Move("wait", time=event.time))
        if isinstance(event, EditWaits):
            self.machine.hold(event.nodes)
        elif isinstance(event, StructureChanged):
            self._follow_edit(event)
        elif not self._match(event):
            self._decide(event)
        self.seen.append(event)

    def _was_torn_down(self, event: TraceEvent) -> bool:
        """Return whether a do-activity ends because an edit removes its node, before or after the edit itself (R4)."""
        if not isinstance(event, DoEnded) or event.outcome != "cancelled" or key(event) in map(key, self.expected):
            return False
        index = self.machine.paths.get(event.node)
        doing = None if index is None else self.machine.activity_of(self.machine.stations[index])
        if doing is not None and doing.cancelled:
            return False
        if doing is not None:
            self._torn_down[event.node] = event
        return True

    def _follow_edit(self, event: StructureChanged) -> None:
        """The run is edited (R4): so is the reference."""
        mark = len(self.machine.observed)
        self.machine.edit(event.change)
        self._torn_down.clear()
        self._look_at_edges()
        self._expect(self.machine.observed_since(mark))

    def tell(self, stimulus: Callable[[ReferenceMachine], None]) -> None:
        """Let the world outside do to the reference what it is about to do to the run."""
        mark = len(self.machine.observed)
        stimulus(self.machine)
        self._expect(self.machine.observed_since(mark))

    def check_quiet(self, time: float | None = None) -> None:
        """Check that nothing is missing and that nothing more could move before something comes from outside.

        Args:
          time: time on the run's clock; it may have advanced without visible events.

        Raises:
          Divergence: the run has stopped too early.
        """
        self._finish_steps()
        while time is not None and time > self.machine.now:
            waits = [move.time for move in self.machine.moves() if move.kind == "wait"]
            self._apply(Move("wait", time=min([time, *waits])))
            self._finish_steps()
        if self.expected:
            raise Divergence("the run did not do all that follows", None, self)
        if self.machine.owed_moves():
            raise Divergence("the run rests although the rules permit moves", None, self)

    def check_over(self) -> None:
        """Check that the run has ended, and rightly.

        Raises:
          Divergence: something is missing.
        """
        if self.expected:
            raise Divergence("the run did not do all that follows", None, self)
        if self._torn_down:
            raise Divergence("a do-activity was cancelled for nothing", next(iter(self._torn_down.values())), self)
        if self.machine.outcome is None:
            raise Divergence("the run has no end", None, self)

    # --- matching

    def _expect(self, events: list[TraceEvent]) -> None:
        self.expected += [event for event in events if not self._is_idle(event)]
        idle = (event for event in events if isinstance(event, EventTriggered) and self._is_idle(event))
        self._unheard.update(map(key, idle))

    def _keep_up(self, event: EventTriggered) -> None:
        """Advance code whose triggers have no receiver as far as in the run: an edit may change its next steps (R4)."""
        if event.time > self.machine.now + _SAME_TIME:
            self._let_time_go(event)
        node, wanted = self._teller(event), key(event)
        while self._unheard[wanted] < 1 and (steps := self._steps_of(node)):
            self._apply(min(steps, key=lambda move: self._strangeness(move, event)))
        self._unheard[wanted] -= 1

    def _steps_of(self, node: str | None) -> list[Move]:
        """Return the next possible steps of a node's waiting code."""
        return [move for move in self.machine.moves() if move.kind in _STEPS and move.node == node]

    def _is_idle(self, event: TraceEvent) -> bool:
        """Return whether the event is invisible: events without edges, and events that are not compared."""
        if isinstance(event, EventTriggered):
            return event.event not in self._connected
        if isinstance(event, TokenProcessed):  # of a delay or buffer: no node waits, so the moment is open
            return event.edge in self._delays
        return isinstance(event, RunPaused | RunResumed)

    def _match(self, event: TraceEvent) -> bool:
        wanted = key(event)
        for index, expected in enumerate(self.expected):
            if key(expected) == wanted and abs(expected.time - event.time) <= _SAME_TIME:
                del self.expected[index]
                return True
        return False

    def _decide(self, event: TraceEvent) -> None:
        """Find the move that explains an event which nothing before it does, and take it."""
        if isinstance(event, FiringStarted | CallStarted):
            self._begin(event)
            return
        if isinstance(event, RunEnded):
            self._end(event)
            return
        for unseen in self.machine.moves():
            if unseen.kind == "feed" and not self._reaches(unseen.edge):
                self._apply(unseen)
        for _ in range(10_000):
            move = self._explaining(event)
            if move is None:
                break
            self._apply(move)
            if self._match(event):
                return
        raise Divergence("the run did what the rules do not say", event, self)

    def _begin(self, event: FiringStarted | CallStarted) -> None:
        if self.expected:
            raise Divergence("the run went on before all of the last decision was done", event, self)
        self._end_rest(event.node)
        if not (isinstance(event, CallStarted) and event.slot in ("enable", "reset")):  # which wait for them (F10)
            self._end_tasks(event.node)
        for move in self.machine.moves():
            fires = move.kind == "fire" and isinstance(event, FiringStarted)
            calls = move.kind == "call" and isinstance(event, CallStarted) and move.edge == event.edge
            if move.node == event.node and (fires or calls):
                self._apply(move)
                if not self._match(event):
                    raise Divergence("it is another kind of firing or call", event, self)
                return
        raise Divergence("the run moved when the rules forbid it", event, self)

    def _end_rest(self, node: str) -> None:
        """A restarted node becomes visible only when it continues."""
        for move in self.machine.moves():
            if move.kind == "timer" and move.node == node and not self.machine.times_out(self.machine.paths[node]):
                self._apply(move)

    def _end_tasks(self, node: str) -> None:
        """End cancelled tasks: the trace shows their end, as by a reset, only when their node starts something."""
        for move in self.machine.moves():
            task = self.machine.task_of(move) if move.kind == "task" else None
            cancelled = task is not None and task.cancelled and self._ends_unseen(task)
            if move.node == node and (cancelled or self._resets(move)):
                self._apply(move)

    def _ends_unseen(self, task: Task) -> bool:
        """Return whether its end is not to be seen: one sees it of a do-activity that has begun (A15)."""
        return not task.is_activity or (not task.stepped and self.machine.is_closing(task.station))

    def _resets(self, move: Move) -> bool:
        """Return whether the node is reset by this, because a subgraph around it is (G2)."""
        return move.kind == "go on" and self.machine.under_way(move).kind == "reset"

    def _end(self, event: RunEnded) -> None:
        if not any(move.kind == "finish" for move in self.machine.moves()):
            self._finish_steps()
        if self.expected:
            raise Divergence("the run ended before all of the last decision was done", event, self)
        for _ in range(1000):
            moves = self.machine.moves()
            finish = next((move for move in moves if move.kind == "finish"), None)
            # Steps that nothing was seen of; what sources for ended nodes might do first need not be done (R5).
            unseen = next((move for move in moves if move.kind in ("complete", "wait")), None)
            if finish is not None or unseen is None:
                break
            self._apply(unseen)
        if finish is None:
            raise Divergence(f'the run ended as "{event.outcome}"', event, self)
        self._apply(finish)
        if not self._match(event):
            why = f'ended as "{event.outcome}"' if self.machine.outcome != event.outcome else "ended at another time"
            raise Divergence(f"the run {why}", event, self)

    def _explaining(self, event: TraceEvent) -> Move | None:
        """Return the move that may explain an event: a step of its node, or one that follows from quiet."""
        moves = self.machine.moves()
        node = self._teller(event)
        ringing = next((move for move in moves if self._rings(move, event)), None)
        if ringing is not None:
            return ringing
        if steps := [move for move in moves if move.kind in _STEPS and move.node == node]:
            return min(steps, key=lambda move: self._strangeness(move, event))
        fitting = (move for move in moves if self._leads_to(move, event, node) or self._follows_from_quiet(move, event))
        unseen = (move for move in moves if self._may_go_unseen(move, event))
        return next(fitting, None) or next(unseen, None)

    def _rings(self, move: Move, event: TraceEvent) -> bool:
        """Whether it is the timer that the event tells of: of the operators of its edge, or of an activity (A12)."""
        if move.kind != "timer":
            return False
        if move.edge:
            return move.edge == getattr(event, "edge", None)
        timeout = isinstance(event, EventTriggered) and event.event == f"{move.node}.timeout"
        return timeout and self.machine.times_out(self.machine.paths[move.node])

    def _leads_to(self, move: Move, event: TraceEvent, node: str | None) -> bool:
        """Return whether something that is due at the event's node or edge may explain the event."""
        match move.kind:
            case "timer":
                return (move.node or self._source_of(move.edge)) == node
            case "call" | "read":
                return isinstance(event, TokenTaken) and move.edge == event.edge
            case "feed":
                return isinstance(event, TokenSent) and self._comes_from(event, move.edge)
        return False

    def _follows_from_quiet(self, move: Move, event: TraceEvent) -> bool:
        """Return whether a step that follows only from quiet may explain the event."""
        match move.kind:
            case "grow":
                return isinstance(event, QueueGrown) and move.edge == event.edge
            case "give up":
                return isinstance(event, TokenDrained)
            case "complete":
                return True
            case "end events":
                return isinstance(event, TokenSent) and event.token.value is END
            case "wait":
                return move.time <= event.time + _SAME_TIME
            case "finish":
                return isinstance(event, TokenDropped) and event.reason == "stopped"
        return False

    def _may_go_unseen(self, move: Move, event: TraceEvent) -> bool:
        """Return whether the step may be invisible: of a task, of a restart, or towards a firing's turn (F14)."""
        if move.kind == "timer":
            return not (move.node and self.machine.times_out(self.machine.paths[move.node]))
        return move.kind == "task" or self._resets(move) or (move.kind == "go on" and isinstance(event, QueueGrown))

    def _strangeness(self, move: Move, event: TraceEvent) -> tuple[bool, bool, bool]:
        """Rank the firings of one node (F14): the higher, the less likely its step explains the event.

        Signals have the stamp of their firing (T5); events about the end of a firing name it. The code of a run begins
        with its firing, so a first step comes before the next of those that have waited. A task triggers and fails, and
        does nothing else that could be seen.
        """
        if move.kind == "task":
            is_signal = isinstance(event, EventTriggered) or self._is_signal(event)
            return not (is_signal or _is_of_task(event)), False, False
        if not move.number:
            return _is_of_task(event), False, False
        flight = self.machine.under_way(move)
        number = -1 if _is_of_task(event) else getattr(event, "number", flight.number)
        token = getattr(event, "token", None)
        other = token is not None and abs(token.stamp - flight.stamp) > _SAME_TIME
        return number != flight.number, other, flight.stepped

    def _is_signal(self, event: TraceEvent) -> bool:
        return isinstance(event, TokenSent) and self.machine.labels[event.edge].edge.is_event

    def _source_of(self, label: str) -> str:
        return self.machine.path_of(self.machine.labels[label].edge.source.owner)

    def _comes_from(self, event: TokenSent, name: str) -> bool:
        source = self.machine.labels[event.edge].edge.source
        return source.kind == "output" and source.name == name

    def _teller(self, event: TraceEvent) -> str | None:
        if isinstance(event, EventTriggered):
            return _owner(event.event)
        if isinstance(event, TokenSent | TokenDropped):
            line = self.machine.labels.get(event.edge)
            return None if line is None else self.machine.path_of(line.edge.source.owner)
        if isinstance(event, TokenProcessed | TokenDrained):  # the first event that shows that a node ends (F4, F12)
            line = self.machine.labels.get(event.edge)
            return None if line is None else self.machine.path_of(line.edge.target.owner)
        return getattr(event, "node", None)

    def _apply(self, move: Move) -> None:
        self._expect(self.machine.apply(move))

    def _finish_steps(self) -> None:
        """Let waiting code go on as far as it can, for in the run it has by now."""
        while True:
            steps = [
                move
                for move in self.machine.moves()
                if move.kind in ("go on", "task", "timer") or (move.kind == "feed" and not self._reaches(move.edge))
            ]
            if not steps:
                return
            self._apply(steps[0])

    def _reaches(self, name: str) -> bool:
        """Return whether anything would observe the tokens that are fed."""
        return any(self.machine.is_live(line) for line in self.machine.lines_from(-1, "output", name))

    def _let_time_go(self, event: TraceEvent) -> None:
        while event.time > self.machine.now + _SAME_TIME:
            self._finish_steps()
            if self.expected:
                raise Divergence("time went on before all of the last decision was done", event, self)
            moves = self.machine.moves()
            steps = [move for move in moves if move.kind in ("wait", "finish", "complete")]
            if self._paused and not any(move.kind == "wait" for move in steps):
                steps = [Move("wait", time=event.time)]
            if isinstance(event, EditWaits | StructureChanged) and all(
                move.kind == "wait" for move in self.machine.owed_moves()
            ):
                # code outside has waited until then (R4)
                steps = [*(move for move in moves if move.kind == "wait"), Move("wait", time=event.time)]
            hangs = isinstance(event, RunEnded) and event.time >= self.machine.now + TEARDOWN_LIMIT_S - _SAME_TIME
            # The run was over before a teardown that took its time, even if a source without consumers had continued.
            wait = min(steps, key=lambda move: ((move.kind == "finish") is not hangs, move.time), default=None)
            if wait is None:
                raise Divergence("time went on although the rules permit moves now", event, self)
            if wait.kind == "finish":
                if not isinstance(event, RunEnded | TokenDropped) or wait.time > event.time + _SAME_TIME:
                    raise Divergence("time went on although the run should be over", event, self)
                return
            if wait.kind == "wait" and wait.time > event.time + _SAME_TIME:
                raise Divergence(f"nothing is due before {wait.time:g} s", event, self)
            self._apply(wait)


def key(event: TraceEvent) -> tuple[Any, ...]:
    """Return the part of an event that is compared; its time is compared separately."""
    kind = type(event).__name__
    if isinstance(event, TokenSent | TokenTaken | TokenDrained):
        return (kind, event.edge, token_key(event.token))
    if isinstance(event, TokenDropped):
        return (kind, event.edge, token_key(event.token), event.reason)
    if isinstance(event, EventTriggered):
        return (kind, event.event, value_key(event.token.value), round(event.token.stamp, 9))
    if isinstance(event, ErrorRaised):
        return (kind, event.node, event.policy)
    if isinstance(event, FiringRetried):
        return (kind, event.node, event.number, event.attempt, round(event.pause_s, 9))
    if isinstance(event, ParameterSet):
        return (kind, event.node, event.parameter, value_key(event.value))
    return (kind, *(getattr(event, name) for name in event.__struct_fields__ if name != "time"))


def token_key(token: Token[Any]) -> tuple[Any, ...]:
    """What of a token is compared."""
    return (value_key(token.value), token.activity, round(token.stamp, 9), token.sequence)


def value_key(value: Any) -> Any:
    """Values are compared by what they look like, errors by their type: arrays and NaN have no usable equality."""
    kind = type(value)
    if issubclass(kind, BaseException):
        return kind.__name__
    if issubclass(kind, Failure):
        return (type(value.error).__name__, _without_place(value.taken))
    return (kind.__name__, _without_place(value))


def _without_place(value: object) -> str:
    """Return its repr without addresses in memory."""
    return _PLACE.sub("", shown(value, _LONGEST))


def _is_of_task(event: TraceEvent) -> bool:
    return isinstance(event, DoStarted | DoEnded) or (
        isinstance(event, ErrorRaised) and event.what.startswith(('task "', "do()"))
    )


def _owner(event: str) -> str:
    """Return the path of the node whose event it is; "" for the graph's own `start`."""
    path, dot, _ = event.partition(".")
    return path if dot else ""


def describe(event: TraceEvent) -> str:
    """Return an event in a few words."""
    fields = {name: getattr(event, name) for name in event.__struct_fields__ if name not in ("time", "token")}
    words = " ".join(str(value) for value in fields.values())
    token = getattr(event, "token", None)
    if token is not None:
        sign = {1: " +1", -1: " -1"}.get(token.activity, "")
        words += f" <- {token.value!r}{sign} @{token.stamp:g} #{token.sequence}"
    return f"{event.time:g} s  {type(event).__name__} {words}"
