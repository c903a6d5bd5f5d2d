"""Makes a `NodeType` from a class body, and refuses bodies that cannot work.

Depends on ports, `signature` and `description`; `Node` calls it when a subclass is made.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, TypeAlias, TypeVar

from hfg.errors import DeclarationError, UsageError
from hfg.nodetypes.description import EventSpec, InputSpec, NodeType, OutputSpec, Result, SlotSpec
from hfg.nodetypes.hints import MISSING, hints_of, kind_of, split_token
from hfg.nodetypes.signature import Signature, read_signature
from hfg.nodetypes.vectors import list_of, size_parameters, vector_specs
from hfg.ports.automatic import AUTOMATIC_EVENTS, AUTOMATIC_SLOTS
from hfg.ports.base import Relaying
from hfg.ports.events import Event
from hfg.ports.inputs import Input
from hfg.ports.outputs import Output
from hfg.ports.parameters import Parameter
from hfg.ports.slots import UNSET, Slot
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.ports.states import State
from hfg.ports.vectors import Events, Inputs, Outputs, Slots, Vector, VectorSpec
from hfg.types import describe, is_hint

HOOKS: Final = ("setup", "ready", "end", "teardown", "on_activated", "on_deactivated", "do")
"""Methods of a node that a runner calls in addition to `process`."""

RESERVED: Final = frozenset(
    {*HOOKS, "process", "ports", "place", "active", "log", "inner", "start_soon", *AUTOMATIC_EVENTS, *AUTOMATIC_SLOTS}
)
"""Every public name of `Node`; a test keeps this list complete."""

_SUBGRAPH_RESERVED: Final = RESERVED | {"graph", "build", "iterate_over"}

Declaration: TypeAlias = Input[Any] | Output[Any] | Event[Any] | Slot[Any] | Vector[Any] | Parameter[Any] | State[Any]
D = TypeVar("D")
_DECLARATIONS: Final = (Input, Output, Event, Slot, Vector, Parameter, State)


class Shared:
    """Replaces an attribute whose name belongs to both an input side and an output side: it would be ambiguous."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, node: Any, owner: Any) -> Any:
        if node is None:
            return self
        raise _shared_name(node, self.name)


def _shared_name(node: Any, name: str) -> Exception:
    """Return the error that names both ports."""
    kinds = [kind for kind in ("inputs", "outputs", "events", "slots") if name in getattr(node._type, kind)]
    both = " or ".join(f'node.ports.{kind}["{name}"]' for kind in kinds)
    return UsageError(f'"{name}" of {node._type.name} is two ports; write {both}')


def snake_case(name: str) -> str:
    """Turn a class name into the default name of its nodes: MapLookup -> map_lookup, HTTPServer -> http_server."""
    words = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1_\2", name.strip("_<>"))
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", words).lower()


def declare(cls: type[Any], base: type[Any]) -> NodeType:
    """Describe a subclass of `base`, which is `Node`. Ports that `process` declares are added to the class."""
    where = f"node type {cls.__qualname__}"
    _wrap_overridden_slots(cls, base)
    kind = _described(cls, base, where)
    check_names(kind, where, _SUBGRAPH_RESERVED if kind.is_subgraph else RESERVED)
    install_ports(cls, kind, base)
    return kind


def _described(cls: type[Any], base: type[Any], where: str) -> NodeType:
    is_subgraph = issubclass(cls, Relaying)
    declared = _declared(cls, base, where)
    vectors = vector_specs(declared, where)
    parameters = {name: parameter.spec(where) for name, parameter in _of(declared, Parameter).items()}
    parameters.update(size_parameters(vectors))
    inputs = {name: _input_spec(name, d) for name, d in _declared_as(declared, Input, Inputs)}
    outputs = {name: OutputSpec(name, d.type) for name, d in _declared_as(declared, Output, Outputs)}
    signature = None
    if _has_process(cls, base, where, is_subgraph):
        signature = _read_process(cls, cls.process, inputs, vectors, where)
        inputs = {spec.name: spec for spec in signature.inputs}
        parameters.update((spec.name, spec) for spec in signature.parameters if spec.name not in parameters)
        outputs = outputs or _outputs(signature, where, must_say=not _has_inputs(declared))
    slots = {name: _slot_spec(cls, d, where, is_subgraph) for name, d in _declared_as(declared, Slot, Slots)}
    events, slots = _signals(declared, slots, parameters)
    return NodeType(
        name=snake_case(cls.__name__),
        origin=cls,
        module=cls.__module__,
        qualname=cls.__qualname__,
        doc=inspect.cleandoc(cls.__dict__.get("__doc__") or ""),
        inputs=inputs,
        outputs=outputs,
        events=events,
        slots=slots,
        parameters=parameters,
        states=_of(declared, State),
        process_kind="none" if signature is None else signature.kind,
        result=_result(outputs),
        is_subgraph=is_subgraph,
        shared=shared_names(inputs, outputs, events, slots),
        declared=declared,
        hooks=_hooks(cls, base, where),
        completes=_do_activity(cls, base, where, is_subgraph),
        caller=None if signature is None else _caller(signature),
        vectors=vectors,
    )


