"""A person looks in a narrow window: panels lie over the graph, and what is left out comes back with the room."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, expect

from tests.studio.stories.bench import Story
from tools.browser import WINDOW

pytestmark = pytest.mark.slow


@pytest.fixture
def narrow(story: Story) -> Iterator[Story]:
    story.page.set_viewport_size({"width": 900, "height": 900})
    yield story
    story.page.set_viewport_size(WINDOW)


def right(element: Locator) -> float:
    box = element.bounding_box()
    assert box is not None
    return box["x"] + box["width"]


def test_all_of_the_graph_stays_in_view_as_the_window_becomes_narrow(narrow: Story) -> None:
    expect(narrow.page.locator(".frame")).to_have_class(re.compile(r"\bnoside\b"))
    narrow.until(lambda: right(narrow.node("store")) < 900, "the last node is in view")
    expect(narrow.page.get_by_role("button", name="Start (Space)")).to_be_visible()
    expect(narrow.page.locator(".clock")).to_be_visible()
    for left_out in ("All edges", "Nothing to redo"):
        expect(narrow.page.get_by_role("button", name=left_out)).to_be_hidden()
    expect(narrow.page.get_by_role("tab", name="Log")).to_be_hidden()


def test_the_inspector_lies_over_the_graph_until_escape(narrow: Story) -> None:
    narrow.select("scale")
    narrow.press("i")
    side = narrow.page.locator("#side")
    expect(side).to_contain_text("factor")
    assert right(side) == 900
    canvas = narrow.page.locator("#canvas").bounding_box()
    assert canvas is not None
    assert canvas["width"] == 900 - 44  # as wide as without it
    narrow.page.locator("#canvas").focus()
    narrow.press("Escape")
    expect(side).to_be_hidden()
    expect(narrow.node("scale")).to_have_class(re.compile(r"\bsel\b"))  # the next Escape leaves that


def test_with_more_room_the_panels_are_back(narrow: Story) -> None:
    narrow.page.set_viewport_size(WINDOW)
    expect(narrow.page.locator("#side")).to_be_visible()
    expect(narrow.page.get_by_role("button", name="All edges")).to_be_visible()
