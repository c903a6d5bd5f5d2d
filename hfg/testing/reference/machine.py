"""The reference machine: which moves the rules permit, and what each of them does.

`moves()` lists every decision that a scheduler may take now; `apply(move)` takes one and gives what an observer sees of
it. Where it is quiet, the steps that follow only from quiet are the moves: time advances (R6), operators complete (P9),
events end (F13), the run ends (R5).
"""

from __future__ import annotations

from collections.abc import Collection, Set
from dataclasses import dataclass
from typing import Any, Literal

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import QueueLimit, Stalled, UsageError
from hfg.testing.reference.rings import Rings
from hfg.testing.reference.state import Flight, Line, Station, Task
from hfg.testing.reference.structure import ROOT, Edge, End, boundary_of
from hfg.testing.reference.waiting import MOMENT_S, TEARDOWN_LIMIT_S
from hfg.trace import (
    ActivityChanged,
    QueueGrown,
    RunEnded,
    RunStarted,
    TokenDropped,
    TokenTaken,
    TraceEvent,
)


@dataclass(frozen=True)
class Move:
    """One permitted step.

    Attributes:
      kind: "fire" node; "call" a slot of node with the token of `edge`; "go on" with the firing or call of node;
        "task": resume a task that its code has started; "time out" the firing of node (X2); "timer": what a timer of
        node, or the operators of `edge`, waited for; "feed" the graph's input `edge`, "read" the output at the end of
        `edge` (P10); "wait" until `time`; "grow" the queue of `edge`; "give up" sources; "complete" operators; "end
        events"; "finish" the run.
      outcome: of "finish".
      number: of "go on" and "time out": which of the node's firings, if several may be in progress (F14); otherwise 0.
        Of "task": which of the node's tasks.
    """

    kind: Literal[
        "fire",
        "call",
        "go on",
        "task",
        "time out",
        "timer",
        "feed",
        "read",
        "wait",
        "grow",
        "give up",
        "complete",
        "end events",
        "finish",
    ]
    node: str = ""
    edge: str = ""
    time: float = 0.0
    outcome: str = ""
    number: int = 0

    def __str__(self) -> str:
        match self.kind:
            case "wait":
                return f"wait until {self.time:g} s"
            case "finish":
                return f"finish: {self.outcome}"
            case "timer":
                return f'timer of "{self.node or self.edge}"'
            case "grow" | "feed" | "read":
                return f"{self.kind} {self.edge}"
            case "call":
                return f'call a slot of "{self.node}" over {self.edge}'
            case "task":
                return f'go on with task {self.number} of "{self.node}"'
            case "give up" | "complete" | "end events":
                return self.kind
        return f'{self.kind} "{self.node}"' + (f" in firing {self.number}" if self.number else "")


