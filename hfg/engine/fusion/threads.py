"""Regions of a thread group: a whole wave is one job of the group's thread, one hand-over instead of one per hop.

The head's step takes the tokens on the loop. The thread calls the members one after the other, as `writing` says, with
values in locals. Back on the loop, the region puts the tokens that leave it, or takes the side exit. All members are
busy during the wave. An edit that needs one of them ends the wave after its present call, so it waits for at most one
firing.

A token that leaves the region during a wave leaves when its firing is over (F3), so that neighbours in other groups run
at the same time. The tokens of the last member come back with the wave.

Depends on `region` and `writing`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import Any, NamedTuple

from typing_extensions import override

from hfg.base.token import NO_MESSAGE
from hfg.engine.fusion.binding import Fusible, Wave, bind
from hfg.engine.fusion.region import Region
from hfg.engine.fusion.schedule import Schedule
from hfg.engine.fusion.writing import Writer
from hfg.engine.model.flags import Flags
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import firing
from hfg.engine.rules.agenda import consider, idle_again, queue_next_in_wave
from hfg.engine.rules.putting import put
from hfg.engine.rules.releasing import make_room, release
from hfg.ports.edges import ACTIVITY, SyncEdge

__all__ = ["SOONER_IN_THREADS", "ThreadRegion"]

SOONER_IN_THREADS = 12
"""By so much earlier than on the loop a region pays: a hand-over costs as much as that many calls."""

_SLICE_S = 0.005  # how long a source may go on in its thread before the loop hears of it

_Sending = tuple[int, float, tuple[Any, ...]]
"""The member, the stamp, and a value for each of its edges over the border; None is NO_MESSAGE."""


class _Left(NamedTuple):
    """A wave has ended after the call of member k: its result or error, and the locals."""

    k: int | None
    found: dict[str, Any]
    result: Any = None
    error: BaseException | None = None


class _InThread:
    """The methods that the text of a wave calls in the thread; the loop reads the outcome afterwards."""

    def __init__(self, region: ThreadRegion) -> None:
        self.order = region.order
        self.silent = [0] * len(region.order)
        self.spread = [0] * len(region.order)
        self.sent: list[_Sending] = []  # what is to be put when the wave is back
        self._region = region
        self._group: Any = region.head.group

    def sends(self, k: int, stamp: float, values: tuple[Any, ...]) -> None:
        """The firing of member k is over, others follow."""
        self._group.signal(partial(self._region.put_border, k, stamp, values))

    def sends_last(self, k: int, stamp: float, values: tuple[Any, ...]) -> None:
        """The last firing is over."""
        self.sent.append((k, stamp, values))

    def over(self, done: int) -> int:
        """Waves have run to their end: `done` of them."""
        return done

    def leave(self, k: int, found: dict[str, Any]) -> _Left:
        """Something about the firing of member k is not plain."""
        return _Left(k, found, found[f"r{k}"] if f"r{k}" in found else found[f"v{k}_0"])

    def caught(self, error: BaseException, found: dict[str, Any]) -> _Left:
        """A call has raised; the line says which one."""
        traceback: Any = error.__traceback__
        k = self._region.called_at(traceback.tb_frame.f_code, traceback.tb_lineno)
        return _Left(k, found, None, error)


class ThreadRegion(Region):
    """A head and the nodes that fire after it in one wave, in the thread of their group.

    Attributes:
      flags: if not empty, the current wave ends after its present call; the thread checks it.
    """

    def __init__(self, schedule: Schedule, respecialise: Callable[[RunningNode], None]) -> None:
        self._thread: Any = None
        super().__init__(schedule, respecialise)
        self.step = self._fire
        self._carries = self.head in self.activity_senders
        self._speaking = [worker for worker in self.order if not worker.silent_code]
        self._seeing = [self.head, *(worker for worker in self._speaking if worker is not self.head)]
        self._over_border = [[edge for edge, _, to in out if to is None] for out in schedule.outs]
        self._measuring = self._measured is not None

    @override
    def _write(self, *, measured: bool) -> Wave:
        if self._thread is None:
            self.flags = Flags()
            self._thread = _InThread(self)
        return bind(self, _ThreadWriter(self, measured), to=self._thread)

    # --- a wave -----------------------------------------------------------------------------------------------------

    def _fire(self, head: RunningNode) -> None:
        """Take the tokens and let the thread go on from there."""
        if not self._may_begin():
            self.decline(head)
            return
        head.use_turn()
        arguments: list[Any] = list(head.unset)
        tokens = [(edge, firing.take(edge)) for edge in self.entries]
        for edge, token in tokens:
            arguments[edge.position] = token.value
        stamp = self.core.now() if head.is_source else max(token.stamp for _, token in tokens)
        for worker in self.order:
            worker.be_in_wave("firing")  # each may be the one whose call is in progress: only the thread knows
        for worker in self._speaking:
            worker.send_as(stamp)
        for edge in self.entries:
            make_room(edge)
        if head.paced:
            head.rate.start(self.core.now(), head.options.max_rate_hz)
        self._wave = (self._measured if self._measuring else None) or self._plain
        self.flags.clear()
        self.called_off = False
        self.running = True
        self.core.code.execute_wave(self._seeing, self._wave.step, (head, stamp, *arguments), self._back)

    def _may_begin(self) -> bool:
        """Whether the head's next piece of work is a plain wave."""
        head = self.head
        if head.special or head.busy or not head.fireable or (self._carries and head.active):
            return False
        plain = self._source_is_open() if head.is_source else self._all_plain()
        return plain and (self.armed or self.arm())

    def _source_is_open(self) -> bool:
        return self.head.type.process_kind != "generator" or self.head.execution.generator is not None

    def _all_plain(self) -> bool:
        """Each entry holds a token, and none of them moves activity."""
        if self.head.inputs.missing:
            return False
        for edge in self.entries:
            if type(edge) is SyncEdge:
                if edge.token.activity:  # type: ignore[union-attr]  # no input is missing
                    return False
            elif not edge.live or edge.queue[0][ACTIVITY]:
                return False
        return True

    def put_border(self, k: int, stamp: float, values: tuple[Any, ...]) -> None:
        """Put the tokens that member k has sent over the border on their edges, if those still exist."""
        core = self.core
        since = len(core.next_in_wave)
        for edge, value in zip(self._over_border[k], values, strict=True):
            if edge.live:
                put(edge, NO_MESSAGE if value is None else value, 0, stamp)
        queue_next_in_wave(core, since)
        if self.head.outputs.missing:
            self.head.drop_firing()

    def _back(self, outcome: int | _Left, error: BaseException | None) -> None:
        """The wave is over, or has ended after one of its calls; on the loop."""
        if error is not None:
            raise error  # a fault of ours
        self._rest()
        if self.core.over:
            self._too_late(outcome)
            return
        sent, self._thread.sent = self._thread.sent, []
        for sending in sent:
            self.put_border(*sending)
        if isinstance(outcome, _Left):
            self._exit(outcome)
        else:
            self._waves_are_over(outcome)

    def _rest(self) -> bool:
        """No code is running any more; edits may have all members except the head."""
        for worker in self.order[1:]:
            worker.rest()
        for worker in self._speaking:
            worker.leave()
            if worker is not self.head:  # whose own was the one in flight
                worker.leave_job()
        thread = self._thread
        if any(thread.silent) or any(thread.spread):
            for number in range(len(self.order)):
                self.silent[number] += thread.silent[number]
                self.spread[number] += thread.spread[number]
                thread.silent[number] = thread.spread[number] = 0
        return False

    def _waves_are_over(self, done: int) -> None:
        head = self.head
        self.running = False
        self.waves += done
        if head.outputs.missing:
            head.drop_firing()
            head.hold(self.held_entries)
        elif self.held_entries:
            if not self.flags:  # the later members free its outputs, which releases the tokens that it took
                head.rest()
                if head.fireable:
                    head.enqueue()
                else:
                    consider(head)
            release(self.held_entries)
        if self.flags:  # which were raised too late for this wave
            self.disarm()
        if self._measuring and all(worker.meter.left <= 0 for worker in self.order):
            self._measuring = False
        self._end()
        idle_again(head)

    def _end(self) -> None:
        """Those who have come to a member while it was busy have their turn."""
        if self.doomed:
            self.dissolve()
        if self.flags:
            for worker in self.order[1:]:
                if not worker.busy:
                    idle_again(worker)

    def _exit(self, left: _Left) -> None:
        """The current firing ends like any other, and the later members fire one by one."""
        k, error, head = left.k, left.error, self.head
        if k is None:
            self.running = False
            assert error is not None
            raise error  # a fault of ours
        if error is None and not self.flags:
            self._note_exit(k)
        head.rest()
        worker = self.materialise(k, left.found)
        if head.outputs.missing:
            head.drop_firing()
        firing.when_done(worker)(left.result, error)
        self._end()
        if worker is not head and not head.busy:
            idle_again(head)

    @override
    def materialise(self, k: int, found: dict[str, Any]) -> RunningNode:
        worker = super().materialise(k, found)
        self.core.running_node = None  # no node's code runs on the loop
        return worker

    def _too_late(self, outcome: int | _Left) -> None:
        """The run is over: the wave is counted, and its results are ignored."""
        if not isinstance(outcome, _Left):
            self.running = False
            self.waves += outcome
        elif outcome.k is not None:
            self.materialise(outcome.k, outcome.found)

    # --- from outside -----------------------------------------------------------------------------------------------

    @override
    def measure_on(self) -> None:
        self._measuring = self._measured is not None

    @override
    def is_sending(self, worker: RunningNode) -> bool:
        """A member that sends during a wave is busy; this one is not, so no fused call of it is in progress."""
        return False

    @override
    def abandon(self) -> RunningNode:
        """The current wave does not come back. Return the member whose call it is in; those before it have fired."""
        group: Any = self.head.group
        frame = self._frame(sys._current_frames().get(group.thread_id()))  # noqa: SLF001 - as above: of frames
        k = self._wave.calls.get(frame.f_lineno, 0) if frame is not None else 0
        self._rest()
        if frame is None:
            self.running = False
            return self.head
        return self.materialise(k, dict(frame.f_locals))

    def _frame(self, frame: FrameType | None) -> FrameType | None:
        while frame is not None and frame.f_code is not self._wave.code:
            frame = frame.f_back
        return frame


