"""Whatever lies in a file, it is read or refused with a sentence, and no process dies of it.

A few of each kind in the suite, a million by `make soak`: HFG_SOAK_DAMAGED says how many, HFG_SOAK_SEED where to begin.
What foreign code reads is tried in processes of their own. A seed that found something stays in `SEEDS`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hfg.nodes import _structured
from hfg.nodes.learning._models import model_of
from hfg.nodes.vision import CascadeDetector
from tests.attacks.fuzzing import KINDS, damaged, trial
from tests.limits import patience

pytestmark = pytest.mark.rule("L4")

ROOT = Path(__file__).resolve().parents[2]
OWN = [name for name, kind in KINDS.items() if not kind.native]
NATIVE = [name for name, kind in KINDS.items() if kind.native]
SEEDS: dict[str, tuple[int, ...]] = {
    "graph": (152,),  # a node whose `graph:` is empty
    "archive": (
        9,  # the place of a part is before the file
        *(1007984, 1015500, 1038153, 1054020, 1060441, 1061598, 1064657, 1068652),  # bz2 has errors without a number
    ),
}
FEW = 150
MANY = int(os.environ.get("HFG_SOAK_DAMAGED", "1000000")) // len(KINDS)
FIRST = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCK = 2000


@pytest.mark.slow
@pytest.mark.parametrize("kind", OWN)
def test_a_damaged_file_is_read_or_refused_with_a_sentence(kind: str, tmp_path: Path) -> None:
    wrong = {seed: trial(kind, seed, tmp_path) for seed in (*SEEDS.get(kind, ()), *range(FEW))}
    assert {seed: what for seed, what in wrong.items() if what is not None} == {}


def test_damage_is_the_same_each_time_and_there_is_some() -> None:
    for kind in OWN:
        assert len({damaged(kind, seed) for seed in range(50)}) > 30
        assert damaged(kind, 7) == damaged(kind, 7)


def in_a_process(kind: str, first: int, count: int, folder: Path) -> list[object]:
    """Try them in a process of its own; gives what is wrong, and at which seed it has died."""
    progress = folder / "progress"
    progress.touch()
    command = [sys.executable, "-m", "tests.attacks.fuzzing", kind, str(first), str(count), str(progress)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace", timeout=patience(750))
    wrong: list[object] = [json.loads(line) for line in done.stdout.splitlines()]
    if done.returncode:
        wrong.append([progress.read_text(), f"the process ended with {done.returncode}: {done.stderr[-400:]}"])
    return wrong


@pytest.mark.slow
def test_foreign_code_survives_damaged_files(tmp_path: Path) -> None:
    assert in_a_process(",".join(NATIVE), 0, 40, tmp_path) == []


@pytest.mark.parametrize("seed", [1879, 2308])  # variables that are missing; a class that is text
def test_a_model_of_trees_that_names_what_is_not_there_is_refused(seed: int) -> None:
    """OpenCV would end the process for it."""
    with pytest.raises(ValueError, match="what it names is not there"):
        _structured.model_of(damaged("model", seed))


@pytest.mark.parametrize(
    ("kind", "old", "new"),
    [
        (0, b"0 1 0 0.01", b"0 1 9 0.01"),  # the feature
        (0, b"0 1 0 0.01", b"0 1 x 0.01"),
        (0, b"-1 -2 1", b"-1 -3 1"),  # the leaf
        (0, b"-1 -2 1", b"1 -2 1"),  # in a ring
        (0, b"4 2 3 8 3.", b"14 2 9 8 3."),  # outside of the window
        (0, b"8 0 3 4 1.", b"1 0 3 4 1."),  # a tilted one, outside on the left
        (0, b">0<", b">256<"),
        (1, b"0 0 4 5", b"0 0 7 5"),
    ],
)
def test_a_cascade_that_leads_out_of_the_window_or_its_tables_is_refused(kind: int, old: bytes, new: bytes) -> None:
    good = KINDS["cascade"].samples()[kind]
    assert old in good
    _structured.cascade_of(good)
    with pytest.raises(ValueError, match="what it names is not there"):
        _structured.cascade_of(good.replace(old, new))


@pytest.mark.slow
def test_a_file_that_kills_the_process_that_tries_it_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    good = KINDS["model"].samples()[0]
    monkeypatch.setattr(_structured, "_trusted", set())
    assert model_of(good, "it").isTrained()
    deadly = tmp_path / "deadly.py"
    deadly.write_text("import os\nos.kill(os.getpid(), 9)\n")
    monkeypatch.setattr(_structured, "_trusted", set())
    monkeypatch.setattr(_structured, "__file__", str(deadly))
    with pytest.raises(ValueError, match='"it" holds no model of .*a process that read it ended with -9'):
        model_of(good, "it")


@pytest.mark.slow
def test_the_cascade_of_a_user_is_tried_first(tmp_path: Path) -> None:
    place = tmp_path / "a.xml"
    place.write_bytes(KINDS["cascade"].samples()[1])
    node: Any = CascadeDetector(cascade=str(place))
    node.setup()
    assert not node.detector.empty()


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("kind", KINDS)
def test_many_damaged_files(kind: str, tmp_path: Path) -> None:
    wrong: list[object] = []
    for first in range(FIRST, FIRST + MANY, BLOCK):
        wrong += in_a_process(kind, first, min(BLOCK, FIRST + MANY - first), tmp_path)
    assert wrong == []
