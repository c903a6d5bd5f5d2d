"""Opens type hints: what is inside of aliases, new names and metadata, and which limits they say."""

from __future__ import annotations

import typing
from typing import Any

from hfg.base.limits import limits_of

__all__ = ["opened"]


def opened(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """Take aliases, new names and metadata off; keep the limits."""
    limits: tuple[Any, ...] = ()
    while True:
        if hasattr(hint, "__metadata__"):
            limits += limits_of(hint.__metadata__)
            hint = typing.get_args(hint)[0]
        elif type(hint).__name__ == "TypeAliasType":
            hint = hint.__value__
        elif isinstance(hint, typing.NewType):
            hint = hint.__supertype__
        elif isinstance(hint, typing.TypeVar):
            hint = typing.Union[hint.__constraints__] if hint.__constraints__ else hint.__bound__ or Any  # noqa: UP007
        elif typing.get_origin(hint) in (typing.Required, typing.NotRequired, typing.Final, typing.ClassVar):
            hint = typing.get_args(hint)[0]
        else:
            return hint, limits
