"""`hfg convert TARGET OUT`: writes a graph, or a file of CS::APEX, as a graph file, or the schema of such files.

Depends on `target`, `show` and the files' floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hfg.base.whole import write_whole
from hfg.cli import completing, show
from hfg.cli.options import LoadFlags
from hfg.cli.target import SUFFIXES, import_from_here, load_graph
from hfg.errors import TargetError, UsageError
from hfg.files import apex, describe, save, schema, text_of, write
from hfg.graph import Graph


def convert(
    flags: LoadFlags,
    target: Annotated[
        str | None,
        typer.Argument(
            help="module:graph, file.py, file.py:graph, file.hfg.yaml or file.apex", autocompletion=completing.targets
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Argument(help="a file name that ends in .hfg.yaml; default: standard output")
    ] = None,
    json_schema: Annotated[
        bool,
        typer.Option(
            "--schema",
            help="Write the JSON schema of graph files, with all installed and allowed node types.",
        ),
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="For a CS::APEX file: report how each part was converted, as JSON.")
    ] = False,
) -> int:
    """Write a graph to a graph file. Fails without writing anything if part of the graph cannot be stored.

    For a CS::APEX file, it reports what is mapped, approximated and missing.
    """
    show.set_debug(flags.debug)
    if json_schema:
        if out is not None:
            raise TargetError("--schema needs no TARGET: write hfg convert --schema FILE, or leave FILE out")
        return _write_schema(target, flags.allow or ())
    if target is None:
        raise TargetError("there is no TARGET: write hfg convert graph.py graph.hfg.yaml")
    if target.endswith(SUFFIXES):
        return _import_apex(target, out, json)
    if json:
        raise TargetError("--json tells what became of a file of CS::APEX; leave it out")
    return _save(load_graph(target, flags.arg, flags.allow), out)


def _save(graph: Graph, out: Path | None) -> int:
    if out is None:
        show.write(text_of(describe(graph, beside=Path("graph.hfg.yaml"))))
        return 0
    try:
        save(graph, out)
    except UsageError as error:
        show.sentence(str(error))
        return 2
    return 0


def _import_apex(target: str, out: Path | None, json: bool) -> int:
    """Without OUT the document is the output, the report goes to standard error; with --json that is the output."""
    document, report = apex.read(target)
    try:
        if out is not None:
            write(document, out)
        elif not json:
            show.write(text_of(document))
    except UsageError as error:
        show.sentence(str(error))
        return 2
    if json:
        show.json(report)
    else:
        show.write(f"{report}\n", to_stderr=out is None)
    return 0


def _write_schema(file: str | None, allow: Sequence[str]) -> int:
    if allow:
        import_from_here(last=True)
    try:
        text = schema(types=True, allow=allow)
    except UsageError as error:
        raise TargetError(str(error)) from None
    if file is None:
        show.write(text)
        return 0
    try:
        write_whole(Path(file), lambda stream: stream.write(text.encode()))
    except OSError as error:
        show.sentence(f"{file} cannot be written: {error.strerror}")
        return 2
    return 0
