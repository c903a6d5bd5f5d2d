"""What hfg does between two processes: an edge of a graph that is cut, a link alone, programs that meet by a name.

The nodes are found by their names in both processes, so what they share in one of them is in the module.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np

import hfg
from benchmarks.measure import ROOT
from benchmarks.meters import Laps
from benchmarks.parcels import SHAPE, Job, Picture, Post, letter, opened, picture, picture_bytes
from hfg.links.local import LocalTransport
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.transport import Traffic

__all__ = ["activity", "edge", "link", "meeting", "pipeline"]

MEGABYTE = 2**20
POOL = 128 * MEGABYTE


@hfg.node
def letters(*, count: int = 10) -> Iterator[bytes]:
    """Write letters."""
    for number in range(count):
        yield letter(number)


@hfg.node
def pictures(*, count: int = 10) -> Iterator[tuple[int, int, Picture]]:
    """Yield the picture again and again, with its number and the time."""
    for number in range(count):
        yield number, time.monotonic_ns(), picture()


@hfg.node
def read(letter: bytes) -> None:
    """Take a letter."""
    Post.current.take_letter(letter)


@hfg.node
def see(picture: tuple[int, int, Picture]) -> None:
    """Take a picture."""
    Post.current.take_picture(*picture)


def ends(graph: hfg.Graph, job: Job, **options: Any) -> tuple[Any, Any]:
    """Add a source, and give it and who takes what it sends, which is not added."""
    source: hfg.Node = letters(count=job.number) if job.what == "letter" else pictures(count=job.number)
    graph.add(source, max_rate_hz=job.rate_hz or None, **options)
    return source, read() if job.what == "letter" else see()


# --- an edge over the cut -------------------------------------------------------------------------------------------


def edge(window: int, job: Job) -> dict[str, float]:
    """A source in a process of its own, and who takes it in the main one; leaky: as an event, the latest counts."""
    Post.current = Post(job)
    graph = hfg.Graph("crossing")
    graph.group("far", process=True)
    source, sink = ends(graph, job, group="far")
    graph.add(sink, release="sequential" if window == 1 else "auto")
    entry = next(iter(sink.ports.inputs.values()))
    if job.leaky:
        graph.connect(source.out.sent, entry, overflow="latest")
    else:
        graph.connect(source.out, entry, buffer=window - 1)
    hfg.run(graph)
    return Post.current.figures()


# --- a link alone ---------------------------------------------------------------------------------------------------


async def paced(job: Job, send: Callable[[int], Awaitable[object]]) -> None:
    """Send at the rate of the job; as fast as it goes the loop has its turns whenever sending waits."""
    began = time.monotonic()
    for number in range(job.number):
        wait_s = job.wait_s(began, number)
        if wait_s > 0:
            await asyncio.sleep(wait_s)
        await send(number)


async def open_session(folder: str, way: str) -> Any:
    """Open a session: "straight" as parts of a run do on one host, else over Zenoh, perhaps with its shared memory."""
    if way == "straight":
        return await LocalTransport().open(folder=folder)
    from hfg_transports.zenoh import ZenohTransport

    meet = [f"unixsock-stream/{folder}/meet"]
    return await ZenohTransport().open(realm=Path(folder).name, meet=meet, shared_memory=POOL * (way == "shared"))


async def link_sender(job: Job, folder: str, window: int, way: str) -> None:
    """Send over a link: the other process."""
    session = await open_session(folder, way)
    exact = None if job.leaky else LinkSender(session, "link", epoch=1, window=window)
    loose = BoundedSender(session, "link", epoch=1) if job.leaky else None
    if exact is not None:
        exact.admit("here", 1)
    publisher = session.publisher("link/tokens", Traffic.BULK)
    while loose is not None and not publisher.wanted:  # noqa: ASYNC110 - nobody tells, and what is sent before is lost
        await asyncio.sleep(0.01)

    async def send(number: int) -> None:
        token = (b"", letter(number)) if job.what == "letter" else (letter(number), picture_bytes())
        if exact is not None:
            await exact.send(token)
        elif loose is not None:
            loose.send_nowait(token)
            await asyncio.sleep(0)  # a turn of the loop is a datagram

    await paced(job, send)
    if exact is not None:
        await exact.wait_finished()
        await exact.close(over=True)
    elif loose is not None:
        await loose.close()
    await session.close()


async def link_receiver(post: Post, folder: str, window: int, way: str) -> None:
    """Receive: this process."""
    session = await open_session(folder, way)
    is_picture = post.job.what == "picture"
    over = asyncio.Event()
    receiver: LinkReceiver | BoundedReceiver

    def arrived() -> None:
        deliveries = receiver.machine.take_all()
        for delivery in deliveries:
            metadata, value = delivery.token
            if is_picture:
                post.take_picture(*opened(metadata), np.frombuffer(value, np.uint8).reshape(SHAPE))
            else:
                post.take_letter(value)
        if isinstance(receiver, LinkReceiver):
            receiver.done(len(deliveries))
        if post.is_over:
            over.set()

    if post.job.leaky:
        receiver = BoundedReceiver(session, "link", arrived=arrived, producer=1)
    else:
        receiver = LinkReceiver(
            session, "link", consumer="here", incarnation=1, producer=1, capacity=window, arrived=arrived
        )
    job = post.job._asdict()
    process = begin("link", {"job": job, "folder": folder, "window": window, "way": way})
    await until_over(process, over)
    await receiver.close()
    await session.close()


def link(window: int, way: Literal["straight", "zenoh", "shared"], job: Job) -> dict[str, float]:
    """A link without a graph: straight, over Zenoh, or over Zenoh with its shared memory."""
    post = Post(job)
    with tempfile.TemporaryDirectory(prefix="hfg-") as folder:
        asyncio.run(link_receiver(post, folder, window, way))
    return post.figures()


# --- programs that meet ---------------------------------------------------------------------------------------------


def meeting(window: int, job: Job) -> dict[str, float]:
    """`hfg.publish` in one program, `hfg.subscribe` in the other."""
    Post.current = post = Post(job)
    with tempfile.TemporaryDirectory(prefix="hfg-") as folder:
        settings = Path(folder) / "here.toml"
        settings.write_text(f'realm = "{Path(folder).name}"\n', encoding="utf-8")
        graph = hfg.Graph("subscriber")
        sink = graph.add(read() if job.what == "letter" else see())
        hfg.subscribe(
            "parcels",
            next(iter(sink.ports.inputs.values())),
            settings=str(settings),
            capacity=window,
            overflow="latest" if job.leaky else "wait",
        )
        process = begin("meeting", {"job": job._asdict(), "settings": str(settings), "window": window})
        hfg.run(graph)
        process.wait(10)
    return post.figures()


def publisher(job: Job, settings: str, window: int) -> None:
    """The program that publishes."""
    graph = hfg.Graph("publisher")
    source, _ = ends(graph, job)
    hfg.publish("parcels", source.out, settings=settings, window=window, absent="wait", lossless=not job.leaky)
    hfg.run(graph)


# --- activity -------------------------------------------------------------------------------------------------------


class Here(hfg.Node):
    """Has the activity, gives it away and reads the clock when it comes back."""

    away = hfg.Event(int)
    meter: Laps

    @hfg.slot
    def begin(self) -> None:
        """Release it for the first time."""
        Here.meter.lap()
        self.away.trigger(Here.meter.tokens - 1)

    @hfg.slot
    def back(self, left: int) -> None:
        """Release it again."""
        Here.meter.lap()
        if left:
            self.away.trigger(left - 1)


class There(hfg.Node):
    """Returns it."""

    away = hfg.Event(int)

    @hfg.slot
    def take(self, left: int) -> None:
        """Return it."""
        self.away.trigger(left)


def activity(rounds: int) -> dict[str, float]:
    """Activity over an active edge that is cut, and back over another: microseconds one way."""
    Here.meter = Laps(rounds)
    graph = hfg.Graph("activity")
    graph.group("far", process=True)
    here, there = graph.add(Here()), graph.add(There(), group="far")
    here.away.activates(there.take)
    there.away.activates(here.back)
    graph.start.activates(here.begin)
    hfg.run(graph)
    return Here.meter.figures(2)


# --- heavy work -----------------------------------------------------------------------------------------------------


@hfg.node
def note(areas: tuple[int, int]) -> None:
    """Note when a result has come."""
    NOTED.append(time.perf_counter())


NOTED: list[float] = []


def pipeline(count: int) -> dict[str, float]:
    """The graph of examples/three_processes.py, cut and in one piece: seconds from the first result to the last."""
    folder = str(ROOT / "examples")
    if folder not in sys.path:
        sys.path.append(folder)  # the processes get the path, and find the node types there
    three_processes = import_module("three_processes")
    results, seconds = [], []
    for apart in (True, False):
        NOTED.clear()
        graph = three_processes.build(apart=apart, count=count)
        graph.connect(graph["parts"].out, graph.add(note()).areas)
        results.append(hfg.run(graph).outputs["areas"])
        seconds.append(NOTED[-1] - NOTED[0])
    if results[0] != results[1] or len(results[0]) != count:
        raise RuntimeError("three processes have found something else than one")
    return {"wall": seconds[0], "one process": seconds[1]}


# --- the other process ----------------------------------------------------------------------------------------------


def begin(what: str, arguments: dict[str, Any], module: str = "benchmarks.crossing") -> subprocess.Popen[bytes]:
    """Begin the other process."""
    return subprocess.Popen([sys.executable, "-m", module, what, json.dumps(arguments)], cwd=ROOT)


async def until_over(process: subprocess.Popen[bytes], over: asyncio.Event, silence_s: float = 0.5) -> None:
    """Wait until the last one has come; or, where that may be lost, until the other process is over and some more."""
    while not over.is_set():
        ended = process.poll()
        try:
            async with asyncio.timeout(silence_s):
                await over.wait()
        except TimeoutError:
            if ended is not None:
                return
    await asyncio.to_thread(process.wait)


def main() -> None:
    """Be the other process."""
    arguments = json.loads(sys.argv[2])
    arguments["job"] = Job(**arguments["job"])
    if sys.argv[1] == "link":
        asyncio.run(link_sender(**arguments))
    else:
        publisher(**arguments)


if __name__ == "__main__":
    main()
