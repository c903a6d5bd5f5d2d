"""The studio: one graph, its runs, its file, and all pages that look at it. Everything happens on the graph's loop.

`requests` carries out the requests of pages. Depends on `steering`, `project`, `following`, `viewing` and `topics`.
"""

from __future__ import annotations

import asyncio
import functools
import os
import time
from collections.abc import Callable, Coroutine
from importlib.metadata import version
from typing import Any, Final

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.errors import HfgError
from hfg.studio.budget import metered
from hfg.studio.describing import automatic_ports
from hfg.studio.following import Following
from hfg.studio.messages import (
    SUBPROTOCOL,
    VERSION,
    FromPage,
    Hello,
    Join,
    Level,
    Painted,
    Reject,
    Request,
    Subscribe,
    Unsubscribe,
    Visible,
)
from hfg.studio.project import Project
from hfg.studio.recorded import Recorded
from hfg.studio.recorded_topics import RECORDED
from hfg.studio.refusing import Refused, reject
from hfg.studio.replaying import SENTENCE, Replay
from hfg.studio.requests import answer
from hfg.studio.steering import Steering
from hfg.studio.topics import TOPICS, make_topic
from hfg.studio.viewing import MOST_REQUESTS, MOST_SUBSCRIPTIONS, Outbox, Shown, Subscription, Viewer

__all__ = ["Studio"]

_LOGGER: Final = Log("hfg.studio")
_LOOK_S: Final = 1.0
_BEAT_S: Final = 1 / 60
_SHARE: Final = 0.03
"""Of the loop's time, for all streams of all pages together: if they want more, they all get fewer frames."""

_OTHER_THING: Final = 4012
"""Close code: pages load themselves again. A server that ends closes with 1012, which pages survive."""

_MOST_VIEWERS: Final = 32
_MOST_LEVELS: Final = 64


@functools.cache
def _version() -> str:
    return version("hfg")


