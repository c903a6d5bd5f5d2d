"""Learning from samples with OpenCV: trees, neighbors and support vectors, trained and asked while a graph runs.

A sample is some numbers and the class that they belong to. Trainers collect samples and write what they have learned
to a file; a classifier reads that file, whichever kind of model it holds.

    _samples        Sample; making, labelling, filtering and splitting them
    _models         models as text, and back
    _training       RandomTreesTrainer, NearestTrainer, SvmTrainer
    _classifying    Classifier
"""

from __future__ import annotations

from hfg.nodes._extras import require

require("cv2", "vision")  # before the modules that import it

# isort: split
from hfg.nodes.learning._classifying import Classifier  # noqa: E402
from hfg.nodes.learning._samples import (  # noqa: E402
    FunctionSamples,
    Sample,
    SampleSplitter,
    filter_samples,
    label_samples,
    make_sample,
)
from hfg.nodes.learning._training import NearestTrainer, RandomTreesTrainer, SvmTrainer  # noqa: E402

__all__ = [
    "Classifier",
    "FunctionSamples",
    "NearestTrainer",
    "RandomTreesTrainer",
    "Sample",
    "SampleSplitter",
    "SvmTrainer",
    "filter_samples",
    "label_samples",
    "make_sample",
]
