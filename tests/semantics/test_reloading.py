"""Hot reload of a module, at rest and while its nodes run: code under way goes on with what it had (rule R4)."""

from __future__ import annotations

import asyncio
import importlib
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import GraphError
from hfg.testing import Recorder, fire, recorder
from hfg.testing.nodes import script, sink

SOURCE = """
import asyncio
import hfg

CLOSED = []

def helper(value):
    return value

class Grow(hfg.Node):
    by = hfg.Parameter(1)

    async def process(self, value: int) -> int:
        await asyncio.sleep(0.01)
        return helper(value) * self.by

    def teardown(self) -> None:
        CLOSED.append(helper("closed"))
"""


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("growing", "grown", "grown.inner"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    path = tmp_path / "growing.py"
    path.write_text(SOURCE)
    return path


def line() -> hfg.Graph:
    graph = hfg.Graph("line")
    source = graph.add(script(values=(1, 2, 3)), max_rate_hz=50.0)
    graph.edit(c.Add("growing:Grow", "grow", {"by": 10}), c.Connect("script.out", "grow.value"))
    assert source is graph["script"]
    graph["grow"] >> graph.add(sink(), name="sink")
    return graph


def drive(graph: hfg.Graph, body: Callable[[hfg.Run], Awaitable[Any]]) -> Recorder:
    trace = recorder()

    async def main() -> None:
        async with hfg.running(graph, trace=trace) as run:
            await body(run)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    return trace


def given(trace: Recorder) -> list[Any]:
    return trace.values("grow.out -> sink.value")[:-1]


def write(source: Path, text: str) -> None:
    source.write_text(text)


@pytest.mark.rule("R4")
def test_a_firing_under_way_ends_with_the_code_it_began_with(source: Path) -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        write(source, SOURCE.replace("helper(", "aid(").replace("* self.by", "* self.by + 5"))
        await run.reload("growing")

    graph = line()
    old = sys.modules["growing"]
    closed = vars(old)["CLOSED"]
    assert given(drive(graph, body)) == [10, 25, 35]
    assert closed == ["closed"]  # by the old helper, which the new module has no more


@pytest.mark.rule("R4")
def test_a_module_that_fails_leaves_the_run_as_it_was_and_can_be_tried_again(source: Path) -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        write(source, "def helper(:")
        with pytest.raises(GraphError, match="invalid syntax in line 1 of .*the graph keeps its nodes"):
            await run.reload("growing")
        await asyncio.sleep(0.02)
        write(source, SOURCE.replace("* self.by", "* self.by + 5"))
        await run.reload("growing")

    assert given(drive(line(), body)) == [10, 20, 35]


@pytest.mark.rule("R4")
def test_what_is_undone_works_with_its_old_code(source: Path) -> None:
    async def body(run: hfg.Run) -> None:
        write(source, SOURCE.replace("helper(", "aid(").replace("* self.by", "* self.by + 5"))
        await run.reload("growing")
        await run.undo()

    assert given(drive(line(), body)) == [10, 20, 30]


TWO = """
import hfg

def scale(x: int) -> int:
    return x * {by}

f = hfg.node(scale)

class Box:
    class Inner(hfg.Node):
        def process(self, x: int) -> int:
            return x * {by}
"""


@pytest.mark.rule("R4")
def test_what_is_undone_is_reloaded_like_everything_else(source: Path) -> None:
    write(source, TWO.format(by=1))
    graph = hfg.Graph()
    graph.edit(c.Add("growing:f", "f"), c.Add("growing:Box.Inner", "inner"), c.Add("growing:f", "late"))
    graph.edit(c.Remove("late"))
    for by in (2, 3):
        write(source, TWO.format(by=by))
        graph.reload("growing")
    for _ in range(3):
        graph.undo()
    assert [fire(graph[name], x=10).outputs for name in ("f", "inner", "late")] == [{"out": 10}] * 3
    write(source, TWO.format(by=4))
    graph.reload("growing")
    assert [fire(graph[name], x=10).outputs for name in ("f", "inner", "late")] == [{"out": 40}] * 3


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "No such file"),
        (b"import hfg\n# \xff\n", "can't decode byte 0xff"),
        (b"import hfg\n\0\n", "null bytes"),
        (b"import sys\nsys.exit(3)\n", "running it failed (SystemExit: 3)"),
        (b"# -*- coding: klingon -*-\n", "klingon"),
    ],
)
def test_a_file_that_is_no_module_any_more_is_refused_with_a_sentence(
    source: Path, content: bytes | None, sentence: str
) -> None:
    graph = line()
    before = sys.modules["growing"]
    source.unlink()
    if content is not None:
        source.write_bytes(content)
    with pytest.raises(GraphError) as refused:
        graph.reload("growing")
    assert sentence in str(refused.value)
    assert "cannot be reloaded" in str(refused.value)
    assert sys.modules["growing"] is before


