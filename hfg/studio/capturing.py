"""What a page shows, as a file: a level as SVG, a value as CSV or NPY.

Depends on the drawing, the graph and `showing`.
"""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Iterable, Mapping
from typing import Any, Final, Literal, cast

import numpy as np

from hfg.graph import Graph, drawing
from hfg.graph.drawing import View
from hfg.graph.drawing.seen import Kind
from hfg.graph.structure.level import inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.studio.layouts import positions
from hfg.studio.refusing import Refused
from hfg.studio.showing import fields_of

__all__ = ["level_as_svg", "value_as_file"]

_MOST_BYTES: Final = 16 << 20
_MOST_DIMENSIONS: Final = 2
_FORMULAS: Final = ("=", "+", "-", "@", "\t", "\r", "\n")
"""With which a spreadsheet begins a formula, which may start programs and send what is in the sheet (rule L4)."""


def level_as_svg(graph: Graph, path: str, view: str) -> dict[str, str]:
    """Return the drawing of one level as it is on the canvas; what is active now has an orange border.

    Raises:
      GraphError: there is no such level.
    """
    root = level_of(graph)
    level = root if not path else inside(node_at(root, path))
    if level is None:
        raise Refused("unknown", f'"{path}" is not a subgraph, so nothing is inside it', path)
    seen = View(cast("Kind | None", view or None), depth=0, all_ports=True, places=positions(level))
    return {"name": f"{(path or graph.name).replace('/', '.')}.svg", "svg": drawing.svg(level.face, seen)}


def value_as_file(value: object, path: str, kind: Literal["csv", "npy"]) -> dict[str, str]:
    """Return a value as the bytes of a file, in Base64.

    Raises:
      Refused: it cannot be written like that; the message says why and what can be done instead.
    """
    data = _npy(value) if kind == "npy" else _csv(value)
    if len(data) > _MOST_BYTES:
        raise Refused(
            "usage",
            f"the value has {len(data):,} bytes, more than the page takes; hfg record writes it to a file",
            path,
        )
    name = "".join(letter if letter.isalnum() or letter in "._-" else "." for letter in path)
    return {"name": f"{name}.{kind}", "base64": base64.b64encode(data).decode()}


def _npy(value: object) -> bytes:
    array = np.asarray(value)
    if array.dtype.hasobject:
        raise Refused("usage", f"NPY holds numbers, and this is {type(value).__name__}; save it as CSV")
    written = io.BytesIO()
    np.save(written, array, allow_pickle=False)
    return written.getvalue()


def _csv(value: object) -> bytes:
    written = io.StringIO()
    csv.writer(written).writerows([_harmless(cell) for cell in row] for row in _rows(value))
    return written.getvalue().encode()


def _harmless(cell: object) -> object:
    """Return a cell that a spreadsheet takes for what it is: a text that it would calculate gets an apostrophe."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULAS) else cell


def _rows(value: object) -> Iterable[list[Any]]:
    """Yield lines of cells: those of an array, or of records under the names of their fields."""
    if isinstance(value, np.ndarray):
        if value.ndim > _MOST_DIMENSIONS:
            shape = " x ".join(map(str, value.shape))
            raise Refused("usage", f"CSV has two dimensions, and this array has {value.ndim} ({shape}); save it as NPY")
        return [list(row) if np.ndim(row) else [row] for row in np.atleast_1d(value)]
    items = list(value) if isinstance(value, list | tuple) and not hasattr(value, "_fields") else [value]
    records = [one for item in items if (one := item if isinstance(item, Mapping) else fields_of(item)) is not None]
    if records and len(records) == len(items):
        names = list(dict.fromkeys(name for one in records for name in one))
        return [names, *([one.get(name, "") for name in names] for one in records)]
    return [list(one) if isinstance(one, list | tuple) else [one] for one in items]
