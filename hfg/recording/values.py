"""Values as JSON and back, bit for bit: the result is equal, of the same types, and a new object.

A pair of functions is made for each type of a port. Values that are exactly of the type are written plainly, a struct
as an object of its fields, a tuple as a list, so that other programs can read them. Other values (an integer where the
type is float, a value that is not a number) are written together with their type, `{"$type": "tuple", "value": [1,
2]}`. The encoded data shares nothing with the value, which may change afterwards. Data that is read is never executed,
except pickles if the user has allowed them. Depends on `forms` and numpy.
"""

from __future__ import annotations

import base64
import datetime
import decimal
import enum
import pathlib
import pickle
import struct
import uuid
from collections import deque
from collections.abc import Callable
from math import isfinite
from typing import Any, Final

import msgspec
import numpy as np

from hfg.encoding.arrays import unsafe_content
from hfg.encoding.plain import need_spread
from hfg.encoding.records import imported
from hfg.errors import HfgError
from hfg.recording.forms import bare, fields_of, form_of, reference

_TAG: Final = "$type"
_HASHED: Final = ("set", "frozenset")
_NONE: Final = type(None)


class CannotKeep(HfgError):
    """A value that cannot be recorded."""


def array_fields(value: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Return the parts of an array, as data of its own."""
    if value.dtype.hasobject:
        raise CannotKeep("an array of objects has no fixed bytes")
    descr: Any = value.dtype.str if value.dtype.fields is None else np.lib.format.dtype_to_descr(value.dtype)
    return {"dtype": descr, "shape": list(value.shape), "data": value.tobytes()}


def _array(fields: Any) -> np.ndarray[Any, Any]:
    descr = fields["dtype"]
    dtype = np.dtype(descr) if isinstance(descr, str) else np.lib.format.descr_to_dtype(_as_tuples(descr))
    return sound(np.frombuffer(bytearray(base64.b64decode(fields["data"])), dtype).reshape(fields["shape"]))


def sound(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return an array whose bytes numpy takes for what they are.

    Raises:
      CannotKeep: it does not.
    """
    problem = unsafe_content(array)
    if problem is not None:
        raise CannotKeep(problem)
    return array


def _as_tuples(descr: Any) -> Any:
    if isinstance(descr, str):
        return descr
    return [
        tuple(_as_tuples(one) if number == 1 else _shape(one) for number, one in enumerate(field)) for field in descr
    ]


def _shape(one: Any) -> Any:
    return tuple(one) if isinstance(one, list) else one


Encode = Callable[[Any], Any]


class Codec:
    """Writes and reads values of one type.

    Attributes:
      encode: converts a value to JSON data and bytes.
      decode: converts the data back.
      bytes_kept: total size of all arrays and bytes written.
    """

    def __init__(self, hint: Any, *, may_pickle: bool = False) -> None:
        self.bytes_kept = 0
        self._may_pickle = may_pickle
        self._classes: dict[str, type] = {}
        self._encoders: dict[Any, Encode] = {}
        self._decoders: dict[Any, Encode] = {}
        self.encode = self._encoder(hint)
        self.decode = self._decoder(hint)

    # --- writing ------------------------------------------------------------------------------------------------------

    def _encoder(self, hint: Any) -> Encode:
        hint = bare(hint)
        try:
            made = self._encoders.get(hint)
        except TypeError:  # a part of it is unhashable
            return self._any
        if made is None:
            self._encoders[hint] = lambda value: self._encoders[hint](value)  # for recursive types
            made = self._encoders[hint] = self._make_encoder(hint)
        return made

    def _make_encoder(self, hint: Any) -> Encode:
        exactly = self._any
        form = form_of(hint)
        match form.kind:
            case "optional":
                inner = self._encoder(form.of)
                return lambda value: None if value is None else inner(value)
            case "fields":
                return self._of_fields(hint, form.of)
            case "enum":
                self._classes[reference(hint)] = hint
                return lambda value: value.name if type(value) is hint and value.name else self._apart(value, str)
            case "bytes":
                return lambda value: value if type(value) is bytes else self._apart(value, str)
            case "list":
                item = self._encoder(form.of)
                return lambda value: [item(one) for one in value] if type(value) is list else exactly(value)
            case "tuple":
                return self._of_tuples(form.of)
            case "dict":
                return self._of_dicts(form.of)
            case "array":
                return lambda value: self._array(value) if type(value) is np.ndarray else self._apart(value, dict)
        return exactly

    def _of_fields(self, hint: Any, fields: dict[str, Any]) -> Encode:
        self._classes[reference(hint)] = hint
        parts = [(name, self._encoder(one)) for name, one in fields.items()]

        def of_fields(value: Any) -> Any:
            if type(value) is not hint:
                return self._apart(value, dict)
            return {name: encode(getattr(value, name)) for name, encode in parts}

        return of_fields

    def _of_dicts(self, values: Any) -> Encode:
        item = self._encoder(values)

        def of_dicts(value: Any) -> Any:
            if type(value) is not dict or not _has_names(value):
                return self._any(value)
            return {key: item(one) for key, one in value.items()}

        return of_dicts

    def _of_tuples(self, arguments: tuple[Any, ...]) -> Encode:
        items, rest = _tuple_items(arguments)
        encoders, of_rest = [self._encoder(one) for one in items], self._encoder(rest)

        def of_tuples(value: Any) -> Any:
            if type(value) is not tuple or (items and len(value) != len(items)):
                return self._apart(value, list)
            if items:
                return [encode(one) for encode, one in zip(encoders, value, strict=True)]
            return [of_rest(one) for one in value]

        return of_tuples

    def _apart(self, value: Any, kind: Any) -> Any:
        """Write a value together with its type, if it could be mistaken for a value of the declared type."""
        if type(value) is not kind:
            return self._any(value)
        if kind is str:
            return {_TAG: "str", "value": _text(value)}
        if kind is list:
            return {_TAG: "list", "value": [self._any(one) for one in value]}
        return {_TAG: "dict", "value": [[self._any(key), self._any(one)] for key, one in value.items()]}

    def _any(self, value: Any) -> Any:
        kind = type(value)
        if kind is str:
            return _text(value)
        if kind is float:
            return value if isfinite(value) else {_TAG: "float", "value": struct.pack(">d", value).hex()}
        if kind in (int, bool, _NONE):
            return value
        if kind is list:
            return [self._any(one) for one in value]
        if kind is dict:
            if not _has_names(value):
                return self._apart(value, dict)
            return {key: self._any(one) for key, one in value.items()}
        if kind is np.ndarray:
            return {_TAG: "array", **self._array(value)}
        known = _KINDS.get(kind)
        if known is not None:
            name, write, _ = known
            if kind in (bytes, bytearray):
                self.bytes_kept += len(value)
            plain = write(value)
            return {_TAG: name, "value": [self._any(one) for one in plain] if type(plain) is list else plain}
        return self._of_class(value, kind)

    def _array(self, value: np.ndarray[Any, Any]) -> dict[str, Any]:
        self.bytes_kept += value.nbytes
        return array_fields(value)

    def _of_class(self, value: Any, kind: Any) -> Any:
        if isinstance(value, np.generic) and not value.dtype.hasobject and value.dtype.fields is None:
            return {_TAG: "number", "dtype": value.dtype.str, "data": value.tobytes()}
        if isinstance(value, pathlib.PurePath):
            return {_TAG: "path", "value": _text(str(value))}
        if _is_found(kind):
            if isinstance(value, enum.Enum) and value.name:
                return {_TAG: "enum", "class": reference(kind), "name": value.name}
            fields = fields_of(kind)
            if fields is not None:
                parts = {name: self._any(getattr(value, name)) for name in fields}
                return {_TAG: "object", "class": reference(kind), "fields": parts}
        if not self._may_pickle:
            raise CannotKeep(f"{kind.__module__}.{kind.__qualname__} is not data that JSON can hold")
        try:
            return {_TAG: "pickle", "data": pickle.dumps(value)}
        except Exception as error:
            raise CannotKeep(f"{kind.__qualname__} cannot be pickled: {error}") from error

    # --- reading ------------------------------------------------------------------------------------------------------

    def _decoder(self, hint: Any) -> Encode:
        hint = bare(hint)
        try:
            made = self._decoders.get(hint)
        except TypeError:
            return self._revived
        if made is None:
            self._decoders[hint] = lambda data: self._decoders[hint](data)
            made = self._decoders[hint] = self._make_decoder(hint)
        return made

    def _make_decoder(self, hint: Any) -> Encode:
        revived = self._revived
        form = form_of(hint)
        match form.kind:
            case "optional":
                inner = self._decoder(form.of)
                return lambda data: None if data is None else inner(data)
            case "fields":
                parts = {name: self._decoder(one) for name, one in form.of.items()}
                return self._unless_tagged(
                    lambda data: _made(hint, {name: decode(data[name]) for name, decode in parts.items()})
                )
            case "enum":
                return lambda data: hint[data] if type(data) is str else revived(data)
            case "bytes":
                return lambda data: base64.b64decode(data) if type(data) is str else revived(data)
            case "list":
                item = self._decoder(form.of)
                return lambda data: [item(one) for one in data] if type(data) is list else revived(data)
            case "tuple":
                return self._to_tuples(form.of)
            case "dict":
                item = self._decoder(form.of)
                return self._unless_tagged(lambda data: {key: item(one) for key, one in data.items()})
            case "array":
                return self._unless_tagged(_array)
        return revived

    def _unless_tagged(self, decode: Encode) -> Encode:
        """Return a decoder of objects that first handles values with a type of their own."""
        revived = self._revived
        return lambda data: decode(data) if type(data) is dict and _TAG not in data else revived(data)

    def _to_tuples(self, arguments: tuple[Any, ...]) -> Encode:
        items, rest = _tuple_items(arguments)
        decoders, of_rest = [self._decoder(one) for one in items], self._decoder(rest)

        def to_tuples(data: Any) -> Any:
            if type(data) is not list:
                return self._revived(data)
            if items:
                return tuple(decode(one) for decode, one in zip(decoders, data, strict=True))
            return tuple(map(of_rest, data))

        return to_tuples

    def _revived(self, data: Any) -> Any:
        kind = type(data)
        if kind is list:
            return [self._revived(one) for one in data]
        if kind is not dict:
            return data
        name = data.get(_TAG)
        if name is None:
            return {key: self._revived(one) for key, one in data.items()}
        match name:
            case "str":
                return data["value"]
            case "float":
                return struct.unpack(">d", bytes.fromhex(data["value"]))[0]
            case "list":
                return [self._revived(one) for one in data["value"]]
            case "dict":
                pairs = [(self._revived(key), self._revived(one)) for key, one in data["value"]]
                need_spread([key for key, _ in pairs])
                return dict(pairs)
            case "array":
                return _array(data)
            case "number":
                return sound(np.frombuffer(base64.b64decode(data["data"]), data["dtype"]))[0]
            case "path":
                return pathlib.Path(data["value"])
            case "enum":
                return self._class(data["class"], "enum")[data["name"]]  # type: ignore[index]
            case "object":
                fields = {key: self._revived(one) for key, one in data["fields"].items()}
                return _made(self._class(data["class"], "fields"), fields)
            case "pickle":
                return self._unpickled(data)
        read = _READ.get(name)
        if read is None:
            raise CannotKeep(f'values of kind "{name}" are unknown here: was it recorded with a newer hfg?')
        plain = data["value"]
        members = [self._revived(one) for one in plain] if type(plain) is list else plain
        if name in _HASHED:
            need_spread(members)
        return read(members)

    def _unpickled(self, data: Any) -> Any:
        if not self._may_pickle:
            raise CannotKeep("it is pickled, and reading it runs code: allow it with pickle=True if you trust the file")
        return pickle.loads(base64.b64decode(data["data"]))

    def _class(self, name: str, form: str) -> type:
        """Return a data class that is already imported, never another one.

        An object of any class could run code when it is deleted.
        """
        found = self._classes.get(name) or imported(name)
        if not isinstance(found, type):
            raise CannotKeep(f"its type {name} is unknown here: import the module that has it first")
        if form_of(found).kind != form or hasattr(found, "__del__"):
            raise CannotKeep(f"its type {name} is not data: only structs, dataclasses, named tuples and enums are")
        return found


def _made(kind: Any, fields: dict[str, Any]) -> Any:
    """Make an object from its fields, as it was; a dataclass without running its own initialisation."""
    if issubclass(kind, tuple):
        return tuple.__new__(kind, fields.values())
    if issubclass(kind, msgspec.Struct):
        return kind(**fields)
    made = object.__new__(kind)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made


def _tuple_items(arguments: tuple[Any, ...]) -> tuple[tuple[Any, ...], Any]:
    if not arguments:
        return (), Any
    return ((), arguments[0]) if arguments[-1] is Ellipsis else (arguments, Any)


def _has_names(value: dict[Any, Any]) -> bool:
    """Return whether all keys can be names in JSON, and none of them is the type key."""
    return _TAG not in value and all(type(key) is str and type(_text(key)) is str for key in value)


def _text(value: str) -> Any:
    try:
        value.encode()
    except UnicodeEncodeError:  # a lone surrogate, which JSON cannot hold
        return {_TAG: "text", "value": value.encode("utf-16-le", "surrogatepass").hex()}
    return value


def _is_found(kind: Any) -> bool:
    return imported(reference(kind)) is kind


def _base64(value: bytes | bytearray) -> bytes:
    return bytes(value)


_KINDS: Final[dict[Any, tuple[str, Callable[[Any], Any], Callable[[Any], Any]]]] = {
    tuple: ("tuple", list, tuple),
    set: ("set", list, set),
    frozenset: ("frozenset", list, frozenset),
    deque: ("deque", list, deque),
    bytes: ("bytes", _base64, base64.b64decode),
    bytearray: ("bytearray", _base64, lambda data: bytearray(base64.b64decode(data))),
    complex: (
        "complex",
        lambda value: struct.pack(">dd", value.real, value.imag).hex(),
        lambda data: complex(*struct.unpack(">dd", bytes.fromhex(data))),
    ),
    datetime.datetime: (
        "datetime",
        lambda value: f"{value.fold}{value.isoformat()}",
        lambda data: datetime.datetime.fromisoformat(data[1:]).replace(fold=int(data[0])),
    ),
    datetime.date: ("date", datetime.date.isoformat, datetime.date.fromisoformat),
    datetime.time: (
        "time",
        lambda value: f"{value.fold}{value.isoformat()}",
        lambda data: datetime.time.fromisoformat(data[1:]).replace(fold=int(data[0])),
    ),
    datetime.timedelta: (
        "timedelta",
        lambda value: [value.days, value.seconds, value.microseconds],
        lambda data: datetime.timedelta(*data),
    ),
    decimal.Decimal: ("decimal", str, decimal.Decimal),
    uuid.UUID: ("uuid", str, uuid.UUID),
    range: ("range", lambda value: [value.start, value.stop, value.step], lambda data: range(*data)),
}
_READ: Final = {name: read for name, _, read in _KINDS.values()} | {
    "text": lambda data: bytes.fromhex(data).decode("utf-16-le", "surrogatepass")
}
