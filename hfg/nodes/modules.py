"""Node types of the functions of any module: `from_module(scipy.ndimage)`.

Arguments that are arrays are inputs, and so are required arguments without a declared type; arguments with a default,
or declared as a number, a string or a choice, are parameters. Types that the signature lacks are read from the
docstring, in the form of numpy or Google.

    # my_robot/filters.py
    import scipy.ndimage
    from hfg.nodes import from_module

    filters = from_module(scipy.ndimage)

`my_robot.filters:filters.gaussian_filter` is then a reference as good as any other.
"""

from __future__ import annotations

import inspect
import keyword
import re
import sys
import typing
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType, ModuleType
from typing import Any, Final, Literal

import docstring_parser
import numpy as np

from hfg.errors import DeclarationError
from hfg.nodes._making import Port, Recipe, Setting, make
from hfg.nodetypes.declaration import RESERVED
from hfg.nodetypes.description import TypesByName
from hfg.nodetypes.functions import NodeFunction, make_type
from hfg.ports.specs import REQUIRED
from hfg.types import Array, accepts, is_hint

__all__ = ["FunctionNodes", "from_module"]


def from_module(module: ModuleType, *, only: Collection[str] | None = None) -> FunctionNodes:
    """Return the functions of a module as node types; each is made when it is first named.

    Assign the result to a name at the top of a module of your own, so that files and other processes find the types.

    Args:
      module: any module; what its `__all__` lists, or else what is defined in it and has no underscore.
      only: the names to take instead.

    Raises:
      DeclarationError: it is not a module, or `only` has a name that it lacks.

    Examples:
      >>> import math
      >>> maths = from_module(math, only=["hypot", "sin"])
      >>> maths.sin()
      <sin()>
      >>> maths.not_nodes
      mappingproxy({'hypot': 'it takes any number of values, "*coordinates"'})
    """
    if not isinstance(module, ModuleType):
        raise DeclarationError(f"from_module takes a module, got {module!r:.80}: import it and give it")
    names = _public(module) if only is None else list(only)
    missing = [name for name in names if not hasattr(module, name)]
    if missing:
        raise DeclarationError(f'module {module.__name__} has no "{missing[0]}": correct only=')
    home = sys._getframe(1).f_globals.get("__name__", "__main__")
    return FunctionNodes(module, names, home)


class FunctionNodes(TypesByName):
    """The functions of a module as node types, by name.

    Attributes:
      names: of the node types, in alphabetical order.
      not_nodes: the other functions, with the reason.
    """

    def __init__(self, module: ModuleType, names: Collection[str], home: str) -> None:
        self._functions = module
        self._home = home
        self._made: dict[str, NodeFunction[..., Any]] = {}
        reasons = {name: _reason(getattr(module, name)) for name in sorted(names)}
        self.names = tuple(name for name, reason in reasons.items() if reason is None)
        self.not_nodes: Mapping[str, str] = MappingProxyType(
            {name: reason for name, reason in reasons.items() if reason is not None}
        )

    def __getattr__(self, name: str) -> NodeFunction[..., Any]:
        if name.startswith("__") or name not in self.names:
            reason = "" if name.startswith("__") else self.not_nodes.get(name)
            why = f": {reason}" if reason else f"; there are {', '.join(self.names[:8])} ..."
            raise AttributeError(f'"{name}" of {self._functions.__name__} is not a node type{why}')
        made = self._made.get(name)
        if made is None:
            made = self._made.setdefault(name, self._make(name))  # two threads may ask at once; there is one of each
        return made

    def _make(self, name: str) -> NodeFunction[..., Any]:
        function = getattr(self._functions, name)
        qualname = f"{self._own_name()}.{name}"
        if isinstance(function, np.ufunc):
            return make_type(_Ufunc(function, self._home, qualname), self._home, outputs=_ufunc_outputs(function))
        return make(_recipe(name, function), self._home, qualname)

    def _own_name(self) -> str:
        """Find the name that its module gave to this; without one the types have no reference."""
        names = vars(sys.modules.get(self._home, object))
        return next((name for name, value in list(names.items()) if value is self), "<from_module>")

    def __iter__(self) -> Iterator[NodeFunction[..., Any]]:
        return (getattr(self, name) for name in self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.names})

    def __repr__(self) -> str:
        return f"<{len(self.names)} node types of {self._functions.__name__}>"


def _public(module: ModuleType) -> list[str]:
    listed = getattr(module, "__all__", None)
    if listed is not None:
        return [
            name for name in listed if callable(getattr(module, name, None)) and _is_function(getattr(module, name))
        ]
    inside = f"{module.__name__}."
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and _is_function(value)
        and f"{getattr(value, '__module__', None) or module.__name__}.".startswith(inside)
    ]


def _is_function(value: Any) -> bool:
    return callable(value) and not inspect.isclass(value) and not isinstance(value, ModuleType | NodeFunction)


