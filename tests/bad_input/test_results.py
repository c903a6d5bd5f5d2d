"""What a node gives back that nobody expects: a value without an output for it, a coroutine from a plain function."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest

import hfg
from tests.bad_input.graphs import one, sentence
from tests.semantics.nodes import Keep, drive, numbers, run

# --- a value, but no output ---


@hfg.node
def counts(value: int) -> None:
    """Says that it gives nothing back."""
    return value  # type: ignore[return-value]


@hfg.node
async def counts_async(value: int) -> None:
    """Says so too."""
    return value  # type: ignore[return-value]


class Total(hfg.Node):
    """Has inputs alone."""

    value = hfg.Input(int)

    def process(self, value):  # type: ignore[no-untyped-def]
        return value


@hfg.node
def yields() -> Iterator[None]:
    """A source without an output."""
    yield 1  # type: ignore[misc]


@hfg.node
async def yields_async() -> AsyncIterator[None]:
    """The same, async."""
    yield 1  # type: ignore[misc]


@pytest.mark.rule("F3", "X1")
@pytest.mark.parametrize("node", [counts, counts_async, Total])
@pytest.mark.parametrize("debug", [True, False])
def test_a_value_without_an_output_is_an_error_of_the_firing(node: Any, debug: bool, fast: bool) -> None:
    name = node._type.name
    assert sentence(one(node()), fast, debug=debug) == (
        f'node "node" failed in firing 1: TypeError: {name} has no output but returned 1; '
        "declare an output (annotate the result), or return nothing"
    )


@pytest.mark.rule("F3", "X1")
@pytest.mark.parametrize("node", [yields, yields_async])
def test_a_source_without_an_output_yields_nothing_but_none(node: Any, fast: bool) -> None:
    graph = hfg.Graph()
    graph.add(node())
    assert "has no output but returned 1" in sentence(graph, fast)


@pytest.mark.rule("F3", "X1")
def test_a_value_without_an_output_follows_the_policy_like_other_failures(fast: bool) -> None:
    report = run(one(counts(), on_error="skip"), fast)
    assert report.nodes["node"].failed == 3


def test_a_value_without_an_output_in_a_thread_is_an_error_too() -> None:
    graph = one(counts(), group="work")
    graph.group("work", threads=1)
    assert "counts has no output but returned 1" in sentence(graph, True)


@pytest.mark.rule("F4", "X1")
def test_what_end_gives_back_is_no_output(fast: bool) -> None:
    class Late(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def process(self, value: int) -> None:
            pass

        def end(self) -> int:
            return 3

    assert sentence(one(Late()), fast) == (
        'node "node" failed in end(): TypeError: end() gave back 3, but it writes with send(): self.out.send(...)'
    )


# --- a coroutine from a plain function ---


async def twice(value: int) -> int:
    """Wait a second first."""
    await asyncio.sleep(1)
    return 2 * value


async def keep(value: int) -> None:
    """Wait a second, give nothing."""
    await asyncio.sleep(1)
    kept.append(value)


kept: list[int] = []


@hfg.node
def forgotten(value: int) -> int:
    """Wraps an async function without being one."""
    return twice(value)  # type: ignore[return-value]


@hfg.node
async def forgotten_inside(value: int) -> int:
    """Forgets to await."""
    return twice(value)  # type: ignore[return-value]


class Forgotten(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value):  # type: ignore[no-untyped-def]
        return twice(value)


wrapped = hfg.node(lambda value: twice(value), inputs={"value": int}, outputs=int)


@hfg.node
def forgotten_source() -> Iterator[int]:
    """Yields what is to be awaited."""
    yield twice(1)  # type: ignore[misc]
    yield 4
    yield twice(3)  # type: ignore[misc]


@hfg.node
def only_sometimes(value: int) -> int:
    """Waits for even values."""
    return value if value % 2 else twice(value)  # type: ignore[return-value]


@pytest.mark.rule("R1", "F3")
@pytest.mark.parametrize("node", [forgotten, forgotten_inside, Forgotten, wrapped])
def test_a_coroutine_is_awaited_whoever_gives_it_back(node: Any, fast: bool) -> None:
    graph = one(node())
    report = run(graph, fast)
    assert graph["keep"].values == [2, 4, 6]
    assert report.duration_s == 3


@pytest.mark.rule("R1", "F3")
def test_a_coroutine_that_comes_now_and_then_is_awaited(fast: bool) -> None:
    graph = one(only_sometimes())
    run(graph, fast)
    assert graph["keep"].values == [1, 4, 3]


@pytest.mark.rule("R1", "F2")
def test_a_coroutine_that_a_generator_yields_is_awaited(fast: bool) -> None:
    graph = hfg.Graph()
    sink = graph.add(Keep())
    graph.add(forgotten_source()) >> sink
    run(graph, fast)
    assert sink.values == [2, 4, 6]


@pytest.mark.rule("R1", "F3")
def test_a_coroutine_of_a_sink_is_awaited(fast: bool) -> None:
    kept.clear()
    run(one(hfg.node(lambda value: keep(value), inputs={"value": int}, outputs=object)()), fast)
    assert kept == [1, 2, 3]
    kept.clear()
    graph = hfg.Graph()
    graph.add(forgotten_source()) >> graph.add(keeps())
    run(graph, fast)
    assert kept == [2, 4, 6]


@hfg.node
def keeps(value: int) -> None:
    """A sink that is async after all."""
    return keep(value)  # type: ignore[return-value]


@pytest.mark.rule("X1")
def test_a_coroutine_that_raises_is_a_failed_firing(fast: bool) -> None:
    async def fails() -> int:
        raise ValueError("mine")

    node = hfg.node(lambda value: fails(), inputs={"value": int}, outputs=int)
    assert sentence(one(node()), fast) == 'node "node" failed in firing 1: ValueError: mine'


@pytest.mark.rule("R1", "F9")
def test_a_coroutine_that_an_async_slot_gives_back_is_awaited(fast: bool) -> None:
    class Hears(hfg.Node):
        @hfg.slot
        async def hear(self, value: int) -> Any:
            return keep(value)

    kept.clear()
    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=2)).out, graph.add(Hears()).hear)
    run(graph, fast)
    assert kept == [1, 2]


@pytest.mark.rule("R1", "X1")
@pytest.mark.parametrize("slot", [False, True])
def test_a_coroutine_from_a_thread_is_an_error_that_says_what_to_write(slot: bool) -> None:
    class Hears(hfg.Node):
        @hfg.slot
        def hear(self, value: int) -> Any:
            return twice(value)

    graph = hfg.Graph() if slot else one(forgotten(), group="work")
    if slot:
        graph.connect(graph.input("in", int), graph.add(Hears(), name="node", group="work").hear)
    graph.group("work", threads=1)

    async def main() -> None:
        async with hfg.running(graph) as run:
            if slot:
                async with run.feed("in") as feed:
                    await feed.send(1)
            await run.wait_finished()

    with pytest.raises(hfg.errors.NodeError) as failed:
        drive(main)
    assert str(failed.value).endswith(
        'TypeError: it gave back a coroutine, but its group "work" is a thread and async code runs on the loop; write '
        "`async def` and leave out group="
    )


# --- a source that says it is a generator ---


@hfg.node
def no_iterator() -> Iterator[int]:
    """Gives back a list."""
    return [1, 2]  # type: ignore[return-value]


@hfg.node
def forgets() -> Iterator[int]:
    """Gives back nothing."""


@hfg.node
def mapped(*, count: int = 3) -> Iterator[int]:
    """Gives back an iterator, which cannot be closed."""
    return map(abs, range(count))


@hfg.node
def fails_at_once() -> Iterator[int]:
    """Fails before there is an iterator."""
    raise ValueError("mine")


@pytest.mark.rule("F2", "X1")
@pytest.mark.parametrize(("node", "found"), [(no_iterator, "list"), (forgets, "NoneType")])
def test_a_source_that_gives_back_no_iterator_says_what_to_write(node: Any, found: str, fast: bool) -> None:
    graph = hfg.Graph()
    graph.add(node(), name="node") >> graph.add(Keep())
    assert sentence(graph, fast) == (
        f'node "node" failed in firing 1: TypeError: it is annotated as an iterator but gave back {found}, not one; '
        "write `yield` in it, or `return iter(...)`"
    )


@pytest.mark.rule("F2")
def test_an_async_source_without_yield_is_refused_where_it_is_declared() -> None:
    async def forgot() -> AsyncIterator[int]:
        return 1  # type: ignore[return-value]

    with pytest.raises(
        hfg.errors.DeclarationError, match="^node type forgot: it is async .* but has no `yield`; write"
    ):
        hfg.node(forgot)


@pytest.mark.rule("F2", "X1")
@pytest.mark.parametrize("group", ["loop", "work"])
def test_a_source_that_fails_before_there_is_an_iterator_is_named(group: str, fast: bool) -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    graph.add(fails_at_once(), group=group) >> graph.add(Keep())
    assert sentence(graph, fast) == 'node "fails_at_once" failed in firing 1: ValueError: mine'


@pytest.mark.rule("F2")
def test_a_source_may_give_back_any_iterator(fast: bool) -> None:
    graph = hfg.Graph()
    sink = graph.add(Keep())
    graph.add(mapped()) >> sink
    run(graph, fast)
    assert sink.values == [0, 1, 2]
