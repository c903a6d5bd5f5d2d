"""A subgraph that iterates over collections (rule G4): the inside sees the elements one by one.

Each to quiet before the next.

The inside is a run of its own within the run: a core with its own idea of quiet, whose workers stand in the same
groups. Outside, the subgraph is one node that fires. Stands on `plan` and `quiet`; waits for nothing itself.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from hfg.engine.executing.code import answer
from hfg.engine.model.core import Core, Host, Timer
from hfg.engine.model.worker import Worker
from hfg.engine.rules import errors, firing, quiet
from hfg.engine.rules.releasing import take_from_reader
from hfg.engine.rules.sending import put_outputs
from hfg.engine.runtime import plan
from hfg.errors import HfgError
from hfg.graph.flat import FlatGraph
from hfg.ports.events import EventPort
from hfg.token import NO_MESSAGE, Marker

__all__ = ["Iteration"]


class _InnerHost:
    """The engine, as the inside sees it: the same, but it is told what is under way inside."""

    def __init__(self, outer: Host, iteration: Iteration) -> None:
        self._outer = outer
        self._iteration = iteration

    def now(self) -> float:
        return self._outer.now()

    def call_at(self, when: float, callback: Callable[[], None], *, counts: bool = True) -> Timer:
        """A timer of the inside keeps the inside from being quiet too."""
        if not counts:
            return self._outer.call_at(when, callback, counts=False)
        core = self._iteration.core
        core.timers += 1

        def due() -> None:
            core.timers -= 1
            callback()
            self._iteration.settle()

        return _InnerTimer(self._outer.call_at(when, due), core)

    def kick(self) -> None:
        """Something inside may move, or the inside may be quiet now."""
        self._outer.kick()
        self._iteration.look_later()

    def finish(self, outcome: str, error: HfgError | None) -> None:
        self._outer.finish(outcome, error)

    def soon(self, callback: Callable[[], None]) -> None:
        self._outer.soon(callback)

    def on_loop(self) -> bool:
        return self._outer.on_loop()

    def from_any_thread(self, call: Callable[[], None]) -> None:
        self._outer.from_any_thread(call)

    def bring_in(self, call: Callable[[], None]) -> None:
        self._outer.bring_in(call)

    def adopt_event(self, port: EventPort[Any]) -> None:
        self._outer.adopt_event(port)


class _InnerTimer:
    def __init__(self, timer: Timer, core: Core) -> None:
        self._timer = timer
        self._core = core
        self._open = True

    def cancel(self) -> None:
        if self._open:
            self._open = False
            self._core.timers -= 1
            self._timer.cancel()


class Iteration:
    """The inside of one iterating subgraph.

    Attributes:
      looks: at the loop's next pass it will see whether the inside is quiet.
    """

    def __init__(self, worker: Worker, flat: FlatGraph, groups: Any, loop: Any) -> None:
        self.worker = worker
        outer = worker.core
        self.core = Core(_InnerHost(outer.host, self), outer.upstairs)
        self.core.code = outer.code
        self.core.pumping = True  # whatever is queued inside kicks the pump by itself
        self.core.debug = outer.debug
        self.core.fast = False
        self.core.inside = self
        self._over = worker.options.iterate_over
        self._elements: list[tuple[Any, ...]] = []
        self._position = 0
        self._results: list[list[Any]] = []
        self._queued = 0
        self._waiters: list[asyncio.Future[None]] = []
        self.looks = False
        plan.build(self.core, flat, groups, loop=loop)
        for inner in self.core.workers:
            if not inner.is_boundary_output:
                inner.queue_by(self._counted(inner.push), self._counted(inner.push_next))

    def _counted(self, push: Callable[[Worker], None]) -> Callable[[Worker], None]:
        def counted(inner: Worker) -> None:
            self._queued += 1
            inner.core.host.kick()
            push(inner)

        return counted

    def step(self, inner: Worker) -> None:
        """One worker of the inside does its next piece of work."""
        self._queued -= 1
        firing.step(inner)
        self.settle()

    def begin(self, arguments: Sequence[Any]) -> None:
        """The subgraph fires: let the elements go in, one after the other.

        Unequal lengths are an error of the firing (X1).
        """
        worker = self.worker
        names = list(worker.type.inputs)
        lengths = {name: len(list(value)) for name, value in zip(names, arguments, strict=True) if name in self._over}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f'"{name}" has {length}' for name, length in lengths.items())
            problem = ValueError(f"it iterates over inputs of unequal length: {shown} elements")
            errors.fail(worker, f"firing {worker.firings}", problem, answer=True)
            return
        count = next(iter(lengths.values()), 0)
        columns = [
            list(value) if name in self._over else [value] * count for name, value in zip(names, arguments, strict=True)
        ]
        self._elements = list(zip(*columns, strict=True))
        self._position = 0
        self._results = [[] for _ in self.worker.type.outputs]
        self.worker.set_out()
        self._next()

    def _next(self) -> None:
        core = self.core
        if self._position == len(self._elements):
            self._finished()
            return
        element = self._elements[self._position]
        self._position += 1
        names = list(self.worker.type.inputs)
        for feed in core.feeds:
            value = element[names.index(feed.port_name)]
            put_outputs(feed, [(NO_MESSAGE if value is None else value, None, self.worker.stamp)])
        self.look_later()

    def _finished(self) -> None:
        worker = self.worker
        worker.come_back()
        for position, values in enumerate(self._results):
            worker.write(position, (values, None, None))
        firing.complete_firing(worker, None)
        worker.core.host.kick()

    def look_later(self) -> None:
        """See at the loop's next pass whether the inside is quiet."""
        if not self.looks and self.worker.in_flight:
            self.looks = True
            self.worker.core.host.soon(self._look)

    def _look(self) -> None:
        self.looks = False
        self.settle()
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            answer(waiter, None)

    async def looked(self) -> None:
        """Wait until it was seen whether the inside is quiet, and what follows has been done."""
        while self.looks:
            waiter: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            self._waiters.append(waiter)
            await waiter

    def settle(self) -> None:
        """If the inside is quiet, take what came out and go on with the next element."""
        core = self.core
        if not self.worker.in_flight or self.worker.core.over:
            return
        if self._queued or core.timers:
            return
        if core.in_flight and not (core.waiting_room and quiet.only_waiting_for_room(core)):
            return
        came_out = False
        for reader in core.readers:
            position = list(self.worker.type.outputs).index(reader.port_name)
            while reader.live_inputs and not reader.inputs.missing:
                token = take_from_reader(reader)
                came_out = True
                if type(token.value) is not Marker:
                    self._results[position].append(token.value)
        if came_out or quiet.grow(core):
            self.look_later()
            return
        self._next()
