"""A fused region: nodes whose firings run as one generated function a wave, with values in locals.

*Operator fusion* with *guards* and *side exits*, as in a tracing JIT. Inside of a wave there are no tokens, barriers or
run queues; outside of one the members look as the rules leave them. What keeps that true:

- **arm**: before a wave that follows something unusual one looks whether everything inside rests and nobody there
  could pass activity on. From then on the output barrier of the head stands for those of all members: a token that has
  left the region counts at the head (`Edge.waits`), for until it is processed no member can fire again anyway (F5).
- **disturb**: whoever changes what a wave takes for granted (blocks a member, makes it active, waits for it) says so
  to the worker, and the region is disarmed: what the members would say is written down, and the interpreted way goes
  on.
- **side exit**: when a call brings what is not plain (an error, a token, code that waits) or a flag is up, the wave
  ends behind that call: what the locals hold is put on the edges, who is enabled by it in front of the run queue, and
  the firing under way is finished as any other.
- **give way**: async code that only lets others have a turn (`sleep(0)`) goes on within its wave. Until the wave is
  over all members are busy, as in a thread: who wants one of them waits, and calls the wave off behind its present
  call.
- **dissolve**: whenever wiring or somebody's interest changes, `specialise` is asked, and the region is gone.

Counts follow from the number of waves; who reads them has them settled first. Stands on `schedule` and `writing`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Sequence
from types import CodeType, CoroutineType, FrameType
from typing import Any

from hfg.base.token import NO_MESSAGE, Token
from hfg.engine.fusion.schedule import Schedule
from hfg.engine.fusion.tap_writing import emit_rest
from hfg.engine.fusion.writing import Wave, Writer, write_wave
from hfg.engine.model.core import PENDING, Flags
from hfg.engine.model.running_node import NO_CALLS, RunningNode
from hfg.engine.rules import agenda, calls, errors, firing
from hfg.engine.rules.releasing import release
from hfg.errors import EngineInternalError
from hfg.ports.edges import EventEdge, SyncEdge

__all__ = ["Region"]

_MOST_EXITS = 16  # by one member, before it is asked whether they are the rule


_LONGEST_PUT_OFF = 255  # waves for which a region that cannot be armed does not ask again


def _rests(worker: RunningNode, called: bool) -> bool:
    """Whether nothing is under way at a member, nothing lies before it, and nothing forbids its next firing or call."""
    blocked = worker.blocked >= NO_CALLS if called else worker.blocked
    if blocked or worker.busy or worker.fireable or worker.queued or worker.calls or worker.idle_callbacks is not None:
        return False
    if worker.outputs.missing or worker.pending_end:
        return False
    return called or worker.inputs.missing == len(worker.live_inputs)


class Region:
    """A head and those that fire behind it in one wave.

    Attributes:
      head: whose step runs a wave.
      schedule: the members in their order, and the edges between them.
      step: what the head's step is while the region lasts.
      armed: everything inside rests, or a wave runs.
      running: a wave is under way.
      amid: "", or "wave" while the wave under way has given way to others and all members are busy.
      called_off: the wave that has given way ends behind its present call; the flags are cleared meanwhile.
      flags: not empty: the wave under way ends behind its present call.
      ending: some producer before the head sends END as soon as its outputs are free.
    """

    def __init__(self, schedule: Schedule, respecialise: Callable[[RunningNode], None]) -> None:
        self.schedule = schedule
        self.order = order = schedule.order
        self.head = head = order[0]
        self.core = head.core
        self.flags: Flags = self.core.flags
        self.entries: tuple[Any, ...] = head.live_inputs
        self.held_entries = tuple(edge for edge in self.entries if type(edge) is not EventEdge and edge.sequential)
        self.inner = [edge for out in schedule.outs for edge, _, to in out if to is not None]
        self.border = [edge for out in schedule.outs for edge, _, to in out if to is None]
        self.activity_senders = [worker for worker in order if any(edge.active for edge in worker.all_out_edges())]
        self.armed = False
        self.running = False
        self.doomed = False
        self.amid = ""
        self.called_off = False
        self.detached = False  # the call under way waits, and goes on as a firing like any other
        self._coroutine: Any = None  # of the wave that has waited
        self._after: Callable[[Any, BaseException | None], None] | None = None
        self._may_give_way = schedule.may_give_way()
        self._lender = next((worker for worker in order if worker.is_async), None)
        self._put_off = self._patience = 0  # waves before one asks again whether it may be armed
        self.ending = any(edge.source.pending_end for edge in self.held_entries)
        self.waves = 0  # not yet in the counts of members and edges
        self.silent = [0] * len(order)  # silent firings, likewise
        self.spread = [0] * len(order)  # how often all behind a member were silent since it was
        self._exits = [0] * len(order)
        self._formed_at = head.counts.firings
        self._respecialise = respecialise
        self._take_members()
        self._plain = self._write(measured=False)
        metered = all(worker.meter is not None for worker in order)  # one that an edit has added has none at first
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
        return write_wave(self, Writer(self, measured))

    # --- armed or not -----------------------------------------------------------------------------------------------

    def arm(self) -> bool:
        """Before a wave that follows something unusual: does everything inside rest, and would no activity move?

        Where the answer is no again and again (a node that stays active before an active edge), asking is put off.
        """
        if self._put_off:
            self._put_off -= 1
            return False
        called = self.schedule.called
        rests = not self.doomed and not self.head.outputs.missing
        rests = rests and not any(one.active for one in self.activity_senders)
        if not rests or not all(_rests(one, k in called) for k, one in enumerate(self.order) if k):
            self._put_off = self._patience
            self._patience = min(2 * self._patience + 1, _LONGEST_PUT_OFF)
            return False
        self._patience = 0
        for edge in self.border:
            edge.waits = self.head
        self.armed = True
        return True

    def check_invariants(self) -> None:
        """While it is armed everything inside rests, and what has left it counts at the head.

        Raises:
          EngineInternalError: it does not.
        """
        if not self.armed or self.running:
            return
        for k, worker in enumerate(self.order):
            if k and not _rests(worker, k in self.schedule.called):
                raise EngineInternalError(f'node "{worker.path}": its region is armed, but it does not rest')
        for edge in self.inner:
            if edge.token is not None or edge.unprocessed:
                raise EngineInternalError(f'edge "{edge.label}": its region is armed, but a token is on it')
        for edge in self.border:
            if edge.waits is not self.head:
                raise EngineInternalError(
                    f'edge "{edge.label}": its region is armed, but the head does not answer for it'
                )

    def disarm(self) -> None:
        """The interpreted way goes on: write down what finished waves still wait for, where that way looks for it."""
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

    def expect_end(self) -> None:
        """Before it a node is over, and END comes as soon as what it has sent is processed."""
        self.ending = True

    def interrupt(self) -> None:
        """The run is paused, or over: let the wave under way end behind its present call."""
        if self.running:
            self._call_off("interrupted")

    def _call_off(self, why: str) -> None:
        """Let the wave under way end behind its present call."""
        if self.amid:
            self.called_off = True
        else:
            self.flags.append(why)

    def abandon(self) -> RunningNode:
        """The wave that has given way does not come back: whose call it is in; those before it have fired."""
        if not self.amid:
            return self.head  # a wave on the loop always comes back
        k, found = self._place()
        self._rest()
        self.detached = True
        return self.materialise(k, found)

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

    def decline(self, worker: RunningNode) -> None:
        """The head's next piece of work is not a plain wave."""
        self.disarm()
        firing.step(worker)

    # --- counts -----------------------------------------------------------------------------------------------------

    def settle_counts(self) -> None:
        """Each member has fired once a wave, and each inner edge has carried one token."""
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

    # --- the end of a wave --------------------------------------------------------------------------------------------

    def over(self, done: int) -> None:
        """So many waves have run to their end."""
        self.running = False
        self.waves += done
        head, core = self.head, self.core
        if self.amid and core.over:
            return  # nobody hears of it any more
        gave_way, called_off = bool(self.amid), self.called_off
        if gave_way:
            self._rest()
        if core.next_in_wave:
            self._queue_next_in_wave(self.schedule.next_in_wave)
        if head.outputs.missing or head.inputs.missing:
            head.drop_firing()  # what came in while the wave ran gave it a place; F1 does not hold behind the wave
        if head.outputs.missing:
            head.hold(self.held_entries)
        elif self.held_entries:
            self._let_go(head)
        if self.doomed:
            self.dissolve()
        elif self._wave is self._measured and all(worker.meter.left <= 0 for worker in self.order):
            self._go_by(self._plain)
        if gave_way:
            agenda.idle_again(head)
            self._go_on(called_off)
        else:
            agenda.consider(head)

    def _let_go(self, head: RunningNode) -> None:
        """Nothing the head has sent is waited for, so what it took is processed (F5)."""
        if len(self.order) > 1:  # those behind it freed its outputs, when its own firing was over
            agenda.consider(head)
            release(self.held_entries)
        elif self.ending:  # the END that may come of it finds the head amid its firing, and enables it by its end (F1)
            head.be_in_wave()
            release(self.held_entries)
            agenda.idle_again(head)
        else:
            release(self.held_entries)

    def measure_on(self) -> None:
        """What was measured has been read: measure the next waves; one may be under way."""
        if self._measured is not None and self.head.step is self.step:
            self._go_by(self._measured)

    def _go_by(self, wave: Wave) -> None:
        self._wave = wave
        self.step = wave.step
        self.head.use_step(wave.step)

    def _queue_next_in_wave(self, candidates: Sequence[RunningNode]) -> None:
        """Those outside whom the wave has enabled go next, in the order R2 prescribes."""
        core, next_in_wave = self.core, self.core.next_in_wave
        if len(next_in_wave) > 1:
            place = {worker: number for number, worker in enumerate(candidates)}
            next_in_wave.sort(key=place.__getitem__)
        core.ran_next += len(next_in_wave)
        for worker in reversed(next_in_wave):
            worker.push_next(worker)
        next_in_wave.clear()

    # --- side exits -------------------------------------------------------------------------------------------------

    def leave(self, k: int, found: dict[str, Any]) -> object:
        """Something about the firing of member k is not plain: what it gave back, or what happened meanwhile."""
        result = found[f"r{k}"] if f"r{k}" in found else found[f"v{k}_0"]
        if self.detached:
            self.detached = False
            return result  # of the coroutine that has waited, so that it comes back as its firing's
        if not (self.flags or self.called_off):
            self._note_exit(k)
        gave_way = bool(self.amid)
        self._rest()
        worker = self.materialise(k, found)
        if gave_way and self.core.over:
            return None  # nobody hears of it any more
        if k not in self.schedule.called:
            firing.complete_firing(worker, result)
        elif type(result) is CoroutineType:
            calls.await_call(worker, worker.call_edge.port_name, result)
        else:
            calls.finish_call(worker, "done")
        self._left(gave_way)
        return None

    def caught(self, error: BaseException, found: dict[str, Any]) -> None:
        """Which call has raised is told by its line, so it costs nothing until it happens.

        Raises:
          BaseException: what is no error of a node (Ctrl-C, and what ends a task or the program).
        """
        if self.detached:
            self.detached = False
            raise error
        gave_way = bool(self.amid)
        self._rest()
        traceback: Any = error.__traceback__
        k = self.called_at(traceback.tb_frame.f_code, traceback.tb_lineno)
        if k is None:
            self.running = False
            raise error  # a fault of ours
        worker = self.materialise(k, found)
        if gave_way and (self.core.over or isinstance(error, GeneratorExit)):
            raise error
        if isinstance(error, Exception) and k in self.schedule.called:
            errors.fail_call(worker, worker.call_edge.port_name, error)
        elif isinstance(error, Exception) or (gave_way and not isinstance(error, KeyboardInterrupt)):
            firing.when_done(worker)(None, error)
        else:
            self._left(gave_way)
            raise error
        self._left(gave_way)

    def _left(self, gave_way: bool = False) -> None:
        if self.doomed:
            self.dissolve()
        if gave_way and not self.core.over:
            self._go_on(called_off=True)

    def _note_exit(self, k: int) -> None:
        """A member that is hardly ever plain is none: the region forms anew without it."""
        self._exits[k] += 1
        waves = self.head.counts.firings + self.waves - self._formed_at
        if self._exits[k] >= _MOST_EXITS and self._exits[k] * 8 > waves:
            self.order[k].fit_no_more()
            self.doomed = True

    def materialise(self, k: int, found: dict[str, Any]) -> RunningNode:
        """Members before k have fired and k is amid its firing: let the interpreted way see it so."""
        self.waves += found["done"]
        self.settle_counts()
        emit_rest(self._wave.untold.get(k, ()), found, self.core.now)
        self.armed = self.running = False
        stamp = found["stamp"]
        silent_calls: set[SyncEdge] = set()
        for j in range(k):
            self._count(self.order[j], j in self.schedule.called)
            for edge, output, to in self.schedule.outs[j]:
                if to is None or (to > k and not edge.live):  # one end was disabled meanwhile: it goes nowhere (F10)
                    continue
                edge.sent += 1
                if to > k and not self._lay(edge, to, found.get(f"v{j}_{output}"), stamp):
                    silent_calls.add(edge)
        self._write_barriers(k, silent_calls)
        worker = self.order[k]
        if k in self.schedule.called:
            worker.begin_call(worker.slot_edges[0], stamp)
        else:
            worker.resume_as_firing(worker.live_inputs if k else self.held_entries, stamp)
        self._queue_behind(k)
        self.core.running_node = worker
        return worker

    def _lay(self, edge: SyncEdge, to: int, value: object, stamp: float) -> bool:
        """Put what a local holds on the edge to member `to`; a slot is not called by a marker (T4)."""
        target, called = self.order[to], to in self.schedule.called
        if value is None and called:
            return False
        edge.token = Token(NO_MESSAGE if value is None else value, 0, stamp, edge.sent)
        if called:
            target.expect_call(edge)
        else:
            target.inputs.missing -= 1
            if value is None:
                target.mark_special()
        return True

    def _count(self, worker: RunningNode, called: bool) -> None:
        """It has fired, or was called, in the wave that does not come to its end; its silence is counted already."""
        if called:
            worker.counts.add_calls(1)
        else:
            worker.counts.add_firings(1)

    def _queue_behind(self, k: int) -> None:
        """Who stands behind member k is enabled by now, or by an outside edge that was waited for (R2)."""
        behind = self.schedule.behind[k]
        for worker in behind:
            if worker in self.schedule.position and (worker.calls or agenda.make_fireable(worker)):
                worker.run_after_wave()
        self._queue_next_in_wave(behind)

    def _write_barriers(self, k: int, silent_calls: Collection[SyncEdge] = ()) -> None:
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
            done[j] = not missing

    # --- code that waits --------------------------------------------------------------------------------------------

    def start(self, waves: CoroutineType[Any, Any, Any]) -> None:
        """Run a wave in which there is async code, with the identity of a task: once a wave, not once a call.

        A call that really waits becomes a firing like any other; the wave's coroutine stays around it.
        """
        eager_task: Any = self._lender.execution.eager_task  # type: ignore[union-attr]  # there is async code
        self._coroutine = waves
        if eager_task.start(waves, self._late, self._detach) is PENDING and not self.detached:
            if self._may_give_way:
                self._give_way()
            else:
                self._detach()

    def _give_way(self) -> None:
        """The wave has given way to others: its members are busy until it is over."""
        lender: Any = self._lender
        self.amid = "wave"
        self.called_off = bool(self.flags)  # raised by the call before it gave way; the flags are cleared meanwhile
        for worker in self.order:
            if worker.busy != "firing":  # else its call, under way, was announced
                worker.be_in_wave(self.amid)
        code = self.core.code
        lender.begin_async()
        self._after = code.late(lender, _nothing_more)
        self.sent_on()
        self.core.running_node = None

    def sent_on(self) -> None:
        """What has left the wave that gives way is on its way, and the head waits for it."""
        if self.core.next_in_wave:
            self._queue_next_in_wave(self.schedule.next_in_wave)
            self.core.runtime.kick()
        if self.head.outputs.missing:
            self.head.drop_firing()

    def _detach(self) -> None:
        """The call under way waits for more than its turn: from here on it is a firing like any other."""
        if self.detached:
            return  # it was told before
        lender: Any = self._lender
        k, found = self._place()
        worker = self.order[k]
        gave_way = bool(self.amid)
        if gave_way:
            lender.end_async()
            self._rest()
        worker.execution.exchange(lender.execution)  # whoever cancels the node means this code
        self.detached = True
        self._note_exit(k)
        self.materialise(k, found)
        code = self.core.code
        worker.begin_async()
        self._after = code.late(worker, firing.when_done(worker))
        self._left(gave_way)
        if gave_way:
            self.core.runtime.kick()

    def _place(self) -> tuple[int, dict[str, Any]]:
        """The member in whose call the wave waits, and what its locals hold."""
        frame = self._coroutine.cr_frame
        k = self.called_at(frame.f_code, frame.f_lineno)
        assert k is not None
        return k, dict(frame.f_locals)

    def _rest(self) -> None:
        """The wave does not give way any more: nobody's code is under way but that of the present call, if any."""
        if self.amid:
            self.amid = ""
            self.called_off = False
            for worker in self.order:
                worker.rest()
            if (
                len(self.order) > 1
            ):  # what came in meanwhile gave it a place, or time to start; it waits for the wave (F5)
                self.head.drop_firing()

    def _go_on(self, called_off: bool) -> None:
        """Those who have come to a member while it was busy have their turn."""
        if called_off:
            for worker in self.order:
                if not worker.busy:
                    agenda.idle_again(worker)

    def _late(self, result: object, error: BaseException | None) -> None:
        after, self._after = self._after, None
        assert after is not None
        after(result, error)

    # --- who is at work ----------------------------------------------------------------------------------------------

    def at_work(self, frame: FrameType | None) -> RunningNode | None:
        """Whose call a running wave is in, by the line it is at; None if the frames are of something else."""
        codes = [wave.code for wave in self._waves()]
        while frame is not None:
            if frame.f_code in codes:
                return self.order[self.called_at(frame.f_code, frame.f_lineno) or 0]
            frame = frame.f_back
        return None

    def called_at(self, code: CodeType, line: int) -> int | None:
        """Which member a line calls. The wave under way need not be the one that is next, see `measure_on`."""
        return next((wave.calls.get(line) for wave in self._waves() if wave.code is code), None)

    def _waves(self) -> list[Wave]:
        return [wave for wave in (self._plain, self._measured) if wave is not None]

    def is_calling(self, worker: RunningNode) -> bool:
        """Whether the call of this member is the one under way in a running wave."""
        if self.amid:  # its own tasks may ask while it waits for its turn
            frame = self._coroutine.cr_frame
            k = None if frame is None else self.called_at(frame.f_code, frame.f_lineno)
            return k is not None and self.order[k] is worker
        return self.running and self.at_work(sys._getframe(1)) is worker  # noqa: SLF001 - of frames nobody else knows

    def is_sending(self, worker: RunningNode) -> bool:
        """A member sends by itself, which a plain call does not: whether it is the one whose call runs.

        It leaves the wave behind this call, and the next region says before each of its calls that it runs.
        """
        if worker.slot_edges or not self.is_calling(worker):  # (what a slot handler may not do is for others to say)
            return False
        worker.mark_sends_itself()
        self.doomed = True
        self._call_off("sends")
        return True


def _nothing_more(result: Any, error: BaseException | None) -> None:
    """The coroutine of a wave that has given way is over: it has seen to everything itself."""
    if error is not None:
        raise error
