"""Node types as the face shows them: functions, sources, library functions, classes.

Here and in the files beside, what stands under "as written" is a line of the project's first drawing, unchanged.
"""

from __future__ import annotations

import asyncio
import types
from collections.abc import AsyncIterator, Iterator
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
import pytest
from annotated_types import Ge, Interval

import hfg
from hfg.images import Image


class Pose(NamedTuple):
    x: float
    y: float


# --- as written ---


@hfg.node
def blur(image: Image, *, sigma: Annotated[float, Interval(gt=0, le=20)] = 2.0) -> Image:
    return cv2.GaussianBlur(image, (0, 0), sigma)


@hfg.node
async def ask(question: str) -> str:
    await asyncio.sleep(1)
    return question.upper()


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    yield from range(count)


class Found(NamedTuple):
    pose: Pose
    score: float


@hfg.node(outputs=Found)
def find(image: Image) -> Found | None:
    return Found(Pose(1.0, 2.0), 0.9) if image.any() else None


smooth = hfg.node(cv2.medianBlur, inputs={"src": Image}, outputs=Image, parameters={"ksize": 5})
split = hfg.node(
    cv2.threshold,
    inputs={"src": Image},
    outputs={"level": float, "dst": Image},
    parameters={"thresh": 127, "maxval": 255, "type": cv2.THRESH_OTSU},
)
add = hfg.node(np.add)


class Count(hfg.Node):
    total = hfg.State(0)  # per run: set afresh before setup(), snapshotted where links need it

    def process(self, value: int) -> int:
        self.total += 1
        return self.total


class MapLookup(hfg.Node):
    """Find the pose of a key in the newest map."""

    key = hfg.Input(int)
    map = hfg.Input(dict[int, Pose], optional=True)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)
    tolerance = hfg.Parameter(0.1, Interval(ge=0, le=1), unit="m")  # self.tolerance is the value

    def setup(self) -> None: ...

    def process(self, key, map):  # type: ignore[no-untyped-def]  # noqa: A002 - as many will write it
        if map and key in map:
            self.pose.send(map[key])  # with one output, returning the value does the same
        else:
            self.unknown.trigger(key)

    @hfg.slot
    def forget(self, key: int) -> None:
        self.forgotten = key


# --- what they must do ---


class Seen(hfg.Node):
    """Keeps what arrives."""

    values: list[Any]

    def setup(self) -> None:
        self.values = []

    @hfg.slot
    def see(self, value: Any) -> None:
        self.values.append(value)


@hfg.node
def pictures(*, levels: tuple[int, ...] = (0, 200)) -> Iterator[Image]:
    for level in levels:
        picture = np.zeros((16, 16), np.uint8)
        picture[4:12, 4:12] = level
        yield picture


def results(node: hfg.Node, *, outputs: tuple[str, ...] = ("out",), **sources: hfg.Node) -> dict[str, list[Any]]:
    """Run one node behind a source for each named input, in debug mode, and give what left its outputs."""
    graph = hfg.Graph("one")
    graph.add(node)
    for name, source in sources.items():
        graph.add(source)
        graph.connect(next(iter(source.ports.outputs.values())), node.ports.inputs[name])
    for name in outputs:
        port = node.ports.outputs[name]
        graph.connect(port, graph.output(name, port.type))
    return hfg.run(graph, clock="virtual", debug=True).outputs


def test_function_has_inputs_parameters_and_the_output_out() -> None:
    node = blur(sigma=1.0)
    assert list(node.ports.inputs) == ["image"]
    assert list(node.ports.outputs) == ["out"]
    assert list(node.ports.parameters) == ["sigma"]
    assert node.sigma == 1.0
    first, second = results(node, image=pictures())["out"]
    assert not first.any()
    assert 0 < second[4, 3] < second[8, 8]  # the edge is soft


@pytest.mark.parametrize("sigma", [0.0, 20.5, -1.0, "wide"])
def test_limit_of_a_parameter_holds_from_the_first_value_on(sigma: Any) -> None:
    with pytest.raises(ValueError, match=r'"blur\.sigma"|"sigma"'):
        blur(sigma=sigma)


def test_limit_of_a_parameter_holds_when_it_is_set() -> None:
    node = blur()
    with pytest.raises(ValueError, match="sigma"):
        node.ports.parameters["sigma"].value = 21.0
    assert node.sigma == 2.0


