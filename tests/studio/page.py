"""A page without a browser: what the studio sends, and a replica of its tables. Runs on the studio's own loop."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine, Iterable
from itertools import count
from pathlib import Path
from typing import Any

import msgspec

import hfg
from hfg.studio.describing import describe_graph
from hfg.studio.messages import HEADER, read
from hfg.studio.project import Project
from hfg.studio.studio import Studio
from hfg.studio.viewing import Frame, Viewer

__all__ = ["Page", "live", "studio_of", "tables_of"]


def live(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Run a test on a loop."""
    asyncio.run(main())


def tables_of(graph: hfg.Graph) -> Any:
    """Return what pages should know of a graph."""
    return json.loads(msgspec.json.encode(describe_graph(graph)))


class Page:
    """One page, which paints every frame at once.

    Attributes:
      tables: its replica.
      frames: decoded frames of streams, in order.
      closed: code and reason, once the studio has sent the page away.
    """

    def __init__(self, studio: Studio, *, levels: Iterable[str] = ()) -> None:
        self.studio = studio
        self.tables: dict[str, dict[str, Any]] = {}
        self.frames: list[dict[str, Any]] = []
        self.binary: list[tuple[int, int, bytes]] = []  # subscription, number, data
        self.patches: list[dict[str, Any]] = []
        self.hello: dict[str, Any] = {}
        self.rev = -1
        self.boot = ""
        self.snapshots = 0
        self.closed: tuple[int, str] | None = None
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._ids = count(1)
        self._changed = asyncio.Event()
        self.viewer: Viewer = studio.enter(self)
        self._levels = list(levels)

    # --- an outbox ---

    def put(self, frame: Frame) -> None:
        data = frame.data() if callable(frame.data) else frame.data
        if frame.is_binary:
            _, _, sub, seq, _ = HEADER.unpack_from(data)
            self.binary.append((sub, seq, data[HEADER.size :]))
            self._paint(sub, seq)
        else:
            self._take(json.loads(data))
        self._changed.set()

    def close(self, code: int, reason: str) -> None:
        self.closed = code, reason
        self._changed.set()

    def _take(self, message: dict[str, Any]) -> None:
        match message["t"]:
            case "hello":
                self.hello = message
            case "snapshot":
                self.tables, self.rev = message["tables"], message["rev"]
                self.snapshots += 1
            case "patch":
                assert message["rev"] == self.rev + 1, f"revision {message['rev']} after {self.rev}"
                self.rev = message["rev"]
                self.patches.append(message)
                for table, key, record in message["ops"]:
                    if record is None:
                        self.tables[table].pop(key, None)
                    else:
                        self.tables[table][key] = record
            case "ack" | "reject" | "answer":
                self._answers.pop(message["id"]).set_result(message)
            case _:
                self.frames.append(message)
                if message["t"] == "data":
                    self._paint(message["sub"], message["seq"])

    def _paint(self, sub: int, seq: int) -> None:
        if (subscription := self.viewer.subscriptions.get(sub)) is not None:
            subscription.painted(seq)

    # --- what it does ---

    def say(self, **message: Any) -> None:
        """Say something that is not answered."""
        self.studio.receive(self.viewer, read(json.dumps(message)))

    def join(self) -> Page:
        """Ask for the tables, or for what is missing of them."""
        self.say(t="join", boot=self.boot, rev=self.rev)
        self.boot = self.hello["boot"]
        self.say(t="level", path="", open=False)  # drawing takes its time, and most tests do not look
        for level in self._levels:
            self.say(t="level", path=level)
        return self

    async def ask(self, t: str, **fields: Any) -> dict[str, Any]:
        """Ask for something, and return what is answered."""
        number = next(self._ids)
        self._answers[number] = asyncio.get_running_loop().create_future()
        answer = self._answers[number]
        self.say(t=t, id=number, **fields)
        return await answer

    async def edit(self, *commands: dict[str, Any], gesture: str = "") -> dict[str, Any]:
        return await self.ask("edit", commands=list(commands), gesture=gesture)

    async def value(self, what: str, **args: Any) -> Any:
        """Ask a question, and return the value of the answer."""
        answer = await self.ask("ask", what=what, args=args)
        assert answer["t"] == "answer", answer
        return answer["value"]

    def cut(self) -> None:
        """The connection is gone; the replica stays."""
        self.studio.leave(self.viewer)

    def come_back(self, studio: Studio | None = None) -> None:
        """Connect again, maybe to a studio that was started again."""
        self.studio = studio or self.studio
        self.viewer = self.studio.enter(self)
        self.join()

    async def until(self, true: Callable[[], bool]) -> None:
        """Wait until something holds after a message."""
        while not true():
            self._changed.clear()
            await self._changed.wait()

    @property
    def run(self) -> Any:
        return self.tables["studio"]["run"]

    async def state(self, *states: str) -> None:
        await self.until(lambda: self.run["state"] in states)

    def agrees(self) -> bool:
        """Whether its replica is what the graph is."""
        known = {
            name: self.tables[name] for name in ("nodes", "edges", "gates", "groups", "ports", "types", "annotations")
        }
        return bool(known == tables_of(self.studio.graph))


def studio_of(graph: hfg.Graph, folder: Path | None = None, file: Path | None = None, **options: Any) -> Studio:
    """Make a studio of a graph, by default without a file."""
    return Studio(Project(graph, folder or Path("/nonexistent"), file), **options)
