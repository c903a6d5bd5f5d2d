"""Node types in the JSON schema of graph files, so that editors complete types and parameters and check values.

A type that is not listed is any text, and its parameters are not checked. Depends on the catalogue's descriptions.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable
from math import isfinite
from typing import Any, Final

from hfg.catalogue.describing import ParameterDescription, TypeDescription
from hfg.encoding import TAG

_LIMITS: Final = {
    "ge": "minimum",
    "gt": "exclusiveMinimum",
    "le": "maximum",
    "lt": "exclusiveMaximum",
}

_INFINITE: Final = "^(-?inf|nan)$"
"""How files write what JSON has no number for."""


def with_types(schema: dict[str, Any], types: Iterable[TypeDescription]) -> dict[str, Any]:
    """Let a schema of graph files know node types.

    Args:
      schema: is changed.
      types: those to know.
    """
    defs = schema["$defs"]
    node = defs["NodeDocument"]
    known = sorted(types, key=lambda one: one.reference)
    said = node["properties"]["type"]
    node["properties"]["type"] = {
        "description": said["description"],
        "anyOf": [
            *({"const": one.reference, "title": one.title, "description": one.summary} for one in known),
            {"type": "string"},
        ],
    }
    node["allOf"] = [_rule(one) for one in known]
    for one in known:
        defs[f"parameters of {one.reference}"] = _parameters(one)
    return schema


def _rule(one: TypeDescription) -> dict[str, Any]:
    place = f"parameters of {one.reference}".replace("~", "~0").replace("/", "~1").replace(" ", "%20")
    then: dict[str, Any] = {"properties": {"parameters": {"$ref": f"#/$defs/{place}"}}}
    if any(parameter.required for parameter in one.parameters):
        then["required"] = ["parameters"]
    return {"if": {"properties": {"type": {"const": one.reference}}, "required": ["type"]}, "then": then}


def _parameters(one: TypeDescription) -> dict[str, Any]:
    settable = [parameter for parameter in one.parameters if not parameter.trigger]
    required = [parameter.name for parameter in settable if parameter.required]
    made: dict[str, Any] = {
        "description": one.summary,
        "type": "object" if required else ["object", "null"],
        "properties": {parameter.name: _parameter(parameter) for parameter in settable},
        "additionalProperties": False,
    }
    return made | ({"required": required} if required else {})


def _parameter(one: ParameterDescription) -> dict[str, Any]:
    """Say what a parameter is, and what a file may give it."""
    forms = [_FORMS.get(one.kind, _anything)(one)]
    if "None" in one.type or one.default is None:
        forms.append({"type": "null"})
    if one.kind in ("list", "vector", "choices"):
        forms.append({"type": "object", "required": [TAG]})  # where the declared type leaves open which list it is
    value = forms[0] if len(forms) == 1 or not forms[0] else {"anyOf": forms}
    words = [one.doc or one.type, *([f"In {one.unit}."] if one.unit else []), *_in_words(one)]
    made = {"description": " ".join(words), **value}
    default = _plain(one.default)
    return made if one.required or default is None else {**made, "default": default}


def _in_words(one: ParameterDescription) -> list[str]:
    limits = one.limits_in_words()
    return [f"Allowed: {', '.join(limits)}."] if limits else []


# --- what a file may say, by the kind of a parameter ------------------------------------------------------------------


def _anything(_one: ParameterDescription) -> dict[str, Any]:
    return {}


def _whole(one: ParameterDescription) -> dict[str, Any]:
    steps = one.limits.get("multiple_of")
    return {"type": "integer", **_limits(one, _LIMITS), **({"multipleOf": steps} if steps else {})}


def _real(one: ParameterDescription) -> dict[str, Any]:
    limits = _limits(one, _LIMITS)
    if len(limits) > 1:
        return {"type": "number", **limits}
    return {"type": ["number", "string"], "pattern": _INFINITE, **limits}


def _text(one: ParameterDescription) -> dict[str, Any]:
    return {"type": "string", **_limits(one, {"min_length": "minLength", "max_length": "maxLength"})}


def _list(one: ParameterDescription) -> dict[str, Any]:
    return {"type": "array", **_limits(one, {"min_length": "minItems", "max_length": "maxItems"})}


def _vector(one: ParameterDescription) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number", **_limits(one, _LIMITS)}}


def _choice(one: ParameterDescription) -> dict[str, Any]:
    choices = [_plain(value) for value in one.choices or ()]
    if not choices or None in choices:
        return {}
    labels = [label for label in one.labels if label not in choices]
    return {"enum": [*choices, *labels]}


def _choices(one: ParameterDescription) -> dict[str, Any]:
    return {"type": "array", "items": _choice(one)}


def _limits(one: ParameterDescription, names: dict[str, str]) -> dict[str, Any]:
    return {told: one.limits[name] for name, told in names.items() if name in one.limits}


def _plain(value: Any) -> Any:
    """A value as JSON, where that is what a file has for it."""
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value if isinstance(value, bool | int | float | str) else None


_FORMS: Final[dict[str, Callable[[ParameterDescription], dict[str, Any]]]] = {
    "bool": lambda _one: {"type": "boolean"},
    "int": _whole,
    "float": _real,
    "text": _text,
    "path": _text,
    "list": _list,
    "vector": _vector,
    "choice": _choice,
    "choices": _choices,
}
"""Other kinds have forms that JSON Schema cannot tell apart; the loader checks them."""
