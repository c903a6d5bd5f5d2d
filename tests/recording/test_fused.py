"""A recording of fused regions is that of the nodes one by one, message by message: waves are told of together (R7)."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

import hfg
from hfg.engine.runtime import settings
from hfg.recording import record
from hfg.recording.messages import ITEM
from hfg.recording.recorder import Recorder
from hfg.testing import nodes, reference_run
from hfg.testing.reference.structure import dissolve
from tests.support.making import SYNCHRONOUS, Allowed, random_plan

MOST_MOVES = 1500
CHAINS = replace(SYNCHRONOUS, plain=True, failures=True, rates=False, boxes=False)
ALLOWED = (
    Allowed(),
    Allowed(plain=True, max_nodes=10),
    *(replace(CHAINS, max_nodes=many) for many in (6, 10, 14)),
)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


@pytest.fixture
def waves(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many tokens the recorder was told of together, each time."""
    told: list[int] = []
    put = Recorder._put_wave

    def noted(self: Recorder, items: tuple[Any, ...]) -> None:
        told.append(len(items) // ITEM)
        put(self, items)

    monkeypatch.setattr(Recorder, "_put_wave", noted)
    return told


def recorded(graph: hfg.Graph, file: Path, *, fast: bool) -> tuple[str, list[tuple[str, int, bytes]]]:
    """Run it in virtual time; give how it ended and what was written, in its order."""
    how = "done"
    try:
        hfg.run(graph, clock="virtual", fast=fast, until_s=30.0, begin=lambda run: record(run, file, force=True))
    except (hfg.errors.Stalled, hfg.errors.RunError, hfg.errors.NodeError) as error:
        how = f"{type(error).__name__}: {error}"
    with file.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return how, [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def comes_to_an_end(graph: hfg.Graph, seed: int) -> bool:
    try:
        reference_run(graph, seed=seed, max_moves=MOST_MOVES)
    except RuntimeError:
        return False
    return True


def differs(seed: int, allowed: Allowed, file: Path) -> str:
    """Record one random graph interpreted and fused; what is not the same."""
    plan = random_plan(seed, allowed)
    if not comes_to_an_end(plan.build(), seed):
        return ""
    one, other = recorded(plan.build(), file, fast=False), recorded(plan.build(), file, fast=True)
    leaves = dissolve(plan.build()).leaves
    if sum(leaf.node._type.process_kind.startswith("async") for leaf in leaves) >= 2:  # who is first is left open (R2)
        one, other = (one[0], sorted(one[1])), (other[0], sorted(other[1]))
    if one == other:
        return ""
    at = next((n for n, (a, b) in enumerate(zip(one[1], other[1], strict=False)) if a != b), -1)
    return f"{plan}\n{one[0]}, {other[0]}; at message {at}:\n  {one[1][at:][:3]}\n  {other[1][at:][:3]}"


@pytest.mark.slow
@pytest.mark.rule("R7", "F7", "R2")
@pytest.mark.parametrize("block", range(4))
def test_random_graphs_are_recorded_alike_fused_and_interpreted(
    block: int, tmp_path: Path, waves: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    if block % 2:  # then values of what is declared Any are not copied, so that more is told of together
        monkeypatch.setattr("hfg.recording.messages.is_plain", lambda _hint: True)
    logging.disable(logging.CRITICAL)
    try:
        for seed in range(block * 40, block * 40 + 40):
            found = differs(seed, ALLOWED[seed % len(ALLOWED)], tmp_path / "run.mcap")
            assert not found, f"seed {seed}: {found}"
    finally:
        logging.disable(logging.NOTSET)
    assert sum(waves) > (40 if block % 2 else 3)


@hfg.node
def fails_at_five(value: int) -> int:
    if value == 5:
        raise ValueError("five")
    return value


@hfg.node
def some_text(value: int) -> str:
    return f"number {value}"


@pytest.mark.rule("R7", "X1")
def test_what_has_passed_before_an_error_in_the_middle_of_a_wave_is_recorded(tmp_path: Path, waves: list[int]) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(nodes.script(values=(1, 5, None, 2)), name="source")
        twice = graph.add(nodes.double(), name="twice")
        fails = graph.add(fails_at_five(), name="fails", on_error="skip")
        back = graph.add(nodes.double(), name="back")
        source >> twice >> graph.add(nodes.sink(), name="end")
        source >> fails >> back >> graph.add(nodes.sink(), name="end_too")
        return graph

    logging.disable(logging.CRITICAL)
    try:
        interpreted = recorded(build(), tmp_path / "a.mcap", fast=False)
        assert not waves
        fused = recorded(build(), tmp_path / "b.mcap", fast=True)
    finally:
        logging.disable(logging.NOTSET)
    assert fused == interpreted
    assert len(waves) >= 3


@pytest.mark.rule("R7")
def test_a_port_whose_values_are_kept_stays_in_its_place_between_those_of_a_wave(tmp_path: Path) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(nodes.script(values=(3, 1, 2)), name="source")
        source >> graph.add(nodes.double(), name="twice") >> graph.add(some_text(), name="text") >> graph.add(hear())
        return graph

    interpreted = recorded(build(), tmp_path / "a.mcap", fast=False)
    fused = recorded(build(), tmp_path / "b.mcap", fast=True)
    assert fused == interpreted
    assert [topic for topic, _, _ in fused[1] if topic.endswith(".out")][:3] == ["source.out", "twice.out", "text.out"]


class Passes(hfg.Node):
    """Whom a signal makes active, and who hands that on."""

    passed = hfg.Event(None)

    @hfg.slot
    def hear(self) -> None:
        """Pass it on."""
        self.passed.trigger()


@hfg.node
def hear(text: str) -> None:
    """Take it."""


@pytest.mark.rule("R7")
def test_on_the_real_clock_each_token_has_the_time_at_which_it_has_passed(tmp_path: Path, waves: list[int]) -> None:
    graph = hfg.Graph()
    passed: list[float] = []

    @hfg.node
    def late(value: int) -> int:
        passed.append(run_of[0].now())
        return value

    run_of: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        run_of.append(run)
        record(run, tmp_path / "a.mcap")

    source = graph.add(nodes.script(values=tuple(range(50))), name="source")
    source >> graph.add(nodes.double(), name="twice") >> graph.add(late(), name="late") >> graph.add(nodes.sink())
    hfg.run(graph, begin=begin)
    with (tmp_path / "a.mcap").open("rb") as stream:
        times = {"source.out": [], "twice.out": [], "late.out": []}  # type: dict[str, list[int]]
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.topic in times:
                times[channel.topic].append(message.log_time)
    assert max(waves) == 3
    before, after = times["twice.out"], times["late.out"]
    assert len(before) == len(after) == len(passed) == 50
    for twice_at, called_at, late_at in zip(before, passed, after, strict=True):
        assert twice_at <= called_at * 1e9 + 1000  # nanoseconds of a float of seconds since 1970 end in noise
        assert called_at * 1e9 - 1000 <= late_at


def both(build: Callable[[], hfg.Graph], folder: Path) -> tuple[list[tuple[str, int, bytes]], ...]:
    """What is written of a graph interpreted, and as it goes when nobody looks."""
    return tuple(recorded(build(), folder / f"{fast}.mcap", fast=fast)[1] for fast in (False, True))


@pytest.mark.rule("R7", "A5", "A6")
def test_activity_that_goes_from_slot_to_slot_is_recorded_on_the_fast_path_too(tmp_path: Path) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        first, second = graph.add(Passes(), name="first"), graph.add(Passes(), name="second")
        graph.connect(graph.start, first.hear, active=True)
        graph.connect(first.passed, second.hear, active=True)
        return graph

    interpreted, fast = both(build, tmp_path)
    assert fast == interpreted
    changes = [json.loads(data) for _, _, data in fast if b"ActivityChanged" in data]
    assert [(one["node"], one["active"]) for one in changes] == [("first", True), ("first", False), ("second", True)]


@pytest.mark.rule("R7", "F9")
def test_signals_of_a_slot_that_a_wave_calls_are_recorded_with_the_numbers_of_their_calls(tmp_path: Path) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, relay = graph.add(nodes.script(values=(1, 2, 3)), name="source"), graph.add(nodes.Relay(), name="relay")
        graph.connect(source.out, relay.say)
        graph.connect(relay.said, graph.add(nodes.sink(), name="end").value)
        return graph

    interpreted, fast = both(build, tmp_path)
    assert fast == interpreted
    assert [json.loads(data)["call"] for topic, _, data in fast if topic == "relay.said"] == [1, 2, 3]


@pytest.mark.rule("R2", "F1", "F4")
def test_an_end_that_its_own_firing_frees_does_not_let_a_node_pass_those_who_wait(tmp_path: Path) -> None:
    """Last words keep END waiting until they are processed; who processes them is still busy when END comes."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, counter = graph.add(nodes.script(values=(1, 2, 3)), name="source"), graph.add(nodes.Counter(), name="c")
        graph.connect(source.out, counter.value)
        graph.connect(counter.out, graph.add(nodes.double(), name="behind").value)
        graph.connect(source.out, graph.add(nodes.sink(), name="beside").value, buffer=3)
        return graph

    interpreted, fast = both(build, tmp_path)
    assert fast == interpreted
    ended = [json.loads(data)["node"] for _, _, data in fast if b"NodeEnded" in data]
    assert ended == ["source", "c", "beside", "behind"]


@pytest.mark.rule("R7", "R4")
def test_who_stops_looking_amid_a_wave_is_told_of_what_has_passed_before(tmp_path: Path, waves: list[int]) -> None:
    recordings: list[Any] = []

    @hfg.node
    def stops(value: int) -> int:
        if value == 6:
            recordings[0].stop()
        return value

    def begin(run: hfg.Run) -> None:
        recordings.append(record(run, tmp_path / "a.mcap"))

    graph = hfg.Graph()
    source = graph.add(nodes.script(values=(1, 2, 3, 4, 5)), name="source")
    twice, stopping, end = graph.add(nodes.double(), name="twice"), graph.add(stops()), graph.add(nodes.Tally())
    graph.connect(source.out, twice.value)
    graph.connect(twice.out, stopping.ports.inputs["value"])
    graph.connect(stopping.ports.outputs["out"], end.value)
    hfg.run(graph, clock="virtual", begin=begin)
    assert end.count == 5
    assert waves
    recordings[0]._writer.join()
    found: dict[str, list[int]] = {}
    with (tmp_path / "a.mcap").open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append(json.loads(message.data).get("value"))
    assert found["stops.out"] == [2, 4]
    assert found["twice.out"][:2] == [2, 4]
