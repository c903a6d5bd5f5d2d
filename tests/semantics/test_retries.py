"""Firings that fail are tried again with the same values before the node's policy decides (rule X1)."""

from __future__ import annotations

import asyncio
import logging
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg import END, NO_MESSAGE, commands
from hfg.graph import NodeGiven
from hfg.testing import Recorder, reference_run
from hfg.testing.nodes import script
from hfg.trace import ErrorRaised, FiringEnded, FiringRetried, FiringStarted, TraceEvent
from tests.semantics.nodes import Keep, drive, named, numbers, of_kind, run
from tests.semantics.readings import sent
from tests.support.kinds import Unsteady


class Device(hfg.Node):
    """Fails as often as it is told for each value."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    told = hfg.Event(int)
    fails = hfg.Parameter(2)
    pause_s = hfg.Parameter(1.0)

    def setup(self) -> None:
        self.tries: dict[int, int] = {}

    async def process(self, value: int) -> None:
        self.tries[value] = self.tries.get(value, 0) + 1
        self.out.send(10 * value + self.tries[value])
        await asyncio.sleep(self.pause_s)
        if self.tries[value] <= self.fails:
            raise ConnectionResetError(f"try {self.tries[value]}")


def trying(node: hfg.Node, count: int = 2, **options: Any) -> tuple[hfg.Graph, Keep]:
    graph, sink = hfg.Graph(), Keep()
    source = graph.add(numbers(count=count))
    graph.add(node, name="node", **options)
    graph.connect(source.out, node.ports.inputs["value"])
    graph.connect(node.ports.outputs["out"], graph.add(sink).value)
    return graph, sink


CONCURRENCY = pytest.mark.parametrize("concurrency", [1, 2])


@pytest.mark.rule("X1")
@CONCURRENCY
def test_a_firing_is_tried_again_with_the_same_values_and_what_it_wrote_is_thrown_away(
    concurrency: int, fast: bool
) -> None:
    graph, sink = trying(Device(), retries=2, retry_backoff_s=0.5, concurrency=concurrency)
    trace: list[TraceEvent] = []
    report = run(graph, fast, trace=trace)
    assert sink.values == [13, 23]
    assert (report.nodes["node"].retries, report.nodes["node"].failed, report.errors) == (4, 0, [])
    retried = [event for event in of_kind(trace, FiringRetried) if event.number == 1]
    assert [(event.time, event.attempt, event.error, event.pause_s) for event in retried] == [
        (1, 1, "ConnectionResetError: try 1", 0.5),
        (2.5, 2, "ConnectionResetError: try 2", 1.0),
    ]
    number = {FiringStarted: 0, FiringEnded: 0}
    for event in trace:
        if isinstance(event, FiringStarted | FiringEnded) and event.node == "node" and event.number < 3:
            number[type(event)] += 1
    assert number == {FiringStarted: 2, FiringEnded: 2}  # however often it was tried


@pytest.mark.rule("X1")
@CONCURRENCY
def test_behind_the_last_retry_the_policy_decides(concurrency: int, fast: bool) -> None:
    graph, sink = trying(Device(fails=9), retries=2, on_error="skip", concurrency=concurrency)
    report = run(graph, fast)
    assert sink.values == []
    assert report.errors == [f'node "node" failed in firing {number}: ConnectionResetError: try 3' for number in (1, 2)]
    assert (report.nodes["node"].failed, report.nodes["node"].retries) == (2, 4)
    graph, _ = trying(Device(fails=9), retries=2, concurrency=concurrency)
    with pytest.raises(hfg.errors.NodeError, match='node "node" failed in firing 1: ConnectionResetError: try 3'):
        run(graph, fast)


@pytest.mark.rule("X1", "X2")
@CONCURRENCY
def test_each_attempt_has_the_whole_time_limit(concurrency: int, fast: bool) -> None:
    class Slow(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def setup(self) -> None:
            self.tries = 0

        async def process(self, value: int) -> int:
            self.tries += 1
            await asyncio.sleep(4 if self.tries > 1 else 100)
            return value

    graph, sink = trying(Slow(), 1, retries=1, retry_backoff_s=1, max_duration_s=5, concurrency=concurrency)
    report = run(graph, fast)
    assert sink.values == [1]
    assert report.duration_s == 5 + 1 + 4


@pytest.mark.rule("X1", "F3")
@CONCURRENCY
def test_a_firing_that_has_sent_a_signal_is_not_repeated(concurrency: int, fast: bool) -> None:
    class Tells(Device):
        async def process(self, value: int) -> None:
            self.told.trigger(value)
            await super().process(value)

    graph, _ = trying(Tells(), retries=5, on_error="skip", concurrency=concurrency)
    report = run(graph, fast)
    assert (report.nodes["node"].failed, report.nodes["node"].retries) == (2, 0)


@pytest.mark.rule("X1")
@CONCURRENCY
@pytest.mark.parametrize("group", ["loop", "work"])
def test_plain_functions_are_tried_again_too(concurrency: int, group: str, fast: bool) -> None:
    tries: list[int] = []

    @hfg.node
    def flaky(value: int) -> int:
        tries.append(value)
        if tries.count(value) < 3:
            raise OSError("not now")
        return value

    if group == "loop" and concurrency > 1:
        pytest.skip("plain functions on the loop have one firing at a time (F14)")
    graph, sink = trying(flaky(), 4, retries=2, group=group, concurrency=concurrency)
    graph.group("work", threads=2)
    run(graph, fast)
    assert sink.values == [1, 2, 3, 4]
    assert sorted(tries) == sorted([1, 2, 3, 4] * 3)


@pytest.mark.rule("X1", "R6")
@CONCURRENCY
def test_pauses_double_up_to_a_maximum_and_are_shortened_by_chance_the_same_for_the_same_seed(
    concurrency: int, fast: bool
) -> None:
    def pauses(seed: int | None, jitter: float) -> list[float]:
        options: dict[str, Any] = {"retry_backoff_s": 1, "retry_backoff_max_s": 5, "retry_jitter": jitter}
        graph, _ = trying(Device(fails=5), 1, retries=5, concurrency=concurrency, **options)
        trace: list[TraceEvent] = []
        run(graph, fast, trace=trace, seed=seed)
        return [event.pause_s for event in of_kind(trace, FiringRetried)]

    longest = pauses(None, 0.0)
    assert longest == [1, 2, 4, 5, 5]
    drawn = pauses(1, 0.5)
    assert drawn == pauses(1, 0.5) != pauses(2, 0.5)
    assert all(whole / 2 <= pause <= whole for pause, whole in zip(drawn, longest, strict=True))
    assert drawn[3] != drawn[4]


@pytest.mark.rule("X1", "R5")
@CONCURRENCY
def test_a_run_that_ends_waits_for_no_pause(concurrency: int, fast: bool) -> None:
    graph, _ = trying(Device(), retries=2, retry_backoff_s=1000, concurrency=concurrency)
    report = run(graph, fast, until_s=50)
    assert (report.outcome, report.duration_s) == ("until", 50)


@pytest.mark.rule("X1")
@CONCURRENCY
def test_retries_are_logged_with_the_path(concurrency: int, caplog: pytest.LogCaptureFixture) -> None:
    graph, _ = trying(Device(fails=1), 1, retries=3, retry_backoff_s=2, concurrency=concurrency)
    with caplog.at_level(logging.WARNING, logger="hfg"):
        run(graph)
    assert [(record.getMessage(), record.path) for record in caplog.records] == [  # type: ignore[attr-defined]
        ('node "node": firing 1, attempt 1 of 4, failed: ConnectionResetError: try 1; again in 2 s', "node")
    ]


@pytest.mark.rule("X1", "R4")
def test_an_edit_waits_until_the_firing_is_over(fast: bool) -> None:
    async def main() -> float:
        graph, _ = trying(Device(), 1, retries=2, retry_backoff_s=3)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(2)
            began = hfg.now()
            await run.edit(hfg.commands.Remove("keep"))
            waited = hfg.now() - began
            await run.wait_finished()
        return waited

    assert drive(main) == 3 * 1 + 3 + 6 - 2


@pytest.mark.rule("X1")
def test_whoever_ends_a_task_on_purpose_is_not_tried_again(fast: bool) -> None:
    @hfg.node
    async def leaves(value: int) -> int:
        raise SystemExit(3)

    graph, _ = trying(leaves(), retries=3, on_error="skip")
    trace: list[TraceEvent] = []
    with pytest.raises(hfg.errors.NodeError, match="called sys.exit"):
        run(graph, fast, trace=trace)
    assert not of_kind(trace, FiringRetried)
    assert len(of_kind(trace, ErrorRaised)) <= 1
    assert all(earlier.time <= later.time for earlier, later in pairwise(trace))


# --- read by engine and oracle


def unsteady(*values: int, pause_s: float = 1.0, **options: Any) -> hfg.Graph:
    """It fails as often for a value as its remainder by four says, a second after each beginning."""
    graph = hfg.Graph()
    node = graph.add(Unsteady(pause_s=pause_s), name="node", on_error="skip", retry_backoff_s=0.5, **options)
    graph.add(script(values=values)) >> node
    graph.connect(node.out, graph.add(Keep(), name="keep").value)
    graph.connect(node.tried, graph.add(Keep(), name="heard").value)
    return graph


def tried(seen: Recorder) -> list[tuple[float, int, int, float]]:
    return [(event.time, event.number, event.attempt, event.pause_s) for event in seen.of(FiringRetried)]


GIVEN = "node.out -> keep.value"


@pytest.mark.slow
@pytest.mark.rule("X1")
@pytest.mark.parametrize(
    ("concurrency", "again", "given"),
    [
        pytest.param(
            1,
            [(1, 1, 1, 0.5), (2.5, 1, 2, 1.0), (5.5, 2, 1, 0.5)],
            [(4.5, 2 + 3), (7, 1 + 2), (7, END)],
            id="one after the other",
        ),
        pytest.param(
            2,
            [(1, 1, 1, 0.5), (1, 2, 1, 0.5), (2.5, 1, 2, 1.0)],
            [(4.5, 2 + 3), (4.5, 1 + 2), (4.5, END)],
            id="at once",
        ),
    ],
)
def test_a_firing_is_over_behind_its_last_attempt(
    perform: Any, concurrency: int, again: list[Any], given: list[Any]
) -> None:
    """The first fails at 1 and 2.5, its third attempt begins behind a pause of one second, at 3.5."""

    def build() -> hfg.Graph:
        return unsteady(2, 1, retries=3, concurrency=concurrency)

    assert perform(build, lambda seen: sorted(tried(seen))) == again
    assert perform(build, lambda seen: sent(seen, GIVEN)) == given


@pytest.mark.slow
@pytest.mark.rule("X1", "F3")
@pytest.mark.parametrize("concurrency", [1, 2])
def test_nobody_tries_again_behind_a_signal_or_behind_the_last_retry(perform: Any, concurrency: int) -> None:
    """3 is told of amid the second attempt; 7, which fails three times, has but one retry."""

    def build(retries: int, value: int) -> hfg.Graph:
        return unsteady(value, retries=retries, concurrency=concurrency)

    for retries, value, heard in ((3, 3, [(2.5, 2)]), (1, 7, [])):
        assert perform(lambda r=retries, v=value: build(r, v), lambda seen: sent(seen, GIVEN)[0]) == (2.5, NO_MESSAGE)
        told = perform(lambda r=retries, v=value: build(r, v), lambda seen: sent(seen, "node.tried -> heard.value"))
        assert [one for one in told if one[1] is not END] == heard


@pytest.mark.slow
@pytest.mark.rule("X1", "X2")
def test_the_limit_of_time_is_for_each_attempt_and_the_pause_not_part_of_it(perform: Any) -> None:
    def build() -> hfg.Graph:
        return unsteady(4, pause_s=2.0, retries=2, max_duration_s=1.5, retry_backoff_max_s=0.75)

    assert perform(build, tried) == [(1.5, 1, 1, 0.5), (3.5, 1, 2, 0.75)]
    assert perform(build, lambda seen: sent(seen, GIVEN)) == [(5.75, NO_MESSAGE), (5.75, END)]


@pytest.mark.rule("X1", "R6")
def test_the_oracle_says_that_it_draws_no_pauses() -> None:
    with pytest.raises(NotImplementedError, match='the pauses of "node" are shorter by chance'):
        reference_run(unsteady(1, retries=1, retry_jitter=0.5))


# --- only some errors ---


class NoAnswer(ConnectionError):
    """An error of a type's own."""


