"""Node types with vectors of ports: each size has a type of its own, made when a node needs it.

So the ports of such a node are found like those of any other node, and a node is still described by its type's name and
its parameters, which include the sizes. Depends on ports and descriptions, not on classes of nodes.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import msgspec

from hfg.base.bounds import NODES_AND_PORTS
from hfg.errors import DeclarationError
from hfg.nodetypes.description import EventSpec, InputSpec, NodeType, OutputSpec, SlotSpec
from hfg.ports.slots import Slot
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.ports.vectors import Slots, Vector, VectorSpec, element
from hfg.types import is_hint

Sizes = tuple[int, ...]

_SHOWN_SIZE: Final = 1
"""Size in listings of types, for vectors whose size must be given when a node is made."""


def list_of(hint: Any) -> Any:
    """Return the type of the argument that `process` gets for a whole vector.

    A hint that is not a type is refused later.
    """
    return list[hint] if is_hint(hint) else hint


def vector_specs(declared: Mapping[str, Any], where: str) -> dict[str, VectorSpec]:
    """Return the vectors among declarations.

    Raises:
      DeclarationError: a vector refers to the size of something that is not a vector.
    """
    specs = {name: one.spec() for name, one in declared.items() if isinstance(one, Vector)}
    for spec in specs.values():
        if spec.like and (spec.like not in specs or specs[spec.like].like):
            sized = [name for name, one in specs.items() if not one.like]
            raise DeclarationError(
                f'{where}: "{spec.name}" should have the size of "{spec.like}", which is not a vector '
                f"with a size of its own; {'there is ' + ', '.join(sized) if sized else 'give it a number'}"
            )
    return specs


def size_parameters(specs: Mapping[str, VectorSpec]) -> dict[str, ParameterSpec]:
    """Return the parameters for the sizes: a node is made with them, and they never change."""
    return {
        name: ParameterSpec(name, int, REQUIRED if spec.size is None else spec.size, size=True)
        for name, spec in specs.items()
        if not spec.like
    }


class Vectors:
    """The types of one declaration with vectors, by size.

    Attributes:
      pattern: the type with each vector as one port, as `process` sees it.
    """

    def __init__(self, cls: type, pattern: NodeType) -> None:
        self.pattern = pattern
        self._class = cls
        self._classes: dict[Sizes, type] = {}

    def sizes(self, parameters: Mapping[str, Any]) -> Sizes:
        """Return the sizes with which to make a node.

        Raises:
          TypeError: a size is missing.
          ValueError: a size is not an integer of 1 or more, or is larger than any may be.
        """
        found: dict[str, int] = {}
        for name, spec in self.pattern.vectors.items():
            if spec.like:
                continue
            size = parameters.get(name, spec.size)
            if size is None:
                raise TypeError(
                    f'{self.pattern.name} needs to know how many {spec.kind}s "{name}" has: write '
                    f"{self.pattern.qualname}({name}=3), or hfg.{spec.kind.title()}s(..., 3) where it is declared"
                )
            if type(size) is not int or size < 1:
                raise ValueError(
                    f'{self.pattern.name} has 1 or more {spec.kind}s "{name}", got {name}={size!r}; write '
                    f"{self.pattern.qualname}({name}=3)"
                )
            if size > NODES_AND_PORTS.most:
                raise ValueError(
                    f'{self.pattern.name} cannot have {size:,} {spec.kind}s "{name}": {NODES_AND_PORTS.remedy}'
                )
            found[name] = size
        return tuple(found[spec.like or name] for name, spec in self.pattern.vectors.items())

    @property
    def shown(self) -> NodeType:
        """The type for listings, with default sizes."""
        specs = self.pattern.vectors
        sizes = {name: spec.size or _SHOWN_SIZE for name, spec in specs.items()}
        return self.sized(tuple(sizes[spec.like or name] for name, spec in specs.items()))

    def make(self, cls: type, *positional: Any, **parameters: Any) -> Any:
        """Make a node in place of `__new__`; its class has the node's sizes.

        Raises:
          TypeError: a size is missing.
          ValueError: a size is not an integer of 1 or more.
        """
        made: Any = object.__new__(self._class_of(self.sizes(parameters)))
        if not isinstance(made, cls):  # called on a class with other sizes, for which Python does not call __init__
            made.__init__(*positional, **parameters)
        return made

    def _class_of(self, sizes: Sizes) -> type:
        found = self._classes.get(sizes)
        if found is None:
            cls = self._class
            body = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": cls.__doc__}
            found = self._classes[sizes] = types.new_class(
                cls.__name__, (cls,), {"_made": lambda _: self.sized(sizes)}, lambda namespace: namespace.update(body)
            )
        return found

    # --- the type of one size ---

    def sized(self, sizes: Sizes) -> NodeType:
        """Describe the type with vectors of these sizes."""
        pattern = self.pattern
        counts = dict(zip(pattern.vectors, sizes, strict=True))
        vectors = {name: msgspec.structs.replace(pattern.vectors[name], size=count) for name, count in counts.items()}
        slots, handlers = self._slots(counts)
        layout = tuple(counts.get(name) for name in pattern.outputs)
        has_outputs = any(name in counts for name in pattern.outputs)
        return dataclasses.replace(
            pattern,
            inputs=_spread(pattern.inputs, counts, lambda spec, name: _input(vectors[spec.name], spec, name)),
            outputs=_spread(pattern.outputs, counts, lambda spec, name: OutputSpec(name, vectors[spec.name].type)),
            events=_spread(pattern.events, counts, lambda spec, name: EventSpec(name, spec.type)),
            slots=slots,
            declared={**pattern.declared, **handlers},
            vectors=vectors,
            result="fields" if has_outputs else pattern.result,
            layout=layout if has_outputs else (),
            caller=None if pattern.caller is None else _gathering(pattern.caller, pattern.inputs, counts),
        )

    def _slots(self, counts: Mapping[str, int]) -> tuple[Mapping[str, SlotSpec], dict[str, Slot[Any]]]:
        handlers: dict[str, Slot[Any]] = {}
        for name, count in counts.items():
            declaration = self.pattern.declared.get(name)
            if isinstance(declaration, Slots) and declaration.handler is not None:
                for number in range(count):
                    one = Slot[Any](_numbered(declaration.handler, number), declaration.type)
                    one.name = element(name, number)
                    handlers[one.name] = one

        def renamed(spec: SlotSpec, name: str) -> SlotSpec:
            return msgspec.structs.replace(spec, name=name, handler_name=name if spec.handler_name else "")

        return _spread(self.pattern.slots, counts, renamed), handlers


def _spread(specs: Mapping[str, Any], counts: Mapping[str, int], made: Callable[[Any, str], Any]) -> Mapping[str, Any]:
    """Replace each vector by its ports."""
    found: dict[str, Any] = {}
    for name, spec in specs.items():
        if name in counts:
            names = [element(name, number) for number in range(counts[name])]
            found.update((one, made(spec, one)) for one in names)
        else:
            found[name] = spec
    return found


def _input(vector: VectorSpec, pattern: InputSpec, name: str) -> InputSpec:
    return InputSpec(name, vector.type, vector.optional, vector.default, pattern.token)


def _numbered(handler: Callable[..., Any], number: int) -> Callable[..., Any]:
    return lambda self, *value: handler(self, number, *value)


def _gathering(
    caller: Callable[[Any], Callable[..., Any]], inputs: Iterable[str], counts: Mapping[str, int]
) -> Callable[[Any], Callable[..., Any]]:
    """Return a caller that passes `process` a list for each vector; the runner passes one value per port."""
    parts: list[int | slice] = []
    position = 0
    for name in inputs:
        count = counts.get(name)
        parts.append(position if count is None else slice(position, position + count))
        position += 1 if count is None else count
    if not any(isinstance(part, slice) for part in parts):
        return caller

    def gathering(node: Any) -> Callable[..., Any]:
        process = caller(node)

        def call(*values: Any) -> Any:
            return process(*[list(values[part]) if isinstance(part, slice) else values[part] for part in parts])

        return call

    return gathering
