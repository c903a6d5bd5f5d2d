"""In which order nodes of one group move under first in, first out: depth first in a wave, waves in turn (rule R2)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

import hfg
from hfg.trace import CallStarted, FiringStarted, TraceEvent


@hfg.node
def numbers(*, count: int = 2) -> Iterator[int]:
    yield from range(count)


@hfg.node
def same(value: int) -> int:
    return value


@hfg.node
def both(one: int, other: int) -> int:
    return one


@hfg.node
async def waits(value: int) -> int:
    await asyncio.sleep(0)
    return value


class Hears(hfg.Node):
    """A slot, and an event from there."""

    heard = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.trigger(value)


def order(graph: hfg.Graph) -> str:
    """The names of the nodes in the order in which they fired or were called, without the sources' ends."""
    moved: list[str] = []

    def note(event: TraceEvent) -> None:
        if isinstance(event, CallStarted | FiringStarted):
            moved.append(event.node)

    hfg.run(graph, clock="virtual", trace=note)
    return " ".join(moved)


@pytest.mark.rule("R2")
def test_a_wave_goes_depth_first_in_the_order_of_the_edges() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=1), name="s")
    for name in ("a", "b"):
        first = graph.add(same(), name=name)
        source.out >> first.value
        for deeper in ("1", "2"):
            graph.connect(first.out, graph.add(same(), name=name + deeper).value)
    assert order(graph).startswith("s a a1 a2 b b1 b2 s")


@pytest.mark.rule("R2")
def test_a_join_follows_the_firing_that_completes_it() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=1), name="s")
    left, right, last = graph.add(same(), name="l"), graph.add(same(), name="r"), graph.add(same(), name="z")
    join, behind = graph.add(both(), name="j"), graph.add(same(), name="k")
    for node in (left, right, last):
        graph.connect(source.out, node.value)
    left.out >> join.one
    right.out >> join.other
    join.out >> behind.value
    assert order(graph).startswith("s l r j k z s")


@pytest.mark.rule("R2")
def test_waves_are_first_in_first_out() -> None:
    graph = hfg.Graph()
    for name in ("s", "t"):
        source = graph.add(numbers(count=2), name=name)
        first, second = graph.add(same(), name=name + "1"), graph.add(same(), name=name + "2")
        source.out >> first.value
        first.out >> second.value
    assert order(graph).startswith("s s1 s2 t t1 t2 s s1 s2 t t1 t2")


@pytest.mark.rule("R2", "F6")
def test_a_slot_call_by_an_output_belongs_to_the_wave_and_what_its_signal_enables_waits_behind_it() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=1), name="s")
    hears, far, near = graph.add(Hears(), name="h"), graph.add(Hears(), name="far"), graph.add(same(), name="n")
    graph.connect(source.out, near.value)
    graph.connect(source.out, hears.hear)
    graph.connect(hears.heard, far.hear)
    assert order(graph).startswith("s h n far s")


@pytest.mark.rule("R2")
def test_code_that_waits_lets_its_wave_be_overtaken_and_what_it_enables_still_goes_first() -> None:
    graph = hfg.Graph()
    slow = graph.add(waits(), name="w")
    graph.add(numbers(count=1), name="s").out >> slow.value
    behind = graph.add(same(), name="b")
    slow.out >> behind.value
    behind.out >> graph.add(same(), name="c").value
    other = graph.add(same(), name="o")
    graph.add(numbers(count=1), name="t").out >> other.value
    moved = order(graph)
    assert moved.startswith("s w t o")
    assert "b c" in moved
