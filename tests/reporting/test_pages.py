"""Pages about runs: what they show, that they stay small, and that no name or value breaks them."""

from __future__ import annotations

import asyncio
import base64
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg.errors import NodeError, NotRunning
from hfg.images import Color, Gray
from hfg.reporting.observing import MOST_ERRORS, MOST_NODES, MOST_TIMES, SPANS, Gallery, Observed, Rows, Times
from hfg.reporting.pictures import is_picture, png, smaller
from hfg.testing.nodes import script, sink
from hfg.trace import ActivityChanged, ErrorRaised, FiringStarted


class State(hfg.Node):
    done = hfg.Event()

    @hfg.slot
    def begin(self) -> None: ...


class Part(hfg.Subgraph):
    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(State(), name="inner", active_for_s=3)
        graph.connect(self.begin.inner, inner.begin, active=True)
        graph.connect(inner.timeout, self.done.inner, active=True)


@hfg.node
def camera(*, count: int = 5) -> Iterator[Color]:
    for number in range(count):
        yield np.full((480, 640, 3), (number, 100, 200), np.uint8)


@hfg.node
def look(image: Color) -> None: ...


class Fails(hfg.Node):
    image = hfg.Input(Color)

    def process(self, image: Color) -> None:
        raise ValueError("<b>broken</b> & tired")


def mission(name: str = "mission") -> hfg.Graph:
    graph = hfg.Graph(name)
    first, part, last = (
        graph.add(State(), name="first", active_for_s=2),
        graph.add(Part()),
        graph.add(State(), name="last"),
    )
    graph.start.activates(first.begin)
    graph.connect(first.timeout, part.begin, active=True)
    graph.connect(part.done, last.begin, active=True)
    return graph


def seen(graph: hfg.Graph) -> hfg.Graph:
    """Let a camera look, twice a second, and a node fail at each picture."""
    graph.group("vision")
    eye = graph.add(camera(), max_rate_hz=2, group="vision")
    graph.connect(eye.out, graph.add(look(), group="vision").image)
    graph.connect(eye.out, graph.add(Fails(), on_error="skip").image)
    return graph


def page_of(graph: hfg.Graph, file: Path, **options: Any) -> str:
    hfg.run(graph, clock="virtual", begin=lambda run: run.report_page(file, **options))
    return file.read_text(encoding="utf-8")


