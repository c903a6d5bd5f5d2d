"""A machine whose graph is edited on the way (rule R4).

Commands are carried out on the machine's own drawing; then it is dissolved again, and existing parts are identified:
stations by their nodes, lines by their ends. What is gone lets go what lay on it. Sees how drawings are edited, and
shares nothing with what runs them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set
from typing import Any

from hfg.graph.editing import history_of, prepare
from hfg.graph.editing.changes import Change, EdgeChange, NodeSwap, OptionsChange, ParameterChange, undo_all
from hfg.graph.editing.commands import read
from hfg.testing.reference.calls import Calling
from hfg.testing.reference.state import Line, Station, fresh
from hfg.testing.reference.structure import ROOT, Edge, End, Structure, boundary_of, is_box, whole
from hfg.testing.reference.waiting import MOMENT_S
from hfg.trace import ParameterSet, TokenDropped, TokenProcessed

_GONE = boundary_of(10_000)
"""The sender of tokens whose sender was removed."""


class Editing(Calling):
    """A machine that follows edits."""

    paths: dict[str, int]
    labels: dict[str, Line]

    def hold(self, paths: Iterable[str]) -> None:
        """An edit waits: these nodes start nothing until it is done."""
        self.held = {id(self.stations[self.paths[path]]) for path in paths}
        if self.edit_began is None:
            self.edit_began = self.now

    def is_held(self, index: int) -> bool:
        """Return whether an edit waits for the node, or for others with it."""
        return id(self.stations[index]) in self.held

    def edit(self, what: str) -> None:
        """Carry out what a run says it has carried out: commands as JSON, "undo", "redo"; "" was given up."""
        self.held = set()
        self._note_missed_timeouts()
        if what:
            self._follow(self._draw(what))
        self.edit_began = None
        self.settle()

    def _note_missed_timeouts(self) -> None:
        """A12: a timeout without a receiver at its time is not delivered later."""
        for owner in [*range(len(self.stations)), *(-2 - box.index for box in self.structure.boxes)]:
            if owner >= 0:
                since, limit = self.stations[owner].active_since, self.stations[owner].leaf.options.active_for_s
            else:
                since, limit = self.box_since[-2 - owner], self.structure.boxes[-2 - owner].options.active_for_s
            if since is None or limit is None or not self.is_over(since + limit):
                continue
            if owner >= 0 and not self.lines_from(owner, "event", "timeout"):
                self.stations[owner].active_since = None
            elif owner < 0 and not self.lines_from(owner, "event", "timeout"):
                self.box_since[-2 - owner] = None

    def _draw(self, what: str) -> Sequence[Change]:
        """Edit the drawing; its parameters are first what tokens have made of them (P8)."""
        for station in self.stations:
            if station.leaf.inside is None:
                station.leaf.node._parameters.update(station.node._parameters)
        history = history_of(self.graph)
        if what == "undo":
            changes = undo_all(history.next_undo().changes)
            history.undo_done()
            return changes
        if what == "redo":
            transaction = history.next_redo()
            for change in transaction.changes:
                change.do()
            history.redo_done()
            return transaction.changes
        transaction = prepare(self.graph, read(what), check=False)
        history.note(transaction)
        return transaction.changes

    def _follow(self, changes: Sequence[Change]) -> None:
        self._switch(changes)
        name_of = {owner: self._name_of(owner) for owner in self._owners()}  # by what it is, not by its number
        before = {id(station.leaf.node): station for station in self.stations}
        boxes = {id(box.node): box.index for box in self.structure.boxes}
        swapped = self._swap(changes, before)
        rubbed_out = {id(one.edge) for one in changes if isinstance(one, EdgeChange) and not one.added and one.for_good}
        old_lines = [(name_of[line.edge.source.owner], name_of[line.edge.target.owner], line) for line in self.lines]
        senders = [(lying, name_of.get(lying.sender, "")) for line in self.lines for lying in line.queue]
        after = whole(self.graph)
        enabled = [station for station in self.stations if self.is_enabled(station.leaf.index)]
        gated = self._gated()
        self._disable_for_good(boxes, {id(box.node) for box in after.boxes})
        self._exchange_stations(after, before)
        self._exchange_boxes(after, boxes)
        for station in self._gated().values():
            if id(station) not in gated:
                station.last_function = float("-inf")  # from the first firing after the gate is set
        number_of = {self._name_of(owner): owner for owner in self._owners()}
        for lying, name in senders:
            lying.sender = number_of.get(name, _GONE)
        lost, new = self._exchange_lines(old_lines, number_of, rubbed_out)
        self._name_all_anew(after)
        self._begin_and_end(list(before.values()), swapped, new, lost)
        self._set_parameters(changes)
        self._silence_those_that_rest_now(enabled)
        for station in self.stations:
            self._process_what_is_pipelined_now(station)
        self.settle()  # the change itself comes before what its nodes say
        for station in self.stations:
            self._take_part(station)

    def _swap(self, changes: Sequence[Change], before: dict[int, Station]) -> set[int]:
        """Find stations by the nodes that have taken the places of others; give those that this is about."""
        swapped = set()
        for change in changes:
            if isinstance(change, NodeSwap) and id(change.old) in before:
                station = before[id(change.new)] = before.pop(id(change.old))
                swapped.add(id(station))
        return swapped

    def _gated(self) -> dict[int, Station]:
        stations = [self.stations[index] for gate in self.structure.gates for index in gate.targets]
        return {id(station): station for station in stations}

    def _name_all_anew(self, after: Structure) -> None:
        self.paths = {station.path: station.leaf.index for station in self.stations}
        self.paths |= {box.path: -2 - box.index for box in after.boxes}
        self.paths[""] = ROOT
        self.labels = {line.edge.label: line for line in self.lines}

    def _begin_and_end(
        self, before: Sequence[Station], swapped: Set[int], new: Sequence[Line], lost: Sequence[Line]
    ) -> None:
        """Start added nodes, then end removed ones."""
        were = {id(station) for station in before}
        for station in self.stations:
            if id(station) not in were:
                self.connect_one(station)
                self._set_up_ahead(station)
            elif id(station) in swapped:
                self._exchange_node(station)
        for line in new:
            self.lay(line)
        for line in lost:
            self._let_go(line)
        here = {id(station) for station in self.stations}
        for station in before:
            if id(station) not in here:
                self._remove(station)

    def _set_up_ahead(self, station: Station) -> None:
        """A new node was set up when the edit began, and its tasks have continued since."""
        now, self.now = self.now, self.now if self.edit_began is None else self.edit_began
        station.early = []
        self.set_up(station)
        while True:
            while self.now < now and (tasks := self.tasks_in_turn(station)):
                self.go_on_with(tasks[0])
            due = min(
                (time for task in station.tasks if (time := self.loop.next_time_of(task)) is not None), default=now
            )
            if due >= now - MOMENT_S:
                break
            self.now = due
            self.loop.ring()
        self.now = now
        self.loop.ring()  # what is due at this very moment may move now, without more time passing
        if not self.is_enabled(station.leaf.index):  # they last as long as that (F10)
            self.cancel_tasks(station)

    def _take_part(self, station: Station) -> None:
        """Its signals since it was set up leave at the moment of the edit."""
        early, station.early = station.early or (), None
        for name, value, activity, stamp in early:
            self.trigger(station.leaf.index, name, value, activity, stamp)

    def _silence_those_that_rest_now(self, enabled: Sequence[Station]) -> None:
        here = {id(station) for station in self.stations}
        for station in enabled:
            if id(station) in here and not self.is_enabled(station.leaf.index) and station.enabled:
                self._silence(station)

    # --- who is who

    def _owners(self) -> list[int]:
        iterating = [boundary_of(station.leaf.index) for station in self.stations if station.leaf.inside is not None]
        return [*range(len(self.stations)), *(-2 - box.index for box in self.structure.boxes), *iterating, ROOT]

    def _name_of(self, owner: int) -> Any:
        if owner == ROOT:
            return "root"
        if owner >= 0:
            return id(self.stations[owner])
        if is_box(owner):
            return id(self.structure.boxes[-2 - owner].node)
        return ("inside", id(self.stations[boundary_of(0) - owner]))

    def _exchange_stations(self, after: Any, before: dict[int, Station]) -> None:
        stations = []
        for leaf in after.leaves:
            station = before.get(id(leaf.node))
            if station is None:
                station = Station(leaf, fresh(leaf), enabled=bool(leaf.options.enabled))
            station.leaf = leaf
            station.node._place = leaf.node._place
            stations.append(station)
        self.stations = stations

    def _exchange_boxes(self, after: Any, boxes: dict[int, int]) -> None:
        was = [boxes.get(id(box.node)) for box in after.boxes]
        self.box_enabled = [
            bool(box.options.enabled) if old is None else self.box_enabled[old]
            for box, old in zip(after.boxes, was, strict=True)
        ]
        self.box_active = [False if old is None else self.box_active[old] for old in was]
        self.box_since = [None if old is None else self.box_since[old] for old in was]
        calls = dict(self.box_calls)
        self.box_calls = {
            -2 - index: calls[-2 - old] for index, old in enumerate(was) if old is not None and -2 - old in calls
        }
        self.structure = after

    def _exchange_lines(
        self, old_lines: list[tuple[Any, Any, Line]], number_of: dict[Any, int], rubbed_out: set[int]
    ) -> tuple[list[Line], list[Line]]:
        """Find the lines again; gives those that are lost and those that are new."""
        there: dict[Any, list[Line]] = {}
        outside, lost = [], []
        for source, target, line in old_lines:
            edge = line.edge
            if edge.source.name == "outside":
                if target in number_of:
                    owner = number_of[target]
                    path = self.stations[owner].path if owner >= 0 else self._path_outside(owner)
                    edge.target = edge.target._replace(owner=owner)
                    edge.label = f"outside -> {path}.{edge.target.name}" if path else edge.label
                    outside.append(line)
                else:
                    lost.append(line)
            elif rubbed_out.isdisjoint(id(part) for part in edge.parts):
                there.setdefault((source, target, *_kind(edge)), []).append(line)
            else:
                lost.append(line)
        lines, new = [], []
        for edge in self.structure.edges:
            same = there.get((self._name_of(edge.source.owner), self._name_of(edge.target.owner), *_kind(edge)))
            line = same.pop(0) if same else Line(edge, edge.capacity)
            if line.edge is edge:
                new.append(line)
            line.edge = edge
            lines.append(line)
        self.take_lines(lines + outside)
        return lost + [line for lines in there.values() for line in lines], new

    def _path_outside(self, owner: int) -> str:
        return "" if owner == ROOT else self.structure.boxes[-2 - owner].path

    # --- what follows

    def _let_go(self, line: Line) -> None:
        """A removed edge counts as processed; what lay on it is dropped, activity goes back (A8)."""
        for lying in line.queue:
            self.observe(TokenDropped(self.now, line.edge.label, lying.token, "removed"))
            if lying.token.activity == 1:
                if lying.sender >= 0:
                    self.set_active(lying.sender, True, "returned")
                else:
                    self.lose_activity(line.edge.label)
        if not line.edge.is_event and line.under_way > line.slack:
            self.observe(TokenProcessed(self.now, line.edge.label))
        line.queue.clear()
        for station in self.stations:
            station.owed = [one for one in station.owed if one is not line]
            for flight in station.flights:
                flight.taken = [one for one in flight.taken if one is not line]

    def _remove(self, station: Station) -> None:
        if station.active:
            self.lose_activity(station.path)
        for line in station.owed:
            if line in self.lines:
                self.process(line)
        self.tear_down(station)

    def _exchange_node(self, station: Station) -> None:
        """Another node in its place: teardown, setup, not ended; tokens and A(v) stay."""
        self.tear_down(station)
        station.node = fresh(station.leaf)
        station.node._active = station.active
        self.connect_one(station)
        if station.resting_until is None:  # else its back-off does it
            self.set_up(station)
        self.not_ended(station)

    def _switch(self, changes: Sequence[Change]) -> None:
        """Enable and disable what there was before (F10), as it is in the end: nodes first, then subgraphs."""
        of_node = {id(station.leaf.node): station for station in self.stations}
        number = {node: station.leaf.index for node, station in of_node.items()}
        number |= {id(box.node): -2 - box.index for box in self.structure.boxes}
        switched: dict[int, bool] = {}
        for change in changes:
            if isinstance(change, NodeSwap) and id(change.old) in number:
                number[id(change.new)] = number[id(change.old)]
            elif isinstance(change, OptionsChange) and id(change.node) in number and _is_switch(change):
                switched[number[id(change.node)]] = change.after.enabled
            elif isinstance(change, ParameterChange) and id(change.node) in of_node:  # for `setup`
                of_node[id(change.node)].node._parameters[change.name] = change.after
        for owner, enabled in sorted(switched.items(), key=lambda one: is_box(one[0])):
            if enabled:
                self.enable(owner)
            else:
                self.disable(owner)

    def _disable_for_good(self, boxes: dict[int, int], stay: set[int]) -> None:
        """Nodes of a disabled subgraph that was removed stay disabled (G1)."""
        for node, index in boxes.items():
            if node not in stay and not self.box_enabled[index]:
                for member in self.structure.boxes[index].members:
                    self.stations[member].enabled = False

    def _set_parameters(self, changes: Sequence[Change]) -> None:
        owner_of = {id(station.leaf.node): station.leaf.index for station in self.stations}
        owner_of |= {id(box.node): -2 - box.index for box in self.structure.boxes}
        for change in changes:
            if isinstance(change, ParameterChange):
                owner = owner_of.get(id(change.node))
                if owner is not None:
                    if owner >= 0:
                        self.stations[owner].node._parameters[change.name] = change.after
                    self.observe(ParameterSet(self.now, self.path_of(owner), change.name, change.after))

    def _process_what_is_pipelined_now(self, station: Station) -> None:
        """A new group may change the mode of a node, including the one for tokens it has already taken (F5, F6)."""
        owed, station.owed = station.owed, []
        for line in owed:
            if self.is_pipelined(line):
                self.process(line)
            else:
                station.owed.append(line)
        for flight in station.flights:
            called = [] if flight.line is None or flight.line.edge.is_event else [flight.line]
            for line in (*flight.taken, *called):
                if self.is_pipelined(line):
                    self.process(line)


def _is_switch(change: OptionsChange) -> bool:
    """Return whether it is about what is enabled, not about the group."""
    return change.before.group == change.after.group


def _kind(edge: Edge) -> tuple[Any, ...]:
    source: End = edge.source
    return (source.kind, source.name, edge.target.kind, edge.target.name, bool(edge.initial) and not edge.is_event)
