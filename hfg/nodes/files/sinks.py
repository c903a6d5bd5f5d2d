"""Streams as files: one file for each value, or one for all of them.

A file that holds one value is the old one or the new one, never half of each. A file that grows line by line has its
name when it is complete. Depends on access, whole, nodetype, ports and numpy.
"""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, Final

import msgspec
import numpy as np
from annotated_types import Interval, MaxLen, MinLen, Predicate

from hfg.base.clock import now
from hfg.base.whole import GrowingFile
from hfg.images import AnyImage
from hfg.nodes._extras import require
from hfg.nodes._printing import print_line
from hfg.nodes.files.access import FilePath, is_a_path, named, reaching, write_whole
from hfg.nodes.values.parsing import json_bytes
from hfg.nodes.values.text import format_safely, is_a_format
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State
from hfg.types import Array

PICTURES: Final = "*.png *.jpg *.jpeg *.tif *.tiff *.bmp *.webp *.exr *.hdr *.pgm *.ppm"
_ENCODINGS: Final = ("utf-8", "utf-8-sig", "latin-1", "ascii", "utf-16", "cp1252")


# --- one file for each value ---


class _WholeFiles(Node):
    """Writes each value to a file of its own, or to the same one again and again."""

    path = Parameter("", Predicate(is_a_path), Predicate(is_a_format), save=True)
    first = Parameter(1, Interval(ge=0))
    overwrite = Parameter(True)
    number = State[int | None](None)
    written = Output(str)

    def _write(self, write: Callable[[BinaryIO], Any]) -> str:
        number = self.first if self.number is None else self.number
        path = named(format_safely(self.path, (), {"number": number, "time": now()}))
        write_whole(path, write, overwrite=self.overwrite)
        self.number = number + 1
        return str(path)


class WriteText(_WholeFiles):
    """Write each text to a file.

    A path such as "notes/{number:04}.txt" makes a file per text; a path without braces always has only the newest text.
    A file is replaced only as a whole; missing directories are created. Writing blocks the loop until the data is on
    disk; put the node into a thread group if that takes too long.

    Attributes:
      text: the text to write.
      path: path of the file, with {number} for the number of the value and {time} for the seconds of the run's clock;
        relative paths start in the working directory.
      encoding: encoding of the file.
      first: the number of the first value.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: no path is set, the path has another field, or the encoding cannot represent a character.

    CS::APEX: csapex::ExportFile.
    """

    text = Input(str)
    encoding = Parameter("utf-8", choices=_ENCODINGS)

    def process(self, text: str) -> str:
        """Write it."""
        return self._write(lambda file: file.write(text.encode(self.encoding)))


class WriteBytes(_WholeFiles):
    """Write each value of bytes to a file.

    A path such as "data/{number:04}.bin" makes a file per value; a path without braces always has only the newest
    value. A file is replaced only as a whole; missing directories are created. Writing blocks the loop until the data
    is on disk; put the node into a thread group if that takes too long.

    Attributes:
      data: the bytes to write.
      path: path of the file, with {number} for the number of the value and {time} for the seconds of the run's clock;
        relative paths start in the working directory.
      first: the number of the first value.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: no path is set, or the path has another field.

    CS::APEX: csapex::ExportFile.
    """

    data = Input(bytes)

    def process(self, data: bytes) -> str:
        """Write it."""
        return self._write(lambda file: file.write(data))


class WriteJson(_WholeFiles):
    """Write each value to a file as JSON.

    A path such as "poses/{number:04}.json" makes a file per value; a path without braces always has only the newest
    value. A file is replaced only as a whole; missing directories are created. Writing blocks the loop until the data
    is on disk; put the node into a thread group if that takes too long.

    Attributes:
      value: anything that can be represented in JSON: dicts, lists, dataclasses, structs, arrays ...
      path: path of the file, with {number} for the number of the value and {time} for the seconds of the run's clock;
        relative paths start in the working directory.
      indent: blanks for each level, on lines of their own; 0 is one line.
      first: the number of the first value.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      TypeError: the value cannot be represented in JSON.
      ValueError: part of it cannot, no path is set, or the path has another field.

    CS::APEX: csapex::ExportFile.
    """

    value = Input(object)
    indent = Parameter(2, Interval(ge=0, le=16))

    def process(self, value: object) -> str:
        """Write it."""
        data = json_bytes(value)
        if self.indent:
            data = msgspec.json.format(data, indent=self.indent)
        return self._write(lambda file: file.write(data + b"\n"))


