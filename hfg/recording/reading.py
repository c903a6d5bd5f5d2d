"""Reading recordings, including files that are damaged or were cut off.

Files are read chunk by chunk, so that they can have any length. A chunk that cannot be read costs only its own
contents, and the loss is reported (rule L4). Depends on `layout` and `chunks`.
"""

from __future__ import annotations

import math
import os
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec
from mcap.records import Channel, Schema

from hfg.encoding.plain import json_value
from hfg.errors import UsageError
from hfg.recording.bags import RECOVERED, opened
from hfg.recording.chunks import Budget, Content, Damaged, content_of, unpacked
from hfg.recording.layout import Layout, read_record
from hfg.recording.mcap import MAGIC
from hfg.recording.messages import EVENTS, MARKERS

CDR: Final = "cdr"
"""The encoding of messages of ROS 2."""

_KEPT_CHUNKS: Final = 8
_KEPT_BYTES: Final = 64 * 2**20
_MOST_TOLD: Final = 100
_FURTHEST_NS: Final = 2.0**62

RawMessage = tuple[int, int, bytes]
"""Channel, nanoseconds, data."""


class Loss(msgspec.Struct):
    """A part of a recording that cannot be read.

    Attributes:
      what: what is lost and why, as a message without a full stop.
      messages: number of lost messages; None if unknown.
      first_s: time of the first one; None if unknown.
      last_s: time of the last one.
    """

    what: str
    messages: int | None = 0
    first_s: float | None = None
    last_s: float | None = None

    def __str__(self) -> str:
        """Return the loss as a message."""
        if self.messages is None:
            return f"{self.what}; the number of lost messages is unknown"
        when = "" if self.first_s is None else f", from {self.first_s:.3f} s to {self.last_s:.3f} s"
        return f"{self.what}; {_messages(self.messages)} lost{when}" if self.messages else self.what


class PortInfo(msgspec.Struct):
    """Information about one recorded port.

    Attributes:
      path: path of the port; the topic, if hfg did not write the file.
      kind: "output", "event", ...
      type: type of its values, in words.
      schema: the name of the schema of its messages.
      values: number of recorded values, without markers.
      rate_hz: their average rate.
    """

    path: str
    kind: str
    type: str
    schema: str
    values: int
    rate_hz: float


class RecordingInfo(msgspec.Struct):
    """Information about a recording.

    Attributes:
      whole: its writer has finished it; otherwise it was cut off, and ends with its last complete chunk.
      losses: parts that cannot be read, and losses from before the file was recovered.
      graph: the name of the graph; empty if hfg did not write it.
      clock: "real" or "virtual".
      began: start of the run, on its clock.
      duration_s: from the first token to the last.
      outcome: of the run; empty if unknown.
      markers: number of markers.
      left_out: number of tokens skipped for lack of time, by port.
      refused: number of values that are not data, by port.
      held_s: how long nodes waited for the recording.
      commands: the graph itself, as commands that make it (`hfg.commands.decode`).
    """

    path: str
    bytes: int
    whole: bool
    library: str
    graph: str
    clock: str
    began: float
    duration_s: float
    outcome: str
    chunks: int
    messages: int
    markers: int
    held_s: float
    left_out: dict[str, int]
    refused: dict[str, int]
    ports: list[PortInfo]
    commands: str
    losses: list[Loss] = []


