"""Reads a file of CS::APEX, `*.apex`, or a snippet, `*.apexs`, and finds everything that is wrong with its shape.

Keys may come in any order and most may be missing; what a version before or after writes more is kept and not refused.
Depends on the opening and parsing of graph files and on `document`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from hfg.files.apex.document import ApexConnection, ApexFile, ApexGraph, ApexNode, ApexParameter, ApexThread
from hfg.files.findings import Findings
from hfg.files.opening import bytes_of, text_in
from hfg.files.parsing import Located, parse, plain

SUFFIXES: Final = (".apex", ".apexs")
SEPARATOR: Final = ":|:"

_HANDLED: Final = ("nodes", "connections", "fulcrums", "threads", "version", "name", "description", "yaml")
_NUMBER: Final = (int, float)
_NO_VALUE: Final = ("trigger", "progress", "null", "text", "output_progress", "output_text")
_VALUES: Final[tuple[str, ...]] = ("int", "double", "bool", "string", "long")


def read_file(path: Path, file: str, findings: Findings) -> ApexFile | None:
    """Read a file; None if nothing of use is in it, and then a finding says why."""
    data = bytes_of(path, file, findings, *SUFFIXES)
    if data is None:
        return None
    text = text_in(
        data,
        file,
        findings,
        small="no graph of CS::APEX is that large",
        text="a graph of CS::APEX is text, messages are not imported",
    )
    if text is None:
        return None
    reader = _Reader(lambda line, sentence, where="": findings.add(file, line, where, sentence))
    count = len(findings.problems)
    root = parse(text, reader.said)
    if root is None and len(findings.problems) == count:
        findings.add(file, 1, "", "there is nothing in it; name a file that CS::APEX has saved")
    return None if root is None else reader.file(root)


class _Reader:
    """Takes a file apart."""

    def __init__(self, said: Callable[..., None]) -> None:
        self.said = said
        self.is_new = False

    def file(self, root: Located) -> ApexFile | None:
        top = self.mapping(root, "a file of CS::APEX")
        if top is None:
            return None
        self.version(top.get("version"))
        inner = top
        if "yaml" in top:  # a snippet
            inner = self.mapping(top["yaml"], "yaml") or {}
        if "nodes" not in inner:
            self.said(root.line, "there are no nodes in it; name a file that CS::APEX has saved")
            return None
        found = ApexFile(self.graph(inner, ""))
        for key in ("name", "description"):
            if key in top and isinstance(top[key].value, str):
                setattr(found, key, top[key].value.strip())
        self.threads(inner.get("threads"), found)
        found.is_new = self.is_new
        found.rest = {key: plain(one) for key, one in (top | inner).items() if key not in _HANDLED}
        return found

    def version(self, said: Located | None) -> None:
        if said is None or said.value is None:
            return
        self.is_new = True
        parts = self.mapping(said, "version") or {}
        major = parts["major"].value if "major" in parts else 0
        # CS::APEX itself reads the last number of a version as its first, so what it has saved again may have that.
        if not _is_int(major) or not 0 <= major <= 1:
            self.said(
                said.line,
                f"it is of version {major}, and versions 0 and 1 are known; save it with CS::APEX 1.0, "
                "or correct the number",
            )

    # --- graphs ---

    def graph(self, said: dict[str, Located], path: str) -> ApexGraph:
        graph = ApexGraph()
        for item in self.items(said.get("nodes"), "nodes"):
            node = self.node(item, path)
            if node is None:
                continue
            if node.uuid in graph.nodes:
                first = graph.nodes[node.uuid].line
                self.said(
                    item.line,
                    f"its uuid is also that of the node in line {first}; give one of them another, and its connections",
                    path + node.uuid,
                )
                continue
            graph.nodes[node.uuid] = node
        for item in self.items(said.get("connections"), "connections"):
            graph.connections += self.connections(item)
        graph.fulcrums = len(self.items(said.get("fulcrums"), "fulcrums"))
        return graph

    def node(self, item: Located, path: str) -> ApexNode | None:
        entry = self.mapping(item, "a node")
        if entry is None:
            return None
        texts = {}
        for key in ("uuid", "type"):
            one = entry.get(key)
            if one is None or not isinstance(one.value, str) or not one.value:
                self.said(item.line, f"a node has no {key}; write it, or take the node out")
            else:
                texts[key] = one.value
        if len(texts) < 2:
            return None
        uuid = texts["uuid"]
        if SEPARATOR in uuid:
            self.said(item.line, f'a node cannot be called "{uuid}"; "{SEPARATOR}" parts a node from its port')
            return None
        node = ApexNode(texts["type"], uuid, item.line)
        node.raw = {key: plain(one) for key, one in entry.items() if key != "subgraph"}
        where = path + uuid
        node.label = self.value(entry, "label", str, "a text", where) or ""
        node.position = self.position(entry.get("pos"), where)
        node.colour = self.colour(entry.get("color"), where)
        node.max_frequency = self.value(entry, "max_frequency", _NUMBER, "a number", where)
        node.exec_mode = self.value(entry, "exec_mode", int, "0 or 1", where)
        for key in ("enabled", "muted"):
            found = self.value(entry, key, bool, "true or false", where)
            if found is not None:
                setattr(node, key, found)
        self.is_new = self.is_new or "exec_type" in entry
        node.parameters = self.parameters(entry.get("state"), where)
        if "subgraph" in entry:
            inner = self.mapping(entry["subgraph"], "a subgraph")
            node.graph = self.graph(inner or {}, f"{where}/")
        elif node.kind == "csapex::Graph":
            node.graph = ApexGraph()
        return node

    def connections(self, item: Located) -> Iterator[ApexConnection]:
        entry = self.mapping(item, "a connection")
        if entry is None:
            return
        source = entry.get("uuid")
        if source is None or not isinstance(source.value, str) or not source.value:
            self.said(item.line, "a connection has no uuid, so it begins nowhere; write the port that it comes from")
            return
        targets = self.items(entry.get("targets"), "targets")
        kinds = self.items(entry.get("types"), "types")
        if kinds and len(kinds) != len(targets):
            self.said(
                kinds[0].line,
                f"there are {len(kinds)} types of {len(targets)} targets; each target has one, default or active",
                source.value,
            )
            return
        for number, target in enumerate(targets):
            if not isinstance(target.value, str) or not target.value:
                self.said(target.line, "a target is no port; write its uuid, or take it out", source.value)
                continue
            kind = kinds[number].value if kinds else "default"
            if kind not in ("default", "active"):
                self.said(
                    kinds[number].line,
                    f"a connection is default or active, got {_short(kind)}; correct it",
                    source.value,
                )
                continue
            yield ApexConnection(source.value, target.value, kind == "active", target.line)

    def threads(self, said: Located | None, found: ApexFile) -> None:
        entry = self.mapping(said, "threads") if said is not None and said.value is not None else None
        if entry is None:
            return
        for item in self.items(entry.get("groups"), "groups"):
            group = self.mapping(item, "a thread group") or {}
            number, name = (group[key].value if key in group else None for key in ("id", "name"))
            if not isinstance(number, int):
                self.said(item.line, "a thread group has no number; write its id")
                continue
            affinity = plain(group["affinity"]) if "affinity" in group else None
            found.threads[number] = ApexThread(str(name or f"group {number}"), affinity or [])
        for item in self.items(entry.get("assignments"), "assignments"):
            one = self.mapping(item, "an assignment") or {}
            number, uuid = (one[key].value if key in one else None for key in ("id", "uuid"))
            if not isinstance(number, int):
                self.said(item.line, "an assignment to a thread group has no number; write the group's id")
            elif isinstance(uuid, str):  # null is the whole graph
                found.assignments[uuid] = number

    # --- parameters ---

    def parameters(self, state: Located | None, where: str) -> dict[str, ApexParameter]:
        if state is None or not isinstance(state.value, dict):
            return {}  # a state of the type's own, which is kept in the raw entry
        params = state.value.get("params")
        if params is None or params.value is None:
            return {}
        found = {}
        for name, item in (self.mapping(params, "params", where) or {}).items():
            entry = self.mapping(item, f'the parameter "{name}"', where)
            if entry is not None:
                found[name] = self.parameter(entry, item.line, f"{where}.{name}")
        return found

    def parameter(self, entry: dict[str, Located], line: int, where: str) -> ApexParameter:
        kind = entry["type"].value if "type" in entry else "range"
        if not isinstance(kind, str):
            self.said(line, "the type of a parameter is a text; correct it", where)
            kind = "value"
        made = ApexParameter(kind)
        if kind not in _NO_VALUE:
            made.value = self.value_of(kind, entry, line, where)
        if kind == "set":
            made.text = self.selected(entry, made.value, where)
            made.value = made.text if made.value is None and made.text else made.value
        return made

    def selected(self, entry: dict[str, Located], value: Any, where: str) -> str:
        """Return the text of a set: the one that is said, else the one of its value."""
        said = self.value(entry, "txt", str, "a text", where)
        if said is not None:
            return str(said)
        pairs = plain(entry["values"]) if "values" in entry else None
        found = [one for one in pairs if isinstance(one, list) and len(one) == 2] if isinstance(pairs, list) else []
        return next((str(text) for text, number in found if number == value), "")

    def value_of(self, kind: str, entry: dict[str, Located], line: int, where: str) -> Any:
        match kind:
            case "color":
                return self.colour(entry.get("values"), where)
            case "path":
                return self.value(entry, "value", str, "a text", where)
            case "string_list":
                return [str(one.value) for one in self.items(entry.get("list"), "list")]
            case "interval":
                return self.interval(entry, line, where)
        key = next((one for one in _VALUES if one in entry), None)
        value = None if key is None else self.scalar(entry[key], key, where)
        if kind == "bitset" and "values" in entry and isinstance(entry["values"].value, dict):
            masks = plain(entry["values"])
            return [one for one, mask in masks.items() if _is_int(mask) and (value or 0) & mask]
        return value

    def interval(self, entry: dict[str, Located], line: int, where: str) -> Any:
        key = next((one for one in _VALUES[:2] if one in entry), None)
        value = None if key is None else plain(entry[key])
        if not _is_numbers(value, 2):
            self.said(line, "an interval is two numbers, under int or double; correct it", where)
        return value

    def scalar(self, said: Located, key: str, where: str) -> Any:
        value = said.value
        fits = {
            "int": _is_int(value),
            "long": _is_int(value),
            "double": isinstance(value, _NUMBER) and not isinstance(value, bool),
            "bool": isinstance(value, bool),
            "string": value is None or not isinstance(value, dict | list),
        }
        if not fits[key]:
            self.said(said.line, f"this should be of type {key}, got {_short(value)}; correct it", where)
            return None
        if key == "double":
            return float(value)
        if key == "string":
            return "" if value is None else value if isinstance(value, str) else _word(value)
        return value

    # --- shapes ---

    def mapping(self, said: Located, what: str, where: str = "") -> dict[str, Located] | None:
        if isinstance(said.value, dict):
            return said.value
        self.said(said.line, f"{what} is keys and values, got {_short(said.value)}; see how CS::APEX saves it", where)
        return None

    def items(self, said: Located | None, what: str) -> list[Located]:
        if said is None or said.value is None:
            return []
        if isinstance(said.value, list):
            return said.value
        self.said(said.line, f"{what} is a list, got {_short(said.value)}; see how CS::APEX saves it")
        return []

    def value(self, entry: dict[str, Located], key: str, kind: Any, what: str, where: str) -> Any:
        one = entry.get(key)
        if one is None or one.value is None:
            return None
        if not isinstance(one.value, kind) or (isinstance(one.value, bool) and kind is not bool):
            if kind is str and not isinstance(one.value, dict | list):
                return _word(one.value)
            self.said(one.line, f"{key} is {what}, got {_short(one.value)}; correct it, or take it out", where)
            return None
        return one.value

    def position(self, said: Located | None, where: str) -> list[Any] | None:
        if said is None or said.value is None:
            return None
        found = plain(said)
        if not _is_numbers(found, 2):
            self.said(said.line, f"pos is two numbers, got {_short(found)}; correct it, or take it out", where)
            return None
        return list(found)

    def colour(self, said: Located | None, where: str) -> str | None:
        if said is None or said.value is None:
            return None
        found = plain(said)
        if not _is_numbers(found, 3):
            self.said(said.line, f"a colour is three numbers, got {_short(found)}; correct it, or take it out", where)
            return None
        if min(found) < 0:
            return None  # not set
        return "#" + "".join(f"{min(255, int(one)):02x}" for one in found)


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_numbers(value: object, count: int) -> bool:
    return (
        isinstance(value, list)
        and len(value) == count
        and all(isinstance(one, _NUMBER) and not isinstance(one, bool) for one in value)
    )


def _word(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _short(value: object) -> str:
    if isinstance(value, dict):
        return "keys and values"
    if isinstance(value, list):
        return "a list"
    return "nothing" if value is None else f"{value!r:.60}"
