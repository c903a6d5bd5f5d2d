"""Finds the position of everything in an MCAP file, even if the file is damaged or was cut off.

A complete file has a summary with the position of each chunk, which is used if its checksum is right. In any case,
records are followed from the start. If a record cannot be read, the search continues at the next chunk according to the
summary, or, without a summary, at the next place that looks like one. Depends on `chunks` and the records of the
package `mcap`.
"""

from __future__ import annotations

import re
import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from io import BytesIO
from typing import Any, BinaryIO, Final, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Header, Metadata, Schema, Statistics

from hfg.base.bounds import CHUNK_BYTES
from hfg.recording.chunks import CHUNK, HEAD, MESSAGE, Damaged, chunk_head
from hfg.recording.mcap import MAGIC

_FOOTER: Final = HEAD.size + 20 + len(MAGIC)
_LONGEST_RECORD: Final = 64 * 2**20  # except chunks, messages and attachments
_PIECE: Final = 4 * 2**20  # bytes that are read at once: of messages outside chunks, and where a chunk is looked for
_LOOKS_LIKE_A_CHUNK: Final = re.compile(
    rb"\x06.{5}\x00{3}.{28}(?:\x03\x00{3}lz4|\x04\x00{3}zstd|\x00{4}).{5}\x00{3}", re.DOTALL
)
_HEAD_OF_A_CHUNK: Final = 64
_MOST_NAMES: Final = 10_000
_KNOWN: Final = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}
_LAST_OPCODE: Final = 0x0F
_FIRST_PRIVATE: Final = 0x80


class Piece(NamedTuple):
    """A place with messages: a chunk, or consecutive messages outside chunks.

    Attributes:
      begin: start of the chunk's content, or of the first record.
      length: its length.
      is_chunk: whether it is a chunk.
    """

    begin: int
    length: int
    is_chunk: bool

    @property
    def end(self) -> int:
        """Where the next record starts."""
        return self.begin + self.length


class _Exact(ReadDataStream):
    """Reads exactly as many bytes as a record's lengths ask for, or fails; the package would return fewer."""

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length)
        if len(data) != length:
            raise Damaged("a length in it is wrong")
        return data


def read_record(opcode: int, data: bytes) -> Any:
    """Make a record from its bytes; None for kinds that are not used here.

    Raises:
      Damaged: it cannot be read.
    """
    kind: Any = _KNOWN.get(Opcode(opcode)) if 0 < opcode <= _LAST_OPCODE else None
    if kind is None:
        return None
    try:
        return kind.read(_Exact(BytesIO(data)))
    except Damaged:
        raise
    except Exception as error:  # the package may raise anything for damaged bytes
        raise Damaged(f"a record of kind {Opcode(opcode).name} cannot be read ({error})") from None


