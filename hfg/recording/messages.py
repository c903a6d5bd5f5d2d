"""The form of tokens in a file: one kind of message for each kind of port. Depends on `schemas` and `values`.

Markers are not values and have a channel of their own, so that a channel contains only values, which other programs can
plot. Events of the graph itself have a separate channel, too.
"""

from __future__ import annotations

import base64
from collections.abc import Callable
from math import isfinite
from typing import Any, Final, Literal

import msgspec
import numpy as np

from hfg.base.token import Token
from hfg.encoding.pictures import need_fair_size
from hfg.errors import UsageError
from hfg.recording import foxglove, schemas
from hfg.recording.forms import is_plain
from hfg.recording.values import CannotKeep, Codec, sound
from hfg.trace import TraceEvent
from hfg.types import describe, describe_value

ITEM: Final = 5
"""Entries per token in the writer's queue, one flat list, which gives the garbage collector nothing to look at.

They are: the place (a `TokenWriter`; None: an event of the run itself), the token or event, its stamp, its number on
its edge, and when it passed, on the run's clock. What passes in a wave of a fused region is not a token but a value
(None: NO_MESSAGE), for which stamp and number count; otherwise these two have no meaning."""


MARKERS: Final = "hfg/markers"
"""Channel of markers: silence and the ends of streams."""

EVENTS: Final = "hfg/events"
"""Channel of events of a run other than tokens: activity, parameters, structure, errors."""

Images = Literal["raw", "png", "jpeg"]

_TOLD: Final = ("began", "call", "beside", "silent", "last", "waited", "refused")


class Told(Token[Any], frozen=True):
    """A token that was not sent as most are, at the end of a firing that started at its stamp.

    A player of the node has to send it in the same way.
    """

    began: float | None = None  # when the firing started, if its stamp does not show it
    call: int = 0  # the number of the slot call in which it was triggered; 0: in none
    beside: bool = False  # it was triggered in no firing and no call
    silent: bool = False  # the function was not run in this firing
    last: bool = False  # `end()` has written or triggered it
    waited: bool = False  # the firing waited, though no time passed
    refused: bool = False  # it replaces a value that cannot be recorded, so that firings stay aligned


class TokensLeftOut(TraceEvent, frozen=True):
    """There was no room for the tokens that passed here."""


class Firings:
    """Numbers the firings of a node that has several outputs, so that each is played back as one firing.

    A firing puts one token on each live output (F3), and which are live changes only with the structure of the graph.
    So a firing is over when one of its outputs sends again, or when the structure has changed.
    """

    def __init__(self) -> None:
        self._number = 0
        self._sent: set[str] = set()
        self.end()

    def end(self) -> None:
        """Start the next firing with the next token."""
        self._number += bool(self._sent) or not self._number
        self._sent.clear()

    def number(self, path: str) -> int:
        """Return the number of the firing in which an output sends its next token, from 1."""
        if path in self._sent:
            self.end()
        self._sent.add(path)
        return self._number


class _Circumstances(msgspec.Struct, omit_defaults=True, kw_only=True):
    """How a token was sent, as far as the token itself does not show it; see `recorder.Told`.

    Attributes:
      firing: number of the firing among those of its node; 0: the node has one output, so each token is a firing.
      refused: the value could not be recorded; silence takes its place.
    """

    time: float | None = None
    began: float | None = None
    call: int = 0
    beside: bool = False
    silent: bool = False
    last: bool = False
    waited: bool = False
    firing: int = 0
    refused: bool = False


class Marked(_Circumstances, omit_defaults=True):
    """A marker that was sent by a port."""

    port: str
    marker: str
    stamp: float
    activity: int = 0
    sequence: int = 0


class Timed(_Circumstances):
    """A token that was sent at a time other than its stamp, in virtual time, which is exact."""

    value: Any
    activity: int
    stamp: float
    sequence: int


class PlainToken(msgspec.Struct, gc=False):
    """A token with a number, as in the file. There are many, so it is not tracked by the garbage collector."""

    value: float
    activity: int
    stamp: float
    sequence: int


