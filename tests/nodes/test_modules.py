"""Node types of the functions of any module."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import scipy.ndimage

import hfg
from hfg import registry
from hfg.catalogue import describe_type, undocumented
from hfg.nodes import from_module
from hfg.testing import fire

filters = from_module(scipy.ndimage)


def test_arrays_are_inputs_and_the_rest_are_parameters() -> None:
    kind = filters.gaussian_filter._type
    assert list(kind.inputs) == ["input"]
    assert list(kind.parameters) == ["sigma", "order", "mode", "cval", "truncate", "radius", "axes"]
    assert kind.parameters["mode"].default == "reflect"


def test_it_does_what_the_function_does() -> None:
    image = np.eye(7)
    out = fire(filters.gaussian_filter(sigma=1.5, mode="wrap"), input=image).outputs["out"]
    assert np.array_equal(out, scipy.ndimage.gaussian_filter(image, 1.5, mode="wrap"))


def test_several_results_have_names() -> None:
    outputs = fire(filters.label(), input=np.eye(3)).outputs
    assert list(outputs) == ["label", "num_features"]
    assert outputs["num_features"] == 3


def test_an_array_with_none_as_its_default_may_be_left_out() -> None:
    image = np.pad(np.ones((3, 3)), 1)
    assert filters.binary_erosion._type.inputs["structure"].optional
    out = fire(filters.binary_erosion(), input=image).outputs["out"]
    whole = fire(filters.binary_erosion(), input=image, structure=np.ones((3, 3))).outputs["out"]
    assert out.sum() == whole.sum() == 1


def test_what_cannot_be_a_node_says_why() -> None:
    assert filters.not_nodes["generic_filter"] == 'its argument "function" is a function'
    assert "generic_filter" not in filters
    with pytest.raises(AttributeError, match='"generic_filter" of scipy.ndimage is not a node type: its argument'):
        _ = filters.generic_filter
    with pytest.raises(AttributeError, match='"gausian" of scipy.ndimage is not a node type; there are'):
        _ = filters.gausian


@pytest.mark.slow
def test_every_function_of_a_module_becomes_a_type_that_is_described() -> None:
    assert len(filters) > 60
    for kind in filters:
        assert undocumented(describe_type(kind)) == []


def test_functions_of_numpy_s_own_kind_are_types_too() -> None:
    numbers = from_module(np, only=["hypot", "sin", "clip"])
    assert fire(numbers.hypot(), x1=3.0, x2=4.0).outputs["out"] == 5.0
    assert repr(numbers) == "<3 node types of numpy>"


def test_functions_written_in_c_are_called_by_position() -> None:
    maths = from_module(math, only=["sin", "gcd"])
    assert fire(maths.sin(), x=0.0).outputs["out"] == 0.0
    assert maths.not_nodes["gcd"] == 'it takes any number of values, "*integers"'


def test_annotations_are_types() -> None:
    module = ModuleType("shapes")

    def area(width: float, height: float, scale: float = 2.0) -> float:
        """Give the area."""
        return width * height * scale

    area.__module__ = "shapes"
    module.area = area  # type: ignore[attr-defined]
    shapes = from_module(module)
    kind = shapes.area._type
    assert (kind.inputs["width"].type, kind.outputs["out"].type) == (float, float)
    assert fire(shapes.area(scale=3.0), width=1.0, height=2.0).outputs["out"] == 6.0


@pytest.mark.slow
def test_a_type_is_found_by_the_name_that_its_module_gave(tmp_path: Path) -> None:
    (tmp_path / "my_filters.py").write_text(
        "import scipy.ndimage\nfrom hfg.nodes import from_module\nfilters = from_module(scipy.ndimage)\n"
    )
    program = (
        "from hfg import registry\n"
        "kind = registry.find('my_filters:filters.gaussian_filter')\n"
        "print(registry.reference_of(kind), registry.find(registry.reference_of(kind)) is kind)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.split() == ["my_filters:filters.gaussian_filter", "True"]
    assert registry.reference_of(filters.sobel) == f"{__name__}:filters.sobel"


def test_without_a_name_in_a_module_there_is_no_reference() -> None:
    assert registry.reference_of(from_module(scipy.ndimage).sobel) is None


@pytest.mark.parametrize(
    ("module", "only", "sentence"),
    [
        ("scipy.ndimage", None, "from_module takes a module, got 'scipy.ndimage': import it and give it"),
        (math, ["sine"], 'module math has no "sine": correct only='),
    ],
)
def test_what_is_no_module_or_not_in_it_is_refused(module: Any, only: Any, sentence: str) -> None:
    with pytest.raises(hfg.errors.DeclarationError) as error:
        from_module(module, only=only)
    assert str(error.value) == sentence
