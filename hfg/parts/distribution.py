"""A run of a graph that is cut: the main part here, the others wherever a launcher has started them.

It starts the others, sets them up together with its own part, starts all of them at one moment, makes them agree on the
consequences of quiet, and ends them with the run (rules L1 to L3, R5). Depends on `worker`'s side of the conversation
and `channels`.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
import time
import uuid
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.engine.face.composition import Composition
from hfg.engine.observing.report import Report
from hfg.errors import HfgError, RunError, UsageError
from hfg.graph import Graph
from hfg.graph.flat import MAIN, Cutting, FlatGraph, cut
from hfg.parts.hosts import requests
from hfg.parts.hosts.announcement import Announcement
from hfg.parts.model import messages
from hfg.parts.model.agreement import Agreement, Question, Rest
from hfg.parts.model.clocks import RunClock, machine
from hfg.parts.model.components import components
from hfg.parts.model.costs import uncounted
from hfg.parts.model.deaths import LIMIT, WITHIN_S
from hfg.parts.model.failing import as_error
from hfg.parts.model.inheriting import inherited, keeping, remembered
from hfg.parts.model.ledgers import Entry, Ledger, ledger_of
from hfg.parts.model.messages import Message, OfAnEdge, Untrue
from hfg.parts.model.trace_filter import trace_filter
from hfg.parts.processes.peer_process import Launcher, PeerProcess
from hfg.parts.processes.worker import FIRST_INCARNATION
from hfg.parts.running.channels import Channel, name_of
from hfg.parts.running.part import Part
from hfg.parts.running.part_links import PartLinks
from hfg.parts.running.rings import sweep_run, sweep_runs
from hfg.parts.steering.asking import Asking
from hfg.parts.steering.editing import Drawing
from hfg.parts.steering.reports import Counts, whole_report
from hfg.parts.steering.run import CutRun

_LOGGER = Log("hfg.parts")
_PATIENCE_S = 1.0  # how long a lossy signal may be in transit while nothing else moves
_MOST_LOGGERS = 1000  # that other parts may use here
_LEAVING_S = 7.0  # how long the others may take to tear down; one node may take five (X3)


class Distribution:
    """The whole of a run that is cut.

    Attributes:
      flat: the main part, to be run here.
    """

    def __init__(
        self,
        flat: FlatGraph,
        cutting: Cutting,
        text: str,
        options: Mapping[str, Any],
        launcher: Launcher,
        *,
        write: Callable[[Graph], str],
        modules: Mapping[str, str] | None = None,
        name: str = "",
    ) -> None:
        """Prepare the run; nothing is started yet.

        Args:
          flat: the whole graph.
          cutting: how the graph is cut.
          text: the graph, as a file would have it.
          options: of the run, for the other parts.
          launcher: starts them.
          write: returns the text of the graph after an edit.
          modules: modules that they will import, each with a place in the graph that needs it.
          name: name of the run, if it has one.
        """
        self.flat: FlatGraph = cutting.parts[MAIN]
        self._drawing = Drawing(flat, cutting, text, write)
        self._options = dict(options)
        self._launcher = launcher
        self._modules = dict(modules or {})
        self._run = f"hfg/{name or uuid.uuid4().hex[:12]}"
        self._incarnations = dict.fromkeys(cutting.parts, FIRST_INCARNATION)
        self._agreement = Agreement(
            cutting.parts,
            self._ask,
            lossy=[edge.label for edge in cutting.edges if edge.guarantee == "bounded"],
            wait=self._look_later,
        )
        self._others = {name: PeerProcess(name) for name in cutting.parts if name != MAIN}
        self._asking = Asking(flat, cutting, self._call)
        self._run_of_all: Run
        self._part: Part
        self._announcement: Announcement | None = None
        self._carrier: PartLinks | None = None
        self._is_open = False
        self._has_begun = False
        self._ledgers: dict[str, Ledger] = {}
        self._loggers: set[str] = set()
        self._labels = {
            name: (
                {edge.label for edge in cutting.edges if edge.source == name},
                {edge.label for edge in cutting.edges if edge.target == name},
            )
            for name in cutting.parts
        }
        self._newest = FIRST_INCARNATION  # of all parts together, so that later streams are higher on any link

    # --- the beginning ----------------------------------------------------------------------------------------------

    def take(self, composition: Composition) -> None:
        """Here is the engine of the main part."""
        self._loop = asyncio.get_running_loop()
        cutting = self._drawing.cutting
        self._part = Part(
            MAIN,
            composition,
            cutting.edges_of(MAIN),
            rests=self._rests,
            inherited=inherited(cutting),
            remembered=remembered(cutting),
        )
        composition.consumers.leave_out(trace_filter(MAIN, self._drawing.cutting.edges))
        composition.engine.callbacks.finished.append(self._ended_here)

    def face(self, graph: Graph) -> Run:
        """Return the interface to the whole run."""
        composition = self._part.composition
        self._run_of_all = (
            CutRun(graph, composition, self._asking, self._drawing) if self._others else Run(graph, composition)
        )
        return self._run_of_all

    async def open(self) -> None:
        """Begin the other parts and set them up.

        Raises:
          HfgError: one of them cannot be, or its setup has failed. `close` is to be called all the same.
        """
        self._is_open = True
        self._open_ledgers()
        self._session = session = await self._launcher.open()
        await self._launcher.prepare({name: self._host(name) for name in self._others}, self._modules)
        if self._launcher.is_in_realm:
            self._announcement = Announcement(session, self._run, self._run_of_all, self._parts, self._restart)
        edges = list(self._drawing.cutting.edges_of(MAIN))
        if self._launcher.shares_memory:
            sweep_runs()
        for other in self._others.values():
            other.begin(self._channel_to(other))
        self._carrier = PartLinks(
            self._part,
            session,
            self._launcher.near or session,
            self._run,
            self._incarnations,
            edges,
            self._say,
            remembered(self._drawing.cutting),
            shares_memory=self._launcher.shares_memory,
            admits=False,
        )
        for other in self._others.values():
            await self._launch(other)
            if self._incarnations[other.name] > self._incarnations[MAIN]:
                self._carrier.admit(other.name, self._incarnations[other.name])
        while waiting := [other for other in self._others.values() if other.state != "running"]:
            for other in waiting:
                await other.wait_opened()

    def _host(self, part: str) -> str:
        return self._drawing.cutting.parts[part].groups[part].host

    def _open_ledgers(self) -> None:
        """Open the ledgers.

        A part with an entry counts as younger than all parts that start from scratch: they send it their positions.
        """
        for name, where in keeping(self._drawing.cutting).items():
            self._ledgers[name] = ledger_of(where, name)
        kept = [name for name, ledger in self._ledgers.items() if ledger.entry is not None]
        if kept:
            first = 1 + max([ledger.entry.incarnation for ledger in self._ledgers.values() if ledger.entry is not None])
            self._incarnations = dict.fromkeys(self._incarnations, first)
            self._newest = first
            for name in kept:
                self._newest += 1
                self._incarnations[name] = self._newest

    def _channel_to(self, other: PeerProcess) -> Channel:
        incarnations = (FIRST_INCARNATION, self._incarnations[other.name])
        return Channel(self._session, self._run, MAIN, other.name, incarnations, partial(self._hear, other))

    async def _launch(self, other: PeerProcess) -> None:
        """Start the process of a part and have it set up its nodes; the part reports when this is done."""
        name = other.name
        incarnations = (self._incarnations[name], FIRST_INCARNATION)
        launched = await self._launcher.launch(self._run, name, self._host(name), incarnations)
        other.live(launched, partial(self._gone, other))
        calls = self._asking.open(name)
        shares = self._launcher.shares_memory
        engine = self._part.engine
        clock = RunClock(machine(), engine.time.ahead_s, engine.time.began_at)
        ledger = self._ledgers.get(name)
        kept = None if ledger is None or ledger.entry is None else ledger.entry.data
        lives_of_all, known = dict(self._incarnations), _known_packages()
        self._say(
            name, messages.Open(self._drawing.text, self._options, lives_of_all, clock, known, shares, calls, kept)
        )

    def begin(self) -> None:
        """Start all parts after setup, the main part last."""
        self._has_begun = True
        for other in self._others.values():
            other.let_go()

    # --- what is said -----------------------------------------------------------------------------------------------

    def _say(self, part: str, message: Message) -> None:
        self._others[part].say(message)

    def _call(self, part: str, call: messages.Call) -> None:
        if self._others[part].is_there:
            self._say(part, call)

    def _hear(self, other: PeerProcess, message: Message) -> None:
        if isinstance(message, OfAnEdge):
            assert self._carrier is not None
            self._carrier.hear(other.name, message)
            return
        self._need_own(other, message)
        match message:
            case messages.Opened():
                other.answer(None if message.failed is None else self._error(message.failed, other))
            case messages.AskTime():
                self._say(other.name, messages.TellTime(message.asked, time.monotonic()))
            case messages.Rests():
                self._agreement.rest(message.rest)
            case messages.Told():
                self._told(message)
            case messages.Keep():
                if other.name not in self._ledgers or other.is_keeping:
                    raise Untrue("and has no ledger, or does not know yet that its previous data is stored")
                other.keep(partial(self._keep, other.name, message.number, message.data))
            case messages.Ended():
                self._ended_there(other, message)
            case messages.Logged():
                _log(other.name, message, self._loggers)
            case messages.Result() | messages.Seen():
                self._asking.hear(other.name, message)
            case messages.Closed():
                other.close(message)
            case _:
                raise Untrue("which is not for the main part")

    def _told(self, message: messages.Told) -> None:
        try:
            self._agreement.hear(message.answer)
        except msgspec.ValidationError as error:
            raise Untrue(f"which is not an answer to that question: {error}") from error

    def _need_own(self, other: PeerProcess, message: Message) -> None:
        """Check that a part's message is about its own edges and nodes.

        Raises:
          Untrue: it is not.
        """
        name = other.name
        match message:
            case messages.Opened() | messages.Ended() | messages.Closed():
                speaker = message.part
            case messages.Rests():
                speaker = message.rest.part
                if (set(message.rest.leaving), set(message.rest.coming)) != self._labels[name]:
                    raise Untrue("of other edges than it has")
            case messages.Told():
                speaker = message.answer.part
            case _:
                return
        if speaker != name:
            raise Untrue(f"for {name_of(speaker):.200}")
        if isinstance(message, messages.Closed) and not other.is_leaving:
            raise Untrue("and it has not been told to start")

    async def _keep(self, part: str, number: int, data: bytes, say: Callable[[Message], None]) -> None:
        """Store the data of a part, and confirm it."""
        ledger, entry = self._ledgers[part], Entry(self._newest, data)
        try:
            if ledger.is_slow and not self._part.engine.virtual:
                await asyncio.to_thread(ledger.write, entry)
            else:
                ledger.write(entry)
        except RunError as error:
            self._part.finish("failed", error)
        else:
            say(messages.Kept(number))

    def _rests(self, rest: Rest) -> None:
        self._loop.call_soon(self._agreement.rest, rest)

    def _look_later(self) -> None:
        self._loop.call_later(_PATIENCE_S, self._agreement.look_again)

    def _ask(self, part: str, question: Question) -> None:
        if part == MAIN:
            self._loop.call_soon(lambda: self._agreement.hear(self._part.answer(question)))
        else:
            self._say(part, messages.Ask(question))

    # --- the end ----------------------------------------------------------------------------------------------------

    def _error(self, failed: messages.Failed, other: PeerProcess) -> HfgError:
        return as_error(failed, f"the process of group {other.name!r}")

    def _ended_here(self) -> None:
        """The main part is over: so are all."""
        for name, other in self._others.items():
            if other.is_there:
                self._say(name, messages.Finish(self._part.engine.outcome))

    def _ended_there(self, other: PeerProcess, message: messages.Ended) -> None:
        """Another part has ended, by itself or because it was told to; so all parts end.

        Exception: a process that has to leave, because of its agent or a restart, is replaced by another one.
        """
        if message.outcome == "cancelled":
            return
        error = None if message.failed is None else self._error(message.failed, other)
        self._part.finish(message.outcome, error)
        self._asking.over(other.name)

    def _gone(self, other: PeerProcess, how: str) -> None:
        """A process has ended that was not told to; another one takes its place."""
        self._agreement.leave(other.name)
        self._asking.gone(other.name, RunError(f'the process of group "{other.name}" is gone: {how}'))
        torn = self._torn_by(other.name)
        pause_s = other.died()
        if not self._is_open:
            return
        if torn:
            error = RunError(f'the process of group "{other.name}" is gone: {how}; {torn}')
            other.answer(error)
            self._part.finish("failed", error)
            self._asking.over(other.name)
            return
        if pause_s is None:
            often = f"it died {LIMIT + 1} times within {WITHIN_S:g} s and is not restarted"
            error = RunError(f'the process of group "{other.name}" is gone: {how}; {often}: see what it ended with')
            other.answer(error)
            self._part.finish("failed", error)
            self._asking.over(other.name)
            return
        _LOGGER.warning('the process of group "%s" is gone: %s; a new one starts in %g s', other.name, how, pause_s)
        for what in self._uncounted(other.name):
            _LOGGER.warning('group "%s": %s', other.name, what)
        other.come_back(self._bring_back(other, pause_s))

    def _uncounted(self, name: str) -> tuple[str, ...]:
        return uncounted(self._drawing.cutting, name, self._ledgers) if self._has_begun else ()

    def _torn_by(self, name: str) -> str:
        """Return why the run cannot continue without a process: joins would pair unrelated tokens (L2)."""
        cutting = self._drawing.cutting
        if name in self._ledgers or not self._has_begun or cutting.parts[name].groups[name].may_misalign:
            return ""
        for one in components(cutting, self._ledgers)[name]:
            if one.cost == "unknown" and one.joined:
                return (
                    f"the number of tokens lost with it is unknown because {one.uncertain}, and "
                    f'"{one.joined}" would pair tokens that do not belong together: give the group '
                    "ledger=True, or may_misalign=True to continue"
                )
        return ""

    async def _restart(self, name: str) -> None:
        """Somebody asks for another process of a part."""
        other = self._others.get(name)
        if other is None:
            there = ", ".join(f'"{one}"' for one in self._others) or "none"
            raise UsageError(f'the run has no group "{name}" with a process of its own; it has {there}')
        await other.restart()  # what follows is as when it dies

    def _parts(self) -> list[requests.PartIs]:
        """Tell of all parts, the main one first."""
        here = self._session.host
        told = [requests.PartIs("", here, os.getpid(), "running", 0, self._part.engine.elapsed())]
        for name, one in self._others.items():
            told.append(requests.PartIs(name, self._host(name) or here, one.process, one.state, one.restarts, one.up_s))
        return told

    async def _bring_back(self, other: PeerProcess, pause_s: float) -> None:
        """Begin another incarnation of a part, while all others wait for it as they do for one that is slow (L3)."""
        await asyncio.sleep(pause_s)
        name = other.name
        try:
            await other.bury()
            self._newest += 1
            self._incarnations[name] = incarnation = self._newest
            other.begin(self._channel_to(other))
            for one in self._others.values():
                if one.is_told:
                    self._say(one.name, messages.Reborn(name, incarnation))
            await self._launch(other)
            assert self._carrier is not None
            self._carrier.admit(name, incarnation)
            await other.wait_opened()
        except HfgError as error:
            other.answer(error)
            self._part.finish("failed", error)
            self._asking.over(name)
            return
        if self._has_begun:
            other.let_go()
        if self._part.engine.core.over:  # over meanwhile, when no one could be told
            self._say(name, messages.Finish(self._part.engine.outcome))

    async def close(self) -> None:
        """Let the other parts tear down, take their reports, and see to it that nothing is left of them."""
        if not self._is_open:
            return
        self._is_open = False
        for other in self._others.values():
            await other.stay_away()
        there = [other for other in self._others.values() if other.is_there]
        for other in there:
            other.leaves()
            self._say(other.name, messages.Close())
        if there:
            await asyncio.wait({other.closed for other in there}, timeout=_LEAVING_S)
        for other in self._others.values():
            await other.end()
        self._asking.close()
        for ledger in self._ledgers.values():
            if self._part.engine.outcome == "done" and ledger.entry is not None:
                ledger.clear()
            ledger.close()
        if self._carrier is not None:
            await self._carrier.close()
        if self._announcement is not None:
            self._announcement.close()
        if self._launcher.shares_memory:
            sweep_run(self._run)  # of processes that were killed
        await self._launcher.close()

    def failure(self) -> HfgError | None:
        """Return the error from the teardown of another part, if there was one."""
        for other in self._others.values():
            if other.report is not None and other.report.failed is not None:
                return self._error(other.report.failed, other)
        return None

    def whole(self, report: Report) -> Report:
        """Put the report of the main part and those of the others together."""
        is_running = report.outcome == "running"
        counts = self._run_of_all.counts() if is_running and isinstance(self._run_of_all, CutRun) else {}
        found: dict[str, Counts | messages.Closed] = {}
        errors: list[str] = []
        for name, other in self._others.items():
            counted: Counts | messages.Closed | None = counts.get(name) if is_running else other.report
            if counted is not None:
                found[name] = counted
                errors += self._restarted(other) + counted.errors
            elif not is_running:
                errors.append(f'the process of group "{name}" has not reported')
        return whole_report(report, self._drawing.cutting, found, errors)

    def _restarted(self, other: PeerProcess) -> list[str]:
        """Return what a part's report lacks because its process was restarted."""
        times = max(other.deaths.count, other.restarts)
        if not times:
            return []
        return [
            f'the process of group "{other.name}" was restarted {times} times; its counts from before are not in the '
            "report",
            *(f'group "{other.name}", each time: {what}' for what in self._uncounted(other.name)),
        ]


