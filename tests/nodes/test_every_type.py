"""Every node type of the library keeps its word: it takes what it declares, and gives and raises nothing else.

`python -m hfg.testing.usable --seed 1` tries them with other values.
"""

from __future__ import annotations

import pytest

from hfg.catalogue import Catalogue, installed, undocumented
from hfg.catalogue.offers import Offer
from hfg.testing.usable import try_all

NEEDS_HARDWARE = {"hfg.nodes.video:Camera", "hfg.nodes.video:Screenshot", "hfg.nodes.video:VideoFile"}
"""What cannot work without a thing that a test has not."""


@pytest.fixture(scope="module")
def library() -> Catalogue:
    return installed([Offer("hfg.nodes")])


def test_every_module_of_the_library_can_be_imported(library: Catalogue) -> None:
    assert library.problems == ()


@pytest.mark.timeout(300)
def test_every_type_fires_with_what_it_declares(library: Catalogue) -> None:
    """Of OpenCV's functions every tenth; all take five minutes: python -m hfg.testing.usable hfg.nodes.cv."""
    generated = [one for one in library.types if one.module == "hfg.nodes.cv"]
    chosen = [one for one in library.types if one not in generated or generated.index(one) % 10 == 0]
    trials = try_all(one.reference for one in chosen)
    assert len(trials) == len(chosen) > len(library.types) / 2
    faults = [trial.fault for trial in trials if not trial.usable and trial.reference not in NEEDS_HARDWARE]
    assert not faults, "\n".join(faults)


def test_every_type_says_what_it_does_and_what_its_ports_and_parameters_mean(library: Catalogue) -> None:
    missing = [line for one in library.types for line in undocumented(one)]
    assert not missing, "\n".join(missing)


def test_names_are_not_taken_twice_in_a_family(library: Catalogue) -> None:
    names = [(one.category, one.name) for one in library.types]
    doubled = sorted({name for name in names if names.count(name) > 1})
    assert not doubled, "two types have the same name in snake case"
