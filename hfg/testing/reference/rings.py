"""Rings that only full queues close (rule F8), literally by the rule: slowly, from scratch at each step.

A *deed* is something that can be waited for: that a node fires, is called, triggers, ends what it does, or has room.
All that are waited for are collected, those that may come about are crossed out until nothing changes, and of what is
left a ring is all that waits for each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from hfg.testing.reference.edits import Editing
from hfg.testing.reference.state import Flight, Line, Station
from hfg.testing.reference.structure import ROOT, is_box


class _Deed(NamedTuple):
    """Whose, and what: "fire", "call", "tell", "finish", "room", "hear", or "happen" for what comes from outside."""

    owner: int
    what: str


class _Need(NamedTuple):
    """What a deed waits for: `how` is "all" of `deeds`, "any" of them, or "nothing"; any of none never comes about."""

    how: str
    deeds: frozenset[_Deed] = frozenset()


class Rings(Editing):
    """A machine that sees who waits for whom."""

    def queues_to_grow(self) -> list[Line]:
        """F8: of each ring its full queue with the smallest capacity; a ring that waits for another one comes later."""
        holders = [owner for owner in self.owners() if self.full_lines(owner)]
        if not holders:
            return []
        needs = self._stuck(_Deed(owner, "room") for owner in holders)
        behind = {deed: self._reach(deed, needs) for deed in needs}
        found: dict[frozenset[_Deed], Line] = {}
        for owner in holders:
            room = _Deed(owner, "room")
            ring = frozenset(one for one in behind.get(room, ()) if room in behind[one])
            full = [line for one in ring for line in self._full_of(one) if self._taking(line) in ring]
            if full:
                found[ring] = min(full, key=lambda line: (line.capacity, line.edge.index))
        return [
            line
            for ring, line in found.items()
            if not any(other != ring and other & behind[next(iter(ring))] for other in found)
        ]

    def owners(self) -> list[int]:
        """The graph, its subgraphs and its nodes."""
        return [ROOT, *(-2 - box.index for box in self.structure.boxes), *range(len(self.stations))]

    def is_held_back(self, owner: int) -> bool:
        """Return whether only a full queue holds it back: code that waits for room, a slot call, or its next firing."""
        if owner < 0:
            return self.next_call(owner) is not None
        station = self.stations[owner]
        if any(self._waits_for_room(station, work) for work in station.work):
            return True
        if station.resting_until is not None or station.afterwards:
            return False
        if not station.is_busy and self.may_fire(owner, ignore="queues"):
            return True
        busy = station.is_calling if station.is_concurrent else bool(station.flights)
        return not busy and self.next_call(owner) is not None

    def _full_of(self, deed: _Deed) -> list[Line]:
        held = deed.what == "room" and self.is_held_back(deed.owner)
        return self.full_lines(deed.owner) if held else []

    def _stuck(self, begin: Iterable[_Deed]) -> dict[_Deed, set[_Deed]]:
        """Return what can never come about, and what of that each waits for."""
        needs: dict[_Deed, _Need] = {}
        waiting = list(begin)
        while waiting:
            deed = waiting.pop()
            if deed not in needs:
                needs[deed] = self._need(deed)
                waiting += needs[deed].deeds
        possible: set[_Deed] = set()
        while more := {one for one in needs if one not in possible and self._comes_about(needs[one], possible)}:
            possible |= more
        return {deed: set(need.deeds) - possible for deed, need in needs.items() if deed not in possible}

    def _comes_about(self, need: _Need, possible: set[_Deed]) -> bool:
        if need.how == "any":
            return bool(need.deeds & possible)
        return need.deeds <= possible

    def _reach(self, begin: _Deed, needs: dict[_Deed, set[_Deed]]) -> set[_Deed]:
        seen: set[_Deed] = set()
        waiting = list(needs[begin])
        while waiting:
            deed = waiting.pop()
            if deed not in seen:
                seen.add(deed)
                waiting += needs[deed]
        return seen

    # --- what each deed waits for

    def _need(self, deed: _Deed) -> _Need:
        owner = deed.owner
        match deed.what:
            case "room":
                return _Need("all", frozenset(self._taking(line) for line in self.full_lines(owner)))
            case "call":
                return self._need_of_call(owner)
            case "hear":
                lines = [line for line in self.lines_called(owner) if self.is_live(line)]
                return _Need("any", frozenset(self._sending(line) for line in lines))
            case "tell":
                return self._need_of_signal(owner)
            case "fire":
                return self._need_of_firing(owner)
            case "finish":
                return self._need_of_end(owner)
        return _Need("all")

    def _need_of_firing(self, owner: int) -> _Need:
        station = self.stations[owner]
        at_work = [flight for flight in station.flights if self._is_at_work(flight)]
        if station.resting_until is not None or station.afterwards:
            return _Need("all")
        if any(flight.what == "firing" or station.is_concurrent for flight in at_work):
            return _Need("all")
        deeds = self._processing(owner)
        if station.ending and not station.ended and self.is_enabled(owner):
            return _Need("all" if deeds else "any", deeds)
        if not self._fires_ever(owner):
            return _Need("any")
        waited = [line for line in self.lines_joined(owner) if self.takes_part(line)]
        deeds |= {self._sending(line) for line in waited if not line.queue}
        if self.full_lines(owner) and self._is_held_by_queue(station, deeds):
            deeds |= {_Deed(owner, "room")}
        return _Need("all", deeds)

    def _fires_ever(self, owner: int) -> bool:
        """Return whether it would fire if all came that it waits for."""
        station = self.stations[owner]
        if station.ended or not self.is_enabled(owner) or owner in self.moot_sources():
            return False
        if station.type.process_kind == "none" and station.leaf.inside is None:
            return False
        waited = [line for line in self.lines_joined(owner) if self.takes_part(line)]
        connected = {line.edge.target.name for line in self.lines_joined(owner) if line.ended}
        connected |= {line.edge.target.name for line in waited}
        mandatory = {name for name, spec in station.type.inputs.items() if not spec.optional}
        return mandatory <= connected and (bool(waited) or station.type.is_source)

    def _is_held_by_queue(self, station: Station, deeds: frozenset[_Deed]) -> bool:
        """Whether F8 holds its next firing by itself: not in combination with a rate, a gate, `ready()` or a call."""
        index = station.leaf.index
        if any(self._waits_for_room(station, flight) for flight in station.flights):
            return True
        if station.unready or self.is_suspended_source(index) or station.is_calling:
            return False
        return bool(deeds) or not (self.is_held_by_time(index) or self.is_resting(index))

    def _need_of_call(self, owner: int) -> _Need:
        if owner in self.calling_boxes:
            return _Need("all")
        if owner >= 0:
            station = self.stations[owner]
            busy = any(self._is_at_work(flight) for flight in station.flights)
            if busy or station.resting_until is not None or station.afterwards:
                return _Need("all")
        deeds = {_Deed(owner, "room")} if self.full_lines(owner) else set()
        if self.next_call(owner) is None:
            deeds.add(_Deed(owner, "hear"))
        return _Need("all", frozenset(deeds))

    def _need_of_signal(self, owner: int) -> _Need:
        if owner == ROOT:
            return _Need("any")  # `start` was triggered, and no node waits for tokens from outside
        if is_box(owner):
            box = self.structure.boxes[-2 - owner]
            inner = {-2 - one.index for one in self.structure.boxes if box.index in one.boxes}
            return _Need(
                "any", frozenset({_Deed(owner, "call"), *(_Deed(one, "tell") for one in {*box.members, *inner})})
            )
        station = self.stations[owner]
        if any(not self._waits_for_room(station, task) for task in station.tasks):
            return _Need("all")
        deeds = {_Deed(owner, "call"), _Deed(owner, "fire")}
        if any(self._waits_for_room(station, work) for work in station.work):
            deeds.add(_Deed(owner, "room"))
        return _Need("any", frozenset(deeds))

    def _need_of_end(self, owner: int) -> _Need:
        if owner < 0:
            return _Need("all")
        station = self.stations[owner]
        if any(self._is_at_work(flight) for flight in station.flights):
            return _Need("all")
        deeds = self._processing(owner)
        if any(self._waits_for_room(station, flight) for flight in station.flights):
            deeds |= {_Deed(owner, "room")}
        return _Need("all", deeds)

    def _processing(self, owner: int) -> frozenset[_Deed]:
        """F5: what its outputs wait for."""
        occupied = [line for line in self.lines_out(owner) if self.is_occupied(line)]
        return frozenset(
            self._taking(line) if line.queue else _Deed(line.edge.target.owner, "finish") for line in occupied
        )

    def _sending(self, line: Line) -> _Deed:
        source = line.edge.source
        if source.kind == "observable" or (
            source.kind == "output" and (source.owner == ROOT or self.is_outside(source.owner))
        ):
            return _Deed(source.owner, "happen")
        if not line.edge.is_event:
            return _Deed(source.owner, "fire")
        ripening = line.operators is not None and line.operators.due() is not None
        if ripening or (source.name == "timeout" and self.time_of_timeout(source.owner) is not None):
            return _Deed(source.owner, "happen")
        return _Deed(source.owner, "tell")

    def _taking(self, line: Line) -> _Deed:
        target = line.edge.target
        if self.is_called(line):
            return _Deed(target.owner, "call")
        return _Deed(target.owner, "happen" if self.is_outside(target.owner) else "fire")

    def _is_at_work(self, flight: Flight) -> bool:
        """Return whether a firing or call is in progress that waits neither for room nor for the firings before it."""
        if flight.over is not None or flight.waits_to_end:
            return False
        return not self._waits_for_room(flight.station, flight)

    def _waits_for_room(self, station: Station, work: object) -> bool:
        return bool(getattr(work, "waiting_for", "")) and self.has_no_room(station)

    def time_of_timeout(self, owner: int) -> float | None:
        """When a time-out of A12 will be due."""
        raise NotImplementedError
