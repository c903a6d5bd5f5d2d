"""Figures 12 to 14 of the paper: state beside the data flow, state in it, and machines as graphs (§5).

Every function builds the graph of one figure; `docs/model/activity.md` walks through them.
Look at one with `hfg draw examples/figures/activity.py:figure_13`, run it with
`hfg run examples/figures/activity.py:figure_13 --clock virtual`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import hfg


@hfg.node
def messages() -> Iterator[str]:
    yield from ("one", "two", "three", "four")


# --- figure 12: the machine beside the data flow; who is the current state, each keeps for itself


class First(hfg.Node):
    """S_1: takes its time, asks for a message, and makes the transition."""

    ask = hfg.Event()
    on = hfg.Event()

    @hfg.slot
    async def enter(self) -> None:
        await asyncio.sleep(1.5)
        self.ask.trigger()
        self.on.trigger()


class Second(hfg.Node):
    """S_2: waits for the answer."""

    on = hfg.Event(str)
    is_current = hfg.State(False)

    @hfg.slot
    def enter(self) -> None:
        self.is_current = True

    @hfg.slot
    def answered(self, message: str) -> None:
        if self.is_current:
            self.is_current = False
            self.on.trigger(message)


class Listener(hfg.Node):
    """v_l: once asked, answers with the next message."""

    message = hfg.Input(str)
    answer = hfg.Event(str)
    is_asked = hfg.State(False)

    def process(self, message: str) -> None:
        if self.is_asked:
            self.is_asked = False
            self.answer.trigger(message)

    @hfg.slot
    def ask(self) -> None:
        self.is_asked = True


class Last(hfg.Node):
    """S_q: what was waited for."""

    begun_at = hfg.State(factory=list[float])

    @hfg.slot
    def enter(self, message: str) -> None:
        self.begun_at.append(hfg.now())
        print(f"S_q begins at {hfg.now():g} s")


def figure_12() -> hfg.Graph:
    """A data flow and a machine, which communicate only by messages."""
    graph = hfg.Graph("figure 12")
    source, listener = graph.add(messages(), name="v_k", max_rate_hz=1), graph.add(Listener(), name="v_l")
    first, second, last = graph.add(First(), name="S_1"), graph.add(Second(), name="S_2"), graph.add(Last(), name="S_q")
    graph.connect(source.out, listener.message)
    graph.connect(graph.start, first.enter)
    graph.connect(first.ask, listener.ask)
    graph.connect(first.on, second.enter)
    graph.connect(listener.answer, second.answered)
    graph.connect(second.on, last.enter)
    return graph


# --- figure 13: activity


class Prepare(hfg.Node):
    """Whatever comes before; its signal brings the activity."""

    done = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        await asyncio.sleep(1.5)
        self.done.trigger()


class Relay(hfg.Node):
    """v_b: gives every message on as a signal. It knows nothing of activity."""

    message = hfg.Input(str)
    relayed = hfg.Event(str)

    def process(self, message: str) -> None:
        self.relayed.trigger(message)


class Goal(hfg.Node):
    """S_q: begins when it becomes active; the messages before that reach it, and mean nothing."""

    begun_at = hfg.State(factory=list[float])

    @hfg.slot
    def hear(self, message: str) -> None:
        """Take the signal; whether it brought the activity is a matter of the edge."""

    def on_activated(self) -> None:
        self.begun_at.append(hfg.now())
        print(f"S_q begins at {hfg.now():g} s")


def figure_13() -> hfg.Graph:
    """The same with activity: the next message that leaves the active buffer takes the state along."""
    graph = hfg.Graph("figure 13")
    source, relay = graph.add(messages(), name="v_k", max_rate_hz=1), graph.add(Relay(), name="v_b")
    prepare, goal = graph.add(Prepare(), name="S_1"), graph.add(Goal(), name="S_q")
    graph.connect(source.out, relay.message)
    graph.start.activates(prepare.begin)
    graph.connect(prepare.done, relay.activate, active=True)
    graph.connect(relay.relayed, goal.hear, active=True)
    return graph


# --- figure 14: a machine, and the graph that it is

MACHINE = hfg.StateMachine(
    ["s_0", "s_1", "s_2", "s_3"],
    [("begin", "s_0", "s_1"), ("found", "s_1", "s_2"), ("lost", "s_2", "s_1"), ("arrived", "s_2", "s_3")],
    initial="s_0",
    final=["s_3"],
    missing="ignore",
)


def figure_14() -> hfg.Graph:
    """Each state is a node, each transition an event, a slot and an active edge."""
    return MACHINE.graph("figure 14")


# --- what no machine can do


class Split(hfg.Node):
    """Sends one signal over two active edges."""

    both = hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        self.both.trigger()


class Task(hfg.Node):
    """Something to do."""

    @hfg.slot
    def begin(self) -> None: ...


def fork() -> hfg.Graph:
    """Position and orientation are controlled at the same time: activity is in two places."""
    graph = hfg.Graph("fork")
    split = graph.add(Split())
    graph.start.activates(split.begin)
    for name in ("position", "orientation"):
        graph.connect(split.both, graph.add(Task(), name=name).begin, active=True)
    return graph
