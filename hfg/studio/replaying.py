"""A recording in place of a run: its cursor is moved, played and stepped; nothing can be changed.

All pages share the cursor, as they share a run. Depends on `recorded` and `steering`.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Iterator
from typing import Any, Final, Never

import msgspec
from typing_extensions import override

from hfg.graph import Graph
from hfg.recording.reading import Loss
from hfg.studio.messages import Condition, Open, Pause, Proceed, Seek, Start, Step
from hfg.studio.recorded import Recorded, Values
from hfg.studio.records import NodeRecord, ProblemRecord
from hfg.studio.refusing import Refused
from hfg.studio.spans import around
from hfg.studio.steering import Follower, Steering
from hfg.studio.words import in_words

__all__ = ["SENTENCE", "Replay"]

SENTENCE: Final = "this is a recording; it can be looked at, not changed: open the graph's own file for that"

_TICK_S: Final = 1 / 30
_ONE_FIRING_NS: Final = 50_000
"""Tokens of one node that are not further apart are of one firing."""

_MOST_OUTPUTS: Final = 1000
_READ_S: Final = 0.05


class Replay(Steering):
    """A recording, and the time at which it is shown.

    Attributes:
      recorded: the recording.
      values: its values, decoded.
      jumps: counts how often the cursor was put elsewhere.
    """

    looking = frozenset({Start, Pause, Proceed, Step, Seek, Open})
    is_live = False

    def __init__(self, recorded: Recorded, graph: Graph, follower: Follower) -> None:
        super().__init__(graph, follower)
        self.recorded = recorded
        self.values = Values(recorded)
        self.jumps = 0
        self._at = recorded.began
        self._plays_since: float | None = None  # on the loop's clock
        self._timer: asyncio.TimerHandle | None = None
        self._reading: asyncio.Task[None] | None = None
        self._edits = 0
        self._shown: dict[tuple[str, str], Any] = {}
        self._origins: dict[str, str] | None = None
        self._told: set[str] = set()
        length = (recorded.last - recorded.began) / 1e9
        self._record = msgspec.structs.replace(
            self._record, state="paused", why="pause", number=1, steerable=False, length_s=length
        )
        self.values.types_of(graph)

    # --- the cursor ---------------------------------------------------------------------------------------------------

    @property
    def at(self) -> int:
        """The time at which the recording is shown, in nanoseconds of its clock."""
        if self._plays_since is None:
            return self._at
        passed = asyncio.get_running_loop().time() - self._plays_since
        return min(self._at + int(passed * 1e9), self.recorded.last)

    @override
    def elapsed(self) -> float:
        return (self.at - self.recorded.began) / 1e9

    @override
    def since_begin(self, time: float) -> float:
        return time - self.recorded.began / 1e9

    def seconds(self, at: int) -> float:
        """Return the seconds from the begin of the run to a time in nanoseconds."""
        return (at - self.recorded.began) / 1e9

    @override
    def seek(self, at_s: float) -> None:
        if not math.isfinite(at_s):
            raise Refused("usage", f"the cursor is at a number of seconds, got {at_s}")
        was_playing = self._plays_since is not None
        self._put(self.recorded.began + round(at_s * 1e9))
        if was_playing:
            self._play()
        self._moved()

    def _put(self, at: int) -> None:
        self._plays_since = None
        self._at = min(max(at, self.recorded.began), self.recorded.last)
        self.jumps += 1

    @override
    async def start(self, *, stay: bool) -> None:
        self.proceed()

    @override
    def proceed(self) -> None:
        if self.at >= self.recorded.last:
            self._put(self.recorded.began)
        self._play()
        self._moved()

    def _play(self) -> None:
        self._at, loop = self.at, asyncio.get_running_loop()
        self._plays_since = loop.time()
        if self._timer is None:
            self._timer = loop.call_later(_TICK_S, self._tick)

    @override
    def pause(self) -> None:
        self._at, self._plays_since = self.at, None
        self._moved()

    def _tick(self) -> None:
        """Follow the cursor while the recording is played."""
        self._timer = None
        if self._plays_since is None:
            return
        if self.at >= self.recorded.last:
            self.pause()
            return
        self._timer = asyncio.get_running_loop().call_later(_TICK_S, self._tick)
        self._follow()

    @override
    async def step(self, path: str, *, back: bool = False) -> dict[str, Any]:
        """Go to the next firing that sent something, or to the one before; of one node, or of any."""
        ports = self._ports_of(path)
        if not ports:
            raise Refused("unknown", f'nothing that "{path}" sends was recorded', path)
        self._at, self._plays_since = self.at, None
        found = await asyncio.to_thread(self._next, [self.recorded.channels[port] for port in ports], self._at, back)
        if found is None:
            which = f'of "{path}" ' if path else ""
            when = "before" if back else "after"
            self._moved()
            return {"moved": [], "why_not": f"no firing {which}was recorded {when} {self.elapsed():.2f} s"}
        self._put(found)
        self._moved()
        return {"moved": [path], "why_not": ""}

    def _ports_of(self, path: str) -> list[str]:
        """Return the recorded ports of a node and of what is in it; of an empty path all."""
        nodes = self.recorded.nodes
        if not path:
            return [port for ports in nodes.values() for port in ports]
        return [port for node, ports in nodes.items() if node == path or path in around(node) for port in ports]

    def _next(self, channels: list[int], at: int, back: bool) -> int | None:
        seeking = self.recorded.seeking
        look = seeking.before if back else seeking.after
        found = look(channels, at)
        for _ in range(_MOST_OUTPUTS):  # to the last token of the firing, or back over those of this one
            if back:
                if found is None or at - found > _ONE_FIRING_NS:
                    break
                at, found = found, look(channels, found)
            else:
                later = None if found is None else look(channels, found)
                if found is None or later is None or later - found > _ONE_FIRING_NS:
                    break
                found = later
        return found

    # --- what is seen at the cursor -----------------------------------------------------------------------------------

    def _moved(self) -> None:
        self._say(state="paused" if self._plays_since is None else "running")
        self._follow()
        self._follower.cursor_moved()

    def _follow(self) -> None:
        """Show the graph and its parameters as they are at the cursor."""
        course, at = self.recorded.course, self.at
        edits = course.edits_until(at)
        settings = course.settings(at)
        before, self._shown = self._shown, settings
        if edits != self._edits:
            text = course.edits[min(edits, len(course.edits)) - 1][1] if edits > self._edits else ""
            self._edits = edits
            self._take(self.recorded.graph_after(edits), _words_of(text))
        elif settings != before:
            keys = before.keys() | settings.keys()
            self._follower.settings_changed({key[0] for key in keys if before.get(key) != settings.get(key)})

    def _take(self, graph: Graph, text: str) -> None:
        self._origins = None
        self.values.types_of(graph)
        self._follower.graph_changed(graph, text)
        self._report()

    @override
    def shown(self, nodes: dict[str, NodeRecord]) -> dict[str, NodeRecord]:
        nodes = dict(nodes)
        for (path, name), value in (self.recorded.settings | self._shown).items():
            node = nodes.get(path)
            if node is None:
                continue
            if name:
                nodes[path] = msgspec.structs.replace(node, parameters={**node.parameters, name: value})
            else:
                nodes[path] = msgspec.structs.replace(node, enabled=bool(value))
        return nodes

    def channel_of(self, path: str) -> int:
        """Return the channel of the port from which that comes which passes a port or an edge.

        Raises:
          Refused: it was not recorded.
        """
        if self._origins is None:
            self._origins = self.recorded.origins(self.graph)
        found = self._origins.get(path)
        if found is None:
            raise Refused("unknown", f'what passes "{path}" was not recorded', path)
        return self.recorded.channels[found]

    @override
    def _say(self, **changed: Any) -> None:
        self._record = msgspec.structs.replace(self._record, at=time.time(), elapsed_s=self.elapsed(), **changed)
        self._follower.run_changed()

    # --- reading in the background ------------------------------------------------------------------------------------

    @override
    def attended(self) -> None:
        if self._reading is None:
            self._report()
            self._reading = asyncio.create_task(self._read(), name="hfg studio recording")

    async def read(self) -> None:
        """Wait until all of the recording was read once."""
        self.attended()
        if self._reading is not None:
            await self._reading

    async def _read(self) -> None:
        steps = self.recorded.course.read()
        while not self.recorded.course.is_complete:
            await asyncio.to_thread(_read_some, steps)
            self._follow()
            self._report()
            self._follower.cursor_moved()

    def _report(self) -> None:
        """Put what has failed, and what is damaged, into the list of problems."""
        recorded = self.recorded
        for at, path, what, error in recorded.course.errors[:]:
            self._tell(ProblemRecord(path, "error", what, error, "", "run", "run", self.seconds(at)))
        for loss in recorded.seeking.losses():
            at_s = None if loss.first_s is None else self.since_begin(loss.first_s)
            self._tell(ProblemRecord("", "error", _damage(loss), "", "", "recording", "recording", at_s))
        for gap in recorded.gaps:
            self._tell(ProblemRecord("", "warning", gap, "", "", "recording", "recording"))
        if recorded.course.unknown_after is not None:
            at_s = self.seconds(recorded.course.unknown_after)
            what = f"there are more changes than the studio keeps: after {at_s:.1f} s they are not shown"
            self._tell(ProblemRecord("", "warning", what, "", "", "recording", "recording", at_s))

    def _tell(self, problem: ProblemRecord) -> None:
        key = f"{problem.path}: {problem.what}: {problem.why}"
        if key not in self._told:
            self._told.add(key)
            self._follower.problem(problem)

    @override
    async def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._reading is not None:
            self._reading.cancel()
        await asyncio.to_thread(self.recorded.close)

    # --- what a recording does not do ---------------------------------------------------------------------------------

    @override
    def _need(self) -> Never:
        raise Refused("read_only", SENTENCE)

    @override
    async def _in_run(self, do: Any) -> Never:
        raise Refused("read_only", SENTENCE)

    @override
    def break_at(self, path: str, condition: Condition | None) -> Never:
        raise Refused("read_only", SENTENCE)


def _read_some(steps: Iterator[None]) -> None:
    """Read for a moment."""
    until = time.monotonic() + _READ_S
    for _ in steps:
        if time.monotonic() > until:
            return


def _damage(loss: Loss) -> str:
    """Return what is damaged, without the times of the run's clock, which mean little to people."""
    count = "" if not loss.messages else f"; {loss.messages:,} message{'s' * (loss.messages != 1)} lost"
    return f"{loss.what}{count}"


def _words_of(change: str) -> str:
    """Return what an edit did."""
    from hfg.errors import GraphError
    from hfg.graph.editing.commands import read

    try:
        return in_words(read(change)) if change.startswith("[") else change
    except GraphError:
        return "an edit"
