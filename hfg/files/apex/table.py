"""The types of CS::APEX and what they are here, as data from `types.yaml`.

A plug-in's own type of the same class name but another namespace is none of these. Depends on msgspec.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any, Final, Literal

import msgspec
import yaml

As = Literal["same", "float", "lower", "square", "first", "second", "from", "into", "ending"]

_NAMESPACES: Final = ("csapex::", "vision_plugins::", "csapex::vision_plugins::")


class ParameterRule(msgspec.Struct, rename={"how": "as"}, forbid_unknown_fields=True):
    """Where a parameter goes.

    Attributes:
      to: its name here.
      how: what becomes of its value: "square" makes (k, k) of k, "first" and "second" are the parts of a pair, "from"
        and "into" those of a word such as "BGR2HSV"; "ending" takes that of a name of a file.
      values: of a set: the values here of its texts, which are all that is known.
    """

    to: str
    how: As = "same"
    values: dict[str, Any] = {}


class TypeRule(msgspec.Struct, forbid_unknown_fields=True):
    """What a type is here.

    Attributes:
      type: its reference.
      inputs: the names of its ports in the order of their numbers; so the next three.
      triggers: its trigger parameters in the order of their declaration, and the slots they are here.
      parameters: by their names there, where they go.
      shown: parameters that show what has come, and the outputs that they are here; {} stands for any number.
      same: parameters without a counterpart, and the value with which that makes no difference.
      set: parameters that are only here; "{name}" is the node's name.
      made_by: the function that changes the rule for a node, if its type depends on its parameters.
      differs: why the node does not do the same in all cases.
    """

    type: str
    inputs: list[str] = []
    outputs: list[str] = []
    slots: list[str] = []
    events: list[str] = []
    triggers: dict[str, str] = {}
    parameters: dict[str, str | ParameterRule] = {}
    shown: dict[str, str] = {}
    same: dict[str, Any] = {}
    set: dict[str, Any] = {}
    made_by: Literal["", "file_importer"] = ""
    differs: str = ""

    def parameter(self, name: str) -> ParameterRule | None:
        """Return where a parameter goes."""
        found = self.parameters.get(name)
        return ParameterRule(found) if isinstance(found, str) else found

    def output_of(self, name: str) -> str | None:
        """Return which output a parameter is that shows what has come."""
        for pattern, output in self.shown.items():
            before, _, behind = pattern.partition("{}")
            number = name.removeprefix(before).removesuffix(behind) if "{}" in pattern else ""
            if name == f"{before}{number}{behind}" and number.isdecimal() is ("{}" in pattern):
                return output.format(number)
        return None


@cache
def rules() -> dict[str, TypeRule]:
    """Return what is known of all types, by their names behind the namespaces of CS::APEX."""
    text = files(__package__).joinpath("types.yaml").read_text(encoding="utf-8")
    return msgspec.convert(yaml.safe_load(text), dict[str, TypeRule])


def rule_of(kind: str) -> TypeRule | None:
    """Return what is known of a type, named as in a file; None if that is nothing."""
    for namespace in sorted(_NAMESPACES, key=len, reverse=True):
        if kind.startswith(namespace):
            return rules().get(kind.removeprefix(namespace))
    return None
