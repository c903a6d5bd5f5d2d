"""Work in thread groups: stages that sleep, and the camera of examples/photographs.py beside threads by hand."""

from __future__ import annotations

import importlib.util
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import hfg
from benchmarks.measure import ROOT
from benchmarks.meters import Arrivals
from benchmarks.ours import run

__all__ = ["PHOTOGRAPHS", "by_groups", "by_hand", "camera", "stages"]

STAGE_S = 0.02
PHOTOGRAPHS = 6
"""How many the example looks at: a look at each makes as many pictures."""


@hfg.node
def rest(value: int) -> int:
    """Take a while without a processor."""
    time.sleep(STAGE_S)
    return value


def stages(number: int, tokens: int) -> dict[str, float]:
    """Seconds from the first token to the arrival of the last, and what stages that overlap perfectly would take."""
    times = []

    def numbers() -> Iterator[int]:
        times.append(time.perf_counter())
        yield from range(tokens)

    def take(value: int) -> None:
        times.append(time.perf_counter())

    graph = hfg.Graph("stages")
    port: Any = graph.add(hfg.node(numbers)()).out
    for stage in range(number):
        graph.group(f"stage_{stage}", threads=1)
        node = graph.add(rest(), group=f"stage_{stage}")
        graph.connect(port, node.value)
        port = node.out
    graph.connect(port, graph.add(hfg.node(take)()).value)
    run(graph)
    if len(times) != tokens + 1:
        raise RuntimeError(f"{len(times) - 1} of {tokens} tokens have arrived")
    return {"wall": times[-1] - times[0], "ideal": (tokens + number - 1) * STAGE_S}


def example() -> ModuleType:
    """The example as a module; it needs OpenCV and scikit-image."""
    if "photographs" not in sys.modules:
        spec = importlib.util.spec_from_file_location("photographs", ROOT / "examples" / "photographs.py")
        assert spec is not None
        assert spec.loader is not None
        sys.modules["photographs"] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules["photographs"]


def by_groups(looks: int, take: Callable[[Any], None]) -> None:
    """Search the pictures for circles in one thread group; look, and search for lines, in another.

    So both have about as much to do. The loop puts together what they found. What goes from thread to thread has a
    place for one value (P4), as the queues by hand have: without it the camera, which is free only when what has
    become of its picture is taken (F5), would wait for the circles.
    """
    photographs = example()
    graph = hfg.Graph("camera")
    for group in ("circles", "lines"):
        graph.group(group, threads=1)
    source = graph.add(photographs.photographs(looks=looks), group="lines")
    for_circles = graph.add(photographs.smooth(ksize=5), group="circles")
    for_lines = graph.add(photographs.smooth(ksize=3), group="lines")
    circles = graph.add(photographs.find_circles(), group="circles")
    lines = graph.add(photographs.find_lines(), group="lines")
    sight = graph.add(photographs.see())
    graph.connect(source.picture, for_circles.src)
    graph.connect(source.picture, for_lines.src)
    graph.connect(for_circles.out, circles.picture)
    graph.connect(for_lines.out, lines.picture)
    for port in (source.ports.outputs["name"], source.picture):
        graph.connect(port, sight.ports.inputs[port.name], buffer=1)
    graph.connect(circles.out, sight.circles, buffer=1)
    graph.connect(lines.out, sight.lines, buffer=1)

    def arrived(sight: Any) -> None:
        take(sight)

    graph.connect(sight.out, graph.add(hfg.node(arrived)()).sight)
    run(graph)


def by_hand(looks: int, take: Callable[[Any], None]) -> None:
    """Do the same by two threads, with a queue of one place wherever something goes from thread to thread."""
    photographs = example()
    pictures, found, others = (queue.Queue[Any](1) for _ in range(3))
    smooth = photographs.cv2.medianBlur

    def look_for_lines() -> None:
        for look in photographs.photographs.function(looks=looks):
            pictures.put(look.picture)
            others.put((look, photographs.find_lines.function(smooth(look.picture, 3))))
        pictures.put(None)
        others.put(None)

    def look_for_circles() -> None:
        while (picture := pictures.get()) is not None:
            found.put(photographs.find_circles.function(smooth(picture, 5)))

    threads = [threading.Thread(target=work, daemon=True) for work in (look_for_lines, look_for_circles)]
    for thread in threads:
        thread.start()
    while (other := others.get()) is not None:
        look, lines = other
        take(photographs.see.function(look.name, look.picture, found.get(), lines))
    for thread in threads:
        thread.join()


def camera(way: Callable[[int, Callable[[Any], None]], None], pictures: int) -> dict[str, float]:
    """Microseconds a picture."""
    looks = max(1, pictures // PHOTOGRAPHS)
    meter = Arrivals(looks * PHOTOGRAPHS)
    way(looks, meter.take)
    return meter.figures()
