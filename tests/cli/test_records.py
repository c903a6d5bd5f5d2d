"""What is logged, on the command line: with time and path, and without taking a user's own logging away."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.limits import patience

pytestmark = pytest.mark.slow

LOUD = """
import logging
from collections.abc import Iterator

import hfg

{configuration}
MINE = logging.getLogger("mine")


@hfg.node
def steps() -> Iterator[int]:
    yield from (1, 2)


class Box(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.value.inner, graph.add(loud(), on_error="skip").value)


@hfg.node
def loud(value: int) -> None:
    hfg.log().info("quiet %s", value)
    hfg.log().warning("loud %s", value)
    MINE.info("mine %s", value)
    MINE.warning("my warning %s", value)
    if value == 2:
        raise ValueError("no 2")


@hfg.node
def never(error: object) -> None: ...


def build() -> hfg.Graph:
    graph = hfg.Graph("loud")
    source = graph.add(steps(), max_rate_hz=4)
    graph.connect(source.out, graph.add(Box()).value)
    graph.connect(source.failed, graph.add(never()).error)
    return graph
"""


def errors_of(folder: Path, *arguments: str, configuration: str = "") -> list[str]:
    """Run it in a process of its own: logging belongs to all of a process."""
    file = folder / "loud.py"
    file.write_text(LOUD.replace("{configuration}", configuration))
    done = subprocess.run(
        [sys.executable, "-m", "hfg", "run", str(file), *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_COLOR": "1"},
        timeout=patience(50),
    )
    assert done.returncode == 0, done.stderr
    return done.stderr.splitlines()


def test_records_have_the_run_s_time_and_the_path_and_failures_the_user_s_frames(tmp_path: Path) -> None:
    lines = errors_of(tmp_path, "--clock", "virtual")
    assert lines[0].startswith(
        '0.000 s WARNING hfg.graph: "steps.failed -> never.error": nothing ever comes over this edge'
    )
    assert lines[1:6] == [
        "0.000 s WARNING box/loud: loud 1",
        "0.000 s WARNING mine: my warning 1",
        "0.250 s WARNING box/loud: loud 2",
        "0.250 s WARNING mine: my warning 2",
        '0.250 s ERROR box/loud: node "box/loud" failed in firing 2: ValueError: no 2; the node goes on '
        '(on_error="skip")',
    ]
    assert lines[6] == "Traceback (most recent call last):"
    frames = [line for line in lines if line.startswith("  File")]
    assert frames
    assert all(f'{tmp_path}/loud.py"' in line for line in frames)


def test_on_the_real_clock_they_have_the_time_of_day(tmp_path: Path) -> None:
    lines = errors_of(tmp_path, "-v")
    assert re.match(r"\d\d:\d\d:\d\d\.\d{3} WARNING hfg\.graph: ", lines[0])
    assert re.match(r"\d\d:\d\d:\d\d\.\d{3} INFO box/loud: quiet 1$", lines[1])


def test_a_program_that_sets_up_logging_itself_keeps_it(tmp_path: Path) -> None:
    mine = 'logging.basicConfig(level="INFO", format="MINE %(name)s %(message)s")'
    lines = errors_of(tmp_path, "--clock", "virtual", configuration=mine)
    assert lines[1:5] == [
        "MINE hfg.node.box.loud loud 1",
        "MINE mine mine 1",
        "MINE mine my warning 1",
        "MINE hfg.node.box.loud loud 2",
    ]
    assert not [line for line in lines if " s WARNING" in line]