@hfg.node
async def asks(value: int) -> int:
    """Fail at each value, in one way or another."""
    await asyncio.sleep(0)
    raise [NoAnswer("busy"), ValueError("wrong")][value % 2]


@pytest.mark.rule("X1")
@CONCURRENCY
@pytest.mark.parametrize(
    ("retry_on", "retries"),
    [
        ((), [2, 2]),
        (ConnectionError, [0, 2]),
        (NoAnswer, [0, 2]),
        ([NoAnswer, ValueError], [2, 2]),
        ("ValueError", [2, 0]),
        (f"{__name__}:NoAnswer", [0, 2]),
        (["not.loaded:NoAnswer"], [0, 0]),
        (TypeError, [0, 0]),
    ],
)
def test_only_the_errors_that_are_named_are_tried_again(
    retry_on: Any, retries: list[int], concurrency: int, fast: bool
) -> None:
    graph = hfg.Graph()
    node = graph.add(asks(), retries=2, retry_on=retry_on, on_error="skip", concurrency=concurrency)
    graph.connect(graph.add(numbers(count=2)).out, node.value)
    trace: list[TraceEvent] = []
    run(graph, fast, trace=trace)
    retried = [event.number for event in of_kind(trace, FiringRetried)]
    assert [retried.count(1), retried.count(2)] == retries


