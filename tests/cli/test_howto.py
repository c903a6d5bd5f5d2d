"""The lines of docs/howto/command_line.md do what they say."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.cli.conftest import Command

pytestmark = pytest.mark.slow

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "command_line.md"
BLOCKS = re.findall(r"^```console\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
LINES = [shlex.split(line, comments=True) for block in BLOCKS for line in block.splitlines()]
NOTHING_THERE = 2

ROBOT = '''
"""As the page has it."""
from collections.abc import Iterator

import hfg


@hfg.node
def camera() -> Iterator[int]:
    yield from range(12)


class Lookup(hfg.Node):
    key = hfg.Input(int)
    pose = hfg.Output(float)
    tolerance = hfg.Parameter(0.1)

    def process(self, key: int) -> float:
        return key * self.tolerance


@hfg.node
def plan(pose: float, *, mode: str = "bold") -> None: ...


class Arm(hfg.Subgraph):
    pose = hfg.Input(float)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.pose.inner, graph.add(plan()).ports.inputs["pose"])


def build(cameras: int = 1) -> hfg.Graph:
    graph = hfg.Graph("robot")
    eye, lookup, arm = graph.add(camera()), graph.add(Lookup()), graph.add(Arm())
    graph.connect(eye.out, lookup.key)
    graph.connect(lookup.pose, arm.pose)
    return graph
'''


@pytest.mark.parametrize("line", LINES, ids=" ".join)
def test_line_works_as_written(command: Command, line: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    Path("robot.py").write_text(ROBOT, encoding="utf-8")
    Path("my_robot").mkdir()
    Path("my_robot", "graphs.py").write_text(ROBOT.replace("def build", "def fetch"), encoding="utf-8")
    monkeypatch.setenv("XDG_STATE_HOME", str(Path.cwd()))
    program, *arguments = line[: line.index("|")] if "|" in line else line
    assert program == "hfg"
    if "robot.hfg.yaml" in arguments[:2]:
        command("convert", "robot.py", "robot.hfg.yaml")
    if "run.mcap" in arguments[:2]:
        command("record", "robot.py", "-o", "run.mcap")
    if arguments[0] == "check" and "--profile" in arguments:
        command("run", "robot.py", "--profile", "robot.json")
    shown = command(*arguments)
    looks_elsewhere = arguments[0] in ("top", "ros") or "4711" in arguments or arguments[1] == "fetch"
    assert shown.code == (NOTHING_THERE if looks_elsewhere else 0), shown.err
