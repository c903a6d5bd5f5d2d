"""Values that are kept and given again. Depends on nodetype and ports."""

from __future__ import annotations

import asyncio
import weakref
from collections import deque
from typing import Any, Final

from annotated_types import Ge, Gt, Interval

from hfg.base.clock import elapsed
from hfg.errors import EndOfStream
from hfg.graph import Graph
from hfg.graph.graph import graph_of
from hfg.graph.structure.level import level_of
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot


class Latch(Node):
    """Keep the newest value and send it again and again: a source.

    From the first value on it fires as fast as its consumers allow, or at the rate of its `max_rate_hz`, which the
    check asks for; the stamp is that of the firing. It never ends by itself: send to `close` when the values do, or
    stop the run. To give the newest value in step with another stream use `SampleAndHold`.

    Attributes:
      value: what is given from now on.
      out: the newest value.
      forget: nothing is given until the next value.
      close: ends the node.

    CS::APEX: csapex::Latch.
    """

    out = Output(Any)
    kept = State(factory=list[Any])
    is_closed = State(False)

    def ready(self) -> bool:
        """Say whether there is something to give."""
        if self.is_closed:
            raise EndOfStream
        return bool(self.kept)

    def process(self) -> Any:
        """Return it."""
        return self.kept[0]

    @slot
    def value(self, value: Any) -> None:
        """Keep it."""
        self.kept = [value]

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept = []

    @slot
    def close(self) -> None:
        """End."""
        self.is_closed = True


class TriggeredLatch(Node):
    """Keep the newest value and send it on request.

    Before the first value, it sends nothing. The signal has the stamp of the one that asked.

    Attributes:
      value: the value to send from now on.
      publish: asks for it.
      published: the newest value.
      forget: nothing is told until the next value.

    CS::APEX: csapex::TriggeredLatch.
    """

    published = Event(Any)
    kept = State(factory=list[Any])

    @slot
    def value(self, value: Any) -> None:
        """Keep it."""
        self.kept = [value]

    @slot
    def publish(self) -> None:
        """Tell it."""
        if self.kept:
            self.published.trigger(self.kept[0])

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept = []


class HoldableBuffer(Node):
    """Keep the last values and pass one of them on; on hold the buffer stays as it is.

    Each value is one firing, on hold too: what arrives then is dropped, and asks for the chosen value again. While
    fewer values were kept than `index` asks for there is silence.

    Attributes:
      value: anything.
      size: how many values are kept.
      hold: whether the buffer stays as it is.
      index: which value is passed on: 0 is the newest, 1 the one before it.
      out: the chosen value.

    CS::APEX: csapex::HoldableBuffer.
    """

    value = Input(Any)
    out = Output(Any)
    size = Parameter(10, Interval(ge=1, le=10_000))
    hold = Parameter(False)
    index = Parameter(0, Ge(0))
    kept = State(factory=deque[Any])

    def process(self, value: Any) -> Any:
        """Keep it, or not; choose."""
        if not self.hold:
            self.kept.append(value)
            while len(self.kept) > self.size:
                self.kept.popleft()
        return self.kept[-1 - self.index] if self.index < len(self.kept) else None


