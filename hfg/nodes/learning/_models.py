"""Models of OpenCV as text: what is trained is written, what is read says itself which kind it is.

A file is OpenCV's own, in YAML: other programs that use OpenCV read and write it too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import cv2
import numpy as np

from hfg.nodes.learning._samples import Sample

__all__ = ["model_of", "table_of", "text_of"]

_KINDS: Final[Mapping[str, Callable[[], Any]]] = {
    "opencv_ml_rtrees": cv2.ml.RTrees.create,
    "opencv_ml_knn": cv2.ml.KNearest.create,
    "opencv_ml_svm": cv2.ml.SVM.create,
}
_MOST: Final = 1e30  # OpenCV takes larger numbers for missing ones


def text_of(model: Any) -> bytes:
    """Write a model as OpenCV would."""
    name = next(name for name, kind in _KINDS.items() if isinstance(model, type(kind())))
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    model.write(storage, name)
    return storage.releaseAndGetString().encode()


def model_of(data: bytes, name: str) -> Any:
    """Read a model.

    Args:
      data: what its file holds.
      name: of the file, for messages.

    Raises:
      ValueError: it is none.
    """
    try:
        text = data.decode("utf-8")
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        node = storage.getFirstTopLevelNode()
        kind = _KINDS[node.name()]
        if not _is_whole(node):
            raise ValueError
        model = kind()
        model.read(node)
        if not model.isTrained():
            raise ValueError
    except (KeyError, ValueError, SystemError, cv2.error):
        raise ValueError(
            f'"{name}" holds no model of random trees, nearest neighbors or support vectors as OpenCV writes it: '
            "train one"
        ) from None
    return model


def _is_whole(node: Any) -> bool:
    """Whether all of the trees are there: OpenCV reads a file that was cut off, and then follows what it has not read.

    In each tree there is one leaf more than there are nodes that split.
    """
    trees = node.getNode("trees")
    if trees.empty():
        return True
    if trees.size() != int(node.getNode("ntrees").real()):
        return False
    for number in range(trees.size()):
        nodes = trees.at(number).getNode("nodes")
        splits = sum(not nodes.at(index).getNode("splits").empty() for index in range(nodes.size()))
        if nodes.size() != 2 * splits + 1:
            return False
    return True


def table_of(samples: Sequence[Sample], width: int | None = None) -> Any:
    """Put the numbers of samples into rows.

    Args:
      samples: one at least.
      width: how many numbers each has; None for as many as the first one.

    Raises:
      ValueError: one has more or fewer numbers than the others, none at all, or one that is no finite number.
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
