"""The JSON schema of graph files, made of the structs of `document`; editors complete and check by it.

`graph.schema.json` beside this is what it gives, for who has no Python at hand. `typed` adds node types.
Depends on `document`.
"""

from __future__ import annotations

import inspect
import json
from typing import Any, Final

import docstring_parser
import msgspec

from hfg.graph.editing import document
from hfg.graph.editing.commands import Operator
from hfg.graph.editing.document import VERSION, Document, EdgeDocument, MonitorDocument
from hfg.graph.structure.option import Fields, declared

_LABEL: Final = {
    "type": "string",
    "pattern": "^.+ -> .+$",
    "description": "source.port -> target.port",
}


def schema_text(schema: dict[str, Any]) -> str:
    """Return it as text."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def json_schema() -> dict[str, Any]:
    """Return it as data."""
    (top,), components = msgspec.json.schema_components([Document], ref_template="#/$defs/{name}")
    for name, component in components.items():
        _describe(getattr(document, name), component)
    operator = components["Operator"]
    components["Operator"] = {
        "title": Operator.__name__,
        "anyOf": [{"type": "string", "description": "its reference, where it is given nothing"}, operator],
    }
    components["MonitorDocument"] = {
        "title": MonitorDocument.__name__,
        "anyOf": [
            {"type": "string", "description": "its property, where it has no options"},
            components["MonitorDocument"],
        ],
    }
    components["EdgeDocument"] = _edge(components["EdgeDocument"])
    components["NodeDocument"]["anyOf"] = [{"required": [name]} for name in ("type", "file", "graph")]
    components["Document"]["properties"]["hfg"] = {"const": VERSION, "description": "the version of the format"}
    components["Document"]["required"] = ["hfg"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "hfg graph file",
        **top,
        "$defs": components,
    }


def _describe(struct: type[Any], component: dict[str, Any]) -> None:
    """Say in it what the docstrings say, and that there is nothing else; what is left empty is nothing said."""
    told = docstring_parser.parse(inspect.getdoc(struct) or "")
    component["description"] = told.short_description or ""
    component["additionalProperties"] = False
    for parameter in told.params:
        if parameter.arg_name in component["properties"]:
            component["properties"][parameter.arg_name]["description"] = " ".join((parameter.description or "").split())
    for name, one in declared(struct).items() if issubclass(struct, Fields) else ():
        option, property_ = one.option, component["properties"][name]
        property_["description"] = option.says
        limits = {"minimum": option.least, "maximum": option.most, "exclusiveMinimum": option.above}
        property_ |= {word: limit for word, limit in limits.items() if limit is not None}
    for name, one in component["properties"].items():
        if one.get("type") in ("object", "array") and name not in ("position", "choices"):
            one["type"] = [one["type"], "null"]


def _edge(full: dict[str, Any]) -> dict[str, Any]:
    """An edge has three forms: a label, a label with options below it, and both ends by name."""
    options = {name: one for name, one in full["properties"].items() if name not in ("source", "target")}
    below = {"type": ["object", "null"], "properties": options, "additionalProperties": False}
    labelled = {
        "type": "object",
        "patternProperties": {_LABEL["pattern"]: below},
        "minProperties": 1,
        "maxProperties": 1,
        "additionalProperties": False,
    }
    return {"title": EdgeDocument.__name__, "description": full["description"], "anyOf": [_LABEL, labelled, full]}
