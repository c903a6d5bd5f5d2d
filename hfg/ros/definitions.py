"""Definitions of messages: what a type consists of, its hash, and a record for its values.

The package `rosbags` has the definitions of the common packages, the parser of `.msg` files, the hashes and CDR. Texts
from outside are checked here after they are parsed, because `rosbags` compiles them to Python. Depends on
errors.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from typing import Annotated, Any, Final, NamedTuple, TypeAlias

import msgspec
import numpy as np

from hfg.base.values import same
from hfg.errors import EncodingError, UsageError
from hfg.types import Shape

Fields: TypeAlias = list[tuple[str, Any]]
"""Names and descriptions, as `rosbags` has them."""

BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4
"""Kinds of descriptions in `rosbags`."""

INTEGERS: Final = {
    kind: (low, high)
    for bits in (8, 16, 32, 64)
    for kind, low, high in (
        (f"int{bits}", -(2 ** (bits - 1)), 2 ** (bits - 1) - 1),
        (f"uint{bits}", 0, 2**bits - 1),
    )
}
"""The smallest and largest number of each kind."""

RECORDS: Final = "hfg.ros.records"
"""The module that has the classes of records."""

PADDING: Final = "structure_needs_at_least_one_member"
"""The field of a message without fields."""

_NAME: Final = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Za-z][A-Za-z0-9_]*")
_FIELD: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_NUMBERS: Final = {*INTEGERS, "float32", "float64", "bool"}
_MOST_TEXT: Final = 2**20
_MOST_FIELDS: Final = 1_000
_MOST_DEEP: Final = 32
_MOST_UNROLLED: Final = 256  # `rosbags` writes a line of code for each item of an array of messages or strings
_MOST_ITEMS: Final = 2**24
_DEFAULTS: Final = {
    ("geometry_msgs/msg/Quaternion", "w"): 1.0,
    ("sensor_msgs/msg/NavSatStatus", "status"): -2,
}
"""Defaults other than 0 in the common packages: the definitions in `rosbags` lack defaults."""


class Record(msgspec.Struct, frozen=True):
    """A message that has no other type of value in hfg: one field for each of its own, by the same names.

    Numbers, strings and booleans are Python's, arrays of numbers are numpy's, other arrays are lists, messages in it
    are records. `bool[]` is an array of uint8. A field that is left out is 0, empty or the default record.
    """

    def __eq__(self, other: object) -> bool:
        return same(self, other)

    __hash__ = None  # type: ignore[assignment]


class Size(NamedTuple):
    """How much memory a type needs.

    Attributes:
      least: the fewest bytes of a message.
      values: how many Python values it makes apart from sequences.
      dense: the most values that a byte of a message makes.
      deep: how many messages are in one another.
    """

    least: int
    values: int
    dense: float
    deep: int


def rosbags() -> Any:
    """Return the module `rosbags.typesys`.

    Raises:
      UsageError: it is not installed.
    """
    try:
        from rosbags import typesys
    except ImportError:
        raise UsageError('messages of ROS 2 need rosbags: pip install "hfg[ros2]"') from None
    return typesys


def parsed(text: str, name: str) -> dict[str, Fields]:
    """Read the text of a `.msg` file, or several texts as they are in a bag, each after a line `MSG: name`.

    Args:
      text: the text.
      name: of the first message, "std_msgs/msg/String".

    Raises:
      UsageError: it cannot be read, or is too large.
    """
    if len(text) > _MOST_TEXT:
        raise UsageError(f"the definition of {name!r:.200} has {len(text):,} characters; at most {_MOST_TEXT:,} fit")
    from rosbags.typesys import TypesysError, get_types_from_msg

    try:
        found = get_types_from_msg(text.replace("\r\n", "\n"), name)
    except (TypesysError, ValueError, RecursionError, AssertionError) as error:
        at = re.search(r"\n(\d+)\n", str(error))
        where = "" if at is None else f" near {text[max(0, int(at[1]) - len(name) - 6) :][:40]!r}"
        raise UsageError(f"the definition of {name!r:.200} cannot be read{where}") from None
    made = {_plain_name(one): _of_file(fields) for one, (_, fields) in found.items()}
    if sum(map(len, made.values())) > _MOST_FIELDS:
        raise UsageError(f"the definition of {name!r:.200} has more than {_MOST_FIELDS:,} fields")
    return made


def _plain_name(name: str) -> str:
    if not _NAME.fullmatch(name) or len(name) > 255:
        raise UsageError(f"{name!r:.200} is not the name of a message: write package, msg and name")
    return name


def _of_file(fields: Iterable[tuple[str, Any]]) -> Fields:
    """Check fields that were read from a text; a `char` is a `uint8` in ROS 2."""
    made: Fields = []
    for name, description in fields:
        if not _FIELD.fullmatch(name):
            raise UsageError(f"{name!r:.200} is not the name of a field")
        made.append((name, _as_in_ros2(description)))
    if not made:
        return [(PADDING, (BASE, ("uint8", 0)))]
    if len({name.lower() for name, _ in made}) < len(made):
        raise UsageError(f"two fields have the same name: {', '.join(name for name, _ in made)!r:.300}")
    return made


def _as_in_ros2(description: Any) -> Any:
    kind, about = int(description[0]), description[1]
    if kind == BASE:
        return kind, ("uint8" if about[0] == "char" else about[0], about[1])
    if kind == NAME:
        return kind, _plain_name(about)
    inner, count = _as_in_ros2(about[0]), int(about[1])
    unrolled = kind == ARRAY and (inner[0] == NAME or inner[1][0] == "string")
    if count > (_MOST_UNROLLED if unrolled else _MOST_ITEMS) or (kind == ARRAY and count < 1):
        raise UsageError(
            f"an array of {count:,} items in a definition: at most {_MOST_UNROLLED} messages or strings fit"
        )
    return kind, (inner, count)


def standard() -> dict[str, Fields]:
    """Return the definitions of the release of ROS 2 in ROS_DISTRO, as in "jazzy"; without it, of Kilted.

    Raises:
      UsageError: there is no such release.
    """
    typesys = rosbags()
    name = os.environ.get("ROS_DISTRO", "") or "kilted"
    releases = {one.name[5:].lower(): one for one in typesys.Stores if one.name.startswith("ROS2_")}
    if name not in releases:
        raise UsageError(f"ROS_DISTRO is {name!r:.80}; known are {', '.join(releases)}")
    known = typesys.get_typestore(releases[name]).fielddefs
    return {name: _of_file(fields) for name, (_, fields) in known.items()}


def hash_of(name: str, known: dict[str, Fields]) -> str:
    """Return the hash of a type, "RIHS01_...", which other programs compare."""
    from rosbags.interfaces import Nodetype
    from rosbags.typesys.store import Typestore

    def described(description: Any) -> Any:
        kind, about = description
        return Nodetype(kind), (described(about[0]), about[1]) if kind in (ARRAY, SEQUENCE) else about

    store = Typestore()
    for one in inside(name, known):
        store.fielddefs[one] = ([], [(field, described(about)) for field, about in known[one]])
    return str(store.hash_rihs01(name))


def inside(name: str, known: dict[str, Fields]) -> list[str]:
    """Return a type and all types in it, the inner ones first.

    Raises:
      UsageError: one is unknown, or contains itself, or they are nested too deep.
    """
    found: dict[str, None] = {}
    _look_into(name, known, [], found)
    return list(found)


def _look_into(name: str, known: dict[str, Fields], around: list[str], found: dict[str, None]) -> None:
    if name in found:
        return
    if name not in known:
        within = f", which {around[-1]} contains," if around else ""
        raise UsageError(f"the type {name!r:.200}{within} is unknown: register its .msg file first")
    if name in around or len(around) >= _MOST_DEEP:
        why = "contains itself" if name in around else f"contains more than {_MOST_DEEP} messages in one another"
        raise UsageError(f"the type {around[0] if around else name} {why}")
    for _, description in known[name]:
        for inner in named(description):
            _look_into(inner, known, [*around, name], found)
    found[name] = None


def named(description: Any) -> list[str]:
    """Return the names of messages in the description of a field: one or none."""
    kind, about = description
    if kind in (ARRAY, SEQUENCE):
        return named(about[0])
    return [about] if kind == NAME else []


def record_of(name: str, fields: Fields, records: dict[str, type[Record]], module: str) -> type[Record]:
    """Make the class of a type's values; the classes of inner types are in `records`."""
    from rosbags.typesys.base import normalize_fieldname

    parts: list[Any] = []
    for field, description in fields:
        hint, default = _hint(description, records)
        said = _DEFAULTS.get((name, field))
        if said is not None:
            default = said
        elif callable(default):
            default = msgspec.field(default_factory=default)
        parts.append((normalize_fieldname(field), hint, default))
    short = name.rpartition("/")[2]
    made: Any = msgspec.defstruct(short, parts, bases=(Record,), module=module, frozen=True)
    made.__qualname__ = name.replace("/", "__")
    made.__doc__ = f"A value of {name}."
    kept: type[Record] = made
    return kept


