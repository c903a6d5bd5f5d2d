"""Vectors of ports: any number of ports of one kind, for mergers, barriers and pools.

A vector is declared once. When a node is made, each of its ports is a port of its own, "values[0]", "values[1]" ...,
with its own edges and its own place in every rule. Depends on the ports of each kind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, Generic, Self, TypeVar, overload

import msgspec
from typing_extensions import TypeForm

from hfg.errors import DeclarationError, UsageError
from hfg.ports.base import Kind, Owner, path_of
from hfg.ports.events import EventPort
from hfg.ports.inputs import InputPort
from hfg.ports.outputs import OutputPort
from hfg.ports.slots import SlotPort

__all__ = ["Events", "Inputs", "Outputs", "PortVector", "Slots", "Vector", "VectorIndexError", "VectorSpec", "element"]

T = TypeVar("T")
P_co = TypeVar("P_co", covariant=True)


def element(name: str, number: int) -> str:
    """Return the name of one port of a vector."""
    return f"{name}[{number}]"


class VectorSpec(msgspec.Struct, frozen=True):
    """The description of a vector of ports.

    Attributes:
      kind: kind of each of its ports.
      type: type of each of its ports.
      size: the number of ports; for a type, the default number, or None: the node is made with it.
      like: the vector whose size this one always has, or "".
    """

    name: str
    kind: Kind
    type: Any
    size: int | None = None
    like: str = ""
    optional: bool = False
    default: Any = None


class PortVector(Sequence[P_co], Generic[P_co]):
    """The ports of a vector, in order; `node.values[0]` is a port like any other."""

    __slots__ = ("_node", "_spec")

    def __init__(self, node: Any, spec: VectorSpec) -> None:
        self._node = node
        self._spec = spec

    def __len__(self) -> int:
        return self._spec.size or 0

    @overload
    def __getitem__(self, number: int) -> P_co: ...
    @overload
    def __getitem__(self, number: slice) -> list[P_co]: ...
    def __getitem__(self, number: int | slice) -> Any:
        spec, count = self._spec, len(self)
        if isinstance(number, slice):
            return [self[one] for one in range(*number.indices(count))]
        if not -count <= number < count:
            raise VectorIndexError(
                f'"{path_of(self._node, spec.name)}" has {count} {spec.kind}s, numbered from 0 to {count - 1}, got '
                f"{number!r}; make the node with more, as in {spec.name}={count + 1}"
            )
        return self._node._port(spec.kind, element(spec.name, number % count))

    def __iter__(self) -> Iterator[P_co]:
        return (self[number] for number in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} {self._spec.kind}s {path_of(self._node, self._spec.name)}>"

    @property
    def path(self) -> str:
        """The address of the vector; the address of one of its ports is followed by the port's number."""
        return path_of(self._node, self._spec.name)


class VectorIndexError(UsageError, IndexError):
    """A vector has no port with this number. It is an IndexError because ports are indexed like a list."""


class Vector(Generic[T]):
    """Common part of declarations of vectors; `size` is a number, another vector's name or None."""

    kind: ClassVar[Kind]

    def __init__(self, type: Any, size: Any) -> None:  # noqa: A002 - the word users know
        is_number = isinstance(size, int) and not isinstance(size, bool) and size >= 1
        if size is not None and not isinstance(size, str) and not is_number:
            raise DeclarationError(
                f"hfg.{self.__class__.__name__} needs its size, 1 or more, got {size!r}; write "
                f"hfg.{self.__class__.__name__}(int, 3), or omit it and make the node with it"
            )
        self.type: Any = type
        self.size = size
        self.optional = False
        self.default: Any = None
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    def spec(self) -> VectorSpec:
        """Return the declaration as plain data."""
        like = self.size if isinstance(self.size, str) else ""
        size = self.size if isinstance(self.size, int) else None
        return VectorSpec(self.name, self.kind, self.type, size, like, self.optional, self.default)

    def _of(self, node: Any) -> Any:
        return self if node is None else PortVector(node, node._type.vectors[self.name])

    def __repr__(self) -> str:
        return f"<{self.__class__.__name__} {self.name}>"


class Inputs(Vector[T]):
    """Declare a vector of inputs; `process` gets a list with one value for each, or takes them as `*values`.

    Args:
      type: type of the values at each input.
      size: how many there are unless the node is made with another number, `Merge(values=5)`; without a size, the
        number must be given when the node is made. The name of another vector means its size.
      optional: the node also fires when some are not connected or hold nothing; the list then holds `default` there.
      default: value for absent inputs; see `optional`.

    Examples:
      >>> import hfg
      >>> class Largest(hfg.Node):
      ...     values = hfg.Inputs(int)
      ...     def process(self, values: list[int]) -> int:
      ...         return max(values)
      >>> [port.name for port in Largest(values=2).values]
      ['values[0]', 'values[1]']
    """

    kind: ClassVar[Kind] = "input"

    def __init__(
        self,
        type: TypeForm[T],  # noqa: A002
        size: int | str | None = None,
        *,
        optional: bool = False,
        default: T | None = None,
    ) -> None:
        super().__init__(type, size)
        if default is not None and not optional:
            raise DeclarationError(
                f"inputs with the default {default!r} must be optional: write hfg.Inputs(..., optional=True, "
                f"default={default!r})"
            )
        self.optional, self.default = optional, default

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> PortVector[InputPort[T]]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self._of(node)


class Outputs(Vector[T]):
    """Declare a vector of outputs; write to one with `self.parts[0].send(value)`, or return a list for all.

    Args:
      type: type of the values that each sends.
      size: as for `Inputs`.
    """

    kind: ClassVar[Kind] = "output"

    def __init__(self, type: TypeForm[T], size: int | str | None = None) -> None:  # noqa: A002
        super().__init__(type, size)

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> PortVector[OutputPort[T]]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self._of(node)


class Events(Vector[T]):
    """Declare a vector of events; trigger one with `self.done[0].trigger(value)`.

    Args:
      type: type of the signals' values; None: signals without a value.
      size: as for `Inputs`.
    """

    kind: ClassVar[Kind] = "event"

    def __init__(self, type: TypeForm[T], size: int | str | None = None) -> None:  # noqa: A002
        super().__init__(type, size)

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> PortVector[EventPort[T]]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self._of(node)


class Slots(Vector[T]):
    """Declare a vector of slots. The handler gets the number of the slot, then the value if it takes one.

    In a subgraph it needs no handler: `asks = hfg.Slots(int, 3)` is a vector of relays.

    Args:
      type: type of the values at each slot.
      size: as for `Inputs`.

    Examples:
      >>> import hfg
      >>> class Desk(hfg.Node):
      ...     served = hfg.Event(str)
      ...     @hfg.Slots(str, 3)
      ...     def ask(self, number: int, question: str) -> None:
      ...         self.served.trigger(f"{question} at window {number}")
      >>> Desk().ask[1]
      <slot desk.ask[1]>
    """

    kind: ClassVar[Kind] = "slot"

    def __init__(self, type: TypeForm[T], size: int | str | None = None) -> None:  # noqa: A002
        super().__init__(type, size)
        self.handler: Callable[..., Any] | None = None

    def __call__(self, handler: Callable[..., Any]) -> Self:
        """Decorate the handler."""
        if not callable(handler):
            raise DeclarationError(f"hfg.Slots is for a method, got {handler!r:.80}; write it above the handler")
        made = self.__class__(self.type, self.size)
        made.handler = handler
        made.__doc__ = getattr(handler, "__doc__", None)
        return made

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> PortVector[SlotPort[T]]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self._of(node)
