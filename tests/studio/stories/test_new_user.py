"""Somebody who has read nothing builds a graph that finds coins in a photograph, with what the page offers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open

pytestmark = pytest.mark.slow

COINS = 6


@pytest.fixture
def photograph(tmp_path: Path) -> Path:
    """A photograph of coins on a dark table, with some dirt."""
    image = np.full((200, 300), 60, np.uint8)
    for number in range(COINS):
        place = 60 + 90 * (number % 3), 55 + 90 * (number // 3)
        cv2.circle(image, place, 26, 190, -1)
        cv2.circle(image, place, 14, 150, 3)
    image += np.random.default_rng(1).integers(0, 25, image.shape, np.uint8)
    cv2.imwrite(str(tmp_path / "coins.png"), image)
    return tmp_path


def add(story: Story, words: str) -> None:
    """Type what the node should do, and take the first that is offered."""
    story.page.get_by_label("Which node?").fill(words)
    story.page.locator(".palette li.sel mark, .palette .doc h4").first.wait_for()
    story.settle()
    story.press("Enter")
    story.settle()


def draw_a_wire_to_nothing(story: Story, port: str, dx: int, dy: int = 0) -> None:
    x, y = story.middle(story.port(port))
    story.drag(port, (x + dx, y + dy))
    story.page.get_by_label("Which node?").wait_for()


def test_a_graph_that_finds_coins_is_built_from_nothing_and_one_parameter_tuned_by_looking(
    open_studio: Open, photograph: Path
) -> None:
    story = open_studio(hfg.Graph("graph"))
    side = story.page.locator("#side")
    story.page.get_by_role("button", name="New graph").click()
    story.page.mouse.dblclick(180, 220)
    add(story, "photo")
    side.get_by_label("pattern").fill(str(photograph / "*.png"))
    story.press("Enter")
    side.get_by_label("mode").select_option("gray")
    side.get_by_label("loop").click()
    draw_a_wire_to_nothing(story, "image_files.image", 120)
    add(story, "blur")
    draw_a_wire_to_nothing(story, "blur.out", 120)
    add(story, "coins")
    draw_a_wire_to_nothing(story, "hough_circles.out", -160, 160)
    add(story, "draw circ")
    story.drag("image_files.image", "draw_circles.image")
    story.settle()
    story.select("draw_circles")
    side.locator(".prt").get_by_role("button", name="out", exact=True).click()
    story.page.get_by_role("button", name="Add a node that shows it").click()
    expect(story.node("show")).to_be_visible()
    assert len(story.bench.call(lambda: list(story.graph.nodes))) == 5
    assert not [one for one in story.bench.call(story.graph.check) if one.severity == "error"]

    story.select("hough_circles")
    side.get_by_label("min dist").fill("40")
    story.press("Enter")
    story.start()
    story.select("draw_circles")
    expect(side.locator(".prt", has_text="circles").locator(".v")).to_have_text("silent")  # none are found yet
    story.select("hough_circles")
    story.settle()
    box = story.page.locator('[data-slider="param2"]').bounding_box()
    assert box is not None
    mouse = story.page.mouse
    mouse.move(box["x"] + box["width"] * 0.4, box["y"] + 8)
    mouse.down()
    mouse.move(box["x"] + box["width"] * 0.1, box["y"] + 8, steps=12)
    mouse.up()
    story.select("draw_circles")
    expect(side.locator(".prt", has_text="circles").locator(".v")).to_have_text(f"float32, {COINS} x 1 x 3")
    expect(story.page.locator('#stage [data-view="show#newest"]')).to_be_visible()
    expect(story.page.locator("#stage .caption")).to_have_text("300 x 200")


def test_a_graph_without_a_file_asks_for_a_name_when_it_is_saved(open_studio: Open, tmp_path: Path) -> None:
    story = open_studio(hfg.Graph("graph"))
    story.page.get_by_role("button", name="New graph").click()
    story.page.mouse.dblclick(180, 220)
    add(story, "photo")
    story.page.locator("#canvas").focus()
    story.press("Control+s")
    story.page.get_by_label("Save as").fill("coins")
    story.press("Enter")
    expect(story.page.locator(".filename")).to_have_text("coins.hfg.yaml")
    assert (tmp_path / "coins.hfg.yaml").read_text().startswith("hfg: 1")
