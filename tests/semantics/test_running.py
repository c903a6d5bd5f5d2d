"""Groups, threads and policies (rules R1, R2)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from tests.limits import patience
from tests.semantics.nodes import (
    Ear,
    Keep,
    Ringing,
    Where,
    forward,
    forward_later,
    numbers,
    only_odd,
    run,
)

# --- R1 ---


@pytest.mark.rule("R1")
def test_nodes_of_one_thread_group_share_its_thread_and_never_run_at_the_same_time() -> None:
    Where.worst.clear()
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source = graph.add(numbers(count=10))
    nodes = [graph.add(Where(), group="work") for _ in range(4)]
    for node in nodes[:3]:
        graph.connect(source.out, node.value)
    graph.connect(source.out, nodes[3].hear)
    graph.connect(nodes[0].out, graph.add(Keep()).value)
    run(graph)
    assert set.union(*(node.threads for node in nodes)) == {"hfg group work"}
    assert max(Where.worst) == 1


@pytest.mark.rule("R1")
def test_different_groups_really_run_at_the_same_time() -> None:
    barrier = threading.Barrier(2, timeout=patience(5))
    Meets.barrier = barrier
    graph = hfg.Graph()
    source = graph.add(numbers(count=3))
    for name in ("left", "right"):
        graph.group(name, threads=1)
        graph.connect(source.out, graph.add(Meets(), group=name).value)
    run(graph)
    assert not barrier.broken


class Meets(hfg.Node):
    """Returns only if the other one runs too."""

    value = hfg.Input(int)
    barrier = threading.Barrier(2)

    def process(self, value: int) -> None:
        self.barrier.wait()


@pytest.mark.rule("R1")
def test_hooks_generators_and_slots_of_a_node_in_a_group_run_on_its_thread() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    node, ear = graph.add(AllOver(), group="work"), graph.add(Ear())
    sink = graph.add(Keep())
    graph.connect(graph.start, node.begin)
    graph.connect(node.out, sink.value)
    graph.connect(node.rang, ear.hear)
    run(graph)
    assert set(node.seen) == {"hfg group work"}
    assert len(node.seen) == 5
    assert sink.values == [1, 2]
    assert ear.heard == ["slot"]


class AllOver(hfg.Node):
    """Notes the thread of everything it does."""

    rang = hfg.Event(str)
    out = hfg.Output(int)
    seen = hfg.State(factory=list)

    def note(self) -> None:
        self.seen.append(threading.current_thread().name)

    def setup(self) -> None:
        self.note()

    def process(self) -> Iterator[int]:
        self.note()
        yield 1
        self.note()
        yield 2

    @hfg.slot
    def begin(self) -> None:
        self.note()
        self.rang.trigger("slot")

    def teardown(self) -> None:
        self.note()


@pytest.mark.rule("R1")
def test_async_code_in_a_thread_group_is_refused_with_the_remedy() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    graph.connect(graph.add(numbers()).out, graph.add(forward_later(), group="work").value)
    with pytest.raises(hfg.errors.GraphError, match=r'"forward_later": it is async, but its group "work" is a thread'):
        run(graph)


@pytest.mark.rule("R1")
def test_a_subgraph_may_say_where_its_nodes_run() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, box = graph.add(numbers(count=2)), graph.add(Box(), group="work")
    graph.connect(source.out, box.value)
    run(graph)
    assert graph["box/where"].threads == {"hfg group work"}


class Box(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.value.inner, graph.add(Where(), name="where").value)


# --- R2 ---


class Named(hfg.Node):
    """Notes who is called."""

    mark = hfg.Parameter("")
    story: list[str] = []  # noqa: RUF012 - of all

    @hfg.slot
    def hear(self, value: object) -> None:
        self.story.append(self.mark)


def order(declared: str, seed: int | None = None, **options: Any) -> str:
    """Who is called first, of six that become ready together."""
    Named.story.clear()
    graph = hfg.Graph()
    graph.group("loop", policy=declared, seed=seed)  # type: ignore[arg-type]
    source = graph.add(Ringing(count=1))
    for position, mark in enumerate("abcdef"):
        node = graph.add(Named(mark=mark), name=mark, priority=position % 3)
        graph.connect(source.rang, node.hear)
    run(graph, **options)
    return "".join(Named.story)


@pytest.mark.rule("R2")
def test_first_in_first_out_is_the_default(fast: bool) -> None:
    assert order("fifo", fast=fast) == "abcdef"


@pytest.mark.rule("R2")
def test_priority_lets_the_highest_go_first_and_keeps_the_order_of_equals(fast: bool) -> None:
    assert order("priority", fast=fast) == "cfbead"


@pytest.mark.rule("R2")
def test_random_is_another_order_for_each_seed_and_the_same_for_the_same(fast: bool) -> None:
    orders = {order("random", seed, fast=fast) for seed in range(10)}
    assert len(orders) > 5
    assert order("random", 3, fast=fast) == order("random", 3, fast=not fast)


@pytest.mark.rule("R2")
def test_a_run_may_choose_the_policy_of_all_groups(fast: bool) -> None:
    assert order("fifo", policy="priority", fast=fast) == "cfbead"
    assert order("fifo", 1, policy="random", fast=fast) == order("random", 1, fast=fast)


@pytest.mark.rule("R2")
def test_a_thread_group_has_a_policy_too() -> None:
    Named.story.clear()
    graph = hfg.Graph()
    graph.group("work", threads=1, policy="priority")
    source = graph.add(Ringing(count=1))
    for position, mark in enumerate("abcdef"):
        node = graph.add(Named(mark=mark), name=mark, priority=position % 3, group="work")
        graph.connect(source.rang, node.hear)
    run(graph)
    assert "".join(Named.story) in ("cfbead", "acfbed")  # the first may have begun before the others came


@pytest.mark.rule("R1")
@pytest.mark.parametrize("group", ["loop", "work"])
def test_what_goes_round_without_end_leaves_everybody_else_a_turn(group: str, fast: bool) -> None:
    async def main() -> str:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        odd, back = graph.add(only_odd(), group=group), graph.add(forward(), group=group)
        graph.connect(odd.out, back.value)
        graph.connect(back.out, odd.value, initial=[2])  # silence for ever
        async with asyncio.timeout(5):
            async with hfg.running(graph, fast=fast) as run:
                while run.statistics().nodes["only_odd"].silent <= 10:
                    await asyncio.sleep(0.001)
        return run.report().outcome

    assert asyncio.run(main()) == "stopped"
