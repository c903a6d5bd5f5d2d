"""Node types that are classes: what they say of themselves, what they refuse, and what a runner gets."""

from __future__ import annotations

import dataclasses
import logging
import tracemalloc
from collections.abc import AsyncIterator, Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import pytest

import hfg
from hfg.errors import DeclarationError, EngineInternalError, UsageError
from hfg.nodetypes.declaration import RESERVED, snake_case
from hfg.nodetypes.node import Place
from hfg.ports import Relaying

if TYPE_CHECKING:
    from decimal import Decimal

Value = TypeVar("Value")


class Pose(NamedTuple):
    x: float


class MapLookup(hfg.Node):
    """Find the pose of a key.

    In the newest map.
    """

    key = hfg.Input(int)
    map = hfg.Input(dict[int, Pose], optional=True)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)
    tolerance = hfg.Parameter(0.1)

    def setup(self) -> None: ...

    def process(self, key, map):  # type: ignore[no-untyped-def]  # noqa: A002
        return key, map

    @hfg.slot
    def forget(self, key: int) -> None: ...


class Count(hfg.Node):
    total = hfg.State(0)

    def process(self, value: int, step: int = 2, *, scale: int = 1) -> int | None:
        self.total += value * step * scale
        return self.total


# --- description -----------------------------------------------------------------------------------------------------


def test_a_type_describes_itself_in_order_of_declaration() -> None:
    kind = MapLookup._type
    assert (kind.name, kind.reference) == ("map_lookup", f"{__name__}:MapLookup")
    assert kind.doc == "Find the pose of a key.\n\nIn the newest map."
    assert [(spec.name, spec.type, spec.optional) for spec in kind.inputs.values()] == [
        ("key", int, False),
        ("map", dict[int, Pose], True),
    ]
    assert (list(kind.outputs), list(kind.events), list(kind.slots)) == (["pose"], ["unknown"], ["forget"])
    assert (kind.process_kind, kind.result, kind.is_source) == ("function", "single", False)
    assert kind.hooks == {"setup"}


def test_one_description_serves_all_nodes() -> None:
    assert MapLookup()._type is MapLookup()._type is MapLookup._type


def test_process_declares_ports_as_a_function_would() -> None:
    kind = Count._type
    assert [(spec.name, spec.type, spec.optional, spec.default) for spec in kind.inputs.values()] == [
        ("value", int, False, None),
        ("step", int, True, 2),
    ]
    assert [(spec.name, spec.type) for spec in kind.outputs.values()] == [("out", int)]
    assert list(kind.parameters) == ["scale"]
    node = Count(scale=3)
    assert node.scale == 3  # type: ignore[attr-defined]
    assert node._process_call()(2, 1) == 6
    assert isinstance(Count.value, hfg.Input)  # type: ignore[attr-defined]
    assert node.out is node.ports.outputs["out"]  # type: ignore[attr-defined]


def test_declared_inputs_meet_arguments_by_name_whatever_their_order() -> None:
    class Swapped(hfg.Node):
        a = hfg.Input(int)
        b = hfg.Input(str)

        def process(self, b, a):  # type: ignore[no-untyped-def]
            return f"{a=} {b=}"

    assert list(Swapped._type.inputs) == ["a", "b"]
    assert Swapped()._process_call()("first", "second") == "a='first' b='second'"


def test_an_argument_annotated_as_token_sees_the_token() -> None:
    class Late(hfg.Node):
        now = hfg.Input(int)
        before = hfg.Input(int, optional=True)

        def process(self, now: hfg.Token[int], before: hfg.Token[int] | None) -> hfg.Token[int]:
            return now

    class Inferred(hfg.Node):
        def process(self, now: hfg.Token[int], before: hfg.Token | None = None) -> None: ...  # type: ignore[type-arg]

    for kind in (Late, Inferred):
        assert [spec.token for spec in kind._type.inputs.values()] == [True, True]
        assert kind._type.inputs["now"].type is int
    assert Inferred._type.inputs["before"].type is Any
    assert Late._type.outputs["out"].type is int


@pytest.mark.rule("F2")
def test_a_source_is_told_by_its_type() -> None:
    class Generator(hfg.Node):
        def process(self) -> Iterator[int | None]:
            yield 1

    class AsyncGenerator(hfg.Node):
        async def process(self) -> AsyncIterator[int]:
            yield 1

    class Reading(hfg.Node):
        async def process(self) -> int:
            return 1

    class Lazy(hfg.Node):
        def process(self) -> Iterator[int]:
            return iter([1])

    class OnlyOptional(hfg.Node):
        def process(self, value: int = 3) -> int:
            return value

    class Slots(hfg.Node):
        done = hfg.Event()

    kinds = [kind._type for kind in (Generator, AsyncGenerator, Reading, Lazy, OnlyOptional, Slots)]
    assert [kind.process_kind for kind in kinds] == [
        "generator",
        "async generator",
        "async",
        "generator",
        "function",
        "none",
    ]
    assert [kind.is_source for kind in kinds] == [True, True, True, True, False, False]
    assert [kind.outputs["out"].type for kind in kinds[:5]] == [int] * 5


