"""A person opens a recording, and looks at any time of the run in the page that shows runs."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from playwright.sync_api import expect

import hfg
from hfg.studio.replaying import Replay
from tests.studio.recordings import recording_of
from tests.studio.stories.bench import Story
from tests.studio.stories.test_access import serious

pytestmark = pytest.mark.slow

GUTTER, RIGHT = 136, 12
BRIGHT = """canvas => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data[
  4 * (canvas.width * 16 + 16)]"""


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recordings") / "run.mcap"
    with ThreadPoolExecutor(1) as thread:  # the browser has a loop in this one
        return thread.submit(recording_of, file, edits=True).result()


@pytest.fixture
def story(open_studio: Callable[..., Story], run_file: Path) -> Story:
    story = open_studio(recording=run_file)
    expect(story.page.locator(".clock")).to_contain_text("of 10.00 s")
    expect(story.page.locator("#time canvas")).to_have_attribute("data-length", "10")
    return story


def replay(story: Story) -> Replay:
    assert isinstance(story.bench.studio.steering, Replay)
    return story.bench.studio.steering


def place(story: Story, at: float) -> tuple[float, float]:
    """Where on the timeline a time of the run is, among the lanes."""
    box = story.page.locator("#time canvas").bounding_box()
    assert box is not None
    return box["x"] + GUTTER + (box["width"] - GUTTER - RIGHT) * at / 10.0, box["y"] + box["height"] - 8


def scrub(story: Story, *times: float) -> None:
    """Press the mouse on the timeline at the first of the times, and drag it to the others."""
    mouse = story.page.mouse
    mouse.move(*place(story, times[0]))
    mouse.down()
    for at in times[1:]:
        mouse.move(*place(story, at), steps=4)
    mouse.up()
    story.bench.until(lambda: abs(replay(story).elapsed() - times[-1]) < 0.02, f"the cursor is at {times[-1]} s")


def test_dragging_in_the_timeline_shows_graph_values_and_activity_of_that_time(story: Story) -> None:
    story.select("scale")
    row = story.page.locator("#side .prt").last
    scrub(story, 1.0, 5.05)
    expect(story.node("rest")).to_have_class(re.compile(r"\bactive\b"))
    expect(row.locator(".v")).to_have_text("250")
    factor = story.page.locator("#side .sec").first.locator(".par", has_text="factor")
    expect(factor).to_contain_text("5")
    scrub(story, 5.0, 1.05)
    expect(story.node("rest")).not_to_have_class(re.compile(r"\bactive\b"))
    expect(row.locator(".v")).to_have_text("20")
    expect(factor).to_contain_text("2")


def test_a_node_that_was_added_while_it_ran_is_there_from_then_on(story: Story) -> None:
    expect(story.node("spare")).to_have_count(0)
    scrub(story, 1.0, 7.0)
    expect(story.node("spare")).to_be_visible()
    scrub(story, 7.0, 2.0)
    expect(story.node("spare")).to_have_count(0)


def test_space_plays_and_pauses(story: Story) -> None:
    story.press(" ")
    expect(story.page.get_by_role("button", name="Pause")).to_be_visible()
    story.bench.until(lambda: replay(story).elapsed() > 0.3, "it is played")
    story.press(" ")
    expect(story.page.get_by_role("button", name="Play")).to_be_visible()
    at = story.bench.call(lambda: replay(story).elapsed())
    expect(story.page.locator(".clock")).to_contain_text(f"{at:.2f} s")
    assert story.bench.call(lambda: replay(story).elapsed()) == at


def test_arrows_step_from_firing_to_firing_of_the_selected_node(story: Story) -> None:
    scrub(story, 1.05, 1.06)
    story.select("scale")
    cursor = story.page.locator("#time canvas")
    for key, at in (("ArrowRight", "1.1"), ("ArrowRight", "1.2"), ("ArrowLeft", "1.1"), ("ArrowLeft", "1")):
        story.press(key)
        expect(cursor).to_have_attribute("data-cursor", at)
    story.select("rest")
    story.page.get_by_role("button", name="To the next firing").click()
    expect(cursor).to_have_attribute("data-cursor", "6")


def test_a_pinned_picture_and_plot_follow_the_cursor(story: Story) -> None:
    for node in ("draw", "scale"):
        story.pin(node, "out")
    scrub(story, 1.0, 2.05)
    picture = story.page.locator('canvas[data-probe="draw.out"]')
    story.until(lambda: picture.evaluate(BRIGHT) > 10, "the picture is painted")
    dark = picture.evaluate(BRIGHT)
    scrub(story, 2.0, 9.05)
    story.until(lambda: picture.evaluate(BRIGHT) > dark + 40, "a brighter one is painted")
    expect(story.page.get_by_role("region", name="Probe of scale.out").locator(".r")).to_have_text("450")
    drawn = "canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(v => v > 0)"
    story.until(lambda: story.page.locator('[data-plot="scale.out"]').evaluate(drawn), "the plot is painted")


def test_what_would_change_it_is_locked_with_one_sentence(story: Story) -> None:
    story.select("scale")
    story.press("Delete")
    expect(story.page.locator(".toast")).to_contain_text("this is a recording; it can be looked at, not changed")
    expect(story.node("scale")).to_be_visible()


def test_a_failure_of_the_run_is_listed_at_its_time(story: Story) -> None:
    story.page.get_by_role("tab", name="Problems").click()
    row = story.page.locator("#panel-problems li")
    expect(row).to_contain_text("160 is too large")
    expect(row).to_contain_text("3.20 s")


def test_the_timeline_is_saved_as_that_of_a_run(story: Story) -> None:
    with story.page.expect_download() as download:
        story.page.get_by_role("button", name="Save as Perfetto").click()
    text = Path(download.value.path()).read_text()
    assert '"name":"scale"' in text
    assert '"thread_name"' in text


def test_nothing_of_a_recording_looks_as_if_it_could_be_changed(story: Story) -> None:
    story.select("scale")
    expect(story.page.locator("#side")).to_contain_text("group")
    expect(story.page.locator("#side")).to_contain_text("enabled")
    expect(story.page.locator("#side").locator("select, input, textarea")).to_have_count(0)
    expect(story.page.locator("#side")).not_to_contain_text("Breakpoint")


def test_axe_finds_nothing_serious_in_a_recording(story: Story) -> None:
    story.select("scale")
    scrub(story, 1.0, 5.05)
    assert serious(story) == []


def test_a_recording_is_opened_from_the_list_of_files_and_a_graph_after_it(
    open_studio: Callable[..., Story], run_file: Path, tmp_path: Path
) -> None:
    shutil.copy(run_file, tmp_path / "run.mcap")
    hfg.save(hfg.Graph("empty"), tmp_path / "other.hfg.yaml")
    story = open_studio()
    story.press("Control+o")
    story.page.get_by_role("dialog").get_by_role("button", name="run.mcap").click()
    expect(story.page.locator(".clock")).to_contain_text("of 10.00 s")
    expect(story.page.get_by_role("button", name="Play", exact=False)).to_be_visible()
    expect(story.node("scale")).to_be_visible()
    assert isinstance(story.bench.studio.steering, Replay)
    story.press("Control+o")
    story.page.get_by_role("dialog").get_by_role("button", name="other.hfg.yaml").click()
    expect(story.page.locator(".crumbs")).to_contain_text("empty")
    story.bench.until(lambda: story.bench.studio.read_only == "")
    expect(story.page.get_by_role("button", name="Start (Space)")).to_be_enabled()