class Cache(Node):
    """Record values, and play them back at a rate.

    The last `size` values are kept. `play` sends those from `first` to `last`, each in its turn and not before a
    waiting edge has room for it; with `loop` again and again, until `pause`. Values that arrive meanwhile are kept for
    the next time. `play` while it plays starts over.

    Attributes:
      value: is kept.
      size: how many values are kept; the oldest are forgotten.
      buffered: how many there are.
      rate_hz: how many values per second are sent.
      first: number of the first value to send, from 0, which is the oldest.
      last: the number of the last one; negative numbers count from the newest, which is -1.
      loop: whether the first follows the last.
      play: begins to tell them.
      pause: tells no more.
      forget: keeps nothing.
      played: a value that was kept.
      finished: all were sent; not signalled with `loop`, nor after `pause`.

    CS::APEX: csapex::Cache.
    """

    played = Event(Any)
    finished = Event()
    size = Parameter(100, Ge(1))
    buffered = Parameter(0, read_only=True)
    rate_hz = Parameter(10.0, Gt(0), unit="Hz")
    first = Parameter(0)
    last = Parameter(-1)
    loop = Parameter(False)
    kept = State(factory=deque[Any])
    playing = State(0)
    """The number of the playback under way; 0: none."""
    playbacks = State(0)

    @slot
    def value(self, value: Any) -> None:
        """Keep it."""
        self.kept.append(value)
        while len(self.kept) > self.size:
            self.kept.popleft()
        self.buffered = len(self.kept)

    @slot
    def play(self) -> None:
        """Begin to tell them."""
        self.playbacks += 1
        self.playing = self.playbacks
        self.start_soon(self._play(self.playing, self._chosen()))

    @slot
    def pause(self) -> None:
        """Tell no more."""
        self.playing = 0

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept.clear()
        self.buffered = 0

    def _chosen(self) -> list[Any]:
        count = len(self.kept)
        first, last = (number + count if number < 0 else number for number in (self.first, self.last))
        return list(self.kept)[max(0, first) : last + 1]

    async def _play(self, number: int, values: list[Any]) -> None:
        due, turns = elapsed(), 0
        while values and (self.loop or not turns):
            for value in values:
                await asyncio.sleep(max(0.0, due - elapsed()))
                if self.playing != number:
                    return
                await self.played.trigger_wait(value)
                due = max(due, elapsed() - 1 / self.rate_hz) + 1 / self.rate_hz  # nothing is made up in a burst
            turns += 1
        if self.playing == number:
            self.playing = 0
            self.finished.trigger()


class MemoryCell(Node):
    """Keep a value under a name for all cells of that name in the graph, inside of subgraphs too.

    Each run begins without values; what a cell of another run keeps is its own. Setting or clearing a value triggers
    the events of all cells of the name. If several nodes set a value at the same moment, the order is that of the run.
    A drawing shows edges, but not the connections between cells: use cells for values whose edges would cross
    everything else. A cell belongs on the loop, not into a thread.

    Attributes:
      name: the name.
      set: sets the value.
      clear: there is no value any more.
      publish: asks for the value.
      changed: a cell of this name was set; the value.
      cleared: a cell of this name was cleared, and had a value.
      published: was asked for; the value.
      empty: was asked for, and there is none.

    CS::APEX: state::MemoryCell.
    """

    changed = Event(Any)
    cleared = Event()
    published = Event(Any)
    empty = Event()
    name = Parameter("cell")

    def setup(self) -> None:
        """Join the others."""
        self.shared = _SHARED.setdefault(graph_of(level_of(self.place.graph).whole.root.face), _Shared())
        self.shared.join(self)

    def teardown(self) -> None:
        """Leave them."""
        self.shared.leave(self)

    @slot
    def set(self, value: Any) -> None:
        """Set it, and tell all."""
        self.shared.values[self.name] = value
        self.changed.trigger(value)
        for other in self.shared.others(self):
            other.start_soon(other._tell_changed(value))  # a signal of another node is not this one's to send

    @slot
    def clear(self) -> None:
        """Forget it, and tell all."""
        if self.name in self.shared.values:
            del self.shared.values[self.name]
            self.cleared.trigger()
            for other in self.shared.others(self):
                other.start_soon(other._tell_cleared())

    @slot
    def publish(self) -> None:
        """Tell it."""
        if self.name in self.shared.values:
            self.published.trigger(self.shared.values[self.name])
        else:
            self.empty.trigger()

    async def _tell_changed(self, value: Any) -> None:
        self.changed.trigger(value)

    async def _tell_cleared(self) -> None:
        self.cleared.trigger()


class _Shared:
    """Shared state of the cells of one run."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}
        self._cells: dict[int, weakref.ref[MemoryCell]] = {}  # weak, for a cell leads to the graph that is the key

    def join(self, cell: MemoryCell) -> None:
        self._cells[id(cell)] = weakref.ref(cell)

    def leave(self, cell: MemoryCell) -> None:
        """Forget everything with the last cell, because the run is over then."""
        self._cells.pop(id(cell), None)
        if not self._cells:
            self.values.clear()

    def others(self, cell: MemoryCell) -> list[MemoryCell]:
        cells = [one() for one in self._cells.values()]
        return [one for one in cells if one is not None and one is not cell and one.name == cell.name]


_SHARED: Final[weakref.WeakKeyDictionary[Graph, _Shared]] = weakref.WeakKeyDictionary()
"""By graph, of which there is at most one run at a time."""
