"""Reads what OpenCV keeps in files of its own (models, cascades), whoever wrote them (rule L4).

OpenCV follows what such a file says without a look: an index that is too large ends the process. So all that it will
follow is compared first. Its parser is foreign code too, so a file is first read and used in a process of its own: who
kills that one is refused. This module is what that process runs, so it depends only on cv2 and numpy.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import cv2
import numpy as np

_KINDS: Final[Mapping[str, Callable[[], Any]]] = {
    "opencv_ml_rtrees": cv2.ml.RTrees.create,
    "opencv_ml_knn": cv2.ml.KNearest.create,
    "opencv_ml_svm": cv2.ml.SVM.create,
}
_NO_NUMBER: Final = 2**31 - 1  # what OpenCV takes text for
_FORMAT: Final = 3  # of models, since OpenCV 3
_LONGEST_S: Final = 60.0
_MEMORY_BYTES: Final = 3 * 2**30
_SIDE: Final = 10_000  # of the window of a cascade
_LABELS: Final = 256  # of a local binary pattern
_WORDS: Final = _LABELS // 32
_RECTANGLES: Final = 3  # of a Haar feature


def _top(data: bytes) -> Any:
    text = data.decode("utf-8")
    if "\0" in text:
        raise ValueError("it holds a zero byte")
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    return storage, storage.getFirstTopLevelNode()  # the node is of no use without the storage


def model_of(data: bytes) -> Any:
    """Read a model.

    Raises:
      ValueError: it is not a complete model.
    """
    with _as_value_error():
        storage, node = _top(data)
        kind = _KINDS[node.name()]
        if not (_int(node, "format") == _FORMAT and _CHECKS[node.name()](node)):
            raise ValueError("what it names is not there")
        model = kind()
        model.read(node)
        if not model.isTrained():
            raise ValueError("it is not trained")
        del storage
        return model


def cascade_of(data: bytes) -> Any:
    """Read a cascade.

    Raises:
      ValueError: it is not a complete model.
    """
    with _as_value_error():
        storage, node = _top(data)
        detector = cv2.CascadeClassifier()
        if not (_is_cascade(node) and detector.read(node)) or detector.empty():
            raise ValueError("what it names is not there")
        del storage
        return detector


@contextlib.contextmanager
def _as_value_error() -> Iterator[None]:
    try:
        yield
    except (KeyError, SystemError, MemoryError, cv2.error) as error:
        raise ValueError(f"OpenCV does not read it: {error}") from None


# --- models -----------------------------------------------------------------------------------------------------------


def _are_trees(node: Any) -> bool:
    """Variables are columns of samples and numbers; each tree is whole, and names variables and classes."""
    variables, columns = _int(node, "var_count"), _int(node, "var_all") - 1  # the last one is the answer
    trees, labels, types = (_list(node, name) for name in ("trees", "class_labels", "var_type"))
    is_classifier = _int(node, "is_classifier")
    if not (
        0 < variables <= columns
        and 0 < _int(node, "ntrees") == len(trees)
        and _within(_list(node, "var_idx"), variables, columns)
        and _within(types, columns + 1, 2)
        and not any(one.real() for one in types[:-1])  # categories would name further tables
        and len(_list(node, "cat_ofs")) in (0, 2 * columns, 2 * len(types))
        and len(_list(node, "missing_subst")) == len(types)
        and is_classifier in (0, 1)
        and (labels or not is_classifier)
    ):
        return False
    end = columns if _int(node, "global_var_idx") == 1 else variables
    return all(_is_tree(_list(tree, "nodes"), end, len(labels)) for tree in trees)


def _is_tree(nodes: list[Any], variables: int, labels: int) -> bool:
    """It is written from the root on, left before right; each node that splits has two below."""
    awaited = 1
    for one in nodes:
        if not awaited or not 0 <= _int(one, "norm_class_idx") < max(labels, 1):
            return False
        splits = _list(one, "splits")
        awaited += 1 if splits else -1
        if not all(0 <= _int(split, "var", _NO_NUMBER) < variables for split in splits):
            return False
    return awaited == 0


def _are_vectors(node: Any) -> bool:
    """Each function that decides names vectors that are there, as long as the samples; each class has a label."""
    variables, total, classes = (_int(node, name) for name in ("var_count", "sv_total", "class_count"))
    vectors, functions = _list(node, "support_vectors"), _list(node, "decision_functions")
    pairs = max(classes * (classes - 1) // 2, 1)
    if not (variables > 0 and 0 < total == len(vectors) and len(functions) == pairs):
        return False
    if any(len(_items(one)) != variables for one in vectors):
        return False
    labels = node.getNode("class_labels").mat()
    tells_classes = node.getNode("svmType").string() in ("C_SVC", "NU_SVC")
    if tells_classes or classes > 1:
        if classes < 2 or labels is None or labels.dtype != np.int32 or labels.size != classes:
            return False
        return all(_decides(one, total) for one in functions)
    return _int(functions[0], "sv_count") == len(_list(functions[0], "alpha")) == total


def _decides(function: Any, vectors: int) -> bool:
    count = _int(function, "sv_count")
    return len(_list(function, "alpha")) == count and _within(_list(function, "index"), count, vectors)


def _are_neighbors(node: Any) -> bool:
    """As many answers as samples, and no more are asked than there are."""
    samples, answers = node.getNode("samples").mat(), node.getNode("responses").mat()
    return (
        samples is not None
        and answers is not None
        and samples.ndim == 2
        and samples.size > 0
        and samples.dtype == np.float32
        and answers.dtype == np.float32
        and len(samples) == answers.size
        and 0 < _int(node, "default_k") < _NO_NUMBER
    )


_CHECKS: Final[Mapping[str, Callable[[Any], bool]]] = {
    "opencv_ml_rtrees": _are_trees,
    "opencv_ml_knn": _are_neighbors,
    "opencv_ml_svm": _are_vectors,
}


# --- cascades ---------------------------------------------------------------------------------------------------------


def _is_cascade(node: Any) -> bool:
    """Features lie in the window; trees lead downwards, to leaves and features that are there."""
    width, height = _int(node, "width"), _int(node, "height")
    kind = node.getNode("featureType").string()
    categories = _int(node.getNode("featureParams"), "maxCatCount")
    if (kind, categories) not in (("HAAR", 0), ("LBP", _LABELS)) or not (0 < width < _SIDE and 0 < height < _SIDE):
        return False
    features, stages = _list(node, "features"), _list(node, "stages")
    is_feature = _is_haar if kind == "HAAR" else _is_pattern
    if not (features and stages and all(is_feature(one, width, height) for one in features)):
        return False
    step = 3 + (_WORDS if categories else 1)
    weak = [_list(stage, "weakClassifiers") for stage in stages]
    return all(weak) and all(_is_weak(one, step, len(features)) for stage in weak for one in stage)


def _is_haar(feature: Any, width: int, height: int) -> bool:
    rectangles = [_numbers(one) for one in _list(feature, "rects")]
    tilted = _int(feature, "tilted")
    if not 0 < len(rectangles) <= _RECTANGLES or tilted not in (0, 1):
        return False
    return all(len(one) == 5 and _lies_in(one, width, height, tilted=bool(tilted)) for one in rectangles)


def _lies_in(rectangle: list[float], width: int, height: int, *, tilted: bool) -> bool:
    x, y, w, h = rectangle[:4]
    if not all(_is_whole(one) and 0 <= one < _SIDE for one in (x, y, w, h)):
        return False
    if tilted:  # its upper corner is at x, y; one side goes down to the right, the other down to the left
        return h <= x and x + w <= width and y + w + h <= height
    return x + w <= width and y + h <= height


def _is_pattern(feature: Any, width: int, height: int) -> bool:
    found = _numbers(feature.getNode("rect"))
    if len(found) != 4:
        return False
    x, y, w, h = found  # of one of three times three fields
    return _lies_in([x, y, 3 * w, 3 * h], width, height, tilted=False)


def _is_weak(tree: Any, step: int, features: int) -> bool:
    numbers = _numbers(tree.getNode("internalNodes"))
    nodes, rest = divmod(len(numbers), step)
    if rest or not nodes or len(_numbers(tree.getNode("leafValues"))) != nodes + 1:
        return False
    for number in range(nodes):
        *below, feature = numbers[number * step : number * step + 3]
        if not (_is_whole(feature) and 0 <= feature < features):
            return False
        if not all(_is_whole(one) and (number < one < nodes or -nodes <= one <= 0) for one in below):
            return False
    return True


# --- what a file says, as OpenCV takes it -----------------------------------------------------------------------------


def _int(node: Any, name: str, otherwise: int = 0) -> int:
    found = node.getNode(name)
    if found.empty() or found.isNone():
        return otherwise
    number = float(found.real()) if found.isInt() or found.isReal() else math.inf
    return round(number) if abs(number) < _NO_NUMBER else _NO_NUMBER


def _items(node: Any) -> list[Any]:
    """Return the items of a sequence; other nodes have none."""
    return [node.at(place) for place in range(node.size())] if node.isSeq() else []


def _list(node: Any, name: str) -> list[Any]:
    return _items(node.getNode(name)) if node.isMap() else []


def _numbers(node: Any) -> list[float]:
    """Those of a sequence; what else is in it is not a number, so that it is nowhere."""
    return [one.real() if one.isInt() or one.isReal() else math.nan for one in _items(node)]


def _is_whole(number: float) -> bool:
    return float(number).is_integer()


def _within(numbers: list[Any], count: int, end: int) -> bool:
    """Return whether there are `count` integers, each from 0 to below `end`."""
    return len(numbers) == count and all(one.isInt() and 0 <= one.real() < end for one in numbers)


# --- in a process of its own ------------------------------------------------------------------------------------------


def _try_model(data: bytes) -> None:
    model = model_of(data)
    chance = np.random.default_rng(1)
    width = max(1, model.getVarCount())
    for table in (np.zeros((2, width), np.float32), chance.normal(0, 100, (50, width)).astype(np.float32)):
        with contextlib.suppress(cv2.error):
            model.predict(table)


def _try_cascade(data: bytes) -> None:
    detector = cascade_of(data)
    width, height = (min(one + 20, 500) for one in detector.getOriginalWindowSize())
    detector.detectMultiScale(np.random.default_rng(1).integers(0, 255, (height, width), np.uint8))


def tried_with(shape: tuple[int, ...], network: bytes) -> bytes:
    """Return the bytes that say with which input a network is to be tried."""
    return struct.pack(f"<{len(shape) + 1}I", len(shape), *shape) + network


def _input_and_network(data: bytes) -> tuple[Any, bytes]:
    (count,) = struct.unpack_from("<I", data)
    shape = struct.unpack_from(f"<{count}I", data, 4)
    values = np.random.default_rng(1).uniform(0, 1, shape).astype(np.float32)
    return values, data[4 * (count + 1) :]


def _try_opencv(data: bytes) -> None:
    tensor, network = _input_and_network(data)
    net = cv2.dnn.readNetFromONNX(np.frombuffer(network, np.uint8))
    net.setInput(tensor)
    net.forward(net.getUnconnectedOutLayersNames())


def _try_session(data: bytes) -> None:
    import onnxruntime

    tensor, network = _input_and_network(data)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # each thread's stack counts as memory
    try:
        session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        session.run(None, {session.get_inputs()[0].name: tensor})
    except Exception as error:  # its errors have no common class
        raise ValueError(str(error)) from None


_TRIES: Final[Mapping[str, Callable[[bytes], None]]] = {
    "cascade": _try_cascade,
    "model": _try_model,
    "opencv": _try_opencv,
    "session": _try_session,
}
_MOST_TRUSTED: Final = 1000
_trusted: Final[set[bytes]] = set()


def trust(data: bytes) -> None:
    """Take it that this file is harmless, as this process wrote it or has tried it."""
    if len(_trusted) > _MOST_TRUSTED:
        _trusted.clear()
    _trusted.add(hashlib.sha256(data).digest())


def need_harmless(kind: str, data: bytes) -> None:
    """See that a process that reads a file and uses it survives that.

    Args:
      kind: "model", "cascade", "opencv" for a network that OpenCV runs, "session" for one that ONNX Runtime does.
      data: what the file holds.

    Raises:
      ValueError: it does not, needs more than a minute or 3 GiB, or refuses the file.
    """
    if hashlib.sha256(data).digest() in _trusted:
        return
    command = [sys.executable, "-P", __file__, kind]
    places = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=_LONGEST_S, env=places, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"to read it takes more than {_LONGEST_S:.0f} s") from None
    if done.returncode:
        raise ValueError(f"a process that read it ended with {done.returncode}")
    trust(data)


def _main(kind: str) -> int:
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    cv2.setNumThreads(1)
    try:
        _TRIES[kind](sys.stdin.buffer.read())
    except (ValueError, cv2.error):
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1]))
