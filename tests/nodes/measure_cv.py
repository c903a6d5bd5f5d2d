"""Measures which kinds of pixels each generated OpenCV node takes, and which end the process.

Every node is given pictures of every dtype with 1 to 4 channels, with each choice of each of its parameters, in a
process of its own: some functions of OpenCV write beyond their memory for a dtype that they do not expect, and the
process dies, at once or when it ends. Run it after a new version of OpenCV:

    python -m tests.nodes.measure_cv             # writes hfg/nodes/cv/_measured.json
    python -m tests.nodes.measure_cv sqrt blur   # shows what it finds for some, with --json as in the table
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
import typing
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from hfg.nodes.cv import _recipes
from hfg.nodes.cv._recipes import Measured, ResultKind
from hfg.ports.specs import REQUIRED
from tests.nodes.cv_samples import HEIGHT, PARAMETERS, WIDTH, picture, sample

DTYPES = ("uint8", "int8", "uint16", "int16", "int32", "float16", "float32", "float64", "bool")
EVERY = [(dtype, channels) for dtype in DTYPES for channels in (1, 2, 3, 4)]
OPEN = Measured(DTYPES, (1, 2, 3, 4))
TABLE = Path(_recipes.__file__).with_name("_measured.json")


def settings(name: str, recipe: Any) -> Iterator[dict[str, Any]]:
    """The defaults, then each choice of each parameter alone."""
    defaults = {one.name: one.default for one in recipe.settings if one.default is not REQUIRED}
    defaults |= PARAMETERS.get(name, {})
    yield defaults
    for one in recipe.settings:
        hint = one.hint
        while typing.get_origin(hint) is typing.Annotated:
            hint = typing.get_args(hint)[0]
        if typing.get_origin(hint) is typing.Literal:
            yield from ({**defaults, one.name: choice} for choice in typing.get_args(hint) if choice != one.default)
        elif typing.get_origin(hint) is frozenset:
            yield from (
                {**defaults, one.name: frozenset({choice})} for choice in typing.get_args(typing.get_args(hint)[0])
            )


def takes_images(name: str) -> bool:
    """Whether some input of the node takes any picture, so that there is something to measure."""
    return any(hint == _recipes._image_hint(OPEN) for hint in _image_inputs(name))


def _image_inputs(name: str) -> list[Any]:
    recipe = _recipes.recipe(name, OPEN)
    return [typing.get_args(one.hint)[0] if typing.get_origin(one.hint) is list else one.hint for one in recipe.inputs]


def values(recipe: Any, dtype: str, channels: int, *, optional: bool, last: bool = False) -> list[Any]:
    """Pictures where any will do, elsewhere ordinary values of the first or last dtype that is allowed."""
    found: list[Any] = []
    any_image = _recipes._image_hint(OPEN)
    for number, one in enumerate(recipe.inputs):
        image = picture(dtype, channels, number)
        if one.name == "templ":
            image = np.ascontiguousarray(image[4:20, 8:24])
        if one.optional and not optional:
            found.append(None)
        elif one.hint == any_image:
            found.append(image)
        elif typing.get_origin(one.hint) is list and typing.get_args(one.hint)[0] == any_image:
            found.append([image, image])
        else:
            found.append(sample(one.hint, seed=number, last=last))
    return found


def attempt(recipe: Any, dtype: str, channels: int, parameters: dict[str, Any], *, optional: bool, last: bool) -> Any:
    """One call: its results, or None if it refuses."""
    try:
        result = recipe.call(*values(recipe, dtype, channels, optional=optional, last=last), **parameters)
    except (ValueError, TypeError, SystemError):
        return None
    return result if isinstance(result, tuple) and len(recipe.outputs) > 1 else (result,)


def seen(result: Any) -> Any:
    """What the table wants to know of one result."""
    if not isinstance(result, np.ndarray):
        return None
    flat = result.ndim == 2 or (result.ndim == 3 and result.shape[2] <= 4)
    image = flat and min(result.shape[:2]) * 4 >= min(HEIGHT, WIDTH) - 24 and max(result.shape[:2]) * 2 >= WIDTH - 20
    return [result.dtype.name, result.shape[2] if result.ndim == 3 else 1, bool(image)]


def work(name: str, kinds: list[tuple[str, int]], report: Any, variants: bool) -> None:
    """In the child: try, and report each before the next."""
    recipe = _recipes.recipe(name, OPEN)
    for dtype, channels in kinds:
        for parameters in settings(name, recipe):
            ways = {False, any(one.optional for one in recipe.inputs)}
            for optional, last in product(ways, (False, True)):
                results = attempt(recipe, dtype, channels, parameters, optional=optional, last=last)
                rubbish = [np.ones(size, np.uint8) for size in (9, 65, 513, 4097, 70000) for _ in range(8)]
                del rubbish  # broken memory shows when it is used again
                if results is not None:
                    report([dtype, channels, [seen(one) for one in results]])
            if not variants:
                break
        report([dtype, channels, "done"])


def child(name: str, kinds: list[tuple[str, int]], variants: bool = True, limit: float = 120) -> tuple[list[Any], str]:
    """Work in a forked process: what it reported, and how it ended: "", "died" or "slow"."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reader)
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, 1)
        os.dup2(devnull, 2)
        with os.fdopen(writer, "w") as stream:

            def report(line: Any) -> None:
                stream.write(json.dumps(line) + "\n")
                stream.flush()

            try:
                work(name, kinds, report, variants)
            except Exception as error:
                report([repr(error)])
        os._exit(0)
    os.close(writer)
    chunks: list[bytes] = []
    slow = False
    end = time.monotonic() + limit
    with os.fdopen(reader, "rb", buffering=0) as pipe:
        while True:
            if not select.select([pipe], [], [], max(0.0, end - time.monotonic()))[0]:
                os.kill(pid, signal.SIGKILL)
                slow = True
                break
            chunk = pipe.read(1 << 16)
            if not chunk:
                break
            chunks.append(chunk)
    status = os.waitpid(pid, 0)[1]
    lines = [json.loads(line) for line in b"".join(chunks).decode().split("\n")[:-1]]
    if lines and len(lines[-1]) == 1:
        raise RuntimeError(f"{name}: {lines[-1][0]}")
    return lines, "slow" if slow else "died" if status else ""