class WriteArray(_WholeFiles):
    """Write each array to a `.npy` file.

    A path such as "scans/{number:04}.npy" makes a file per value; a path without braces always has only the newest
    value. A file is replaced only as a whole; missing directories are created. Writing blocks the loop until the data
    is on disk; put the node into a thread group if that takes too long.

    Attributes:
      array: the array to write, of any shape and dtype but Python objects.
      path: path of the file, with {number} for the number of the value and {time} for the seconds of the run's clock;
        relative paths start in the working directory.
      first: the number of the first value.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: the array holds Python objects, no path is set, or the path has another field.

    CS::APEX: csapex::ExportFile.
    """

    array = Input(Array)

    def process(self, array: Array) -> str:
        """Write it."""
        return self._write(lambda file: _save(file, array))


def _save(file: BinaryIO, array: Array) -> None:
    """Write an array by Python's own calls: numpy's own way to a file swallows the error of its last write."""
    np.save(SimpleNamespace(write=file.write), array, allow_pickle=False)


class WriteArrays(_WholeFiles):
    """Write each dict of arrays to a `.npz` file.

    A path such as "scans/{number:04}.npz" makes a file per value; a path without braces always has only the newest
    value. A file is replaced only as a whole; missing directories are created. Writing blocks the loop until the data
    is on disk; put the node into a thread group if that takes too long.

    Attributes:
      arrays: arrays by their names.
      path: path of the file, with {number} for the number of the value and {time} for the seconds of the run's clock;
        relative paths start in the working directory.
      compressed: whether it is made smaller, which takes longer.
      first: the number of the first value.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: an array holds Python objects, a name is not allowed in such a file, no path is set, or the path has
        another field.
    """

    arrays = Input(Mapping[str, Array])
    compressed = Parameter(True)

    def process(self, arrays: Mapping[str, Array]) -> str:
        """Write it."""
        save: Any = np.savez_compressed if self.compressed else np.savez
        wrong = next((name for name in arrays if name in ("file", "allow_pickle") or "\0" in name), None)
        if wrong is not None:
            raise ValueError(f"an array in a .npz file cannot be called {wrong!r:.80}; rename it by rename_keys")
        return self._write(lambda file: save(file, allow_pickle=False, **arrays))


class WriteImage(_WholeFiles):
    """Write each image to a file, in the format that the name's end says.

    A path such as "frames/{number:06}.png" makes a file per value; a path without braces always has only the newest
    value. A file is replaced only as a whole; missing directories are created. Writing blocks the loop for about ten
    milliseconds per million pixels; put the node into a thread group if that is too long. Needs OpenCV.

    Attributes:
      image: with 1 channel, 3 (blue, green and red) or 4; what other pixels than 8 bits become depends on the format.
      path: path of the file, such as PNG, JPEG, TIFF, BMP or WebP, with {number} for the number of the image and {time}
        for the seconds of the run's clock; relative paths start in the working directory.
      quality: of JPEG and WebP, 1 to 100.
      first: the number of the first image.
      overwrite: whether an existing file may be replaced.
      written: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: the format does not take such an image, or the path has another field.
      ModuleNotFoundError: OpenCV is not installed.

    CS::APEX: csapex::ExportFile.
    """

    path = Parameter("image-{number:04}.png", Predicate(is_a_path), Predicate(is_a_format), save=True, pattern=PICTURES)
    image = Input(AnyImage)
    quality = Parameter(95, Interval(ge=1, le=100))

    def process(self, image: AnyImage) -> str:
        """Write it."""
        data = encoded(image, self.path, self.quality)
        return self._write(lambda file: file.write(data))


