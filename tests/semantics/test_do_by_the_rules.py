"""The do-activity (rule A15), read by engine and oracle.

The expected results were counted out on paper from the text of the rules, before either was run. Cues arrive at
whole seconds and do-activities take half seconds, so that no two things happen at the same moment unless a test says
so.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import hfg
from hfg.testing import Recorder
from hfg.trace import ActivityChanged, ErrorRaised, RunEnded
from tests.semantics.readings import sent, signs

Cues = tuple[tuple[float, int], ...]


class Cue(hfg.Node):
    """At each of the given seconds trigger `on` with the given modifier."""

    on = hfg.Event(int)
    cues = hfg.Parameter(())

    async def process(self) -> None:
        now = 0.0
        for at, modifier in self.cues:
            await asyncio.sleep(at - now)
            now = at
            self.on.trigger(modifier, activity=modifier)
        raise hfg.EndOfStream


class Works(hfg.Node):
    """Its do-activity takes a while and returns a number; `began` tells of each."""

    began = hfg.Event(int)
    pause_s = hfg.Parameter(2.5)
    times = hfg.State(0)

    @hfg.slot
    def go(self, value: int) -> None: ...

    async def do(self) -> int:
        self.times += 1
        mine = self.times
        self.began.trigger(mine)
        await asyncio.sleep(self.pause_s)
        return mine


class LingersOn(Works):
    """Needs another 1.5 s after it has been cancelled, and then returns as if nothing had been."""

    async def do(self) -> int:
        self.times += 1
        mine = self.times
        self.began.trigger(mine)
        try:
            await asyncio.sleep(self.pause_s)
        except asyncio.CancelledError:
            await asyncio.sleep(1.5)
        return mine


class Ear(hfg.Node):
    heard = hfg.State(0)

    @hfg.slot
    def hear(self, value: Any) -> None:
        self.heard += 1


BEGAN = "works.began -> ear.hear"
DONE = "works.completed -> next.hear"


def scene(worker: Any, cues: Cues, *, active: bool = False, **options: Any) -> hfg.Graph:
    """Cues activate and deactivate a worker; one node hears when it begins, another what it completes."""
    graph = hfg.Graph()
    works, ear, after = (
        graph.add(worker, name="works", **options),
        graph.add(Ear(), name="ear"),
        graph.add(Ear(), name="next"),
    )
    cue = graph.add(Cue(cues=cues))
    graph.connect(cue.on, works.go, active=True)
    graph.connect(works.began, ear.hear)
    graph.connect(works.completed, after.hear, active=active)
    return graph


def changes(seen: Recorder, node: str) -> list[tuple[float, bool]]:
    return [(round(e.time, 6), e.active) for e in seen.of(ActivityChanged) if e.node == node]


def both(seen: Recorder) -> tuple[Any, Any]:
    return sent(seen, BEGAN), sent(seen, DONE)


@pytest.mark.rule("A15")
@pytest.mark.parametrize(
    ("worker", "cues", "began", "done"),
    [
        pytest.param(
            Works(), ((1, 1),), [(1, 1)], [(3.5, 1)], id="it begins with the activity and tells what it returned"
        ),
        pytest.param(Works(), ((1, 0),), [], [], id="no activity, no do"),
        pytest.param(Works(), ((1, 1), (2, -1)), [(1, 1)], [], id="it is cancelled with the activity"),
        pytest.param(Works(), ((1, 1), (2, 1)), [(1, 1)], [(3.5, 1)], id="activity on top of activity leaves it alone"),
        pytest.param(
            Works(), ((1, 1), (2, -1), (3, 1)), [(1, 1), (3, 2)], [(5.5, 2)], id="a new activity begins a new one"
        ),
        pytest.param(Works(), ((1, 1), (5, 1)), [(1, 1)], [(3.5, 1)], id="still active, and done once: no second one"),
        pytest.param(
            LingersOn(),
            ((1, 1), (2, -1), (3, 1)),
            [(1, 1), (3.5, 2)],
            [(6, 2)],
            id="the next waits until the cancelled one is over",
        ),
        pytest.param(
            LingersOn(),
            ((1, 1), (2, -1), (3, 1), (3.25, -1)),
            [(1, 1)],
            [],
            id="activity that was gone again begins none",
        ),
        pytest.param(
            LingersOn(),
            ((1, 1), (2, -1), (3, 1), (3.125, -1), (3.25, 1)),
            [(1, 1), (3.5, 2)],
            [(6, 2)],
            id="of several activities while one is being cancelled the last begins one",
        ),
        pytest.param(
            LingersOn(),
            ((1, 1), (2, -1)),
            [(1, 1)],
            [],
            id="what returns in spite of being cancelled has not completed",
        ),
        pytest.param(
            Works(pause_s=0.0),
            ((1, 1), (2, -1), (3, 1)),
            [(1, 1), (3, 2)],
            [(1, 1), (3, 2)],
            id="one that is over at once",
        ),
    ],
)
def test_a_do_activity_lives_as_long_as_the_activity(
    perform: Any, worker: Any, cues: Cues, began: list[Any], done: list[Any]
) -> None:
    assert perform(lambda: scene(type(worker)(pause_s=worker.pause_s), cues), both) == (began, done)


@pytest.mark.rule("A15", "A5")
def test_the_activity_leaves_with_completed_over_an_active_edge(perform: Any) -> None:
    def read(seen: Recorder) -> Any:
        return signs(seen, DONE), changes(seen, "works"), changes(seen, "next")

    found = perform(lambda: scene(Works(), ((1, 1),), active=True), read)
    assert found == ([(1, 1)], [(1, True), (3.5, False)], [(3.5, True)])


@pytest.mark.rule("A15", "A7")
def test_over_an_edge_that_is_not_active_the_node_stays_active(perform: Any) -> None:
    found = perform(lambda: scene(Works(), ((1, 1),)), lambda seen: (signs(seen, DONE), changes(seen, "works")))
    assert found == ([(1, 0)], [(1, True)])


class HandsOver(Works):
    """Hands its activity over in the middle of its do-activity."""

    over = hfg.Event(int)

    async def do(self) -> int:
        self.began.trigger(1)
        await asyncio.sleep(0.5)
        self.over.trigger(1)
        await asyncio.sleep(0.5)
        self.began.trigger(2)
        return 1


@pytest.mark.rule("A15", "A5")
def test_a_do_activity_that_hands_its_activity_over_is_cancelled_by_that(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = scene(HandsOver(), ((1, 1),))
        last = graph.add(Ear(), name="last")
        graph.connect(graph["works.over"], last.hear, active=True)
        return graph

    found = perform(build, lambda seen: (*both(seen), signs(seen, "works.over -> last.hear"), changes(seen, "works")))
    assert found == ([(1, 1)], [], [(1, 1)], [(1, True), (1.5, False)])


class Minds(Works):
    """Takes two inputs; its do-activity as that of its base."""

    a = hfg.Input(int)
    b = hfg.Input(int)

    def process(self, a: int, b: int) -> None: ...


class Sends(hfg.Node):
    """At one second +1, at two a -1 and, if asked, at once a +1 beside it on its other output."""

    a = hfg.Output(int)
    b = hfg.Output(int)
    time = hfg.State(0)

    async def process(self) -> None:
        await asyncio.sleep(1)
        self.time += 1
        if self.time == 1:
            self.a.send(1, activity=1)
            self.b.send(1, activity=0)
        elif self.time == 2:
            self.a.send(2, activity=-1)
            self.b.send(2, activity=1)
        else:
            raise hfg.EndOfStream


@pytest.mark.rule("A15", "A6")
def test_only_the_net_change_of_one_firing_counts(perform: Any) -> None:
    """-1 and +1 taken by one firing are no change from 1, so the do-activity goes on."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, works = graph.add(Sends()), graph.add(Minds(), name="works")
        ear, after_ = graph.add(Ear(), name="ear"), graph.add(Ear(), name="next")
        graph.connect(source.a, works.a, active=True)
        graph.connect(source.b, works.b, active=True)
        graph.connect(works.began, ear.hear)
        graph.connect(works.completed, after_.hear)
        return graph

    assert perform(build, both) == ([(1, 1)], [(3.5, 1)])


