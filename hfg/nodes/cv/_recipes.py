"""Turns functions of OpenCV into recipes for node types: what is an input, what a parameter, what an output.

An array that must be given is an input, a number is a parameter; arrays that OpenCV could write into are omitted, and
arrays that it writes into in any case are copied first, because values on edges are never changed (T1). Which kinds of
pixels a function takes has been measured (`_measured.json`), because some of them end the process.
"""

from __future__ import annotations

import functools
import operator
import types
import typing
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Annotated, Any, Final

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from hfg.images import Color, Gray, Image, Rows
from hfg.nodes._making import Port, Recipe, Setting, holds_reals, port_name
from hfg.nodes.cv import _overrides as overrides
from hfg.nodes.cv._calling import Calling, Inlet, Knob
from hfg.nodes.cv._docs import Documentation, read
from hfg.nodes.cv._overrides import Say
from hfg.nodes.cv._stub import Argument, Overload, overloads
from hfg.nodes.cv._words import ABOUT, APEX, ARGUMENTS, CATEGORIES, NO_NODES, OUTPUTS, OVERLOADS, unit_of
from hfg.ports.specs import REQUIRED
from hfg.types import Array, Pixels, array_facts


class ResultKind(msgspec.Struct, frozen=True):
    """What was seen of one output: its dtype and channels if they were always the same, and whether it is an image."""

    dtype: str | None = None
    channels: int | None = None
    image: bool = False


class Measured(msgspec.Struct, frozen=True):
    """The measured behaviour of a function with images of every type.

    Attributes:
      dtypes: kinds of pixels that it takes.
      channels: how many channels.
      deadly: pairs of them that end the process although each by itself is fine.
      results: what came out, in order.
    """

    dtypes: tuple[str, ...] = ("uint8",)
    channels: tuple[int, ...] = (1, 3)
    deadly: tuple[tuple[str, int], ...] = ()
    results: tuple[ResultKind, ...] = ()


class _Table(msgspec.Struct, frozen=True):
    version: str
    functions: dict[str, Measured]


@functools.cache
def measured() -> Mapping[str, Measured]:
    """Return the checked-in table, by OpenCV's names; what it lacks takes images of 8 bits only."""
    data = files("hfg.nodes.cv").joinpath("_measured.json").read_bytes()
    return msgspec.json.decode(data, type=_Table).functions


_ARRAYS: Final = ("MatLike", "MatLike | None")
_LISTS: Final = ("Sequence[MatLike]", "Sequence[KeyPoint]", "Sequence[DMatch]", "Sequence[Sequence[DMatch]]")
_VALUES: Final[Mapping[str, Any]] = {
    "int": int,
    "float": float,
    "bool": bool,
    "str": str,
    "Size": tuple[int, int],
    "Point": tuple[int, int],
    "Point2f": tuple[float, float],
    "Point2d": tuple[float, float],
    "Rect": tuple[int, int, int, int],
    "Scalar": overrides.Channels,
    "Sequence[int]": tuple[int, ...],
    "Sequence[float]": tuple[float, ...],
}
_RESULTS: Final[Mapping[str, Any]] = {
    **_VALUES,
    "Scalar": tuple[float, ...],
    "Vec2d": tuple[float, float],
    "Vec3d": tuple[float, float, float],
    "RotatedRect": overrides.Rotated,
    "Moments": dict[str, float],
    "Sequence[MatLike]": list[Array],
    "Sequence[int]": list[int],
    "Sequence[Rect]": list[tuple[int, int, int, int]],
    "Sequence[Point]": list[tuple[int, int]],
    "numpy.ndarray[Any, numpy.dtype[numpy.uint8]]": npt.NDArray[np.uint8],
}


@functools.cache
def names() -> Mapping[str, str]:
    """Return OpenCV's name for the name of each node type, in alphabetical order."""
    found = {port_name(name): name for name in overloads() if refused(name) is None}
    return dict(sorted(found.items()))


def refused(name: str) -> str | None:
    """Say why a function of OpenCV is no node type; None if it is one."""
    if name in NO_NODES:
        return NO_NODES[name]
    overload = chosen(name)
    if not any(_is_input(one, _say(name, one)) for one in overload.arguments if not one.optional):
        return "it takes no array, so it would be a source without end"
    if overload.returns == "None":
        return "it returns nothing"
    for argument in overload.arguments:
        say = _say(name, argument)
        known = argument.type in (*_ARRAYS, *_LISTS, *_VALUES) or say.hint is not None or say.drop or argument.optional
        if not known:
            return f"its argument {argument.name} is a {argument.type}, which no port carries"
    return None


