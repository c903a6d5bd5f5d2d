"""The run of a studio: started, ended, held, stepped and edited here; or one that another program has begun.

Everything happens on the graph's loop. Two callbacks report the consequences: the run is in another state, or
something of it has changed. Depends on the engine.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any, Protocol

import msgspec

from hfg.engine import Run, running
from hfg.engine.editing.breakpoints import Breakpoint
from hfg.errors import HfgError, NotRunning
from hfg.graph import Graph
from hfg.graph.editing.commands import Command
from hfg.nodetypes.node import Node
from hfg.studio.conditions import Looked, condition_text
from hfg.studio.failing import error_record
from hfg.studio.messages import Condition
from hfg.studio.places import place_at
from hfg.studio.records import BreakpointRecord, NodeRecord, ProblemRecord, RunRecord
from hfg.studio.refusing import Refused
from hfg.trace import RunEnded, RunPaused, RunResumed, TraceEvent

__all__ = ["Follower", "Steering"]


class Follower(Protocol):
    """Receives the changes of a run."""

    def run_changed(self) -> None:
        """It is in another state, or another run."""

    def run_begins(self, active: Iterable[str], at: float) -> None:
        """There is a run now: its active nodes, and how long it has been running."""

    def run_ends(self, at: float) -> None:
        """The run is over, after this many seconds."""

    def run_event(self, event: TraceEvent) -> None:
        """Something has changed in it that has to do with no single token."""

    def cursor_moved(self) -> None:
        """The cursor of a recording is elsewhere: streams are due."""

    def settings_changed(self, paths: Iterable[str]) -> None:
        """Parameters of these nodes may have other values."""

    def graph_changed(self, graph: Graph, text: str) -> None:
        """The graph is another one."""

    def problem(self, found: ProblemRecord) -> None:
        """Something has gone wrong."""


class _Stop:
    """A breakpoint that outlives runs."""

    def __init__(self, condition: Condition | None, changed: Callable[[], None]) -> None:
        self.condition = condition
        self.looked = None if condition is None else Looked(condition, changed)
        self.breakpoint: Breakpoint | None = None

    def set_in(self, run: Run, place: Any) -> None:
        """Pause this run there."""
        self.breakpoint = run.break_at(place, when=self.looked)

    def record(self, path: str, *, holds: bool) -> BreakpointRecord:
        """Describe it for pages."""
        return BreakpointRecord(
            path,
            0 if self.breakpoint is None else self.breakpoint.hits,
            holds,
            condition_text(self.condition),
            None if self.condition is None else msgspec.to_builtins(self.condition),
            "" if self.looked is None else self.looked.why_not,
        )


class Steering:
    """One graph and its runs, one after the other.

    Attributes:
      graph: the whole graph.
      run: the current run; None at rest.
      looking: the requests that change nothing, so that they are for pages that may only look, too.
      is_live: its graph can run, so it is worth looking for mistakes in it.
    """

    looking: frozenset[type] = frozenset()
    is_live = True

    def __init__(self, graph: Graph, follower: Follower, target: str | bool = False) -> None:
        self.graph = graph
        self.run: Run | None = None
        self._follower = follower
        self._target = target
        self._own = True
        self._record = RunRecord()
        self._stops: dict[str, _Stop] = {}
        self._task: asyncio.Task[None] | None = None
        self._until_stopped: asyncio.Event | None = None
        self._listener: Any = None
        self._offset = 0.0
        self._over = asyncio.Event()
        self._step = asyncio.Lock()

    def follow(self, run: Run) -> None:
        """Follow a run that another program has begun, and that cannot be started here."""
        self._own = False
        self._record = msgspec.structs.replace(self._record, steerable=False)
        self._begun(run)

    # --- from rest to rest ---

    async def start(self, *, stay: bool) -> None:
        """Let the graph run; return when its nodes are set up.

        Raises:
          HfgError: it cannot run, or fails as it begins.
        """
        if self.run is not None or self._task is not None:
            raise Refused("state", "the graph runs already; stop it first")
        if not self._own:
            raise Refused("state", "the run is over, and belongs to another program: start it there")
        begun: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._say(state="starting", outcome="", error=None, number=self._record.number + 1, elapsed_s=0.0, why="")
        self._task = asyncio.create_task(self._live(begun, stay), name="hfg studio run")
        await begun

    async def _live(self, begun: asyncio.Future[None], stay: bool) -> None:
        """One run, from its first setup to its last teardown."""
        failure: HfgError | None = None
        self._until_stopped = asyncio.Event() if stay else None
        try:
            async with running(self.graph, watch=self._target) as run:
                self._begun(run)
                begun.set_result(None)
                if self._until_stopped is not None:
                    await self._until_stopped.wait()
                else:
                    await run.wait_finished()
        except HfgError as error:
            failure = error
        finally:
            self._ended(failure)
            self._task = None
            if not begun.done():
                begun.set_exception(failure or Refused("state", "the run was stopped as it began"))

    def _begun(self, run: Run) -> None:
        self.run = run
        self._over = asyncio.Event()
        self._offset = run.now() - run.elapsed()
        self._follower.run_begins(run.active(), run.elapsed())
        self._listener = run.trace(self._event, changes_only=True)
        for path, stop in self._stops.items():
            with suppress(HfgError):  # there is no such place any more
                stop.set_in(run, place_at(self.graph, path))
        number = self._record.number if self._own else 1
        self._say(state="paused" if run.paused else "running", number=number)

    def _ended(self, failure: HfgError | None) -> None:
        run, self.run = self.run, None
        outcome = "failed" if failure is not None else "stopped"
        if run is not None:
            self._listener.remove()
            outcome = run.report().outcome
        elapsed = 0.0 if run is None else run.elapsed()
        self._follower.run_ends(elapsed)
        for stop in self._stops.values():
            stop.breakpoint = None
        error = None if failure is None else error_record(failure)
        self._say(state="ended", outcome=outcome, elapsed_s=elapsed, why="", error=error)
        self._over.set()

    def stop(self) -> None:
        """End the run normally; one that is still setting up its nodes is given up."""
        if self.run is None and self._task is not None:
            self._task.cancel()
            return
        run = self._need()
        self._say(state="stopping")
        if self._until_stopped is not None:
            self._until_stopped.set()
        run.stop()

    async def close(self) -> None:
        """End a run of the studio's own, and wait for it."""
        if self._task is not None:
            task = self._task
            task.cancel()
            with suppress(asyncio.CancelledError, HfgError):
                await task
        elif self._listener is not None:
            self._listener.remove()

    # --- while it runs ---

    def _need(self) -> Run:
        if self.run is None and self._task is not None:
            raise Refused("state", "the graph is still setting up its nodes; wait, or stop it")
        if self.run is None:
            raise Refused("state", "the graph does not run; start it first")
        return self.run

    def pause(self) -> None:
        """Start nothing new."""
        self._need().pause()

    def proceed(self) -> None:
        """Go on."""
        self._need().resume()

    def reset(self) -> None:
        """Deactivate all nodes and start over."""
        self._need().reset_activity()

    def seek(self, at_s: float) -> None:
        """Move the cursor of a recording."""
        raise Refused("state", "only a recording has a cursor that can be moved, and this is a graph")

    async def step(self, path: str, *, back: bool = False) -> dict[str, Any]:
        """One step of a node, or of all, after those that were asked for before; return what moved."""
        if back:
            raise Refused("state", "only a recording goes back, and this is a graph")
        async with self._step:
            run = self._need()
            if not run.paused:
                raise Refused(
                    "state", "the run is not paused, and only a run that stands still makes steps; pause it first"
                )
            self._say(state="stepping")
            try:
                step = await run.step(path or None)
            finally:
                self._stepped(run)
        return {"moved": list(step.moved), "why_not": step.why_not}

    def _stepped(self, run: Run) -> None:
        if self.run is run:
            self._say(state="paused" if run.paused else "running")

    async def trigger(self, path: str, value: object, activity: int | None) -> None:
        """Send a signal into a slot, or trigger an event."""
        run = self._need()
        if activity is not None and activity not in (-1, 0, 1):
            raise Refused("usage", f"activity is -1, 0 or 1, got {activity}")
        await run.trigger(path, value, activity=activity)

    # --- edits ---

    async def edit(self, commands: Sequence[Command]) -> None:
        """Edit the graph, whether it runs or not."""
        if not await self._in_run(lambda run: run.edit(*commands)):
            self.graph.edit(*commands)

    async def undo(self) -> None:
        """Take the last edit back."""
        if not await self._in_run(lambda run: run.undo()):
            self.graph.undo()

    async def redo(self) -> None:
        """Carry out again what was undone."""
        if not await self._in_run(lambda run: run.redo()):
            self.graph.redo()

    async def reload(self, module: str) -> None:
        """Reload a module that node types of the graph come from."""
        if not await self._in_run(lambda run: run.reload(module)):
            self.graph.reload(module)

    async def _in_run(self, do: Callable[[Run], Any]) -> bool:
        """Do it in the run, if there is one, and say so; a run that ends meanwhile leaves it to be done at rest."""
        run = self.run
        if run is None:
            return False
        try:
            await do(run)
        except NotRunning:
            if not self._own:
                raise
            await self._over.wait()
            return False
        return True

    # --- breakpoints ---

    def break_at(self, path: str, condition: Condition | None) -> None:
        """Pause whenever the run comes there, now and in the runs to come.

        Raises:
          HfgError: the run cannot pause there; a breakpoint that was there stays.
        """
        place = place_at(self.graph, path)
        if condition is not None and isinstance(place, Node):
            raise Refused("usage", f'"{path}" is a node, and a condition looks at what is sent: set it at a port', path)
        stop = _Stop(condition, self._follower.run_changed)
        if self.run is not None:
            stop.set_in(self.run, place)
        if not isinstance(place, Node):  # at a node there is one for all
            self._forget(path)
        self._stops[path] = stop
        self._follower.run_changed()

    def unbreak(self, path: str) -> None:
        """Pause there no more."""
        self._forget(path)
        self._follower.run_changed()

    def _forget(self, path: str) -> None:
        stop = self._stops.pop(path, None)
        if stop is not None and stop.breakpoint is not None:
            stop.breakpoint.remove()

    def breakpoints(self) -> dict[str, BreakpointRecord]:
        """Return all breakpoints, by path."""
        why = self._record.why if self._record.state == "paused" else ""
        return {path: stop.record(path, holds=why == path) for path, stop in self._stops.items()}

    # --- what is told ---

    def attended(self) -> None:
        """A page is there."""

    def shown(self, nodes: dict[str, NodeRecord]) -> dict[str, NodeRecord]:
        """Return the records of nodes as they are at this time."""
        return nodes

    @property
    def record(self) -> RunRecord:
        """The state of the run for pages."""
        return self._record

    def elapsed(self) -> float:
        """Return seconds since the run began; of a run that is over, how long it took."""
        return self._record.elapsed_s if self.run is None else self.run.elapsed()

    def since_begin(self, time: float) -> float:
        """Return seconds since the run began for a time on the run's clock."""
        return time - self._offset

    def _say(self, **changed: Any) -> None:
        if self.run is not None and "elapsed_s" not in changed:
            changed["elapsed_s"] = self.run.elapsed()
        self._record = msgspec.structs.replace(self._record, at=time.time(), **changed)
        self._follower.run_changed()

    def _event(self, event: TraceEvent) -> None:
        match event:
            case RunPaused(why=why):
                self._say(state="paused", why=why)
            case RunResumed():
                if self._record.state != "stepping":
                    self._say(state="running", why="")
            case RunEnded(outcome=outcome) if not self._own:
                self._say(state="ended", outcome=outcome)
                self.run = None
        self._follower.run_event(event)
