"""Runs nodes that write, each with limits on the size of files; a program of its own, because limits stay with it.

Reads one JSON object, {"references": [...], "folder": ...}, and prints for each node what it left.
"""

from __future__ import annotations

import json
import logging
import resource
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hfg
from hfg.errors import HfgError
from hfg.nodes.learning import Sample
from hfg.registry import find

_NOISE = np.random.default_rng(1)
_PICTURES = [_NOISE.integers(0, 255, (48, 64, 3), np.uint8) for _ in range(6)]
_NUMBERS = [[float(number) for number in _NOISE.normal(size=500)] for _ in range(3)]
_SAMPLES = [[Sample((float(number), 1.0 - number), number % 2) for number in range(60)]]
_TEXTS = ["x" * 700, "y" * 700, "z" * 700]

FED: dict[str, tuple[dict[str, list[Any]], dict[str, Any]]] = {
    "ImageDisplay": ({"image": _PICTURES}, {"path": "{}.png"}),
    "HistogramPlot": ({"value": _NUMBERS}, {"path": "{}.png"}),
    "ScatterPlot": ({"x": _NUMBERS, "y": _NUMBERS}, {"path": "{}.png"}),
    "TimePlot": ({"value": _NUMBERS}, {"path": "{}.png"}),
    "VectorPlot": ({"at": _NUMBERS, "vectors[0]": _NUMBERS}, {"path": "{}.png"}),
    "StackArrays": ({"value": [np.ones(100)] * 5}, {"path": "{}.npy"}),
    "WriteArray": ({"array": [np.ones(500)]}, {"path": "{}.npy"}),
    "WriteArrays": ({"arrays": [{"a": _NOISE.normal(size=500)}]}, {"path": "{}.npz"}),
    "WriteBytes": ({"data": [bytes(3000)]}, {"path": "{}.bin"}),
    "WriteCsv": ({"row": [{"a": text, "b": 1} for text in _TEXTS]}, {"path": "{}.csv"}),
    "WriteImage": ({"image": _PICTURES[:1]}, {"path": "{}.png"}),
    "WriteJson": ({"value": [list(range(1000))]}, {"path": "{}.json"}),
    "WriteJsonLines": ({"value": list(_TEXTS)}, {"path": "{}.jsonl"}),
    "WriteLines": ({"text": _TEXTS}, {"path": "{}.txt"}),
    "WriteText": ({"text": ["x" * 3000]}, {"path": "{}.txt"}),
    "NearestTrainer": ({"samples": _SAMPLES}, {"path": "{}.yaml", "every": 60}),
    "RandomTreesTrainer": ({"samples": _SAMPLES}, {"path": "{}.yaml", "every": 60}),
    "SvmTrainer": ({"samples": _SAMPLES}, {"path": "{}.yaml", "every": 60}),
    "WriteVideo": ({"image": _PICTURES}, {"path": "{}.avi"}),
    "WriteVideo mp4v": ({"image": _PICTURES}, {"path": "{}.mp4", "codec": "mp4v"}),
    "WriteVideo XVID": ({"image": _PICTURES}, {"path": "{}.avi", "codec": "XVID"}),
    "WriteLines buffered": ({"text": _TEXTS}, {"path": "{}.txt", "flush": False}),
}
"""What each node is fed, by its name, and its parameters; with a second word, another way to use it."""


class Outcome(NamedTuple):
    """What a node left, with a limit on the size of files or without."""

    way: str
    limit: int | None
    error: str
    left: dict[str, Any]


def ways(reference: str) -> list[str]:
    """The entries of `FED` for a node type."""
    name = reference.partition(":")[2]
    return [way for way in FED if way.partition(" ")[0] == name]


@hfg.node
def given(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    """Send values."""
    yield from values


def run(reference: str, way: str, folder: Path, name: str) -> tuple[Path, str]:
    """Run it; gives where its file is to be and the error."""
    feeds, parameters = FED[way]
    file = folder / str(parameters["path"]).format(name)
    graph = hfg.Graph("full")
    node: Any = find(reference)
    writer = graph.add(node(**{**parameters, "path": type(node._type.parameters["path"].default)(file)}), name="writer")
    for number, (port, values) in enumerate(feeds.items()):
        source = graph.add(given(values=tuple(values)), name=f"given_{number}")
        graph.connect(source.out, writer.ports.inputs[port])
    try:
        report = hfg.run(graph, clock="virtual")
    except HfgError as error:
        return file, str(error)
    return file, " ".join(report.errors)


def limited(bytes_: int) -> None:
    """Let no file become larger."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def main() -> None:
    """Try all that is asked for."""
    asked = json.load(sys.stdin)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    logging.disable(logging.CRITICAL)
    found: list[Outcome] = []
    for reference in asked["references"]:
        for way in ways(reference):
            folder = Path(asked["folder"], way.replace(" ", "-"))
            folder.mkdir()
            file, error = run(reference, way, folder, "whole")
            size = file.stat().st_size if file.exists() else 0
            found.append(Outcome(way, None, error, left(folder, file.name)))
            file.unlink(missing_ok=True)
            for limit in (size - 1, size // 2, 10):
                limited(limit)
                file, error = run(reference, way, folder, "limited")
                limited(resource.RLIM_INFINITY)
                found.append(Outcome(way, limit, error, left(folder, file.name)))
                for one in folder.iterdir():
                    one.unlink()
    print(json.dumps([one._asdict() for one in found]))


def left(folder: Path, name: str) -> dict[str, Any]:
    """What lies in the folder: whether the file is there, and what else."""
    names = {file.name for file in folder.iterdir()}
    return {"file": name in names, "part": f"{name}.part" in names, "else": sorted(names - {name, f"{name}.part"})}


if __name__ == "__main__":
    main()
