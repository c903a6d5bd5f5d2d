"""The family `values`: texts."""

from __future__ import annotations

from typing import Any

import pytest

from hfg.nodes import values
from hfg.testing import fire
from hfg.testing.diagrams import check


@pytest.mark.parametrize(
    ("node", "inputs", "expected"),
    [
        (values.join_text(parts=3, separator="-"), {"parts": ["a", 1, 2.5]}, "a-1-2.5"),
        (values.join_list(separator="/"), {"items": ["a", 1]}, "a/1"),
        (values.split_text(separator=","), {"text": "a,,b"}, ["a", "", "b"]),
        (values.split_text(separator=",", most=1), {"text": "a,b,c"}, ["a", "b,c"]),
        (values.split_text(), {"text": "  a \n b "}, ["a", "b"]),
        (values.split_lines(), {"text": "a\r\nb\n"}, ["a", "b"]),
        (values.slice_text(start=1, stop=-1), {"text": "hello"}, "ell"),
        (values.slice_text(start=-2), {"text": "hello"}, "lo"),
        (values.replace_text(needle="l", replacement="L"), {"text": "hello"}, "heLLo"),
        (values.replace_pattern(pattern=r"(\d)(\d)", replacement=r"\2\1"), {"text": "12 34 5"}, "21 43 5"),
        (values.change_case(case="upper"), {"text": "aB c"}, "AB C"),
        (values.change_case(case="lower"), {"text": "aB c"}, "ab c"),
        (values.change_case(case="title"), {"text": "aB c"}, "Ab C"),
        (values.change_case(case="capitalize"), {"text": "aB c"}, "Ab c"),
        (values.change_case(case="swap"), {"text": "aB c"}, "Ab C"),
        (values.change_case(case="fold"), {"text": "ß"}, "ss"),
        (values.strip_text(), {"text": " a "}, "a"),
        (values.strip_text(side="left"), {"text": " a "}, "a "),
        (values.strip_text(side="right", characters="a "), {"text": " ba "}, " b"),
        (values.pad_text(width=3), {"text": "a"}, "a  "),
        (values.pad_text(width=3, align="right", filling="0"), {"text": "a"}, "00a"),
        (values.pad_text(width=3, align="centre"), {"text": "a"}, " a "),
        (values.pad_text(width=3), {"text": "abcd"}, "abcd"),
        (values.text_length(), {"text": "häuser"}, 6),
        (values.contains_text(needle="ell"), {"text": "hello"}, True),
        (values.contains_text(needle="ELL"), {"text": "hello"}, False),
        (values.contains_text(needle="ELL", fold=True), {"text": "hello"}, True),
        (values.contains_text(needle="he", where="start"), {"text": "hello"}, True),
        (values.contains_text(needle="he", where="end"), {"text": "hello"}, False),
        (values.contains_text(needle="hello", where="whole"), {"text": "hello"}, True),
        (values.count_in_text(needle="aa"), {"text": "aaaaa"}, 2),
        (values.matches_text(pattern=r"\d+"), {"text": "12"}, True),
        (values.matches_text(pattern=r"\d+"), {"text": "12a"}, False),
        (values.matches_text(pattern=r"\d+", whole=False), {"text": "a12a"}, True),
        (values.find_all(pattern=r"\d+"), {"text": "a12b3"}, ["12", "3"]),
        (values.format_text(values=2, format="{:.2f} m of {}"), {"values": [1.234, "all"]}, "1.23 m of all"),
        (values.format_text(values=2, format="{1}{0}{{}}"), {"values": ["a", "b"]}, "ba{}"),
        (values.format_text(values=2, format="{:>{}}"), {"values": ["a", 3]}, "  a"),
        (values.format_text(format="{!r}"), {"values": ["a"]}, "'a'"),
        (values.format_fields(format="{name} is {age:03d}"), {"fields": {"name": "Eve", "age": 7}}, "Eve is 007"),
    ],
)
def test_texts(node: Any, inputs: dict[str, Any], expected: Any) -> None:
    assert fire(node, **inputs).outputs == {"out": expected}


def test_a_search_gives_the_first_place_with_its_groups_and_is_silent_without_one() -> None:
    node = values.search_text(pattern=r"(?P<key>\w+)=(\d+)?")
    assert fire(node, text="x; a=1 b=2").outputs == {"found": "a=1", "groups": ["a", "1"], "names": {"key": "a"}}
    assert fire(node, text="a=").outputs == {"found": "a=", "groups": ["a", ""], "names": {"key": "a"}}
    assert fire(node, text="nothing").outputs == {}


def test_texts_are_compared_and_signalled() -> None:
    check(values.TextCompare(), a="aB|", b="ab|", expected={"equal": "a", "different": "-B"})
    check(values.TextCompare(fold=True), a="aB|", b="ab|", expected={"equal": "aB"})


@pytest.mark.parametrize("made", [values.replace_pattern, values.matches_text, values.search_text, values.find_all])
def test_a_pattern_that_is_none_is_refused_where_it_is_set(made: Any) -> None:
    with pytest.raises(ValueError, match="must satisfy is_a_pattern, got '\\('"):
        made(pattern="(")


def test_a_replacement_that_does_not_fit_its_pattern_says_so() -> None:
    for replacement in (r"\1", r"\g<name>", r"\q"):
        with pytest.raises(ValueError, match="does not fit the pattern"):
            fire(values.replace_pattern(pattern="a", replacement=replacement), text="a")


@pytest.mark.parametrize(
    "format_",
    ["{0.__class__}", "{0[0]}", "{:{0.real}}", "{", "}", "{!x}", "{a.b}", "{0.__class__.__mro__[1].__subclasses__}"],
)
def test_a_format_that_reaches_into_values_is_refused_where_it_is_set(format_: str) -> None:
    for made in (values.format_text, values.format_fields):
        with pytest.raises(ValueError, match="must satisfy is_a_format"):
            made(format=format_)


@pytest.mark.parametrize(
    ("node", "inputs", "sentence"),
    [
        (values.format_text(format="{} {}"), {"values": [1]}, "but there are 1 of them"),
        (values.format_text(format="{:d}"), {"values": ["a"]}, "'a' cannot be written as {:d}"),
        (values.format_text(format="{:.2f}"), {"values": [[1]]}, r"\[1\] cannot be written as"),
        (values.format_text(format="{:10000000000}"), {"values": [1]}, "has at most 10000 characters"),
        (values.format_text(values=2, format="{:{}}"), {"values": [1, 10**10]}, "has at most 10000 characters"),
        (values.format_fields(format="{b}"), {"fields": {"a": 1}}, "wants the value 'b', but there are a"),
        (values.format_fields(format="{}"), {"fields": {"a": 1}}, "wants the value"),
    ],
)
def test_a_format_that_does_not_fit_its_values_says_so(node: Any, inputs: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        fire(node, **inputs)