@pytest.mark.rule("A15", "R5")
def test_a_graph_is_not_quiet_while_a_do_activity_runs(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        works = graph.add(Works(pause_s=7.5), name="works")
        graph.start.activates(works.activate)
        return graph

    assert perform(build, lambda seen: [(e.outcome, e.time) for e in seen.of(RunEnded)]) == [("done", 7.5)]


@pytest.mark.rule("A15", "F10")
def test_disabling_cancels_it_and_keeps_the_activity(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = scene(Works(), ((1, 1),))
        graph.connect(graph.add(Cue(cues=((2, 0),)), name="off").on, graph["works"].disable)
        return graph

    found = perform(build, lambda seen: (*both(seen), changes(seen, "works")))
    assert found == ([(1, 1)], [], [(1, True)])


class Breaks(Works):
    async def do(self) -> int:
        self.began.trigger(1)
        await asyncio.sleep(0.5)
        raise ValueError("broken")


@pytest.mark.rule("A15", "X1")
def test_an_error_in_it_fails_the_run_and_names_the_node(perform: Any) -> None:
    found = perform(
        lambda: scene(Breaks(), ((1, 1), (9, 0))),
        lambda seen: ([(e.node, e.time) for e in seen.of(ErrorRaised)], seen.outcome),
    )
    assert found == ([("works", 1.5)], "failed")


@pytest.mark.rule("A15", "X1", "A9")
def test_an_error_that_is_skipped_triggers_failed_and_keeps_the_activity(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = scene(Breaks(), ((1, 1), (3, 0)), on_error="skip")
        graph.connect(graph["works.failed"], graph.add(Ear(), name="sorry").hear)
        return graph

    def read(seen: Recorder) -> Any:
        return [t for t, _ in sent(seen, "works.failed -> sorry.hear")], changes(seen, "works"), both(seen)

    assert perform(build, read) == ([1.5], [(1, True)], ([(1, 1)], []))


class WritesWithInput(hfg.Node):
    value = hfg.Input(int, optional=True)
    out = hfg.Output(int)

    def process(self, value: int | None = None) -> int | None:
        return value

    async def do(self) -> int:
        self.out.send(1)
        return 1


@pytest.mark.slow
@pytest.mark.rule("A15", "F3")
def test_outputs_belong_to_firings(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(WritesWithInput(), name="works")
        graph.connect(node.out, graph.add(Ear(), name="ear").hear)
        graph.start.activates(node.activate)
        return graph

    found = perform(
        build, lambda seen: ([e.node for e in seen.of(ErrorRaised)], seen.outcome, sent(seen, "works.out -> ear.hear"))
    )
    assert found == (["works"], "failed", [])


@pytest.mark.rule("A15")
def test_two_active_edges_behind_completed_fork_the_activity(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = scene(Works(), ((1, 1),), active=True)
        graph.connect(graph["works.completed"], graph.add(Ear(), name="other").hear, active=True)
        return graph

    found = perform(
        build, lambda seen: (signs(seen, DONE), signs(seen, "works.completed -> other.hear"), changes(seen, "other"))
    )
    assert found == ([(1, 1)], [(1, 1)], [(3.5, True)])


class Greets(Works):
    def on_activated(self) -> None:
        self.began.trigger(100)


@pytest.mark.rule("A15")
def test_it_begins_behind_on_activated(perform: Any) -> None:
    assert perform(lambda: scene(Greets(), ((1, 1),)), both) == ([(1, 100), (1, 1)], [(3.5, 1)])


@pytest.mark.rule("A15", "A5", "A6")
def test_an_activity_that_returns_to_the_same_node_begins_a_new_one(perform: Any) -> None:
    """`completed` leads back into the node: its activity leaves (A5) and comes back with the next call (A6)."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        works, ear = graph.add(Works(), name="works"), graph.add(Ear(), name="ear")
        graph.connect(works.began, ear.hear)
        graph.connect(works.completed, works.go, active=True)
        graph.connect(graph.add(Cue(cues=((6, 0),)), name="halt").on, graph.stop)
        graph.start.activates(works.activate)
        return graph

    assert perform(build, lambda seen: sent(seen, BEGAN)) == [(0, 1), (2.5, 2), (5, 3)]
