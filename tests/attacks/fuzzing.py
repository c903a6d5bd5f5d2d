"""Damaged files of every kind, made from good ones: each is read, or refused with a sentence, in bounded time.

`python -m tests.attacks.fuzzing KIND,... SEED COUNT FILE` tries so many in a process of its own, of limited memory,
and writes kind and number of each into that file beforehand: who kills the process is found by that.
"""

from __future__ import annotations

import base64
import io
import itertools
import json
import os
import random
import resource
import struct
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np

import hfg
from hfg.encoding.pictures import need_fair_size, size_of
from hfg.errors import HfgError
from hfg.files import apex
from hfg.nodes import _structured
from hfg.nodes.files.reading import json_of, load_image, read_array, read_arrays, read_csv
from hfg.nodes.learning._models import text_of
from hfg.nodes.video import VideoFile
from hfg.recording import File, recover
from hfg.recording.tracks import Track, recorded_ports
from tests.recording import damage

__all__ = ["KINDS", "damaged", "trial"]

_EXTREMES: Final = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**62,
    2**63,
    2**64 - 9,
    2**64 - 1,
)
_LIMIT_BYTES: Final = 4 * 2**30


class Kind(NamedTuple):
    """Files of one kind.

    Attributes:
      samples: makes good ones.
      words: texts that mean something in them.
      read: reads one, and refuses it with an error that is expected.
      native: whether foreign code reads it, which may end the process.
    """

    samples: Callable[[], Sequence[bytes]]
    words: Sequence[bytes]
    read: Callable[[Path], object]
    native: bool = False


# --- good files -------------------------------------------------------------------------------------------------------


def _recordings() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        whole = damage.chunked(Path(folder) / "a.mcap", 25)
        return [whole, whole[:-200], *(damage.hostile(name) for name in damage.HOSTILE if "gigabytes" not in name)]


def _tokens() -> list[bytes]:
    picture = base64.b64encode(bytes(cv2.imencode(".png", np.zeros((5, 7), np.uint8))[1])).decode()
    values: list[Any] = [
        1,
        {"$type": "array", "dtype": "<f8", "shape": [2], "data": base64.b64encode(bytes(16)).decode()},
        {"$type": "array", "dtype": [["a", "<i4"], ["b", "|S3", [2]]], "shape": [1], "data": "AAAAAAAAAAAAAA=="},
        {"$type": "tuple", "value": [1, {"$type": "set", "value": ["a"]}]},
        {"$type": "datetime", "value": "02026-01-01T00:00:00"},
        {"$type": "object", "class": "hfg.base.token:Token", "fields": {"value": 1, "activity": 0, "stamp": 0.0}},
        {"$type": "enum", "class": "enum:Enum", "name": "x"},
        {"$type": "dict", "value": [[1, 2]]},
        {"$type": "text", "value": "00d8"},
        {"$type": "range", "value": [0, 5, 1]},
        {"$type": "number", "dtype": "<f4", "data": "AACAPw=="},
        picture,
    ]  # fmt: skip
    return [json.dumps({"value": one, "activity": 0, "stamp": 0.5, "sequence": 3}).encode() for one in values]


def _graphs() -> list[bytes]:
    return [
        (
            b"hfg: 1\nname: g\ngroups:\n  slow: {threads: 2, policy: random, seed: 3}\nnodes:\n  s:\n"
            b"    type: hfg.testing.nodes:Script\n    max_rate_hz: 10\n    parameters: {count: 3}\n    group: slow\n"
            b"  d: {type: 'hfg.testing.nodes:double', notes: {x: &a [1, 2]}, position: [1, 2]}\n"
            b"  box:\n    graph:\n      inputs: {v: int}\n      outputs: {o: 'list[int]'}\n      nodes:\n"
            b"        e: {type: 'hfg.testing.nodes:double'}\n      edges: [v -> e.value]\n    gate: {by: s}\n"
            b"edges:\n- s.out -> d.value: {buffer: 2}\n- s.seen -> d.activate: {active: true, capacity: 3}\n"
            b"- start -> s.activate: {active: true, through: [{type: 'reactivex.operators:delay', arguments: [0.1]}]}\n"
        ),
        b"hfg: 1\nnodes: &n\n  a: &x {type: hfg.nodes.values.constants:ConstantInt}\n  b: *x\n",
    ]


