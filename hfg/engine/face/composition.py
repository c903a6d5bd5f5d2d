"""A run put together: the engine, and all that stands on it, each handed what it needs (rules R3, R4, R7)."""

from __future__ import annotations

from hfg.engine.editing.edits import Edits
from hfg.engine.editing.pausing import Pausing
from hfg.engine.observing.consumers import Consumers
from hfg.engine.observing.measuring import Measuring
from hfg.engine.observing.taps import Taps
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.lifetime import Lifetime
from hfg.engine.runtime.settings import Settings
from hfg.graph.flat import FlatGraph

__all__ = ["Composition"]


class Composition:
    """One engine, and who begins and ends it, looks at it, holds it still and edits it.

    Attributes:
      consumers: who listens to the trace.
      taps: who looks at ports and edges.
    """

    def __init__(self, flat: FlatGraph, settings: Settings) -> None:
        self.engine = engine = Engine(flat, settings)
        self.consumers = Consumers(engine)
        self.lifetime = Lifetime(engine, last=self.consumers.end)
        self.taps = Taps(engine)
        self.pausing = Pausing(engine, self.consumers)
        self.edits = Edits(engine, self.lifetime)
        self._measuring: Measuring | None = None
        if settings.trace is not None:
            self.consumers.add(settings.trace)

    @property
    def measuring(self) -> Measuring:
        """What keeps statistics: from now on, if nobody has asked before."""
        if self._measuring is None:
            self._measuring = Measuring(self.engine)
        return self._measuring