class Layout:
    """The positions of everything in a file.

    Attributes:
      size: bytes of the file.
      whole: the file is complete up to its end, and so is its summary.
      ended: the recording ended here; the summary may be damaged.
      pieces: places of messages, in order.
      library: the program that wrote it.
      schemas: by number.
      channels: by number.
      metadata: by name; if there are several of one name, the last.
      beside: places of attachments and metadata: kind, position and length of each.
      faults: damage outside chunks, with the position of its start.
      statistics: of the summary.
    """

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self.size = size
        self.whole = self.ended = False
        self.pieces: list[Piece] = []
        self.library = self.profile = ""
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.beside: list[tuple[int, int, int]] = []
        self.faults: list[tuple[int, str]] = []
        self.statistics: Statistics | None = None
        # checksum of everything before a position, as stated by its writer
        self._checksum: tuple[int, int] | None = None
        self._indexed: dict[int, ChunkIndex] = {}  # the chunks in the summary, by their positions
        self._bare = False  # the last piece consists of messages outside chunks
        end = self._read_summary()
        self._places = sorted(self._indexed)
        self._follow(len(MAGIC), size if end is None else end)

    # --- the summary --------------------------------------------------------------------------------------------------

    def _read_summary(self) -> int | None:
        """Read the summary, if there is one that is not damaged. Return its position."""
        if self.size < _FOOTER + len(MAGIC):
            return None
        tail = self._at(self.size - _FOOTER, _FOOTER)
        opcode, length = HEAD.unpack_from(tail)
        if not tail.endswith(MAGIC) or opcode != Opcode.FOOTER or length != 20:
            return None
        footer = read_record(opcode, tail[HEAD.size : -len(MAGIC)])
        at, end = footer.summary_start, self.size - _FOOTER
        if at == 0:  # there is none, which is allowed
            self.whole = self._checks(tail, footer.summary_crc)
            return None
        if not len(MAGIC) <= at <= end:
            return None
        checksum = self._checksum_of(at, end + HEAD.size + 16) if footer.summary_crc else 0
        if checksum != footer.summary_crc:
            return None
        try:
            self._take_summary(at, end)
        except Damaged:
            self._indexed.clear()
            self.statistics = None
            return None
        self.whole = True
        return int(at)

    def _checks(self, tail: bytes, checksum: int) -> bool:
        return checksum in (0, zlib.crc32(tail[: HEAD.size + 16]))

    def _take_summary(self, at: int, end: int) -> None:
        while at < end:
            opcode, length = self._head(at, end)
            at += HEAD.size
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX):
                record = self._record(opcode, at, length)
                if isinstance(record, ChunkIndex):
                    self._take_index(record)
                elif isinstance(record, Statistics):
                    self.statistics = record
                else:
                    self.declare(record)
            at += length

    def _take_index(self, record: ChunkIndex) -> None:
        at, length = record.chunk_start_offset, record.chunk_length
        if at < len(MAGIC) or length < HEAD.size or at + length > self.size:
            raise Damaged("it lists a chunk that is not in the file")
        self._indexed[at] = record

    # --- the data -----------------------------------------------------------------------------------------------------

    def _follow(self, at: int, end: int) -> None:
        """Follow records from `at` to `end`, skipping the contents of chunks."""
        while at < end and not self.ended:
            known = self._indexed.get(at)
            if known is not None:
                self._add(Piece(at + HEAD.size, known.chunk_length - HEAD.size, is_chunk=True))
                at += known.chunk_length
                continue
            try:
                opcode, length = self._head(at, self._next_indexed(at, end))
                self._take(opcode, at + HEAD.size, length)
                at += HEAD.size + length
            except Damaged as error:
                found = self._resume(at + 1, end)
                if found is None and not self.whole:
                    break  # it was cut off here
                self.faults.append((at, str(error)))
                at = end if found is None else found
        if not self.whole:
            behind = "its summary cannot be read and was ignored" if self.ended else "it was cut off here"
            self.faults.append((at, behind))

    def _take(self, opcode: int, at: int, length: int) -> None:
        if opcode == CHUNK:
            chunk_head(self._at(at, min(length, _HEAD_OF_A_CHUNK)), length)
            self._add(Piece(at, length, is_chunk=True))
        elif opcode == MESSAGE:
            if self._places and self.profile == "hfg":
                raise Damaged("a message is outside the chunks, where hfg does not write any")
            self._take_message(at, length)
        elif opcode == Opcode.ATTACHMENT:
            self.beside.append((opcode, at, length))
        elif opcode == Opcode.DATA_END:
            if length < 4 or (self._places and at <= self._places[-1]):
                raise Damaged("the end of the data is not valid")
            self.ended = True
            (checksum,) = struct.unpack("<I", self._at(at, 4))
            if checksum:
                self._checksum = at - HEAD.size, checksum
        elif opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA):
            self.declare(self._record(opcode, at, length))
            if opcode == Opcode.METADATA:
                self.beside.append((opcode, at, length))

    def _add(self, piece: Piece) -> None:
        self.pieces.append(piece)
        self._bare = False

    def _take_message(self, at: int, length: int) -> None:
        begin, end = at - HEAD.size, at + length
        last = self.pieces[-1] if self._bare else None
        if last is not None and last.end == begin and end - last.begin <= _PIECE:
            self.pieces[-1] = Piece(last.begin, end - last.begin, is_chunk=False)
            return
        self.pieces.append(Piece(begin, end - begin, is_chunk=False))
        self._bare = True

    def declare(self, record: Any) -> None:
        """Process a record that declares contents of the file."""
        match record:
            case Header():
                self.library, self.profile = record.library, record.profile
            case Schema():
                self.schemas[record.id] = record
            case Channel():
                self.channels[record.id] = record
            case Metadata() if record.name in self.metadata or len(self.metadata) < _MOST_NAMES:
                self.metadata[record.name] = record.metadata

    # --- what is damaged ----------------------------------------------------------------------------------------------

    def _resume(self, at: int, end: int) -> int | None:
        """Find the next chunk, or the end of the data."""
        if self._places:
            found = self._next_indexed(at - 1, end)
            return None if found >= end else found
        while at < end:  # piece by piece: if another user cuts a file meanwhile, mapped memory kills the process
            data = self._at(at, min(_PIECE, end - at))
            for match in _LOOKS_LIKE_A_CHUNK.finditer(data):
                begin = at + match.start()
                _, length = HEAD.unpack_from(data, match.start())
                if begin + HEAD.size + length <= end and self._is_chunk(begin + HEAD.size, length):
                    return begin
            if len(data) < _PIECE:
                return None
            at += _PIECE - _HEAD_OF_A_CHUNK  # it may begin in one piece and end in the next
        return None

    def _is_chunk(self, at: int, length: int) -> bool:
        try:
            head = chunk_head(self._at(at, min(length, _HEAD_OF_A_CHUNK)), length)
        except Damaged:
            return False
        return head.first <= head.last

    def _next_indexed(self, at: int, end: int) -> int:
        number = bisect_right(self._places, at)
        return min(self._places[number], end) if number < len(self._places) else end

    def lost_in(self, piece: Piece) -> tuple[int | None, int | None, int | None]:
        """Return the contents of an unreadable chunk as far as known: number of messages, and their times."""
        count = None
        for _, length in self._message_indexes(piece.end):
            count = (count or 0) + max(length - 6, 0) // 16
        first, last = self.times_of(piece)
        return count, first, last

    def times_of(self, piece: Piece) -> tuple[int | None, int | None]:
        """Return the times of the first and the last message of a chunk according to its head, if it can be read."""
        try:
            head = chunk_head(self._at(piece.begin, min(piece.length, _HEAD_OF_A_CHUNK)), piece.length)
        except Damaged:
            return None, None
        return head.first, head.last

    def indexes_of(self, piece: Piece) -> dict[int, tuple[int, int]]:
        """Return position and length of the index of each channel after a chunk; none if it has no indexes.

        These are the contents of records, which consist of the channel, a length, and pairs of a time and a place.
        """
        known = self._indexed.get(piece.begin - HEAD.size)
        if known is None or not known.message_index_offsets:
            found = {}
            for at, length in self._message_indexes(piece.end):
                found[int.from_bytes(self._at(at, 2), "little")] = at, length
            return found
        places = sorted(known.message_index_offsets.items(), key=lambda item: item[1])
        ends = [*(at for _, at in places[1:]), places[0][1] + known.message_index_length]
        if piece.end != places[0][1] or ends[-1] > self.size:
            return {}  # the summary contradicts itself
        return {
            channel: (at + HEAD.size, end - at - HEAD.size)
            for (channel, at), end in zip(places, ends, strict=True)
            if end - at >= HEAD.size
        }

    def _message_indexes(self, at: int) -> Iterator[tuple[int, int]]:
        """Yield positions and lengths of the index records after a chunk."""
        while True:
            try:
                opcode, length = self._head(at, self.size)
            except Damaged:
                return
            if opcode != Opcode.MESSAGE_INDEX:
                return
            yield at + HEAD.size, length
            at += HEAD.size + length

    def read(self, at: int, length: int) -> bytes:
        """Read some bytes of the file."""
        return self._at(at, length)

    def keeps_its_checksum(self) -> bool:
        """Return whether everything before the end of the data is unchanged, as far as the file has a checksum."""
        if self._checksum is None:
            return True
        end, said = self._checksum
        return self._checksum_of(0, end) == said

    # --- reading ------------------------------------------------------------------------------------------------------

    def _at(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(length)

    def _head(self, at: int, end: int) -> tuple[int, int]:
        """Return kind and length of a record that ends before `end`."""
        if at + HEAD.size > end:
            raise Damaged("a record is incomplete")
        head = self._at(at, HEAD.size)
        if len(head) < HEAD.size:
            raise Damaged("the file has become shorter")
        opcode, length = HEAD.unpack(head)
        if opcode == 0 or _LAST_OPCODE < opcode < _FIRST_PRIVATE:
            raise Damaged("a record is not valid")
        if length > end - at - HEAD.size:
            raise Damaged(f"a record states {length:,} bytes, which are not there")
        return opcode, length

    def _record(self, opcode: int, at: int, length: int) -> Any:
        if length > _LONGEST_RECORD:
            raise Damaged(f"a record has {length:,} bytes, but descriptions may have at most 64 MiB")
        return read_record(opcode, self._at(at, length))

    def _checksum_of(self, at: int, end: int) -> int:
        self._stream.seek(at)
        found, left = 0, end - at
        while left > 0 and (data := self._stream.read(min(left, 2**20))):
            found = zlib.crc32(data, found)
            left -= len(data)
        return found

    def content(self, begin: int, length: int) -> bytes:
        """Read a record; for a chunk, the packed data.

        Raises:
          Damaged: it is longer than allowed.
        """
        if length > CHUNK_BYTES.most + _HEAD_OF_A_CHUNK:
            raise Damaged(f"it has {length:,} bytes, {CHUNK_BYTES.remedy}")
        return self._at(begin, length)
