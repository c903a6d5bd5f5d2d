"""Makes a graph of a document: the one way back from data, for files, commands and graphs sent to other processes.

All nodes come first, level by level, then edges, promotions from the inside out, differences inside subgraphs, and
gates, because any node may be gated by any other. Parts that cannot be made are reported with their place in the
document; the rest is made all the same. Depends on `document`, `boxes` and `steps`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from contextlib import contextmanager
from typing import NamedTuple, TypeAlias

from hfg.errors import GraphError
from hfg.graph.editing import commands as c
from hfg.graph.editing.boxes import box_with
from hfg.graph.editing.document import (
    BoxDocument,
    Document,
    GateDocument,
    InsideDocument,
    NodeDocument,
)
from hfg.graph.editing.making import made
from hfg.graph.editing.steps import Steps
from hfg.graph.structure.edge import PortEnd, end_path
from hfg.graph.structure.facts import Fact
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.options import GroupGiven
from hfg.graph.structure.paths import node_at, parameter_at, source_at, target_at
from hfg.graph.structure.refusals import raise_refusals
from hfg.nodetypes.node import Node

Key: TypeAlias = tuple[str | int, ...]
"""A place in a document: ("nodes", "camera", "parameters", "rate_hz"), ("edges", 3)."""


class _Part(NamedTuple):
    """A level, the part of the document that describes it, and the place of that part."""

    level: Level
    box: BoxDocument
    key: Key


class Builder:
    """Makes what one document says.

    Attributes:
      root: the level that the whole document describes: an empty graph, or the inside of a subgraph.
      steps: what was done.
      later: steps that must wait until all surrounding subgraphs are built: what kind, how deep, and what to do.
    """

    def __init__(self, root: Level, steps: Steps) -> None:
        self.root = root
        self.steps = steps
        self.later: list[tuple[int, int, Callable[[], None]]] = []

    # --- what subclasses decide ---

    @contextmanager
    def refusing(self, key: Key, path: str = "") -> Iterator[None]:
        """Report what is refused inside; by default it is raised."""
        yield

    def record(self, command: c.Command) -> None:
        """Receive the command that does the same as a step."""

    def lost(self, key: Key) -> Set[str]:
        """Return the nodes at a place that are missing in the document because something about them is wrong."""
        return frozenset()

    def make(self, level: Level, name: str, said: NodeDocument, key: Key, box: BoxDocument) -> Node | None:
        """Make a node that is in no graph yet; None if it cannot be made, which was reported."""
        if said.type:
            return made(said.type, said.parameters, level.path_to(name), self.steps.find)
        assert said.graph is not None
        graph = said.graph
        if graph.parameters:
            raise GraphError(
                f'node "{level.path_to(name)}": it has parameters, but no type that can be found by name, so no '
                "command can make it; define its type at the top of a module"
            )
        return box_with(level.whole.box_type, _add_subgraph("", graph, {}), level.path_to(name))

    def add(self, level: Level, name: str, node: Node, said: NodeDocument, key: Key) -> None:
        """Add a node."""
        self.steps.add(level, name, node, said.said())

    # --- the whole document ---

    def build(self, document: BoxDocument) -> None:
        """Make all of it."""
        with self.root.whole.taking_commands(), raise_refusals():
            if isinstance(document, Document):
                self._declare_groups(document)
                self._declare_monitors(document)
            if self.root.owner is None:
                self._declare_ports(document)
                if isinstance(document, Document):
                    self._note(self.root, None, document)
            parts = [_Part(self.root, document, ())]
            for part in parts:  # grows while it is walked through: subgraphs may be nested to any depth
                parts += self._add_nodes(part)
            missing = [self._missing(part) for part in parts]
            for part, lost in zip(parts, missing, strict=True):
                self._connect(part, lost)
            for part, lost in reversed(list(zip(parts, missing, strict=True))):
                self._promote(part, lost)
            for part, lost in zip(parts, missing, strict=True):
                self._gate(part, lost)
            if isinstance(document, Document):
                self._state(document, missing[0])
            for part in parts:
                self._differ(part)

    def finish(self) -> None:
        """Do what had to wait.

        Values that differ from those of a promoted parameter are set again, outer ones first, because each is passed
        on inwards. Differences inside subgraphs follow, outer ones last, because the outermost document decides.
        """
        with self.root.whole.taking_commands():
            for _, _, step in sorted(self.later, key=lambda one: one[:2]):
                step()

    def _declare_groups(self, document: Document) -> None:
        known = self.root.whole.groups
        for name, group in document.groups.items():
            said: GroupGiven = {"threads": group.threads, **group.said()}
            if name == "loop" and group.threads == 1:
                del said["threads"]  # the default of other groups
            with self.refusing(("groups", name), f'group "{name}"'):
                before = known.by_name.get(name)
                self.steps.declare_group(name, said)
                if known.by_name[name] != before:
                    self.record(c.AddGroup(name, **said))

    def _declare_monitors(self, document: Document) -> None:
        for name, said in document.monitors.items():
            with self.refusing(("monitors", name), f'monitor "{name}"'):
                self.steps.declare_monitor(name, said.property, said.said())
                self.record(c.SetMonitor(name, said.property, **said.said()))

    def _declare_ports(self, document: BoxDocument) -> None:
        for name, text in document.inputs.items():
            with self.refusing(("inputs", name)):
                self.steps.declare_port("input", name, text)
                self.record(c.AddInput(name, text))
        for name, text in document.outputs.items():
            with self.refusing(("outputs", name)):
                self.steps.declare_port("output", name, text)
                self.record(c.AddOutput(name, text))

    # --- nodes ---

    def _add_nodes(self, part: _Part) -> Iterator[_Part]:
        """Add the nodes of a level; yield the inner levels that are to be filled."""
        level, box, key = part
        for name, said in box.nodes.items():
            at = (*key, "nodes", name)
            with self.refusing(at):
                node = self.make(level, name, said, at, box)
                if node is None:
                    continue
                self.steps.need_room(node)
                self.add(level, name, node, said, at)
                self._record_node(level.path_to(name), said)
                within = inside(node)
                if said.graph is not None and within is not None:
                    self._clear(within)
                    yield _Part(within, said.graph, (*at, "graph"))
                self._note(level, node, said)

    def _record_node(self, path: str, said: NodeDocument) -> None:
        options = said.said()
        if said.type:
            self.record(c.Add(said.type, path, said.parameters, options))
        elif said.graph is not None:
            self.record(_add_subgraph(path, said.graph, options))

    def _clear(self, within: Level) -> None:
        """Remove what a type has built: the document says what is there instead."""
        for edge in reversed(within.edges):
            self.record(c.Disconnect(end_path(edge.source), edge.target.path))
            self.steps.disconnect(within, edge)
        for node in list(within.nodes.values()):
            self.record(c.Remove(node.place.path))
            self.steps.remove(node)
        self.steps.set_promotions(within, {})

    def _note(self, level: Level, node: Node | None, said: NodeDocument | InsideDocument | Document) -> None:
        """Add the notes of editors to those that are there."""
        position = None if isinstance(said, Document) else said.position
        noted = ({} if position is None else {"position": position}) | said.notes
        if noted:
            self.steps.set_notes(node, level.whole.notes.get(node, {}) | noted)
            for name, value in noted.items():
                self.record(c.Note("" if node is None else node.place.path, name, value))

    # --- edges and promotions ---

    def _missing(self, part: _Part) -> Set[str]:
        """Return the names of nodes that could not be made, which was reported and is not reported again."""
        names = (*part.box.nodes, *self.lost(part.key))
        return {name for name in names if name not in part.level.nodes}

    def _connect(self, part: _Part, lost: Set[str]) -> None:
        level = part.level
        for number, edge in enumerate(part.box.edges):
            if _is_of(lost, edge.source) or _is_of(lost, edge.target):
                continue
            with self.refusing((*part.key, "edges", number), f"{edge.source} -> {edge.target}"):
                source = _end(level, edge.source, ("inputs", "slots"), source_at)
                target = _end(level, edge.target, ("outputs", "events"), target_at)
                self.steps.connect(level, source, target, edge.said(), f'"{edge.source}" -> "{edge.target}"')
                self.record(c.Connect(end_path(source), end_path(target), **edge.said()))

    def _promote(self, part: _Part, lost: Set[str]) -> None:
        level, box = part.level, part.box
        for name, path in ((name, path) for name, paths in box.promotes.items() for path in paths):
            if level.owner is None or path.partition(".")[0] in lost:
                continue
            key = (*part.key, "promotes", name)
            with self.refusing(key):
                outer = level.owner.ports.parameters
                if name not in outer:
                    raise GraphError(f'there is no parameter "{name}" to promote to; {suggest(name, outer)}')
                node_name, dot, parameter = path.partition(".")
                node = level.nodes.get(node_name)
                if not dot or node is None or parameter not in node.ports.parameters:
                    known = [f"{one}.{each}" for one, inner in level.nodes.items() for each in inner.ports.parameters]
                    raise GraphError(f'"{path}" is not a parameter inside; {suggest(path, known)}')
                inner = node.ports.parameters[parameter]
                self.steps.promote(outer[name], inner)
                self.record(c.Promote(outer[name].path, inner.path))
                said = box.nodes[node_name].parameters if node_name in box.nodes else {}
                if parameter in said:  # another value than that of the subgraph
                    self.later.append((0, level.depth, self._setting(level, path, said[parameter], key)))

    def _setting(self, level: Level, path: str, value: object, key: Key) -> Callable[[], None]:
        def set_parameter() -> None:
            with self.refusing(key):
                port = parameter_at(level, path)
                self.steps.set_parameter(port, value)
                self.record(c.SetParameter(port.path, value))

        return set_parameter

    # --- differences inside subgraphs, and gates ---

    def _differ(self, part: _Part) -> None:
        for name, node in part.box.nodes.items():
            if name in part.level.nodes and self.may_differ(part.level.nodes[name]):
                for path, said in node.inside.items():
                    key = (*part.key, "nodes", name, "inside", path)
                    self.later.append((1, -part.level.depth, self._differing(part.level.nodes[name], path, said, key)))

    def may_differ(self, node: Node) -> bool:
        """Return whether there is anything inside a node that could differ."""
        return True

    def _differing(self, box: Node, path: str, said: InsideDocument, key: Key) -> Callable[[], None]:
        def differ() -> None:
            within = inside(box)
            with self.refusing(key):
                if within is None:
                    raise GraphError("nothing is inside because this is not a subgraph; remove these lines")
                node = node_at(within, path)
                for name, value in said.parameters.items():
                    self._setting(within, f"{path}.{name}", value, (*key, "parameters", name))()
                if said.enabled is not None:
                    self.steps.set_options(node, enabled=said.enabled)
                    self.record((c.Enable if said.enabled else c.Disable)(node.place.path))
                if said.group is not None:
                    self.steps.move(node, said.group or None)
                    self.record(c.Move(node.place.path, said.group or None))
                self._note(within, node, said)

        return differ

    def _gate(self, part: _Part, lost: Set[str]) -> None:
        for name, node in part.box.nodes.items():
            key = (*part.key, "nodes", name)
            if name in lost:
                continue
            if node.gate is not None:
                self._set_gate(part.level, name, node.gate, (*key, "gate"), lost)
            for path, said in node.inside.items() if self.may_differ(part.level.nodes[name]) else ():
                if said.gate is not None:
                    self._set_gate(part.level, f"{name}/{path}", said.gate, (*key, "inside", path, "gate"), lost)

    def _state(self, document: Document, lost: Set[str]) -> None:
        for number, said in enumerate(document.facts):
            if any(path.partition("/")[0] in lost for path in said.nodes):
                continue
            with self.refusing(("facts", number)):
                fact = Fact(said.claim, tuple(node_at(self.root, path) for path in said.nodes))
                self.steps.state(fact)
                self.record(c.Fact(said.claim, tuple(said.nodes)))

    def _set_gate(self, level: Level, path: str, said: GateDocument, key: Key, lost: Set[str]) -> None:
        by, seen = (said.by[1:], self.root) if said.by.startswith("/") else (said.by, level)
        if seen is level and by.partition("/")[0] in lost:
            return
        with self.refusing(key):
            gate = Gate(node_at(level, path), node_at(seen, by), said.idle_rate_hz)
            self.steps.gate(gate, seen)
            self.record(c.Gate(gate.target.place.path, gate.by.place.path, gate.idle_rate_hz))


def _add_subgraph(path: str, graph: BoxDocument, options: c.NodeData) -> c.AddSubgraph:
    return c.AddSubgraph(path, graph.inputs, graph.outputs, graph.events, graph.slots, options)


def _is_of(names: Set[str], port: str) -> bool:
    """Return whether that is the path of a port of one of these nodes."""
    name, dot, _ = port.partition(".")
    return bool(dot) and name in names


def _end(level: Level, path: str, kinds: tuple[str, str], at: Callable[[Level, str], PortEnd]) -> PortEnd:
    """Find one end of an edge; a name without a dot is a port of the subgraph itself, or of the whole graph."""
    whole = path.removeprefix("/")
    owner = level.owner
    if owner is None or "." in path or whole != path:
        return at(level, whole)
    for kind in kinds:
        ports = getattr(owner.ports, kind)
        if path in ports:
            side: PortEnd = ports[path].inner
            return side
    if path in level.ports.by_name():
        return at(level, path)
    known = [name for kind in kinds for name in getattr(owner._type, kind)]
    raise GraphError(f'the subgraph has no "{path}" that could be here; {suggest(path, known)}')
