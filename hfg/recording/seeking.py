"""Finds the messages of a recording by time, without reading all of it.

A file lists the times and places of the messages of each chunk after the chunk. These lists are read when they are
needed, and the newest are kept; a chunk is unpacked only for a message in it. The lists are not trusted: a message that
is not at its place makes the chunk damaged. All methods can be called from any thread. Depends on `reading`.
"""

from __future__ import annotations

import struct
import threading
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from itertools import accumulate
from typing import Any, Final, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from hfg.recording.chunks import HEAD, MESSAGE, Damaged
from hfg.recording.reading import File, Loss

T = TypeVar("T")
Array = npt.NDArray[Any]

MOST_MARKS: Final = 4000
"""Of a stretch of time; of more messages, some that are evenly spread."""

_KEPT_BYTES: Final = 64 * 2**20
_MARK_BYTES: Final = 8 * 2**20  # of lists that are read for one stretch of time
_FIELDS: Final = struct.Struct("<HIQQ")
_TIME: Final = struct.calcsize("<HI")  # where the time is
_PAIR: Final = np.dtype([("time", "<i8"), ("place", "<i8")])
_FOREVER: Final = 2**63 - 1


class Found(NamedTuple):
    """A message: its channel, time in nanoseconds, piece, and place in the unpacked piece."""

    channel: int
    time: int
    piece: int
    place: int


class _Piece(NamedTuple):
    """A piece of the file that holds messages.

    Attributes:
      first, last: times of its messages, in nanoseconds.
      number: its place in the file.
      lists: where the lists of its messages lie, and how long each is, by channel; empty if it has none.
    """

    first: int
    last: int
    number: int
    lists: dict[int, tuple[int, int]]


class _Kept(Generic[T]):
    """Results by number, the newest within a number of bytes."""

    def __init__(self, size: Callable[[T], int]) -> None:
        self._size = size
        self._kept: OrderedDict[int, T] = OrderedDict()
        self._bytes = 0

    def get(self, number: int) -> T | None:
        found = self._kept.get(number)
        if found is not None:
            self._kept.move_to_end(number)
        return found

    def put(self, number: int, value: T) -> None:
        self._kept[number] = value
        self._bytes += self._size(value)
        while self._bytes > _KEPT_BYTES and len(self._kept) > 1:
            self._bytes -= self._size(self._kept.popitem(last=False)[1])