class File:
    """An MCAP file.

    Attributes:
      path: path of the file.
      whole: whether its writer has finished it.
      channels: by number.
      schemas: by number.
      metadata: by name; if there are several of one name, the last.
      when_lost: called with each chunk that cannot be read, when it is reached.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open it.

        Raises:
          UsageError: there is no such file, or it is not an MCAP file.
        """
        self.path = Path(path)
        self._kept: OrderedDict[int, Content] = OrderedDict()
        self._lost: dict[int, Loss] = {}  # by number of the piece
        self.when_lost: Callable[[Loss], object] = _nobody
        try:
            self._stream: BinaryIO = opened(self.path, File)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise UsageError(f"cannot open the recording {path}: {why}") from None
        try:
            if self._stream.read(len(MAGIC)) != MAGIC:
                raise UsageError(
                    f"{path} is not an MCAP file; hfg record writes such files, and so do many other programs"
                )
            self.layout = Layout(self._stream, os.fstat(self._stream.fileno()).st_size)
        except OSError as error:
            self._stream.close()
            raise UsageError(f"cannot read the recording {path}: {error.strerror}") from None
        except BaseException:
            self._stream.close()
            raise
        self._budget = Budget(self.layout.size)
        self.whole = self.layout.whole
        self.library = self.layout.library
        self.channels: dict[int, Channel] = self.layout.channels
        self.schemas: dict[int, Schema] = self.layout.schemas
        self.metadata: dict[str, dict[str, str]] = self.layout.metadata
        if self.layout.statistics is None:  # chunks may contain declarations
            for number in range(len(self.layout.pieces)):
                self.content(number)

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def __enter__(self) -> File:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def contents(self) -> Iterator[Content]:
        """Yield the chunks that can be read."""
        for number in range(len(self.layout.pieces)):
            content = self.content(number)
            if content is not None:
                yield content

    def messages(self, channels: frozenset[int] | None = None) -> Iterator[RawMessage]:
        """Yield all messages, or those of some channels, in the order in which they were written.

        Unreadable parts are skipped; see `losses`.
        """
        wanted = self.channels if channels is None else channels
        for content in self.contents():
            for message in content.messages():
                if message.channel in wanted:
                    yield message.channel, message.log_time, message.data

    def numbers_of(self, topic: str) -> frozenset[int]:
        """Return the channels of one topic."""
        return frozenset(number for number, one in self.channels.items() if one.topic == topic)

    def began(self) -> float:
        """Return when the recorded graph started to run, or when the recording started, if that was later."""
        for _, _, data in self.messages(self.numbers_of(EVENTS)):
            event = self.object_in(data)
            if event.get("type") == "RunStarted":
                return number_in(event.get("time"))
            break
        if not self._about():  # another program has written it
            return next((when for _, when, _ in self.messages()), 0) / 1e9
        return number_in(self._about().get("began", 0.0))

    def object_in(self, data: bytes) -> dict[str, Any]:
        """Decode a message of hfg's own.

        Raises:
          UsageError: the data is not such a message.
        """
        try:
            found = json_value(data)
        except (RecursionError, ValueError) as error:
            raise UsageError(f"{self.path} is damaged: a message in it is not JSON ({error})") from None
        if not isinstance(found, dict):
            raise UsageError(f"{self.path} is damaged: a message in it is not an object but {str(found)[:40]!r}")
        return found

    def losses(self) -> list[Loss]:
        """Return what cannot be read; reads the whole file."""
        return self._count()[1]

    def info(self) -> RecordingInfo:
        """Return information about the recording; counts all messages."""
        seen, losses = self._count()
        counts = seen.counts
        duration = (seen.last - seen.first) / 1e9 if seen.counts else 0.0
        about, ended = self._about(), self.metadata.get("hfg:end", {})
        return RecordingInfo(
            path=str(self.path),
            bytes=self.layout.size,
            whole=self.whole,
            library=self.library,
            graph=about.get("graph", ""),
            clock=about.get("clock", ""),
            began=self.began() if about else seen.first / 1e9,
            duration_s=duration,
            outcome=ended.get("outcome", ""),
            chunks=len(self.layout.pieces),
            messages=sum(counts.values()),
            markers=sum(counts[number] for number, one in self.channels.items() if one.topic == MARKERS),
            held_s=number_in(ended.get("held_s", 0.0)),
            left_out=_counts(ended.get("left_out", "{}")),
            refused=_counts(ended.get("refused", "{}")),
            ports=[
                self._port(number, counts[number], duration)
                for number, one in self.channels.items()
                if one.topic not in (MARKERS, EVENTS)
            ],
            commands=about.get("commands", ""),
            losses=losses,
        )

    def _about(self) -> Mapping[str, str]:
        return self.metadata.get("hfg", {})

    def _port(self, number: int, count: int, duration: float) -> PortInfo:
        channel = self.channels[number]
        schema = self.schemas.get(channel.schema_id)
        about = channel.metadata
        rate = count / duration if duration else 0.0
        name = schema.name if schema is not None else ""
        type_ = about.get("type", "") or (name if channel.message_encoding == CDR else "")
        return PortInfo(channel.topic, about.get("kind", ""), type_, name, count, rate)

    # --- what cannot be read ------------------------------------------------------------------------------------------

    def _count(self) -> tuple[_Seen, list[Loss]]:
        """Read the whole file and count."""
        seen = _Seen()
        for content in self.contents():
            for channel, _, when, _, _ in content.messages():
                if channel in self.channels:
                    seen.take(channel, when)
                else:
                    seen.orphans += 1
        return seen, self._losses(seen)

    def losses_met(self) -> list[Loss]:
        """Return the losses in the part of the file that was read."""
        faults = [Loss(f"at byte {at:,}: {why}") for at, why in self.layout.faults]
        if faults and not self.layout.ended:
            faults[-1].messages = None
        chunks = [self._lost[one] for one in sorted(self._lost)]
        found = self._recovered() + faults[-_MOST_TOLD:] + chunks[:_MOST_TOLD]
        if len(faults) > _MOST_TOLD:
            found.append(Loss(f"{len(faults) - _MOST_TOLD} more places are damaged"))
        if more := [one.messages for one in chunks[_MOST_TOLD:]]:
            count = None if None in more else sum(one or 0 for one in more)
            found.append(Loss(f"{len(more):,} more chunks cannot be read", count))
        return found

    def _losses(self, seen: _Seen) -> list[Loss]:
        found = self.losses_met()
        if seen.orphans:
            found.append(Loss("the descriptions of some ports cannot be read", seen.orphans))
        if found:
            return found
        statistics = self.layout.statistics
        if not self.layout.keeps_its_checksum():
            return [Loss("something outside the chunks is damaged, so the description of the file may be wrong")]
        if statistics is not None and statistics.message_count != sum(seen.counts.values()):
            found.append(
                Loss(f"its summary lists {_messages(statistics.message_count)}, but there is a different number")
            )
        return found

    def _recovered(self) -> list[Loss]:
        """Return the losses from before the file was recovered."""
        said = self.metadata.get(RECOVERED, {}).get("losses", "[]")
        try:
            return msgspec.json.decode(said, type=list[Loss])
        except (msgspec.DecodeError, RecursionError):
            return [Loss("the list of losses from before it was recovered cannot be read", None)]

    def content(self, number: int) -> Content | None:
        """Read a chunk. Return None if it cannot be read, and record the loss."""
        if number in self._lost:
            return None
        kept = self._kept.get(number)
        if kept is not None:
            self._kept.move_to_end(number)
            return kept
        data = self.unpacked(number)
        if data is None:
            return None
        try:
            content = content_of(data, self._declare)
            self._budget.spend(number, len(data), len(content.places) // 2)
        except Damaged as error:
            self.lose(number, str(error))
            return None
        self._kept[number] = content
        while len(self._kept) > _KEPT_CHUNKS or (
            len(self._kept) > 1 and sum(len(one.data) for one in self._kept.values()) > _KEPT_BYTES
        ):
            self._kept.popitem(last=False)
        return content

    def unpacked(self, number: int) -> bytes | None:
        """Return the records of a piece as bytes. Return None if it cannot be read, and record the loss."""
        if number in self._lost:
            return None
        piece = self.layout.pieces[number]
        try:
            record = self.layout.content(piece.begin, piece.length)
            data = unpacked(record) if piece.is_chunk else record
            self._budget.spend(number, len(data))
        except Damaged as error:
            self.lose(number, str(error))
            return None
        return data

    def lose(self, number: int, why: str = "") -> Loss:
        """Record that a piece cannot be read, unless that is known already; return what is lost."""
        if number not in self._lost:
            self._lost[number] = self._loss(number, why)
            self.when_lost(self._lost[number])
        return self._lost[number]

    def _loss(self, number: int, why: str) -> Loss:
        piece = self.layout.pieces[number]
        count, first, last = self.layout.lost_in(piece)
        times = (None, None) if first is None or last is None or not count else (first / 1e9, last / 1e9)
        return Loss(f"chunk {number + 1} of {len(self.layout.pieces)} cannot be read: {why}", count, *times)

    def _declare(self, opcode: int, data: bytes) -> None:
        self.layout.declare(read_record(opcode, data))


class _Seen:
    """The messages found in a file."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.first = self.last = 0
        self.orphans = 0

    def take(self, channel: int, when: int) -> None:
        if not self.counts:
            self.first = self.last = when
        self.counts[channel] += 1
        self.first, self.last = min(self.first, when), max(self.last, when)


def _nobody(_loss: Loss) -> None:
    pass


def _messages(count: int) -> str:
    return f"{count:,} message{'s' * (count != 1)}"


def number_in(said: object) -> float:
    """Return the number in a file's data; 0 if it is not a number."""
    try:
        return float(said)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return 0.0


def nanoseconds_in(said: object) -> int:
    """Return the seconds in a file's data as nanoseconds of 64 bits; 0 if they are not a finite number."""
    seconds = number_in(said)
    return int(min(max(seconds * 1e9, -_FURTHEST_NS), _FURTHEST_NS)) if math.isfinite(seconds) else 0


def _counts(said: str) -> dict[str, int]:
    try:
        return msgspec.json.decode(said, type=dict[str, int])
    except (msgspec.DecodeError, RecursionError):
        return {}