class _Ufunc:
    """A function of numpy's own kind, under a name at which it is found again."""

    def __init__(self, function: np.ufunc, module: str, qualname: str) -> None:
        self.function = function
        self.__name__ = function.__name__
        self.__module__ = module
        self.__qualname__ = qualname
        self.__doc__ = (function.__doc__ or "").partition("\n\n")[2]
        names = ["x"] if function.nin == 1 else [f"x{number}" for number in range(1, function.nin + 1)]
        self.__signature__ = inspect.Signature(
            [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Any) for name in names]
        )
        self.__annotations__ = dict.fromkeys([*names, "return"], Any)

    def __call__(self, *values: Any) -> Any:
        return self.function(*values)


def _ufunc_outputs(function: np.ufunc) -> Any:
    return Any if function.nout == 1 else {f"out{number}": Any for number in range(1, function.nout + 1)}


class _Told(typing.NamedTuple):
    """What a docstring says."""

    about: str
    types: dict[str, str]
    words: dict[str, str]
    results: list[tuple[str, str]]


_ARRAYS: Final = re.compile(r"array|ndarray|image|matrix", re.IGNORECASE)
_CALLABLE: Final = re.compile(r"callable|function", re.IGNORECASE)
_WRITTEN: Final = ("out", "output", "dst")
"""Arguments that name what is written into; the result is made anew instead."""


def _reason(function: Any) -> str | None:
    """Say why a function is no node type; None if it is one."""
    if isinstance(function, np.ufunc):
        return None if function.signature is None else "its arguments are arrays of matching axes, a generalized ufunc"
    if inspect.isgeneratorfunction(function) or inspect.isasyncgenfunction(function):
        return "it is a generator: decorate it with hfg.node"
    try:
        arguments = list(inspect.signature(function).parameters.values())
    except (ValueError, TypeError):
        return "its signature cannot be read: write hfg.node(function, inputs=..., outputs=...)"
    told = _read(function)
    rest = next((one.name for one in arguments if one.kind is one.VAR_POSITIONAL), None)
    if rest is not None:
        return f'it takes any number of values, "*{rest}"'
    for one in arguments:
        if one.default is one.empty and _CALLABLE.search(told.types.get(one.name, "")):
            return f'its argument "{one.name}" is a function'
    kinds = [_role(one, told) for one in arguments]
    return None if "input" in kinds or "optional" in kinds else "it takes no value, so it would be a source without end"


def _role(argument: inspect.Parameter, told: _Told) -> str:
    """Say what an argument becomes: an "input", an "optional" one, a "parameter", or "" for nothing."""
    required = argument.default is argument.empty
    said = told.types.get(argument.name, "")
    if argument.kind in (argument.VAR_KEYWORD, argument.VAR_POSITIONAL):
        return ""
    if argument.name in _WRITTEN and not required:
        return ""
    if argument.kind is argument.KEYWORD_ONLY:
        return "parameter"
    if said and _ARRAYS.search(said.partition(",")[0]):
        if required:
            return "input"
        return "optional" if argument.default is None else "parameter"
    if not required:
        return "" if argument.default is not None and not _is_value(argument.default) else "parameter"
    if argument.annotation is not argument.empty:
        return "input"
    return "parameter" if said and _hint_of(said) is not Any else "input"


def _is_value(value: Any) -> bool:
    """Say whether a default can be that of a parameter: no function, and nothing that only a module knows."""
    return isinstance(value, bool | int | float | complex | str | bytes | tuple | list | dict)


def _read(function: Any) -> _Told:
    """Read the docstring; what cannot be read says nothing."""
    try:
        parsed = docstring_parser.parse(inspect.getdoc(function) or "")
    except Exception:  # a docstring may hold anything
        return _Told("", {}, {}, [])
    types: dict[str, str] = {}
    words: dict[str, str] = {}
    for one in parsed.params:
        for name in one.arg_name.split(","):
            types[name.strip()] = one.type_name or ""
            words[name.strip()] = " ".join((one.description or "").split("\n\n")[0].split())
    # "a : ndarray" is a name and a type; "ndarray" alone is read as a type
    results = [
        (one.return_name or "", " ".join((one.description or "").split("\n\n")[0].split()))
        for one in parsed.many_returns
    ]
    return _Told(" ".join((parsed.short_description or "").split()), types, words, results)


_SIMPLE: Final[Mapping[str, Any]] = {
    "int": int,
    "integer": int,
    "float": float,
    "scalar": float,
    "number": float,
    "bool": bool,
    "boolean": bool,
    "str": str,
    "string": str,
    "tuple": tuple,
    "sequence": tuple,
    "list": list,
}


