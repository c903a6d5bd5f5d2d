"""A name has one home, and where users import, `__all__` tells the truth about it."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import hfg
from tests.test_layers import ALL, HFG, ROOT

PUBLIC = [name for name in ALL if not any(part.startswith("_") for part in name.split("."))]
LISTING = [
    name
    for name, file in ALL.items()
    if name in PUBLIC
    and (
        file.name == "__init__.py"
        or name.count(".") < 2
        or (name.startswith(("hfg.nodes.", "hfg.testing.")) and name.count(".") == 2)
    )
]
"""Modules from which users import: what lies directly in hfg, packages, families of nodes, help for tests."""
STILL_LISTING = ("hfg.engine.", "hfg.activity.", "hfg.ports.", "hfg.studio.", "hfg.analysis.", "hfg.monitors.")
"""Components whose inner modules still list their names."""


def order(name: str) -> tuple[int, str]:
    """Sort as ruff's RUF022 does: constants, then classes, then the rest."""
    return (0 if name.isupper() and len(name) > 1 else 1 if name[:1].isupper() else 2), name


def tree(module: str) -> ast.Module:
    return ast.parse(ALL[module].read_text(encoding="utf-8"))


def loaded(module: str) -> ModuleType:
    return importlib.import_module(module)


@pytest.mark.slow
def test_modules_from_which_users_import_list_their_names_sorted_and_without_doubles() -> None:
    for module in LISTING:
        exported = getattr(loaded(module), "__all__", None)
        assert exported is not None, f"{module} has no __all__"
        assert list(exported) == sorted(set(exported), key=order), f"{module}.__all__ is not sorted"


def test_inner_modules_say_by_an_underscore_alone_what_is_theirs() -> None:
    """A list beside the underscores would say the same a second time. `hfg.commands` is one of these modules."""
    inner = set(PUBLIC) - set(LISTING) - {"hfg.graph.editing.commands"}
    checked = [module for module in sorted(inner) if not module.startswith(STILL_LISTING)]
    listing = [module for module in checked if "__all__" in _names(module)]
    assert not listing, f"{listing} have an __all__, but nobody imports from there: the underscore tells"


def _names(module: str) -> set[str]:
    assigned = (one for one in tree(module).body if isinstance(one, ast.Assign | ast.AnnAssign))
    targets = (one.targets[0] if isinstance(one, ast.Assign) else one.target for one in assigned)
    return {ast.unparse(target) for target in targets}


@pytest.mark.slow
def test_all_names_what_exists() -> None:
    for module in LISTING:
        missing = [name for name in loaded(module).__all__ if not hasattr(loaded(module), name)]
        assert not missing, f"{module}.__all__ names {missing}, which the module does not have"


@pytest.mark.slow
def test_public_definitions_are_in_all() -> None:
    """A function or class that others must not use has an underscore, or lives in a module that has one."""
    for module in LISTING:
        kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
        defined = {node.name for node in tree(module).body if isinstance(node, kinds) and not node.name.startswith("_")}
        left_out = sorted(defined - set(loaded(module).__all__))
        assert not left_out, f"{module} defines {left_out} but does not list them in __all__"


def test_the_face_is_complete() -> None:
    """Type checkers read the imports, Python finds the same objects on demand, and `hfg.__all__` lists them."""
    imports = [
        one
        for block in tree("hfg").body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for one in block.body
        if isinstance(one, ast.ImportFrom)
    ]
    names = [(one.module, alias.name) for one in imports for alias in one.names]
    assert sorted(name for _, name in names) == sorted(hfg.__all__)
    for module, name in names:
        assert getattr(hfg, name) is getattr(loaded(str(module)), name), name


def test_the_face_defines_nothing() -> None:
    """`hfg/__init__.py` holds a layout comment, imports and `__all__`; every name has its home elsewhere."""
    for statement in tree("hfg").body:
        is_docstring = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        is_all = isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "__all__"
        is_import = isinstance(statement, ast.Import | ast.ImportFrom)
        is_dir = isinstance(statement, ast.FunctionDef) and statement.name == "__dir__"
        is_about_imports = isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test)
        assert is_docstring or is_all or is_import or is_dir or is_about_imports, (
            f"hfg/__init__.py:{statement.lineno} defines something"
        )


def test_a_name_that_hfg_does_not_have_is_refused_as_by_any_module() -> None:
    with pytest.raises(AttributeError, match=r"^module 'hfg' has no attribute 'Grpah'$"):
        _ = getattr(hfg, "Grpah")  # noqa: B009 - type checkers refuse it too
    assert hfg.encoding.Limits is loaded("hfg.encoding").Limits


def test_a_module_that_cannot_be_imported_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An attribute that only seems to be missing would hide it."""
    (tmp_path / "lazily").mkdir()
    (tmp_path / "lazily" / "__init__.py").write_text(
        "from hfg.base.lazy import on_demand\n__getattr__ = on_demand(__name__, {'broken': ['name']})\n"
    )
    (tmp_path / "lazily" / "broken.py").write_text("import no_such_module_at_all\n")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("name", "broken"):
        with pytest.raises(ModuleNotFoundError, match="no_such_module_at_all"):
            getattr(loaded("lazily"), name)


def test_completion_shows_the_public_names_only() -> None:
    assert dir(hfg) == sorted(hfg.__all__)


def test_no_module_is_named_like_a_public_function() -> None:
    """`hfg.node` must stay the function, whatever is imported in whatever order."""
    submodules = {name.split(".")[1] for name in HFG if name.count(".") == 1}
    clashes = sorted(name for name in submodules & set(hfg.__all__) if not isinstance(getattr(hfg, name), ModuleType))
    assert not clashes


def test_import_hfg_brings_next_to_nothing() -> None:
    """So the command line shows its help, and searches nodes, without the engine; whoever uses a name pays for it."""
    code = "import sys, hfg; print(*sorted(name for name in sys.modules))"
    names = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    unwanted = {"hfg.cli", "hfg.testing", "hfg_transports", "typer", "rich", "hypothesis", "pytest", "cv2"}
    unwanted |= {"numpy", "reactivex", "anyio", "asyncio", "hfg.graph", "hfg.engine", "hfg.ports"}
    assert not unwanted & set(names)


@pytest.mark.slow
def test_all_of_hfg_brings_neither_command_line_nor_test_tools() -> None:
    code = "import sys; from hfg import *; print(*sorted(name for name in sys.modules))"
    names = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    unwanted = {"hfg.cli", "hfg.testing", "hfg_transports", "typer", "rich", "hypothesis", "pytest", "cv2"}
    assert not unwanted & set(names)
    assert "hfg.engine" in names


def test_virtual_time_is_at_the_door() -> None:
    """The few names that README and docs lean on, so that a slip in `__all__` cannot hide with both halves of it."""
    for name in ("Graph", "Node", "Subgraph", "Input", "Output", "Event", "Parameter", "State", "Token", "EndOfStream"):
        assert name in hfg.__all__
    for name in ("node", "slot", "run", "run_async", "running", "now", "VirtualTimeLoop"):
        assert name in hfg.__all__


def test_the_reference_page_has_every_name_of_the_face() -> None:
    page = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    missing = [name for name in hfg.__all__ if f"hfg.{name}" not in page]
    assert not missing, f"docs/reference.md says nothing of {missing}"
