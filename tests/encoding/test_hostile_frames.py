"""Whatever arrives: tokens of the declared type, or one exception with one sentence, and memory for no more."""

from __future__ import annotations

import dataclasses
import struct
import tracemalloc
from fractions import Fraction
from random import Random
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.base.token import Token
from hfg.base.values import Colour
from hfg.encoding import Limits, TokenCodec
from hfg.errors import EncodingError
from hfg.images import Gray
from hfg.types import Array, accepts


@dataclasses.dataclass
class Pose:
    x: float
    names: tuple[str, ...] = ()


class Tree(msgspec.Struct):
    label: str
    children: list[Tree] = []


SAMPLES: list[tuple[Any, Any]] = [
    (int, 3),
    (int, 2**90),
    (list[Pose], [Pose(1.0, ("a",)), Pose(2)]),
    (dict[str, Pose | Colour | None], {"a": Pose(1.0), "b": Colour(1, 2, 3), "c": None}),
    (Tree, Tree("a", [Tree("b")])),
    (tuple[Gray, Array], (np.ones((3, 4), np.uint8), np.array(["ab", "c"]))),
    (Array, np.array([True, False, True])),
    (Fraction, Fraction(1, 3)),
    (bytes, b"abc"),
]
SENT = [TokenCodec[Any](hint).encode(Token(value, 1, 2.5, 3)) for hint, value in SAMPLES]
MEMORY = 400_000  # of a refusal: sentences, the exception with its traceback, and what was read until then


def refused(codec: TokenCodec[Any], metadata: bytes, value: bytes) -> bool:
    """Whether it is refused; what is taken is of the type and needs no more memory than its bytes may ask for."""
    sentence, found = "", Token[Any](None)
    tracemalloc.start()
    try:
        found = codec.decode(metadata, value)
    except EncodingError as error:
        sentence = str(error)
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < MEMORY + 100 * len(value)
    if sentence:
        assert sentence.startswith("the value was refused on arrival: ")
        assert "\n" not in sentence
        assert len(sentence) < 600
        return True
    assert found.is_marker or found.value is None or accepts(found.value, codec.hint)
    return False


def small(kind: Any = 0, activity: Any = 0, stamp: Any = 0.5, number: Any = 1, *more: Any) -> bytes:
    """Make metadata of what a stranger says."""
    return msgspec.msgpack.encode([kind, activity, stamp, number, *more])


def with_arrays(body: Any, heads: list[Any], rest: bytes = b"") -> bytes:
    """Make a value with arrays of what a stranger says that is in it."""
    data = msgspec.msgpack.encode([body, heads])
    head = struct.pack("<I", len(data)) + data
    return head + (bytes(-len(head) % 64) + rest if rest else b"")


@pytest.mark.rule("L4")
@pytest.mark.parametrize("number", range(len(SAMPLES)))
def test_the_samples_are_tokens(number: int) -> None:
    assert not refused(TokenCodec[Any](SAMPLES[number][0]), *SENT[number])


@pytest.mark.rule("L4")
@pytest.mark.parametrize("number", range(len(SAMPLES)))
def test_what_is_cut_anywhere_is_refused(number: int) -> None:
    codec, (metadata, value) = TokenCodec[Any](SAMPLES[number][0]), SENT[number]
    assert all(refused(codec, metadata[:length], value) for length in range(len(metadata)))
    assert all(refused(codec, metadata, value[:length]) for length in range(len(value)))
    assert refused(codec, metadata, value + b"\0")
    assert refused(codec, metadata + b"\0", value)


