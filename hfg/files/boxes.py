"""Types of subgraphs that a document describes: with its ports, its parameters and, as `build`, its inside.

A subgraph that stands in a file of its own has one type for all its nodes, which is found by name like any other:
`hfg.files.boxes:File[...]`. Who fills the inside hands that down. Stands on `document` and the editing wing.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final
from urllib.parse import quote, unquote

import annotated_types

from hfg.encoding import Find, encode
from hfg.errors import EncodingError, GraphError, HfgError
from hfg.files.document import BoxDocument, Document
from hfg.files.values import decoded
from hfg.graph.editing.type_texts import type_of_text
from hfg.graph.graph import Enclosed, Graph, Subgraph
from hfg.ports import Event, Input, Output, Parameter, ParameterSpec, slot
from hfg.ports.conditions import Condition
from hfg.ports.kinds import type_of_choices

__all__ = ["LIMITS", "FileBox", "box_type", "conditions_in_words", "file_box_type", "file_of", "limits_in_words"]

Fill = Callable[[Any, Graph], None]
"""Takes a subgraph and the graph inside it."""

LIMITS: Final[dict[str, tuple[type[Any], str]]] = {
    "gt": (annotated_types.Gt, "gt"),
    "ge": (annotated_types.Ge, "ge"),
    "lt": (annotated_types.Lt, "lt"),
    "le": (annotated_types.Le, "le"),
    "multiple_of": (annotated_types.MultipleOf, "multiple_of"),
    "min_length": (annotated_types.MinLen, "min_length"),
    "max_length": (annotated_types.MaxLen, "max_length"),
}
"""By the word that a file has for it: the limit, and the attribute that holds its value."""

_KINDS: Final[tuple[tuple[str, Callable[[Any], Any]], ...]] = (
    ("inputs", Input),
    ("outputs", Output),
    ("events", Event),
    ("slots", lambda hint: slot(type=hint)),
)
_MADE: Final[dict[Path, type[FileBox]]] = {}
"""The newest type of each file."""


class FileBox(Subgraph):
    """A subgraph that a file describes."""

    _file: ClassVar[Path]
    _document: ClassVar[Document]
    _parts: ClassVar[Mapping[str, type[FileBox]]]
    """The types of the files that it includes, by how it names them."""
    _fill: ClassVar[Fill]
    _read: ClassVar[Callable[[Path], type[FileBox]]]
    """Makes the type of a file that was not read yet; `building` gives it, which stands above."""

    def build(self, graph: Graph) -> None:
        """Make what the file says."""
        type(self)._fill(self, graph)


def box_type(
    box: BoxDocument, path: str, fill: Fill, said: Callable[[str, str, str], None], find: Find
) -> type[Enclosed]:
    """Make the type of a subgraph that a document describes where it stands.

    Args:
      box: what is inside, and the ports.
      path: of the subgraph, for messages.
      fill: is called when a node of it is added.
      said: is told what of its ports cannot be: the kind, the name and the sentence.
      find: gives what values of its parameters refer to.
    """
    body = dict(_declarations(box, said, find)) | {"build": lambda self, graph: fill(self, graph)}
    try:
        made: type[Enclosed] = types.new_class("Enclosed", (Enclosed,), exec_body=lambda names: names.update(body))
    except HfgError as error:
        said("", "", str(error))
        return box_type(BoxDocument(), path, fill, said, find)
    return made


def file_box_type(
    file: Path,
    document: Document,
    parts: Mapping[str, type[FileBox]],
    fill: Fill,
    said: Callable[[str, str, str], None],
    find: Find,
) -> type[FileBox]:
    """Make the type of the subgraphs that a file describes; the one there is, if the file says the same as ever."""
    known = _MADE.get(file)
    if known is not None and known._document == document and known._parts == parts:
        return known
    body: dict[str, Any] = dict(_declarations(document, said, find)) | {
        "__module__": __name__,
        "__qualname__": f"File[{quote(str(file), safe='').replace('.', '%2E')}]",
        "__doc__": f"The subgraph in {file.name}.",
        "_file": file,
        "_document": document,
        "_parts": parts,
        "_fill": staticmethod(fill),
    }
    name = "".join(part.title() for part in file.name.partition(".")[0].replace("-", "_").split("_")) or "Box"
    try:
        made: type[FileBox] = types.new_class(name, (FileBox,), exec_body=lambda names: names.update(body))
    except HfgError as error:
        said("", "", str(error))
        return FileBox
    _MADE[file] = made
    return made


def _declarations(box: BoxDocument, said: Callable[[str, str, str], None], find: Find) -> Iterator[tuple[str, Any]]:
    """What stands in the body of the class; what cannot is told and left out."""
    names: set[str] = set()
    for kind, declared in _KINDS:
        for name, text in getattr(box, kind).items():
            try:
                _need_port_name(name, names)
                yield name, declared(type_of_text(text, f'"{name}"'))
            except HfgError as error:
                said(kind, name, str(error))
    for name in box.parameters:
        try:
            _need_port_name(name, names)
            yield name, _parameter(name, box, find)
        except HfgError as error:
            said("parameters", name, str(error))


def _need_port_name(name: str, names: set[str]) -> None:
    if not name.isidentifier() or name.startswith("_") or hasattr(Subgraph, name):
        raise GraphError(f'a port of a subgraph cannot be called "{name}"; choose another name')
    if name in names:
        raise GraphError(f'the subgraph has two ports "{name}"; give each a name of its own')
    names.add(name)


def _parameter(name: str, box: BoxDocument, find: Find) -> Parameter[Any]:
    said = box.parameters[name]
    hint = type_of_text(said.type, f'"{name}"')
    limits = _limits(said.limits)
    choices: Any = None
    if said.choices is not None:
        choices = [decoded(one, type_of_choices(hint), find) for one in said.choices]
    if said.labels:
        if len(said.labels) != len(choices or ()) or len(set(said.labels)) < len(said.labels):
            raise GraphError(
                f"labels are what to call the choices; there are {len(choices or ())} choices and {len(said.labels)} "
                "labels, so give each choice one of its own, or leave labels out"
            )
        choices = dict(zip(said.labels, choices, strict=True))
    return Parameter(
        decoded(said.default, hint, find),
        *limits,
        unit=said.unit,
        choices=choices,
        step=said.step,
        group=said.group,
        help=said.help,
        shown_if=_conditions(name, box, find),
        pattern=said.pattern,
        directory=said.directory,
        save=said.save,
        type=hint,
    )


def _limits(said: Mapping[str, Any]) -> list[Any]:
    unknown = [word for word in said if word not in LIMITS]
    if unknown:
        raise GraphError(f'"{unknown[0]}" is no limit; there are {", ".join(LIMITS)}')
    return [LIMITS[word][0](value) for word, value in said.items()]


class _Together(annotated_types.GroupedMetadata):
    """Several limits where one is asked for."""

    def __init__(self, limits: list[Any]) -> None:
        self.limits = limits

    def __iter__(self) -> Iterator[Any]:
        return iter(self.limits)


def _conditions(name: str, box: BoxDocument, find: Find) -> Any:
    """Read `shown_if`; what is none of its forms is for the declaration to refuse."""
    said = box.parameters[name].shown_if
    if not isinstance(said, dict):
        return said
    wanted: dict[str, Any] = {}
    for other, one in said.items():
        if isinstance(one, dict):
            wanted[other] = _Together(_limits(one))
        elif other in box.parameters:
            hint = type_of_text(box.parameters[other].type, f'"{other}"')
            several = one if isinstance(one, list) else [one]
            wanted[other] = [decoded(value, hint, find) for value in several]
        else:
            wanted[other] = one
    return wanted


def conditions_in_words(conditions: tuple[Condition, ...], parameters: Mapping[str, ParameterSpec]) -> Any:
    """Give conditions as a file has them, in the words of the declaration: a name, or by name what others must be.

    Raises:
      EncodingError: a value in them is no data.
    """
    found: dict[str, Any] = {}
    for one in conditions:
        if one.on:
            return one.parameter
        values = [encode(value, parameters[one.parameter].type) for value in one.values]
        limits = limits_in_words(one.limits)
        if limits is None:
            raise EncodingError(f"a condition asks for {one.limits!r:.80}, which a file cannot say")
        plain = values[0] if len(values) == 1 and not isinstance(values[0], dict | list) else values
        found[one.parameter] = plain if values else limits
    return found or None


def limits_in_words(limits: tuple[Any, ...]) -> dict[str, Any] | None:
    """Give limits as a file has them; None if one cannot be said."""
    found: dict[str, Any] = {}
    for limit in limits:
        word = next((word for word, (kind, _) in LIMITS.items() if type(limit) is kind), None)
        if word is None or word in found:
            return None
        found[word] = getattr(limit, LIMITS[word][1])
    return found


def file_of(reference: str) -> Path | None:
    """Give the file that the reference of a type stands for; None of others."""
    module, _, name = reference.partition(":")
    if module != __name__ or not (name.startswith("File[") and name.endswith("]")):
        return None
    return Path(unquote(name.removeprefix("File[").removesuffix("]")))


def __getattr__(name: str) -> Any:
    if name.startswith("File[") and name.endswith("]"):
        file = Path(unquote(name.removeprefix("File[").removesuffix("]")))
        if file not in _MADE:
            return FileBox._read(file)
        return _MADE[file]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