def _hint(description: Any, records: dict[str, type[Record]]) -> tuple[Any, Any]:
    """Return the type of a field's values, and its default or a function that makes one."""
    kind, about = description
    if kind == NAME:
        return records[about], records[about]
    if kind == BASE:
        plain: type = _plain(about[0])
        return plain, plain()
    inner, count = about
    if inner[0] == BASE and inner[1][0] != "string":
        number: Any = dtype_of(inner[1][0])
        length = count if kind == ARRAY else 0
        hint = Annotated[np.ndarray[Any, np.dtype[number.type]], Shape(count if kind == ARRAY else None)]
        return hint, lambda: np.zeros(length, number)
    item, default = _hint(inner, records)
    if kind == SEQUENCE:
        return list[item], list  # type: ignore[valid-type]
    make: Callable[[], Any] = default if callable(default) else lambda: default
    return list[item], lambda: [make() for _ in range(count)]  # type: ignore[valid-type]


def _plain(kind: str) -> type:
    if kind in ("bool", "string"):
        return bool if kind == "bool" else str
    return float if kind.startswith("float") else int


def dtype_of(kind: str) -> np.dtype[Any]:
    """Return the dtype for an array of such numbers; booleans are uint8 there: a byte may be neither 0 nor 1."""
    return np.dtype("uint8" if kind in ("bool", "byte") else kind)


