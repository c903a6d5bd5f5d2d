"""Measures the source of hfg: how large it is, how its modules depend on each other, and how plain its functions are.

    python tools/house.py                       this tree
    python tools/house.py --against 751ed90     another commit too; may be given several times

Requires only Python 3.11 and, for other commits, git. Lines are lines of files, comments and blank lines included.
"""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import sys
import tarfile
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.imports import imported, modules, parsed  # noqa: E402 - a script finds its folder first

HARD = ("hfg.graph", "hfg.engine")
LARGEST = 5
MOST_LINES_OF_A_FUNCTION = 40
MOST_LINES_OF_A_MODULE = 400
Figures = dict[str, str]
_DESCRIBED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--against", metavar="REV", action="append", default=[], help="another commit, beside this tree"
    )
    revisions = parser.parse_args().against
    columns = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, revision in enumerate(revisions):
            columns[revision] = figures(_checked_out(revision, Path(folder, str(number))))
        columns["this tree"] = figures(ROOT)
    print("\n".join(table(columns)))
    return 0


def _checked_out(revision: str, folder: Path) -> Path:
    command = ["git", "-C", str(ROOT), "archive", revision, "hfg", "tests/test_layers.py"]
    packed = subprocess.run(command, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def figures(source: Path) -> Figures:
    """Measure the tree in a folder."""
    files = modules("hfg", source)
    lines = {name: len(file.read_bytes().splitlines()) for name, file in files.items()}
    hard = {name: file for name, file in files.items() if name.startswith(HARD)}
    parts = Counter[str]()
    for name, number in lines.items():
        parts[_component(name)] += number
    found: Figures = {"lines": f"{sum(parts.values()):,}"}
    found |= {f"lines of {part}": f"{number:,}" for part, number in sorted(parts.items()) if part != "hfg"}
    found |= {f"lines that are {kind}": f"{number:,}" for kind, number in sorted(_kinds(files.values()).items())}
    found["modules"] = str(len(files))
    found["components (modules and packages of hfg)"] = str(len(parts))
    found["packages with their subpackages"] = str(sum(file.name == "__init__.py" for file in files.values()))
    found["layers"] = str(len(_layers(source)))
    arrows = {(_component(name), _component(other)) for name, other in edges(files)}
    found["arrows between components"] = str(sum(a != b for a, b in arrows))
    cycles = sorted(map(len, strongly_connected(files)), reverse=True)
    found["import cycles (modules in them)"] = f"{len(cycles)} ({', '.join(map(str, cycles)) or 'none'})"
    methods = sorted(public_methods(files.values()), reverse=True)[:LARGEST]
    found["public methods of the largest classes"] = ", ".join(f"{name} {number}" for number, name in methods)
    for title, some in (("", files), (" in graph and engine", hard)):
        found[f"functions over {MOST_LINES_OF_A_FUNCTION} lines{title}"] = str(sum(map(long_functions, some.values())))
        large = sum(lines[name] > MOST_LINES_OF_A_MODULE for name in some)
        found[f"modules over {MOST_LINES_OF_A_MODULE} lines{title}"] = str(large)
        found[f"foreign writes{title}"] = str(sum(map(foreign_writes, some.values())))
        found[f"Any{title}"] = str(sum(map(anys, some.values())))
        found[f"asserts{title}"] = str(sum(_count(ast.Assert, file) for file in some.values()))
        comments = sum(map(comment_lines, some.values()))
        found[f"comments per 100 lines{title}"] = f"{100 * comments / sum(lines[name] for name in some):.1f}"
    return found


def table(columns: Mapping[str, Figures]) -> Iterator[str]:
    """Yield the lines of a table in Markdown, with a column for each tree."""
    names = list(dict.fromkeys(name for column in columns.values() for name in column))
    parts = sorted(name for name in names if name.startswith("lines of "))
    names = [names[0], *parts, *(name for name in names[1:] if name not in parts)]
    yield "| " + " | ".join(["", *columns]) + " |"
    yield "|---|" + "--:|" * len(columns)
    for name in names:
        yield "| " + " | ".join([name, *(column.get(name, "") for column in columns.values())]) + " |"


def _kinds(files: Iterable[Path]) -> Counter[str]:
    """Count lines by what they are: code, imports, docstrings, comments of their own, or blank."""
    found = Counter[str]()
    for file in files:
        lines = [line.strip() for line in file.read_text(encoding="utf-8").splitlines()]
        kinds = ["blank" if not line else "comments" if line.startswith("#") else "code" for line in lines]
        for one in ast.walk(parsed(file)):
            if isinstance(one, ast.Import | ast.ImportFrom):
                _mark(kinds, one, "imports")
            elif isinstance(one, _DESCRIBED) and ast.get_docstring(one, clean=False) is not None:
                _mark(kinds, one.body[0], "docstrings")
        found.update(kinds)
    return found


def _mark(kinds: list[str], part: ast.stmt, kind: str) -> None:
    end = part.end_lineno or part.lineno
    kinds[part.lineno - 1 : end] = [kind] * (end - part.lineno + 1)


def _component(module: str) -> str:
    return ".".join(module.split(".")[:2])


def _layers(source: Path) -> set[int]:
    """Return the layers in the table of the tree's own test."""
    for statement in parsed(source / "tests" / "test_layers.py").body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) in ("FLOORS", "LAYERS"):
            return set(ast.literal_eval(statement.value).values())
    raise SystemExit("tests/test_layers.py has no table FLOORS or LAYERS")


