"""Finds types in a catalogue by words, by name and by category. Depends on descriptions only.

A search compares stems of whole words, so "planning" finds "plan" and "rate" does not find "separate". Words that mean
the same are in `thesaurus.txt`. An `Index` holds all words of a list of types; it can be stored, see `keeping`.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
import threading
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol, TypeVar

import msgspec

if TYPE_CHECKING:  # a search of the stored index needs no description
    from hfg.catalogue.describing import TypeDescription

_STEMMING: Final = threading.Lock()
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_a-zA-Z]+")
_IDLE_WORDS: Final = (
    "a an and are as at by can do for from get give how i in into is it its me my of on one or several some something "
    "that the them then there this to use using what when where which with without you"
)
_IDLE: Final = frozenset(_IDLE_WORDS.split())
"""Words without meaning for a search; they count only if there are no others."""

_NAME, _KIND, _SUMMARY, _PORT, _TEXT = 10.0, 5.0, 4.0, 1.2, 1.0
_ALIKE: Final = 0.75
"""How much less a word of the same meaning counts than the word itself."""
_RELATED: Final = 0.5
"""How much less a word counts that only starts in the same way, as "detector" and "detection"."""
_BEGUN: Final = 0.6
"""How much less a word counts that only starts with the letters typed so far."""
_AMID: Final = 0.2
"""How much less a name counts that has these letters somewhere else."""
_FEWEST_LETTERS: Final = 5
_WORST: Final = 0.2
"""Results are left out whose score is less than this part of the best one's."""


class Entry(msgspec.Struct, frozen=True):
    """What a list shows of a type."""

    reference: str
    title: str
    module: str
    category: str
    summary: str


class Index(msgspec.Struct, frozen=True):
    """All words of a list of types.

    Attributes:
      entries: the types, in their order.
      weights: by stem: which entries have it, by number, and how near to the name.
      lengths: how many words the name of each entry has.
      words: every word, with its stem.
    """

    entries: list[Entry]
    weights: dict[str, dict[int, float]]
    lengths: list[int]
    words: dict[str, str]


class _Listed(Protocol):
    """Something with a category."""

    @property
    def category(self) -> str: ...


L = TypeVar("L", bound=_Listed)


def search(types: Iterable[TypeDescription], words: str) -> list[TypeDescription]:
    """Return the types that the words describe, best first.

    Words count by their stems, and by what means the same; a word in the name counts more than one in the first line,
    that more than one in the rest. Types that have more of the words come first.

    Examples:
      >>> import hfg
      >>> from hfg.catalogue import describe_type
      >>> @hfg.node
      ... def delay(value: object) -> object:
      ...     '''Hold each value back.'''
      ...     return value
      >>> [one.name for one in search([describe_type(delay)], "delaying VALUES")]
      ['delay']
    """
    every = list(types)
    return [every[number] for number in ranked(index_of(every), words)]


def index_of(types: Iterable[TypeDescription]) -> Index:
    """Collect the words of types."""
    entries: list[Entry] = []
    weights: defaultdict[str, dict[int, float]] = defaultdict(dict)
    lengths: list[int] = []
    words: dict[str, str] = {}
    for number, one in enumerate(types):
        entries.append(Entry(one.reference, one.title, one.module, one.category, one.summary))
        lengths.append(len(_split(one.name)))
        for weight, text in _layers(one):
            for word in _split(text):
                stem = words.setdefault(word, "") or _stemmed(word)
                words[word] = stem
                before = weights[stem].get(number, 0.0)
                # a word that comes again adds a little, up to half as much again
                weights[stem][number] = weight if not before else min(before + 0.05 * weight, 1.5 * max(before, weight))
    rounded = {stem: {number: round(each, 2) for number, each in one.items()} for stem, one in weights.items()}
    return Index(entries, rounded, lengths, words)


def _layers(one: TypeDescription) -> Iterator[tuple[float, str]]:
    """Yield the texts of a type, nearest to the name first, with what a word there counts."""
    yield _NAME, one.name
    yield _NAME, " ".join(word for word in (one.title,) if word.lower().replace("_", "") != one.name.replace("_", ""))
    yield _KIND, " ".join(one.apex)
    yield _KIND / 2, one.category
    yield _SUMMARY, one.summary
    for _, port in one.ports():
        yield _PORT, f"{port.name} {port.doc}"
    for each in one.parameters:
        yield _PORT, f"{each.name} {each.doc} {' '.join(map(str, each.choices or ()))} {each.type}"
    yield _TEXT, one.text