def test_async_function_waits_while_the_graph_goes_on() -> None:
    @hfg.node
    def questions() -> Iterator[str]:
        yield from ("a", "b")

    graph = hfg.Graph()
    asked = graph.add(ask())
    graph.connect(graph.add(questions()).out, asked.question)
    seen = graph.add(Seen())
    graph.connect(asked.out, seen.see)
    ticks = graph.add(numbers(count=4), max_rate_hz=2)
    graph.connect(ticks.out, seen.see)
    report = hfg.run(graph, clock="virtual")
    assert [value for value in seen.values if isinstance(value, str)] == ["A", "B"]
    assert seen.values[:3] == [0, 1, "A"] or seen.values[:3] == [0, 1, 2]  # it asked meanwhile
    assert report.duration_s == 2.0


def test_generator_is_a_source_that_ends() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=3))
    graph.connect(source.out, graph.output("numbers", int))
    report = hfg.run(graph, clock="virtual")
    assert report.outputs["numbers"] == [0, 1, 2]
    assert report.nodes["numbers"].ended


def test_async_generator_is_a_source_and_so_is_what_raises_end_of_stream() -> None:
    assert results(ticks())["out"] == [0, 1]
    assert results(Dice())["out"] == [1, 2]


@hfg.node
async def ticks() -> AsyncIterator[int]:
    for number in range(2):
        await asyncio.sleep(1)
        yield number


class Dice(hfg.Node):
    thrown = hfg.State(0)

    def process(self) -> int:
        self.thrown += 1
        if self.thrown > 2:
            raise hfg.EndOfStream
        return self.thrown


def test_outputs_makes_each_field_an_output_and_none_is_silence() -> None:
    node = find()
    assert list(node.ports.outputs) == ["pose", "score"]
    assert results(node, image=pictures(), outputs=("pose", "score")) == {"pose": [Pose(1.0, 2.0)], "score": [0.9]}


def test_named_tuple_alone_is_one_value() -> None:
    @hfg.node
    def locate(value: int) -> Found:
        return Found(Pose(value, 0.0), 1.0)

    node = locate()
    assert list(node.ports.outputs) == ["out"]
    assert results(node, value=numbers(count=1))["out"] == [Found(Pose(0, 0.0), 1.0)]


def test_library_function_takes_its_parameters_by_name() -> None:
    node = smooth(ksize=3)
    assert list(node.ports.inputs) == ["src"]
    assert node.ksize == 3
    _, second = results(node, src=pictures())["out"]
    assert second.max() == 200
    assert second[4, 4] == 0  # the corner is gone


def test_library_function_with_two_results_has_two_outputs() -> None:
    node = split()
    out = results(node, src=pictures(levels=(90,)), outputs=("level", "dst"))
    assert 0 <= out["level"][0] <= 90
    assert set(np.unique(out["dst"][0])) == {0, 255}


def test_ufunc_needs_no_words() -> None:
    node = add()
    assert list(node.ports.inputs) == ["x1", "x2"]
    assert results(node, x1=numbers(count=3), x2=numbers(count=3))["out"] == [0, 2, 4]


@pytest.mark.parametrize(
    ("function", "call"),
    [
        (cv2.medianBlur, "hfg.node(medianBlur, inputs="),
        (np.clip, "hfg.node(clip, inputs="),
    ],
)
def test_library_function_without_words_is_answered_with_the_call_to_write(function: Any, call: str) -> None:
    with pytest.raises(hfg.errors.DeclarationError) as error:
        hfg.node(function)
    assert call in str(error.value)
    assert "\n" not in str(error.value)


def test_state_is_set_afresh_for_each_run() -> None:
    node = Count()
    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=3)).out, graph.add(node).ports.inputs["value"])
    graph.connect(node.ports.outputs["out"], graph.output("totals", int))
    assert hfg.run(graph, clock="virtual").outputs["totals"] == [1, 2, 3]
    assert hfg.run(graph, clock="virtual").outputs["totals"] == [1, 2, 3]


def test_class_with_declared_ports_sends_or_triggers() -> None:
    @hfg.node
    def maps() -> Iterator[dict[int, Pose]]:
        yield from ({0: Pose(0.0, 0.5)}, {}, {2: Pose(2.0, 0.5)})

    graph = hfg.Graph()
    lookup = graph.add(MapLookup())
    seen = graph.add(Seen())
    graph.connect(graph.add(numbers(count=3)).out, lookup.key)
    graph.connect(graph.add(maps()).out, lookup.map)
    graph.connect(lookup.pose, graph.output("poses", Pose))
    graph.connect(lookup.unknown, seen.see)
    report = hfg.run(graph, clock="virtual", debug=True)
    assert report.outputs["poses"] == [Pose(0.0, 0.5), Pose(2.0, 0.5)]
    assert seen.values == [1]