class _Time(msgspec.Struct):
    sec: int
    nsec: int


class _Raw(_Circumstances, omit_defaults=True):
    timestamp: _Time
    frame_id: str
    width: int
    height: int
    encoding: str
    step: int
    data: Any
    dtype: str
    shape: tuple[int, ...]
    stamp: float
    activity: int = 0
    sequence: int = 0


class _Compressed(_Circumstances, omit_defaults=True):
    timestamp: _Time
    frame_id: str
    data: Any
    format: str
    shape: tuple[int, ...]
    stamp: float
    activity: int = 0
    sequence: int = 0


def circumstances(token: Token[Any], time: float | None, firing: int) -> dict[str, Any]:
    """Return the recorded circumstances of a token; `time`: when it was sent, if that is to be written."""
    found: dict[str, Any] = {"firing": firing} if time is None else {"time": time, "firing": firing}
    if type(token) is Told:
        found |= {name: getattr(token, name) for name in _TOLD}
    return found


class TokenWriter:
    """Makes messages from the tokens of one port.

    Attributes:
      keep: returns an immutable copy of a value and its size, on the loop of the run; None: values are immutable
        anyway.
      metadata: of its channel.
      channel: its number in the file; 0 before the first value.
      values: number of values written.
      markers: number of markers written.
      left_out: number of tokens skipped for lack of time.
      refused: number of values that are not data.
      firings: numbers the firings of its node; None: the port is the node's only output, or not an output.
      schema_name: of its channel.
      schema: of its channel.
    """

    def __init__(self, path: str, hint: Any, *, images: Images, may_pickle: bool) -> None:
        self.path = path
        self.channel = 0
        self.values = 0
        self.markers = 0
        self.left_out = 0
        self.refused = 0
        self.firings: Firings | None = None
        self.images = images
        self.is_image = schemas.is_image(hint)
        self._shown = foxglove.shown(hint)
        codec = Codec(hint, may_pickle=may_pickle)
        self.keep: Callable[[Any], tuple[Any, int]] | None = None
        self.metadata: dict[str, str] = {}
        if self.is_image:
            self.keep = self._keep_image
            self.schema_name = "foxglove.RawImage" if images == "raw" else "foxglove.CompressedImage"
            schema = schemas.RAW_IMAGE if images == "raw" else schemas.COMPRESSED_IMAGE
            self.schema = msgspec.json.encode(schema)
        elif self._shown is not None:
            self.keep = self._keep_shown
            self.schema_name = self._shown.name
            self.schema = self._shown.schema(schemas.value_schema(hint), schemas.TOKEN)
        else:
            if not is_plain(hint):
                self.keep = self._keep
            self.schema_name = f"hfg.{describe(hint)}"
            self.schema = schemas.message_schema(hint)
        self._codec = codec

    def _keep(self, value: Any) -> tuple[Any, int]:
        codec = self._codec
        before = codec.bytes_kept
        return codec.encode(value), codec.bytes_kept - before

    def _keep_shown(self, value: Any) -> tuple[Any, int]:
        kept, size = self._keep(value)
        try:
            fields = self._shown.fields(value) if self._shown is not None else {}
        except (AttributeError, TypeError):  # a value of another type than the port's: only hfg can read it
            fields = {}
        return {**fields, "value": kept}, 2 * size

    def _keep_image(self, value: Any) -> tuple[np.ndarray[Any, Any], int]:
        _need_image(value)
        return np.array(value, order="C", copy=True), value.nbytes

    def shown(self, token: Token[Any], time: float | None) -> Any:
        """Return the data to encode of a token whose value is not a copy; like `message`.

        Raises:
          CannotKeep: the value is not data.
        """
        if self.is_image:
            _need_image(token.value)
        elif self.keep is not None:
            token = msgspec.structs.replace(token, value=self.keep(token.value)[0])
        return self.message(token, time)

    def message(self, token: Token[Any], time: float | None, firing: int = 0) -> Any:
        """Return the data to encode; `time`: when the token was sent, if that is to be written."""
        if self.is_image:
            return self._image(token, time, firing)
        if self._shown is not None:
            told = circumstances(token, time, firing).items()
            rest = {name: one for name, one in told if one or (one is not None and name in ("time", "began"))}
            said = {"stamp": token.stamp, "activity": token.activity, "sequence": token.sequence}
            return {**token.value, **said, **rest}
        value = token.value
        kind = type(value)
        if self.keep is None and (kind is str or (kind is float and not isfinite(value))):
            value = self._codec.encode(value)
            token = msgspec.structs.replace(token, value=value)
        if time is None and not firing and type(token) is Token:
            return token
        return Timed(value, token.activity, token.stamp, token.sequence, **circumstances(token, time, firing))

    def _image(self, token: Token[Any], time: float | None, firing: int) -> Any:
        value = token.value
        height, width = value.shape[:2]
        seconds = max(token.stamp, 0.0)
        stamp = _Time(int(seconds), min(int((seconds % 1.0) * 1e9), 999_999_999))
        rest: dict[str, Any] = {
            "shape": value.shape,
            "stamp": token.stamp,
            "activity": token.activity,
            "sequence": token.sequence,
            **circumstances(token, time, firing),
        }
        if self.images == "raw":
            step = value.nbytes // height if height else 0
            encoding = schemas.encoding_of(value) or ""
            return _Raw(stamp, "", width, height, encoding, step, _bytes_of(value), value.dtype.str, **rest)
        return _Compressed(stamp, "", _compress(value, self.images), self.images, **rest)


