"""Samples: some numbers and the class that they belong to."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, TypeVar

from annotated_types import Interval

from hfg.errors import EndOfStream
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Outputs, Parameter, State

T = TypeVar("T")


class Sample(NamedTuple):
    """Some numbers and the class that they belong to.

    Attributes:
      values: the numbers, in the same order and as many in all samples that belong together.
      label: the number of the class.
      confidence: how sure that is, 0 to 1.
    """

    values: tuple[float, ...]
    label: int = 0
    confidence: float = 1.0


class FunctionSamples(Node):
    """Draw samples along one wave of the cosine, with outliers: something to try a classifier with.

    A source. A sample is a place x, y with x from 0 to one turn. Its y is the cosine of x, give or take 0.05; that of
    an outlier lies 0.1 to 2.1 further up or down. The label is 1 within 0.1 of the cosine, else 0. The slot `reset`
    starts over, with the same samples.

    Attributes:
      outliers: how likely an outlier is.
      seed: another one makes other samples.
      count: number of samples before it ends; 0 means without end.
      sample: the samples.

    CS::APEX: csapex::FunctionSampleGenerator.
    """

    outliers = Parameter(0.1, Interval(ge=0, le=1), unit="1")
    seed = Parameter(0)
    count = Parameter(0, Interval(ge=0))
    sample = Output(Sample)

    chance: State[random.Random | None] = State(None)
    sent = State(0)

    def process(self) -> Sample:
        """Draw one."""
        if self.count and self.sent >= self.count:
            raise EndOfStream
        if self.chance is None:
            self.chance = random.Random(self.seed)
        draw = self.chance.random
        self.sent += 1
        x = draw() * 2 * math.pi
        off = 0.0
        if draw() < self.outliers:
            off = (0.1 + 2 * draw()) * (1 if draw() < 0.5 else -1)
        off += (draw() - 0.5) * 0.1
        return Sample((x, math.cos(x) + off), int(abs(off) < 0.1))


@node
def make_sample(values: Sequence[float], label: int = 0) -> Sample:
    """Make a sample of numbers.

    Args:
      values: the numbers.
      label: the number of their class.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::ToFeature.
    """
    return Sample(tuple(float(value) for value in values), label)


@node
def label_samples(
    samples: Sequence[Sample],
    labels: Sequence[int] | None = None,
    *,
    label: Annotated[int, Interval(ge=0, le=255)] = 0,
) -> list[Sample]:
    """Return samples other labels.

    Args:
      samples: any number of them.
      labels: one for each; without this input all have the same.
      label: the one that all have.

    Raises:
      ValueError: there are more or fewer labels than samples.

    CS::APEX: csapex::AssignFeatureClassifications.
    """
    if labels is None:
        labels = [label] * len(samples)
    if len(labels) != len(samples):
        raise ValueError(f"each sample has a label, got {len(labels)} labels for {len(samples)} samples")
    return [sample._replace(label=one) for sample, one in zip(samples, labels, strict=True)]


@node
def filter_samples(samples: T, *, label: int = 1) -> T | None:
    """Pass on what has a certain label.

    A sample of another label is silence; of a list, those that have it are a list again, which may be empty.

    Args:
      samples: a sample, or a list of them.
      label: what is passed on.

    Raises:
      TypeError: it is neither.

    CS::APEX: csapex::FeaturesMessageFilter.
    """
    if isinstance(samples, Sample):
        return samples if samples.label == label else None
    if isinstance(samples, list) and all(isinstance(one, Sample) for one in samples):
        return [one for one in samples if one.label == label]  # type: ignore[return-value]
    raise TypeError(f"this takes a sample or a list of samples, got a {type(samples).__name__}")


class SampleSplitter(Node):
    """Send the numbers of a sample and its label at an output each.

    Attributes:
      sample: with as many numbers as there are outputs.
      entries: the numbers, in order.
      label: the number of the class.
      confidence: how sure that is, 0 to 1.

    Raises:
      ValueError: the sample has more or fewer numbers than there are outputs.

    CS::APEX: csapex::SampleSplitter.
    """

    sample = Input(Sample)
    entries = Outputs(float, 2)
    label = Output(int)
    confidence = Output(float)

    def process(self, sample: Sample) -> None:
        """Take it apart."""
        if len(sample.values) != len(self.entries):
            raise ValueError(
                f"a sample with {len(sample.values)} numbers came, but there are {len(self.entries)} outputs: make the "
                f"node with entries={len(sample.values)}"
            )
        outputs: Any = self.entries
        for output, value in zip(outputs, sample.values, strict=True):
            output.send(value)
        self.label.send(sample.label)
        self.confidence.send(sample.confidence)
