"""What the shell offers at the Tab key: targets, ports and parameters.

The names of graphs are read from the text of a file, which is not run. Ports and parameters are known only when the
graph is built, so there the target is imported, in silence; whatever goes wrong means no offer. A shell puts an offer
into the command line as it is, and files and the names in them may be of others: what the shell would take for more
than a word, such as `$(...)`, is not offered (rule L4). Depends on `target`.
"""

from __future__ import annotations

import ast
import io
import re
from collections.abc import Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Final

import typer

from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.base.whole import read_plain
from hfg.cli.target import load_graph, names_code
from hfg.graph import Graph, Subgraph
from hfg.nodetypes.node import Node

_PLAIN: Final = re.compile(r"[\w./:=,@%+][\w./:=,@%+~\[\]-]*")


def targets(incomplete: str) -> list[str]:
    """Python files, and the graphs of the one that is named."""
    name, colon, _ = incomplete.rpartition(":")
    file = Path(name if colon else incomplete)
    if file.suffix == ".py" and file.is_file():
        return _plain(one for one in (f"{file}:{graph}" for graph in _graphs_in(file)) if one.startswith(incomplete))
    folder = Path(incomplete) if incomplete.endswith("/") else file.parent
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return []
    offers = [f"{one}/" if one.is_dir() else str(one) for one in found if one.is_dir() or one.suffix == ".py"]
    return _plain(one for one in offers if one.startswith(incomplete) and not Path(one).name.startswith((".", "__")))


def ports(ctx: typer.Context, incomplete: str) -> list[str]:
    """Outputs, events, inputs and slots of the target's nodes."""
    return _plain(
        one
        for path, node in _nodes(ctx)
        for kind in (node.ports.outputs, node.ports.events, node.ports.inputs, node.ports.slots)
        for one in (f"{path}.{name}" for name in kind)
        if one.startswith(incomplete)
    )


def parameters(ctx: typer.Context, incomplete: str) -> list[str]:
    """Parameters of the target's nodes, as the beginning of an assignment."""
    return _plain(
        one
        for path, node in _nodes(ctx)
        for one in (f"{path}.{name}=" for name in node.ports.parameters)
        if one.startswith(incomplete)
    )


def _plain(offers: Iterable[str]) -> list[str]:
    return [one for one in offers if _PLAIN.fullmatch(one)]


def _nodes(ctx: typer.Context) -> list[tuple[str, Node]]:
    # An option without its value yet, as here, keeps typer from sorting out what stands before it.
    target = ctx.params.get("target") or next(iter(ctx.args), "")
    if not names_code(target):  # such as the name of a run: a module that lies here and is called so is not imported
        return []
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            return list(_inside(load_graph(target), ""))
    except Exception:  # a target that does not work completes to nothing
        return []


def _inside(graph: Graph, before: str) -> Iterator[tuple[str, Node]]:
    for name, node in graph.nodes.items():
        yield before + name, node
        if isinstance(node, Subgraph):
            yield from _inside(node._graph, f"{before}{name}/")


def _graphs_in(file: Path) -> list[str]:
    """Names in a file that are graphs, or functions that promise one, as far as its text shows."""
    try:
        body = ast.parse(read_plain(file, GRAPH_FILE_BYTES.most)).body
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    names = []
    for one in body:
        if isinstance(one, ast.FunctionDef) and one.returns is not None and _last_word(one.returns) == "Graph":
            names.append(one.name)
        elif isinstance(one, ast.Assign) and isinstance(one.value, ast.Call) and _last_word(one.value.func) == "Graph":
            names += [target.id for target in one.targets if isinstance(target, ast.Name)]
    return [name for name in names if not name.startswith("_")]


def _last_word(expression: ast.expr) -> str:
    return ast.unparse(expression).strip("'\"").rpartition(".")[2]