def test_optional_input_without_an_edge_is_absent() -> None:
    graph = hfg.Graph()
    lookup = graph.add(MapLookup())
    seen = graph.add(Seen())
    graph.connect(graph.add(numbers(count=2)).out, lookup.key)
    graph.connect(lookup.unknown, seen.see)
    hfg.run(graph, clock="virtual")
    assert seen.values == [0, 1]


def test_parameter_of_a_class_is_its_value_and_its_port_has_the_limits() -> None:
    node = MapLookup(tolerance=0.2)
    assert node.tolerance == 0.2
    assert node.ports.parameters["tolerance"].spec.unit == "m"
    with pytest.raises(ValueError, match="tolerance"):
        MapLookup(tolerance=1.5)
    with pytest.raises(ValueError, match="tolerance"):
        node.tolerance = -1.0
    assert node.tolerance == 0.2


def test_calling_a_slot_runs_the_method() -> None:
    class Careful(MapLookup):
        @hfg.slot
        def forget(self, key: int) -> None:
            super().forget(key + 1)

    node = MapLookup()
    node.forget(3)
    assert node.forgotten == 3
    careful = Careful()
    careful.forget(3)
    assert careful.forgotten == 4


def test_argument_annotated_token_sees_the_token() -> None:
    class Late(hfg.Node):
        key = hfg.Input(int)
        late = hfg.Output(float)

        def process(self, key: hfg.Token[int]) -> float:
            return key.stamp + key.value

    graph = hfg.Graph()
    late = graph.add(Late())
    graph.connect(graph.add(numbers(count=3), max_rate_hz=2).out, late.key)
    graph.connect(late.late, graph.output("late", float))
    assert hfg.run(graph, clock="virtual").outputs["late"] == [0.0, 1.5, 3.0]


def test_send_and_trigger_take_modifier_and_stamp() -> None:
    class Sender(hfg.Node):
        value = hfg.Input(int)
        sent = hfg.Output(int)
        told = hfg.Event(int)

        def process(self, value: int) -> None:
            self.told.trigger(value, activity=+1)
            self.sent.send(value, activity=-1, stamp=0.5)

    class Receiver(hfg.Node):
        got = hfg.State(factory=list)

        @hfg.slot
        def told(self, value: hfg.Token[int]) -> None:
            self.got.append(("told", value.activity, value.stamp, self.active))

        @hfg.slot
        def sent(self, value: hfg.Token[int]) -> None:
            self.got.append(("sent", value.activity, value.stamp, self.active))

    graph = hfg.Graph()
    sender, receiver = graph.add(Sender()), graph.add(Receiver())
    graph.connect(graph.add(numbers(count=1)).out, sender.value)
    graph.connect(sender.told, receiver.told, active=True)
    graph.connect(sender.sent, receiver.sent, active=True)
    hfg.run(graph, clock="virtual")
    assert receiver.got == [("told", 1, 0.0, True), ("sent", -1, 0.5, False)]


@pytest.mark.parametrize("hook", ["setup", "teardown", "end", "ready", "on_activated", "on_deactivated"])
@pytest.mark.parametrize("is_async", [False, True])
def test_hook_may_be_def_or_async(hook: str, is_async: bool) -> None:
    called: list[str] = []

    class Body(hfg.Node):
        value = hfg.Input(int)

        def process(self, value: int) -> None: ...

        @hfg.slot
        def begin(self) -> None: ...

    def plain(self: Any) -> bool | None:
        called.append(hook)
        return True if hook == "ready" else None

    async def waiting(self: Any) -> bool | None:
        await asyncio.sleep(0.01)
        return plain(self)

    hooked = types.new_class(
        "Hooked", (Body,), exec_body=lambda body: body.update({hook: waiting if is_async else plain})
    )
    graph = hfg.Graph()
    node = graph.add(hooked(), active_for_s=1.0)
    graph.connect(graph.add(numbers(count=3), max_rate_hz=1).out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.timeout, node.deactivate)
    hfg.run(graph, clock="virtual")
    assert called


def test_node_type_keeps_what_python_knows_of_the_function() -> None:
    assert blur.__wrapped__ is blur.function
    assert blur.__name__ == "blur"
    assert isinstance(blur(), hfg.Node)


def test_limits_of_annotated_types_are_read_wherever_they_stand() -> None:
    @hfg.node
    def scale(value: int, *, by: Annotated[int, Ge(1)] = 1) -> int:
        return by * value

    with pytest.raises(ValueError, match="by"):
        scale(by=0)
    assert results(scale(by=2), value=numbers(count=2))["out"] == [0, 2]
