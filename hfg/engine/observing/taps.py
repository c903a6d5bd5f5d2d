"""Taps: looking at what passes a port or an edge while the graph runs.

A tap keeps the newest tokens in a buffer of its own. The graph never waits for it; what it is too slow for is skipped
and counted. Only the node in front of what is tapped leaves its shortest way. Depends on `ports` and `relays`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, Protocol, TypeAlias

from hfg.base.token import Token
from hfg.engine.fusion.specialise import specialise
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.running_node import RunningNode
from hfg.engine.model.tap import FirstLiveTap, TokenTap
from hfg.engine.rules.listening import find_listeners
from hfg.engine.runtime import ports, relays
from hfg.engine.runtime.callbacks import Edited
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.places import Ends, behind, edges_at, is_near, place_of
from hfg.errors import GraphError, UsageError
from hfg.graph.structure.edge import Edge as DrawnEdge
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port
from hfg.ports.edges import AnyEdge

__all__ = ["Looker", "Tap", "Taps", "make_tap"]

_SIZE = 100

_Where: TypeAlias = Port | InnerSource[Any] | InnerTarget[Any] | DrawnEdge | Ends


class Tap:
    """Tokens as they pass a port or an edge of a run, markers too: an async iterator that ends with the run.

    It looks from the moment it is made until `close()`, the end of a `with` block, or until it is garbage.

    Attributes:
      passed_s: when the token that was iterated over last passed, in seconds since the run began.
    """

    def __init__(self, buffer: _Buffer, max_rate_hz: float | None, detach: Callable[[], object]) -> None:
        self._buffer = buffer
        self._detach = detach
        self._pause_s = 1.0 / max_rate_hz if max_rate_hz else 0.0
        self._next_at = float("-inf")
        self._given = 0
        self.passed_s = 0.0

    @property
    def seen(self) -> int:
        """How many tokens have passed."""
        return self._buffer.seen

    @property
    def latest(self) -> Token[Any] | None:
        """The newest token that passed, iterated over or not; None before the first."""
        return self._buffer.latest

    @property
    def skipped(self) -> int:
        """How many tokens were not iterated over and never will be."""
        return self._buffer.seen - self._given - len(self._buffer.kept)

    def take(self) -> list[tuple[float, Token[Any]]]:
        """Return what is kept for the reader without waiting: each token with the seconds at which it passed."""
        kept = list(self._buffer.kept)
        self._buffer.kept.clear()
        self._given += len(kept)
        return kept

    def close(self) -> None:
        """Stop observing; the iteration ends after the tokens that are kept. The second call does nothing."""
        self._detach()
        self._buffer.end()

    def __enter__(self) -> Tap:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def __aiter__(self) -> Tap:
        return self

    async def __anext__(self) -> Token[Any]:
        buffer = self._buffer
        while not buffer.kept:
            if buffer.over.is_set():
                raise StopAsyncIteration
            buffer.more.clear()
            await buffer.more.wait()
        if self._pause_s:
            await self._pause()
        self._given += 1
        self.passed_s, token = buffer.kept.popleft()
        return token

    async def _pause(self) -> None:
        """Keep to the rate; meanwhile newer tokens take the place of older ones. At the end of the run, do not wait."""
        loop = asyncio.get_running_loop()
        left = self._next_at - loop.time()
        if left > 0:
            try:
                async with asyncio.timeout(left):
                    await self._buffer.over.wait()
            except TimeoutError:
                pass
        self._next_at = loop.time() + self._pause_s

    def __del__(self) -> None:
        self._detach()


class Looker(Protocol):
    """An observer of passing tokens."""

    @property
    def put(self) -> TokenTap:
        """Called with each token that passes."""

    def end(self) -> None:
        """No more will pass."""


class _Buffer:
    """The tokens that a tap keeps. The observed port or edge refers to it; the reader refers to the tap."""

    def __init__(self, size: int, elapsed: Callable[[], float]) -> None:
        self.size = size
        self.kept: deque[tuple[float, Token[Any]]] = deque(maxlen=size)
        self._elapsed = elapsed
        self.seen = 0
        self.latest: Token[Any] | None = None
        self.more = asyncio.Event()
        self.over = asyncio.Event()

    def put(self, token: Token[Any]) -> None:
        """A token passes."""
        self.seen += 1
        self.latest = token
        self.kept.append((self._elapsed(), token))
        self.more.set()

    def miss(self, count: int) -> None:
        """Tokens have passed that could not be kept: `count` of them."""
        self.seen += count

    def end(self) -> None:
        """No more will pass."""
        self.over.set()
        self.more.set()


def make_tap(
    size: int | None, max_rate_hz: Any, elapsed: Callable[[], float], detach: Callable[[], object]
) -> tuple[Tap, _Buffer]:
    """Make a tap, and the buffer that is to be filled for it; `detach` ends that.

    Args:
      size: tokens that are kept for the reader.
      max_rate_hz: at which tokens are given.
      elapsed: gives the seconds since the run began.
      detach: called when the tap is closed or garbage.

    Raises:
      UsageError: the size or the rate cannot be.
    """
    if size is not None and (type(size) is not int or size < 1):
        raise UsageError(f"size is how many tokens a tap keeps, 1 or more, got {size!r}")
    if max_rate_hz is not None and not (isinstance(max_rate_hz, int | float) and max_rate_hz > 0):
        raise UsageError(f"max_rate_hz is how many tokens a second a tap gives at most, got {max_rate_hz!r}")
    buffer = _Buffer(size or (_SIZE if max_rate_hz is None else 1), elapsed)
    return Tap(buffer, max_rate_hz, detach), buffer


class Taps:
    """All taps of one run."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._buffers: dict[
            Looker, tuple[Any, list[tuple[Any, TokenTap]]]
        ] = {}  # what each looks at, and where that is
        self._looks: dict[Any, list[TokenTap]] = {}  # by edge, event, or (worker, slot) for edges still to come
        engine.callbacks.finished.append(self._end)
        engine.callbacks.edited.append(self._find_again)
        engine.callbacks.joined.append(self._adopt)

    def add(self, what: Any, size: int | None, max_rate_hz: Any) -> Tap:
        """Begin to look at a port or an edge, given itself or by path.

        Raises:
          UsageError: nothing passes there, or the size or the rate cannot be.
          GraphError: there is no such path.
        """
        found: list[Callable[[], object]] = []
        tap, buffer = make_tap(size, max_rate_hz, self._engine.elapsed, lambda: [end() for end in found])
        found.append(self.look(what, buffer))
        return tap

    def look(self, what: Any, looker: Looker) -> Callable[[], None]:
        """Attach a tap to a port or an edge. Return the function that detaches it.

        Raises:
          UsageError: nothing passes there.
          GraphError: there is no such path.
        """
        what = self._outside(what) or place_of(self._engine, what)
        self._attach(looker, what, self._places(what))
        if self._engine.core.over:
            looker.end()
        return partial(self._remove, looker)

    def workers(self, looker: Looker) -> list[RunningNode]:
        """The observed ports and edges, as the graph is now."""
        found: dict[RunningNode, None] = {}
        for place, _ in self._buffers.get(looker, (None, []))[1]:
            if isinstance(place, RunningEvent):
                found[place.worker] = None
            elif not isinstance(place, tuple):
                found[place.source] = None
        return list(found)

    def _find_again(self, edited: Edited) -> None:
        """The graph was edited: what is looked at may be elsewhere, or nowhere for now (R4)."""
        for buffer, (where, _) in list(self._buffers.items()):
            if not is_near(where, edited.nodes):
                continue
            what = behind(where, edited.swapped)
            self._remove(buffer)
            try:
                places = self._places(what)
            except (GraphError, UsageError):
                places = []
            self._attach(buffer, what, places)

    def _attach(self, buffer: Looker, what: Any, places: list[tuple[Any, list[Any]]]) -> None:
        looks = [(place, FirstLiveTap.of(group, place, buffer.put) if group else buffer.put) for place, group in places]
        self._buffers[buffer] = (what, looks)
        for place, look in looks:
            self._looks.setdefault(place, []).append(look)
            self._install(place)

    def _adopt(self, edge: AnyEdge) -> None:
        """An edge into a slot was made while the graph runs: whoever looks at the slot looks at it too."""
        for look in self._looks.get((edge.target, edge.port_name), ()):
            self._looks.setdefault(edge, []).append(look)
            self._install(edge)

    def _end(self) -> None:
        """The run is over."""
        for buffer in self._buffers:
            buffer.end()

    def _remove(self, buffer: Looker) -> None:
        gone = [look for _, look in self._buffers.pop(buffer, (None, []))[1]]
        for place in list(self._looks) if gone else ():
            left = [look for look in self._looks[place] if look not in gone]
            if len(left) != len(self._looks[place]):
                self._looks[place] = left
                self._install(place)
                if not left:
                    del self._looks[place]

    def _install(self, place: Any) -> None:
        """Let the engine see who looks at an edge or event now."""
        looks = tuple(self._looks[place])
        if isinstance(place, RunningEvent):
            self._tell_event(place)
        elif not isinstance(place, tuple):
            place.tap = looks[0] if len(looks) == 1 else partial(_all_of, looks) if looks else None
            source: RunningNode = place.source
            find_listeners(source)
            if source.core.started and not self._engine.core.over:
                specialise(source)
            for event in source.events.values():
                if place in event.edges:
                    self._tell_event(event)

    def _tell_event(self, event: RunningEvent[RunningNode]) -> None:
        looks = tuple(self._looks.get(event, ()))
        event.tap = looks if looks or any(edge.tap is not None for edge in event.edges) else None
        if event.tap is not None and event.port is not None and event.port._observers is None:
            event.port._observe([])  # the fast path of `trigger` asks for no more
        core = self._engine.core
        if event.worker.slot_edges and core.started and not core.over:  # are its calls to be told apart?
            for worker in (event.worker, *(edge.source for edge in event.worker.slot_edges)):
                specialise(worker)

    # --- finding ----------------------------------------------------------------------------------------------------

    def _outside(self, path: Any) -> Any:
        """An edge by which signals come from outside the graph."""
        return next((edge for edge in self._engine.core.outside.values() if edge.label == path), None)

    def _edges(self) -> Iterator[AnyEdge]:
        return iter(self._engine.core.edges)

    def _places(self, what: object) -> list[tuple[Any, list[Any]]]:
        """Where to look: edges, events, slots; with an edge come those that carry the same tokens."""
        if any(what is edge for edge in self._edges()):
            return [(what, [])]
        where = self._of_this_run(what)
        if isinstance(where, Port) and where.kind == "event":
            events = relays.events_behind(where) if relays.is_relay(where) else [where]
            return [(event, []) for event in map(self._running, events) if event is not None]
        places = _with_same_tokens(edges_at(self._engine, where))
        if isinstance(where, Port) and where.kind == "slot" and not relays.is_relay(where):
            places += self._before_slot(where)
        if not places:
            name = where.path if isinstance(where, Port | InnerSource | InnerTarget) else _label(where)
            raise UsageError(f'"{name}" has no edge in this run, so no token passes there: connect it before the run')
        return places

    def _before_slot(self, slot: Port) -> list[tuple[Any, list[Any]]]:
        """A slot gets edges while the graph runs; there may be one already by which signals come from outside."""
        worker = self._worker(slot)
        places: list[tuple[Any, list[Any]]] = [((worker, slot.name), [])]
        edge = worker.core.outside.get((worker.index, slot.name))
        return places if edge is None else [*places, (edge, [])]

    def _of_this_run(self, what: object) -> _Where:
        """Refuse anything except a port or an edge of the running graph."""
        if isinstance(what, Node):
            kind = what._type
            names = dict.fromkeys([*kind.inputs, *kind.outputs, *kind.events, *kind.slots])
            raise UsageError(
                f'"{what.place.path}" is a node, and a tap looks at a port or an edge: name one of its ports; '
                f"{suggest('', names)}"
            )
        if not isinstance(what, Port | InnerSource | InnerTarget | DrawnEdge | Ends):
            raise UsageError(f"a tap looks at a port or an edge of this run, given itself or by path, got {what!r}")
        if isinstance(what, Port) and (
            what.graph is None or level_of(what.graph).whole is not level_of(self._engine.graph).whole
        ):
            raise UsageError(
                f'"{what.path}" is in no graph that runs here, so no token passes there: '
                f'this is a run of graph "{self._engine.graph.name}"'
            )
        return what

    def _running(self, event: Any) -> RunningEvent[RunningNode] | None:
        worker = self._worker(event)
        return worker.events.get(event.name) if worker.node is None else ports.bind_event(worker, event.name)

    def _worker(self, port: Any) -> RunningNode:
        if port.node is self._engine.graph:
            boundary = self._engine.core.boundary
            assert boundary is not None
            return boundary
        return next(worker for worker in self._engine.core.workers if worker.node is port.node)


def _with_same_tokens(edges: Iterable[AnyEdge]) -> list[tuple[Any, list[Any]]]:
    """Each edge with those that carry the same tokens: of one output; first those that carry activity too."""
    carrying: dict[Any, list[Any]] = {}
    for edge in sorted(edges, key=lambda edge: not edge.active):
        carrying.setdefault(edge.source_port, []).append(edge)
    return [(edge, group if len(group) > 1 else []) for group in carrying.values() for edge in group]


def _label(edge: DrawnEdge | Ends) -> str:
    return f"{edge.source.path} -> {edge.target.path}" if isinstance(edge, Ends) else str(edge.label)


def _all_of(looks: tuple[TokenTap, ...], token: Token[Any]) -> None:
    for look in looks:
        look(token)
