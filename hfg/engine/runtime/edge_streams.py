"""Operators of reactivex on edges, and observables that feed edges from outside the graph (P9, R5)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hfg.engine.runtime import rx
from hfg.engine.runtime.engine import Engine
from hfg.errors import NodeError
from hfg.ports.edges import AnyEdge, EventEdge

__all__ = ["EdgeStreams"]


class EdgeStreams:
    """Everything of reactivex that is connected to the edges of a run, until it is disposed of."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._disposables: dict[Any, Callable[[], None]] = {}  # by edge

    def pipe(self, edge: EventEdge, operators: tuple[Any, ...]) -> None:
        """Put operators on an edge."""
        self._disposables[edge] = rx.pipe_edge(edge, operators, self._engine)

    def feed(self, source: Any, edge: EventEdge, operators: tuple[Any, ...]) -> None:
        """Feed an edge from an observable, which holds the run open until it completes (R5)."""
        engine = self._engine
        engine.quiet.hold()
        is_open = True

        def over(error: BaseException | None) -> None:
            nonlocal is_open
            if not is_open:
                return
            is_open = False
            if error is not None:
                problem = NodeError(edge.target.path, f'the observable that feeds "{edge.label}"', error)
                problem.__cause__ = error
                engine.finish("failed", problem)
            engine.quiet.unhold()

        dispose = rx.feed_from_observable(source, edge, operators, engine.scheduler, engine.from_any_thread, over)

        def stop() -> None:
            dispose()
            over(None)

        self._disposables[edge] = stop

    def forget(self, edge: AnyEdge) -> None:
        """An edit has removed this edge (R4)."""
        dispose = self._disposables.pop(edge, None)
        if dispose is not None:
            dispose()

    def dispose(self) -> None:
        """The run is over."""
        for dispose in self._disposables.values():
            dispose()
