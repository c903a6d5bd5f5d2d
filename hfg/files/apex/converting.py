"""Makes a document of a graph file of what a file of CS::APEX says, and tells what became of each part.

First names and rules of all nodes, then which way ports are counted, for that needs all connections; then nodes and
edges. What this finds nothing for keeps its place with its data. Depends on `document`, `table`, `ports` and `report`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any, Final

from hfg.files.apex.document import ApexConnection, ApexFile, ApexGraph, ApexNode, ApexParameter
from hfg.files.apex.playing import file_importer
from hfg.files.apex.ports import AUTOMATIC, Missing, Ports, is_source, parts
from hfg.files.apex.reading import SEPARATOR
from hfg.files.apex.report import ConversionReport, Converted
from hfg.files.apex.table import ParameterRule, TypeRule, rule_of
from hfg.files.findings import Findings
from hfg.graph.editing.document import BoxDocument, Document, EdgeDocument, GroupDocument, NodeDocument

_NOTE: Final = "csapex::Note"
_GRAPH: Final = "csapex::Graph"
_DEFAULT_RATE_HZ: Final = 60.0  # what CS::APEX limits every node to unless it says another rate
_DEFAULT_THREAD, _PRIVATE_THREAD = 1, 0
_COUNTS: Final = {"input count": "in", "output count": "out", "slot count": "slot", "event count": "event"}
_NAMES: Final = ("input names", "output names", "slot names", "event names")
_OF_PORTS: Final = (*_COUNTS, *_NAMES)
_ITERATION: Final = ("iterate_containers", "iterated_containers")
_NO_VALUE: Final = ("trigger", "progress", "null", "text", "output_progress", "output_text")
_RELEASE: Final = {0: "pipelined", 1: "sequential"}
_DRAWN: Final[dict[str, Any]] = {"z": 0, "minimized": False, "flipped": False, "logger_level": 1, "dict": []}
_ROOT_SOURCES: Final = {"event_activation": "start"}
_ROOT_TARGETS: Final = {"slot_exit": "stop", "slot_abort": "abort"}
_ANY: Final = "Any"


def convert(file: ApexFile, name: str, findings: Findings) -> tuple[Document, ConversionReport]:
    """Make the document.

    Args:
      file: as read.
      name: what the file is called, for messages.
      findings: are given what contradicts itself in the file.
    """
    return _Converting(file, name, findings).convert()


class _Level:
    """A graph of the file while it is converted.

    Attributes:
      path: "" or that of the subgraph, followed by a slash.
      names: of the nodes here, by their uuids.
      numbers: of ports that connections use, by node.
    """

    def __init__(self, graph: ApexGraph, box: BoxDocument, path: str, owner: ApexNode | None) -> None:
        self.graph, self.box, self.path, self.owner = graph, box, path, owner
        self.names: dict[str, str] = {}
        self.ports: dict[str, Ports] = {}
        self.converted: dict[str, Converted] = {}
        self.numbers: dict[str, list[tuple[str, int]]] = defaultdict(list)
        self.taken: dict[str, str] = {}


class _Converting:
    def __init__(self, file: ApexFile, name: str, findings: Findings) -> None:
        self.file, self.name, self.findings = file, name, findings
        self.report = ConversionReport(name)
        self.document = Document(name=file.name or name.rpartition("/")[2].rpartition(".")[0] or "graph")
        self.levels: list[_Level] = []
        self.thread_names: dict[int, str] = {}
        self.old = False

    def convert(self) -> tuple[Document, ConversionReport]:
        if self.file.description:
            self.document.notes["description"] = self.file.description
        said = self.file.rest.get("tags")
        tags = [one for one in said if one] if isinstance(said, list) else []  # empty ones are added at each save
        if tags:
            self.document.notes["tags"] = tags
        self.threads()
        self.level(self.file.graph, self.document, "", None)
        self.old = not self.file.is_new and not any(self.counts_automatic(level) for level in self.levels)
        for level in self.levels:
            for uuid, node in level.graph.nodes.items():
                if uuid in level.names:
                    self.node(level, node)
        for level in self.levels:
            for connection in level.graph.connections:
                self.connection(level, connection)
        self.remarks()
        return self.document, self.report

    def level(self, graph: ApexGraph, box: BoxDocument, path: str, owner: ApexNode | None) -> None:
        """Name the nodes of a graph, and of those inside of it."""
        level = _Level(graph, box, path, owner)
        self.levels.append(level)
        for uuid, node in graph.nodes.items():
            if node.kind == _NOTE:
                self.note(level, node)
                continue
            level.names[uuid] = _unused(_plain_name(uuid), level.names.values())
        for connection in graph.connections:
            for port in (connection.source, connection.target):
                uuid, _, name = port.rpartition(SEPARATOR)
                try:
                    kind, number = parts(name)
                except Missing:
                    continue  # told when it is connected
                if number.isdecimal():
                    level.numbers[uuid].append((kind, int(number)))
        for uuid, node in graph.nodes.items():
            if node.graph is not None:
                inner = NodeDocument(graph=BoxDocument())
                box.nodes[level.names[uuid]] = inner
                assert inner.graph is not None
                self.level(node.graph, inner.graph, f"{path}{level.names[uuid]}/", node)

    def counts_automatic(self, level: _Level) -> bool:
        """Return whether a number here is too large for a node unless automatic ports are counted.

        Subgraphs are no evidence: their ports have been counted behind the automatic ones for longer.
        """
        for uuid, numbers in level.numbers.items():
            rule = rule_of(level.graph.nodes[uuid].kind) if uuid in level.graph.nodes else None
            if rule is None:
                continue
            own = {"slot": len(rule.triggers) + len(rule.slots), "event": len(rule.triggers) + len(rule.events)}
            if any(kind in AUTOMATIC and number >= own[kind] for kind, number in numbers):
                return True
        return False

    def threads(self) -> None:
        names: list[str] = []
        for number, thread in self.file.threads.items():
            if number > _DEFAULT_THREAD:
                name = _unused(thread.name, names)
                names.append(name)
                self.document.groups[name] = GroupDocument()
                self.thread_names[number] = name
                if thread.affinity:
                    self.report.remarks.append(f'thread group "{name}": on which processors it runs is left out')

    def note(self, level: _Level, node: ApexNode) -> None:
        said = {name: one.value for name, one in node.parameters.items()}
        note: dict[str, Any] = {"text": str(said.get("text") or "")}
        if node.position is not None:
            note["position"] = node.position
        if isinstance(said.get("w"), int) and isinstance(said.get("h"), int):
            note["size"] = [said["w"], said["h"]]
        if node.colour is not None:
            note["colour"] = node.colour
        self.document.notes[_unused(level.path + _plain_name(node.uuid), self.document.notes)] = note
        self.report.notes += 1

    # --- nodes ---

    def node(self, level: _Level, node: ApexNode) -> None:
        name = level.names[node.uuid]
        told = Converted(level.path + node.uuid, kind=node.kind, target=level.path + name)
        self.report.nodes.append(told)
        level.converted[node.uuid] = told
        made = level.box.nodes.pop(name, None) or NodeDocument()  # of a subgraph it is there, and goes to its place
        level.box.nodes[name] = made
        self.options(level, node, made, told)
        if node.graph is not None:
            self.subgraph(level, node, made, told)
            return
        rule = rule_of(node.kind)
        if rule is None:
            made.type = told.type = node.kind
            made.parameters = {one: said.value for one, said in node.parameters.items() if said.kind not in _NO_VALUE}
            made.notes["csapex"] = node.raw
            told.lost("there is no such type here; the node keeps its place and its data, and the graph does not run")
            return
        if rule.made_by == "file_importer":
            rule = file_importer(rule, node.parameters)
        made.type = told.type = rule.type
        counts = self.counts(node)
        level.ports[node.uuid] = Ports(rule, level.numbers[node.uuid], counts, self.old)
        if rule.differs:
            told.differs(rule.differs)
        for one, value in rule.set.items():
            made.parameters[one] = value.format(name=name) if isinstance(value, str) else value
        made.parameters |= self.sizes(rule, level.ports[node.uuid]) | _shown_sizes(rule, node.parameters)
        lost = {}
        for one, said in node.parameters.items():
            if one in _OF_PORTS or said.kind in _NO_VALUE or said.value is None:
                continue
            if not self.parameter(rule, one, said, made, told):
                lost[one] = said.value
        if lost:
            made.notes["csapex"] = lost

    def sizes(self, rule: TypeRule, ports: Ports) -> dict[str, int]:
        found: dict[str, int] = {}
        for names in (rule.inputs, rule.slots, rule.events, rule.outputs):
            if names and names[-1].endswith("[]") and not (found and names is rule.outputs):
                found[names[-1].removesuffix("[]")] = max(1, *ports.sizes.values())
        return found

    def counts(self, node: ApexNode) -> dict[str, int]:
        return {
            kind: node.parameters[name].value
            for name, kind in _COUNTS.items()
            if name in node.parameters and isinstance(node.parameters[name].value, int)
        }

    def parameter(self, rule: TypeRule, name: str, said: ApexParameter, made: NodeDocument, told: Converted) -> bool:
        """Set a parameter; False if what it says is lost."""
        if rule.output_of(name) is not None:
            return True  # what came last; it comes again
        goes = rule.parameter(name)
        if goes is None:
            if name in rule.same and rule.same[name] == said.value:
                return True
            told.differs(f'its parameter "{name}" ({said.value}) has no counterpart')
            return False
        try:
            _set(made.parameters, goes, said)
        except (TypeError, ValueError):
            shown = said.text or said.value
            told.differs(f'its parameter "{name}" ({shown}) cannot be "{goes.to}" here, which is as usual')
            return False
        return True

    def options(self, level: _Level, node: ApexNode, made: NodeDocument, told: Converted) -> None:
        made.enabled = node.enabled
        made.position = node.position
        if node.label and node.label != node.uuid:
            made.notes["label"] = node.label
        if node.colour is not None:
            made.notes["colour"] = node.colour
        drawn = {key: node.raw[key] for key, usual in _DRAWN.items() if node.raw.get(key) not in (None, usual)}
        if drawn:
            made.notes["drawn"] = drawn
        if node.muted:
            made.notes["muted"] = True
            told.differs("it is muted there, which there is nothing like")
        if node.raw.get("exec_type") == 2:
            told.differs("it runs in a process of its own there; give it a group with threads, or make it a worker")
        rate = _DEFAULT_RATE_HZ if node.max_frequency is None else node.max_frequency
        if node.graph is not None:
            if node.max_frequency not in (None, 0, _DEFAULT_RATE_HZ):
                told.differs(f"its rate of {node.max_frequency:g} Hz is left out: a subgraph does not fire itself")
        elif rate > 0:
            made.max_rate_hz = float(rate)
        if node.graph is None and node.exec_mode in _RELEASE:
            made.release = _RELEASE[node.exec_mode]  # type: ignore[assignment]
        self.group(level, node, made)

    def group(self, level: _Level, node: ApexNode, made: NodeDocument) -> None:
        number = self.file.assignments.get(self.uuid_path(level, node.uuid), _DEFAULT_THREAD)
        if node.graph is not None or number == _DEFAULT_THREAD:
            return
        if number == _PRIVATE_THREAD:
            made.group = _unused(level.path.replace("/", "_") + level.names[node.uuid], self.document.groups)
            self.document.groups[made.group] = GroupDocument()
        elif number in self.thread_names:
            made.group = self.thread_names[number]
        else:
            self.findings.add(
                self.name,
                node.line,
                level.path + node.uuid,
                f"it is assigned to thread group {number}, which is not there; assign it to one of threads.groups",
            )

    def uuid_path(self, level: _Level, uuid: str) -> str:
        """Name a node from the outermost graph, as assignments do."""
        owners = []
        path = level
        while path.owner is not None:
            owners.append(path.owner.uuid)
            path = next(one for one in self.levels if any(node is path.owner for node in one.graph.nodes.values()))
        return SEPARATOR.join([*reversed(owners), uuid])

    def subgraph(self, level: _Level, node: ApexNode, made: NodeDocument, told: Converted) -> None:
        told.type = "subgraph"
        box = made.graph
        assert box is not None
        self.own_ports(level, node, box)
        rule = TypeRule("the subgraph", list(box.inputs), list(box.outputs), list(box.slots), list(box.events))
        level.ports[node.uuid] = Ports(rule, level.numbers[node.uuid], {}, self.old)
        for name, ports in zip(_NAMES, (box.inputs, box.outputs, box.slots, box.events), strict=True):
            said = node.parameters.get(name)
            if said is not None and said.value and ports:
                made.notes[name] = said.value[: len(ports)]
        self.activity(level, node, box, told)
        iterates = node.parameters.get("iterate_containers")
        if iterates is not None and iterates.value is True:
            self.iteration(node, made, told)
        for name, said in node.parameters.items():
            if name not in _OF_PORTS and name not in _ITERATION and said.kind not in _NO_VALUE:
                told.differs(f'its parameter "{name}" ({said.value}) has no counterpart')
                made.notes.setdefault("csapex", {})[name] = said.value

    def own_ports(self, level: _Level, node: ApexNode, box: BoxDocument) -> None:
        """As many as it says, or as connections inside and outside of it use."""
        counts = self.counts(node)
        inner = next(one for one in self.levels if one.owner is node)
        for kind, ports in (("in", box.inputs), ("out", box.outputs), ("slot", box.slots), ("event", box.events)):
            used = [*_relayed(inner, kind)]
            if kind not in counts and kind not in AUTOMATIC:
                used += [number for one, number in level.numbers[node.uuid] if one == kind]
            for number in range(max([counts.get(kind, 0), *(number + 1 for number in used)])):
                ports[f"{kind}_{number}"] = _ANY

    def activity(self, level: _Level, node: ApexNode, box: BoxDocument, told: Converted) -> None:
        """Its activity acts inside through its own slots."""
        assert node.graph is not None
        name = level.names[node.uuid]
        for event, slot in (("event_activation", "activation"), ("event_deactivation", "deactivation")):
            if any(one.source == event for one in node.graph.connections):
                box.slots[slot] = _ANY
                outer = f"{name}.{AUTOMATIC['event'][event == 'event_deactivation']}"
                level.box.edges.append(EdgeDocument(outer, f"{name}.{slot}", active=True))
                told.differs(f"its {event} goes by a slot of its own")

    def iteration(self, node: ApexNode, made: NodeDocument, told: Converted) -> None:
        assert made.graph is not None
        said = node.parameters.get("iterated_containers")
        names = list(made.graph.inputs)
        if said is not None and isinstance(said.value, int):
            made.iterate_over = tuple(name for bit, name in enumerate(names) if said.value >> bit & 1)
        elif said is not None and isinstance(said.value, list):
            made.iterate_over = tuple(name for name in names if any(str(one).endswith(name) for one in said.value))
        if not made.iterate_over and names:
            made.iterate_over = (names[0],)
            told.differs("it iterates over its first input, for the file names none")

    # --- connections ---

    def connection(self, level: _Level, said: ApexConnection) -> None:
        told = Converted(f"{level.path}{said.source} -> {said.target}")
        self.report.connections.append(told)
        ends: list[str] = []
        for port, begins in ((said.source, True), (said.target, False)):
            try:
                ends.append(self.end(level, port, begins, told, said.line))
            except Missing as error:
                told.lost(str(error))
        if len(ends) < 2:
            self.keep(told, said)
            return
        source, target = ends
        key = f"{level.path}{target}"
        if key in level.taken and self.is_input(said.target):
            told.lost(f"{target} is connected to {level.taken[key]} already, and an input takes one")
            self.keep(told, said)
            return
        level.taken[key] = source
        told.target = f"{level.path}{source} -> {target}"
        level.box.edges.append(EdgeDocument(source, target, active=said.active))

    def keep(self, told: Converted, said: ApexConnection) -> None:
        lost = self.document.notes.setdefault("csapex connections", [])
        lost.append(f"{told.source}{' (active)' if said.active else ''}")

    def is_input(self, port: str) -> bool:
        return port.rpartition(SEPARATOR)[2].startswith(("in_", "relayin_"))

    def end(self, level: _Level, port: str, begins: bool, told: Converted, line: int) -> str:
        uuid, _, name = port.rpartition(SEPARATOR)
        if uuid in ("", "~"):
            return self.own(level, name, begins)
        node = level.graph.nodes.get(uuid)
        if node is None or node.kind == _NOTE:
            why = "is a note" if node is not None else "is not there"
            self.findings.add(
                self.name,
                line,
                told.source,
                f'this is connected to "{uuid}", which {why}; take it out, or mend its uuid',
            )
            raise Missing(f'"{uuid}" {why}')
        kind, number = parts(name)
        if is_source(kind) is not begins:
            raise Missing(f'"{name}" is no port where a connection {"begins" if begins else "ends"}')
        ours = level.names[uuid]
        ports = level.ports.get(uuid)
        if ports is None:
            told.lost(f"there is no type for {ours}, whose edge keeps its place")
            return f"{ours}.{name.replace('/', '_').replace('.', '_')}"
        if number.startswith("relay "):
            return f"{ours}.{kind}_{number.removeprefix('relay ')}"
        if number.isdecimal():
            found = ports.name(kind, int(number))
            if node.graph is not None and found == "processed":
                raise Missing("a subgraph does not fire itself, so there is no event for it")
            if ports.doubtful.get(kind):
                told.differs(f'"{name}" is taken for "{found}", as in files from before automatic ports had numbers')
            return f"{ours}.{found}"
        return f"{ours}.{self.of_parameter(ports, number, begins)}"

    def of_parameter(self, ports: Ports, name: str, begins: bool) -> str:
        output = ports.rule.output_of(name)
        if begins and output is not None:
            return output
        goes = ports.rule.parameter(name)
        if goes is None or goes.how not in ("same", "float"):
            raise Missing(f'the parameter "{name}" of {ports.rule.type} is no port here')
        return goes.to

    def own(self, level: _Level, name: str, begins: bool) -> str:
        """A port of the graph itself."""
        if level.owner is None:
            known = _ROOT_SOURCES if begins else _ROOT_TARGETS
            if name not in known:
                raise Missing(f'the graph itself has nothing like "{name}" here')
            return known[name]
        if begins and name in ("event_activation", "event_deactivation"):
            return name.removeprefix("event_")
        kind, number = parts(name)
        if not number.startswith("relay ") or (kind in ("in", "slot")) is not begins:
            raise Missing(f'the subgraph itself has nothing like "{name}" here')
        return f"{kind}_{number.removeprefix('relay ')}"

    # --- the file as a whole ---

    def remarks(self) -> None:
        bent = sum(level.graph.fulcrums for level in self.levels)
        if bent:
            self.report.remarks.append(f"bend points of {bent} drawn connections are left out")
        if self.file.rest.get("settings"):
            self.report.remarks.append(f"{len(self.file.rest['settings'])} settings of the program are left out")
        if self.file.rest.get("adapters"):
            self.report.remarks.append(f"sizes and the like of views ({len(self.file.rest['adapters'])}) are left out")
        others = sorted(set(self.file.rest) - {"settings", "adapters", "uuid_map", "tags"})
        if others:
            self.report.remarks.append(f"what is said under {', '.join(others)} is unknown, and left out")
        if any(node.max_frequency is None for level in self.levels for node in level.graph.nodes.values()):
            self.report.remarks.append("nodes that say no rate fire 60 times a second at most, as CS::APEX has it")


def _set(parameters: dict[str, Any], goes: ParameterRule, said: ApexParameter) -> None:
    """Set a parameter."""
    value = _meant(goes, said)
    match goes.how:
        case "same":
            parameters[goes.to] = value
        case "float":
            parameters[goes.to] = float(value)
        case "lower" | "ending":
            if not isinstance(value, str):
                raise TypeError
            parameters[goes.to] = (value if goes.how == "lower" else value.rpartition(".")[2]).lower()
        case "square":
            parameters[goes.to] = [int(value), int(value)]
        case "first" | "second":
            pair = parameters.setdefault(goes.to, [1, 1])
            pair[goes.how == "second"] = int(value)
        case "from" | "into":
            before, _, behind = parameters[goes.to].partition("2")
            parameters[goes.to] = f"{value}2{behind}" if goes.how == "from" else f"{before}2{value}"


def _meant(goes: ParameterRule, said: ApexParameter) -> Any:
    """Return the value that is meant: of a set that of its text, because numbers are what its author counted by."""
    if said.kind != "set" or not said.text:
        if goes.values:
            raise ValueError  # a bare number says nothing
        return said.value
    if goes.values:
        if said.text not in goes.values:
            raise ValueError
        return goes.values[said.text]
    is_number = isinstance(said.value, int | float) and said.text == f"{said.value:g}"
    return said.value if is_number else said.text


def _shown_sizes(rule: TypeRule, names: Iterable[str]) -> dict[str, int]:
    """How many outputs there are of a kind of which the file has a parameter each."""
    outputs = [output for name in names if (output := rule.output_of(name)) is not None and output.endswith("]")]
    found: dict[str, int] = {}
    for output in outputs:
        vector, _, number = output.removesuffix("]").partition("[")
        found[vector] = max(found.get(vector, 0), int(number) + 1)
    return found


def _relayed(inner: _Level, kind: str) -> Iterator[int]:
    """The numbers of a subgraph's own ports that are connected inside."""
    for connection in inner.graph.connections:
        for port in (connection.source, connection.target):
            if SEPARATOR in port:
                continue
            try:
                found, number = parts(port)
            except Missing:
                continue
            if found == kind and number.startswith("relay "):
                yield int(number.removeprefix("relay "))


def _plain_name(uuid: str) -> str:
    return uuid.rpartition("::")[2].replace("/", "_").replace(".", "_") or "node"


def _unused(name: str, taken: Any) -> str:
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name}_{number}"
    return found