@pytest.mark.rule("X1", "X2")
def test_a_time_limit_is_an_error_like_others() -> None:
    for error, retries in ((hfg.errors.FiringTimeout, 2), (OSError, 0)):
        graph = hfg.Graph()
        options: dict[str, Any] = {"max_duration_s": 0.5, "retries": 2, "retry_on": error, "on_error": "skip"}
        node = graph.add(Device(), **options)
        graph.connect(graph.add(numbers(count=1)).out, node.value)
        assert run(graph).nodes["device"].retries == retries


@pytest.mark.rule("X1", "L4")
def test_a_file_names_them_and_brings_no_code_with_it(tmp_path: Path) -> None:
    graph = hfg.Graph()
    node = graph.add(asks(), name="asks", retries=2, retry_on=(NoAnswer, OSError, "not.loaded:Strange"))
    graph.connect(graph.add(numbers(count=1)).out, node.value)
    file = tmp_path / "asks.hfg.yaml"
    hfg.save(graph, file)
    assert f"- {__name__}:NoAnswer" in file.read_text()
    again = hfg.load(file)
    assert again["asks"]._options == node._options
    assert "not.loaded" not in sys.modules
    file.write_text(file.read_text().replace("OSError", "OSEror"))
    with pytest.raises(hfg.errors.FileError, match='retry_on names "OSEror", and there is no such error'):
        hfg.load(file)


@pytest.mark.rule("X1", "R4", "G1")
def test_edits_copies_and_boxes_keep_them() -> None:
    graph = hfg.Graph()
    options: NodeGiven = {"retries": 1, "retry_on": [f"{__name__}:NoAnswer"]}
    graph.edit(commands.Add(named(asks), "asks", options=options))
    wanted = graph["asks"]._options
    assert wanted.retry_on == (f"{__name__}:NoAnswer",)
    graph.edit(commands.Copy("asks", "more"))
    assert graph["more"]._options == wanted
    graph.edit(commands.Enclose(("more",), "box"))
    assert graph["box/more"]._options == wanted
    graph.undo()
    graph.undo()
    assert commands.decode(commands.encode([commands.Add(named(asks), "twin", options=options)]))
