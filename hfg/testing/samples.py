"""Small files that paths are drawn from, and a folder of their own for nodes that read and write some.

Depends on numpy and on runs, which make the recording among them.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

import hfg
from hfg.testing.nodes import script, sink

__all__ = ["PATHS", "sample_folder"]

PATHS: Final = (
    *("lines.txt", "table.csv", "lines.jsonl", "value.json", "picture.png", "array.npy", "arrays.npz", "video.avi"),
    *("recording.mcap", "folder", "new", "new.png", "new.txt", "new/one.json", "no/such"),
)
"""Relative paths: of files of many kinds, of a folder, and some that lead nowhere yet."""

_PICTURE: Final = bytes.fromhex(  # a PNG of one grey pixel
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a49444154789c636800000082008177cd72b600000000"
    "49454e44ae426082"
)


@contextlib.contextmanager
def sample_folder() -> Iterator[Path]:
    """Make a folder with a file of each kind the working directory for a while: nothing of the user's is touched."""
    with tempfile.TemporaryDirectory(prefix="hfg-try-") as folder, contextlib.chdir(folder):
        _lay_out()
        yield Path(folder)


def _lay_out() -> None:
    Path("folder").mkdir()
    Path("lines.txt").write_text("one\ntwo\nthree\n", encoding="utf-8")
    Path("table.csv").write_text("name,value\na,1\nb,2.5\n", encoding="utf-8")
    Path("lines.jsonl").write_text('{"a": 1}\n[1, 2]\n', encoding="utf-8")
    Path("value.json").write_text('{"a": [1, 2.5, "b", null]}\n', encoding="utf-8")
    for name in ("picture.png", "folder/1.png", "folder/2.png"):
        Path(name).write_bytes(_PICTURE)
    np.save("array.npy", np.arange(6.0).reshape(2, 3))
    np.savez("arrays.npz", first=np.arange(3), second=np.zeros((2, 2)))
    Path("recording.mcap").write_bytes(_recording())
    if find_spec("cv2") is not None:
        Path("video.avi").write_bytes(_video())


@cache
def _recording() -> bytes:
    """Record three numbers."""
    graph = hfg.Graph("recorded")
    graph.add(script()) >> graph.add(sink())
    hfg.run(graph, clock="virtual", begin=lambda run: run.record("recording.mcap", force=True))
    return Path("recording.mcap").read_bytes()


@cache
def _video() -> bytes:
    """Film three small pictures; the codec is the simplest, which every build of OpenCV has."""
    import cv2

    writer = cv2.VideoWriter("video.avi", cv2.VideoWriter.fourcc(*"MJPG"), 5.0, (32, 24))
    for number in range(3):
        writer.write(np.full((24, 32, 3), 80 * number, np.uint8))
    writer.release()
    return Path("video.avi").read_bytes()
