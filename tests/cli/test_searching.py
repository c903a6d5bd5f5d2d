"""`hfg tune`, `hfg sweep` and `hfg compare` as their user meets them: tables, journals, pages, wrong use."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Command

pytestmark = pytest.mark.slow

HILL = '''
"""The lowest place is at 1."""
import math
import os
import signal

from annotated_types import Interval

import hfg
from hfg import monitors as m


class Hill(hfg.Node):
    x = hfg.Parameter(0.0, Interval(ge=-5, le=5))
    free = hfg.Parameter(1.0)
    trap = hfg.Parameter("none", choices=("none", "error", "kill", "nan"))
    seed = hfg.Parameter(1)
    height = hfg.Output(float)

    def process(self):
        if self.x > 3 and self.trap == "error":
            raise ValueError("too far")
        if self.x > 3 and self.trap == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        self.height.send(math.nan if self.trap == "nan" else (self.x - 1) ** 2 + 0.01 * self.seed)
        raise hfg.EndOfStream


def build(trap: str = "none") -> hfg.Graph:
    graph = hfg.Graph("hill")
    graph.connect(graph.add(Hill(trap=trap), name="hill").height, graph.output("score", float))
    return graph


def high():
    return {"high": m.never(m.sent("hill.height", lambda height: height > 9))}


number = 3
'''
SEARCH = ("--minimize", "score", "--evaluations", "12", "--processes", "2")


@pytest.fixture
def hfg(command: Command) -> Command:
    """Give the command, in a folder with `hill.py`."""
    Path("hill.py").write_text(HILL, encoding="utf-8")
    return command


def told(shown: Any) -> Any:
    assert shown.code == 0, shown.err
    return json.loads(shown.out)


def test_tune_tells_the_best_values_and_confirms_them(hfg: Command) -> None:
    shown = hfg("tune", "hill.py", "-p", "hill.x", *SEARCH, "--seeds", "1..2", "--confirm", "11..13", "--plot", "x.svg")
    assert shown.code == 0, shown.err
    assert shown.out.startswith("best: score 0.")
    assert "on 3 new seeds better in score by" in shown.out
    assert "outside the noise" in shown.out
    assert "times as fast as real time" in shown.err
    assert Path("x.svg").read_text().startswith("<svg")


def test_tune_continues_from_its_journal(hfg: Command) -> None:
    search = ("tune", "hill.py", "-p", "hill.x=-2..2", *SEARCH, "--journal", "x.jsonl", "--json")
    first = told(hfg(*search))
    whole = Path("x.jsonl").read_bytes()
    Path("x.jsonl").write_bytes(whole[: len(whole) // 2])
    assert told(hfg(*search)) == first
    assert Path("x.jsonl").read_bytes() == whole


@pytest.mark.parametrize(("trap", "outcome"), [("error", "failed"), ("kill", "crashed")])
def test_candidates_that_fail_are_counted_and_kept_with_the_reason(hfg: Command, trap: str, outcome: str) -> None:
    found = told(hfg("tune", "hill.py", "-p", "hill.x=2..5", *SEARCH, "--arg", f"trap={trap}", "--json"))
    assert found["outcomes"][outcome] > 0
    assert found["best"]["values"]["hill.x"] <= 3


def test_a_search_in_which_every_score_is_nan_fails_and_says_so(hfg: Command) -> None:
    shown = hfg("tune", "hill.py", "-p", "hill.x", *SEARCH, "--arg", "trap=nan", "--confirm", "1")
    assert shown.code in (1, 2)
    shown = hfg("tune", "hill.py", "-p", "hill.x", *SEARCH, "--arg", "trap=nan")
    assert shown.code == 1
    assert 'score "score" is nan' in shown.out


def test_constraints_are_monitors(hfg: Command) -> None:
    found = told(hfg("tune", "hill.py", "-p", "hill.x=-5..5", *SEARCH, "--constraint", "hill:high", "--json"))
    assert found["outcomes"]["violated"] > 0


WRONG = [
    (("-p", "hill.y=0..1"), 'graph "hill" has no parameter "hill.y"'),
    (("-p", "hill.free"), 'parameter "hill.free" has no limits: write hill.free=LOW..HIGH'),
    (("-p", "hill.x=low..1"), '"hill.x=low..1" is not a range'),
    (("-p", "hill.x=-9..0"), "must be >= -5"),
    (("-p", "hill.x", "--method", "luck"), 'no method "luck"'),
    (("-p", "hill.x", "--seeds", "one"), '"one" is not a list of seeds'),
    (("-p", "hill.x", "--seeds", "1", "--confirm", "1"), "--confirm names seeds that the search uses"),
    (("-p", "hill.x", "--confirm", "7"), "runs without a seed are all the same"),
    (("-p", "hill.x", "--constraint", "hill:number"), "not a dict of monitors"),
    (("-p", "hill.x", "--constraint", "hill:nothing"), 'hill has no "nothing"'),
    (("-p", "hill.x", "--maximize", "hill.depth"), 'no score "hill.depth"'),
    (("-p", "hill.x", "--plot", "nowhere/x.svg"), '"nowhere/x.svg" cannot be written'),
    (("-p", "hill.x", "--journal", "nowhere/x.jsonl"), '"nowhere/x.jsonl" cannot be written'),
    (("-p", "hill.x", "--journal", "hill.py"), "not the journal of a search"),
]


@pytest.mark.parametrize(("options", "sentence"), WRONG)
def test_wrong_use_of_tune_is_one_sentence(hfg: Command, options: tuple[str, ...], sentence: str) -> None:
    shown = hfg("tune", "hill.py", "--minimize", "score", "--evaluations", "3", "--processes", "1", *options)
    assert shown.code == 2, shown
    assert sentence in shown.err
    assert "Traceback" not in shown.err
    assert shown.err.count("\n") == 1


# --- sweeps ---

TABLE = ("sweep", "hill.py", "-p", "hill.x=0,1", "--score", "score", "--seeds", "1..3")


def test_sweep_shows_means_with_their_intervals(hfg: Command) -> None:
    shown = hfg(*TABLE, "--fault", "hill.x=2@0")
    assert shown.code == 0, shown.err
    assert "1.02 ± 0.025" in shown.out
    assert shown.out.count("hill.x=2@0") == 2


def test_sweep_continues_from_its_journal(hfg: Command) -> None:
    sweep = (*TABLE, "--fault", "hill.x=2@0", "--journal", "x.jsonl", "--json")
    first = told(hfg(*sweep))
    whole = Path("x.jsonl").read_bytes()
    assert whole.count(b"\n") == 1 + 4 * 3
    Path("x.jsonl").write_bytes(whole[: len(whole) * 2 // 3])
    assert told(hfg(*sweep)) == first
    assert Path("x.jsonl").read_bytes() == whole
    shown = hfg(*TABLE, "--journal", "x.jsonl")
    assert shown.code == 2
    assert "its happenings is" in shown.err


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("-p", "hill.x=0..1"), "any number of values: list some"),
        (("-p", "hill.y=0,1"), 'no parameter "hill.y"'),
        (("--fault", "hill.jump@3"), 'node "hill" has no action "jump"'),
        (("--fault", "hill.x=2@soon"), 'after "@" stands a time'),
        (("--score", "hill.depth"), 'no score "hill.depth"'),
    ],
)
def test_wrong_use_of_sweep_is_one_sentence(hfg: Command, options: tuple[str, ...], sentence: str) -> None:
    shown = hfg("sweep", "hill.py", "--score", "score", *options)
    assert shown.code == 2, shown
    assert sentence in shown.err
    assert shown.err.count("\n") == 1


# --- comparisons ---


def test_compare_tells_what_differs_as_text_json_and_page(hfg: Command) -> None:
    both = ("compare", "steps.py:build", "steps.py:build", "--param-b", "steps.count=4")
    shown = hfg(*both, "--report", "x.html")
    assert shown.code == 0, shown.err
    assert 'first difference: token 5 of "steps.out"' in shown.out
    assert "number 5, sent at 0.800000 s: 4" in shown.out
    assert "Who was active" in Path("x.html").read_text()
    found = told(hfg(*both, "--json"))
    assert found["first"]["port"] == "steps.out"
    assert hfg(*both, "--exit-code").code == 1
    assert hfg("compare", "steps.py:build", "steps.py:build", "--exit-code").code == 0


def test_compare_reads_recordings_and_reports(hfg: Command) -> None:
    for count in ("4", "5"):
        options = ("steps.py:build", "--clock", "virtual", "--param", f"steps.count={count}")
        assert hfg("record", *options, "-o", f"{count}.mcap").code == 0
        Path(f"{count}.json").write_text(hfg("run", *options, "--json").out)
    shown = hfg("compare", "4.mcap", "5.mcap", "--score", "steps.out.sum")
    assert 'token 5 of "steps.out"' in shown.out
    assert "steps.out.sum" in shown.out
    assert "steps: firings" in hfg("compare", "4.json", "5.json").out
    assert 'token 5 of "steps.out"' in hfg("compare", "4.mcap", "steps.py:build").out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("nowhere.mcap", "hill.py"), "cannot open the recording nowhere.mcap"),
        (("hill.py", "nowhere.json"), 'the report "nowhere.json" cannot be read'),
        (("nowhere.py", "hill.py"), "nowhere.py"),
        (("hill.py", "hill.py", "--score", "hill.depth"), 'no score "hill.depth"'),
        (("hill.py", "hill.py", "--param-b", "hill.x=9"), "must be <= 5"),
        (("hill.py", "hill.py", "--report", "nowhere/x.html"), "cannot be written"),
        (("steps.py:build", "hill.py", "--seeds", "1..2"), 'no parameter "seed"'),
    ],
)
def test_wrong_use_of_compare_is_one_sentence(hfg: Command, arguments: tuple[str, ...], sentence: str) -> None:
    shown = hfg("compare", *arguments)
    assert shown.code == 2, shown
    assert sentence in shown.err
    assert "Traceback" not in shown.err
    assert shown.err.count("\n") == 1