def edges(files: Mapping[str, Path]) -> set[tuple[str, str]]:
    """Return which module imports which, including imports in functions and for type checkers."""
    known = frozenset(files)
    return {(name, other) for name, file in files.items() for other, _ in imported(name, file, known) if other in known}


def strongly_connected(files: Mapping[str, Path]) -> list[list[str]]:
    """Return the groups of modules that import each other in a cycle, deferred imports included (Kosaraju)."""
    after: dict[str, list[str]] = {name: [] for name in files}
    before: dict[str, list[str]] = {name: [] for name in files}
    for name, other in edges(files):
        if name != other:
            after[name].append(other)
            before[other].append(name)
    seen: set[str] = set()
    order = [name for start in files for name in _finished(start, after, seen)]
    seen.clear()
    groups = [list(_finished(start, before, seen)) for start in reversed(order)]
    return [group for group in groups if len(group) > 1]


def _finished(start: str, following: Mapping[str, Sequence[str]], seen: set[str]) -> Iterator[str]:
    """Yield what can be reached from the start and was not seen before, each after those that it leads to."""
    if start in seen:
        return
    seen.add(start)
    stack = [(start, iter(following[start]))]
    while stack:
        name, rest = stack[-1]
        new = next((one for one in rest if one not in seen), None)
        if new is None:
            stack.pop()
            yield name
        else:
            seen.add(new)
            stack.append((new, iter(following[new])))


def public_methods(files: Iterable[Path]) -> Iterator[tuple[int, str]]:
    """Yield how many public methods and properties each class defines itself; overloads and setters count once."""
    for file in files:
        for one in ast.walk(parsed(file)):
            if isinstance(one, ast.ClassDef):
                functions = [part for part in one.body if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef)]
                yield len({part.name for part in functions if not part.name.startswith("_")}), one.name


def long_functions(file: Path) -> int:
    """Count the functions with too many lines, without decorators and docstring."""
    return sum(
        _lines_of(one) > MOST_LINES_OF_A_FUNCTION
        for one in ast.walk(parsed(file))
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def _lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    first = function.body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    described = (first.end_lineno or 0) - first.lineno + 1 if is_docstring else 0
    return (function.end_lineno or 0) - function.lineno + 1 - described


def foreign_writes(file: Path) -> int:
    """Count the attributes that are set or deleted on anything but `self` and `cls`."""
    return sum(
        not (isinstance(one.value, ast.Name) and one.value.id in ("self", "cls"))
        for one in ast.walk(parsed(file))
        if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store | ast.Del)
    )


def anys(file: Path) -> int:
    """Count how often `Any` is used."""
    return sum(isinstance(one, ast.Name) and one.id == "Any" for one in ast.walk(parsed(file)))


def _count(kind: type[ast.AST], file: Path) -> int:
    return sum(isinstance(one, kind) for one in ast.walk(parsed(file)))


def comment_lines(file: Path) -> int:
    """Count the comments, each line of a longer one."""
    with file.open("rb") as lines:
        return sum(token.type == tokenize.COMMENT for token in tokenize.tokenize(lines.readline))


if __name__ == "__main__":
    sys.exit(main())
