"""A person puts things in order and writes beside them what they are for; the file keeps it, and all can be undone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, expect

import hfg
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import mission

pytestmark = pytest.mark.slow

ALLOW = ("tests.studio.stories",)


def notes(story: Story, path: str = "") -> Any:
    """What editors have noted about a node, or the whole graph."""
    return story.bench.call(lambda: dict(story.graph.notes(path)))


def height(frame: Locator) -> float:
    box = frame.bounding_box()
    assert box is not None
    return box["height"]


def test_a_note_is_written_moved_saved_and_undone(open_studio: Open, tmp_path: Path) -> None:
    graph = mission()
    hfg.save(graph, tmp_path / "noted.hfg.yaml")
    story = open_studio(graph, file=tmp_path / "noted.hfg.yaml")
    story.page.locator("#canvas").focus()
    story.press("n")
    story.page.get_by_label("Text of the note").fill("Slow lenses need a longer look.")
    story.press("Enter")
    story.bench.until(lambda: story.graph.notes("").get("note 1", {}).get("text") == "Slow lenses need a longer look.")
    note = story.page.locator('.note[data-annotation=" note 1"]')
    story.settle()
    x, y = story.middle(note)
    before = notes(story)["note 1"]["at"]
    story.page.mouse.move(x, y)
    story.page.mouse.down()
    story.page.mouse.move(x + 80, y + 40, steps=4)
    story.page.mouse.up()
    story.bench.until(lambda: story.graph.notes("")["note 1"]["at"] != before)
    story.press("Control+s")
    story.bench.until(lambda: not story.bench.studio.project.record().changes)
    again = hfg.load(tmp_path / "noted.hfg.yaml", allow=ALLOW)
    assert again.notes("")["note 1"] == notes(story)["note 1"]
    for _ in range(3):  # moved, written, made
        story.press("Control+z")
    story.bench.until(lambda: "note 1" not in story.graph.notes(""))
    expect(note).to_have_count(0)


def test_a_frame_stays_around_its_nodes_wherever_they_go_and_whatever_they_are_called(story: Story) -> None:
    story.choose("scale", "check")
    story.press("Control+j")
    story.page.get_by_label("Name of the frame").fill("numbers")
    story.press("Enter")
    story.bench.until(lambda: story.graph.notes("").get("frame 1", {}).get("text") == "numbers")
    frame = story.page.locator(".frame-box")
    before = height(frame)
    layout = story.bench.call(lambda: story.bench.studio.tables.of["layouts"][":"])
    x, y = next((box["x"], box["y"]) for box in layout["nodes"] if box["id"] == "check")
    story.bench.call(lambda: story.graph.edit(hfg.commands.Rename("scale", "larger")))
    moves = hfg.commands.Note("larger", "position", [x - 204, y + 120]), hfg.commands.Note("check", "position", [x, y])
    story.bench.call(lambda: story.graph.edit(*moves))
    story.bench.call(lambda: story.bench.studio.refresh_all())
    expect(story.node("larger")).to_be_visible()
    story.until(lambda: height(frame) > before + 50, "the frame is around both again")
    assert notes(story, "larger")["frame"] == "frame 1"


def test_deleting_a_frame_leaves_what_is_in_it(story: Story) -> None:
    story.choose("scale", "check")
    story.press("Control+j")
    story.page.get_by_label("Name of the frame").press("Enter")
    story.bench.until(lambda: story.graph.notes("scale").get("frame") == "frame 1")
    story.page.locator(".frame-head").click()
    expect(story.page.locator("#side h2").first).to_have_text("2 nodes")
    story.press("Delete")
    story.bench.until(lambda: "frame 1" not in story.graph.notes(""))
    assert {"scale", "check"} < set(story.bench.call(lambda: set(story.graph.nodes)))
    assert "frame" not in notes(story, "check")


def test_selected_nodes_are_aligned_in_one_step_of_the_history(story: Story) -> None:
    story.choose("scale", "check", "store")
    story.page.get_by_role("button", name="Align left sides").click()
    story.bench.until(
        lambda: (
            len(
                {
                    story.graph.notes(one)["position"][0]
                    for one in ("scale", "check", "store")
                    if "position" in story.graph.notes(one)
                }
            )
            == 1
        )
    )
    story.press("Control+z")
    story.bench.until(lambda: all("position" not in story.graph.notes(one) for one in ("scale", "check", "store")))
