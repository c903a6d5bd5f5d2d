"""Find which modules of a source tree import which, without importing any.

Used by `house` and `tests/test_layers.py`.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Set
from pathlib import Path

__all__ = ["imported", "modules", "parsed"]


def modules(folder: str, source: Path) -> dict[str, Path]:
    """Return every module below `source/folder` by its dotted name."""
    found = {}
    for file in sorted((source / folder).rglob("*.py")):
        parts = file.relative_to(source).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@functools.cache
def parsed(file: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(file.read_text(encoding="utf-8"), filename=str(file))


def _for_types_only(tree: ast.AST) -> set[int]:
    """Return the lines of a file that are under `if TYPE_CHECKING`: they name and do not import."""
    blocks = [one for one in ast.walk(tree) if isinstance(one, ast.If) and "TYPE_CHECKING" in ast.unparse(one.test)]
    return {line for block in blocks for one in block.body for line in range(one.lineno, (one.end_lineno or 0) + 1)}


@functools.cache
def imported(module: str, file: Path, known: Set[str], *, named: bool = True) -> tuple[tuple[str, int], ...]:
    """Return the full names of the modules that the file imports, with the line; relative imports are resolved.

    Args:
      module: the dotted name of the file.
      file: the file.
      known: all modules of the tree: `from hfg import graph` imports hfg.graph, `from hfg import Graph` imports hfg.
      named: count imports that are only for type checkers too.
    """
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    tree, found = parsed(file), list[tuple[str, int]]()
    left_out = set() if named else _for_types_only(tree)
    for statement in ast.walk(tree):
        if getattr(statement, "lineno", 0) in left_out:
            continue
        if isinstance(statement, ast.Import):
            found += [(alias.name, statement.lineno) for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            base = statement.module or ""
            if statement.level:
                anchor = package.split(".")[: len(package.split(".")) - statement.level + 1]
                base = ".".join([*anchor, base] if base else anchor)
            names = [f"{base}.{alias.name}" for alias in statement.names]
            found += [(name, statement.lineno) for name in {name if name in known else base for name in names}]
    return tuple(found)
