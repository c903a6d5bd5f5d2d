"""A studio with a page in a real browser: the person acts there, and the engine is asked what it then does."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import hfg
from hfg.studio.project import Project, RecordedProject
from hfg.studio.recorded import Recorded
from hfg.studio.serving import Server, StudioDoor
from hfg.studio.studio import Studio
from tests.limits import patience

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

__all__ = ["Bench", "Story"]

T = TypeVar("T")
_LOOK_EVERY_S = 0.02


class Bench:
    """A studio on a loop of its own, in a thread as a user's program would have it."""

    def __init__(
        self,
        graph: hfg.Graph,
        folder: Path,
        file: Path | None = None,
        read_only: str = "",
        recording: Path | None = None,
    ) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="studio of a story", daemon=True)
        self._thread.start()
        recorded = None if recording is None else Recorded(recording)
        self._project = Project(graph, folder, file, allow=("tests.studio.stories",))
        if recorded is not None and recording is not None:
            self._project = RecordedProject(recorded.graph_after(0), recording)
        self._read_only = read_only
        self.studio: Studio = self.call(lambda: Studio(self._project, read_only=read_only, recorded=recorded))
        self.server = self._serve(None)
        self.address = self.server.address

    def _serve(self, port: int | None) -> Server:
        server = Server(StudioDoor(self._loop, self.studio), port=port)
        server.start()
        return server

    @property
    def graph(self) -> hfg.Graph:
        return self.studio.graph

    def call(self, do: Callable[[], T]) -> T:
        """Do something on the studio's loop, where alone the graph may be read."""

        async def done() -> T:
            return do()

        return asyncio.run_coroutine_threadsafe(done(), self._loop).result(patience(10))

    def until(self, true: Callable[[], object], what: str = "") -> None:
        """Wait until something holds in the engine."""
        end = time.monotonic() + patience(10)
        while not self.call(true):
            assert time.monotonic() < end, f"it never held: {what or true}"
            time.sleep(_LOOK_EVERY_S)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let the studio answer nothing for a while, nor the graph go on."""
        stands, goes_on = threading.Event(), threading.Event()

        def stand() -> None:
            stands.set()
            goes_on.wait(patience(10))

        self._loop.call_soon_threadsafe(stand)
        assert stands.wait(patience(10))
        yield
        goes_on.set()

    def node(self, path: str) -> Any:
        return self.call(lambda: self.graph[path])

    def state(self, *states: str) -> None:
        """Wait until the run is in one of these states."""
        self.until(lambda: self.studio.steering.record.state in states, f"the run is {' or '.join(states)}")

    def is_active(self, path: str) -> bool:
        """Whether a node is active now; asked on the studio's loop."""
        run = self.studio.steering.run
        return run is not None and path in run.active()

    def cut(self) -> None:
        """The network is gone, the studio lives on."""
        asyncio.run_coroutine_threadsafe(self.server.stop(), self._loop).result(patience(10))

    def mend(self) -> None:
        """The network is back at the same port; pages have their cookies of before."""
        entrance, port = self.server.entrance, int(self.address.split(":")[2].split("/")[0])
        self.server = Server(StudioDoor(self._loop, self.studio), port=port)
        vars(self.server.entrance).update(vars(entrance))
        self.server.start()

    def close(self) -> None:
        async def end() -> None:
            await self.studio.close()
            await self.server.stop()
            left = asyncio.all_tasks() - {asyncio.current_task()}  # a level may just be laid out
            for task in left:
                task.cancel()
            await asyncio.gather(*left, return_exceptions=True)

        asyncio.run_coroutine_threadsafe(end(), self._loop).result(patience(10))
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(patience(5))
        self._loop.close()


class Story:
    """The page as a person uses it, and the engine behind it."""

    def __init__(self, bench: Bench, page: Page) -> None:
        self.bench = bench
        self.page = page
        self.errors: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.goto(bench.address)
        page.locator("[data-node]").first.wait_for()

    @property
    def graph(self) -> hfg.Graph:
        return self.bench.graph

    def node(self, path: str) -> Locator:
        return self.page.locator(f'[data-node="{path}"]')

    def port(self, path: str) -> Locator:
        return self.page.locator(f'#canvas [data-port="{path}"]')

    def select(self, path: str) -> None:
        """Click on a node, where nothing else lies on it."""
        self.node(path).locator(".t b").click()

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def start(self) -> None:
        """Start the run, and wait until it goes."""
        self.page.get_by_role("button", name="Start").click()
        self.bench.state("running")
        self.page.get_by_role("button", name="Pause").wait_for()

    def hold(self, path: str, to: tuple[float, float] | str) -> None:
        """Press on a port and drag to a place, or another port; the button stays down."""
        mouse = self.page.mouse
        x, y = self.middle(self.port(path))
        mouse.move(x, y)
        mouse.down()
        self.page.locator("#canvas.wiring").wait_for()
        self.page.locator(".dragline .num").first.wait_for()
        place = self.middle(self.port(to)) if isinstance(to, str) else to
        mouse.move(*place, steps=3)

    def drag(self, path: str, to: tuple[float, float] | str) -> None:
        self.hold(path, to)
        self.page.mouse.up()

    def middle(self, element: Locator) -> tuple[float, float]:
        box = element.bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def empty_place(self) -> tuple[float, float]:
        """A place of the canvas where nothing is: its lower right corner."""
        box = self.page.locator("#canvas").bounding_box()
        assert box is not None
        return box["x"] + box["width"] - 60, box["y"] + box["height"] - 60

    def moves_on(self, path: str) -> None:
        """Wait until a node receives more than it has."""
        before = self.bench.node(path).seen
        self.bench.until(lambda: self.graph[path].seen > before, f"{path} receives more")