class Studio(Following):
    """One graph that pages see and edit.

    Attributes:
      boot: differs for each studio, so that pages know whether their revisions are of this one.
      read_only: why nothing can be changed; "" if it can.
      level: the subgraph that a page shows first.
    """

    def __init__(
        self,
        project: Project,
        *,
        read_only: str = "",
        run: Run | None = None,
        target: str | bool = False,
        level: str = "",
        recorded: Recorded | None = None,
    ) -> None:
        steering = Steering(project.graph, self, target) if recorded is None else Replay(recorded, project.graph, self)
        super().__init__(project, steering)
        self._forbids = read_only
        self.level = level
        self._recognize(recorded)
        self._count = 0
        self._beating: asyncio.TimerHandle | None = None
        self._looking: asyncio.TimerHandle | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        if run is not None:
            self.steering.follow(run)

    def _recognize(self, recorded: Recorded | None) -> None:
        """Set what differs between a graph and a recording; revisions of before are those of another studio."""
        self._topics = TOPICS if recorded is None else RECORDED
        self.boot = os.urandom(8).hex()
        self.read_only = self._forbids if recorded is None else SENTENCE

    async def exchange(self, project: Project, recorded: Recorded | None) -> None:
        """Show a recording in place of the graph, or a graph in place of a recording.

        All pages are sent away, and come back by themselves.
        """
        steering, before = self.steering, self.project
        graph = project.graph
        self.start_over(project, Steering(graph, self) if recorded is None else Replay(recorded, graph, self))
        self._recognize(recorded)
        self.level = ""
        asyncio.get_running_loop().call_soon(self._send_all_away)
        before.close()
        await steering.close()

    def may_open(self) -> None:
        """Refuse to open anything if the studio was started to look at one thing only."""
        if self._forbids:
            raise Refused("read_only", self._forbids)

    def _send_all_away(self) -> None:
        for viewer in list(self.viewers.values()):
            viewer.send_away(_OTHER_THING, "another file was opened")
            self.leave(viewer)

    # --- pages ---

    def enter(self, outbox: Outbox) -> Viewer:
        """A page is there."""
        self._count += 1
        viewer = Viewer(self._count, outbox)
        if len(self.viewers) >= _MOST_VIEWERS:
            viewer.send_away(1013, f"{_MOST_VIEWERS} pages look at this studio already: close one")
            return viewer
        self.viewers[viewer.number] = viewer
        viewer.send(
            Hello(
                v=VERSION,
                boot=self.boot,
                viewer=viewer.number,
                name=self.graph.name,
                version=_version(),
                read_only=self.read_only,
                automatic=automatic_ports(),
                topics=list(self._topics),
                now=time.time(),
                level=self.level,
            )
        )
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """A page is gone."""
        if self.viewers.pop(viewer.number, None) is not None:
            viewer.leave()
            self.viewers_changed()

    def receive(self, viewer: Viewer, message: FromPage) -> None:
        """A page says something."""
        if viewer.number not in self.viewers:
            return
        if viewer.joined == isinstance(message, Join):  # a snapshot is not for free
            viewer.send_away(1008, f"{SUBPROTOCOL} begins with one join")
            return
        match message:
            case Join():
                self._join(viewer, message)
            case Subscribe():
                self._subscribe(viewer, message)
            case Unsubscribe(sub=sub):
                viewer.unsubscribe(sub)
            case Painted(sub=sub, seq=seq):
                if (subscription := viewer.subscriptions.get(sub)) is not None:
                    subscription.painted(seq)
            case Visible(on=on):
                viewer.visible = on
            case Level(path=path, open=is_open, view=view, deep=deep):
                self._level(viewer, Shown(path, view, deep), is_open)
            case Request():
                self._request(viewer, message)

    def _join(self, viewer: Viewer, message: Join) -> None:
        missing = self.tables.since(message.rev) if message.boot == self.boot else None
        viewer.levels.add(Shown())
        if not self.is_described:
            self.refresh_all()
        if missing is None:
            viewer.send(self.tables.snapshot())
        else:
            for patch in missing:
                viewer.send(patch)
        viewer.joined = True
        self.steering.attended()
        self.viewers_changed()
        self.layouts_wanted()
        if self._looking is None:
            self._looking = asyncio.get_running_loop().call_later(_LOOK_S, self._look_at_file)

    def _look_at_file(self) -> None:
        """Look now and then whether another program has written the file, while a page would show it."""
        self._looking = None
        if self.viewers:
            self._looking = asyncio.get_running_loop().call_later(_LOOK_S, self._look_at_file)
            self._begin(self._looked())

    async def _looked(self) -> None:
        await asyncio.to_thread(self.project.look)
        self.singles_changed()

    def _level(self, viewer: Viewer, level: Shown, is_open: bool) -> None:
        if is_open and len(viewer.levels) < _MOST_LEVELS:
            viewer.levels.add(level)
        else:
            viewer.levels.discard(level)
        self.layouts_wanted()

    # --- streams ---

    def _subscribe(self, viewer: Viewer, message: Subscribe) -> None:
        is_new = message.sub not in viewer.subscriptions
        if is_new and len(viewer.subscriptions) >= MOST_SUBSCRIPTIONS:
            viewer.unsubscribe(message.sub, f"a page has {MOST_SUBSCRIPTIONS} subscriptions at most")
            return
        try:
            topic = make_topic(self, message.topic, message.args, self._topics)
        except HfgError as error:
            viewer.unsubscribe(message.sub, str(error))
            return
        viewer.subscribe(Subscription(message.sub, topic, message.hz))
        if self._beating is None:
            self._beat()

    def _beat(self) -> None:
        """Send what is new. Without subscriptions there is no beat."""
        loop = asyncio.get_running_loop()
        began = time.thread_time()  # of this thread: what else the machine does takes nothing away from pages
        for viewer in list(self.viewers.values()):
            viewer.beat(loop.time())
        self._beating = None
        if any(viewer.subscriptions for viewer in self.viewers.values()):
            pause = max(_BEAT_S, (time.thread_time() - began) / _SHARE)
            self._beating = loop.call_later(pause, self._beat)

    # --- requests ---

    def _request(self, viewer: Viewer, message: Request) -> None:
        if viewer.pending >= MOST_REQUESTS:
            viewer.send(Reject(message.id, "busy", f"{MOST_REQUESTS} requests of this page wait for an answer already"))
            return
        if viewer.budget.is_over():
            viewer.send(Reject(message.id, "busy", "this page asks for more than its share of the graph's time; wait"))
            return
        viewer.pending += 1
        self._begin(self._answer(viewer, message))

    async def _answer(self, viewer: Viewer, message: Request) -> None:
        try:
            viewer.send(await metered(answer(self, viewer, message), viewer.budget))
        except HfgError as error:
            viewer.send(reject(message.id, error))
        except Exception as error:
            _LOGGER.error("the studio could not carry out %r", type(message).__name__, exc_info=error)
            viewer.send(reject(message.id, error))
        finally:
            viewer.pending -= 1

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work, name="hfg studio")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def in_background(self, make: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Start a task that runs on its own."""
        self._begin(make())

    async def close(self) -> None:
        """The studio ends: send the pages away, end its own run."""
        for viewer in list(self.viewers.values()):
            viewer.send_away(1001, "the studio has ended")
            self.leave(viewer)
        self.stop_following()
        for timer in (self._beating, self._looking):
            if timer is not None:
                timer.cancel()
        for task in list(self._tasks):
            task.cancel()
        await self.steering.close()
        self.project.close()