def chosen(name: str) -> Overload:
    """Return the way to call a function that its node takes."""
    return overloads()[name][OVERLOADS.get(name, 0)]


def _say(function: str, argument: Argument) -> Say:
    own = overrides.FUNCTIONS.get(function, {}).get(argument.name)
    return own or overrides.COMMON.get(argument.name, Say())


def recipe(name: str, seen: Measured | None = None) -> Recipe:
    """Make the recipe for the function that OpenCV calls so; `seen` takes the place of what the table says of it."""
    seen = measured().get(name, Measured()) if seen is None else seen
    function = getattr(cv2, name)
    overload = chosen(name)
    told = read(function, (one.name for one in overload.arguments))
    inlets, knobs, given = _arguments(name, overload, told, seen)
    taken = {inlet.port.name for inlet in inlets} | {knob.setting.name for knob in knobs}
    category = next((one for one, members in CATEGORIES.items() if name in members), "other")
    return Recipe(
        name=port_name(name),
        about=_about(name, told),
        more=(
            f"Fires once for each set of inputs and calls cv2.{name}; a result of None is silence.",
            f"Category: cv {category}.",
            *([f"CS::APEX: {', '.join(f'csapex::{one}' for one in APEX[name].split())}."] if name in APEX else []),
        ),
        inputs=tuple(inlet.port for inlet in inlets),
        settings=tuple(knob.setting for knob in knobs),
        outputs=_outputs(name, overload, told, taken, _sure(seen.results, inlets)),
        raises={
            "TypeError": "an input is of another kind than is declared.",
            "ValueError": _refusals(name),
        },
        call=Calling(
            name,
            function,
            inlets,
            knobs,
            given,
            deadly=frozenset(seen.deadly),
            results=_split_returns(overload.returns),
            is_single=len(told.outputs) <= 1,
        ),
    )


def _arguments(
    name: str, overload: Overload, told: Documentation, seen: Measured
) -> tuple[list[Inlet], list[Knob], dict[str, Any]]:
    """Say what becomes of each argument: an input, a parameter, or what is always the same."""
    inlets: list[Inlet] = []
    knobs: list[Knob] = []
    given: dict[str, Any] = {}
    for argument in overload.arguments:
        say = _say(name, argument)
        if say.drop:
            if say.given is not REQUIRED:
                given[argument.name] = say.given
        elif argument.optional and (argument.name in told.outputs or argument.name in _MADE):
            continue  # an array to write into, which OpenCV makes if nobody gives one
        elif _is_input(argument, say):
            inlets.append(_inlet(name, argument, say, told, seen))
        elif argument.type in _VALUES or say.hint is not None:
            knobs.append(_knob(name, argument, say, told))
    inlets.sort(key=lambda inlet: inlet.port.optional)  # Python wants those with a default last
    return inlets, knobs, given


def _refusals(name: str) -> str:
    own = "".join(f", {need.says}" for need in overrides.NEEDS.get(name, ()))
    return f"an input is empty{own}, or OpenCV refuses the values; the message says why."


def _sure(results: Sequence[ResultKind], inlets: Sequence[Inlet]) -> Sequence[ResultKind]:
    """Remove facts that were constant only because the samples were: pictures of a type that is declared by hand."""
    facts = [array_facts(inlet.port.hint) for inlet in inlets if not inlet.is_image]
    if not any(
        one is not None
        and any(len(shape) == 3 and shape[2] in (2, 3, 4) for shape in one.shapes)
        and len(one.shapes) > 2
        for one in facts
    ):
        return results
    return [msgspec.structs.replace(one, channels=None) for one in results]


_MADE: Final = ("dst", "jacobian", "inliers")
"""Arrays to write into of which the documentation does not always say so."""


def _is_input(argument: Argument, say: Say) -> bool:
    return say.port or argument.type in (*_ARRAYS, *_LISTS)


def _about(name: str, told: Documentation) -> str:
    words = ABOUT.get(name) or told.about or f"Call cv2.{name}."
    return words if words.endswith((".", "!", "?")) else f"{words}."


