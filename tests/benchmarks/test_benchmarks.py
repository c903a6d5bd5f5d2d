"""The benchmarks run, at sizes that say nothing about time; what they write becomes the page's tables."""

from __future__ import annotations

import importlib
import json
import linecache
import math
import re
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

import pytest

from benchmarks import (
    bench_goals,
    bench_links,
    bench_missions,
    bench_peers,
    bench_robot,
    bench_start,
    bench_studio,
    bench_viewers,
    figures,
    page,
    profile_hop,
    threaded,
)
from benchmarks.__main__ import SUITES
from benchmarks.goals import Goal, Side, judge, verdicts
from benchmarks.measure import BEFORE, ROOT, Record, measure, one, read, write
from benchmarks.meters import Arrivals, Laps
from benchmarks.nodes import through
from benchmarks.ours import Kind, run
from benchmarks.parcels import Job, Post
from benchmarks.sampler import Sampler
from benchmarks.works import WORKS

MODULES = {name: importlib.import_module(f"benchmarks.{name}") for name in (*SUITES, "bench_peers", "bench_goals")}
LONGEST = 1_000  # ten thousand nodes take a second to build and run
TOKENS = 12


def cases() -> Iterator[tuple[str, str]]:
    """Name every case that is small enough."""
    for name, suite in MODULES.items():
        for case in suite.CASES:
            length = case.rpartition(" | ")[2]
            if not (length.isdigit() and int(length) > LONGEST and case.startswith("hop")):
                yield name, case


@pytest.mark.slow
@pytest.mark.parametrize(("suite", "case"), list(cases()))
def test_every_case_runs_at_a_tiny_size(suite: str, case: str) -> None:
    figures = (
        MODULES[suite]
        .CASES[case]
        .run({"bench_threads": 2, "bench_start": 1, "bench_robot": 6, "bench_tuning": 2}.get(suite, TOKENS))
    )
    values = list(figures.values()) if isinstance(figures, dict) else [figures]
    assert values
    assert all(math.isfinite(value) for value in values)


def test_all_works_are_done_by_somebody() -> None:
    done = {case.rpartition(" | ")[2] for suite in ("bench_kinds", "bench_peers") for case in MODULES[suite].CASES}
    assert done == set(WORKS)


def test_every_peer_takes_part_or_is_named_as_missing() -> None:
    rows = {case.partition(" | ")[0] for case in bench_peers.CASES}
    for peer in {"csp", "aiostream", "streamz", "ezmsg", "transitions", "py_trees"}:
        assert (peer in rows) != (f"{peer} is not installed" in bench_peers.MISSING), peer


@pytest.mark.parametrize(
    "suite", [bench_goals, bench_links, bench_missions, bench_robot, bench_start, bench_studio, bench_viewers]
)
def test_every_goal_has_its_cases_or_the_reason_why_not(suite: Any) -> None:
    assert suite.GOALS
    for goal in suite.GOALS:
        for side in goal.sides:
            assert (side.case in suite.CASES) != (side.case in suite.SKIPPED), side.case


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        "hfg edge, window 8 | 100 B, rate",
        "hfg edge, latest | leaky, 6.2 MB, latency",
        "hfg link, window 8 | 100 B, latency",
        "hfg publish and subscribe, window 8 | 100 B, rate",
        "Zenoh, express puts | 100 B, rate",
        "shared memory and semaphores | 6.2 MB, rate",
    ],
)
def test_what_one_process_sends_another_has(case: str) -> None:
    figures = bench_links.CASES[case].run(TOKENS)
    assert isinstance(figures, dict)
    assert 0 < figures["p50"] <= figures["p99"]
    assert ("wall" in figures) == case.endswith("rate")
    assert figures["lost"] == 0 or "leaky" in case


def test_letters_that_are_lost_count_only_where_they_may_be() -> None:
    lossless, leaky = Post(Job("letter", 5)), Post(Job("letter", 5, leaky=True))
    for number in (-1, 0, 1, 2):
        lossless.take(number, 0)
    with pytest.raises(RuntimeError, match="number 4 has arrived behind 2"):
        lossless.take(4, 0)
    with pytest.raises(RuntimeError, match="3 of 5 have arrived"):
        lossless.figures()
    for number in (0, 1, 2, 4):
        leaky.take(number, 0)
    assert leaky.is_over
    assert leaky.figures()["lost"] == pytest.approx(20)


def test_rates_and_ages_and_losses_stand_in_one_cell() -> None:
    rate = RECORD._replace(figures={"wall": [10.0, 20.0], "p50": [300.0, 300.0], "p99": [1.0, 1.0], "lost": [0.0, 0.0]})
    age = RECORD._replace(figures={"p50": [300.0, 330.0], "p99": [1.0, 1.0], "lost": [0.0, 0.0]})
    assert page.arrival(rate) == "66,667 (67%)"
    assert page.arrival(age) == "315 / 1.00 (10%)"
    rate.figures["lost"] = [50.0, 50.0]
    assert page.arrival(rate) == "66,667 (67%), 300 µs old; 50.0 % lost"


