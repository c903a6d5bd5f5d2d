"""Tokens become bytes and come back the same: of the same classes, to the bit, whatever the type (L1, L4)."""

from __future__ import annotations

import collections
import dataclasses
import datetime
import decimal
import enum
import fractions
import functools
import json
import math
import operator
import os
import subprocess
import sys
import typing
import uuid
import zoneinfo
from collections import abc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath, PurePosixPath
from random import Random
from types import GenericAlias
from typing import Annotated, Any, Generic, Literal, NamedTuple, NewType, NotRequired, TypedDict, TypeVar

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.base.values import Colour, Span, same
from hfg.encoding import TokenCodec, codec_for, description_of, difference, type_fingerprint, wire_problem
from hfg.encoding.wire import Limits
from hfg.errors import EncodingError
from hfg.images import AnyImage, Color, Gray, Image, Points
from hfg.testing import values_of
from hfg.testing.strategies import tokens
from hfg.types import Array, Shape
from tests.encoding.kinds import Found, Mode, Plan, Pose, Sides

T = TypeVar("T")
Metres = NewType("Metres", float)


class Level(enum.IntEnum):
    LOW = 1
    HIGH = 2


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Detection:
    label: str
    box: tuple[int, int, int, int]
    crop: Image


@dataclasses.dataclass
class Angle:
    degrees: float
    radians: float = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        if not math.isnan(self.degrees) and abs(self.degrees) > 1e7:
            raise ValueError("too far")
        self.radians = math.radians(self.degrees)


class Options(msgspec.Struct, frozen=True, kw_only=True):
    speed: int | None
    name: str


class Nothing(NamedTuple):
    pass


class Settings(TypedDict):
    size: int
    name: NotRequired[str]


class Box(msgspec.Struct, Generic[T]):
    inside: T
    many: list[T]


class Tree(msgspec.Struct):
    label: str
    image: Gray | None = None
    children: list[Tree] = []