class TokenReader:
    """Makes tokens from the messages of one channel."""

    def __init__(self, schema_name: str, hint: Any, *, may_pickle: bool) -> None:
        self._schema_name = schema_name
        self._codec = Codec(hint, may_pickle=may_pickle)

    def fields(self, data: bytes, ns: int, plain: Callable[[bytes], Any]) -> Any:
        """Return the fields of a message that was written at a time in nanoseconds; `plain` reads JSON."""
        return plain(data)

    def token(self, message: dict[str, Any]) -> Token[Any]:
        """Return the token of a message.

        Raises:
          CannotKeep: the value cannot be read here.
        """
        if self._schema_name == "foxglove.RawImage":
            data = base64.b64decode(message["data"])
            value: Any = sound(np.frombuffer(bytearray(data), message["dtype"]).reshape(message["shape"]))
        elif self._schema_name == "foxglove.CompressedImage":
            value = _decompress(message["data"], message["shape"])
        else:
            value = self._codec.decode(message["value"])
        return Token(value, message.get("activity", 0), message["stamp"], message.get("sequence", 0))


def _need_image(value: Any) -> None:
    if not isinstance(value, np.ndarray) or schemas.encoding_of(value) is None:
        raise CannotKeep(f"{describe_value(value)} is not an image")


def _bytes_of(value: np.ndarray[Any, Any]) -> Any:
    """Return the content of an array in C order, without a copy if it lies so in memory."""
    return value.reshape(-1).view(np.uint8).data if value.flags.c_contiguous and value.size else value.tobytes()


def _compress(value: np.ndarray[Any, Any], how: Images) -> bytes:
    cv2 = _opencv()
    done, data = cv2.imencode(f".{how}", value)
    if not done:
        raise CannotKeep(f"an image of {value.dtype} cannot be written as {how}")
    return bytes(data)


def _decompress(data: str, shape: list[int]) -> np.ndarray[Any, Any]:
    cv2 = _opencv()
    packed = base64.b64decode(data)
    need_fair_size(packed, "the picture")
    value: Any = cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_UNCHANGED)
    if value is None:
        raise CannotKeep("it is not a picture that OpenCV can read, or it is incomplete")
    decoded: np.ndarray[Any, Any] = value.reshape(shape)
    return decoded


def _opencv() -> Any:
    try:
        import cv2
    except ImportError:
        raise UsageError('compressed images in recordings need OpenCV: pip install "hfg[vision]"') from None
    return cv2
