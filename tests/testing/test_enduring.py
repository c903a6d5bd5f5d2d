"""Hostile values, and the driver that finds the calls which end a process."""

from __future__ import annotations

import collections
import os
import signal
import tempfile
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from annotated_types import Ge, Interval, Len

import hfg
from hfg.catalogue import types_of
from hfg.images import Color, Gray
from hfg.testing.enduring import Endured, endure
from hfg.testing.hostile import Hostile
from hfg.types import accepts

pytestmark = pytest.mark.slow

HERE = "tests.testing.test_enduring"
NATIVE = ("cv", "vision", "video", "learning", "csapex")
"""Families whose nodes call native code of others."""


# --- nodes that die ---


@hfg.node
def dies_of_nan(values: npt.NDArray[np.float64]) -> float:
    if np.isnan(values).any():
        os.kill(os.getpid(), signal.SIGSEGV)
    return float(values.sum())


@hfg.node
def lives(values: npt.NDArray[np.float64], *, word: Literal["a", "b"] = "a") -> float:
    if not values.size:
        raise ValueError("nothing")
    return 1.0


@hfg.node
def reads_beyond(image: Gray) -> int:
    """Reads the byte behind a picture, which most often is there."""
    import ctypes

    last = image.ctypes.data + image.nbytes
    return ctypes.c_ubyte.from_address(last).value if image.flags.c_contiguous and image.size else 0


@hfg.node
def hangs(number: float) -> float:
    while number != number:
        pass
    return number


def test_a_call_that_ends_the_process_is_named_with_its_arguments_and_the_others_go_on() -> None:
    found = endure([f"{HERE}:dies_of_nan", f"{HERE}:lives"], calls=200, most_deaths=2)
    assert [one.reference for one in found] == [f"{HERE}:dies_of_nan", f"{HERE}:lives"]
    died, lived = found
    assert len(died.deaths) == 2
    assert died.deaths[0].how == "ended its process by SIGSEGV"
    assert "fire(dies_of_nan(), values=<an array of float64" in died.deaths[0].what
    assert " NaN" in died.deaths[0].what
    assert (lived.calls, lived.deaths) == (200, ())
    assert 0 < lived.refused < 200
    again = endure([f"{HERE}:dies_of_nan"], calls=200, most_deaths=2)[0]
    assert again.deaths == died.deaths  # the same seed, the same calls


def test_a_process_that_dies_leaves_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    assert endure([f"{HERE}:dies_of_nan"], calls=200, most_deaths=1)[0].deaths
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif("sys.platform != 'linux'", reason="pages are guarded by mprotect")
def test_who_reads_beyond_an_array_dies_at_once() -> None:
    assert endure([f"{HERE}:reads_beyond"], calls=100, most_deaths=1)[0].deaths


def test_a_call_that_does_not_return_is_named() -> None:
    told: list[Endured] = []
    found = endure([f"{HERE}:hangs"], calls=400, most_deaths=1, limit_s=0.5, tell=told.append)
    assert [one.how for one in found[0].deaths] == ["did not return within 2 s"]
    assert "number=nan" in found[0].deaths[0].what
    assert told == found


def test_a_slow_type_is_called_less_often_and_says_so() -> None:
    found = endure([f"{HERE}:lives"], calls=10**9, within_s=0.2)[0]
    assert 0 < found.calls < 10**9


# --- values ---


def test_the_same_seed_gives_the_same_values() -> None:
    first, second = (
        [Hostile(f"{seed}", guards=False).value(list[Annotated[float, Ge(0)]]) for seed in range(50)] for _ in range(2)
    )
    assert repr(first) == repr(second)


@pytest.mark.parametrize("hint", [Gray, Color, npt.NDArray[np.float32], int, str, tuple[int, float], bool | None])
def test_values_are_of_their_type_but_for_a_few(hint: Any) -> None:
    count = sum(accepts(Hostile(f"{seed}").value(hint), hint) for seed in range(300))
    assert 280 <= count <= 300


def test_parameters_are_within_their_limits() -> None:
    @hfg.node
    def limited(
        *,
        share: Annotated[float, Interval(ge=0, le=1)] = 0.5,
        name: Annotated[str, Len(1, 3)] = "a",
        mode: Literal["a", "b"] = "a",
    ) -> float:
        return share

    for seed in range(200):
        for spec in limited._type.parameters.values():
            assert spec.check(Hostile(f"{seed}").parameter(spec)) is None


def test_everything_hostile_comes() -> None:
    seen: collections.Counter[str] = collections.Counter()
    for seed in range(3000):
        draw = Hostile(f"{seed}")
        array = draw.value(npt.NDArray[np.float32])
        if not isinstance(array, np.ndarray) or array.dtype != np.float32:
            continue
        seen["empty"] += array.size == 0
        seen["NaN"] += bool(np.isnan(array).any())
        seen["infinite"] += bool(np.isinf(array).any())
        seen["denormal"] += bool(((array != 0) & (np.abs(array) < np.finfo(np.float32).tiny)).any())
        seen["negative strides"] += any(stride < 0 for stride in array.strides)
        seen["not contiguous"] += not array.flags.c_contiguous
        seen["read-only"] += not array.flags.writeable
        seen["odd address"] += array.ctypes.data % 4 != 0
        seen["long"] += max(array.shape, default=0) >= 40_000
        text = draw.value(str)
        seen["surrogate"] += isinstance(text, str) and "\ud800" in text
        number = draw.value(int)
        seen["beyond 63 bits"] += isinstance(number, int) and abs(number) >= 2**63
    assert not [name for name, count in seen.items() if count < 2], seen


# --- the library ---


def native() -> list[str]:
    return [one.reference for family in NATIVE for one in types_of(f"hfg.nodes.{family}").types]


@pytest.mark.timeout(900)  # by the clock, on a machine that has much else to do
def test_the_library_endures_hostile_values() -> None:
    """A few calls of each type that calls native code; the soak makes 10,000 of each."""
    pytest.importorskip("cv2")
    found = endure(native(), calls=8, processes=2)
    assert len(found) > 250
    assert not [f"{one.reference}: {death}" for one in found for death in one.deaths]


@pytest.mark.soak
@pytest.mark.timeout(6 * 3600)
def test_the_library_endures_ten_thousand_hostile_calls_of_each_type(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    seed = int.from_bytes(os.urandom(4))
    found = endure(native(), calls=10_000, seed=seed, processes=2)
    assert not [f"seed {seed}, {one.reference}: {death}" for one in found for death in one.deaths]
