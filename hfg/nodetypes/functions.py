"""Node types as functions: `hfg.node` turns any function into a factory of nodes.

Arguments are inputs, keyword-only arguments are parameters, the return annotation is the output "out". Arguments of the
call add what a library function does not declare. Depends on `Node` and `signature`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import sys
import types
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, cast, overload

import numpy as np
from typing_extensions import TypeForm

from hfg.encoding.records import names_of
from hfg.errors import DeclarationError
from hfg.nodetypes.declaration import RESERVED, check_names, install_ports, shared_names, snake_case
from hfg.nodetypes.description import InputSpec, NodeType, OutputSpec
from hfg.nodetypes.hints import MISSING, function_name, hints_of_class, output_type
from hfg.nodetypes.node import Node
from hfg.nodetypes.signature import CallPlan, Signature, read_signature
from hfg.nodetypes.vectors import list_of, size_parameters, vector_specs
from hfg.ports.outputs import OutputPort
from hfg.ports.parameters import Parameter
from hfg.ports.specs import ParameterSpec
from hfg.ports.vectors import Inputs, Outputs, Vector
from hfg.types import describe

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
R_co = TypeVar("R_co", covariant=True)
A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")
D = TypeVar("D")
E = TypeVar("E")
F = TypeVar("F")


class FunctionNode(Node, Generic[T]):
    """A node whose type is a function; `out` is its output unless outputs= declares others."""

    if TYPE_CHECKING:

        @property
        def out(self) -> OutputPort[T]:  # noqa: D102 - the class says it
            ...

        # Inputs and parameters have the names of the function's arguments, which no annotation can express.
        def __getattr__(self, name: str) -> Any: ...


class NodeFunction(Generic[P, R_co]):
    """A node type made from a function; calling it with parameters makes a node.

    Attributes:
      function: the function itself.
    """

    __name__: str

    def __init__(self, function: Callable[..., R_co], node_class: type[Node]) -> None:
        self.function = function
        self._class = node_class
        self._type = node_class._type
        for name in ("__module__", "__name__", "__qualname__", "__doc__"):
            if hasattr(function, name):
                setattr(self, name, getattr(function, name))
        self.__wrapped__ = function

    @overload
    def __call__(self: NodeFunction[P, None], *args: P.args, **parameters: P.kwargs) -> FunctionNode[None]: ...
    @overload
    def __call__(
        self: NodeFunction[P, Coroutine[Any, Any, None]], *args: P.args, **parameters: P.kwargs
    ) -> FunctionNode[None]: ...
    @overload
    def __call__(
        self: NodeFunction[P, Coroutine[Any, Any, T | None]], *args: P.args, **parameters: P.kwargs
    ) -> FunctionNode[T]: ...
    @overload
    def __call__(
        self: NodeFunction[P, Iterator[T | None]], *args: P.args, **parameters: P.kwargs
    ) -> FunctionNode[T]: ...
    @overload
    def __call__(
        self: NodeFunction[P, AsyncIterator[T | None]], *args: P.args, **parameters: P.kwargs
    ) -> FunctionNode[T]: ...
    @overload
    def __call__(self: NodeFunction[P, T | None], *args: P.args, **parameters: P.kwargs) -> FunctionNode[T]: ...
    def __call__(self, *args: Any, **parameters: Any) -> Any:
        """Make a node.

        Raises:
          TypeError: it was called like the function itself.
          ValueError: a value violates the parameter's limits.
        """
        return self._class(*args, **parameters)

    def __repr__(self) -> str:
        return f"<node type {self._type.name}>"


# One overload for each number of positional arguments: these are inputs, and not part of the call that makes a node.
@overload
def node(function: Callable[Concatenate[A, B, C, D, E, F, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[Concatenate[A, B, C, D, E, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[Concatenate[A, B, C, D, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[Concatenate[A, B, C, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[Concatenate[A, B, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[Concatenate[A, P], R], /) -> NodeFunction[P, R]: ...
@overload
def node(function: Callable[P, R], /) -> NodeFunction[P, R]: ...
@overload
def node(
    function: Callable[..., Any],
    /,
    *,
    inputs: Mapping[str, Any] | None = None,
    outputs: TypeForm[T],
    parameters: Mapping[str, Any] | None = None,
) -> NodeFunction[..., T]: ...
@overload
def node(
    function: Callable[..., Any],
    /,
    *,
    inputs: Mapping[str, Any] | None = None,
    outputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> NodeFunction[..., Any]: ...
@overload
def node(
    *, inputs: Mapping[str, Any] | None = None, outputs: Any = None, parameters: Mapping[str, Any] | None = None
) -> Callable[[Callable[..., Any]], NodeFunction[..., Any]]: ...
def node(
    function: Callable[..., Any] | None = None,
    /,
    *,
    inputs: Mapping[str, Any] | None = None,
    outputs: Any = None,
    parameters: Mapping[str, Any] | None = None,
) -> Any:
    """Make a node type from a function.

    Args:
      function: a function with annotations; without them, use `inputs` and `outputs`. A generator, sync or async, is a
        source.
      inputs: argument name -> type, or -> new name as a string.
      outputs: one type; or a NamedTuple or dataclass, or a mapping from name to type, whose fields become one output
        each.
      parameters: argument name -> default.

    Raises:
      DeclarationError: something is missing; the message shows the call to write.

    Examples:
      >>> @node
      ... def scale(value: float, *, factor: float = 2.0) -> float:
      ...     return factor * value
      >>> scale(factor=3.0)
      <scale(factor=3.0)>
      >>> scale.function(1.5)
      3.0
    """
    if function is None:
        return functools.partial(node, inputs=inputs, outputs=outputs, parameters=parameters)
    if isinstance(function, NodeFunction) or (inspect.isclass(function) and issubclass(function, Node)):
        raise DeclarationError(f"{function_name(function)} is already a node type; use it without hfg.node")
    if isinstance(function, Node):
        raise DeclarationError(f"{function!r} is already a node; add it to a graph: graph.add(node)")
    if not callable(function):
        raise DeclarationError(
            f"hfg.node needs a function, got {function!r}; pass options by keyword, as in hfg.node(outputs=Found)"
        )
    for word, given in (("inputs", inputs), ("parameters", parameters)):
        if given is not None and not isinstance(given, Mapping):
            raise DeclarationError(
                f"hfg.node({function_name(function)}): {word} is a mapping from names of arguments, got {given!r:.80}; "
                f'write {word}={{"name": ...}}'
            )
    caller = sys._getframe(1)
    while caller.f_globals.get("__name__") == "functools" and caller.f_back is not None:
        caller = caller.f_back
    return make_type(function, caller.f_globals.get("__name__", "__main__"), inputs, outputs, parameters)


def make_type(
    function: Callable[..., Any],
    module: str,
    inputs: Mapping[str, Any] | None = None,
    outputs: Any = None,
    parameters: Mapping[str, Any] | None = None,
) -> NodeFunction[..., Any]:
    """Make a node type that belongs to a given module; `node` does this for the module that calls it."""
    name = function_name(function)
    where = f"node type {name}"
    declared = _declared_vectors(where, inputs, outputs)
    signature = _read(function, where, inputs, outputs, parameters)
    if inspect.isclass(function) and not signature.inputs:
        raise DeclarationError(
            f"{where}: a class without inputs would be an endless source of {name} objects; write `class "
            f"{name}(hfg.Node)` for a node type with state, or decorate a function"
        )
    described = _described(function, name, module, signature, _read_outputs(function, where, outputs, signature))

    def describe_type(cls: type[Node]) -> NodeType:
        vectors = vector_specs(declared, where)
        parameters = {**described.parameters, **size_parameters(vectors)}
        made = dataclasses.replace(described, origin=cls, declared=declared, vectors=vectors, parameters=parameters)
        check_names(made, where, RESERVED)
        install_ports(cls, made, Node)
        for vector_name, vector in declared.items():
            setattr(cls, vector_name, vector)
        return made

    body = {
        "__module__": module,
        "__qualname__": getattr(function, "__qualname__", name),
        "__doc__": getattr(function, "__doc__", None),
    }
    node_class = cast(
        type[Node],
        types.new_class(name, (FunctionNode,), {"_made": describe_type}, lambda namespace: namespace.update(body)),
    )
    made: NodeFunction[..., Any] = NodeFunction(function, node_class)
    node_class._type = dataclasses.replace(node_class._type, origin=made)
    if node_class._type.vectors:
        node_class._stand_for_sizes()
    made._type = node_class._type
    return made


def _described(
    function: Callable[..., Any],
    name: str,
    module: str,
    signature: Signature,
    results: tuple[list[OutputSpec], tuple[str, ...] | None],
) -> NodeType:
    """Describe a function without its vectors of ports; its class takes the function's place at first."""
    inputs = {spec.name: spec for spec in signature.inputs}
    if len(inputs) < len(signature.inputs):
        raise DeclarationError(f"node type {name}: two inputs have the same name; give each its own in inputs=")
    outputs, fields = {spec.name: spec for spec in results[0]}, results[1]
    is_of_module = getattr(function, "__module__", None) == module
    return NodeType(
        name=snake_case(name) or "function",
        origin=function,
        module=module,
        qualname=getattr(function, "__qualname__", name) if is_of_module else name,
        doc=inspect.cleandoc(getattr(function, "__doc__", None) or ""),
        inputs=inputs,
        outputs=outputs,
        parameters={spec.name: spec for spec in signature.parameters},
        process_kind=signature.kind,
        result="none" if not outputs else "fields" if fields is not None else "single",
        fields=fields or (),
        is_function=True,
        shared=shared_names(inputs, outputs, (), ()),
        caller=lambda made: signature.plan.bind(function, made._parameters),
    )


