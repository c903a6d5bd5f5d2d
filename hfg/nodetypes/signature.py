"""Reads a function as a node type.

Arguments are inputs, keyword-only arguments are parameters, the return annotation is the output. Depends on ports and
descriptions, not on classes of nodes. Every error names the function and the argument, and shows what to write instead.
"""

from __future__ import annotations

import inspect
import typing
from collections import abc
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from hfg.errors import DeclarationError
from hfg.nodetypes.description import InputSpec, ProcessKind
from hfg.nodetypes.hints import MISSING, function_name, hints_of, is_iterator, kind_of, result_of, split_token
from hfg.ports.kinds import type_of_default
from hfg.ports.parameters import spec_of
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.types import describe

_POSITIONAL: Final = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


@dataclass(frozen=True, slots=True)
class CallPlan:
    """Maps values of inputs and parameters to the arguments of a call.

    Attributes:
      positional: for each positional argument, the index of its input or the name of its parameter.
      keyword_inputs: argument name and index of inputs passed by keyword.
      keyword_parameters: names of parameters passed by keyword.
      rest: the index of the input whose list becomes all further positional arguments, `*values`.
    """

    positional: tuple[int | str, ...]
    keyword_inputs: tuple[tuple[str, int], ...] = ()
    keyword_parameters: tuple[str, ...] = ()
    rest: int | None = None

    def bind(self, function: Callable[..., Any], parameters: Mapping[str, Any]) -> Callable[..., Any]:
        """Return a function that takes one positional argument for each input.

        It reads parameters from the live mapping at each call. Without parameters and with inputs in order, it is the
        function itself, which saves a call between runner and user.
        """
        names, rest = self.keyword_parameters, self.rest
        inputs_lead = self.positional == tuple(range(len(self.positional))) and not self.keyword_inputs and rest is None
        if inputs_lead and not names:
            return function
        if inputs_lead and len(names) == len(parameters):
            return lambda *values: function(*values, **parameters)
        if inputs_lead:
            return lambda *values: function(*values, **{name: parameters[name] for name in names})

        def call(*values: Any) -> Any:
            positional = [values[item] if type(item) is int else parameters[item] for item in self.positional]  # type: ignore[index]
            keywords = {name: values[index] for name, index in self.keyword_inputs}
            keywords.update((name, parameters[name]) for name in names)
            return function(*positional, *(values[rest] if rest is not None else ()), **keywords)

        return call


@dataclass(frozen=True, slots=True)
class Signature:
    """The description of a function.

    `output` is its return type, None without one, or `MISSING` without an annotation.
    """

    inputs: tuple[InputSpec, ...]
    parameters: tuple[ParameterSpec, ...]
    output: Any
    kind: ProcessKind
    plan: CallPlan


def read_signature(
    function: Any,
    where: str,
    *,
    inputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
    known: Mapping[str, InputSpec] | None = None,
    bound: bool = False,
    vectors: Collection[str] = (),
) -> Signature:
    """Read a callable.

    Args:
      function: a function or another callable.
      where: the node type, for error messages.
      inputs: types of arguments that are inputs, or new names as strings.
      parameters: defaults of arguments that are parameters.
      known: for classes: inputs declared as ports; arguments take their types from them.
      bound: the first argument is the node itself.
      vectors: which inputs are vectors; the argument takes a list, or is `*values`.

    Raises:
      DeclarationError: something needed is missing, or cannot be a port.
    """
    return _Reader(function, where, inputs or {}, parameters or {}, known, vectors).read(bound)


