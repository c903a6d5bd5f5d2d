"""A person looks closely, and from far away: values at ports, what waits and why, what is inside of subgraphs."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Locator, expect

from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import LONG_S, jam

pytestmark = pytest.mark.slow


def come_near(story: Story, path: str) -> None:
    """Turn the wheel over a node until its ports have values beside them."""
    story.page.mouse.move(*story.middle(story.node(path)))
    for _ in range(3):
        story.page.mouse.wheel(0, -200)
    expect(story.page.locator("#canvas")).to_have_class(re.compile(r"\bnear\b"))


def beside(story: Story, node: str, kind: str) -> Locator:
    """What stands beside a port."""
    return story.page.locator(f'.react-flow__node[data-id="{node}"] .pv.{kind}')


def test_close_up_each_port_has_its_name_and_its_last_value(story: Story) -> None:
    come_near(story, "scale")
    expect(beside(story, "scale", "output")).to_contain_text("int")  # before there is a value, its type
    story.start()
    expect(beside(story, "scale", "output").locator(".known")).to_have_text(re.compile(r"^\d+$"))
    shown = int(beside(story, "scale", "output").locator(".known").inner_text())
    story.bench.until(lambda: story.graph["store"].last >= shown, "it was sent")
    assert shown % 2 == 0


def test_a_node_that_waits_says_for_what(open_studio: Open) -> None:
    story = open_studio(jam())
    story.start()
    expect(story.node("numbers").get_by_role("img", name="waits until scale took out")).to_be_visible()
    expect(story.node("bell").get_by_role("img", name="waits until a queue of its signals has room")).to_be_visible()
    expect(story.node("add").locator(".badge.waits")).to_have_count(0)
    story.select("numbers")
    expect(story.page.locator("#side")).to_contain_text(
        re.compile(r"waits until scale took out, for at least \d+\.\d s")
    )


def test_an_edge_that_holds_everything_up_shows_what_is_on_it(open_studio: Open) -> None:
    story = open_studio(jam())
    story.start()
    full = story.page.locator('[data-edges="bell.ring -> deaf.hear"]').get_by_label("full, 3 of 3")
    expect(full).to_be_visible()
    run = story.bench.studio.steering.run
    assert run is not None
    assert story.bench.call(lambda: run.statistics().nodes["bell"].doing) == "queue"
    expect(story.page.locator('[data-edges="scale.out -> stuck.value"]').get_by_label("full, 1 of 1")).to_be_visible()
    expect(story.page.locator(".full-mark")).to_have_count(2)


def test_a_node_that_is_off_says_so(open_studio: Open) -> None:
    story = open_studio(jam())
    expect(story.node("off")).to_contain_text("disabled")
    story.select("off")
    story.press("e")
    story.bench.until(lambda: story.bench.studio.tables.of["nodes"]["off"].enabled)
    expect(story.node("off")).not_to_contain_text("disabled")


def test_a_bundle_is_spread_under_the_mouse(open_studio: Open) -> None:
    story = open_studio(jam())
    story.press("2")
    bundle = story.page.locator('.wire-group[data-edges*="both.left -> add.left"]')
    expect(bundle.locator(".count-pill")).to_be_visible()
    expect(bundle.locator(".strand")).to_have_count(0)
    story.page.mouse.move(*story.middle(bundle.locator(".count-pill")))
    expect(bundle.locator(".strand")).to_have_count(2)
    story.page.mouse.move(*story.empty_place())
    expect(bundle.locator(".strand")).to_have_count(0)


def test_from_far_away_one_sees_into_all_subgraphs(story: Story) -> None:
    story.bench.set("errand/there", "duration", LONG_S)
    story.start()
    story.page.locator("#canvas").focus()
    story.press("u")
    expect(story.node("errand/there")).to_be_attached()
    expect(story.node("errand")).to_have_class(re.compile(r"\bopen\b"))
    story.page.mouse.move(*story.empty_place())
    for _ in range(3):
        story.page.mouse.wheel(0, 600)
    expect(story.page.locator("#canvas")).to_have_class(re.compile(r"\bfar\b"))
    story.bench.until(lambda: story.bench.is_active("errand/there"))
    label = story.page.locator(".far-label", has_text=re.compile("errand . there"))
    expect(label).to_be_visible()
    expect(story.page.locator(".far-frame.on")).to_have_count(1)
    expect(story.page.locator(".legend")).to_contain_text(re.compile(r"11 nodes, \d active"))
    story.press("u")
    expect(story.node("errand/there")).to_have_count(0)
