"""A part of a run that another process started: it makes its graph from the received text, and follows instructions.

Depends on `channels` and the files of graphs, not on processes.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec

from hfg.base.logs import Log
from hfg.engine.face.composition import Composition
from hfg.engine.observing.report import edge_reports, node_reports
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.settings import Settings
from hfg.errors import EngineInternalError, HfgError
from hfg.graph import Graph
from hfg.graph.flat import MAIN, CutEdge, cut, flatten
from hfg.graph.structure.level import level_of
from hfg.parts.model import messages
from hfg.parts.model.agreement import Rest
from hfg.parts.model.clocks import Offset, RunClock, machine
from hfg.parts.model.components import components
from hfg.parts.model.failing import as_failed
from hfg.parts.model.inheriting import inherited, inheriting, keeping, remembered
from hfg.parts.model.messages import Message, OfAnEdge, Untrue
from hfg.parts.model.trace_filter import trace_filter
from hfg.parts.running.channels import Channel, called
from hfg.parts.running.checkpointing import Checkpointer, read
from hfg.parts.running.part import Part
from hfg.parts.running.part_links import PartLinks
from hfg.parts.running.rings import sweep_run
from hfg.parts.steering.serving import Serving
from hfg.transport import Session

_LOGGER = Log("hfg.parts")
FIRST_INCARNATION = 1
_MOST_RECORDS = 1000  # waiting to be sent
_ROUNDS = 8  # times that the time is asked for before the nodes are set up
_ASKS_EVERY_S = 5.0
_PARTING_S = 2.0  # how long the last words may take


class Worker:
    """Serves one part of a run.

    Args:
      session: session of the transport.
      run: the name by which all parts know the run.
      name: name of the part.
      incarnations: its incarnation, and that of the main part.
      build: makes the graph from the received text.
      near: the session that reaches parts on the same host; None if `session` does.
      is_apart: it shares no memory with parts on the same host, whatever the main part says.
    """

    def __init__(
        self,
        session: Session,
        run: str,
        name: str,
        incarnations: tuple[int, int],
        build: Callable[[messages.Open], Graph],
        *,
        near: Session | None = None,
        is_apart: bool = False,
    ) -> None:
        self._is_apart = is_apart
        self._session = session
        self._near = near or session
        self._run = run
        self._name = name
        self._incarnation = incarnations[0]
        self._build = build
        self._inbox: asyncio.Queue[Message] = asyncio.Queue()
        self._channels = {MAIN: Channel(session, run, name, MAIN, incarnations, self._inbox.put_nowait)}
        self._incarnations: dict[str, int] = {}  # of neighbours
        self._has_begun = False
        self._asked = 0  # number of requests for the time without an answer
        self._part: Part | None = None
        self._carrier: PartLinks | None = None
        self._shares_memory = False
        self._serving: Serving | None = None
        self._is_closed = False
        self._offset: Offset | None = None  # of the machine of the main part, if that is another
        self._postponed: deque[Message] = deque()

    async def serve(self) -> None:
        """Follow the main part's instructions until it ends the run."""
        try:
            while True:
                message = self._postponed.popleft() if self._postponed else await self._inbox.get()
                if isinstance(message, messages.Close):
                    await self._close()
                    return
                try:
                    await self._do(message)
                except Untrue as problem:
                    self._channels[MAIN].refuse(f'it has sent "{type(message).__name__}", {problem}')
        finally:
            if self._part is not None and not self._is_closed:  # no other process is left that would report it
                self._part.finish("cancelled", None)
                if self._serving is not None:
                    self._serving.close()
                await self._part.composition.run_lifecycle.close()
            await self._leave()

    async def _do(self, message: Message) -> None:
        """Follow an instruction of the main part.

        Raises:
          Untrue: it makes no sense.
        """
        part = self._part
        if isinstance(message, messages.Open):
            if part is not None:
                raise Untrue("for the second time")
            await self._open(message)
        elif isinstance(message, messages.TellTime):
            self._told_time(message)
        elif part is None:
            raise Untrue("before there is a part")
        elif isinstance(message, messages.Reborn):
            await self._admit(part, message)
        elif isinstance(message, OfAnEdge):
            self._hear(part, MAIN, message)
        else:
            self._obey(part, message)

    def log(self, logged: messages.Logged) -> None:
        """Bring a log record to the main part; when that is slow, some are left out."""
        channel = self._channels[MAIN]
        if channel.waiting < _MOST_RECORDS:
            channel.send(logged)

    def _say(self, part: str, message: Message) -> None:
        self._channels[part].send(message)

    # --- the beginning ----------------------------------------------------------------------------------------------

    async def _open(self, message: messages.Open) -> None:
        try:
            self._part = part = self._make(message)
            await self._follow(part.engine, message.clock)
            assert self._serving is not None
            for call in message.calls:
                self._serving.obey(call)
            went_well = await part.composition.run_lifecycle.set_up()
        except HfgError as error:
            self._say(MAIN, messages.Opened(self._name, as_failed(error)))
            return
        except Exception as error:
            problem = EngineInternalError(f"{type(error).__name__}: {error}; please report this")
            problem.__cause__ = error
            self._say(MAIN, messages.Opened(self._name, as_failed(problem)))
            return
        self._say(MAIN, messages.Opened(self._name, None if went_well else as_failed(part.engine.error)))

    def _make(self, message: messages.Open) -> Part:
        graph = self._build(message)
        flat = flatten(graph)
        cutting = cut(flat)
        if self._name not in cutting.parts:
            raise EngineInternalError(f'graph "{graph.name}" has no part "{self._name}" here')
        edges = list(cutting.edges_of(self._name))
        flat_part = cutting.parts[self._name]
        has_ledger = self._name in keeping(cutting)
        # there is no place between the nodes of a fused region
        options = message.options | ({"fast": False} if has_ledger else {})
        composition = Composition(flat_part, Settings(**options))
        was_asked_for = bool(flat_part.groups[self._name].ledger)
        keeper = self._keeper(composition, message.kept, was_asked_for) if has_ledger else None
        part = Part(
            self._name,
            composition,
            edges,
            rests=self._rests,
            components=components(cutting)[self._name],
            inherits=self._name in inheriting(cutting),
            inherited=inherited(cutting),
            remembered=remembered(cutting),
            returns=self._incarnation > message.incarnations[MAIN],
            keeper=keeper,
        )
        self._serving = Serving(graph, flat, composition, partial(self._say, MAIN), part.emptied)
        level_of(graph).whole.begin_run(self._serving.run)
        composition.consumers.leave_out(trace_filter(self._name, edges))
        part.engine.callbacks.finished.append(partial(self._ended, part))
        self._connect(part, edges, remembered(cutting), message)
        return part

    def _connect(self, part: Part, edges: list[CutEdge], remembered: frozenset[str], message: messages.Open) -> None:
        """Connect the part with its neighbours."""
        incarnations = message.incarnations
        neighbours = {edge.source for edge in edges} | {edge.target for edge in edges}
        for other in neighbours - {self._name, MAIN}:
            self._channels[other] = self._channel_to(part, other, incarnations[other])
        self._carrier = PartLinks(
            part,
            self._session,
            self._near,
            self._run,
            incarnations,
            edges,
            self._say,
            remembered,
            shares_memory=message.shares_memory and not self._is_apart,
        )
        self._shares_memory = message.shares_memory and not self._is_apart

    def _keeper(self, composition: Composition, kept: bytes | None, keeps_states: bool) -> Checkpointer:
        def keep(number: int, data: bytes) -> None:
            self._say(MAIN, messages.Keep(number, data))

        snapshot = None if kept is None else read(kept, self._name)
        keeper = Checkpointer(self._name, composition.engine, keep, snapshot, keeps_states=keeps_states)
        keeper.check()
        return keeper

    def _channel_to(self, part: Part, other: str, incarnation: int) -> Channel:
        self._incarnations[other] = incarnation
        hear = partial(self._hear, part, other)
        return Channel(self._session, self._run, self._name, other, (self._incarnation, incarnation), hear)

    async def _admit(self, part: Part, message: messages.Reborn) -> None:
        """A neighbour has died and is restarted; messages to the one that died are lost."""
        if message.part not in self._incarnations or self._carrier is None:
            return  # not a neighbour
        if message.incarnation <= max(self._incarnations[message.part], FIRST_INCARNATION):
            raise Untrue(f"of incarnation {message.incarnation} of {called(message.part)}, which has had later ones")
        old = self._channels[message.part]
        await old.close()
        self._channels[message.part] = self._channel_to(part, message.part, message.incarnation)
        self._carrier.admit(message.part, message.incarnation)

    # --- time -------------------------------------------------------------------------------------------------------

    async def _follow(self, engine: Engine, clock: RunClock) -> None:
        """Go by the clock of the run, as far as that is known here."""
        if clock.machine == machine():
            engine.time.follow(clock.ahead_s, clock.began_s, float)
            return
        self._offset = offset = Offset()
        while offset.heard < _ROUNDS:
            self._ask_time()
            while not isinstance(message := await self._inbox.get(), messages.TellTime):
                self._postponed.append(message)
            offset.hear(message.asked, message.told, time.monotonic())
            self._asked = max(self._asked - 1, 0)
        used_s = offset.offset_s
        engine.time.follow(clock.ahead_s + used_s, clock.began_s, lambda: offset.error_of(used_s, time.monotonic()))
        self._ask_time_later()

    def _ask_time_later(self) -> None:
        """The longer ago it was asked, the less is known: clocks drift."""
        asyncio.get_running_loop().call_later(_ASKS_EVERY_S, self._ask_time)

    def _ask_time(self) -> None:
        if not self._is_closed:
            self._asked += 1
            self._say(MAIN, messages.AskTime(time.monotonic()))

    def _told_time(self, message: messages.TellTime) -> None:
        if self._offset is None or not self._asked:
            raise Untrue("without having been asked")
        self._asked -= 1
        self._offset.hear(message.asked, message.told, time.monotonic())
        self._ask_time_later()

    # --- what is said -----------------------------------------------------------------------------------------------

    def _hear(self, part: Part, other: str, message: Message) -> None:
        """Process a message of another part; only the main part gives instructions."""
        if not isinstance(message, OfAnEdge):
            raise Untrue("which only the main part may send")
        assert self._carrier is not None
        self._carrier.hear(other, message)

    def _obey(self, part: Part, message: Message) -> None:
        match message:
            case messages.Begin():
                if self._has_begun:
                    raise Untrue("for the second time")
                self._has_begun = True
                part.begin()
            case messages.Kept():
                part.be_kept(message.number)
            case messages.Ask():
                try:
                    message.question.check()
                except msgspec.ValidationError as error:
                    raise Untrue(f"which is not such a question: {error}") from error
                self._say(MAIN, messages.Told(part.answer(message.question)))
            case messages.Finish():
                part.finish(message.outcome, None)
            case messages.Call():
                assert self._serving is not None
                self._serving.obey(message)
            case _:
                raise Untrue("which is not for a part")

    def _rests(self, rest: Rest) -> None:
        assert self._serving is not None
        self._serving.flush()  # what a monitor finds in it may make the graph move again
        self._say(MAIN, messages.Rests(rest))

    def _ended(self, part: Part) -> None:
        assert self._serving is not None
        self._serving.flush()
        self._say(MAIN, messages.Ended(self._name, part.engine.outcome, as_failed(part.engine.error)))

    # --- the end ----------------------------------------------------------------------------------------------------

    async def _close(self) -> None:
        part = self._part
        self._is_closed = True
        if part is None:
            return
        try:
            await part.composition.run_lifecycle.close()
        finally:
            if self._serving is not None:
                self._serving.close()
            engine = part.engine
            failed = as_failed(engine.error) if engine.outcome == "failed" else None
            self._say(MAIN, _closed(self._name, engine, failed))

    async def _leave(self) -> None:
        await self._channels[MAIN].flush(_PARTING_S)
        if self._carrier is not None:
            await self._carrier.close()
        if self._shares_memory:
            sweep_run(self._run)  # if the main part was killed, no other process is left to do it
        for channel in self._channels.values():
            await channel.close()


def _closed(name: str, engine: Any, failed: Any) -> messages.Closed:
    """Say what a part has done, now that it is torn down."""
    core = engine.core
    return messages.Closed(
        name,
        node_reports(core),
        edge_reports(core),
        [str(error) for error in core.errors],
        core.lost_activity,
        failed,
        engine.time.within_s(),
    )
