"""What is brought into another part of a run is exact or refused; what is only looked at never fails (rules L4, R7)."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import EncodingError
from hfg.graph.flat import flatten
from hfg.parts.steering.crossing import Crossing
from hfg.trace import (
    EventTriggered,
    NodeEnded,
    ParameterSet,
    TokenDrained,
    TokenDropped,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

EDGE = "maker.out -> taker.value"


class Maker(hfg.Node):
    factor = hfg.Parameter(1.5)
    out = hfg.Output(list[float])
    alarm = hfg.Event(str)
    anything = hfg.Event(object)

    def process(self) -> list[float]:
        return [self.factor]


@hfg.node
def taker(value: list[float]) -> None: ...


def crossing() -> Crossing:
    graph = hfg.Graph("crossing")
    graph.connect(graph.add(Maker(), name="maker").out, graph.add(taker(), name="taker").value)
    return Crossing(flatten(graph))


@pytest.mark.rule("R7", "L4")
@pytest.mark.parametrize(
    "event",
    [
        TokenSent(0.5, EDGE, Token([1.0, -0.0], 1, 0.25, 3)),
        TokenTaken(0.5, EDGE, Token(END, 0, 0.25, 4)),
        TokenDrained(0.5, EDGE, Token(NO_MESSAGE, 0, 0.25, 5)),
        TokenDropped(0.5, EDGE, Token([2.0], 0, 0.25, 6), "overflow"),
        EventTriggered(0.5, "maker.alarm", Token("hot", 0, 0.25, 1)),
        ParameterSet(0.5, "maker", "factor", 2.5),
        NodeEnded(0.5, "maker"),
    ],
    ids=lambda event: type(event).__name__,
)
def test_an_event_of_the_trace_is_seen_as_it_was(event: TraceEvent) -> None:
    here, there = crossing(), crossing()
    assert there.see_event(here.show_event(event)) == event


@pytest.mark.rule("R7")
@pytest.mark.parametrize(
    ("place", "value", "shown"),
    [
        (EDGE, {"not": "a list"}, "{'not': 'a list'}"),  # a node may lie, which only debug=True forbids
        ("maker.anything", 7, "7"),
    ],
)
def test_of_what_cannot_cross_the_text_is_seen(place: str, value: object, shown: str) -> None:
    here, there = crossing(), crossing()
    seen = there.see(place, here.show(place, Token(value, 1, 0.25, 3)))
    assert (seen.value, seen.activity, seen.stamp, seen.sequence) == (shown, 1, 0.25, 3)


@pytest.mark.rule("P10", "L4")
def test_what_is_brought_in_is_exact() -> None:
    here, there = crossing(), crossing()
    parcel = here.pack("taker.value", list[float], Token([0.1, float("inf")], 1, 0.25, 3))
    assert there.unpack("taker.value", list[float], parcel) == Token([0.1, float("inf")], 1, 0.25, 3)


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("hint", "value", "sentence"),
    [
        (Any, 1, '"taker.value" is in another process, and its values cannot go there: .*; declare what it carries'),
        (list[float], [1j], 'the value of "taker.value"'),
    ],
)
def test_what_cannot_be_exact_is_refused_by_path(hint: Any, value: object, sentence: str) -> None:
    with pytest.raises(EncodingError, match=sentence):
        crossing().pack("taker.value", hint, Token(value))