def encoded(image: AnyImage, path: FilePath, quality: int) -> bytes:
    """Return an image in the format that a name says.

    Raises:
      ValueError: there is no such format, or it does not take such an image.
    """
    cv2 = require("cv2", "vision")
    ending = named(path).suffix
    settings = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_WEBP_QUALITY, quality]
    try:
        done, data = cv2.imencode(ending, np.ascontiguousarray(image), settings if ending.lower() in _LOSSY else [])
    except (cv2.error, TypeError):
        done = False
    if not done:
        shape = " x ".join(map(str, image.shape))
        raise ValueError(
            f'an image of {image.dtype}, {shape}, cannot be written as "{ending}": end the path "{path}" with a format '
            "such as .png, or convert the image"
        )
    return bytes(data)


_LOSSY = (".jpg", ".jpeg", ".jpe", ".webp")


# --- one file for all values ---


class _GrowingFile(Node):
    """Writes all values to one file, which is opened with the first one and completed at the end in any case."""

    path = Parameter("", Predicate(is_a_path), save=True)
    append = Parameter(False)
    flush = Parameter(True)
    file = State[GrowingFile | None](None)
    encoder = State[codecs.IncrementalEncoder | None](None)
    is_new = State(True)

    def _opened(self, encoding: str) -> GrowingFile:
        if self.file is None:
            place = named(self.path)
            with reaching(place, "write"):
                place.parent.mkdir(parents=True, exist_ok=True)
                self.file = GrowingFile(place, append=self.append, at_once=self.flush)
            self.is_new = self.file.is_empty
            self.encoder = codecs.getincrementalencoder(encoding)()
            if not self.is_new:
                self.encoder.setstate(2 if encoding == "utf-16" else 0)  # the mark of the byte order is there already
        return self.file

    def _put(self, text: str, encoding: str = "utf-8") -> None:
        file = self._opened(encoding)
        assert self.encoder is not None
        with reaching(self.path, "write"):
            file.write(self.encoder.encode(text))

    def _finish(self, encoding: str = "utf-8") -> None:
        """Complete a file that has come to its end, and make one that nothing was written to."""
        self._opened(encoding)
        self.teardown()

    def teardown(self) -> None:
        """Complete it."""
        file, self.file = self.file, None
        if file is not None:
            with reaching(self.path, "write"):
                file.complete()


class WriteLines(_GrowingFile):
    """Write texts to a file, a line each.

    Lines go into `<name>.part`, which is renamed when the stream ends or the run is over; so a file with the final name
    is complete. With `append`, lines are added to an existing file. Each line is passed to the system at once; with
    `flush` off, many together, which is faster. A line takes microseconds; put the node into a thread group if the disk
    is slow.

    Attributes:
      text: each line, without its end.
      path: path of the file; relative paths start in the working directory, and missing directories are created.
      append: add lines to an existing file.
      flush: pass each line to the system at once.
      encoding: encoding of the file.

    Raises:
      OSError: the file cannot be written; the message says why, and the lines written so far are in `<name>.part`.
      ValueError: the encoding cannot represent a character, or no path is set.

    CS::APEX: csapex::ExportFile.
    """

    text = Input(str)
    encoding = Parameter("utf-8", choices=_ENCODINGS)

    def process(self, text: str) -> None:
        """Write it."""
        self._put(text + "\n", self.encoding)

    def end(self) -> None:
        """Close it."""
        self._finish(self.encoding)


class WriteJsonLines(_GrowingFile):
    """Write values to a file as JSON, a line each.

    Lines go into `<name>.part`, which is renamed when the stream ends or the run is over; so a file with the final name
    is complete. With `append`, lines are added to an existing file. Each line is passed to the system at once; with
    `flush` off, many together, which is faster. A line takes microseconds; put the node into a thread group if the disk
    is slow.

    Attributes:
      value: anything that can be represented in JSON: dicts, lists, dataclasses, structs, arrays ...
      path: path of the file; relative paths start in the working directory, and missing directories are created.
      append: add lines to an existing file.
      flush: pass each line to the system at once.

    Raises:
      OSError: the file cannot be written; the message says why, and the lines written so far are in `<name>.part`.
      TypeError: the value cannot be represented in JSON.
      ValueError: part of it cannot, or no path is set.

    CS::APEX: csapex::ExportFile.
    """

    value = Input(object)

    def process(self, value: object) -> None:
        """Write it."""
        self._put(json_bytes(value).decode() + "\n")

    def end(self) -> None:
        """Close it."""
        self._finish()