def measure(name: str) -> tuple[Measured, str]:
    """Everything of one function, and a remark."""
    kinds = EVERY if takes_images(name) else [("uint8", 1)]
    lines, ended = child(name, kinds)
    deadly: list[tuple[str, int]] = []
    if ended == "died":  # find out which: each in a process of its own
        lines = []
        for kind in kinds:
            more, how = child(name, [kind])
            if how == "died":
                deadly.append(kind)
            else:
                lines += more
    worked = {(dtype, channels): results for dtype, channels, results in lines if results != "done"}
    dtypes = tuple(one for one in DTYPES if any(dtype == one for dtype, _ in worked))
    channels = tuple(sorted({number for _, number in worked}))
    results = [results for _, _, results in lines if results != "done"]
    width = max(map(len, results), default=0)
    kinds_of_results = tuple(summed([one[place] for one in results if len(one) > place]) for place in range(width))
    found = Measured(dtypes, channels, tuple(deadly), kinds_of_results)
    deaths = "" if ended != "died" else "dies"
    return found, " ".join(filter(None, [deaths, ended, "" if worked else "never worked"]))


def summed(every: list[Any]) -> ResultKind:
    """What was always the same."""
    arrays = [one for one in every if one is not None]
    if not arrays:
        return ResultKind()
    dtypes, channels, images = ({one[place] for one in arrays} for place in range(3))
    image = images == {True}
    return ResultKind(
        dtypes.pop() if len(dtypes) == 1 else None, channels.pop() if image and len(channels) == 1 else None, image
    )


def main(chosen: list[str]) -> None:
    cv2.setNumThreads(1)
    as_json = "--json" in chosen
    chosen = [name for name in chosen if name != "--json"]
    found: dict[str, Measured] = {}
    for name in chosen or list(_recipes.names().values()):
        found[name], remark = measure(name)
        if (chosen or remark) and not as_json:
            print(f"{name:32} {remark:12} {found[name]}", flush=True)
    if as_json:
        print(msgspec.json.encode(found).decode())
    elif not chosen:
        lines = ",\n".join(f'"{name}": {msgspec.json.encode(one).decode()}' for name, one in sorted(found.items()))
        TABLE.write_text(f'{{"version": "{cv2.__version__}", "functions": {{\n{lines}\n}}}}\n')


if __name__ == "__main__":
    main(sys.argv[1:])
