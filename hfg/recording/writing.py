"""The thread that writes a recording: encodes tokens from the run, and writes them to the file chunk by chunk.

A chunk is written when it is large enough or a second old, and passed to the system at once: if the process dies, the
file can be read up to its last chunk. Batches are small, so that other threads get the interpreter in between. Depends
on `mcap` and `messages`.
"""

from __future__ import annotations

import itertools
import threading
import time
from array import array
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from hfg.base.token import NO_MESSAGE, Marker, Token
from hfg.base.whole import create, write_in_place
from hfg.errors import UsageError
from hfg.recording.mcap import Writer
from hfg.recording.messages import (
    EVENTS,
    ITEM,
    MARKERS,
    Marked,
    PlainToken,
    TokensLeftOut,
    TokenWriter,
    circumstances,
)
from hfg.trace import NodeEnabled, StructureChanged

PROFILE: Final = "hfg"
_CHUNK_BYTES: Final = 1024 * 1024
_CHUNK_MESSAGES: Final = 20_000
_CHUNK_S: Final = 1.0
_LOOK_S: Final = 0.3
_BATCH: Final = 1024
_NUMBERS: Final = frozenset({int, float, bool})
_PLAIN: Final = {Token}
_BETWEEN_FIRINGS: Final = frozenset({StructureChanged, NodeEnabled, TokensLeftOut})
_MARKED_SCHEMA: Final = b'{"title":"hfg marker","type":"object"}'
EVENT_SCHEMA: Final = b'{"title":"hfg event","type":"object"}'
"""Of events of a run."""


class _Batch(NamedTuple):
    """Columns of the tokens from the run; see `ITEM`."""

    places: Sequence[Any]
    passed: Sequence[Any]
    stamps: Sequence[float]
    sequences: Sequence[int]
    whens: Sequence[float]


