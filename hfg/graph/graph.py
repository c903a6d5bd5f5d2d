"""`Graph` and `Subgraph`: the public API for building graphs. The work is done elsewhere.

A graph is the public side of a level (package `structure`): nodes, edges, gates and the ports of the whole graph. Each
call is checked when it is made, and a refused call changes nothing. Problems that only the whole graph can show wait
for `check()`. Depends on all packages of `hfg.graph`, which know it only by name, and on no engine.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType, ModuleType
from typing import Any, ClassVar, Final, Literal, Never, TypeAlias, TypeVar, Unpack, overload

from reactivex import Observable
from typing_extensions import TypeForm

from hfg.base.hooks import hooks
from hfg.base.token import Token
from hfg.errors import Problem, UsageError
from hfg.graph.checks.checking import check
from hfg.graph.editing import transactions
from hfg.graph.editing.commands import Command
from hfg.graph.editing.to_commands import as_commands
from hfg.graph.structure.adding import add
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.connecting import connect
from hfg.graph.structure.declaring import declare_group, move, need_new_port, promote, set_gate
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.facts import Fact, facts_of, state_fact
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, Whole, inside
from hfg.graph.structure.monitors import declare_monitor
from hfg.graph.structure.naming import need_name
from hfg.graph.structure.option import Fields, unknown
from hfg.graph.structure.options import (
    EdgeGiven,
    EdgeOptions,
    GroupGiven,
    GroupSpec,
    MonitorGiven,
    MonitorSpec,
    NodeGiven,
    NodeOptions,
)
from hfg.graph.structure.paths import find, node_at
from hfg.graph.structure.subgraph import Box
from hfg.monitors.properties import Property
from hfg.nodetypes.node import Node, Place
from hfg.ports import EventPort, ParameterPort, Port, SlotPort, Source, Target

N = TypeVar("N", bound=Node)
T = TypeVar("T")
Through: TypeAlias = Callable[[Observable[Any]], Observable[Any]]

_NOBODY: Final[Any] = None  # so that a forgotten `by=` gets a clear error


class Graph:
    """An activity flow graph, or the part of one inside a subgraph.

    While the graph runs, only commands can change its structure (`run.edit`); everything else raises `UsageError`.

    Args:
      name: its name, for people.

    Examples:
      >>> import hfg
      >>> from collections.abc import Iterator
      >>> @hfg.node
      ... def count(*, to: int = 3) -> Iterator[int]:
      ...     yield from range(to)
      >>> @hfg.node
      ... def show(value: int) -> None:
      ...     print(value)
      >>> graph = Graph("counting")
      >>> numbers = graph.add(count(to=2))
      >>> edge = graph.connect(numbers.out, graph.add(show()).value)
      >>> edge.label
      'count.out -> show.value'
    """

    def __init__(self, name: str = "graph", *, _level: Level | None = None) -> None:
        if _level is None:
            _level = Level(need_name("a graph", name), Whole(_face_of, Enclosed), face=self)
        self._level = _level

    # --- what it is made of ---

    @property
    def name(self) -> str:
        """The graph's name, for people. It is not part of any path."""
        return self._level.name

    @name.setter
    def name(self, name: str) -> None:
        self._level.name = need_name("a graph", name)

    @property
    def nodes(self) -> dict[str, Node]:
        """The nodes by name, in the order in which they were added."""
        return self._level.nodes

    @property
    def edges(self) -> list[Edge]:
        """The edges, in the order in which they were connected."""
        return self._level.edges

    @property
    def gates(self) -> list[Gate]:
        """The gates, in the order in which they were declared."""
        return self._level.gates.listed

    @property
    def facts(self) -> list[Fact]:
        """The facts that were stated about the activity of nodes in here."""
        return facts_of(self._level)

    @property
    def groups(self) -> dict[str, GroupSpec]:
        """All groups of the whole graph by name. "loop" always exists."""
        return self._level.whole.groups.by_name

    @property
    def inputs(self) -> dict[str, GraphInput[Any]]:
        """The ports that feed the graph from outside, by name (rule P10)."""
        return self._level.ports.inputs

    @property
    def outputs(self) -> dict[str, GraphOutput[Any]]:
        """The ports at which the graph is read from outside, by name (rule P10)."""
        return self._level.ports.outputs

    @property
    def start(self) -> EventPort[None]:
        """The event that starts every run (rule A10). Inside a subgraph it is the event of the whole graph."""
        return self._level.ports.start

    @property
    def stop(self) -> SlotPort[object]:
        """The slot that ends the run normally."""
        return self._level.ports.stop

    @property
    def abort(self) -> SlotPort[object]:
        """The slot that ends the run as a failure."""
        return self._level.ports.abort

    @property
    def path(self) -> str:
        """The path of the subgraph that contains this graph; "" for a whole graph."""
        return self._level.path

    # --- nodes and edges ---

    def add(self, node: N, *, name: str | None = None, **options: Unpack[NodeGiven]) -> N:
        """Add a node and return it. A subgraph builds its inner graph now.

        Args:
          node: a node that belongs to no graph yet.
          name: its name in paths. Default: the type's name, followed by _2, _3 and so on if it is taken.
          **options: how the node runs; `help(hfg.graph.NodeOptions)` and docs/reference.md list all options.

        Returns:
          The node.

        Raises:
          GraphError: the name is taken or not allowed, an option is out of range, or the node already belongs to a
            graph; nothing was changed.
        """
        _need_known(NodeOptions, options, "graph.add")
        add(self._level, node, name, options)
        return node

    @overload
    def connect(self, source: Source[T], target: Target[T], **options: Unpack[EdgeGiven[T, Through]]) -> Edge: ...
    @overload
    def connect(
        self,
        source: Observable[T] | Observable[Token[T]],
        target: Target[T],
        **options: Unpack[EdgeGiven[T, Through]],
    ) -> Edge: ...
    @overload
    def connect(self, source: str, target: Target[Any] | str, **options: Unpack[EdgeGiven[Any, Through]]) -> Edge: ...
    @overload
    def connect(
        self, source: Source[Any] | Observable[Any], target: str, **options: Unpack[EdgeGiven[Any, Through]]
    ) -> Edge: ...
    def connect(self, source: Any, target: Any, **options: Unpack[EdgeGiven]) -> Edge:
        """Add an edge from an output or event to an input or slot. A reactivex observable can be a source, too.

        Args:
          source: where the edge starts: the port, or its path, "fetch/camera.out".
          target: where it ends, in the same way.
          **options: capacity, buffer, activity and so on; `help(hfg.graph.EdgeOptions)` and docs/reference.md list all
            options.

        Returns:
          The edge.

        Raises:
          ConnectionError: the edge is not possible; nothing was changed.
          GraphError: a path does not exist.
        """
        _need_known(EdgeOptions, options, "graph.connect")
        return connect(self._level, source, target, options)

    # --- groups and gates ---

    def group(self, name: str, **options: Unpack[GroupGiven]) -> GroupSpec:
        """Declare a group: where nodes run. Groups belong to the whole graph, wherever they are declared.

        Args:
          name: the name for `add(..., group=name)`. "loop" is the event loop; only its policy can be chosen.
          **options: threads, policy, process and so on; `help(hfg.graph.GroupSpec)` and docs/reference.md list all
            options.

        Returns:
          The declared group.

        Raises:
          GraphError: a value is out of range, or the group is already declared with other options.
        """
        _need_known(GroupSpec, options, "graph.group")
        return declare_group(self._level, name, options)

    def move(self, node: Node | str, *, group: str | None) -> None:
        """Let a node run in another group. Moving a subgraph moves all inner nodes that have no group of their own.

        Args:
          node: a node of this graph or of a subgraph in it, or its path.
          group: a declared group; None for the group of the enclosing subgraph, or else the loop.

        Raises:
          GraphError: the node is not in this graph, or the group is not declared; nothing was changed.
        """
        move(self._level, node, group)

    def gate(
        self, target: Node | str, *others: Never, by: Node | str = _NOBODY, idle_rate_hz: float | None = None
    ) -> Gate:
        """Let a node or subgraph work only while another node, its state node, is active (rule A11).

        Args:
          target: the node or subgraph to gate, or its path.
          others: not allowed; they only make the error clearer when `by=` is forgotten.
          by: the state node or subgraph, or its path.
          idle_rate_hz: firings per second that are still allowed while `by` is inactive. None allows none.

        Returns:
          The gate.

        Raises:
          GraphError: one of the two is not in this graph, or `target` already has a gate; nothing was changed.
        """
        if others or by is _NOBODY:
            raise UsageError(
                f"a gate has to say who works while whom is active, got {len(others) + 1} nodes and "
                f"{'no by=' if by is _NOBODY else 'by='}: write graph.gate(detector, by=fetch)"
            )
        return set_gate(self._level, target, by, idle_rate_hz)

    # --- facts ---

    def at_most_one(self, *nodes: Node | str) -> Fact:
        """State that never more than one of some nodes is active.

        The analysis of activity takes it for granted where it can neither prove nor read it, and says so. Debug runs
        and the test kit check it: a run that violates it fails. Activity in transit to one of the nodes counts, too.

        Args:
          *nodes: nodes of this graph or of a subgraph in it, or their paths. A subgraph stands for all nodes inside.

        Returns:
          The fact.

        Raises:
          GraphError: there are fewer than two, or one is not in this graph; nothing was changed.
        """
        return state_fact(self._level, "at most one", nodes)

    def exactly_one(self, *nodes: Node | str) -> Fact:
        """State that exactly one of some nodes is active, from when activity first comes to one of them.

        Otherwise like `at_most_one`.
        """
        return state_fact(self._level, "exactly one", nodes)

    # --- monitors ---

    @property
    def monitors(self) -> Mapping[str, MonitorSpec]:
        """The properties that must hold of each run of the whole graph, by name."""
        return MappingProxyType(self._level.whole.monitors)

    def monitor(self, name: str, property: Property | str, **options: Unpack[MonitorGiven]) -> None:  # noqa: A002
        """Declare what must hold of each run; docs/howto/monitors.md describes the language.

        Args:
          name: for people, and for `hfg.monitors.declared(run)`.
          property: made by functions of `hfg.monitors`, or its text: "never(active(driving))". Its paths begin at the
            whole graph.
          **options: what a violation does; docs/reference.md lists all options.

        Raises:
          GraphError: it is malformed, or another monitor has this name; nothing was changed.
        """
        declare_monitor(self._level, name, property, options)

    # --- ports of the whole ---

    def input(self, name: str, type: TypeForm[T]) -> GraphInput[T]:  # noqa: A002 - the word users know
        """Declare a port that feeds the graph from outside (rule P10).

        Args:
          name: the port's name.
          type: type of its values, any type hint.

        Returns:
          The port, to which you connect nodes.

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        need_new_port(self._level, "input", name, type)
        port: GraphInput[T] = GraphInput(self, name, type)
        self._level.ports.add(port)
        return port

    def output(self, name: str, type: TypeForm[T]) -> GraphOutput[T]:  # noqa: A002
        """Declare a port at which the graph is read from outside (rule P10).

        Args:
          name: the port's name.
          type: type of its values, any type hint.

        Returns:
          The port, to which you connect nodes.

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        need_new_port(self._level, "output", name, type)
        port: GraphOutput[T] = GraphOutput(self, name, type)
        self._level.ports.add(port)
        return port

    def promote(self, outer: ParameterPort[T], inner: ParameterPort[T]) -> None:
        """Let a parameter of the subgraph set a parameter inside, now and whenever it is set (rule G3).

        Args:
          outer: the subgraph's parameter, `self.speed`. It can set several inner parameters.
          inner: the inner parameter, `node.ports.parameters["limit"]`.

        Raises:
          GraphError: the two do not fit; nothing was changed.
        """
        promote(self._level, outer, inner)

    # --- finding and checking ---

    def __getitem__(self, path: str) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
        """Return the node or port at a path: "fetch/go_to", "fetch/go_to.goal".

        Ports of the whole graph go by their name. Append ".inner" to the path of a subgraph's port for its inner side.

        Raises:
          GraphError: the path does not exist, or an input and an output share the name.
        """
        return find(self._level, path)

    def check(self) -> list[Problem]:
        """Return everything that keeps the graph from working, or probably does; errors first.

        docs/howto/checks.md has an example and a remedy for each check.
        """
        return check(self)

    def draw(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        depth: int | None = None,
        fold: Iterable[Node | str] = (),
        active: Iterable[Node | str] | None = None,
        ports: Literal["used", "all"] = "used",
        view: Literal["states", "activity", "mission", "all"] | None = None,
        format: Literal["svg", "mmd", "dot"] | None = None,  # noqa: A002 - the word users know
    ) -> str:
        """Draw the graph and return the drawing as text. Notebooks show a graph without this.

        An SVG uses the notation of the paper: inputs left, outputs right, slots on top, events at the bottom; dark
        squares are synchronous, light circles asynchronous, double lines active edges. Activity flows from top to
        bottom, data from left to right. Nodes that are active in a run have an orange border.

        Args:
          path: the file to write; its name ends in ".svg", ".mmd" (Mermaid) or ".dot" (Graphviz). By default no file is
            written.
          depth: how many levels of subgraphs to show expanded; 0 collapses all, None expands all.
          fold: subgraphs, or their paths, to collapse regardless of `depth`.
          active: the nodes and subgraphs to show as active, as `run.active()` returns them. Default: those that are
            active now.
          ports: "all" also shows ports without an edge.
          view: "states" shows only the states that can be reached and the events that lead from one to another, in any
            format. Of an SVG, "activity" shows the states and what feeds them, "mission" all edges with data in
            bundles, "all" each edge by itself. Default: "mission" if activity moves between nodes, else "all".
          format: "svg", "mmd" or "dot", regardless of the file's name. Default without a file: Mermaid.

        Returns:
          The text of the drawing.

        Raises:
          GraphError: a node is not in the graph, or something to collapse is not a subgraph.
          UsageError: the file's name has another ending, the file cannot be written, or an argument is invalid.
        """
        from hfg.graph.drawing.formats import draw, view_of  # here, for most programs draw nothing

        if view == "states":
            paths = [list(map(_path_of, nodes)) for nodes in (fold, active or ())]
            drawn: Graph = hooks.states(self)
            return drawn.draw(path, depth=depth, fold=paths[0], active=paths[1], view="activity", format=format)

        return draw(self, path, format=format, view=view_of(self, depth, fold, active, ports, view))

    # --- editing ---

    def edit(self, *commands: Command) -> None:
        """Carry out commands: all of them, or none if one is refused. For a running graph, use `run.edit`.

        Args:
          *commands: edits from `hfg.commands`, in order.

        Raises:
          GraphError: a command cannot be carried out; the message says which one and why.
          UsageError: the graph is running, or is the inside of a subgraph.

        Examples:
          >>> from hfg import Graph, commands
          >>> graph = Graph()
          >>> graph.edit(commands.Add("hfg.testing.nodes:double", "double", options={"max_rate_hz": 5}))
          >>> graph.undo()
          >>> graph.nodes
          {}
        """
        transactions.edit(self, commands)

    @property
    def can_undo(self) -> bool:
        """Return whether there is an edit to undo. The last 1,000 edits are kept."""
        return bool(self._level.whole.history.done)

    @property
    def can_redo(self) -> bool:
        """Return whether the last change was an undo, so that its edit can be carried out again."""
        return bool(self._level.whole.history.undone)

    @property
    def history(self) -> tuple[tuple[Command, ...], ...]:
        """The edits that can be undone, as they were given, the latest last. The last 1,000 edits are kept."""
        return tuple(transaction.commands for transaction in self._level.whole.history.done)

    def notes(self, path: str = "") -> dict[str, Any]:
        """Return the notes that editors keep about a node or subgraph with `commands.Note`, by name.

        hfg does not use notes itself.

        Args:
          path: the path of the node; "" for the notes about the whole graph.

        Raises:
          GraphError: there is no such node.
        """
        return copy.deepcopy(self._level.whole.notes.get(node_at(self._level, path) if path else None, {}))

    def as_commands(self) -> list[Command]:
        """Return the commands that build this graph: one edit of an empty graph with them makes an equal graph.

        Commands name node types by reference, so types that cannot be found by name are refused. So are values and code
        on edges that are not data.

        Raises:
          GraphError: part of the graph cannot be expressed as commands; the message names it and what to do.

        Examples:
          >>> from hfg import Graph, commands
          >>> from hfg.testing.nodes import double
          >>> graph = Graph()
          >>> node = graph.add(double(), name="twice", max_rate_hz=5)
          >>> commands.encode(graph.as_commands())
          '[{"do":"Add","type":"hfg.testing.nodes:double","path":"twice","options":{"max_rate_hz":5}}]'
          >>> other = Graph()
          >>> other.edit(*graph.as_commands())
          >>> list(other.nodes)
          ['twice']
        """
        return as_commands(self._level)

    def undo(self) -> None:
        """Undo the last edit: the graph is exactly as it was before.

        Raises:
          UsageError: there is no edit to undo, the graph was changed by other means since, or it is running.
        """
        transactions.undo(self)

    def redo(self) -> None:
        """Carry out the edit again that was undone last.

        Raises:
          UsageError: there is no edit to redo, the graph was changed since, or it is running.
        """
        transactions.redo(self)

    def reload(self, module: str | ModuleType) -> None:
        """Reload a changed module and replace the nodes whose types it defines. Parameters are kept.

        Args:
          module: the module, or its name.

        Raises:
          GraphError: the module fails, or a new type does not fit the edges; nothing was changed.
          UsageError: the graph is running: use `run.reload`.
        """
        transactions.reload(self, module)

    def _repr_svg_(self) -> str:
        return self.draw(format="svg")

    def __repr__(self) -> str:
        return f"<{self._level.title}: {len(self.nodes)} nodes, {len(self.edges)} edges>"

    # --- for the floors below, which know a graph by what ports and nodes ask of it ---

    @property
    def _place(self) -> Place:
        """Where its own ports are; asked by them."""
        return Place(self, self.name, "")

    def _is_taken(self, port: Port) -> bool:
        """Return whether it is an input that has its edge; asked by `>>`."""
        return port in self._level.connections.into

    @property
    def _run(self) -> object | None:
        """The run that it has as a whole, if any; asked by events."""
        return self._level.whole.run


