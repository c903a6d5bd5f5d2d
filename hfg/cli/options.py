"""Arguments and options that several verbs have; those of a run follow from their declaration."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any, get_type_hints

import typer

from hfg.cli import completing
from hfg.engine.runtime.settings import RunFields
from hfg.graph.structure.option import declared


class Clock(StrEnum):
    """The clocks a run can have."""

    real = "real"
    virtual = "virtual"


def _not_negative(seconds: float | None) -> float | None:
    if seconds is not None and seconds < 0:
        raise typer.BadParameter(f"seconds are not negative, got {seconds:g}")
    return seconds


TargetArgument = Annotated[
    str,
    typer.Argument(
        help="module:graph, file.py, file.py:graph, file.hfg.yaml or file.apex", autocompletion=completing.targets
    ),
]
ClockOption = Annotated[Clock, typer.Option(help="virtual: as fast as possible, and reproducible.")]
UntilOption = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", callback=_not_negative, help="Stop after this many seconds."),
]
ParamOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PATH=VALUE",
        help="Set a parameter, as in lookup.tolerance=0.2. Can be repeated.",
        autocompletion=completing.parameters,
    ),
]
ArgOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Pass an argument to the function that builds the graph, as in count=3. Can be repeated.",
    ),
]
AllowOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PACKAGE",
        help="Allow a graph file to use this module or package. Can be repeated.",
    ),
]
SettingsOption = Annotated[
    str | None,
    typer.Option(metavar="FILE", help="Settings of the realm (TOML): addresses of agents and other hosts."),
]
TableOption = Annotated[bool, typer.Option(help="Show a live table of nodes (on a terminal and the real clock).")]
DebugOption = Annotated[
    bool, typer.Option("--debug", help="Check values against port types; show hfg's own frames in tracebacks.")
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]
VerboseOption = Annotated[
    int, typer.Option("-v", "--verbose", count=True, help="Report each node; with -vv, each edge.")
]


def with_run_options(verb: Callable[..., int]) -> Callable[..., int]:
    """Add to a verb the flags that options of a run declare; it receives them by name, in `**options`."""
    signature = inspect.signature(verb)
    hints = get_type_hints(verb, include_extras=True)
    own = [one.replace(annotation=hints[one.name]) for one in signature.parameters.values() if one.name != "options"]
    flags = [
        inspect.Parameter(
            one.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=one.default,
            annotation=Annotated[one.type, typer.Option(one.option.flag, help=one.option.says.replace("`", ""))],
        )
        for one in declared(RunFields).values()
        if one.option.flag
    ]

    @functools.wraps(verb)
    def run(*arguments: Any, **named: Any) -> int:
        return verb(*arguments, **named)

    run.__dict__["__signature__"] = signature.replace(parameters=[*own, *flags])
    run.__annotations__ = {one.name: one.annotation for one in (*own, *flags)} | {"return": int}
    return run