def _signals(
    declared: Mapping[str, Declaration], slots: Mapping[str, SlotSpec], parameters: Mapping[str, ParameterSpec]
) -> tuple[dict[str, EventSpec], dict[str, SlotSpec]]:
    """Return the events and slots; a trigger parameter has one of each."""
    triggers = [spec for spec in parameters.values() if spec.trigger]
    events = {name: EventSpec(name, d.type) for name, d in _declared_as(declared, Event, Events)}
    events.update((spec.name, EventSpec(spec.name, spec.type)) for spec in triggers)
    return events, {**slots, **{spec.name: SlotSpec(spec.name, spec.type or object) for spec in triggers}}


def _result(outputs: Mapping[str, OutputSpec]) -> Result:
    if not outputs:
        return "none"
    return "single" if len(outputs) == 1 else "fields"


def _has_process(cls: type[Any], base: type[Any], where: str, is_subgraph: bool) -> bool:
    """Return whether it has a process function of its own, and refuse what cannot be one."""
    process = cls.process
    if process is base.process:
        return False
    if is_subgraph:
        raise DeclarationError(
            f"{where}: a subgraph does not fire itself; move the work into a node and add it in build()"
        )
    if isinstance(process, _DECLARATIONS) or not callable(process):
        raise DeclarationError(
            f'{where}: "process" is reserved for the function of a firing, got {process!r}; choose another name'
        )
    return True


def _hooks(cls: type[Any], base: type[Any], where: str) -> frozenset[str]:
    """Return the hooks that it overrides."""
    names = frozenset(name for name in HOOKS if getattr(cls, name) is not getattr(base, name))
    for name in HOOKS:
        found = inspect.getattr_static(cls, name)
        if name in names and inspect.isfunction(found):
            _behind_self(found, name, where)
    return names


def _do_activity(cls: Any, base: type, where: str, is_subgraph: bool) -> Any:
    """Return the result type of a type's do-activity (rule A15); None if it has no annotation, or no do-activity."""
    found = cls.do
    if found is getattr(base, "do") or isinstance(found, _DECLARATIONS):  # noqa: B009 - type checkers know no base but Node
        return None  # a port of this name is refused as such
    if is_subgraph:
        raise DeclarationError(
            f"{where}: a subgraph runs no code of its own, so it cannot have a do-activity; write do() in a node inside"
        )
    if not inspect.iscoroutinefunction(found):
        raise DeclarationError(
            f'{where}: "do" is reserved for the do-activity of a node, which must be `async def do(self)`; '
            f"got {found!r:.80}: choose another name, or make it async"
        )
    return hints_of(found, f"{where}.do").get("return", Any)


def _of(declared: Mapping[str, Declaration], kind: type[D]) -> dict[str, D]:
    return {name: declaration for name, declaration in declared.items() if isinstance(declaration, kind)}


def _declared_as(declared: Mapping[str, Declaration], *kinds: type[Any]) -> Iterator[tuple[str, Any]]:
    """Return the declarations of some kinds, in order of declaration."""
    return ((name, declaration) for name, declaration in declared.items() if isinstance(declaration, kinds))


def _has_inputs(declared: Mapping[str, Declaration]) -> bool:
    return any(isinstance(declaration, Input | Inputs) for declaration in declared.values())


def _input_spec(name: str, declaration: Input[Any] | Inputs[Any]) -> InputSpec:
    hint = list_of(declaration.type) if isinstance(declaration, Inputs) else declaration.type
    return InputSpec(name, hint, declaration.optional, declaration.default)


def _caller(signature: Signature) -> Callable[[Any], Callable[..., Any]]:
    plan = signature.plan
    return lambda node: plan.bind(node.process, node._parameters)


