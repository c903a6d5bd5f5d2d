"""The list of verbs. The module of a verb is imported when the verb is used, because most modules import much.

A module offers functions with the names of its verbs, or `verbs`, which has several below one name. The help
texts in the list are their docstrings, taken from the compiled modules.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Mapping
from importlib import import_module
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any, Final

import typer
import typer.core
import typer.main

_MODULES: Final[Mapping[str, str]] = {
    **{name: name for name in ("run", "check", "convert", "draw", "nodes", "tap", "record", "play", "info", "recover")},
    **{name: name for name in ("top", "agent", "part")},
    **{name: name for name in ("tune", "sweep", "compare")},
    **dict.fromkeys(("deploy", "ps", "logs", "restart", "stop"), "runs"),
    **{name: name for name in ("new", "keys", "studio", "ros")},
    **dict.fromkeys(("set", "edit", "undo", "redo", "reload", "pause", "resume", "step", "trigger"), "steer"),
}


class Verbs(typer.core.TyperGroup):
    """The group of all verbs."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name in _MODULES:
            self.add_command(_Verb(name, help=_said(name), rich_markup_mode=self.rich_markup_mode))


class _Verb(typer.core.TyperCommand):
    """Stands for a verb, and imports it to run it."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **settings: Any) -> Any:
        return self._imported().make_context(info_name, args, *rest, **settings)

    def _imported(self) -> Any:
        name = str(self.name)
        module = import_module(f"{__package__}.{_MODULES[name]}")
        holder = typer.Typer(rich_markup_mode=self.rich_markup_mode, pretty_exceptions_enable=False)
        if hasattr(module, "verbs"):
            holder.add_typer(module.verbs, name=name)
        else:
            from hfg.cli.options import with_flags  # here, because it needs the engine's options

            holder.command(name)(with_flags(getattr(module, name)))
        return typer.main.get_group(holder).commands[name]


def _said(name: str) -> str | None:
    for one in _compiled(_MODULES[name]).co_consts:
        if isinstance(one, CodeType) and one.co_name == name:
            said = one.co_consts[0] if one.co_consts else None
            return inspect.cleandoc(said) if isinstance(said, str) else None
    return None


@functools.cache
def _compiled(module: str) -> CodeType:
    """Return a module's code as Python caches it, without running it."""
    name = f"{__package__}.{module}"
    code = SourceFileLoader(name, str(Path(__file__).with_name(f"{module}.py"))).get_code(name)
    assert code is not None
    return code
