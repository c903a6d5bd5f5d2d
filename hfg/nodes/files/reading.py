"""Files read whole, one for each path that arrives. Depends on access, functions, numpy and msgspec."""

from __future__ import annotations

import csv
import errno
import io
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from annotated_types import MaxLen, MinLen

from hfg.base.bounds import FILE_BYTES
from hfg.encoding.pictures import need_fair_size
from hfg.encoding.plain import json_value
from hfg.images import AnyImage, Image
from hfg.nodes._extras import require
from hfg.nodes.files.access import FilePath, named, reaching, read_whole
from hfg.nodes.files.arrays import need_fair_arrays, read_rows, sound
from hfg.nodetypes.functions import node
from hfg.types import Array

Column: TypeAlias = Literal["text", "int", "float", "bool"]
Encoding: TypeAlias = Literal["utf-8", "utf-8-sig", "latin-1", "ascii", "utf-16", "cp1252"]
Delimiter: TypeAlias = Annotated[str, MinLen(1), MaxLen(1)]


_TRUTHS: Final = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_CASTS: Final[dict[Column, Callable[[str], Any]]] = {
    "int": int,
    "float": float,
    "bool": lambda text: _TRUTHS[text.strip().lower()],
    "text": str,
}


@node
def read_text(path: FilePath, *, encoding: Encoding = "utf-8") -> str:
    r"""Read a file of text.

    Line ends of all systems become "\n". Reading blocks the loop; put the node into a thread group if files are large
    or remote.

    Args:
      path: path of the file; relative paths start in the working directory.
      encoding: encoding of the file.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not text of that encoding, or the path is not valid.
    """
    place = named(path)
    data = io.BytesIO(read_whole(place))
    with reaching(place, "read"):
        return io.TextIOWrapper(data, encoding=encoding).read()


@node
def read_bytes(path: FilePath) -> bytes:
    """Read a file of anything.

    Reading blocks the loop; put the node into a thread group if files are large or remote.

    Args:
      path: path of the file; relative paths start in the working directory.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: the path is not valid.
    """
    return read_whole(named(path))


@node
def read_json(path: FilePath) -> Any:
    """Read a JSON file; a plain `null` is silence.

    Reading blocks the loop; put the node into a thread group if files are large or remote.

    Args:
      path: path of the file; relative paths start in the working directory.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not JSON, or the path is not valid.
    """
    return json_of(read_bytes.function(path), f'"{path}"')


def json_of(data: bytes, what: str) -> Any:
    """Read JSON.

    Raises:
      ValueError: it is not one.
    """
    try:
        return json_value(data)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{what} is no JSON: {error}") from None


@node
def read_csv(
    path: FilePath,
    *,
    delimiter: Delimiter = ",",
    header: bool = True,
    guess: bool = True,
    columns: Mapping[str, Column] | None = None,
    encoding: Encoding = "utf-8-sig",
) -> list[dict[str, Any]]:
    """Read a table of comma-separated values as a list of rows, each a dict.

    Reading blocks the loop; put the node into a thread group if files are large or remote.

    Args:
      path: path of the file; relative paths start in the working directory.
      delimiter: the character between two values of a row.
      header: whether the first row has the names of the columns; otherwise they are named "0", "1" ...
      guess: whether values that look like numbers become numbers, and empty ones None; otherwise they stay text.
      columns: the types of columns that are not guessed; an empty value of a number is None.
      encoding: encoding of the file.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: a row has more values than there are columns, or one that its column cannot have; or the path is not
        valid.
    """
    text = read_text.function(path, encoding=encoding)
    return list(rows_of(io.StringIO(text), named(path), delimiter, header, guess, columns or {}))