def _declared(cls: type, base: type, where: str) -> dict[str, Declaration]:
    """Collect declarations, bases first; the `process` of a base is read again."""
    found: dict[str, Declaration] = {}
    for owner in reversed(cls.__mro__):
        if owner is base or owner is object:
            continue
        for name, value in vars(owner).items():
            if isinstance(value, _DECLARATIONS):
                if getattr(value, "inferred", False):
                    continue
                if value.name != name:
                    raise DeclarationError(
                        f'{where}: "{name}" and "{value.name}" are the same object; declare each port with a '
                        "call of its own"
                    )
                found[name] = value
            elif name in found and not name.startswith("__"):
                raise DeclarationError(
                    f'{where}: "{name}" is a port or parameter of {owner.__bases__[0].__name__}, overwritten by '
                    f"{value!r}; use another name"
                )
    return found


def _wrap_overridden_slots(cls: type, base: type) -> None:
    """Make handlers of methods that override a slot's handler, decorated or not."""
    for name, value in list(vars(cls).items()):
        inherited = next((vars(owner)[name] for owner in cls.__mro__[1:] if name in vars(owner)), None)
        if inspect.isfunction(value) and isinstance(inherited, Slot) and inherited.handler is not None:
            made: Slot[Any] = Slot(
                value, UNSET if _argument(value) in getattr(value, "__annotations__", {}) else inherited.type
            )
            if made.type is UNSET and _argument(value) is not None and _argument(value) not in value.__annotations__:
                made.type = _slot_type(inherited, name)
            made.name = name
            setattr(cls, name, made)


def _slot_type(inherited: Slot[Any], name: str) -> Any:
    argument = _argument(inherited.handler)
    return (
        split_token(hints_of(inherited.handler, f"slot {name}").get(argument or "", Any))[0]
        if inherited.type is UNSET
        else inherited.type
    )


def _argument(handler: Any) -> str | None:
    """Return the name of a handler's argument after self."""
    names = [a.name for a in inspect.signature(handler).parameters.values()]
    return names[1] if len(names) > 1 else None


def _slot_spec(cls: type, slot: Slot[Any] | Slots[Any], where: str, is_subgraph: bool) -> SlotSpec:
    name = slot.name
    if isinstance(slot, Slots):
        return _slots_spec(slot, where, is_subgraph)
    if slot.handler is None:
        if not is_subgraph:
            raise DeclarationError(
                f'{where}: slot "{name}" has no handler; write `@hfg.slot` above `def {name}(self, value: int)`'
            )
        if slot.while_active:
            raise DeclarationError(
                f'{where}: slot "{name}" of a subgraph only forwards signals, so while_active has no effect; '
                "set it at the inner slots that it is connected to"
            )
        return SlotSpec(name, object if slot.type is UNSET else slot.type)
    arguments = _behind_self(slot.handler, f'the handler of slot "{name}"', where)
    needed = [a for a in arguments if a.default is a.empty and a.kind not in (a.VAR_KEYWORD, a.VAR_POSITIONAL)]
    if len(needed) > 1 or any(a.kind is a.KEYWORD_ONLY for a in needed):
        names = ", ".join(a.name for a in needed)
        raise DeclarationError(
            f'{where}: the handler of slot "{name}" takes {len(needed)} arguments ({names}), but a signal '
            "carries one value; use at most one argument"
        )
    positional = [a for a in arguments if a.kind in (a.POSITIONAL_ONLY, a.POSITIONAL_OR_KEYWORD)]
    runs = "async" in kind_of(slot.handler)
    if not positional:
        return SlotSpec(name, object if slot.type is UNSET else slot.type, name, False, False, runs, slot.while_active)
    hint = hints_of(slot.handler, f'{where}, slot "{name}"').get(positional[0].name, MISSING)
    if hint is MISSING and slot.type is UNSET:
        raise DeclarationError(
            f'{where}: argument "{positional[0].name}" of slot "{name}" has no annotation; '
            f"write `{positional[0].name}: int` or `@hfg.slot(type=int)`"
        )
    type_, token = split_token(hint) if hint is not MISSING else (slot.type, False)
    return SlotSpec(name, type_ if slot.type is UNSET else slot.type, name, True, token, runs, slot.while_active)