def _declared_vectors(where: str, inputs: Mapping[str, Any] | None, outputs: Any) -> dict[str, Vector[Any]]:
    """Return the vectors that the call declares, each under its name."""
    found: dict[str, Vector[Any]] = {}
    for word, kind, given in (("inputs", Inputs, inputs), ("outputs", Outputs, outputs)):
        for name, vector in given.items() if isinstance(given, Mapping) else ():
            if not isinstance(vector, Vector):
                continue
            if not isinstance(vector, kind) or name in found:
                raise DeclarationError(
                    f'{where}: {word}= has {vector!r} as "{name}"; give each a name of its own, as in '
                    f'{word}={{"{name}": hfg.{kind.__name__}(int, 3)}}'
                )
            vector.name = name
            found[name] = vector
    return found


def _read(
    function: Callable[..., Any],
    where: str,
    inputs: Mapping[str, Any] | None,
    outputs: Any,
    parameters: Mapping[str, Any] | None,
) -> Signature:
    if isinstance(function, np.ufunc) and inputs is None and not parameters:
        names = ["x"] if function.nin == 1 else [f"x{number}" for number in range(1, function.nin + 1)]
        plan = CallPlan(tuple(range(function.nin)))
        return Signature(tuple(InputSpec(name, Any) for name in names), (), MISSING, "function", plan)
    declared = {name: value for name, value in (parameters or {}).items() if isinstance(value, Parameter)}
    defaults = {name: value.default if name in declared else value for name, value in (parameters or {}).items()}
    vectors = [name for name, value in (inputs or {}).items() if isinstance(value, Inputs)]
    types_ = {name: list_of(value.type) if name in vectors else value for name, value in (inputs or {}).items()}
    signature = read_signature(function, where, inputs=types_, parameters=defaults, vectors=vectors)
    if not declared:
        return signature

    def complete(spec: ParameterSpec) -> ParameterSpec:
        return spec if spec.name not in declared else declared[spec.name].spec(where, spec.name, type=spec.type)

    return dataclasses.replace(signature, parameters=tuple(complete(spec) for spec in signature.parameters))


