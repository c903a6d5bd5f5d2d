"""What mypy and pyright must accept, with the types they must see; run by test_typing.py."""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, assert_type

import numpy as np
from annotated_types import Interval
from reactivex import Observable
from reactivex import operators as ops

import hfg
from hfg.errors import Problem
from hfg.graph import Edge, GraphInput, GraphOutput, GroupSpec
from hfg.images import Image
from hfg.nodetypes.functions import FunctionNode
from hfg.ports import (
    EventPort,
    InnerSource,
    InnerTarget,
    InputPort,
    OutputPort,
    ParameterPort,
    Relaying,
    SlotPort,
    Source,
    Target,
)

T = TypeVar("T")


def connect(source: Source[T], target: Target[T], *, active: bool = False) -> None: ...


class Pose(NamedTuple):
    x: float


class Found(NamedTuple):
    pose: Pose
    score: float


@hfg.node
def blur(image: Image, *, sigma: Annotated[float, Interval(gt=0, le=20)] = 2.0) -> Image:
    return image


@hfg.node
async def ask(question: str) -> str:
    return question


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def ticks() -> AsyncIterator[float]:
    yield 1.0


@hfg.node
def maybe(value: int, limit: int = 3) -> int | None:
    return value if value < limit else None


@hfg.node
def show(value: object) -> None: ...


@hfg.node(outputs=Found)
def find(image: Image) -> Found | None:
    return None


smooth = hfg.node(np.clip, inputs={"a": Image}, outputs=int, parameters={"a_min": 0, "a_max": 9})

assert_type(blur(sigma=1.0).out, OutputPort[Image])
assert_type(ask(), FunctionNode[str])
assert_type(numbers(count=3).out, OutputPort[int])
assert_type(ticks().out, OutputPort[float])
assert_type(maybe().out, OutputPort[int])
assert_type(smooth(a_max=3).out, OutputPort[int])
find().pose.send(1)


class MapLookup(hfg.Node):
    key = hfg.Input(int)
    map = hfg.Input(dict[int, Pose], optional=True)
    either = hfg.Input(int | str)
    anything = hfg.Input(Any)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)
    done = hfg.Event()
    tolerance = hfg.Parameter(0.1, Interval(ge=0, le=1), unit="m")
    names = hfg.Parameter((), type=tuple[str, ...])
    mode = hfg.Parameter("fast", choices=("fast", "good"))
    band = hfg.Parameter(hfg.Span(0.2, 0.8), unit="m", step=0.1, group="g", help="h", shown_if={"mode": "good"})
    frame = hfg.Parameter(hfg.Colour(255, 128, 0))
    method = hfg.Parameter(8, choices={"Otsu": 8})
    store = hfg.Parameter(Path("a.png"), pattern="*.png", save=True)
    folder = hfg.Parameter(type=Path, directory=True)
    portion = hfg.Parameter(0.0, Interval(ge=0, le=1), read_only=True)
    total = hfg.State(0)
    seen = hfg.State[list[int]](factory=list)
    names_seen = hfg.State(factory=dict[str, int])
    newest = hfg.State(factory=lambda: deque[int](maxlen=3))
    last = hfg.State[int | None](None)

    def setup(self) -> None:
        self.total += 1
        self.tolerance = 0.5
        self.portion = 0.5
        assert_type(self.band, hfg.Span[float])
        assert_type(self.band.low, float)
        assert_type(self.frame.bgr, tuple[int, int, int])
        assert_type(self.method, int)
        assert_type(self.store, Path)
        assert_type(self.folder, Path)

    def process(self, key: int, map: dict[int, Pose] | None, either: int | str, anything: Any) -> None:  # noqa: A002
        if map:
            self.pose.send(map[key], activity=-1, stamp=1.0)
        self.unknown.trigger(key, activity=+1)
        self.done.trigger()
        self.log.info("%s", self.place.path)

    @hfg.slot
    def forget(self, key: int) -> None: ...

    @hfg.slot
    def look(self, key: hfg.Token[str]) -> None: ...

    @hfg.slot
    def watch(self, token: hfg.Token[object]) -> None: ...

    @hfg.slot
    async def wake(self) -> None: ...

    @hfg.slot(type=float)
    def aim(self, angle): ...  # type: ignore[no-untyped-def]


