"""Finds types in a catalogue by words, by name and by category. Stands on descriptions alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hfg.catalogue.describing import TypeDescription

__all__ = ["categories", "named", "search"]


def search(types: Iterable[TypeDescription], words: str) -> list[TypeDescription]:
    """Give the types of which every word is said somewhere: name, category, CS::APEX names, ports, documentation.

    Best first: words in the name before words in the first line, those before the rest; else in the given order.

    Example:
      >>> import hfg
      >>> from hfg.catalogue import describe_type
      >>> @hfg.node
      ... def delay(value: object) -> object:
      ...     '''Hold each value back.'''
      ...     return value
      >>> [one.name for one in search([describe_type(delay)], "hold VALUE")]
      ['delay']
    """
    wanted = words.lower().split()
    rated = [(_distance(described, wanted), described) for described in types]
    return [described for distance, described in sorted(rated, key=lambda one: one[0] or 0) if distance is not None]


def _distance(described: TypeDescription, words: Sequence[str]) -> int | None:
    """Say how far from the name the words are said; None if one of them is nowhere."""
    name = f"{described.name} {described.title}".lower()
    nearer = (described.category, described.summary, *described.apex)
    ports = (part for _, port in described.ports() for part in (port.name, port.doc))
    parameters = (part for one in described.parameters for part in (one.name, one.doc))
    layers = [name, " ".join(nearer).lower(), " ".join((described.doc, *ports, *parameters)).lower()]
    total = 0
    for word in words:
        if word in (described.name, described.title.lower()):
            continue  # the name itself: nearest of all
        layer = next((index for index, text in enumerate(layers) if word in text), None)
        if layer is None:
            return None
        total += layer + 1
    return total


def named(types: Iterable[TypeDescription], name: str) -> list[TypeDescription]:
    """Give the types that somebody may mean by a name: a reference, "flow:delay", "flow.delay", "delay", "Delay".

    Those that are spelled exactly so come alone; else those that differ by upper and lower case or by underscores.
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


def categories(types: Iterable[TypeDescription]) -> dict[str, list[TypeDescription]]:
    """Group types by category, both in the order of their first appearance."""
    found: dict[str, list[TypeDescription]] = {}
    for described in types:
        found.setdefault(described.category, []).append(described)
    return found
