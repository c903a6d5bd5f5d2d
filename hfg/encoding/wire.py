"""Tokens as bytes, for links: the small parts of a token, and its value by its declared type.

    metadata   msgpack: kind, modifier, stamp, number
    value      msgpack; or, with arrays in it:
               length of the head, 4 bytes | head: value and descriptions of its arrays | gap | array | gap | array ...

Every array starts at a multiple of 64, in the order of the head. So offsets are never read but computed, and no array
can be outside the frame or overlap another. Everything is checked before it is used because any program may have sent
it. There is no pickle, and no class is looked up by name (rule L4). Depends on `codecs`, `arrays` and tokens.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Annotated, Any, Final, Generic, NamedTuple, TypeVar

import msgspec
import numpy as np

from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.encoding.arrays import ArrayHead, Lease, bytes_of, view_of
from hfg.encoding.carriers import Codec, Unfit
from hfg.encoding.codecs import codec_for
from hfg.errors import EncodingError

T = TypeVar("T")

Place = Callable[["np.ndarray[Any, Any]"], Lease | None]
"""Puts an array into shared memory and returns its place; None: its bytes are sent with the value."""

View = Callable[[ArrayHead], "np.ndarray[Any, Any]"]
"""Returns an array in shared memory by its lease; raises ValueError if it cannot."""

_PLAIN: Final = 0
_ARRAYS: Final = 1
_WIDE: Final = 2  # integers beyond 64 bits; can be combined with _ARRAYS
_SILENT: Final[dict[Any, int]] = {None: 4, NO_MESSAGE: 5, END: 6}
_WITHOUT_VALUE: Final = {kind: value for value, kind in _SILENT.items()}
_LENGTH: Final = struct.Struct("<I")
_ALIGNED: Final = 64
_encode: Final = msgspec.msgpack.Encoder().encode


class _Small(msgspec.Struct, array_like=True, gc=False, forbid_unknown_fields=True):
    """The small parts of a token."""

    kind: Annotated[int, msgspec.Meta(ge=0, le=6)]
    activity: Annotated[int, msgspec.Meta(ge=-1, le=1)]
    stamp: float | int
    sequence: Annotated[int, msgspec.Meta(ge=0)]


_decode_small: Final = msgspec.msgpack.Decoder(_Small).decode


class Limits(NamedTuple):
    """Limits of a value in transit; a value that exceeds one is refused before it is decoded.

    Attributes:
      size: bytes of the whole value, and of an array in shared memory.
      arrays: number of arrays in it.
    """

    size: int = 2**28
    arrays: int = 2**12


class TokenCodec(Generic[T]):
    """Converts tokens of one type to bytes, and bytes to tokens.

    Args:
      hint: the declared type of the values; None is always allowed because events may have no value (rule T2).
      what: the name of a value in messages, as in 'the value of "camera.image"'.
      limits: of every value.

    Raises:
      EncodingError: values of this type cannot be sent to another process.

    Examples:
      >>> codec = TokenCodec(dict[str, float])
      >>> metadata, value = codec.encode(Token({"x": 0.5}, 1, stamp=2.0, sequence=7))
      >>> codec.decode(metadata, value)
      Token(value={'x': 0.5}, activity=1, stamp=2.0, sequence=7)
    """

    def __init__(self, hint: Any, *, what: str = "the value", limits: Limits | None = None) -> None:
        self.hint = hint
        self.what = what
        self.limits = limits or Limits()
        codec = codec_for(hint)
        self._exact, self._lower, self._lift = codec.exact, codec.lower, codec.lift
        self._decode = msgspec.msgpack.Decoder(codec.wire).decode
        self._readers: dict[int, tuple[Codec, Callable[[Any], Any]]] = {}

    @property
    def holds_arrays(self) -> bool:
        """Whether values of the type may contain arrays, according to the type."""
        return not self._exact

    def encode(self, token: Token[T], *, place: Place | None = None) -> tuple[bytes, bytes]:
        """Return metadata and value in the form that links take.

        Args:
          token: the token to send.
          place: puts arrays into shared memory, for consumers of this host.

        Raises:
          EncodingError: the value is not of the declared type, or too large.
        """
        value: Any = token.value
        kind = _PLAIN
        try:
            if type(value) in self._exact:
                data = _encode(value)
            elif value is None or type(value) is Marker:
                kind, data = _SILENT[value], b""
            else:
                arrays: list[np.ndarray[Any, Any]] = []
                lowered = self._lower(value, arrays)
                if arrays:
                    kind, data = _ARRAYS, self._with_arrays(lowered, arrays, place)
                else:
                    data = _encode(lowered)
        except OverflowError:
            kind, data = self._of_any_size(value, place)
        except Unfit as problem:
            raise EncodingError(problem.sentence(self.what)) from None
        except UnicodeEncodeError as error:
            raise EncodingError(
                f"{self.what} cannot be sent: a string in it is not valid Unicode ({error.reason})"
            ) from None
        except RecursionError:
            raise EncodingError(f"{self.what} cannot be sent: it contains itself, or is nested too deep") from None
        if len(data) > self.limits.size:
            raise EncodingError(
                f"{self.what} cannot be sent: it has {len(data)} bytes, and at most {self.limits.size} are allowed"
            )
        return _encode((kind, token.activity, token.stamp, token.sequence)), data

    def _reader(self, kind: int) -> tuple[Codec, Callable[[Any], Any]]:
        """Return the codec for a kind of data, and its reader; few ports need more than the plain kind."""
        found = self._readers.get(kind)
        if found is None:
            codec = codec_for(self.hint, wide=bool(kind & _WIDE))
            wire: Any = codec.wire
            if kind & _ARRAYS:
                wire = tuple.__class_getitem__((wire, list[ArrayHead]))
            found = self._readers[kind] = codec, msgspec.msgpack.Decoder(wire).decode
        return found

    def _of_any_size(self, value: Any, place: Place | None) -> tuple[int, bytes]:
        arrays: list[np.ndarray[Any, Any]] = []
        lowered = self._reader(_WIDE)[0].lower(value, arrays)
        if arrays:
            return _ARRAYS | _WIDE, self._with_arrays(lowered, arrays, place)
        return _WIDE, _encode(lowered)

    def _with_arrays(self, lowered: Any, arrays: list[np.ndarray[Any, Any]], place: Place | None) -> bytes:
        if len(arrays) > self.limits.arrays:
            raise EncodingError(
                f"{self.what} cannot be sent: it has {len(arrays)} arrays in it, and at most {self.limits.arrays} are "
                "allowed; put them into one array"
            )
        size = sum(array.nbytes for array in arrays)
        if size > self.limits.size:
            raise EncodingError(
                f"{self.what} cannot be sent: its arrays have {size} bytes, and at most {self.limits.size} are allowed"
            )
        heads, inside = [], []
        for array in arrays:
            lease = None if place is None else place(array)
            heads.append(ArrayHead(array.dtype.str, array.shape, lease))
            if lease is None and array.size:
                inside.append(array)
        head = _encode((lowered, heads))
        parts: list[Any] = [_LENGTH.pack(len(head)), head]
        end = _LENGTH.size + len(head)
        for array in inside:
            parts += (bytes(-end % _ALIGNED), np.ascontiguousarray(array).reshape(-1).view(np.uint8))
            end += -end % _ALIGNED + array.nbytes
        return b"".join(parts)

    def decode(self, metadata: Any, value: Any, *, view: View | None = None) -> Token[T]:
        """Return the token; its arrays are read-only views of the value's bytes, which must no longer change.

        Args:
          metadata: the first result of `encode`, in any bytes-like object.
          value: the second result of `encode`.
          view: returns arrays in shared memory; without it, such values are refused.

        Raises:
          EncodingError: it is not a token of this type; nothing of it was used.
        """
        try:
            if len(value) > self.limits.size:
                raise ValueError(f"it has {len(value)} bytes, and at most {self.limits.size} are allowed")
            small = _decode_small(metadata)
            kind = small.kind
            found: Any
            if kind == _PLAIN:
                found = self._decode(value)
                if self._lift is not None:
                    found = self._lift(found, [])
            elif kind in _WITHOUT_VALUE:
                found = self._without_value(small, value)
            else:
                found = self._unusual(kind, memoryview(value).cast("B"), view)
            return Token(found, small.activity, small.stamp, small.sequence)
        except (ValueError, TypeError, LookupError, ArithmeticError, RecursionError) as error:
            deep = isinstance(error, RecursionError)
            reason = "it is nested too deep" if deep else str(error) or type(error).__name__
            raise EncodingError(f"{self.what} was refused on arrival: {reason:.400}") from error

    def _without_value(self, small: _Small, value: Any) -> Any:
        found = _WITHOUT_VALUE[small.kind]
        if len(value) or (found is NO_MESSAGE and small.activity):
            raise ValueError("a marker has a value, or a silence has a modifier")
        return found

    def _unusual(self, kind: int, value: memoryview, view: View | None) -> Any:
        codec, decode = self._reader(kind)
        arrays: list[Any] = []
        if kind & _ARRAYS:
            if len(value) < _LENGTH.size:
                raise ValueError(f"it is cut after {len(value)} bytes")
            end = _LENGTH.size + _LENGTH.unpack_from(value)[0]
            if end > len(value):
                raise ValueError(f"it is cut: its head ends at {end} of {len(value)} bytes")
            data, heads = decode(value[_LENGTH.size : end])
            arrays = self._arrays(heads, value, end, view)
        else:
            data = decode(value)
        return data if codec.lift is None else codec.lift(data, arrays)

    def _arrays(self, heads: list[ArrayHead], value: memoryview, begin: int, view: View | None) -> list[Any]:
        if len(heads) > self.limits.arrays:
            raise ValueError(f"it has {len(heads)} arrays, and at most {self.limits.arrays} are allowed")
        made = []
        for head in heads:
            size = bytes_of(head, self.limits.size)
            if head.lease is not None:
                if view is None:
                    raise ValueError("it has an array in shared memory, which is not open to this end")
                made.append(view(head))
                continue
            offset = begin + (-begin % _ALIGNED if size else 0)
            if offset + size > len(value):
                raise ValueError(f"it is cut: an array of {size} bytes begins at {offset} of {len(value)}")
            made.append(view_of(head, value, offset))
            begin = offset + size
        if begin != len(value):
            raise ValueError(f"{len(value) - begin} of its bytes belong to no array")
        return made