def _read_outputs(
    function: Any, where: str, outputs: Any, signature: Signature
) -> tuple[list[OutputSpec], tuple[str, ...] | None]:
    """Return the outputs, and the field names if the result is split; None if the result is one value."""
    if isinstance(outputs, Outputs):
        raise DeclarationError(
            f"{where}: a vector of outputs needs a name; write "
            f'outputs={{"parts": hfg.Outputs({describe(outputs.type)}, 3)}}'
        )
    if isinstance(outputs, Mapping):
        hints = {name: one.type if isinstance(one, Outputs) else one for name, one in outputs.items()}
        return [OutputSpec(name, hint) for name, hint in hints.items()], tuple(outputs)
    if outputs is not None:
        fields = _fields_of(outputs, where)
        if fields is not None:
            return [OutputSpec(name, output_type(hint)) for name, hint in fields.items()], tuple(fields)
        return [OutputSpec("out", output_type(outputs))], None
    if isinstance(function, np.ufunc):
        if function.nout == 1:
            return [OutputSpec("out", Any)], None
        names = [f"out{number}" for number in range(1, function.nout + 1)]
        return [OutputSpec(name, Any) for name in names], tuple(names)
    if signature.output is MISSING:
        given = ", inputs={...}" if signature.inputs and not inspect.isfunction(function) else ""
        raise DeclarationError(
            f"{where}: it does not say what it returns; annotate the result (`-> None` for a sink), or write "
            f"hfg.node({function_name(function)}{given}, outputs=Any)"
        )
    return ([] if signature.output is None else [OutputSpec("out", signature.output)]), None


def _fields_of(outputs: Any, where: str) -> dict[str, Any] | None:
    """Return the fields of a NamedTuple, dataclass or msgspec struct; None for any other type."""
    names = names_of(outputs)
    if names is None:
        return None
    hints = hints_of_class(outputs, where)
    return {name: hints.get(name, Any) for name in names}
