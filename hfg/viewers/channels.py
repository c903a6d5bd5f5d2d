"""The channels of a run for viewers: its ports, its events, which nodes are active, the log.

This part lives on the loop of the run. A channel observes its port only while a viewer has subscribed: nodes stay fused
otherwise, and nothing is kept. A token that passes is put into a short queue, whose oldest entry gives way; the thread
of the server makes messages of it, of the same form as in a recording. Depends on the recording's forms of messages.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import msgspec

from hfg.base.logs import Log
from hfg.base.token import NO_MESSAGE, Marker, Token
from hfg.engine import Run
from hfg.engine.model.tap import BatchTap, TokenTap
from hfg.recording.messages import EVENTS, ITEM, TokenWriter
from hfg.recording.recording import is_recordable, ports_of
from hfg.recording.values import CannotKeep
from hfg.recording.writing import EVENT_SCHEMA
from hfg.trace import ActivityChanged, TraceEvent
from hfg.viewers.protocol import HEAD

ACTIVITY: Final = "hfg/activity"
"""Channel of the state: which nodes are active."""

LOG: Final = "hfg/log"
"""Channel of hfg's log, in Foxglove's schema for logs."""

_LOGGER: Final = Log("hfg.viewers")
_MANY, _SOME, _NEWEST = 256, 8, 1
"""How many tokens wait for the server: numbers and texts, other values, images."""

_MOST_LETTERS: Final = 2000
_LEVELS: Final = ((logging.CRITICAL, 5), (logging.ERROR, 4), (logging.WARNING, 3), (logging.INFO, 2))
_STAMP: Final = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_TEXT: Final = {"type": "string"}


class _State(msgspec.Struct, frozen=True):
    timestamp: dict[str, int]
    state: str
    active: list[str]


class _Line(msgspec.Struct, frozen=True):
    """`foxglove.Log`."""

    timestamp: dict[str, int]
    level: int
    message: str
    name: str
    file: str
    line: int


def _schema(title: str, **properties: Any) -> bytes:
    return msgspec.json.encode({"title": title, "type": "object", "properties": {"timestamp": _STAMP, **properties}})


_STATE_SCHEMA: Final = _schema("hfg.activity", state=_TEXT, active={"type": "array", "items": _TEXT})
_LOG_SCHEMA: Final = _schema(
    "foxglove.Log", level={"type": "integer"}, message=_TEXT, name=_TEXT, file=_TEXT, line={"type": "integer"}
)


class Channel:
    """Something that can be seen. It is a `Looker` of taps.

    Attributes:
      number: of the channel; never used again.
      topic: its name: the path of a port, or one of hfg's own.
      schema_name: of its messages.
      schema: of its messages, a JSON schema.
      place: makes messages of tokens; None: what waits is a message already.
      put: called with each token.
      waiting: what has passed and when, on the run's clock; the newest few.
      passed: how much has passed while a viewer had subscribed.
      made: how many messages were made.
      is_told: the server knows that something waits.
    """

    def __init__(
        self, number: int, topic: str, kind: tuple[str, bytes], tell: Callable[[Channel], None], place: Any = None
    ) -> None:
        self.number = number
        self.topic = topic
        self.schema_name, self.schema = kind
        self.place: TokenWriter | None = place
        few = _NEWEST if place is not None and place.is_image else _SOME
        self.waiting: deque[tuple[Any, float]] = deque(maxlen=_MANY if place is None or place.keep is None else few)
        self.passed = self.made = 0
        self.is_told = False
        self.put: TokenTap = _no_token
        self._tell = tell
        self._has_failed = False

    def keep(self, what: Any, when: float) -> None:
        """Keep what passes."""
        self.passed += 1
        self.waiting.append((what, when))
        if not self.is_told:
            self.is_told = True
            self._tell(self)

    def end(self) -> None:
        """No more will pass."""

    def messages(self, encoder: msgspec.json.Encoder, *, exact: bool) -> Iterator[tuple[bytearray, float]]:
        """Take what waits: room for a head with the data of each message, and when it passed. In the server's thread.

        Args:
          encoder: makes JSON.
          exact: a token that did not pass at its stamp says so, as in a recording in virtual time.
        """
        while self.waiting:
            what, when = self.waiting.popleft()
            data = bytearray(HEAD)
            try:
                message = what if self.place is None else self.place.shown(what, when if exact else None)
                encoder.encode_into(message, data, HEAD)
            except Exception as error:  # of a user's class; a value may also change while it is read
                if not self._has_failed:
                    self._has_failed = True
                    _LOGGER.warning('viewers do not see some values of "%s": %s', self.topic, _said(error))
                continue
            self.made += 1
            yield data, when


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, CannotKeep) else f"{type(error).__name__}: {error}"


def _no_token(_token: Token[Any]) -> None:
    pass


class Channels:
    """All that can be seen of one run.

    Attributes:
      of: the channels by number.
      when_changed: called with the channels that are new and those that are gone, on the run's loop.
    """

    def __init__(self, run: Run, tell: Callable[[Channel], None]) -> None:
        self._run = run
        self._engine = run._engine
        self._tell = tell
        self._ports: dict[Any, Channel] = {}
        self._number = 0
        self._ends: dict[int, Callable[[], object]] = {}  # of the observation of each subscribed channel
        self.of: dict[int, Channel] = {}
        self.when_changed: Callable[[list[Channel], list[Channel]], None] = _nobody
        self._events = self._add(EVENTS, (EVENTS.replace("/", "."), EVENT_SCHEMA))
        self._activity = self._add(ACTIVITY, ("hfg.activity", _STATE_SCHEMA))
        self._log = self._add(LOG, ("foxglove.Log", _LOG_SCHEMA))
        self._look_for_ports()
        self._engine.callbacks.edited.append(lambda _edited: self._engine.soon(self._edited))

    def _add(self, topic: str, kind: tuple[str, bytes], place: TokenWriter | None = None) -> Channel:
        self._number += 1
        made = self.of[self._number] = Channel(self._number, topic, kind, self._tell, place)
        return made

    def _look_for_ports(self) -> tuple[list[Channel], list[Channel]]:
        """Add the ports that are new, and forget those that are gone."""
        known = ports_of(self._run)
        new = []
        for path, port in known.items():
            if port not in self._ports and is_recordable(path, port.type):
                place = TokenWriter(path, port.type, images="raw", may_pickle=False)
                channel = self._ports[port] = self._add(path, (place.schema_name, place.schema), place)
                self._tap(channel)
                new.append(channel)
        gone = [port for port in self._ports if port not in known.values()]
        return new, [self._forget(port) for port in gone]

    def _forget(self, port: Any) -> Channel:
        channel = self._ports.pop(port)
        self.wish(channel.number, wanted=False)
        del self.of[channel.number]
        return channel

    def _edited(self) -> None:
        if not self._engine.core.over:
            new, gone = self._look_for_ports()
            if new or gone:
                self.when_changed(new, gone)

    # --- observing ----------------------------------------------------------------------------------------------------

    def wish(self, number: int, *, wanted: bool) -> None:
        """Observe a channel for viewers from now on, or stop it. A second call does nothing."""
        if not wanted:
            self._ends.pop(number, _nothing)()
            channel = self.of.get(number)
            if channel is not None:
                channel.waiting.clear()
        elif number in self.of and not self._engine.core.over:
            channel = self.of[number]
            if number in self._ends:
                self._say_state()  # another viewer has come
            elif channel is self._log:
                self._ends[number] = _LogLines(channel, self._run.now).close
            elif channel.place is None:
                self._ends[number] = self._changes(channel)
            else:
                port = next(port for port, one in self._ports.items() if one is channel)
                self._ends[number] = self._run._parts.taps.look(port, channel)

    def _tap(self, channel: Channel) -> None:
        now = self._engine.now

        def put(token: Token[Any]) -> None:
            if type(token.value) is not Marker:
                channel.keep(token, now())

        channel.put = BatchTap.of(put, channel, _put_wave)

    def _changes(self, channel: Channel) -> Callable[[], object]:
        """Observe events of the run other than tokens, for which nodes stay fused."""
        take = self._state if channel is self._activity else partial(_keep_event, channel)
        listener = self._run._parts.consumers.add(take, changes_only=True)
        if channel is self._activity:
            self._say_state()
        return listener.remove

    def _state(self, event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged):
            self._say_state()

    def _say_state(self) -> None:
        workers = self._engine.core.workers
        active = [worker.path for worker in workers if worker.active and worker.node is not None]
        now = self._run.now()
        self._activity.keep(_State(_stamp(now), ", ".join(active), active), now)

    def close(self) -> None:
        """Observe nothing any more."""
        for number in list(self._ends):
            self.wish(number, wanted=False)


def _put_wave(items: tuple[Any, ...]) -> None:
    """Keep the values of a wave of a fused region; see `BatchTap`."""
    for at in range(0, len(items), ITEM):
        channel, value, stamp, sequence, when = items[at : at + ITEM]
        if value is not None and value is not NO_MESSAGE:
            channel.keep(Token(value, 0, stamp, sequence), when)


def _keep_event(channel: Channel, event: TraceEvent) -> None:
    channel.keep(event, event.time)


class _LogLines(logging.Handler):
    """Puts the lines of hfg's log into a channel, from any thread."""

    def __init__(self, channel: Channel, now: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self._channel = channel
        self._now = now
        logging.getLogger("hfg").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        level = next((number for least, number in _LEVELS if record.levelno >= least), 1)
        text, now = record.getMessage()[:_MOST_LETTERS], self._now()
        name = str(getattr(record, "path", "") or record.name)
        self._channel.keep(_Line(_stamp(now), level, text, name, record.filename, record.lineno), now)

    def close(self) -> None:
        logging.getLogger("hfg").removeHandler(self)
        super().close()


def _stamp(seconds: float) -> dict[str, int]:
    ns = max(int(seconds * 1e9), 0)
    return {"sec": ns // 10**9, "nsec": ns % 10**9}


def _nothing() -> None:
    pass


def _nobody(_new: list[Channel], _gone: list[Channel]) -> None:
    pass
