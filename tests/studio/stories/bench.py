"""A studio with a page in a real browser: the person acts there, and the engine is asked what it then does."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import hfg
from hfg.cli.studio import read_target
from hfg.studio.project import Project, RecordedProject
from hfg.studio.recorded import Recorded
from hfg.studio.refusing import Refused
from hfg.studio.serving import Server, StudioDoor
from hfg.studio.studio import Studio
from hfg.studio.web import PageOutbox, Visit
from tests.limits import patience
from tools.browser import Person, reserved_port

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["IN_THE_PAGE", "Bench", "Story"]

T = TypeVar("T")
_LOOK_EVERY_S = 0.02

IN_THE_PAGE = """
window.said = {isOpen: false, rev: -1, asked: new Set(), sentences: new Map()};
link.addEventListener("told", event => {
  const message = JSON.parse(event.data);
  if (["snapshot", "patch"].includes(message.t)) said.rev = message.rev;
  if (["ack", "answer", "reject"].includes(message.t)) said.asked.delete(message.id);
});
link.addEventListener("asked", event => {
  const {id} = JSON.parse(event.data);
  if (id !== undefined) said.asked.add(id);
});
link.addEventListener("opened", () => said.isOpen = true);
link.addEventListener("closed", () => {
  said.isOpen = false;
  said.asked.clear();
});
const {setTimeout: later, clearTimeout: never} = window;
let count = 0;
window.setTimeout = (act, ms, ...more) => {
  if (!(ms >= 1500)) return later(act, ms, ...more);
  said.sentences.set(--count, act);
  return count;
};
window.clearTimeout = one => said.sentences.delete(one) || never(one);
const clock = performance.now.bind(performance);
let ahead = 0;
performance.now = () => clock() + ahead;
said.timePasses = () => {
  ahead += 10_000;
  for (const [one, act] of said.sentences) said.sentences.delete(one), act();
};
"""
"""After `LISTENING`: notes what the page has asked and was told.

Sentences that go by themselves wait for `Story.time_passes`.
"""


class Bench:
    """A server, and one studio after the other on a loop in a thread, as a user's program would have it.

    Attributes:
      studio: the studio of this story.
      address: what a page opens.
    """

    studio: Studio

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="studio of a story", daemon=True)
        self._thread.start()
        self._held = ExitStack()
        self._port = self._held.enter_context(reserved_port())
        self._is_open = False
        self._server: Server | None = self._serve()
        self.address = self._server.address

    def _serve(self) -> Server:
        server = Server(self, port=self._port)
        server.start()
        return server

    async def enter(self, outbox: PageOutbox) -> Visit:
        """Let a page in; that of the story before may still knock."""
        if not self._is_open:
            raise Refused("state", "no story is told")
        return await StudioDoor(self._loop, self.studio).enter(outbox)

    def open(
        self,
        graph: hfg.Graph,
        folder: Path,
        file: Path | None = None,
        read_only: str = "",
        recording: Path | None = None,
    ) -> None:
        """Begin the studio of a story."""
        recorded = None if recording is None else Recorded(recording)
        allow = ("tests.studio.stories",)
        project = Project(graph, folder, file, allow=allow, read=partial(read_target, allow=allow))
        if recorded is not None and recording is not None:
            project = RecordedProject(recorded.graph_after(0), recording)
        self.studio = self.call(lambda: Studio(project, read_only=read_only, recorded=recorded))
        self._is_open = True

    def shut(self) -> None:
        """End the studio of a story."""
        if not self._is_open:
            return
        self._is_open = False

        async def end() -> None:
            await self.studio.close()
            left = asyncio.all_tasks() - {asyncio.current_task()}  # a level may just be laid out
            for task in left:
                task.cancel()
            await asyncio.gather(*left, return_exceptions=True)

        self._wait(end())
        if self._server is None:
            self.mend()

    def close(self) -> None:
        """End the server."""
        self.cut()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(patience(5))
        self._loop.close()
        self._held.close()

    def _wait(self, what: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(patience(10))

    @property
    def graph(self) -> hfg.Graph:
        return self.studio.graph

    def call(self, do: Callable[[], T]) -> T:
        """Do something on the studio's loop, where alone the graph may be read."""

        async def done() -> T:
            return do()

        result: T = self._wait(done())
        return result

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
        try:
            yield
        finally:
            goes_on.set()

    def node(self, path: str) -> Any:
        return self.call(lambda: self.graph[path])

    def set(self, path: str, name: str, value: object) -> None:
        """Set a parameter as the program of the graph would."""
        self.call(lambda: setattr(self.graph[path], name, value))

    def state(self, *states: str) -> None:
        """Wait until the run is in one of these states."""
        self.until(lambda: self.studio.steering.record.state in states, f"the run is {' or '.join(states)}")

    def is_active(self, path: str) -> bool:
        """Whether a node is active now; asked on the studio's loop."""
        run = self.studio.steering.run
        return run is not None and path in run.active()

    def rev(self) -> int:
        """Return the revision of all that pages are to show, once every level is laid out."""
        self.until(lambda: self.studio._layouts._working is None, "all levels are laid out")
        return self.call(lambda: self.studio.tables.rev)

    def cut(self) -> None:
        """The network is gone, the studio lives on."""
        assert self._server is not None
        self._wait(self._server.stop())
        self._entrance, self._server = self._server.entrance, None

    def mend(self) -> None:
        """The network is back at the same port; pages have their cookies of before."""
        server = Server(self, port=self._port)
        vars(server.entrance).update(vars(self._entrance))
        server.start()
        self._server = server


