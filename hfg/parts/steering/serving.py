"""Requests from outside to this part of a run, on its own side: the verbs of `Call` (rules P8, P10, R3, R7).

A part has a `Run` like any other, so this module only converts arguments and answers. Depends on `crossing`.
"""

from __future__ import annotations

import asyncio
import inspect
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager, nullcontext
from functools import partial
from typing import Any, Final

from hfg.base.token import Token
from hfg.engine.editing.breakpoints import Breakpoint
from hfg.engine.editing.edits import Edits
from hfg.engine.face.composition import Composition
from hfg.engine.face.run import Run
from hfg.engine.model.running_node import RunningNode
from hfg.engine.observing.report import edge_reports, node_reports
from hfg.errors import EngineInternalError, HfgError, UsageError
from hfg.graph import Graph
from hfg.graph.editing.commands import read
from hfg.graph.flat import FlatGraph, flatten
from hfg.monitors.gathering import EVERY_S, Known
from hfg.monitors.violations import Point
from hfg.monitors.watching import Witnessing
from hfg.parts.model.failing import as_failed
from hfg.parts.model.messages import Call, Failed, Message, Parcel, Result, Seen, Sight
from hfg.parts.steering.crossing import Crossing
from hfg.parts.steering.editing import draw, draw_redo, draw_undo, try_to_draw
from hfg.trace import RunEnded, RunPaused, RunResumed, RunStarted, TraceEvent

_MOST: Final = 500  # events in one message
_OF_THE_WHOLE: Final = (RunStarted, RunEnded, RunPaused, RunResumed)  # events that the main part reports for all parts


