"""Many graphs of the shapes that are fused, by `make soak`: fused, interpreted and watched runs are one (R2, R7).

HFG_SOAK_GRAPHS and HFG_SOAK_SEED as in `test_soak.py`.
"""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from types import ModuleType

import pytest

from hfg.engine.runtime import settings

GRAPHS = int(os.environ.get("HFG_SOAK_GRAPHS", "20000"))
SEED = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCKS = 40


def _fused() -> ModuleType:
    path = Path(__file__).parents[1] / "semantics" / "test_fused.py"
    spec = importlib.util.spec_from_file_location("soak_fused", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("block", range(BLOCKS))
def test_fused_interpreted_and_watched_runs_are_one(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    suite = _fused()
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)
    calls = suite.note_calls(monkeypatch)
    first = SEED + block * (GRAPHS // BLOCKS)
    print(f"seeds {first} to {first + GRAPHS // BLOCKS - 1}")
    for seed in range(first, first + GRAPHS // BLOCKS):
        allowed = suite.BESIDE_THREADS if seed % 5 == 0 else suite.plain_shapes(seed)
        if seed % 20 == 1:
            allowed = suite.large_shapes(seed)
        suite.check(calls, seed, allowed)
    print(f"{calls.share:.0%} of {calls.may_fuse} firings and calls fused")
    assert calls.share > suite.LEAST_SHARE
