"""Values become JSON and come back to the bit, of the same types, and nothing of them is shared."""

from __future__ import annotations

import dataclasses
import datetime
import decimal
import enum
import math
import pickle
import struct
import uuid
from collections import deque
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.base.values import same
from hfg.recording.values import CannotKeep, Codec


class Pose(msgspec.Struct):
    x: float
    y: float = 0.0


class Path(msgspec.Struct, frozen=True):
    first: Pose
    steps: tuple[int, ...]
    last: Pose | None = None


@dataclasses.dataclass
class Scan:
    number: int
    ranges: list[float]
    poses: dict[str, Pose]
    image: np.ndarray


class Found(NamedTuple):
    number: int
    name: str


class Gear(enum.Enum):
    LOW = 1
    HIGH = 2


def there_and_back(hint: Any, value: Any, **options: bool) -> Any:
    codec = Codec(hint, **options)
    return codec.decode(msgspec.json.decode(msgspec.json.encode(codec.encode(value))))


EXAMPLES = [
    (Pose, Pose(1, 2.5)),
    (Path, Path(Pose(1, math.inf), (1, 2), Pose(3, -0.0))),
    (Any, Path(Pose(1, 2.0), (1, 2))),
    (Scan, Scan(1, [1.0, 2], {"a": Pose(1)}, np.arange(3))),
    (Found, Found(1, "x")),
    (object, Found(1, "x")),
    (Gear, Gear.HIGH),
    (Gear, "HIGH"),
    (bytes, b"\x00\xff"),
    (bytes, "AP8="),
    (float, 3),
    (float, math.inf),
    (tuple[int, str], (1, "a")),
    (tuple[int, str], [1, "a"]),
    (list[int], (1, 2)),
    (dict[str, Pose], {"a": Pose(1)}),
    (Pose, {"x": 1}),
    (Pose | None, None),
    (Any, {"$type": "tuple"}),
    (Any, {1: 2, (3,): [4]}),
    (Any, {"\ud800": 1}),
    (str, "half \ud800"),
    (int, 2**80),
    (Any, 1j),
    (Any, {1, 2}),
    (Any, deque([1, (2,)])),
    (Any, datetime.datetime(2026, 1, 2, 3, 4, 5, 6, tzinfo=datetime.UTC)),
    (Any, datetime.timedelta(days=-1, microseconds=3)),
    (Any, decimal.Decimal("1.10")),
    (Any, uuid.UUID(int=7)),
    (Any, np.float32(1.5)),
    (np.ndarray, np.zeros((2, 0, 3))),
    (Any, np.array([(1, (2.0, 3.0))], dtype=[("a", "<i4"), ("b", "<f8", (2,))])),
]


@pytest.mark.parametrize(("hint", "value"), EXAMPLES)
def test_a_value_comes_back_equal_and_of_the_same_type(hint: Any, value: Any) -> None:
    found = there_and_back(hint, value)
    assert type(found) is type(value)
    assert same(found, value) or pickle.dumps(found) == pickle.dumps(value)


def test_what_is_not_a_number_keeps_its_bits() -> None:
    value = struct.unpack(">d", bytes.fromhex("fff8000000000123"))[0]
    assert struct.pack(">d", there_and_back(float, value)).hex() == "fff8000000000123"


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text() | st.integers(), inner),
    max_leaves=10,
)


@pytest.mark.slow
@given(plain)
def test_whatever_is_nested_comes_back(value: Any) -> None:
    found = there_and_back(object, value)
    assert repr(found) == repr(value)


def test_what_was_kept_shares_nothing_with_the_value() -> None:
    image, ranges = np.zeros(3), [1.0]
    codec = Codec(Scan)
    kept = codec.encode(Scan(1, ranges, {}, image))
    image[:] = 7
    ranges.append(2.0)
    assert same(codec.decode(msgspec.json.decode(msgspec.json.encode(kept))), Scan(1, [1.0], {}, np.zeros(3)))


class Handle:
    """No data."""


def test_an_object_that_is_no_data_is_refused_unless_pickle_is_allowed() -> None:
    with pytest.raises(CannotKeep, match=r"test_values\.Handle is not data"):
        Codec(Any).encode(Handle())
    assert type(there_and_back(Any, Handle(), may_pickle=True)) is Handle


def test_pickled_values_are_read_only_where_that_is_allowed() -> None:
    data = msgspec.json.decode(msgspec.json.encode(Codec(Any, may_pickle=True).encode(Handle())))
    with pytest.raises(CannotKeep, match="runs code"):
        Codec(Any).decode(data)


def test_a_class_that_nobody_has_imported_is_not_imported_for_a_file() -> None:
    with pytest.raises(CannotKeep, match="antigravity:Plane is unknown here"):
        Codec(Any).decode({"$type": "object", "class": "antigravity:Plane", "fields": {}})
