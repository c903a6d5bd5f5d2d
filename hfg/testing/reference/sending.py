"""The handling of tokens that leave, and of their activity (rules T1-T5, P5, F3, F12, A3-A9).

One sending is all edges of one output set, or of one trigger. It is put in full before anything follows from it; what
follows (automatic events, tokens that are processed at once, outputs that become free) is done by `settle` until
nothing changes.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any, Literal

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import QueueOverflow
from hfg.testing.reference.operators import Operators
from hfg.testing.reference.state import Flight, Line, Lying, State, Station
from hfg.testing.reference.structure import ROOT, is_box
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    EventTriggered,
    NodeEnded,
    TokenDrained,
    TokenDropped,
    TokenProcessed,
    TokenSent,
    TraceEvent,
)

Shipment = tuple[Line, Any, int | None, float]
"""One token to be put: where, its value or marker, its explicit modifier if any, its stamp."""

Cause = Literal["token", "sent", "slot", "reset", "returned"]


class Sending(State):
    """A state whose tokens move."""

    def observe(self, event: TraceEvent) -> None:
        """Write down what an observer sees."""
        self.observed.append(event)

    def next_tick(self) -> int:
        """Number the moments, for the order of F9."""
        self.tick += 1
        return self.tick

    # --- one sending

    def send(self, sender: int, shipments: Iterable[Shipment], flight: Flight | None = None) -> None:
        """Put all tokens of one sending, slots first; then A(sender) follows (A3, A5), and all that comes of it."""
        self.put_together(sender, shipments, flight)
        self.settle()

    def put_together(self, sender: int, shipments: Iterable[Shipment], flight: Flight | None = None) -> None:
        """Put all tokens of one sending; nothing comes of it yet."""
        ordered = sorted(shipments, key=lambda shipment: not self.is_called(shipment[0]))
        gives = self.is_active(sender) or (flight is not None and flight.right)
        gave = False
        for line, value, explicit, stamp in ordered:
            if not self.is_live(line):
                continue
            modifier = 0
            if line.edge.active and value is not NO_MESSAGE:
                modifier = int(gives) if explicit is None else explicit  # A3, A4
                gave |= gives and modifier == 1  # A5: by the one or the other
            self.put(line, Token(value, modifier, stamp), sender)
        if gave:
            self.take_activity(sender, flight)

    def take_activity(self, sender: int, flight: Flight | None) -> None:
        """A5, and for a subgraph: activity that leaves by its events is taken from everything inside (G2)."""
        if sender >= 0:
            if self.stations[sender].active and flight is not None:
                flight.right = True
            self.set_active(sender, False, "sent")
        elif is_box(sender):
            self.quench(-2 - sender, "sent")

    def quench(self, box: int, cause: Cause) -> None:
        """Take the activity from everything inside a subgraph, including tokens in transit."""
        for line in self.lines_inside(box):
            for lying in line.queue:
                if lying.token.activity == 1:
                    lying.token = _with(lying.token, activity=0)
        for member in self.structure.boxes[box].members:
            for flight in self.stations[member].flights:
                flight.right = False
            self.stations[member].drained_modifiers = [0 for _ in self.stations[member].drained_modifiers]
            self.set_active(member, False, cause)

    def put(self, line: Line, token: Token[Any], sender: int) -> None:
        """Put one token on an edge, or hand it to the operators in front of its queue."""
        if line.operators is not None:
            if not line.completed:
                line.operators.push(_with(token, activity=0))
            else:
                self.observe(TokenDropped(self.now, line.edge.label, _with(token, activity=0), "ended"))
            return
        self.enqueue(line, token, sender)

    def enqueue(self, line: Line, token: Token[Any], sender: int) -> None:
        """Assign the token its number and its place in the queue; a full queue follows its policy (P5)."""
        line.sequence += 1
        token = _with(token, sequence=line.sequence)
        policy = line.edge.overflow
        if line.given_end and token.value is not END:  # tokens after END are dropped (F13)
            self.observe(TokenSent(self.now, line.edge.label, token))
            self.observe(TokenDropped(self.now, line.edge.label, token, "ended"))
            if token.activity == 1:
                self.returning.append((line, sender))
            return
        if token.activity != 1 and self.is_deaf(line):  # T4
            self.observe(TokenSent(self.now, line.edge.label, token))
            line.queue.append(Lying(token, self.next_tick(), sender, self.now, unheard=True))
            return
        full = line.edge.is_event and len(line.queue) >= line.capacity
        if full and policy in ("drop_oldest", "latest"):
            self.observe(TokenDropped(self.now, line.edge.label, line.queue.pop(0).token, "overflow"))
        self.observe(TokenSent(self.now, line.edge.label, token))
        if full and policy in ("drop_newest", "error"):  # "error": only of operators, whose output has no caller
            self.observe(TokenDropped(self.now, line.edge.label, token, "overflow"))
            return
        line.queue.append(Lying(token, self.next_tick(), sender, self.now))
        if not line.edge.is_event and line.slack and line.under_way <= line.slack:
            self.observe(TokenProcessed(self.now, line.edge.label))  # a delay or a buffer ends the wave (P7, P4)

    # --- events

    def trigger(
        self,
        owner: int,
        name: str,
        value: Any = None,
        activity: int | None = None,
        stamp: float | None = None,
        flight: Flight | None = None,
    ) -> None:
        """Trigger an event: one sending of its own.

        Raises:
          QueueOverflow: an edge with policy "error" is full; nothing was sent.
        """
        if self.outcome is not None:
            return  # code that ends with the run cannot send any more
        value, activity, stamp = passed_on(value, activity, stamp)
        if stamp is None:
            stamp = self.now if flight is None else flight.stamp
        if owner >= 0 and (early := self.stations[owner].early) is not None:
            early.append((name, value, activity, stamp))
            return
        lines = self.lines_from(owner, "event", name)
        for line in lines:
            if (
                line.edge.overflow == "error"
                and self.is_live(line)
                and line.operators is None
                and not line.given_end
                and len(line.queue) >= line.capacity
            ):
                raise QueueOverflow(f'"{line.edge.label}" holds {line.capacity} signals and takes no more')
        if lines or not self.is_automatic(owner, name):
            path = self.event_path(owner, name)
            self.observe(EventTriggered(self.now, path, Token(value, activity or 0, stamp)))
        self.send(owner, [(line, value, activity, stamp) for line in lines], flight)

    def is_automatic(self, owner: int, name: str) -> bool:
        """Return whether the event is automatic (A9)."""
        return is_box(owner) or (owner >= 0 and name not in self.stations[owner].type.events)

    def event_path(self, owner: int, name: str) -> str:
        """The event's path."""
        if owner == ROOT:
            return name
        return f"{self.stations[owner].path if owner >= 0 else self.structure.boxes[-2 - owner].path}.{name}"

    # --- activity

    def set_active(self, owner: int, active: bool, cause: Cause) -> None:
        """Change A(v): it is seen, restarts the time-out (A12), is told to the code, raises an automatic event (A9)."""
        station = self.stations[owner]
        if station.active == active:
            return
        station.active = station.node._active = active
        station.active_since = self.now if active else None
        self.observe(ActivityChanged(self.now, station.path, active, cause))
        station.changes.append((self.next_tick(), "activated" if active else "deactivated", None, None))
        self.note_places(gated=True)  # a gate that opens gives a place at once
        hook = station.node._hook("on_activated" if active else "on_deactivated")
        if hook is not None:
            self.run_hook(station, hook)
        self.follow_activity(station)

    def follow_activity(self, station: Station) -> None:
        """A15: begin or cancel the do-activity."""
        raise NotImplementedError

    def run_hook(self, station: Station, hook: Any) -> None:
        """Run a hook to its end."""
        raise NotImplementedError

    def receive_activity(self, owner: int, modifiers: list[int]) -> None:
        """A6: the tokens of one firing together; only the net change counts."""
        if owner < 0:
            return
        active = self.stations[owner].active
        if -1 in modifiers:
            active = False
        if 1 in modifiers:
            active = True
        self.set_active(owner, active, "token")

    def flush_changes(self, station: Station) -> None:
        """Send the automatic events that arose, each a sending of its own: +1 only if the node is active right then."""
        while station.changes:
            _, name, value, stamp = station.changes.pop(0)
            self.trigger(station.leaf.index, name, value, stamp=stamp)

    # --- discarding

    def discard(
        self, line: Line, lying: Lying, reason: Literal["overflow", "disabled", "ended", "removed", "stopped"]
    ) -> None:
        """Throw a token away; activity on it goes back to its sender (A8)."""
        line.queue.remove(lying)
        self.observe(TokenDropped(self.now, line.edge.label, lying.token, reason))
        if lying.token.activity == 1 and reason == "disabled":
            self.give_back(line, lying.sender)

    def give_back(self, line: Line, sender: int) -> None:
        """Activity that got nowhere goes back to its sender, or its loss is counted (A8)."""
        if sender >= 0:
            self.set_active(sender, True, "returned")
        else:
            self.lose_activity(line.edge.label)

    def lose_activity(self, where: str) -> None:
        """Count an activity that no node can receive (A8)."""
        self.lost_activity += 1
        self.observe(ActivityLost(self.now, where))

    # --- what follows by itself

    def settle(self) -> None:
        """Do what rules want "at once", until nothing changes; then see who is enabled now."""
        going = self.outcome is None  # what is over speaks no more
        while going:
            while self.returning:
                self.give_back(*self.returning.pop(0))
            while self.drain_once():
                pass
            self.note_places()
            going = self.release_once() or self.leave_once() or self.end_once() or self.flush_once()

    def drain_once(self) -> bool:
        """Markers into slots, and tokens for nodes that are ending, are processed at once (T4, F12)."""
        for line in self.lines:
            target = line.edge.target
            if not line.queue or self.is_outside(target.owner):
                continue
            unheard = next((lying for lying in line.queue if lying.unheard), None)
            if unheard is not None:
                line.queue.remove(unheard)
                self.observe(TokenDrained(self.now, line.edge.label, unheard.token))
                self.receive_activity(target.owner, [unheard.token.activity])
                return True
            marker = self.is_called(line) and line.queue[0].token.is_marker
            ended = target.owner >= 0 and self.stations[target.owner].ending and line in self.lines_joined(target.owner)
            if not marker and not ended:
                continue
            token = line.queue.pop(0).token
            self.observe(TokenDrained(self.now, line.edge.label, token))  # says that it is processed, too
            if ended and not self.stations[target.owner].ended:
                self.stations[target.owner].drained_modifiers.append(token.activity)
            else:
                self.receive_activity(target.owner, [token.activity])
            return True
        return False

    def note_processed(self, line: Line) -> None:
        """Say that a synchronous edge is free again, if a token was taken from it."""
        if line.edge.is_event:
            return
        if not line.slack or line.under_way == line.slack:
            self.observe(TokenProcessed(self.now, line.edge.label))

    def release_once(self) -> bool:
        """Tokens taken by a sequential firing are processed when its own tokens are (F5)."""
        for station in self.stations:
            if (
                station.owed
                and self.outputs_are_free(station.leaf.index)
                and not (station.ending and not station.ended)
            ):
                owed, station.owed = station.owed, []
                for line in owed:
                    self.process(line)
                return True
        return False

    def process(self, line: Line) -> None:
        """Count one taken token as processed."""
        if not line.delay and line.unprocessed:  # otherwise the node was disabled meanwhile
            line.unprocessed -= 1
            self.note_processed(line)

    def leave_once(self) -> bool:
        """Outputs of a firing that is over leave in its turn, as soon as those before have been processed (F14)."""
        for station in self.stations:
            if not station.flights or any(flight.leaving for flight in station.flights):
                continue  # nothing, or after it
            firings = station.firings_under_way
            over = sorted((one for one in firings if one.over is not None), key=lambda one: one.over_since)
            void = [one for one in over if one.void]  # sends nothing, so it need not wait (F10)
            if not void and station.leaf.options.ordered and over and over[0] is not firings[0]:
                over = [one for one in firings[:1] if one.over is not None]
            if over and self.may_leave(one := (void or over)[0]):
                self.leave(one)
                return True
        return False

    def may_leave(self, flight: Flight) -> bool:
        """Return whether nothing lies where the outputs of the firing go."""
        says_nothing = flight.void or (flight.over is not None and flight.over[0] == "ended" and not flight.writes)
        return says_nothing or self.outputs_are_free(flight.station.leaf.index)

    def leave(self, flight: Flight) -> None:
        """Send the outputs of a firing that is over."""
        raise NotImplementedError

    def end_once(self) -> bool:
        """END follows on all outputs as soon as they are free (F4); then drained modifiers act (F12)."""
        for station in self.stations:
            index = station.leaf.index
            busy = station.firings_under_way if station.is_concurrent else station.flights
            if station.ending and not station.ended and not busy and self.outputs_are_free(index):
                lines = self.in_order_of_outputs(station)
                self.put_together(index, [(line, END, None, station.stamp) for line in lines])
                while self.drain_once():  # including its own END in a cycle
                    pass
                station.ended = True
                self.observe(NodeEnded(self.now, station.path))
                self.note_places()  # of those who wait for END, before anything else is sent (F9)
                waiting, station.drained_modifiers = station.drained_modifiers, []
                for modifier in waiting:
                    self.receive_activity(index, [modifier])
                if not station.flights:
                    self.flush_changes(station)  # report the changes of its end before its events complete (F12)
                    self.note_places()
                self.complete_operators(station)
                return True
        return False

    def complete_operators(self, station: Station) -> None:
        """P9: when the event's node has ended, the event completes."""
        for line in self.lines_sent(station.leaf.index):
            if line.operators is not None and not line.completed:
                line.completed = True
                line.operators.complete()
                self.note_places()  # what came out of one enables before what comes out of the next (F9)

    def in_order_of_outputs(self, station: Station) -> list[Line]:
        """The synchronous edges of a node: outputs as declared, then parameters, each in order of connecting."""
        order = [("output", name) for name in station.type.outputs] + [
            ("parameter", name) for name in station.type.parameters
        ]
        return [line for kind, name in order for line in self.lines_from(station.leaf.index, kind, name)]

    def flush_once(self) -> bool:
        """Automatic events of changes outside a firing or call; then those of subgraphs (G2)."""
        waiting = [
            station
            for station in self.stations
            if station.changes and not (station.is_calling if station.is_concurrent else station.flights)
        ]
        if waiting:
            first = min(waiting, key=lambda station: station.changes[0][0])
            _, name, value, stamp = first.changes.pop(0)
            self.trigger(first.leaf.index, name, value, stamp=stamp)
            return True
        for box in reversed(self.structure.boxes):  # inner ones first
            active = self.is_active(-2 - box.index)
            if active != self.box_active[box.index] and not self.is_amid(box.index):
                self.box_active[box.index] = active
                self.box_since[box.index] = self.now if active else None
                self.trigger(-2 - box.index, "activated" if active else "deactivated")
                return True
        return False

    def is_amid(self, box: int) -> bool:
        """Return whether an inner node is within a step, so that the subgraph's activity is not checked yet."""
        return False

    def moot_sources(self) -> set[int]:
        """Sources that work for ended nodes only (R5)."""
        raise NotImplementedError

    def note_places(self, *, gated: bool = False) -> None:
        """Assign a place to each node that has become enabled for a firing, and take it from those that are not (F9).

        Args:
          gated: look only at those that a gate is set on.
        """
        behind = {index for gate in self.structure.gates for index in gate.targets}
        moot = self.moot_sources()
        for station in self.stations:
            if gated and station.leaf.index not in behind:
                continue
            if not self.may_fire(station.leaf.index):
                station.place = None
            elif station.place is None:
                station.place = self.next_tick()
                station.timed = self.now if self.in_timers else None
            if self.is_next(station) and not self.says_ready(station):  # asked last, and not before its turn
                station.place, station.unready = None, True
            station.rested |= station.place is not None and station.leaf.index in moot

    def is_next(self, station: Station) -> bool:
        """Return whether a firing is the next thing that the node does (F9)."""
        line = self.next_call(station.leaf.index)
        return (
            station.place is not None
            and not station.flights
            and not station.afterwards
            and (line is None or line.queue[0].place > station.place)
        )

    def make_operators(self) -> None:
        """Put the operators of P9 in front of their queues."""
        for line in self.lines:
            if line.edge.through:
                self._make_operators(line)

    def renew_operators(self, station: Station) -> None:
        """P9: when the node starts over, so do the completed operators of its events."""
        for line in self.lines:
            if line.edge.source.owner == station.leaf.index and line.completed:
                line.completed = False
                self._make_operators(line)

    def _make_operators(self, line: Line) -> None:
        line.operators = Operators(line.edge.through, partial(self._out_of_operators, line))
        line.operators.tell_time(self.now)
        line.operators.connect()

    def _out_of_operators(self, line: Line, token: Token[Any]) -> None:
        if self.reaches(line):
            self.enqueue(line, token, line.edge.source.owner)


def passed_on(value: Any, activity: int | None, stamp: float | None) -> tuple[Any, int | None, float | None]:
    """A4: a token passed on keeps its stamp, and a modifier if it has one; one with a = 0 counts as its value."""
    if type(value) is Token:
        activity = (value.activity or None) if activity is None else activity
        stamp = value.stamp if stamp is None else stamp
        value = value.value
    return value, activity, stamp


def _with(token: Token[Any], *, activity: int | None = None, sequence: int | None = None) -> Token[Any]:
    return Token(
        token.value,
        token.activity if activity is None else activity,
        token.stamp,
        token.sequence if sequence is None else sequence,
    )