BERLIN = zoneinfo.ZoneInfo("Europe/Berlin")
EXAMPLES: list[tuple[Any, Any]] = [
    (int, 2**63),
    (int, True),
    (int, -(2**100)),
    (list[int], [1, 2**200, -(2**64), 0]),
    (dict[int, float], {2**70: 1.5, -1: 2**70}),
    (float, 3),
    (float, math.nan),
    (float, -0.0),
    (Metres, 1.5),
    (complex, 1 - 2j),
    (complex, 1),
    (complex, complex(math.nan, -0.0)),
    (int | str | None, "a"),
    (bytes, b"\x00\xff"),
    (bytes | str, b"a"),
    (bytearray, bytearray(b"ab")),
    (Mode, Mode.GOOD),
    (Level | int, Level.HIGH),
    (Level | int, 2),
    (Sides, Sides.LEFT | Sides.RIGHT),
    (Literal["a", 1, True, Mode.FAST], True),
    (Literal["a", 1, True, Mode.FAST], 1),
    (Literal["a", 1, True, Mode.FAST], Mode.FAST),
    (Colour, Colour(1, 2, 3)),
    (Span[float], Span(0.25, 3)),
    (Span[Colour], Span(Colour(1, 2, 3), Colour(2, 3, 4))),
    (Path, Path("a/b.png")),
    (PurePath, Path("a")),
    (PurePath, PurePosixPath("a")),
    (os.PathLike[str], Path("a")),
    (str | Path, Path("a")),
    (str | Path, "a"),
    (fractions.Fraction, fractions.Fraction(2**80, 3)),
    (decimal.Decimal, decimal.Decimal("1.50")),
    (uuid.UUID, uuid.UUID(int=7)),
    (datetime.date, datetime.date(2020, 1, 2)),
    (datetime.datetime, datetime.datetime(2020, 1, 2, 3, 4, 5, 6)),  # noqa: DTZ001
    (datetime.datetime, datetime.datetime(2020, 1, 2, tzinfo=datetime.UTC)),
    (datetime.datetime, datetime.datetime(2020, 10, 25, 2, 30, fold=1, tzinfo=BERLIN)),
    (datetime.time, datetime.time(1, 2, 3, 4, tzinfo=datetime.timezone(datetime.timedelta(hours=2)), fold=1)),
    (datetime.timedelta, datetime.timedelta(days=-3, microseconds=7)),
    (range, range(3, 9, 2)),
    (tuple[int, str], (1, "a")),
    (tuple[()], ()),
    (tuple[Pose, ...], (Pose(1.0), Pose(2))),
    (set[int | str], {1, "a"}),
    (frozenset[tuple[int, Mode]], frozenset({(1, Mode.FAST)})),
    (abc.Set[int], frozenset({1})),
    (Sequence[int], (1, 2)),
    (Sequence[int], b"ab"),
    (Sequence[str], "ab"),
    (Iterable[float], {1.5}),
    (collections.deque[int], collections.deque([1, 2], maxlen=3)),
    (collections.Counter[str], collections.Counter("aab")),
    (collections.OrderedDict[str, Pose], collections.OrderedDict(b=Pose(1), a=Pose(2))),
    (dict[tuple[int, int], Pose], {(1, 2): Pose(1.0)}),
    (Mapping[str, list[float]], {"a": [1.0]}),
    (Pose, Pose(1, Mode.GOOD, Path("q"))),
    (Plan, Plan([Pose(2.0), Pose(3.0, Mode.GOOD)], "p")),
    (Options, Options(speed=None, name="n")),
    (Angle, Angle(180.0)),
    (Found, Found(0.5)),
    (Nothing, Nothing()),
    (Settings, {"size": 1}),
    (Settings, {"name": "n", "size": 1}),
    (Box[Pose], Box(Pose(1.0), [Pose(2.0)])),
    (Pose | Plan | Found | list[int] | list[str] | None, ["a"]),
    (Pose | Plan | Found | list[int] | list[str] | None, Found(1.0)),
    (Tree, Tree("a", None, [Tree("b", np.zeros((2, 3), np.uint8), [Tree("c")])])),
    (Detection, Detection(label="d", box=(1, 2, 3, 4), crop=np.ones((3, 4, 3), np.uint8))),
    (Array, np.arange(6).reshape(2, 3).T),
    (Array, np.zeros((3, 0), np.float16)),
    (Array, np.array(7, ">i4")),
    (Array, np.array(["a", "bcé"])),
    (Array, np.array([b"a", b"bc"])),
    (Array, np.array(["2020-01-02"], "datetime64[ms]")),
    (Array, np.array([True, False])),
    (Array, np.zeros((4, 6, 3), np.uint8)[1:3, ::2]),
    (list[AnyImage], [np.zeros((2, 2, 3), np.float32), np.ones((1, 1), np.int16)]),
    (Annotated[npt.NDArray[np.float64], Shape(None, 3)] | str, np.ones((2, 3))),
    (np.float32, np.float32(1.5)),
    (np.int64 | np.bool_, np.bool_(True)),
    (type(None), None),
]


def there_and_back(hint: Any, *values: Any) -> list[Any]:
    codec = TokenCodec[Any](hint)
    return [codec.decode(*codec.encode(Token(value))).value for value in values]


def alike(one: Any, other: Any) -> bool:
    """Equal, of the same classes inside too, and with the same zones and lengths."""
    if isinstance(one, collections.deque) and one.maxlen != other.maxlen:
        return False
    if isinstance(one, list | tuple | collections.deque):
        return type(one) is type(other) and len(one) == len(other) and all(map(alike, one, other))
    if type(one) is dict:
        return one.keys() == other.keys() and all(alike(one[key], other[key]) for key in one)
    if isinstance(one, datetime.datetime | datetime.time | decimal.Decimal):
        return repr(one) == repr(other)
    return same(one, other)


