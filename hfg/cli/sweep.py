"""`hfg sweep TARGET`: a table of scores for combinations of values, faults and seeds. Depends on `search`."""

from __future__ import annotations

from typing import Annotated

import typer

from hfg.cli import search, show
from hfg.cli.options import AllowOption, ArgOption, TargetArgument, UntilOption
from hfg.tuning import sweep as sweep_graph


def sweep(
    target: TargetArgument,
    score: Annotated[
        list[str],
        typer.Option(help="A score: node.port.rms, node.state, an output of the graph, or module:function."),
    ],
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter", "-p", metavar="PATH=VALUES", help="Values: a.gain=1,2,5 or a.gain=1..5/9. Can be repeated."
        ),
    ] = None,
    seeds: search.SeedsOption = None,
    seed_parameter: search.SeedParameterOption = None,
    fault: search.FaultOption = None,
    constraint: search.ConstraintOption = None,
    until: UntilOption = None,
    processes: search.ProcessesOption = None,
    patience: search.PatienceOption = None,
    journal: search.JournalOption = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    json: Annotated[bool, typer.Option("--json", help="Write the table as JSON.")] = False,
) -> int:
    """Run a graph with every combination of values, faults and seeds; show means with 95 % confidence intervals."""
    search.need_place(journal)
    with search.usage(), search.progress(None) as tell:
        found = sweep_graph(
            search.builder(target, arg, allow),
            parameter or [],
            scores=search.scores_of(score),
            seeds=search.seeds_of(seeds),
            seed_parameter=seed_parameter,
            faults=fault or [],
            constraints=search.constraints_of(constraint),
            until_s=until,
            processes=processes,
            journal=journal,
            patience_s=patience,
            told=lambda run: tell(run, ""),
        )
    if json:
        show.json(found.as_data())
    else:
        show.table(target, found.heads, found.cells())
        show.sentence(str(found.effort))
    return 0