def _split(text: str) -> list[str]:
    """Split a text into words, and names in snake or camel case into theirs."""
    return [word.lower() for word in _WORD.findall(text)]


def _stemmed(word: str) -> str:
    with _STEMMING:  # the stemmer keeps the word that it works on
        stem: str = _stemmer().stemWord(word)
    return stem


@functools.cache
def _stemmer() -> _Stemmer:
    import snowballstemmer  # which loads the stemmers of all languages: only if there is something to stem

    stemmer: _Stemmer = snowballstemmer.stemmer("english")
    return stemmer


class _Stemmer(Protocol):
    def stemWord(self, word: str) -> str: ...  # noqa: N802 - its own name


# --- searching ---


class _Found(NamedTuple):
    """What one word of a search found: which entries, and how well the word describes each of them."""

    scores: dict[int, float]
    weight: float


def ranked(index: Index, words: str, *, typing: bool = False) -> list[int]:
    """Return the numbers of the entries that the words describe, best first.

    Args:
      index: the words of the entries.
      words: to search for.
      typing: the user is typing, so the word at the end may be incomplete: "thr" finds "threshold".
    """
    wanted = _wanted(words)
    found = _all_found(index, wanted)
    if typing and wanted:
        _complete(index, _telling(words)[-1], found[-1])
    whole = sum(one.weight for one in found)
    scores: dict[int, float] = {}
    for number in {number for one in found for number in one.scores}:
        covered = sum(one.weight for one in found if number in one.scores) / whole
        scores[number] = sum(one.scores.get(number, 0.0) for one in found) * covered**2
        if covered == 1.0:
            scores[number] *= 1.0 + 0.4 * _share_of_name(index, number, wanted)
    best = max(scores.values(), default=0.0)
    kept = [number for number, score in scores.items() if score >= _WORST * best]
    return sorted(kept, key=lambda number: (-scores[number], number))


def unmatched(index: Index, words: str) -> list[str]:
    """Return the words of a search that no type has, nor one that means the same: results cover the others only."""
    found = _all_found(index, _wanted(words))
    return [word for word, one in zip(_telling(words), found, strict=True) if not one.scores]


def _all_found(index: Index, wanted: Sequence[str]) -> list[_Found]:
    found = [_found(index, wanted, place) for place in range(len(wanted))]
    for start, length, others in _meanings(wanted):
        _add_meanings(index, found[start : start + length], others)
    return found


def _wanted(words: str) -> list[str]:
    """Return the stems of the words that say something."""
    return [_stemmed(word) for word in _telling(words)]


def _telling(words: str) -> list[str]:
    every = _split(words)
    return [word for word in every if word not in _IDLE] or every


def _share_of_name(index: Index, number: int, wanted: Sequence[str]) -> float:
    """Return which share of an entry's name the words cover: "blur" is all of "blur", and half of "median_blur"."""
    named = sum(1 for stem in set(wanted) if index.weights.get(stem, {}).get(number, 0.0) >= _NAME)
    return min(1.0, named / max(1, index.lengths[number]))


def _found(index: Index, wanted: Sequence[str], place: int) -> _Found:
    """Find a word itself, and words that start like it."""
    stem = wanted[place]
    scores: dict[int, float] = {}
    weight = _rarity(index, stem)
    _add(scores, _scored(index, stem), 1.0)
    for other in _relatives(index, stem):
        _add(scores, _scored(index, other), _RELATED)
    if not scores:
        weight = math.log(1 + len(index.entries))  # an unknown word weighs as much as the rarest
    return _Found(scores, weight)


def _complete(index: Index, letters: str, found: _Found) -> None:
    """Let words count that start with these letters, and words that mean the same as those."""
    if len(letters) < _FEWEST_TYPED:
        return
    for word in index.words.keys() | _spoken():
        if not word.startswith(letters) or word == letters:
            continue
        stem = index.words.get(word) or _stemmed(word)
        _add(found.scores, _scored(index, stem), _BEGUN)
        for phrase in _thesaurus().get((stem,), ()):
            if len(phrase) == 1:
                _add(found.scores, _scored(index, phrase[0]), _BEGUN * _ALIKE)
    whole = math.log(1 + len(index.entries)) * _NAME
    for number, entry in enumerate(index.entries):
        name = entry.title.lower()
        if letters in name:  # of two names, the shorter one has more of it
            share = _BEGUN if any(one.startswith(letters) for one in _split(entry.title)) else _AMID
            score = whole * share * (1 + len(letters) / len(name))
            found.scores[number] = max(found.scores.get(number, 0.0), score)


