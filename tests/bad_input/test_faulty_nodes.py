"""Nodes that raise, write wrongly or give back the wrong thing: one clear sentence with the path."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg.errors import NodeError
from tests.bad_input.graphs import one, sentence
from tests.semantics.nodes import Ear, Keep, drive, run

# --- nodes that raise ---


@hfg.node
def broken(value: int) -> int:
    """Fails."""
    raise ZeroDivisionError("division by zero")


@hfg.node
async def broken_at_once(value: int) -> int:
    """Fails before it waits."""
    raise ZeroDivisionError("division by zero")


@hfg.node
async def broken_later(value: int) -> int:
    """Fails behind a wait."""
    await asyncio.sleep(1)
    raise ZeroDivisionError("division by zero")


@pytest.mark.parametrize("node", [broken, broken_at_once, broken_later])
def test_a_node_that_raises_is_named_with_its_firing(node: Any, fast: bool) -> None:
    expected = 'node "node" failed in firing 1: ZeroDivisionError: division by zero'
    assert sentence(one(node()), fast) == expected


def test_a_node_that_raises_in_a_thread_is_named_too() -> None:
    graph = one(broken(), group="work")
    graph.group("work", threads=1)
    assert sentence(graph, True) == 'node "node" failed in firing 1: ZeroDivisionError: division by zero'


class Mute(Exception):
    """Cannot be told."""

    def __str__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    ("problem", "said"), [(Mute, "Mute: its text cannot be made (RuntimeError)"), (ValueError, "ValueError")]
)
def test_an_exception_without_a_text_is_named(problem: type[Exception], said: str, fast: bool) -> None:
    class Raises(hfg.Node):
        def process(self, value: int) -> None:
            raise problem

    seen: list[Any] = []
    assert sentence(one(Raises()), fast, trace=seen.append) == f'node "node" failed in firing 1: {said}'


@hfg.node
async def broken_source() -> AsyncIterator[int]:
    """Fails behind its first value."""
    yield 1
    raise ValueError("dry")


def test_a_source_that_raises_is_named(fast: bool) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(broken_source()).out, graph.add(Keep()).value)
    assert sentence(graph, fast) == 'node "broken_source" failed in firing 2: ValueError: dry'


def test_the_users_frames_are_in_the_cause(fast: bool) -> None:
    with pytest.raises(NodeError) as raised:
        run(one(broken()), fast)
    cause = raised.value.__cause__
    assert cause is not None
    frame = cause.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    assert frame is not None
    assert frame.tb_frame.f_code.co_name == "broken"


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (hfg.State(threading.Lock()), "TypeError: cannot pickle '_thread.lock' object"),
        (hfg.State(factory=3), "TypeError: 'int' object is not callable"),  # type: ignore[call-overload]
    ],
)
def test_a_state_that_cannot_be_made_is_named(state: Any, said: str, fast: bool) -> None:
    node = type("Stateful", (hfg.Node,), {"value": hfg.Input(int), "lock": state, "process": lambda self, value: None})
    assert sentence(one(node()), fast) == f'node "node" failed in its state: {said}'


class Hooked(hfg.Node):
    """Fails in one of its hooks."""

    fails = hfg.Parameter("")
    value = hfg.Input(int)
    asked = hfg.State(0)

    def fail(self, name: str) -> None:
        if self.fails == name:
            raise ValueError(f"in {name}")

    def setup(self) -> None:
        self.fail("setup")

    def ready(self) -> bool:
        self.fail("ready")
        return True

    def process(self, value: int) -> None:
        pass

    def end(self) -> None:
        self.fail("end")

    def teardown(self) -> None:
        self.fail("teardown")

    def on_activated(self) -> None:
        self.fail("on_activated")


@pytest.mark.parametrize("hook", ["setup", "ready", "end"])
def test_a_hook_that_raises_is_named(hook: str, fast: bool) -> None:
    assert sentence(one(Hooked(fails=hook)), fast) == f'node "node" failed in {hook}(): ValueError: in {hook}'


def test_a_teardown_that_raises_is_named_behind_a_run_that_went_well(fast: bool) -> None:
    with pytest.raises(
        hfg.errors.TeardownError, match=r'^node "node" failed in teardown\(\): ValueError: in teardown$'
    ):
        run(one(Hooked(fails="teardown")), fast)


def test_a_hook_of_activity_that_raises_is_named(fast: bool) -> None:
    graph = one(Hooked(fails="on_activated"))
    graph.connect(graph.start, graph["node"].activate)
    assert sentence(graph, fast) == 'node "node" failed in on_activated(): ValueError: in on_activated'


def test_a_ready_that_raises_is_not_asked_without_end_when_it_is_skipped(fast: bool) -> None:
    with pytest.raises(hfg.errors.Stalled, match='"node" says by ready'):
        run(one(Hooked(fails="ready"), on_error="skip"), fast)


# --- nodes that write wrongly ---


class Writes(hfg.Node):
    """Writes where it must not."""

    how = hfg.Parameter("")
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int | None:
        if self.how == "twice":
            self.out.send(1)
            self.out.send(2)
        elif self.how == "send and return":
            self.out.send(1)
            return 2
        return None

    @hfg.slot
    def hear(self, value: object) -> None:
        self.out.send(1)


def test_writing_an_output_twice_is_an_error_of_the_node(fast: bool) -> None:
    assert 'output "node.out" was written twice in one firing' in sentence(one(Writes(how="twice")), fast)
    assert 'output "node.out" was written twice in one firing' in sentence(one(Writes(how="send and return")), fast)


def test_writing_an_output_in_a_slot_handler_is_an_error_of_the_node(fast: bool) -> None:
    graph = one(Writes())
    graph.connect(graph.start, graph["node"].hear)
    said = sentence(graph, fast)
    assert said.startswith('node "node" failed in slot hear, call 1')
    assert 'output "node.out" was written in a slot handler' in said
    assert "trigger an event instead" in said


def test_writing_an_output_outside_a_firing_says_so(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        node = graph.add(Writes())
        async with hfg.running(graph, fast=fast):
            with pytest.raises(hfg.errors.UsageError, match='output "writes.out" was written outside a firing'):
                node.out.send(1)

    drive(main)


# --- nodes that give back the wrong thing ---


@hfg.node
def lies(value: int) -> int:
    """Says int, gives text."""
    return f"{value}"  # type: ignore[return-value]


def test_a_wrong_type_is_found_in_debug_mode_only(fast: bool) -> None:
    said = sentence(one(lies()), fast, debug=True)
    assert said == 'node "node" failed in firing 1: TypeError: output "node.out" is declared int, got str: \'1\''
    assert run(one(lies()), fast).outcome == "done"


class Pair(hfg.Node):
    value = hfg.Input(int)
    a = hfg.Output(int)
    b = hfg.Output(int)

    def process(self, value: int) -> Any:
        return (value,)


def test_a_result_that_does_not_fit_the_outputs_says_what_it_takes(fast: bool) -> None:
    said = sentence(one(Pair()), fast)
    assert 'node "node" failed in firing 1: TypeError' in said
    assert '"a", "b"' in said


def test_a_signal_of_the_wrong_type_is_found_in_debug_mode(fast: bool) -> None:
    class Rings(hfg.Node):
        value = hfg.Input(int)
        rang = hfg.Event(int)

        def process(self, value: int) -> None:
            self.rang.trigger("text")  # type: ignore[arg-type]

    graph = one(Rings())
    graph.connect(graph["node"].rang, graph.add(Ear()).hear)
    assert 'event "node.rang" is declared int, got str' in sentence(graph, fast, debug=True)
