"""A Zenoh router in a process of its own, at a port of loopback, and peers that are not hfg's."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.limits import patience
from tests.transports.zenoh.conftest import free_port

ROOT = Path(__file__).resolve().parent.parent.parent
PEERS = Path(__file__).parent / "peers"
PATIENCE_S = patience(20.0)

_ROUTER = """
import json, sys, zenoh
config = zenoh.Config()
said = {"mode": "router", "scouting/multicast/enabled": False, "listen/endpoints": [sys.argv[1]]}
for key, value in said.items():
    config.insert_json5(key, json.dumps(value))
with zenoh.open(config):
    print("ready", flush=True)
    sys.stdin.read()
"""


class Process:
    """Another program that says when it is ready, and ends with its standard input."""

    def __init__(self, *command: str) -> None:
        self._command = command
        self._running: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and wait until it is ready."""
        quiet = {**os.environ, "GIT_PYTHON_REFRESH": "quiet", "PYTHONWARNINGS": "ignore"}
        self._running = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=quiet)
        assert self._running.stdout is not None
        said = self._running.stdout.readline()
        assert said == b"ready\n", f"{self._command} has said {said!r}"

    def kill(self) -> None:
        """Kill it, if it runs."""
        if self._running is not None:
            self._running.kill()
            self._running.communicate()
            self._running = None


class Router(Process):
    """A router of Zenoh."""

    def __init__(self) -> None:
        self.address = f"tcp/127.0.0.1:{free_port()}"
        super().__init__(sys.executable, "-c", _ROUTER, self.address)


@pytest.fixture(scope="module")
def router() -> Iterator[Router]:
    """Yield a router, the same for all tests of a module."""
    pytest.importorskip("zenoh", reason="eclipse-zenoh is part of hfg[ros2]")
    one = Router()
    one.start()
    yield one
    one.kill()


def python_with(package: str) -> str:
    """Return a Python that has a package: this one, or that of `make peers`; else skip."""
    for prefix in (Path(sys.prefix), ROOT / ".venv-peers"):
        if any(prefix.glob(f"lib/python*/site-packages/{package}")):
            return str(prefix / "bin" / "python")
    pytest.skip(f"{package} is not installed: make peers")


async def until(true: object) -> None:
    """Wait for something that other programs do."""
    assert callable(true)
    async with asyncio.timeout(PATIENCE_S):
        while not true():
            await asyncio.sleep(0.005)
