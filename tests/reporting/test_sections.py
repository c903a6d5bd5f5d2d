"""Sections that users add to a page: what stands in them, in which order, and that nothing in them can do harm."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.errors import UsageError
from tests.reporting.test_pages import HOSTILE, Structure, mission

SVG = '<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'


def page_with(folder: Path, add: Any) -> str:
    """Add to a page when its run is over, and give its text."""
    pages: list[Any] = []
    hfg.run(mission(), clock="virtual", begin=lambda run: pages.append(run.report_page(folder / "run.html")))
    add(pages[0])
    pages[0].write()
    return (folder / "run.html").read_text(encoding="utf-8")


def titles(page: str) -> list[str]:
    return re.findall(r"<h2>(.*?)</h2>", page)


def test_sections_stand_on_top_in_the_order_in_which_they_were_named(tmp_path: Path) -> None:
    def add(page: Any) -> None:
        page.add_text("Score", "three\n\nof four")
        page.add_text("Weather", "fine")
        page.add_text("Score", "in the end")

    page = page_with(tmp_path, add)
    assert titles(page)[:3] == ["Score", "Weather", "The graph"]
    assert re.findall(r"<p>(.*?)</p>", page) == ["three", "of four", "in the end", "fine"]


def test_what_is_added_before_the_run_ends_is_on_the_page_without_another_write(tmp_path: Path) -> None:
    def begin(run: hfg.Run) -> None:
        run.report_page(tmp_path / "run.html").add_text("Plan", "all of it")

    hfg.run(mission(), clock="virtual", begin=begin)
    assert titles((tmp_path / "run.html").read_text(encoding="utf-8"))[0] == "Plan"


def test_a_table_sorts_numbers_as_numbers(tmp_path: Path) -> None:
    rows = [("robot", 1200, 0.25), ("other", 3, 10.0)]
    page = page_with(tmp_path, lambda page: page.add_table("Score", ("who", "steps", "way"), rows))
    assert re.findall(r'data-by="([^"]*)">([^<]*)', page)[:4] == [
        ("1200", "1,200"),
        ("0.25", "0.25"),
        ("3", "3"),
        ("10.0", "10"),
    ]
    assert "<td>robot</td>" in page


def test_pictures_are_pixels_drawings_or_files_and_stand_side_by_side(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"jpeg")

    def add(page: Any) -> None:
        page.add_picture("Seen", np.zeros((16, 16, 3), np.uint8), caption="black", at_s=1.5)
        page.add_picture("Seen", SVG)
        page.add_picture("Seen", tmp_path / "a.jpg")
        page.add_text("Seen", "That is all.")

    page = page_with(tmp_path, add)
    sources = re.findall(r'src="data:image/([^;]*);base64,([^"]*)"', page)
    assert [kind for kind, _ in sources] == ["png", "svg+xml", "jpeg"]
    assert [base64.b64decode(data) for _, data in sources[1:]] == [SVG.encode(), b"jpeg"]
    assert '<figure data-time="1.500000">' in page
    assert page.count('<div class="gallery">') == 1
    assert page.index("That is all.") > page.index("</div>", page.index('<div class="gallery">'))


def test_a_video_says_which_time_of_the_run_it_shows(tmp_path: Path) -> None:
    (tmp_path / "a.webm").write_bytes(b"film")
    page = page_with(tmp_path, lambda page: page.add_video("Film", tmp_path / "a.webm", starts_s=0.5, speed=2))
    assert 'data-starts="0.500000" data-speed="2.000000"' in page
    assert f'src="data:video/webm;base64,{base64.b64encode(b"film").decode()}"' in page
    assert "media-src data:" in page


def test_a_drawing_of_a_subgraphs_inside_bears_the_paths_by_which_the_page_shows_who_is_active(tmp_path: Path) -> None:
    pages: list[Any] = []
    graph = mission()
    hfg.run(graph, clock="virtual", begin=lambda run: pages.append(run.report_page(tmp_path / "run.html")))
    part: Any = graph["part"]
    pages[0].add_drawing("Inside", part.graph, caption="closer")
    assert pages[0].text().count('data-path="part/inner"') == 3, "in the graph, in its states, and in the section"


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_nothing_that_is_added_breaks_the_page(tmp_path: Path, name: str) -> None:
    def adding(name: str) -> Any:
        def add(page: Any) -> None:
            page.add_text(name, name)
            page.add_table(name, (name,), [(name,)])
            page.add_picture(name, np.zeros((16, 16), np.uint8), caption=name)

        return add

    page, plain = page_with(tmp_path, adding(name.replace("\n", ""))), page_with(tmp_path, adding("plain"))
    assert Structure(page).tags == Structure(plain).tags
    assert Structure(page).attributes == Structure(plain).attributes


def test_what_cannot_be_read_is_told_when_it_is_added_and_leaves_the_page_as_it_is(tmp_path: Path) -> None:
    def add(page: Any) -> None:
        with pytest.raises(UsageError, match="cannot be read"):
            page.add_video("Film", tmp_path / "none.webm")

    assert "Film" not in titles(page_with(tmp_path, add))
