"""The handle of a run, by which code outside the graph controls it (rules R1, R7, P10).

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
from hfg.engine.editing.breakpoints import Breakpoint, Step
from hfg.engine.editing.setting import set_parameter
from hfg.engine.executing.code import answer
from hfg.engine.executing.room import trigger_wait
from hfg.engine.face import outside
from hfg.engine.face.composition import Composition
from hfg.engine.fusion.explaining import Explanation, explain
from hfg.engine.model.running_node import UNREADY
from hfg.engine.observing.consumers import Listener
from hfg.engine.observing.glance import Glance, glance_at
from hfg.engine.observing.report import Report, RunPage, RunRecording
from hfg.engine.observing.sampling import Sampler
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
from hfg.graph.structure.paths import parameter_at
from hfg.nodetypes.node import Node
from hfg.ports import EventPort, ParameterPort, Port, SlotPort
from hfg.ports.base import need_sendable
from hfg.trace import Consumer
from hfg.types import accepts, describe

__all__ = ["Run"]

T = TypeVar("T")


class Run:
    """A run of a graph: the handle by which code outside the graph feeds, watches, edits and ends it.

    `running` makes one, and `run(begin=...)` passes one to its function.
    """

    def __init__(self, graph: Graph, parts: Composition) -> None:
        self.graph = graph
        self._parts = parts
        self._afar: Any = None  # the other parts of the run; see `hfg.monitors.gathering`
        self._is_part = False  # a part of a run that another process has started
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
        """Send a signal into a slot, or trigger an event as its node would. Wait while a queue is full (F8).

        Args:
          port: a slot or an event of a node in the graph, or its path.
          value: a value of the port's type, or a token, which keeps its modifier and stamp.
          activity: the modifier. Into a slot it acts as over an active edge.
          stamp: seconds on the run's clock; by default now.

        Raises:
          TypeError: the value is not of the port's type.
          GraphError: the path does not exist.
          UsageError: the port is neither a slot nor an event of a node.
          NotRunning: the run is over.
        """
        port = self._at(port)
        if not isinstance(port, EventPort | SlotPort):
            raise UsageError(
                f"run.trigger is for slots and events of nodes, got {port!r}; give tokens to a graph input "
                f"with run.feed"
            )
        need_sendable(value, activity, stamp)
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
        await trigger_wait(event, value, activity, self._engine.now() if stamp is None else stamp)

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
        """Open a feed into a graph input. Use it with `async with`; it holds the run open until it is closed (P10).

        Args:
          port: the graph input, or its name.
          end: send END when the feed is closed.

        Returns:
          The feed; its `send` waits until the token is processed.

        Raises:
          UsageError: the graph has no such input, or nothing is connected to it.
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
        """Read a graph output, value by value and without loss (P10).

        A reader that does not read holds the graph back. The run does not end while values wait for a reader.

        Args:
          port: the graph output, or its name.

        Returns:
          An async iterator over the values; it ends with the run.

        Raises:
          UsageError: the graph has no such output, or nothing is connected to it.
        """
        name = self._boundary(port, self.graph.outputs)
        for worker in self._engine.core.readers:
            if worker.port_name == name:
                return outside.read(self._engine, worker)
        raise UsageError(
            f'graph output "{name}" is not connected: graph.connect(..., graph.outputs["{name}"]) before the run'
        )

    def tap(self, what: PortEnd | Edge | str, *, size: int | None = None, max_rate_hz: float | None = None) -> Tap:
        """Watch a port or an edge: return an async iterator over its tokens, including markers.

        A tap never slows the graph down. When its buffer is full, it skips the oldest tokens and counts them.

        Args:
          what: a port or an edge, or its path: "fetch/go_to.goal", "a.out -> b.in". An event yields its signals, an
            output yields each token once regardless of fan-out, and a slot yields everything that arrives over its
            edges or from outside.
          size: number of tokens to buffer for the reader. Default 100; with `max_rate_hz` 1, the latest.
          max_rate_hz: yield at most this many tokens per second on the run's clock.

        Raises:
          UsageError: the port belongs to no run, or has no edge.
          GraphError: the path does not exist.
          NotRunning: the run is over.
        """
        self._need_running("nothing will pass there any more")
        return self._parts.taps.add(what, size, max_rate_hz)

    def trace(self, consumer: Consumer, *, size: int | None = None, changes_only: bool = False) -> Listener:
        """Send every event of the run to a consumer from now on (R7).

        Args:
          consumer: a function that takes an event, or a list. A function is called immediately and on the loop, so it
            must be quick. A consumer that raises is logged and removed; the run continues.
          size: number of events to buffer; the function is then called in a thread of its own. An async function always
            has a task and a buffer. A consumer that is too slow loses the oldest events, which are counted as `lost`.
          changes_only: leave out the events of single tokens, firings and calls, so that the graph runs as fast as
            without: only activity, parameters, errors, pauses, edits and the ends of nodes are sent.

        Returns:
          A listener; its `remove` removes the consumer.

        Raises:
          UsageError: the consumer cannot take events.
        """
        return self._parts.consumers.add(consumer, size, changes_only=changes_only)

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
        """Record ports to an MCAP file from now on: tokens, activity, parameters and the graph itself.

        Call it in `begin=` to record everything from the start. The recording ends with the run, which waits until the
        file is complete. `stop()`, `close()` or leaving an `async with` block ends it sooner.

        Args:
          file: the file. It can be read at any time up to its last second, even if the program crashes.
          select: paths of ports or nodes, or patterns such as "camera/*"; by default all outputs and events.
          lossless: record everything: recorded nodes wait while the disk is slower. Otherwise the graph is never slowed
            down, and tokens that cannot be written in time are counted.
          images: format of images: "raw", "png" (smaller, slower, lossless) or "jpeg" (lossy).
          pickle: write values that are not data with pickle. Reading such a file runs code.
          force: overwrite an existing file.

        Raises:
          UsageError: no port matches, the values of one cannot be recorded, or the file exists or cannot be written.
          NotRunning: the run is over.
        """
        recording: RunRecording = hooks.record(
            self, file, select=select, lossless=lossless, images=images, pickle=pickle, force=force
        )
        return recording

    def _need_here(self, chosen: Callable[[str], bool]) -> None:
        """Refuse to record chosen ports, by their paths, that are in another process; here none is."""

    def report_page(self, file: str | os.PathLike[str], *, pictures: int = 24, picture_size: int = 320) -> RunPage:
        """Write a page about the run when it is over: one self-contained HTML file.

        The page has the drawing with the active nodes at any time, activity and firings over time, counts, times,
        errors and images. Call it in `begin=` to cover the whole run. Memory and file size are bounded however long the
        run is; the page says what it leaves out.

        Args:
          file: the file; an existing one is overwritten.
          pictures: number of images from outputs and events to show, spread evenly over ports and time; 0 shows none.
          picture_size: maximum length of their longer side in pixels.

        Returns:
          The page, to which you can add sections of your own.

        Raises:
          UsageError: the file cannot be written, or a number is out of range.
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to see for a page")
        page: RunPage = hooks.report_page(self, file, pictures=pictures, picture_size=picture_size)
        return page

    def studio(self, *, port: int | None = None, read_only: bool = False) -> Any:  # noqa: ANN401 - of a higher layer
        """Serve the studio of this run from now on: a page in the browser that watches, edits and steers it.

        Call it on the run's loop. A notebook shows the result as a frame; `await page.close()` ends the server.

        Args:
          port: of this computer; default: the first free one from 8800.
          read_only: the page cannot change or steer anything.

        Returns:
          The page, with its `address`. Give the address only to people who may run code as you.

        Raises:
          UsageError: the extra `hfg[studio]` is not installed.
          TargetError: the port is in use.
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to steer")
        return hooks.studio(self, port=port, read_only=read_only)

    def foxglove(self, *, port: int | None = None, origins: Iterable[str] = ()) -> Any:  # noqa: ANN401 - likewise
        """Let Foxglove show this run from now on: what a recording would write, encoded only while a viewer looks.

        Call it on the run's loop. It ends with the run.

        Args:
          port: of this computer; default: the first free one from 8765.
          origins: further origins of web pages that may look, "https://example.org"; the application of Foxglove may.

        Returns:
          The server, with its `address` to connect to. Give it only to people who may see what passes.

        Raises:
          UsageError: the extra `hfg[studio]` is not installed.
          TargetError: the port is in use.
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to see")
        return hooks.foxglove(self, port=port, origins=origins)

    @overload
    def set(self, parameter: ParameterPort[T], value: T) -> None: ...
    @overload
    def set(self, parameter: str, value: object) -> None: ...
    def set(self, parameter: ParameterPort[Any] | str, value: Any) -> None:
        """Set a parameter of a node: now, or as soon as its current firing is over (P8).

        Setting a promoted parameter of a subgraph sets the inner parameters that it stands for.

        Args:
          parameter: the port, `node.ports.parameters["gain"]`, or its path, "fetch/filter.gain".
          value: a value within the parameter's limits.

        Raises:
          ValueError: the value is out of limits; nothing was changed.
          UsageError: setting it would have no effect, because a generator function has already received the old value.
          GraphError: the path does not exist.
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
        """Change the graph while it runs. If any command is refused, nothing is changed (R4).

        New nodes are set up first. The change takes effect at one moment, between firings of the nodes that it affects,
        and then this returns; other nodes keep running. Tokens on a removed edge are dropped and count as processed; a
        new edge starts empty. If the call is cancelled before the change takes effect, nothing is changed.

        Args:
          *commands: edits from `hfg.commands`, in order.

        Raises:
          GraphError: a command cannot be carried out; the message says which one and why.
          NodeError: the `setup()` of a new node failed. A node that it was to replace is set up again.
          UsageError: the edit is only possible while the graph is not running, or was requested by code that it has to
            wait for.
          NotRunning: the run is over.
        """
        await self._edits.edit(commands)

    async def undo(self) -> None:
        """Undo the last edit, whether it was made in this run or before. Nodes that come back start from scratch.

        Raises:
          UsageError: there is no edit to undo, or the graph was changed by other means since.
        """
        await self._edits.undo()

    async def redo(self) -> None:
        """Carry out the edit again that was undone last.

        Raises:
          UsageError: there is no edit to redo.
        """
        await self._edits.redo()

    async def reload(self, module: str | ModuleType) -> None:
        """Reload a changed module and replace the nodes whose types it defines.

        Parameters, edges, tokens on them and activity stay; the nodes are torn down and set up.

        Args:
          module: the module, or its name.

        Raises:
          GraphError: the module fails, or a type does not fit; the graph continues as it is.
        """
        await self._edits.reload(module)

    # --- holding it still (R3) ----------------------------------------------------------------------------------------

    @property
    def paused(self) -> bool:
        """Whether the run is paused: no new firing or slot call starts."""
        return self._pausing.paused

    @property
    def breakpoints(self) -> list[Breakpoint]:
        """The breakpoints that are set."""
        return self._pausing.breakpoints

    def pause(self) -> None:
        """Start no new firing and no new slot call (R3).

        Firings and calls in progress finish, tokens stay where they are, and signals from outside are still accepted.
        Time passes, including virtual time.

        Raises:
          NotRunning: the run is over.
        """
        self._need_running("there is nothing left to pause")
        self._pausing.pause()

    def resume(self) -> None:
        """Continue after a pause, past the breakpoints that caused it. Does nothing if the run is not paused.

        Raises:
          UsageError: a step is in progress.
        """
        self._pausing.resume()

    async def wait_paused(self) -> str:
        """Wait until the run is paused, by `pause` or a breakpoint, and nothing is in progress any more.

        Returns:
          The path of the breakpoint that was hit, or "pause".

        Raises:
          UsageError: the run has ended.
        """
        return await self._pausing.wait_paused()

    async def step(self, node: Node | str | None = None) -> Step:
        """Let a paused run make one step, and wait until the step is over (R3).

        Args:
          node: the node to step. It makes one firing or one slot call, whichever is next (F9). If it cannot move, the
            step says why. Without a node, each node makes at most one firing and one call, including those that become
            possible during the step.

        Returns:
          The step: what moved, or why nothing did.

        Raises:
          UsageError: the run is not paused or has ended, another step is in progress, or the node is a subgraph.
        """
        return await (self._pausing.wave() if node is None else self._pausing.step(node))

    def break_at(
        self, place: Node | PortEnd | Edge | str, *, when: Callable[[Token[Any]], object] | None = None
    ) -> Breakpoint:
        """Pause the run whenever it reaches a place; `wait_paused` waits until it has.

        Args:
          place: a node, an edge or a port, or its path. The run pauses before each firing and call of a node, and as
            soon as a token is on an edge or port.
          when: for edges and ports: pause only if this returns true for the token. If it raises, the error is logged
            and the breakpoint is removed.

        Returns:
          The breakpoint; its `remove` removes it.

        Raises:
          UsageError: the run has no such place, or `when` was given for a node or is not callable.
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
        """Wait for the next signal of an event.

        Args:
          event: the event of a node, or its path.

        Returns:
          The signal's token.

        Raises:
          NotRunning: the run ended without a signal.
          UsageError: it is not an event of a node in this graph, or it is the graph's `start`, which is over by now.
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
        try:
            await self._engine.or_end(waiter)
            if waiter.done():
                return waiter.result()
            raise NotRunning(f'the run ended before "{event.path}" was triggered')
        finally:
            waiter.cancel()
            subscription.dispose()

    async def wait_quiet(self) -> None:
        """Wait until nothing runs, nothing can start and no timer is pending that could start something (R5)."""
        await self._engine.quiet.wait()
        self._parts.raise_failure()

    async def wait_inputs(self, node: Node | str) -> None:
        """Wait for a node's input barrier: every live input holds a token.

        Args:
          node: the node, or its path.
        """
        await self._barrier(self._at(node), "inputs")

    async def wait_outputs(self, node: Node | str) -> None:
        """Wait for a node's output barrier: every token that it has sent is processed.

        Args:
          node: the node, or its path.
        """
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
        """Let the run end by itself (R5), and wait until it has ended.

        Returns:
          The report.

        Raises:
          RunError: the run failed, stalled or was aborted.
        """
        await asyncio.sleep(0)  # tasks that were started together with us open their feeds and readers first
        self._parts.let_end()
        await self._engine.ending.wait()
        await self._parts.close()
        return self.report()

    # --- looking ----------------------------------------------------------------------------------------------------

    def active(self) -> list[str]:
        """Return the paths of all active nodes, in the order in which they were added."""
        return [
            worker.path
            for worker in self._engine.core.workers
            if worker.active and worker.scope is None and worker.node is not None
        ]

    def statistics(self) -> Statistics:
        """Return a frozen snapshot of counts, rates, times and depths, ready for JSON.

        Counts are always kept. Times are measured from the first call on, at a cost of about 0.2 us per firing: call
        this at the start of the block to cover the whole run.
        """
        return self._parts.measuring.snapshot()

    def glance(self) -> Glance:
        """Return the few counts that a live table shows; cheap enough for many calls per second, on the run's loop.

        The first call starts measuring times, as `statistics` does.
        """
        return glance_at(self._engine, self._parts.measuring)

    def explain(self, node: Node | str | None = None) -> dict[str, Explanation]:
        """Explain how nodes do their work at this moment: fused, with which others, or why not and what to do.

        Fused nodes fire about fifty times as fast as those that are interpreted. The first firings of each node are
        interpreted, and so is everything while a trace is attached. For a node that has ended: how it was.

        Args:
          node: of which to explain; a subgraph stands for all nodes inside. By default, of all nodes of the graph.

        Returns:
          By path, in the order in which the nodes were added.

        Raises:
          UsageError: it is no node of this run.
        """
        if node is None:
            inside = self._engine.core.workers
        else:
            worker = self._engine.worker_of(self._at(node))
            inside = [worker] if worker.scope is None else worker.scope.inside()
        return {worker.path: explain(worker) for worker in inside if worker.node is not None and worker.scope is None}

    def sampler(self) -> Sampler:
        """Return what samples single nodes and edges of this process many times a second, at next to no cost.

        The first call starts measuring times, as `statistics` does.
        """
        return Sampler(self._engine, self._parts.measuring)

    async def refresh(self) -> None:
        """Ask the nodes in other processes for their counts, and wait for the answers.

        `active`, `glance`, `statistics` and `report` return immediately. For other processes they show the last report,
        and request a new one each time. After `refresh` they are up to date. In a run with one process this does
        nothing.
        """

    def now(self) -> float:
        """Return seconds on the run's clock, as in stamps; `hfg.now` says where its zero is."""
        return self._engine.now()

    def elapsed(self) -> float:
        """Return seconds since the run started, up to its end; 0 before it has started."""
        return self._engine.elapsed()

    def wake(self, node: Node | str) -> None:
        """Make a node ask its `ready()` again (F1).

        Args:
          node: the node, or its path.
        """
        unblock(self._engine.worker_of(self._at(node)), UNREADY)
        self._engine.kick()

    def stop(self) -> None:
        """End the run normally, as the graph's slot `stop` does."""
        self._engine.finish("stopped", None)

    def reset_activity(self) -> None:
        """Deactivate all nodes, clear all modifiers and trigger `start` again (A14)."""
        reset_activity(self._engine.core)
        self._engine.kick()

    @property
    def error(self) -> HfgError | None:
        """The error that the run failed with, or None. A cancelled run can still fail in its teardown."""
        return self._engine.error

    def report(self) -> Report:
        """Return the report: what each node and edge has done so far. It is final once the run is over."""
        return self._parts.report()

    # --- inside -----------------------------------------------------------------------------------------------------

    def _at(self, what: Any) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
        """Return the thing at a path; anything else is returned as it is."""
        return self.graph[what] if isinstance(what, str) else what

    def _need_running(self, why: str) -> None:
        if self._engine.core.over:
            raise NotRunning(f"the run is over: {why}; do it inside of `async with hfg.running(graph)`, before the end")

    def _boundary(self, port: object, ports: Mapping[str, object]) -> str:
        """Return the name of one of the graph's own ports, given as port or name."""
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
        """An automatic event, or `start`, has got a subscriber; called by the event."""
        if event is self.graph.start:
            bind_start(self._engine.worker_of(self.graph), event)
        else:
            bind_event(self._engine.worker_of(event.node), event.name)


def _names(ports: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in ports) or "none"
