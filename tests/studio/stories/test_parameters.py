"""A person changes parameters while the graph runs; the studio decides what is allowed."""

from __future__ import annotations

import pytest
from playwright.sync_api import Locator, expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import count, of_all_kinds

pytestmark = pytest.mark.slow


def field(story: Story, name: str) -> Locator:
    return story.page.locator("#side").get_by_label(name, exact=True)


def test_a_typed_value_applies_at_once(story: Story) -> None:
    story.start()
    story.select("scale")
    field(story, "factor").fill("5")
    story.press("Enter")
    story.bench.until(lambda: story.graph["scale"].factor == 5)
    story.bench.until(lambda: story.graph["store"].last % 5 == 0 and story.graph["store"].last > 0)
    expect(field(story, "factor")).to_have_value("5")


def test_keys_move_a_value_by_steps_and_undo_takes_it_back(story: Story) -> None:
    story.select("scale")
    field(story, "factor").click()
    story.press("ArrowUp")
    story.bench.until(lambda: story.graph["scale"].factor == 3)
    story.press("Escape")
    story.page.locator("#canvas").click(position={"x": 300, "y": 20})
    story.press("Control+z")
    story.bench.until(lambda: story.graph["scale"].factor == 2)


def test_a_drag_is_one_step_of_the_history(story: Story) -> None:
    story.start()
    story.select("scale")
    story.settle()
    box = story.page.locator('[data-slider="factor"]').bounding_box()
    assert box is not None
    mouse = story.page.mouse
    mouse.move(box["x"] + box["width"] * 0.2, box["y"] + 8)
    mouse.down()
    mouse.move(box["x"] + box["width"] * 0.9, box["y"] + 8, steps=12)
    mouse.up()
    story.bench.until(lambda: story.graph["scale"].factor == 9)
    done = story.bench.call(lambda: len(story.bench.studio.tables.of["studio"]["history"].done))
    assert done == 1
    story.press("Control+z")
    story.bench.until(lambda: story.graph["scale"].factor == 2)


def test_a_value_out_of_its_limits_is_refused_in_the_words_of_the_engine(story: Story) -> None:
    story.select("scale")
    field(story, "factor").fill("11")
    story.press("Enter")
    expect(story.page.locator(".par-note")).to_contain_text("10")
    expect(story.page.locator(".par-note")).to_contain_text("It stays at 2")
    assert story.bench.node("scale").factor == 2


def test_a_double_click_on_the_name_resets_a_value(story: Story) -> None:
    story.select("scale")
    field(story, "factor").fill("7")
    story.press("Enter")
    expect(field(story, "factor")).to_have_value("7")
    story.page.locator("#side label", has_text="factor").dblclick()
    story.bench.until(lambda: story.graph["scale"].factor == 2)


def test_whoever_is_faster_than_the_studio_goes_on_from_what_was_set(story: Story) -> None:
    story.select("scale")
    with story.bench.held():
        field(story, "factor").fill("7")
        story.press("Enter")
        expect(field(story, "factor")).to_have_value("7")
        story.press("ArrowUp", "ArrowUp")
        expect(field(story, "factor")).to_have_value("9")
    story.bench.until(lambda: story.graph["scale"].factor == 9)
    with story.bench.held():
        field(story, "factor").fill("3")
        story.press("Enter")
        story.page.locator("#side label", has_text="factor").dblclick()
    story.settle()
    assert story.bench.node("scale").factor == 2
    expect(field(story, "factor")).to_have_value("2")


def test_each_kind_of_parameter_of_a_function_has_its_widget(open_studio: Open) -> None:
    graph = hfg.Graph("kinds")
    graph.connect(graph.add(count(), name="numbers").out, graph.add(of_all_kinds(), name="all").value)
    story = open_studio(graph)
    node = story.bench.node("all")
    story.select("all")
    box = field(story, "loud")
    expect(box).to_have_attribute("type", "checkbox")
    box.click()
    story.bench.until(lambda: node.loud is True)
    field(story, "way").select_option("back")
    story.bench.until(lambda: node.way == "back")
    expect(field(story, "seed")).to_have_value("")  # None
    field(story, "seed").fill("4")
    story.press("Enter")
    story.bench.until(lambda: node.seed == 4)
    expect(field(story, "seed")).to_have_value("4")
    field(story, "seed").fill("")
    story.press("Enter")
    story.bench.until(lambda: node.seed is None)
    story.page.get_by_label("size, 2 of 2").fill("7")
    story.press("Enter")
    story.bench.until(lambda: node.size == (5, 7))
    story.page.get_by_role("group", name="days").get_by_label("sun").click()
    story.bench.until(lambda: node.days == {"sat", "sun"})
