"""One firing from beginning to end (rules F3-F5, F11, A6, A11, X1, P6, P8)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from hfg.base.token import END, NO_MESSAGE
from hfg.errors import EndOfStream, Failure, FiringTimeout, NodeError, UsageError
from hfg.testing.reference.running_code import RunningCode
from hfg.testing.reference.sending import passed_on
from hfg.testing.reference.state import Flight, Line, Lying, Station, newest
from hfg.testing.reference.structure import boundary_of
from hfg.testing.reference.waiting import MOMENT_S
from hfg.trace import (
    ErrorRaised,
    FiringEnded,
    FiringRetried,
    FiringStarted,
    ParameterSet,
    TokenDropped,
    TokenTaken,
)

_OVER = object()
"""What an iterator gives when nothing more comes."""

Taken = list[tuple[Line, Lying]]


class Firing(RunningCode):
    """A machine whose nodes can fire."""

    def start_firing(self, index: int) -> None:
        """Take a token from every edge, let activity and parameters act, decide what kind of firing it is, begin."""
        station = self.stations[index]
        station.place, station.rested = None, False
        station.firings += 1
        joined = [line for line in self.lines_joined(index) if self.is_live(line) or self.takes_part(line)]
        taken = self.take_all([line for line in joined if self.takes_part(line)])
        tokens = [lying.token for _, lying in taken]
        kind = self.kind_of(station, joined, taken)
        stamp = self.now if station.type.is_source else newest(tokens, self.now)
        flight = Flight(station, "firing", station.firings, kind, stamp, [line for line, _ in taken])
        station.flights.append(flight)
        self.observe(FiringStarted(self.now, station.path, flight.number, kind))
        self.receive_activity(index, [token.activity for token in tokens])
        if kind == "process":
            self.keep_rate(station)
        failure = self.set_parameters(station, taken)
        self.settle()  # a delay may be free (P7), the next firing may be enabled, all but "not busy" (F9)
        if kind == "end":
            for line, lying in taken:
                if not lying.token.is_marker:
                    self.observe(TokenDropped(self.now, line.edge.label, lying.token, "ended"))
            self.end_behind_others(flight)
        elif failure is not None:
            self.fail_firing(flight, failure)
        elif kind == "silent":
            self.end_firing(flight, "silent")
        else:
            station.last_function = self.now
            self.run_process(flight, taken)
        self.settle()

    def keep_rate(self, station: Station) -> None:
        """F11: one start in each period of a grid that begins with the first; a late one does not move it."""
        rate = station.leaf.options.max_rate_hz
        if not rate:
            return
        if station.grid is None or station.grid[1] != 1 / rate:
            station.grid = self.now, 1 / rate
        begin, period = station.grid
        station.hold_until = begin + (math.floor((self.now - begin + MOMENT_S) / period) + 1) * period

    def take_all(self, lines: list[Line]) -> Taken:
        """Take one token from each edge."""
        taken = []
        for line in lines:
            lying = line.queue.pop(0)
            line.ended = lying.token.value is END
            self.observe(TokenTaken(self.now, line.edge.label, lying.token))
            if line.edge.is_event:
                pass
            elif line.delay:
                self.note_processed(line)
            else:
                line.unprocessed += 1
                if self.is_pipelined(line):  # its place is free from now on (F5)
                    self.process(line)
            taken.append((line, lying))
        return taken

    def would_end(self, index: int) -> bool:
        """Return whether the node's next firing would be its last (F4)."""
        joined = [line for line in self.lines_joined(index) if self.is_live(line) or self.takes_part(line)]
        lying = [(line, line.queue[0]) for line in joined if self.takes_part(line) and line.queue]
        ending = [line for line, first in lying if first.token.value is END]
        real = [line for line in joined if not line.delay]
        return any(not self.is_optional(line) for line in ending) or (
            bool(real) and all(line in ending or line.ended for line in real)
        )

    def kind_of(self, station: Station, joined: list[Line], taken: Taken) -> Literal["process", "silent", "end"]:
        """F4, and A11's silence."""
        index = station.leaf.index
        if station.stops_itself:
            return "end"
        values = {line.edge.label: lying.token.value for line, lying in taken}
        mandatory = [values[line.edge.label] for line, _ in taken if not self.is_optional(line)]
        if any(value is END for value in mandatory):  # of values it is not known what `==` does
            return "end"
        real = [line for line in joined if not line.delay]
        if real and all(line.ended for line in real):
            return "end"
        if any(value is NO_MESSAGE for value in mandatory):
            return "silent"
        if joined and not mandatory and all(value is NO_MESSAGE or value is END for value in values.values()):
            return "silent"
        if not self.within_idle_rate(index):
            return "silent"
        return "process"

    def set_parameters(self, station: Station, taken: Taken) -> Exception | None:
        """P8: a value that is taken sets the parameter, even in a silent firing."""
        for line, lying in taken:
            if line.edge.target.kind == "parameter" and not lying.token.is_marker:
                try:
                    self.set_parameter(station, line.edge.target.name, lying.token.value)
                except Exception as error:
                    return error
        return None

    def set_parameter(self, station: Station, name: str, value: Any) -> None:
        """Set a parameter and say so.

        Raises:
          ValueError: it is out of its limits.
        """
        station.node._set_parameter(name, value)
        self.observe(ParameterSet(self.now, station.path, name, value))

    # --- the function

    def run_process(self, flight: Flight, taken: Taken) -> None:
        """Run the process function with the values that were taken; what is absent has its default (P6)."""
        station = flight.station
        flight.parameters = dict(station.node._parameters)
        held = {line.edge.target.name: lying.token for line, lying in taken if line.edge.target.kind == "input"}
        flight.values = {name: token.value for name, token in held.items() if not token.is_marker}
        arguments = []
        for name, spec in station.type.inputs.items():
            token = held.get(name)
            if token is None or token.is_marker:
                arguments.append(spec.default)
            else:
                arguments.append(token if spec.token else token.value)
        if station.leaf.inside is not None:
            self.begin_iteration(flight, arguments)
            return
        flight.again = lambda: self.attempt(flight, arguments)
        self.attempt(flight, arguments)

    def attempt(self, flight: Flight, arguments: list[Any]) -> None:
        """Run the process function: for the first time, or once more because it has failed (X1)."""
        station = flight.station
        flight.attempts += 1
        flight.task, flight.stepped = None, False
        self.begin_in_group(flight, station.type.process_kind in ("async", "async generator"))
        self.launch(
            flight, self.what_to_run(station, arguments), lambda result, error: self.end_process(flight, result, error)
        )

    def begin_in_group(self, flight: Flight, is_async: bool) -> None:
        """Code that does not wait runs in the thread of its group, if that has one (R1)."""
        group = flight.station.leaf.options.group
        flight.in_thread = not is_async and self.structure.threads.get(group, 0) > 0

    def what_to_run(self, station: Station, arguments: list[Any]) -> Callable[[], Any]:
        """One firing of each kind of process function; a generator begins at its first firing."""
        kind = station.type.process_kind
        if kind in ("function", "async"):
            call = station.node._process_call()
            return lambda: call(*arguments)
        if kind == "generator":
            return lambda: next(self.iterator_of(station), _OVER)

        async def step() -> Any:
            return await anext(self.iterator_of(station), _OVER)

        return step

    def iterator_of(self, station: Station) -> Any:
        """The running generator of a source."""
        if station.iterator is None:
            station.iterator = station.node._process_call()()
            if hasattr(station.iterator, "__iter__"):
                station.iterator = iter(station.iterator)
        return station.iterator

    def end_process(self, flight: Flight, result: Any, error: BaseException | None) -> None:
        """Say what the end of the function means: the end of a source, a failure, or outputs."""
        if result is _OVER or isinstance(error, EndOfStream):
            self.end_behind_others(flight)
            return
        if error is None:
            try:
                self.write_result(flight, result)
            except Exception as wrong:  # of what it looks like, too
                error = wrong
        if error is not None:
            self.fail_firing(flight, error)
        else:
            self.end_firing(flight, "done")

    def write_result(self, flight: Flight, result: Any) -> None:
        """Returned values are written to the outputs; None is silence (T2)."""
        station = flight.station
        for name, value in zip(station.type.outputs, station.node._split(result), strict=False):
            if value is None:
                continue
            if name in flight.writes:
                raise UsageError(f'"{station.path}.{name}" is written twice in one firing')
            flight.writes[name] = (value, None, None)

    # --- G4

    def begin_iteration(self, flight: Flight, arguments: list[Any]) -> None:
        """Zip the collections; other inputs repeat. Unequal lengths are an error."""
        station = flight.station
        over = station.leaf.options.iterate_over
        given = dict(zip(station.type.inputs, arguments, strict=True))
        try:
            columns = {name: list(given[name]) for name in over}
            lengths = {len(column) for column in columns.values()}
            if len(lengths) > 1:
                raise ValueError(f"the collections have unequal lengths: {sorted(lengths)}")
        except Exception as error:
            self.fail_firing(flight, error)
            return
        count = lengths.pop() if lengths else 0
        flight.results = {name: [] for name in station.type.outputs}
        flight.elements = [
            {name: columns[name][number] if name in columns else value for name, value in given.items()}
            for number in range(count)
        ]
        self.go_on_iterating(flight)

    def go_on_iterating(self, flight: Flight) -> None:
        """Send the next element inside; after the last one, the lists are the outputs."""
        station = flight.station
        assert flight.elements is not None
        if not flight.elements:
            flight.elements = None
            flight.writes = {name: (values, None, None) for name, values in flight.results.items()}
            self.end_firing(flight, "done")
            return
        element, boundary = flight.elements.pop(0), boundary_of(station.leaf.index)
        if not self.outputs_are_free(boundary):
            flight.elements = None
            self.fail_firing(flight, ValueError("an element lies untaken at the border, so the next cannot go in"))
            return
        for name, value in element.items():
            lines = self.lines_from(boundary, "output", name)
            self.send(boundary, [(line, NO_MESSAGE if value is None else value, None, flight.stamp) for line in lines])

    # --- the end of a node

    def end_behind_others(self, flight: Flight) -> None:
        """F14: `end()` is called when all firings that began before are over and their outputs have left."""
        flight.kind = "end"
        if flight.station.firings_under_way == [flight]:
            self.run_end(flight)
        else:
            flight.waits_to_end = True

    def run_end(self, flight: Flight) -> None:
        """F4(1): call `end()`; from now on what arrives is drained (F12)."""
        station = flight.station
        flight.waits_to_end = False
        if station.ending:  # another firing of a source has ended it already (F14)
            self.end_firing(flight, "ended")
            return
        station.ending = True
        station.stamp = flight.stamp
        for line in flight.taken:  # nothing waits for a node that has ended (F12)
            if not line.edge.is_event:
                self.process(line)
        flight.taken = []
        self.settle()  # what lies here is drained and who is free by that has its place, both before `end()` (F12, F9)
        hook = station.node._hook("end") if station.leaf.inside is None else None
        if hook is None:
            self.end_firing(flight, "ended")
            return
        self.begin_in_group(flight, False)

        def after(result: Any, error: BaseException | None) -> None:
            if error is not None:
                self.fail_firing(flight, error)
            else:
                self.end_firing(flight, "ended")

        self.launch(flight, hook, after)

    # --- the end of a firing

    def end_firing(
        self,
        flight: Flight,
        outcome: Literal["done", "silent", "ended", "failed", "abandoned"],
        failure: NodeError | None = None,
    ) -> None:
        """The function is over: outputs leave, of a node that allows several firings in their turn (F14)."""
        flight.over, flight.over_since = (outcome, failure), self.next_tick()
        if flight.void or not flight.station.is_concurrent:
            self.leave(flight)
        else:
            self.settle()
            self.let_others(flight.station)

    def leave(self, flight: Flight) -> None:
        """Outputs leave together, then automatic events in the order they arose; then the firing is over."""
        station = flight.station
        index = station.leaf.index
        assert flight.over is not None
        (outcome, failure), flight.leaving = flight.over, True
        if not flight.void and (flight.kind != "end" or (outcome == "ended" and flight.writes)):
            self.send(index, self.shipments(flight, outcome), flight)
        self.announce(flight, outcome)
        if failure is not None:
            station.changes.append((self.next_tick(), "failed", Failure(failure, flight.values), None))
        self.flush_changes(station)
        if flight.void and outcome == "done":
            outcome = "abandoned"
        self.observe(FiringEnded(self.now, station.path, flight.number, outcome))
        station.flights.remove(flight)
        station.unready = False
        station.owed += [line for line in flight.taken if line.unprocessed]
        self.be_idle(station)

    def announce(self, flight: Flight, outcome: str) -> None:
        """A9: after the outputs, signal the tokens of each, in order, with their stamps; then `processed`."""
        changes = flight.station.changes
        for name in flight.station.type.outputs if outcome in ("done", "ended") and not flight.void else ():
            if name not in flight.writes:
                continue
            value, _, stamp = passed_on(*flight.writes[name])
            if value is not None and value is not NO_MESSAGE:
                changes.append((self.next_tick(), f"{name}.sent", value, flight.stamp if stamp is None else stamp))
        if outcome == "done":
            changes.append((self.next_tick(), "processed", None, None))

    def be_idle(self, station: Station) -> None:
        """A firing or call is over; what was wanted of the node meanwhile is done then (P8, F10, G2)."""
        while station.to_set:
            self.set_parameter(station, *station.to_set.pop(0))
        self.settle()
        self.let_others(station)

    def let_others(self, station: Station) -> None:
        """No code of it may go on any more: what has waited for that is done (F14, G2, X1)."""
        if not station.afterwards or station.is_amid:
            return
        if station.tasks:  # which end first; the last of them calls this again
            self.cancel_tasks(station)
            return
        wanted, station.afterwards = station.afterwards, ""
        if wanted == "rest":
            self.rest(station)
        else:
            self.reset(station)
            self.settle()

    def reset(self, station: Station) -> None:
        """Teardown, setup, not ended."""
        raise NotImplementedError

    def cancel_tasks(self, station: Station) -> None:
        """End the tasks that its code has started."""
        raise NotImplementedError

    def shipments(self, flight: Flight, outcome: str) -> list[tuple[Line, Any, int | None, float]]:
        """One token for every edge of every output (F3); parameters send theirs in firings of the function (P8, F4)."""
        station = flight.station
        shipments: list[tuple[Line, Any, int | None, float]] = []
        for line in self.in_order_of_outputs(station):
            source = line.edge.source
            value: Any = NO_MESSAGE
            activity: int | None = None
            stamp: float | None = None
            if source.kind == "parameter" and outcome == "done":
                known = flight.parameters if station.is_concurrent else station.node._parameters
                value = known[source.name]
            elif source.kind == "output" and outcome in ("done", "ended") and source.name in flight.writes:
                value, activity, stamp = passed_on(*flight.writes[source.name])
            shipments.append(
                (line, NO_MESSAGE if value is None else value, activity, flight.stamp if stamp is None else stamp)
            )
        return shipments

    def is_pipelined(self, line: Line) -> bool:
        """F5, F6: the consumer's mode, `auto` by whether the edge crosses groups; slots of the whole answer at once."""
        if line.edge.target.owner < 0:
            return False
        options = self.stations[line.edge.target.owner].leaf.options
        if options.concurrency > 1:
            return True
        if options.release != "auto":
            return bool(options.release == "pipelined")
        source = line.edge.source.owner
        return source >= 0 and self.stations[source].leaf.options.group != options.group

    # --- X1

    def fail_firing(
        self, flight: Flight, error: BaseException, outcome: Literal["failed", "abandoned"] = "failed"
    ) -> None:
        """An exception in a node's code: it is tried again, or the node's policy decides."""
        if self.may_try_again(flight, error):
            self.try_again(flight, error)
            return
        station = flight.station
        options = station.leaf.options
        what = f"firing {flight.number}"
        failure = error if isinstance(error, NodeError) else NodeError(station.path, what, error)
        policy = self.policy_of(station)
        self.observe(ErrorRaised(self.now, station.path, what, str(failure), policy))
        if policy == "stop":
            station.flights.remove(flight)
            self.fail_run(failure)
            return
        if options.on_error == "disable":
            flight.void = True
            if flight.kind != "end":
                self.end_firing(flight, outcome, failure)
                self.disable(station.leaf.index)
                return
            station.changes.append((self.next_tick(), "failed", Failure(failure, {}), None))
            self.flush_changes(station)
            self.disable(station.leaf.index)  # before END, which goes nowhere
            self.end_firing(flight, outcome)
            return
        if policy == "restart" and not station.is_restarting:
            station.restarts += 1
            if station.is_concurrent or station.tasks:
                station.afterwards = "rest"
            else:
                self.rest(station)
        self.end_firing(flight, outcome, failure)

    def policy_of(self, station: Station) -> str:
        """Return the policy for a failure.

        One during a restart belongs to the restart, and does not count against the limit (F14).
        """
        options = station.leaf.options
        limited = options.on_error == "restart" and not station.is_restarting
        return "stop" if limited and station.restarts >= options.restart_limit else str(options.on_error)

    def may_try_again(self, flight: Flight, error: BaseException) -> bool:
        """Return whether there is another attempt: only of its function, and as long as none has sent a signal."""
        return (
            flight.kind == "process"
            and isinstance(error, Exception)
            and self.is_tried_again(error, flight.station.leaf.options.retry_on)
            and 0 < flight.attempts <= flight.station.leaf.options.retries
            and not flight.triggered
        )

    def is_tried_again(self, error: Exception, names: tuple[str, ...]) -> bool:
        """Return whether the error is one of those that are named, by its own name or that of a base."""
        kinds = [(kind.__module__, kind.__qualname__) for kind in type(error).__mro__]
        named = [tuple(name.split(":")) if ":" in name else ("builtins", name) for name in names]
        return not named or any(kind in named for kind in kinds)

    def try_again(self, flight: Flight, error: BaseException) -> None:
        """Throw away what the attempt has written; after a pause, which doubles each time, there is another one."""
        path, options = flight.station.path, flight.station.leaf.options
        if options.retry_jitter:
            raise NotImplementedError(
                f'the pauses of "{path}" are shorter by chance (retry_jitter), which the reference does not draw'
            )
        pause = min(options.retry_backoff_max_s, options.retry_backoff_s * 2 ** (flight.attempts - 1))
        flight.writes = {}
        flight.pause_until = self.now + pause
        self.observe(FiringRetried(self.now, path, flight.number, flight.attempts, str(error), pause))

    def rest(self, station: Station) -> None:
        """X1: the back-off of a restart begins; with several firings, after the last one in progress (F14)."""
        pause = station.leaf.options.restart_backoff_s * 2 ** (station.restarts - 1)
        station.resting_until = self.now + pause

    def time_out(self, flight: Flight) -> None:
        """X2: the firing took too long."""
        self.abandon(flight)
        limit = flight.station.leaf.options.max_duration_s
        error = FiringTimeout(flight.station.path, f"firing {flight.number}", f"took longer than {limit} s")
        self.fail_firing(flight, error, "abandoned")

    def fail_run(self, error: BaseException) -> None:
        """End the run in failure."""
        raise NotImplementedError

    def disable(self, owner: int) -> None:
        """Rule F10."""
        raise NotImplementedError
