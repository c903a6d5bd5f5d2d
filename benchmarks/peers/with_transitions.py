"""transitions: a state machine of ten states in a ring."""

from __future__ import annotations

from transitions import Machine

from benchmarks.meters import Arrivals
from benchmarks.ours import STATES
from benchmarks.works import Participant


class Transitions(Participant):
    """A method call is a transition."""

    name = "transitions"

    def step(self, tokens: int) -> dict[str, float]:
        """E."""
        meter = Arrivals(tokens)
        machine = Machine(states=[f"s{number}" for number in range(STATES)], initial="s0", auto_transitions=False)
        machine.add_ordered_transitions()
        for number in range(tokens):
            machine.next_state()
            meter.take(number)
        return meter.figures()


PEERS = [Transitions()]
