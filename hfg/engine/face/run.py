"""What one can do with a run from outside (rules R1, R7, P10).

A thin face: what is asked for is done by the parts of `composition`.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from functools import partial
from types import ModuleType
from typing import Any, Literal, TypeVar, overload

from hfg.base.hooks import hooks
from hfg.base.token import Token
from hfg.engine.editing.pausing import Breakpoint, Step
from hfg.engine.editing.setting import set_parameter
from hfg.engine.executing.code import answer
from hfg.engine.face import outside
from hfg.engine.face.composition import Composition
from hfg.engine.model.worker import UNREADY
from hfg.engine.observing.consumers import Listener
from hfg.engine.observing.glance import Glance, glance_at
from hfg.engine.observing.recorder import RunRecording
from hfg.engine.observing.report import Report, RunPage
from hfg.engine.observing.statistics import Statistics
from hfg.engine.observing.taps import Tap
from hfg.engine.rules.activity import reset_activity
from hfg.engine.rules.agenda import unblock
from hfg.engine.runtime import relays
from hfg.engine.runtime.ports import bind_event, bind_start
from hfg.errors import HfgError, NotRunning, UsageError, shown
from hfg.graph import Graph
from hfg.graph.editing.commands import Command
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.edge import Edge, PortEnd
from hfg.graph.structure.level import level_of
from hfg.graph.structure.pointing import parameter_at
from hfg.nodetypes.node import Node
from hfg.ports import EventPort, ParameterPort, Port, SlotPort
from hfg.trace import Consumer
from hfg.types import accepts, describe

__all__ = ["Run"]

T = TypeVar("T")


class Run:
    """A graph that runs; made by `running`."""

    def __init__(self, graph: Graph, parts: Composition) -> None:
        self.graph = graph
        self._parts = parts
        self._engine = parts.engine
        self._edits = parts.edits
        self._pausing = parts.pausing

    # --- bringing in and taking out ---------------------------------------------------------------------------------

    @overload
    async def trigger(
        self,
        port: EventPort[T] | SlotPort[T],
        value: T | Token[T] | None = None,
        *,
        activity: int | None = None,
        stamp: float | None = None,
    ) -> None: ...
    @overload
    async def trigger(
        self, port: str, value: object = None, *, activity: int | None = None, stamp: float | None = None
    ) -> None: ...
    async def trigger(
        self, port: Any, value: Any = None, *, activity: int | None = None, stamp: float | None = None
    ) -> None:
        """Send a signal into a slot, or trigger an event as its node would; waits while a queue is full (F8).

        Args:
          port: a slot or an event of a node in the graph, or its path.
          value: of the port's type; a token passed on keeps its modifier and stamp.
          activity: the modifier; into a slot it acts as over an active edge.
          stamp: seconds on the run's clock; now, if not given.

        Raises:
          TypeError: the value is not of the port's type.
          GraphError: the path leads nowhere.
          NotRunning: the run is over.
        """
        port = self._at(port)
        if not isinstance(port, EventPort | SlotPort):
            raise UsageError(
                f"run.trigger is for slots and events of nodes, got {port!r}; give tokens to a graph input "
                f"with run.feed"
            )
        outside.need_sendable(activity, stamp)
        plain = value.value if isinstance(value, Token) else value
        if not accepts(plain, port.type) and (plain is not None or port.kind == "slot"):
            raise TypeError(f'{port.kind} "{port.path}" expects {describe(port.type)}, got {shown(plain)}')
        if relays.is_relay(port):
            await self._trigger_inside(port, value, activity, stamp)
            return
        await self._bring(port, value, activity, stamp)

    async def _bring(self, port: Port, value: object, activity: int | None, stamp: float | None) -> None:
        """Send a signal into the slot of a node, or trigger its event."""
        worker = self._engine.worker_of(port.node)
        if port.kind == "slot":
            await outside.signal(self._engine, worker, port.name, value, activity, stamp)
            return
        event = bind_event(worker, port.name)
        await self._engine.code.trigger_wait(event, value, activity, self._engine.now() if stamp is None else stamp)

    async def _trigger_inside(self, port: Port, value: object, activity: int | None, stamp: float | None) -> None:
        """The slot of a subgraph stands for those inside that it leads to (G1)."""
        behind = relays.slots_behind(port) if port.kind == "slot" else []
        if not behind or any(slot.kind != "slot" for slot, _ in behind):
            raise UsageError(
                f'"{port.path}" is the {port.kind} of a subgraph and leads to no slot inside: name the port of a node'
            )
        for slot, active in behind:
            await self._bring(slot, value, activity if active else 0, stamp)

    @overload
    def feed(self, port: GraphInput[T], *, end: bool = True) -> outside.Feed[T]: ...
    @overload
    def feed(self, port: str, *, end: bool = True) -> outside.Feed[Any]: ...
    def feed(self, port: GraphInput[Any] | str, *, end: bool = True) -> outside.Feed[Any]:
        """Open a feed into a graph input; use it with `async with`.

        Which holds the run open and sends END at its end unless `end=False`.
        """
        name = self._boundary(port, self.graph.inputs)
        for worker in self._engine.core.feeds:
            if worker.port_name == name:
                return outside.Feed(self._engine, worker, self.graph.inputs[name].type, end=end)
        raise UsageError(
            f'graph input "{name}" is not connected: graph.connect(graph.inputs["{name}"], ...) before the run'
        )

    @overload
    def read(self, port: GraphOutput[T]) -> AsyncIterator[T]: ...
    @overload
    def read(self, port: str) -> AsyncIterator[Any]: ...
    def read(self, port: GraphOutput[Any] | str) -> AsyncIterator[Any]:
        """Read a graph output, value by value and lossless: a reader that does not read holds the graph back (P10).

        While something lies before a reader that goes on, the run does not end.
        """
        name = self._boundary(port, self.graph.outputs)
        for worker in self._engine.core.readers:
            if worker.port_name == name:
                return outside.read(self._engine, worker)
        raise UsageError(
            f'graph output "{name}" is not connected: graph.connect(..., graph.outputs["{name}"]) before the run'
        )

    def tap(self, what: PortEnd | Edge | str, *, size: int | None = None, max_rate_hz: float | None = None) -> Tap:
        """Look at a port or an edge, given itself or by path: an async iterator over the tokens, markers too.

        The graph never waits for a tap: tokens that it has no room for are skipped, oldest first, and counted.

        Args:
          what: a port or an edge of the graph, "fetch/go_to.goal", or "a.out -> b.in". An event shows its signals, an
            output each token once whatever its fan-out, a slot what comes over all its edges and from outside.
          size: how many tokens are kept for the reader; 100, or 1, the latest, with `max_rate_hz`.
          max_rate_hz: give at most so many tokens a second of the run's clock.

        Raises:
          UsageError: it is in no run or has no edge.
          GraphError: there is no such path.
          NotRunning: the run is over.
        """
        self._need_running("nothing will pass there any more")
        return self._parts.taps.add(what, size, max_rate_hz)

    def trace(self, consumer: Consumer, *, size: int | None = None) -> Listener:
        """Let a consumer see every event of the run from now on (R7); gives back what removes it.

        Args:
          consumer: a function that takes an event, called at once and on the loop, so let it be quick; or a list.
            One that raises is logged and removed, and the run goes on.
          size: the events that a buffer of its own holds; the function is then called on a thread of its own. An async
            function has a task and a buffer in any case. Whoever is too slow loses the oldest, counted as `lost`.

        Raises:
          UsageError: it cannot take events.
        """
        return self._parts.consumers.add(consumer, size)

    def record(
        self,
        file: str | os.PathLike[str],
        *,
        select: str | Iterable[str] = "*",
        lossless: bool = True,
        images: Literal["raw", "png", "jpeg"] = "raw",
        pickle: bool = False,
        force: bool = False,
    ) -> RunRecording:
        """Write what passes ports to an MCAP file from now on: tokens, activity, parameters, the graph itself.

        In `begin=`, before nodes are set up, nothing is missed. It ends with the run, which waits until the file is
        whole; `stop()`, `close()` or the end of an `async with` block end it sooner.

        Args:
          file: where to; it can be read at any time up to its last second, whatever becomes of the program.
          select: paths of ports or nodes, or patterns of them, "camera/*"; by default all outputs and events.
          lossless: nothing is left out: nodes whose ports are recorded wait where the disk is slower. Else the graph is
            never slowed, and what there is no time for is counted.
          images: how images are written: "raw", "png" (smaller, slower, the same to the bit), "jpeg" (with losses).
          pickle: write values that are no data with pickle; reading such a file runs code.
          force: write over a file that is there.

        Raises:
          UsageError: no port fits, values of one cannot be recorded, or the file is there already or cannot be made.
          NotRunning: the run is over.
        """
        recording: RunRecording = hooks.record(
            self, file, select=select, lossless=lossless, images=images, pickle=pickle, force=force
        )
        return recording

    def _need_here(self, chosen: Callable[[str], bool]) -> None:
        """Refuse to record chosen ports, by their paths, that are in another process; here none is."""

    def report_page(self, file: str | os.PathLike[str], *, pictures: int = 24, picture_size: int = 320) -> RunPage:
        """Write a page about the run when it is over: one HTML file that needs nothing besides itself.

        It has the drawing with who was active at any time, the times of activity and of firings, counts, times, errors
        and pictures. In `begin=`, before nodes are set up, nothing is missed; what is asked for later begins there.
        However long the run is, memory and file are bounded, and the page says what it leaves out.

        Args:
          file: where to; one that is there is written over.
          pictures: how many of those that pass outputs and events are shown, spread evenly over ports and time; 0 shows
            none. They are images of 8 bits.
          picture_size: how many pixels their longer side has at most.

        Raises:
          UsageError: the file cannot be written, or a number is out of its range.
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to see for a page")
        page: RunPage = hooks.report_page(self, file, pictures=pictures, picture_size=picture_size)
        return page

    @overload
    def set(self, parameter: ParameterPort[T], value: T) -> None: ...
    @overload
    def set(self, parameter: str, value: object) -> None: ...
    def set(self, parameter: ParameterPort[Any] | str, value: Any) -> None:
        """Set a parameter of a node between its firings: now, or when the one under way is over (P8).

        That of a subgraph sets those inside that it stands for.

        Args:
          parameter: its port, `node.ports.parameters["gain"]`, or its path, "fetch/filter.gain".
          value: within its limits.

        Raises:
          ValueError: the value is out of the parameter's limits; nothing is changed.
          UsageError: it would have no effect: a generator function has been given the old value.
          GraphError: the path leads nowhere.
          NotRunning: the run is over.
        """
        if isinstance(parameter, str):
            parameter = parameter_at(level_of(self.graph), parameter)
        if not isinstance(parameter, ParameterPort):
            raise UsageError(
                f'run.set takes the path of a parameter, or its port, as in node.ports.parameters["name"], got '
                f"{parameter!r}"
            )
        self._set(parameter, value)

    def _set(self, parameter: ParameterPort[Any], value: object) -> None:
        set_parameter(self._engine, parameter, value)

    # --- changing it (R4): one edit after the other, in the order they were asked for ---------------------------------

    async def edit(self, *commands: Command) -> None:
        """Change the graph while it runs: all of it, or when a command is refused, nothing.

        New nodes are set up first. The change takes effect at one moment, between firings of the nodes it touches, and
        then this returns; other nodes go on meanwhile. What lies on an edge that is removed is dropped and counts as
        processed; a new edge starts empty. Cancelled before it takes effect, it changes nothing.

        Raises:
          GraphError: a command cannot be carried out; the message says which and why.
          NodeError: the `setup()` of a node that comes failed; one that it was to replace is set up again.
          UsageError: it is an edit that only a graph at rest allows, or was asked for by code whose end it waits for.
          NotRunning: the run is over.
        """
        await self._edits.edit(commands)

    async def undo(self) -> None:
        """Take the last edit back, be it of this run or from before; nodes that come back start afresh.

        Raises:
          UsageError: there is none, or the graph was changed by hand since.
        """
        await self._edits.undo()

    async def redo(self) -> None:
        """Carry the edit out again that was undone last.

        Raises:
          UsageError: there is none.
        """
        await self._edits.redo()

    async def reload(self, module: str | ModuleType) -> None:
        """Run a changed module again; its node types replace those of its nodes.

        Parameters, edges, what lies on them and activity stay; the nodes are torn down and set up.

        Raises:
          GraphError: the module fails, or a type does not fit; the graph goes on with what it has.
        """
        await self._edits.reload(module)

    # --- holding it still (R3) ----------------------------------------------------------------------------------------

    @property
    def paused(self) -> bool:
        """Whether no new firing or slot call starts at the moment."""
        return self._pausing.paused

    @property
    def breakpoints(self) -> list[Breakpoint]:
        """The breakpoints that are set."""
        return self._pausing.breakpoints

    def pause(self) -> None:
        """Let no new firing and no new slot call start (R3).

        What is under way goes on to its end, tokens stay where they are, signals from outside are still taken in. Time
        goes on too, also virtual time.

        Raises:
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to pause")
        self._pausing.pause()

    def resume(self) -> None:
        """Go on after a pause, past the breakpoints that caused it. Does nothing if the run is not paused.

        Raises:
          UsageError: a step is under way.
        """
        self._pausing.resume()

    async def wait_paused(self) -> str:
        """Wait until the run is paused, by `pause` or a breakpoint, and nothing is under way any more.

        Returns:
          The path of the breakpoint that was hit, or "pause".

        Raises:
          UsageError: the run has ended.
        """
        return await self._pausing.wait_paused()

    async def step(self, node: Node | str | None = None) -> Step:
        """Let a paused run make one step, and wait until it is over (R3).

        Args:
          node: makes one firing or one slot call, whichever is next in its order (F9); one that cannot move does not,
            and the step says why. Without a node: a wave, in which each node makes at most one firing and one call,
            those included that become able to by it.

        Raises:
          UsageError: the run is not paused or has ended, another step is under way, or the node is a subgraph.
        """
        return await (self._pausing.wave() if node is None else self._pausing.step(node))

    def break_at(
        self, place: Node | PortEnd | Edge | str, *, when: Callable[[Token[Any]], object] | None = None
    ) -> Breakpoint:
        """Pause the run at a place from now on; `wait_paused` tells when.

        Args:
          place: a node, before each of whose firings and calls the run pauses; an edge, port, or path of one, on which
            the run pauses as soon as a token lies there.
          when: for edges and ports: pause only if this holds for the token. If it raises, it is logged and the
            breakpoint removed.

        Raises:
          UsageError: there is no such place in the run, or `when` was given for a node or cannot be called.
          NotRunning: the run is over.
        """
        self._need_running("nothing will come there any more")
        return self._pausing.break_at(place, when)

    # --- waiting ----------------------------------------------------------------------------------------------------

    @overload
    async def wait_for(self, event: EventPort[T]) -> Token[T]: ...
    @overload
    async def wait_for(self, event: str) -> Token[Any]: ...
    async def wait_for(self, event: EventPort[Any] | str) -> Token[Any]:
        """Wait for the next signal of an event, given itself or by its path.

        Raises:
          NotRunning: the run ended without one.
          UsageError: it is no event of a node in this graph, or the graph's `start`, which is over by now.
        """
        event = self._at(event)
        if not isinstance(event, EventPort):
            raise UsageError(f"run.wait_for waits for an event of a node, got {event!r}; look at others with run.tap")
        if event is self.graph.start:
            raise UsageError(
                '"start" was triggered as the run began, so waiting for it would never end: leave the line out, or '
                "write `await run.wait_quiet()` to wait for what it began"
            )
        return await self._next_of(event)

    async def _next_of(self, event: EventPort[Any]) -> Token[Any]:
        waiter: asyncio.Future[Token[Any]] = self._engine.loop.create_future()
        bind_event(self._engine.worker_of(event.node), event.name)
        subscription = event.subscribe(partial(answer, waiter))
        ending = asyncio.ensure_future(self._engine.ending.wait())
        try:
            await asyncio.wait((waiter, ending), return_when=asyncio.FIRST_COMPLETED)
            if waiter.done():
                return waiter.result()
            raise NotRunning(f'the run ended before "{event.path}" was triggered')
        finally:
            ending.cancel()
            waiter.cancel()
            subscription.dispose()

    async def wait_quiet(self) -> None:
        """Wait until nothing runs, nothing can start and no timer is pending (SEMANTICS, "quiet")."""
        await self._engine.wait_quiet()
        self._parts.raise_failure()

    async def wait_inputs(self, node: Node | str) -> None:
        """Wait for the node's input barrier: every live input holds a token."""
        await self._barrier(self._at(node), "inputs")

    async def wait_outputs(self, node: Node | str) -> None:
        """Wait for the node's output barrier: every token it sent is processed."""
        await self._barrier(self._at(node), "outputs")

    async def _barrier(self, node: Node, which: Literal["inputs", "outputs"]) -> None:
        worker = self._engine.worker_of(node)
        if worker.scope is not None:
            raise UsageError(f'"{worker.path}" is a subgraph, in which each node waits for itself: name a node inside')
        neighbours = [edge.source for edge in worker.in_edges] + [edge.target for edge in worker.all_out_edges()]
        for one in (worker, *neighbours):
            one.be_observed()
        await outside.until(self._engine, getattr(worker, which).when_complete)

    async def wait_finished(self) -> Report:
        """Let the run end by itself (R5), wait for that and give back the report.

        Raises:
          RunError: the run failed, stalled or was aborted.
        """
        await asyncio.sleep(0)  # tasks that were begun beside us open their feeds and readers first
        self._parts.let_end()
        await self._engine.ending.wait()
        await self._parts.close()
        return self.report()

    # --- looking ----------------------------------------------------------------------------------------------------

    def active(self) -> list[str]:
        """The paths of all active nodes, in order of adding."""
        return [
            worker.path
            for worker in self._engine.core.workers
            if worker.active and worker.scope is None and worker.node is not None
        ]

    def statistics(self) -> Statistics:
        """What the run has done so far: a frozen snapshot of counts, rates, times and depths, ready for JSON.

        Counts are kept anyway. Times are measured from the first call on, so make it at the start of the block if they
        are to cover the whole run; it costs some 0.2 us a firing.
        """
        return self._parts.measuring.snapshot()

    def glance(self) -> Glance:
        """Take the few counts that a live table shows, cheap enough for many times a second; on the run's loop.

        The first glance begins to measure, as `statistics` does.
        """
        _ = self._parts.measuring
        return glance_at(self._engine)

    async def refresh(self) -> None:
        """Ask nodes in other processes for their counts, and wait for those.

        `active`, `glance`, `statistics` and `report` answer at once: of other processes with what these last said,
        which they are asked for again each time. Behind this they say how it is now. In one process it does nothing.
        """

    def now(self) -> float:
        """Seconds on the run's clock, as in stamps; `hfg.now` says where it has its zero."""
        return self._engine.now()

    def elapsed(self) -> float:
        """Seconds since the run began, up to its end; 0 before it has begun."""
        return self._engine.elapsed()

    def wake(self, node: Node | str) -> None:
        """Ask a node's `ready()` again (F1)."""
        unblock(self._engine.worker_of(self._at(node)), UNREADY)
        self._engine.kick()

    def stop(self) -> None:
        """End the run well, as the graph's slot `stop` does."""
        self._engine.finish("stopped", None)

    def reset_activity(self) -> None:
        """Take all activity away and trigger `start` again (A14)."""
        reset_activity(self._engine.core)
        self._engine.kick()

    @property
    def error(self) -> HfgError | None:
        """What the run failed with; None if it did not. A run that was cancelled can fail in its teardown."""
        return self._engine.error

    def report(self) -> Report:
        """What the run has done; final once it is over."""
        return self._parts.report()

    # --- inside -----------------------------------------------------------------------------------------------------

    def _at(self, what: Any) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
        """Give what was named by its path, or is given itself."""
        return self.graph[what] if isinstance(what, str) else what

    def _need_running(self, why: str) -> None:
        if self._engine.core.over:
            raise NotRunning(f"the run is over: {why}; do it inside of `async with hfg.running(graph)`, before the end")

    def _boundary(self, port: object, ports: Mapping[str, object]) -> str:
        """Find one of the graph's own ports, given itself or by name."""
        name = str(getattr(port, "name", port))
        if name in ports and (port == name or port is ports[name]):
            return name
        kind, verb = ("input", "feed") if ports is self.graph.inputs else ("output", "read")
        found = f'"{getattr(port, "path", port)}"' if isinstance(port, str) or hasattr(port, "name") else repr(port)
        raise UsageError(
            f'{found} is no {kind} of graph "{self.graph.name}", which has {_names(ports)}: '
            f'run.{verb} takes what graph.{kind}("name", type) gave'
        )

    def _adopt(self, event: EventPort[Any]) -> None:
        """Somebody has subscribed to an automatic event, or to `start`; asked by the event."""
        if event is self.graph.start:
            bind_start(self._engine.worker_of(self.graph), event)
        else:
            bind_event(self._engine.worker_of(event.node), event.name)


def _names(ports: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in ports) or "none"