@pytest.mark.slow
def test_the_camera_finds_the_same_in_groups_as_by_hand() -> None:
    grouped: list[Any] = []
    alone: list[Any] = []
    threaded.by_groups(1, grouped.append)
    threaded.by_hand(1, alone.append)
    assert [(sight.name, sight.circles, sight.lines) for sight in grouped] == [
        (sight.name, sight.circles, sight.lines) for sight in alone
    ]
    assert sum(len(sight.circles) + len(sight.lines) for sight in alone) > 0


def test_a_goal_compares_the_figures_of_the_same_round() -> None:
    ours = RECORD._replace(case="ours", figures={"wall": [1.0, 1.0, 1.0], "cpu": [1.0, 4.0, 30.0]})
    theirs = RECORD._replace(case="theirs", figures={"cpu": [2.0, 4.0, 10.0]})
    records = {record.case: record for record in (ours, theirs)}
    verdict = judge(Goal("a goal", Side("ours"), Side("theirs"), 1.0), records)
    assert verdict.judged == [0.5, 1.0, 3.0]
    assert verdict.reached
    assert not judge(Goal("a goal", Side("ours"), Side("theirs"), 0.99), records).reached
    assert not judge(Goal("a goal", Side("ours"), 2.0, 1.9), records).reached
    assert judge(Goal("a goal", Side("ours"), Side("theirs"), 4.0, alone=True), records).judged == [1.0, 4.0, 30.0]


def test_the_table_of_goals_names_what_was_not_measured() -> None:
    ours = RECORD._replace(case="ours", figures={"cpu": [1.0, 4.0, 30.0]})
    goals = [
        Goal("far away", Side("ours"), 2.0, 1.0),
        Goal("near", Side("ours"), 8.0, 1.0),
        Goal("unknown", Side("ours"), Side("theirs"), 1.0),
    ]
    text = verdicts(goals, [ours], {"theirs": "Traceback ...\nNotImplementedError: it cannot"}).splitlines()
    assert text[1].split() == ["far", "away", "4.00", "2.00", "us", "2.00", "0.50", "to", "15.0", "1", "no"]
    assert text[2].split() == ["near", "4.00", "8.00", "us", "0.50", "0.12", "to", "3.75", "1", "yes"]
    assert text[3].strip() == "unknown  not measured: theirs: NotImplementedError: it cannot"
    assert text[4].strip() == "1 of 2 goals reached; 1 not measured"


@pytest.mark.slow
def test_another_checkout_is_measured_in_turn() -> None:
    case = bench_goals.AGAINST[1]
    said: list[str] = []
    records = measure("bench_goals", 1, said.append, only=[case], quick=True, against=ROOT)
    assert [record.case for record in records] == [case, BEFORE + case]
    assert [record.size for record in records] == [1_000, 1_000]
    assert all(record.median > 0 for record in records)


def test_what_is_complete_counts_when_somebody_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []

    def one(suite: str, case: str, size: int, engine: Path | None) -> dict[str, float]:
        if len(said) == 4:
            raise KeyboardInterrupt
        return {"cpu": float(len(said))}

    monkeypatch.setattr("benchmarks.measure.one", one)
    cases = list(bench_goals.CASES)[:2]
    records = measure("bench_goals", 3, said.append, only=cases)
    assert {record.case: record.values for record in records} == {cases[0]: [1.0], cases[1]: [2.0]}


@pytest.mark.slow
def test_a_folder_without_hfg_is_not_measured(tmp_path: Path) -> None:
    failed: dict[str, str] = {}
    said: list[str] = []
    case = bench_goals.AGAINST[1]
    records = measure("bench_goals", 1, said.append, only=[case], quick=True, against=tmp_path, failed=failed)
    assert [record.case for record in records] == [case]
    assert "there is no hfg in" in failed[BEFORE + case]


@pytest.mark.slow
def test_a_case_is_measured_by_a_process_of_its_own() -> None:
    figures = one("bench_shape", "build and check | 100")
    assert figures["wall"] > 0


@pytest.mark.slow
def test_a_case_that_fails_says_which_and_why() -> None:
    with pytest.raises(RuntimeError, match=r"(?s)bench_nothing: a case failed:.*ModuleNotFoundError"):
        one("bench_nothing", "a case")


def test_nobody_is_fast_by_losing_tokens() -> None:
    meter = Arrivals(3)
    meter.take(0)
    with pytest.raises(RuntimeError, match="1 of 3 tokens have arrived"):
        meter.figures()
    laps = Laps(3)
    laps.lap()
    with pytest.raises(RuntimeError, match="0 of 3 rounds"):
        laps.figures(1)