class Seeking:
    """The messages of a recording, by channel and time.

    Attributes:
      file: the recording.
      first: time of the first message, in nanoseconds.
      last: time of the last message.
    """

    def __init__(self, file: File) -> None:
        self.file = file
        self._lock = threading.RLock()
        self._lists: _Kept[dict[int, Array]] = _Kept(lambda lists: sum(one.nbytes for one in lists.values()))
        self._data: _Kept[bytes] = _Kept(len)
        numbers = range(len(file.layout.pieces))
        self._pieces = sorted(piece for piece in map(self._piece, numbers) if piece is not None)
        self._begins = [piece.first for piece in self._pieces]
        self._ends = list(accumulate((piece.last for piece in self._pieces), max))
        self._by_channel: dict[int, list[int]] = {}
        for index, piece in enumerate(self._pieces):
            for channel in piece.lists or self._lists_of(index):
                self._by_channel.setdefault(channel, []).append(index)
        self.first = self._begins[0] if self._pieces else 0
        self.last = self._ends[-1] if self._pieces else 0

    def _piece(self, number: int) -> _Piece | None:
        """Describe a piece of the file; return None if it holds no messages."""
        layout = self.file.layout
        piece = layout.pieces[number]
        lists = layout.indexes_of(piece) if piece.is_chunk else {}
        first, last = layout.times_of(piece) if lists else (None, None)
        if first is None or last is None or first > last:
            lists = {}
            first, last = self._span_of_content(number)
        return None if first is None or last is None else _Piece(first, last, number, lists)

    def _span_of_content(self, number: int) -> tuple[int | None, int | None]:
        """Return the times in a piece without lists, which has to be read to find them."""
        times = [one["time"] for one in self._listed(number).values()]
        return (int(min(one[0] for one in times)), int(max(one[-1] for one in times))) if times else (None, None)

    # --- the lists of a chunk -----------------------------------------------------------------------------------------

    def _lists_of(self, index: int) -> dict[int, Array]:
        """Return the times and places of the messages in a chunk, by channel, each in the order of time."""
        with self._lock:
            found = self._lists.get(index)
            if found is None:
                where = self._pieces[index].lists
                read = self._read_lists(where) if where else None
                found = self._listed(self._pieces[index].number) if read is None else read
                self._lists.put(index, found)
            return found

    def _read_lists(self, where: dict[int, tuple[int, int]]) -> dict[int, Array] | None:
        """Read the lists after a chunk; None if one is damaged."""
        begin = min(at for at, _ in where.values())
        end = max(at + length for at, length in where.values())
        data = self.file.layout.read(begin, end - begin) if end - begin <= _KEPT_BYTES else b""
        found = {}
        for channel, (at, length) in where.items():
            record = data[at - begin : at - begin + length]
            if len(record) != length or length < 6 or struct.unpack_from("<HI", record) != (channel, length - 6):
                return None
            found[channel] = _in_order(np.frombuffer(record, _PAIR, (length - 6) // _PAIR.itemsize, 6))
        return found

    def _listed(self, number: int) -> dict[int, Array]:
        """Make the lists of a piece that has none."""
        content = self.file.content(number)
        if content is None or not content.places:
            return {}  # whatever is read from it later reports the damage
        data, places = content
        # a small file may hold millions of empty messages: objects of Python for each would take gigabytes
        begins = np.frombuffer(places, np.uint64)[::2].astype(np.int64)
        channels = _numbers_at(data, begins, "<u2")
        order = np.argsort(channels, kind="stable")
        pairs = np.empty(len(begins), _PAIR)
        pairs["time"] = np.minimum(_numbers_at(data, begins + _TIME, "<u8"), _FOREVER)[order]
        pairs["place"] = begins[order] - HEAD.size
        found, first = np.unique(channels[order], return_index=True)
        return {int(channel): _in_order(part) for channel, part in zip(found, np.split(pairs, first[1:]), strict=True)}

    # --- messages by time ---------------------------------------------------------------------------------------------

    def latest(self, channel: int, at: int) -> Found | None:
        """Return the last message of a channel up to a time, in nanoseconds."""
        best: Found | None = None
        holding = self._by_channel.get(channel, [])
        for index in reversed(holding[: bisect_right(holding, bisect_right(self._begins, at) - 1)]):
            if best is not None and best.time >= self._ends[index]:
                break
            pairs = self._lists_of(index).get(channel, _NONE)
            number = int(np.searchsorted(pairs["time"], at, "right")) - 1
            if number >= 0 and (best is None or pairs["time"][number] > best.time):
                best = self._found(channel, index, pairs, number)
        return best

    def before(self, channels: Iterable[int], at: int) -> int | None:
        """Return the time of the last message of some channels before a time."""
        found = [one.time for channel in channels if (one := self.latest(channel, at - 1)) is not None]
        return max(found, default=None)

    def after(self, channels: Iterable[int], at: int) -> int | None:
        """Return the time of the first message of some channels after a time."""
        found = [one for channel in channels if (one := self._first_after(channel, at)) is not None]
        return min(found, default=None)

    def _first_after(self, channel: int, at: int) -> int | None:
        best: int | None = None
        for index in self._by_channel.get(channel, []):
            if best is not None and self._begins[index] > best:
                break
            if self._ends[index] <= at:
                continue
            times = self._lists_of(index).get(channel, _NONE)["time"]
            number = int(np.searchsorted(times, at, "right"))
            if number < len(times) and (best is None or times[number] < best):
                best = int(times[number])
        return best

    def count(self, channels: Iterable[int], begin: int, end: int) -> int:
        """Return how many messages of some channels there are after a time, up to another."""
        total = 0
        for channel in channels:
            for index in self._between(channel, begin, end):
                times = self._lists_of(index).get(channel, _NONE)["time"]
                total += int(np.searchsorted(times, end, "right") - np.searchsorted(times, begin, "right"))
        return total

    def messages(self, channel: int, begin: int, end: int) -> Iterator[Found]:
        """Yield the messages of a channel after a time, up to another, the last first."""
        for index in reversed(self._between(channel, begin, end)):
            pairs = self._lists_of(index).get(channel, _NONE)
            first, last = (int(np.searchsorted(pairs["time"], one, "right")) for one in (begin, end))
            for number in range(last - 1, first - 1, -1):
                yield self._found(channel, index, pairs, number)

    def _found(self, channel: int, index: int, pairs: Array, number: int) -> Found:
        return Found(channel, int(pairs["time"][number]), self._pieces[index].number, int(pairs["place"][number]))

    def _between(self, channel: int, begin: int, end: int) -> list[int]:
        holding = self._by_channel.get(channel, [])
        last = bisect_right(holding, bisect_right(self._begins, end) - 1)
        first = min(bisect_right(holding, bisect_right(self._ends, begin) - 1), last)
        return holding[first:last]

    def marks(self, channels: Iterable[int], begin: int, end: int) -> tuple[dict[int, Array], int]:
        """Return the times of messages in a stretch of time by channel, and how many there are about in all.

        Of very many, only some are returned: of every other chunk, or of every tenth; of each channel evenly spread.
        """
        wanted = frozenset(channels)
        last = bisect_right(self._begins, end)
        inside = range(min(bisect_right(self._ends, begin - 1), last), last)
        indexes = [self._pieces[index].lists for index in inside]
        sizes = [sum(length for one, (_, length) in here.items() if one in wanted) for here in indexes]
        every = max(1, -(-sum(sizes) // _MARK_BYTES))
        found: dict[int, list[Array]] = {}
        for index in inside[::every]:
            lists = self._lists_of(index)
            for channel in wanted & lists.keys():
                times = lists[channel]["time"]
                part = times[np.searchsorted(times, begin, "left") : np.searchsorted(times, end, "right")]
                if len(part):
                    found.setdefault(channel, []).append(part)
        whole = {channel: np.concatenate(parts) for channel, parts in found.items()}
        total = sum(map(len, whole.values()))
        most = max(8, MOST_MARKS // max(1, len(whole)))
        return {channel: times[:: max(1, -(-len(times) // most))] for channel, times in whole.items()}, total * every

    # --- contents -----------------------------------------------------------------------------------------------------

    def read(self, found: Found) -> bytes:
        """Return the data of a message.

        Raises:
          Damaged: its chunk cannot be read; the message of the error says why and what is lost.
        """
        with self._lock:
            data = self._data.get(found.piece)
            if data is None:
                data = self.file.unpacked(found.piece)
                if data is None:
                    raise Damaged(str(self.file.lose(found.piece)))
                self._data.put(found.piece, data)
            begin = found.place + HEAD.size
            if found.place >= 0 and begin + _FIELDS.size <= len(data):
                opcode, length = HEAD.unpack_from(data, found.place)
                channel, _, time, _ = _FIELDS.unpack_from(data, begin)
                if (opcode, channel, time) == (MESSAGE, found.channel, found.time) and begin + length <= len(data):
                    return data[begin + _FIELDS.size : begin + length]
            raise Damaged(str(self.file.lose(found.piece, "the list of its messages is wrong")))

    def parts(self, channel: int) -> Iterator[tuple[int, list[bytes]]]:
        """Read the whole recording, the chunks with a channel first, in the order of time.

        Yields, for each chunk, the time up to which it reaches, and the messages of that channel in it.
        """
        holding = self._by_channel.get(channel, [])
        seen = set(holding)
        others = [index for index in range(len(self._pieces)) if index not in seen]
        for index in [*holding, *others]:
            pairs = self._lists_of(index).get(channel, _NONE)
            with self._lock:
                data = self.file.unpacked(self._pieces[index].number)
            places = pairs["place"].tolist() if data is not None else []
            yield self._ends[index], [one for place in places if (one := _body(data or b"", place)) is not None]

    def losses(self) -> list[Loss]:
        """Return what could not be read so far."""
        with self._lock:
            return self.file.losses_met()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self.file.close()


def _body(data: bytes, place: int) -> bytes | None:
    """Return the data of the message at a place; None if there is none."""
    begin = place + HEAD.size
    if place < 0 or begin + _FIELDS.size > len(data):
        return None
    opcode, length = HEAD.unpack_from(data, place)
    return data[begin + _FIELDS.size : begin + length] if opcode == MESSAGE and begin + length <= len(data) else None


_NONE: Final = np.empty(0, _PAIR)


def _numbers_at(data: bytes, places: Array, kind: str) -> Array:
    """Return the numbers that begin at some places."""
    at_each = np.ndarray(len(data) - np.dtype(kind).itemsize + 1, kind, data, strides=(1,))
    return at_each[places]


def _in_order(pairs: Array) -> Array:
    times = pairs["time"]
    if len(times) > 1 and bool((times[1:] < times[:-1]).any()):
        return pairs[np.argsort(times, kind="stable")]
    return pairs