class RecordingWriter:
    """Writes one file in a thread of its own.

    Attributes:
      items: its queue.
      sizes: sizes of the copied values in the queue.
      places: the recorded ports; each has a channel from the start, even if it sends nothing.
      bytes_taken: size of the values that it has taken, as counted when they were queued.
      error: why it has stopped writing; None while it writes.
      bytes_written: length of the file.
    """

    def __init__(self, path: Path, stream: BinaryIO, *, exact_times: bool, began: Mapping[str, str]) -> None:
        self.path = path
        self.items: list[Any] = []
        self.sizes: deque[int] = deque()
        self.bytes_taken = 0
        self.error: BaseException | None = None
        self.places: list[TokenWriter] = []
        self.last_words: Callable[[], Mapping[str, str]] = dict
        self.taken: Callable[[], None] = _nothing
        self.failed: Callable[[BaseException], None] = _nothing_to_say
        self._stream = stream
        self._exact = exact_times
        self._encode = msgspec.json.Encoder(enc_hook=as_text)
        self._something = threading.Event()
        self._finishing = False
        self._chunk_since = 0.0
        self._last_ns: Any = 0
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._own: dict[str, int] = {}
        self._declared = 0
        self._file = Writer(stream, library=f"hfg {version('hfg')}", profile=PROFILE)
        self._file.add_metadata("hfg", began)
        self._thread = threading.Thread(target=self._live, name=f"hfg recording {path.name}", daemon=True)

    @property
    def bytes_written(self) -> int:
        """Length of the file."""
        return self._file.bytes_written

    @property
    def chunks_written(self) -> int:
        """Number of chunks that the file holds completely."""
        return self._file.chunks_written

    def start(self) -> None:
        """Start writing."""
        self._thread.start()

    def wake(self) -> None:
        """Wake the thread because the queue is not empty."""
        self._something.set()

    def is_alive(self) -> bool:
        """Return whether it still writes."""
        return self._thread.is_alive()

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end."""
        self._thread.join(timeout)

    def finish(self) -> None:
        """Write the rest and close the file."""
        self._finishing = True
        self._something.set()

    # --- in the thread ------------------------------------------------------------------------------------------------

    def _live(self) -> None:
        try:
            self._write_all()
        except BaseException as error:  # most of all a full disk: reported to the recording's user
            self.error = error
            self.failed(error)
        finally:
            try:
                self._stream.close()
            except OSError as error:
                self.error = self.error or error
            self.items.clear()
            self.taken()

    def _write_all(self) -> None:
        items = self.items
        while True:
            finishing = self._finishing
            if not items and not finishing:
                self._something.wait(_LOOK_S)
            self._something.clear()
            while items:
                batch = items[: _BATCH * ITEM]
                del items[: len(batch)]
                self._write(batch)
                self.taken()
                time.sleep(0)  # let the run's own thread have the interpreter
            if self._file.chunk_messages and time.monotonic() - self._chunk_since > _CHUNK_S:
                self._file.end_chunk()
            if finishing:
                self._declare_places()
                self._file.end_chunk()
                self._file.add_metadata("hfg:end", self.last_words())
                self._file.finish()
                return

    def _write(self, items: list[Any]) -> None:
        """Encode a batch, and put it into the chunk."""
        self._declare_places()
        if not self._file.chunk_messages:
            self._chunk_since = time.monotonic()
        columns = _Batch(*(items[at::ITEM] for at in range(ITEM)))
        bodies, channels, sequences, stamps = self._plain_columns(columns) or self._columns(columns)
        lines = self._encode.encode_lines(bodies).split(b"\n")
        lines.pop()  # after the last line
        times = np.maximum.accumulate(np.maximum(_nanoseconds(columns.whens), self._last_ns))
        self._last_ns = times[-1]
        published = _nanoseconds(stamps)
        for part in _parts(lines):
            self._file.add_messages(channels[part], sequences[part], times[part], published[part], lines[part])
            if self._file.chunk_bytes > _CHUNK_BYTES or self._file.chunk_messages > _CHUNK_MESSAGES:
                self._file.end_chunk()

    def _declare_places(self) -> None:
        while self._declared < len(self.places):
            place = self.places[self._declared]
            schema = self._schema(place.schema_name, place.schema)
            place.channel = self._file.add_channel(place.path, schema, "json", place.metadata)
            self._declared += 1

    def _plain_columns(self, batch: _Batch) -> Any:
        """Return plain columns if all values are finite numbers, which need no check each; otherwise None."""
        places, bodies, stamps, sequences, whens = batch
        counts = Counter(places)
        if None in counts or any(place.keep is not None or place.firings is not None for place in counts):
            return None
        values = bodies
        if {*map(type, bodies)} == _PLAIN:
            values = [token.value for token in bodies]
            stamps, sequences = [token.stamp for token in bodies], [token.sequence for token in bodies]
        else:
            bodies = [*map(PlainToken, bodies, itertools.repeat(0), stamps, sequences)]
        if not _are_finite(values) or (self._exact and stamps != whens):
            return None
        channels = [place.channel for place in places]
        for place, count in counts.items():
            place.values += count
        return bodies, channels, sequences, stamps

    def _columns(self, batch: _Batch) -> Any:
        bodies: list[Any] = []
        rest: list[tuple[int, int, float]] = []
        for place, token, stamp, sequence, when in zip(*batch, strict=True):
            if place is None:
                bodies.append(token)
                rest.append((self._own_channel(EVENTS), 0, when))
                if type(token) in _BETWEEN_FIRINGS:
                    self._end_firings()
                continue
            firing = 0 if place.firings is None else place.firings.number(place.path)
            if not isinstance(token, Token):  # it was sent in a wave
                token = Token(NO_MESSAGE if token is None else token, 0, stamp, sequence)
            late = when if self._exact and when != token.stamp else None
            if type(token.value) is Marker:
                told = circumstances(token, late, firing)
                bodies.append(
                    Marked(place.path, token.value.value, token.stamp, token.activity, token.sequence, **told)
                )
                place.markers += 1
                rest.append((self._own_channel(MARKERS), token.sequence, token.stamp))
                continue
            if place.keep is not None:
                self.bytes_taken += self.sizes.popleft()
            bodies.append(place.message(token, late, firing))
            place.values += 1
            rest.append((place.channel, token.sequence, token.stamp))
        return bodies, *zip(*rest, strict=True)

    def _end_firings(self) -> None:
        for place in self.places:
            if place.firings is not None:
                place.firings.end()

    def _own_channel(self, topic: str) -> int:
        number = self._own.get(topic)
        if number is None:
            schema = self._schema(topic.replace("/", "."), EVENT_SCHEMA if topic == EVENTS else _MARKED_SCHEMA)
            number = self._own[topic] = self._file.add_channel(topic, schema, "json", {})
        return number

    def _schema(self, name: str, schema: bytes) -> int:
        number = self._schemas.get((name, schema))
        if number is None:
            number = self._schemas[name, schema] = self._file.add_schema(name, "jsonschema", schema)
        return number


def open_new(path: Path, *, force: bool) -> BinaryIO:
    """Create and open a file.

    Raises:
      UsageError: it already exists, or cannot be made.
    """
    try:
        return write_in_place(path) if force else create(path)
    except FileExistsError:
        raise is_there(path) from None
    except OSError as error:
        raise UsageError(f"cannot write the recording to {path}: {error.strerror}") from None


def _parts(lines: Sequence[bytes]) -> Iterator[slice]:
    """Yield messages in parts, so that large ones do not all go into one chunk, which is read as a whole."""
    if sum(map(len, lines)) <= _CHUNK_BYTES:
        yield slice(None)
        return
    begin = size = 0
    for number, line in enumerate(lines):
        size += len(line)
        if size > _CHUNK_BYTES or number == len(lines) - 1:
            yield slice(begin, number + 1)
            begin, size = number + 1, 0


def is_there(path: Path) -> UsageError:
    """Return the error for a file that already exists."""
    return UsageError(f"{path} already exists: choose another name, or overwrite it with --force or force=True")


def _are_finite(values: Sequence[Any]) -> bool:
    """Return whether all values are numbers that JSON can hold."""
    try:
        return _NUMBERS.issuperset(map(type, values)) and isfinite(sum(values))
    except OverflowError:
        return False


def _nanoseconds(seconds: Sequence[float]) -> npt.NDArray[np.uint64]:
    found = np.frombuffer(array("d", seconds))
    return (np.maximum(found, 0.0) * 1e9).astype(np.uint64)


def as_text(value: Any) -> Any:
    """Return a text for a value that JSON does not support; for an event, whose values are only for reading."""
    return f"{value!r:.200}"


def _nothing() -> None:
    pass


def _nothing_to_say(_error: BaseException) -> None:
    pass