def distribute(
    graph: Graph, flat: FlatGraph, options: Mapping[str, Any], *, virtual: bool, settings: str | None = None
) -> Distribution:
    """Prepare the run of a graph that has groups with processes, or that other programs can find.

    In virtual time its parts share the loop because processes have real clocks.

    Args:
      graph: the graph to run.
      flat: the same graph, flattened.
      options: of the run, for the other parts.
      virtual: whether it runs in virtual time.
      settings: the settings file, which sets its realm; "" for the default, None for none unless its hosts need one.

    Raises:
      FileError: it cannot be sent to another process.
      TransportError: there is no way to communicate with one.
    """
    from hfg.files import text_of
    from hfg.files.building import modules_of
    from hfg.files.describing import describe
    from hfg.parts.hosts.remote_parts import AgentLauncher, deployed_as
    from hfg.parts.processes.launching import LoopLauncher, ProcessLauncher

    cutting = cut(flat)
    launcher: Launcher
    if virtual or (len(cutting.parts) == 1 and settings is None):  # groups without nodes
        launcher = LoopLauncher()
    elif settings is not None or any(flat.groups[part].host for part in cutting.parts if part != MAIN):
        here = ProcessLauncher({"settings": str(Path(settings).resolve())} if settings else {})
        launcher = AgentLauncher(here, graph.name)
    else:
        launcher = ProcessLauncher()
    if len(cutting.parts) == 1:
        return Distribution(flat, cutting, "", options, launcher, write=str, name=deployed_as.get() or "")

    def write(graph: Graph) -> str:
        return text_of(describe(graph, same_program=True))

    document = describe(graph, same_program=True)
    return Distribution(
        flat,
        cutting,
        text_of(document),
        options,
        launcher,
        write=write,
        modules=modules_of(document),
        name=deployed_as.get() or "",
    )


def _log(part: str, logged: messages.Logged, loggers: set[str]) -> None:
    """Hand a record of another part to the loggers here, as if its node were; loggers are never forgotten."""
    if len(loggers) < _MOST_LOGGERS:
        loggers.add(logged.logger)
    logger = logging.getLogger(logged.logger if logged.logger in loggers else "hfg.parts")
    if not logger.isEnabledFor(logged.level):
        return
    extra = {"group": part} | ({"path": logged.path} if logged.path else {})
    record = logger.makeRecord(
        logged.logger, logged.level, logged.file, logged.line, "%s", (logged.text,), None, logged.function, extra
    )
    record.created = logged.created
    with contextlib.suppress(Exception):  # a handler that raises does no harm
        logger.handle(record)


def _known_packages() -> list[str]:
    """Return the packages that this program has imported; its other processes may import them."""
    return sorted({name.partition(".")[0] for name in sys.modules})
