"""Tells a graph as the commands that make it: carried out on an empty graph they give an equal one (rule R4).

While they are found they are carried out on a second graph, so that it is known what the types of subgraphs build by
themselves, and so that what is told is seen to be true. Stands on `performing`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, cast

from hfg.base.values import same
from hfg.encoding import encode
from hfg.errors import EncodingError, GraphError, HfgError
from hfg.graph.editing import commands as c
from hfg.graph.editing.data import edge_as_data
from hfg.graph.editing.insides import differ_in_values_only, nodes_inside
from hfg.graph.editing.performing import perform
from hfg.graph.editing.type_texts import text_of_type
from hfg.graph.structure.edge import Edge, is_feed
from hfg.graph.structure.level import Level, Whole, inside
from hfg.graph.structure.pointing import parameter_at
from hfg.graph.structure.promoting import stands_for
from hfg.graph.structure.subgraph import is_box, is_unnamed
from hfg.nodetypes.node import Node

__all__ = ["as_commands"]


def as_commands(level: Level) -> list[c.Command]:
    """See `Graph.as_commands`.

    Raises:
      GraphError: something of the graph cannot be said by commands.
    """
    if level.owner is not None:
        raise GraphError(
            f'{level.title} is told with the whole graph: write graph.as_commands() of "{level.whole.root.name}"'
        )
    telling = _Telling(level)
    telling.tell()
    return telling.commands


class _Telling:
    """Finds the commands, and carries each out on a second graph."""

    def __init__(self, root: Level) -> None:
        self.root = root
        self.commands: list[c.Command] = []
        self.made = Level(root.name, Whole(root.whole.make_face, root.whole.box_type))

    def say(self, command: c.Command) -> None:
        """Say one more.

        Raises:
          GraphError: it cannot be carried out, so that nobody else could either.
        """
        try:
            perform(self.made, [command])
        except HfgError as error:
            raise GraphError(f"the graph cannot be made by commands, for one of them is refused: {error}") from error
        self.commands.append(command)

    def tell(self) -> None:
        """Tell all."""
        for spec in self.root.whole.groups.by_name.values():
            if spec != self.made.whole.groups.by_name.get(spec.name):
                self.say(c.AddGroup(spec.name, **{"threads": spec.threads, **spec.said()}))
        for name, port in self.root.ports.inputs.items():
            self.say(c.AddInput(name, _text(port.type, f'input "{name}" of the graph')))
        for name, out in self.root.ports.outputs.items():
            self.say(c.AddOutput(name, _text(out.type, f'output "{name}" of the graph')))
        self._tell_level(self.root, self.made)
        self._tell_gates()
        for node in (None, *nodes_inside(self.root).values()):
            for name, value in self.root.whole.notes.get(node, {}).items():
                self.say(c.Note("" if node is None else node.place.path, name, value))

    def _tell_level(self, level: Level, made: Level) -> None:
        waiting = [(level, made)]
        found: list[tuple[Level, Level]] = []
        while waiting:  # without recursion, for subgraphs may be as deep as they like
            level, made = waiting.pop(0)
            found.append((level, made))
            for name, node in level.nodes.items():
                self._tell_node(node)
                inner, inner_made = inside(node), inside(made.nodes[name])
                if inner is None or inner_made is None:
                    continue
                if differ_in_values_only(inner, inner_made):
                    self._tell_values(inner, inner_made)
                    continue
                self._clear(inner_made)
                waiting.append((inner, inner_made))
        for level, _ in found:
            for edge in level.edges:
                self.say(_connected(edge))
        for level, _ in reversed(found):  # inner ones first: a value goes on to what the parameter stands for
            self._tell_promotions(level)

    def _tell_node(self, node: Node) -> None:
        path, options = node.place.path, cast(c.NodeData, node._options.said())
        reference = node._type.reference
        if reference is not None:
            self.say(c.Add(reference, path, _parameters(node), options))
        elif is_box(node) and is_unnamed(node) and not node._type.parameters:
            self.say(_subgraph(node, options))
        else:
            raise GraphError(
                f'node "{path}": its type {node._type.qualname} cannot be found by name, so no command can make it; '
                "define it at the top of a module"
            )

    def _tell_promotions(self, level: Level) -> None:
        """What the parameters of a subgraph stand for; one inside may have been set by itself since."""
        if level.owner is None:
            return
        for name, ports in level.promotions.by_name.items():
            for port in ports:
                self.say(c.Promote(level.owner.ports.parameters[name].path, port.path))
                for one in stands_for(port):
                    if one.spec.is_given and not same(parameter_at(self.made, one.path).value, one.value):
                        self.say(c.SetParameter(one.path, _data(one.spec.encode, one.value)))

    def _tell_values(self, inner: Level, made: Level) -> None:
        """What is inside of a subgraph is what its type builds; what was set or switched there is told beside."""
        for one, other in zip(nodes_inside(inner).values(), nodes_inside(made).values(), strict=True):
            path = one.place.path
            for name, value in one._parameters.items():
                spec = one._type.parameters[name]
                if spec.is_port and spec.is_given and not same(other._parameters[name], value):
                    self.say(c.SetParameter(f"{path}.{name}", _data(spec.encode, value)))
            if one._options.enabled != other._options.enabled:
                self.say(c.Enable(path) if one._options.enabled else c.Disable(path))
            if one._options.group != other._options.group:
                self.say(c.Move(path, one._options.group))

    def _clear(self, made: Level) -> None:
        """What its type builds inside is something else by now: it is taken out, and what is there told instead."""
        for edge in list(made.edges):
            self.say(c.Disconnect(edge.source.path, edge.target.path))
        for name in list(made.nodes):
            self.say(c.Remove(made.path_to(name)))

    def _tell_gates(self) -> None:
        there = {(gate.target.place.path, gate.by.place.path) for level in self.made.walk() for gate in level.gates}
        for level in self.root.walk():
            for gate in level.gates:
                target, by = gate.target.place.path, gate.by.place.path
                if (target, by) not in there:
                    self.say(c.Gate(target, by, gate.idle_rate_hz))


def _subgraph(node: Node, options: c.NodeData) -> c.AddSubgraph:
    kind, path = node._type, node.place.path

    def texts(specs: dict[str, Any]) -> dict[str, str]:
        return {name: _text(spec.type, f'port "{path}.{name}"') for name, spec in specs.items()}

    return c.AddSubgraph(
        path,
        texts(dict(kind.inputs)),
        texts(dict(kind.outputs)),
        texts(dict(kind.events)),
        texts(dict(kind.slots)),
        options,
    )


def _text(hint: object, where: str) -> str:
    text = text_of_type(hint)
    if text is None:
        raise GraphError(
            f"{where}: its type {hint!r} has no name, so no command can say it; "
            "give it one in a module, as in Picture = Annotated[...], and declare the port with that"
        )
    return text


def _parameters(node: Node) -> dict[str, Any]:
    """The values that are not what the type gives by itself."""
    specs = node._type.parameters
    return {
        name: _data(specs[name].encode, value)
        for name, value in node._parameters.items()
        if specs[name].is_given and not same(specs[name].default, value)
    }


def _data(encoded: Callable[[Any], Any], value: object) -> object:
    """Plain data, so that the command can be written down; what is none is said as it is, for this process alone."""
    try:
        return encoded(value)
    except EncodingError:
        return value


def _connected(edge: Edge) -> c.Connect:
    if is_feed(edge.source):
        raise GraphError(
            f'edge "{edge.label}": an observable from outside is code, which no command can say; '
            "connect it by hand, or feed the graph by graph.input(...)"
        )
    try:
        said = edge_as_data(edge, lambda value, hint: _data(partial(encode, hint=hint), value))
    except GraphError as error:
        raise GraphError(f'edge "{edge.label}": {error}') from error
    return c.Connect(edge.source.path, edge.target.path, **said)
