"""Inputs: synchronous reception, one token per firing (rules P2, F1). Depends on `base`."""

from __future__ import annotations

from typing import Any, ClassVar, Generic, Self, TypeVar, overload

from typing_extensions import TypeForm

from hfg.errors import DeclarationError
from hfg.ports.base import Kind, Owner, Port, Target
from hfg.ports.relays import InnerSource, inner_source

__all__ = ["Input", "InputPort"]

T = TypeVar("T")


class InputPort(Port, Target[T]):
    """The input of one node."""

    __slots__ = ("_inner",)

    kind: ClassVar[Kind] = "input"
    _inner: InnerSource[T]

    @property
    def inner(self) -> InnerSource[T]:
        """Its side inside a subgraph."""
        try:
            return self._inner
        except AttributeError:
            self._inner = inner_source(self)
            return self._inner


class Input(Generic[T]):
    """Declare an input in a class body.

    Args:
      type: type of the values, any type hint.
      optional: the node also fires when the input is not connected or holds nothing; `process` then gets `default`
        (rule P6).
      default: passed to `process` when an optional input is absent.
    """

    kind: ClassVar[Kind] = "input"

    def __init__(self, type: TypeForm[T], *, optional: bool = False, default: T | None = None) -> None:  # noqa: A002
        if default is not None and not optional:
            raise DeclarationError(
                f"an input with the default {default!r} must be optional: write hfg.Input(..., optional=True, "
                f"default={default!r})"
            )
        self.type: Any = type
        self.inferred = False  # read from a function instead of a class body
        self.optional = optional
        self.default = default
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> InputPort[T]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self if node is None else node._port("input", self.name)

    def __repr__(self) -> str:
        return f"<Input {self.name}>"