def _path_of(node: Node | str) -> str:
    return node if isinstance(node, str) else node.place.path


def _need_known(kind: type[Fields[Any]], options: Iterable[str], call: str) -> None:
    """Refuse what Python refuses of a call whose arguments are written out."""
    wrong = unknown(kind, options, call) if options else None
    if wrong is not None:
        raise TypeError(f"{call}: {wrong}")


def _face_of(level: Level) -> Graph:
    return Graph(level.name, _level=level)


class Subgraph(Box):
    """A node that holds a graph.

    Declare ports as on any node; `.inner` is the inner side of a port. A slot needs no handler:
    `begin = hfg.slot(type=int)`. The inner graph is built when the subgraph is added to a graph.

    Examples:
      >>> import hfg
      >>> @hfg.node
      ... def double(value: int) -> int:
      ...     return 2 * value
      >>> class Quadruple(Subgraph):
      ...     value = hfg.Input(int)
      ...     result = hfg.Output(int)
      ...     def build(self, graph: Graph) -> None:
      ...         first, second = graph.add(double()), graph.add(double())
      ...         graph.connect(self.value.inner, first.value)
      ...         first >> second
      ...         graph.connect(second.out, self.result.inner)
      >>> box = Graph().add(Quadruple())
      >>> list(box.graph.nodes)
      ['double', 'double_2']

    Attributes:
      iterate_over: names of inputs that take collections; the inner graph receives their elements one by one. The
        declared types are those of the elements (rule G4).
    """

    __slots__ = ()

    _is_base: ClassVar[bool] = True

    def build(self, graph: Graph) -> None:
        """Add the inner nodes and connect them, also to the inner sides of the subgraph's own ports. Override this.

        Args:
          graph: the empty inner graph.
        """

    @property
    def graph(self) -> Graph:
        """The graph inside.

        Raises:
          UsageError: the subgraph was not added to a graph yet.
        """
        if inside(self) is None:
            raise UsageError(
                f'subgraph "{self._type.name}" has no graph yet: build() runs when it is added with graph.add(...)'
            )
        return self._graph

    @property
    def _graph(self) -> Graph:
        """The same for floors that ask `hasattr` first: before it is built, the attribute is not there."""
        return graph_of(self._level.face)

    def _build(self) -> None:
        self.build(self._graph)


class Enclosed(Subgraph):
    """A subgraph without a type of its own, such as `Enclose` makes."""

    _is_base: ClassVar[bool] = True


def graph_of(face: object) -> Graph:
    """Return the face of a level as what it is, which the wings below do not know."""
    assert isinstance(face, Graph)
    return face