@pytest.mark.rule("L1", "L4")
@pytest.mark.parametrize(("hint", "value"), EXAMPLES)
def test_what_arrives_is_what_was_sent(hint: Any, value: Any) -> None:
    assert wire_problem(hint) is None
    first, second = there_and_back(hint, value, value)
    assert alike(first, value), first
    assert alike(second, value), second


ATOMS: list[Any] = [
    bool, int, float, complex, str, bytes, Mode, Level, Path, Colour, Span[float], Found, Pose, Literal["a", 2],
    fractions.Fraction, datetime.timedelta, decimal.Decimal, uuid.UUID, Gray, Color, Points, Array, Settings,
    np.float32,
]  # fmt: skip
KEYS: list[Any] = [bool, int, str, bytes, Mode, tuple[int, str], float | str]


def nested_hint(random: Random, depth: int) -> Any:
    """Make a type of others: containers and unions."""
    if depth == 0:
        return random.choice(ATOMS)
    inner: Any = nested_hint(random, depth - 1)
    key, other = random.choice(KEYS), random.choice(ATOMS)
    made: list[Callable[[], Any]] = [
        lambda: list.__class_getitem__(inner),
        lambda: tuple.__class_getitem__((inner, ...)),
        lambda: GenericAlias(Sequence, inner),
        lambda: inner | None,
        lambda: tuple.__class_getitem__((inner, other)),
        lambda: dict.__class_getitem__((key, inner)),
        lambda: functools.reduce(operator.or_, random.sample(ATOMS, random.randint(1, 3)), inner),
    ]
    return random.choice(made)()


@pytest.mark.rule("L1", "L4")
@pytest.mark.parametrize("seed", [*range(20), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(20, 400))])
def test_values_of_any_type_come_back(seed: int) -> None:
    random = Random(seed)
    hint = nested_hint(random, random.randint(1, 3))

    @settings(max_examples=10, deadline=None, suppress_health_check=list(HealthCheck))
    @given(tokens(values_of(hint)))
    def come_back(sent: Token[Any]) -> None:
        codec = TokenCodec[Any](hint)
        found = codec.decode(*codec.encode(sent))
        assert alike(sent.value, found.value), hint
        assert (sent.activity, sent.stamp, sent.sequence) == (found.activity, found.stamp, found.sequence)

    come_back()


@pytest.mark.rule("T3", "T4", "L1")
def test_markers_and_signals_without_a_value_travel_with_the_values() -> None:
    codec = TokenCodec[Any](int)
    for sent in (Token(NO_MESSAGE, 0, 1.0, 1), Token(3, -1, 2, 2), Token(None, 1, 3.0, 3), Token(END, 1, 4.0, 4)):
        found = codec.decode(*codec.encode(sent))
        assert found == sent
        assert type(found.stamp) is type(sent.stamp)


@pytest.mark.rule("T1", "L4")
def test_arrays_that_arrive_are_read_only_views_of_the_frame() -> None:
    image = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    codec = TokenCodec[Any](tuple[Image, Image])
    metadata, value = codec.encode(Token((image, image)))
    for one in codec.decode(metadata, value).value:
        assert np.array_equal(one, image)
        assert np.shares_memory(one, np.frombuffer(value, np.uint8))
        assert not one.flags.writeable


CANNOT: list[tuple[Any, str]] = [
    (Any, "Any cannot be sent to another process: it does not describe its values; name their type"),
    (object, "object cannot be sent to another process: it does not describe its values; name their type"),
    (list, "list cannot be sent to another process: it does not declare its items; write list[...] with a type"),
    (
        list[Callable[[int], int]],
        "list[Callable[[int], int]] cannot be sent to another process: Callable[[int], int] is code, and code "
        "cannot be sent; send data that describes what to do",
    ),
    (
        type,
        "type cannot be sent to another process: it is code, and code cannot be sent; send data that describes "
        "what to do",
    ),
    (
        dict[str, Any],
        "dict[str, Any] cannot be sent to another process: Any does not describe its values; name their type",
    ),
]


