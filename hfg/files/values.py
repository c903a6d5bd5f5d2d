"""Values of parameters and of initial tokens as plain data, and back. Stands on encoding.

What comes back is the very same value, else it is refused: a file must not make something else of a graph.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from hfg.encoding import Find, decode, has_tag
from hfg.errors import EncodingError
from hfg.ports import ParameterSpec
from hfg.types import accepts

__all__ = ["decoded", "decoded_parameter"]


def decoded_parameter(spec: ParameterSpec, data: object, find: Find) -> object:
    """Give the value of a parameter that plain data stands for; what is none stays as it is, for whoever checks it."""
    return _decoded(data, partial(spec.decode, find=find), lambda one: spec.check(one) is None)


def decoded(data: object, hint: object, find: Find) -> object:
    """Give the value of a type that plain data stands for, or the data itself."""
    return _decoded(data, partial(decode, hint=hint, find=find), lambda one: accepts(one, hint))


def _decoded(data: object, read: Callable[[object], object], fits: Callable[[object], bool]) -> object:
    if not has_tag(data) and fits(data):
        return data
    try:
        return read(data)
    except EncodingError:
        return data