def test_a_generator_may_write_its_outputs_itself() -> None:
    class Ticker(hfg.Node):
        tick = hfg.Output(int)

        def process(self):  # type: ignore[no-untyped-def]
            yield

    class Pacer(hfg.Node):
        beat = hfg.Event()

        def process(self) -> Iterator[None]:
            yield

    assert (Ticker._type.process_kind, list(Ticker._type.outputs)) == ("generator", ["tick"])
    assert (Pacer._type.process_kind, Pacer._type.result) == ("generator", "none")


def test_a_type_without_process_has_nothing_to_call() -> None:
    class Quiet(hfg.Node):
        done = hfg.Event()

    with pytest.raises(EngineInternalError, match="no process function"):
        Quiet()._process_call()


def test_a_subclass_inherits_ports_and_may_say_process_anew() -> None:
    class Looser(MapLookup):
        extra = hfg.Output(int)

    class Renamed(Count):
        def process(self, number: float) -> str:  # type: ignore[override]
            return str(number)

    assert list(Looser._type.inputs) == ["key", "map"]
    assert (list(Looser._type.outputs), Looser._type.result) == (["pose", "extra"], "fields")
    assert Looser._type.hooks == {"setup"}
    assert list(Renamed._type.inputs) == ["number"]
    assert Renamed._type.outputs["out"].type is str
    assert Renamed().out.type is str  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match='node type renamed has no input "value"'):
        _ = Renamed().value  # type: ignore[attr-defined]


def test_ports_may_come_from_a_mixin_and_types_may_be_generic() -> None:
    class Mixin:
        done = hfg.Event()

    class Both(Mixin, hfg.Node, Generic[Value]):
        value = hfg.Input(Any)

        def process(self, value: Value) -> Value:
            return value

    assert list(Both._type.events) == ["done"]
    assert Both[int]()._process_call()(3) == 3


def test_an_input_and_an_output_may_share_a_name_but_not_the_short_form() -> None:
    class Blur(hfg.Node):
        image = hfg.Output(bytes)

        def process(self, image: bytes) -> bytes:
            return image

    node = Blur()
    assert (node.ports.inputs["image"].kind, node.ports.outputs["image"].kind) == ("input", "output")
    assert node.ports.inputs["image"] is node.ports.inputs["image"]
    with pytest.raises(UsageError, match=r'node\.ports\.inputs\["image"\] or node\.ports\.outputs\["image"\]'):
        _ = node.image


@pytest.mark.parametrize(
    ("name", "snake"),
    [("MapLookup", "map_lookup"), ("HTTPServer", "http_server"), ("Go2Point", "go2_point"), ("x", "x"), ("_A", "a")],
)
def test_names_are_in_snake_case(name: str, snake: str) -> None:
    assert snake_case(name) == snake


def test_the_public_names_of_a_node_are_exactly_the_reserved_ones() -> None:
    assert {name for name in dir(hfg.Node) if not name.startswith("_")} == RESERVED
    words = """
        setup process ready end teardown on_activated on_deactivated do ports place active log inner start_soon
        activated deactivated processed failed timeout completed enable disable activate deactivate reset
    """
    assert set(words.split()) == RESERVED


def test_only_types_that_can_be_found_have_a_reference() -> None:
    class Local(hfg.Node): ...

    assert Local._type.reference is None


# --- what is refused -------------------------------------------------------------------------------------------------


def declare(**body: Any) -> type[hfg.Node]:
    return type("Broken", (hfg.Node,), body)


@pytest.mark.parametrize("name", sorted(RESERVED - {"process"}))
def test_reserved_names_are_no_ports(name: str) -> None:
    with pytest.raises(DeclarationError, match=f'"{name}" is a reserved name that every node has; choose another'):
        declare(**{name: hfg.Input(int)})


def test_init_is_not_overridden() -> None:
    with pytest.raises(
        DeclarationError, match=r"__init__ cannot be overridden.*hfg\.Parameter and hfg\.State.*setup\(\)"
    ):
        declare(__init__=lambda self: None)


def test_names_that_hfg_itself_uses_are_refused() -> None:
    with pytest.raises(DeclarationError, match='"_copy" is used by hfg itself'):
        declare(_copy=lambda self: None)