@pytest.mark.slow
@pytest.mark.rule("L4")
@pytest.mark.parametrize("number", range(len(SAMPLES)))
def test_flipped_bits_are_refused_or_are_values_of_the_type(number: int) -> None:
    codec, (metadata, value) = TokenCodec[Any](SAMPLES[number][0]), SENT[number]
    both, outcomes = metadata + value, set()
    for bit in range(8 * len(both)):
        changed = bytearray(both)
        changed[bit // 8] ^= 1 << bit % 8
        outcomes.add(refused(codec, bytes(changed[: len(metadata)]), bytes(changed[len(metadata) :])))
    assert True in outcomes


def hostile_bytes(random: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(random.randint(0, 5)):
        place = random.randrange(len(changed) + 1)
        match random.randrange(4):
            case 0:
                changed[place : place + 1] = random.choice(
                    (b"\xdd", b"\xdf", b"\xdb", b"\xc6", b"\xc9", b"\x91", b"\xff")
                )
            case 1:
                changed[place : place + 4] = random.randbytes(4)
            case 2:
                del changed[place : place + random.randint(1, 8)]
            case 3:
                changed[place:place] = changed[place : place + random.randint(1, 16)]
    return bytes(changed)


@pytest.mark.rule("L4")
@pytest.mark.parametrize("many", [300, pytest.param(100_000, marks=[pytest.mark.soak, pytest.mark.timeout(1800)])])
@pytest.mark.parametrize("number", range(len(SAMPLES)))
def test_what_somebody_has_changed_is_refused_or_is_a_value_of_the_type(number: int, many: int) -> None:
    random = Random(number)
    codec, (metadata, value) = TokenCodec[Any](SAMPLES[number][0]), SENT[number]
    outcomes = []
    for _ in range(many):
        kind = metadata if random.random() < 0.4 else small(random.randrange(7))
        outcomes.append(refused(codec, hostile_bytes(random, kind), hostile_bytes(random, value)))
    assert sum(outcomes) > many // 2


@pytest.mark.rule("L4")
@given(
    st.binary(max_size=40), st.binary(max_size=200), st.sampled_from([hint for hint, _ in SAMPLES]), st.integers(0, 7)
)
def test_random_bytes_are_refused_or_are_values_of_the_type(
    metadata: bytes, value: bytes, hint: Any, kind: int
) -> None:
    refused(TokenCodec[Any](hint), metadata if kind == 7 else small(kind), value)


def count(head: bytes, number: int = 2**32 - 1) -> bytes:
    return head + struct.pack(">I", number)


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("hint", "metadata", "value"),
    [
        (list[int], small(), count(b"\xdd")),
        (list[int], small(), count(b"\xdd") + bytes(60)),
        (dict[str, int], small(), count(b"\xdf")),
        (str, small(), count(b"\xdb")),
        (bytes, small(), count(b"\xc6")),
        (Tree, small(), b"\x92\xa1a\x91" * 50_000),
        (Tree, small(), b"\x92\xa1a" + b"\x91" * 50_000),
        (int, small(1), struct.pack("<I", 2**32 - 1) + bytes(8)),
        (int, count(b"\xdd"), b"\x01"),
        (int, small(2), msgspec.msgpack.encode(b"\xff" * 70_000)),  # arithmetic with it would take for ever
        (Fraction, small(), msgspec.msgpack.encode((1, 0))),
        (Fraction, small(), msgspec.msgpack.encode((2, 4))),
    ],
    ids=str,
)
def test_what_claims_to_be_huge_or_endlessly_deep_is_refused(hint: Any, metadata: bytes, value: bytes) -> None:
    assert refused(TokenCodec[Any](hint), metadata, value)


ARRAYS: list[tuple[Any, str]] = [
    (("|O", [8]), "cannot be sent"),
    (("|V8", [8]), "cannot be sent"),
    (("<f8,<f8", [8]), "cannot be sent"),
    (("[('a','<f8')]", [8]), "cannot be sent"),
    (("<f16", [4]), "cannot be sent"),
    (("f8", [8]), "cannot be sent"),
    (("<U0", [2**40]), "cannot be sent"),
    (("<f8" * 1000, [8]), "cannot be sent"),
    (("<f8", [-8]), "no array can have the shape"),
    (("<f8", [-1, -8]), "no array can have the shape"),
    (("<f8", [1] * 33), "no array can have the shape"),
    (("<f8", [2**63]), "no array can have the shape"),
    (("<f8", [2**40, 2**40]), "bytes that can be here"),
    (("<f8", [0, 2**39, 2**39]), "bytes that can be here"),
    (("<f8", [9]), "it is cut"),
    (("<f8", [7]), "belong to no array"),
    (("|b1", [64]), "holds values other than 0 and 1"),
    (("<U16", [1]), "invalid character"),
    ((">U16", [1]), "invalid character"),
    (("<f8", [8], ["hfg-a-b-1-x", 0, 1, 0]), "not open to this end"),
    (("<f8", [8], ["hfg-a-b-1-x", 0, 1]), "not open to this end"),
]


@pytest.mark.rule("L4")
@pytest.mark.parametrize(("head", "words"), ARRAYS)
def test_arrays_that_nobody_sends_are_refused(head: Any, words: str) -> None:
    value = with_arrays(0, [head], b"\xff" * 64)
    with pytest.raises(EncodingError, match=words):
        TokenCodec[Any](Array).decode(small(1), value)
    assert refused(TokenCodec[Any](Array), small(1), value)


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("metadata", "value", "words"),
    [
        (b"", b"\x01", "truncated"),
        (b"pickle", b"\x01", "Expected `array`"),
        (small(7), b"\x01", "Expected `int` <= 6"),
        (small(0, 2), b"\x01", "Expected `int` <= 1"),
        (small(0, 0, 0.0, -1), b"\x01", "Expected `int` >= 0"),
        (small(0, 0, 0.0, 1, 2), b"\x01", "at most length 4"),
        (small(5), b"\x01", "a marker has a value"),
        (small(5, 1), b"", "a silence has a modifier"),
        (small(), b"", "truncated"),
        (small(1), b"\0\0", "it is cut after 2 bytes"),
        (small(1), struct.pack("<I", 9), "its head ends at 13 of 4 bytes"),
        (small(), msgspec.msgpack.encode(1.5), "got `float`"),
        (small(), msgspec.msgpack.encode("__import__('os')"), "got `str`"),
    ],
)
def test_each_refusal_says_what_is_wrong(metadata: bytes, value: bytes, words: str) -> None:
    with pytest.raises(EncodingError) as found:
        TokenCodec[Any](int).decode(metadata, value)
    assert words in str(found.value)


@pytest.mark.rule("L4")
def test_an_array_of_another_layout_than_declared_is_refused() -> None:
    sent = TokenCodec[Any](Array).encode(Token(np.zeros((2, 3), np.float64)))
    with pytest.raises(EncodingError, match="expected Gray, found an array of float64, 2 x 3"):
        TokenCodec[Any](Gray).decode(*sent)


@pytest.mark.rule("L4")
def test_more_than_the_limits_is_refused_before_anything_is_made_of_it() -> None:
    sent = TokenCodec[Any](list[Gray]).encode(Token([np.zeros((64, 64), np.uint8)] * 4))
    for limits, words in (
        (Limits(size=4096), "at most 4096 are allowed"),
        (Limits(arrays=3), "4 arrays, and at most 3"),
    ):
        with pytest.raises(EncodingError, match=words):
            TokenCodec[Any](list[Gray], limits=limits).decode(*sent)
