"""Runs that are edited at random, beside the oracle (rule R4).

Stands on `edits`, `planned` and `conformance`.
"""

from __future__ import annotations

import asyncio
from typing import Any

import hfg
from hfg.errors import GraphError, NotRunning, RunError, UsageError
from hfg.testing.conformance import Divergence, Replay
from hfg.testing.reference import Move
from hfg.trace import RunEnded, TokenDropped, TraceEvent
from tests.support.edits import drawn, random_edit
from tests.support.iterated import random_iterated
from tests.support.making import Allowed, SeededChooser, random_plan
from tests.support.planned import planned, planned_afresh

__all__ = ["EditedRun"]

_MOST_EVENTS = 3000  # what goes round for ever is cut off here


class EditedRun:
    """One random graph, run under one random schedule and edited at random.

    Args:
      seed: of all of it.
      allowed: what may occur in the graph.
      edits: how often it is edited; commands that are refused count too.
      quiet: edit at quiet moments only.
      iterated: the graph is inside of subgraphs that iterate.

    Attributes:
      trace: all that was seen of the run.
      carried_out: how many edits were.
      problems: what is wrong, as sentences: refused edits that changed something, plans that are not those made afresh.
    """

    def __init__(
        self, seed: int, allowed: Allowed, *, edits: int = 8, quiet: bool = False, iterated: bool = False
    ) -> None:
        self.seed = seed
        self.plan = random_iterated(seed, allowed) if iterated else random_plan(seed, allowed)
        self.graph = self.plan.build()
        self.trace: list[TraceEvent] = []
        self.carried_out = 0
        self.problems: list[str] = []
        self._choose = SeededChooser(seed)
        self._edits = edits
        self._quiet = quiet
        self._let_go: tuple[int, float] | None = None  # after how many events, and when, it was to end by itself

    def run(self) -> None:
        """Run it to its end."""
        with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
            runner.run(self._run())

    def difference(self) -> str | None:
        """Replay it on the oracle and say what differs."""
        replaying = Replay(self.plan.build(), held_open=True)
        try:
            for number, event in enumerate(self.trace):
                if self._let_go is not None and number == self._let_go[0]:
                    _let_time_pass(replaying, self._let_go[1])
                    replaying.machine.held_open = False
                if number >= _MOST_EVENTS or self._is_cut_short(event):
                    return None
                replaying.see(event)
            replaying.check_over()
        except Divergence as divergence:
            return str(divergence)
        finally:
            replaying.machine.close()
        return None

    def _is_cut_short(self, event: TraceEvent) -> bool:
        """From here on the run only ends because it was stopped from outside."""
        ended = isinstance(event, RunEnded) and event.outcome == "stopped"
        dropped = isinstance(event, TokenDropped) and event.reason == "stopped"
        return self._let_go is None and (ended or dropped)

    async def _run(self) -> None:
        try:
            async with hfg.running(self.graph, policy="random", seed=self.seed, trace=self._see) as run:
                self._running = run
                for number in range(self._edits):
                    await self._wait(run)
                    try:
                        await self._edit(run, number)
                    except NotRunning:
                        return
                if self._choose.chance(50):
                    self._let_go = len(self.trace), run.now()
                    await run.wait_finished()
        except RunError:
            pass  # the oracle knows whether it may

    def _see(self, event: TraceEvent) -> None:
        self.trace.append(event)
        if len(self.trace) == _MOST_EVENTS:
            asyncio.get_running_loop().call_soon(self._running.stop)

    async def _wait(self, run: Any) -> None:
        if self._quiet:
            await run.wait_quiet()
            return
        for _ in range(self._choose.number(0, 10)):
            await asyncio.sleep(0)
        if self._choose.chance(40):
            await asyncio.sleep(0.004)

    async def _edit(self, run: Any, number: int) -> None:
        before = drawn(self.graph)
        what = self._choose.number(0, 9)
        commands = random_edit(self.graph, self._choose, number)
        try:
            if what == 0:
                await run.undo()
            elif what == 1:
                await run.redo()
            else:
                await run.edit(*commands)
        except NotRunning:
            raise
        except (GraphError, UsageError) as error:
            if drawn(self.graph) != before and not _values_moved(before):
                self.problems.append(f"edit {number} was refused and changed something: {error}")
            return
        self.carried_out += 1
        if planned(run._engine) != planned_afresh(run._engine):
            self.problems.append(f"the plan after edit {number} is not the plan made afresh: {commands}")


def _values_moved(before: dict[str, Any]) -> bool:
    """Tokens may set parameters meanwhile (P8)."""
    return any(
        node["parameters"] or (node["inside"] is not None and _values_moved(node["inside"]))
        for node in before["nodes"].values()
    )


def _let_time_pass(replaying: Replay, until: float) -> None:
    """Nothing moved until somebody outside did something."""
    machine = replaying.machine
    while machine.now < until:
        replaying._finish_steps()  # of which nothing need have been seen
        moves = machine.owed_moves()
        if any(move.kind != "wait" for move in moves):
            return
        replaying._apply(Move("wait", time=min([until, *(move.time for move in moves)])))