class WriteCsv(_GrowingFile):
    """Write dicts to a file as a table of comma-separated values, a row each.

    The columns are the keys of the first row, unless given; missing keys of a row are empty. Rows go into
    `<name>.part`, which is renamed when the stream ends or the run is over; so a file with the final name is complete.
    With `append`, rows are added to an existing file. Each row is passed to the system at once; with `flush` off, many
    together, which is faster. A row takes microseconds; put the node into a thread group if the disk is slow.

    Attributes:
      row: values by the names of the columns; None is empty.
      path: path of the file; relative paths start in the working directory, and missing directories are created.
      columns: their names in order; none are those of the first row.
      delimiter: the character between two values of a row.
      append: add rows to an existing file.
      flush: pass each row to the system at once.

    Raises:
      OSError: the file cannot be written; the message says why, and the lines written so far are in `<name>.part`.
      ValueError: a row has a key that is not a column, or no path is set.
    """

    row = Input(Mapping[str, object])
    columns = Parameter[Sequence[str]]((), type=Sequence[str])
    delimiter = Parameter(",", MinLen(1), MaxLen(1))
    names = State[list[str] | None](None)

    def process(self, row: Mapping[str, object]) -> None:
        """Write it."""
        lines = io.StringIO()
        self._opened("utf-8")
        if self.names is None:
            self.names = list(self.columns or row)
            if self.is_new:
                self._writer(lines).writerow(self.names)
        strange = next((key for key in row if key not in self.names), None)
        if strange is not None:
            raise ValueError(
                f'the row has "{strange}", but the columns of "{self.path}" are {", ".join(self.names) or "none"}; '
                'say all of them in the parameter "columns"'
            )
        values = [row.get(name) for name in self.names]
        self._writer(lines).writerow(["" if value is None else value for value in values])
        self._put(lines.getvalue())

    def _writer(self, lines: io.StringIO) -> Any:
        try:
            return csv.writer(lines, delimiter=self.delimiter, lineterminator="\n")
        except (ValueError, TypeError) as error:
            raise ValueError(f"{self.delimiter!r} cannot stand between values: {error}") from None

    def end(self) -> None:
        """Close it."""
        self._finish()


class StackArrays(Node):
    """Write all values of a stream to one `.npy` file when it ends: arrays of one shape, or numbers, one row each.

    All of them are kept until then. A run that ends otherwise writes what there is. The file is replaced only as a
    whole. `ArrayRows` reads it again row by row.

    Attributes:
      value: an array, of the same shape each, or a number.
      path: path of the file; relative paths start in the working directory, and missing directories are created.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: the shapes differ, an array holds Python objects, or no path is set.
    """

    value = Input(Array | float)
    path = Parameter("", Predicate(is_a_path), save=True)
    rows = State(factory=list[Any])
    shape = State[tuple[int, ...] | None](None)
    is_written = State(False)

    def process(self, value: Array | float) -> None:
        """Keep it."""
        row = np.array(value)
        if self.shape is not None and row.shape != self.shape:
            raise ValueError(f"the shapes in one file must be the same, got {row.shape} after {self.shape}")
        self.shape = row.shape
        self.rows.append(row)

    def end(self) -> None:
        """Write all."""
        self._write(named(self.path))

    def teardown(self) -> None:
        """Write what there is, unless it was written already."""
        if self.rows and not self.is_written:
            self._write(named(self.path))

    def _write(self, path: Path) -> None:
        self.is_written = True
        whole = np.stack(self.rows) if self.rows else np.zeros(0)
        write_whole(path, lambda file: _save(file, whole))


class StandardOutput(Node):
    """Write texts to the standard output of the program, a line each, at once.

    On a terminal, characters that would steer it are written out.

    Attributes:
      text: each line, without its end.

    Raises:
      OSError: whoever read it has gone.

    CS::APEX: csapex::ExportCout.
    """

    text = Input(str)

    def process(self, text: str) -> None:
        """Write it."""
        print_line(text)
