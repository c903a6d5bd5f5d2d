"""Regions with async members: code that only lets others have a turn (`sleep(0)`) goes on within its wave.

Until the wave is over all members are busy, as in a thread: who wants one of them waits, and calls the wave off behind
its present call. Code that waits for more becomes a firing like any other. No outsider has a turn amid such a wave.

Stands on `region`.
"""

from __future__ import annotations

from collections.abc import Callable
from types import CoroutineType
from typing import Any

from typing_extensions import override

from hfg.engine.fusion.region import Region
from hfg.engine.fusion.schedule import Schedule
from hfg.engine.model.core import PENDING
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import agenda, firing

__all__ = ["AsyncRegion"]


class AsyncRegion(Region):
    """A head and those that fire behind it in one wave, some of them async.

    Attributes:
      amid: "", or "wave" while the wave under way has given way to others and all members are busy.
      detached: the call under way waits, and goes on as a firing like any other.
    """

    def __init__(self, schedule: Schedule, respecialise: Callable[[RunningNode], None]) -> None:
        self.amid = ""
        self.detached = False
        self._coroutine: Any = None  # of the wave that has waited
        self._after: Callable[[Any, BaseException | None], None] | None = None
        self._may_give_way = schedule.may_give_way()
        self._lender = next(worker for worker in schedule.order if worker.is_async)
        super().__init__(schedule, respecialise)

    @override
    def _call_off(self, why: str) -> None:
        self.called_off = True
        if not self.amid:  # else the flags are those of somebody else
            self.flags.append(why)

    @override
    def abandon(self) -> RunningNode:
        """The wave that has given way does not come back: whose call it is in; those before it have fired."""
        if not self.amid:
            return super().abandon()
        k, found = self._place()
        self._rest()
        self.detached = True
        return self.materialise(k, found)

    @override
    def over(self, done: int) -> None:
        self.running = False
        self.waves += done
        if self.amid and self.core.over:
            return  # nobody hears of it any more
        called_off, self.called_off = self.called_off, False
        gave_way = self._rest()
        self._over()
        if gave_way:
            agenda.idle_again(self.head)
            self._go_on(called_off)
        else:
            agenda.consider(self.head)

    @override
    def leave(self, k: int, found: dict[str, Any]) -> object:
        if self.detached:
            self.detached = False
            return found[f"r{k}"] if f"r{k}" in found else found[f"v{k}_0"]  # as that of its firing
        return super().leave(k, found)

    @override
    def caught(self, error: BaseException, found: dict[str, Any]) -> None:
        if self.detached:
            self.detached = False
            raise error
        super().caught(error, found)

    @override
    def _left(self, gave_way: bool = False) -> None:
        super()._left(gave_way)
        if gave_way and not self.core.over:
            self._go_on(called_off=True)

    def start(self, waves: CoroutineType[Any, Any, Any]) -> None:
        """Run a wave in which there is async code, with the identity of a task: once a wave, not once a call.

        A call that really waits becomes a firing like any other; the wave's coroutine stays around it.
        """
        eager_task: Any = self._lender.execution.eager_task
        self._coroutine = waves
        if eager_task.start(waves, self._late, self._detach) is PENDING and not self.detached:
            if self._may_give_way:
                self._give_way()
            else:
                self._detach()

    def _give_way(self) -> None:
        """The wave has given way to others: its members are busy until it is over."""
        lender = self._lender
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
            self.queue_turns(self.schedule.next_in_wave)
            self.core.runtime.kick()
        if self.head.outputs.missing:
            self.head.drop_firing()

    def _detach(self) -> None:
        """The call under way waits for more than its turn: from here on it is a firing like any other."""
        if self.detached:
            return  # it was told before
        lender = self._lender
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

    @override
    def _rest(self) -> bool:
        """Nobody's code is under way any more but that of the present call, if any."""
        if not self.amid:
            return False
        self.amid = ""
        self.called_off = False
        for worker in self.order:
            worker.rest()
        if len(self.order) > 1:  # what came in meanwhile gave it a place, or time to start; it waits for the wave (F5)
            self.head.drop_firing()
        return True

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

    @override
    def is_calling(self, worker: RunningNode) -> bool:
        if self.amid:  # its own tasks may ask while it waits for its turn
            frame = self._coroutine.cr_frame
            k = None if frame is None else self.called_at(frame.f_code, frame.f_lineno)
            return k is not None and self.order[k] is worker
        return super().is_calling(worker)


def _nothing_more(result: Any, error: BaseException | None) -> None:
    """The coroutine of a wave that has given way is over: it has seen to everything itself."""
    if error is not None:
        raise error
