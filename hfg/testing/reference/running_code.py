"""How a machine runs the code of nodes.

At once on the loop, in steps where it waits, out of sight in a thread (rules F3, R1, X2).

A `Flight` is a firing or call in progress. It keeps the values that its code writes; triggered signals leave at once,
or from a thread when the machine delivers it.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.clock import time_told_by
from hfg.errors import UsageError
from hfg.testing.reference.sending import Sending
from hfg.testing.reference.state import Flight, Station, Task
from hfg.trace import ParameterSet


class RunningCode(Sending):
    """A machine that can run functions, coroutines and iterators of nodes."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.in_code: list[Flight] = []  # whose code is running, the innermost last
        self.in_task: Task | None = None  # or that of which task

    def flight_of(self, station: Station) -> Flight | None:
        """The firing or call that a port of the node speaks for: the one whose code is running (F14), if not a task."""
        if self.in_task is not None and self.in_task.station is station:
            return None
        if not station.is_concurrent:
            return station.flight
        return next((flight for flight in reversed(self.in_code) if flight.station is station), None)

    def connect_ports(self) -> None:
        """Let the ports of all nodes speak to this machine."""
        for station in self.stations:
            if station.leaf.inside is None:
                self.connect_one(station)

    def connect_one(self, station: Station) -> None:
        """Let the ports of a node speak to this machine."""
        station.node._start_task = partial(self.start_task, station)
        for name in station.type.outputs:
            station.node.ports.outputs[name]._connect(self._writer(station, name))
        for name in station.type.events:
            port = station.node.ports.events[name]
            port._connect(self._trigger_of(station, name), self._waiting_trigger_of(station, name))
        for name, spec in station.type.parameters.items():
            if spec.read_only:
                station.node.ports.parameters[name]._report_to(partial(self._show, station, name))

    def _show(self, station: Station, name: str, value: Any) -> None:
        """The node has set a read-only parameter (P8, R7)."""
        flight = self.flight_of(station)
        if flight is not None and flight.in_thread:
            flight.signals.append((name, value, None, None))
        else:
            self.observe(ParameterSet(self.now, station.path, name, value))

    def _writer(self, station: Station, name: str) -> Callable[[Any, int | None, float | None], None]:
        def write(value: Any, activity: int | None, stamp: float | None) -> None:
            flight = self.flight_of(station)
            if flight is None or flight.what != "firing":
                raise UsageError(f'"{station.path}.{name}" is written outside a firing')
            if name in flight.writes:
                raise UsageError(f'"{station.path}.{name}" is written twice in one firing')
            flight.writes[name] = (value, activity, stamp)

        return write

    def _trigger_of(self, station: Station, name: str) -> Callable[[Any, int | None, float | None], None]:
        def trigger(value: Any, activity: int | None, stamp: float | None) -> None:
            flight = self.flight_of(station)
            activity = self.withheld(station, activity)
            if flight is not None:
                flight.triggered = True
            if flight is not None and flight.in_thread:
                flight.signals.append((name, value, activity, stamp))
            else:
                self.trigger(station.leaf.index, name, value, activity, stamp, flight)

        return trigger

    def _waiting_trigger_of(self, station: Station, name: str) -> Callable[[Any, int | None, float | None], Any]:
        async def trigger(value: Any, activity: int | None, stamp: float | None) -> None:
            flight = self.flight_of(station)
            activity = self.withheld(station, activity)
            if flight is not None:
                flight.triggered = True
            speaker = self.in_task if flight is None else flight
            self.trigger(station.leaf.index, name, value, activity, stamp, flight)
            while speaker is not None and self.has_no_room(station):
                speaker.waiting_for = name
                await asyncio.sleep(0)
            if speaker is not None:
                speaker.waiting_for = ""

        return trigger

    def withheld(self, station: Station, activity: int | None) -> int | None:
        """A15: what a do-activity sends that is to end carries nothing of a later activity of its node."""
        task = self.in_task
        is_outdated = task is not None and task.station is station and task.is_activity and task.cancelled
        return 0 if is_outdated and activity is None else activity

    def start_task(self, station: Station, coroutine: Coroutine[Any, Any, Any]) -> None:
        """Run it concurrently with the firings of the node."""
        raise NotImplementedError

    def has_no_room(self, station: Station) -> bool:
        """Return whether a queue fed by an event of the node is full, which holds back its firings too (F8)."""
        return bool(self.full_lines(station.leaf.index))

    @contextmanager
    def amid_code(self, flight: Flight | None = None) -> Iterator[None]:
        """Run user code: in the machine's time and on its loop."""
        self.in_code += [] if flight is None else [flight]
        try:
            with time_told_by(lambda: self.now), self.loop.entered():
                yield
        finally:
            if flight is not None:
                self.in_code.pop()

    def launch(
        self, flight: Flight, function: Callable[[], Any], then: Callable[[Any, BaseException | None], None]
    ) -> None:
        """Run `function`; `then` gets its result or error, now or when the flight has been carried on to its end."""
        flight.then = then
        flight.began = self.now
        result: Any = None
        failure: Exception | None = None
        try:
            with self.amid_code(flight):
                result = function()
        except Exception as error:
            failure = error
        if type(result) is CoroutineType:
            with self.amid_code():
                flight.task = self.loop.start(flight, result)
        elif flight.in_thread:
            flight.result, flight.error = result, failure
        else:
            self.land(flight, result, failure)

    def land(self, flight: Flight, result: Any, error: BaseException | None) -> None:
        """Hand over what came out."""
        then, flight.then = flight.then, None
        assert then is not None
        then(result, error)

    def can_go_on(self, flight: Flight) -> bool:
        """Return whether something of the flight can happen without time going by."""
        if flight.pause_until is not None:
            return self.is_over(flight.pause_until)
        if flight.when_rested is not None:
            return not flight.station.is_flying and not any(task.cancelled for task in flight.station.tasks)
        if flight.waits_to_end:
            others = [one for one in flight.station.firings_under_way if not one.waits_to_end]
            return not others and flight.station.firings_under_way[0] is flight
        if flight.elements is not None:
            return self.can_iterate(flight.station.leaf.index)
        if flight.task is None:
            return flight.in_thread
        if flight.waiting_for and self.has_no_room(flight.station):
            return False
        return self.loop.can_step(flight)

    def can_iterate(self, index: int) -> bool:
        """Return whether the next element may go into an iterating subgraph (G4)."""
        raise NotImplementedError

    def go_on_iterating(self, flight: Flight) -> None:
        """Send the next element inside."""
        raise NotImplementedError

    def run_end(self, flight: Flight) -> None:
        """Call `end()`."""
        raise NotImplementedError

    def go_on(self, flight: Flight) -> None:
        """Carry the flight on: an element, a signal from its thread, a step of its coroutine, or its end."""
        if flight.pause_until is not None and flight.again is not None:
            flight.pause_until = None
            flight.again()
            return
        if flight.when_rested is not None:
            begin, flight.when_rested = flight.when_rested, None
            begin()
            return
        if flight.waits_to_end:
            self.run_end(flight)
            return
        if flight.elements is not None:
            self.go_on_iterating(flight)
            return
        if flight.task is None:
            if flight.signals:
                name, value, activity, stamp = flight.signals.pop(0)
                if name in flight.station.type.parameters and name not in flight.station.type.events:
                    self.observe(ParameterSet(self.now, flight.station.path, name, value))
                else:
                    self.trigger(flight.station.leaf.index, name, value, activity, stamp, flight)
            else:
                flight.in_thread = False
                self.land(flight, flight.result, flight.error)
            return
        flight.stepped = True
        with self.amid_code(flight):
            self.loop.step(flight)
        if flight.task.done() and flight.then is not None:
            task: asyncio.Task[Any] = flight.task
            error = asyncio.CancelledError() if task.cancelled() else task.exception()
            self.land(flight, None if error is not None else task.result(), error)

    def abandon(self, flight: Flight) -> None:
        """Stop caring for what it still does (X2)."""
        flight.then = None
        flight.in_thread = False
        if flight.task is not None:
            flight.task.cancel()
            while self.loop.step(flight):
                pass
            if not flight.task.done():
                flight.task.get_coro().close()
        self.loop.forget(flight)

    def run_hook(self, station: Station, hook: Any) -> None:
        """Run a hook to its end; the reference cannot wait in one."""
        owner = object()
        with self.amid_code():
            result = hook()
            if not inspect.iscoroutine(result):
                return
            task = self.loop.start(owner, result)
        while not task.done():
            if not self.loop.step(owner):
                self.loop.forget(owner)
                raise NotImplementedError(
                    f'a hook of "{station.path}" waits for time to go by, which the reference does not do'
                )
        task.result()

    def run_within(self, hook: Any, limit_s: float) -> bool:
        """Run a hook while time goes by; whether it comes back by itself within its limit, and without an error."""
        owner, until = object(), self.now + limit_s
        with self.amid_code():
            try:
                result = hook()
            except Exception:
                return False
            if not inspect.iscoroutine(result):
                return True
            task = self.loop.start(owner, result)
        while not task.done():
            if self.loop.step(owner):
                continue
            due = self.loop.next_time_of(owner)
            if due is None or due > until:
                self.now = until
                break
            self.now = max(self.now, due)
            self.loop.ring()
        came_back = task.done() and not task.cancelled() and task.exception() is None
        task.cancel()
        while self.loop.step(owner):
            pass
        if not task.done():
            task.get_coro().close()
        self.loop.forget(owner)
        return came_back