RECORD = Record("suite", "case", "us", 10, {"median": [2.0, 4.0, 3.0], "p99": [5.0, 5.0, 5.0]}, "m", {}, (0.0, 1.0))


def test_lines_come_back_as_they_were_written(tmp_path: Path) -> None:
    write(tmp_path, [RECORD])
    again = read((tmp_path / "suite.jsonl").read_text().splitlines())["suite"]["case"]
    assert again == RECORD
    assert again.median == 3.0
    assert again.spread == pytest.approx(2 / 3)


def test_a_cell_shows_median_and_spread() -> None:
    assert figures.cell(RECORD) == "3.00 / 5.00 (67%)"


def test_the_page_is_made_from_the_lines_beside_it() -> None:
    text = page.PAGE.read_text(encoding="utf-8")
    lines = page.SOURCE.read_text(encoding="utf-8").splitlines()
    assert page.render(text, read(lines)) == text, "run python -m benchmarks.page, or make bench-docs"


def test_the_page_has_every_table_once() -> None:
    names = [match["name"] for match in page.BLOCK.finditer(page.PAGE.read_text(encoding="utf-8"))]
    assert sorted(names) == sorted(page.TABLES)
    suites = {json.loads(line)["suite"] for line in page.SOURCE.read_text(encoding="utf-8").splitlines()}
    assert suites == {suite for suite, _ in page.TABLES.values()}


def test_samples_are_sorted_into_parts_by_their_innermost_line() -> None:
    """The lines are those that the engine writes for the chain now: a part that no line falls into has gone stale."""
    meter = Arrivals(2_000)
    run(Kind("function", through).chain_graph(3, 2_000, meter))
    name = next(name for name in reversed(linecache.cache) if "hfg region" in name)
    code = linecache.getlines(name)
    wave = range(next(n for n, line in enumerate(code, 1) if "def wave" in line), len(code) + 1)
    outer = "<module> (bench.py:1);Engine._drain (engine/engine.py:1)"
    found = profile_hop.shares(
        [
            *(f"{outer};build.<locals>.wave ({name}:{line}) 1" for line in wave),
            f"{outer};build.<locals>.wave ({name}:{wave[0]});through (benchmarks/nodes.py:1) 4",
            f"{outer} 1",
            f"{outer};_step (engine/rules/firing.py:1) 1",
            f"{outer};speak (engine/rules/errors.py:1) 1",
            "<module> (bench.py:1) 100",
        ],
        {name: code},
    )
    assert all(found.values()), found
    assert sum(found.values()) == pytest.approx(100)
    calls = sum(1 for line in code if re.search(r"= f\d+\(|= next\(", line))
    assert found["your function: its call and its return"] == pytest.approx(100 * (4 + calls) / (len(wave) + 7))


def test_a_profile_that_met_nothing_is_an_error() -> None:
    with pytest.raises(RuntimeError, match=r"Engine\._drain"):
        profile_hop.shares(["<module> (bench.py:1) 100"])


@pytest.mark.parametrize(
    ("files", "share"),
    [
        (["/there/hfg/engine/rules/firing.py"], 100),
        (["<hfg region 1> from chain/first"], 100),
        (["/there/hfg/engine/rules/firing.py", "/there/examples/robot.py"], 0),
        (["<hfg region 1> from chain/first", "/there/hfg/nodes/cv/_blur.py", "/lib/numpy/core.py"], 0),
        (["/there/examples/robot.py", "/there/hfg/ports/ports.py", "/lib/asyncio/events.py"], 100),
    ],
)
def test_time_belongs_to_the_innermost_lines_that_are_of_the_framework_or_of_a_node(
    files: list[str], share: float
) -> None:
    """Each file calls the next one, and the last one is busy for a while."""
    inner: Any = None
    for file in reversed(files):
        names: dict[str, Any] = {"inner": inner, "process_time": process_time}
        busy = "    until = process_time() + 0.03\n    while process_time() < until: pass"
        exec(compile(f"def call():\n{'    inner()' if inner else busy}", file, "exec"), names)
        inner = names["call"]
    sampler = Sampler()
    with sampler:
        sampler.begin()
        inner()
    assert sampler.share() == pytest.approx(share, abs=10)  # the calls that lead there take some time, too
    assert 0.005 < sampler.seconds < 0.2


def test_figures_of_a_busy_machine_say_so() -> None:
    quiet = Record("suite", "case", "us", 10, {"wall": [1.0], "cpu": [1.0]}, "m", {}, (0.5, 1.0))
    slow = quiet._replace(figures={"wall": [2.0], "cpu": [1.0]})
    assert figures.WARNING not in figures.caption({"case": quiet})
    assert figures.WARNING in figures.caption({"case": slow})
    assert figures.WARNING in figures.caption({"case": quiet._replace(load=(7.0, 7.0))})
