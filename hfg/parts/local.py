"""All parts of a graph on one event loop: what a cut means, without processes (rules L1, F7).

Each part has a graph of its own, as each process would, so that nothing is shared by mistake. Tokens go from part to
part at the next pass of the loop. It stands beside the run over real links as the plain statement of what that does.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

from hfg.engine.face import outside
from hfg.engine.face.composition import Composition
from hfg.engine.observing.report import Report
from hfg.engine.runtime.borders import Hearing
from hfg.engine.runtime.settings import Settings
from hfg.errors import CheckFailed, HfgError
from hfg.graph import Graph
from hfg.graph.flat import MAIN, CutEdge, Cutting, cut, flatten
from hfg.parts.agreement import Agreement, Question
from hfg.parts.part import Part
from hfg.token import Token

__all__ = ["LocalParts"]


class LocalParts:
    """A graph in parts, run to its end on one event loop.

    Attributes:
      parts: by name, the main part first.
    """

    def __init__(self, build: Callable[[], Graph], make_settings: Callable[[str], Settings]) -> None:
        """Cut the graph; nothing is set up yet.

        Args:
          build: makes the graph; called once for each part.
          make_settings: gives how a part is to be run.

        Raises:
          CheckFailed: it cannot be cut so.
        """
        self._loop = asyncio.get_running_loop()
        self.cutting = cut(flatten(build()))
        if self.cutting.findings:
            raise CheckFailed(self.cutting.findings)
        self.parts: dict[str, Part] = {}
        self._agreement = Agreement(self.cutting.parts, self._ask)
        self._ended: tuple[str, HfgError | None] | None = None
        for name in self.cutting.parts:
            again: Cutting = cut(flatten(build()))
            composition = Composition(again.parts[name], make_settings(name))
            part = self.parts[name] = Part(name, composition, again.edges_of(name), rests=self._rest)
            part.engine.callbacks.finished.append(partial(self._part_ended, part))
        for edge in self.cutting.edges:
            self._link(edge)

    def _link(self, edge: CutEdge) -> None:
        source, target = self.parts[edge.source], self.parts[edge.target]
        link = _Link(self._loop, edge, source, target)
        source.connect({edge.label: link}, {})
        target.connect({}, {edge.label: link})

    def _rest(self, rest: Any) -> None:
        self._loop.call_soon(self._agreement.rest, rest)

    def _ask(self, part: str, question: Question) -> None:
        self._loop.call_soon(lambda: self._agreement.hear(self.parts[part].answer(question)))

    def _part_ended(self, part: Part) -> None:
        """One has ended: all do, with its outcome."""
        if self._ended is None:
            self._ended = part.engine.ended_how
            for other in self.parts.values():
                if other is not part:
                    self._loop.call_soon(other.finish, part.engine.outcome, None)

    async def run(self) -> dict[str, Report]:
        """Run it to its end; gives the report of each part.

        Raises:
          HfgError: the run has failed.
        """
        main = self.parts[MAIN].composition
        for worker in main.engine.core.readers:
            outside.collect(main.engine, worker, main.outputs.setdefault(worker.port_name, []))
        try:
            went_well = [await part.composition.lifetime.set_up() for part in self.parts.values()]
            for part in self.parts.values() if all(went_well) else ():
                part.composition.lifetime.begin()
            for part in self.parts.values():
                await part.engine.ending.wait()
        finally:
            for part in self.parts.values():
                await part.composition.lifetime.close()
        for part in self.parts.values():
            part.composition.raise_failure()
        return {name: part.composition.report() for name, part in self.parts.items()}


class _Link:
    """A link that loses nothing, for its two ends are on one loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop, edge: CutEdge, source: Part, target: Part) -> None:
        self._loop = loop
        self._edge = edge
        self._source = source
        self._target = target

    def room(self) -> int:
        """See `Outgoing`."""
        return 2**31

    def send(self, tokens: list[Token[Any]]) -> None:
        """See `Outgoing`."""
        bare = [((token.value, token.activity, token.stamp), (0, 0)) for token in tokens]
        self._loop.call_soon(self._target.receive, self._edge.label, bare)

    def speaks(self, speaking: bool, total: int) -> None:
        """See `Outgoing`."""
        self._loop.call_soon(self._target.speak, self._edge.label, speaking, total)

    def hears(self, hearing: Hearing, total: int) -> None:
        """See `Incoming`."""
        self._loop.call_soon(self._source.hear, self._edge.label, hearing, total)

    def taken(self, total: int) -> None:
        """See `Incoming`."""
        if self._edge.guarantee == "exact":
            self._loop.call_soon(self._source.be_taken, self._edge.label, total)
