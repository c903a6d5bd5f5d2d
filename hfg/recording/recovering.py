"""Makes a complete recording from one that is damaged or was cut off: everything readable, with summary and indexes.

Losses are recorded in it, so that later readers know them, too. Depends on `reading`, and on the package `mcap`, which
writes the file.
"""

from __future__ import annotations

import os
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata
from mcap.writer import CompressionType, Writer

from hfg.base.whole import write_whole
from hfg.errors import UsageError
from hfg.recording.bags import RECOVERED
from hfg.recording.chunks import Damaged
from hfg.recording.layout import read_record
from hfg.recording.reading import File, Loss
from hfg.recording.writing import is_there


def recover(
    file: str | os.PathLike[str], output: str | os.PathLike[str], *, force: bool = False
) -> tuple[int, list[Loss]]:
    """Write everything readable in a recording to a new file, which is complete and has a summary.

    Args:
      file: a recording, possibly of another program.
      output: the new file; it is written completely, or not at all.
      force: overwrite an existing file.

    Returns:
      The number of messages, and the losses.

    Raises:
      UsageError: the recording cannot be read, or the new file cannot be written.
    """
    place = Path(output)
    if place.exists() and Path(file).exists() and place.samefile(file):
        raise UsageError(f"{output} is the recording itself: name another file, so that nothing more is lost")
    if place.exists() and not force:
        raise is_there(place)
    with File(file) as recording:
        recovering = _Recovering(recording)
        try:
            write_whole(place, recovering.write, overwrite=force)
        except OSError as error:
            raise UsageError(f"cannot write {output}: {error.strerror}") from None
    return recovering.count, recovering.losses


class _Recovering:
    """Copies everything readable.

    Attributes:
      count: number of messages.
      losses: the parts that cannot be read.
    """

    def __init__(self, recording: File) -> None:
        self._recording = recording
        self.count = 0
        self.losses = recording.losses()

    def write(self, stream: BinaryIO) -> None:
        layout = self._recording.layout
        writer = Writer(stream, compression=CompressionType.LZ4, enable_data_crcs=True)
        writer.start(layout.profile, f"hfg {version('hfg')}")
        self.losses += self._copy_what_is_beside(writer)
        if self.losses:
            said = {"from": self._recording.path.name, "losses": msgspec.json.encode(self.losses).decode()}
            writer.add_metadata(RECOVERED, said)
        self.count = self._copy_messages(writer)
        writer.finish()  # type: ignore[no-untyped-call]

    def _copy_what_is_beside(self, writer: Writer) -> list[Loss]:
        layout = self._recording.layout
        lost = []
        for opcode, begin, length in layout.beside:
            what = Opcode(opcode).name.lower()
            try:
                record = read_record(opcode, layout.content(begin, length))
            except Damaged as error:
                lost.append(Loss(f"the {what} at byte {begin:,} cannot be read: {error}"))
                continue
            if isinstance(record, Metadata) and record.name != RECOVERED:
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        return lost

    def _copy_messages(self, writer: Writer) -> int:
        recording = self._recording
        schemas = {0: 0} | {
            number: writer.register_schema(one.name, one.encoding, one.data)
            for number, one in sorted(recording.schemas.items())
        }
        channels = {
            number: writer.register_channel(
                one.topic, one.message_encoding, schemas.get(one.schema_id, 0), one.metadata
            )
            for number, one in sorted(recording.channels.items())
        }
        count = 0
        for content in recording.contents():
            for message in content.messages():
                channel = channels.get(message.channel)
                if channel is not None:
                    writer.add_message(channel, message.log_time, message.data, message.publish_time, message.sequence)
                    count += 1
        return count