class Serving:
    """Does what is asked of one part.

    Attributes:
      run: what it does that with.
    """

    def __init__(
        self,
        graph: Graph,
        flat: FlatGraph,
        composition: Composition,
        say: Callable[[Message], None],
        emptied: Callable[[], AbstractAsyncContextManager[None]],
    ) -> None:
        """Serve a part that is not set up yet.

        Args:
          graph: the whole graph, as it is here.
          flat: the same, flattened.
          composition: of the part.
          say: sends answers.
          emptied: context for changes of the part's nodes.
        """
        self._graph = graph
        self._emptied = emptied
        self.run = Run(graph, composition)
        self.run._is_part = True
        self._crossing = Crossing(flat)
        self._composition = composition
        self._say = say
        self._tasks: set[asyncio.Future[None]] = set()
        self._watching: dict[int, _Watching] = {}
        composition.pausing.when_hit(self._hit)
        self._hits: dict[Breakpoint, int] = {}
        self._verbs = self._make_verbs(graph, composition.edits)

    def _make_verbs(self, graph: Graph, edits: Edits) -> dict[str, Callable[..., Any]]:
        return {
            "trigger": self._trigger,
            "set": self._set,
            "wait_for": self._wait_for,
            "wake": self.run.wake,
            "wait_inputs": self.run.wait_inputs,
            "wait_outputs": self.run.wait_outputs,
            "reset_activity": self.run.reset_activity,
            "counts": self._counts,
            "pause": self.run.pause,
            "resume": self.run.resume,
            "wait_paused": self.run.wait_paused,
            "step": self.run.step,
            "break_at": self._break_at,
            "trace": self._trace,
            "tap": self._tap,
            "more": self._more,
            "witness": self._witness,
            "known": self._known,
            "leave": self._leave,
            "edit": lambda commands, empties: self._edit(partial(edits.edit_now, read(commands)), empties),
            "undo": lambda empties: self._edit(edits.undo_now, empties),
            "redo": lambda empties: self._edit(edits.redo_now, empties),
            "try_edit": lambda commands: try_to_draw(graph, read(commands)),
            "draw_edit": lambda commands: self._draw(partial(draw, graph, read(commands))),
            "draw_undo": lambda: self._draw(partial(draw_undo, graph)),
            "draw_redo": lambda: self._draw(partial(draw_redo, graph)),
        }

    # --- calls ------------------------------------------------------------------------------------------------------

    def obey(self, call: Call) -> None:
        """Do what is asked, and answer when it is done."""
        try:
            if call.verb not in self._verbs:
                raise EngineInternalError(f'"{call.verb}" was sent to a part, which does not know it')
            answer = self._verbs[call.verb](**call.arguments)
        except Exception as error:
            self._answer(call, failed=_failed(error))
            return
        if not inspect.isawaitable(answer):
            self._answer(call, answer)
            return
        task = asyncio.ensure_future(self._wait(call, answer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _wait(self, call: Call, answer: Awaitable[Any]) -> None:
        try:
            self._answer(call, await answer)
        except Exception as error:
            self._answer(call, failed=_failed(error))

    def _answer(self, call: Call, value: Any = None, failed: Failed | None = None) -> None:
        if call.number or failed is not None:
            self._say(Result(call.number, value, failed))

    def flush(self) -> None:
        """Say what was seen until now."""
        for watching in self._watching.values():
            watching.flush()

    def close(self) -> None:
        """The part is torn down: send no more answers."""
        self.flush()
        for task in self._tasks:
            task.cancel()

    # --- bringing in ------------------------------------------------------------------------------------------------

    async def _trigger(self, path: str, parcel: Any, activity: int | None, stamp: float | None) -> None:
        port: Any = self.run.graph[path]
        token = self._crossing.unpack(path, port.type, parcel)
        await self.run.trigger(port, token.value, activity=activity, stamp=stamp)

    def _set(self, path: str, parcel: Any) -> None:
        port: Any = self.run.graph[path]
        self.run.set(port, self._crossing.unpack(path, port.type, parcel).value)

    # --- editing ----------------------------------------------------------------------------------------------------

    async def _edit(self, now: Callable[[], Awaitable[list[RunningNode]]], empties: bool) -> None:
        """Make the edit, and answer as soon as it is in effect; removed nodes are torn down afterwards."""
        edits = self._composition.edits
        async with edits.lock.one(), self._emptied() if empties else nullcontext():
            gone = await now()
            self._crossing.draw(flatten(self._graph))
        leaving = asyncio.ensure_future(edits.leave(gone))
        self._tasks.add(leaving)
        leaving.add_done_callback(self._tasks.discard)

    def _draw(self, drawn: Callable[[], None]) -> None:
        """Draw an edit of another part."""
        drawn()
        self._crossing.draw(flatten(self._graph))

    # --- waiting ----------------------------------------------------------------------------------------------------

    async def _wait_for(self, path: str) -> Parcel:
        port: Any = self.run.graph[path]
        return self._crossing.pack(path, port.type, await self.run.wait_for(port))

    # --- looking ----------------------------------------------------------------------------------------------------

    def _counts(self, what: list[str]) -> dict[str, Any]:
        engine = self._composition.engine
        core = engine.core
        found: dict[str, Any] = {"nodes": node_reports(core), "edges": edge_reports(core)}
        found["clock_within_s"] = engine.time.within_s()
        found |= {"errors": [str(error) for error in core.errors], "lost_activity": core.lost_activity}
        if "glance" in what:
            found["glance"] = self.run.glance()
        if "statistics" in what:
            found["statistics"] = self.run.statistics()
        return found

    def _trace(self, number: int) -> None:
        watching = self._watching[number] = _Tracing(number, self._crossing, self._say)
        watching.begun(self._composition.consumers.add(watching.take))

    def _tap(self, number: int, place: str, size: int) -> None:
        watching = self._watching[number] = _Tapping(number, self._crossing, self._say, place, size)
        try:
            watching.begun(self._composition.taps.look(place, watching))
        except HfgError:
            del self._watching[number]
            raise

    def _more(self, number: int) -> None:
        watching = self._watching.get(number)
        if isinstance(watching, _Tapping):
            watching.go_on()

    def _witness(self, number: int, atoms: dict[int, str]) -> None:
        points = _Points(number, self._crossing, self._say, self._composition.engine.virtual)
        points.witnessing = Witnessing(self.run, atoms, points.take)
        points.begun(points.witnessing.leave)
        self._watching[number] = points

    def _known(self, number: int) -> Known:
        points = self._watching.get(number)
        if not isinstance(points, _Points):
            raise UsageError("the process could not hear what the monitor names; its log says why")
        points.flush()
        return points.witnessing.known()

    def _break_at(self, number: int, place: str) -> None:
        point = self.run.break_at(place)
        watching = self._watching[number] = _Watching()
        watching.begun(partial(self._remove, point))
        self._hits[point] = number

    def _remove(self, point: Breakpoint) -> None:
        self._hits.pop(point, None)
        point.remove()

    def _hit(self, point: Breakpoint) -> None:
        tokens = [] if point.token is None else [self._crossing.show(point.path, point.token)]
        self._say(Seen(self._hits[point], tokens=tokens, count=point.hits))

    def _leave(self, number: int) -> None:
        watching = self._watching.pop(number, None)
        if watching is not None:
            watching.leave()


def _failed(error: Exception) -> Failed:
    found = as_failed(error)
    assert found is not None
    return found


class _Watching:
    """An observation from outside."""

    def __init__(self) -> None:
        self._end: Callable[[], object] = lambda: None

    def begun(self, end: Callable[[], object]) -> None:
        """It continues until `end` is called."""
        self._end = end

    def leave(self) -> None:
        """End it."""
        self._end()

    def flush(self) -> None:
        """Say what has come by."""


class _Batches(_Watching):
    """Observations of one iteration of the loop are sent together."""

    def __init__(self, number: int, crossing: Crossing, say: Callable[[Message], None]) -> None:
        super().__init__()
        self.number = number
        self.crossing = crossing
        self.say = say
        self._loop = asyncio.get_running_loop()
        self._is_due = False

    def due(self, within_s: float = 0.0) -> None:
        """Something has come by; it may wait so long for more."""
        if not self._is_due:
            self._is_due = True
            if within_s:
                self._loop.call_later(within_s, self._now)
            else:
                self._loop.call_soon(self._now)

    def _now(self) -> None:
        self._is_due = False
        self.flush()


class _Tracing(_Batches):
    """The trace, without loss."""

    def __init__(self, number: int, crossing: Crossing, say: Callable[[Message], None]) -> None:
        super().__init__(number, crossing, say)
        self._events: list[Sight] = []

    def take(self, event: TraceEvent) -> None:
        """An event happens."""
        if isinstance(event, _OF_THE_WHOLE):
            return
        self._events.append(self.crossing.show_event(event))
        if len(self._events) >= _MOST:
            self.flush()
        self.due()

    def flush(self) -> None:
        """See `_Watching`."""
        if self._events:
            events, self._events = self._events, []
            self.say(Seen(self.number, events=events))


class _Tapping(_Batches):
    """A tap: the newest tokens, as fast as they are taken over there; all of them, where the size is 0."""

    def __init__(self, number: int, crossing: Crossing, say: Callable[[Message], None], place: str, size: int) -> None:
        super().__init__(number, crossing, say)
        self._place = place
        self._kept: deque[Token[Any]] = deque(maxlen=size or None)
        self._is_lossless = not size
        self._seen = 0
        self._may_say = True

    def put(self, token: Token[Any]) -> None:
        """A token passes."""
        self._seen += 1
        self._kept.append(token)
        self.due()

    def end(self) -> None:
        """Stop; the end of the run is reported separately."""
        self._may_say = True

    def go_on(self) -> None:
        """The receiver has processed the last batch."""
        self._may_say = True
        self.flush()

    def flush(self) -> None:
        """See `_Watching`."""
        if self._kept and self._may_say:
            self._may_say = self._is_lossless
            tokens = [self.crossing.show(self._place, token) for token in self._kept]
            self._kept.clear()
            self.say(Seen(self.number, tokens=tokens, count=self._seen))


class _Points(_Batches):
    """Points for a monitor of the main part, without loss."""

    witnessing: Witnessing

    def __init__(self, number: int, crossing: Crossing, say: Callable[[Message], None], virtual: bool) -> None:
        super().__init__(number, crossing, say)
        self._points: list[Point] = []
        self._every_s = 0.0 if virtual else EVERY_S

    def take(self, point: Point) -> None:
        """A point is there."""
        self._points.append(point)
        if len(self._points) >= _MOST:
            self.flush()
        self.due(self._every_s)

    def flush(self) -> None:
        """See `_Watching`."""
        if self._points:
            points, self._points = self._points, []
            self.say(Seen(self.number, points=points))
