"""What any transport does, between programs of one user on one computer."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from hfg.links.local import LocalTransport
from hfg.testing.transports import TransportTests

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the sockets are Linux's")


class TestLocal(TransportTests):
    @pytest.fixture(autouse=True)
    def _in_a_place_of_its_own(self, tmp_path: Path) -> None:
        self.folder = tmp_path / "place"

    @asynccontextmanager
    async def sessions(self, count: int) -> AsyncIterator[list[Any]]:
        async with AsyncExitStack() as stack:
            opened = []
            for _ in range(count):
                session = await LocalTransport().open(folder=self.folder, largest_message=5_000_000)
                stack.push_async_callback(session.close)
                opened.append(session)
            yield opened
