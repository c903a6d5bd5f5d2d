"""A person saves a picture of the level, a value, the timeline: the files have what the engine has."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from tests.studio.stories.bench import Story

pytestmark = pytest.mark.slow


def saved(story: Story, button: str) -> bytes:
    """Click on a button, and return the file that the browser saves."""
    with story.page.expect_download() as download:
        story.page.get_by_role("button", name=button, exact=True).click()
    return Path(download.value.path()).read_bytes()


def command(story: Story, words: str) -> bytes:
    """Do something by its name, and return the file that the browser saves."""
    story.press("Control+k")
    with story.page.expect_download() as download:
        story.page.keyboard.type(words)
        story.press("Enter")
    return Path(download.value.path()).read_bytes()


def test_a_picture_of_the_level_is_saved_as_svg_and_png(story: Story) -> None:
    drawing = command(story, "level as svg").decode()
    assert drawing.startswith("<svg")
    for name in story.bench.call(lambda: list(story.graph.nodes)):
        assert f">{name}<" in drawing
    assert command(story, "level as png").startswith(b"\x89PNG")


def test_values_are_saved_as_they_pass(story: Story) -> None:
    story.start()
    story.pin("draw", "out")
    image = np.load(io.BytesIO(saved(story, "Save a value of draw.out as NPY")))
    assert image.shape == (48, 64)
    assert image[10, 10] == 200
    story.pin("scale", "out")
    number = saved(story, "Save a value of scale.out as CSV")
    assert int(number) % 2 == 0
    story.bench.until(lambda: story.graph["store"].last >= int(number), "the value was sent")


def test_the_timeline_is_saved_for_perfetto(story: Story) -> None:
    story.start()
    story.moves_on("store")
    events = json.loads(saved(story, "Save as Perfetto"))["traceEvents"]
    assert {one["name"] for one in events if one["ph"] == "X"} <= set(story.bench.studio.tables.of["nodes"])