def test_an_argument_without_annotation_is_refused() -> None:
    with pytest.raises(DeclarationError, match=r'argument "value" has no annotation.*write `value: float`, or declare'):

        class Broken(hfg.Node):
            def process(self, value) -> None: ...  # type: ignore[no-untyped-def]


def test_a_result_that_nothing_is_said_of_is_refused() -> None:
    with pytest.raises(DeclarationError, match="process does not say what it returns; annotate its result, `-> int`"):

        class Broken(hfg.Node):
            def process(self, value: int): ...  # type: ignore[no-untyped-def]

    with pytest.raises(DeclarationError, match="process does not say what it returns; annotate its result,"):

        class Silent(hfg.Node):
            def process(self):  # type: ignore[no-untyped-def]
                yield 1


def test_beside_declared_inputs_silence_about_the_result_means_none() -> None:
    class Sink(hfg.Node):
        value = hfg.Input(int)

        def process(self, value): ...  # type: ignore[no-untyped-def]

    assert Sink._type.result == "none"


def test_a_type_that_cannot_be_found_at_run_time_is_refused() -> None:
    class Local: ...

    with pytest.raises(DeclarationError, match=r'"Local" in the annotation of "value" cannot be found at run time'):

        class Broken(hfg.Node):
            def process(self, value: Local) -> None: ...

    with pytest.raises(
        DeclarationError, match=r'"Decimal" in the annotation of "return" .*outside `if TYPE_CHECKING:`'
    ):

        class Broken2(hfg.Node):
            def process(self, value: int) -> Decimal: ...


def test_arguments_and_declared_inputs_must_agree() -> None:
    with pytest.raises(DeclarationError, match='process has an argument "other", but the declared inputs are "value"'):

        class TooMany(hfg.Node):
            value = hfg.Input(int)

            def process(self, value: int, other: int) -> None: ...

    with pytest.raises(DeclarationError, match='process has no argument for the input "other"'):

        class TooFew(hfg.Node):
            value = hfg.Input(int)
            other = hfg.Input(int)

            def process(self, value: int) -> None: ...

    with pytest.raises(DeclarationError, match='process gives "value" a default, but the input is mandatory'):

        class Optional(hfg.Node):
            value = hfg.Input(int)

            def process(self, value: int = 3) -> None: ...


def test_a_generator_takes_no_inputs() -> None:
    with pytest.raises(DeclarationError, match=r'a generator is a source and cannot have inputs, but it has "value"'):

        class Broken(hfg.Node):
            def process(self, value: int) -> Iterator[int]:
                yield value


def test_one_declaration_is_one_port() -> None:
    port = hfg.Input(int)
    with pytest.raises(DeclarationError, match='"b" and "a" are the same object'):
        declare(a=port, b=port)


def test_a_port_of_process_must_not_hide_an_attribute() -> None:
    with pytest.raises(DeclarationError, match='"value" is both a port that process declares and an attribute'):

        class Broken(hfg.Node):
            value: ClassVar[int] = 3

            def process(self, value: int) -> None: ...


def test_a_port_of_a_base_must_not_be_overwritten_by_something_else() -> None:
    with pytest.raises(DeclarationError, match='"pose" is a port or parameter of MapLookup, overwritten by 3'):

        class Broken(MapLookup):
            pose = 3  # type: ignore[assignment]


def test_a_subgraph_does_not_fire() -> None:
    with pytest.raises(DeclarationError, match=r"a subgraph does not fire itself; .* build\(\)"):

        class Broken(hfg.Node, Relaying):
            def process(self, value: int) -> None: ...


@pytest.mark.parametrize("hint", [3, "int", [int], print, logging])
def test_what_is_no_type_is_refused_as_the_type_of_a_port(hint: Any) -> None:
    said = '"value" is .*, which is not a type; write the type itself, as in `int`'
    for declare in (hfg.Input, hfg.Output, hfg.Event):
        with pytest.raises(DeclarationError, match=said):
            type("Broken", (hfg.Node,), {"value": declare(hint)})
    with pytest.raises(DeclarationError, match=said):
        hfg.node(lambda value: None, inputs={"value": int}, outputs={"value": hint})
    with pytest.raises(
        hfg.errors.GraphError, match=r'the type of input "value" is .* write graph\.input\("value", int\)'
    ):
        hfg.Graph().input("value", hint)


@pytest.mark.parametrize("method", [{"__eq__": lambda self, other: True}, {"__hash__": None}])
def test_nodes_are_equal_to_themselves_alone(method: dict[str, Any]) -> None:
    with pytest.raises(DeclarationError, match="__eq__ and __hash__ cannot be overridden because .* another name"):
        type("Broken", (hfg.Node,), method)


