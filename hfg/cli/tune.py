"""`hfg tune TARGET`: searches for the parameters that make a score best. Depends on `search` and `hfg.tuning`."""

from __future__ import annotations

import operator
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import search, show
from hfg.cli.options import AllowOption, ArgOption, TargetArgument, UntilOption
from hfg.errors import TargetError
from hfg.tuning import Confirmation, Evaluation, Mean, Told, Tuning
from hfg.tuning import tune as tune_graph


def tune(
    target: TargetArgument,
    parameter: Annotated[
        list[str],
        typer.Option(
            "--parameter",
            "-p",
            metavar="PATH=RANGE",
            help="What to search: a.gain=0.1..2, a.gain=0.1..10:log, a.mode=fast,good. Without a range, the limits of "
            "the declaration. Can be repeated.",
        ),
    ],
    minimize: Annotated[
        list[str] | None,
        typer.Option(help="A score: node.port.rms, node.state, an output of the graph, or module:function."),
    ] = None,
    maximize: Annotated[list[str] | None, typer.Option(help="A score that should be large.")] = None,
    seeds: search.SeedsOption = None,
    seed_parameter: search.SeedParameterOption = None,
    constraint: search.ConstraintOption = None,
    method: Annotated[str, typer.Option(help="de, cma, tpe, grid or random.")] = "de",
    evaluations: Annotated[int, typer.Option(min=1, help="How many candidates at most.")] = 200,
    batch: Annotated[int | None, typer.Option(min=1, help="Candidates of a generation.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the method.")] = 1,
    until: UntilOption = None,
    processes: search.ProcessesOption = None,
    patience: search.PatienceOption = None,
    journal: search.JournalOption = None,
    confirm: Annotated[
        str | None, typer.Option(metavar="LIST", help="Afterwards, compare with the values before on these new seeds.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a drawing of the search as SVG.")] = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON.")] = False,
) -> int:
    """Search for the parameters of a graph that make a score smallest or largest."""
    search.need_place(plot)
    search.need_place(journal)
    every = search.seeds_of(seeds)
    again = search.seeds_of(confirm)
    if set(every) & set(again):
        raise TargetError("--confirm names seeds that the search uses, too: name others")
    with search.usage(), search.progress(evaluations * max(len(every), 1)) as tell:
        best = _Best(tell, smaller=bool(minimize))
        found = tune_graph(
            search.builder(target, arg, allow),
            parameter,
            minimize=search.scores_of(minimize),
            maximize=search.scores_of(maximize),
            seeds=every,
            seed_parameter=seed_parameter,
            constraints=search.constraints_of(constraint),
            method=method,
            evaluations=evaluations,
            batch=batch,
            seed=seed,
            until_s=until,
            processes=processes,
            journal=journal,
            patience_s=patience,
            tell=best.take,
            told=best.tell,
        )
        confirmed = found.confirm(again) if again and not found.best.failed else None
    if plot is not None:
        search.written(plot, found.plot())
    if json:
        show.json(_data(found, confirmed))
    else:
        show.write(f"{found}\n")
        if confirmed is not None:
            show.write(f"{_said(found, confirmed)}\n")
        show.sentence(str(found.effort))
    return 1 if found.best.failed else 0


class _Best:
    """The best candidate so far, by the first score; the progress bar shows it."""

    def __init__(self, tell: Callable[[Told, str], None], *, smaller: bool) -> None:
        self._tell = tell
        self._better = operator.lt if smaller else operator.gt
        self._mean: Mean | None = None

    def take(self, one: Evaluation) -> None:
        """Take in a candidate."""
        if not one.failed and (self._mean is None or self._better(one.means[0].value, self._mean.value)):
            self._mean = one.means[0]

    def tell(self, run: Told) -> None:
        """Move the bar on by a run."""
        self._tell(run, "" if self._mean is None else f"best so far: {self._mean}")


def _said(found: Tuning, confirmed: Confirmation) -> str:
    if not confirmed.gains:
        return f"not confirmed: {confirmed.before.why or confirmed.best.why}"
    gains = ", ".join(f"{score.name} by {gain}" for score, gain in zip(found.scores, confirmed.gains, strict=True))
    certain = "outside the noise" if confirmed.is_certain else "within the noise"
    return f"on {len(confirmed.best.runs)} new seeds better in {gains}: {certain}"


def _data(found: Tuning, confirmed: Confirmation | None) -> dict[str, object]:
    def plain(one: Evaluation) -> dict[str, object]:
        scores = {score.name: list(mean) for score, mean in zip(found.scores, one.means, strict=False)}
        return {"candidate": one.number, "values": found.space.as_data(one.values), "scores": scores, "why": one.why}

    return {
        "best": plain(found.best),
        "before": plain(found.before),
        "front": [plain(one) for one in found.front],
        "outcomes": found.outcomes,
        "candidates": len(found.evaluations),
        "gains": [list(gain) for gain in confirmed.gains] if confirmed is not None else None,
    }
