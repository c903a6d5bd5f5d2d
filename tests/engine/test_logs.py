"""Where nodes log, what of failures is told as it happens, and that no log handler harms a run (rule X1)."""

from __future__ import annotations

import asyncio
import logging
import traceback
from collections.abc import Iterator
from itertools import pairwise

import pytest

import hfg
from tests.semantics.nodes import Ear, Keep, fail_on, forward, numbers, run


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    with caplog.at_level(logging.DEBUG, "hfg"):
        yield caplog


def told(log: pytest.LogCaptureFixture) -> list[tuple[str, str]]:
    return [(record.name, record.getMessage()) for record in log.records]


@pytest.fixture(params=[True, False], ids=["fast", "plain"])
def fast(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


# --- names ---


@hfg.node
def says(value: int) -> int:
    hfg.log().info("function %s", value)
    return value


@hfg.node
async def says_later(value: int) -> int:
    await asyncio.sleep(1)
    hfg.log().info("async %s", value)
    return value


class Says(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        self.log.info("class %s", value)
        hfg.log().info("again %s", value)
        return value


class Deaf(hfg.Node):
    @hfg.slot
    def hear(self, value: int) -> None:
        raise ValueError("deaf")


class Box(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        chain: list[hfg.Node] = [graph.add(says()), graph.add(says_later()), graph.add(Says())]
        chain.append(graph.add(says(), name="last", group="side"))
        graph.connect(self.value.inner, chain[0].ports.inputs["value"])
        for before, behind in pairwise(chain):
            graph.connect(before.ports.outputs["out"], behind.ports.inputs["value"])


def boxed(count: int = 1) -> hfg.Graph:
    graph = hfg.Graph()
    graph.group("side", threads=1)
    graph.connect(graph.add(numbers(count=count)).out, graph.add(Box()).value)
    return graph


def test_each_node_logs_below_its_path_wherever_its_code_runs(log: pytest.LogCaptureFixture, fast: bool) -> None:
    run(boxed(), fast)
    assert told(log) == [
        ("hfg.node.box.says", "function 1"),
        ("hfg.node.box.says_later", "async 1"),
        ("hfg.node.box.says_2", "class 1"),
        ("hfg.node.box.says_2", "again 1"),
        ("hfg.node.box.last", "function 1"),
    ]
    assert {vars(record)["path"] for record in log.records} >= {"box/says", "box/last"}
    assert {record.filename for record in log.records} == {"test_logs.py"}


@pytest.mark.parametrize("group", [None, "side"])
def test_in_a_fused_wave_it_is_the_node_whose_function_asks(log: pytest.LogCaptureFixture, group: str | None) -> None:
    graph = hfg.Graph()
    graph.group("side", threads=1)
    source = graph.add(numbers(count=400), group=group)
    first, second = graph.add(says(), name="first", group=group), graph.add(says(), name="second", group=group)
    graph.connect(source.out, first.value)
    graph.connect(first.out, second.value)
    run(graph)
    assert told(log)[-2:] == [("hfg.node.first", "function 400"), ("hfg.node.second", "function 400")]
    assert {name for name, _ in told(log)} == {"hfg.node.first", "hfg.node.second"}


def test_outside_a_run_a_function_logs_under_the_name_of_all_nodes(log: pytest.LogCaptureFixture) -> None:
    assert says.function(3) == 3
    assert told(log) == [("hfg.node", "function 3")]


def test_a_level_set_for_a_subgraph_is_that_of_all_inside(log: pytest.LogCaptureFixture) -> None:
    logging.getLogger("hfg.node.box").setLevel(logging.WARNING)
    try:
        run(boxed())
    finally:
        logging.getLogger("hfg.node.box").setLevel(logging.NOTSET)
    assert told(log) == []


def test_a_node_that_was_renamed_logs_under_its_new_path(log: pytest.LogCaptureFixture) -> None:
    graph = hfg.Graph()
    node = graph.add(Says())
    node.log.info("before")
    graph.edit(hfg.commands.Rename("says", "other"))
    graph["other"].log.info("after")
    assert told(log) == [("hfg.node.says", "before"), ("hfg.node.other", "after")]


# --- failures ---


@pytest.mark.rule("X1")
@pytest.mark.parametrize(
    ("on_error", "follows"),
    [("skip", "the node goes on"), ("disable", "the node is switched off"), ("restart", "the node is restarted")],
)
def test_a_failure_that_ends_nothing_is_logged_as_it_happens_with_the_user_s_frames(
    log: pytest.LogCaptureFixture, fast: bool, on_error: str, follows: str
) -> None:
    graph = hfg.Graph()
    node = graph.add(fail_on(), on_error=on_error)  # type: ignore[arg-type]
    graph.connect(graph.add(numbers()).out, node.value)
    graph.connect(node.out, graph.add(Keep()).value)
    run(graph, fast)
    [record] = log.records
    assert told(log) == [
        ("hfg.node.fail_on", f'node "fail_on" failed in firing 2: ValueError: no 2; {follows} (on_error="{on_error}")')
    ]
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None
    assert [frame.name for frame in traceback.extract_tb(record.exc_info[2])] == ["fail_on"]


@pytest.mark.rule("X1")
def test_a_failure_that_ends_the_run_is_raised_and_not_logged_too(log: pytest.LogCaptureFixture, fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(fail_on())
    graph.connect(graph.add(numbers()).out, node.value)
    with pytest.raises(hfg.errors.NodeError):
        run(graph, fast)
    assert told(log) == []


@pytest.mark.rule("X1")
def test_a_failed_slot_call_is_logged(log: pytest.LogCaptureFixture, fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=1))
    graph.connect(source.out, graph.add(Deaf(), on_error="skip").hear)
    run(graph, fast)
    assert told(log) == [
        (
            "hfg.node.deaf",
            'node "deaf" failed in slot hear, call 1: ValueError: deaf; the call is only counted (on_error="skip")',
        )
    ]


# --- warnings of the check ---


def test_warnings_of_the_check_are_logged_as_a_run_begins_and_hints_are_not(log: pytest.LogCaptureFixture) -> None:
    graph = hfg.Graph()
    node = graph.add(forward())
    graph.connect(graph.add(numbers(count=1)).out, node.value)
    graph.connect(node.failed, graph.add(Ear()).hear)
    run(graph)
    [(name, sentence)] = told(log)
    assert name == "hfg.graph"
    assert sentence.startswith('"forward.failed -> ear.hear": nothing ever comes over this edge: with on_error="stop"')


# --- handlers that raise ---


class Broken(logging.Handler):
    """Raises for every record."""

    def emit(self, record: logging.LogRecord) -> None:
        raise OSError("disk full")


@pytest.mark.rule("X1")
def test_a_log_handler_that_raises_costs_its_record_and_not_the_run(
    capsys: pytest.CaptureFixture[str], fast: bool
) -> None:
    graph = hfg.Graph()
    node, keep = graph.add(fail_on(), on_error="skip"), graph.add(Keep())
    graph.connect(graph.add(numbers()).out, node.value)
    loud = graph.add(Says())
    graph.connect(node.out, loud.value)
    graph.connect(loud.out, keep.value)
    handler, logger = Broken(), logging.getLogger("hfg")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        report = run(graph, fast)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)
    assert (report.outcome, keep.values, report.nodes["says"].failed) == ("done", [1, 3], 0)
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("hfg: a log handler")]
    assert (
        'hfg: a log handler raised OSError: disk full; a record of "hfg.node.fail_on" is lost, and the run continues'
        in errors
    )
    assert len(errors) == 5
