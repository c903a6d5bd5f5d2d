"""Texts: joined, parted, replaced, searched, compared and made of values.

Formats and patterns are parameters, so they come from the author of the graph; still, a format cannot access attributes
or items of a value, or make a text that uses up all memory. Depends on nodetype, functions and ports.
"""

from __future__ import annotations

import functools
import re
import string
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, Literal, NamedTuple

from annotated_types import Interval, MaxLen, MinLen, Predicate

from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Parameter

# --- joining and parting ---


@node(inputs={"parts": Inputs(object, 2)}, outputs=str, parameters={"separator": ""})
def join_text(*parts: object, separator: str) -> str:
    """Join the values at all inputs to one text.

    Fires once all inputs hold a token. Anything else than text is written as by `str`.

    Args:
      parts: any number of values.
      separator: what stands between two of them.
    """
    return separator.join(map(str, parts))


@node
def join_list(items: Sequence[object], *, separator: str = ", ") -> str:
    """Join the items of a list to one text.

    Args:
      items: anything else than text is written as by `str`.
      separator: what stands between two of them.
    """
    return separator.join(map(str, items))


@node
def split_text(text: str, *, separator: str = "", most: Annotated[int, Interval(ge=0)] = 0) -> list[str]:
    """Part a text wherever a separator stands.

    Args:
      text: any text.
      separator: where it is parted; an empty one means any run of blanks and line ends, which leaves no empty parts.
      most: how often it is parted at most, from the left; 0 is as often as it goes.
    """
    return text.split(separator or None, most or -1)


@node
def split_lines(text: str) -> list[str]:
    """Part a text into its lines, without the ends of them.

    Args:
      text: any text.
    """
    return text.splitlines()


@node
def slice_text(text: str, *, start: int = 0, stop: int | None = None) -> str:
    """Return a part of a text, as `text[start:stop]` does.

    Args:
      text: any text.
      start: the place of the first character, from 0; negative ones count from the end.
      stop: the index after the last character; None is the end.
    """
    return text[start:stop]


# --- changing ---


@node
def replace_text(text: str, *, needle: Annotated[str, MinLen(1)] = " ", replacement: str = "") -> str:
    """Put another text in all places where one stands.

    Args:
      text: any text.
      needle: what is replaced.
      replacement: what takes its place.

    CS::APEX: csapex::ReplaceString.
    """
    return text.replace(needle, replacement)


def is_a_pattern(pattern: str) -> bool:
    """Say whether it is a regular expression."""
    try:
        re.compile(pattern)
    except (re.error, OverflowError, RecursionError):
        return False
    return True


@node
def replace_pattern(
    text: str, *, pattern: Annotated[str, Predicate(is_a_pattern)] = r"\s+", replacement: str = " "
) -> str:
    r"""Put a text in all places that a regular expression finds.

    Args:
      text: any text.
      pattern: of Python's `re`; one with nested repetitions may take very long.
      replacement: what takes the place; `\1` or `\g<name>` is what a group found.

    Raises:
      ValueError: the replacement names a group that the pattern does not have, or an escape that does not exist.
    """
    try:
        return re.sub(pattern, replacement, text)
    except (re.error, IndexError) as error:
        raise ValueError(
            f"the replacement {replacement!r:.80} does not fit the pattern {pattern!r:.80}: {error}"
        ) from None


@node
def change_case(text: str, *, case: Literal["lower", "upper", "title", "capitalize", "swap", "fold"] = "lower") -> str:
    """Write a text in other letters.

    Args:
      text: any text.
      case: "title" begins each word with a capital, "capitalize" the text, "swap" exchanges large and small, "fold" is
        for comparing without regard to them.
    """
    match case:
        case "lower":
            return text.lower()
        case "upper":
            return text.upper()
        case "title":
            return text.title()
        case "capitalize":
            return text.capitalize()
        case "swap":
            return text.swapcase()
        case _:
            return text.casefold()


