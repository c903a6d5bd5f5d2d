"""`hfg compare A B`: shows the differences of two runs, or of two graphs. Depends on `search` and `hfg.comparing`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from hfg.cli import search, show
from hfg.cli.options import AllowOption, ArgOption, ParamOption, UntilOption
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.comparing import Side, page, read_recording, read_report, run_both
from hfg.comparing import compare as compare_sides
from hfg.graph import Graph
from hfg.tuning.scores import ScoreLike


def compare(
    a: Annotated[str, typer.Argument(help="a recording (.mcap), a report (.json), or a graph to run in virtual time")],
    b: Annotated[str, typer.Argument(help="the other one")],
    score: Annotated[
        list[str] | None,
        typer.Option(help="A score: node.port.rms, node.state, an output of the graph, or module:function."),
    ] = None,
    seeds: search.SeedsOption = None,
    seed_parameter: search.SeedParameterOption = None,
    constraint: search.ConstraintOption = None,
    until: UntilOption = None,
    param: ParamOption = None,
    param_b: Annotated[
        list[str] | None, typer.Option(metavar="PATH=VALUE", help="Set a parameter in B only. Can be repeated.")
    ] = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    processes: search.ProcessesOption = None,
    patience: search.PatienceOption = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the comparison as an HTML page.")] = None,
    exit_code: Annotated[bool, typer.Option("--exit-code", help="Exit with 1 if anything differs.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the comparison as JSON.")] = False,
) -> int:
    """Compare two runs: scores, the first token that differs, counts, and when nodes were active."""
    search.need_place(report)
    with search.usage(), TemporaryDirectory(prefix="hfg-compare-") as folder, search.progress(None) as tell:
        scores = search.scores_of(score)
        sides = [_read(name, scores) for name in (a, b)]
        params = [param or [], [*(param or []), *(param_b or [])]]
        missing = [number for number, side in enumerate(sides) if side is None]
        ran = run_both(
            [(a, b)[number] for number in missing],
            [partial(_built, (a, b)[number], arg, allow, params[number]) for number in missing],
            Path(folder),
            scores=scores,
            seeds=search.seeds_of(seeds),
            seed_parameter=seed_parameter,
            constraints=search.constraints_of(constraint),
            until_s=until,
            processes=processes,
            patience_s=patience,
            told=lambda run: tell(run, ""),
        )
        one, other = (side or ran.pop(0) for side in sides)
        found = compare_sides(one, other)
    if report is not None:
        search.written(report, page(found))
    if json:
        show.json(found)
    else:
        show.write("\n".join(found.lines()) + "\n")
    return int(exit_code and found.differs)


def _read(name: str, scores: Sequence[ScoreLike]) -> Side | None:
    """Read a recording or a report; nothing if the name is of a graph."""
    if name.endswith(".mcap"):
        return read_recording(Path(name), scores=scores)
    return read_report(Path(name)) if name.endswith(".json") else None


def _built(target: str, arg: Sequence[str] | None, allow: Sequence[str] | None, param: Sequence[str]) -> Graph:
    graph = load_graph(target, arg or [], allow)
    set_parameters(graph, param)
    return graph
