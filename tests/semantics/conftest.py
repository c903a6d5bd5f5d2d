"""Every rule holds with and without the engine's short ways, and after every step the engine's state is in order."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hfg.engine.runtime import settings as run_settings
from tests.semantics.readings import Perform, by_engine, by_oracle, under_every_schedule


@pytest.fixture(params=[True, False], ids=["fast", "plain"])
def fast(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture(params=[by_engine, by_oracle], ids=["engine", "oracle"])
def perform(request: pytest.FixtureRequest) -> Perform:
    """Give what is read off a run; it must be the same under many schedules."""
    return under_every_schedule(request.param)


@pytest.fixture(autouse=True, scope="session")
def _invariants_after_every_step() -> Iterator[None]:
    before, run_settings.CHECK_ALL = run_settings.CHECK_ALL, True
    yield
    run_settings.CHECK_ALL = before
