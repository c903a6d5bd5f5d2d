"""What TARGET may be, and the sentence for what it may not be."""

from __future__ import annotations

from pathlib import Path

import pytest

from hfg.cli.target import load_graph
from hfg.errors import TargetError

NODE = """
import hfg

@hfg.node
def numbers() -> 'Iterator[int]':
    yield 1
""".replace("'Iterator[int]'", "__import__('collections.abc').abc.Iterator[int]")


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test writes its modules into a folder of its own."""
    monkeypatch.chdir(tmp_path)


def write(name: str, code: str) -> str:
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text("import hfg\n" + code, encoding="utf-8")
    return name


ONE = "only = hfg.Graph('one')\n"
BUILDER = "def build() -> hfg.Graph:\n    return hfg.Graph('built')\n"


@pytest.mark.parametrize(
    ("code", "target", "name"),
    [
        (ONE, "a_file.py", "one"),
        (ONE, "a_file.py:only", "one"),
        (ONE, "a_file:only", "one"),
        (ONE, "a_file", "one"),
        (BUILDER, "a_file.py", "built"),
        (BUILDER, "a_file.py:build", "built"),
        (BUILDER + "graph = build()\n", "a_file.py", "built"),
        ("def make(size=3):\n    return hfg.Graph(f'made{size}')\n", "a_file.py:make", "made3"),
        ("class Holder:\n    graph = hfg.Graph('held')\n", "a_file.py:Holder.graph", "held"),
        (ONE + "same = only\n", "a_file.py", "one"),
    ],
)
def test_target_is_found(code: str, target: str, name: str) -> None:
    write("a_file.py", code)
    assert load_graph(target).name == name


def test_absolute_path_and_module_in_a_package(tmp_path: Path) -> None:
    write("pack/__init__.py", "")
    write("pack/inside.py", ONE)
    assert load_graph("pack.inside:only").name == "one"
    assert load_graph(f"{tmp_path}/pack/inside.py:only").name == "one"


def test_a_file_may_import_its_neighbour() -> None:
    write("deep/neighbour.py", ONE)
    write("deep/main_graph.py", "from neighbour import only\n")
    assert load_graph("deep/main_graph.py").name == "one"


def test_a_file_may_be_named_like_a_module_of_python() -> None:
    write("queue.py", ONE)
    assert load_graph("queue.py").name == "one"


def test_node_types_of_a_file_are_found_by_name() -> None:
    write("robot_types.py", NODE + "graph = hfg.Graph('types')\ngraph.add(numbers())\n")
    (node,) = load_graph("robot_types.py").nodes.values()
    assert type(node)._type.reference == "robot_types:numbers"


@pytest.mark.parametrize(
    ("code", "target", "sentence"),
    [
        ("", "missing.py", "missing.py: does not exist"),
        ("", "missing_module:graph", 'there is no module "missing_module"'),
        ("", "a_file:", "names nothing"),
        ("", "a_file.py", "has no graph"),
        (ONE, "a_file.py:other", 'has no "other"; it has only'),
        (ONE, "a_file.py:hfg", "is a module, not a Graph"),
        (ONE + "two = hfg.Graph('two')\n", "a_file.py", "name one of a_file.py:only, a_file.py:two"),
        ("def build(size) -> hfg.Graph: ...\n", "a_file.py:build", "needs arguments"),
        ("def build() -> hfg.Graph:\n    return 3\n", "a_file.py", "returned an int, not a Graph"),
        ("def build() -> hfg.Graph:\n    1 / 0\n", "a_file.py", "build() failed: ZeroDivisionError"),
        (
            "def build() -> hfg.Graph:\n    raise SystemExit\n",
            "a_file.py",
            "build() left the program; let it return the",
        ),
        ("async def build() -> hfg.Graph: ...\n", "a_file.py", "build() is async; let a plain function build"),
        ("", ".", '"." is not a module; name one from here on, as in package.module, or a file'),
        ("1 / 0\n", "a_file.py", "a_file.py failed: ZeroDivisionError"),
        ("import not_there\n", "a_file.py", "No module named 'not_there'"),
        ("import not_there\n", "a_file:graph", "No module named 'not_there'"),
        ("raise SystemExit(3)\n", "a_file.py", "__main__"),
        ("def broken(:\n", "a_file.py", "SyntaxError"),
    ],
)
def test_what_is_wrong_is_told_in_a_sentence(code: str, target: str, sentence: str) -> None:
    write("a_file.py", code)
    with pytest.raises(TargetError) as caught:
        load_graph(target)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
