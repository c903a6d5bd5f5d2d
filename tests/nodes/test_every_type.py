"""Every node type of the library keeps its word: it takes what it declares, and gives and raises nothing else.

`python -m hfg.testing.usable --seed 1` tries them with other values.
"""

from __future__ import annotations

import re

import pytest

from hfg.catalogue import Catalogue, installed, undocumented
from hfg.catalogue.offers import Offer
from hfg.nodes import buses
from hfg.nodes._making import holds_reals
from hfg.registry import find
from hfg.testing import Trial
from hfg.testing.usable import try_all

NEEDS: dict[str, str] = {
    **dict.fromkeys(
        (f"hfg.nodes.buses:{name}" for name in buses.__all__), "the world outside, which virtual time has not"
    ),
    "hfg.nodes.estimation:ExtendedKalmanFilter": "a measurement of the size of its matrices",
    "hfg.nodes.estimation:KalmanFilter": "a measurement of the size of its matrices",
    "hfg.nodes.estimation:OmniTwist": "a speed for each of its wheels",
    "hfg.nodes.estimation:cluster_detections": "a cloud with clusters",
    "hfg.nodes.links:Publish": "a graph around it, which says the type",
    "hfg.nodes.links:Subscribe": "a graph around it, which says the type",
    "hfg.nodes.mapping:load_map": "a map file",
    "hfg.nodes.mapping:save_map": "a map that is not tilted",
    **dict.fromkeys(
        (f"hfg.nodes.ros:Ros{name}" for name in ("Action", "Publish", "Service", "ServiceClient", "Subscribe")),
        "a router of Zenoh",
    ),
    "hfg.nodes.scenes:scene_of_clusters": "a cloud with clusters",
    "hfg.nodes.video:Camera": "a camera",
    "hfg.nodes.video:Screenshot": "a screen",
    "hfg.nodes.vision:DetectObjects": "a file with a network",
    "hfg.nodes.vision:RunNetwork": "a file with a network",
    "hfg.nodes.vision:ssd_boxes": "a result of such a detector",
}
"""What a test machine has not; such a type may refuse every firing, but only by an error that it declares."""

PARTS = 6
"""Of the library; the processes that run the tests share them."""


@pytest.fixture(scope="module")
def library() -> Catalogue:
    return installed([Offer("hfg.nodes")])


def test_every_module_of_the_library_can_be_imported(library: Catalogue) -> None:
    assert library.problems == ()


@pytest.mark.slow
@pytest.mark.timeout(900)  # by the clock, on a machine that has much else to do; each type is held to processor time
@pytest.mark.parametrize("part", range(PARTS))
def test_every_type_fires_with_what_it_declares(library: Catalogue, part: int) -> None:
    references = [one.reference for one in library.types[part::PARTS]]
    trials = try_all(references)
    assert len(trials) == len(references) > 0
    faults = [trial.fault for trial in trials if not (trial.usable or (trial.reference in NEEDS and _refuses(trial)))]
    assert not faults, "\n".join(faults)


def _refuses(trial: Trial) -> bool:
    return "ended by errors that it declares" in trial.fault


def test_every_type_says_what_it_does_and_what_its_ports_and_parameters_mean(library: Catalogue) -> None:
    missing = [line for one in library.types for line in undocumented(one)]
    assert not missing, "\n".join(missing)


def test_names_are_not_taken_twice_in_a_family(library: Catalogue) -> None:
    names = [(one.category, one.name) for one in library.types]
    doubled = sorted({name for name in names if names.count(name) > 1})
    assert not doubled, "two types have the same name in snake case"


def test_every_real_number_has_a_unit_or_is_declared_a_plain_number(library: Catalogue) -> None:
    """`unit="1"` is a plain number, "of the value" the unit of what comes in; what else there is, people can read."""
    missing = [
        f"{one.reference}.{name}"
        for one in library.types
        for name, spec in find(one.reference)._type.parameters.items()
        if holds_reals(spec.type) and not spec.unit
    ]
    assert not missing, "\n".join(missing)
    assert (
        _units(library)
        <= {"1", "s", "1/s", "m", "px", "rad", "deg", "mm", "Hz", "m/s", "rad/s", "m/s^2", "rad/s^2"} | OF
    )


OF = {"of the value", "of the result", "of the points", "of the command", "of the pixel, squared"}


def _units(library: Catalogue) -> set[str]:
    return {one.unit for each in library.types for one in each.parameters if one.unit is not None}


RAW = re.compile(
    r"\\|@\w|\$|\^|<http|\bcv2?[.:]|::|\b(?:param|note|brief|sa) |\b[Tt]h(?:e|is) function\b|overloaded member|^Wrap |"
    r"^Same as|[Mm]odification of|bindings|\.\.\.$"
)
"""What is left of a manual that was written for another tool, or says nothing without the page around it."""


def test_the_first_line_of_every_type_is_plain_english(library: Catalogue) -> None:
    raw = [f"{one.reference}: {one.summary}" for one in library.types if RAW.search(one.summary)]
    long = [f"{one.reference}: {one.summary}" for one in library.types if len(one.summary) > 160]
    assert not raw + long, "\n".join(raw + long)


DOXYGEN = re.compile(r"\\f[\[$]|\\[a-z]+\{|@(?:param|note|sa|brief|ref|cite|code|snippet|return)\b|\bparam \w+ [A-Z]")


def test_no_text_of_the_library_has_markup_of_another_tool(library: Catalogue) -> None:
    texts = [(one, text) for one in library.types for text in (one.text, *(port.doc for _, port in one.ports()))]
    texts += [(one, each.doc) for one in library.types for each in one.parameters]
    raw = [f"{one.reference}: {text}" for one, text in texts if DOXYGEN.search(text)]
    assert not raw, "\n".join(raw)