def rows_of(
    lines: Iterator[str] | io.StringIO,
    path: Path,
    delimiter: str,
    header: bool,
    guess: bool,
    columns: Mapping[str, Column],
) -> Iterator[dict[str, Any]]:
    """Read rows one by one.

    Raises:
      ValueError: one is wrong; the sentence has its line.
    """
    reader = csv.reader(lines, delimiter=delimiter)
    names: list[str] = []
    lacking, most = 0, FILE_BYTES.most // 64  # of a table whose rows are shorter than its head
    try:
        for row in reader:
            if not row:
                continue
            if not names:
                names = row if header else [str(number) for number in range(len(row))]
                if header:
                    continue
            if len(row) > len(names):
                raise ValueError(f"it has {len(row)} values for {len(names)} columns")
            lacking += len(names) - len(row)
            if lacking > most:
                raise ValueError(f"{lacking:,} values are missing up to here, {FILE_BYTES.remedy}")
            row += [""] * (len(names) - len(row))
            yield {name: _cell(cell, name, guess, columns) for name, cell in zip(names, row, strict=True)}
    except (csv.Error, ValueError) as error:
        raise ValueError(f'line {reader.line_num} of "{path}" is wrong: {error}') from None


def _cell(text: str, name: str, guess: bool, columns: Mapping[str, Column]) -> Any:
    said = columns.get(name)
    if said is not None:
        if not text and said != "text":
            return None
        try:
            return _CASTS[said](text)
        except (ValueError, KeyError):
            raise ValueError(f'"{name}" should be {said}, got {text!r:.80}') from None
    if not guess:
        return text
    if not text:
        return None
    for cast in (int, float):
        try:
            return cast(text)
        except ValueError:
            continue
    return text


def load_array(path: Path) -> Any:
    """Read a file of numpy, without running what pickles would.

    Raises:
      OSError: it cannot be read.
      ValueError: it is not such a file.
    """
    with reaching(path, "read"):
        is_zip = _is_zip(path)
        with _understood(path):
            if is_zip and not zipfile.is_zipfile(path):
                raise ValueError("its end is missing")  # numpy would leave it open
            need_fair_arrays(path, is_zip=is_zip)
            found = np.load(path, allow_pickle=False)
            return sound(found) if isinstance(found, np.ndarray) else found


def rows_of_array(path: Path) -> Iterable[Array]:
    """Read an array of a `.npy` file along its first axis; the file may be larger than the memory.

    Raises:
      OSError: it cannot be read.
      ValueError: it is not such a file, or has no rows.
    """
    with reaching(path, "read"):
        if _is_zip(path):
            raise ValueError(f'"{path}" has no rows because it holds several arrays')
        with _understood(path):
            found = read_rows(path)
    return load_array(path) if found is None else found


def _is_zip(path: Path) -> bool:
    with path.open("rb") as file:  # a directory or a missing file is told by the system, not by numpy
        return file.read(2) == b"PK"


@contextmanager
def _understood(path: Path) -> Iterator[None]:
    """Report in one message that a file is not one of numpy, and why."""
    try:
        yield
    except Exception as error:  # what numpy and zipfile raise, whatever is in a file: a dozen kinds
        if _is_of_the_system(error):
            raise
        raise ValueError(
            f'"{path}" is not a numpy file without Python objects: {error}; write it again with numpy.save or '
            "numpy.savez"
        ) from None


def _is_of_the_system(error: Exception) -> bool:
    """Return whether the system could not read a file, and not that its content makes no sense.

    For damaged content bz2 raises an OSError without a number, and the system refuses positions before the file.
    """
    return isinstance(error, OSError) and error.errno not in (None, errno.EINVAL)


@node
def read_array(path: FilePath) -> Array:
    """Read an array of a `.npy` file.

    Reading blocks the loop; put the node into a thread group if files are large or remote.

    Args:
      path: path of the file; relative paths start in the working directory.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not such a file, or holds Python objects, which are not read; or the path is not valid.
    """
    found = load_array(named(path))
    if not isinstance(found, np.ndarray):
        found.close()
        raise ValueError(f'"{path}" holds several arrays: use read_arrays')
    return found


