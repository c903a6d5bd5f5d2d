"""Types as text, "list[my_robot.types.Pose]", for commands that declare ports; and back.

A class is named by its module and name, a class of Python only by its name. Depends on errors.
"""

from __future__ import annotations

import ast
import importlib
import sys
import types
from typing import Any, Literal, Union, get_args, get_origin

from hfg.errors import GraphError
from hfg.nodetypes.description import look_up


def text_of_type(hint: object) -> str | None:
    """Return what `type_of_text` reads; None for a type that has no name."""
    if hint is None or hint is type(None):
        return "None"
    if hint is Any:
        return "Any"
    if hint is Ellipsis:
        return "..."
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Literal:
        plain = all(type(one) in (int, str, bool, type(None)) for one in parts)
        return f"Literal[{', '.join(map(repr, parts))}]" if plain else None
    texts = [text_of_type(part) for part in parts]
    if None not in texts and origin in (Union, types.UnionType):
        return " | ".join(map(str, texts))
    if None not in texts and isinstance(origin, type):
        within = ", ".join(map(str, texts)) or "()"
        named = _name_of_class(origin)
        return None if named is None else f"{named}[{within}]"
    return _name_of_class(hint) if isinstance(hint, type) and not parts else _name_of_alias(hint)


def _name_of_class(kind: type) -> str | None:
    if look_up(kind.__module__, kind.__qualname__) is not kind:
        return None
    return kind.__qualname__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__qualname__}"


def _name_of_alias(hint: object) -> str | None:
    """The name that a module has given to a type that has none of its own, such as an array of a shape.

    An equal type is as good: which of several equal ones `typing` returns depends on what was imported before.
    """
    equal: str | None = None
    for name, module in list(sys.modules.items()):
        for own, value in list(getattr(module, "__dict__", {}).items()):
            if not own.isidentifier():
                continue
            if value is hint:
                return f"{name}.{own}"
            if equal is None and type(value) is type(hint) and value == hint:
                equal = f"{name}.{own}"
    return equal


def type_of_text(text: str, where: str) -> Any:  # noqa: ANN401 - any type hint
    """Read a type.

    Raises:
      GraphError: the text is not a type, or names something that does not exist; the message begins with `where`.
    """
    remedy = 'write it as in "int" or "list[my_robot.types.Pose]"'
    if not isinstance(text, str):
        raise GraphError(f"{where}: a type is given as a text, got {text!r}; {remedy}")
    try:
        return _read(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError) as error:  # the last: nested too deeply
        said = str(error) or "it is nested too deeply"
        raise GraphError(f'{where}: "{text:.200}" is not a type ({said:.200}); {remedy}') from error


def _read(node: ast.expr) -> Any:  # noqa: ANN401
    match node:
        case ast.Constant(value=None):
            return None
        case ast.Constant(value=value) if value is ...:
            return ...
        case ast.Name() | ast.Attribute():
            return _found(ast.unparse(node))
        case ast.BinOp(left=left, op=ast.BitOr(), right=right):
            return Union[_read(left), _read(right)]  # noqa: UP007 - of values
        case ast.Subscript(value=ast.Name(id="Literal"), slice=inner):
            return Literal[ast.literal_eval(inner)]
        case ast.Subscript(value=value, slice=ast.Tuple(elts=elements)):
            return _read(value)[tuple(map(_read, elements))]
        case ast.Subscript(value=value, slice=inner):
            return _read(value)[_read(inner)]
    raise ValueError(f"what is {ast.unparse(node)}?")


def _found(name: str) -> Any:  # noqa: ANN401
    """Return the object of this name, in a module or in Python."""
    if name == "Any":
        return Any
    *modules, last = name.split(".")
    if not modules:
        modules = ["builtins"]
    ends = range(len(modules), 0, -1)
    for end in ends:  # what is imported already needs no import of another module that might be meant
        found = look_up(".".join(modules[:end]), ".".join([*modules[end:], last]))
        if found is not None:
            return found
    for end in ends:
        module = ".".join(modules[:end])
        try:
            importlib.import_module(module)
        except ImportError:
            continue
        except Exception as error:  # code of users raises what it likes
            raise ValueError(f"importing {module} failed, {type(error).__name__}: {error}") from error
        found = look_up(module, ".".join([*modules[end:], last]))
        if found is not None:
            return found
    raise ValueError(f"there is no {name}")
