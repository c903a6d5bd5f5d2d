"""The actions of a node, step by step, read on demand from a recording: firings, slot calls, other signals.

A recording contains tokens. Tokens of one firing have its number. If a node has one output, or the recording is of
version 1, the next token of an output starts the next firing. The signals of a firing come before its outputs.
Exceptions are recorded with the token (`recorder.Told`). Depends on `reading` and `messages`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import msgspec

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import HfgError, UsageError, in_words
from hfg.ports.automatic import sent_of
from hfg.recording.messages import EVENTS, MARKERS, TokenReader
from hfg.recording.reading import CDR, File, number_in
from hfg.recording.rosmessages import reader_of
from hfg.types import accepts, describe

_PROCESSED = "processed"
_MOST_LOST: Final = 100_000  # firings; larger numbers are not trusted because a file can contain any number
_MOST_LOST_IN_ALL: Final = 1_000_000


class Record(msgspec.Struct):
    """One token of a recording.

    Attributes:
      port: the port that sent it.
      when: the time, in seconds of the recording's clock.
      token: the token.
      told: other facts about how it was sent, see `recorder.Told`.
    """

    port: str
    when: float
    token: Token[Any]
    told: Mapping[str, Any]


class Step(msgspec.Struct):
    """A firing, a slot call, or signals outside both.

    Attributes:
      began: when it starts.
      when: when it is over.
      signals: signals that it triggers.
      fires: it is a firing.
      sent: tokens of its outputs, by recorded port.
      ends: the node ends with it.
      last: its tokens were written by `end()`.
      silent: the process function was not run.
      waits: it ends later than it starts, even if at the same moment.
      call: number of the slot call; 0: it is not one.
      told: `processed` has reported it.
      number: of the firing, according to its tokens; 0: they have none.

    Methods named `take_` return whether a record belongs to the step. If it does, they add it.
    """

    began: float
    when: float
    signals: list[Record] = []
    fires: bool = False
    sent: dict[str, Token[Any]] = {}
    ends: bool = False
    last: bool = False
    silent: bool = False
    waits: bool = False
    call: int = 0
    told: bool = False
    number: int = 0

    @property
    def _is_last_word(self) -> bool:
        return self.ends or self.last

    def take_the_end(self) -> bool:
        """The end of the node was reported."""
        self.ends = self._is_last_word
        return self.ends

    def take_signal(self, record: Record) -> bool:
        """An event was triggered."""
        if not self.call or record.told.get("call") != self.call:
            return False
        self.signals.append(record)
        return True

    def take_sent(self, record: Record) -> bool:
        """An event shows what an output has sent; the outputs of a firing leave before that."""
        if not self.fires or self.told:
            return False
        self.sent[record.port] = record.token
        return True

    def take_processed(self) -> bool:
        """An event shows that a firing is over."""
        if not self.sent or self.told or self._is_last_word:
            return False
        self.told = True
        return True

    def take_output(self, record: Record, *, at_once: bool) -> bool:
        """An output has sent a token; `at_once`: tokens of one firing have the same time."""
        if not self.fires or self.told:
            return False
        if record.token.value is END and self._is_last_word:
            if record.told.get("waited"):
                self.when, self.waits = record.when, True
            self.ends = True
            return True
        if record.port in self.sent or record.told.get("firing", 0) != self.number or self.ends:
            return False
        if at_once and record.when != self.when:
            return False
        self.sent[record.port] = record.token
        return True


class Track:
    """The steps of one node, for playback."""

    def __init__(self, file: File, ports: Mapping[str, Any], *, may_pickle: bool) -> None:
        """Choose the ports to play.

        Args:
          file: the recording.
          ports: paths of recorded ports, and the type of the port that plays each.
          may_pickle: whether pickled values are read.
        """
        self._file = file
        self.began = file.began()
        self.exact = file.metadata.get("hfg", {}).get("clock") == "virtual"
        self._readers: dict[int, tuple[Any, TokenReader, Any]] = {}
        self._markers = file.numbers_of(MARKERS)
        self._events = file.numbers_of(EVENTS)
        self._kinds: dict[str, str] = {}  # "output", "sent", "processed", "event" by port
        self._node = ""
        self._lost = 0  # firings that were put in for those that a damaged file has lost
        self.of_source = False
        for number, channel in file.channels.items():
            if channel.topic in ports:
                schema = file.schemas.get(channel.schema_id)
                hint = ports[channel.topic]
                reader = reader_of(channel, schema, hint, may_pickle=may_pickle)
                self._readers[number] = (channel, reader, hint)
                self._kinds[channel.topic] = _kind(channel.metadata)
                self._node = channel.metadata.get("node", "")
                self.of_source = channel.metadata.get("source") == "true" or channel.message_encoding == CDR
        kinds = set(self._kinds.values())
        self._closes = bool(kinds & {"output", _PROCESSED})  # the ports include one that shows when a firing is over
        self._has_outputs = "output" in kinds

    def firings(self) -> Iterator[Step]:
        """Yield the firings. Firings that a damaged file has lost are silent, as far as their numbers show them.

        So later tokens meet the same tokens in a join as before.
        """
        last: Step | None = None
        self._lost = 0
        for step in self._steps():
            if step.fires:
                yield from self._lost_between(last, step)
                last = step if step.number else None
                yield step

    def _lost_between(self, last: Step | None, step: Step) -> Iterator[Step]:
        """Yield the lost firings between two firings, or before the first one, evenly spaced in time."""
        before, began = (last.number, last.when) if last is not None else (0, self.began)
        lost = step.number - before - 1
        if not 1 <= lost <= min(_MOST_LOST, _MOST_LOST_IN_ALL - self._lost) or not self._file.losses_met():
            return
        self._lost += lost
        for number in range(1, lost + 1):
            when = min(began + (step.began - began) * number / (lost + 1), step.began)
            yield Step(when, when, fires=True, number=before + number)

    def others(self) -> Iterator[Step]:
        """Yield the other steps: slot calls, and signals outside them."""
        if not {"event"} & set(self._kinds.values()):
            return iter(())
        return (step for step in self._steps() if not step.fires)

    def _steps(self) -> Iterator[Step]:
        signals: list[Record] = []  # of the firing in progress
        sent: dict[str, Token[Any]] = {}  # tokens of its outputs that are known only from events
        step: Step | None = None  # the step being read
        before = self.began
        for record in self._records():
            kind = "end" if not record.port else self._kinds[record.port]
            if step is not None and self._goes_on(step, kind, record, amid=bool(signals)):
                continue
            if step is not None:
                yield step
                before, step = step.when, None
            told = record.told
            if kind == "sent":
                sent[record.port] = record.token
            elif kind == "event" and (told.get("call") or told.get("beside") or not self._closes):
                step = Step(record.when, record.when, [record], call=told.get("call", 0))
            elif kind == "event":
                signals.append(record)
            else:
                step = self._firing(kind, record, before, signals, sent)
                signals, sent = [], {}
        if step is not None:
            yield step
        for record in signals:  # the recording ended before the firing
            yield Step(record.when, record.when, [record])

    def _goes_on(self, step: Step, kind: str, record: Record, *, amid: bool) -> bool:
        """Return whether a record belongs to the step being read, and add it if it does."""
        if kind == "end":
            return step.take_the_end()
        if kind == "event":
            return step.take_signal(record)
        if amid:
            return False
        if kind == "output":
            return step.take_output(record, at_once=self.exact)
        return self._has_outputs and (step.take_sent(record) if kind == "sent" else step.take_processed())

    def _firing(
        self, kind: str, record: Record, before: float, signals: list[Record], sent: dict[str, Token[Any]]
    ) -> Step:
        """Return the step of a firing that is complete with this record."""
        token, told = record.token, record.told
        when = record.when
        if kind == "end":
            return Step(before if before < when else when, when, signals, True, sent, ends=True, waits=before < when)
        ends = token.value is END
        if kind == "output" and not ends:
            sent[record.port] = token
        told_of = kind == _PROCESSED
        began = when
        if self.of_source:
            began = min(told.get("began", token.stamp), when)
        waits = (began < when and not ends) or bool(told.get("waited"))
        return Step(
            began,
            when if waits or not ends or not self.of_source else began,
            signals,
            True,
            sent,
            ends=ends,
            last=bool(told.get("last")),
            silent=bool(told.get("silent")),
            told=told_of,
            waits=waits,
            number=told.get("firing", 0),
        )

    def _records(self) -> Iterator[Record]:
        wanted = frozenset(self._readers) | self._markers
        if _PROCESSED in self._kinds.values():  # it is also possible that no consumer took the END
            wanted |= self._events
        node = self._node
        for number, ns, data in self._file.messages(wanted):
            known = self._readers.get(number)
            message = self._file.object_in(data) if known is None else known[1].fields(data, ns, self._file.object_in)
            if number in self._events:
                if message.get("type") == "NodeEnded" and message.get("node") == node:
                    yield Record("", number_in(message.get("time")), _END, {})
                continue
            if not _is_sound(message):
                raise UsageError(f"{self._file.path} is damaged: a message in it is not a token ({data[:80]!r})")
            if number in self._markers:
                if message.get("port") in self._kinds:
                    marker = END if message.get("marker") == "END" else NO_MESSAGE
                    token: Token[Any] = Token(marker, message.get("activity", 0), message["stamp"])
                    yield Record(message["port"], self._when(ns, message), token, message)
                continue
            channel, reader, hint = self._readers[number]
            try:
                token = reader.token(message)
            except Exception as error:  # the data may make numpy, OpenCV or a user's class raise anything
                raise UsageError(
                    f'a value of "{channel.topic}" in {self._file.path} cannot be read as {describe(hint)}: '
                    f"{error if isinstance(error, HfgError) else in_words(error)}"
                ) from None
            is_event = channel.metadata.get("kind") == "event"
            if not accepts(token.value, hint) and not (token.value is None and is_event):
                raise UsageError(
                    f'"{channel.topic}" in {self._file.path} has the value {token.value!r:.80}, which is not '
                    f"{describe(hint)}, the current type of the port: record again, or map it to another port"
                )
            yield Record(channel.topic, self._when(ns, message), token, message)

    def _when(self, ns: int, message: dict[str, Any]) -> float:
        if not self.exact:
            return ns / 1e9
        passed = message.get("time")
        return float(message["stamp"] if passed is None else passed)


_END: Token[Any] = Token(END)


_NUMBERS: Final = (int, float)


def _is_sound(message: dict[str, Any]) -> bool:
    """Return whether a token's data is complete and has the right types."""
    return (
        isinstance(message.get("stamp"), _NUMBERS)
        and message.get("activity", 0) in (-1, 0, 1)
        and all(isinstance(message.get(name) or 0, _NUMBERS) for name in ("sequence", "call", "time", "began"))
        and isinstance(message.get("firing", 0), int)
        and isinstance(message.get("port", ""), str)
    )


def _kind(about: Mapping[str, str]) -> str:
    if about.get("kind") != "event":
        return "output"
    port = about.get("port", "")
    if about.get("source") == "true":
        if port == _PROCESSED:
            return _PROCESSED
        if sent_of(port) is not None:
            return "sent"
    return "event"


def recorded_ports(file: File) -> dict[str, Any]:
    """Return the channels of ports, by path."""
    return {one.topic: one for one in file.channels.values() if one.topic not in (MARKERS, EVENTS)}
