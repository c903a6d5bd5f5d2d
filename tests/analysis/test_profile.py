"""A profile keeps how long nodes took in a run, and what is none is refused in a sentence."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import hfg
from hfg.analysis import Measured, Profile, analyse_time
from hfg.errors import UsageError
from hfg.testing.nodes import double, script, sink


def doubling() -> hfg.Graph:
    graph = hfg.Graph("doubling")
    source = graph.add(script(), max_rate_hz=10)
    _ = source >> graph.add(double()) >> graph.add(sink(), deadline_s=0.5)
    return graph


def test_a_profile_of_a_run_is_read_as_it_was_saved_and_bounds_the_ways(tmp_path: Path) -> None:
    graph = doubling()
    runs: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        run.statistics()
        runs.append(run)

    hfg.run(graph, clock="virtual", begin=begin)
    profile = Profile.of(graph, runs[0].statistics())
    assert list(profile.nodes) == ["script", "double", "sink"]
    assert all(one.count and 0 <= one.mean_s <= one.max_s for one in profile.nodes.values())
    profile.save(tmp_path / "profile.json")
    assert Profile.load(tmp_path / "profile.json") == profile
    (path,) = analyse_time(graph, profile.durations(graph)).paths
    assert path.within_s == pytest.approx(sum(one.max_s for one in profile.nodes.values()))


def test_a_profile_of_another_graph_is_refused_and_nodes_that_are_gone_are_left_out() -> None:
    taken = Measured(count=1, mean_s=0.1, p99_s=0.1, max_s=0.2)
    assert Profile("old", {"double": taken, "gone": taken}).durations(doubling()) == {"double": 0.2}
    with pytest.raises(UsageError, match='is of graph "old", and knows no node of graph "doubling"; measure one'):
        Profile("old", {"gone": taken}).durations(doubling())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "cannot be read: No such file or directory; measure one with hfg run --profile"),
        ("{", '" is not a profile: Input data was truncated; measure one'),
        ("[" * 5000, '" is not a profile: '),
        ("\udcff", '" is not a profile: '),
        ('{"graph": "a"}', "missing required field `nodes`"),
        ('{"graph": "a", "nodes": {"b": {"count": 1, "mean_s": 0, "p99_s": 0, "max_s": -1}}}', ">= 0.0"),
        ('{"graph": "a", "nodes": {"b": {"count": 1, "mean_s": NaN, "p99_s": 0, "max_s": 1}}}', "is not a profile"),
    ],
)
def test_what_is_no_profile_is_refused_with_the_reason(tmp_path: Path, text: str | None, sentence: str) -> None:
    file = tmp_path / "profile.json"
    if text is not None:
        file.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(UsageError, match=re.escape(sentence)):
        Profile.load(file)


def test_a_profile_that_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_GRAPH_FILE_BYTES", "10")
    (tmp_path / "profile.json").write_text('{"graph": "a", "nodes": {}}')
    with pytest.raises(UsageError, match=r"is too large: the limit is 10"):
        Profile.load(tmp_path / "profile.json")
