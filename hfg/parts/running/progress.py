"""The progress of one component of a part, in this incarnation and previous ones (rule L2).

Decides, never waits. Depends on the ends of edges in the engine and on `inheriting`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from hfg.base.token import END
from hfg.engine.model import Core
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.engine.runtime.borders import Inlet, Outlet
from hfg.parts.model.inheriting import Alignment, Arrived, Inheritance, Where


class Progress:
    """One component of a part: a connected part of its synchronous edges.

    Attributes:
      inherits: its tokens inherit the positions of incoming ones, and an incoming token is processed when all its
        consequences are; otherwise it is processed when it was taken.
      source: a source in it, which starts over in each incarnation; "" if there is none.
      coming, leaving: its edges from and to other parts, by label.
      alignment: where it resumes.
      has_begun: it has resumed from there.
      positions: positions of the next tokens, by label of the edge, if it inherits them.
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
        """Start without tokens.

        Args:
          nodes: their paths.
          coming: labels of incoming edges, with the number of initial values of each.
          leaving: labels of leaving edges.
          inherits: see above.
          returns: the part has previous incarnations.
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
        self._origin = dict.fromkeys(self.coming, 0)  # tokens that came to previous incarnations, or were skipped
        self._last: list[RunningNode] = []
        self._before: dict[Any, int] = {}  # what the ends had done when the part was edited last

    def look_for_last(self, core: Core) -> None:
        """Find the nodes that fire and send nothing on; placeholders of subgraphs never fire."""
        self._last = [
            w
            for path, w in core.by_path.items()
            if path in self._nodes and w.scope is None and not any(w.all_out_edges())
        ]

    def begin_at(self, start: int) -> None:
        """Everything before this number was processed by previous incarnations, or is lost with them."""
        self.has_begun = True
        self._origin = dict.fromkeys(self.coming, start - 1)

    def count_anew(self, core: Core, inlets: Mapping[str, Inlet], outlets: Mapping[str, Outlet]) -> None:
        """An edit has changed nodes and edges, and nothing that came in is still there."""
        self.look_for_last(core)
        self._before = {worker: worker.counts.firings for worker in self._last}
        self._before |= {outlets[label]: outlets[label].finished for label in self.leaving}
        self._origin = {label: inlets[label].taken for label in self.coming}

    def inherit(self, label: str, tokens: list[Arrived], outlets: Mapping[str, Outlet]) -> None:
        """Tokens to be sent get the positions of tokens that have arrived."""
        ended = tokens[-1][0][0] is END
        inherited = self._inheritance.arrive(label, [where for _, where in tokens], ended=ended)
        for outlet, positions in self.positions.items():
            if not outlets[outlet].is_over:
                positions.extend(inherited)

    def done(self, core: Core, inlets: Mapping[str, Inlet], outlets: Mapping[str, Outlet]) -> dict[str, int]:
        """Return how many are done, by label of the edge that comes in.

        Each token yields one everywhere. So the number of processed tokens is the number that has passed every end and
        whose firings are over. A node that has ended does not count once earlier tokens are processed: later ones are
        drained (F12).
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
                worker.counts.firings - before.get(worker, 0) - (worker.busy == "firing")
                for worker in self._last
                if worker.busy or not worker.blocked & ENDED
            ]
        return {
            label: min([inlets[label].taken, *(self._origin[label] + count for count in ends)]) for label in self.coming
        }
