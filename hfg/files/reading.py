"""Makes a document of the text of a graph file, and finds everything that is wrong with its shape at once.

What a document may hold is read from its structs. Whoever builds a graph of it later finds the lines in `Read.lines`.
Depends on `opening`, `parsing` and `document`.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
from msgspec import inspect

from hfg.base.controls import name_problem
from hfg.files.findings import Findings, Lines, graph_path
from hfg.files.opening import SUFFIX, bytes_of, text_in
from hfg.files.parsing import Located, parse, plain
from hfg.graph.editing.document import VERSION, Document, EdgeDocument, MonitorDocument, NodeDocument, OperatorDocument
from hfg.graph.editing.from_document import Key
from hfg.graph.structure.naming import nearest

_ARROW: Final = " -> "
_SAYS: Final = ("type", "file", "graph")
_WRONG: Final = msgspec.UNSET  # stands for a value that was reported


class Read(NamedTuple):
    """A document that was read.

    Attributes:
      document: what the file says.
      lines: where each part of it stands.
      file: what messages call it.
      lost: where nodes stand that are left out, for something about them is wrong.
    """

    document: Document
    lines: Lines
    file: str
    lost: frozenset[Key] = frozenset()


def read_file(path: Path, file: str, findings: Findings) -> Read | None:
    """Read a file; None if nothing of use is in it, and then a finding says why."""
    data = bytes_of(path, file, findings, SUFFIX)
    return None if data is None else read_bytes(data, file, findings)


def read_bytes(data: bytes, file: str, findings: Findings) -> Read | None:
    """Read what a file holds."""
    text = text_in(
        data,
        file,
        findings,
        small="put large data into files of its own",
        text="a graph file is text, see docs/howto/files.md",
    )
    if text is None:
        return None
    found = parse(text, lambda line, sentence: findings.add(file, line, "", sentence))
    if found is None or found.value is None:
        if not findings.problems:
            findings.add(file, 1, "", f"nothing is in it; begin it with a line hfg: {VERSION}")
        return None
    reading = _Reading(file, findings)
    document = reading.document(found)
    return None if document is None else Read(document, reading.lines, file, frozenset(reading.lost))


class _Reading:
    """Follows the structs and the values of a file side by side."""

    def __init__(self, file: str, findings: Findings) -> None:
        self.file = file
        self.findings = findings
        self.lines: dict[Key, int] = {}
        self.labels: dict[Key, str] = {}
        self.lost: set[Key] = set()

    def wrong(self, at: Located, key: Key, sentence: str) -> Any:
        """Report something; gives what stands for it."""
        self.findings.add(self.file, at.line, graph_path(key, self.labels.get), sentence)
        return _WRONG

    def document(self, found: Located) -> Document | None:
        if not isinstance(found.value, dict):
            self.wrong(found, (), f"a graph file is a mapping, got {_what(found)}; begin it with a line hfg: {VERSION}")
            return None
        version = found.value.get("hfg")
        if version is None:
            self.wrong(found, (), f"it does not say which version of the format it has; add a line hfg: {VERSION}")
            return None
        if version.value != VERSION or type(version.value) is not int:
            newer = isinstance(version.value, int) and version.value > VERSION
            remedy = "update hfg" if newer else f"write hfg: {VERSION}, and see docs/howto/files.md for what it holds"
            self.wrong(
                version, (), f"version {version.value!r:.40} of the format is not known, only {VERSION} is; {remedy}"
            )
            return None
        read = self.struct(found, Document, ())
        if not isinstance(read, Document):
            return None
        problem = name_problem(read.name)
        if problem is not None:
            self.wrong(found.value["name"], ("name",), f"a graph {problem}")
            read.name = ""
        return read

    # --- by what is expected ---

    def value(self, found: Located, expected: inspect.Type, key: Key) -> Any:
        self.lines[key] = found.line
        match expected:
            case inspect.AnyType():
                return plain(found)
            case inspect.StructType(cls=cls):
                if cls is EdgeDocument:
                    return self.edge(found, key)
                if cls is OperatorDocument and isinstance(found.value, str):
                    return OperatorDocument(found.value)
                if cls is MonitorDocument and isinstance(found.value, str):
                    return MonitorDocument(property=found.value)
                return self.struct(found, cls, key)
            case inspect.DictType(value_type=inner):
                return self.mapping(found, inner, key)
            case inspect.ListType(item_type=inner):
                return self.list(found, inner, key)
            case inspect.VarTupleType(item_type=inner):
                several = self.list(found, inner, key)
                return several if several is _WRONG else tuple(several)
            case inspect.UnionType(types=types):
                return self.one_of(found, types, key)
            case inspect.LiteralType(values=values):
                return self.choice(found, values, key)
        return self.scalar(found, expected, key)

    def one_of(self, found: Located, types: tuple[inspect.Type, ...], key: Key) -> Any:
        if found.value is None and any(isinstance(one, inspect.NoneType) for one in types):
            return None
        inners = [one for one in types if not isinstance(one, inspect.NoneType)]
        is_switch = isinstance(found.value, bool)  # of those with two, one is true or false
        fits = [one for one in inners if isinstance(one, inspect.BoolType) == is_switch]
        return self.value(found, (fits or inners)[0], key)

    def choice(self, found: Located, values: tuple[bool | str | int | None, ...], key: Key) -> Any:
        if found.value in values:
            return found.value
        words = ", ".join(str(one) for one in values)
        return self.wrong(
            found, key, f"{_last(key)} is one of {words}, got {_what(found)}{_meant(found.value, values)}"
        )

    def scalar(self, found: Located, expected: inspect.Type, key: Key) -> Any:
        value = found.value
        match expected:
            case inspect.StrType() if isinstance(value, str):
                return value
            case inspect.BoolType() if isinstance(value, bool):
                return value
            case inspect.IntType() if isinstance(value, int) and not isinstance(value, bool):
                return value
            case inspect.FloatType() if isinstance(value, int | float) and not isinstance(value, bool):
                return value
        words = {
            inspect.StrType: "a text",
            inspect.BoolType: "true or false",
            inspect.IntType: "a whole number",
            inspect.FloatType: "a number",
        }
        remedy = (
            f'write it in quotes, "{value}"'
            if isinstance(expected, inspect.StrType) and not isinstance(value, dict | list | None)
            else "correct it, or take it out"
        )
        return self.wrong(found, key, f"{_last(key)} is {words[type(expected)]}, got {_what(found)}; {remedy}")

    def mapping(self, found: Located, inner: inspect.Type, key: Key) -> Any:
        if not isinstance(found.value, dict):
            if found.value is None:  # all that was below it was taken out
                return {}
            sentence = f"{_last(key)} is a mapping by name, got {_what(found)}; write a line name: below it"
            return self.wrong(found, key, sentence)
        values = {name: self.value(one, inner, (*key, name)) for name, one in found.value.items()}
        if _last(key) == "nodes":
            self.lost.update((*key, name) for name, value in values.items() if value is _WRONG)
        return {name: value for name, value in values.items() if value is not _WRONG}

    def list(self, found: Located, inner: inspect.Type, key: Key) -> Any:
        if not isinstance(found.value, list):
            if found.value is None:
                return []
            return self.wrong(
                found, key, f"{_last(key)} is a list, got {_what(found)}; write each on a line behind a dash"
            )
        values = [self.value(one, inner, (*key, number)) for number, one in enumerate(found.value)]
        if isinstance(inner, inspect.AnyType):
            return values
        return [value for value in values if value is not _WRONG]

    def struct(self, found: Located, cls: type[Any], key: Key, given: dict[str, Any] | None = None) -> Any:
        if found.value is None:  # the document has no value for it
            found = Located({}, found.line)
        if not isinstance(found.value, dict):
            name = f'"{key[-1]}"' if key and isinstance(key[-1], str) else _last(key)
            return self.wrong(
                found, key, f"{name} is a mapping, got {_what(found)}; say what it is on the lines below it"
            )
        fields = _fields(cls)  # type: ignore[arg-type]  # each class has a hash
        said: dict[str, Any] = dict(given or {})
        complete = known = True
        for name, one in found.value.items():
            if name not in fields or (given is not None and name in given):
                remedy = _meant(name, fields, f"it may hold {', '.join(fields)}")
                self.wrong(one, (*key, name), f'nothing here is called "{name}"{remedy}')
                known = False
                continue
            value = self.value(one, fields[name].type, (*key, name))
            if value is not _WRONG:
                said[name] = value
            elif fields[name].required:
                complete = False
        missing = [name for name, field in fields.items() if field.required and name not in said]
        if missing and complete:
            self.wrong(found, key, f"{' and '.join(missing)} is missing; add a line {missing[0]}: below it")
        if missing:
            return _WRONG
        read = cls(**said)
        if cls is NodeDocument and not self.is_one(found, read, key, known):
            return _WRONG
        return read

    def is_one(self, found: Located, node: NodeDocument, key: Key, known: bool) -> bool:
        """Return whether a node says what it is, and says it once; a word that is not known may have been meant so."""
        if not (node.type or node.file or node.graph is not None):
            told = any(found.value[name].value not in (None, "") for name in _SAYS if name in found.value)
            if known and not told:
                remedy = "add a line type: module:name, file: or graph: below it"
                self.wrong(found, key, f"it does not say what it is; {remedy}")
            return False
        if node.file and (node.type or node.graph is not None):
            other = "type" if node.type else "graph"
            self.wrong(found.value["file"], key, f"it has a file and a {other}; take one of them out")
            return False
        return True

    # --- edges ---

    def edge(self, found: Located, key: Key) -> Any:
        """An edge is a label, a label with options below it, or a mapping with source and target."""
        value = found.value
        if isinstance(value, dict) and not {"source", "target"} & value.keys() and len(value) == 1:
            label, options = next(iter(value.items()))
            ends = self.ends(found, label, key)
            if ends is _WRONG or options.value is None:
                return ends if ends is _WRONG else EdgeDocument(**ends)
            return self.struct(options, EdgeDocument, key, given=ends)
        if isinstance(value, dict):
            return self.struct(found, EdgeDocument, key)
        if not isinstance(value, str):
            return self.wrong(found, key, f"an edge is a text, got {_what(found)}; write source.port -> target.port")
        ends = self.ends(found, value, key)
        return ends if ends is _WRONG else EdgeDocument(**ends)

    def ends(self, found: Located, label: str, key: Key) -> Any:
        source, arrow, target = label.partition(_ARROW)
        if not (arrow and source.strip() and target.strip()) or _ARROW in target:
            return self.wrong(found, key, f'"{label:.80}" is no edge; write source.port -> target.port')
        self.labels[key] = label
        return {"source": source.strip(), "target": target.strip()}


@functools.cache
def _fields(cls: Any) -> dict[str, inspect.Field]:
    described = inspect.type_info(cls)
    assert isinstance(described, inspect.StructType)
    return {field.name: field for field in described.fields}


def _last(key: Key) -> str:
    names = [one for one in key if isinstance(one, str)]
    number = f" {key[-1] + 1}" if key and isinstance(key[-1], int) else ""
    return (names[-1] if names else "it") + number


def _meant(word: object, known: Iterable[Any], otherwise: str = "") -> str:
    near = nearest(str(word), [str(one) for one in known])
    if near is not None:
        return f'; did you mean "{near}"?'
    return f"; {otherwise}" if otherwise else "; choose one of them"


def _what(found: Located) -> str:
    match found.value:
        case None:
            return "nothing"
        case dict():
            return "a mapping"
        case list():
            return "a list"
        case str(text):
            return f'the text "{text:.60}"'
        case bool(value):
            return "true" if value else "false"
    return f"{found.value!r:.60}"
