"""Slots: asynchronous reception, one handler call per signal (rules F6, F9). Depends on `base`."""

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
    """Means "not given" where None has a meaning of its own."""

    def __repr__(self) -> str:
        return "UNSET"


UNSET: Any = _Unset()


class SlotPort(Port, Target[T]):
    """The slot of one node.

    Calling it runs the handler outside a run and without the run's rules, for tests and for `super()`.
    """

    __slots__ = ("_inner",)

    kind: ClassVar[Kind] = "slot"
    _inner: InnerSource[T]

    def __call__(self, *value: Any) -> Any:
        """Run the handler with the arguments. Return its result, which is a coroutine if the handler is async.

        Raises:
          UsageError: the slot has no handler of its own: an automatic one (rule A9), a trigger's or a subgraph's.
        """
        handler = self.node._handler(self.name)
        if handler is None:
            raise UsageError(f'"{self.path}" has no handler to call: connect an event to it, or use run.trigger(slot)')
        return handler(*value)

    @property
    def inner(self) -> InnerSource[T]:
        """Its side inside a subgraph."""
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
    """Effect of `@hfg.slot(while_active=True)` on a method."""

    @overload
    def __call__(self, handler: Callable[[Self_], Any], /) -> Slot[object]: ...
    @overload
    def __call__(self, handler: Callable[[Self_, Token[T]], Any], /) -> Slot[T]: ...
    @overload
    def __call__(self, handler: Callable[[Self_, T], Any], /) -> Slot[T]: ...


@overload
def slot(handler: Callable[[Self_], Any], /) -> Slot[object]: ...
@overload  # a T that may be anything cannot be solved for, so it is spelled out
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

    The annotation of the method's argument is the slot's type. An argument annotated `hfg.Token[int]` receives the
    token; a method without an argument accepts any signal. `@hfg.slot(type=...)` sets the type explicitly.

    Args:
      handler: the method.
      type: type of the values.
      while_active: the slot accepts signals only while its node is active, or about to become active. Other signals are
        processed at once, without calling the handler (rule T4). So a signal to many nodes costs only as much as its
        active receivers.
    """
    if handler is not None and not callable(handler):
        raise DeclarationError(f"hfg.slot is for a method, got {handler!r:.80}; write @hfg.slot or hfg.slot(type=int)")
    return Slot(handler, type, while_active)
