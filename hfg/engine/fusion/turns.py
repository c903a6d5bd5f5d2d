"""Three things that may happen during a wave without ending it: turns of outsiders, calls of members, moving activity.

The text of a wave is straight-line code for the ordinary case. For rare cases it calls one of these methods, which do
what the rules say and return whether the wave continues. Three ideas make this possible:

- **turns**: an outsider that a member enables stands in front of the run queue by R2, before the members that follow.
  So the wave puts a *turnstile* into the queue, the outsider before it, and works the queue off up to that. That is R2
  by the letter, and one odd node does not break a wave of sixty.
- **calls**: a member with slots takes part in the run queue like any node. The wave sets its `queued` while its firing
  is enabled and others have turns, so that calls which come then have their turn after it; and it checks whether calls
  wait when it enables the firing, for those come first (F9).
- **activity**: what carries +1 lies on its edge as a token, where subgraphs and A14 look for it; the local of the wave
  holds the value all the same.

Depends on `wave_state`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.activity.rules import leaving
from hfg.base.token import NO_MESSAGE, Token
from hfg.engine.fusion.wave_state import Turnstile, WaveState
from hfg.engine.model.running_node import NO_CALLS, RunningNode
from hfg.engine.model.tap import tap_inside
from hfg.engine.rules.firing import receive_modifiers
from hfg.engine.rules.putting import bring_activity, put
from hfg.engine.rules.sending import activity_left, announce, send_automatic, sent

__all__ = ["Turns"]


class Turns(WaveState):
    """The parts of a wave that are not in its text."""

    # --- outsiders --------------------------------------------------------------------------------------------------

    def note(self, k: int, number: int) -> None:
        """What member k has sent over this edge has enabled an outsider: its turn comes where R2 has it."""
        next_in_wave = self.core.next_in_wave
        self.waiting[k, number] = next_in_wave.pop()
        assert not next_in_wave, "one token enables one node"

    def turns(self, p: int) -> bool:
        """Outsiders whose turns come right before member p have them; whether the wave is to stop there."""
        waiting = self.waiting
        for _, key in self.schedule.between[p]:  # noqa: SIM110 - a generator costs more than most of these turns
            if key in waiting and not self._turn(waiting.pop(key)):
                return True
        return False

    def _turn(self, worker: RunningNode) -> bool:
        """It moves now, and all that follows from that over sequential edges; whether the wave may go on."""
        queue: Any = self.head.group.policy
        turnstile = self._turnstile
        queue.appendleft(turnstile)
        if self._work_off(queue, turnstile, worker):
            return True
        while (one := queue.popleft()) is not turnstile:  # which come before all that the wave leaves to the queue
            self._first.append(one)
        return False

    def _work_off(self, queue: Any, until: Any, one: Any) -> bool:
        """Let `one` move, and all that stand before `until` in the run queue then, and take that out.

        Returns:
          Whether the wave may go on; otherwise something has come up, and `until` still stands in the queue.
        """
        head, core, flags = self.head, self.core, self.flags
        group, outputs = head.group, head.outputs
        budget, ran_next = group.budget, core.ran_next
        group.set_budget(1)  # or calls in a row would run past the turnstile
        outputs.expect()  # the head has fired, and its wave is not over: what has left the region does not free it
        goes_on = True
        while one is not until or (one.calls and one.calls_before):
            if type(one) is Turnstile:  # of a wave in which this one is a turn, and which goes first
                queue.appendleft(one)
                goes_on = False
                break
            step = one.step  # calling it as a field would look it up the slow way
            step(one)
            if self.called_off or (flags and core.ends_slice()):
                goes_on = False
                break
            one = queue.popleft()
        outputs.count(outputs.missing - 1)
        group.set_budget(budget)
        core.ran_next = ran_next  # these turns belong to the wave, and the pump has not counted them
        core.running_node = head
        return goes_on

    # --- calls of members -------------------------------------------------------------------------------------------

    def _enable(self, p: int) -> None:
        """Member p is enabled: calls that wait go before its firing, calls that come from now on after it (F9)."""
        if self.order[p].calls:
            self.expect(p)
        else:
            self.order[p].take_place()

    def expect(self, p: int) -> None:
        """Member p is enabled, and calls wait at it: they come before its firing, where they stand (F9)."""
        worker = self.order[p]
        worker.make_fireable()
        worker.run_next()

    def calls_first(self, p: int) -> bool:
        """Calls wait at member p, and it is the next member in the wave. Return whether the wave must stop there.

        All that stands before them in the run queue has its turn as well (R2).
        """
        worker = self.order[p]
        if not worker.fireable:
            self.expect(p)
        queue: Any = self.head.group.policy
        if not self._work_off(queue, worker, queue.popleft()):
            return True
        worker.use_turn()
        return False

    def call_again(self, k: int) -> bool:
        """Member k has fired, and calls wait at it: they have their place now; whether the wave is to stop there."""
        worker = self.order[k]
        goes_next = worker.is_next
        worker.clear_next()
        if worker.blocked >= NO_CALLS:
            return False
        if not goes_next:
            worker.enqueue()
            return False
        worker.take_place()  # its call was enabled over a sequential edge, and goes before all else (R2)
        return not self._turn(worker)

    # --- activity, and what a firing sends by itself ----------------------------------------------------------------

    def receive(self, k: int, stamp: float, doing: str = "wave") -> None:
        """Member k has taken what lay on its active edges (A6)."""
        edges = self.order[k].slot_edges if k in self.schedule.called else self.order[k].live_inputs
        tokens = [edge.take() for edge in edges if edge.token is not None]
        self.receive_at(k, tokens, stamp, doing)

    def receive_at(self, k: int, tokens: Sequence[Token[Any]], stamp: float, doing: str = "wave") -> None:
        """The same for given tokens; from here on the node is busy.

        Busy with a wave, so that `is_sending` still notices code that was not known to send.
        """
        worker = self.order[k]
        worker.be_in_wave(doing)
        worker.send_as(stamp)
        receive_modifiers(worker, [token.activity for token in tokens if token.activity])

    def send(self, k: int, values: Sequence[Any], stamp: float, done: int) -> bool:
        """Member k sends, and activity leaves too, or automatic events follow (A3, A5, A9).

        Args:
          k: the member.
          values: what it sends, by output; None is silence.
          stamp: of the wave.
          done: waves of this run of the text that are over.

        Returns:
          Whether a token with activity lies on one of its edges inside the region.
        """
        worker, core = self.order[k], self.core
        worker.be_in_wave("firing")
        worker.send_as(stamp)
        may_carry, carried, inside = worker.active or worker.may_carry, False, False
        hearing = [heard and heard.who_hear() for heard in worker.listeners]
        for number, (edge, output, to) in enumerate(self.schedule.outs[k]):
            value = NO_MESSAGE if values[output] is None else values[output]
            modifier = leaving(may_carry, edge.active, None, value is NO_MESSAGE)
            carried = carried or modifier > 0
            if to is not None:
                token = Token(value, modifier, stamp, edge.sent + self.waves + done + 1)
                look = tap_inside(edge)
                if look is not None:
                    look(token)
                if modifier:
                    edge.token = token
                    bring_activity(edge.target)
                    inside = True
            elif not (hearing and hearing[output] is not None and edge not in hearing[output]):
                put(edge, value, modifier, stamp)
                if core.next_in_wave:
                    self.note(k, number)
        for j in self.schedule.enables[k]:
            if self.schedule.fires_with_slots(j):
                self._enable(j)
        if carried:
            activity_left(worker)
        sent(core)
        if worker.shape.announced:
            announce(worker, [None if value is None else (value, None, None) for value in values])
        self.finish(k)
        return inside

    def put_heard(self, k: int, output: int, value: Any, stamp: float) -> None:
        """Put a token on the edges of an output to those who hear it now (T4)."""
        for edge in self.order[k].listeners[output].who_hear():
            put(edge, value, 0, stamp)
            if self.core.next_in_wave:
                self.note(k, self._number_of[edge])

    def finish(self, k: int) -> None:
        """The automatic events of member k follow, then its firing or call is over (A9, A3)."""
        worker = self.order[k]
        send_automatic(worker)
        worker.leave()
        worker.rest()
