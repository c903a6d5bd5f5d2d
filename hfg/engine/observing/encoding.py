"""JSON of what a run shows: reports, problems, events of its trace. Whatever users send can be written.

A token that holds a marker has "marker" in place of "value", so that the end of a stream and the text "END" are two
things: `{"marker": "END", ...}` and `{"value": "END", ...}`. What JSON does not know is written as text, an array by
its shape. Depends on msgspec; knows tokens, no verbs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import msgspec
import numpy as np

from hfg.base.token import Token

__all__ = ["encode", "line_of", "text"]

_LONGEST_VALUE: Final = 200
_DEEPEST: Final = 5


def encode(value: Any) -> bytes:
    """Write JSON on one line; never fails, whatever the value."""
    try:
        if isinstance(value, Token):
            return _ENCODER.encode(_marked_token(value) if value.is_marker else value)
        token = getattr(value, "token", None)
        return _ENCODER.encode(_marked(value) if isinstance(token, Token) and token.is_marker else value)
    except Exception:  # a text with half a character, a container that holds itself, a __repr__ that raises ...
        return _ENCODER.encode(_writable(value, 0))


def _marked(event: Any) -> Any:
    """Put "marker" in place of the value of the event's token."""
    built = msgspec.to_builtins(event, enc_hook=_text)
    built["token"] = _marked_token(event.token)
    return built


def _marked_token(token: Token[Any]) -> dict[str, Any]:
    built = msgspec.to_builtins(token, enc_hook=_text)
    return {"marker": built.pop("value"), **built}


def text(value: Any) -> str:
    """Describe any value on one line, for people; never fails."""
    if isinstance(value, str):
        value = repr(value)
    return " ".join(str(_text(value)).split("\n"))


def line_of(token: Token[Any], passed_s: float, *, json: bool) -> str:
    """Describe a token on one line, for people with the seconds at which it passed, or as JSON."""
    if json:
        return encode(token).decode() + "\n"
    modifier = f"  ({token.activity:+d})" if token.activity else ""
    return f"{passed_s:.3f} s  {text(token.value)}{modifier}\n"


def _writable(value: Any, depth: int) -> Any:
    """Go down to what cannot be written and take its text instead."""
    try:
        return msgspec.Raw(_ENCODER.encode(value))
    except Exception:
        if depth == _DEEPEST:
            return _text(value)
    try:
        return _parts_of(value, depth)
    except Exception:  # of a value that cannot be looked into
        return _text(value)


def _parts_of(value: Any, depth: int) -> Any:
    if isinstance(value, msgspec.Struct):
        config = value.__struct_config__
        tag = {} if config.tag is None else {config.tag_field: config.tag}
        fields = {name: _writable(getattr(value, name), depth + 1) for name in value.__struct_fields__}
        return {**tag, **fields}
    if isinstance(value, Mapping):
        return {_clean(str(key)): _writable(one, depth + 1) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_writable(one, depth + 1) for one in value]
    return _text(value)


def _text(value: Any) -> Any:
    """Describe a value that JSON does not know."""
    kind = type(value)  # a value may lie about its class
    if issubclass(kind, np.ndarray):
        return f"array {'x'.join(map(str, value.shape))} {value.dtype}"
    if issubclass(kind, np.generic):
        return value.item()
    try:
        told = value if isinstance(value, str) else str(value) if isinstance(value, BaseException) else repr(value)
    except Exception as error:
        told = f"<{type(value).__name__}, whose text cannot be made: {type(error).__name__}>"
    told = _clean(told)
    return told if len(told) <= _LONGEST_VALUE else told[: _LONGEST_VALUE - 1] + "…"


def _clean(text: str) -> str:
    """Take out halves of characters, which UTF-8 cannot write."""
    return text.encode("utf-8", "backslashreplace").decode()


_ENCODER: Final = msgspec.json.Encoder(enc_hook=_text)
