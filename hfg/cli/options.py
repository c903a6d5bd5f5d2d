"""Arguments and options that several verbs have, singly and in groups; those of a run follow from their declaration.

A verb takes a group as one argument; `with_flags` replaces it by the flags.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
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
MonitorOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PROPERTY",
        help="What must hold of the run, as in 'never(active(driving) & sent(drive.lamp, value == true))', or with a "
        "name, 'dark=never(...)'. If it is violated, the exit status is 1. Can be repeated.",
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
ForceOption = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]
VerboseOption = Annotated[
    int, typer.Option("-v", "--verbose", count=True, help="Report each node; with -vv, each edge.")
]


@dataclass(frozen=True, kw_only=True)
class LoadFlags:
    """How a graph is loaded."""

    arg: ArgOption = None
    allow: AllowOption = None
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False


@dataclass(frozen=True, kw_only=True)
class RunFlags:
    """How a graph is loaded and run."""

    clock: Annotated[Clock, typer.Option(help="virtual: as fast as possible, and reproducible.")] = Clock.real
    until: UntilOption = None
    param: ParamOption = None
    arg: ArgOption = None
    allow: AllowOption = None
    debug: Annotated[
        bool, typer.Option("--debug", help="Check values against port types; show hfg's own frames in tracebacks.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class ViewFlags:
    """Viewers of a run."""

    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Let Foxglove show the run; the address is printed. It changes nothing.")
    ] = False
    foxglove_at: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS:PORT", help="Do so at this address; default: the first free port from 8765."),
    ] = None
    foxglove_origin: Annotated[
        list[str] | None,
        typer.Option(metavar="ORIGIN", help="Another web page that may look, by its origin. Can be repeated."),
    ] = None


def with_flags(verb: Callable[..., int]) -> Callable[..., int]:
    """Replace each group of options that a verb takes by a flag for each of them."""
    signature, hints = inspect.signature(verb), get_type_hints(verb, include_extras=True)
    groups = {
        name: (hint, list(_flags(hint)))
        for name, hint in hints.items()
        if hint in (LoadFlags, RunFlags, ViewFlags, RunFields)
    }
    own = [one.replace(annotation=hints[name], kind=one.KEYWORD_ONLY) for name, one in signature.parameters.items()]
    spread = [flag for one in own for flag in (groups[one.name][1] if one.name in groups else [one])]

    @functools.wraps(verb)
    def run(**named: Any) -> int:
        for name, (group, flags) in groups.items():
            named[name] = group(**{flag.name: named.pop(flag.name) for flag in flags})
        return verb(**named)

    run.__dict__["__signature__"] = signature.replace(parameters=spread)
    run.__annotations__ = {one.name: one.annotation for one in spread} | {"return": int}
    return run


def _flags(group: Any) -> Iterator[inspect.Parameter]:
    """Yield the flags of a group; of the options of a run, those that declare one."""
    if group is not RunFields:
        hints = get_type_hints(group, include_extras=True)
        for field in fields(group):
            yield _flag(field.name, hints[field.name], field.default)
        return
    for one in declared(RunFields).values():
        if one.option.flag:
            how = typer.Option(one.option.flag, help=one.option.says.replace("`", ""))
            yield _flag(one.name, Annotated[one.type, how], one.default)


def _flag(name: str, hint: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)
