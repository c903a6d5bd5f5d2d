"""Files that ask for more memory than they are worth are refused with a sentence, whatever kind they are of."""

from __future__ import annotations

import base64
import io
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import pytest

from hfg.base.bounds import PICTURE_PIXELS
from hfg.encoding.pictures import need_fair_size, size_of
from hfg.errors import HfgError
from hfg.images import Image
from hfg.nodes.cv import imdecode
from hfg.nodes.files import (
    ArrayRows,
    CsvRows,
    JsonLines,
    TextLines,
    read_array,
    read_arrays,
    read_bytes,
    read_csv,
    read_image,
    read_json,
    read_text,
)
from hfg.nodes.video import VideoFile
from hfg.recording.messages import TokenReader
from hfg.testing import fire
from tests.limits import patience

pytestmark = pytest.mark.rule("L4")

PICTURE: Final = np.zeros((65, 97, 3), np.uint8)


def written(ending: str, picture: Any = PICTURE) -> bytes:
    """The picture as a file."""
    done, data = cv2.imencode(ending, picture)
    assert done
    return bytes(data)


def png(width: int, height: int) -> bytes:
    """Nothing but black, of this size."""

    def part(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packing = zlib.compressobj(9)
    row = b"\0" * (1 + width // 8)
    data = b"".join([*(packing.compress(row) for _ in range(height)), packing.flush()])
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", head) + part(b"IDAT", data) + part(b"IEND", b"")


FLOATS = PICTURE.astype(np.float32)
COLOURED: Final = (".png", ".jpg", ".bmp", ".tiff", ".webp", ".gif", ".jp2", ".ppm", ".pam", ".ras", ".avif")
KINDS: Final[dict[str, Callable[[], bytes]]] = {one: partial(written, one) for one in COLOURED} | {
    ".pgm": lambda: written(".pgm", PICTURE[..., 0]),
    ".pbm": lambda: written(".pbm", PICTURE[..., 0]),
    ".hdr": lambda: written(".hdr", FLOATS),
    ".pfm": lambda: written(".pfm", FLOATS),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_size_of_a_picture_is_read_from_its_header(kind: str) -> None:
    try:
        data = KINDS[kind]()
    except cv2.error:
        pytest.skip(f"this OpenCV does not write {kind}")
    assert size_of(data) == (97, 65)
    need_fair_size(data, "it")


def test_the_size_of_an_exr_is_read() -> None:
    head = b"\x76\x2f\x31\x01\x02\0\0\0" + b"dataWindow\0box2i\0" + struct.pack("<Iiiii", 16, 0, 0, 96, 64)
    assert size_of(head) == (97, 65)


@pytest.mark.parametrize("kind", KINDS)
def test_a_picture_whose_header_is_not_whole_is_refused_or_unknown(kind: str) -> None:
    try:
        data = KINDS[kind]()
    except cv2.error:
        pytest.skip(f"this OpenCV does not write {kind}")
    for length in range(60):
        found = size_of(data[:length])
        assert found in (None, (0, 0), (97, 65)) or kind in (".ppm", ".pgm", ".pbm", ".pam", ".pfm", ".hdr")


def test_a_picture_of_a_billion_pixels_is_refused_by_all_who_decode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PICTURE_PIXELS.variable, "1000")
    file = tmp_path / "0001.png"
    file.write_bytes(written(".png", np.zeros((100, 100), np.uint8)))
    refusals: list[Callable[[], Any]] = [
        lambda: fire(read_image(), path=file),
        lambda: fire(imdecode(), buf=np.frombuffer(file.read_bytes(), np.uint8)),
        lambda: fire(VideoFile(path=str(tmp_path / "%04d.png"))),
    ]
    for refuse in refusals:
        with pytest.raises((HfgError, ValueError), match="has 100 x 100 pixels, the limit is 1,000; if you trust it"):
            refuse()
    monkeypatch.setenv(PICTURE_PIXELS.variable, "10000")
    assert fire(read_image(), path=file) is not None


def test_a_recorded_picture_is_refused_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PICTURE_PIXELS.variable, "1000")
    data = base64.b64encode(written(".png", np.zeros((100, 37), np.uint8))).decode()
    reader = TokenReader("foxglove.CompressedImage", Image, may_pickle=False)
    with pytest.raises(ValueError, match="has 37 x 100 pixels, the limit is 1,000"):
        reader.token({"data": data, "shape": [100, 37], "stamp": 0.0})


def npy(shape: str, *, data: bytes = b"", descr: str = "'<f8'") -> bytes:
    """A file that says that it has this shape."""
    head = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\0" + struct.pack("<H", len(head)) + head + data


def npz(**parts: bytes) -> bytes:
    """Several of them."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


ARRAYS: Final = {
    "says that a terabyte follows": npy("(131072, 1048576)"),
    "says a shape beyond all numbers": npy("(99999999999, 99999999999)"),
    "says a negative shape": npy("(-5,)", data=bytes(80)),
    "says no shape": npy("'x'", data=bytes(80)),
    "holds objects": npy("(1,)", descr="'|O'", data=bytes(80)),
    "says no type": npy("(1,)", descr="'|Q9'", data=bytes(80)),
    "is nested without end": npy("(" * 3000),
    "is code": npy("__import__('os').abort()"),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_an_array_that_is_not_there_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.npy").write_bytes(ARRAYS[name])
    (tmp_path / "a.npz").write_bytes(npz(a=ARRAYS[name]))
    for node, file in ((read_array(), "a.npy"), (read_arrays(), "a.npz")):
        with pytest.raises((HfgError, ValueError), match="is not a numpy file without Python objects"):
            fire(node, path=tmp_path / file)
    with pytest.raises((HfgError, ValueError), match="is not a numpy file|has no rows"):
        fire(ArrayRows(path=str(tmp_path / "a.npy")))


def test_an_archive_that_unpacks_to_more_than_is_allowed_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HFG_MOST_FILE_BYTES", "100000")
    one = npy("(8192,)", data=bytes(2**16))
    (tmp_path / "a.npz").write_bytes(npz(a=one, b=one))
    with pytest.raises((HfgError, ValueError), match="the limit is 100,000"):
        fire(read_arrays(), path=tmp_path / "a.npz")
    monkeypatch.setenv("HFG_MOST_FILE_BYTES", "1000000")
    assert set(fire(read_arrays(), path=tmp_path / "a.npz").outputs["out"]) == {"a", "b"}


@pytest.mark.parametrize("node", [read_text, read_bytes, read_json, read_csv, read_image])
def test_what_has_no_end_and_what_is_too_long_is_refused(
    node: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HFG_MOST_FILE_BYTES", "1000")
    (tmp_path / "long").write_bytes(bytes(1001))
    for path in (Path("/dev/zero"), tmp_path / "long"):
        with pytest.raises((HfgError, ValueError), match="bytes or more, the limit is 1,000; if you trust it, set"):
            fire(node(), path=path)


@pytest.mark.parametrize("kind", [TextLines, JsonLines, CsvRows])
def test_a_line_without_end_is_refused(kind: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_FILE_BYTES", "1000")
    (tmp_path / "long").write_bytes(b"1" * 1001)
    with pytest.raises((HfgError, ValueError), match="is longer than any may be, the limit is 1,000"):
        fire(kind(path=str(tmp_path / "long")))


def test_a_table_of_rows_that_are_not_there_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_FILE_BYTES", "64000")
    (tmp_path / "wide.csv").write_text(",".join(f"c{number}" for number in range(500)) + "\n1" * 1000)
    with pytest.raises((HfgError, ValueError), match="values are missing up to here, the limit is"):
        fire(read_csv(), path=tmp_path / "wide.csv")


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "9" * 100_000, '"\\ud800"', "1e999999", "[1," * 9])
def test_json_that_means_harm_is_a_sentence_or_a_value(text: str, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text(text)
    with suppress(ValueError):
        fire(read_json(), path=tmp_path / "bad.json")


_BOMBS = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
import hfg
from hfg.nodes.files import read_image, read_array, read_arrays
from hfg.testing import fire
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for node, path in zip((read_image(), read_array(), read_arrays()), sys.argv[1:]):
    try:
        fire(node, path=path)
    except Exception as error:
        print(type(error).__name__, error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.slow
def test_files_of_some_kilobytes_cost_no_gigabytes(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(32000, 32000))
    (tmp_path / "a.npy").write_bytes(ARRAYS["says that a terabyte follows"])
    (tmp_path / "a.npz").write_bytes(npz(a=npy("(134217729,)", data=bytes(2**20))))
    files = [str(tmp_path / name) for name in ("a.png", "a.npy", "a.npz")]
    done = subprocess.run([sys.executable, "-c", _BOMBS, *files], capture_output=True, text=True, timeout=patience(300))
    *said, more = done.stdout.splitlines()
    assert [line.partition(" ")[0] for line in said] == ["ValueError"] * 3, done.stderr
    assert int(more) < 100, f"{more} MiB"
