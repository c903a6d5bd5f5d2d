"""The command in this process, in a folder with a small graph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from hfg.cli import main

STEPS = '''
"""Five steps a second, and what becomes of them."""
from collections.abc import Iterator

import hfg


@hfg.node
def steps(*, count: int = 5) -> Iterator[int]:
    yield from range(count)


@hfg.node
def third(step: int) -> int | None:
    print("step", step)
    return step if step % 3 == 0 else None


class Ear(hfg.Node):
    heard = hfg.Input(int)
    rang = hfg.Event(str)
    quiet = hfg.Event()

    def process(self, heard: int) -> None:
        self.rang.trigger("two\\nlines")

    @hfg.slot
    def begin(self) -> None: ...


def build() -> hfg.Graph:
    graph = hfg.Graph("steps")
    source, middle, ear = graph.add(steps(), max_rate_hz=5), graph.add(third()), graph.add(Ear())
    graph.connect(source.out, middle.ports.inputs["step"])
    graph.connect(middle.out, ear.heard)
    graph.start.activates(ear.begin)
    graph.connect(ear.rang, graph.output("rang", str))
    return graph


other = build
'''


@dataclass
class Shown:
    """What a command left behind."""

    code: int
    out: str
    err: str


class Command:
    """Runs the command in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: str) -> Shown:
        code = main(arguments)
        out, err = self._capsys.readouterr()
        return Shown(code, out, err)


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Give the command, in a folder with `steps.py`."""
    (tmp_path / "steps.py").write_text(STEPS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return Command(capsys)