@node
def strip_text(text: str, *, characters: str = "", side: Literal["both", "left", "right"] = "both") -> str:
    """Take blanks, or other characters, off the ends of a text.

    Args:
      text: any text.
      characters: which ones; none means blanks and line ends.
      side: which end.
    """
    which = characters or None
    return text.lstrip(which) if side == "left" else text.rstrip(which) if side == "right" else text.strip(which)


@node
def pad_text(
    text: str,
    *,
    width: Annotated[int, Interval(ge=0, le=10_000)] = 10,
    filling: Annotated[str, MinLen(1), MaxLen(1)] = " ",
    align: Literal["left", "right", "centre"] = "left",
) -> str:
    """Make a text as wide as a column.

    Args:
      text: a longer one stays as it is.
      width: in characters.
      filling: the character that is added.
      align: where the text stands.
    """
    if align == "right":
        return text.rjust(width, filling)
    return text.center(width, filling) if align == "centre" else text.ljust(width, filling)


# --- asking ---


@node
def text_length(text: str) -> int:
    """Count the characters of a text.

    Args:
      text: any text.
    """
    return len(text)


@node
def contains_text(
    text: str, *, needle: str = "", where: Literal["anywhere", "start", "end", "whole"] = "anywhere", fold: bool = False
) -> bool:
    """Say whether a text has another one in it, at its start or end, or is the same.

    Args:
      text: any text.
      needle: what is looked for; an empty one is in every text.
      where: where it is looked for.
      fold: whether large and small letters are the same.
    """
    if fold:
        text, needle = text.casefold(), needle.casefold()
    match where:
        case "start":
            return text.startswith(needle)
        case "end":
            return text.endswith(needle)
        case "whole":
            return text == needle
        case _:
            return needle in text


@node
def count_in_text(text: str, *, needle: Annotated[str, MinLen(1)] = " ") -> int:
    """Count how often one text stands in another, without overlaps.

    Args:
      text: any text.
      needle: what is counted.
    """
    return text.count(needle)


@node
def matches_text(text: str, *, pattern: Annotated[str, Predicate(is_a_pattern)] = ".*", whole: bool = True) -> bool:
    """Say whether a regular expression describes a text.

    Args:
      text: any text.
      pattern: of Python's `re`; one with nested repetitions may take very long.
      whole: whether it must describe all of the text, not only a part of it.
    """
    return (re.fullmatch(pattern, text) if whole else re.search(pattern, text)) is not None


class Found(NamedTuple):
    """The outputs of `search_text`."""

    found: str
    groups: list[str]
    names: dict[str, str]


@node(outputs=Found)
def search_text(text: str, *, pattern: Annotated[str, Predicate(is_a_pattern)] = r"\S+") -> Found | None:
    """Return the first place in a text that a regular expression describes; silent if there is none.

    Args:
      text: any text.
      pattern: of Python's `re`; one with nested repetitions may take very long.

    Returns:
      found: the text that matches the pattern.
      groups: the text of each group; "" for a group that took no part.
      names: the same by name, of groups that have names.
    """
    match = re.search(pattern, text)
    return None if match is None else Found(match[0], list(match.groups("")), match.groupdict(""))


@node
def find_all(text: str, *, pattern: Annotated[str, Predicate(is_a_pattern)] = r"\S+") -> list[str]:
    """Return all places in a text that a regular expression describes, as they come.

    Args:
      text: any text.
      pattern: of Python's `re`; one with nested repetitions may take very long.
    """
    return [match[0] for match in re.finditer(pattern, text)]


class TextCompare(Node):
    """Compare two texts, and signal whether they are equal.

    Attributes:
      a: the first text.
      b: the second one.
      fold: whether large and small letters are the same.
      equal: the first text, if they are equal.
      different: the first text, if they are not.

    CS::APEX: csapex::TextCompare.
    """

    a = Input(str)
    b = Input(str)
    equal = Event(str)
    different = Event(str)
    fold = Parameter(False)

    def process(self, a: str, b: str) -> None:
        """Trigger one of the events."""
        same = a.casefold() == b.casefold() if self.fold else a == b
        (self.equal if same else self.different).trigger(a)


