"""Deadlines are checked before a run: bounds from the graph, its groups and declared durations."""

from __future__ import annotations

import asyncio
import math
import random
import re
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.analysis.timing import TimeReport, analyse_time
from hfg.errors import UsageError
from hfg.graph.flat import flatten
from hfg.graph.flat.deadlines import urgencies


@hfg.node
def tick() -> Iterator[int]:
    yield from range(10)


@hfg.node
def ticks() -> Iterator[int]:
    yield from range(1000)


@hfg.node
def step(number: int) -> int:
    return number


class Detect(hfg.Node):
    number = hfg.Input(int)
    found = hfg.Event(int)

    def process(self, number: int) -> None:
        self.found.trigger(number)


class Join(hfg.Node):
    one = hfg.Input(int)
    other = hfg.Input(int)

    def process(self, one: int, other: int) -> None: ...


class Store(hfg.Node):
    @hfg.slot
    def put(self, number: int) -> None: ...


class Again(Store):
    sent = hfg.Event(int)


def way(graph: hfg.Graph, name: str, rate_hz: float, *takes: float, **last: Any) -> None:
    """A source and a chain of steps, which take so long; options of the last one."""
    before = graph.add(tick(), name=name, max_rate_hz=rate_hz, takes_s=0.0, group=last.get("group"))
    for number, takes_s in enumerate(takes):
        options = last if number == len(takes) - 1 else {"group": last.get("group")}
        node = graph.add(step(), name=f"{name}_{number}", takes_s=takes_s, **options)
        graph.connect(before.out, node.number)
        before = node


def bounds(report: TimeReport) -> dict[str, float]:
    return {path.node: path.within_s for path in report.paths}


@pytest.mark.rule("R2")
def test_first_in_first_out_a_wave_waits_for_the_waves_of_all_others() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01, 0.02, deadline_s=0.05)
    way(graph, "lidar", 20, 0.01)
    report = analyse_time(graph)
    assert bounds(report) == pytest.approx({"camera_1": 0.04, "lidar_0": 0.04})
    assert report.load == pytest.approx({"loop": 0.5})
    assert [path.used for path in report.paths] == [pytest.approx(0.8), None]
    assert not report.problems
    assert next(iter(report.lines())) == "camera -> camera_1: 0.04 s  ████████████████░░░░ 80% of 0.05 s"


def test_a_deadline_that_can_be_missed_is_a_warning_and_priority_helps() -> None:
    def found(policy: Any) -> TimeReport:
        graph = hfg.Graph()
        graph.group("work", policy=policy)
        way(graph, "camera", 10, 0.02, 0.03, group="work")
        bumper = graph.add(tick(), name="bumper", max_rate_hz=10, takes_s=0.0, group="work", priority=2)
        stop = graph.add(step(), name="stop", takes_s=0.001, group="work", priority=2, deadline_s=0.04)
        graph.connect(bumper.out, stop.number)
        return analyse_time(graph)

    assert [problem.check for problem in found("fifo").problems] == ["deadline"]
    assert "can take 0.051 s, its deadline_s is 0.04" in str(found("fifo").problems[0])
    assert not found("priority").problems
    assert bounds(found("priority"))["stop"] == pytest.approx(0.031)  # one firing that has begun


@pytest.mark.rule("F5")
def test_over_groups_and_events_the_response_time_is_the_jitter_of_the_next() -> None:
    graph = hfg.Graph()
    graph.group("vision")
    camera = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.01)
    detect = graph.add(Detect(), name="detect", group="vision", takes_s=0.03)
    show = graph.add(step(), name="show", takes_s=0.005, deadline_s=0.1)
    graph.connect(camera.out, detect.number)
    graph.connect(detect.found, show.number)
    report = analyse_time(graph)
    assert bounds(report) == pytest.approx({"show": 0.06})  # 0.015 + 0.03 + 0.015: show and camera share the loop


def test_too_much_work_has_no_bound_and_says_so() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.2, deadline_s=1.0)
    report = analyse_time(graph)
    assert bounds(report) == {"camera_0": math.inf}
    assert [str(problem.what) for problem in report.problems] == [
        'group "loop" needs 200% of its time',
        'the way from "camera" has no bound, its deadline_s is 1',
    ]


def test_measured_durations_come_before_declared_ones_and_what_is_unknown_is_said() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01)
    graph.connect(graph["camera_0"].out, graph.add(step(), name="last").number)
    graph.connect(graph.add(tick(), name="free").out, graph.add(step(), name="idle").number)
    assert bounds(analyse_time(graph, {"camera_0": 0.04})) == pytest.approx({"last": 0.04})
    assert analyse_time(graph).assumptions[1:] == [
        "no time for last: declare takes_s",
        "no work from free: a source without max_rate_hz has no period",
    ]