def _apexes() -> list[bytes]:
    return [
        b"version: {major: 1, minor: 0, patch: 0}\nnodes:\n"
        b"  - {type: 'csapex::Relay', uuid: a, pos: [1, 2], state: {params: {x: {type: range, int: [1, 0, 9, 1]}}}}\n"
        b"  - {type: 'csapex::Graph', uuid: g, state: {subgraph: {nodes: [{type: 'csapex::Relay', uuid: 'g:|:b'}]}}}\n"
        b"connections:\n  - {uuid: 'a:|:out_0', targets: ['g:|:in_0'], types: [default]}\n"
        b"fulcrums: []\nthreads: {groups: [{id: 1, name: x}], assignments: [{uuid: a, id: 1}]}\n"
    ]


def _array_files() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "a"
        found = []
        for array in (np.arange(12.0).reshape(3, 4), np.zeros(3, [("a", "<i4"), ("b", "S3")]), np.array("text")):
            with place.open("wb") as file:
                np.save(file, array)
            found.append(place.read_bytes())
        return found


def _archives() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "a.npz"
        np.savez_compressed(place, a=np.zeros(100), b=np.arange(3))
        return [place.read_bytes()]


def _packed() -> list[bytes]:
    """Archives that other programs have packed; their damage is reported by other errors than zlib's."""
    with tempfile.TemporaryDirectory() as folder:
        place, found = Path(folder) / "a.npz", []
        array = io.BytesIO()
        np.save(array, np.arange(100.0))
        for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_STORED):
            with zipfile.ZipFile(place, "w", method) as archive:
                archive.writestr("a.npy", array.getvalue())
            found.append(place.read_bytes())
        return found


_PICTURES: Final = (".png", ".jpg", ".bmp", ".tiff", ".webp", ".gif", ".jp2", ".ppm", ".pam", ".ras", ".avif")


def _pictures() -> list[bytes]:
    noise = np.random.default_rng(1).integers(0, 255, (65, 97, 3), np.uint8)
    found = [bytes(cv2.imencode(one, noise)[1]) for one in _PICTURES]
    return found + [bytes(cv2.imencode(one, noise.astype(np.float32))[1]) for one in (".hdr", ".pfm")]


def _videos() -> list[bytes]:
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name, code in (("a.avi", "MJPG"), ("a.mp4", "mp4v")):
            place = Path(folder) / name
            writer = cv2.VideoWriter(str(place), cv2.VideoWriter.fourcc(*code), 10.0, (64, 48))
            for number in range(4):
                writer.write(np.full((48, 64, 3), number * 60, np.uint8))
            writer.release()
            if place.is_file():
                found.append(place.read_bytes())
    return found


def _models() -> list[bytes]:
    samples = np.random.default_rng(2).normal(size=(30, 2)).astype(np.float32)
    labels = (samples[:, 0] > 0).astype(np.int32)
    found = []
    for model in (cv2.ml.RTrees.create(), cv2.ml.KNearest.create(), cv2.ml.SVM.create()):
        model.train(samples, cv2.ml.ROW_SAMPLE, labels)
        found.append(text_of(model))
    return found


def _cascades() -> list[bytes]:
    """One of each kind of feature, a tree in the first one."""
    found = []
    haar = (
        "<rects><_>1 2 9 8 -1.</_><_>4 2 3 8 3.</_></rects>",
        "<rects><_>8 0 3 4 1.</_></rects><tilted>1</tilted>",
    )
    patterns = ("<rect>0 0 4 5</rect>", "<rect>3 2 1 4</rect>")
    for kind, categories, threshold, features in (
        ("HAAR", 0, "0.01", haar),
        ("LBP", 256, "1 -2 3 -4 5 -6 7 -8", patterns),
    ):
        tree = f"0 1 0 {threshold} -1 -2 1 {threshold}" if kind == "HAAR" else f"0 -1 1 {threshold}"
        leaves = "0.9 -0.2 0.4" if kind == "HAAR" else "0.9 -0.2"
        found.append(
            '<?xml version="1.0"?>\n<opencv_storage><cascade type_id="opencv-cascade-classifier">\n'
            f"<stageType>BOOST</stageType><featureType>{kind}</featureType><height>20</height><width>20</width>\n"
            f"<featureParams><maxCatCount>{categories}</maxCatCount></featureParams><stageNum>1</stageNum>\n"
            "<stages><_><maxWeakCount>1</maxWeakCount><stageThreshold>-5.</stageThreshold><weakClassifiers><_>\n"
            f"<internalNodes>{tree}</internalNodes><leafValues>{leaves}</leafValues></_></weakClassifiers></_></stages>\n"
            f"<features>{''.join(f'<_>{one}</_>' for one in features)}</features></cascade></opencv_storage>\n".encode()
        )
    return found