lookup = MapLookup(tolerance=0.2)
assert_type(lookup.key, InputPort[int])
assert_type(lookup.map, InputPort[dict[int, Pose]])
assert_type(lookup.either, InputPort[int | str])
assert_type(lookup.anything, InputPort[Any])
assert_type(lookup.pose, OutputPort[Pose])
assert_type(lookup.unknown, EventPort[int])
assert_type(lookup.done, EventPort[None])
assert_type(lookup.tolerance, float)
assert_type(lookup.names, tuple[str, ...])
assert_type(lookup.mode, str)
assert_type(lookup.total, int)
assert_type(lookup.seen, list[int])
assert_type(lookup.names_seen, dict[str, int])
assert_type(lookup.newest, deque[int])
assert_type(lookup.last, int | None)
assert_type(lookup.forget, SlotPort[int])
assert_type(lookup.look, SlotPort[str])
assert_type(lookup.watch, SlotPort[object])
assert_type(lookup.wake, SlotPort[object])
assert_type(lookup.aim, SlotPort[float])
assert_type(lookup.activated, EventPort[None])
assert_type(lookup.enable, SlotPort[object])
assert_type(lookup.failed, EventPort[hfg.Failure])
assert_type(MapLookup.key, hfg.Input[int])


class Announce(hfg.Node):
    async def do(self) -> str:
        return "closed"


assert_type(Announce().completed, EventPort[Any])
assert_type(lookup.ports.inputs["key"], InputPort[Any])
lookup.forget(3)

connect(numbers().out, lookup.key)
connect(numbers().out, lookup.either)
connect(lookup.unknown, lookup.forget)
connect(lookup.unknown, lookup.watch)
connect(lookup.unknown, lookup.aim)  # int is a float
connect(lookup.done, lookup.wake, active=True)
connect(blur().out, lookup.anything)
connect(lookup.failed, lookup.enable)
connect(lookup.ports.parameters["tolerance"], lookup.aim)
lookup.unknown.activates(lookup.forget)
last = numbers() >> lookup  # checked, never run: the module is only read by type checkers
assert_type(last, MapLookup)
assert_type(numbers().out >> lookup.key, InputPort[int])

observable: Observable[hfg.Token[int]] = lookup.unknown
lookup.unknown.map(lambda token: token.value + 1).subscribe(print)


class Box(hfg.Node, Relaying):
    person = hfg.Input(Pose)
    done = hfg.Event()
    found = hfg.Output(int)
    speed = hfg.Parameter(2.5)
    begin = hfg.slot(type=int)

    def build(self, graph: Any) -> None:
        assert_type(self.person.inner, InnerSource[Pose])
        assert_type(self.done.inner, InnerTarget[None])
        assert_type(self.found.inner, InnerTarget[int])
        assert_type(self.begin.inner, InnerSource[int])
        assert_type(self.speed, ParameterPort[float])
        connect(self.begin.inner, lookup.key)
        connect(numbers().out, self.found.inner)


# The graph: `add` gives the node's own type back, `connect` joins only what fits.
graph = hfg.Graph("fetch")
assert_type(graph.add(lookup, on_error="skip", release="pipelined", active_for_s=5.0), MapLookup)
assert_type(graph.add(numbers(count=3), name="camera", group="vision", max_rate_hz=30), FunctionNode[int])
assert_type(graph.connect(numbers().out, lookup.key, initial=[1]), Edge)
graph.connect(lookup.unknown, lookup.aim)  # int is a float
graph.connect(lookup.unknown, lookup.forget, capacity=100, overflow="drop_oldest", through=[ops.debounce(0.2)])
graph.connect(graph.start, lookup.activate, active=True)
graph.connect(lookup.done, graph.stop)
graph.connect(observable, lookup.key)
graph.connect(lookup.ports.parameters["tolerance"], lookup.aim)
assert_type(graph.input("keys", int), GraphInput[int])
assert_type(graph.output("found", dict[int, Pose]), GraphOutput[dict[int, Pose]])
graph.connect(graph.input("more", int), lookup.key)
graph.connect(lookup.pose, graph.output("poses", Pose))
graph.gate(lookup, by=lookup, idle_rate_hz=1.0)
assert_type(graph.group("vision", threads=1, policy="priority"), GroupSpec)
assert_type(graph.check(), list[Problem])
assert_type(lookup.place.path, str)


class FollowPerson(hfg.Subgraph):
    person = hfg.Input(int)
    done = hfg.Event(int)
    speed = hfg.Parameter(2.5)

    def build(self, graph: hfg.Graph) -> None:
        inside = graph.add(MapLookup())
        graph.connect(self.person.inner, inside.key)
        graph.connect(inside.unknown, self.done.inner)
        graph.promote(self.speed, inside.ports.parameters["tolerance"])


follow = graph.add(FollowPerson(speed=3.0))
assert_type(follow, FollowPerson)
assert_type(follow.graph, hfg.Graph)
graph.connect(numbers().out, follow.person)
assert_type(hfg.run(graph, clock="virtual", until_s=3, policy="fifo", begin=print, allow_idle=True), hfg.Report)


async def with_a_run(run: hfg.Run) -> None:
    assert_type(await run.wait_for(follow.done), hfg.Token[int])
    async with run.feed(graph.input("numbers", int)) as feed:
        await feed.send(3)
    async for number in run.read(graph.output("numbers out", int)):
        assert_type(number, int)
    run.set(follow.ports.parameters["speed"], 2.0)