def test_whoever_holds_the_module_sees_the_new_one(source: Path) -> None:
    graph = line()
    held: Any = sys.modules["growing"]
    for number in (1, 2, 3):
        source.write_text(SOURCE + f"NUMBER = {number}\n")
        graph.reload(held)
        assert held.NUMBER == importlib.import_module("growing").NUMBER == number
        assert type(graph["grow"]) is held.Grow
    held.NUMBER = 7
    assert vars(sys.modules["growing"])["NUMBER"] == 7
    del held.NUMBER
    assert not hasattr(sys.modules["growing"], "NUMBER")


def test_a_module_that_is_put_back_by_hand_is_itself_again(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    graph = line()
    held: Any = sys.modules["growing"]
    source.write_text(SOURCE + "NUMBER = 1\n")
    graph.reload("growing")
    monkeypatch.setitem(sys.modules, "growing", held)
    assert not hasattr(held, "NUMBER")
    held.OTHER = 2
    assert held.OTHER == 2
    del held.OTHER
    assert isinstance(held, ModuleType)


def test_a_package_keeps_what_is_inside_it(source: Path) -> None:
    package = source.parent / "grown"
    package.mkdir()
    (package / "__init__.py").write_text("import hfg\n@hfg.node\ndef same(value: int) -> int:\n    return value\n")
    (package / "inner.py").write_text("import hfg\n@hfg.node\ndef twice(value: int) -> int:\n    return 2 * value\n")
    graph = line()
    graph.edit(c.Add("grown:same", "same"), c.Add("grown.inner:twice", "twice"))
    inner = (package / "inner.py").read_text()
    (package / "inner.py").write_text(inner.replace("2 *", "3 *"))
    graph.reload("grown.inner")
    graph.reload("grown")
    grown: Any = sys.modules["grown"]
    assert grown.inner is sys.modules["grown.inner"]
    assert type(graph["twice"]) is grown.inner.twice._class


TYPES = """
import enum
from collections.abc import Iterator
from dataclasses import dataclass
import hfg

class Mode(enum.Enum):
    SLOW = "slow"
    FAST = "fast"

@dataclass
class Pose:
    x: int = 0

@hfg.node
def poses(*, mode: Mode = Mode.SLOW, home: Pose = Pose()) -> Iterator[Pose]:
    yield home

@hfg.node
def shift(pose: Pose) -> Pose:
    return Pose(pose.x + 1)
"""


@pytest.mark.rule("R4")
def test_types_of_the_module_itself_are_made_anew_on_edges_and_in_parameters(source: Path) -> None:
    source.write_text(TYPES)
    graph = hfg.Graph()
    graph.edit(c.Add("growing:poses", "poses"), c.Add("growing:shift", "shift"))
    graph.edit(c.Connect("poses.out", "shift.pose"), c.SetParameter("poses.mode", "fast"))
    graph.edit(c.SetParameter("poses.home", {"x": 7}))
    source.write_text(TYPES.replace("+ 1", "+ 2"))
    graph.reload("growing")
    module: Any = sys.modules["growing"]
    assert graph["poses"].mode is module.Mode.FAST
    assert type(graph["poses"].home) is module.Pose
    trace = recorder()
    graph["shift"] >> graph.add(Anything(), name="sink")
    hfg.run(graph, clock="virtual", trace=trace)
    assert [pose.x for pose in trace.values("shift.out -> sink.value")[:-1]] == [9]


class Anything(hfg.Node):
    """Takes anything."""

    value = hfg.Input(object)

    def process(self, value: object) -> None: ...


def test_a_value_that_the_new_type_does_not_take_is_no_silent_loss(source: Path) -> None:
    source.write_text(TYPES)
    graph = hfg.Graph()
    graph.edit(c.Add("growing:poses", "poses"), c.SetParameter("poses.mode", "fast"))
    source.write_text(TYPES.replace('    FAST = "fast"\n', ""))
    with pytest.raises(GraphError, match='with its parameters as they are: "mode" must be of type Mode'):
        graph.reload("growing")
    assert graph["poses"].mode.name == "FAST"
    graph.edit(c.SetParameter("poses.mode", "slow"))
    graph.reload("growing")
    assert graph["poses"].mode.name == "SLOW"
