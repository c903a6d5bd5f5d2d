"""The verbs as their user meets them: exit codes, what is told where, options."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hfg.cli import main
from tests.cli.conftest import Command

GRAPH = '''
"""A graph for tests of the command line."""
from collections.abc import Iterator
from typing import Annotated

from annotated_types import Interval

import hfg


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    """Count from zero."""
    yield from range(count)


@hfg.node
def half(number: float, *, divisor: Annotated[int, Interval(ge=0, le=9)] = 2, label: str = "half") -> float:
    print(label, number)
    return number / divisor


@hfg.node
def pair(left: float, right: float) -> None: ...


graph = hfg.Graph("halves")
source = graph.add(numbers(), max_rate_hz=1)
node = graph.add(half())
graph.connect(source.out, node.number)


def unsound() -> hfg.Graph:
    graph = hfg.Graph("unsound")
    first, second = graph.add(half()), graph.add(half())
    graph.connect(first.out, second.number)
    graph.connect(second.out, first.number)
    return graph


def aborting() -> hfg.Graph:
    graph = hfg.Graph("aborting")
    graph.connect(graph.add(numbers()).processed, graph.abort)
    return graph
'''


@pytest.fixture
def hfg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Give the command, in a folder with `halves.py`."""
    (tmp_path / "halves.py").write_text(GRAPH, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return Command(capsys)


TARGET = "halves.py:graph"
VIRTUAL = ("--clock", "virtual")


def test_a_run_that_ends_well(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL)
    assert (shown.code, shown.out) == (0, "half 0\nhalf 1\nhalf 2\n")
    assert 'graph "halves": done after' in shown.err


def test_verbose_tells_of_nodes_and_twice_of_edges(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "-v")
    assert "firings" in shown.err
    assert "numbers.out -> half.number" not in shown.err
    assert "numbers.out -> half.number" in hfg("run", TARGET, *VIRTUAL, "-vv").err


def test_explain_tells_why_a_node_is_not_fused(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--explain")
    assert shown.code == 0
    assert "half" in shown.err
    assert "nodes are fused after" in " ".join(shown.err.split())


def test_a_violated_monitor_is_shown_and_exit_status_1(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--monitor", "few=never(sent(numbers.out, value == 1))")
    assert shown.code == 1
    assert 'monitor "few" is violated after' in shown.err


def test_a_monitor_that_holds_changes_nothing(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--monitor", "always(sent(numbers.out, value < 9) | fired(half))")
    assert (shown.code, shown.out) == (0, "half 0\nhalf 1\nhalf 2\n")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("never(sen(numbers.out))", 'monitor "monitor_1": line 1, column 7: a formula is expected, got "sen"'),
        ("it=never(sent(number.out))", 'there is no "number.out"'),
    ],
)
def test_a_monitor_that_cannot_judge_is_refused(hfg: Command, text: str, sentence: str) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--monitor", text)
    assert shown.code != 0
    assert sentence in " ".join(shown.err.split())


def test_json_has_standard_output_for_itself(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--json")
    report = json.loads(shown.out)
    assert (report["outcome"], report["nodes"]["half"]["failed"]) == ("done", 0)
    assert "half 2" in shown.err


def test_until_ends_the_run(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--until", "1.5", "--json")
    assert shown.code == 0
    assert json.loads(shown.out)["outcome"] == "until"


def test_param_is_a_literal_or_a_text(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--param", "half.label=42", "--param", "numbers.count=1")
    assert (shown.code, shown.out) == (0, "42 0\n")


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("half.divisor=10", 'parameter "half.divisor" must be <= 9, got 10'),
        ("half.divisor=x", 'parameter "half.divisor" must be of type int'),
        ("half.nothing=1", 'node "half" has no parameter "nothing"; it has divisor, label'),
        ("nobody.divisor=1", 'has no node "nobody"'),
        ("divisor=1", "sets nothing"),
        ("half.divisor", "sets nothing"),
    ],
)
def test_param_that_does_not_fit(hfg: Command, setting: str, sentence: str) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--param", setting)
    assert (shown.code, shown.out) == (2, "")
    assert sentence in shown.err


def test_a_param_of_a_type_that_is_not_there_is_refused_because_of_that(hfg: Command) -> None:
    Path("gone.hfg.yaml").write_text("hfg: 1\nname: g\nnodes:\n  a: {type: gone:node}\n", encoding="utf-8")
    shown = hfg("run", "gone.hfg.yaml", "--allow", "gone", "--param", "a.size=3")
    assert (shown.code, shown.out) == (2, "")
    assert 'parameter "a.size" cannot be set: the type "gone:node" is not there; hfg check says why' in shown.err


def test_trace_holds_every_event_as_a_line(hfg: Command) -> None:
    assert hfg("run", TARGET, *VIRTUAL, "--trace", "run.jsonl").code == 0
    events = [json.loads(line) for line in Path("run.jsonl").read_text(encoding="utf-8").splitlines()]
    assert {"RunStarted", "FiringStarted", "TokenSent", "RunEnded"} <= {event["type"] for event in events}


def test_a_trace_in_json_is_a_timeline(hfg: Command) -> None:
    assert hfg("run", TARGET, *VIRTUAL, "--trace", "run.json").code == 0
    events = json.loads(Path("run.json").read_text(encoding="utf-8"))
    assert {"M", "X"} <= {event["ph"] for event in events}
    shown = hfg("run", TARGET, *VIRTUAL, "--trace", "no/such/folder.json")
    assert (shown.code, shown.out) == (2, "")
    assert "the trace cannot be written to no/such/folder.json: No such file or directory" in shown.err


def test_trace_tells_markers_from_texts(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(ODD_VALUES)
    assert hfg("run", "halves.py:says_end", *VIRTUAL, "--trace", "run.jsonl").code == 0
    events = [json.loads(line) for line in Path("run.jsonl").read_text(encoding="utf-8").splitlines()]
    tokens = [event["token"] for event in events if event["type"] == "TokenSent"]
    assert tokens[0] == {"value": "END", "activity": 0, "stamp": 0.0, "sequence": 1}
    assert tokens[-1] == {"marker": "END", "activity": 0, "stamp": 0.0, "sequence": len(tokens)}
    assert [token["value"] for token in tokens[1:-1]] == [
        "\\ud800",
        ["\\ud800", 1],
        {"1": "<Shy, whose text cannot be made: RuntimeError>"},
        {"(1, 2)": 3},
        "array 2x3 uint8",
        1.5,
        [[["[[...]]"]]],
    ]


ODD_VALUES = """
import numpy as np

class Shy:
    def __repr__(self): raise RuntimeError

@hfg.node
def odd() -> Iterator[object]:
    endless = []
    endless.append(endless)
    yield from ("END", "\\ud800", ["\\ud800", 1], {1: Shy()}, {(1, 2): 3})
    yield from (np.zeros((2, 3), np.uint8), np.float32(1.5), endless)

@hfg.node
def hear(value: object) -> None: ...

says_end = hfg.Graph()
says_end.add(odd()) >> says_end.add(hear())
"""


def test_trace_that_cannot_be_written(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--trace", "no/such/folder.jsonl")
    assert (shown.code, shown.err.count("\n")) == (2, 1)


@pytest.mark.parametrize("name", ["run.jsonl", "run.json"])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full is needed")
def test_trace_on_a_full_disk_is_told_once_and_the_run_goes_on(hfg: Command, name: str) -> None:
    Path(name).symlink_to("/dev/full")
    shown = hfg("run", TARGET, *VIRTUAL, "--trace", name)
    assert (shown.code, shown.out) == (1, "half 0\nhalf 1\nhalf 2\n")
    assert shown.err.startswith(f"hfg: the trace in {name} is not whole: No space left on device\n")
    assert shown.err.count("not whole") == 1


def test_a_node_that_fails_shows_the_users_frames_and_a_sentence(hfg: Command) -> None:
    shown = hfg("run", TARGET, *VIRTUAL, "--param", "half.divisor=0")
    assert shown.code == 1
    assert "return number / divisor" in shown.err
    assert "hfg/engine" not in shown.err
    assert (
        shown.err.strip().splitlines()[-1] == 'hfg: node "half" failed in firing 1: ZeroDivisionError: division by zero'
    )


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("graph.add(half(), max_rate_hz=-1)", 'node "half": max_rate_hz must be a number above 0'),
        ("graph.connect('source.out', 'half.number')", 'there is no "source.out"'),
    ],
)
def test_a_builder_that_is_refused_shows_one_traceback_that_begins_with_its_line(
    hfg: Command, line: str, sentence: str
) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(f"\n\ndef refused() -> hfg.Graph:\n    graph = hfg.Graph()\n    {line}\n    return graph\n")
    shown = hfg("run", "halves.py:refused")
    assert shown.code == 2
    assert shown.err.startswith("Traceback (most recent call last):\n  File ")
    assert line in shown.err.splitlines()[2]
    assert shown.err.count(sentence) == 2  # the error and the sentence
    assert "exception" not in shown.err


@pytest.mark.slow
def test_what_our_own_nodes_raise_is_told_by_its_sentence_alone(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(
            "\n\nfrom hfg.nodes.files import TextLines\n"
            "def lost() -> hfg.Graph:\n    graph = hfg.Graph()\n"
            "    graph.add(TextLines(path='no/such/file'))\n    return graph\n"
        )
    shown = hfg("run", "halves.py:lost", *VIRTUAL)
    assert shown.code == 1
    assert "direct cause" not in shown.err
    assert "Traceback" not in shown.err
    assert 'FileNotFoundError: cannot read "no/such/file"' in shown.err.splitlines()[-1]


def test_debug_shows_our_frames_too(hfg: Command) -> None:
    assert "hfg/engine" in hfg("run", TARGET, *VIRTUAL, "--param", "half.divisor=0", "--debug").err


def test_a_graph_that_aborts_itself_is_a_failed_run(hfg: Command) -> None:
    assert hfg("run", "halves.py:aborting", *VIRTUAL).code == 1


def test_a_run_refuses_an_unsound_graph(hfg: Command) -> None:
    shown = hfg("run", "halves.py:unsound")
    assert shown.code == 1
    assert "error at" in shown.err
    assert "Traceback" not in shown.err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("run", "nowhere.py"), "nowhere.py: does not exist"),
        (("run", TARGET, "--nonsense"), "--nonsense"),
        (("run", TARGET, "--clock", "slow"), "slow"),
        (("run", TARGET, "--until", "-1"), "not negative"),
        (("run", TARGET, "--policy", "whim"), "whim"),
        (("run",), "target"),
        (("walk",), "walk"),
        (("check", "nowhere.py"), "nowhere.py: does not exist"),
        (("nodes", "nowhere.py"), "nowhere.py: does not exist"),
    ],
)
def test_wrong_use_is_code_2_and_one_sentence(hfg: Command, arguments: tuple[str, ...], sentence: str) -> None:
    shown = hfg(*arguments)
    assert (shown.code, shown.out) == (2, "")
    assert sentence in shown.err
    assert shown.err.startswith("hfg: ")
    assert shown.err.count("\n") == 1


def test_target_that_fails_shows_its_own_frames(hfg: Command) -> None:
    Path("broken.py").write_text("def ask():\n    return 1 / 0\n\n\nask()\n", encoding="utf-8")
    shown = hfg("run", "broken.py")
    assert shown.code == 2
    assert "return 1 / 0" in shown.err
    assert "importlib" not in shown.err
    assert "hfg/cli" not in shown.err


def test_an_edge_that_is_refused_shows_the_line_that_draws_it(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write("\ngraph.connect(source.out, graph.start)\n")
    shown = hfg("check", TARGET)
    assert shown.code == 1
    assert "the graph refused it at halves.py, line" in shown.out
    assert "graph.connect(source.out, graph.start)" in shown.out


FORKS = """
class Fork(hfg.Node):
    left, right = hfg.Event(), hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        self.left.trigger()
        self.right.trigger()


class State(hfg.Node):
    @hfg.slot
    def begin(self) -> None: ...


def forks() -> hfg.Graph:
    graph = hfg.Graph("forks")
    fork, one, other = graph.add(Fork()), graph.add(State(), name="one"), graph.add(State(), name="other")
    graph.start.activates(fork.begin)
    fork.left.activates(one.begin)
    fork.right.activates(other.begin)
    return graph
"""


def test_check_activity_shows_the_steps_by_which_two_nodes_become_active(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(FORKS)
    shown = hfg("check", "halves.py:forks", "--activity")
    assert shown.code == 0
    assert (
        """"fork", "one", "other": 5 states
  at most one is active: not so, as these steps may show:
    1. "fork" takes the activity from "start -> fork.begin" and sends left and right
    then activity lies on "fork.left -> one.begin" and activity lies on "fork.right -> other.begin"
"""
        in shown.out
    )
    found = json.loads(hfg("check", "halves.py:forks", "--activity", "--json").out)
    (region,) = found["activity"]["regions"]
    assert region["at_most_one"]["holds"] is False
    assert region["at_most_one"]["steps"][0]["path"] == "fork"
    assert {problem["check"] for problem in found["problems"]} == {"activity-stays"}
    assert "and more" in hfg("check", "halves.py:forks", "--activity", "--states", "2").out
    assert hfg("check", TARGET, "--activity").out.startswith("no edge of the graph is active, so no node ever is\n")


def test_check_refuses_a_limit_of_states_that_nothing_would_use(hfg: Command) -> None:
    refused = hfg("check", TARGET, "--states", "2")
    assert refused.code == 2
    assert "--states 2 bounds what --activity looks at, and --activity is not given; add it" in refused.err
    assert not refused.out


def test_check_tells_at_once_all_that_a_graph_refuses_and_what_else_is_wrong(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(
            "def wrong() -> hfg.Graph:\n"
            "    graph = hfg.Graph('wrong')\n"
            "    graph.group('work', policy='best')\n"
            "    first, both = graph.add(half(), max_rate_hz=-1), graph.add(pair(), group='work')\n"
            "    graph.connect(first.out, graph.abort)\n"
            "    graph.connect(both.left, first.out)\n"
            "    graph.connect(first, both.left)\n"
            "    graph.gate(first, by=half())\n"
            "    return graph\n"
        )
    shown = hfg("check", "halves.py:wrong", "--json")
    assert shown.code == 1
    problems = json.loads(shown.out)
    assert all(problem[part] for problem in problems for part in ("path", "what", "why", "remedy", "check"))
    assert [problem["path"] for problem in problems if problem["check"] == "refused"] == [
        "work",
        "half",
        "pair.left -> half.out",
        "half -> pair.left",
        "half",
    ]
    unconnected = [problem["path"] for problem in problems if problem["check"] == "unconnected-input"]
    assert unconnected == ["half.number", "pair.right"]  # pair.left would have been connected


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("{}['key']", "failed() failed: KeyError: 'key'"),
        ("return 3", "returned an int, not a Graph"),
        ("graph.add(3)", "graph.add takes a node, got 3"),
        ("graph.add(half(), name='a/b')", 'cannot be named "a/b"'),
    ],
)
def test_a_graph_that_cannot_be_built_is_told_after_what_was_refused_before(
    hfg: Command, code: str, found: str
) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(
            "def failed() -> hfg.Graph:\n"
            "    graph = hfg.Graph('failed')\n"
            "    graph.connect(graph.add(half()).out, graph.add(pair()))\n"
            f"    {code}\n"
            "    return graph\n"
        )
    shown = hfg("check", "halves.py:failed")
    if code == "return 3":
        assert (shown.code, found in shown.err) == (2, True)  # what is named is no graph: wrong use
        return
    assert shown.code == 1
    first, second, count = shown.out.splitlines()
    assert "got the node" in first
    assert found in second
    assert count == "halves.py:failed: 2 errors, no warnings"
    assert "line 4" in second or "KeyError" not in second


def test_check_counts_hints_apart(hfg: Command) -> None:
    with Path("halves.py").open("a", encoding="utf-8") as file:
        file.write(
            "def hinted() -> hfg.Graph:\n"
            "    graph = hfg.Graph('hinted')\n"
            "    graph.group('loop', policy='deadline')\n"
            "    graph.add(numbers())\n"
            "    return graph\n"
        )
    shown = hfg("check", "halves.py:hinted")
    assert shown.code == 0
    assert "[unused-scheduling]" in shown.out
    assert shown.out.splitlines()[-1] == 'graph "hinted": no errors, no warnings, 1 hint'


def test_check_finds_nothing_in_a_sound_graph(hfg: Command) -> None:
    shown = hfg("check", TARGET)
    assert (shown.code, shown.out.splitlines()[-1]) == (0, 'graph "halves": no errors, no warnings')


def test_check_tells_each_error(hfg: Command) -> None:
    shown = hfg("check", "halves.py:unsound")
    assert shown.code == 1
    assert "error at" in shown.out
    problems = json.loads(hfg("check", "halves.py:unsound", "--json").out)
    assert "error" in {problem["severity"] for problem in problems}


def test_closed_streams_are_no_trouble(hfg: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as closed:
        closed.setattr(sys, "stdout", None)
        closed.setattr(sys, "stderr", None)
        assert main(["check", TARGET]) == 0
        assert main(["run", TARGET, *VIRTUAL]) == 0


@pytest.mark.slow
def test_a_reader_that_has_gone_ends_the_command_quietly(hfg: Command) -> None:
    writes = [sys.executable, "-m", "hfg", "nodes", "halves.py"]
    with subprocess.Popen(writes, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("check", "--help"), ("nodes", "--help"), ()])
def test_every_verb_explains_itself(hfg: Command, arguments: tuple[str, ...]) -> None:
    shown = hfg(*arguments)
    assert shown.code == 0
    assert "Usage" in shown.out


def test_draw_writes_a_file_or_standard_output(hfg: Command, tmp_path: Path) -> None:
    shown = hfg("draw", TARGET)
    assert (shown.code, shown.out.splitlines()[0], shown.err) == (0, "flowchart LR", "")
    assert hfg("draw", TARGET, "halves.mmd").code == 0
    assert (tmp_path / "halves.mmd").read_text(encoding="utf-8") == shown.out
    assert hfg("draw", TARGET, "--format", "dot").out.startswith('digraph "halves"')


def test_draw_says_which_endings_work(hfg: Command) -> None:
    shown = hfg("draw", TARGET, "halves.png")
    assert (shown.code, shown.out) == (2, "")
    assert "a drawing ends in .svg or .mmd or .dot" in shown.err


def test_draw_makes_an_svg_of_a_target_with_what_is_asked_for(hfg: Command, tmp_path: Path) -> None:
    assert hfg("draw", TARGET, "halves.svg").code == 0
    text = (tmp_path / "halves.svg").read_text(encoding="utf-8")
    assert hfg("draw", TARGET, "--format", "svg").out == text
    assert 'class="hfg-body hfg-on"' not in text
    name = text.partition('data-path="')[2].partition('"')[0]
    shown = hfg("draw", TARGET, "--format", "svg", "--active", name, "--depth", "0", "--ports", "all")
    assert 'class="hfg-body hfg-on"' in shown.out


def test_check_tells_everything_that_is_wrong_with_a_machine(hfg: Command, tmp_path: Path) -> None:
    code = (
        "import hfg\n\ndef build() -> hfg.Graph:\n"
        '    return hfg.StateMachine(["a"], [("x", "a", "b"), ("x", "c", "a")], initial="a").graph()\n'
    )
    (tmp_path / "machine.py").write_text(code, encoding="utf-8")
    shown = hfg("check", "machine.py", "--json")
    assert shown.code == 1
    assert [problem["path"] for problem in json.loads(shown.out)] == ["transitions[0]", "transitions[1]"]


def test_check_time_bounds_ways_and_lists_what_it_assumes(hfg: Command) -> None:
    shown = hfg("check", TARGET, "--time")
    assert "assumed: each group has a processor of its own" in shown.out
    assert set(json.loads(hfg("check", TARGET, "--time", "--json").out)["time"]) == {
        "paths",
        "load",
        "assumptions",
        "problems",
    }


def test_a_run_measures_a_profile_with_which_check_bounds_ways(hfg: Command) -> None:
    assert hfg("run", TARGET, "--clock", "virtual", "--profile", "halves.json").code == 0
    nodes = json.loads(Path("halves.json").read_text())["nodes"]
    assert all(one["max_s"] > 0 for one in nodes.values())
    shown = hfg("check", TARGET, "--time", "--profile", "halves.json")
    assert shown.code == 0
    assert "no time for" not in shown.out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--profile", "gone.json"), "--profile gone.json has durations for --time, and --time is not given; add it"),
        (("--time", "--profile", "gone.json"), 'the profile "gone.json" cannot be read: No such file or directory'),
        (("--time", "--profile", "halves.py"), '"halves.py" is not a profile: '),
        (("--time", "--profile", "other.json"), 'the profile is of graph "other", and knows no node of graph '),
    ],
)
def test_check_refuses_a_profile_that_it_cannot_use(hfg: Command, arguments: tuple[str, ...], sentence: str) -> None:
    one = {"count": 1, "mean_s": 0.1, "p99_s": 0.1, "max_s": 0.1}
    Path("other.json").write_text(json.dumps({"graph": "other", "nodes": {"gone": one}}))
    shown = hfg("check", TARGET, *arguments)
    assert shown.code == 2
    assert shown.err.startswith(f"hfg: {sentence}")
    assert shown.err.count("\n") == 1


def test_a_profile_that_cannot_be_written_is_refused_before_the_run(hfg: Command) -> None:
    shown = hfg("run", TARGET, "--profile", "gone/halves.json")
    assert (shown.code, shown.out) == (2, "")
    assert shown.err == "hfg: the profile cannot be written to gone/halves.json: No such file or directory\n"
