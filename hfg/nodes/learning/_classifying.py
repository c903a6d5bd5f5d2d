"""Asking what was learned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from annotated_types import MinLen, Predicate

from hfg.nodes._pictures import refusal
from hfg.nodes.files.access import is_a_path, named, read_whole
from hfg.nodes.learning._models import model_of, table_of
from hfg.nodes.learning._samples import Sample
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot


class Classifier(Node):
    """Say which class samples belong to, by a model that a trainer has written.

    Fires once per list of samples. The file is read with the first of them, and again after `reload`; while there is
    none yet there is silence, so that a graph may train and ask at once.

    Attributes:
      path: of the file: random trees, nearest neighbors or support vectors, as OpenCV writes them.
      samples: whose labels are not looked at.
      classified: the same samples with the label that was found; the confidence of random trees and neighbors is the
        part of the votes.
      weights: of each sample, the part of the votes for each label that has any.
      reload: read the file again.
      missing: the path, each time that there was no file to read.

    Raises:
      ValueError: the file holds no such model, or a sample has more or fewer numbers than it has learned from, or one
        that is not finite.
      OSError: the file cannot be read; the message says why.

    CS::APEX: csapex::RandomTrees, csapex::SVM.
    """

    path = Parameter("model.yaml", Predicate(is_a_path), MinLen(1))
    samples = Input(Sequence[Sample])
    classified = Output(list[Sample])
    weights = Output(list[dict[int, float]])
    missing = Event(str)

    model: State[Any] = State(None)
    is_read = State(False)

    @slot
    def reload(self) -> None:
        """Read the file with the next samples."""
        self.is_read = False

    def process(self, samples: Sequence[Sample]) -> None:
        """Classify them."""
        if not self.is_read:
            self._read()
        if self.model is None:
            return
        votes = self._votes(samples) if samples else []
        best = [max(sorted(one), key=one.__getitem__) for one in votes]
        self.classified.send(
            [
                sample._replace(label=label, confidence=one[label])
                for sample, label, one in zip(samples, best, votes, strict=True)
            ]
        )
        self.weights.send(votes)

    def _read(self) -> None:
        path = named(self.path)
        self.is_read, self.model = True, None
        if not path.exists():
            self.missing.trigger(self.path)
            return
        self.model = model_of(read_whole(path), self.path)

    def _votes(self, samples: Sequence[Sample]) -> list[dict[int, float]]:
        table = table_of(samples, self.model.getVarCount())
        try:
            if isinstance(self.model, cv2.ml.RTrees):
                labels, *counts = self.model.getVotes(table, 0)
                return [_parts(labels, row) for row in counts]
            if isinstance(self.model, cv2.ml.KNearest):
                _, _, neighbors, _ = self.model.findNearest(table, self.model.getDefaultK())
                return [_parts(*np.unique(row.astype(int), return_counts=True)) for row in neighbors]
            return [{int(label): 1.0} for label in np.rint(np.ravel(self.model.predict(table)[1]))]
        except cv2.error as error:
            raise refusal(f"OpenCV's {type(self.model).__name__}", error) from None


def _parts(labels: Any, counts: Any) -> dict[int, float]:
    total = int(np.sum(counts))
    return {int(label): int(count) / total for label, count in zip(labels, counts, strict=True) if count}