def test_a_node_type_is_no_dataclass() -> None:
    class Broken(hfg.Node):
        size: int = 3

    made = dataclasses.dataclass(Broken)()
    with pytest.raises(hfg.errors.GraphError, match=r"node type Broken was given an __init__, .* @dataclass: leave"):
        hfg.Graph().add(made)


@pytest.mark.parametrize("word", ["inputs", "parameters"])
def test_inputs_and_parameters_of_a_function_are_mappings(word: str) -> None:
    given: dict[str, Any] = {"inputs": {"value": int}, word: ["value"]}
    with pytest.raises(DeclarationError, match=rf"{word} is a mapping from names of arguments, got \['value'\]; write"):
        hfg.node(lambda value: None, outputs=int, **given)


def test_a_slot_is_made_of_a_method() -> None:
    with pytest.raises(DeclarationError, match=r"hfg.slot is for a method, got 3; write @hfg.slot or hfg.slot\(type"):
        hfg.slot(3)  # type: ignore[call-overload]


def test_star_arguments_are_no_ports() -> None:
    with pytest.raises(DeclarationError, match=r'"\*values" .*values = hfg.Inputs\(int, 3\)'):

        class Broken(hfg.Node):
            def process(self, *values: int) -> None: ...


# --- nodes -----------------------------------------------------------------------------------------------------------


def test_a_node_can_always_be_made_again() -> None:
    node = MapLookup(tolerance=0.3)
    node._place = Place(None, "lookup", "lookup")
    twin = node._copy()
    assert (type(twin), twin._parameters, twin._place) == (MapLookup, {"tolerance": 0.3}, None)
    assert twin._parameters is not node._parameters


def test_outside_a_run_a_node_is_not_active_and_has_no_place() -> None:
    node = MapLookup()
    assert not node.active
    with pytest.raises(
        UsageError, match=r'^node "map_lookup" is not in a graph, so it has no place: add it first, with'
    ):
        _ = node.place
    assert repr(node) == "<MapLookup(tolerance=0.1)>"
    node._place = Place(None, "lookup", "fetch/lookup")
    assert repr(node) == '<MapLookup(tolerance=0.1) at "fetch/lookup">'


def test_log_records_carry_the_path(caplog: pytest.LogCaptureFixture) -> None:
    node = MapLookup()
    with caplog.at_level(logging.INFO, logger="hfg"):
        node.log.info("one %d", 1)
        node._place = Place(None, "lookup", "fetch/lookup")
        node.log.info("two", extra={"more": 2})
    assert [(record.getMessage(), vars(record)["path"]) for record in caplog.records] == [
        ("one 1", "map_lookup"),
        ("two", "fetch/lookup"),
    ]
    assert vars(caplog.records[1])["more"] == 2


def test_hooks_are_given_only_if_overridden() -> None:
    node = MapLookup()
    assert node._hook("setup") == node.setup
    assert all(node._hook(name) is None for name in ("ready", "end", "teardown", "on_activated", "on_deactivated"))
    assert node.ready() is True
    assert [hook() for hook in (node.end, node.teardown, node.on_activated, node.on_deactivated)] == [None] * 4


@pytest.mark.rule("T2")
def test_results_are_split_into_one_value_for_each_output() -> None:
    class Two(hfg.Node):
        value = hfg.Input(int)
        a = hfg.Output(int)
        b = hfg.Output(int)

        def process(self, value): ...  # type: ignore[no-untyped-def]

    class Sink(hfg.Node):
        def process(self, value: int) -> None: ...

    assert Count()._split((1, 2)) == [(1, 2)]
    assert Count()._split(None) == [None]
    assert Two()._split((1, None)) == [1, None]
    assert Two()._split(None) == [None, None]
    assert Sink()._split(None) == []
    with pytest.raises(TypeError, match='two returned 3 values, but has 2 outputs: "a", "b"; return one for each'):
        Two()._split((1, 2, 3))
    with pytest.raises(TypeError, match='two returned 7, but has the outputs "a", "b"; return a tuple'):
        Two()._split(7)
    with pytest.raises(TypeError, match="sink has no output but returned 7"):
        Sink()._split(7)


# --- size and speed --------------------------------------------------------------------------------------------------


def test_a_node_that_nobody_asked_for_its_ports_is_small() -> None:
    MapLookup()
    tracemalloc.start()
    nodes = [MapLookup() for _ in range(1000)]
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size / len(nodes) < 1000


def test_nodes_without_parameters_share_one_dictionary() -> None:
    class Plain(hfg.Node): ...

    assert Plain()._parameters is Plain()._parameters


def test_without_parameters_nothing_stands_between_the_runner_and_process() -> None:
    class Plain(hfg.Node):
        def process(self, value: int) -> int:
            return value

    node = Plain()
    assert node._process_call() == node.process
