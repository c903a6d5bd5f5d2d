"""Side exits: a wave ends before its last member, and the members continue one by one.

The values in the wave's locals are put on the edges, the nodes that these enable go to the front of the run queue, and
the current firing is finished like any other. Depends on `turns`.
"""

from __future__ import annotations

from types import CodeType, CoroutineType
from typing import Any

from hfg.base.token import NO_MESSAGE, Token
from hfg.engine.fusion.binding import Wave
from hfg.engine.fusion.tap_writing import emit_rest
from hfg.engine.fusion.turns import Turns
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import agenda, calls, errors, firing
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import put_outputs
from hfg.ports.edges import SyncEdge

__all__ = ["Exits"]

_MOST_EXITS = 16  # by one member, before it is asked whether they are the rule


class Exits(Turns):
    """How a wave is left; the text of a wave calls these methods with its locals."""

    _wave: Wave

    def leave(self, k: int, found: dict[str, Any]) -> object:
        """The firing of member k is not plain because of its result or because something happened meanwhile."""
        result = found[f"r{k}"] if f"r{k}" in found else found[f"v{k}_0"]
        if not (self.flags or self.called_off):
            self._note_exit(k)
        gave_way = self._rest()
        worker = self.materialise(k, found)
        if gave_way and self.core.over:
            return None  # the run is over and ignores the result
        if k not in self.schedule.called:
            firing.complete_firing(worker, result)
        elif type(result) is CoroutineType:
            calls.await_call(worker, worker.call_edge.port_name, result)
        else:
            calls.finish_call(worker, "done")
        self._left(gave_way)
        return None

    def mute(self, k: int, found: dict[str, Any]) -> None:
        """Member k is silent, and enables one at which calls wait, while others have their turns before (F9)."""
        worker = self.materialise(k, found)
        worker.counts.add_silent()
        put_outputs(worker, None)
        firing.finish_firing(worker, "silent")
        self._left()

    def stop(self, p: int, found: dict[str, Any]) -> None:
        """Something has come up before the turn of member p, while no firing is in progress."""
        self._rest()
        self._go_by_rules(p, found)
        self.core.running_node = None
        self.queue_turns((*self.schedule.between.get(p, ()), (self.order[p], None), *self.schedule.behind[p]))
        self._let_go(p)
        self._left()

    def caught(self, error: BaseException, found: dict[str, Any]) -> None:
        """A call has raised. The line says which one, so calls that do not raise pay nothing.

        Raises:
          BaseException: if it is not an error of a node: Ctrl-C, or the end of a task or of the program.
        """
        gave_way = self._rest()
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

    def _rest(self) -> bool:
        """The wave does not give way to others any more: whether it did."""
        return False

    def _left(self, gave_way: bool = False) -> None:
        """The members continue one by one; `gave_way`: the wave had let others run."""
        assert not self.waiting, "who was enabled by the wave stands in the run queue"
        if self.doomed:
            self.dissolve()

    def dissolve(self) -> None:
        """Its members are nodes like any others from here on."""
        raise NotImplementedError

    def called_at(self, code: CodeType, line: int) -> int | None:
        """Which member a line calls."""
        raise NotImplementedError

    def _note_exit(self, k: int) -> None:
        """A member that is rarely plain does not pay: the region forms again without it."""
        self._exits[k] += 1
        waves = self.head.counts.firings + self.waves - self._formed_at
        if self._exits[k] >= _MOST_EXITS and self._exits[k] * 8 > waves:
            self.order[k].fit_no_more()
            self.doomed = True

    def materialise(self, k: int, found: dict[str, Any]) -> RunningNode:
        """Write down that the members before k have fired and that k is firing, as the rules record it."""
        self._go_by_rules(k, found, amid=True)
        worker, stamp = self.order[k], found["stamp"]
        if k in self.schedule.called:
            worker.begin_call(worker.slot_edges[0], stamp)
        else:
            worker.resume_as_firing(worker.live_inputs if k else self.held_entries, stamp)
        self.queue_turns(self.schedule.behind[k])
        if k:
            self._let_go(k)
        self.core.running_node = worker
        return worker

    def _let_go(self, k: int) -> None:
        """No node waits for a member that was disabled meanwhile (F10).

        The members after k may now have all that they wait for; k and the nodes already queued are excluded. The
        head's input tokens are processed unless a token that it sent is unprocessed (F5).
        """
        if self.doomed:
            for worker in self.order[k + 1 :]:
                agenda.consider(worker)
        if not self.head.outputs.missing:
            agenda.consider(self.head)
            release(self.held_entries)

    def _go_by_rules(self, k: int, found: dict[str, Any], *, amid: bool = False) -> None:
        """Write down what lies where when members before k have fired; `amid`: k has taken what lay before it."""
        self.waves += found["done"]
        self.settle_counts()
        emit_rest(self._wave.untold.get(k, ()) if amid else (), found, self.core.now)
        self.armed = self.running = self.called_off = False
        silent_calls: set[SyncEdge] = set()
        for j in range(k):
            if j in self.schedule.called:  # its silence is counted already
                self.order[j].counts.add_calls(1)
            else:
                self.order[j].counts.add_firings(1)
            for edge, output, to in self.schedule.outs[j]:
                if to is None:
                    continue
                edge.sent += 1
                value, carries = found.get(f"v{j}_{output}"), bool(found.get(f"m{j}"))
                if to >= k + amid and not self._lay(edge, to, value, found["stamp"], carries=carries):
                    silent_calls.add(edge)
        self._write_barriers(k, silent_calls)

    def _lay(self, edge: SyncEdge, to: int, value: object, stamp: float, *, carries: bool) -> bool:
        """Put what a local holds on the edge to member `to`; a slot is not called by a marker (T4).

        If one end was disabled since, the token is discarded and counted (F10). A token with activity was on the edge
        already, so the rules have discarded it.
        """
        target, called = self.order[to], to in self.schedule.called
        if value is None and called:
            return False
        if not edge.live:
            if not (carries and edge.active):
                edge.count_dropped()
            return True
        if edge.token is None:  # else it carries activity, and lies there already
            edge.token = Token(NO_MESSAGE if value is None else value, 0, stamp, edge.sent)
        if called:
            target.expect_call(edge)
        else:
            target.inputs.missing -= 1
            if value is None:
                target.mark_special()
        return True
