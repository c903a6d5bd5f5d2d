"""A13: a finite-state machine, translated by the construction of §5.3.3, accepts the same words as a graph."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg

Machine = tuple[tuple[tuple[int, int], ...], frozenset[int]]  # per state where "a" and "b" lead; the final states


class State(hfg.Node):
    """A state of a machine over the letters a and b; which of them it answers is where its activity goes."""

    a = hfg.Event()
    b = hfg.Event()

    @hfg.slot
    def enter(self) -> None:
        """Become active: the edge does that."""

    @hfg.slot
    def read(self, letter: str) -> None:
        """Leave over the letter's edge."""
        if self.active:
            (self.a if letter == "a" else self.b).trigger()


class Letters(hfg.Node):
    """Tell every state the next letter, over edges that are not active."""

    letter = hfg.Event(str)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """Deterministic and complete machines of up to five states; state 0 is the initial one."""
    count = draw(st.integers(1, 5))
    state = st.integers(0, count - 1)
    return tuple(draw(st.tuples(state, state)) for _ in range(count)), draw(st.frozensets(state))


def translate(machine: Machine) -> tuple[hfg.Graph, Letters, list[State]]:
    """Make a node of each state, an active edge of each transition; `start` is the edge into the initial state."""
    transitions, _ = machine
    graph = hfg.Graph("machine")
    letters = graph.add(Letters())
    states = [graph.add(State(), name=f"s{number}") for number in range(len(transitions))]
    graph.start.activates(states[0].enter)
    for state, (after_a, after_b) in zip(states, transitions, strict=True):
        graph.connect(letters.letter, state.read)
        state.a.activates(states[after_a].enter)
        state.b.activates(states[after_b].enter)
    return graph, letters, states


async def active_after_each(machine: Machine, word: Sequence[str], policy: str, seed: int) -> list[list[int]]:
    """Feed the word letter by letter, each to quiet; give the active states before and after each."""
    graph, letters, states = translate(machine)
    async with hfg.running(graph, policy=policy, seed=seed) as run:
        await run.wait_quiet()
        seen = [[number for number, state in enumerate(states) if state.active]]
        for letter in word:
            await run.trigger(letters.letter, letter)
            await run.wait_quiet()
            seen.append([number for number, state in enumerate(states) if state.active])
        return seen


@pytest.mark.rule("A13")
@settings(max_examples=40, deadline=None)
@given(machines(), st.lists(st.sampled_from("ab"), max_size=8), st.sampled_from(["fifo", "random"]), st.integers(0, 9))
def test_a_machine_and_its_graph_accept_the_same_words_with_one_active_state_after_every_letter(
    machine: Machine, word: list[str], policy: str, seed: int
) -> None:
    transitions, final = machine
    state, path = 0, [0]
    for letter in word:
        state = transitions[state]["ab".index(letter)]
        path.append(state)
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        seen = runner.run(active_after_each(machine, word, policy, seed))
    assert seen == [[one] for one in path]
    assert (seen[-1][0] in final) == (state in final)
