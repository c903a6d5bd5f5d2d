"""Every node type of the library keeps its word: it takes what it declares, and gives and raises nothing else.

`python -m hfg.testing.usable --seed 1` tries them with other values.
"""

from __future__ import annotations

import pytest

from hfg.catalogue import Catalogue, installed, undocumented
from hfg.catalogue.offers import Offer
from hfg.testing import Trial
from hfg.testing.usable import try_all

NEEDS: dict[str, str] = {
    "hfg.nodes.links:Publish": "a graph around it, which says the type",
    "hfg.nodes.links:Subscribe": "a graph around it, which says the type",
    "hfg.nodes.video:Camera": "a camera",
    "hfg.nodes.video:Screenshot": "a screen",
}
"""What a test machine has not; such a type may refuse every firing, but only by an error that it declares."""


@pytest.fixture(scope="module")
def library() -> Catalogue:
    return installed([Offer("hfg.nodes")])


def test_every_module_of_the_library_can_be_imported(library: Catalogue) -> None:
    assert library.problems == ()


@pytest.mark.timeout(900)  # by the clock, on a machine that has much else to do; each type is held to processor time
def test_every_type_fires_with_what_it_declares(library: Catalogue) -> None:
    trials = try_all((one.reference for one in library.types), processes=2)
    assert len(trials) == len(library.types) > 0
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
