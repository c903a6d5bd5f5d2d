"""`hfg tap`: tokens of a port or an edge, one a line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Command

TARGET = "steps.py:build"
VIRTUAL = ("--clock", "virtual")


def test_tokens_of_an_output_with_the_time_they_passed(command: Command) -> None:
    shown = command("tap", TARGET, "third.out", *VIRTUAL)
    assert shown.code == 0
    assert shown.out.splitlines() == [
        "0.000 s  0",
        "0.200 s  NO_MESSAGE",
        "0.400 s  NO_MESSAGE",
        "0.600 s  3",
        "0.800 s  NO_MESSAGE",
        "1.000 s  END",
    ]
    assert shown.err.splitlines() == [f"step {number}" for number in range(5)]  # out of the way


@pytest.mark.rule("A10")
def test_what_passes_before_anything_moves_is_seen_too(command: Command) -> None:
    assert command("tap", TARGET, "ear.begin", *VIRTUAL).out == "0.000 s  None  (+1)\n"
    assert command("tap", TARGET, "start", *VIRTUAL).out == "0.000 s  None  (+1)\n"


def test_an_edge_and_an_event(command: Command) -> None:
    edge = command("tap", TARGET, "steps.out -> third.step", *VIRTUAL, "-n", "2")
    assert edge.out == "0.000 s  0\n0.200 s  1\n"
    assert command("tap", TARGET, "ear.rang", *VIRTUAL).out == "0.000 s  'two\\nlines'\n0.600 s  'two\\nlines'\n"


def test_json_has_an_object_a_line_and_tells_markers_from_values(command: Command) -> None:
    shown = command("tap", TARGET, "third.out", *VIRTUAL, "--json")
    tokens = [json.loads(line) for line in shown.out.splitlines()]
    assert tokens[0] == {"value": 0, "activity": 0, "stamp": 0.0, "sequence": 1}
    assert tokens[-1] == {"marker": "END", "activity": 0, "stamp": pytest.approx(1.0), "sequence": 6}


def test_it_ends_after_so_many_tokens_or_seconds(command: Command) -> None:
    assert command("tap", TARGET, "steps.out", *VIRTUAL, "--limit", "1").out == "0.000 s  0\n"
    assert command("tap", TARGET, "steps.out", *VIRTUAL, "--until", "0.3").out == "0.000 s  0\n0.200 s  1\n"


def test_a_rate_gives_the_newest(command: Command) -> None:
    shown = command("tap", TARGET, "steps.out", *VIRTUAL, "--rate", "2")
    assert [line.split()[2] for line in shown.out.splitlines()] == ["0", "2", "4", "END"]


def test_a_port_where_nothing_passes_says_so(command: Command) -> None:
    shown = command("tap", TARGET, "ear.quiet", *VIRTUAL)
    assert (shown.code, shown.out) == (0, "")
    assert shown.err.splitlines()[-1] == 'hfg: no token passed "ear.quiet" in 1.000 s'


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("nobody.out", 'there is no "nobody.out"'),
        ("ear.nothing", '"ear" has no port "nothing"'),
        ("ear", '"ear" is a node, and a tap looks at a port or an edge'),
        ("steps.out -> ear.heard", 'there is no edge "steps.out -> ear.heard"'),
        ("steps.count", '"steps.count" has no edge in this run'),
        ("", "there is no"),
    ],
)
def test_a_path_that_leads_nowhere(command: Command, path: str, sentence: str) -> None:
    shown = command("tap", TARGET, path, *VIRTUAL)
    assert (shown.code, shown.out) == (2, "")
    assert sentence in shown.err
    assert shown.err.count("\n") == 1


@pytest.mark.parametrize(("option", "value"), [("--limit", "0"), ("--rate", "0"), ("--rate", "nan"), ("--until", "-1")])
def test_limits_that_cannot_be(command: Command, option: str, value: str) -> None:
    shown = command("tap", TARGET, "steps.out", *VIRTUAL, option, value)
    assert (shown.code, shown.out, shown.err.count("\n")) == (2, "", 1)


def test_a_node_that_fails_is_told_behind_what_passed_before(command: Command) -> None:
    with Path("steps.py").open("a", encoding="utf-8") as file:
        file.write(FAILING)
    shown = command("tap", "steps.py:failing", "steps.out", *VIRTUAL)
    assert (shown.code, shown.out) == (1, "0.000 s  0\n0.000 s  1\n")
    assert shown.err.splitlines()[-1] == 'hfg: node "fails" failed in firing 2: ZeroDivisionError: division by zero'


FAILING = """
@hfg.node
def fails(step: int) -> float:
    return 1 / (1 - step)

def failing() -> hfg.Graph:
    graph = hfg.Graph("failing")
    graph.connect(graph.add(steps()).out, graph.add(fails()).ports.inputs["step"])
    return graph
"""


@pytest.mark.rule("T5")
def test_the_time_is_that_of_passing_whatever_stamp_a_node_sets(command: Command) -> None:
    with Path("steps.py").open("a", encoding="utf-8") as file:
        file.write(STAMPED)
    shown = command("tap", "steps.py:stamped", "old.out", *VIRTUAL)
    assert shown.out.splitlines() == ["0.300 s  1", "0.600 s  2", "0.900 s  END"]


STAMPED = """
class Old(hfg.Node):
    out = hfg.Output(int)

    async def process(self) -> None:
        import asyncio
        await asyncio.sleep(0.3)
        self.count = getattr(self, "count", 0) + 1
        if self.count == 3:
            raise hfg.EndOfStream
        self.out.send(self.count, stamp=-1000.0)

def stamped() -> hfg.Graph:
    graph = hfg.Graph("stamped")
    graph.connect(graph.add(Old(), name="old").out, graph.output("out", int))
    return graph
"""


@pytest.mark.parametrize("edge", ["a -> b.out", "a -> b.out -> a c.step", "a c.out"])
def test_names_of_nodes_may_hold_blanks_and_arrows(command: Command, edge: str) -> None:
    with Path("steps.py").open("a", encoding="utf-8") as file:
        file.write(ARROWS)
    assert command("tap", "steps.py:arrows", edge, *VIRTUAL, "-n", "1").out == "0.000 s  0\n"


ARROWS = """
def arrows() -> hfg.Graph:
    graph = hfg.Graph("arrows")
    graph.add(steps(), name="a -> b") >> graph.add(third(), name="a c")
    graph.connect(graph["a c"].out, graph.output("out", int))
    return graph
"""
