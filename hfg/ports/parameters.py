"""Parameters: values set when a node is made and by tokens (rule P8), within limits.

Stands on `base`, `types` and annotated-types.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Final, Generic, Self, TypeVar, cast, overload

import annotated_types
import msgspec
from typing_extensions import TypeForm

from hfg.errors import DeclarationError, UsageError
from hfg.ports.base import Kind, Owner, Port, Relaying, Source, Target
from hfg.types import accepts, describe

__all__ = ["REQUIRED", "Parameter", "ParameterPort", "ParameterSpec", "limits_of"]

T = TypeVar("T")


class _Required:
    """Stands in for the default of a parameter that has none."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED: Final = _Required()


class ParameterSpec(msgspec.Struct, frozen=True):
    """What is known of a parameter: files, the studio and the runner read it.

    Attributes:
      limits: annotated-types constraints, opened: `Interval` as `Ge`, `Le` ...
      unit: for people, "m/s".
      choices: the only allowed values, or None.
      trigger: no value, but a slot and an event of this name (§3.1 of the paper).
      size: how many ports a vector of this name has: said when a node is made, and no port itself.
    """

    name: str
    type: Any
    default: Any
    limits: tuple[Any, ...] = ()
    unit: str | None = None
    choices: tuple[Any, ...] | None = None
    trigger: bool = False
    size: bool = False

    @property
    def is_port(self) -> bool:
        """Whether it has a value that can be set and seen while a node lives (rule P8)."""
        return not (self.trigger or self.size)

    def check(self, value: Any) -> str | None:
        """Say what is wrong with a value ("must be <= 1, got 3"), or None."""
        if not accepts(value, self.type):
            return f"must be of type {describe(self.type)}, got {value!r}"
        if self.choices is not None and value not in self.choices:
            return f"must be one of {', '.join(map(repr, self.choices))}, got {value!r}"
        for limit in self.limits:
            try:
                wrong = _breaks(limit, value)
            except Exception as error:
                return f"cannot be compared with {limit!r} ({type(error).__name__}: {error}), got {value!r}"
            if wrong:
                return f"{wrong}, got {value!r}"
        return None


def _breaks(limit: Any, value: Any) -> str | None:
    """Say which limit a value breaks."""
    match limit:
        case annotated_types.Gt(gt):
            return None if value > gt else f"must be > {gt!r}"
        case annotated_types.Ge(ge):
            return None if value >= ge else f"must be >= {ge!r}"
        case annotated_types.Lt(lt):
            return None if value < lt else f"must be < {lt!r}"
        case annotated_types.Le(le):
            return None if value <= le else f"must be <= {le!r}"
        case annotated_types.MultipleOf(step):
            return None if value % step == 0 else f"must be a multiple of {step!r}"
        case annotated_types.MinLen(length):
            return None if len(value) >= length else f"must have at least {length} items"
        case annotated_types.MaxLen(length):
            return None if len(value) <= length else f"must have at most {length} items"
        case annotated_types.Predicate(func):
            return None if func(value) else f"must satisfy {getattr(func, '__name__', func)}"
    return None


_LIMITS = (
    annotated_types.Gt,
    annotated_types.Ge,
    annotated_types.Lt,
    annotated_types.Le,
    annotated_types.MultipleOf,
    annotated_types.MinLen,
    annotated_types.MaxLen,
    annotated_types.Predicate,
)


def limits_of(metadata: Collection[Any]) -> tuple[Any, ...]:
    """Open groups such as `Interval` and keep what is a limit; other metadata is somebody else's."""
    limits: list[Any] = []
    for item in metadata:
        if isinstance(item, annotated_types.GroupedMetadata):
            limits.extend(limits_of(list(item)))
        elif isinstance(item, slice):  # the short form of Len
            limits.extend(limits_of([annotated_types.Len(item.start or 0, item.stop)]))
        elif isinstance(item, _LIMITS):
            limits.append(item)
    return tuple(limits)


class ParameterPort(Port, Source[T], Target[T]):
    """The parameter of one node: a value, an optional input and an output (rule P8)."""

    __slots__ = ("spec",)

    kind: ClassVar[Kind] = "parameter"

    def __init__(self, node: Owner, name: str, spec: ParameterSpec) -> None:
        super().__init__(node, name, spec.type)
        self.spec = spec

    @property
    def value(self) -> T:
        """What the node works with now; setting it checks the limits.

        Raises:
          ValueError: on setting, a limit is broken; the value stays.
        """
        parameters: Mapping[str, T] = self.node._parameters
        return parameters[self.name]

    @value.setter
    def value(self, value: T) -> None:
        self.node._set_parameter(self.name, value)


class Parameter(Generic[T]):
    """Declare a parameter in a class body; `self.tolerance` is then its value (on a subgraph, its port).

    Args:
      default: its value unless the node is made with another.
      limits: annotated-types constraints: `Interval(ge=0, le=1)`, `Len(1, 9)`, `Predicate(str.isidentifier)` ...
      unit: for people.
      choices: the only allowed values.
      type: any type hint; without it the default's type.
      trigger: no value, but a slot and an event of this name: a call of the slot triggers the event.
    """

    kind: ClassVar[Kind] = "parameter"

    @overload
    def __init__(
        self,
        default: T,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[object] | None = None,
        trigger: bool = False,
    ) -> None: ...
    @overload
    def __init__(
        self,
        default: T,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[object] | None = None,
        type: TypeForm[T],
        trigger: bool = False,
    ) -> None: ...
    @overload
    def __init__(self: Parameter[None], /, *, trigger: bool) -> None: ...
    def __init__(
        self,
        default: Any = None,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[Any] | None = None,
        type: Any = None,  # noqa: A002
        trigger: bool = False,
    ) -> None:
        unknown = [limit for limit in limits if not limits_of([limit])]
        if unknown:
            raise DeclarationError(
                f"{unknown[0]!r} is no limit for a parameter: use those of annotated_types, such as Interval(ge=0, "
                "le=1)"
            )
        if type is None and default is not None:
            type = default.__class__  # noqa: A001
        self.inferred = False  # read from a function, not written in a class body
        self.default = default
        self.limits = limits_of(limits)
        self.unit = unit
        self.choices = None if choices is None else tuple(choices)
        self.type: Any = Any if type is None and not trigger else type
        self.trigger = trigger
        self.name = ""

    def __set_name__(self, owner: object, name: str) -> None:
        self.name = self.name or name

    def spec(self) -> ParameterSpec:
        """Give the declaration as plain data."""
        return ParameterSpec(self.name, self.type, self.default, self.limits, self.unit, self.choices, self.trigger)

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Relaying, owner: Any) -> ParameterPort[T]: ...
    @overload
    def __get__(self, node: object, owner: Any) -> T: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        if node is None:
            return self
        if self.trigger:
            raise UsageError(
                f'"{self.name}" is a trigger: write node.ports.slots["{self.name}"] or node.ports.events["{self.name}"]'
            )
        if isinstance(node, Relaying):
            return cast(Any, node)._port("parameter", self.name)
        return node._parameters[self.name]

    def __set__(self, node: Any, value: T) -> None:
        node._set_parameter(self.name, value)

    def __repr__(self) -> str:
        return f"<Parameter {self.name}>"