def _slots_spec(slots: Slots[Any], where: str, is_subgraph: bool) -> SlotSpec:
    """Describe each slot of a vector; its handler gets the slot's number first."""
    name, hint = slots.name, slots.type
    if slots.handler is None:
        if not is_subgraph:
            raise DeclarationError(
                f'{where}: the slots "{name}" have no handler; write `@hfg.Slots({describe(hint)}, 3)` above '
                f"`def {name}(self, number: int, value)`"
            )
        return SlotSpec(name, hint)
    arguments = _behind_self(slots.handler, f'the handler of the slots "{name}"', where)
    positional = [a for a in arguments if a.kind in (a.POSITIONAL_ONLY, a.POSITIONAL_OR_KEYWORD)]
    if not positional or len([a for a in arguments if a.default is a.empty]) > 2:
        raise DeclarationError(
            f'{where}: the handler of the slots "{name}" takes the number of the slot and at most one value; write '
            f"`def {name}(self, number: int, value)`"
        )
    token = False
    if len(positional) > 1:
        hints = hints_of(slots.handler, f'{where}, slots "{name}"')
        token = split_token(hints[positional[1].name])[1] if positional[1].name in hints else False
    return SlotSpec(name, hint, name, len(positional) > 1, token, "async" in kind_of(slots.handler))


def _behind_self(function: Callable[..., Any], what: str, where: str) -> list[inspect.Parameter]:
    """Return the arguments of a method after the node itself."""
    arguments = list(inspect.signature(function).parameters.values())
    first = arguments[0] if arguments else None
    if first is None or first.kind is first.KEYWORD_ONLY or _is_annotated(first):
        given = ", ".join(str(argument) for argument in arguments)
        name = getattr(function, "__name__", "process")
        raise DeclarationError(
            f"{where}: {what} is a method and takes the node first; write "
            f"`def {name}(self{', ' if given else ''}{given})`, or @staticmethod above it"
        )
    return arguments[1:]


def _is_annotated(argument: inspect.Parameter) -> bool:
    return argument.name != "self" and argument.annotation is not argument.empty


def _read_process(
    cls: type, process: Any, inputs: dict[str, InputSpec], vectors: Mapping[str, VectorSpec], where: str
) -> Signature:
    bound = inspect.isfunction(inspect.getattr_static(cls, "process"))
    if bound:
        _behind_self(process, "process", where)
    return read_signature(process, where, known=inputs, bound=bound, vectors=vectors.keys() & inputs.keys())


def _outputs(signature: Signature, where: str, *, must_say: bool) -> dict[str, OutputSpec]:
    """Return the one output "out" of a return annotation, which may be missing only next to declared inputs."""
    if signature.output is MISSING:
        if must_say:
            raise DeclarationError(
                f"{where}: process does not say what it returns; annotate its result, `-> int` for an output, "
                "`-> None` for none"
            )
        return {}
    return {} if signature.output is None else {"out": OutputSpec("out", signature.output)}


def shared_names(
    inputs: Iterable[str], outputs: Iterable[str], events: Iterable[str], slots: Iterable[str]
) -> frozenset[str]:
    """Return the names that mean a port on both sides."""
    return frozenset({*inputs, *slots} & {*outputs, *events})


def check_names(kind: NodeType, where: str, reserved: frozenset[str] = RESERVED) -> None:
    """Refuse names that are reserved, used twice or not identifiers.

    Raises:
      DeclarationError: naming the port and the remedy.
    """
    values = [name for name, spec in kind.parameters.items() if spec.is_port]
    for side in ([*kind.inputs, *kind.slots, *values], [*kind.outputs, *kind.events, *values]):
        doubled = next((name for name in side if side.count(name) > 1), None)
        if doubled is not None:
            raise DeclarationError(f'{where}: two ports are named "{doubled}"; rename one{_rename(kind, doubled)}')
    for name in [*kind.inputs, *kind.outputs, *kind.events, *kind.slots, *values, *kind.states]:
        if name in reserved:
            raise DeclarationError(
                f'{where}: "{name}" is a reserved name that every node has; choose another{_rename(kind, name)}'
            )
        if not name.isidentifier() or name.startswith("_"):
            raise DeclarationError(
                f'{where}: "{name}" cannot be the name of a port; use letters, digits and underscores, a letter '
                f"first{_rename(kind, name)}"
            )
    ports: tuple[Mapping[str, Any], ...] = (kind.inputs, kind.outputs, kind.events, kind.slots, kind.parameters)
    for one in (port for some in ports for port in some.values()):
        _check_type(one.name, one.type, where)
    for spec in kind.parameters.values():
        _check_default(spec, where)
        _check_conditions(spec, kind.parameters, where)
        if spec.read_only and kind.is_subgraph:
            raise DeclarationError(
                f'{where}: parameter "{spec.name}" is read-only, but a subgraph has no code of its own to set '
                "it; make it an output, and connect to it the parameter of the inner node that is set"
            )


