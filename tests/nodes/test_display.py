"""The family `display`: text, lights, tables, images and plots, without a screen."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg.nodes import display, values
from hfg.testing import fire
from hfg.testing.diagrams import check


@pytest.fixture(autouse=True)
def in_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test has a working directory of its own."""
    monkeypatch.chdir(tmp_path)


def run(
    node: Any, *given: Any, name: str | None = None, rate_hz: float | None = None, output: str | None = None
) -> hfg.Report:
    """Run a node on these values."""
    graph = hfg.Graph()
    graph.add(node, name=name)
    source = graph.add(values.ListSource(values=given), max_rate_hz=rate_hz)
    graph.connect(source.out, next(iter(node.ports.inputs.values())))
    if output is not None:
        graph.connect(node.ports.outputs[output], graph.output("all", Any))
    return hfg.run(graph, clock="virtual", debug=True)


def shown_in(path: str) -> Any:
    """Read a picture as it was written."""
    return cv2.imread(path, cv2.IMREAD_UNCHANGED)


# --- text ---


def test_values_are_printed_with_the_path_of_the_node(capsys: pytest.CaptureFixture[str]) -> None:
    run(display.TextDisplay(), 1, "a", [2], name="seen")
    assert capsys.readouterr().out == "seen: 1\nseen: a\nseen: [2]\n"


def test_a_display_has_a_format_and_another_stream(capsys: pytest.CaptureFixture[str]) -> None:
    run(display.TextDisplay(format="{:.2f} at {time:.1f} s", to="error"), 1.234, 2, rate_hz=2)
    assert capsys.readouterr() == ("", "1.23 at 0.0 s\n2.00 at 0.5 s\n")


