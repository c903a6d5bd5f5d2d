"""The history of a graph as pages see it: what each step did, and which page made it. Depends on transactions."""

from __future__ import annotations

import time
from collections import deque
from itertools import count
from typing import Final

from hfg.graph import Graph
from hfg.graph.editing import Transaction, history_of
from hfg.studio.records import HistoryRecord, StepRecord
from hfg.studio.words import in_words

__all__ = ["Attribution"]

_MOST_SHOWN: Final = 100


class Attribution:
    """The author of each edit: the number of a page, or 0 for another program."""

    def __init__(self) -> None:
        self._steps: dict[Transaction, StepRecord] = {}
        self._gestures: dict[Transaction, tuple[int, str]] = {}
        self._numbers = count(1)
        self._calls: deque[StepRecord] = deque(maxlen=_MOST_SHOWN)

    def note(self, graph: Graph, by: int, gesture: str) -> None:
        """A page has made the last edit; what belongs to the same gesture becomes one step."""
        history = history_of(graph)
        if not history.done:
            return
        before = history.done[-2] if len(history.done) > 1 else None
        if gesture and before is not None and self._gestures.get(before) == (by, gesture):
            step = self._steps.get(before)
            history.join_last(Transaction.joined)
            if step is not None:
                self._steps[history.done[-1]] = StepRecord(step.n, in_words(history.done[-1].commands), by, time.time())
        last = history.done[-1]
        self._gestures[last] = by, gesture
        if last not in self._steps:
            self._steps[last] = self._step(last, by)

    def called(self, text: str, by: int) -> None:
        """A page has carried out an action that cannot be undone."""
        self._calls.append(StepRecord(next(self._numbers), text, by, time.time()))

    def _step(self, transaction: Transaction, by: int) -> StepRecord:
        return StepRecord(next(self._numbers), in_words(transaction.commands), by, time.time())

    def record(self, graph: Graph) -> HistoryRecord:
        """Return the newest steps that can be undone and redone."""
        history = history_of(graph)
        known = {*history.done, *history.undone}
        for transaction in self._steps.keys() - known:
            self._steps.pop(transaction)
            self._gestures.pop(transaction, None)
        return HistoryRecord(self._shown(history.done), self._shown(history.undone), list(self._calls))

    def _shown(self, transactions: list[Transaction]) -> list[StepRecord]:
        for one in transactions:
            if one not in self._steps:
                self._steps[one] = self._step(one, 0)
        return [self._steps[one] for one in transactions[-_MOST_SHOWN:]]
