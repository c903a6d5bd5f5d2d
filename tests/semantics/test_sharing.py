"""Values that are shared are not changed (rule T1): debug mode locks arrays and finds who changes what all the same."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pytest

import hfg
from hfg.engine.model.sharing import DEPTH
from hfg.errors import NodeError

pytestmark = pytest.mark.rule("T1")

Pixels = hfg.types.Array

SENT: list[Any] = []  # by whichever camera runs, to look at when the run is over


@pytest.fixture(autouse=True)
def _nothing_was_sent() -> Iterator[None]:
    SENT.clear()
    yield
    SENT.clear()


@dataclass
class Frame:
    """A record with an array and a dict in it."""

    pixels: Any
    about: dict[str, int] = field(default_factory=dict)


class Pair(NamedTuple):
    left: Any
    right: Any


def fresh_array(number: int) -> Any:
    return np.full((3, 4), number)


MAKERS: dict[str, Callable[[int], Any]] = {
    "array": fresh_array,
    "view": lambda number: fresh_array(number)[1:],
    "view of a view": lambda number: fresh_array(number)[1:][:1],
    "dataclass": lambda number: Frame(fresh_array(number)),
    "tuple": lambda number: (number, fresh_array(number)),
    "named tuple": lambda number: Pair(number, fresh_array(number)),
    "list": lambda number: [fresh_array(number)],
    "dict": lambda number: {"pixels": fresh_array(number)},
    "deep": lambda number: {"a": [(Frame(fresh_array(number)),)]},
}


@hfg.node
def camera(*, makes: str = "array", count: int = 3) -> Iterator[object]:
    """Sends something new each time."""
    for number in range(count):
        SENT.append(MAKERS[makes](number))
        yield SENT[-1]


@hfg.node
def reusing(*, count: int = 4) -> Iterator[object]:
    """Writes into its own buffer again and again, as camera drivers do."""
    buffer = np.zeros((3, 4), np.int64)
    for number in range(count):
        buffer[:] = number
        yield buffer


@hfg.node
def reusing_by_a_view(*, count: int = 4) -> Iterator[object]:
    """The same by another view than the one that it sends, made before: no flag keeps it from that."""
    ring = np.zeros((2, 3), np.int64)
    own = ring[0]
    for number in range(count):
        own[:] = number
        yield ring[0]


@hfg.node
async def reusing_in_time(*, count: int = 5) -> AsyncIterator[object]:
    """An async one, whose firings wait or do not."""
    buffer = np.zeros(3, np.int64)
    for number in range(count):
        if number % 2:
            await asyncio.sleep(1)
        buffer[:] = number
        yield buffer


def arrays_in(value: object) -> Iterator[Any]:
    """All arrays of what the cameras make, and what they are views of."""
    if isinstance(value, np.ndarray):
        yield value
        if value.base is not None:
            yield from arrays_in(value.base)
    elif isinstance(value, dict):
        yield from arrays_in(list(value.values()))
    elif isinstance(value, Frame):
        yield from arrays_in(value.pixels)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from arrays_in(part)


class Sees(hfg.Node):
    """Looks at whether what it gets can be written to."""

    writeable = hfg.State(factory=list)

    def process(self, value: object) -> None:
        self.writeable += [array.flags.writeable for array in arrays_in(value)]


class Keeps(hfg.Node):
    """Keeps what it gets."""

    kept = hfg.State(factory=list)

    def process(self, value: object) -> None:
        self.kept.append(value)


class KeepsTheLast(hfg.Node):
    """Compares each frame with the one before, as optical flow does."""

    last: hfg.State[Any] = hfg.State(None)

    def process(self, value: object) -> None:
        self.last = value


class SeesInTime(hfg.Node):
    """Takes its time."""

    async def process(self, value: object) -> None:
        await asyncio.sleep(1.5)


class Hears(hfg.Node):
    """Takes values into a slot and may write into them."""

    writes = hfg.Parameter(False)

    @hfg.slot
    def hear(self, value: object) -> None:
        if self.writes:
            value[0] = 7  # type: ignore[index]


class Rings(hfg.Node):
    """Triggers one array again and again, and writes into it in between."""

    rang = hfg.Event(object)
    copies = hfg.Parameter(False)
    buffer: hfg.State[Any] = hfg.State(factory=lambda: np.zeros(3))

    def process(self, value: int) -> None:
        self.buffer[:] = value
        self.rang.trigger(self.buffer.copy() if self.copies else self.buffer)


@hfg.node
def paint(value: object) -> object:
    """Writes into what it takes."""
    value[0] = 1  # type: ignore[index]
    return value


@hfg.node
async def paint_later(value: object) -> None:
    await asyncio.sleep(1)
    value[0] = 1  # type: ignore[index]


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def pass_on(value: object) -> object:
    return value


def run(*nodes: hfg.Node, debug: bool = True, **edge: Any) -> hfg.Report:
    """A source, and each of the others behind it."""
    graph = hfg.Graph()
    source, *others = [graph.add(node) for node in nodes]
    for other in others:
        graph.connect(source.ports.outputs["out"], other.ports.inputs["value"], **edge)
    return hfg.run(graph, clock="virtual", debug=debug)


def sentence(*nodes: hfg.Node, **edge: Any) -> str:
    with pytest.raises(NodeError) as raised:
        run(*nodes, **edge)
    return str(raised.value)


# --- arrays are read-only while they are shared ---


@pytest.mark.parametrize("makes", MAKERS)
def test_arrays_are_read_only_while_a_node_works_on_them_and_as_before_behind_it(makes: str) -> None:
    one, two = Sees(), Sees()
    run(camera(makes=makes), one, two)
    assert one.writeable == two.writeable == [False] * len(one.writeable) != []
    assert all(array.flags.writeable for array in arrays_in(SENT))


@pytest.mark.parametrize("edge", [{"buffer": 2}, {"initial": [0]}])
def test_flags_come_back_behind_buffers_and_delays(edge: dict[str, Any]) -> None:
    run(camera(), Sees(), SeesInTime(), **edge)
    assert all(array.flags.writeable for array in arrays_in(SENT))


def test_flags_come_back_when_a_run_ends_in_the_middle() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(camera()).out, graph.add(SeesInTime()).ports.inputs["value"])
    hfg.run(graph, clock="virtual", debug=True, until_s=1)
    assert len(SENT) == 1
    assert SENT[0].flags.writeable


def test_what_was_read_only_stays_so() -> None:
    @hfg.node
    def locked() -> Iterator[object]:
        whole = np.zeros((2, 3))
        view = whole[0]
        whole.flags.writeable = False
        SENT.extend([whole, view])
        yield view
        yield whole

    run(locked(), Sees(), Sees())
    assert [array.flags.writeable for array in SENT] == [False, True]


def test_memory_that_somebody_lent_is_looked_at_and_not_locked() -> None:
    @hfg.node
    def lent(*, writeable: bool) -> Iterator[object]:
        SENT.append(np.frombuffer(bytearray(8) if writeable else bytes(8), np.uint8))
        yield SENT[-1]

    for writeable in (True, False):
        seen = Sees()
        run(lent(writeable=writeable), seen)
        assert seen.writeable[:1] == [False]
        assert SENT[-1].flags.writeable == writeable


def test_without_debug_nothing_is_locked() -> None:
    seen = Sees()
    run(camera(), seen, debug=False)
    assert seen.writeable == [True] * 3


def test_an_array_in_a_queue_is_locked_until_its_slot_call_is_over() -> None:
    graph = hfg.Graph()
    rings, hears = graph.add(Rings(copies=True)), graph.add(Hears())
    graph.connect(graph.add(numbers()).out, rings.ports.inputs["value"])
    graph.connect(rings.rang, hears.hear)
    assert hfg.run(graph, clock="virtual", debug=True).outcome == "done"
    hears.ports.parameters["writes"].value = True
    with pytest.raises(
        NodeError, match=r'failed in slot hear, call 1: it wrote into the array that it took from "rings'
    ):
        hfg.run(graph, clock="virtual", debug=True)


@pytest.mark.rule("F14")
def test_flags_come_back_one_by_one_where_several_firings_are_under_way() -> None:
    seen: list[tuple[bool, ...]] = []

    @hfg.node
    async def look(value: object) -> None:
        number = int(value[0][0])  # type: ignore[index]
        await asyncio.sleep(10 - 3 * number)  # the first takes the longest
        seen.append(tuple(array.flags.writeable for array in SENT))

    graph = hfg.Graph()
    graph.connect(graph.add(camera()).out, graph.add(look(), concurrency=3, ordered=False).ports.inputs["value"])
    assert hfg.run(graph, clock="virtual", debug=True).outcome == "done"
    assert seen == [(False, False, False), (False, False, True), (False, True, True)]
    assert [array.flags.writeable for array in SENT] == [True] * 3


# --- who writes is told, with the edge ---


@pytest.mark.parametrize("painter", [paint, paint_later])
@pytest.mark.parametrize("makes", ["array", "view"])
def test_a_write_names_node_edge_and_remedy(painter: Any, makes: str) -> None:
    path = painter()._type.name
    assert sentence(camera(makes=makes), painter()) == (
        f'node "{path}" failed in firing 1: it wrote into the array that it took from "camera.out -> {path}.value", '
        f"which others may use too, so it is read-only (T1): change a copy, as in value.copy()"
    )


def test_a_write_in_a_thread_is_told_too() -> None:
    graph = hfg.Graph()
    graph.group("side", threads=1)
    graph.connect(graph.add(camera()).out, graph.add(paint(), group="side").ports.inputs["value"])
    with pytest.raises(NodeError, match=r'it took from "camera\.out -> paint\.value"'):
        hfg.run(graph, clock="virtual", debug=True)


def test_an_array_of_the_users_own_that_is_read_only_is_none_of_ours() -> None:
    @hfg.node
    def careful(value: object) -> None:
        own = np.zeros(3)
        own.flags.writeable = False
        own[0] = 1

    assert sentence(camera(), careful()).endswith("failed in firing 1: ValueError: assignment destination is read-only")


def test_with_skip_the_run_goes_on_and_says_so() -> None:
    graph = hfg.Graph()
    node = graph.add(paint(), on_error="skip")
    graph.connect(graph.add(camera()).out, node.ports.inputs["value"])
    report = hfg.run(graph, clock="virtual", debug=True)
    assert report.nodes["paint"].failed == 3


# --- who writes into its own buffer ---


@pytest.mark.parametrize(
    ("source", "keeper"),
    [
        (reusing, Keeps),
        (reusing, KeepsTheLast),
        (reusing_by_a_view, Keeps),
        (reusing_by_a_view, KeepsTheLast),
        (reusing_in_time, Keeps),
    ],
)
def test_a_source_that_sends_its_buffer_again_is_found_where_somebody_keeps_it(source: Any, keeper: Any) -> None:
    node = source()
    said = sentence(node, keeper())
    assert f'"{node._type.name}.out" sends an array again that was sent before and written to since' in said
    assert "send a copy, as in frame.copy()" in said


@pytest.mark.parametrize("source", [reusing, reusing_by_a_view, reusing_in_time])
@pytest.mark.parametrize("edge", [{}, {"buffer": 1}])
def test_a_source_that_sends_its_buffer_again_when_nobody_has_it_any_more_is_fine(
    source: Any, edge: dict[str, Any]
) -> None:
    assert run(source(), Sees(), Sees(), **edge).outcome == "done"


def test_a_source_that_writes_into_its_buffer_while_others_work_on_it_is_stopped() -> None:
    graph = hfg.Graph()
    graph.group("grab", threads=1)
    source, sink = graph.add(reusing(), group="grab"), graph.add(SeesInTime())
    graph.connect(source.ports.outputs["out"], sink.ports.inputs["value"])
    with pytest.raises(NodeError) as raised:
        hfg.run(graph, clock="virtual", debug=True)
    assert str(raised.value) == (
        'node "reusing" failed in firing 2: it wrote into the array that it has sent on "reusing.out -> '
        'sees_in_time.value" and that was in use there, so it was read-only (T1): send a copy, as in buffer.copy(), or '
        "a new array each time"
    )


def test_a_source_that_writes_by_another_view_while_the_token_waits_is_blamed() -> None:
    graph = hfg.Graph()
    source, sink = graph.add(reusing_by_a_view()), graph.add(SeesInTime())
    graph.connect(source.ports.outputs["out"], sink.ports.inputs["value"], buffer=2)
    with pytest.raises(NodeError, match='node "reusing_by_a_view" failed'):
        hfg.run(graph, clock="virtual", debug=True)


def test_an_event_that_is_triggered_with_one_array_again_and_again() -> None:
    graph = hfg.Graph()
    rings = graph.add(Rings())
    graph.connect(graph.add(numbers()).out, rings.ports.inputs["value"])
    graph.connect(rings.rang, graph.add(Keeps()).ports.inputs["value"])
    with pytest.raises(NodeError, match=r'node "rings" failed in firing 2: .*"rings\.rang'):
        hfg.run(graph, clock="virtual", debug=True)


# --- other values that change ---


def change(value: Any) -> None:
    """Change a value in place, deep inside."""
    match value:
        case dict():
            value["more"] = 1
        case set():
            value.add(99)
        case bytearray():
            value[0] = 7
        case Frame():
            value.about["more"] = 1
        case deque() | list():
            value.append(99)
        case (inner, *_):
            change(inner)


VALUES: dict[str, Callable[[], Any]] = {
    "list": lambda: [1, 2],
    "dict": lambda: {"a": 1},
    "set": lambda: {1, 2},
    "bytearray": lambda: bytearray(3),
    "deque": lambda: deque([1]),
    "dataclass": lambda: Frame(None),
    "in tuples": lambda: (([1],),),
}


@hfg.node
def values(*, makes: str, count: int = 3) -> Iterator[object]:
    for _ in range(count):
        yield VALUES[makes]()


@hfg.node
def change_it(value: object) -> object:
    change(value)
    return value


@pytest.mark.parametrize("makes", VALUES)
def test_a_node_that_changes_what_it_took_is_found(makes: str) -> None:
    assert sentence(values(makes=makes), change_it()) == (
        'node "change_it" failed in firing 1: UsageError: the value that it took from "values.out -> change_it.value" '
        "was changed meanwhile, but what is taken is shared and not changed (T1): change a copy, as in list(values) or "
        "copy.deepcopy(value)"
    )
    assert run(values(makes=makes), pass_on()).outcome == "done"


def test_a_slot_that_changes_what_it_took_is_found() -> None:
    class Changes(hfg.Node):
        @hfg.slot
        def hear(self, value: object) -> None:
            change(value)

    graph = hfg.Graph()
    graph.connect(graph.add(values(makes="list")).out, graph.add(Changes()).hear)
    with pytest.raises(
        NodeError, match=r'failed in slot hear, call 1: .* took from "values\.out -> changes\.hear" was'
    ):
        hfg.run(graph, clock="virtual", debug=True)


def test_a_source_that_changes_what_waits_on_its_edge_is_blamed() -> None:
    class Collects(hfg.Node):
        changed = hfg.Event(object)
        all: hfg.State[list[int]] = hfg.State(factory=list)

        def process(self, value: int) -> None:
            self.all.append(value)
            self.changed.trigger(self.all)

    graph = hfg.Graph()
    collects, sink = graph.add(Collects()), graph.add(SeesInTime())
    graph.connect(graph.add(numbers()).out, collects.ports.inputs["value"])
    graph.connect(collects.changed, sink.ports.inputs["value"])
    with pytest.raises(NodeError) as raised:
        hfg.run(graph, clock="virtual", debug=True)
    assert str(raised.value).startswith(
        'node "sees_in_time" failed in firing 1: UsageError: the value that it took from "collects.changed -> '
        'sees_in_time.value" was changed meanwhile, perhaps by "collects", but what is taken is shared'
    )


def test_a_source_that_changes_what_nobody_has_taken_yet_is_blamed() -> None:
    @hfg.node
    def grows() -> Iterator[object]:
        values = [1]
        yield values
        values.append(2)
        yield list(values)

    graph = hfg.Graph()
    source, sink = graph.add(grows()), graph.add(SeesInTime())
    graph.connect(source.ports.outputs["out"], sink.ports.inputs["value"], initial=[0])
    with pytest.raises(NodeError) as raised:
        hfg.run(graph, clock="virtual", debug=True)
    assert str(raised.value) == (
        'node "grows" failed in what it has sent: UsageError: a value that it sent on "grows.out -> '
        'sees_in_time.value" was changed before "sees_in_time" took it, but what is sent is shared and not changed '
        "(T1): send a copy, or make a new one each time"
    )


def test_what_lies_too_deep_is_not_looked_at() -> None:
    def deep(levels: int) -> Any:
        return [1] if not levels else (deep(levels - 1),)

    @hfg.node
    def nests(*, levels: int) -> Iterator[object]:
        yield deep(levels)

    assert "was changed meanwhile" in sentence(nests(levels=DEPTH - 1), change_it())
    assert run(nests(levels=DEPTH), change_it()).outcome == "done"


def test_a_large_array_costs_a_look_at_a_sample_of_it() -> None:
    @hfg.node
    def films() -> Iterator[object]:
        for number in range(50):
            yield np.full((1080, 1920, 3), number, np.uint8)[:, ::-1]

    assert run(films(), Sees(), Sees()).outcome == "done"
