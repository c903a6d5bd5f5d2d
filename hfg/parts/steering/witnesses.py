"""The other parts of a run, as monitors in its main part see them. Depends on `asking`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from hfg.graph.flat import MAIN
from hfg.monitors.gathering import Gathered, Known
from hfg.nodetypes.node import Node
from hfg.parts.model.messages import Seen, Untrue
from hfg.parts.steering.asking import Asking

Find = Callable[[Any], tuple[str, Any, set[str]]]


class Witnesses:
    """Lets other parts hear what monitors name there; see `hfg.monitors.gathering.Afar`."""

    main = MAIN

    def __init__(self, asking: Asking, find: Find) -> None:
        """Ask nothing yet.

        Args:
          asking: asks the other parts.
          find: returns the path, the node or port, and the parts of a path.
        """
        asking.expect({"known": Known})
        self._asking = asking
        self._find = find

    def parts_of(self, path: str) -> set[str]:
        """See `Afar`."""
        _, found, parts = self._find(path)
        return (self._asking.homes.below(path) or parts) if isinstance(found, Node) else parts

    def look(self, part: str, atoms: Mapping[int, str], watch: Gathered) -> _Witness:
        """See `Afar`."""
        return _Witness(self._asking, part, atoms, watch)


class _Witness:
    """One monitor, as far as another part hears for it."""

    def __init__(self, asking: Asking, part: str, atoms: Mapping[int, str], watch: Gathered) -> None:
        self._asking = asking
        self._part = part
        self._atoms = atoms
        self._watch = watch
        self._last = float("-inf")
        self._subscription = asking.subscribe(
            [part], "witness", self._seen, lambda: watch.over(part), self._gone, atoms=dict(atoms)
        )

    def known(self) -> asyncio.Future[Known]:
        """See `Far`."""
        return self._asking.ask(self._part, "known", number=self._subscription.number)

    def end(self) -> None:
        """See `Far`."""
        self._asking.end(self._subscription)

    def _seen(self, part: str, told: Seen) -> None:
        for point in told.points:
            if not self._last <= point.time < float("inf") or not self._atoms.keys() >= set(point.true):
                raise Untrue("that something was true which it was not asked about, or at a time that cannot be")
            self._last = point.time
            self._watch.take(part, point)

    def _gone(self, part: str, why: str) -> None:
        self._last = float("-inf")  # another machine may have another clock
        self._watch.gone(part, why)
