"""The page can be used with a keyboard and a screen reader: axe finds nothing serious in its main states."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import count, jam, mission, of_all_kinds, workshop

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


def notes_and_frames(story: Story) -> None:
    story.select("scale")
    story.press("Control+j")
    story.page.get_by_label("Name of the frame").press("Enter")
    story.page.locator("#canvas").focus()
    story.press("n")
    story.page.get_by_label("Text of the note").fill("Read this.")


def near(story: Story) -> None:
    story.start()
    story.page.mouse.move(*story.middle(story.node("scale")))
    story.page.mouse.wheel(0, -600)
    expect(story.page.locator("#canvas")).to_have_class(re.compile(r"\bnear\b"))
    story.page.locator(".pv .known").first.wait_for()


def far_inside(story: Story) -> None:
    story.start()
    story.page.locator("#canvas").focus()
    story.press("u")
    story.node("errand/there").wait_for()
    story.page.mouse.move(*story.empty_place())
    story.page.mouse.wheel(0, 1200)
    story.page.locator(".far-label").first.wait_for()


def several(story: Story) -> None:
    story.choose("scale", "check")
    expect(story.page.locator("#side h2").first).to_have_text("2 nodes")


def keys(story: Story) -> None:
    story.press("?")


def open_file(story: Story) -> None:
    story.press("Control+o")


def of_an_edge(story: Story) -> None:
    hit = story.page.locator('[data-edges="clock.tick -> heard.hear"] .hit')
    hit.evaluate("wire => wire.dispatchEvent(new MouseEvent('click', {bubbles: true}))")
    expect(story.page.locator("#side h2").first).to_have_text("Edge")
    story.page.get_by_label("operators").select_option(label="debounce")
    story.page.get_by_label("pauses here").click()
    story.page.locator(".when").wait_for()


def gate_and_promotion(story: Story) -> None:
    story.node("pace").locator(".t b").dblclick()
    story.select("pace/times")
    story.page.get_by_label("factor").last.wait_for()


def all_widgets(story: Story) -> None:
    story.select("all")
    story.page.get_by_label("loud").wait_for()


def waiting(story: Story) -> None:
    story.start()
    story.page.locator(".full-mark").first.wait_for()
    story.select("numbers")


def start_page(story: Story) -> None:
    story.page.get_by_role("button", name="Run it").wait_for()


def stage_and_tour(story: Story) -> None:
    story.page.get_by_role("button", name="Take the tour").click()
    story.page.locator("#stage .caption", has_text="seen").wait_for()


def actions(story: Story) -> None:
    story.page.get_by_role("button", name="Run it").click()
    story.node("camera").wait_for()
    story.press("x")
    story.page.get_by_role("menuitem", name="Push the ball").click()
    story.page.get_by_role("dialog").wait_for()


def kinds() -> hfg.Graph:
    graph = hfg.Graph("kinds")
    graph.connect(graph.add(count(), name="numbers").out, graph.add(of_all_kinds(), name="all").value)
    return graph


def empty() -> hfg.Graph:
    return hfg.Graph("graph")


MORE: list[tuple[Callable[[], hfg.Graph], Callable[[Story], None]]] = [
    (mission, notes_and_frames),
    (mission, near),
    (mission, far_inside),
    (mission, several),
    (mission, keys),
    (mission, open_file),
    (workshop, of_an_edge),
    (workshop, gate_and_promotion),
    (kinds, all_widgets),
    (jam, waiting),
    (empty, start_page),
    (empty, stage_and_tour),
    (empty, actions),
]


def serious(story: Story) -> list[str]:
    found = Axe().run(story.page).response["violations"]
    return [f"{one['id']}: {one['nodes'][0]['target']}" for one in found if one["impact"] in ("serious", "critical")]


@pytest.mark.parametrize("act", [run_it, inside, palette, commands, outline_and_problems])
def test_axe_finds_nothing_serious_in_light_and_dark(story: Story, act: Callable[[Story], None]) -> None:
    act(story)
    assert serious(story) == []
    story.page.evaluate("document.documentElement.dataset.theme = 'dark'")
    assert serious(story) == []


@pytest.mark.parametrize(("build", "act"), MORE)
def test_axe_finds_nothing_serious_in_editors_views_and_dialogs(
    open_studio: Open, build: Callable[[], hfg.Graph], act: Callable[[Story], None]
) -> None:
    story = open_studio(build())
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


def test_a_browser_that_is_too_old_reads_which_ones_are_not(story: Story) -> None:
    story.page.route("**/assets/index.js", lambda route: route.fulfill(body="", content_type="text/javascript"))
    story.page.reload()
    story.page.evaluate("document.getAnimations().forEach(one => one.finish())")  # it waits for slow connections
    expect(story.page.get_by_text("Firefox 113")).to_be_visible()
    story.page.unroute("**/assets/index.js")
