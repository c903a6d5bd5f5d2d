"""What whoever runs a graph does to hold it still and look (rule R3): the part of `Run` for pausing and stepping."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from hfg.engine.editing.pausing import Breakpoint, Step
from hfg.engine.runtime.places import place_of
from hfg.errors import UsageError
from hfg.token import Token

if TYPE_CHECKING:
    from hfg.engine.model.worker import Worker
    from hfg.engine.runtime.engine import Engine

__all__ = ["Steering"]


class Steering:
    """Pause, steps and breakpoints of a run."""

    _engine: Engine

    def _worker(self, node: Any) -> Worker:
        raise NotImplementedError

    @property
    def paused(self) -> bool:
        """Whether no new firing or slot call starts at the moment."""
        return self._engine.pausing.paused

    @property
    def breakpoints(self) -> list[Breakpoint]:
        """The breakpoints that are set."""
        return self._engine.pausing.breakpoints

    def pause(self) -> None:
        """Let no new firing and no new slot call start (R3).

        What is under way goes on to its end, tokens stay where they are, signals from outside are still taken in. Time
        goes on too, also virtual time.
        """
        self._engine.pausing.pause()

    def resume(self) -> None:
        """Go on after a pause, past the breakpoints that caused it. Does nothing if the run is not paused.

        Raises:
          UsageError: a step is under way.
        """
        self._engine.pausing.resume()

    async def wait_paused(self) -> str:
        """Wait until the run is paused, by `pause` or a breakpoint, and nothing is under way any more.

        Returns:
          The path of the breakpoint that was hit, or "pause".

        Raises:
          UsageError: the run has ended.
        """
        return await self._engine.pausing.wait_paused()

    async def step(self, node: Any = None) -> Step:
        """Let a paused run make one step, and wait until it is over (R3).

        Args:
          node: makes one firing or one slot call, whichever is next in its order (F9); one that cannot move does not,
            and the step says why. Without a node: a wave, in which each node makes at most one firing and one call,
            those included that become able to by it.

        Raises:
          UsageError: the run is not paused or has ended, another step is under way, or the node is a subgraph.
        """
        pausing = self._engine.pausing
        return await (pausing.wave() if node is None else pausing.step(self._single(node, "step")))

    def break_at(self, place: Any, *, when: Callable[[Token[Any]], object] | None = None) -> Breakpoint:
        """Pause the run at a place from now on; `wait_paused` tells when.

        Args:
          place: a node, before each of whose firings and calls the run pauses; an edge, port, or path of one, on which
            the run pauses as soon as a token lies there.
          when: for edges and ports: pause only if this holds for the token. If it raises, it is logged and the
            breakpoint removed.

        Raises:
          UsageError: there is no such place in the run, or `when` was given for a node or cannot be called.
        """
        engine = self._engine
        if when is not None and not callable(when):
            raise UsageError(f"when= takes a function of the token, like lambda token: token.value > 3; got {when!r}")
        place = place_of(engine, place)
        if not hasattr(place, "_place"):
            return engine.pausing.at_edges(place, when)
        if when is not None:
            raise UsageError("when= looks at a token: give an edge or a port of the node, not the node")
        return engine.pausing.at_node(self._single(place, "stop at"))

    def _single(self, node: Any, what: str) -> Worker:
        if isinstance(node, str):
            node = self._engine.graph[node]
        inside = (worker for worker in self._engine.all_workers() if worker.node is node and node is not None)
        worker = next(inside, None) or self._worker(node)
        if worker.scope is not None:
            raise UsageError(f'"{worker.path}" is a subgraph: {what} a node inside (G1)')
        return worker
