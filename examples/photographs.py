"""A camera looks at photographs, searches them for things, and measures what it finds: data and states in one graph.

    camera ─┬─ smooth ── find circles ─┬─ see ─┬─ search ════════════ measuring ══ report ══ search ══ ...   (activity)
            └─ smooth ── find lines ───┘       └─ measure: clean ── fit ──┘

Shown: a library's functions as nodes, thread groups, a join, active edges in place of a state machine, and a gate on a
subgraph: the expensive measure works only while `measuring` is active. `python examples/photographs.py [FOLDER]` runs
it with the gate and without and tells what the gate saved, then once more and changes a parameter on the way. On a
terminal a table shows what the nodes do; pictures of the findings and a timeline go into FOLDER (default: out). As
every graph, it also runs by `hfg run examples/photographs.py -v`. The photographs come with scikit-image.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import cv2
import numpy as np
import skimage.data
from annotated_types import Ge, Interval
from reactivex import operators

import hfg
from hfg.cli.live import live_table
from hfg.images import Image
from hfg.timeline import Timeline
from hfg.trace import ActivityChanged, FiringStarted, TokenSent, TraceEvent

Clock = Literal["real", "virtual"]

cv2.setNumThreads(1)  # the groups bring the parallelism

STREAM = {name: getattr(skimage.data, name)() for name in ("camera", "coins", "brick", "page", "astronaut", "moon")}


class Look(NamedTuple):
    """What the camera gives: a picture, and of which photograph."""

    name: str
    picture: Image


class Circle(NamedTuple):
    """In pixels."""

    x: float
    y: float
    radius: float


class Box(NamedTuple):
    """Around a line of text, in pixels."""

    x: int
    y: int
    width: int
    height: int


class Ellipse(NamedTuple):
    """As OpenCV describes it, in pixels and degrees."""

    center: Sequence[float]
    axes: Sequence[float]
    angle: float

    @property
    def diameter(self) -> float:
        return float(np.sqrt(self.axes[0] * self.axes[1]))


class Sight(NamedTuple):
    """A look, and what both branches found in it."""

    name: str
    picture: Image
    circles: list[Circle]
    lines: list[Box]


class Measured(NamedTuple):
    """A clean picture, and the exact shape of what is in it."""

    name: str
    picture: Image
    rims: list[Ellipse]
    lines: list[Box]
    sharpness: float


class Summary(NamedTuple):
    """What is reported about a photograph: lengths in pixels, means of several looks."""

    name: str
    looks: int
    circles: int
    diameter: float
    lines: int
    spacing: float
    sharpness: float


# --- Data: a stream of pictures, two branches in threads of their own, and a join.


@hfg.node(outputs=Look)
def photographs(*, looks: Annotated[int, Ge(1)] = 6, noise: Annotated[float, Ge(0)] = 4.0) -> Iterator[Look]:
    """Look at one photograph after the other, with a noisy camera and an unsteady hand."""
    chance = np.random.default_rng(0)
    for name, original in STREAM.items():
        photograph = original if original.ndim == 2 else cv2.cvtColor(original, cv2.COLOR_RGB2GRAY)
        for _ in range(looks):
            left, up = chance.integers(0, 7, 2)
            moved = cv2.copyMakeBorder(photograph, 6 - up, up, 6 - left, left, cv2.BORDER_REPLICATE)
            yield Look(name, np.clip(moved + chance.normal(0, noise, moved.shape), 0, 255).astype(np.uint8))


smooth = hfg.node(cv2.medianBlur, inputs={"src": Image}, outputs=Image, parameters={"ksize": 5})


@hfg.node
def find_circles(picture: Image, *, roundness: Annotated[float, Interval(gt=0, lt=1)] = 0.86) -> list[Circle]:
    """Find the round things of 12 to 40 pixels."""
    found = cv2.HoughCircles(
        picture, cv2.HOUGH_GRADIENT_ALT, 2, 20, param1=300, param2=roundness, minRadius=12, maxRadius=40
    )
    return [] if found is None else [Circle(*map(float, circle)) for circle in found[0]]


@hfg.node
def find_lines(picture: Image) -> list[Box]:
    """Find the lines of text: ink that letters make a bar of, and that is many strokes."""
    ink = cv2.adaptiveThreshold(picture, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, 25, 18)
    bars = cv2.morphologyEx(ink, cv2.MORPH_CLOSE, np.ones((1, 21), np.uint8))
    bars = cv2.morphologyEx(bars, cv2.MORPH_OPEN, np.ones((3, 25), np.uint8))
    bars = cv2.morphologyEx(bars, cv2.MORPH_CLOSE, np.ones((1, 31), np.uint8))
    boxes = []
    for contour in cv2.findContours(bars, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
        x, y, width, height = cv2.boundingRect(contour)
        letters = cv2.bitwise_and(ink, bars)[y : y + height, x : x + width]
        strokes = np.max(np.sum(np.diff(letters, axis=1) == 255, axis=1))
        if width > 150 and height < 25 and strokes > 0.07 * width:
            left, top, wide, high = cv2.boundingRect(letters)
            boxes.append(Box(x + left, y + top, wide, high))
    return sorted(boxes, key=lambda box: box.y)


@hfg.node
def see(
    name: str, picture: Image, circles: list[Circle], lines: list[Box], *, at_least: Annotated[int, Ge(1)] = 5
) -> Sight:
    """Put together what belongs to one look; a few circles or lines are chance, and count as none."""
    return Sight(name, picture, circles if len(circles) >= at_least else [], lines if len(lines) >= at_least else [])


# --- The expensive part: a subgraph, which a gate can couple to activity as a whole.


@hfg.node
def clean(sight: Sight, *, strength: Annotated[float, Interval(gt=0, le=30)] = 8.0) -> Sight:
    """Take the noise out of the picture by non-local means: by far the most expensive work here."""
    return sight._replace(picture=cv2.fastNlMeansDenoising(sight.picture, None, strength, 7, 15))


@hfg.node
def fit(sight: Sight) -> Measured:
    """Fit an ellipse to every circle, and find the lines again in the clean picture."""
    picture = sight.picture
    rims = [fit_rim(picture, circle) for circle in sight.circles]
    sharpness = float(cv2.Laplacian(picture, cv2.CV_64F).var())
    lines = find_lines.function(picture) if sight.lines else []
    return Measured(sight.name, picture, rims, lines, sharpness)


def fit_rim(picture: Image, circle: Circle) -> Ellipse:
    """Look outwards from the center in all directions for the place where it gets dark the most."""
    reach, directions = 1.4 * circle.radius, 90
    rays = cv2.warpPolar(picture, (100, directions), (circle.x, circle.y), reach, cv2.WARP_POLAR_LINEAR)
    steps = cv2.Sobel(cv2.GaussianBlur(rays, (9, 3), 0), cv2.CV_32F, 1, 0)
    near = slice(55, 95)  # the circle itself is at 71
    radius = (near.start + np.argmin(steps[:, near], axis=1) + 0.5) * reach / 100
    angle = (np.arange(directions) + 0.5) * 2 * np.pi / directions
    rim = np.stack([circle.x + radius * np.cos(angle), circle.y + radius * np.sin(angle)], axis=1)
    return Ellipse(*cv2.fitEllipse(rim.astype(np.float32)))


class Measure(hfg.Subgraph):
    """Everything that is only worth its time when there is something to measure."""

    sight = hfg.Input(Sight)
    measured = hfg.Output(Measured)

    def build(self, graph: hfg.Graph) -> None:
        cleaner, fitter = graph.add(clean()), graph.add(fit())
        graph.connect(self.sight.inner, cleaner.sight)
        graph.connect(cleaner.out, fitter.sight)
        graph.connect(fitter.out, self.measured.inner)


# --- States: nodes like all others, but one of them is active.


class Search(hfg.Node):
    """Reports photographs with something in them that was not reported yet."""

    sight = hfg.Input(Sight)
    found = hfg.Event(str)
    reported = hfg.State(factory=set[str])

    def process(self, sight: Sight) -> None:
        if (sight.circles or sight.lines) and sight.name not in self.reported:
            self.found.trigger(sight.name)

    @hfg.slot
    def resume(self, summary: Summary) -> None:
        self.reported.add(summary.name)


class Measuring(hfg.Node):
    """While active, gathers measurements of the reported photograph until there are enough."""

    measured = hfg.Input(Measured)
    enough = hfg.Event(list[Measured])
    looks = hfg.Parameter(3, Ge(1))
    name = hfg.State("")
    kept = hfg.State(factory=list[Measured])

    @hfg.slot
    def begin(self, name: str) -> None:
        if name != self.name:
            self.name, self.kept = name, []

    def process(self, measured: Measured) -> None:
        if self.active and measured.name == self.name:
            self.kept.append(measured)
            if len(self.kept) >= self.looks:
                self.enough.trigger(self.kept)


class Report(hfg.Node):
    """Says what was measured; draws it too if there is a folder to draw into."""

    done = hfg.Event(Summary)
    folder = hfg.Parameter("")

    @hfg.slot
    def write(self, looks: list[Measured]) -> None:
        summary = summarize(looks)
        print(describe(summary))
        if self.folder:
            Path(self.folder).mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(Path(self.folder, f"{summary.name}.png")), draw(looks[-1], summary))
        self.done.trigger(summary)


# --- The graph.


def build(*, gated: bool = True, folder: str = "") -> hfg.Graph:
    """Build the graph; without the gate it finds the same, but measures all the time."""
    graph = hfg.Graph("photographs")
    for group in ("camera", "circles", "lines", "measure"):
        graph.group(group, threads=1)

    camera = graph.add(photographs(), name="camera", group="camera", max_rate_hz=12)
    for_circles, for_lines = graph.add(smooth(ksize=5), group="circles"), graph.add(smooth(ksize=3), group="lines")
    circles, lines = graph.add(find_circles(), group="circles"), graph.add(find_lines(), group="lines")
    sight = graph.add(see())
    search, measuring, report = graph.add(Search()), graph.add(Measuring()), graph.add(Report(folder=folder))
    measure = graph.add(Measure(), group="measure")

    graph.connect(camera.picture, for_circles.src)
    graph.connect(camera.picture, for_lines.src)
    for_circles >> circles
    for_lines >> lines
    graph.connect(camera.name, sight.name)
    graph.connect(camera.picture, sight.picture)
    graph.connect(circles.out, sight.circles)
    graph.connect(lines.out, sight.lines)
    graph.connect(sight.out, search.sight)
    graph.connect(sight.out, measure.sight)
    graph.connect(measure.measured, measuring.measured)

    graph.start.activates(search.activate)
    search.found.activates(measuring.begin)
    measuring.enough.activates(report.write)
    report.done.activates(search.resume)
    if gated:
        graph.gate(measure, by=measuring)

    graph.connect(report.done, graph.output("reports", Summary))
    return graph


# --- Findings as numbers, words and pictures.


def summarize(looks: list[Measured]) -> Summary:
    diameters = [rim.diameter for look in looks for rim in look.rims]
    spacings = [below.y - above.y for look in looks for above, below in zip(look.lines, look.lines[1:], strict=False)]
    return Summary(
        name=looks[0].name,
        looks=len(looks),
        circles=round(float(np.median([len(look.rims) for look in looks]))),
        diameter=float(np.mean(diameters)) if diameters else 0.0,
        lines=round(float(np.median([len(look.lines) for look in looks]))),
        spacing=float(np.median(spacings)) if spacings else 0.0,
        sharpness=float(np.mean([look.sharpness for look in looks])),
    )


def describe(summary: Summary) -> str:
    found, means = [], "one look" if summary.looks == 1 else f"means of {summary.looks} looks"
    if summary.circles:
        found.append(f"{summary.circles} circles, {summary.diameter:.1f} px across on average")
    if summary.lines:
        found.append(f"{summary.lines} lines of text, {summary.spacing:.0f} px apart")
    return f"{summary.name}: {' and '.join(found)}; sharpness {summary.sharpness:.0f} ({means})"


def draw(look: Measured, summary: Summary) -> Image:
    """Draw what was found onto the picture, at twice its size."""
    big = cv2.resize(cv2.cvtColor(look.picture, cv2.COLOR_GRAY2BGR), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    for (x, y), (width, height), angle in look.rims:
        cv2.ellipse(big, ((2 * x + 0.5, 2 * y + 0.5), (2 * width, 2 * height), angle), (90, 220, 90), 2, cv2.LINE_AA)
    for x, y, width, height in look.lines:
        cv2.rectangle(big, (2 * x - 4, 2 * y - 4, 2 * width + 8, 2 * height + 8), (60, 160, 255), 1, cv2.LINE_AA)
    caption = np.full((34, big.shape[1], 3), 32, np.uint8)
    cv2.putText(caption, describe(summary), (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (230, 230, 230), 1, cv2.LINE_AA)
    return np.vstack([big, caption])


# --- Runs, and what happened in them.


class Watched(NamedTuple):
    """The results of a run, its events, and its CPU seconds."""

    summaries: list[Summary]
    events: list[TraceEvent]
    cpu_s: float

    @property
    def cleaned(self) -> int:
        """How often `clean` worked."""
        firings = [one for one in self.events if isinstance(one, FiringStarted) and one.node == "measure/clean"]
        return sum(one.kind == "process" for one in firings)


def watch(graph: hfg.Graph, *, file: Path | None = None, hurry: bool = False, clock: Clock = "real") -> Watched:
    """Run the graph under a table of its nodes.

    With a file, write a timeline into it; in a hurry, let one look be enough after the first report: a parameter is
    changed while the graph runs.
    """
    events: list[TraceEvent] = []
    with live_table(clock == "real") as live:

        def begin(run: hfg.Run) -> None:
            live.begin(run)
            run.trace(events)
            if file is not None:
                run.trace(Timeline(file, graph))
            if hurry:
                first = graph["report"].done.pipe(operators.take(1))
                first.subscribe(lambda _: run.set(graph["measuring.looks"], 1))

        began = time.process_time()
        report = hfg.run(graph, clock=clock, begin=begin)
    return Watched(report.outputs["reports"], events, time.process_time() - began)


def timeline(events: list[TraceEvent], columns: int = 80) -> str:
    """Draw what the camera saw and which state was active, from left to right."""
    began, ended = events[0].time, events[-1].time

    def column(moment: float) -> int:
        return int((moment - began) / (ended - began) * (columns - 1))

    rows = {name: [" "] * columns for name in ("camera", "search", "measuring", "report")}
    looks = [event for event in events if isinstance(event, TokenSent) and event.edge == "camera.name -> see.name"]
    for name in STREAM:
        place = column(next(look.time for look in looks if look.token.value == name))
        rows["camera"][place : place + len(name)] = name
    changes = [event for event in events if isinstance(event, ActivityChanged)]
    for number, change in enumerate(changes):
        if change.active:
            later = (other.time for other in changes[number:] if other.node == change.node and not other.active)
            first, last = column(change.time), column(next(later, ended))
            rows[change.node][first : last + 1] = "━" * (last + 1 - first)
    lines = [f"  {name:10}{''.join(row).rstrip()}" for name, row in rows.items()]
    return "\n".join([*lines, f"  {'':10}0 s{f'{ended - began:.1f} s':>{columns - 3}}"])


def main(folder: str = "out") -> None:
    Path(folder).mkdir(parents=True, exist_ok=True)
    file = Path(folder, "photographs.json")
    print("With the gate: `measure` works only while `measuring` is active.\n")
    gated = watch(build(folder=folder), file=file)
    print(timeline(gated.events))
    print("\nWithout it: the same is found, but every picture is measured.\n")
    free = watch(build(gated=False))
    print(timeline(free.events))
    print("\nWith it, and steered: after the first report `measuring.looks` is set to 1 while the graph runs.\n")
    steered = watch(build(), hurry=True)
    print(timeline(steered.events))
    print(f"""
                         with the gate   without   saved    steered
  firings of clean       {gated.cleaned:13}{free.cleaned:10}{1 - gated.cleaned / free.cleaned:8.0%}{steered.cleaned:11}
  CPU seconds of the run {gated.cpu_s:13.2f}{free.cpu_s:10.2f}{1 - gated.cpu_s / free.cpu_s:8.0%}{steered.cpu_s:11.2f}

Pictures of the findings are in {folder}/. Open {file} in https://ui.perfetto.dev:
a timeline of the first run, with a row for each group, who was active, and the signals between them.""")


if __name__ == "__main__":
    main(*sys.argv[1:2])
