"""Node types are found by reference."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import hfg
from hfg import registry
from hfg.errors import TargetError


class Outer:
    class Inner(hfg.Node):
        def process(self, value: int) -> int:
            return value


@hfg.node
def double(value: int) -> int:
    return 2 * value


@pytest.mark.parametrize("kind", [Outer.Inner, double])
def test_a_type_is_found_by_its_reference(kind: type[hfg.Node]) -> None:
    reference = registry.reference_of(kind)
    assert reference is not None
    assert registry.find(reference) is kind
    assert registry.reference_of(kind()) == reference


def test_a_module_is_imported_when_a_type_of_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot_parts.py").write_text("import hfg\nclass Arm(hfg.Node):\n    moved = hfg.Event()\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert registry.reference_of(registry.find("robot_parts:Arm")) == "robot_parts:Arm"
    del sys.modules["robot_parts"]


def test_a_type_has_the_name_of_the_package_that_lists_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So a module can be parted, and files written before still find its types."""
    package = tmp_path / "robot_family"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from robot_family.arms import Arm, Leg, raised\n__all__ = ['Arm', 'raised']\n"
    )
    (package / "arms.py").write_text(
        "import hfg\nclass Arm(hfg.Node):\n    moved = hfg.Event()\nclass Leg(hfg.Node):\n    moved = hfg.Event()\n"
        "@hfg.node\ndef raised(by: int) -> int:\n    return by + 1\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for name, where in (("Arm", "robot_family"), ("raised", "robot_family"), ("Leg", "robot_family.arms")):
        kind = registry.find(f"robot_family.arms:{name}")
        assert registry.reference_of(kind) == f"{where}:{name}"
        assert registry.find(f"{where}:{name}") is kind
    sys.modules["robot_family"].Arm = object  # type: ignore[attr-defined]
    assert registry.reference_of(registry.find("robot_family.arms:Arm")) == "robot_family.arms:Arm"
    del sys.modules["robot_family"], sys.modules["robot_family.arms"]


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("Arm", 'write "module:name"'),
        ("no_such_module:Arm", 'no module named "no_such_module"'),
        ("hfg.errors:Arm", 'module "hfg.errors" has no "Arm"'),
        ("hfg.testing.nodes:Scrpt", r'module "hfg\.testing\.nodes" has no "Scrpt" \(did you mean "Script"\?\)'),
        ("hfg.nodes.cv:blurr", r'module "hfg\.nodes\.cv" has no "blurr" \(did you mean "blur"\?\)'),
        ("hfg.errors:HfgError", "not a node type; derive it from hfg.Node"),
    ],
)
def test_what_is_no_node_type_is_refused(reference: str, message: str) -> None:
    with pytest.raises(TargetError, match=message):
        registry.find(reference)


def test_a_module_that_fails_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_parts.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(TargetError, match=r'importing "broken_parts" failed \(ZeroDivisionError'):
        registry.find("broken_parts:Arm")