# --- reading them -----------------------------------------------------------------------------------------------------


def _read_recording(path: Path) -> None:
    with File(path) as recording:
        recording.info()
        for port in recorded_ports(recording):
            with suppress(HfgError):
                list(Track(recording, {port: Any}, may_pickle=False).firings())
    if path.stat().st_size % 16 == 0:
        recover(path, path.with_suffix(".whole"), force=True)
        with File(path.with_suffix(".whole")) as recording:
            assert recording.whole


def _read_token(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(damage.with_message(data))
    with File(path) as recording:
        list(Track(recording, {"a.out": Any}, may_pickle=False).firings())


def _read_graph(path: Path) -> None:
    hfg.load(path).check()


def _read_picture(path: Path) -> None:
    """It is as large as was looked up, so that nobody has decoded more than that."""
    said = size_of(path.read_bytes())
    found = load_image(path, "raw")
    assert said is None or found.shape[0] * found.shape[1] <= said[0] * said[1], (said, found.shape)


def _read_header(path: Path) -> None:
    need_fair_size(path.read_bytes(), "it")


def _harmless(kind: str, data: bytes) -> bool:
    """Whether a copy of this process survives reading it; faster than the new process that a graph takes."""
    process = os.fork()
    if not process:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (3, 3))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        try:
            _structured._TRIES[kind](data)
        except BaseException:
            os._exit(1)
        os._exit(0)
    return not os.waitpid(process, 0)[1]


def _ask_model(path: Path) -> None:
    """What was read can be asked, whatever the samples."""
    data = path.read_bytes()
    if not _harmless("model", data):
        return
    model = _structured.model_of(data)
    width = max(1, min(model.getVarCount(), 1000))
    table = np.random.default_rng().normal(0, 3, (300, width)).astype(np.float32)
    with suppress(cv2.error):
        if isinstance(model, cv2.ml.RTrees):
            model.getVotes(table, 0)
        elif isinstance(model, cv2.ml.KNearest):
            model.findNearest(table, model.getDefaultK())
        else:
            model.predict(table)


def _ask_cascade(path: Path) -> None:
    data = path.read_bytes()
    if not _harmless("cascade", data):
        return
    picture = np.random.default_rng().integers(0, 255, (70, 90), np.uint8)
    _structured.cascade_of(data).detectMultiScale(picture, 1.3)


def _read_video(path: Path) -> None:
    node: Any = VideoFile(path=str(path))
    node.setup()
    try:
        for _ in range(6):
            node.capture.read()
    finally:
        node.teardown()


_YAML: Final = (
    b"hfg", b"nodes", b"edges", b"graph", b"type", b"file", b"gate", b"inside", b"through", b"promotes", b"groups",
    b"  ", b"\n", b"- ", b": ", b"{", b"}", b"[", b"]", b"&a ", b"*a", b"!!python/object:os.system ", b"<<: ", b"|\n",
    b"'", b'"', b"\\x", b"---\n", b"%YAML 9\n", b"? ", b"null", b"1e999", b"0x", b"9" * 5000, b"\xff", b"\x1b", b"../",
    b"/dev/zero", b"os:system", b"a.hfg.yaml", b" -> ", b"start", b"list[", b"hfg.testing.nodes:Tally", b"activate",
)  # fmt: skip
_JSON: Final = (
    b"{", b"}", b"[", b"]", b",", b":", b'"', b"\\ud800", b"null", b"1e999", b"9" * 400, b"-", b"[" * 2000,
    b'{"a":' * 900,
    b'"$type"', b'"object"', b'"class"', b'"subprocess:Popen"', b'"array"', b'"pickle"', b'"|O"', b'"dtype"', b"\x00",
)  # fmt: skip
_BINARY: Final = (b"\0" * 8, b"\xff" * 8, b"PK", b"'|O'", b"(99999999999,)", b"lz4", b"zstd", b"\x89MCAP0\r\n")

_XML: Final = (b"<_>", b"</_>", b"<", b">", b"-1 ", b"99 ", b"2147483647 ", b".5", b"x ", b"1e99 ", b"nan ", b"<a/>")
_TABLE: Final = (b",", b"\n", b'"', b"\0", b"\r", b"9" * 5000)