class Story(Person):
    """The page as a person uses it, and the engine behind it."""

    def __init__(self, bench: Bench, page: Page) -> None:
        self.bench = bench
        self.errors: list[str] = []
        page.on("pageerror", self._note)
        super().__init__(page, bench.address)
        self.settle()

    def _note(self, error: object) -> None:
        self.errors.append(str(error))

    def close(self) -> None:
        """Leave the page as it was, for the next story."""
        self.page.remove_listener("pageerror", self._note)
        self.page.mouse.up()
        self.page.mouse.move(0, 0)
        for key in ("Alt", "Control", "Shift"):
            self.page.keyboard.up(key)
        self.page.emulate_media(color_scheme="light")
        self.page.evaluate("localStorage.clear()")

    @property
    def graph(self) -> hfg.Graph:
        return self.bench.graph

    def settle(self) -> None:
        """Wait until the studio has answered everything that the page has asked, and the page has drawn it."""
        self.until(lambda: self.page.evaluate("said.asked.size") == 0, "the studio has answered everything")
        rev = self.bench.rev()
        self.until(lambda: self.page.evaluate("said.rev") >= rev, f"the page shows revision {rev}")

    def time_passes(self) -> None:
        """Let ten seconds be over for the page: what it shows for some seconds only goes."""
        self.page.evaluate("said.timePasses()")

    def until(self, true: Callable[[], object], what: str) -> None:
        """Wait until something holds in the page."""
        end = time.monotonic() + patience(10)
        while not true():
            assert time.monotonic() < end, f"it never held: {what}"
            self.frame()

    def frame(self) -> None:
        """Wait for the page's next frame."""
        self.page.evaluate("new Promise(requestAnimationFrame)")

    def start(self) -> None:
        """Start the run, and wait until it goes."""
        self.page.get_by_role("button", name="Start").click()
        self.bench.state("running")
        self.page.get_by_role("button", name="Pause").wait_for()

    def hold(self, path: str, to: tuple[float, float] | str) -> None:
        """Press on a port and drag to a place, or another port; the button stays down."""
        self.settle()
        mouse = self.page.mouse
        mouse.move(*self.middle(self.port(path)))
        mouse.down()
        self.page.locator("#canvas.wiring").wait_for()
        self.page.locator(".dragline .num").first.wait_for()
        place = self.middle(self.port(to)) if isinstance(to, str) else to
        mouse.move(*place, steps=3)

    def drag(self, path: str, to: tuple[float, float] | str) -> None:
        self.hold(path, to)
        self.page.mouse.up()

    def moves_on(self, path: str) -> None:
        """Wait until a node receives more than it has."""
        before = self.bench.node(path).seen
        self.bench.until(lambda: self.graph[path].seen > before, f"{path} receives more")

    def choose(self, first: str, *others: str) -> None:
        """Select several nodes."""
        self.select(first)
        self.page.keyboard.down("Control")
        self.frame()  # the canvas knows of the key
        for path in others:
            self.select(path)
        self.page.keyboard.up("Control")
        for path in (first, *others):
            self.page.locator(f'[data-node="{path}"].sel').wait_for()

    def pin(self, node: str, port: str) -> None:
        """Show in a probe what a port of a node sends."""
        self.select(node)
        self.page.locator("#side h2", has_text=node).wait_for()
        self.page.locator("#side .prt").get_by_role("button", name=port, exact=True).click()