@node
def read_arrays(path: FilePath) -> dict[str, Array]:
    """Read the arrays of a `.npz` file, by their names.

    Reading blocks the loop; put the node into a thread group if files are large or remote.

    Args:
      path: path of the file; relative paths start in the working directory.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not such a file, or holds Python objects, which are not read; or the path is not valid.
    """
    place = named(path)
    found = load_array(place)
    if isinstance(found, np.ndarray):
        raise ValueError(f'"{path}" holds one array: use read_array')
    with found, reaching(place, "read"):
        try:
            return {name: sound(found[name]) for name in found.files}
        except Exception as error:  # see `load_array`
            if _is_of_the_system(error):
                raise
            raise ValueError(f'"{path}" cannot be read: {error}; write it again with numpy.savez') from None


def load_image(path: FilePath, mode: Literal["color", "gray", "raw"]) -> Any:
    """Read a picture; OpenCV itself says nothing of why it could not.

    Raises:
      OSError: the file cannot be read.
      ValueError: it is not a picture.
    """
    cv2 = require("cv2", "vision")
    whole = read_bytes.function(path)
    need_fair_size(whole, f'"{path}"')
    data = np.frombuffer(whole, dtype=np.uint8)
    flag = {"color": cv2.IMREAD_COLOR, "gray": cv2.IMREAD_GRAYSCALE, "raw": cv2.IMREAD_UNCHANGED}[mode]
    try:
        image = cv2.imdecode(data, flag) if len(data) else None
    except cv2.error:
        image = None
    if image is None:
        raise ValueError(f'"{path}" is not a picture that OpenCV can read, or it is incomplete')
    return image


@node
def read_image(path: FilePath, *, mode: Literal["color", "gray"] = "color") -> Image:
    """Read a picture as an image of 8 bits.

    Reading blocks the loop for some milliseconds per million pixels; put the node into a thread group if that is too
    long. Needs OpenCV.

    Args:
      path: path of the file, such as PNG, JPEG, TIFF, BMP or WebP; relative paths start in the working directory.
      mode: "color" gives blue, green and red, "gray" one channel.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not a picture, or the path is not valid.
      ModuleNotFoundError: OpenCV is not installed.
    """
    image: Image = load_image(path, mode)
    return image


@node
def read_raw_image(path: FilePath) -> AnyImage:
    """Read a picture as it was written: with its own channels, of 8 or 16 bits or real numbers, such as a depth image.

    Reading blocks the loop for some milliseconds per million pixels; put the node into a thread group if that is too
    long. Needs OpenCV.

    Args:
      path: path of the file, such as PNG, TIFF or EXR; relative paths start in the working directory.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not a picture, or the path is not valid.
      ModuleNotFoundError: OpenCV is not installed.
    """
    image: AnyImage = load_image(path, "raw")
    return image


@node
def list_directory(
    path: FilePath,
    *,
    pattern: str = "*",
    kind: Literal["files", "directories", "all"] = "files",
    recursive: bool = False,
) -> list[str]:
    """List what is in a directory, by name.

    Args:
      path: path of the directory; relative paths start in the working directory.
      pattern: which names are listed, as a shell has it: "*.png".
      kind: whether files, directories or both are listed.
      recursive: whether directories inside are gone through too.

    Raises:
      OSError: the directory cannot be read; the message says why.
      ValueError: the pattern is empty or absolute, or the path is not valid.
    """
    place = named(path)
    with reaching(place, "read"):
        next(place.iterdir(), None)  # a missing directory would be an empty one
        try:
            found = list(place.rglob(pattern) if recursive else place.glob(pattern))
        except (ValueError, NotImplementedError) as error:
            raise ValueError(f"{pattern!r:.80} is not a pattern for names: {error}") from None
        wanted = {"files": Path.is_file, "directories": Path.is_dir, "all": Path.exists}[kind]
        return sorted(str(one) for one in found if wanted(one))
