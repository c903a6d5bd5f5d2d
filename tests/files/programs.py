"""What several tests of graph files need: node types, and a run told as lines."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Interval

import hfg
from hfg.engine.observing.encoding import encode
from hfg.files import describe, load, save, text_of
from hfg.testing import reference_run
from hfg.testing.plans import GraphPlan
from tests.support.making import WIDE, Allowed, random_plan

MOST_MOVES = 1500


class Mode(enum.Enum):
    FAST = "fast"
    GOOD = "good"


@dataclass(frozen=True)
class Pose:
    x: float
    y: float = 0.0


@hfg.node
def numbers(*, count: int = 3, step: float = 1.0) -> Iterator[int]:
    yield from range(count)


@hfg.node
def shown(
    value: int,
    *,
    mode: Mode = Mode.FAST,
    corners: tuple[int, ...] = (),
    pose: Pose | None = None,
    share: Annotated[float, Interval(ge=0, le=1)] = 0.5,
    text: str = "",
) -> int:
    return value


@hfg.node
def double(value: int, *, factor: int = 2) -> int:
    return factor * value


class Ear(hfg.Node):
    rang = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.rang.trigger(value)


class Merged(hfg.Node):
    values = hfg.Inputs(int)
    out = hfg.Output(int)

    def process(self, values: list[int]) -> int:
        return sum(values)


class Scaling(hfg.Subgraph):
    """Multiplies, twice; its factor stands for that of the first."""

    value = hfg.Input(int)
    scaled = hfg.Output(int)
    factor = hfg.Parameter(3)

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(double(), name="first"), graph.add(double(), name="second")
        graph.connect(self.value.inner, first.value)
        graph.connect(first.out, second.value)
        graph.connect(second.out, self.scaled.inner)
        graph.promote(self.factor, first.ports.parameters["factor"])
        graph.gate(second, by=first)


def plan_of(seed: int) -> GraphPlan | None:
    """A random graph that comes to an end under every schedule; None if this seed gives none.

    Every third may have parameters of every kind.
    """
    plan = random_plan(seed, replace(WIDE if seed % 2 else Allowed(), max_nodes=5 + seed % 6, tuned=seed % 3 == 0))
    try:
        report = reference_run(plan.build(), seed=seed, max_moves=MOST_MOVES)
    except RuntimeError:  # it goes round and round
        return None
    endless = report.outcome == "stalled" and any(node.type == "Hums" for node in plan.nodes)
    return None if endless else plan


def told(graph: hfg.Graph, seed: int) -> list[Any]:
    """Everything that happens in a run under one schedule, in order."""
    events: list[Any] = []
    try:
        hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=lambda event: events.append(encode(event)))
    except hfg.errors.RunError as error:
        events.append(str(error))
    return events


def difference(plan: GraphPlan, seed: int, file: Path) -> str | None:
    """Say what a file makes of a graph that is not the same."""
    graph = plan.build()
    save(graph, file)
    first = file.read_text(encoding="utf-8")
    loaded = load(file)
    save(loaded, file)
    if file.read_text(encoding="utf-8") != first:
        return f"{first}\nbecame\n{file.read_text(encoding='utf-8')}"
    if text_of(describe(graph)) != first:
        return "the graph was changed by saving it"
    for one, other in zip_longest(told(graph, seed), told(loaded, seed)):
        if one != other:
            return f"{one!r} became {other!r} in\n{first}"
    return None
