"""What follows when the graph is quiet, and what outside it prevents the end of the run (rules P9, P10, F13, R5)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from hfg.base.logs import Log
from hfg.engine.executing.code import answer
from hfg.engine.executing.groups import ThreadGroup
from hfg.engine.model import Core, RunningNode
from hfg.engine.rules import quiescence, rings

__all__ = ["Quiet"]

_LOGGER = Log("hfg.engine")


class Quiet:
    """Decides what follows when the ready queues are empty.

    Attributes:
      readers: the graph outputs that are read from outside now, so that tokens at them will be taken.
      read_out: those whose END was read.
      senders: feeds for which a caller outside has a token, once for each.
    """

    def __init__(self, core: Core, *, virtual: bool) -> None:
        self._core = core
        self._virtual = virtual
        self._holds = 0
        self.readers: list[RunningNode] = []
        self.read_out: set[RunningNode] = set()
        self.senders: list[RunningNode] = []
        self._told_unread: set[str] = set()
        self._waiters: list[asyncio.Future[None]] = []
        self._agreement: Callable[[], None] | None = None

    def hold(self) -> None:
        """Something outside may still send tokens: keep the run open (R5)."""
        self._holds += 1

    def unhold(self) -> None:
        """One less."""
        self._holds -= 1
        self._core.runtime.kick()

    async def wait(self) -> None:
        """Wait until only something outside can change anything, or the run is over."""
        if self._core.over:
            return
        waiter: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiters.append(waiter)
        self._core.runtime.kick()
        await waiter

    def answer(self) -> None:
        """Let those continue that wait for quiet."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            answer(waiter, None)

    def settle(self) -> None:
        """The ready queues are empty: if the graph is quiet, do what follows."""
        core = self._core
        if core.timers:
            return
        if (core.in_flight or core.tasks) and not (
            (core.dead_sources and self._only_dead_sources_work())
            or (core.waiting_room and quiescence.only_waiting_for_room(core))
        ):
            return
        self._is_quiet()

    def _only_dead_sources_work(self) -> bool:
        """Only sources that feed ended nodes work, and no node waits for its turn in their groups (R5)."""
        if any(isinstance(node.group, ThreadGroup) and len(node.group.policy) for node in self._core.workers):
            return False
        return quiescence.only_dead_sources_in_flight(self._core, threads_too=not self._virtual)

    def _is_quiet(self) -> None:
        """Nothing runs, nothing can start, no timer is pending (P9, F13, R5).

        Each step may make the graph move again, so the order matters: what operators hold comes out before END is sent
        to inputs (F13), and only a graph with nothing left to do is over or stalled.
        """
        core = self._core
        if any(not feed.outputs.missing for feed in self.senders):
            return  # a token is about to arrive
        if self._agreement is not None:
            self._agreement()
            return
        rings.look_at_all(core)
        if rings.resolve(core) or core.timers or self.is_held_open():
            return
        if self.give_up() or self.complete_operators() or core.timers > 0 or self.end_events():
            return
        stalled = quiescence.stall(core)
        core.runtime.finish("done" if stalled is None else "stalled", stalled)

    def leave_to(self, agreement: Callable[[], None]) -> None:
        """This is a part of a graph that is cut: only report when nothing moves in it any more.

        The whole decides what follows, and calls the methods below.
        """
        self._agreement = agreement

    def is_held_open(self) -> bool:
        """Let those continue that wait for quiet. Return whether something outside may still send or take (R5)."""
        self.answer()
        if self._holds and self._core.readers:
            self._warn_of_unread()
        return bool(self._holds) or any(reader.inputs_ready() for reader in self.readers)

    def give_up(self) -> bool:
        """Let sources end that feed only ended nodes (R5). Return whether there were any."""
        return self._kicked(quiescence.give_up(self._core))

    def complete_operators(self) -> bool:
        """Complete operators on edges (P9). Return whether they held something."""
        return self._kicked(quiescence.complete_operators(self._core))

    def end_events(self) -> bool:
        """Send END to inputs that no signal can reach any more (F13). Return whether there were any."""
        return self._kicked(quiescence.end_events(self._core))

    def _kicked(self, moves: bool) -> bool:
        if moves:
            self._core.runtime.kick()
        return moves

    def _warn_of_unread(self) -> None:
        """Warn once of an output without a reader (P10): a graph that waits for it looks like any quiet one."""
        for node in quiescence.unread(self._core, self.readers):
            name = node.port_name
            if name not in self._told_unread:
                self._told_unread.add(name)
                _LOGGER.warning(
                    'graph output "%s" is not read, and the graph stands still until it is: read it beside the rest, '
                    '`async for value in run.read("%s")`, or leave the output out',
                    name,
                    name,
                )
