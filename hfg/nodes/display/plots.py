"""Numbers as pictures: over time, against each other, counted. Needs matplotlib, and no screen.

Depends on nodetype, ports and numpy.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from annotated_types import Interval, Predicate

from hfg.base.token import Token
from hfg.errors import UsageError
from hfg.images import Color
from hfg.nodes._extras import require
from hfg.nodes.files.access import is_a_path, named, write_whole
from hfg.nodes.values.vectors import Vector
from hfg.nodetypes.node import Node
from hfg.ports import Input, Inputs, Output, Parameter, State, slot

Numbers: TypeAlias = float | Vector
"""One number, or several: a list of them or an array with one axis."""

_SETTINGS: Final = "matplotlibrc"


class _Plot(Node):
    """Draws now and then what it has kept, to an output and a file."""

    path = Parameter("", Predicate(is_a_path), save=True)
    every = Parameter(0, Interval(ge=0))
    width = Parameter(640, Interval(ge=32, le=8192), unit="px")
    height = Parameter(480, Interval(ge=32, le=8192), unit="px")
    title = Parameter("")
    plot = Output(Color)
    since = State(0)

    def _draw(self, axes: Any) -> None:
        """Draw what was kept."""
        raise NotImplementedError

    def _taken(self) -> Color | None:
        """Count one more token; give a picture if it is time for one."""
        self.since += 1
        return self._picture() if self.every and self.since >= self.every else None

    def end(self) -> None:
        """Send the last picture, if there is anything that no picture shows yet."""
        if self.since:
            self.plot.send(self._picture())

    def _picture(self) -> Color:
        self.since = 0
        _need_no_strange_settings()
        require("matplotlib", "plot")
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # Without pyplot, which keeps every figure, and wants the main thread and maybe a screen.
        figure = Figure(figsize=(self.width / 100, self.height / 100), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        # Room for labels by hand: an automatic layout takes several times as long as the picture.
        axes: Any = figure.add_axes((0.13, 0.12, 0.84, 0.78))
        axes.grid(alpha=0.3)
        if self.title:
            axes.set_title(self.title, parse_math=False)
        with np.errstate(all="ignore"):
            self._draw(axes)
            canvas.draw()
            if self.path:
                write_whole(named(self.path), lambda file: self._save(figure, file))
        return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., 2::-1])

    def _save(self, figure: Any, file: Any) -> None:
        ending = named(self.path).suffix.removeprefix(".").lower() or "png"
        if ending not in figure.canvas.get_supported_filetypes():
            known = ", ".join(sorted(figure.canvas.get_supported_filetypes()))
            raise ValueError(f'a plot cannot be written as "{self.path}": end it with one of {known}')
        if ending == "png":
            from matplotlib.image import imsave

            imsave(file, figure.canvas.buffer_rgba(), format="png")  # what is drawn already
        else:
            figure.savefig(file, format=ending)

    def teardown(self) -> None:
        """Draw what a run that was stopped has left."""
        if self.path and self.since:
            self._picture()


def _need_no_strange_settings() -> None:
    """Refuse settings of matplotlib that lie in the working directory, unless they are named: they can run programs.

    Another person may have made the folder, and matplotlib reads the file when it is imported (rule L4).

    Raises:
      UsageError: there are some.
    """
    file, named = Path(_SETTINGS), os.environ.get("MATPLOTLIBRC", "")
    if "matplotlib" in sys.modules or not file.exists() or (named and file.resolve() == _settings_in(Path(named))):
        return
    raise UsageError(
        f"matplotlib would take its settings from {file.absolute()}, and settings can run programs: if you trust it, "
        f"set MATPLOTLIBRC={_SETTINGS}, else remove it or work in another folder"
    )


def _settings_in(place: Path) -> Path:
    return (place / _SETTINGS if place.is_dir() else place).resolve()


def finite(values: Any) -> Any:
    """Return numbers that can be drawn: what is infinite, or too large for a picture, is left out."""
    array = np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=np.float64)
    return np.where(np.abs(array) < 1e300, array, np.nan)


class TimePlot(_Plot):
    """Draw numbers over time.

    Each token has the time of its stamp. A picture is drawn after every `every` tokens, and when the stream ends or the
    run is stopped. Drawing takes some ten milliseconds, so put the node into a thread group. Needs matplotlib.

    Attributes:
      value: a number; or several, which make a line each: then all tokens have as many.
      path: path of the file, PNG, SVG or PDF, for the newest picture; "" writes none.
      every: number of tokens per picture; 0 draws only one, at the end.
      points: how many of the last tokens are shown; 0 shows and keeps all.
      relative: whether the time begins with 0 at the first token that is shown.
      width: width of the picture, in pixels.
      height: height of the picture, in pixels.
      title: title above the picture.
      label: label of the axis of the numbers.
      forget: starts over.
      plot: each picture, blue, green and red.

    Raises:
      ValueError: tokens have different numbers of numbers, or the path has no image format as its extension.
      OverflowError: a whole number is too large for a float.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ModuleNotFoundError: matplotlib is not installed.

    CS::APEX: csapex::TimePlot.
    """

    value = Input(Numbers)
    points = Parameter(1000, Interval(ge=0))
    relative = Parameter(True)
    label = Parameter("")
    kept = State(factory=deque[tuple[float, Any]])

    def process(self, value: Token[Numbers]) -> Color | None:
        """Keep it."""
        row = np.atleast_1d(np.asarray(value.value, dtype=np.float64))
        if self.kept and len(row) != len(self.kept[-1][1]):
            raise ValueError(f"all tokens must have as many numbers, got {len(row)} after {len(self.kept[-1][1])}")
        self.kept.append((value.stamp, row))
        while self.points and len(self.kept) > self.points:
            self.kept.popleft()
        return self._taken()

    @slot
    def forget(self) -> None:
        """Start over."""
        self.kept = deque()

    def _draw(self, axes: Any) -> None:
        axes.set_xlabel("time in s")
        axes.set_ylabel(self.label, parse_math=False)
        if self.kept:
            stamps = np.array([stamp for stamp, _ in self.kept])
            axes.plot(stamps - stamps[0] if self.relative else stamps, finite(np.array([row for _, row in self.kept])))


class ScatterPlot(_Plot):
    """Draw points by two streams of numbers.

    A picture is drawn after every `every` tokens, and when a stream ends or the run is stopped. Drawing takes some ten
    milliseconds, so put the node into a thread group. Needs matplotlib.

    Attributes:
      x: a number to the right, or several, for as many points.
      y: a number upwards, or as many.
      path: path of the file, PNG, SVG or PDF, for the newest picture; "" writes none.
      every: number of tokens per picture; 0 draws only one, at the end.
      points: how many of the last points are shown; 0 shows and keeps all.
      point_size: how large a point is, in pixels.
      width: width of the picture, in pixels.
      height: height of the picture, in pixels.
      title: title above the picture.
      x_label: label of the horizontal axis.
      y_label: label of the vertical axis.
      forget: starts over.
      plot: each picture, blue, green and red.

    Raises:
      ValueError: x and y are not as many, or the path has no image format as its extension.
      OverflowError: a whole number is too large for a float.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ModuleNotFoundError: matplotlib is not installed.

    CS::APEX: csapex::ScatterPlot.
    """

    x = Input(Numbers)
    y = Input(Numbers)
    points = Parameter(10_000, Interval(ge=0))
    point_size = Parameter(4.0, Interval(gt=0, le=1000), unit="px")
    x_label = Parameter("x")
    y_label = Parameter("y")
    kept = State(factory=deque[tuple[float, float]])

    def process(self, x: Numbers, y: Numbers) -> Color | None:
        """Keep them."""
        right, up = (np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in (x, y))
        if len(right) != len(up):
            raise ValueError(f"there must be as many numbers for x as for y, got {len(right)} and {len(up)}")
        self.kept.extend(zip(right.tolist(), up.tolist(), strict=True))
        while self.points and len(self.kept) > self.points:
            self.kept.popleft()
        return self._taken()

    @slot
    def forget(self) -> None:
        """Start over."""
        self.kept = deque()

    def _draw(self, axes: Any) -> None:
        axes.set_xlabel(self.x_label, parse_math=False)
        axes.set_ylabel(self.y_label, parse_math=False)
        if self.kept:
            points = finite(np.array(self.kept))
            axes.scatter(points[:, 0], points[:, 1], s=self.point_size**2)


class VectorPlot(_Plot):
    """Draw the newest vectors of several streams, each as a line.

    A picture is drawn after every `every` tokens, and when a stream ends or the run is stopped. Drawing takes some ten
    milliseconds, so put the node into a thread group. Needs matplotlib.

    Attributes:
      at: where the numbers stand, to the right; without an edge they are counted from 0. It serves the vectors that are
        as long.
      vectors: any number of vectors.
      path: path of the file, PNG, SVG or PDF, for the newest picture; "" writes none.
      every: number of tokens per picture; 0 draws only one, at the end.
      names: of the lines, in order.
      width: width of the picture, in pixels.
      height: height of the picture, in pixels.
      title: title above the picture.
      x_label: label of the horizontal axis.
      y_label: label of the vertical axis.
      plot: each picture, blue, green and red.

    Raises:
      ValueError: the path has no image format as its extension.
      OverflowError: a whole number is too large for a float.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ModuleNotFoundError: matplotlib is not installed.

    CS::APEX: csapex::VectorPlot.
    """

    at = Input(Vector, optional=True)
    vectors = Inputs(Vector, 1)
    names = Parameter[Sequence[str]]((), type=Sequence[str])
    x_label = Parameter("")
    y_label = Parameter("")
    newest = State(factory=list[Any])
    places = State[Any](None)

    def process(self, at: Vector | None, vectors: list[Vector]) -> Color | None:
        """Keep them."""
        self.newest = [finite(vector) for vector in vectors]
        self.places = None if at is None else finite(at)
        return self._taken()

    def _draw(self, axes: Any) -> None:
        axes.set_xlabel(self.x_label, parse_math=False)
        axes.set_ylabel(self.y_label, parse_math=False)
        for number, vector in enumerate(self.newest):
            fits = self.places is not None and len(self.places) == len(vector)
            name = self.names[number] if number < len(self.names) else None
            axes.plot(self.places if fits else np.arange(len(vector)), vector, label=name)
        if self.names:
            axes.legend()


class HistogramPlot(_Plot):
    """Draw how many numbers of a stream fell into each of several ranges.

    A picture is drawn after every `every` tokens, and when the stream ends or the run is stopped. Drawing takes some
    ten milliseconds, so put the node into a thread group. Needs matplotlib.

    Attributes:
      value: a number, or several.
      path: path of the file, PNG, SVG or PDF, for the newest picture; "" writes none.
      every: number of tokens per picture; 0 draws only one, at the end.
      points: how many of the last numbers are counted; 0 counts and keeps all.
      bins: how many ranges, all equal, from the smallest number to the largest.
      width: width of the picture, in pixels.
      height: height of the picture, in pixels.
      title: title above the picture.
      label: label of the axis of the numbers.
      forget: starts over.
      plot: each picture, blue, green and red.

    Raises:
      ValueError: the path has no image format as its extension.
      OverflowError: a whole number is too large for a float.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ModuleNotFoundError: matplotlib is not installed.
    """

    value = Input(Numbers)
    points = Parameter(10_000, Interval(ge=0))
    bins = Parameter(20, Interval(ge=1, le=10_000))
    label = Parameter("")
    kept = State(factory=deque[float])

    def process(self, value: Numbers) -> Color | None:
        """Keep it."""
        self.kept.extend(np.atleast_1d(np.asarray(value, dtype=np.float64)).tolist())
        while self.points and len(self.kept) > self.points:
            self.kept.popleft()
        return self._taken()

    @slot
    def forget(self) -> None:
        """Start over."""
        self.kept = deque()

    def _draw(self, axes: Any) -> None:
        axes.set_xlabel(self.label, parse_math=False)
        axes.set_ylabel("how many")
        numbers = finite(self.kept)
        numbers = numbers[np.isfinite(numbers)]
        if len(numbers):
            try:
                counts, edges = np.histogram(numbers, bins=self.bins)
            except ValueError:  # numbers that differ by less than floats can be parted
                counts, edges = np.histogram(numbers, bins=1)
            axes.stairs(counts, edges, fill=True)  # one shape; a bar for each range takes seconds
