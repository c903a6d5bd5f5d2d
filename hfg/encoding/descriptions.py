"""What two ends compare before the first value: their types as plain data, as a fingerprint, and in words.

The module of a class is ignored, because a program's own module is `__main__` to itself. Its name, its fields and their
types count. Depends on `codecs`.
"""

from __future__ import annotations

import hashlib
from typing import Any, Final

import msgspec

from hfg.encoding.codecs import codec_for
from hfg.errors import EncodingError

_LONGEST: Final = 2**20


def description_of(hint: Any) -> str:
    """Return everything that both ends must agree on, as a string to send before the first value.

    Raises:
      EncodingError: values of this type cannot be sent to another process.
    """
    return msgspec.json.encode(codec_for(hint).form).decode()


def type_fingerprint(hint: Any) -> str:
    """Return 16 digits that are equal where types are, in every process and version of Python.

    Raises:
      EncodingError: values of this type cannot be sent to another process.

    Examples:
      >>> type_fingerprint(int | str) == type_fingerprint(str | int), type_fingerprint(int) == type_fingerprint(float)
      (True, False)
    """
    return hashlib.sha256(description_of(hint).encode()).hexdigest()[:16]


def difference(hint: Any, theirs: str) -> str | None:
    """Return how the other end's type differs from this end's, or None if it does not.

    Args:
      hint: the type of this end.
      theirs: the result of `description_of` at the other end.

    Raises:
      EncodingError: `theirs` is not a description of a type.

    Examples:
      >>> print(difference(dict[str, float], description_of(dict[str, list[float]])))
      the value of each key: float here, list of float there
    """
    try:
        if len(theirs) > _LONGEST:
            raise ValueError("it is too long")
        other = msgspec.json.decode(theirs, type=list)
        return _difference(codec_for(hint).form, other, "")
    except (ValueError, RecursionError, UnicodeEncodeError) as error:
        raise EncodingError(f"cannot read the other end's description of its type ({error})") from None


def _difference(mine: Any, theirs: Any, where: str) -> str | None:
    if mine == theirs:
        return None
    if not (isinstance(theirs, list) and theirs and isinstance(theirs[0], str)):
        raise ValueError(f"{theirs!r:.40} is not a type")
    if mine[0] != theirs[0] or len(mine) != len(theirs):
        return _unlike(mine, theirs, where)
    match mine[0]:
        case "class" | "dict" if len(mine) == 3 and isinstance(mine[1], str):
            return _of_fields(mine, theirs, where)
        case "list" | "set" | "frozenset" | "deque":
            return _difference(mine[1], theirs[1], f"{where} each item:")
        case "dict" | "OrderedDict" | "Counter":
            key = _difference(mine[1], theirs[1], f"{where} each key:")
            return key or _difference(mine[2], theirs[2], f"{where} the value of each key:")
        case "tuple" if _is_list_of_types(mine[1]) and _is_list_of_types(theirs[1]) and len(mine[1]) == len(theirs[1]):
            for number, (one, other) in enumerate(zip(mine[1], theirs[1], strict=True)):
                found = _difference(one, other, f"{where} item {number}:")
                if found is not None:
                    return found
    return _unlike(mine, theirs, where)


def _is_list_of_types(form: Any) -> bool:
    return isinstance(form, list) and all(isinstance(one, list) for one in form)


def _of_fields(mine: Any, theirs: Any, where: str) -> str | None:
    if mine[1] != theirs[1]:
        return _unlike(mine, theirs, where)
    if not isinstance(theirs[2], list) or not all(
        isinstance(one, list) and len(one) > 1 and isinstance(one[0], str) for one in theirs[2]
    ):
        raise ValueError(f"{theirs!r:.40} is not a class")
    here, there = ({one[0]: one[1:] for one in form[2]} for form in (mine, theirs))
    only_here = [name for name in here if name not in there]
    only_there = [name for name in there if name not in here]
    if only_here or only_there:
        lacks = [f'"{name}" is missing there' for name in only_here]
        lacks += [f'"{name}" is missing here' for name in only_there]
        return f"{where} in {mine[1]}, {', '.join(lacks)}".strip()
    for name in here:
        found = _difference(here[name][0], there[name][0], f"{where} {mine[1]}.{name}:")
        if found is not None:
            return found
    if list(here) != list(there):
        return f"{where} {mine[1]} has its fields in the order {', '.join(here)} here, {', '.join(there)} there".strip()
    return _unlike(mine, theirs, where)


def _unlike(mine: Any, theirs: Any, where: str) -> str:
    here, there = _in_words(mine), _in_words(theirs)
    if here == there:
        here, there = str(mine), str(theirs)
    return f"{where} {here:.300} here, {there:.300} there".strip()


def _in_words(form: Any) -> str:
    match form:
        case ["class" | "dict", str(name), list()]:
            return name
        case ["enum" | "flag", str(name), members]:
            return f"{name} with the members {members}"
        case ["again", str(name)]:
            return name
        case ["literal", list(values)]:
            return "one of " + ", ".join(str(one[-1]) if isinstance(one, list) and one else str(one) for one in values)
        case ["array", list(dtypes), list(layouts)]:
            items = " or ".join(map(str, dtypes)) if len(dtypes) < 9 else "numbers"
            return " ".join(["array of", items, *map(str, layouts)])
        case ["union", list(members)]:
            return " | ".join(map(_in_words, members))
        case ["tuple", list(parts)] if _is_list_of_types(parts):
            return f"tuple of {', '.join(map(_in_words, parts))}"
        case [str(name), list(inner)]:
            return f"{name} of {_in_words(inner)}"
        case [str(name), list(key), list(item)]:
            return f"{name} of {_in_words(key)} to {_in_words(item)}"
        case [str(name)]:
            return name
    return str(form)
