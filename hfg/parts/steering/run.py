"""The run of a graph whose nodes are in several processes; it has the same interface as any run (rule L1).

Requests about a node are executed in its process. Values that are read at once, such as statistics, are current for the
main part and as of the last report for the others: reading them requests new ones, and `refresh` waits for these.
Depends on `asking` and `editing`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, Final, Literal, NoReturn, TypeVar

import msgspec

from hfg.activity.rules import asked_for
from hfg.base.token import Token
from hfg.base.values import own_copy
from hfg.engine.editing.breakpoints import Breakpoint, Step
from hfg.engine.editing.setting import need_settable, without_effect
from hfg.engine.face.composition import Composition
from hfg.engine.face.run import Run
from hfg.engine.observing.consumers import Listener
from hfg.engine.observing.glance import Glance
from hfg.engine.observing.statistics import EdgeStatistics, Statistics
from hfg.engine.observing.taps import Tap, make_tap
from hfg.errors import NotRunning, UsageError
from hfg.graph import Graph
from hfg.graph.editing.commands import Command
from hfg.graph.flat import MAIN, CutEdge
from hfg.graph.structure.edge import Edge, PortEnd
from hfg.nodetypes.node import Node
from hfg.parts.model.messages import Seen
from hfg.parts.steering.asking import Asking, Subscription
from hfg.parts.steering.editing import CutEdits, Drawing
from hfg.parts.steering.reports import Counts
from hfg.parts.steering.witnesses import Witnesses
from hfg.ports import EventPort, ParameterPort, Port
from hfg.trace import Consumer

T = TypeVar("T")

_NO_STATISTICS: Final = EdgeStatistics(
    sent=0, dropped=0, drained=0, untaken=0, grown=0, rate_hz=0.0, deepest=0, capacity=None
)


class CutRun(Run):
    """A graph that runs in several processes."""

    def __init__(self, graph: Graph, composition: Composition, asking: Asking, drawing: Drawing) -> None:
        super().__init__(graph, composition)
        self._cut_edits = CutEdits(graph, composition.edits, asking, drawing, self._answer)
        self._asking = asking
        asking.expect({"counts": Counts, "step": Step})
        self._homes = asking.homes
        self._counts: dict[str, Counts] = {}
        self._asked: dict[str, asyncio.Future[Any]] = {}
        self._wanted: list[str] = []
        self._far_breakpoints: dict[Breakpoint, Subscription] = {}
        self._far_step = False
        self._heard: dict[EventPort[Any], Subscription] = {}
        self._listeners: list[Listener] = []
        self._tracing: Subscription | None = None
        self._afar = Witnesses(asking, self._find)
        composition.pausing.when_hit(self._hit)
        for listener in composition.consumers.listeners:
            self._listen(listener)
        for node in self._homes.far_nodes():
            for event in node.ports.events.values():
                if event._observers:
                    self._adopt(event)

    # --- bringing in ------------------------------------------------------------------------------------------------

    async def _bring(self, port: Port, value: object, activity: int | None, stamp: float | None) -> None:
        home = self._homes.of_node(port.node)
        if home == MAIN:
            await super()._bring(port, value, activity, stamp)
            return
        self._need_running("nothing can be brought into it any more")
        if isinstance(value, Token):
            activity = asked_for(activity, value.activity)
            stamp = value.stamp if stamp is None else stamp
            value = value.value
        parcel = self._asking.crossing.pack(port.path, port.type, Token(value))
        self._engine.quiet.hold()  # tokens in transit can still revive the graph
        try:
            await self._answer(
                home,
                "the run ended before the signal had arrived",
                "trigger",
                path=port.path,
                parcel=parcel,
                activity=activity,
                stamp=stamp,
            )
        finally:
            self._engine.quiet.unhold()

    def _set(self, parameter: ParameterPort[Any], value: object) -> None:
        """Refuse invalid values on this side before anything is set anywhere."""
        reached = need_settable(self._engine, parameter, value)
        homes = {one: self._homes.of_node(one.node) for one in reached}
        far = {one: home for one, home in homes.items() if home != MAIN}
        if not far:
            super()._set(parameter, value)
            return
        value = own_copy(value)
        crossing = self._asking.crossing
        parcels = {one: crossing.pack(one.path, one.type, Token(value)) for one in far}
        for one in far:
            if one.node._type.given_parameters_once and self._engine.core.started:
                raise without_effect(one.node, one.name)
        for one in reached:
            if one not in far and one is not parameter:
                super()._set(one, value)
        for one, home in far.items():
            one.node._parameters[one.name] = own_copy(value)
            self._asking.keep_parameter(home, one.path, parcels[one])

    def wake(self, node: Node | str) -> None:
        """See `Run.wake`."""
        found: Node = self._at(node)
        home = self._homes.of_node(found)
        if home == MAIN:
            super().wake(found)
        else:
            self._asking.tell(home, "wake", node=found.place.path)

    def reset_activity(self) -> None:
        """See `Run.reset_activity`; each part does so when it receives the request."""
        super().reset_activity()
        for part in self._asking.others:
            self._asking.tell(part, "reset_activity")

    # --- waiting ----------------------------------------------------------------------------------------------------

    async def _next_of(self, event: EventPort[Any]) -> Token[Any]:
        home = self._homes.of_node(event.node)
        if home == MAIN:
            return await super()._next_of(event)
        crossing = self._asking.crossing
        crossing.codec(event.path, event.type)
        ended = f'the run ended before "{event.path}" was triggered'
        return crossing.unpack(event.path, event.type, await self._answer(home, ended, "wait_for", path=event.path))

    async def _barrier(self, node: Node, which: Literal["inputs", "outputs"]) -> None:
        home = self._homes.of_node(node)
        if home == MAIN:
            await super()._barrier(node, which)
        else:
            await self._answer(home, "", f"wait_{which}", node=node.place.path)

    async def _answer(self, part: str, ended: str, verb: str, **arguments: Any) -> Any:
        """Ask a part and wait for what it answers, or for the end of the run."""
        if self._engine.core.over and ended:
            raise NotRunning(ended)
        asked = self._asking.ask(part, verb, **arguments)
        try:
            await self._engine.or_end(asked)
            if asked.done():
                return asked.result()
            if ended:
                raise NotRunning(ended)
            return None
        finally:
            asked.cancel()

    # --- holding it still -------------------------------------------------------------------------------------------

    def pause(self) -> None:
        """See `Run.pause`; each part does so when it receives the request, and `wait_paused` waits for all."""
        super().pause()
        self._pause_others()

    def _pause_others(self, but: str = "") -> None:
        for part in self._asking.others:
            if part != but:
                self._asking.keep(part, "pause", "pause")

    def resume(self) -> None:
        """See `Run.resume`."""
        if self._far_step:
            raise UsageError("a step is in progress: await it before run.resume()")
        was_paused = self.paused
        super().resume()
        for part in self._asking.others if was_paused else ():
            self._asking.forget(part, "pause")
            self._asking.tell(part, "resume")

    async def wait_paused(self) -> str:
        """See `Run.wait_paused`: of all parts."""
        why = await super().wait_paused()
        ended = "cannot pause: the run has ended"
        for part in self._asking.others:
            await self._answer(part, ended, "wait_paused")
        return why

    async def step(self, node: Node | str | None = None) -> Step:
        """See `Run.step`. A node steps where it lives; of a wave, each part makes its own."""
        found: Node | None = None if node is None else self._at(node)
        what = "a wave" if found is None else found.place.path
        if self._far_step:
            raise UsageError(f"{what} cannot step while another step is in progress: await that first")
        home = MAIN if found is None else self._homes.of_node(found)
        if found is not None and home == MAIN:
            return await super().step(found)
        self._pausing.need_still(what)
        self._far_step = True
        try:
            if found is not None:
                return await self._step_there(home, found.place.path)
            waves = [await super().step()]
            waves += [await self._step_there(part, None) for part in self._asking.others]
        finally:
            self._far_step = False
        moved = tuple(path for wave in waves for path in wave.moved)
        return Step(moved, "" if moved else "no node can move")

    async def _step_there(self, part: str, path: str | None) -> Step:
        step: Step = await self._answer(part, "the run ended before the step was made", "step", node=path)
        return step

    @property
    def breakpoints(self) -> list[Breakpoint]:
        """See `Run.breakpoints`."""
        return super().breakpoints + list(self._far_breakpoints)

    def break_at(
        self, place: Node | PortEnd | Edge | str, *, when: Callable[[Token[Any]], object] | None = None
    ) -> Breakpoint:
        """See `Run.break_at`. `when` is code, so it can look at tokens that are sent in the main part only."""
        self._need_running("nothing will come there any more")
        path, what, parts = self._find(place)
        if parts == {MAIN}:
            return super().break_at(place, when=when)
        if isinstance(what, Node) and not self._homes.has(what):
            return super().break_at(place, when=when)  # which refuses a subgraph
        if when is not None:
            raise UsageError(
                f'when= of a breakpoint at "{path}" cannot go to the process of group "{min(parts - {MAIN})}": leave '
                "it out, or break at a place in the main part"
            )
        if MAIN in parts:
            raise UsageError(
                f'"{path}" represents places in several processes: set a breakpoint at the ports of the inner nodes'
            )
        point = Breakpoint(what, path, self._remove)

        def seen(part: str, told: Seen) -> None:
            point.was_hit(self._asking.crossing.see(path, told.tokens[-1]) if told.tokens else None)
            self._pausing.pause(point.path)
            self._pause_others(but=part)

        self._far_breakpoints[point] = self._asking.subscribe(parts, "break_at", seen, place=path)
        return point

    def _remove(self, point: Breakpoint) -> None:
        subscription = self._far_breakpoints.pop(point, None)
        if subscription is not None:
            self._asking.end(subscription)

    def _hit(self, _: Breakpoint) -> None:
        self._pause_others()

    # --- looking ----------------------------------------------------------------------------------------------------

    def tap(self, what: PortEnd | Edge | str, *, size: int | None = None, max_rate_hz: float | None = None) -> Tap:
        """See `Run.tap`. Tokens of other parts come in batches; of a value that cannot be encoded there is the text."""
        self._need_running("nothing will pass there any more")
        path, found, parts = self._find(what)
        if parts == {MAIN} or isinstance(found, Node):
            return super().tap(what, size=size, max_rate_hz=max_rate_hz)
        crossing = self._asking.crossing
        looking: list[Callable[[], object]] = []
        tap, buffer = make_tap(size, max_rate_hz, self._engine.elapsed, lambda: [end() for end in looking])

        def seen(part: str, told: Seen) -> None:
            before = counted.get(part, 0)
            counted[part] = max(told.count, before)  # a restarted part starts its count over
            buffer.miss(max(told.count - before - len(told.tokens), 0))
            for parcel in told.tokens:
                buffer.put(crossing.see(path, parcel))
            self._asking.tell(part, "more", number=subscription.number)

        counted: dict[str, int] = {}
        subscription = self._asking.subscribe(parts - {MAIN}, "tap", seen, buffer.end, place=path, size=buffer.size)
        looking.append(lambda: self._asking.end(subscription))
        if MAIN in parts:
            looking.append(self._parts.taps.look(found, buffer))
        return tap

    def trace(self, consumer: Consumer, *, size: int | None = None, changes_only: bool = False) -> Listener:
        """See `Run.trace`. Those of each part come in its order, those of other parts in batches, and of all kinds."""
        listener = super().trace(consumer, size=size, changes_only=changes_only)
        self._listen(listener)
        return listener

    def _listen(self, listener: Listener) -> None:
        self._listeners.append(listener)
        if self._tracing is None:
            self._tracing = self._asking.subscribe(self._asking.others, "trace", self._traced)

    def _traced(self, _: str, told: Seen) -> None:
        for sight in told.events:
            event = self._asking.crossing.see_event(sight)
            for listener in self._listeners:
                if listener.is_open:
                    listener.take(event)
        self._listeners = [listener for listener in self._listeners if listener.is_open]
        if not self._listeners and self._tracing is not None:
            self._asking.end(self._tracing)
            self._tracing = None

    def _adopt(self, event: EventPort[Any]) -> None:
        """Somebody has subscribed to an event: signals of another part are brought here, all of them."""
        home = self._homes.of_node(event.node)
        if home == MAIN:
            super()._adopt(event)
            return
        if event in self._heard or self._engine.core.over:
            return

        def seen(_: str, told: Seen) -> None:
            for parcel in told.tokens:
                event._notify(self._asking.crossing.see(event.path, parcel))

        self._heard[event] = self._asking.subscribe([home], "tap", seen, event._complete, place=event.path, size=0)

    # --- counts -----------------------------------------------------------------------------------------------------

    async def refresh(self) -> None:
        """Ask all other parts for their counts, and wait: what is read next without waiting is of now."""
        self._want("glance", "statistics")
        if self._engine.core.over:
            return
        _ = self._parts.measuring
        for part in self._asking.others:
            told = await self._answer(part, "", "counts", what=self._wanted)
            if told is not None:
                self._take_counts(part, told)

    def active(self) -> list[str]:
        """See `Run.active`; for other parts as of their last report (see `refresh`)."""
        self._ask_counts("glance")
        found = set(super().active())
        for counts in self._counts.values():
            found |= {node.path for node in (counts.glance.nodes if counts.glance else ()) if node.active}
        return [path for path in self._homes.order if path in found]

    def glance(self) -> Glance:
        """See `Run.glance`; for other parts as of their last report (see `refresh`)."""
        self._ask_counts("glance")
        mine = super().glance()
        nodes, growing = {node.path: node for node in mine.nodes}, dict(mine.growing)
        lost, now = mine.lost, self.now()
        for counts in self._counts.values():
            if (told := counts.glance) is not None:
                age_s = max(now - counts.at, 0.0)
                nodes |= {node.path: msgspec.structs.replace(node, age_s=age_s) for node in told.nodes}
                growing |= told.growing
                lost += told.lost
        in_order = list(self._in_order(nodes).values())
        return msgspec.structs.replace(mine, nodes=in_order, lost=lost, growing=growing)

    def statistics(self) -> Statistics:
        """See `Run.statistics`; for other parts as of their last report (see `refresh`), with its age."""
        self._ask_counts("statistics")
        mine = super().statistics()
        said = {part: counts.statistics for part, counts in self._counts.items() if counts.statistics is not None}
        all_of_them = [mine, *said.values()]
        nodes = {path: node for one in all_of_them for path, node in one.nodes.items()}
        edges = {label: edge for one in all_of_them for label, edge in one.edges.items()}
        halves = {MAIN: mine.edges, **{part: one.edges for part, one in said.items()}}
        for edge in self._asking.cutting.edges:
            edges[edge.label] = _joined(edge, halves)
        now = self.now()
        return msgspec.structs.replace(
            mine,
            firings=sum(node.firings for node in nodes.values()),
            nodes=self._in_order(nodes),
            edges=edges,
            groups=mine.groups | {part: one.groups[part] for part, one in said.items() if part in one.groups},
            lost_activity=sum(one.lost_activity for one in all_of_them),
            errors=[error for one in all_of_them for error in one.errors],
            ages_s={part: max(now - self._counts[part].at, 0.0) for part in said},
        )

    def counts(self) -> Mapping[str, Counts]:
        """Return the last reports of the other parts, and request new ones; for reports of a run in progress."""
        self._ask_counts()
        return self._counts

    def _want(self, *what: str) -> None:
        self._wanted += [one for one in what if one not in self._wanted]

    def _ask_counts(self, *what: str) -> None:
        """Request new reports; a part that has not answered yet is not asked again."""
        self._want(*what)
        if self._engine.core.over:
            return
        for part in self._asking.others:
            if part not in self._asked:
                asked = self._asked[part] = self._asking.ask(part, "counts", what=list(self._wanted))
                asked.add_done_callback(lambda done, part=part: self._told_counts(part, done))  # type: ignore[misc]

    def _told_counts(self, part: str, asked: asyncio.Future[Any]) -> None:
        self._asked.pop(part, None)
        if not asked.cancelled() and asked.exception() is None:
            self._take_counts(part, asked.result())

    def _take_counts(self, part: str, told: Counts) -> None:
        """Accept a report, except items that belong to other parts."""
        homes, glance, statistics = self._homes, told.glance, told.statistics
        labels = {edge.label for flat in self._asking.cutting.parts[part].walk() for edge in flat.edges}

        def own(found: dict[str, T], *, of_edges: bool = False) -> dict[str, T]:
            return {
                place: one
                for place, one in found.items()
                if (place in labels if of_edges else homes.of_path(place) == part)
            }

        if glance is not None:
            mine = [node for node in glance.nodes if homes.of_path(node.path) == part]
            glance = msgspec.structs.replace(glance, nodes=mine)
        if statistics is not None:
            nodes, edges = own(statistics.nodes), own(statistics.edges, of_edges=True)
            statistics = msgspec.structs.replace(statistics, nodes=nodes, edges=edges)
        self._counts[part] = msgspec.structs.replace(
            told,
            nodes=own(told.nodes),
            edges=own(told.edges, of_edges=True),
            glance=glance,
            statistics=statistics,
            at=self.now(),
        )

    def _in_order(self, nodes: dict[str, T]) -> dict[str, T]:
        return {path: nodes[path] for path in self._homes.order if path in nodes} | nodes

    # --- editing, and what only a graph in one process allows -------------------------------------------------------

    async def edit(self, *commands: Command) -> None:
        """See `Run.edit`. An edit is made in one process: it concerns nodes of one, and edges between them.

        An edit in another process cannot be cancelled; a cancelled caller waits for its result.

        Raises:
          UsageError: including: it concerns nodes of several processes, or an edge from one to another.
        """
        self._need_running("edit the graph with graph.edit(...)")
        await self._cut_edits.edit(commands)

    async def undo(self) -> None:
        """See `Run.undo`: an edit of this run that all its processes have seen."""
        self._need_running("edit the graph with graph.edit(...)")
        await self._cut_edits.undo()

    async def redo(self) -> None:
        """See `Run.redo`."""
        self._need_running("edit the graph with graph.edit(...)")
        await self._cut_edits.redo()

    async def reload(self, module: str | ModuleType) -> None:
        """Refuse to reload: code is changed in all processes at once, or in none."""
        self._refuse("given new code")

    def _need_here(self, chosen: Callable[[str], bool]) -> None:
        """Refuse to record ports of other processes: what is recorded without loss holds its node back."""
        ports = [
            port.path
            for node in self._homes.far_nodes()
            for port in (*node.ports.outputs.values(), *node.ports.events.values())
            if chosen(port.path)
        ]
        if not ports:
            return
        names = ", ".join(f'"{name}"' for name in self._asking.others)
        more = f" and {len(ports) - 3} more ports" if len(ports) > 3 else ""
        shown = ", ".join(f'"{path}"' for path in ports[:3])
        raise UsageError(
            f'graph "{self.graph.name}" runs in several processes (group {names}), and a recording holds what passes '
            f"in this one, without {shown}{more}: select ports of this process, with select= or --select, or take "
            "process=True from the groups"
        )

    def _refuse(self, what: str) -> NoReturn:
        self._need_running("nothing can be changed any more")
        names = ", ".join(f'"{name}"' for name in self._asking.others)
        raise UsageError(
            f'graph "{self.graph.name}" cannot be {what} while it runs in several processes (group {names}): end the '
            "run and change the graph before the next one"
        )

    # --- where things are -------------------------------------------------------------------------------------------

    def _find(self, what: Any) -> tuple[str, Any, set[str]]:
        """Return the path or label of a place for other parts, the place, and the parts that have it."""
        homes = self._homes
        if isinstance(what, Edge):
            label = homes.label_of(what)
            return label, what, homes.of_place(what) if label else {MAIN}
        if isinstance(what, str) and " -> " in what:
            return what, what, homes.of_place(what)
        place = self._at(what)
        if isinstance(place, Node):
            path = place.place.path if place._place is not None else ""
        else:
            path = getattr(getattr(place, "outer", place), "path", "")
        return path, place, homes.of_place(place)


def _joined(edge: CutEdge, halves: Mapping[str, Mapping[str, EdgeStatistics]]) -> EdgeStatistics:
    """Return the counts of an edge, of which each side has one half."""
    source = halves.get(edge.source, {}).get(edge.label, _NO_STATISTICS)
    target = halves.get(edge.target, {}).get(edge.label, _NO_STATISTICS)
    return msgspec.structs.replace(
        source,
        dropped=source.dropped + target.dropped,
        drained=source.drained + target.drained,
        lost=source.lost + target.lost,
        untaken=source.untaken if edge.guarantee == "exact" else target.untaken,
    )
