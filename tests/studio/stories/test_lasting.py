"""What a person does not lose: the connection, edits, the file that somebody else has changed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import mission

pytestmark = pytest.mark.slow


@pytest.fixture
def saved(open_studio: Open, tmp_path: Path) -> Story:
    file = tmp_path / "mission.hfg.yaml"
    hfg.save(mission(), file)
    return open_studio(hfg.load(file, allow=["tests.studio.stories"]), file=file)


def test_the_page_is_live_again_without_a_reload_when_the_connection_is_back(story: Story) -> None:
    story.start()
    story.page.evaluate("window.sameDocument = true")
    story.bench.cut()
    story.until(lambda: not story.page.evaluate("said.isOpen"), "the page has lost the connection")
    story.time_passes()
    expect(story.page.locator(".live")).to_contain_text("away")
    expect(story.page.locator(".frame")).to_have_class(re.compile(r"\bold\b"))
    expect(story.page.locator(".toast")).to_contain_text("Edits wait")
    story.bench.mend()
    expect(story.page.locator(".live")).to_have_text("live")
    expect(story.page.locator(".frame")).not_to_have_class(re.compile(r"\bold\b"))
    assert story.page.evaluate("window.sameDocument") is True
    story.select("spare")
    story.press("Delete")
    story.bench.until(lambda: "spare" not in story.graph.nodes)


def test_whoever_may_only_look_reads_why_nothing_can_be_changed(open_studio: Open) -> None:
    why = "You may look, not change: the studio was started with --read-only."
    story = open_studio(read_only=why)
    story.select("spare")
    story.press("Delete")
    expect(story.page.locator(".toast")).to_contain_text(why)
    assert "spare" in story.bench.call(lambda: set(story.graph.nodes))


def test_changes_are_seen_until_they_are_saved(saved: Story, tmp_path: Path) -> None:
    expect(saved.page.locator(".filename")).to_have_text("mission.hfg.yaml")
    saved.select("spare")
    saved.press("Delete")
    expect(saved.page.locator(".filename")).to_contain_text("1 change")
    saved.press("Control+s")
    expect(saved.page.locator(".filename")).not_to_contain_text("change")
    assert "spare" not in (tmp_path / "mission.hfg.yaml").read_text()


def test_a_file_that_was_changed_elsewhere_is_not_overwritten(saved: Story, tmp_path: Path) -> None:
    file = tmp_path / "mission.hfg.yaml"
    theirs = file.read_text() + "\n# changed by somebody else\n"
    file.write_text(theirs)
    bar = saved.page.locator(".bar-above")
    expect(bar).to_contain_text("changed")
    saved.select("spare")
    saved.press("Delete")
    expect(bar).to_contain_text("1 change")
    assert file.read_text() == theirs
    bar.get_by_role("button", name="Keep mine").click()
    expect(bar).to_have_count(0)
    assert "spare" not in file.read_text()