KINDS: Final[dict[str, Kind]] = {
    "recording": Kind(_recordings, _BINARY, _read_recording),
    "token": Kind(_tokens, _JSON, _read_token),
    "graph": Kind(_graphs, _YAML, _read_graph),
    "apex": Kind(_apexes, _YAML, apex.load),
    "json": Kind(_tokens, _JSON, lambda path: json_of(path.read_bytes(), "it")),
    "table": Kind(lambda: [b'a,b,c\n1,2,x\n"q",,\n'], _TABLE, lambda path: read_csv.function(path)),
    "array": Kind(_array_files, _BINARY, lambda path: read_array.function(path)),
    "archive": Kind(_archives, _BINARY, lambda path: read_arrays.function(path)),
    "packed": Kind(_packed, _BINARY, lambda path: read_arrays.function(path)),
    "header": Kind(_pictures, _BINARY, _read_header),
    "picture": Kind(_pictures, _BINARY, _read_picture, native=True),
    "video": Kind(_videos, _BINARY, _read_video, native=True),
    "model": Kind(_models, _YAML, _ask_model, native=True),
    "cascade": Kind(_cascades, _XML, _ask_cascade, native=True),
}  # fmt: skip

_SUFFIXES: Final = {"graph": ".hfg.yaml", "apex": ".apex", "recording": ".mcap", "token": ".mcap", "video": ".avi"}


# --- damaging them ----------------------------------------------------------------------------------------------------


@cache
def _samples(kind: str) -> Sequence[bytes]:
    return KINDS[kind].samples()


def damaged(kind: str, seed: int) -> bytes:
    """Give a damaged file; the same each time."""
    chance = random.Random(f"{kind} {seed}")
    samples, words = _samples(kind), KINDS[kind].words
    data = bytearray(chance.choice(samples))
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        at = chance.randrange(len(data) + 1)
        match chance.randrange(8):
            case 0 if at < len(data):
                data[at] ^= 1 << chance.randrange(8)
            case 1 if at < len(data):
                data[at] = chance.randrange(256)
            case 2:
                width = chance.choice(((1, "B"), (2, "H"), (4, "I"), (8, "Q")))
                form = chance.choice("<>") + width[1]
                data[at : at + width[0]] = struct.pack(form, chance.choice(_EXTREMES) % 256 ** width[0])
            case 3:
                data[at:at] = chance.choice(words)
            case 4:
                word = chance.choice(words)
                data[at : at + len(word)] = word
            case 5:
                del data[at : at + chance.choice((1, 2, 9, 100))]
            case 6:
                end = at + chance.choice((1, 9, 100, 1000))
                data[at:at] = bytes(data[at:end]) * chance.choice((1, 1, 2, 20))
            case _:
                other = chance.choice(samples)
                begin = chance.randrange(len(other) + 1)
                data[at:] = other[begin:]
        if chance.randrange(20) == 0:
            del data[at:]
    return bytes(data)


def trial(kind: str, seed: int, folder: Path) -> str | None:
    """Read one; gives what is wrong, or None."""
    path = folder / f"a{_SUFFIXES.get(kind, '')}"
    path.write_bytes(damaged(kind, seed))
    began = time.process_time()
    try:
        KINDS[kind].read(path)
    except (HfgError, ValueError, FileNotFoundError) as error:
        if not str(error):
            return f"{type(error).__name__} without a word"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    took = time.process_time() - began
    return f"it took {took:.0f} s" if took > 20 else None


def main(kinds: Sequence[str], first: int, count: int, progress: Path) -> int:
    """Try so many of each kind; print what is wrong."""
    cv2.setNumThreads(1)  # threads do not outlive a fork
    for kind in kinds:
        _samples(kind)
    if sys.platform == "linux":
        resource.setrlimit(resource.RLIMIT_AS, (_LIMIT_BYTES, _LIMIT_BYTES))
    wrong = 0
    with tempfile.TemporaryDirectory() as folder, progress.open("r+b", buffering=0) as at:
        for kind, seed in itertools.product(kinds, range(first, first + count)):
            at.seek(0)
            at.write(f"{kind} {seed} ".encode())
            what = trial(kind, seed, Path(folder))
            if what is not None:
                wrong += 1
                sys.stdout.write(json.dumps([kind, seed, what]) + "\n")
    return wrong


if __name__ == "__main__":
    main(sys.argv[1].split(","), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