def test_a_display_writes_to_the_log_of_its_node(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        run(display.TextDisplay(to="log", level="warning", format="{}"), "100 %s", name="seen")
    assert [
        (one.name, one.levelname, one.getMessage()) for one in caplog.records if one.name.startswith("hfg.node")
    ] == [("hfg.node.seen", "WARNING", "100 %s")]


def test_a_display_shows_no_more_than_somebody_can_read(capsys: pytest.CaptureFixture[str]) -> None:
    run(display.TextDisplay(format="{}", most_per_s=1.0), *range(8), rate_hz=4)
    assert capsys.readouterr().out.splitlines() == ["0", "4 (3 not shown)", "7 (2 not shown)"]


def test_a_display_hears_signals_too() -> None:
    check(display.TextDisplay(format="{}", to="error"), value="1-2|", show="-a", expected={"shown": "1a2"})


def test_a_long_text_is_cut(capsys: pytest.CaptureFixture[str]) -> None:
    run(display.TextDisplay(format="{}", longest=3), "abcdef")
    assert capsys.readouterr().out == "abc ... (3 characters more)\n"


def test_a_value_that_does_not_fit_the_format_is_told() -> None:
    with pytest.raises(ValueError, match="'a' cannot be written as {:d}"):
        fire(display.TextDisplay(format="{:d}"), value="a")
    with pytest.raises(ValueError, match='"text_display.format" must satisfy is_a_format'):
        display.TextDisplay(format="{0.__class__}")


def test_a_value_is_logged_on_its_way(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        report = run(display.log_value(format="got {}", level="debug"), 1, 2, name="tap", output="out")
    assert report.outputs["all"] == [1, 2]
    records = [one for one in caplog.records if one.name.startswith("hfg.node")]
    assert [(one.name, one.levelname, one.getMessage()) for one in records] == [
        ("hfg.node.tap", "DEBUG", "got 1"),
        ("hfg.node.tap", "DEBUG", "got 2"),
    ]


# --- lights ---


def test_an_indicator_tells_changes_and_shows_its_state(caplog: pytest.LogCaptureFixture) -> None:
    node = display.Indicator()
    with caplog.at_level(logging.INFO):
        events = [fire(node, signal=signal).events for signal in (False, True, True, False)]
    assert events == [[("changed", False)], [("changed", True)], [], [("changed", False)]]
    assert [one.getMessage() for one in caplog.records] == ["off", "on", "off"]
    fire(node, signal=True)
    assert node.on is True


def test_a_signal_light_has_one_of_three_states() -> None:
    node = display.SignalLight()
    for light, events in (
        ("red", [("changed", "red")]),
        ("red", []),
        ("yellow", [("changed", "yellow")]),
        ("green", [("changed", "green")]),
    ):
        assert fire(node, slot=light).events == events
        assert node.state == light


# --- tables ---


def test_rows_stand_below_each_other() -> None:
    rows = [{"name": "Eve", "age": 7, "size": 1.25}, {"name": "Bartholomew", "size": 0.1 + 0.2}, {"hat": "a\nb"}]
    assert fire(display.format_table(), rows=rows).outputs["out"].splitlines() == [
        "name         age  size  hat",
        "-----------  ---  ----  ---",
        "Eve            7  1.25",
        "Bartholomew        0.3",
        "                        a b",
    ]


def test_a_table_may_have_chosen_columns_and_narrow_ones() -> None:
    rows = [{"name": "Bartholomew", "age": 7}]
    assert fire(display.format_table(columns=["name"], widest=6), rows=rows).outputs["out"].splitlines() == [
        "name",
        "------",
        "Bar...",
    ]
    assert fire(display.format_table(columns=["no"]), rows=rows).outputs["out"].splitlines() == ["no", "--"]
    assert fire(display.format_table(), rows=[]).outputs["out"] == "\n"


# --- images ---


def test_the_newest_image_is_in_the_file_and_the_last_one_at_the_end() -> None:
    images = [np.full((2, 3), number, np.uint8) for number in range(8)]
    node = display.ImageDisplay(path="see.png", most_per_s=1.0)
    assert fire(node, image=images[0]).events == [("shown", "see.png")]
    assert shown_in("see.png")[0, 0] == 0
    run(display.ImageDisplay(path="see.png", most_per_s=1.0), *images, rate_hz=4)
    assert shown_in("see.png")[0, 0] == 7


def test_a_display_that_cannot_write_its_format_says_so() -> None:
    with pytest.raises(ValueError, match=r'parameter "image_display.path" must be a file name like \*.png'):
        display.ImageDisplay(path="see")
    with pytest.raises(ValueError, match="end the path"):
        fire(display.ImageDisplay(path="see.png"), image=np.zeros((2, 2, 2), np.uint8))


@pytest.mark.parametrize(
    ("image", "shown"),
    [
        (np.array([[1.0, 2.0, 3.0]], np.float32), [0, 128, 255]),
        (np.array([[-5, 0, 5]], np.int16), [0, 128, 255]),
        (np.array([[True, False]]), [255, 0]),
        (np.array([[np.nan, 1.0, np.inf, 3.0]]), [0, 0, 0, 255]),
        (np.array([[7.0, 7.0]]), [0, 0]),
        (np.array([[-1e308, 1e308]]), [0, 255]),
        (np.array([[np.nan]]), [0]),
    ],
)
def test_other_numbers_are_shown_from_the_smallest_to_the_largest(image: Any, shown: list[int]) -> None:
    fire(display.ImageDisplay(path="see.png"), image=image)
    assert shown_in("see.png")[0].tolist() == shown


def test_an_image_of_complex_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match="an image of complex128 cannot be shown"):
        fire(display.ImageDisplay(), image=np.zeros((2, 2), complex))


def test_images_stand_beside_and_below_each_other() -> None:
    dark, light = np.full((2, 2), 1, np.uint8), np.full((4, 2, 3), 9, np.uint8)
    grid = fire(display.image_grid(images=3, gap=1), images=[dark, light, dark]).outputs["out"]
    assert grid.shape == (9, 5, 3)
    assert grid[..., 0].tolist() == [
        [128, 128, 128, 9, 9],
        [1, 1, 128, 9, 9],
        [1, 1, 128, 9, 9],
        [128, 128, 128, 9, 9],
        [128] * 5,
        [128] * 5,
        [1, 1, 128, 128, 128],
        [1, 1, 128, 128, 128],
        [128] * 5,
    ]
    row = fire(display.image_grid(images=2, columns=9, gap=0), images=[dark, dark]).outputs["out"]
    assert row.tolist() == [[1, 1, 1, 1]] * 2
    with pytest.raises(ValueError, match="2 channels"):
        fire(display.image_grid(), images=[dark, np.zeros((2, 2, 2), np.uint8)])


# --- plots ---


def ink(picture: Any) -> int:
    """Count the pixels in which there is colour: those of lines and points, not of the frame."""
    picture = picture[..., :3]
    return int((picture.max(axis=2).astype(int) - picture.min(axis=2) > 60).sum())


def last(node: Any, *firings: dict[str, Any]) -> Any:
    """Fire a plot and give the last picture, which `end` draws."""
    for inputs in firings:
        assert fire(node, **inputs).outputs == {}
    return fire(node, hook="end").outputs["plot"]


def stamped(*samples: tuple[float, Any]) -> list[dict[str, Any]]:
    return [{"value": hfg.Token(value, 0, stamp)} for stamp, value in samples]


@pytest.mark.slow
def test_each_kind_of_plot_has_something_to_see() -> None:
    lines = last(display.TimePlot(), *stamped((0, 1.0), (1, 3.0), (2, 2.0)))
    assert lines.shape == (480, 640, 3)
    assert lines.dtype == np.uint8
    assert ink(lines) > 300
    two = last(display.TimePlot(), *stamped((0, [1.0, 2.0]), (1, [3.0, 2.0]), (2, [2.0, 1.0])))
    assert ink(two) > 1.5 * ink(lines)
    points = last(display.ScatterPlot(), {"x": 1.0, "y": 2.0}, {"x": [2.0, 3.0], "y": np.array([1.0, 4.0])})
    assert 30 < ink(points) < ink(lines)
    vectors = last(display.VectorPlot(vectors=2, names=["a"]), {"vectors": [[1, 2, 3], [3, 1, 2]], "at": [0, 5, 6]})
    assert ink(vectors) > 300
    assert ink(last(display.HistogramPlot(), {"value": [1, 1, 2, 3]}, {"value": 2})) > 3000


@pytest.mark.slow
def test_a_plot_is_as_large_as_it_says_and_red_is_red() -> None:
    picture = last(display.ScatterPlot(width=200, height=100, point_size=80.0), {"x": 0.0, "y": 0.0})
    assert picture.shape == (100, 200, 3)
    blue, _, red = picture[50, 110].tolist()
    assert blue > red  # the first colour of matplotlib is a blue


@pytest.mark.parametrize(
    "node", [display.TimePlot(), display.HistogramPlot(), display.ScatterPlot(), display.VectorPlot()]
)
def test_nothing_is_drawn_of_nothing(node: Any) -> None:
    assert fire(node, hook="end").outputs == {}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1e308, 1e308])
