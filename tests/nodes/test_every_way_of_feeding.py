"""What every type of the families flow, time and activity does however it is fed.

By data and by events, with silence, activity and ends, on the loop and in a thread.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.base.token import END, NO_MESSAGE, Token
from hfg.nodes import activity, flow, time
from hfg.nodetypes.node import Node
from hfg.trace import ActivityChanged, TokenSent, TraceEvent
from hfg.types import accepts

ENDLESS = {"Clock", "Latch", "Ticker"}
"""Sources without an end, which are given one by `until_s`."""

FORKS = {"Join": 2, "SampleAndHold": 2, "Take": 0, "OneShotCommand": 0}
"""In how many places activity is that came with data, if not in one: several outputs are sent to at once, a stream is
given up before, or data is no way for activity."""

ALONE = {"Rejoin": "values[0]"}
"""Inputs of which no other may have a value at the same time."""

ON_THE_LOOP = {
    "Background",
    "Cache",
    "Deadline",
    "Debounce",
    "Delay",
    "MemoryCell",
    "Retry",
    "Schedule",
    "Throttle",
    "Ticker",
    "TimeLimit",
    "Wait",
}
"""Types that wait for time, which cannot be in a thread."""

TYPES: dict[str, Any] = {
    f"{family.__name__.rpartition('.')[2]}.{name}": getattr(family, name)
    for family in (flow, time, activity)
    for name in family.__all__
}
KINDS = [pytest.param(kind, id=name) for name, kind in TYPES.items()]
WITH_INPUTS = [pytest.param(kind, id=name) for name, kind in TYPES.items() if kind._type.inputs]


@hfg.node
def script(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    yield from values


class Heard(hfg.Node):
    """Takes whatever it is told."""

    @hfg.slot
    def hear(self) -> None:
        """Take it."""


def fitting(hint: Any) -> Any:
    """Give a value of a port's type."""
    return next(value for value in (1, 0.5, "start", [1, 2], True) if accepts(value, hint))


class Trial:
    """One node, fed in one way; what it did."""

    def __init__(
        self, kind: Any, values: int = 3, *, silent: bool = False, by_events: bool = False, **options: Any
    ) -> None:
        self.graph = graph = hfg.Graph()
        node: Node = kind()
        if node._type.is_source:
            options.setdefault("max_rate_hz", 100)
        if options.get("group"):
            graph.group(options["group"], threads=1)
        self.node = graph.add(node, name="node", **options)
        ports = node.ports
        given = (None,) * values if silent else None
        for name, port in [*ports.inputs.items(), *ports.slots.items()]:
            if name != ALONE.get(kind.__name__, name):
                continue
            source = graph.add(
                script(values=given or (fitting(port.type),) * values), name=f"to_{name}", max_rate_hz=100
            )
            graph.connect(f"{source.place.name}.out{'.sent' if by_events else ''}", f"node.{name}")
        for name in [*ports.outputs, *ports.events]:
            heard = graph.add(Heard(), name=f"from_{name}")
            graph.connect(f"node.{name}", heard.hear)
        self.sent: dict[str, list[Any]] = {}
        self.report = hfg.run(graph, clock="virtual", until_s=5.0, trace=self._note)

    def _note(self, event: TraceEvent) -> None:
        if isinstance(event, TokenSent):
            _, _, target = event.edge.partition(" -> ")
            if target.startswith("from_"):
                self.sent.setdefault(target.removeprefix("from_").removesuffix(".hear"), []).append(event.token.value)


@pytest.mark.rule("F4", "T4")
@pytest.mark.parametrize("by_events", [False, True], ids=["data", "events"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_type_ends_with_what_feeds_it_and_says_so_on_every_output(kind: Any, by_events: bool) -> None:
    trial = Trial(kind, by_events=by_events)
    assert trial.report.outcome == ("until" if trial.node._type.origin.__name__ in ENDLESS - {"Latch"} else "done")
    for name in trial.node.ports.outputs:
        if trial.report.outcome == "done":
            assert trial.sent[name][-1] is END
            assert trial.sent[name].count(END) == 1


@pytest.mark.rule("F4")
@pytest.mark.parametrize("kind", WITH_INPUTS)
def test_no_type_makes_something_of_silence(kind: Any) -> None:
    trial = Trial(kind, silent=True)
    ends = {"AtEnd": {"ended"}, "MarkerDetector": {"ended"}, "Deadline": {"missed"}}.get(kind.__name__, set())
    for name, values in trial.sent.items():
        assert name in ends or all(value is NO_MESSAGE or value is END for value in values)


@pytest.mark.rule("R1", "F7")
@pytest.mark.parametrize("kind", KINDS)
def test_every_type_does_the_same_in_a_thread_or_says_that_it_cannot(kind: Any) -> None:
    if kind.__name__ in ON_THE_LOOP:
        with pytest.raises(hfg.errors.HfgError, match="thread"):
            Trial(kind, group="thread")
        return
    here, there = Trial(kind), Trial(kind, group="thread")
    assert there.report.outcome == here.report.outcome
    if kind.__name__ not in ENDLESS and not here.node.ports.slots:
        assert there.sent == here.sent


class Active(hfg.Node):
    """Gives one value with activity, behind one without."""

    out = hfg.Output(Any)
    value = hfg.Parameter(1, type=Any)
    given = hfg.State(0)

    def process(self) -> None:
        self.given += 1
        if self.given == 3:
            raise hfg.EndOfStream
        self.out.send(Token(self.value), activity=1 if self.given == 2 else None)


@pytest.mark.rule("A3", "A5", "A8")
@pytest.mark.parametrize("kind", WITH_INPUTS)
def test_activity_that_arrives_with_data_is_neither_lost_nor_doubled(kind: Any) -> None:
    graph = hfg.Graph()
    node = graph.add(kind(), name="node")
    ports = node.ports
    first = next(iter(ports.inputs))
    for name, port in ports.inputs.items():
        if name != ALONE.get(kind.__name__, name):
            continue
        graph.add(Active(value=fitting(port.type)), name=f"to_{name}", max_rate_hz=100)
        graph.connect(f"to_{name}.out", f"node.{name}", active=name == first)
    for name in [*ports.outputs, *ports.events]:
        graph.add(Heard(), name=f"from_{name}")
        graph.connect(f"node.{name}", f"from_{name}.hear", active=True)
    active: set[str] = set()

    def note(event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged):
            (active.add if event.active else active.discard)(event.node)

    hfg.run(graph, clock="virtual", until_s=5.0, trace=note)
    holders = {name for name in active if not name.startswith("to_")}
    if kind.__name__ == "ActivityAbsorber":
        assert holders == set()
    else:
        assert len(holders) == FORKS.get(kind.__name__, 1)
