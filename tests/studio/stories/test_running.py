"""A person starts, pauses, steps and stops a graph, and sees what it does."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.studio.stories.bench import Story
from tests.studio.stories.graphs import LONG_S

pytestmark = pytest.mark.slow


def test_all_nodes_of_the_graph_are_on_the_page(story: Story) -> None:
    for path in story.graph.nodes:
        expect(story.node(path)).to_be_visible()
    expect(story.page.locator("#status")).to_contain_text("12 nodes")


def test_space_starts_the_graph_and_the_page_shows_its_time(story: Story) -> None:
    story.press("Space")
    story.bench.until(lambda: story.graph["store"].seen > 2)
    expect(story.page.locator(".live")).to_have_text("live")
    expect(story.page.locator(".clock")).to_contain_text(re.compile(r"[1-9]\d*\.\d\d s|0\.\d*[1-9]\d* s"))


def test_pause_lets_nothing_fire_until_it_goes_on(story: Story) -> None:
    story.start()
    story.moves_on("store")
    story.press("Space")
    story.bench.state("paused")
    expect(story.page.locator(".clock")).to_contain_text("paused")
    held = story.bench.node("store").seen
    assert story.bench.node("store").seen == held
    story.press("Space")
    story.moves_on("store")


def test_a_step_moves_a_paused_graph_by_one_wave(story: Story) -> None:
    story.start()
    story.moves_on("store")
    story.press("Space")
    story.bench.state("paused")
    for _ in range(8):  # what was under way may take several
        before = story.bench.node("store").seen
        story.press(".")
        story.settle()
        if story.bench.node("store").seen > before:
            break
    assert before < story.bench.node("store").seen <= before + 2


def test_the_run_ends_when_one_stops_it(story: Story) -> None:
    story.start()
    story.press("Shift+Escape")
    story.bench.state("ended")
    expect(story.page.locator("#top")).to_contain_text("ended")
    expect(story.page.get_by_role("button", name="Start")).to_be_visible()


def test_whoever_has_the_activity_has_the_ring(story: Story) -> None:
    story.bench.set("rest", "duration", LONG_S)
    story.start()
    rest, errand = story.node("rest"), story.node("errand")
    expect(rest).to_have_class(re.compile(r"\bactive\b"))
    expect(errand).not_to_have_class(re.compile(r"\bactive\b"))
    assert story.bench.call(lambda: story.bench.is_active("rest"))
    story.bench.set("errand/back", "duration", LONG_S)
    story.bench.set("rest", "duration", 0.1)
    expect(errand).to_contain_text("back")
    expect(errand).to_have_class(re.compile(r"\bactive\b"))
    expect(rest).not_to_have_class(re.compile(r"\bactive\b"))


def test_the_reset_of_activity_begins_at_the_start_again(story: Story) -> None:
    story.bench.set("rest", "duration", LONG_S)
    story.start()
    story.bench.until(lambda: story.bench.is_active("rest"), "the errand is over")
    story.press("Control+k")
    story.page.keyboard.type("reset the act")
    story.press("Enter")
    story.bench.until(lambda: story.bench.is_active("errand/there"), "it begins again")


def test_a_breakpoint_pauses_where_it_is_set(story: Story) -> None:
    story.start()
    story.select("check")
    story.press("F9")
    story.bench.state("paused")
    expect(story.page.locator(".clock")).to_contain_text("check")
    expect(story.node("check").locator(".brk")).to_be_visible()
    assert "check" in story.bench.call(story.bench.studio.steering.breakpoints)
    story.press("F9", "Space")
    story.moves_on("store")


def test_a_failure_is_said_once_and_the_list_leads_to_the_node(story: Story) -> None:
    story.start()
    story.bench.set("check", "limit", 0)
    story.bench.state("ended")
    expect(story.page.locator(".toast.bad")).to_contain_text("is too large")
    story.page.get_by_role("tab", name="Problems").click()
    story.page.get_by_role("button", name="Go to node").first.click()
    expect(story.page.locator("#side h2").first).to_have_text("check")
    expect(story.node("check")).to_have_class(re.compile(r"\bfailed\b"))


def test_bars_and_figures_of_nodes_come_from_the_engine(story: Story) -> None:
    story.start()
    story.moves_on("store")
    expect(story.node("scale").locator(".m")).to_contain_text(re.compile(r"\d+\.\d Hz"))
    story.select("scale")
    expect(story.page.locator("#side .facts")).to_contain_text(re.compile(r"median\s*\d+(\.\d+)? [µm]s"))
