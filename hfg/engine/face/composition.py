"""A run put together: the engine, and all that depends on it, each handed what it needs (rules R3, R4, R7)."""

from __future__ import annotations

import asyncio
from typing import Any, Protocol

from hfg.engine.editing.edits import Edits
from hfg.engine.editing.pausing import Pausing
from hfg.engine.observing.consumers import Consumers
from hfg.engine.observing.measuring import Measuring
from hfg.engine.observing.report import Report, edge_reports, node_reports
from hfg.engine.observing.taps import Taps
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.run_lifecycle import RunLifecycle
from hfg.engine.runtime.settings import Settings
from hfg.errors import HfgError, RunError
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph

__all__ = ["Composition", "Others"]


class Others(Protocol):
    """The other parts of a graph that is cut for processes (rule L1); made above, where processes are known.

    Attributes:
      flat: what is left for this one.
    """

    flat: FlatGraph

    def take(self, composition: Composition) -> None:
        """Here is the engine of the main part."""

    def face(self, graph: Graph) -> Any:  # noqa: ANN401 - a `Run`, which stands on this module
        """Return the `Run` of all parts."""

    async def open(self) -> None:
        """Begin the other parts and set them up.

        Raises:
          HfgError: one of them cannot be.
        """

    def begin(self) -> None:
        """All are set up: let them go."""

    async def close(self) -> None:
        """Tear them down; nothing is left of them."""

    def failure(self) -> HfgError | None:
        """Return what their teardown has failed with."""

    def whole(self, report: Report) -> Report:
        """Put the report of the main part and theirs together."""


class Composition:
    """One engine, and who begins and ends it, looks at it, holds it still and edits it.

    Attributes:
      consumers: who listens to the trace.
      taps: who looks at ports and edges.
      outputs: values of the graph's own outputs that are not read.
    """

    def __init__(self, flat: FlatGraph, settings: Settings, others: Others | None = None) -> None:
        self.others = others
        self.engine = engine = Engine(flat, settings)
        self.consumers = Consumers(engine)
        self.run_lifecycle = RunLifecycle(engine, last=self._last)
        self.taps = Taps(engine)
        self.pausing = Pausing(engine, self.consumers)
        self.edits = Edits(engine, self.run_lifecycle)
        self._measuring: Measuring | None = None
        self.outputs: dict[str, list[Any]] = {}
        self._held = False
        self._done: asyncio.Future[None] | None = None
        if settings.trace is not None:
            self.consumers.add(settings.trace)
        if others is not None:
            others.take(self)

    async def start(self) -> None:
        """Set up all nodes, in whatever process, and let them go (A10)."""
        others, run_lifecycle = self.others, self.run_lifecycle
        if others is None:
            await run_lifecycle.start()
        elif await run_lifecycle.set_up():
            try:
                await others.open()
            except HfgError as error:
                self.engine.finish("failed", error)
            if self.engine.ended_how is None:
                others.begin()
                run_lifecycle.begin()

    async def _last(self) -> None:
        """When all else is over."""
        others = self.others
        if others is not None:
            await others.close()
            failure = others.failure()
            if failure is not None and self.engine.error is None:
                self.engine.ended_how = ("failed", failure)
        await self.consumers.end()

    @property
    def measuring(self) -> Measuring:
        """The measurements, which begin now unless they have before."""
        if self._measuring is None:
            self._measuring = Measuring(self.engine)
        return self._measuring

    # --- the end ----------------------------------------------------------------------------------------------------

    @property
    def ending(self) -> bool:
        """Whether a caller waits for the end, and so gets a failure."""
        return self._done is not None

    def stay_open(self) -> None:
        """Let the run not end by itself."""
        self._held = True
        self.engine.quiet.hold()

    def let_end(self) -> None:
        """Let the run end by itself (R5)."""
        if self._held:
            self._held = False
            self.engine.quiet.unhold()

    async def close(self) -> None:
        """Tear the run down, once; later callers wait until it is torn down.

        Raises:
          HfgError: the run has failed.
        """
        if self._done is None:
            self._done = self.engine.loop.create_future()
            try:
                await self.run_lifecycle.close()
            finally:
                self._done.set_result(None)
        elif not self._done.done():
            await asyncio.shield(self._done)
        self.raise_failure()

    def raise_failure(self) -> None:
        """Raise what the run failed with, if it did, with the report.

        Raises:
          HfgError: the run has failed.
        """
        error = self.engine.error
        if error is not None:
            if isinstance(error, RunError):
                error.report = self.report()  # type: ignore[attr-defined]
            raise error

    def report(self) -> Report:
        """See `Run.report`."""
        engine = self.engine
        nodes = node_reports(engine.core)
        report = Report(
            outcome=engine.outcome,
            duration_s=engine.elapsed(),
            firings=sum(node.firings for node in nodes.values()),
            nodes=nodes,
            edges=edge_reports(engine.core),
            outputs=dict(self.outputs),
            errors=[str(error) for error in engine.core.errors],
            lost_activity=engine.core.lost_activity,
        )
        return report if self.others is None else self.others.whole(report)