@pytest.mark.rule("L4")
@pytest.mark.parametrize(("hint", "sentence"), CANNOT)
def test_what_cannot_cross_is_known_before_a_run(hint: Any, sentence: str) -> None:
    assert wire_problem(hint) == sentence
    with pytest.raises(EncodingError) as found:
        TokenCodec(hint)
    assert str(found.value) == sentence


class Zone(datetime.tzinfo):
    def utcoffset(self, moment: datetime.datetime | None) -> None: ...
    def dst(self, moment: datetime.datetime | None) -> None: ...
    def tzname(self, moment: datetime.datetime | None) -> None: ...


@dataclasses.dataclass
class Holds:
    what: dict[str, object]


@dataclasses.dataclass
class Takes:
    size: int
    scale: dataclasses.InitVar[int]


@dataclasses.dataclass
class Lost:
    what: Missing  # type: ignore[name-defined] # noqa: F821


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("hint", "words"),
    [
        (list[Holds], "its part Holds.what is object, which does not describe its values"),
        (Takes, "takes arguments that it does not keep (InitVar)"),
        (Lost, "has fields whose types cannot be resolved"),
        (Iterator[int], "is not data that hfg can send;"),
        (Zone, "is not data that hfg can send;"),
        (Box, "does not describe its values"),
        (np.floating, "has no fixed size"),
        (np.longdouble, "has no fixed size"),
        (np.void, "has no fixed size"),
        (T, "does not describe its values"),
    ],
)
def test_the_part_that_cannot_cross_is_named(hint: Any, words: str) -> None:
    assert words in (wire_problem(hint) or "")


