"""Drawings are legible on light and on dark screens: their style sheet is applied here as a browser does it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

from tests.graph.test_svg import at_random, mission

ROOT = Path(__file__).resolve().parents[2]
PICTURES = [file for file in sorted((ROOT / "docs" / "pictures").glob("*.svg")) if b'class="hfg"' in file.read_bytes()]
SVG = "{http://www.w3.org/2000/svg}"


class Rule(NamedTuple):
    """One rule for one selector."""

    selector: list[str]  # of the ancestors, then of the element
    weight: tuple[int, int]
    said: dict[str, str]


class Seen(NamedTuple):
    """An element with its colours."""

    element: ElementTree.Element
    look: dict[str, str]


def rules(style: str, *, dark: bool) -> list[Rule]:
    """Read a style sheet; those within the media query count on a dark screen."""
    plain, found, nested = style.partition("@media (prefers-color-scheme:dark){")
    assert found
    text = plain + (nested.rstrip().removesuffix("}") if dark else "")
    made = []
    for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", text):
        said = dict(one.split(":") for one in body.split(";") if one)
        for selector in selectors.split(","):
            parts = selector.split()
            classes = selector.count(".")
            made.append(Rule(parts, (classes, sum(not part.startswith(".") for part in parts)), said))
    return made


def fits(selector: str, element: ElementTree.Element) -> bool:
    tag, *classes = selector.split(".")
    named = set(element.get("class", "").split())
    return tag in ("", element.tag.removeprefix(SVG)) and named.issuperset(classes)


def applies(rule: Rule, ancestors: list[ElementTree.Element], element: ElementTree.Element) -> bool:
    *above, own = rule.selector
    return fits(own, element) and all(any(fits(one, other) for other in ancestors) for one in above)


def drawn(text: str, *, dark: bool) -> Iterator[Seen]:
    """Give each element the colours that a browser gives it: rules win over attributes, and both are inherited."""
    root = ElementTree.fromstring(text)
    style = root.find(f"{SVG}style")
    assert style is not None
    sheet = rules(style.text or "", dark=dark)

    def go(
        element: ElementTree.Element, ancestors: list[ElementTree.Element], inherited: dict[str, str]
    ) -> Iterator[Seen]:
        look = inherited | {name: value for name in ("stroke", "fill") if (value := element.get(name))}
        for rule in sorted((one for one in sheet if applies(one, ancestors, element)), key=lambda one: one.weight):
            look |= {name: value for name, value in rule.said.items() if name in ("stroke", "fill")}
        yield Seen(element, look)
        for child in element:
            yield from go(child, [*ancestors, element], look)

    yield from go(root, [], {"stroke": "none", "fill": "#000000"})


def lightness(colour: str) -> float:
    """Of a colour, 0 to 1, as the eye has it."""
    assert re.fullmatch("#[0-9a-f]{6}", colour), colour
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    return sum(
        share * (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4)
        for share, part in zip((0.2126, 0.7152, 0.0722), parts, strict=True)
    )


def contrast(one: str, other: str) -> float:
    """Between two colours, 1 to 21, as the Web Content Accessibility Guidelines have it."""
    darker, lighter = sorted((lightness(one), lightness(other)))
    return (lighter + 0.05) / (darker + 0.05)


def texts() -> list[tuple[str, str]]:
    found = [(file.name, file.read_text(encoding="utf-8")) for file in PICTURES]
    return [*found, ("mission", mission().draw(format="svg")), ("random", at_random(1).draw(format="svg"))]


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_no_label_has_an_outline_and_each_stands_out_from_what_it_lies_on(dark: bool) -> None:
    grounds = ("#0f1318", "#1f2730") if dark else ("#f3f5f8", "#ffffff")
    seen = 0
    for name, text in texts():
        for element, look in drawn(text, dark=dark):
            if element.tag == f"{SVG}text":
                seen += 1
                assert look["stroke"] == "none", f"{name}: {element.text}"
                assert all(contrast(look["fill"], ground) > 7 for ground in grounds), f"{name}: {element.text}"
    assert seen > 500


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_an_active_node_stands_out(dark: bool) -> None:
    text = (ROOT / "docs" / "pictures" / "robot_mission.svg").read_text(encoding="utf-8")
    active = [look for element, look in drawn(text, dark=dark) if "hfg-on" in element.get("class", "")]
    assert {look["stroke"] for look in active} == {"#ff7a3d" if dark else "#d9480f"}