# --- texts of values ---

_LONGEST: Final = 10_000
"""The widest field; `"{:1000000000}"` would take the memory of the machine."""


class _Formatter(string.Formatter):
    """Formats values, but reaches into none: `{0.__class__}` leads to everything that Python knows."""

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        if "." in field_name or "[" in field_name:
            raise ValueError(f"a format reaches into no value, got {{{field_name}}}; take it apart by a node before")
        return self.get_value(int(field_name) if field_name.isdecimal() else field_name, args, kwargs), field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        if any(int(number) > _LONGEST for number in re.findall(r"[0-9]+", format_spec)):
            raise ValueError(f"a field of a format has at most {_LONGEST} characters, got {{:{format_spec}}}")
        try:
            return str(format(value, format_spec))
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"{value!r:.80} cannot be written as {{:{format_spec}}}: {error}") from None

    def convert_field(self, value: Any, conversion: str | None) -> Any:
        return super().convert_field(value, conversion)


_FORMATTER: Final = _Formatter()


@functools.lru_cache(maxsize=256)
def _wrong_format(text: str) -> str | None:
    """Say what is wrong with a format whatever the values are."""
    try:
        for _, name, spec, conversion in string.Formatter().parse(text):
            if name is not None and ("." in name or "[" in name):
                return f"it reaches into a value by {{{name}}}"
            if conversion not in (None, "", "r", "s", "a"):
                return f"it has no conversion !{conversion}"
            if spec and (wrong := _wrong_format(spec)):
                return wrong
    except ValueError as error:
        return str(error)
    return None


def is_a_format(text: str) -> bool:
    """Say whether it is a format as `str.format` has it, without `.` and `[` inside of the braces."""
    return _wrong_format(text) is None


def format_safely(text: str, args: Sequence[Any], fields: Mapping[str, Any]) -> str:
    """Format values.

    Raises:
      ValueError: the format and the values do not fit each other.
    """
    try:
        return _FORMATTER.vformat(text, args, fields)
    except (IndexError, KeyError) as error:
        have = ", ".join(map(str, fields)) if fields else f"{len(args)} of them"
        raise ValueError(f"the format {text!r:.80} wants the value {error}, but there are {have or 'none'}") from None


@node(
    inputs={"values": Inputs(object, 1)},
    outputs=str,
    parameters={"format": Parameter("{}", Predicate(is_a_format), MaxLen(100_000))},
)
def format_text(*values: object, format: str) -> str:  # noqa: A002 - the word of the trade
    """Write values into a text, as `str.format` does: "{:.2f} m of {}".

    Fires once all inputs hold a token. The format reaches no attributes and no items of a value, and no field has more
    than 10,000 characters.

    Args:
      values: any number of values, called {}, or {0}, {1} ...
      format: the text with a pair of braces for each value; braces of the text itself are doubled.

    Raises:
      ValueError: the format wants a value that is not there, or one cannot be written so.

    CS::APEX: csapex::GenericTextCombiner.
    """
    return format_safely(format, values, {})


@node
def format_fields(
    fields: Mapping[str, object],
    *,
    format: Annotated[str, Predicate(is_a_format), MaxLen(100_000)] = "",  # noqa: A002 - the word of the trade
) -> str:
    """Write the values of a dict into a text by their names: "{name} is {age:d}".

    The format reaches no attributes and no items of a value, and no field has more than 10,000 characters.

    Args:
      fields: values by name.
      format: the text with a name in braces for each value; braces of the text itself are doubled.

    Raises:
      ValueError: the format wants a value that is not there, or one cannot be written so.
    """
    return format_safely(format, (), fields)
