"""A13: a finite-state machine, translated by the construction of §5.3.3, accepts the same words as a graph."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg
from hfg.activity import StateMachine, StateNode

LETTERS = ("a", "b", "go home", "timeout", "ß.")  # the last three cannot be names of events of their own


@st.composite
def machines(draw: st.DrawFn) -> StateMachine:
    """Draw deterministic machines of up to six states in which transitions may be missing."""
    states = [f"s{number}" for number in range(draw(st.integers(1, 6)))]
    letters = draw(st.lists(st.sampled_from(LETTERS), min_size=1, unique=True))
    transitions = [
        (letter, state, draw(st.sampled_from(states)))
        for state in states
        for letter in letters
        if draw(st.integers(0, 4)) > 0
    ]
    return StateMachine(
        states,
        transitions,
        initial=draw(st.sampled_from(states)),
        final=draw(st.sets(st.sampled_from(states))),
        missing=draw(st.sampled_from(["dead", "ignore"])),
    )


words = st.lists(st.sampled_from([*LETTERS, "unheard"]), max_size=8)
schedules = st.one_of(st.just(("fifo", None)), st.tuples(st.just("random"), st.integers(0, 2**31 - 1)))


async def active_states(
    machine: StateMachine, word: Sequence[str], schedule: tuple[str, int | None], *, wait: bool
) -> list[list[str]]:
    """Feed a word to the machine's graph; give the active nodes before and after each letter, or at the end alone."""
    graph = machine.graph()
    policy, seed = schedule
    async with hfg.running(graph, policy=policy, seed=seed) as run, run.feed(graph.inputs["letters"]) as feed:
        await run.wait_quiet()
        seen = [run.active()]
        for letter in word:
            await feed.send(letter)
            if wait:
                await run.wait_quiet()
                seen.append(run.active())
        await run.wait_quiet()
        return [*seen, run.active()]


def accept_the_same(machine: StateMachine, word: Sequence[str], schedule: tuple[str, int | None]) -> None:
    """One state is active after each letter, the machine's; letters that follow at once lead to the same state."""
    expected = [machine.after(word[:length]) or "dead" for length in range(len(word) + 1)]
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        seen = runner.run(active_states(machine, word, schedule, wait=True))
        assert seen == [[state] for state in [*expected, expected[-1]]]
        assert machine.accepts(word) == (seen[-1][0] in machine.final)
        in_haste = runner.run(active_states(machine, word, schedule, wait=False))
        assert in_haste[-1] == seen[-1]


@pytest.mark.slow
@pytest.mark.rule("A13")
@settings(max_examples=200, deadline=None)
@given(machines(), words, schedules)
def test_a_machine_and_its_graph_accept_the_same_words_with_one_active_state_under_every_schedule(
    machine: StateMachine, word: list[str], schedule: tuple[str, int | None]
) -> None:
    accept_the_same(machine, word, schedule)


@pytest.mark.slow
@pytest.mark.rule("A13")
@settings(max_examples=100, deadline=None)
@given(machines())
def test_the_machine_can_be_read_out_of_its_graph(machine: StateMachine) -> None:
    assert StateMachine.of(machine.graph()) == machine


def test_states_of_ones_own_do_their_work_and_move_on_by_their_own_events() -> None:
    told: list[str] = []

    class Closed(StateNode):
        push = hfg.Event()

        def on_activated(self) -> None:
            told.append(f"closed at {hfg.now():.0f} s")

    class Open(hfg.Node):  # no `enter` and no `read`: it leaves by time alone
        def on_activated(self) -> None:
            told.append(f"open at {hfg.now():.0f} s")

    class Visitor(hfg.Node):
        gone = hfg.Event(str)

        @hfg.slot
        async def come(self) -> None:
            for _ in range(2):
                await asyncio.sleep(3)
                self.gone.trigger("push")

    door = hfg.StateMachine(
        ["closed", "open"], [("push", "closed", "open"), ("timeout", "open", "closed")], initial="closed"
    )
    graph = hfg.Graph("door")
    visitor = graph.add(Visitor())
    opened = graph.add(Open(), name="ajar", active_for_s=2)
    graph.connect(graph.start, visitor.come)
    # The letter "timeout" is the automatic event of a node of one's own.
    nodes = door.build(graph, letters=visitor.gone, nodes={"closed": Closed(), "open": opened})
    assert [node.place.path for node in nodes.values()] == ["closed", "ajar"]
    hfg.run(graph, clock="virtual")
    assert told == ["closed at 0 s", "open at 3 s", "closed at 5 s", "open at 6 s", "closed at 8 s"]


@pytest.mark.slow
@pytest.mark.rule("A13")
def test_signals_in_one_burst_are_read_one_after_the_other() -> None:
    class Keyboard(hfg.Node):
        typed = hfg.Event(str)

        @hfg.slot
        def type_all(self) -> None:
            for letter in "abcabcab":
                self.typed.trigger(letter)

    ring = StateMachine(["x", "y", "z"], [("a", "x", "y"), ("b", "y", "z"), ("c", "z", "x")], initial="x", final=["z"])
    graph = hfg.Graph()
    keyboard = graph.add(Keyboard())
    graph.connect(graph.start, keyboard.type_all)
    ring.build(graph, letters=keyboard.typed)
    for seed in range(20):
        report = hfg.run(graph, clock="virtual", policy="random", seed=seed)
        assert [path for path, node in report.nodes.items() if node.active] == ["z"]


# --- states of one's own ---


class Door(hfg.Node):
    """A state with a way in of its own name."""

    push = hfg.Event()
    begun = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        self.begun += 1

    @hfg.slot
    def read(self, letter: str) -> None:
        if self.active and letter == "push":
            self.push.trigger()


@pytest.mark.rule("A13")
def test_the_slot_of_a_state_by_which_activity_comes_in_is_given_in_place_of_the_node() -> None:
    machine = hfg.StateMachine(["closed", "open"], [("push", "closed", "open")], initial="closed")
    closed, opened = Door(), Door()
    graph = machine.graph(nodes={"closed": closed.begin, "open": opened.begin})

    async def main() -> list[str]:
        async with hfg.running(graph) as run, run.feed("letters") as feed:
            await feed.send("push")
            await run.wait_quiet()
            return run.active()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == ["open"]
    assert (closed.begun, opened.begun) == (1, 1)


@pytest.mark.rule("A13")
def test_a_state_whose_way_in_cannot_be_told_is_refused() -> None:
    machine = hfg.StateMachine(["closed", "open"], [("push", "closed", "open")], initial="closed")
    with pytest.raises(hfg.errors.MachineError, match=r"Door has no slot `enter`.*nodes=\{'closed': node.begin\}"):
        machine.graph(nodes={"closed": Door()})
