"""Engine and oracle under the same stimuli from outside, step by step."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from hfg.testing.machines import EngineAgainstOracle


@pytest.mark.rule("P10", "F10", "A4", "A7", "A9", "A14", "P8")
def test_what_comes_from_outside_has_the_same_effect() -> None:
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        EngineAgainstOracle,
        settings=settings(
            max_examples=60, stateful_step_count=12, deadline=None, suppress_health_check=list(HealthCheck)
        ),
    )