class _Reader:
    """Goes through the arguments once; its fields hold what it has found so far."""

    def __init__(
        self,
        function: Any,
        where: str,
        inputs: Mapping[str, Any],
        parameters: Mapping[str, Any],
        known: Mapping[str, InputSpec] | None,
        vectors: Collection[str],
    ) -> None:
        self.function = function
        self.where = where
        self.given_inputs = inputs
        self.given_parameters = parameters
        self.known = known
        self.vectors = vectors
        # If inputs= has types, that list is complete; if it only has new names, the other inputs are read from the
        # annotations.
        self.inputs_complete = any(not isinstance(value, str) for value in inputs.values())
        self.inputs: list[InputSpec] = []
        self.parameters: list[ParameterSpec] = []
        self.positional: list[int | str] = []
        self.keyword_inputs: list[tuple[str, int]] = []
        self.keyword_parameters: list[str] = []
        self.rest: int | None = None
        self.hints: dict[str, Any] = {}

    def read(self, bound: bool) -> Signature:
        try:
            arguments = list(inspect.signature(self.function).parameters.values())[1 if bound else 0 :]
        except (ValueError, TypeError):
            return self._unreadable()
        self.hints = hints_of(self.function, self.where)
        self._check_given({argument.name for argument in arguments}, any(a.kind is a.VAR_KEYWORD for a in arguments))
        by_position = True  # until an argument keeps its default: arguments after it must be passed by keyword
        for argument in arguments:
            by_position = self._argument(argument, by_position)
        if self.known is not None:
            self._match_known()
        kind = kind_of(self.function)
        output = MISSING
        if "return" in self.hints:
            output, kind = result_of(self.hints["return"], kind, bool(self.inputs))
            if kind == "async" and not self.inputs and is_iterator(self.hints["return"]):
                raise DeclarationError(
                    f"{self.where}: it is async and annotated as an iterator, but has no `yield`; write one, "
                    "or annotate the value that it returns"
                )
        return self._signature(output, kind)

    def _signature(self, output: Any, kind: ProcessKind) -> Signature:
        if kind in ("generator", "async generator") and self.inputs:
            raise DeclarationError(
                f"{self.where}: a generator is a source and cannot have inputs, but it has "
                f'"{self.inputs[0].name}"; return one value per firing, or make "{self.inputs[0].name}" a '
                "keyword-only parameter"
            )
        plan = CallPlan(tuple(self.positional), tuple(self.keyword_inputs), tuple(self.keyword_parameters), self.rest)
        return Signature(tuple(self.inputs), tuple(self.parameters), output, kind, plan)

    def _check_given(self, names: set[str], any_keyword: bool) -> None:
        for word, given in (("inputs", self.given_inputs), ("parameters", self.given_parameters)):
            unknown = [name for name in given if name not in names and not any_keyword]
            if unknown:
                raise DeclarationError(
                    f'{self.where}: {word}= names "{unknown[0]}", which is not an argument of it; its '
                    f"arguments are {', '.join(sorted(names)) or 'none'}"
                )
        if any_keyword:
            self.keyword_parameters += [name for name in self.given_parameters if name not in names]
            self.parameters += [self._given_parameter(name, MISSING) for name in self.keyword_parameters]

    def _argument(self, argument: inspect.Parameter, by_position: bool) -> bool:
        name = argument.name
        if argument.kind is argument.VAR_KEYWORD:
            if self.known is not None or not (self.given_inputs or self.given_parameters):
                raise DeclarationError(
                    f'{self.where}: "**{name}" takes arguments that no port or parameter can supply, since '
                    f"these have fixed names; name each, as in `*, gain: float = 1.0`, or remove **{name}"
                )
            return by_position
        if argument.kind is argument.VAR_POSITIONAL:
            if name in self.vectors and by_position:
                self.rest = len(self.inputs)
                self.inputs.append(self._input(argument))
            elif self.known is not None or not (self.given_inputs or self.given_parameters):
                hint = describe(self.hints.get(name, Any))
                remedy = (
                    f'inputs={{"{name}": hfg.Inputs({hint}, 3)}}'
                    if self.known is None
                    else f"{name} = hfg.Inputs({hint}, 3)"
                )
                raise DeclarationError(
                    f'{self.where}: "*{name}" does not say how many inputs there are; declare a vector of them, '
                    f"{remedy}, or name each argument"
                )
            return False
        positional = argument.kind in _POSITIONAL
        if name in self.given_parameters:
            self._pass_parameter(self._given_parameter(name, self.hints.get(name, MISSING)), positional and by_position)
        elif not positional and name not in self.given_inputs:
            if not (self.given_parameters or self.inputs_complete) or argument.default is MISSING:
                self._pass_parameter(self._parameter(argument), False)
        elif self._is_left_alone(argument):
            return False
        else:
            self._pass_input(self._input(argument), name, positional and by_position)
        return by_position

    def _is_left_alone(self, argument: inspect.Parameter) -> bool:
        """Return whether an argument of a library function keeps its default because the call does not mention it."""
        if argument.name in self.given_inputs or argument.default is MISSING:
            return False
        return self.inputs_complete or (
            argument.name not in self.hints and bool(self.given_inputs or self.given_parameters)
        )

    def _pass_input(self, spec: InputSpec, argument: str, by_position: bool) -> None:
        if by_position:
            self.positional.append(len(self.inputs))
        else:
            self.keyword_inputs.append((argument, len(self.inputs)))
        self.inputs.append(spec)

    def _pass_parameter(self, spec: ParameterSpec, by_position: bool) -> None:
        if by_position:
            self.positional.append(spec.name)
        else:
            self.keyword_parameters.append(spec.name)
        self.parameters.append(spec)

    def _input(self, argument: inspect.Parameter) -> InputSpec:
        name, has_default = argument.name, argument.default is not MISSING
        default = argument.default if has_default else None
        given = self.given_inputs.get(name, MISSING)
        hint = self.hints.get(name, MISSING) if given is MISSING or isinstance(given, str) else given
        if self.known is not None and name in self.known:
            spec = self.known[name]
            token = hint is not MISSING and split_token(self._of_each(hint, argument))[1]
            if has_default and not spec.optional:
                raise DeclarationError(
                    f'{self.where}: process gives "{name}" a default, but the input is mandatory; '
                    "write hfg.Input(..., optional=True, default=...)"
                )
            return InputSpec(
                name,
                spec.type,
                spec.optional,
                spec.default if spec.default is not None or not has_default else default,
                token,
            )
        if self.known:
            raise DeclarationError(
                f'{self.where}: process has an argument "{name}", but the declared inputs are '
                f"{_names(self.known)}; also declare `{name} = hfg.Input(...)`"
            )
        if hint is MISSING:
            raise DeclarationError(
                f'{self.where}: argument "{name}" has no annotation, so its input has no type; '
                f"{self._call_to_write(name)}"
            )
        type_, token = split_token(hint)
        if name in self.vectors:
            token = split_token(self._of_each(self.hints.get(name, MISSING), argument))[1]
        return InputSpec(given if isinstance(given, str) else name, type_, has_default, default, token)

    def _of_each(self, hint: Any, argument: inspect.Parameter) -> Any:
        """Return the type of one port of a vector; the annotation is that of the list, or of each of `*values`."""
        parts = typing.get_args(hint)
        if argument.name not in self.vectors or argument.kind is argument.VAR_POSITIONAL or len(parts) != 1:
            return hint
        return parts[0] if split_token(parts[0])[1] else hint

    def _match_known(self) -> None:
        """Match arguments with declared inputs.

        Values are passed in the order of the ports, whatever the order of the arguments.
        """
        assert self.known is not None
        if not self.known:
            return
        missing = [name for name in self.known if name not in {spec.name for spec in self.inputs}]
        if missing:
            raise DeclarationError(
                f'{self.where}: process has no argument for the input "{missing[0]}"; it needs one for each of '
                f"{_names(self.known)}"
            )
        order = {name: index for index, name in enumerate(self.known)}
        new_index = [order[spec.name] for spec in self.inputs]
        self.positional = [new_index[item] if isinstance(item, int) else item for item in self.positional]
        self.keyword_inputs = [(name, new_index[index]) for name, index in self.keyword_inputs]
        self.rest = None if self.rest is None else new_index[self.rest]
        self.inputs.sort(key=lambda spec: order[spec.name])

    def _parameter(self, argument: inspect.Parameter) -> ParameterSpec:
        default = REQUIRED if argument.default is MISSING else argument.default
        hint = self.hints.get(argument.name, MISSING)
        if hint is MISSING:
            if default is REQUIRED or default is None:
                raise DeclarationError(
                    f'{self.where}: parameter "{argument.name}" has no type; write `{argument.name}: float = 1.0`'
                )
            hint = type_of_default(default)
        return spec_of(argument.name, default, hint, self.where)

    def _given_parameter(self, name: str, hint: Any) -> ParameterSpec:
        default = self.given_parameters[name]
        if hint is MISSING:
            hint = type_of_default(default)
        return spec_of(name, default, hint, self.where)

    def _unreadable(self) -> Signature:
        """Describe a C function, of which only the contents of inputs= and parameters= are known."""
        if not self.given_inputs or not self.inputs_complete:
            raise DeclarationError(f"{self.where}: cannot read the function's signature; {self._call_to_write(None)}")
        by_position = not self.given_parameters
        for name, hint in self.given_inputs.items():
            type_, token = split_token(hint)
            self._pass_input(InputSpec(name, type_, token=token), name, by_position)
        for name in self.given_parameters:
            self._pass_parameter(self._given_parameter(name, MISSING), False)
        return self._signature(MISSING, kind_of(self.function))

    def _call_to_write(self, missing: str | None) -> str:
        if self.known is not None:
            return f"write `{missing}: float`, or declare `{missing} = hfg.Input(float)`"
        name = function_name(self.function)
        try:
            arguments = [
                a
                for a in inspect.signature(self.function).parameters.values()
                if a.kind in _POSITIONAL and a.default is MISSING
            ]
            inputs = {a.name: describe(self.hints.get(a.name, Any)) for a in arguments}
        except (ValueError, TypeError):
            inputs = {"src": "Any"}
        types_ = ", ".join(f'"{argument}": {type_}' for argument, type_ in inputs.items())
        annotate = "annotate it, or " if inspect.isfunction(self.function) else ""
        return f"{annotate}write hfg.node({name}, inputs={{{types_}}}, outputs=Any)"


def _names(names: abc.Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"