def _entry(function: str, name: str, told: Documentation) -> str:
    text = ARGUMENTS.get(function, {}).get(name) or told.arguments.get(name) or f"{name} of OpenCV's function."
    return text if text.endswith((".", "!", "?", "...")) else f"{text}."


def _inlet(function: str, argument: Argument, say: Say, told: Documentation, seen: Measured) -> Inlet:
    is_image = say.hint is None
    hint = say.hint or _image_hint(seen)
    if argument.type in _LISTS and say.hint is None and say.convert is None:  # which makes a list of one image
        hint = list[hint]  # type: ignore[valid-type]
    optional = argument.optional or argument.type == "MatLike | None" or say.default is None
    # What is given back under its own name was written into; so was what "dst" is, where it must be given.
    written = argument.name in told.outputs or argument.name == "dst"
    copied = written and not argument.optional and argument.type in _ARRAYS
    port = Port(port_name(argument.name), hint, _entry(function, argument.name, told), optional)
    return Inlet(port, argument.name, say, copied, not argument.optional, is_image, _is_points(hint))


def _is_points(hint: Any) -> bool:
    """Say whether a type is that of points, of lists of them, or of points or something else."""
    if any(isinstance(item, Rows) for item in getattr(hint, "__metadata__", ())):
        return True
    return typing.get_origin(hint) in _AROUND and any(map(_is_points, typing.get_args(hint)))


_AROUND: Final = (list, Annotated, typing.Union, types.UnionType)


def _knob(function: str, argument: Argument, say: Say, told: Documentation) -> Knob:
    hint = say.hint if say.hint is not None else _VALUES[argument.type]
    default = say.default
    own = default is REQUIRED and argument.optional
    if own:
        default, hint = None, hint | None
    unit = unit_of(function, argument.name) if holds_reals(hint) else None
    setting = Setting(port_name(argument.name), hint, default, _entry(function, argument.name, told), unit)
    return Knob(setting, argument.name, say, own)


def _image_hint(found: Measured) -> Any:
    """Return the type of the images that a function takes, as it was measured."""
    scalars = tuple(getattr(np, "bool_" if name == "bool" else name) for name in found.dtypes)
    if found.dtypes == ("uint8",):
        if found.channels == (1,):
            return Gray
        if found.channels == (3,):
            return Color
        if found.channels == (1, 2, 3, 4):
            return Image
    scalar: Any = functools.reduce(operator.or_, scalars)
    return Annotated[npt.NDArray[scalar], Pixels(*found.channels)]


def _outputs(
    name: str, overload: Overload, told: Documentation, taken: set[str], results: Sequence[ResultKind]
) -> tuple[Port, ...]:
    kinds = _split_returns(overload.returns)
    words = told.outputs or ("retval",)
    if len(words) == 1:
        kinds = (overload.returns,)
    ports: list[Port] = []
    for position, (word, kind) in enumerate(zip(words, kinds, strict=False)):
        seen = results[position] if position < len(results) else ResultKind()
        about = told.arguments.get(word) or told.returned or "what OpenCV gives back"
        about = about if about.endswith((".", "!", "?")) else f"{about}."
        if len(words) == 1:
            ports.append(Port("out", _result_hint(kind, seen), about))
            continue
        own = OUTPUTS.get(name, {}).get(word) or port_name(word)
        ports.append(Port(f"{own}_out" if own in taken else own, _result_hint(kind, seen), about))
    return tuple(ports)


def _split_returns(text: str) -> tuple[str, ...]:
    if not text.startswith("tuple["):
        return (text,)
    depth, parts, start = 0, [], len("tuple[")
    for position, letter in enumerate(text[start:-1], start):
        depth += (letter == "[") - (letter == "]")
        if letter == "," and depth == 0:
            parts.append(text[start:position].strip())
            start = position + 1
    return (*parts, text[start:-1].strip())


def _result_hint(kind: str, seen: ResultKind) -> Any:
    if kind.startswith("tuple["):
        return tuple[float, ...]
    if kind not in _ARRAYS:
        return _RESULTS.get(kind, Any)
    scalar = Any if seen.dtype is None else getattr(np, "bool_" if seen.dtype == "bool" else seen.dtype)
    if not seen.image:
        return npt.NDArray[scalar]  # type: ignore[valid-type]
    layout = Pixels() if seen.channels is None else Pixels(seen.channels)
    return Annotated[npt.NDArray[scalar], layout]  # type: ignore[valid-type]