def test_numbers_that_cannot_be_drawn_are_left_out(wrong: float) -> None:
    last(display.TimePlot(), *stamped((0, 1.0), (1, wrong), (2, 2.0)))
    last(display.ScatterPlot(), {"x": wrong, "y": 1.0}, {"x": 1.0, "y": 2.0})
    last(display.VectorPlot(), {"vectors": [[1.0, wrong]]})
    last(display.HistogramPlot(), {"value": [1.0, wrong]})


def test_a_title_is_taken_as_it_is() -> None:
    last(display.TimePlot(title="$\\frac{", label="$x$ %s"), *stamped((0, 1.0)))


@pytest.mark.slow
def test_a_plot_is_drawn_now_and_then_and_at_the_end() -> None:
    node = display.TimePlot(every=2, path="plot.png")
    assert [bool(fire(node, value=float(number)).outputs) for number in range(5)] == [False, True, False, True, False]
    before = Path("plot.png").read_bytes()
    assert "plot" in fire(node, hook="end").outputs
    assert Path("plot.png").read_bytes() != before
    assert fire(node, hook="end").outputs == {}


@pytest.mark.slow
def test_a_plot_in_a_graph_is_written_when_the_stream_ends() -> None:
    report = run(display.TimePlot(path="plot.png", every=2), 1, 3, 2, rate_hz=1, output="plot")
    assert len(report.outputs["all"]) == 2
    picture = shown_in("plot.png")
    assert picture.shape == (480, 640, 4)
    assert ink(picture) > 300


def test_a_plot_of_a_run_that_is_stopped_is_written_too() -> None:
    graph = hfg.Graph()
    plot = graph.add(display.TimePlot(path="plot.svg"))
    graph.connect(graph.add(values.ConstantFloat(), max_rate_hz=1).out, plot.value)
    hfg.run(graph, clock="virtual", until_s=2.5)
    assert Path("plot.svg").read_text().startswith("<?xml")


def test_only_the_last_points_are_shown_and_all_can_be_forgotten() -> None:
    node = display.ScatterPlot(points=2)
    for number in range(5):
        fire(node, x=float(number), y=0.0)
    assert list(node.kept) == [(3.0, 0.0), (4.0, 0.0)]
    fire(node, slot="forget")
    assert list(node.kept) == []


def test_what_does_not_fit_together_is_told() -> None:
    with pytest.raises(ValueError, match="as many numbers for x as for y, got 1 and 2"):
        fire(display.ScatterPlot(), x=1.0, y=[1.0, 2.0])
    node = display.TimePlot()
    fire(node, value=1.0)
    with pytest.raises(ValueError, match="all tokens must have as many numbers, got 2 after 1"):
        fire(node, value=[1.0, 2.0])


def test_a_plot_that_cannot_be_written_says_why_and_leaves_the_old_file() -> None:
    Path("plot.xyz").write_text("old")
    with pytest.raises(ValueError, match=r'a plot cannot be written as "plot.xyz": end it with one of .*png'):
        fire(display.TimePlot(path="plot.xyz", every=1), value=1.0)
    assert Path("plot.xyz").read_text() == "old"
    Path("dir").mkdir()
    with pytest.raises(IsADirectoryError, match='cannot write "dir"'):
        fire(display.TimePlot(path="dir", every=1), value=1.0)


class Looked:
    """What a page looks at."""

    path, now = "show", 1.0

    def __init__(self, value: Any) -> None:
        self.value = value

    def latest(self, port: str) -> Any:
        return self.value if port == "value" else None

    def active(self) -> list[str]:
        return []


def shapes(value: Any) -> list[Any]:
    scene = display.Show().newest(Looked(value))
    assert scene is not None
    return [(kind, more[0]) for kind, *more in scene.shapes]


def test_what_is_shown_is_a_picture_or_lines_of_text() -> None:
    ((kind, image),) = shapes(np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4))
    assert (kind, image.dtype, int(image.max())) == ("image", np.uint8, 255)
    assert shapes("two words") == [("text", "two words")]
    assert shapes(3.5) == [("text", "3.5")]
    assert len(shapes(list(range(1000)))) == 10
    assert shapes(np.zeros((4, 4, 5), np.uint8)) == [("text", "array of uint8, 4 x 4 x 5")]
    assert display.Show().newest(Looked(None)) is None