def _hint_of(said: str) -> Any:
    """Make a type of what a docstring says: "int or tuple of ints", "{'reflect', 'wrap'}, optional"."""
    choices = re.search(r"\{(.*?)\}", said)
    if choices:
        words = re.findall(r"['\"\u2018](.*?)['\"\u2019]", choices[1])
        return Literal[tuple(words)] if words else Any
    found: list[Any] = []
    for word in re.findall(r"[A-Za-z]+", said.partition(", optional")[0].lower()):
        hint = _SIMPLE.get(word) or _SIMPLE.get(word.removesuffix("s"))
        if hint is not None and hint not in found:
            found.append(hint)
    return typing.Union[tuple(found)] if found else Any  # noqa: UP007 - known at run time only


def _recipe(name: str, function: Callable[..., Any]) -> Recipe:
    told = _read(function)
    hints = _hints(function)
    inputs: list[tuple[str, Port]] = []
    settings: list[tuple[str, Setting]] = []
    for argument in inspect.signature(function).parameters.values():
        role = _role(argument, told)
        about = _sentence(told.words.get(argument.name) or f"{argument.name} of {name}")
        said = told.types.get(argument.name, "")
        hint = hints.get(argument.name)
        if role in ("input", "optional"):
            inputs.append((argument.name, _port(argument, hint, said, about, optional=role == "optional")))
        elif role == "parameter":
            settings.append((argument.name, _setting(argument, hint, said, about)))
    if inputs and all(port.optional for _, port in inputs):  # without any it would be a source without end
        inputs[0] = (inputs[0][0], replace(inputs[0][1], optional=False))
    inputs.sort(key=lambda one: one[1].optional)
    return Recipe(
        name=name,
        about=_sentence(told.about or f"Call {getattr(function, '__module__', '')}.{name}"),
        more=("Fires once for each set of inputs.",),
        inputs=tuple(port for _, port in inputs),
        settings=tuple(setting for _, setting in settings),
        outputs=_outputs(told, hints, {port.name for _, port in inputs} | {one.name for _, one in settings}),
        raises={"Exception": "whatever the function raises."},
        call=_caller(function, inputs, settings),
    )


def _port(argument: inspect.Parameter, hint: Any, said: str, about: str, *, optional: bool) -> Port:
    """Make an input of an argument, by its annotation or what its docstring says."""
    hint = hint or (Array if _ARRAYS.search(said.partition(",")[0]) else Any)
    return Port(_free(argument.name), hint, about, optional)


def _setting(argument: inspect.Parameter, hint: Any, said: str, about: str) -> Setting:
    """Make a parameter of an argument, in the same way."""
    default = REQUIRED if argument.default is argument.empty else argument.default
    return Setting(_free(argument.name), hint or _of_default(_hint_of(said), default), default, about)


def _outputs(told: _Told, hints: Mapping[str, Any], taken: set[str]) -> tuple[Port, ...]:
    """One, or as many as the docstring gives names to where the annotation does not say what comes back."""
    results = told.results
    if len(results) > 1 and all(name for name, _ in results) and "return" not in hints:
        return tuple(Port(_result_name(name, taken), Any, _sentence(words or name)) for name, words in results)
    return (Port("out", hints.get("return", Any), _sentence(results[0][1] if results else "the result")),)


def _hints(function: Any) -> dict[str, Any]:
    """Return the annotations that can be read at run time."""
    try:
        return {name: hint for name, hint in typing.get_type_hints(function).items() if is_hint(hint)}
    except Exception:  # names that exist for type checkers only
        return {}


def _of_default(hint: Any, default: Any) -> Any:
    """Widen a type so that the default is of it."""
    if hint is Any or default is REQUIRED:
        return hint
    if default is None:
        return hint | None
    return hint if accepts(default, hint) else hint | type(default)


def _caller(
    function: Callable[..., Any], inputs: list[tuple[str, Port]], settings: list[tuple[str, Setting]]
) -> Callable[..., Any]:
    optional = {name for name, port in inputs if port.optional}

    def call(*values: Any, **parameters: Any) -> Any:
        named = {name: value for (name, _), value in zip(inputs, values, strict=True)}
        arguments = {name: value for name, value in named.items() if value is not None or name not in optional}
        arguments.update((name, parameters[setting.name]) for name, setting in settings)
        return _bound(function, arguments)

    return call


def _bound(function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """Call by name where that is allowed; functions of C libraries take some arguments only by position."""
    by_position = []
    rest = dict(arguments)
    for one in inspect.signature(function).parameters.values():
        if one.kind is not one.POSITIONAL_ONLY:
            break
        if one.name in rest:
            by_position.append(rest.pop(one.name))
    return function(*by_position, **rest)


def _free(name: str) -> str:
    own = name.strip("_") or "value"
    return f"{own}_" if own in RESERVED or keyword.iskeyword(own) else own


def _result_name(name: str, taken: set[str]) -> str:
    own = _free(re.sub(r"\W+", "_", name))
    return f"{own}_out" if own in taken else own


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."
