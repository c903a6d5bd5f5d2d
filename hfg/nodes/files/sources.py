"""Files as streams: lines, rows, pictures, and what is written on the keyboard; all end with the file.

Depends on reading, nodetype and ports.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from annotated_types import MaxLen, MinLen, Predicate

from hfg.errors import EndOfStream
from hfg.images import Image
from hfg.nodes.files.access import find_files, is_a_path, lines_of, named, reaching
from hfg.nodes.files.keyboard import lines_of_standard_input
from hfg.nodes.files.reading import Column, json_of, load_image, rows_of, rows_of_array
from hfg.nodetypes.node import Node
from hfg.ports import Event, Output, Parameter, State, slot
from hfg.types import Array

_ENCODINGS: Final = ("utf-8", "utf-8-sig", "latin-1", "ascii", "utf-16", "cp1252")


class TextLines(Node):
    """Send a file of text line by line, then end.

    It reads ahead by some thousand characters, which blocks the loop; put the node into a thread group if the file is
    remote. The slot `reset` starts over.

    Attributes:
      path: path of the file; relative paths start in the working directory.
      encoding: encoding of the file.
      loop: start again at the end.
      line: each line, without its end.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not text of that encoding, or no path is set.

    CS::APEX: csapex::FileImporter.
    """

    path = Parameter("", Predicate(is_a_path), pattern="*")
    encoding = Parameter("utf-8", choices=_ENCODINGS)
    loop = Parameter(False)
    line = Output(str)

    def process(self) -> Iterator[str]:
        """Read it."""
        place, some = named(self.path), True
        with reaching(place, "read"):
            while some:
                some = False
                with place.open(encoding=self.encoding) as file:
                    for line in lines_of(file, place):
                        some = self.loop  # an empty file has no lines to begin again with
                        yield line.removesuffix("\n")


class JsonLines(Node):
    """Send the values of a file that has JSON on each line, then end.

    Empty lines are passed over, and `null` is silence. It reads ahead by some thousand characters, which blocks the
    loop; put the node into a thread group if the file is remote. The slot `reset` starts over.

    Attributes:
      path: path of the file; relative paths start in the working directory.
      loop: start again at the end.
      skip_invalid: whether a line that is not JSON is sent by `invalid` and skipped, instead of raising an error.
      value: the value of each line.
      invalid: a line that is not JSON.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: a line is not JSON, or no path is set.

    CS::APEX: csapex::FileImporter.
    """

    path = Parameter("", Predicate(is_a_path), pattern="*")
    loop = Parameter(False)
    skip_invalid = Parameter(False)
    value = Output(Any)
    invalid = Event(str)

    def process(self) -> Iterator[Any]:
        """Read it."""
        place, some = named(self.path), True
        with reaching(place, "read"):
            while some:
                some = False
                with place.open("rb") as file:
                    for number, line in enumerate(lines_of(file, place), 1):
                        if not line.strip():
                            continue
                        some = self.loop
                        yield self._value(line, f'line {number} of "{place}"')

    def _value(self, line: bytes, where: str) -> Any:
        try:
            return json_of(line, where)
        except ValueError:
            if not self.skip_invalid:
                raise
        self.invalid.trigger(line.decode(errors="replace").rstrip("\r\n"))
        return None


class CsvRows(Node):
    """Send the rows of a table of comma-separated values as dicts, then end.

    It reads ahead by some thousand characters, which blocks the loop; put the node into a thread group if the file is
    remote. The slot `reset` starts over.

    Attributes:
      path: path of the file; relative paths start in the working directory.
      delimiter: the character between two values of a row.
      header: whether the first row has the names of the columns; otherwise they are named "0", "1" ...
      guess: whether values that look like numbers become numbers, and empty ones None; otherwise they stay text.
      columns: the types of columns that are not guessed: "text", "int", "float" or "bool"; an empty value of a number
        is None.
      encoding: encoding of the file.
      loop: start again at the end.
      row: each row, by the names of the columns.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: a row has more values than there are columns, or one that its column cannot have, it is not text of
        that encoding, or no path is set.
    """

    path = Parameter("", Predicate(is_a_path), pattern="*")
    delimiter = Parameter(",", MinLen(1), MaxLen(1))
    header = Parameter(True)
    guess = Parameter(True)
    columns = Parameter[Mapping[str, Column]]({}, type=Mapping[str, Column])
    encoding = Parameter("utf-8-sig", choices=_ENCODINGS)
    loop = Parameter(False)
    row = Output(dict[str, Any])

    def process(self) -> Iterator[dict[str, Any]]:
        """Read it."""
        place, some = named(self.path), True
        with reaching(place, "read"):
            while some:
                some = False
                with place.open(encoding=self.encoding, newline="") as file:
                    lines = lines_of(file, place)
                    for row in rows_of(lines, place, self.delimiter, self.header, self.guess, self.columns):
                        some = self.loop
                        yield row


class ArrayRows(Node):
    """Send an array of a `.npy` file along its first axis, then end.

    The file is not read whole: it may be larger than the memory. Put the node into a thread group if the file is
    remote. The slot `reset` starts over.

    Attributes:
      path: path of the file; relative paths start in the working directory.
      loop: start again at the end.
      row: each part, an array with one axis less.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: it is not such a file, holds Python objects or a single number, or no path is set.
    """

    path = Parameter("", Predicate(is_a_path), pattern="*")
    loop = Parameter(False)
    row = Output(Array)

    def process(self) -> Iterator[Array]:
        """Read it."""
        place = named(self.path)
        some = True
        while some:
            some = False
            for row in rows_of_array(place):
                some = self.loop
                yield row


class _Player(Node):
    """Goes through files in order; can be stopped, resumed and restarted."""

    order = Parameter("name", choices=("name", "number", "modified"))
    loop = Parameter(False)
    playing = Parameter(True)
    began = Event(None)
    ended = Event(None)
    left = State(factory=list[Path])
    has_begun = State(False)
    is_over = State(False)

    def ready(self) -> bool:
        """Say whether it plays."""
        if self.is_over:
            raise EndOfStream
        return self.playing

    def _next(self, pattern: str) -> Path:
        if self.has_begun and not self.left:
            self.has_begun = False
            self.ended.trigger()
            if not self.loop:
                raise EndOfStream
        if not self.has_begun:
            self.left, self.has_begun = find_files(pattern, self.order)[::-1], True
            self.began.trigger()
        return self.left.pop()

    @slot
    def play(self) -> None:
        """Go on."""
        self.playing = True

    @slot
    def stop(self) -> None:
        """Wait."""
        self.playing = False

    @slot
    def restart(self) -> None:
        """Begin again with the first."""
        self.left, self.has_begun = [], False

    @slot
    def abort(self) -> None:
        """End."""
        self.is_over = True


class FilePaths(_Player):
    """Send the paths of the files that a pattern describes, then end: for read_text, read_image and their like.

    The files are listed when the first path is given, and again for each round of a loop. While it is stopped it gives
    nothing; if then nothing else happens in the run either, the run ends as stalled.

    Attributes:
      pattern: as a shell has it: "images/*.png"; `**` is any number of directories; relative paths start in the working
        directory.
      order: by "name", by the "number" in the name, so that 10 follows 9, or by when they were "modified".
      loop: start again at the end.
      playing: whether paths are given; the slots change it.
      path: each path.
      began: before the first path of each round.
      ended: after the last path of each round.
      play: resumes.
      stop: waits.
      restart: starts over with the first.
      abort: ends.

    Raises:
      OSError: there is no such file, or the directory cannot be read.

    CS::APEX: csapex::FileImporter.
    """

    pattern = Parameter("*", MinLen(1), Predicate(is_a_path))
    path = Output(str)

    def process(self) -> str:
        """Return the next one."""
        return str(self._next(self.pattern))


class ImageFiles(_Player):
    """Send the pictures that a pattern describes, then end.

    The files are listed when the first one is given, and again for each round of a loop. Reading blocks the loop for
    some milliseconds per million pixels; put the node into a thread group if that is too long. While it is stopped it
    gives nothing; if then nothing else happens in the run either, the run ends as stalled. Needs OpenCV.

    Attributes:
      pattern: as a shell has it: "images/*.png"; `**` is any number of directories; relative paths start in the working
        directory.
      order: by "name", by the "number" in the name, so that 10 follows 9, or by when they were "modified".
      mode: "color" gives blue, green and red, "gray" one channel.
      loop: start again at the end.
      skip_invalid: whether a file that is not a picture is sent by `invalid` and skipped, instead of raising an error.
      playing: whether pictures are given; the slots change it.
      image: each picture.
      path: of each picture.
      began: before the first picture of each round.
      ended: after the last picture of each round.
      invalid: the path of a file that is not a picture.
      play: resumes.
      stop: waits.
      restart: starts over with the first.
      abort: ends.

    Raises:
      OSError: there is no such file, or it cannot be read; the message says why.
      ValueError: a file is not a picture.
      ModuleNotFoundError: OpenCV is not installed.

    CS::APEX: csapex::FileImporter.
    """

    pattern = Parameter("*.png", MinLen(1), Predicate(is_a_path))
    mode = Parameter("color", choices=("color", "gray"))
    skip_invalid = Parameter(False)
    image = Output(Image)
    path = Output(str)
    invalid = Event(str)

    def process(self) -> tuple[Image, str] | None:
        """Return the next one."""
        path = self._next(self.pattern)
        try:
            return load_image(path, "gray" if self.mode == "gray" else "color"), str(path)
        except ValueError:
            if not self.skip_invalid:
                raise
            self.invalid.trigger(str(path))
            return None


class StandardInput(Node):
    """Send the lines that the program is sent, by a terminal, a pipe or a file, then end.

    It waits in a thread of its own, so a keyboard blocks nothing. Input that was read but not sent when a run ends is
    kept for the next run of the process. Under a virtual clock the time of the graph does not wait for it. Bytes that
    are not UTF-8 become replacement characters.

    Attributes:
      line: each line, without its end.

    Raises:
      OSError: it cannot be read.

    CS::APEX: csapex::ImportCin.
    """

    line = Output(str)

    async def process(self) -> AsyncIterator[str]:
        """Read."""
        async for line in lines_of_standard_input():
            yield line
