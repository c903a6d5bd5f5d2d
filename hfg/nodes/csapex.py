"""What graphs of CS::APEX use and the other families have no need for; `hfg convert x.apex x.hfg.yaml` names them.

Depends on functions, nodetype and ports.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Final, Literal

import numpy as np
from annotated_types import Interval, Predicate

from hfg.images import AnyImage, Color
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Inputs, Output, Parameter

__all__ = ["ExampleImage", "UserSwitch", "combine_images"]

_OPERATORS: Final[Mapping[type[ast.AST], Callable[..., Any]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_FUNCTIONS: Final[Mapping[str, tuple[Callable[..., Any], int]]] = {
    "abs": (np.abs, 1),
    "sqrt": (np.sqrt, 1),
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
}
_IMAGE: Final = re.compile(r"\$([0-9]+)")
_LONGEST: Final = 1000


class ExampleImage(Node):
    """Send a drawn picture again and again, to try a graph with.

    A source without end that sends as fast as its consumers take; give it a rate with `max_rate_hz`. All pictures are
    the same array, so it must not be written to.

    Attributes:
      picture: a chessboard of grey, stripes of colours, or a ramp from black to white with a disc.
      width: in pixels.
      height: in pixels.
      image: the picture: blue, green, red.

    CS::APEX: csapex::ExampleImageGenerator.
    """

    picture = Parameter("disc", type=Literal["disc", "chessboard", "stripes"])
    width = Parameter(320, Interval(ge=1, le=10_000), unit="px")
    height = Parameter(240, Interval(ge=1, le=10_000), unit="px")
    image = Output(Color)

    def process(self) -> Color:
        """Send it."""
        return _drawn(self.picture, self.width, self.height)


@lru_cache(maxsize=4)
def _drawn(picture: str, width: int, height: int) -> Color:
    rows, columns = np.mgrid[0:height, 0:width]
    if picture == "chessboard":
        fields = (rows * 8 // height + columns * 8 // width) % 2
        result = np.repeat((64 + 128 * fields)[:, :, None], 3, axis=2).astype(np.uint8)
    elif picture == "stripes":
        stripes = columns * 8 // width
        result = np.stack([255 * (stripes >> bit & 1) for bit in (0, 1, 2)], axis=2).astype(np.uint8)
    else:
        ramp = columns * 255 // max(1, width - 1)
        result = np.repeat(ramp[:, :, None], 3, axis=2).astype(np.uint8)
        radius = min(width, height) / 4
        disc = (rows - height / 2) ** 2 + (columns - width / 2) ** 2 <= radius**2
        result[disc] = (0, 128, 255)
    result.setflags(write=False)
    return result


class UserSwitch(Node):
    """Pass one of two images on, which a parameter chooses, and say whether it is the first one.

    Fires when both are there; a change of the parameter counts from the next firing on.

    Attributes:
      first: an image.
      second: an image.
      selector: which one is passed on.
      image: that image.
      is_first: whether it is the first one.

    CS::APEX: csapex::tutorial::UserSwitch.
    """

    first = Input(AnyImage)
    second = Input(AnyImage)
    selector = Parameter("first", type=Literal["first", "second"])
    image = Output(AnyImage)
    is_first = Output(bool)

    def process(self, first: AnyImage, second: AnyImage) -> tuple[AnyImage, bool]:
        """Pass one on."""
        return (first, True) if self.selector == "first" else (second, False)


def _is_script(script: str) -> bool:
    """Return whether a text is an expression that `combine_images` can read."""
    try:
        _parsed(script)
    except ValueError:
        return False
    return True


@lru_cache(maxsize=64)
def _parsed(script: str) -> ast.expr:
    """Read a script.

    Raises:
      ValueError: it is not one.
    """
    if len(script) > _LONGEST:
        raise ValueError(f"the script has {len(script)} characters; none has more than {_LONGEST}")
    text = _IMAGE.sub(r"_image_\1_", script.replace("^", "**")).strip()
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f'"{script}" is not an expression ({error}); write one as in "255 - $1"') from error
    _need_known(tree, script)
    return tree


def _need_known(tree: ast.expr, script: str) -> None:
    inner: list[ast.expr] = []
    match tree:
        case ast.Constant(value=number) if type(number) in (int, float):
            pass
        case ast.Name(id=name) if re.fullmatch("_image_[1-9][0-9]{0,3}_", name):
            pass
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            inner = [operand]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            inner = [left, right]
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
            inner = [left, right]
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if (
            name in _FUNCTIONS and len(given) == _FUNCTIONS[name][1]
        ):
            inner = given
        case _:
            what = ast.unparse(tree)[:40]
            raise ValueError(f'"{script}": {what!r} is nothing that can be calculated; see combine_images')
    for one in inner:
        _need_known(one, script)


@node(
    inputs={"images": Inputs(AnyImage, 1)},
    outputs=AnyImage,
    parameters={"script": Parameter("$1", Predicate(_is_script))},
)
def combine_images(*images: AnyImage, script: str) -> AnyImage:
    """Calculate with images, pixel by pixel, as an expression says.

    Fires when every input holds an image. It is calculated in floating-point numbers; the result has the kind of pixel
    of the first image, and what is beyond its range becomes the nearest number in it. Comparisons give 1 and 0.

    Args:
      images: of the same size; an image of one channel goes with those of several.
      script: of `$1`, `$2` ... for the images, numbers, `+ - * / % ^`, comparisons, parentheses, and the functions abs,
        sqrt, exp, log, min and max, as in "255 - $1" or "max($1, $2) / 2".

    Returns:
      out: the result.

    Raises:
      ValueError: the script names an image that there is no input for, images are of different sizes, or an image is of
        numbers that cannot be calculated with.

    CS::APEX: csapex::GenericImageCombiner.
    """
    tree = _parsed(script)
    for number, image in enumerate(images, 1):
        if image.dtype.kind not in "buif":
            raise ValueError(f"image {number} is of {image.dtype}, with which combine_images does not calculate")
    channels = max(image.ndim for image in images)
    numbers = [image.astype(np.float64) for image in images]
    numbers = [image[..., None] if image.ndim < channels else image for image in numbers]
    with np.errstate(all="ignore"):
        try:
            found = np.broadcast_to(_value(tree, numbers), np.broadcast_shapes(*(one.shape for one in numbers)))
        except ValueError as error:
            sizes = ", ".join("x".join(map(str, image.shape)) for image in images)
            raise ValueError(
                f"images of {sizes} cannot be combined ({error}); bring them to one size before"
            ) from error
    kind = images[0].dtype
    if kind.kind in "ui":
        limits = np.iinfo(kind)
        # The largest of 64 bits is no number of floats: the nearest one above it would wrap around.
        high = np.nextafter(float(limits.max), 0) if float(limits.max) > limits.max else float(limits.max)
        found = np.clip(np.rint(np.nan_to_num(found)), float(limits.min), high)
    return found.astype(kind)


def _value(tree: ast.expr, images: list[Any]) -> Any:
    match tree:
        case ast.Constant(value=number):
            return np.float64(number)  # type: ignore[arg-type]
        case ast.Name(id=name):
            number = int(name.strip("_").removeprefix("image_"))
            if number > len(images):
                raise ValueError(
                    f"${number} is not an image: there are {len(images)}; correct the script, or add inputs"
                )
            return images[number - 1]
        case ast.UnaryOp(op=op, operand=inner):
            return _OPERATORS[type(op)](_value(inner, images))
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, images), _value(right, images))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _OPERATORS[type(op)](_value(left, images), _value(right, images)).astype(np.float64)
        case ast.Call(func=ast.Name(id=name), args=given):
            return _FUNCTIONS[name][0](*(_value(one, images) for one in given))
    raise AssertionError(ast.dump(tree))  # refused when it was parsed
