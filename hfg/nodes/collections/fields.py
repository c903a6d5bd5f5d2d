"""What is inside of a value: keys of dicts, fields of records, items of lists; methods and private names are not.

Depends on `encoding.records`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from hfg.encoding.records import names_of


def read_field(value: Any, path: str) -> Any:
    """Follow a path such as "pose.x" or "points.0.x" into a value; an empty one is the value itself.

    Raises:
      LookupError: there is nothing of that name; the message says what there is.
    """
    for name in path.split(".") if path else ():
        value = _one(value, name, path)
    return value


def _one(value: Any, name: str, path: str) -> Any:
    number = int(name) if re.fullmatch(r"-?[0-9]{1,9}", name) else None
    if isinstance(value, Mapping):
        if name in value:
            return value[name]
        if number is not None and number in value:
            return value[number]
        known = [str(key) for key in value]
    elif name in (known := record_fields(value)):
        return getattr(value, name)
    elif isinstance(value, Sequence) and number is not None:
        if -len(value) <= number < len(value):
            return value[number]
        known = [f"{len(value)} items"]
    have = ", ".join(known[:10]) or "nothing that has a name"
    raise LookupError(f'there is no "{name}" of "{path}" in a {type(value).__name__}, which has {have}')


def record_fields(value: Any) -> list[str]:
    """Name the fields of a record; other objects have none, because reading their attributes may do anything."""
    if isinstance(value, type):
        return []
    names = names_of(type(value))
    return list(names) if names is not None else [field.name for field in getattr(type(value), "__attrs_attrs__", ())]
