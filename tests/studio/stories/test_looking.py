"""A person looks at values, pictures, time and the order of things."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Locator, expect

from tests.studio.stories.bench import Story
from tests.studio.stories.graphs import LONG_S

pytestmark = pytest.mark.slow

BRIGHT = """canvas => {
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return [canvas.width, canvas.height, data[4 * (canvas.width * 16 + 16)], data[4 * (canvas.width * 40 + 40)]];
}"""


def test_a_number_is_seen_at_the_port_and_plotted_when_pinned(story: Story) -> None:
    story.start()
    story.pin("scale", "out")
    expect(story.page.locator(".prt .v").last).to_have_text(re.compile(r"\d+"))
    plot = story.page.locator('[data-plot="scale.out"]')
    expect(plot).to_be_visible()
    shown = int(story.page.locator(".probe .r").inner_text().split()[0])
    story.bench.until(lambda: story.graph["store"].last >= shown, "what the page shows was sent")
    assert shown % 2 == 0


def test_a_picture_is_seen_as_the_node_draws_it(story: Story) -> None:
    story.start()
    story.pin("draw", "out")
    probe = story.page.locator('canvas[data-probe="draw.out"]')
    story.until(lambda: probe.evaluate(BRIGHT)[0] == 64, "the picture is there")
    width, height, square, ground = probe.evaluate(BRIGHT)
    assert (width, height) == (64, 48)
    assert square > 150
    assert ground < 60


def test_the_value_of_a_port_appears_where_the_mouse_rests(story: Story) -> None:
    story.start()
    story.moves_on("store")
    story.port("scale.out").hover()
    tip = story.page.get_by_role("tooltip")
    expect(tip).to_contain_text("scale.out")
    expect(tip).to_contain_text(re.compile(r"\d+\.\d Hz"))
    story.press("p")
    expect(story.page.get_by_role("region", name="Probe of scale.out")).to_be_visible()


def test_one_goes_into_a_subgraph_sees_its_activity_and_comes_back(story: Story) -> None:
    there, back = story.node("errand/there"), story.node("errand/back")
    story.bench.set("errand/there", "duration", LONG_S)
    story.bench.set("errand/back", "duration", LONG_S)
    story.start()
    story.node("errand").dblclick(position={"x": 12, "y": 28})
    expect(there).to_be_visible()
    expect(story.page.locator(".crumbs .here")).to_contain_text("errand")
    expect(there).to_have_class(re.compile(r"\bactive\b"))
    expect(back).not_to_have_class(re.compile(r"\bactive\b"))
    story.bench.set("errand/there", "duration", 0.1)
    expect(back).to_have_class(re.compile(r"\bactive\b"))
    story.page.locator("#canvas").focus()
    story.press("Escape", "Escape", "Backspace")
    expect(story.node("numbers")).to_be_visible()


def test_the_states_are_drawn_the_active_one_is_orange_and_a_click_selects_its_node(story: Story) -> None:
    def state(path: str) -> Locator:
        return story.page.locator(f'[data-state="{path}"]')

    story.bench.set("errand/there", "duration", LONG_S)
    story.bench.set("errand/back", "duration", LONG_S)
    story.start()
    story.page.get_by_role("button", name="States (S)").click()
    story.bench.until(lambda: story.bench.is_active("errand/there"), "the first state is active")
    on = re.compile(r"\bon\b")
    expect(state("errand/there")).to_have_class(on)
    expect(state("errand")).to_have_class(on)
    expect(state("errand/back")).not_to_have_class(on)
    expect(story.page.get_by_role("list", name="What is proved")).to_contain_text(
        "Exactly one is active: proved of 3 nodes"
    )
    story.bench.set("errand/there", "duration", 0.1)
    expect(state("errand/back")).to_have_class(on)
    story.bench.until(lambda: story.bench.is_active("errand/back"), "the second state is active")
    expect(state("errand/there")).not_to_have_class(on)
    state("rest").click()
    expect(story.node("rest")).to_have_class(re.compile(r"\bsel\b"))
    expect(story.page.locator("#side h2", has_text="rest")).to_be_visible()
    story.press("s")
    expect(state("rest")).to_have_count(0)


def test_a_choice_in_the_timeline_is_a_choice_in_the_graph(story: Story) -> None:
    story.start()
    box = story.page.locator("#time canvas").bounding_box()
    assert box is not None

    def is_chosen() -> bool:
        """Whether a span of activity has been drawn under the mouse."""
        story.page.mouse.click(box["x"] + 136 + (box["width"] - 148) * 0.04, box["y"] + 50)
        return story.page.locator("#side h2", has_text=re.compile("^(errand|rest)$")).count() > 0

    story.until(is_chosen, "a click on a span chooses the node")
    expect(story.page.locator("[data-node].sel")).to_have_count(1)
    story.press("l")
    expect(story.page.get_by_role("button", name="Follow", exact=True)).to_be_visible()


def test_the_outline_is_the_same_graph_and_leads_to_each_node(story: Story) -> None:
    story.press("o")
    tree = story.page.get_by_role("tree")
    for path in story.graph.nodes:
        expect(tree.locator(f'[data-outline="{path}"]')).to_be_visible()
    tree.locator('[data-outline="errand/back"]').click()
    expect(story.node("errand/back")).to_have_class(re.compile(r"\bsel\b"))
    story.press("e")
    story.bench.until(lambda: not story.bench.studio.tables.of["nodes"]["errand/back"].enabled)


def test_a_node_is_found_by_its_name_wherever_it_is(story: Story) -> None:
    story.press("Control+k")
    story.page.keyboard.type("back")
    story.press("Enter")
    expect(story.node("errand/back")).to_have_class(re.compile(r"\bsel\b"))
    expect(story.page.locator("#side h2").first).to_have_text("back")


def test_arrows_go_from_node_to_node_along_edges(story: Story) -> None:
    story.select("numbers")
    story.press("ArrowRight")
    reached = story.page.locator("#side h2").first
    expect(reached).to_have_text(re.compile("scale|draw"))


def test_the_page_has_the_theme_of_the_system_until_one_chooses_another_which_is_kept(story: Story) -> None:
    root = story.page.locator("html")
    expect(root).to_have_attribute("data-theme", "light")
    story.page.emulate_media(color_scheme="dark")
    story.page.reload()
    expect(root).to_have_attribute("data-theme", "dark")
    story.page.get_by_role("button", name="Show the light theme").click()
    expect(root).to_have_attribute("data-theme", "light")
    story.page.reload()
    expect(root).to_have_attribute("data-theme", "light")


def test_the_view_of_activity_alone_hides_data_and_comes_from_the_studio(story: Story) -> None:
    story.press("1")
    expect(story.page.get_by_role("button", name="Activity", exact=True)).to_have_attribute("aria-pressed", "true")
    story.bench.until(lambda: "activity:" in story.bench.studio.tables.of["layouts"])
    story.press("3")
    expect(story.page.get_by_role("button", name="All edges")).to_have_attribute("aria-pressed", "true")
    story.bench.until(lambda: "all:" in story.bench.studio.tables.of["layouts"])


def test_no_request_leaves_the_machine(story: Story) -> None:
    asked: list[str] = []
    story.page.on("request", lambda request: asked.append(request.url))
    story.page.reload()
    story.node("numbers").wait_for()
    base = story.bench.address.partition("/?")[0]
    assert asked
    assert [url for url in asked if not url.startswith((base, "blob:", "data:"))] == []


def test_what_one_chooses_in_a_level_takes_the_place_of_the_choice_outside(story: Story) -> None:
    story.select("errand")
    story.press("Enter")
    story.node("errand/there").wait_for()
    story.select("errand/there")
    expect(story.page.locator("#side h2").first).to_have_text("there")


def test_who_comes_back_to_a_level_does_not_wait_for_the_studio(story: Story) -> None:
    story.select("errand")
    story.press("Enter")
    story.node("errand/there").wait_for()
    with story.bench.held():
        story.press("Backspace")
        expect(story.node("numbers")).to_be_visible()
        story.press("Enter")
        expect(story.node("errand/there")).to_be_visible()


def test_a_node_that_lies_far_away_is_a_block_and_has_its_ports_again_when_one_comes_near(story: Story) -> None:
    story.page.mouse.move(*story.empty_place())
    for _ in range(3):
        story.page.mouse.wheel(0, 600)
    expect(story.page.locator("#canvas")).to_have_class(re.compile(r"\bfar\b"))
    expect(story.node("numbers")).to_be_visible()
    expect(story.port("numbers.out")).to_have_count(0)
    story.page.get_by_role("button", name="Zoom to 100 %").click()
    story.press("Home")
    expect(story.port("numbers.out")).to_be_visible()
