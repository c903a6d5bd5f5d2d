"""The state of a region between its waves: whether one may begin, the counts, and the turns of its members.

Depends on `schedule`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.engine.fusion.schedule import Key, Schedule, Turn, is_only_called, takes_no_turns
from hfg.engine.model.flags import Flags
from hfg.engine.model.running_node import NO_CALLS, RunningNode
from hfg.engine.rules import agenda
from hfg.errors import EngineInternalError
from hfg.ports.edges import EventEdge

__all__ = ["Turnstile", "WaveState"]

_LONGEST_PUT_OFF = 255  # waves for which a region that cannot be armed does not ask again


class Turnstile:
    """Stands in the run queue after the nodes that have their turns during a wave; no other node passes it."""

    calls = ()


class WaveState:
    """The state of a region.

    Attributes:
      head: whose step runs a wave.
      schedule: the members in their order, and the edges between them.
      takes_turns: outsiders have their turns during a wave, so members may be active; see `turns`.
      waiting: outsiders that a sending of the current wave has enabled, and that have not had their turns.
      armed: everything inside rests, or a wave runs.
      running: a wave is in progress.
      called_off: the current wave ends after its present call, or after the present turn of an outsider.
      flags: if not empty, the current wave ends after its present call.
      ending: some producer before the head sends END as soon as its outputs are free.
    """

    def __init__(self, schedule: Schedule) -> None:
        self.schedule = schedule
        self.order = order = schedule.order
        self.paths = tuple(worker.path for worker in order)
        self.head = head = order[0]
        self.core = head.core
        self.flags: Flags = self.core.flags
        self.takes_turns = not takes_no_turns(order)
        self.entries: tuple[Any, ...] = head.live_inputs
        self.held_entries = tuple(edge for edge in self.entries if type(edge) is not EventEdge and edge.sequential)
        self.inner = [edge for out in schedule.outs for edge, _, to in out if to is not None]
        self.border = [edge for out in schedule.outs for edge, _, to in out if to is None]
        self.activity_senders = [worker for worker in order if any(edge.active for edge in worker.all_out_edges())]
        self.waiting: dict[Key, RunningNode] = {}
        self._turnstile = Turnstile()
        self._number_of = {edge: n for out in schedule.outs for n, (edge, _, to) in enumerate(out) if to is None}
        self._first: list[RunningNode] = []  # who goes before all that the wave leaves to the run queue
        self.armed = False
        self.running = False
        self.doomed = False
        self.called_off = False
        self._put_off = self._patience = 0  # waves before one asks again whether it may be armed
        self.ending = any(edge.source.pending_end for edge in self.held_entries)
        self.waves = 0  # not yet in the counts of members and edges
        self.silent = [0] * len(order)  # silent firings, likewise
        self.spread = [0] * len(order)  # how often a member silenced all later ones
        self._exits = [0] * len(order)
        self._formed_at = head.counts.firings

    # --- armed or not -----------------------------------------------------------------------------------------------

    def arm(self) -> bool:
        """Before a wave that follows something unusual: does everything inside rest?

        Where outsiders have no turns during a wave, its text does not check activity, so none may move. After each
        "no", the region waits longer before it checks again.
        """
        if self._put_off:
            self._put_off -= 1
            return False
        rests = not self.doomed and not self.head.outputs.missing
        rests = rests and (self.takes_turns or not any(one.active for one in self.activity_senders))
        if not rests or not all(self._rests(k) for k in range(1, len(self.order))):
            self._put_off = self._patience
            self._patience = min(2 * self._patience + 1, _LONGEST_PUT_OFF)
            return False
        self._patience = 0
        for edge in self.border:
            edge.waits = self.head
        self.armed = True
        return True

    def _rests(self, k: int) -> bool:
        """Whether a member has no firing or call in progress, and nothing forbids its next one.

        Nothing lies before it either, but for calls of one that fires as well: the wave looks at those where the firing
        has its place (F9).
        """
        worker, called = self.order[k], k in self.schedule.called
        if (worker.blocked >= NO_CALLS if called else worker.blocked) or worker.outputs.missing or worker.pending_end:
            return False
        if worker.busy or worker.fireable or worker.idle_callbacks is not None:
            return False
        if (worker.queued or worker.calls) and not self.schedule.fires_with_slots(k):
            return False
        return called or worker.inputs.missing == len(worker.live_inputs)

    def check_invariants(self) -> None:
        """While it is armed everything inside rests, and what has left it counts at the head.

        Raises:
          EngineInternalError: it does not.
        """
        if not self.armed or self.running:
            return
        for k, worker in enumerate(self.order):
            if k and not self._rests(k):
                raise EngineInternalError(f'node "{worker.path}": its region is armed, but it does not rest')
        for edge in self.inner:
            if edge.token is not None or edge.unprocessed:
                raise EngineInternalError(f'edge "{edge.label}": its region is armed, but a token is on it')
        for edge in self.border:
            if edge.waits is not self.head:
                raise EngineInternalError(
                    f'edge "{edge.label}": its region is armed, but the head does not answer for it'
                )
        if self.waiting:
            raise EngineInternalError(f'node "{self.head.path}": its wave is over, but outsiders wait for turns in it')

    def disarm(self) -> None:
        """The members continue one by one: write into their barriers what finished waves still wait for."""
        if self.armed and not self.running:
            self.armed = False
            self.settle_counts()
            self._write_barriers(len(self.order))

    def disturb(self, worker: RunningNode) -> None:
        """A member does not rest any more; of the head only its next wave asks."""
        if self.running:
            self._call_off("disturbed")
        elif worker is not self.head:
            self.disarm()

    def activity_changed(self, worker: RunningNode) -> None:
        """A member is active now, or no longer: a wave looks at that itself, unless it takes no turns."""
        if not self.takes_turns:
            self.disturb(worker)

    def expect_end(self) -> None:
        """Before it a node is over, and END comes as soon as what it has sent is processed."""
        self.ending = True

    def interrupt(self) -> None:
        """The run is paused, or over: end the current wave after its present call."""
        if self.running:
            self._call_off("interrupted")

    def _call_off(self, why: str) -> None:
        """End the current wave after its present call."""
        self.called_off = True
        self.flags.append(why)

    def _write_barriers(self, k: int, silent_calls: Sequence[Any] | set[Any] = ()) -> None:
        """F5: who of those that have fired, the first k, still waits for what it has sent.

        Args:
          k: how many have fired.
          silent_calls: edges into slots that carried a marker, which is processed at once (T4).
        """
        for edge in self.border:
            edge.waits = edge.source
        done = [False] * len(self.order)
        for j in reversed(range(k)):
            worker, missing = self.order[j], 0
            for edge, _, to in self.schedule.outs[j]:
                if to is not None:
                    edge.unprocessed = edge.live and (to >= k or not done[to]) and edge not in silent_calls
                missing += edge.unprocessed
            worker.wait_for_taking(missing, worker.live_inputs if j else self.held_entries)
            if missing:
                worker.drop_firing()  # of the head, to which a place was given while its outputs were not counted (F1)
            done[j] = not missing

    # --- counts -----------------------------------------------------------------------------------------------------

    def settle_counts(self) -> None:
        """Each member has fired once per wave, and each inner edge has carried one token."""
        waves, self.waves = self.waves, 0
        if waves:
            for edge in self.inner:
                edge.sent += waves
        spread, called = 0, self.schedule.called
        for number, worker in enumerate(self.order):
            silent = self.silent[number] + spread
            spread += self.spread[number]
            self.silent[number] = self.spread[number] = 0
            if number in called:  # by a marker a slot is not called (T4)
                worker.counts.add_calls(waves - silent)
            else:
                worker.counts.add_firings(waves, silent)

    # --- who goes next ----------------------------------------------------------------------------------------------

    def queue_turns(self, turns: Sequence[Turn]) -> None:
        """The wave is over, or goes the interpreted way: who has its turn now stands in front of the run queue (R2).

        Args:
          turns: whose turns may come, the next one first; members that are enabled by now, and outsiders that were.
        """
        core, found = self.core, self.core.next_in_wave
        for worker, key in turns:
            if key is not None:
                if key in self.waiting:
                    found.append(self.waiting.pop(key))
            elif is_only_called(worker):
                if worker.calls:
                    worker.run_after_wave()
            elif not worker.fireable and (agenda.make_fireable(worker) or worker.queued):
                worker.go_before_calls()
                if worker in worker.group.policy:  # for a call (F9), so it keeps that place
                    worker.run_next()
                else:
                    worker.run_after_wave()
        if not self.takes_turns and len(found) > 1:
            place = {worker: number for number, (worker, _) in enumerate(turns)}
            found.sort(key=place.__getitem__)
        core.ran_next += len(found)
        for worker in reversed(found):
            worker.push_next(worker)
        found.clear()
        for worker in reversed(self._first):
            worker.push_next(worker)
        self._first.clear()