def size_of(name: str, known: dict[str, Fields]) -> Size:
    """Return how much memory a type needs; see `Size`."""
    sizes: dict[str, Size] = {}
    for one in inside(name, known):
        parts = [_part(description, sizes) for _, description in known[one]]
        least, values = sum(part.least for part in parts), 1 + sum(part.values for part in parts)
        deep = 1 + max(part.deep for part in parts)
        sizes[one] = Size(least, values, max(part.dense for part in parts), deep)
    return sizes[name]


def _part(description: Any, sizes: dict[str, Size]) -> Size:
    kind, about = description
    if kind == NAME:
        return sizes[about]
    if kind == BASE:
        return Size(5 if about[0] == "string" else np.dtype(about[0].replace("byte", "uint8")).itemsize, 1, 0.0, 0)
    inner, count = about
    item = _part(inner, sizes)
    plain = inner[0] == BASE and inner[1][0] != "string"
    if kind == ARRAY:
        return Size(count * item.least, 1 if plain else 1 + count * item.values, item.dense, item.deep)
    return Size(4, 1, max(item.dense, 0.0 if plain else item.values / item.least), item.deep)


def need_supported(name: str, fields: Fields) -> None:
    """Refuse what cannot be decoded here.

    Raises:
      EncodingError: a field is of a wide or an unknown kind of character.
    """
    for field, description in fields:
        kind, about = description
        while kind in (ARRAY, SEQUENCE):
            kind, about = about[0]
        if kind == BASE and about[0] not in (*_NUMBERS, "byte", "string"):
            raise EncodingError(f'field "{field}" of {name} is a {about[0]}, which hfg cannot read')


def store() -> Any:
    """Return an empty store of `rosbags`, which encodes and decodes what is `put` into it."""
    rosbags()
    from rosbags.typesys.store import Typestore

    return Typestore()


def put(into: Any, name: str, fields: Fields, record: type[Record]) -> None:
    """Let a store decode a type to records; booleans in arrays, and bytes, are numbers there."""
    from rosbags.interfaces import Nodetype

    def coded(description: Any, *, within: bool = False) -> Any:
        kind, about = description
        if kind in (ARRAY, SEQUENCE):
            return Nodetype(kind), (coded(about[0], within=True), about[1])
        if kind == BASE and (about[0] == "byte" or (within and about[0] == "bool")):
            return Nodetype.BASE, ("uint8", 0)
        return Nodetype(kind), about

    into.fielddefs[name] = ([], [(field, coded(about)) for field, about in fields])
    into.types[name] = record


def serde_error() -> type[Exception]:
    """Return the class of errors of the package's decoder."""
    from rosbags.serde import SerdeError

    return SerdeError


def text_of(name: str, known: dict[str, Fields]) -> str:
    """Return the definition of a type as bags have it: its own text, and those of the types in it."""
    texts = []
    for one in reversed(inside(name, known)):
        lines = [f"{_written(about)} {field}" for field, about in known[one] if field != PADDING]
        package, _, short = one.split("/")
        head = [] if one == name else ["=" * 80, f"MSG: {package}/{short}"]
        texts.append("\n".join([*head, *lines, ""]))
    return "".join(texts)


def _written(description: Any) -> str:
    kind, about = description
    if kind == BASE:
        return f"{about[0]}<={about[1]}" if about[1] else str(about[0])
    if kind == NAME:
        package, _, short = about.split("/")
        return f"{package}/{short}"
    limit = "" if not about[1] else str(about[1]) if kind == ARRAY else f"<={about[1]}"
    return f"{_written(about[0])}[{limit}]"
