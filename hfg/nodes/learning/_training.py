"""Trainers: they collect samples, and learn when asked to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import cv2
import numpy as np
from annotated_types import Interval, MinLen, Predicate

from hfg.nodes._pictures import refusal
from hfg.nodes.files.access import is_a_path, named, write_whole
from hfg.nodes.learning._models import table_of, text_of
from hfg.nodes.learning._samples import Sample
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter, State, slot


class _Trainer(Node):
    """Collects samples; what it learns from them is up to those who derive from it."""

    samples = Input(Sequence[Sample], optional=True)
    sample = Input(Sample, optional=True)
    path = Parameter("model.yaml", Predicate(is_a_path), MinLen(1), save=True)
    every = Parameter(0, Interval(ge=0))
    trained = Event(str)

    kept = State(factory=list[Sample])
    learned = State(0)

    def process(self, samples: Sequence[Sample] | None, sample: Sample | None) -> None:
        """Keep them."""
        self.kept += [*(samples or ()), *([] if sample is None else [sample])]
        if self.every and len(self.kept) - self.learned >= self.every:
            self._learn()

    @slot
    def train(self) -> None:
        """Learn from all that was collected."""
        self._learn()

    @slot
    def clear(self) -> None:
        """Forget the samples; what was learned stays."""
        self.kept, self.learned = [], 0

    def _learn(self) -> None:
        if not self.kept:
            raise ValueError("no samples to train on; connect a source of samples, or train later")
        table = table_of(self.kept)
        labels = np.array([sample.label for sample in self.kept], np.int64)
        if np.abs(labels).max() > 2**24:  # OpenCV keeps them as floats
            raise ValueError(f"a label lies within {2**24}, got {labels[np.abs(labels).argmax()]}")
        self.learned = len(self.kept)
        model = self._model(len(self.kept), len(set(labels.tolist())))
        try:
            model.train(cv2.ml.TrainData.create(table, cv2.ml.ROW_SAMPLE, labels.astype(np.int32)))
        except cv2.error as error:
            raise refusal(f"OpenCV's {type(model).__name__}", error) from None
        data = text_of(model)
        write_whole(named(self.path), lambda file: file.write(data))
        self.trained.trigger(self.path)

    def _model(self, samples: int, classes: int) -> Any:
        raise NotImplementedError


class RandomTreesTrainer(_Trainer):
    """Learn a forest of random trees, of which each has a vote.

    Fires once per sample or list of samples, and keeps them; `train` learns from all of them and writes the file, which
    is replaced only as a whole. Learning takes milliseconds to seconds: put the node into a thread group.

    Attributes:
      sample: a sample with its label.
      samples: several of them.
      path: path of the file.
      every: number of further samples after which it learns by itself; 0: only when asked to.
      depth: of a tree, at most.
      least: how many samples a branch needs to be parted further.
      variables: among how many of the numbers, chosen at random, each branch takes the best; 0 for their square root.
      trees: how many there are, at most.
      accuracy: with so small a part of errors there are trees enough.
      priors: how much each class weighs, in the order of their labels; none for equal weights.
      seed: of what is chosen at random; OpenCV's generator, which its other functions in this thread use too, begins
        there each time.
      train: learn now.
      clear: forget the samples.
      trained: the path, after the file was written.

    Raises:
      ValueError: there are no samples, they have different numbers of numbers, one is not finite, or OpenCV refuses
        them; the message says why.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.

    CS::APEX: csapex::RandomTreesTrainer.
    """

    depth = Parameter(8, Interval(ge=1, le=25))
    least = Parameter(10, Interval(ge=0, le=10_000))
    variables = Parameter(0, Interval(ge=0, le=10_000))
    trees = Parameter(16, Interval(ge=1, le=1024))
    accuracy = Parameter(0.06, Interval(ge=0, le=1), unit="1")
    priors = Parameter[Sequence[float]]((), type=Sequence[float], unit="1")
    seed = Parameter(0, Interval(ge=0, le=2**31 - 1))

    def _model(self, samples: int, classes: int) -> Any:
        if self.priors and (len(self.priors) != classes or not all(0 < one < 1e6 for one in self.priors)):
            raise ValueError(f"each of {classes} classes has a weight above 0, got priors {list(self.priors)}")
        model = cv2.ml.RTrees.create()
        model.setMaxDepth(self.depth)
        model.setMinSampleCount(self.least)
        model.setActiveVarCount(min(self.variables, len(self.kept[0].values)))
        model.setTermCriteria((cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, self.trees, self.accuracy))
        if self.priors:
            model.setPriors(np.array(self.priors, np.float32))
        cv2.setRNGSeed(self.seed)  # of this thread: what OpenCV has done before must not decide what is learned
        return model


class NearestTrainer(_Trainer):
    """Learn by heart: what is asked later belongs to the class of most of its nearest neighbors.

    Fires once per sample or list of samples, and keeps them; `train` writes all of them to the file, which is replaced
    only as a whole.

    Attributes:
      sample: a sample with its label.
      samples: several of them.
      path: path of the file.
      every: number of further samples after which it writes by itself; 0: only when asked to.
      neighbors: how many of them vote.
      train: write now.
      clear: forget the samples.
      trained: the path, after the file was written.

    Raises:
      ValueError: there are no samples, they have different numbers of numbers, one is not finite, or OpenCV refuses
        them; the message says why.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
    """

    neighbors = Parameter(5, Interval(ge=1, le=1000))

    def _model(self, samples: int, classes: int) -> Any:
        model = cv2.ml.KNearest.create()
        model.setDefaultK(min(self.neighbors, samples))
        return model


class SvmTrainer(_Trainer):
    """Learn a support vector machine: the border between classes that is farthest from all samples.

    Fires once per sample or list of samples, and keeps them; `train` learns from all of them and writes the file, which
    is replaced only as a whole. Numbers of about the same size do best. Learning takes milliseconds to seconds: put the
    node into a thread group.

    Attributes:
      sample: a sample with its label.
      samples: several of them.
      path: path of the file.
      every: number of further samples after which it learns by itself; 0: only when asked to.
      kernel: the shape of the border: "linear" is straight, "rbf" goes round samples.
      c: how much a sample on the wrong side costs.
      gamma: how near the samples are that an "rbf" border goes round; larger is nearer.
      train: learn now.
      clear: forget the samples.
      trained: the path, after the file was written.

    Raises:
      ValueError: there are no samples, all of one class, they have different numbers of numbers, one is not finite, or
        OpenCV refuses them; the message says why.
      OSError: the file cannot be written; the message says why, and the old file is unchanged.

    CS::APEX: csapex::SVMTrainer.
    """

    kernel = Parameter("rbf", type=Literal["linear", "rbf"])
    c = Parameter(1.0, Interval(gt=0, le=1e6), unit="1")
    gamma = Parameter(1.0, Interval(gt=0, le=1e6), unit="1")

    def _model(self, samples: int, classes: int) -> Any:
        if classes < 2:
            raise ValueError("a support vector machine parts two classes at least, and all samples are of one")
        model = cv2.ml.SVM.create()
        model.setType(cv2.ml.SVM_C_SVC)
        model.setKernel(cv2.ml.SVM_LINEAR if self.kernel == "linear" else cv2.ml.SVM_RBF)
        model.setC(self.c)
        model.setGamma(self.gamma)
        model.setTermCriteria((cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-6))
        return model
