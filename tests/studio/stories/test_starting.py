"""A person starts the studio without a graph: one click shows one that runs, and five steps explain it."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Locator, expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open

pytestmark = pytest.mark.slow

STEPS = [
    ("A node does one thing", "find"),
    ("The orange outline is the state", None),
    ("Draw a line from a port", "find"),
    ("Change it while it runs", None),
    ("When, and for how long", None),
]


def is_next_to(step: Locator, node: Locator) -> bool:
    """Whether a step of the tour is beside, above or below a node, and near."""
    box, about = step.bounding_box(), node.bounding_box()
    assert box is not None
    assert about is not None
    across = max(box["x"] - about["x"] - about["width"], about["x"] - box["x"] - box["width"])
    down = max(box["y"] - about["y"] - about["height"], about["y"] - box["y"] - box["height"])
    return 0 < max(across, down) < 60


@pytest.fixture
def first(open_studio: Open) -> Story:
    return open_studio(hfg.Graph("graph"))


def test_one_click_shows_a_graph_that_runs_with_what_its_camera_sees(first: Story) -> None:
    expect(first.page.locator("#top")).to_contain_text("no graph")
    first.page.get_by_role("button", name="Run it").click()
    first.bench.state("running")
    first.bench.until(lambda: first.bench.is_active("search") or first.bench.is_active("follow"), "it is somewhere")
    expect(first.page.locator(".crumbs")).to_contain_text("ball")
    expect(first.page.locator("#canvas .node.active")).not_to_have_count(0)
    expect(first.page.locator("#stage .caption")).to_contain_text("the ball was seen at")


def test_what_one_opens_while_a_starter_begins_stays_open(first: Story) -> None:
    first.page.get_by_role("button", name="Run it").click()
    first.node("camera").wait_for()
    with first.bench.held():
        first.press("Control+k")
    first.bench.state("running")
    first.settle()
    expect(first.page.get_by_role("dialog", name="Find or do anything")).to_be_visible()


def test_the_tour_has_five_steps_each_next_to_what_it_is_about(first: Story) -> None:
    first.page.get_by_role("button", name="Take the tour").click()
    for title, node in STEPS:
        step = first.page.get_by_role("dialog", name=title)
        expect(step).to_be_visible()
        if node is not None:
            first.until(partial(is_next_to, step, first.node(node)), f"it stands next to {node}")
        step.get_by_role("button", name=re.compile("Next|Done")).click()
    expect(first.page.get_by_role("dialog")).to_have_count(0)
    expect(first.page.locator("#side h2").first).to_have_text("find")
    first.bench.state("running")


def test_a_small_starter_runs_as_soon_as_it_is_chosen(first: Story) -> None:
    first.page.get_by_role("button", name="Wait for a start signal").click()
    first.bench.state("running")
    first.bench.until(lambda: first.bench.is_active("drive"), "the signal has come")
    expect(first.node("drive")).to_be_visible()


def test_a_file_that_cannot_be_opened_says_why_on_the_first_page(open_studio: Open, tmp_path: Path) -> None:
    (tmp_path / "broken.hfg.yaml").write_text("hfg: 1\nnodes: [\n")
    (tmp_path / "newer.hfg.yaml").write_text("hfg: 99\nname: newer\n")
    story = open_studio(hfg.Graph("graph"))
    for name, why in (("broken", "this is no YAML"), ("newer", "update hfg")):
        story.page.get_by_role("button", name=f"{name}.hfg.yaml").click()
        expect(story.page.locator(".toast").last).to_contain_text(why)


MISSING = """hfg: 1
name: missing
nodes:
  clock:
    type: hfg.nodes.values:ListSource
    parameters:
      values: [1, 2]
  finder:
    type: hfg_blobs:BlobFinder
    parameters:
      sensitivity: 0.5
  spare:
    type: hfg.nodes.display:Show
edges:
  - clock.out -> finder.image
"""


def test_a_node_whose_type_is_not_installed_is_grey_and_saved_as_it_was(open_studio: Open, tmp_path: Path) -> None:
    file = tmp_path / "missing.hfg.yaml"
    file.write_text(MISSING)
    story = open_studio(hfg.Graph("graph"))
    story.page.get_by_role("button", name="missing.hfg.yaml").click()
    expect(story.node("finder")).to_have_class(re.compile(r"\bmissing\b"))
    expect(story.node("finder")).to_contain_text("not installed")
    story.settle()
    middles = [story.middle(story.node(name))[0] for name in ("clock", "finder")]
    assert sum(middles) / 2 == pytest.approx(story.middle(story.page.locator("#canvas"))[0], abs=2)  # all is in view
    story.select("spare")
    story.press("Delete", "Control+s")
    expect(story.page.locator(".filename")).to_have_text("missing.hfg.yaml")
    story.bench.until(lambda: "spare" not in file.read_text(), "it is saved")
    assert "hfg_blobs:BlobFinder" in file.read_text()
    assert "sensitivity: 0.5" in file.read_text()
