"""Regions with async members: code that only lets others have a turn (`sleep(0)`) continues within its wave.

All members are busy until the wave is over, as in a thread. An edit that needs one of them calls the wave off, and
waits for its present call. Code that waits for more than its turn becomes a firing like any other. Outsiders have no
turns during such a wave.

Depends on `region`.
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
    """A head and the nodes that fire after it in one wave, some of them async.

    Attributes:
      amid: "", or "wave" while the current wave lets others run and all members are busy.
      detached: the current call waits, and continues as a firing like any other.
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
        if not self.amid:  # else the flags belong to another wave
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
            return  # the run is over and ignores the result
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
        """Run a wave with async code under the identity of one task per wave, not one per call.

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
            if worker.busy != "firing":  # else its current call was announced
                worker.be_in_wave(self.amid)
        code = self.core.code
        lender.begin_async()
        self._after = code.late(lender, _nothing_more)
        self.sent_on()
        self.core.running_node = None

    def sent_on(self) -> None:
        """Tokens have left a wave that lets others run: deliver them; the head waits for them."""
        if self.core.next_in_wave:
            self.queue_turns(self.schedule.next_in_wave)
            self.core.runtime.kick()
        if self.head.outputs.missing:
            self.head.drop_firing()

    def _detach(self) -> None:
        """The current call waits for more than its turn: from here on it is a firing like any other."""
        if self.detached:
            return  # it knows already
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
        """No code is running any more except the present call, if any."""
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
