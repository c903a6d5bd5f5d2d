"""A fused region: nodes whose firings run as one generated function a wave, with values in locals.

*Operator fusion* with *guards* and *side exits*, as in a tracing JIT. Inside of a wave there are no tokens, barriers or
run queues; outside of one the members look as the rules leave them. What keeps that true:

- **arm**: before a wave that follows something unusual, the region checks that everything inside rests and that no
  member could pass activity on. From then on, the output barrier of the head stands for those of all members: a token
  that has left the region counts at the head (`Edge.waits`), because no member can fire again until it is processed
  (F5).
- **disturb**: whoever changes what a wave takes for granted (blocks a member, makes it active, waits for it) says so
  to the worker, and the region is disarmed: what the members would say is written down, and the interpreted way goes
  on.
- **side exit**: when a call brings what is not plain (an error, a token, code that waits) or a flag is up, the wave
  ends after that call: the values in the locals are put on the edges, the nodes that these enable go to the front of
  the run queue, and the current firing is finished like any other.
- **turns**: turns of others during a wave, and activity that moves in it, do not end it; see `turns`.
- **dissolve**: whenever the wiring or the observers of a member change, `specialise` dissolves the region.

Counts follow from the number of waves; readers have them settled first. Depends on `exits` and `writing`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import CodeType, FrameType

from typing_extensions import override

from hfg.base.token import END
from hfg.engine.fusion.binding import Wave, bind
from hfg.engine.fusion.exits import Exits
from hfg.engine.fusion.schedule import Schedule
from hfg.engine.fusion.writing import Writer
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import agenda, firing
from hfg.engine.rules.releasing import release
from hfg.ports.edges import SyncEdge

__all__ = ["Region"]


class Region(Exits):
    """A head and the nodes that fire after it in one wave.

    Attributes:
      step: what the head's step is while the region lasts.
    """

    def __init__(self, schedule: Schedule, respecialise: Callable[[RunningNode], None]) -> None:
        super().__init__(schedule)
        self._respecialise = respecialise
        self._take_members()
        self._plain = self._write(measured=False)
        metered = all(worker.meter is not None for worker in self.order)  # one that an edit has added has none at first
        self._measured: Wave | None = self._write(measured=True) if metered else None
        self._wave = self._measured or self._plain
        self.step = self._wave.step

    def _take_members(self) -> None:
        for worker in self.order:
            if worker.region is not None:
                worker.region.dissolve()
        for worker in self.order:
            worker.be_fused(self)
        self.core.regions.add(self)

    def _write(self, *, measured: bool) -> Wave:
        return bind(self, Writer(self, measured))

    @override
    def dissolve(self) -> None:
        """Its members are nodes like any others from here on; from within a wave, from its end on."""
        if self.running:
            self.doomed = True
            self._call_off("dissolved")
            return
        self.disarm()
        if self in self.core.regions:
            self.core.regions.discard(self)
            for worker in self.order:
                worker.be_fused(None)
            for worker in self.order:
                self._respecialise(worker)

    # --- before a wave, and behind it -------------------------------------------------------------------------------

    def may_go_on(self) -> bool:
        """Something about the head's next firing is not ordinary: whether it is no more than that values are missing.

        Then the wave sees to that; an END, or what waits in a queue, is for the interpreted way.
        """
        head = self.head
        if head.inputs.missing or not self.takes_turns or not all(type(edge) is SyncEdge for edge in self.entries):
            return False
        if any(edge.token.value is END for edge in self.entries):
            return False
        head.mark_ordinary()
        return True

    def decline(self, worker: RunningNode) -> None:
        """The head's next piece of work is not a plain wave; a slot call does not concern the other members."""
        if worker.fireable and not (worker.calls and worker.calls_before):
            self.disarm()
        firing.step(worker)

    def over(self, done: int) -> None:
        """Waves have run to their end: `done` of them."""
        self.running = False
        self.waves += done
        if self.called_off:  # after the last guard, because of a token that a member has sent
            self.called_off = False
            self.disarm()
        self._over()
        agenda.consider(self.head)
        last = self.order[-1]
        if last.calls and self.schedule.fires_with_slots(len(self.order) - 1) and not last.busy:
            agenda.idle_again(last)

    def _over(self) -> None:
        """Those outside whom the wave has enabled go next, and what the head has taken is processed, if it is (F5)."""
        head, core = self.head, self.core
        if len(self.waiting) == 1 and not self._first:
            self.waiting.popitem()[1].enqueue_in_front()
        elif core.next_in_wave or self.waiting or self._first:
            self.queue_turns(self.schedule.next_in_wave)
        if head.outputs.missing or head.inputs.missing:
            head.drop_firing()  # tokens that came while the wave ran gave it a place; F1 does not hold after the wave
        if head.outputs.missing:
            head.hold(self.held_entries)
        elif self.held_entries:
            self._let_all_go(head)
        if self.doomed:
            self.dissolve()
        elif self._wave is self._measured and all(worker.meter.left <= 0 for worker in self.order):
            self._go_by(self._plain)

    def _let_all_go(self, head: RunningNode) -> None:
        """Nothing the head has sent is waited for, so what it took is processed (F5)."""
        if len(self.order) > 1:  # the later members freed its outputs, when its own firing was over
            agenda.consider(head)
            release(self.held_entries)
        elif self.ending:  # an END that follows must find the head busy, so that the end of the firing enables it (F1)
            head.be_in_wave()
            release(self.held_entries)
            agenda.idle_again(head)
        else:
            release(self.held_entries)

    def measure_on(self) -> None:
        """Measurements have been read: measure the next waves; one may be in progress."""
        if self._measured is not None and self.head.step is self.step:
            self._go_by(self._measured)

    def _go_by(self, wave: Wave) -> None:
        self._wave = wave
        self.step = wave.step
        self.head.use_step(wave.step)

    # --- who is at work ----------------------------------------------------------------------------------------------

    def at_work(self, frame: FrameType | None) -> RunningNode | None:
        """Whose call a running wave is in, by the line it is at; None if the frames are of something else."""
        codes = [wave.code for wave in self._waves()]
        while frame is not None:
            if frame.f_code in codes:
                k = self.called_at(frame.f_code, frame.f_lineno)
                return None if k is None else self.order[k]
            frame = frame.f_back
        return None

    @override
    def called_at(self, code: CodeType, line: int) -> int | None:
        """Which member a line calls. The current wave may have another text than the next, see `measure_on`."""
        return next((wave.calls.get(line) for wave in self._waves() if wave.code is code), None)

    def _waves(self) -> list[Wave]:
        return [wave for wave in (self._plain, self._measured) if wave is not None]

    def is_calling(self, worker: RunningNode) -> bool:
        """Whether a running wave is in the call of this member."""
        return self.running and self.at_work(sys._getframe(1)) is worker  # noqa: SLF001 - of frames nobody else knows

    def is_sending(self, worker: RunningNode) -> bool:
        """A member sends by itself, which a plain call does not: whether it is the one whose call runs.

        The wave ends after this call, and the next region says before each call of the member that it runs.
        """
        if self.schedule.position[worker] in self.schedule.called or not self.is_calling(worker):
            return False  # (what a slot handler may not do is for others to say)
        worker.mark_sends_itself()
        self.doomed = True
        self._call_off("sends")
        return True

    def abandon(self) -> RunningNode:
        """The current wave does not come back; one on the loop always does."""
        return self.head
