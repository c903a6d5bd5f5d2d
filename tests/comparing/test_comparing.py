"""Two runs are compared by what a recording holds: the first token that differs, counts, activity, scores, graphs."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import pytest

import hfg
from hfg.comparing import Comparison, compare, page, read_recording, read_report, run_both
from hfg.engine.observing.encoding import encode
from hfg.errors import UsageError

pytestmark = pytest.mark.slow


@hfg.node
def numbers(*, count: int = 5, odd_one: int = -1, seed: int = 0) -> Iterator[int]:
    for number in range(count):
        yield 100 if number == odd_one else number + seed


class Alarm(hfg.Node):
    """Is active from the first number above its limit on."""

    limit = hfg.Parameter(2)
    number = hfg.Input(int)
    loud = hfg.Event(int)

    def process(self, number: int) -> None:
        if number > self.limit:
            self.loud.trigger(number, activity=1)


class Siren(hfg.Node):
    @hfg.slot
    def ring(self, number: int) -> None: ...


class Handle:
    """Something that is no data."""


@hfg.node
def handles() -> Iterator[Handle]:
    yield Handle()


def build(count: int = 5, odd_one: int = -1, limit: int = 2) -> hfg.Graph:
    graph = hfg.Graph("alarm")
    source = graph.add(numbers(count=count, odd_one=odd_one), name="numbers", max_rate_hz=10)
    alarm, siren = graph.add(Alarm(limit=limit), name="alarm"), graph.add(Siren(), name="siren")
    graph.connect(source.out, alarm.number)
    alarm.loud.activates(siren.ring)
    graph.connect(source.out, graph.output("last", int))
    return graph


def compared(folder: Path, *, seeds: Sequence[int] = (), **other: int) -> Comparison:
    builds = (build, lambda: build(**other))
    return compare(*run_both("ab", builds, folder, scores=["last"], seeds=seeds))


def recorded(graph: hfg.Graph, file: Path) -> hfg.Report:
    return hfg.run(graph, clock="virtual", begin=lambda run: run.record(file))


def test_equal_runs_differ_in_nothing(tmp_path: Path) -> None:
    found = compared(tmp_path)
    assert not found.differs
    assert "nothing differs" in list(found.lines())


def test_the_first_token_that_differs_is_named_with_edge_number_stamp_and_both_values(tmp_path: Path) -> None:
    first = compared(tmp_path, odd_one=1).first
    assert first is not None
    assert (first.port, first.turn) == ("numbers.out", 2)
    assert "numbers.out -> alarm.number" in first.edges
    assert first.a is not None
    assert first.b is not None
    assert (first.a.number, first.a.stamp_s, first.a.value) == (2, 0.1, "1")
    assert (first.b.number, first.b.stamp_s, first.b.value) == (2, 0.1, "100")


def test_a_token_that_is_sent_at_another_time_differs(tmp_path: Path) -> None:
    """Its value and its stamp are those of what it was made from, and equal."""

    class Slow(hfg.Node):
        seconds = hfg.Parameter(0.1)

        async def process(self, number: int) -> int:
            await asyncio.sleep(self.seconds)
            return number

    def slowed(seconds: float) -> hfg.Graph:
        graph = hfg.Graph("slowed")
        slow = graph.add(Slow(seconds=seconds), name="slow")
        graph.connect(graph.add(numbers(count=1)).out, slow.ports.inputs["number"])
        graph.connect(graph["slow.out"], graph.output("late", int))
        return graph

    first = compare(*run_both("ab", (lambda: slowed(0.1), lambda: slowed(0.2)), tmp_path)).first
    assert first is not None
    assert first.a is not None
    assert first.b is not None
    assert (first.port, first.a.value, first.a.stamp_s == first.b.stamp_s) == ("slow.out", first.b.value, True)
    assert (first.a.sent_s, first.b.sent_s) == (0.1, 0.2)


def test_a_side_that_sends_less_differs_where_it_ends(tmp_path: Path) -> None:
    found = compared(tmp_path, count=3)
    assert found.first is not None
    assert found.first.b is None or found.first.b.value == "END"
    assert found.counts is not None
    assert ("numbers: firings", 6, 4) in [(row.what, row.a, row.b) for row in found.counts]


def test_activity_that_differs_is_told_with_its_time(tmp_path: Path) -> None:
    found = compared(tmp_path, limit=3)
    assert found.activity is not None
    (row,) = (row for row in found.activity if row.node == "siren")
    assert row.differs_at_s == pytest.approx(0.3)
    assert any("siren" in line and "█" in line for line in found.lines())


def test_graphs_that_differ_are_told_as_commands(tmp_path: Path) -> None:
    found = compared(tmp_path, limit=3)
    assert found.graph is not None
    assert [line[:2] for line in found.graph] == ["- ", "+ "]
    assert '"limit":3' in found.graph[1]


def test_scores_of_the_same_seeds_are_compared_in_pairs(tmp_path: Path) -> None:
    """Seeds spread the scores far more than the change does; each pair has the same change."""
    (row,) = compared(tmp_path, seeds=[1, 20, 300], count=7).scores
    assert row.a.within > 100
    assert (row.change.value, row.change.within) == (2, 0)
    assert row.is_certain


def test_a_run_that_fails_is_compared_as_far_as_it_came(tmp_path: Path) -> None:
    def failing() -> hfg.Graph:
        graph = build()

        @hfg.node
        def fails(number: int) -> None:
            if number == 2:
                raise ValueError("two")

        graph.connect(graph["numbers.out"], graph.add(fails()).number)
        return graph

    found = compare(*run_both("ab", (build, failing), tmp_path))
    assert found.sides[1].outcome == "failed"
    assert "two" in found.sides[1].why
    assert found.ports is not None


def test_a_recording_and_a_report_are_sides(tmp_path: Path) -> None:
    for name, odd_one in (("a", -1), ("b", 3)):
        report = recorded(build(odd_one=odd_one), tmp_path / f"{name}.mcap")
        (tmp_path / f"{name}.json").write_bytes(encode(report))
    a, b = (read_recording(tmp_path / f"{name}.mcap", scores=["numbers.out.max"]) for name in "ab")
    found = compare(a, b)
    assert found.first is not None
    assert found.first.turn == 4
    assert [(row.a.value, row.b.value) for row in found.scores] == [(4, 100)]
    reports = compare(*(read_report(tmp_path / f"{name}.json") for name in "ab"))
    assert reports.counts == []
    assert "tokens, because not both sides are recorded" in reports.notes


def test_ports_whose_values_are_not_data_are_named_and_left_out(tmp_path: Path) -> None:
    def with_handles() -> hfg.Graph:
        graph = build()
        graph.connect(graph.add(handles()).out, graph.output("handle", Handle))
        return graph

    found = compare(*run_both("ab", (with_handles, with_handles), tmp_path))
    assert not found.differs
    assert any('"handles.out"' in note for note in found.notes)


@pytest.mark.rule("L4")
@pytest.mark.parametrize("text", [b"", b"[]", b'{"outcome": 1}', b"[" * 100_000, b"\xff"])
def test_a_file_that_is_no_report_is_refused_in_a_sentence(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "x.json").write_bytes(text)
    with pytest.raises(UsageError, match="is not the report of a run"):
        read_report(tmp_path / "x.json")


def test_the_page_shows_both_and_takes_names_as_text(tmp_path: Path) -> None:
    one, other = run_both(("<script>", "b"), (build, lambda: build(limit=3)), tmp_path)
    text = page(compare(one, other))
    assert "&lt;script&gt;" in text
    assert "<script>alert" not in text
    assert "Who was active, and when" in text
    assert msgspec.json.decode(encode(compare(one, other)))["first"]["port"] == "alarm.loud"