_FEWEST_TYPED: Final = 2


def _relatives(index: Index, stem: str) -> list[str]:
    if len(stem) < _FEWEST_LETTERS:
        return []
    return [
        other
        for other in index.weights
        if other != stem
        and len(other) >= _FEWEST_LETTERS
        and (other.startswith(stem) or stem.startswith(other))
        and abs(len(other) - len(stem)) <= 4
    ]


def _scored(index: Index, stem: str) -> dict[int, float]:
    rarity = _rarity(index, stem)
    return {number: rarity * weight for number, weight in index.weights.get(stem, {}).items()}


def _rarity(index: Index, stem: str) -> float:
    return math.log(1 + len(index.entries) / (1 + len(index.weights.get(stem, ()))))


def _add(scores: dict[int, float], more: Mapping[int, float], share: float) -> None:
    for number, score in more.items():
        scores[number] = max(scores.get(number, 0.0), share * score)


def _add_meanings(index: Index, found: list[_Found], others: Sequence[tuple[str, ...]]) -> None:
    """Let words count that mean the same as those that were searched for; each of a phrase's words must be there."""
    for phrase in others:
        parts = [_scored(index, stem) for stem in phrase]
        both = set.intersection(*(set(one) for one in parts))
        for number in both:
            score = _ALIKE * sum(one[number] for one in parts) / len(found)
            for one in found:
                one.scores[number] = max(one.scores.get(number, 0.0), score)


def _meanings(wanted: Sequence[str]) -> Iterator[tuple[int, int, list[tuple[str, ...]]]]:
    """Yield where in the words something begins that has other words, how long it is, and those others."""
    known = _thesaurus()
    for start in range(len(wanted)):
        for length in range(1, len(wanted) - start + 1):
            others = known.get(tuple(wanted[start : start + length]))
            if others:
                yield start, length, others


@functools.cache
def _thesaurus() -> dict[tuple[str, ...], list[tuple[str, ...]]]:
    """Return, for each word or phrase, all that mean the same; as stems."""
    found: defaultdict[tuple[str, ...], list[tuple[str, ...]]] = defaultdict(list)
    for line in _lines():
        asked, arrow, meant = line.partition(">")
        group, others = _phrases(asked), _phrases(meant if arrow else asked)
        for one in group:
            found[one] += [other for other in others if other != one]
    return dict(found)


def _phrases(text: str) -> list[tuple[str, ...]]:
    return [tuple(_wanted(phrase)) for phrase in text.split(",")]


def near_words(index: Index, words: str) -> list[str]:
    """Return words that would find something, and are spelled like those that found nothing."""
    known = sorted({word for word in index.words if len(word) >= _FEWEST_LETTERS - 1} | _spoken())
    near = [one for word in _split(words) for one in difflib.get_close_matches(word, known, n=3, cutoff=0.7)]
    return list(dict.fromkeys(near))[:5]


def _spoken() -> set[str]:
    return {word for line in _lines() for word in _split(line)}


def _lines() -> list[str]:
    text = files("hfg.catalogue").joinpath("thesaurus.txt").read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.strip() and not line.startswith("#")]


# --- names and categories ---


def named(types: Iterable[TypeDescription], name: str) -> list[TypeDescription]:
    """Return the types that a name may mean: a reference, "flow:delay", "flow.delay", "delay", "Delay".

    If there are exact matches, returns only these; otherwise the types whose names differ in case or underscores.
    """
    wanted = name.strip()
    every = list(types)
    for form in (str, _loosely):
        found = [one for one in every if form(wanted) in {form(spelling) for spelling in _spellings(one)}]
        if found:
            return found
    return []


def _spellings(described: TypeDescription) -> set[str]:
    title, module = described.title, described.module
    short = f"{described.category}:{title}"
    last = f"{module.rpartition('.')[2]}:{title}"
    full = described.reference
    return {title, described.name, *(one for spelling in (full, short, last) for one in (spelling, _dotted(spelling)))}


def _dotted(spelling: str) -> str:
    return spelling.replace(":", ".")


def _loosely(text: str) -> str:
    return text.lower().replace("_", "").replace("-", "")


def categories(types: Iterable[L]) -> dict[str, list[L]]:
    """Group types by category, both in the order of their first appearance."""
    found: dict[str, list[L]] = {}
    for described in types:
        found.setdefault(described.category, []).append(described)
    return found
