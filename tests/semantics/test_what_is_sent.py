"""A modifier is -1, 0 or +1 and a stamp a moment, in whichever way a node sends; else it is the node's error (X1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hfg


@hfg.node
def numbers(*, count: int) -> Iterator[int]:
    """Count."""
    yield from range(count)


def saying(say: Callable[[Any], Any]) -> hfg.Node:
    """A node that sends in a firing, in the way of the test."""

    class Says(hfg.Node):
        out = hfg.Output(int)
        said = hfg.Event(int)

        def process(self, value: int) -> int:
            return say(self)  # type: ignore[no-any-return]

    return Says()


def answering(say: Callable[[Any], Any]) -> hfg.Node:
    """A node that sends in a slot."""

    class Answers(hfg.Node):
        said = hfg.Event(int)

        @hfg.slot
        def hear(self, value: int) -> None:
            say(self)

    return Answers()


def hearing(heard: list[int]) -> hfg.Node:
    """A node that keeps what comes."""

    class Hears(hfg.Node):
        def process(self, value: int) -> None:
            heard.append(value)

    return Hears()


def token(activity: Any, stamp: Any) -> hfg.Token[int]:
    return hfg.Token(1, 0 if activity is None else activity, 0.0 if stamp is None else stamp)


WAYS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "send": lambda node, activity, stamp: node.out.send(1, activity=activity, stamp=stamp),
    "send a token": lambda node, activity, stamp: node.out.send(token(activity, stamp)),
    "return a token": lambda node, activity, stamp: token(activity, stamp),
    "trigger": lambda node, activity, stamp: node.said.trigger(1, activity=activity, stamp=stamp),
    "trigger a token": lambda node, activity, stamp: node.said.trigger(token(activity, stamp)),
}
WRONG = {
    "not a number": (None, math.nan, "stamp must be seconds .* got nan"),
    "never": (None, math.inf, "stamp must be seconds .* got inf"),
    "a text": (None, "now", "stamp must be seconds .* got 'now'"),
    "five": (5, None, "activity must be -1, 0 or .1, .* got 5"),
    "a word": ("on", None, "activity must be -1, 0 or .1, .* got 'on'"),
}


def wrong_from(count: int, way: str, what: str) -> Callable[[Any], Any]:
    """Send silence until then, so that fused code is what meets it."""
    activity, stamp, _ = WRONG[what]
    calls = iter(range(1000))
    return lambda node: WAYS[way](node, activity, stamp) if next(calls) >= count else None


@pytest.mark.rule("T1", "T5", "A4", "X1")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_modifier_or_stamp_is_an_error_of_the_firing_that_sends_it(what: str, way: str, fast: bool) -> None:
    graph = hfg.Graph()
    says: Any = graph.add(saying(wrong_from(40, way, what)), name="says")
    heard: list[int] = []
    graph.connect(graph.add(numbers(count=60)).out, says.value)
    for port in (says.out, says.said):
        graph.connect(port, graph.add(hearing(heard)).ports.inputs["value"])
    with pytest.raises(hfg.errors.NodeError, match=f'"says" failed in firing 41: UsageError: {WRONG[what][2]}'):
        hfg.run(graph, clock="virtual", fast=fast)
    assert heard == []


@pytest.mark.rule("T1", "T5", "A4", "X1")
@pytest.mark.parametrize("way", ["trigger", "trigger a token"])
@pytest.mark.parametrize("what", WRONG)
def test_so_it_is_of_a_slot_call(what: str, way: str, fast: bool) -> None:
    graph = hfg.Graph()
    answers: Any = graph.add(answering(wrong_from(40, way, what)))
    last: Any = graph.add(answering(lambda _: None))
    graph.connect(graph.add(numbers(count=60)).out, answers.hear)
    graph.connect(answers.said, last.hear)
    with pytest.raises(hfg.errors.NodeError, match=f"UsageError: {WRONG[what][2]}"):
        hfg.run(graph, clock="virtual", fast=fast)
