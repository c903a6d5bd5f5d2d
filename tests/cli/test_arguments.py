"""`--arg count=3`: what the function that builds a graph is called with."""

from __future__ import annotations

import enum
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import pytest

import hfg
from hfg.cli.arguments import builder_arguments
from hfg.errors import TargetError


class Mode(enum.Enum):
    FAST = "fast"


def make(  # type: ignore[no-untyped-def]
    count: int,
    rate: float = 1.0,
    *,
    name: str = "graph",
    loud: bool = False,
    mode: Mode = Mode.FAST,
    place: Path = Path(),
    sizes: list[int] = [1],  # noqa: B006
    kind: Literal["a", "b"] = "a",
    maybe: int | None = None,
    plain=3,
) -> hfg.Graph:
    return hfg.Graph(name)


@pytest.mark.parametrize(
    ("given", "value"),
    [
        ("count=3", 3),
        ("rate=2", 2),
        ("rate=2.5", 2.5),
        ("name=3", "3"),
        ("name=two words", "two words"),
        ("loud=true", True),
        ("loud=True", True),
        ("mode=fast", Mode.FAST),
        ("place=/data", Path("/data")),
        ("sizes=[1, 2]", [1, 2]),
        ("kind=b", "b"),
        ("maybe=None", None),
        ("plain=7", 7),
    ],
)
def test_a_value_is_read_by_its_type_hint(given: str, value: Any) -> None:
    name = given.partition("=")[0]
    assert builder_arguments("graph.py", make, ["count=1", given])[name] == value


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (["count=three"], "graph.py: make(): argument \"count\" must be of type int, got 'three'"),
        (["count=2.5"], 'argument "count" must be of type int'),
        (["kind=c"], 'argument "kind" must be of type'),
        (["cuont=3"], 'make() has no argument "cuont"; it has count: int, rate: float, name: str'),
        (["count"], '--arg "count" gives nothing: write --arg NAME=VALUE'),
        ([], "make() needs a value for count: write --arg count=VALUE"),
    ],
)
def test_a_wrong_argument_is_refused_with_what_there_is(given: list[str], sentence: str) -> None:
    with pytest.raises(TargetError) as refused:
        builder_arguments("graph.py", make, given)
    assert sentence in str(refused.value)


FILE = """
import hfg
from hfg.testing.nodes import script, sink

def make(count: int) -> hfg.Graph:
    graph = hfg.Graph("made")
    graph.add(script(values=tuple(range(count)))) >> graph.add(sink())
    return graph
"""


def test_run_tap_check_and_draw_take_arguments(command: Callable[..., Any]) -> None:
    Path("made.py").write_text(FILE, encoding="utf-8")
    assert command("check", "made.py:make", "--arg", "count=3").code == 0
    assert command("draw", "made.py", "--arg", "count=3").code == 0
    tapped = command("tap", "made.py:make", "script.out", "--arg", "count=3", "--clock", "virtual")
    assert tapped.out.splitlines()[-2:] == ["0.000 s  2", "0.000 s  END"], tapped
    ran = command("run", "made.py:make", "--arg", "count=3", "--clock", "virtual")
    assert ran.code == 0, ran
    missing = command("run", "made.py:make")
    assert missing.code == 2
    assert "--arg NAME=VALUE" in missing.err
    Path("whole.py").write_text("import hfg\ngraph = hfg.Graph()\n", encoding="utf-8")
    built = command("run", "whole.py:graph", "--arg", "count=3")
    assert built.code == 2
    assert "holds a graph that is built already" in built.err