class ReferenceMachine(Rings):
    """A run of a graph whose every decision is taken from outside.

    Args:
      graph: as built; its nodes are copied, so it can be run elsewhere too.
      until_s: the run ends when time would go beyond it.
      held_open: tokens may still come from outside, so quiet does not end the run.
    """

    def __init__(self, graph: Any, *, until_s: float | None = None, held_open: bool = False) -> None:
        super().__init__(graph)
        self.until_s = until_s
        self.held_open = held_open
        self.paths = {station.path: station.leaf.index for station in self.stations}
        self.paths |= {box.path: -2 - box.index for box in self.structure.boxes}
        self.paths[""] = ROOT
        self.feeding: dict[str, list[Any]] = {}  # what is to be fed into each input of the graph
        self.unread: set[str] = set()  # outputs of the graph without a reader at the moment
        self.collected: dict[str, list[Any]] = {}
        self.labels = {line.edge.label: line for line in self.lines}

    def start(self) -> list[TraceEvent]:
        """Lay the initial tokens, set up all nodes, trigger `start` (A10)."""
        self.connect_ports()
        for line in self.lines:
            self.lay(line)
        before = self.next_tick()
        self.make_operators()
        for station in self.stations:
            self.set_up(station)
        self.place_by_operators(before)
        self.note_places()
        self.observe(RunStarted(self.now))
        self.started = True
        self.trigger(ROOT, "start", activity=1)
        self.settle()
        return self.observed_since(0)

    def place_by_operators(self, before: int) -> None:
        """Let tokens that operators emit when connected enable firings in order of arrival, like calls (F9, P9)."""
        for station in self.stations:
            index = station.leaf.index
            into = [line for line in self.lines if line.edge.target.owner == index and line.edge.target.kind == "input"]
            arrived = max((line.queue[0].place for line in into if line.queue), default=before)
            if arrived > before and self.may_fire(index):
                station.place = arrived

    def observed_since(self, mark: int) -> list[TraceEvent]:
        """Return the events after the first `mark`."""
        return self.observed[mark:]

    # --- what may happen

    def moves(self) -> list[Move]:
        """Return every permitted next move; none after the end, or if only the world outside can go on."""
        if self.outcome is not None:
            return []
        working = self.working_moves()
        moot = self.moot_sources()
        if any(self.is_owed(move, moot) for move in working):
            return working
        # Those who work for ended nodes only may go on, but neither time nor the end waits for them (R5).
        found = working + self.quiet_moves(moot)
        due = self.next_timer()
        if moot and due is not None and (self.until_s is None or due <= self.until_s):
            found += [Move("wait", time=due)] if Move("wait", time=due) not in found else []
        return found

    def owed_moves(self) -> list[Move]:
        """Return the moves of which one must be taken before the run counts as quiet."""
        if self.outcome is not None:
            return []
        moot = self.moot_sources()
        return [move for move in self.working_moves() if self.is_owed(move, moot)] or self.quiet_moves(moot)

    def is_owed(self, move: Move, moot: Set[int]) -> bool:
        """Whether others wait for it: not for a firing of a source for ended nodes, whose slots go on, though (R5).

        Nor for the beginning of a last firing that would wait for those before it (F14).
        """
        index = self.paths.get(move.node, ROOT)
        if move.kind == "fire" and self.stations[index].flights and self.would_end(index):
            return False
        if index not in moot:
            return True
        return move.kind == "call" or (move.kind == "go on" and self.stations[index].is_calling)

    def working_moves(self, only: Collection[int] | None = None) -> list[Move]:
        """Return firings, calls, and next steps of those in progress, of all nodes or `only` some; and full rings."""
        found = self.moves_at_the_border()
        for index, station in enumerate(self.stations):
            if only is not None and index not in only:
                continue
            found += [Move("task", station.path, number=task.number) for task in self.tasks_in_turn(station)]
            for flight in station.flights:
                found += self.moves_of(flight, index, station)
            if station.flights and not station.is_concurrent:
                continue
            move = self.next_of(index)
            found += [] if move is None else [move]
            found += self.either_way(index, move)
        return found

    def moves_at_the_border(self) -> list[Move]:
        """Return moves of tokens from and to the outside, timers, slots of the graph and of subgraphs, and rings."""
        found = [Move("feed", edge=name) for name, values in self.feeding.items() if values and self.can_feed(name)]
        found += self.timers_due()
        found += [Move("read", edge=line.edge.label) for line in self.lines if line.queue and self.is_read(line)]
        for owner in [ROOT, *(-2 - box.index for box in self.structure.boxes)]:
            line = self.next_call(owner)
            if line is not None and not self.full_lines(owner):
                found.append(Move("call", self.path_of(owner), line.edge.label))
        return found + [Move("grow", edge=line.edge.label) for line in self.queues_to_grow()]

    def moves_of(self, flight: Flight, index: int, station: Station) -> list[Move]:
        """Return how a firing or call in progress may continue."""
        found = []
        number = flight.number if station.is_concurrent and flight.what == "firing" else 0
        if self.can_go_on(flight):
            found.append(Move("go on", station.path, number=number))
        limit = station.leaf.options.max_duration_s
        if limit is not None and self.is_limited(flight) and self.is_over(flight.began + limit):
            found.append(Move("time out", station.path, number=number))
        return found

    def is_limited(self, flight: Flight) -> bool:
        """Return whether the time limit of its node counts for it (X2)."""
        return flight.what == "firing" and flight.task is not None and flight.then is not None

    def under_way(self, move: Move) -> Flight:
        """Return the firing or call that a move resumes."""
        station = self.stations[self.paths[move.node]]
        if move.number:
            return next(one for one in station.firings_under_way if one.number == move.number)
        return next((one for one in station.flights if one.what == "call"), station.flights[0])

    def task_of(self, move: Move) -> Task:
        """Return the task that a move resumes."""
        return next(task for task in self.stations[self.paths[move.node]].tasks if task.number == move.number)

    def can_feed(self, name: str) -> bool:
        """Return whether the graph's input is free (P10)."""
        return not any(self.is_occupied(line) for line in self.lines_from(ROOT, "output", name))

    def is_read(self, line: Line) -> bool:
        """Return whether tokens there are taken from outside.

        Always for iterating subgraphs; as configured for the graph.
        """
        target = line.edge.target
        return self.is_outside(target.owner) and target.kind == "input" and target.name not in self.unread

    def can_iterate(self, index: int) -> bool:
        """Return whether the next element may go in: it is quiet inside (G4)."""
        inside = self.all_inside(index)
        return not self.is_moving_inside(index, inside)

    def is_moving_inside(self, index: int, inside: Set[int]) -> bool:
        """Return whether something happens inside an iterating subgraph, or will when time advances."""
        boxes = [box for box in self.structure.boxes if inside & set(box.members)]
        paths = {self.stations[number].path for number in inside} | {box.path for box in boxes}
        for move in self.working_moves(inside):
            line = self.labels.get(move.edge)
            if move.node in paths or (line is not None and line.edge.within in (index, *inside)):
                return True
        timed = [*inside, *(-2 - box.index for box in boxes)]
        return (
            any(self.time_of_timeout(owner) is not None for owner in timed)
            or any(self.is_moving(number) for number in inside)
            or any(
                line.operators is not None and line.operators.due() is not None
                for line in self.lines
                if line.edge.within in (index, *inside)
            )
        )

    def is_moving(self, index: int) -> bool:
        """Return whether a node works or waits for a point in time; not if its code waits for room in a queue (F8)."""
        station = self.stations[index]
        works = any(not work.waiting_for for work in station.work)
        return works or station.resting_until is not None or self.waits_for_rate(index)

    def waits_for_rate(self, index: int) -> bool:
        """Return whether it fires when its time has come, or is then held back only by a full queue."""
        if self.may_fire(index, ignore="timers"):
            return True
        by_time = self.is_held_by_time(index) or self.is_resting(index)
        return by_time and not self.stations[index].is_busy and self.may_fire(index, ignore="timers and queues")

    def all_inside(self, index: int) -> set[int]:
        """Return all nodes inside an iterating subgraph."""
        return {number for number in range(len(self.stations)) if self.is_inside(number, index)}

    def is_inside(self, index: int, around: int) -> bool:
        """Return whether a node belongs to what iterates, directly or inside another one that does (G3, G4)."""
        within = self.stations[index].leaf.within
        return within is not None and (within == around or self.is_inside(within, around))

    def next_of(self, index: int) -> Move | None:
        """F9: of a node's calls and its firing, the one with the oldest place."""
        if self.is_held(index):
            return None
        station = self.stations[index]
        line = self.next_call(index)
        held = bool(self.full_lines(index)) or station.resting_until is not None or station.is_calling
        held |= bool(station.afterwards) and not station.is_amid  # its tasks come to their end first
        fires = station.place is not None and not station.is_busy and self.may_fire(index)
        if line is not None and (station.place is None or line.queue[0].place < station.place):
            return None if held else Move("call", station.path, line.edge.label)
        if fires:
            return Move("fire", station.path)
        if line is not None and station.is_concurrent and not held:  # its calls wait for no firing (F14)
            return Move("call", station.path, line.edge.label)
        return None

    def either_way(self, index: int, move: Move | None) -> list[Move]:
        """A second move where the order of F9 is open.

        Timers of one moment take effect in any order; and the firing of a source for ended nodes may as well rest.
        Calls of a node that allows several firings wait for none of them (F14).
        """
        station, line = self.stations[index], self.next_call(index)
        if move is None or line is None or station.place is None:
            return []
        same_moment = station.timed is not None and abs(line.queue[0].since - station.timed) <= MOMENT_S
        if move.kind == "fire" and (same_moment or station.rested or station.is_concurrent):
            return [Move("call", station.path, line.edge.label)]
        if move.kind == "call" and same_moment and not station.is_busy and self.may_fire(index):
            return [Move("fire", station.path)]
        return []

    def quiet_moves(self, moot: Set[int]) -> list[Move]:
        """What follows when nothing runs and nothing can start, `moot` sources apart."""
        due = self.next_timer(moot)
        if due is not None:
            if self.until_s is not None and due > self.until_s + MOMENT_S:
                return [Move("finish", outcome="until", time=self.until_s)]
            return [Move("wait", time=due)]
        busy = any(
            (any(not task.waiting_for for task in station.tasks) or any(map(self.is_unfinished, station.flights)))
            and (index not in moot or station.is_calling)
            for index, station in enumerate(self.stations)
        )
        return [] if busy or self.held_open else [self.closing_move()]

    def is_unfinished(self, flight: Flight) -> bool:
        """Whether more may come of it: not of what is over and waits for its turn (F14), nor of what waits for room."""
        return flight.over is None and not flight.waiting_for

    def closing_move(self) -> Move:
        """What is next when only the end is left.

        Sources for ended nodes are stopped (R5), operators emit what they hold (P9), events end (F13), then R5.
        """
        if self.sources_to_give_up():
            return Move("give up")
        if any(line.operators is not None and not line.completed for line in self.lines):
            return Move("complete")
        if self.events_to_end():
            return Move("end events")
        return Move("finish", outcome="stalled" if self.stalled() else "done")

    def next_timer(self, without: Set[int] = frozenset()) -> float | None:
        """The next moment at which something could start: rate, gate, back-off, time-out, operator, waiting code."""
        ignored = {
            id(work) for index in without for work in self.stations[index].work if not self.stations[index].is_calling
        }
        times: list[float | None] = [self.loop.next_time(ignored)]
        for index, station in enumerate(self.stations):
            if index in without:
                continue
            limit = station.leaf.options.max_duration_s
            if limit is not None:
                times += [flight.began + limit for flight in station.flights if self.is_limited(flight)]
            if station.resting_until is not None:
                times.append(station.resting_until)
            times += [flight.pause_until for flight in station.flights]
            times += [task.limit for task in station.tasks]
            if not station.is_busy and station.place is None and self.may_fire(index, ignore="timers and queues"):
                rests = [station.hold_until]
                rests += [
                    station.last_function + 1 / rate for rate in self.gates_of(index) if rate and self.is_resting(index)
                ]
                times += [rest for rest in rests if not self.is_over(rest)]
            times.append(self.time_of_timeout(index))
        times += [self.time_of_timeout(-2 - box.index) for box in self.structure.boxes]
        for line in self.lines:
            if line.operators is not None and (due := line.operators.due()) is not None:
                times.append(max(due, self.now))
        return min((time for time in times if time is not None), default=None)

    def events_to_end(self) -> list[Line]:
        """F13: live event edges into inputs whose queues are empty, once per edge; ended nodes need no END."""
        return [
            line
            for line in self.lines
            if line.edge.is_event
            and line.edge.within is None
            and line.edge.target.kind == "input"
            and self.is_live(line)
            and not line.queue
            and not line.given_end
            and not self.has_ended(line.edge.target.owner)
        ]

    def has_ended(self, owner: int) -> bool:
        """Return whether the node has ended, or is about to."""
        return owner >= 0 and self.stations[owner].ending

    def stalled(self) -> list[str]:
        """R5: sources that have not ended and are blocked, and edges with tokens that can never be taken.

        What is kept inside of what iterates waits for its next firing.
        """
        found = []
        moot = self.moot_sources()
        for index, station in enumerate(self.stations):
            if (
                station.type.is_source
                and self.is_enabled(index)
                and not station.ended
                and not self.is_suspended_source(index)  # one that is throttled would fire in time, were it not blocked
                and index not in moot
            ):
                found.append(station.path)
        return found + [
            line.edge.label
            for line in self.lines
            if line.queue and line.edge.within is None and self.is_enabled(line.edge.target.owner)
        ]

    def moot_sources(self) -> set[int]:
        """R5: sources that have not ended but have edges only into ended nodes, or into others of them."""
        found: set[int] = set()
        left = {
            index
            for index, station in enumerate(self.stations)
            if station.type.is_source and self.is_enabled(index) and (station.given_up or not station.ended)
        }
        while more := {index for index in left - found if self._works_for_nobody(index, found)}:
            found |= more
        return found

    def _works_for_nobody(self, index: int, moot: Set[int]) -> bool:
        lines = self.lines_sent(index)
        return bool(lines) and all(self._ends_with(line, moot) for line in lines)

    def _ends_with(self, line: Line, moot: Set[int]) -> bool:
        """Return whether what comes on the edge is for a node that has ended or counts so; its slots go on (F12)."""
        target = line.edge.target.owner
        if target < 0 or line not in self.lines_joined(target):
            return False
        return self.stations[target].ended or target in moot

    def sources_to_give_up(self) -> list[Station]:
        """Those for which something waits: it is drained then, and whoever sent it may go on (R5, F12)."""
        return [
            self.stations[index]
            for index in self.moot_sources()
            if not self.stations[index].given_up and any(line.queue for line in self.lines_joined(index))
        ]

    # --- what happens

    def apply(self, move: Move) -> list[TraceEvent]:
        """Take a permitted move and give what is seen of it."""
        mark = len(self.observed)
        index = self.paths.get(move.node, ROOT)
        match move.kind:
            case "fire":
                self.start_firing(index)
            case "call":
                self.start_call(index, self.labels[move.edge])
            case "go on":
                self.go_on(self.under_way(move))
                self.settle()
            case "task":
                self.go_on_with(self.task_of(move))
                self.settle()
            case "time out":
                self.time_out(self.under_way(move))
                self.settle()
            case "feed":
                self.feed_once(move.edge)
            case "read":
                self.read_once(self.labels[move.edge])
            case "timer":
                self.in_timers = True
                self.take_timer(move)
                self.in_timers = False
            case "wait":
                self.wait_until(move.time)
            case "grow":
                self.grow(self.labels[move.edge])
            case "give up":
                self.give_up()
            case "complete":
                self.complete_all()
            case "end events":
                self.end_events()
            case "finish":
                self.now = move.time or self.now
                self.finish(move.outcome)
        return self.observed_since(mark)

    def wait_until(self, time: float) -> None:
        """Let time go on, by whole nanoseconds (R6); what is due then becomes possible."""
        self.now = max(self.now, round(time, 9))
        self.in_timers = True
        self.loop.ring()
        for line in self.lines:
            if line.operators is not None:
                line.operators.tell_time(self.now)
        self.settle()
        self.in_timers = False

    def timers_due(self) -> list[Move]:
        """Timers whose moment has come; those of one moment ring in any order."""
        found = []
        for index, station in enumerate(self.stations):
            if self.times_out(index) or (station.resting_until is not None and self.is_over(station.resting_until)):
                found.append(Move("timer", station.path))
            late = [task for task in station.tasks if task.limit is not None and self.is_over(task.limit)]
            found += [Move("timer", station.path, number=task.number) for task in late]
        found += [Move("timer", box.path) for box in self.structure.boxes if self.times_out(-2 - box.index)]
        for line in self.lines:
            if line.operators is not None and (due := line.operators.due()) is not None and self.is_over(due):
                found.append(Move("timer", edge=line.edge.label))
        return found

    def times_out(self, owner: int) -> bool:
        """Return whether the node or subgraph has been active for so long that its event `timeout` is due (A12)."""
        moment = self.time_of_timeout(owner)
        return moment is not None and self.is_over(moment)

    def time_of_timeout(self, owner: int) -> float | None:
        """Return when that will be; None if never, or without a receiver."""
        if owner >= 0:
            since, limit = self.stations[owner].active_since, self.stations[owner].leaf.options.active_for_s
        else:
            since, limit = self.box_since[-2 - owner], self.structure.boxes[-2 - owner].options.active_for_s
        if since is None or limit is None or not self.lines_from(owner, "event", "timeout"):
            return None
        return float(since + limit)

    def take_timer(self, move: Move) -> None:
        """Do what a timer was set for."""
        if move.edge:
            self.labels[move.edge].operators.advance(self.now)
        elif move.number:
            self.leave_behind(self.task_of(move))
        else:
            owner = self.paths[move.node]
            if self.times_out(owner):
                self.time_activity_out(owner)
            elif owner >= 0:
                self.stations[owner].resting_until = None
                self.restart(self.stations[owner])
        self.settle()

    def time_activity_out(self, owner: int) -> None:
        """A12: once for each unbroken activity; it takes the right of A3 away."""
        if owner >= 0:
            station = self.stations[owner]
            station.active_since = None
            for flight in station.flights:
                flight.right = False
        else:
            self.box_since[-2 - owner] = None
        self.trigger(owner, "timeout")

    def grow(self, line: Line) -> None:
        """F8: one more place, unless the limit forbids it."""
        limit = line.edge.capacity_limit
        if limit is not None and line.capacity >= limit:
            self.fail_run(QueueLimit(f'the queue of "{line.edge.label}" would grow over its limit of {limit}'))
            return
        line.capacity += 1
        self.observe(QueueGrown(self.now, line.edge.label, line.capacity))
        self.settle()

    def give_up(self) -> None:
        """R5: they count as ended from now on."""
        for station in self.sources_to_give_up():
            station.given_up = station.ending = station.ended = True
        self.settle()

    def complete_all(self) -> None:
        """P9: all events complete before the run ends."""
        for line in self.lines:
            if line.operators is not None and not line.completed:
                line.completed = True
                line.operators.complete()
                self.note_places()
        self.settle()

    def end_events(self) -> None:
        """F13: END on all of them at the same moment."""
        for line in self.events_to_end():
            line.given_end = True
            self.enqueue(line, Token(END, 0, self.now), line.edge.source.owner)
        self.settle()

    def finish(self, outcome: str) -> None:
        """End the run; what is left by one that was cut short is dropped."""
        if self.outcome is not None:
            return
        self.outcome = outcome
        if outcome == "stalled":
            self.error = Stalled(f"nothing can move any more: {', '.join(self.stalled())}")
        self.end_code()
        ended = self.close()
        torn_down = [self.tear_down_at_last(station) for station in reversed(self.stations)]
        for line in self.lines if outcome in ("stopped", "until") else ():
            for lying in line.queue:
                self.observe(TokenDropped(self.now, line.edge.label, lying.token, "stopped"))
        if not (ended and all(torn_down)) and outcome in ("done", "stopped", "until"):
            self.outcome = "failed"
        self.observe(RunEnded(self.now, self.outcome))

    def end_code(self) -> None:
        """X3: all running code is cancelled and may take its time, within one limit for all of it."""
        until = self.now + TEARDOWN_LIMIT_S
        code: dict[Flight | Task, Any] = {}
        for station in self.stations:
            code |= {flight: flight.task for flight in station.flights if flight.task is not None}
            code |= {task: task.code for task in station.tasks}
            for task in station.tasks:
                task.cancelled = True
        with self.amid_code():
            for one in code.values():
                one.cancel()
        while not all(one.done() for one in code.values()):
            turn = next((owner for owner in self.loop.owners_in_turn() if owner in code), None)
            if turn is not None:
                with self.amid_code():
                    self.loop.step(turn)
                continue
            times = [self.loop.next_time_of(owner) for owner in code]
            due = min((time for time in times if time is not None), default=until + 1)
            self.now = min(until, max(self.now, round(due, 9)))
            if due > until:
                return
            self.loop.ring()

    def tear_down_at_last(self, station: Station) -> bool:
        """X3: in the reverse order of setup, each within its time limit; whether it went well."""
        hook = station.node._hook("teardown") if station.set_up and station.leaf.inside is None else None
        station.set_up = False
        return hook is None or self.run_within(hook, TEARDOWN_LIMIT_S)

    def close(self) -> bool:
        """Discard work in progress. Return whether all tasks have ended well.

        By hand only for a run that is not taken to its end.
        """
        for station in self.stations:
            for flight in station.flights:
                self.abandon(flight)
        ended = [self.abandon_tasks(station) for station in self.stations]
        self.loop.close_tasks()  # those that the code of nodes has left behind
        return all(ended)

    def fail_run(self, error: BaseException, outcome: str = "failed") -> None:
        """End the run in failure."""
        if self.outcome is None:
            self.error = error
            self.finish(outcome)

    # --- what the world outside may do

    def feed_once(self, name: str) -> None:
        """Put what is next for an input of the graph."""
        value, activity = self.feeding[name].pop(0)
        lines = self.lines_from(ROOT, "output", name)
        self.send(ROOT, [(line, NO_MESSAGE if value is None else value, activity, self.now) for line in lines])

    def read_once(self, line: Line) -> None:
        """Take what lies at an output of the graph, or of the inside of an iterating subgraph."""
        token = line.queue.pop(0).token
        target = line.edge.target
        self.observe(TokenTaken(self.now, line.edge.label, token))
        self.note_processed(line)
        if not token.is_marker and target.owner == ROOT:
            self.collected.setdefault(target.name, []).append(token.value)
        elif not token.is_marker:
            flight = self.stations[boundary_of(0) - target.owner].flight
            if flight is not None:
                flight.results[target.name].append(token.value)
        self.settle()

    def feed(self, name: str, value: Any, activity: int | None = None) -> None:
        """Bring a token in as soon as the graph's input is free (P10); END closes it."""
        self.feeding.setdefault(name, []).append((value, activity))

    def call_from_outside(self, path: str, slot: str, value: Any = None, activity: int = 0) -> None:
        """Bring a signal into a slot, as if by an active edge."""
        label = f"outside -> {path}.{slot}" if path else f"outside -> {slot}"
        line = self.labels.get(label)
        if line is None:
            ends = End(ROOT, "event", "outside"), End(self.paths[path], "slot", slot)
            edge = Edge(len(self.lines), label, *ends, True, 16, "wait", None, (), (), ())
            line = self.labels[label] = Line(edge, edge.capacity)
            self.take_lines([*self.lines, line])
        if self.is_live(line):
            self.enqueue(line, Token(value, activity, self.now), ROOT)
        self.settle()

    def set_from_outside(self, path: str, parameter: str, value: Any) -> None:
        """Set a parameter between firings (P8).

        Raises:
          UsageError: the code that runs could not see it any more.
        """
        station = self.stations[self.paths[path]]
        if station.type.is_function and station.iterator is not None:
            raise UsageError(
                f'"{path}.{parameter}" is an argument of a generator function, which reads it only as it begins; '
                "reset the node with the same edit, or make it a class and read self." + parameter
            )
        if not (station.is_calling if station.is_concurrent else station.flights):
            self.set_parameter(station, parameter, value)
        else:
            station.to_set.append((parameter, value))
        self.settle()

    def trigger_from_outside(self, path: str, event: str, value: Any = None, activity: int | None = None) -> None:
        """Trigger an event as its node would, with the time as stamp."""
        self.trigger(self.paths[path], event, value, activity)
        self.settle()

    def reset_activity(self) -> None:
        """A14: all A(v) := 0, modifiers on edges := 0, the right of A3 ends, then `start` is triggered."""
        for line in self.lines:
            for lying in line.queue:
                lying.token = Token(lying.token.value, 0, lying.token.stamp, lying.token.sequence)
        for station in self.stations:
            station.drained_modifiers = [0 for _ in station.drained_modifiers]
            for flight in station.flights:
                flight.right = False
            if station.active:
                station.active = station.node._active = False
                station.active_since = None
                station.changes.append((self.next_tick(), "deactivated", None, None))
                self.observe(ActivityChanged(self.now, station.path, False, "reset"))
                self.follow_activity(station)
        self.settle()
        self.trigger(ROOT, "start", activity=1)
        self.settle()
