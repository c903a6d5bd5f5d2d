"""Finds the first token that differs between two recordings, port by port.

Of the first recording only a number for each token is kept; the values of the token that differs are read again.
Depends on recordings.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import ExitStack
from hashlib import blake2b
from itertools import islice
from typing import Any, Final, NamedTuple

import msgspec

from hfg.errors import UsageError
from hfg.recording import File
from hfg.recording.messages import EVENTS, MARKERS
from hfg.recording.reading import nanoseconds_in, number_in

_MOST_TOKENS: Final = 20_000_000
_LONGEST: Final = 200
_LATEST_NS: Final = 2**63 - 1  # a forged time needs more
_OF_TIME: Final = ("timestamp", "frame_id", "time", "began", "stamp", "sequence", "activity", "port")


class Said(msgspec.Struct, frozen=True):
    """A token, as far as people want to see it.

    Attributes:
      number: on its edge.
      sent_s: when it was sent, in seconds of the run.
      stamp_s: in seconds of the run.
      activity: its modifier.
      value: as text.
    """

    number: int
    sent_s: float
    stamp_s: float
    activity: int
    value: str


class Difference(msgspec.Struct, frozen=True):
    """The first token of a port that differs.

    Attributes:
      port: the port that sent it.
      edges: that it went over, by their labels.
      turn: which token of the port it is, from 1.
      a: the token of the first side; None if it has sent none.
      b: of the second.
    """

    port: str
    edges: list[str]
    turn: int
    a: Said | None
    b: Said | None


class PortTokens(msgspec.Struct):
    """The tokens of one port.

    Attributes:
      port: its path.
      a: how many the first side has sent, markers included.
      b: the second.
      differs_at: which token differs first, from 1; None if all are equal.
    """

    port: str
    a: int = 0
    b: int = 0
    differs_at: int | None = None


class _Seen(NamedTuple):
    """A token in a recording: where it was sent, when, how many were sent before, and its message."""

    port: str
    at: int
    order: int
    message: dict[str, Any]


def compare_tokens(one: str, other: str) -> tuple[list[PortTokens], Difference | None, list[str]]:
    """Compare the tokens of two recordings.

    Returns:
      The ports that both have recorded, the first difference by time, and what is left out.
    """
    with ExitStack() as files:
        a, b = (files.enter_context(File(path)) for path in (one, other))
        ports = sorted(_ports(a) & _ports(b))
        notes = [f'"{port}" was recorded on one side only' for port in sorted(_ports(a) ^ _ports(b))]
        exact = all(file.metadata.get("hfg", {}).get("clock") == "virtual" for file in (a, b))
        if not exact:
            notes.append("times and stamps, because a run was on the real clock")
        found = _Comparing(ports, exact)
        notes += found.compare(a, b)
        first = found.first()
        if first is None:
            return list(found.ports.values()), None, notes
        port, turn = first.port, first.differs_at or 0
        difference = Difference(port, _edges(a, port), turn, _said(a, port, turn), _said(b, port, turn))
        return list(found.ports.values()), difference, notes


class _Comparing:
    def __init__(self, ports: list[str], exact: bool) -> None:
        self.ports = {port: PortTokens(port) for port in ports}
        self._exact = exact
        self._keys = {port: array("Q") for port in ports}
        self._places = {port: array("q") for port in ports}  # pairs of time and order
        self._differ_at: dict[str, tuple[int, int]] = {}  # nanoseconds of the run, order

    def compare(self, a: File, b: File) -> list[str]:
        """Read both. Return what is left out."""
        began, count = nanoseconds_in(a.began()), 0
        for seen in _tokens(a):
            one = self.ports.get(seen.port)
            if one is None:
                continue
            one.a += 1
            count += 1
            if count <= _MOST_TOKENS:
                self._keys[seen.port].append(self._key(seen, seen.at - began))
                self._places[seen.port].extend((min(seen.at - began, _LATEST_NS), seen.order))
        began = nanoseconds_in(b.began())
        for seen in _tokens(b):
            one = self.ports.get(seen.port)
            if one is not None:
                one.b += 1
                self._take(one, seen, (seen.at - began, seen.order))
        for one in self.ports.values():
            if one.differs_at is None and one.b < one.a:
                self._differs(one, one.b + 1, None)
        return [f"only the first {_MOST_TOKENS:,} tokens are compared"] if count > _MOST_TOKENS else []

    def _take(self, one: PortTokens, seen: _Seen, place: tuple[int, int]) -> None:
        if one.differs_at is not None:
            return
        keys = self._keys[one.port]
        if one.b > one.a or (one.b <= len(keys) and keys[one.b - 1] != self._key(seen, place[0])):
            self._differs(one, one.b, place)

    def _differs(self, one: PortTokens, turn: int, place: tuple[int, int] | None) -> None:
        one.differs_at = turn
        places = self._places[one.port]
        of_a = [(places[2 * turn - 2], places[2 * turn - 1])] if 2 * turn <= len(places) else []
        self._differ_at[one.port] = min([*of_a, *([] if place is None else [place])], default=(0, 0))

    def _key(self, seen: _Seen, at: int) -> int:
        """Return a number that differs if the tokens do."""
        message = seen.message
        told = {name: value for name, value in message.items() if name not in _OF_TIME}
        times = (message.get("stamp"), at) if self._exact else ()
        data = msgspec.json.encode((message.get("activity", 0), message.get("sequence", 0), times, told))
        return int.from_bytes(blake2b(data, digest_size=8).digest())

    def first(self) -> PortTokens | None:
        """Return the port whose difference comes first."""
        differing = [one for one in self.ports.values() if one.differs_at is not None]
        return min(differing, key=lambda one: (self._differ_at[one.port], one.port), default=None)


def _ports(file: File) -> set[str]:
    return {one.topic for one in file.channels.values() if one.topic not in (MARKERS, EVENTS)}


def _tokens(file: File) -> Iterator[_Seen]:
    markers, events = file.numbers_of(MARKERS), file.numbers_of(EVENTS)
    for order, (channel, at, data) in enumerate(file.messages(frozenset(file.channels) - events)):
        try:
            message = file.object_in(data)
        except UsageError:  # the losses of the file tell it
            continue
        port = message.get("port") if channel in markers else file.channels[channel].topic
        yield _Seen(str(port), at, order, message)


def _said(file: File, port: str, turn: int) -> Said | None:
    """Read a token of a port once more."""
    seen = next(islice((seen for seen in _tokens(file) if seen.port == port), turn - 1, None), None)
    if seen is None:
        return None
    message, began = seen.message, file.began()
    number = int(number_in(message.get("sequence"))) or turn  # a signal has one only on its edge
    activity = int(number_in(message.get("activity")))
    return Said(number, seen.at / 1e9 - began, number_in(message.get("stamp")) - began, activity, _text(message))


def _text(message: dict[str, Any]) -> str:
    if "marker" in message:
        return str(message["marker"])
    if "value" in message:
        text = msgspec.json.encode(message["value"]).decode()
    elif isinstance(message.get("shape"), list):
        digest = blake2b(str(message.get("data")).encode(), digest_size=4).hexdigest()
        text = f"image {'x'.join(map(str, message['shape']))}, its bytes have the sum {digest}"
    else:
        text = msgspec.json.encode({key: one for key, one in message.items() if key not in _OF_TIME}).decode()
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _edges(file: File, port: str) -> list[str]:
    """Return the edges that leave a port, as the recording lists them."""
    try:
        listed = msgspec.json.decode(file.metadata.get("hfg", {}).get("edges", "[]"), type=list[dict[str, Any]])
    except (msgspec.DecodeError, RecursionError):
        return []
    labels = [str(one.get("edge")) for one in listed]
    source = port.removesuffix(".sent")
    return [label for label in labels if label.partition(" -> ")[0] in (port, source)]