def _check_type(name: str, hint: Any, where: str) -> None:
    """Refuse an annotation that is not a type."""
    if not is_hint(hint):
        raise DeclarationError(
            f'{where}: the type of "{name}" is {hint!r:.80}, which is not a type; write the type itself, as '
            "in `int` or `list[str]`"
        )


def _rename(kind: NodeType, name: str) -> str:
    return f', as in inputs={{"{name}": "{name}_in"}}' if kind.is_function and name in kind.inputs else ""


def _check_default(spec: ParameterSpec, where: str) -> None:
    """Refuse a default that violates its own limits."""
    wrong = None if spec.trigger or spec.default is REQUIRED else spec.check(spec.default)
    if wrong is not None:
        raise DeclarationError(
            f'{where}: the default of parameter "{spec.name}" {wrong}; change the default or the limit'
        )


def _check_conditions(spec: ParameterSpec, parameters: Mapping[str, ParameterSpec], where: str) -> None:
    """Refuse a shown_if condition that can never hold."""
    for condition in spec.shown_if:
        other = parameters.get(condition.parameter)
        if other is None or other.trigger:
            there = ", ".join(f'"{name}"' for name, one in parameters.items() if not one.trigger and one is not spec)
            raise DeclarationError(
                f'{where}: parameter "{spec.name}" is shown by "{condition.parameter}", which is not a '
                f"parameter with a value; the others are {there or 'none'}"
            )
        wrong = next((wrong for value in condition.values if (wrong := other.check(value))), None)
        if wrong is not None:
            raise DeclarationError(
                f'{where}: parameter "{spec.name}" is shown if "{other.name}" has a value that it can never '
                f"have: it {wrong}"
            )
    ring = _ring_of_conditions(spec.name, parameters)
    if ring:
        names = " by ".join(f'"{name}"' for name in ring)
        raise DeclarationError(
            f"{where}: parameters depend on each other to be shown, {names}, so all of them could be hidden "
            "forever; always show one of them"
        )


def _ring_of_conditions(name: str, parameters: Mapping[str, ParameterSpec]) -> tuple[str, ...]:
    """Follow the shown_if conditions from a parameter. Return the path if it comes back to it."""
    ways: list[tuple[str, ...]] = [(name,)]
    seen: set[str] = set()
    while ways:
        way = ways.pop()
        for condition in parameters[way[-1]].shown_if if way[-1] in parameters else ():
            if condition.parameter == name:
                return (*way, name)
            if condition.parameter not in seen:
                seen.add(condition.parameter)
                ways.append((*way, condition.parameter))
    return ()


def install_ports(cls: type, kind: NodeType, base: type) -> None:
    """Make ports that were read from a function attributes of the class, as if they had been declared in its body."""
    for name in kind.shared:
        if not isinstance(kind.declared.get(name), Parameter):
            setattr(cls, name, Shared(name))
    made: list[Any] = [Input(spec.type, optional=spec.optional, default=spec.default) for spec in kind.inputs.values()]
    made += [Output(spec.type) for spec in kind.outputs.values()]
    names = [*kind.inputs, *kind.outputs]
    for spec in kind.parameters.values():
        if spec.size:
            continue
        made.append(Parameter.of(spec))
        names.append(spec.name)
    for name, declaration in zip(names, made, strict=True):
        if name in kind.declared or name in kind.shared:
            continue
        taken = next((owner for owner in cls.__mro__ if owner is not base and name in vars(owner)), None)
        if (
            taken is not None
            and not getattr(vars(taken)[name], "inferred", False)
            and not isinstance(vars(taken)[name], Shared)
        ):
            raise DeclarationError(
                f'node type {cls.__qualname__}: "{name}" is both a port that process declares and an attribute of '
                f"{taken.__name__}; rename one of them"
            )
        declaration.name = name
        if not isinstance(declaration, Parameter):
            declaration.inferred = True
        setattr(cls, name, declaration)
