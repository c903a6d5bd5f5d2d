"""A person opens the graphs of the paper's figures: all their names can be read, in each view."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import expect

import hfg
from examples.figures import activity, robot
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open

pytestmark = pytest.mark.slow

FIGURES = (
    activity.figure_13,
    activity.figure_14,
    robot.figure_17a,
    robot.figure_17b,
    robot.figure_18,
    robot.figure_19,
)
VIEWS = {"1": "Activity", "2": "Mission", "3": "All edges"}

UNREADABLE = """() => {
  const names = [...document.querySelectorAll("#canvas :is(.node .t b, .pn, .wlabel, .far-name)")].map((one) => {
    const text = document.createRange();
    text.selectNodeContents(one);
    return [one.textContent, text.getBoundingClientRect(), one.closest(".node")?.getBoundingClientRect()];
  });
  const found = names.filter(([, a, node]) => node && a.right > node.right).map(([text]) => `${text} is cut off`);
  names.forEach(([text, a], at) => names.slice(at + 1).forEach(([other, b]) => {
    const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (wide > 2 && high > 3) found.push(`${text} lies on ${other}`);
  }));
  return [names.length, found];
}"""
"""How many names the page shows, and which of them cannot be read."""


def seen(story: Story) -> None:
    """Wait until the whole graph is on the screen, and look at all names."""
    story.settle()
    expect(story.page.locator("#canvas .node").first).to_be_visible()
    story.press("Home")
    story.frame()
    count, unreadable = story.page.evaluate(UNREADABLE)
    assert unreadable == []
    assert count >= 3


@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.__name__)
def test_no_name_is_cut_off_or_lies_on_another(open_studio: Open, figure: Callable[[], hfg.Graph]) -> None:
    story = open_studio(figure())
    for key, view in VIEWS.items():
        story.press(key)
        expect(story.page.get_by_role("button", name=view, exact=True)).to_have_attribute("aria-pressed", "true")
        seen(story)
        if figure is robot.figure_19:
            story.press("u")
            expect(story.node("fetch_cube/go_to")).to_be_visible()
            seen(story)
            story.press("u")
            expect(story.node("fetch_cube/go_to")).to_have_count(0)


def test_the_view_of_activity_says_so_if_no_node_has_any(open_studio: Open) -> None:
    story = open_studio(activity.figure_12())
    story.press("1")
    expect(story.page.locator("#canvas")).to_contain_text("No node here takes part in activity.")
    story.press("3")
    expect(story.node("v_k")).to_be_visible()


def test_code_with_several_graphs_is_opened_by_the_name_of_one(open_studio: Open, tmp_path: Path) -> None:
    shutil.copy(activity.__file__, tmp_path / "paper.py")
    story = open_studio(hfg.Graph("graph"))
    story.page.get_by_role("button", name="paper.py").click()
    dialog = story.page.get_by_role("dialog")
    expect(dialog.locator("h2")).to_have_text("Graphs in paper.py")
    dialog.get_by_role("button", name="figure_13").click()
    expect(dialog).to_have_count(0)
    expect(story.page.locator(".crumbs")).to_contain_text("figure 13")
    expect(story.node("v_b")).to_be_visible()
    story.press("Control+o")
    expect(dialog.locator("h2")).to_contain_text("Files in")
