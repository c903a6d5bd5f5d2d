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
    """Whether all is there that OpenCV follows when it reads and asks a model: it looks at nothing of this itself."""
    trees, kernel, samples = (node.getNode(name) for name in ("trees", "kernel", "samples"))
    if not trees.empty():
        return _are_trees(node, trees)
    if not kernel.empty():
        return _are_vectors(node)
    return samples.empty() or _are_neighbors(node)


def _are_trees(node: Any, trees: Any) -> bool:
    """In each tree there is one leaf more than there are nodes that split; each names a variable and a class."""
    variables, columns = _int(node, "var_count"), _int(node, "var_all")
    labels = node.getNode("class_labels").size()
    if not (
        0 < variables <= columns
        and _int(node, "ntrees") == trees.size()
        and _within(node.getNode("var_idx"), variables, columns)
        and _within(node.getNode("var_type"), columns, 2)
        and node.getNode("cat_ofs").size() in (0, 2 * variables, 2 * columns)
        and (labels > 0 or not _int(node, "is_classifier"))
    ):
        return False
    return all(_is_tree(trees.at(number).getNode("nodes"), variables, labels) for number in range(trees.size()))


def _is_tree(nodes: Any, variables: int, labels: int) -> bool:
    splits = 0
    for index in range(nodes.size()):
        one = nodes.at(index)
        if not 0 <= _int(one, "norm_class_idx") < max(labels, 1):
            return False
        found = one.getNode("splits")
        splits += not found.empty()
        if not all(0 <= _int(found.at(place), "var", -1) < variables for place in range(found.size())):
            return False
    return bool(nodes.size() == 2 * splits + 1)


def _are_vectors(node: Any) -> bool:
    """Each function that decides names vectors that are there, as long as the samples."""
    variables, total, classes = (_int(node, name) for name in ("var_count", "sv_total", "class_count"))
    vectors, functions = node.getNode("support_vectors"), node.getNode("decision_functions")
    pairs = max(classes * (classes - 1) // 2, 1)
    if not (variables > 0 and 0 < total == vectors.size() and functions.size() == pairs):
        return False
    if any(vectors.at(number).size() != variables for number in range(total)):
        return False
    for number in range(pairs):
        one = functions.at(number)
        count = _int(one, "sv_count")
        index = one.getNode("index")
        if one.getNode("alpha").size() != count or not (index.empty() or _within(index, count, total)):
            return False
        if index.empty() and count != total:
            return False
    return True


def _are_neighbors(node: Any) -> bool:
    """As many answers as samples, and no more are asked than there are."""
    samples, answers = node.getNode("samples").mat(), node.getNode("responses").mat()
    return (
        samples is not None
        and answers is not None
        and samples.ndim == 2
        and samples.dtype == np.float32
        and answers.dtype == np.float32
        and 0 < len(samples) == answers.size
        and _int(node, "default_k") > 0
    )


def _int(node: Any, name: str, otherwise: int = 0) -> int:
    found = node.getNode(name)
    return int(found.real()) if found.isInt() else otherwise


def _within(numbers: Any, count: int, end: int) -> bool:
    """Whether there are so many whole numbers, each from 0 to below an end."""
    found = [numbers.at(place) for place in range(numbers.size())]
    return len(found) == count and all(one.isInt() and 0 <= one.real() < end for one in found)


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
