"""Several firings at once, and retries, for nodes that cannot have them: one sentence with path and remedy."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from tests.semantics.nodes import Ear, Keep, drive, forward, forward_async, numbers


class Ready(hfg.Node):
    def ready(self) -> bool:
        return True

    async def process(self, value: int) -> int:
        return value


class Counts(hfg.Node):
    total = hfg.State(0)

    async def process(self, value: int) -> int:
        self.total += value
        return self.total


class Box(hfg.Subgraph):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(forward())
        graph.connect(self.value.inner, inner.value)
        graph.connect(inner.out, self.out.inner)


REFUSED: list[tuple[hfg.Node, dict[str, Any], str]] = [
    (forward_async(), {"concurrency": 0}, 'node "node": concurrency must be a whole number from 1 on, got 0'),
    (forward_async(), {"concurrency": 2.0}, 'node "node": concurrency must be a whole number from 1 on, got 2.0'),
    (forward_async(), {"ordered": None}, 'node "node": ordered must be True or False, got None'),
    (
        Ready(),
        {"concurrency": 8},
        'node "node": concurrency=8 does not go together with ready(), which is asked between two firings (rule F14); '
        "leave concurrency out, or await in process() what ready() looks for",
    ),
    (
        numbers(),
        {"concurrency": 8},
        'node "node": concurrency=8 lets several firings be in progress at once, but the firings of a generator are '
        "its steps, one after the other (rule F14); write an async function, or leave concurrency out",
    ),
    (
        Ear(),
        {"concurrency": 8},
        'node "node": concurrency=8 is about firings, but ear has no process function; leave it out',
    ),
    (
        forward_async(),
        {"concurrency": 8, "release": "sequential"},
        'node "node": concurrency=8 does not go together with release="sequential", because its tokens count as '
        "processed as soon as they are taken (rule F14); leave release out",
    ),
    (
        Box(),
        {"concurrency": 8, "iterate_over": ("value",)},
        'node "node": concurrency=8 is for nodes that run code, and a subgraph runs that of others; say it inside, in '
        "build()",
    ),
    (
        Box(),
        {"concurrency": 8},
        'subgraph "node": it does not fire itself, so concurrency means nothing; give it to the nodes inside, in '
        "build()",
    ),
    (forward(), {"retries": -1}, 'node "node": retries must be a whole number from 0 on, got -1'),
    (
        forward(),
        {"retry_jitter": 2},
        'node "node": retry_jitter must be a number from 0 to 1, got 2; 0.5 makes pauses up to a half shorter',
    ),
    (
        forward(),
        {"retry_backoff_s": -1},
        'node "node": retry_backoff_s must be seconds from 0 on, got -1; 0 tries again at once',
    ),
    (
        Counts(),
        {"retries": 3},
        'node "node": retries=3 would run a firing again with what the failed attempt has left in its state "total" '
        "(rule X1); leave retries out, or keep the state in a node after it",
    ),
    (
        numbers(),
        {"retries": 3},
        'node "node": retries=3 would run a firing again, but a generator that has raised is over (rule X1); '
        'leave retries out, or say on_error="restart"',
    ),
    (Ear(), {"retries": 3}, 'node "node": retries=3 is about firings, but ear has no process function; leave it out'),
]


@pytest.mark.rule("F14", "X1")
@pytest.mark.parametrize(("node", "options", "sentence"), REFUSED, ids=lambda value: str(value)[:30])
def test_add_refuses_what_the_code_of_a_node_cannot_do(node: hfg.Node, options: dict[str, Any], sentence: str) -> None:
    graph = hfg.Graph()
    with pytest.raises(hfg.errors.GraphError) as refused:
        graph.add(node, name="node", **options)
    assert str(refused.value) == sentence
    assert not graph.nodes


def checked(graph: hfg.Graph) -> list[str]:
    return [str(problem) for problem in graph.check() if problem.check == "concurrency"]


@pytest.mark.rule("F14", "R1")
def test_a_plain_function_on_the_loop_is_told_by_the_check_and_refused_by_a_run() -> None:
    graph = hfg.Graph()
    graph.add(numbers()) >> graph.add(forward(), name="node", concurrency=8)
    sentence = (
        'error at "node": concurrency=8, but its function is a plain one on the event loop: a function that never '
        "waits, or has no thread of its own, runs alone (rules R1, F14); make it async, or put it into "
        'graph.group("work", threads=8) by group="work"'
    )
    assert checked(graph) == [sentence]
    with pytest.raises(hfg.errors.GraphError, match="its function is a plain one on the event loop"):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("F14", "R1")
def test_more_firings_than_threads_are_told() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=2)
    graph.add(numbers()) >> graph.add(forward(), name="node", concurrency=8, group="work")
    assert checked(graph) == [
        'error at "node": concurrency=8, but its group "work" has threads=2: a function that never waits, or has no '
        'thread of its own, runs alone (rules R1, F14); declare graph.group("work", threads=8), or say concurrency=2'
    ]


@pytest.mark.rule("F14", "A5")
@pytest.mark.parametrize("into", [True, False])
def test_an_active_edge_is_told(into: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers()), graph.add(forward_async(), name="node", concurrency=8), graph.add(Keep())
    graph.connect(source.out, node.value, active=into)
    graph.connect(node.out, sink.value, active=not into)
    label = "numbers.out -> node.value" if into else "node.out -> keep.value"
    assert checked(graph) == [
        f'error at "{label}": it is active, but "node" has concurrency=8: activity belongs to one firing or call of a '
        "node at a time (rules A5, F14); leave active= out, or leave out concurrency"
    ]


@pytest.mark.rule("F14", "R4")
def test_an_edit_that_would_make_such_an_edge_is_refused_and_the_run_goes_on() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        node, ear = graph.add(forward_async(), name="node", concurrency=2), graph.add(Ear())
        graph.connect(graph.input("in", int), node.value)
        graph.connect(node.out, graph.add(Keep()).value)
        async with hfg.running(graph) as run:
            with pytest.raises(hfg.errors.GraphError, match='"node" has concurrency=2'):
                await run.edit(hfg.commands.Connect("node.processed", "ear.hear", active=True))
            with pytest.raises(hfg.errors.GraphError, match=r"concurrency=2 does not go together with ready\(\)"):
                await run.edit(hfg.commands.Replace("node", f"{__name__}:Ready"))
            await run.wait_finished()
        assert ear.heard == []

    drive(main)
