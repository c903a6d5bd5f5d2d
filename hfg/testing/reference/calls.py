"""Slot calls, and what the automatic slots do (rules F6, F9, F10, A7, A9, A10, G2, X1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from hfg.base.token import Token
from hfg.errors import Aborted, NodeError
from hfg.testing.reference.state import Flight, Line, Lying, Station
from hfg.testing.reference.structure import ROOT, boundary_of, is_box
from hfg.testing.reference.tasks import Tending
from hfg.trace import CallEnded, CallStarted, ErrorRaised, FiringEnded, NodeEnabled, TokenProcessed, TokenTaken


class Calling(Tending):
    """A machine whose slots can be called."""

    def start_call(self, owner: int, line: Line) -> None:
        """Take the oldest token and work on it: activity first, then the handler (A6, A7)."""
        lying = line.queue.pop(0)
        name = line.edge.target.name
        number = self.count_call(owner)
        self.observe(CallStarted(self.now, self.path_of(owner), number, name, line.edge.label))
        self.observe(TokenTaken(self.now, line.edge.label, lying.token))
        if not line.edge.is_event:
            line.unprocessed += 1
            if self.is_pipelined(line):  # its place is free from now on (F6)
                self.process(line)
        if is_box(owner) and lying.token.activity == 1:  # it has no activity but that of its nodes (G2)
            self.lose_activity(line.edge.label)
        if owner < 0:
            self.calling_boxes.add(owner)

            def over() -> None:
                self.calling_boxes.remove(owner)
                self.observe(CallEnded(self.now, self.path_of(owner), number, "done"))
                if not line.edge.is_event and line.unprocessed:
                    self.process(line)
                self.settle()

            self.call_of_whole(owner, name, over)
            return
        station = self.stations[owner]
        flight = Flight(station, "call", number, "call", lying.token.stamp, slot=name, line=line)
        station.flights.append(flight)
        self.receive_activity(owner, [lying.token.activity])
        self.note_places()  # a queue may have room again
        if name in station.type.slots:  # otherwise after the automatic slot (A7)
            self.settle()
        self.launch_call(flight, self.handler_of(station, name, lying.token))
        self.settle()

    def count_call(self, owner: int) -> int:
        """Number the calls of a node."""
        if owner >= 0:
            self.stations[owner].calls += 1
            return self.stations[owner].calls
        self.box_calls[owner] = self.box_calls.get(owner, 0) + 1
        return self.box_calls[owner]

    def path_of(self, owner: int) -> str:
        """The path of a node, of a subgraph, or "" for the graph."""
        if owner >= 0:
            return self.stations[owner].path
        if is_box(owner):
            return self.structure.boxes[-2 - owner].path
        return "" if owner == ROOT else self.stations[boundary_of(0) - owner].path

    def handler_of(self, station: Station, name: str, token: Any) -> Callable[[], Any]:
        """What runs: an automatic slot of A9, the node's own handler, or the setting of a parameter (P8)."""
        index = station.leaf.index
        if name in station.type.parameters and name not in station.type.slots:
            return lambda: self.set_parameter(station, name, token.value)
        if name in station.type.slots:
            if station.type.slots[name].while_active and not station.active:  # T4: not any more, or not yet
                return lambda: None
            call = station.node._slot_call(name)
            return lambda: call(token)
        actions: dict[str, Callable[[], None]] = {
            "enable": lambda: self.enable(index),
            "disable": lambda: self.disable(index),
            "reset": lambda: self.reset(station),
            "activate": lambda: self.set_active(index, True, "slot"),
            "deactivate": lambda: self.deactivate(index),
        }
        return actions[name]

    def launch_call(self, flight: Flight, handler: Callable[[], Any]) -> None:
        """Run the handler where its group runs.

        A handler that tears the node down runs after its firings (F14) and tasks.
        """
        station = flight.station
        automatic = flight.slot not in station.type.slots
        if automatic and self.begins_afresh(flight) and (station.is_flying or station.tasks):
            if not station.is_flying:
                self.cancel_tasks(station)
            flight.when_rested = lambda: self.launch_call(flight, handler)
            return
        # `setup` and `teardown` run where the node does
        at_once = automatic and flight.slot not in ("reset", "enable")
        self.begin_in_group(flight, at_once or (not automatic and self.is_async_slot(flight)))
        if not (automatic and flight.in_thread):
            self.launch(flight, handler, lambda _, error: self.end_call(flight, error))
            return

        def set_up_there(_: Any, error: BaseException | None) -> None:
            handler()
            self.end_call(flight, error)

        self.launch(flight, lambda: None, set_up_there)

    def begins_afresh(self, flight: Flight) -> bool:
        """Return whether what an automatic slot does begins with a teardown (A9, F10)."""
        index = flight.station.leaf.index
        if flight.slot == "reset":
            return flight.station.resting_until is None or flight.station.is_flying
        return flight.slot == "enable" and not self.is_enabled(index) and self.is_enabled_around(index)

    def is_async_slot(self, flight: Flight) -> bool:
        """Return whether the handler may wait."""
        return bool(flight.station.type.slots[flight.slot].is_async)

    def end_call(self, flight: Flight, error: BaseException | None) -> None:
        """Automatic events follow, then the call is over and its token processed (F6)."""
        station = flight.station
        if error is not None and not self.fail_call_of(station, f"slot {flight.slot}, call {flight.number}", error):
            return
        self.settle()  # subgraphs around the node come first
        self.flush_changes(station)
        self.observe(CallEnded(self.now, station.path, flight.number, "done" if error is None else "failed"))
        station.flights.remove(flight)
        station.unready = False
        line = flight.line
        if line is not None and not line.edge.is_event and line.unprocessed:
            self.process(line)
        self.be_idle(station)

    def fail_call_of(self, station: Station, what: str, error: BaseException) -> bool:
        """A failed slot call is only counted, unless the policy is to stop; False if the run is over."""
        policy = station.leaf.options.on_error
        failure = NodeError(station.path, what, error)
        self.observe(ErrorRaised(self.now, station.path, what, str(failure), policy))
        if policy == "stop":
            station.flights = station.firings_under_way
            self.fail_run(failure)
            return False
        return True

    # --- A9's slots

    def deactivate(self, index: int) -> None:
        """Take A(v), and the right of A3 with it."""
        for flight in self.stations[index].flights:
            flight.right = False
        self.set_active(index, False, "slot")

    def call_of_whole(self, owner: int, name: str, then: Callable[[], None]) -> None:
        """Slots of the graph (A10) and of subgraphs (G2); `then` follows when all is done."""
        if owner == ROOT:
            if name == "stop":
                self.finish("stopped")
            else:
                self.fail_run(Aborted("the slot abort was called"), "aborted")
        elif name == "enable":
            self.enable(owner)
        elif name == "disable":
            self.disable(owner)
        elif name == "deactivate":
            self.quench(-2 - owner, "slot")
        else:
            self.reset_each(iter(self.members_of(owner)), then)
            return
        then()

    def reset_each(self, stations: Iterator[Station], then: Callable[[], None]) -> None:
        """One after the other; a node within a firing or call follows later, and the others do not wait for it (G2)."""
        for station in stations:
            if station.is_amid or station.tasks:
                station.afterwards = station.afterwards or "reset"
            elif self.closes_in_thread(station):
                flight = Flight(station, "call", 0, "reset", self.now, in_thread=True)
                station.flights.append(flight)
                self.launch(
                    flight, lambda: None, partial(self.end_reset, flight, lambda: self.reset_each(stations, then))
                )
                return
            else:
                self.reset(station)
        then()

    def closes_in_thread(self, station: Station) -> bool:
        """Whether its teardown has something to do in the thread of its group, for which others do not wait (R1)."""
        has_work = station.iterator is not None and not station.ending and station.type.process_kind == "generator"
        return has_work and station.set_up and self.structure.threads.get(station.leaf.options.group, 0) > 0

    def end_reset(self, flight: Flight, then: Callable[[], None], _result: Any, _error: BaseException | None) -> None:
        """The request of a subgraph around the node is done."""
        self.reset(flight.station)
        flight.station.flights.remove(flight)
        self.be_idle(flight.station)
        then()

    def reset(self, station: Station) -> None:
        """A9: it has not ended, so a pending end after firings whose turn has not come is cancelled (F14)."""
        for flight in [flight for flight in station.firings_under_way if flight.waits_to_end]:
            station.flights.remove(flight)
            self.observe(FiringEnded(self.now, station.path, flight.number, "abandoned"))
        self.restart(station)
        if station.leaf.inside is None:
            self.not_ended(station)

    def restart(self, station: Station) -> None:
        """Teardown and setup; tokens and A(v) stay. In a back-off that is done when it is over (X1)."""
        if station.leaf.inside is None and station.resting_until is None:
            self.tear_down(station)
            self.set_up(station)

    def not_ended(self, station: Station) -> None:
        """It starts over, and so do its events (P9); a restart does not have this effect (X1)."""
        station.ending = station.ended = station.given_up = False
        self.renew_operators(station)

    def set_up(self, station: Station) -> None:
        """Make the node as new: state, generator."""
        station.iterator = None
        station.unready = station.stops_itself = False
        station.set_up = True
        if station.leaf.inside is None:
            station.node._reset_states()
            hook = station.node._hook("setup")
            if hook is not None:
                station.opening = True
                self.run_hook(station, hook)
                station.opening = False
            if station.early is None and not self.is_enabled(
                station.leaf.index
            ):  # they last as long as its setup (F10)
                self.cancel_tasks(station)
            station.is_to_do = station.active
            self.begin_to_do(station)

    def tear_down(self, station: Station) -> None:
        """Close what `setup` opened."""
        self.abandon_tasks(station)
        if station.set_up and station.leaf.inside is None:
            hook = station.node._hook("teardown")
            if hook is not None:
                self.run_hook(station, hook)
        station.set_up = False

    # --- F10

    def members_of(self, owner: int) -> list[Station]:
        """The node itself, or all inside a subgraph."""
        if owner >= 0:
            return [self.stations[owner]]
        return [self.stations[member] for member in self.structure.boxes[-2 - owner].members]

    def enable(self, owner: int) -> None:
        """Rule F10: start over; A(v) is kept."""
        members = self.members_of(owner)
        before = [self.is_enabled(station.leaf.index) for station in members]
        if self._set_enabled(owner, True):
            for station, was in zip(members, before, strict=True):
                if was or not self.is_enabled(station.leaf.index):
                    continue
                if station.is_flying or (is_box(owner) and station.is_calling):
                    station.afterwards = "enable"
                else:
                    self.reset(station)
            self.settle()

    def disable(self, owner: int) -> None:
        """Rule F10: tokens on the inputs and in the queues are discarded, and untaken tokens of the outputs."""
        members = self.members_of(owner)
        before = [self.is_enabled(station.leaf.index) for station in members]
        if self._set_enabled(owner, False):
            for station in members:
                station.afterwards = station.afterwards.replace("enable", "")
            for station, was in zip(members, before, strict=True):
                if was and not self.is_enabled(station.leaf.index):
                    self._silence(station)
            if is_box(owner):
                shut = [-2 - box.index for box in self.structure.boxes if -2 - owner in (*box.boxes, box.index)]
                self._empty(lambda line: line.edge.target.owner in shut and line.edge.target.name != "enable")
            self.settle()

    def _set_enabled(self, owner: int, enabled: bool) -> bool:
        before = self.is_enabled(owner)
        if owner >= 0:
            changed = self.stations[owner].enabled != enabled
            self.stations[owner].enabled = enabled
        else:
            changed = self.box_enabled[-2 - owner] != enabled
            self.box_enabled[-2 - owner] = enabled
        if self.is_enabled(owner) != before:  # inside a disabled subgraph this is not visible yet
            self.observe(NodeEnabled(self.now, self.path_of(owner), enabled))
        return changed

    def _silence(self, station: Station) -> None:
        index = station.leaf.index
        self.cancel_tasks(station)
        for flight in station.firings_under_way:
            flight.void = True
        for line in self.lines:  # no node waits for tokens that it has taken
            if line.edge.target.owner == index and line.edge.target.name != "enable" and line.unprocessed:
                self.process(line)
        self._empty(lambda line: line.edge.target.owner == index and line.edge.target.name != "enable")
        self._empty(lambda line: line.edge.source.owner == index and not line.edge.is_event)

    def lay(self, line: Line) -> None:
        """Lay the initial tokens of an edge (P7); at a node that is disabled they are discarded (F10)."""
        for value in line.edge.initial:
            line.queue.append(Lying(Token(value, 0, self.now, 0), self.next_tick(), line.edge.source.owner))
        source, target = line.edge.source.owner, line.edge.target.owner
        shut = target >= 0 and not self.is_enabled(target)
        if shut or (source >= 0 and not self.is_enabled(source) and not line.edge.is_event):
            self._empty(lambda one: one is line)

    def _empty(self, which: Callable[[Line], bool]) -> None:
        for line in self.lines:
            if which(line):
                occupied = line.is_waited_for and bool(line.queue)
                for lying in list(line.queue):
                    self.discard(line, lying, "disabled")
                if occupied:
                    self.observe(TokenProcessed(self.now, line.edge.label))

    def finish(self, outcome: str) -> None:
        """End the run."""
        raise NotImplementedError

    def fail_run(self, error: BaseException, outcome: str = "failed") -> None:
        """End the run in failure."""
        raise NotImplementedError
