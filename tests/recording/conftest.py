"""A graph to record, as code and as a program of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hfg
from tests.limits import patience

PROGRAM = """
from collections.abc import Iterator
import hfg

@hfg.node
def camera(*, count: int = 20) -> Iterator[int]:
    yield from range(count)

@hfg.node
def double(value: int) -> int:
    return 2 * value

@hfg.node
def show(value: int) -> None:
    pass

def build(count: int = 20, rate: float = 100.0) -> hfg.Graph:
    graph = hfg.Graph("robot")
    graph.add(camera(count=count), max_rate_hz=rate) >> graph.add(double()) >> graph.add(show())
    return graph
"""


@hfg.node
def camera(*, count: int = 20) -> Iterator[int]:
    """Give numbers."""
    yield from range(count)


@hfg.node
def double(value: int) -> int:
    """Give twice the value."""
    return 2 * value


@hfg.node
def show(value: int) -> None:
    """Take it."""


def build(count: int = 20, rate: float | None = 100.0) -> hfg.Graph:
    """Make the graph."""
    graph = hfg.Graph("robot")
    graph.add(camera(count=count), max_rate_hz=rate) >> graph.add(double()) >> graph.add(show())
    return graph


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The same graph as a file."""
    file = tmp_path / "robot.py"
    file.write_text(PROGRAM)
    return file


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `hfg` in a process of its own, in the folder of the test."""

    def run(*arguments: str, before: str = "") -> subprocess.CompletedProcess[str]:
        code = f"{before}\nimport sys\nfrom hfg.cli.app import main\nsys.exit(main({list(arguments)!r}))"
        return subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
            timeout=patience(60),
            check=False,
        )

    return run
