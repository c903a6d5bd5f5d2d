"""Models of OpenCV as text: what is trained is written, what is read says itself which kind it is.

A file is OpenCV's own, in YAML: other programs that use OpenCV read and write it too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import cv2
import numpy as np

from hfg.nodes import _structured
from hfg.nodes._structured import need_harmless, trust
from hfg.nodes.learning._samples import Sample

_MOST: Final = 1e30  # OpenCV takes larger numbers for missing ones


def text_of(model: Any) -> bytes:
    """Write a model as OpenCV would."""
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    model.write(storage, model.getDefaultName())
    data: bytes = storage.releaseAndGetString().encode()
    trust(data)
    return data


def model_of(data: bytes, name: str) -> Any:
    """Read a model.

    Args:
      data: what its file holds.
      name: of the file, for messages.

    Raises:
      ValueError: it is not one.
    """
    try:
        need_harmless("model", data)
        return _structured.model_of(data)
    except ValueError as error:
        raise ValueError(
            f'"{name}" holds no model of random trees, nearest neighbors or support vectors as OpenCV writes it for '
            f"variables that are numbers ({error}): train one"
        ) from None


def table_of(samples: Sequence[Sample], width: int | None = None) -> Any:
    """Put the numbers of samples into rows.

    Args:
      samples: one at least.
      width: how many numbers each has; None for as many as the first one.

    Raises:
      ValueError: one has more or fewer numbers than the others, none at all, or one that is not finite.
    """
    width = len(samples[0].values) if width is None else width
    for sample in samples:
        if not sample.values or len(sample.values) != width:
            raise ValueError(f"samples have {max(1, width)} numbers each here, got one with {len(sample.values)}")
    table = np.array([sample.values for sample in samples], np.float64)
    if not (np.abs(table) < _MOST).all():
        raise ValueError(
            f"the numbers of samples are finite and smaller than {_MOST:g}, got {table[~(np.abs(table) < _MOST)][0]}"
        )
    return table.astype(np.float32)
