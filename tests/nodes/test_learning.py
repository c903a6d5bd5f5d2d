"""The family `learning`: samples, trainers, and the classifier that asks what they have learned."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import pytest

import hfg
from hfg.nodes import learning
from hfg.nodes.learning import Sample
from hfg.testing import fire
from hfg.testing.diagrams import check

BLUE, RED = [Sample((1.0, float(one)), 1) for one in range(20)], [Sample((9.0, float(one)), 2) for one in range(20)]
TRAINERS = [learning.RandomTreesTrainer, learning.NearestTrainer, learning.SvmTrainer]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def trained(trainer: Any, *samples: Sample) -> str:
    """Teach a trainer, and give the path that it tells."""
    fire(trainer, samples=list(samples))
    ((name, path),) = fire(trainer, slot="train").events
    assert name == "trained"
    return str(path)


def drawn(**parameters: Any) -> list[Sample]:
    """The samples that the function gives."""
    graph = hfg.Graph()
    source = graph.add(learning.FunctionSamples(**parameters))
    graph.connect(source.sample, graph.output("samples", Sample))
    return list(hfg.run(graph, clock="virtual").outputs["samples"])


# --- samples ---


def test_samples_are_filtered_by_their_label_and_the_others_are_silence() -> None:
    one, two = Sample((1.0,), 1), Sample((2.0,), 2)
    check(
        learning.filter_samples(),
        samples="ab-a|",
        expected={"out": "a.-a|"},
        values={"a": one, "b": two},
    )
    assert fire(learning.filter_samples(label=2), samples=[one, two, two]).outputs["out"] == [two, two]
    assert fire(learning.filter_samples(label=3), samples=[one]).outputs["out"] == []
    with pytest.raises(TypeError, match="a sample or a list of samples, got a str"):
        fire(learning.filter_samples(), debug=False, samples="a")


def test_a_sample_is_split_into_its_numbers_and_its_label() -> None:
    outputs = fire(learning.SampleSplitter(entries=2), sample=Sample((3.0, 4.0), 7, 0.5)).outputs
    assert outputs == {"entries[0]": 3.0, "entries[1]": 4.0, "label": 7, "confidence": 0.5}
    with pytest.raises(ValueError, match="3 numbers came, but there are 2 outputs: make the node with entries=3"):
        fire(learning.SampleSplitter(entries=2), sample=Sample((1.0, 2.0, 3.0)))


def test_samples_are_made_and_labelled() -> None:
    assert fire(learning.make_sample(), values=[1, 2], label=3).outputs["out"] == Sample((1.0, 2.0), 3)
    samples = [Sample((1.0,)), Sample((2.0,))]
    assert [one.label for one in fire(learning.label_samples(label=4), samples=samples).outputs["out"]] == [4, 4]
    labelled = fire(learning.label_samples(), samples=samples, labels=[5, 6]).outputs["out"]
    assert labelled == [Sample((1.0,), 5), Sample((2.0,), 6)]
    with pytest.raises(ValueError, match="got 1 labels for 2 samples"):
        fire(learning.label_samples(), samples=samples, labels=[5])


@pytest.mark.slow
def test_the_function_gives_the_same_samples_for_a_seed_and_outliers_as_often_as_said() -> None:
    samples = drawn(count=2000, seed=3, outliers=0.3)
    assert samples == drawn(count=2000, seed=3, outliers=0.3) != drawn(count=2000, seed=4, outliers=0.3)
    for sample in samples:
        x, y = sample.values
        assert 0 <= x <= 2 * math.pi
        assert sample.label == (abs(y - math.cos(x)) < 0.1)
    assert sum(sample.label == 0 for sample in samples) / 2000 == pytest.approx(0.3, abs=0.04)
    assert {sample.label for sample in drawn(count=50, outliers=0.0)} == {1}


# --- training and classifying ---


@pytest.mark.parametrize("trainer", TRAINERS, ids=lambda one: one.__name__)
def test_what_was_learned_is_written_and_known_again(trainer: Any) -> None:
    path = trained(trainer(path="kept/model.yaml"), *BLUE, *RED)
    assert path == "kept/model.yaml"
    asked = [Sample((1.5, 4.0)), Sample((8.0, 4.0), 77)]
    fired = fire(learning.Classifier(path=path), samples=asked)
    assert [(one.values, one.label) for one in fired.outputs["classified"]] == [((1.5, 4.0), 1), ((8.0, 4.0), 2)]
    assert [max(one, key=one.__getitem__) for one in fired.outputs["weights"]] == [1, 2]
    for sample, weights in zip(fired.outputs["classified"], fired.outputs["weights"], strict=True):
        assert sum(weights.values()) == pytest.approx(1)
        assert sample.confidence == weights[sample.label]
    assert fire(learning.Classifier(path=path), samples=[]).outputs == {"classified": [], "weights": []}


def test_votes_are_parts_of_all() -> None:
    path = trained(learning.NearestTrainer(neighbors=4), *(Sample((float(one),), one % 4 == 0) for one in range(4)))
    (weights,) = fire(learning.Classifier(path=path), samples=[Sample((1.0,))]).outputs["weights"]
    assert weights == {0: 0.75, 1: 0.25}


def test_opencv_itself_reads_what_was_written() -> None:
    path = trained(learning.RandomTreesTrainer(), *BLUE, *RED)
    assert cv2.ml.RTrees.load(path).isTrained()


def test_a_classifier_is_silent_until_there_is_a_model_and_reads_it_when_told() -> None:
    classifier = learning.Classifier(path="model.yaml")
    first = fire(classifier, samples=[BLUE[0]])
    assert (first.outputs, first.events) == ({}, [("missing", "model.yaml")])
    trained(learning.RandomTreesTrainer(), *BLUE, *RED)
    again = fire(classifier, samples=[BLUE[0]])
    assert (again.outputs, again.events) == ({}, [])
    fire(classifier, slot="reload")
    assert fire(classifier, samples=[BLUE[0]]).outputs["classified"][0].label == 1


def test_a_trainer_learns_by_itself_after_so_many_samples_and_forgets_when_told() -> None:
    trainer = learning.RandomTreesTrainer(every=3, least=0)
    samples = [BLUE[0], RED[0], BLUE[1], RED[1], BLUE[2], RED[2]]
    assert [len(fire(trainer, sample=one).events) for one in samples] == [0, 0, 1, 0, 0, 1]
    fire(trainer, slot="clear")
    with pytest.raises(ValueError, match="no samples to train on"):
        fire(trainer, slot="train")


def test_classes_weigh_as_said() -> None:
    few = [Sample((float(one % 10),), 1) for one in range(10)]
    many = [Sample((float(one % 10),), 0) for one in range(40)]
    found = {}
    for priors in ([1.0, 1.0], [1.0, 20.0]):
        path = trained(learning.RandomTreesTrainer(priors=priors, trees=50, accuracy=0.0), *few, *many)
        found[priors[1]] = fire(learning.Classifier(path=path), samples=[Sample((4.0,))]).outputs["classified"][0].label
    assert found == {1.0: 0, 20.0: 1}
    with pytest.raises(ValueError, match=r"each of 2 classes has a weight above 0, got priors \[1.0\]"):
        trained(learning.RandomTreesTrainer(priors=[1.0]), *few, *many)


def test_random_trees_are_those_of_the_seed_whatever_opencv_has_done_before() -> None:
    samples = [Sample((float(one % 7), float(one % 5)), int(one % 7 > one % 5)) for one in range(35)]

    def grown(seed: int, before: int) -> str:
        cv2.setRNGSeed(before)
        return Path(trained(learning.RandomTreesTrainer(seed=seed, variables=1), *samples)).read_text()

    assert grown(3, before=1) == grown(3, before=2) != grown(4, before=1)


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        ([Sample((1.0,)), Sample((1.0, 2.0))], "samples have 1 numbers each here, got one with 2"),
        ([Sample(())], "got one with 0"),
        ([Sample((math.nan,))], "finite and smaller than 1e\\+30, got nan"),
        ([Sample((1.0,), 1 << 40)], "a label lies within 16777216"),
    ],
)
@pytest.mark.parametrize("trainer", TRAINERS, ids=lambda one: one.__name__)
def test_samples_that_cannot_be_learned_from_are_one_sentence(
    trainer: Any, samples: list[Sample], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        trained(trainer(), *samples)
    assert not Path("model.yaml").exists()


def test_support_vectors_need_two_classes() -> None:
    with pytest.raises(ValueError, match="two classes at least, and all samples are of one"):
        trained(learning.SvmTrainer(), *BLUE)


def test_a_sample_of_another_kind_than_learned_from_is_refused() -> None:
    path = trained(learning.RandomTreesTrainer(), *BLUE, *RED)
    with pytest.raises(ValueError, match="samples have 2 numbers each here, got one with 3"):
        fire(learning.Classifier(path=path), samples=[Sample((1.0, 2.0, 3.0))])


@pytest.mark.slow
@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe\x00", b"%YAML:1.0\n---\na: 1\n", b"hello", b"%YAML:1.0\n---\nopencv_ml_svm:\n"]
)
def test_a_file_that_holds_no_model_is_one_sentence(content: bytes) -> None:
    Path("model.yaml").write_bytes(content)
    with pytest.raises(ValueError, match='"model.yaml" holds no model of random trees'):
        fire(learning.Classifier(path="model.yaml"), samples=[BLUE[0]])


@pytest.mark.slow
@pytest.mark.parametrize("trainer", TRAINERS, ids=lambda one: one.__name__)
@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
def test_a_file_that_was_cut_off_is_refused(trainer: Any, part: float) -> None:
    path = Path(trained(trainer(), *BLUE, *RED))
    path.write_text(path.read_text()[: int(part * path.stat().st_size)])
    with pytest.raises(ValueError, match="holds no model"):
        fire(learning.Classifier(path=str(path)), samples=[BLUE[0]])