def test_what_comes_over_an_edge_has_the_deadline_of_the_edge_and_the_earliest_counts() -> None:
    graph = hfg.Graph()
    for name in ("camera", "lidar"):
        graph.add(tick(), name=name, max_rate_hz=10, takes_s=0.01)
    join = graph.add(Join(), name="join", takes_s=0.02, deadline_s=0.2)
    graph.connect(graph["camera"].out, join.one, deadline_s=0.05)
    graph.connect(graph["lidar"].out, join.other, deadline_s=0.4)
    report = analyse_time(graph)
    found = {path.source: (path.deadline_s, path.by) for path in report.paths}
    assert found == {"camera": (0.05, "camera.out -> join.one"), "lidar": (0.2, "")}
    assert next(iter(report.lines())).endswith("of 0.05 s, by camera.out -> join.one")
    assert "its deadline_s is 0.05 (by camera.out -> join.one)" in str(report.problems[0])


def test_a_deadline_of_the_loop_is_one_of_each_way_that_ends() -> None:
    graph = hfg.Graph()
    graph.group("loop", deadline_s=0.1)
    graph.group("vision", deadline_s=0.06)
    way(graph, "camera", 10, 0.01, 0.01)
    way(graph, "lidar", 10, 0.01, group="vision")
    way(graph, "bumper", 10, 0.01, deadline_s=0.03)
    assert {path.node: (path.deadline_s, path.by) for path in analyse_time(graph).paths} == {
        "camera_1": (0.1, 'group "loop"'),
        "lidar_0": (0.06, 'group "vision"'),
        "bumper_0": (0.03, ""),
    }


def test_a_node_must_be_done_before_the_deadlines_of_what_it_leads_to() -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01, 0.01, 0.01, deadline_s=0.09)
    graph.connect(graph["camera_0"].out, graph.add(step(), name="show", deadline_s=0.05).number)
    flat = flatten(graph)
    assert {flat.nodes[index].path: seconds for index, seconds in urgencies(flat).items()} == {
        "camera": 0.05,
        "camera_0": 0.05,
        "camera_1": 0.09,
        "camera_2": 0.09,
        "show": 0.05,
    }


def test_with_one_deadline_at_the_end_of_a_way_all_of_it_has_that_deadline() -> None:
    graph = hfg.Graph()
    graph.group("work", policy="deadline")
    way(graph, "camera", 10, 0.02, 0.02, group="work", deadline_s=0.09)
    way(graph, "bumper", 10, 0.005, group="work", deadline_s=0.03)
    assert bounds(analyse_time(graph)) == pytest.approx({"camera_1": 0.045, "bumper_0": 0.03})


def test_groups_without_threads_share_the_time_of_the_loop() -> None:
    graph = hfg.Graph()
    graph.group("ui", threads=0)
    way(graph, "camera", 10, 0.03)
    way(graph, "screen", 10, 0.04, group="ui")
    report = analyse_time(graph)
    assert report.load == pytest.approx({"loop": 0.7})
    assert bounds(report) == pytest.approx({"camera_0": 0.07, "screen_0": 0.07})
    assert report.assumptions[0].startswith("each group but ui, which share the loop, has a processor of its own")


def test_a_node_that_is_called_by_several_signals_of_one_wave_works_for_each() -> None:
    graph = hfg.Graph()
    source = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.0)
    detect, once, twice = (graph.add(Detect(), name=name, takes_s=0.01) for name in ("detect", "once", "twice"))
    store = graph.add(Store(), name="store", takes_s=0.01)
    graph.connect(source.out, detect.number)
    graph.connect(detect.found, once.number)
    graph.connect(detect.found, twice.number)
    for node in (detect, once, twice):
        graph.connect(node.found, store.put)
    assert bounds(analyse_time(graph))["store"] == pytest.approx(0.06)  # three nodes, and three calls


def test_a_join_of_two_groups_begins_when_the_later_one_is_done() -> None:
    graph = hfg.Graph()
    for name in ("circles", "lines"):
        graph.group(name)
    camera = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.01)
    join = graph.add(Join(), name="join", takes_s=0.005)
    for name, port, takes_s in (("circles", join.one, 0.03), ("lines", join.other, 0.05)):
        node = graph.add(step(), name=f"find_{name}", group=name, takes_s=takes_s)
        graph.connect(camera.out, node.number)
        graph.connect(node.out, port)
    assert bounds(analyse_time(graph)) == pytest.approx({"join": 0.015 + 0.05 + 0.015})


def test_a_ring_of_signals_is_counted_once_and_said() -> None:
    graph = hfg.Graph()
    camera = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.0)
    ring = [graph.add(Again(), name=name, takes_s=0.01) for name in ("a", "b")]
    graph.connect(camera.out, ring[0].put)
    graph.connect(ring[0].sent, ring[1].put)
    graph.connect(ring[1].sent, ring[0].put)
    report = analyse_time(graph)
    assert report.load == pytest.approx({"loop": 0.2})
    assert "what camera causes goes round rings once" in report.assumptions