class _ThreadWriter(Writer):
    """Writes a wave that is called in the thread: the loop has taken the tokens, and puts what crosses the border."""

    def __init__(self, region: Fusible, measured: bool) -> None:
        super().__init__(region, measured)
        self.loops = self.real and self.is_source and not self.head.paced and not self.has_border

    @override
    def _sends_itself(self, worker: RunningNode) -> bool:
        return not worker.silent_code  # all members are busy, so its code may send: look whether it has

    @override
    def _entrance(self) -> None:
        arguments = [f"a{at}" for at in range(len(self.head.unset))]
        self.say(f"def wave({', '.join(['worker', 'stamp', *arguments])}):")
        self.indent = 2
        self._nonlocal()
        self._register()
        self.say("done = 0")
        if self.is_generator:
            self.say("generator = worker.execution.generator")
        if self.loops:
            self.say(f"until = monotonic() + epoch + {_SLICE_S}")

    @override
    def _head(self) -> None:
        if self.is_source:
            if self.loops:
                self.say("stamp = monotonic() + epoch")
            self._call(0, "next(generator)" if self.is_generator else "f0()", within=False)
        else:
            self._call(0, f"f0({', '.join(f'a{at}' for at in range(len(self.head.unset)))})", within=False)

    @override
    def _announce(self, k: int) -> None:
        pass  # all members say so from the beginning of the wave on

    @override
    def _finish(self, k: int) -> None:
        pass  # and until its end

    @override
    def _spread_out(self, k: int) -> None:
        say, outputs = self.say, self.order[k].out_names
        say(f"if flags: return region.leave({k}, locals())")
        if outputs:
            say(f"values = values_of(region, {k}, r{k})", k)
            say(f"if values is None: return region.leave({k}, locals())")
        else:
            say(f"if r{k} is not None: return region.leave({k}, locals())")
        for output in range(len(outputs)):
            say(f"v{k}_{output} = values[{output}]")

    @override
    def _put(self, k: int, *, silent: bool = False) -> None:
        values = [f"v{k}_{output}" for _, output, to in self.outs[k] if to is None]
        if values:
            sends = "sends" if k < len(self.order) - 1 else "sends_last"
            self.say(f"region.{sends}({k}, stamp, ({', '.join(values)},))")

    @override
    def _end_of_wave(self) -> None:
        self.say("done += 1")
        if self.loops:
            self.say("if queue or flags or worker.blocked or stamp > until: break")
