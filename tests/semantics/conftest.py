"""Every rule holds with and without the engine's short ways."""

from __future__ import annotations

import pytest


@pytest.fixture(params=[True, False], ids=["fast", "plain"])
def fast(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)