class Poses(list[Pose]):
    pass


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("hint", "value", "sentence"),
    [
        (
            int,
            "a",
            "the value cannot be sent: expected int, found str: 'a'; send what the port declares, or declare what it "
            "sends",
        ),
        (
            list[Pose],
            [Pose(1.0), Pose(2.0, Path("a"))],  # type: ignore[arg-type]
            "the value[1].mode cannot be sent: expected Mode, found PosixPath: PosixPath('a'); send what the port "
            "declares, or declare what it sends",
        ),
        (
            list[Pose],
            Poses(),
            "the value cannot be sent: expected list[Pose], found Poses: []; it would arrive as another class: send "
            "exactly the declared one",
        ),
        (dict[str, Color], {"a": np.zeros((2, 2), np.uint8)}, "expected Color, found an array of uint8, 2 x 2"),
        (Array, np.array([object()]), "that another process could read"),
        (Array, np.zeros(2, "i4,f4"), "that another process could read"),
        (Array, np.ma.zeros(2), "send numpy.asarray(...) of it"),
        (str, "\ud800", "a string in it is not valid Unicode"),
        (Settings, {"name": "n"}, "expected Settings"),
        (int | str, 1.5, "expected int | str"),
        (Sides | Mode, 3, "expected Sides | Mode"),
        (datetime.datetime, datetime.datetime(2020, 1, 1, tzinfo=Zone()), "time zone"),
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_is_named_and_nothing_is_sent(hint: Any, value: Any, sentence: str) -> None:
    with pytest.raises(EncodingError) as found:
        TokenCodec[Any](hint).encode(Token(value))
    assert sentence in str(found.value)


def test_a_value_that_contains_itself_is_refused() -> None:
    tree = Tree("a")
    tree.children.append(tree)
    with pytest.raises(EncodingError, match="contains itself"):
        TokenCodec[Any](Tree).encode(Token(tree))


@pytest.mark.rule("L4")
def test_a_class_checks_what_it_holds_on_arrival_too() -> None:
    angle = Angle(1.0)
    angle.degrees = 1e9  # which Angle would not take
    codec = TokenCodec[Any](Angle)
    with pytest.raises(EncodingError, match=r"refused on arrival: it is not Angle \(ValueError: too far\)"):
        codec.decode(*codec.encode(Token(angle)))


@pytest.mark.rule("L4")
def test_too_much_is_refused_by_the_sender() -> None:
    codec = TokenCodec[Any](list[Gray] | str, what='the value of "camera.image"', limits=Limits(size=4096, arrays=2))
    image = np.zeros((32, 64), np.uint8)
    for value, words in (
        ([image] * 3, "3 arrays in it, and at most 2"),
        ([image] * 2, "bytes, and at most 4096"),
        ([np.zeros((64, 65), np.uint8)], "its arrays have 4160 bytes, and at most 4096"),
        ("a" * 5000, "it has 5005 bytes, and at most 4096"),
    ):
        with pytest.raises(EncodingError, match=f'^the value of "camera.image" cannot be sent: .*{words}'):
            codec.encode(Token(value))


# --- what two ends compare ---


@pytest.mark.slow
@pytest.mark.rule("L4")
def test_equal_types_have_equal_fingerprints_in_every_process() -> None:
    names = ["int | str | None", "str | None | int", "dict[str, list[float]]", "Literal['b', 1, 'a']"]
    code = (
        "import json; from typing import Literal; from hfg.encoding import type_fingerprint\n"
        f"print(json.dumps([type_fingerprint(eval(name)) for name in {names}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    here = [type_fingerprint(eval(name)) for name in names]
    assert json.loads(done.stdout) == here
    assert here[0] == here[1] != here[2]


def changed(name: str, fields: list[tuple[str, Any]]) -> Any:
    return dataclasses.make_dataclass(name, fields)


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("mine", "theirs", "sentence"),
    [
        (int, str, "int here, str there"),
        (list[int], list[float], "each item: int here, float there"),
        (dict[str, Mode], dict[str, Level], "the value of each key: Mode with the members"),
        (Pose, changed("Pose", [("x", float), ("mode", Mode)]), 'in Pose, "file" is missing there'),
        (Pose, changed("Pose", [("x", int), ("mode", Mode), ("file", Path | None)]), "Pose.x: float here, int there"),
        (Pose, changed("Pose", [("mode", Mode), ("x", float), ("file", Path | None)]), "the order x, mode, file here"),
        (Color, Gray, "array of uint8 Pixels(3) here, array of uint8 Pixels(1) there"),
        (Settings, TypedDict("Settings", {"size": int, "name": str}), "['name', ['str'], False]"),  # type: ignore[operator]
        (tuple[int, str], tuple[int, int], "item 1: str here, int there"),
        (tuple[int, str], tuple[int, ...], "tuple of int, str here, tuple of int there"),
        (Tree, list[str], "Tree here, list of str there"),
        (Literal["a"], Literal["b"], "one of 'a' here, one of 'b' there"),
    ],
)
def test_a_difference_is_told_in_words(mine: Any, theirs: Any, sentence: str) -> None:
    found = difference(mine, description_of(theirs))
    assert found is not None
    assert sentence in found
    assert type_fingerprint(mine) != type_fingerprint(theirs)
    assert difference(mine, description_of(mine)) is None


@pytest.mark.slow
@given(st.recursive(st.none() | st.text(max_size=5) | st.integers(), lambda inner: st.lists(inner, max_size=4)))
def test_what_is_no_description_is_refused(data: Any) -> None:
    for hint in (Pose, tuple[int, str], dict[str, list[int]]):
        try:
            assert difference(hint, json.dumps(data)) is not None
        except EncodingError as error:
            assert "cannot read the other end's description of its type" in str(error)  # noqa: PT017


def test_a_codec_is_made_once_for_each_type() -> None:
    assert codec_for(list[Pose]) is codec_for(list[Pose])
    assert typing.get_type_hints(codec_for)["return"] is not None
