"""transitions: a state machine whose states stand in a ring."""

from __future__ import annotations

from transitions import Machine

from benchmarks.meters import Arrivals
from benchmarks.ours import STATES
from benchmarks.works import Participant


class Transitions(Participant):
    """A method call is a transition."""

    name = "transitions"

    def __init__(self, states: int = STATES) -> None:
        self.states = states

    def step(self, tokens: int) -> dict[str, float]:
        """E."""
        meter = Arrivals(tokens)
        names = [f"s{number}" for number in range(self.states)]
        machine = Machine(states=names, initial="s0", auto_transitions=False)
        machine.add_ordered_transitions()
        for number in range(tokens):
            machine.next_state()
            meter.take(number)
        if machine.state != names[tokens % self.states]:
            raise RuntimeError(f"after {tokens} transitions the state is {machine.state}")
        return meter.figures()


PEERS = [Transitions()]
