"""The palette: which types it offers first, and to which of their ports a wire leads."""

from __future__ import annotations

from typing import Any

import hfg
from hfg.nodes import cv, files
from tests.studio.page import Page, live, studio_of


def photographs() -> hfg.Graph:
    graph = hfg.Graph("photographs")
    photographs = graph.add(files.ImageFiles(), name="photographs")
    graph.connect(photographs.image, graph.add(cv.hough_circles(), name="circles").ports.inputs["image"])
    return graph


def titles(found: Any) -> list[str]:
    return [row["title"] for row in found["rows"]]


def test_for_the_first_node_sources_come_first() -> None:
    async def main() -> None:
        page = Page(studio_of(hfg.Graph("empty"))).join()
        assert titles(await page.value("search", words="read image"))[0] == "ImageFiles"
        page = Page(studio_of(photographs())).join()
        assert titles(await page.value("search", words="read image"))[0] == "read_image"

    live(main)


def test_a_wire_leads_to_the_port_of_its_own_type() -> None:
    async def main() -> None:
        page = Page(studio_of(photographs())).join()
        found = await page.value("search", words="draw circles", port="circles.out")
        assert (found["rows"][0]["title"], found["rows"][0]["port"]) == ("draw_circles", "circles")

    live(main)


def test_without_words_types_that_are_near_to_the_wire_come_before_those_that_take_any_collection() -> None:
    async def main() -> None:
        page = Page(studio_of(photographs())).join()
        found = await page.value("search", port="photographs.image", most=1000)
        order = titles(found)
        assert order.index("gaussian_blur") < order.index("EachItem")

    live(main)


def test_an_output_that_nothing_takes_gets_a_node_that_shows_it() -> None:
    async def main() -> None:
        page = Page(studio_of(photographs())).join()
        commands = (await page.value("shown_by", path="circles.out"))["commands"]
        assert (await page.ask("edit", commands=commands))["t"] == "ack"
        assert "circles.out -> show.value" in page.tables["edges"]
        assert page.tables["nodes"]["show"]["title"] == "Show"
        refused = await page.ask("ask", what="shown_by", args={"path": "circles.image"})
        assert refused["message"] == '"circles.image" is where an edge ends, so nothing is sent there'

    live(main)
