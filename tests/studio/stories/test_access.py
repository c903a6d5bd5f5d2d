"""The page can be used with a keyboard and a screen reader: axe finds nothing serious in its main states."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from tests.studio.stories.bench import Story

pytestmark = pytest.mark.slow


def run_it(story: Story) -> None:
    story.start()
    story.select("scale")


def inside(story: Story) -> None:
    story.node("errand").dblclick(position={"x": 12, "y": 28})
    story.node("errand/there").wait_for()


def palette(story: Story) -> None:
    story.page.mouse.dblclick(*story.empty_place())
    story.page.locator(".palette li").first.wait_for()


def commands(story: Story) -> None:
    story.press("Control+k")


def outline_and_problems(story: Story) -> None:
    story.press("o")
    story.page.get_by_role("tab", name="Problems").click()


def serious(story: Story) -> list[str]:
    found = Axe().run(story.page).response["violations"]
    return [f"{one['id']}: {one['nodes'][0]['target']}" for one in found if one["impact"] in ("serious", "critical")]


@pytest.mark.parametrize("act", [run_it, inside, palette, commands, outline_and_problems])
def test_axe_finds_nothing_serious_in_light_and_dark(story: Story, act: Callable[[Story], None]) -> None:
    act(story)
    assert serious(story) == []
    story.page.evaluate("document.documentElement.dataset.theme = 'dark'")
    assert serious(story) == []


def test_stories_leave_no_loop_behind_for_other_tests(chromium: object) -> None:
    assert asyncio.run(asyncio.sleep(0, "done")) == "done"


def test_regions_are_reached_by_f6_and_the_canvas_opens_the_palette_by_tab(story: Story) -> None:
    story.press("F6")
    regions = set()
    for _ in range(5):
        regions.add(story.page.evaluate("document.activeElement.closest('#top, #rail, #canvas, #side, #time')?.id"))
        story.press("F6")
    assert regions == {"top", "rail", "canvas", "side", "time"}
    story.page.locator("#canvas").focus()
    story.press("Tab")
    expect(story.page.get_by_label("Which node?")).to_be_focused()
