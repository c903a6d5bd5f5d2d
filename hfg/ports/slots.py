"""Slots: asynchronous reception, one call of a handler for each signal (rules F6, F9). Stands on `base`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar, overload

from typing_extensions import TypeForm

from hfg.base.token import Token
from hfg.errors import DeclarationError, UsageError
from hfg.ports.base import Kind, Owner, Port, Target
from hfg.ports.relays import InnerSource, inner_source

__all__ = ["UNSET", "Slot", "SlotPort", "slot"]

T = TypeVar("T")
Self_ = TypeVar("Self_")


class _Unset:
    """Stands for "not given" where None means something."""

    def __repr__(self) -> str:
        return "UNSET"


UNSET: Any = _Unset()


class SlotPort(Port, Target[T]):
    """The slot of one node.

    Calling it runs the handler, without a run and without its rules, for tests and for `super()`.
    """

    __slots__ = ("_inner",)

    kind: ClassVar[Kind] = "slot"
    _inner: InnerSource[T]

    def __call__(self, *value: Any) -> Any:
        """Run the handler with what is given; an async handler's coroutine is handed back.

        Raises:
          UsageError: the slot has no handler of its own: an automatic one (rule A9), a trigger's or a subgraph's.
        """
        handler = self.node._handler(self.name)
        if handler is None:
            raise UsageError(f'"{self.path}" has no handler to call: connect an event to it, or use run.trigger(slot)')
        return handler(*value)

    @property
    def inner(self) -> InnerSource[T]:
        """Its side that looks into a subgraph."""
        try:
            return self._inner
        except AttributeError:
            self._inner = inner_source(self)
            return self._inner


class Slot(Generic[T]):
    """A declared slot; made by `slot`.

    In a subgraph it needs no handler: `begin = hfg.slot(type=int)` is a relay.
    """

    kind: ClassVar[Kind] = "slot"

    def __init__(
        self,
        handler: Callable[..., Any] | None = None,
        type: Any = UNSET,  # noqa: A002
        while_active: bool = False,
    ) -> None:
        self.handler = handler
        self.type = type
        self.while_active = while_active
        self.name = ""
        self.__doc__ = getattr(handler, "__doc__", None)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    def __call__(self, handler: Callable[..., Any]) -> Slot[T]:
        """Decorate the handler, for `@hfg.slot(type=...)`."""
        return Slot(handler, self.type, self.while_active)

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> SlotPort[T]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        if node is None:
            return self
        if (
            self.handler is not None and node._type.declared.get(self.name) is not self
        ):  # reached by super(): another slot has its place
            return self.handler.__get__(node)
        return node._port("slot", self.name)

    def __repr__(self) -> str:
        return f"<Slot {self.name}>"


class _WhileActive(Protocol):
    """What `@hfg.slot(while_active=True)` does to a method."""

    @overload
    def __call__(self, handler: Callable[[Self_], Any], /) -> Slot[object]: ...
    @overload
    def __call__(self, handler: Callable[[Self_, Token[T]], Any], /) -> Slot[T]: ...
    @overload
    def __call__(self, handler: Callable[[Self_, T], Any], /) -> Slot[T]: ...


@overload
def slot(handler: Callable[[Self_], Any], /) -> Slot[object]: ...
@overload  # a T that may be anything cannot be solved for, so it is said
def slot(handler: Callable[[Self_, Token[object]], Any], /) -> Slot[object]: ...
@overload
def slot(handler: Callable[[Self_, Token[T]], Any], /) -> Slot[T]: ...
@overload
def slot(handler: Callable[[Self_, T], Any], /) -> Slot[T]: ...
@overload
def slot(*, type: TypeForm[T], while_active: bool = False) -> Slot[T]: ...
@overload
def slot(*, while_active: bool) -> _WhileActive: ...
def slot(
    handler: Callable[..., Any] | None = None,
    /,
    *,
    type: Any = UNSET,  # noqa: A002
    while_active: bool = False,
) -> Any:
    """Make a method the handler of a slot of the same name.

    The annotation of its argument is the slot's type; annotated `hfg.Token[int]` it gets the token; without an argument
    it takes any signal. `@hfg.slot(type=...)` says the type itself.

    Args:
      handler: the method.
      type: of the values.
      while_active: it listens only while its node is active, or about to be: what comes else is processed at once,
        and the handler is not called (rule T4). So a signal to many nodes costs what those cost that are active.
    """
    if handler is not None and not callable(handler):
        raise DeclarationError(f"hfg.slot is for a method, got {handler!r:.80}; write @hfg.slot or hfg.slot(type=int)")
    return Slot(handler, type, while_active)