def data_of(page: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(page.partition('id="data">')[2].partition("</script>")[0])
    return found


class Structure(HTMLParser):
    """The tags of a page; names do not count."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes |= {name for name, _ in attrs}


# --- what is on it


def test_a_page_tells_who_was_active_and_when(tmp_path: Path) -> None:
    page = page_of(mission(), tmp_path / "run.html")
    data = data_of(page)
    assert {one["path"]: one["spans"] for one in data["active"]} == {
        "first": [[0, 2]],
        "part/inner": [[2, 5]],
        "last": [[5, 5]],
    }
    assert data["duration"] == 5
    assert '<p class="outcome good">done</p>' in page
    assert {"first", "part", "part/inner", "last"} <= set(re.findall(r'data-path="([^"]*)"', page))


def test_a_page_counts_firings_over_time_by_node_and_group(tmp_path: Path) -> None:
    data = data_of(page_of(seen(mission()), tmp_path / "run.html"))
    assert sum(data["counts"]["camera"]) == 6
    spans = [index * data["span"] for index, count in enumerate(data["counts"]["camera"]) if count]
    assert [round(at, 1) for at in spans] == [0, 0.5, 1, 1.5, 2, 2.5]
    assert data["groups"]["look"] == "vision"


def test_a_page_has_tables_errors_and_pictures(tmp_path: Path) -> None:
    page = page_of(seen(mission()), tmp_path / "run.html", pictures=3, picture_size=64)
    assert page.count("firing 1: ValueError: &lt;b&gt;broken&lt;/b&gt; &amp; tired") == 1
    assert "camera.out -&gt; look.image" in page
    pictures = re.findall(r'src="data:image/png;base64,([^"]*)"', page)
    assert len(pictures) == 3
    image = cv2.imdecode(np.frombuffer(base64.b64decode(pictures[1]), np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.shape == (48, 64, 3)
    assert image[0, 0].tolist() == [2, 100, 200]


def test_a_page_marks_the_nodes_that_cannot_be_fused_and_says_why(tmp_path: Path) -> None:
    graph = mission()
    eye = graph.add(camera())
    graph.connect(eye.out, graph.add(look(), name="steady").image)
    graph.connect(eye.out, graph.add(look(), name="again", retries=2).image)
    page = page_of(graph, tmp_path / "run.html")
    refused = data_of(page)["refused"]
    assert list(refused) == ["again"]
    assert "retries=" in refused["again"]
    assert "Tinted nodes" in page
    assert f"<td>{refused['again']}</td>" in page
    assert "Tinted nodes" not in page_of(mission(), tmp_path / "run.html")


def test_without_pictures_there_are_none(tmp_path: Path) -> None:
    assert "data:image" not in page_of(seen(mission()), tmp_path / "run.html", pictures=0)


def test_a_failed_run_has_a_page_that_says_so(tmp_path: Path) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(camera()).out, graph.add(Fails()).image)
    with pytest.raises(NodeError):
        page_of(graph, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert '<p class="outcome bad">failed</p>' in page
    assert '<pre class="error">' in page


def test_a_page_can_be_written_while_the_run_goes_on_and_is_written_again_at_its_end(tmp_path: Path) -> None:
    async def main() -> None:
        graph = mission()
        async with hfg.running(graph) as run:
            page = run.report_page(tmp_path / "run.html")
            await asyncio.sleep(1)
            page.write()
            assert '<p class="outcome good">still running</p>' in page.path.read_text(encoding="utf-8")
            await run.wait_finished()
        assert '<p class="outcome good">done</p>' in page.path.read_text(encoding="utf-8")
        assert page.error is None
        with pytest.raises(NotRunning):
            run.report_page(tmp_path / "late.html")

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def test_a_disk_that_is_full_in_the_end_harms_no_run(tmp_path: Path) -> None:
    pages = []
    folder = tmp_path / "folder"
    folder.mkdir()

    def begin(run: hfg.Run) -> None:
        pages.append(run.report_page(folder / "run.html"))
        folder.rmdir()

    assert hfg.run(mission(), clock="virtual", begin=begin).outcome == "done"
    assert isinstance(pages[0].error, FileNotFoundError)


def test_a_page_loads_nothing_and_says_so(tmp_path: Path) -> None:
    page = page_of(seen(mission()), tmp_path / "run.html")
    assert "default-src 'none'" in page
    assert set(re.findall(r"\w+://[^\s\"'<]*", page)) == {"http://www.w3.org/2000/svg"}


# --- hostile names

HOSTILE = ["<script>alert(1)<!--", '" onload="alert(1)', "]]>", "&amp;", "中文", "-->"]


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_no_name_breaks_the_page(tmp_path: Path, name: str) -> None:
    def build(name: str) -> hfg.Graph:
        graph = hfg.Graph(name)
        graph.group(name)
        eye, state = graph.add(camera(), name=name, group=name), graph.add(State(), name=f"x{name}")
        graph.connect(eye.out, graph.add(Fails(), name=f"y{name}", on_error="skip").image)
        graph.start.activates(state.begin)
        return graph

    page, plain = page_of(build(name), tmp_path / "run.html"), page_of(build("plain"), tmp_path / "plain.html")
    assert Structure(page).tags == Structure(plain).tags
    assert Structure(page).attributes - Structure(plain).attributes <= {"textlength", "lengthadjust"}
    assert len(data_of(page)["active"]) == 1


# --- bounds


def test_times_of_activity_that_are_too_many_are_joined_and_their_sum_stays_exact() -> None:
    times = Times()
    for number in range(10 * MOST_TIMES):
        times.begin(number)
        times.end(number + 0.25)
    assert len(times.spans) <= MOST_TIMES
    assert len(times.spans) + times.joined == 10 * MOST_TIMES
    assert times.total_s == 2.5 * MOST_TIMES
    assert times.spans[0][0] == 0
    assert times.spans[-1][1] == 10 * MOST_TIMES - 0.75
    assert all(one[1] <= other[0] for one, other in zip(times.spans, times.spans[1:], strict=False))


def test_firings_are_counted_in_spans_that_grow_with_the_run() -> None:
    rows = Rows()
    for second in range(100_000):
        rows.add("node", float(second))
    assert len(rows.counts["node"]) == 2 * SPANS
    assert sum(rows.counts["node"]) == 100_000
    assert rows.span_s * SPANS <= 100_000 <= rows.span_s * 2 * SPANS


def test_nodes_and_errors_beyond_the_bounds_are_counted_only() -> None:
    observed = Observed(0, 16)
    for number in range(MOST_NODES + 5):
        observed(ActivityChanged(0.0, f"n{number}", True, "token"))
        observed(FiringStarted(0.0, f"n{number}", 1, "process"))
        observed(ErrorRaised(0.0, "n", "firing", "x" * 10_000, "skip"))
    assert (len(observed.times), len(observed.rows.counts)) == (MOST_NODES, MOST_NODES)
    assert (len(observed.errors), observed.more_errors) == (MOST_ERRORS, MOST_NODES + 5 - MOST_ERRORS)
    assert len(observed.errors[0][2]) < 3000


def test_pictures_are_spread_evenly_over_ports_and_time() -> None:
    gallery = Gallery(most=6, longest=16)
    for number in range(1000):
        for port in ("a.out", "b.out"):
            for target in ("x", "y"):  # a fan-out is one picture
                gallery.take(f"{port} -> {target}.in", np.zeros((10, 10), np.uint8), float(number))
    assert gallery.seen == {"a.out": 1000, "b.out": 1000}
    times = [[at for at, _ in kept] for kept in gallery.by_port.values()]
    assert all(2 <= len(kept) <= 3 for kept in times)
    assert times[0] == [0.0, 512.0] or times[0] == [0.0, 256.0, 512.0]


def test_of_more_ports_than_pictures_some_are_left_out_and_told() -> None:
    gallery = Gallery(most=2, longest=16)
    for port in "abc":
        gallery.take(f"{port}.out -> x.in", np.zeros((10, 10), np.uint8), 0.0)
    assert (list(gallery.by_port), gallery.left_out) == (["a.out", "b.out"], {"c.out"})


def test_what_is_left_out_is_on_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.reporting.observing.MOST_ERRORS", 2)
    monkeypatch.setattr("hfg.reporting.html._MOST_ROWS", 1)
    page = page_of(seen(mission()), tmp_path / "run.html")
    assert "<li>3 more errors after the first 2</li>" in page
    assert "<li>the table of nodes has the first 1 of 6</li>" in page


# --- pictures


@pytest.mark.parametrize("shape", [(12, 20), (12, 20, 1), (12, 20, 3), (12, 20, 4)], ids=str)
def test_a_png_has_the_pixels_of_its_image(shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    read = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_UNCHANGED)
    assert read is not None
    assert np.array_equal(read.reshape(shape), image)


def test_a_smaller_picture_has_the_means_of_squares() -> None:
    image = np.kron(np.arange(12, dtype=np.uint8).reshape(3, 4), np.ones((50, 50), np.uint8))
    assert np.array_equal(smaller(image, 4), np.arange(12).reshape(3, 4))
    assert smaller(image, 1000) is not image
    assert smaller(np.zeros((9, 5000), np.uint8), 100).shape == (1, 100)


def test_what_is_no_picture_is_not_shown() -> None:
    gray: Gray = np.zeros((20, 20), np.uint8)
    assert is_picture(gray)
    for value in (
        None,
        3,
        "x",
        np.zeros((4, 4), np.uint8),
        np.zeros((20, 20)),
        np.zeros((20, 20, 2), np.uint8),
        [gray],
    ):
        assert not is_picture(value)


def test_a_graph_without_activity_has_a_page_too(tmp_path: Path) -> None:
    graph = hfg.Graph()
    _ = graph.add(script()) >> graph.add(sink())
    assert data_of(page_of(graph, tmp_path / "run.html"))["active"] == []


def test_a_large_graph_is_drawn_folded_and_one_that_is_too_large_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hfg.reporting.drawn._MOST_DRAWN", 3)
    graph = mission()
    graph.add(Part(), name="other", enabled=False)
    assert "<li>the drawing, because the graph has 4 nodes; graph.draw makes it</li>" in page_of(
        graph, tmp_path / "a.html"
    )
    monkeypatch.setattr("hfg.reporting.drawn._MOST_DRAWN", 4)
    graph["other"].graph.add(State(), name="more")
    page = page_of(graph, tmp_path / "b.html")
    assert "<li>the insides of subgraphs, because there are 5 nodes in all</li>" in page
    drawing = page.partition('<section id="drawing"')[2].partition("</section>")[0]
    assert 'data-path="part"' in drawing
    assert 'data-path="part/inner"' not in drawing


def test_a_graph_that_was_edited_is_drawn_as_it_is_in_the_end(tmp_path: Path) -> None:
    async def main() -> None:
        graph = mission()
        async with hfg.running(graph) as run:
            run.report_page(tmp_path / "run.html")
            await run.edit(hfg.commands.Rename("last", "goal"))
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert 'data-path="goal"' in page
    assert "<li>the graph was changed once; the drawing shows its final state</li>" in page


@pytest.mark.rule("A5", "A13")
def test_the_page_shows_the_states_and_what_is_proved_of_them(tmp_path: Path) -> None:
    pages: list[Any] = []
    graph = mission()
    hfg.run(graph, clock="virtual", begin=lambda run: pages.append(run.report_page(tmp_path / "run.html")))
    states = (tmp_path / "run.html").read_text().partition('<section id="states"')[2].partition("</section>")[0]
    assert 'data-path="part/inner"' in states
    assert "timeout" in states
    assert "exactly one of &quot;first&quot;, &quot;part/inner&quot;, &quot;last&quot; is active: proved" in states


def test_a_page_of_a_graph_in_which_no_activity_moves_has_no_states(tmp_path: Path) -> None:
    graph = hfg.Graph("still")
    graph.connect(graph.add(script()).out, graph.add(sink()).value)
    hfg.run(graph, clock="virtual", begin=lambda run: run.report_page(tmp_path / "run.html"))
    assert 'id="states"' not in (tmp_path / "run.html").read_text()
