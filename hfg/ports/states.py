"""State: attributes of a node that belong to one run and are reset before `setup()`. Depends on errors."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar, overload

from hfg.errors import DeclarationError

__all__ = ["State"]

T = TypeVar("T")


class State(Generic[T]):
    """Declare a field of a node's state; on the node it is a plain attribute.

    Args:
      default: its value at the start of every run, copied each time, so that lists are safe.
      factory: makes that value instead. With its item type, `hfg.State(factory=list[int])`, the field needs no
        annotation; a plain `list` does not tell type checkers the item type.

    Examples:
      >>> import hfg
      >>> class Seen(hfg.Node):
      ...     names = hfg.State(factory=dict[str, int])
      ...     total = hfg.State(0)
      >>> Seen().names
      {}
    """

    @overload
    def __init__(self, default: T) -> None: ...
    @overload
    def __init__(self, *, factory: Callable[[], T]) -> None: ...
    def __init__(self, *default: Any, factory: Callable[[], Any] | None = None, **named: Any) -> None:
        if "default" in named:
            default += (named.pop("default"),)
        if named or len(default) + (factory is not None) != 1:
            raise DeclarationError(
                "hfg.State takes either one default or factory=: write hfg.State(0) or hfg.State(factory=list[int])"
            )
        self.default = default
        self.factory = factory
        self.name = ""

    def fresh(self) -> T:
        """Return the value for the start of a run."""
        made: T = copy.deepcopy(self.default[0]) if self.factory is None else self.factory()
        return made

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: object, owner: Any) -> T: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        if node is None:
            return self
        value = node.__dict__[self.name] = self.fresh()
        return value

    if TYPE_CHECKING:  # at run time the field is in the instance dict, where reading and writing need no call

        def __set__(self, node: object, value: T) -> None: ...