@pytest.mark.parametrize(
    ("durations", "sentence"),
    [
        ({"camera_0": -1.0}, 'the duration of "camera_0" must be seconds from 0 on, got -1.0'),
        ({"camera_0": math.nan}, "must be seconds from 0 on, got nan"),
        ({"camera_0": "long"}, "must be seconds from 0 on, got 'long'"),
        ({"gone": 0.1}, 'there is a duration of "gone", and the graph has no such node'),
    ],
)
def test_durations_that_cannot_be_are_refused(durations: Any, sentence: str) -> None:
    graph = hfg.Graph()
    way(graph, "camera", 10, 0.01)
    with pytest.raises(UsageError, match=re.escape(sentence)):
        analyse_time(graph, durations)


class Box(hfg.Subgraph):
    number = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.number.inner, graph.add(step(), name="inner", takes_s=0.01).number, deadline_s=0.05)


@pytest.mark.rule("G1")
@pytest.mark.parametrize(("outer_s", "least_s"), [(None, 0.05), (0.03, 0.03), (0.2, 0.05)])
def test_an_edge_into_a_subgraph_has_the_least_deadline_of_its_parts(outer_s: float | None, least_s: float) -> None:
    graph = hfg.Graph()
    camera = graph.add(tick(), name="camera", max_rate_hz=10, takes_s=0.0)
    graph.connect(camera.out, graph.add(Box(), name="box").number, deadline_s=outer_s)
    (path,) = analyse_time(graph).paths
    assert (path.node, path.deadline_s) == ("box/inner", least_s)


# --- beside runs ---


class Works(hfg.Node):
    """Takes its time, and triggers its event; it knows the greatest age at which it was done."""

    number = hfg.Input(int)
    out = hfg.Output(int)
    sent = hfg.Event(int)
    takes_s = hfg.Parameter(0.0)
    oldest_s = hfg.State(0.0)

    def process(self, number: hfg.Token[int]) -> int:
        self._work(number)
        return number.value

    @hfg.slot
    def put(self, number: hfg.Token[int]) -> None:
        self._work(number)

    def _work(self, number: hfg.Token[int]) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, hfg.VirtualTimeLoop)
        loop.spend(self.takes_s)
        self.oldest_s = max(self.oldest_s, hfg.now() - number.stamp)
        self.sent.trigger(number.value)


def random_graph(rng: random.Random, policy: Any) -> hfg.Graph:
    """Sources with rates, and nodes behind them in two groups on the loop, joined by outputs, inputs and slots."""
    graph = hfg.Graph()
    graph.group("loop", policy=policy)
    graph.group("other", policy=policy, threads=0)
    several = rng.random() < 0.3
    for number in range(rng.randint(1, 3)):
        group = "other" if several and rng.random() < 0.5 else None
        rate_hz = rng.choice([5, 10, 20])
        source = graph.add(ticks(), name=f"source_{number}", max_rate_hz=rate_hz, takes_s=0.0, group=group)
        ports: list[Any] = [source.out]
        for index in range(rng.randint(1, 4)):
            takes_s = rng.choice([0.0005, 0.001, 0.002])
            options: Any = {"takes_s": takes_s, "group": group, "priority": rng.choice([0, 1])}
            node = graph.add(Works(takes_s=takes_s), name=f"node_{number}_{index}", deadline_s=0.5, **options)
            graph.connect(rng.choice(ports), node.number)
            if rng.random() < 0.5:
                graph.connect(rng.choice(ports), node.put)
            ports += [node.out, node.sent]
    return graph


def stays_below(seed: int, policy: str) -> None:
    graph = random_graph(random.Random(seed), policy)
    report = analyse_time(graph)
    hfg.run(graph, clock="virtual", until_s=3.0, seed=seed if policy == "random" else None)
    for path in report.paths:
        node: Any = graph[path.node]
        if isinstance(node, Works):
            assert node.oldest_s <= path.within_s + 1e-9, f"{policy}, seed {seed}: {path} took {node.oldest_s}"


@pytest.mark.parametrize("policy", ["fifo", "priority", "deadline", "fair", "random"])
@pytest.mark.rule("R2")
def test_no_node_of_a_run_is_later_than_its_bound(policy: str) -> None:
    for seed in range(4):
        stays_below(seed, policy)


@pytest.mark.soak
@pytest.mark.parametrize("policy", ["fifo", "priority", "deadline", "fair", "random"])
def test_no_node_of_a_thousand_runs_is_later_than_its_bound(policy: str) -> None:
    for seed in range(1000, 1200):
        stays_below(seed, policy)
