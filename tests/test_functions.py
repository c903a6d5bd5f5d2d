"""Node types that are functions: `hfg.node` on ours and on those of libraries."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import cv2
import msgspec
import numpy as np
import pytest
from annotated_types import Ge, Interval

import hfg
from hfg.errors import DeclarationError, UsageError
from hfg.images import Image
from hfg.nodetypes.functions import FunctionNode, NodeFunction

if TYPE_CHECKING:
    from decimal import Decimal


class Found(NamedTuple):
    pose: str
    score: float | None


@dataclass
class Reading:
    value: float
    unit: str


class Packet(msgspec.Struct):
    head: int
    body: bytes


@hfg.node
def blur(image: Image, *, sigma: Annotated[float, Interval(gt=0, le=20)] = 2.0) -> Image:
    """Blur an image."""
    return image


@hfg.node
def add_up(a: int, b: int = 5) -> int | None:
    return a + b


@hfg.node
async def ask(question: str) -> str:
    return question


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    yield from range(count)


@hfg.node(outputs=Found)
def find(image: Image) -> Found | None: ...


smooth = hfg.node(cv2.medianBlur, inputs={"src": Image}, outputs=Image, parameters={"ksize": 5})
split = hfg.node(
    cv2.threshold,
    inputs={"src": Image},
    outputs={"level": float, "dst": Image},
    parameters={"thresh": 127, "maxval": 255, "type": cv2.THRESH_OTSU},
)
add = hfg.node(np.add)


def ports_of(kind: NodeFunction[..., Any]) -> tuple[list[Any], list[Any], list[str]]:
    type_ = kind._type
    return (
        [(spec.name, spec.type) for spec in type_.inputs.values()],
        [(spec.name, spec.type) for spec in type_.outputs.values()],
        list(type_.parameters),
    )


# --- our functions ---------------------------------------------------------------------------------------------------


def test_arguments_are_inputs_keywords_are_parameters_the_result_is_out() -> None:
    assert ports_of(blur) == ([("image", Image)], [("out", Image)], ["sigma"])
    assert ports_of(add_up) == ([("a", int), ("b", int)], [("out", int)], [])
    assert (add_up._type.inputs["b"].optional, add_up._type.inputs["b"].default) == (True, 5)
    assert (blur._type.name, blur._type.reference, blur._type.doc) == ("blur", f"{__name__}:blur", "Blur an image.")


def test_calling_a_node_type_makes_a_node() -> None:
    node = blur(sigma=1.5)
    assert isinstance(node, hfg.Node)
    assert isinstance(node, FunctionNode)
    assert (node.sigma, node.image.kind, node.out.kind) == (1.5, "input", "output")
    assert repr(node) == "<blur(sigma=1.5)>"
    assert repr(blur) == "<node type blur>"
    with pytest.raises(ValueError, match=r'parameter "blur\.sigma" must be <= 20, got 30'):
        blur(sigma=30)


def test_the_function_itself_is_still_there() -> None:
    assert add_up.function(1, 2) == 3
    assert inspect.unwrap(blur) is blur.function is blur.__wrapped__
    assert (blur.__name__, blur.__doc__, blur.__module__) == ("blur", "Blur an image.", __name__)


def test_calling_it_like_the_function_is_answered_with_where_the_function_is() -> None:
    with pytest.raises(TypeError) as caught:
        blur(np.zeros((2, 2)))  # type: ignore[arg-type, call-arg]
    assert str(caught.value) == "blur(...) makes a node; the function itself is blur.function"
    with pytest.raises(TypeError, match=r'blur has no parameter "image".*inputs are connected, not given here'):
        blur(image=3)  # type: ignore[call-arg]


def test_without_parameters_the_call_is_the_function() -> None:
    assert add_up()._process_call() is add_up.function


def test_parameters_are_read_at_each_call() -> None:
    @hfg.node
    def scale(value: float, *, factor: float = 2.0, offset: float = 0.0) -> float:
        return value * factor + offset

    node = scale()
    call = node._process_call()
    assert call(3) == 6
    node.factor = 5  # type: ignore[attr-defined]
    node.ports.parameters["offset"].value = 1
    assert call(3) == 16


@pytest.mark.rule("F2")
def test_how_a_function_runs_is_told_by_what_it_is_or_says() -> None:
    async def ticks() -> AsyncIterator[int]:
        yield 1

    def lazy() -> Iterator[int]:
        return iter([1])

    def generator() -> Generator[int, None, str]:
        yield 1
        return "end"

    def iterable() -> Iterable[int]:
        yield 1

    def later(value: int) -> Coroutine[Any, Any, int]: ...

    def awaitable(value: int) -> Awaitable[int | None]: ...

    def plain(value: int) -> Iterator[int]:  # one value that is an iterator: with an input it is no source
        return iter([value])

    class Callable_:  # noqa: N801
        async def __call__(self, value: int) -> int:
            return value

    kinds = [hfg.node(function)._type for function in (ticks, lazy, generator, iterable, later, awaitable, plain)]
    kinds.append(hfg.node(Callable_())._type)
    assert [(kind.process_kind, kind.outputs["out"].type) for kind in kinds] == [
        ("async generator", int),
        ("generator", int),
        ("generator", int),
        ("generator", int),
        ("async", int),
        ("async", int),
        ("function", Iterator[int]),
        ("async", int),
    ]
    assert ask._type.process_kind == "async"
    assert numbers._type.is_source
    assert list(numbers(count=2)._process_call()()) == [0, 1]


def test_a_function_that_gives_back_none_is_a_sink() -> None:
    @hfg.node
    def show(value: object) -> None: ...

    assert ports_of(show) == ([("value", object)], [], [])
    assert show._type.result == "none"


@pytest.mark.parametrize(
    ("outputs", "fields", "result"),
    [
        (Found, [("pose", str), ("score", float)], Found("a", 0.5)),
        (Reading, [("value", float), ("unit", str)], Reading(1.0, "m")),
        (Packet, [("head", int), ("body", bytes)], Packet(1, b"x")),
        ({"a": int, "b": str}, [("a", int), ("b", str)], (1, "x")),
    ],
)
def test_outputs_make_one_output_a_field(outputs: Any, fields: list[Any], result: Any) -> None:
    @hfg.node(outputs=outputs)
    def work(value: int): ...  # type: ignore[no-untyped-def]

    assert ports_of(work)[1] == fields
    values = list(result) if isinstance(result, tuple) else [getattr(result, name) for name, _ in fields]
    assert work()._split(result) == values
    assert work()._split(None) == [None, None]
    with pytest.raises(TypeError, match="return a tuple with one value for each"):
        work()._split(3)


def test_a_named_tuple_alone_is_one_value() -> None:
    @hfg.node
    def find_one(image: Image) -> Found: ...

    assert ports_of(find_one)[1] == [("out", Found)]
    assert find_one()._split(Found("a", 1.0)) == [Found("a", 1.0)]


def test_an_input_can_be_renamed_and_an_output_may_have_its_name() -> None:
    @hfg.node(inputs={"path": "file"}, outputs={"file": str, "size": int})
    def load(path: str, n: int) -> tuple[str, int]:
        return path, n

    assert ports_of(load)[0] == [("file", str), ("n", int)]
    assert load()._process_call()("a", 1) == ("a", 1)
    with pytest.raises(UsageError, match=r'node\.ports\.inputs\["file"\] or node\.ports\.outputs\["file"\]'):
        _ = load().file


# --- functions of libraries ------------------------------------------------------------------------------------------


def test_opencv_functions_are_nodes() -> None:
    image = np.zeros((5, 5), np.uint8)
    assert ports_of(smooth) == ([("src", Image)], [("out", Image)], ["ksize"])
    assert smooth(ksize=3)._process_call()(image).shape == (5, 5)
    assert ports_of(split) == ([("src", Image)], [("level", float), ("dst", Image)], ["thresh", "maxval", "type"])
    level, picture = split()._split(split()._process_call()(image))
    assert (level, picture.shape) == (0.0, (5, 5))


def test_ufuncs_are_nodes() -> None:
    assert ports_of(add) == ([("x1", Any), ("x2", Any)], [("out", Any)], [])
    assert add()._process_call()(1, 2) == 3
    assert ports_of(hfg.node(np.sqrt))[0] == [("x", Any)]
    divide = hfg.node(np.divmod)
    assert [name for name, _ in ports_of(divide)[1]] == ["out1", "out2"]
    assert divide()._split(divide()._process_call()(7, 2)) == [3, 1]
    assert hfg.node(np.add, inputs={"x1": int, "x2": int}, outputs=int)()._process_call()(1, 2) == 3


def test_what_was_named_by_assignment_is_found_under_that_name() -> None:
    assert smooth._type.reference == f"{__name__}:smooth"
    assert smooth._type.name == "median_blur"
    assert hfg.node(lambda value: value, inputs={"value": int}, outputs=int)._type.reference is None


def test_arguments_nobody_asked_for_stay_at_their_defaults() -> None:
    def library(data, axis=0, out=None, *, keep=False, **more):  # type: ignore[no-untyped-def]
        return data, axis, out, keep, more

    picked = hfg.node(library, inputs={"data": int}, outputs=tuple, parameters={"keep": True, "extra": 7})
    assert ports_of(picked)[::2] == ([("data", int)], ["extra", "keep"])
    assert picked()._process_call()(1) == (1, 0, None, True, {"extra": 7})
    later = hfg.node(library, inputs={"data": int, "out": str}, outputs=tuple)
    assert later()._process_call()(1, "x") == (1, 0, "x", False, {})


def test_positional_arguments_can_be_parameters() -> None:
    power = hfg.node(math.pow, inputs={"x": float}, outputs=float, parameters={"y": 2.0})
    root = hfg.node(math.pow, inputs={"y": float}, outputs=float, parameters={"x": 2.0})
    assert power()._process_call()(3.0) == 9.0
    assert power(y=3.0)._process_call()(3.0) == 27.0
    assert root()._process_call()(3.0) == 8.0

    @hfg.node(parameters={"factor": 2.0})
    def scale(value: float, factor: Annotated[float, Ge(0)]) -> float:
        return value * factor

    assert ports_of(scale)[::2] == ([("value", float)], ["factor"])
    with pytest.raises(ValueError, match="must be >= 0"):
        scale(factor=-1.0)


def test_parameters_of_libraries_may_have_limits() -> None:
    kind = hfg.node(
        cv2.medianBlur, inputs={"src": Image}, outputs=Image, parameters={"ksize": hfg.Parameter(5, Ge(1), unit="px")}
    )
    assert kind._type.parameters["ksize"].unit == "px"
    with pytest.raises(ValueError, match=r'"median_blur\.ksize" must be >= 1, got 0'):
        kind(ksize=0)


def test_partials_classes_and_lambdas_are_functions() -> None:
    def scale(value: float, factor: float) -> float:
        return value * factor

    double = hfg.node(functools.partial(scale, factor=2.0))
    assert ports_of(double) == ([("value", float)], [("out", float)], ["factor"])
    assert double()._process_call()(3.0) == 6.0
    assert ports_of(hfg.node(Reading)) == ([("value", float), ("unit", str)], [("out", Reading)], [])
    assert hfg.node(lambda value: value + 1, inputs={"value": int}, outputs=int)()._process_call()(1) == 2


# --- what is refused -------------------------------------------------------------------------------------------------


def unannotated(image, sigma=1.0):  # type: ignore[no-untyped-def]
    ...


def half(image: Image):  # type: ignore[no-untyped-def]
    ...


def typing_only(value: Decimal) -> None: ...


def stars(*values: int) -> int: ...


def generating(value: int) -> Iterator[int]:
    yield value


def reserved(reset: int) -> None: ...


def hidden(_value: int) -> None: ...


def keyword(value: int, *, limit=None) -> None:  # type: ignore[no-untyped-def]
    ...


def doubled(value: int, *, out: int = 1) -> int: ...


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (unannotated, {}, 'node type unannotated: argument "image" has no annotation.*write hfg.node'),
        (unannotated, {}, r'hfg\.node\(unannotated, inputs=\{"image": Any\}, outputs=Any\)'),
        (half, {}, r"it does not say what it returns; annotate the result \(`-> None` for a sink\)"),
        (
            cv2.medianBlur,
            {},
            r"cannot read the function's signature; write hfg\.node\(medianBlur, inputs=.*outputs=Any\)",
        ),
        (cv2.medianBlur, {"inputs": {"src": Image}}, r"it does not say what it returns.*outputs=Any"),
        (math.sqrt, {}, r'write hfg\.node\(sqrt, inputs=\{"x": Any\}, outputs=Any\)'),
        (typing_only, {}, r'"Decimal" in the annotation of "value" cannot be found at run time'),
        (stars, {}, r'"\*values" .* inputs=\{"values": hfg.Inputs'),
        (generating, {}, "a generator is a source and cannot have inputs"),
        (reserved, {}, r'"reset" is a reserved name that every node has; .* as in inputs=\{"reset": "reset_in"\}'),
        (hidden, {}, '"_value" cannot be the name of a port'),
        (keyword, {}, 'parameter "limit" has no type; write `limit: float = 1.0`'),
        (doubled, {}, 'two ports are named "out"'),
        (add_up.function, {"inputs": {"c": int}}, r'inputs= names "c", which is not an argument.*arguments are a, b'),
        (add_up.function, {"parameters": {"c": 3}}, 'parameters= names "c"'),
        (add_up.function, {"inputs": {"a": "x", "b": "x"}}, "two inputs have the same name"),
        (add_up.function, {"outputs": {"a b": int}}, '"a b" cannot be the name of a port'),
        (blur, {}, "blur is already a node type;"),
        (3, {}, "needs a function, got 3"),
    ],
)
def test_what_cannot_be_a_node_type_is_refused_with_a_remedy(
    function: Callable[..., Any], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(DeclarationError, match=message):
        hfg.node(function, **options)


def test_a_reserved_name_can_be_renamed() -> None:
    kind = hfg.node(reserved, inputs={"reset": "reset_in"})
    assert list(kind._type.inputs) == ["reset_in"]
