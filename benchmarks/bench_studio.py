"""The page of the studio on a graph of 500 nodes and 700 edges, 200 of the nodes at work 30 times a second.

Measured: in Chromium on the page as it ships, drawn without a graphics card, with the studio in a process of its own.
  A moment is the time from the browser's stamp of what the person did, or the engine's of what happened, until the
  first frame that shows it is painted; the figure is the 95th percentile. `busy` is the share of the time in which the
  page's main thread works while nobody touches the page, `processor` how much of a processor that is.
Not measured: a graphics card, other browsers, a network between page and studio.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import time
from collections.abc import Callable
from functools import partial
from math import cos, sin
from multiprocessing.synchronize import Event
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.browser import Looker, percentile, resident_mb
from benchmarks.crowd import build
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from hfg.studio.project import Project
from hfg.studio.serving import Server, StudioDoor
from hfg.studio.studio import Studio
from tools.browser import CHROMIUM, StudioProcess, browsers

DISTRIBUTIONS = ("hfg", "playwright")
RUNS = 3
CROWD = "benchmarks.crowd:build"
EACH = 20
PAUSE_MS = 150
"""Between two moments: nobody is faster."""

Measured = Callable[[Looker, int], list[float]]


# --- what a person does ---


def press(looker: Looker, times: int) -> list[float]:
    """Press on a port: what takes its wire lights up."""
    mouse, took = looker.page.mouse, []
    at = looker.middle(looker.port("ticks.out"))
    for _ in range(times):
        mouse.move(*looker.empty_place())
        mouse.move(*at, steps=4)
        looker.page.wait_for_timeout(PAUSE_MS)
        took.append(looker.takes("pointerdown", "document.querySelector('#canvas .expects')", mouse.down))
        _let_go(looker)
    return took


def _let_go(looker: Looker) -> None:
    looker.page.keyboard.press("Escape")
    looker.page.mouse.up()
    looker.page.wait_for_timeout(PAUSE_MS)


def refuse(looker: Looker, times: int) -> list[float]:
    """Drag over a port that refuses: the reason appears."""
    mouse, took = looker.page.mouse, []
    start, end = (looker.middle(looker.port(path)) for path in ("ticks.out", "stamp.write"))
    for _ in range(times):
        mouse.move(*start)
        looker.page.wait_for_timeout(PAUSE_MS)
        mouse.down()
        looker.page.locator(".dragline .num").first.wait_for()
        mouse.move(end[0] - 120, end[1], steps=3)
        looker.page.wait_for_timeout(PAUSE_MS)
        took.append(looker.takes("pointermove", "document.querySelector('.reason.no')", lambda: mouse.move(*end)))
        _let_go(looker)
    return took


def drop(looker: Looker, times: int) -> list[float]:
    """Drop a wire on a port that takes it: the edge is there."""
    mouse, took = looker.page.mouse, []
    edge = 'document.querySelector(\'[data-edges*="spare.value"], [data-asked*="spare.value"]\')'
    start, end = (looker.middle(looker.port(path)) for path in ("ticks.out", "spare.value"))
    for _ in range(times):
        mouse.move(*start)
        looker.page.wait_for_timeout(PAUSE_MS)
        mouse.down()
        looker.page.locator(".dragline .num").first.wait_for()
        mouse.move(*end, steps=3)
        looker.page.wait_for_timeout(PAUSE_MS)
        took.append(looker.takes("pointerup", edge, mouse.up))
        looker.page.wait_for_timeout(4 * PAUSE_MS)
        looker.page.keyboard.press("Control+z")
        looker.page.locator('[data-edges*="spare.value"]').wait_for(state="detached")
        looker.page.wait_for_timeout(4 * PAUSE_MS)
    return took


def open_palette(looker: Looker, times: int) -> list[float]:
    """Press Tab: the palette is open."""
    took = []
    looker.page.locator("#canvas").focus()
    for _ in range(times):
        rows = "document.querySelector('.palette li b')"
        took.append(looker.takes("keydown", rows, lambda: looker.page.keyboard.press("Tab")))
        looker.page.wait_for_timeout(PAUSE_MS)
        looker.page.keyboard.press("Escape")
        looker.page.locator("#canvas").focus()
        looker.page.wait_for_timeout(PAUSE_MS)
    return took


def type_letters(looker: Looker, times: int) -> list[float]:
    """Type the last letter of a word into the palette: the rows that answer are there."""
    took = []
    looker.page.locator("#canvas").focus()
    looker.page.keyboard.press("Tab")
    looker.page.locator(".palette li b").first.wait_for()
    field = looker.page.locator(".palette input")
    for number in range(times):
        word = ("threshold", "circle", "blur", "gate")[number % 4]
        field.fill(word[:-1])
        looker.page.wait_for_timeout(2 * PAUSE_MS)
        answers = f"document.querySelector('.palette li.sel b')?.textContent.includes({word!r})"
        took.append(looker.takes("keydown", answers, partial(looker.page.keyboard.press, word[-1])))
        looker.page.wait_for_timeout(PAUSE_MS)
    return took


PIXEL = 'document.querySelector(\'canvas[data-probe="shade.out"]\').getContext("2d").getImageData(9, 9, 1, 1).data[0]'


def drag_parameter(looker: Looker, times: int) -> list[float]:
    """Drag a parameter: the picture that the node draws with it is there."""
    looker.select("shade")
    looker.page.locator("#side .prt").get_by_role("button", name="out", exact=True).click()
    looker.page.locator('canvas[data-probe="shade.out"]').wait_for()
    slider = looker.page.locator('[data-slider="level"]')
    box = slider.bounding_box()
    assert box is not None
    mouse, took, y = looker.page.mouse, [], box["y"] + box["height"] / 2
    mouse.move(box["x"] + box["width"] * 0.2, y)
    mouse.down()
    looker.page.wait_for_timeout(4 * PAUSE_MS)
    for number in range(times):
        share = 0.8 if number % 2 == 0 else 0.2
        wanted = f"Math.abs({PIXEL} - {255 * share}) < 8"
        took.append(looker.takes("pointermove", wanted, partial(mouse.move, box["x"] + box["width"] * share, y)))
        looker.page.wait_for_timeout(2 * PAUSE_MS)
    mouse.up()
    looker.page.get_by_role("button", name="Unpin shade.out").click()
    return took


WATCH = """(times) => new Promise(done => {
  const took = [], seen = new Set();
  let before = new Set();
  heard.moves = [];
  const nameOf = one => one.closest("[data-node]")?.dataset.node ?? one.dataset.ends;
  const note = path => {
    const move = heard.moves.findLast(([, node, on]) => on && path.split(" ").includes(node));
    if (!move || seen.has(move)) return;
    seen.add(move);
    const happened = 1000 * (heard.run.at - heard.run.elapsed_s + move[0]);
    painted(() => took.push(performance.timeOrigin + performance.now() - happened));
  };
  const look = () => {
    const now = new Set([...document.querySelectorAll("%s")].map(nameOf));
    for (const path of now) if (!before.has(path)) note(path);
    before = now;
    if (took.length >= times) done(took); else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})"""


def ring(looker: Looker, times: int) -> list[float]:
    """Activity moves: the ring of the node that has it now is there."""
    return list(looker.page.evaluate(WATCH % ".active:is([data-node=rest], [data-node=think])", times))


def way(looker: Looker, times: int) -> list[float]:
    """Activity moves: the line over which it comes is orange."""
    return list(looker.page.evaluate(WATCH % ".layer-hot .wire-group", times))


def enter(looker: Looker, times: int) -> list[float]:
    """Go into a subgraph."""
    took = []
    for _ in range(times):
        inside = "document.querySelector('[data-node=\"errand/there\"]')"
        middle = looker.middle(looker.node("errand"))
        took.append(looker.takes("dblclick", inside, partial(looker.page.mouse.dblclick, *middle)))
        looker.page.wait_for_timeout(2 * PAUSE_MS)
        looker.page.keyboard.press("Backspace")
        looker.node("errand").wait_for()
        looker.page.wait_for_timeout(2 * PAUSE_MS)
    return took


def leave(looker: Looker, times: int) -> list[float]:
    """Come back out of it."""
    took = []
    for _ in range(times):
        looker.page.mouse.dblclick(*looker.middle(looker.node("errand")))
        looker.node("errand/there").wait_for()
        looker.page.wait_for_timeout(2 * PAUSE_MS)
        outside = "document.querySelector('[data-node=\"ticks\"]')"
        took.append(looker.takes("keydown", outside, lambda: looker.page.keyboard.press("Backspace")))
        looker.page.wait_for_timeout(2 * PAUSE_MS)
    return took


def scrub(looker: Looker, times: int) -> list[float]:
    """Drag the timeline of the run to another time: the next frame shows it."""
    box = looker.page.locator("#time canvas").bounding_box()
    assert box is not None
    mouse, took = looker.page.mouse, []
    mouse.move(box["x"] + 160, box["y"] + 14)
    mouse.down()
    mouse.move(box["x"] + 180, box["y"] + 14)
    for number in range(5 * times):
        x = box["x"] + 180 + (number * 137) % (box["width"] - 200)
        took.append(looker.takes("pointermove", "true", partial(mouse.move, x, box["y"] + 14)))
    mouse.up()
    looker.page.keyboard.press("l")
    return took


FAILED = """() => { window.measured = new Promise(done => {
  const look = () => {
    const toasts = [...document.querySelectorAll(".toast")].map(one => one.textContent);
    const found = toasts.map(text => /failed at (\\d{6,}\\.\\d+)/.exec(text)).find(Boolean);
    if (!found) return requestAnimationFrame(look);
    painted(() => done(performance.timeOrigin + performance.now() - 1000 * Number(found[1])));
  };
  requestAnimationFrame(look);
}); }"""


def fail(looker: Looker, times: int) -> list[float]:
    """A node fails, and with it the run: the sentence is there. Once in a process."""
    looker.select("check")
    field = looker.page.get_by_label("fails")
    field.fill("true")
    looker.page.evaluate(FAILED)
    field.press("Enter")
    return [float(looker.page.evaluate("window.measured"))]


# --- cases ---

MOMENTS: dict[str, tuple[Measured, float]] = {
    "a port is pressed: its targets are lit": (press, 32),
    "over a port that refuses: the reason": (refuse, 50),
    "a wire is dropped: the edge": (drop, 100),
    "the palette opens": (open_palette, 80),
    "a letter in the palette: rows": (type_letters, 50),
    "a parameter is dragged: the picture": (drag_parameter, 100 + 1000 / 30),
    "activity moves: the line": (way, 100),
    "activity moves: the ring, without motion": (ring, 100),
    "into a subgraph": (enter, 150),
    "out of a subgraph": (leave, 150),
    "the timeline is dragged: the frame": (scrub, 33),
    "a node fails: the sentence": (fail, 200),
}


def moment(name: str, times: int) -> dict[str, float]:
    """The 95th percentile of a moment, its median and its longest."""
    measured, _ = MOMENTS[name]
    with StudioProcess(CROWD, "--run") as studio, browsers() as browser:
        looker = Looker(browser, studio.address, calm=measured is not way)
        looker.page.wait_for_timeout(3000)
        took = measured(looker, times)
    return {"p95": percentile(took), "p50": percentile(took, 0.5), "max": max(took)}


def ready(times: int) -> dict[str, float]:
    """The address is opened: nodes are painted, and live. In a studio that has just begun, then once more."""
    with StudioProcess(CROWD, "--run") as studio, browsers() as browser:
        first, *others = [_opened(browser, studio) for _ in range(times)]
    return {"first": first, "later": percentile(others, 0.5)}


def _opened(browser: Any, studio: StudioProcess) -> float:
    looker = Looker(browser, studio.address)
    looker.close()
    return looker.ready_ms


def frames(seconds: int) -> dict[str, float]:
    """Frames while one pans and zooms; the figure is the slower of both, in milliseconds a frame."""
    with StudioProcess(CROWD, "--run") as studio, browsers() as browser:
        looker = Looker(browser, studio.address)
        looker.page.wait_for_timeout(5000)
        pan, longest = looker.frames(lambda: _pan(looker, seconds))
        zoom, longest_zoom = looker.frames(lambda: _zoom(looker, seconds))
    return {
        "ms": 1000 / min(pan, zoom),
        "pan_fps": pan,
        "zoom_fps": zoom,
        "longest_task_pan_ms": longest,
        "longest_task_zoom_ms": longest_zoom,
    }


def _pan(looker: Looker, seconds: int) -> None:
    mouse, (x, y) = looker.page.mouse, looker.empty_place()
    mouse.move(x, y)
    mouse.down()
    for step in range(60 * seconds):
        mouse.move(x - 200 + 200 * cos(step / 30), y - 200 * sin(step / 40))
        looker.page.wait_for_timeout(8)
    mouse.up()


def _zoom(looker: Looker, seconds: int) -> None:
    mouse, (x, y) = looker.page.mouse, looker.empty_place()
    mouse.move(x, y)
    for step in range(60 * seconds):
        mouse.wheel(0, 24 * sin(step / 30))
        looker.page.wait_for_timeout(8)


def alone(seconds: int) -> dict[str, float]:
    """What the page works while nobody touches it, and whether anything moves by itself."""
    with StudioProcess(CROWD, "--run") as studio, browsers() as browser:
        looker = Looker(browser, studio.address)
        looker.page.wait_for_timeout(15_000)  # the timeline is full
        bars = looker.page.locator("[data-node] canvas").count()
        looker.page.evaluate(
            """() => { window.shift = 0; new PerformanceObserver(list => {
              for (const one of list.getEntries()) shift += one.value;
            }).observe({type: "layout-shift"}); }"""
        )
        busy, processor = looker.busy(seconds)
        shift = looker.page.evaluate("window.shift")
    return {"busy": busy, "processor": processor, "bars": bars, "layout_shift": shift}


def restart(times: int) -> dict[str, float]:
    """The studio is killed and started again: from when it serves until the page is live."""
    took = []
    with StudioProcess(CROWD) as studio, browsers() as browser:
        looker = Looker(browser, studio.address)
        for _ in range(times):
            looker.page.wait_for_timeout(1000)
            looker.page.evaluate("() => { window.back = becomes(false).then(() => becomes(true)); }")
            studio.kill()
            studio.start()
            served = time.time()
            took.append(float(looker.page.evaluate("window.back")) - 1000 * served)
    return {"longest": max(took), "p50": percentile(took, 0.5)}


async def _watched(seconds: int) -> dict[str, float]:
    graph = build(None)
    with TemporaryDirectory() as folder:
        studio = Studio(Project(graph, Path(folder)))
        await studio.steering.start(stay=True)
        assert studio.steering.run is not None
        sampler = studio.steering.run.sampler()  # statistics are on
        server = Server(StudioDoor(asyncio.get_running_loop(), studio))
        server.start()
        fresh = multiprocessing.get_context("spawn")  # Playwright would take its time from this process
        there, suspended, over = (fresh.Event() for _ in range(3))
        page = fresh.Process(target=_look_on, args=(server.address, there, suspended, over))

        async def hop() -> float:
            done, began = sampler.done(), time.thread_time()
            await asyncio.sleep(seconds)
            return 1e6 * (time.thread_time() - began) / (sampler.done() - done)

        await asyncio.sleep(1)  # until regions are fused
        before = await hop()
        page.start()
        await asyncio.to_thread(there.wait)
        watched, memory = await hop(), resident_mb(os.getpid())
        suspended.set()
        await asyncio.sleep(2)
        asleep, grown = await hop(), resident_mb(os.getpid()) - memory
        over.set()
        await asyncio.to_thread(page.join)
        await asyncio.sleep(1)
        after = await hop()
        await studio.close()
        await server.stop()
    alone = (before + after) / 2
    return {"watched": watched / alone, "suspended": asleep / alone, "hop_us": alone, "grown_mb": grown}


def _look_on(address: str, there: Event, suspended: Event, over: Event) -> None:
    """Look at the page until it is suspended by a debugger."""
    with browsers() as browser:
        looker = Looker(browser, address)
        looker.page.wait_for_timeout(3000)
        there.set()
        while not suspended.is_set():
            looker.page.wait_for_timeout(100)
        looker.cdp.send("Debugger.enable")
        looker.cdp.send("Debugger.pause")
        over.wait()
        looker.cdp.send("Debugger.resume")


def watched(seconds: int) -> dict[str, float]:
    """Processor time of a firing at full speed: with one page beside none, and with the page suspended."""
    return asyncio.run(_watched(seconds))


CASES: dict[str, Case] = {}
GOALS: list[Goal] = []
SKIPPED: dict[str, str] = {}


def _goal(name: str, case: str, figure: str, budget: float) -> None:
    GOALS.append(Goal(name, Side(case, figure), budget, 1.0))


for _name, (_, _budget) in MOMENTS.items():
    CASES[_name] = Case(partial(moment, _name), EACH, "ms")
    _goal(_name, _name, "p95", _budget)
CASES["the page is ready"] = Case(ready, 4, "ms")
CASES["frames"] = Case(frames, 6, "ms")
CASES["left alone"] = Case(alone, 10, "%")
CASES["watched / unwatched"] = Case(watched, 5, "x")
CASES["killed and restarted"] = Case(restart, 3, "ms")
_goal("the page is ready", "the page is ready", "first", 2000)
_goal("pan and zoom: a frame", "frames", "ms", 1000 / 45)
_goal("pan: the longest task", "frames", "longest_task_pan_ms", 50)
_goal("untouched: the main thread is busy", "left alone", "busy", 60)
_goal("killed and restarted: live again", "killed and restarted", "longest", 1000)
_goal("watched / unwatched, statistics on", "watched / unwatched", "watched", 1 / 0.93)
_goal("suspended / unwatched, statistics on", "watched / unwatched", "suspended", 1 / 0.93)

if not CHROMIUM:
    SKIPPED.update(dict.fromkeys(CASES, "there is no Chromium"))
    CASES.clear()
