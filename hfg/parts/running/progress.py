"""How far one component of a part has come, in this life and those before it (rule L2).

Decides, never waits. Stands on the ends of edges in the engine and on `inheriting`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from hfg.base.token import END
from hfg.engine.model.core import Core
from hfg.engine.model.worker import ENDED, Worker
from hfg.engine.runtime.borders import Inlet, Outlet
from hfg.parts.model.inheriting import Alignment, Arrived, Inheritance, Where

__all__ = ["Progress"]


class Progress:
    """One component of a part: a connected part of its synchronous edges.

    Attributes:
      inherits: what it sends inherits the positions of what comes in, and a token that came in is done when all that
        came of it is done; else it is done when it was taken.
      source: a source in it, which each life begins from its start; "" if there is none.
      coming, leaving: its edges from and to other parts, by label.
      alignment: where it goes on.
      has_begun: it goes on from there.
      positions: of what it will send next, by label of the edge, if it inherits them.
    """

    def __init__(
        self,
        nodes: Collection[str],
        coming: Mapping[str, int],
        leaving: Iterable[str],
        *,
        inherits: bool,
        returns: bool,
        source: str = "",
    ) -> None:
        """Nothing has come yet.

        Args:
          nodes: their paths.
          coming: the edges that come in, by label, and how many initial values each has.
          leaving: those that leave.
          inherits: see above.
          returns: the part has lived before.
          source: a source in it; "" if there is none.
        """
        self._nodes = frozenset(nodes)
        self.inherits = inherits
        self.source = source
        self.coming = tuple(coming)
        self.leaving = tuple(leaving)
        told_by = () if inherits else self.leaving  # what it sends again is known by its number
        self.alignment = Alignment(coming, told_by, start=None if returns else 1)
        self.has_begun = not returns
        self.positions: dict[str, deque[Where]] = {label: deque() for label in self.leaving} if inherits else {}
        self._inheritance = Inheritance(self.coming)
        self._origin = dict.fromkeys(self.coming, 0)  # how many tokens came to former lives, or were passed over
        self._last: list[Worker] = []
        self._before: dict[Any, int] = {}  # what the ends had done when the part was edited last

    def look_for_last(self, core: Core) -> None:
        """See who fires and sends nothing on; what stands for a subgraph never fires."""
        self._last = [
            w
            for path, w in core.by_path.items()
            if path in self._nodes and w.scope is None and not any(w.all_out_edges())
        ]

    def begin_at(self, start: int) -> None:
        """All before that number was done by former lives, or is lost with them."""
        self.has_begun = True
        self._origin = dict.fromkeys(self.coming, start - 1)

    def count_anew(self, core: Core, inlets: Mapping[str, Inlet], outlets: Mapping[str, Outlet]) -> None:
        """An edit has changed nodes and edges, and nothing that came in is still there."""
        self.look_for_last(core)
        self._before = {worker: worker.firings for worker in self._last}
        self._before |= {outlets[label]: outlets[label].finished for label in self.leaving}
        self._origin = {label: inlets[label].taken for label in self.coming}

    def inherit(self, label: str, tokens: list[Arrived], outlets: Mapping[str, Outlet]) -> None:
        """What will be sent has the positions of what has come."""
        ended = tokens[-1][0][0] is END
        inherited = self._inheritance.arrive(label, [where for _, where in tokens], ended=ended)
        for outlet, positions in self.positions.items():
            if not outlets[outlet].is_over:
                positions.extend(inherited)

    def done(self, core: Core, inlets: Mapping[str, Inlet], outlets: Mapping[str, Outlet]) -> dict[str, int]:
        """How many are done, by label of the edge that comes in.

        Each token gives one everywhere: so many are done as have passed every end, and their firings are over. Who has
        ended holds nobody up, once that is done which came before: whatever still comes is drained (F12).
        """
        before = self._before
        ends = [
            outlet.finished - before.get(outlet, 0)
            for outlet in map(outlets.__getitem__, self.leaving)
            if outlet.holds_up
        ]
        if self._last:
            core.settle_counts()
            ends += [
                worker.firings - before.get(worker, 0) - (worker.busy == "firing")
                for worker in self._last
                if worker.busy or not worker.blocked & ENDED
            ]
        return {
            label: min([inlets[label].taken, *(self._origin[label] + count for count in ends)]) for label in self.coming
        }
