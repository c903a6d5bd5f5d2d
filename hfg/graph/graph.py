"""Graph, the face: what users say about graphs, and nothing of how it is done.

A graph is the face of a level (`structure`): nodes, edges, gates and the ports of the whole. What is said is checked
when it is said, and what is refused changes nothing; what only the whole shows waits for `check()`. Stands on all
wings, which know it by name alone; knows nobody who runs it.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any, ClassVar, Final, Literal, Never, TypeAlias, TypeVar, Unpack, overload

from reactivex import Observable
from typing_extensions import TypeForm

from hfg.base.token import Token
from hfg.errors import Problem, UsageError
from hfg.graph.checks.checking import check
from hfg.graph.editing import transactions
from hfg.graph.editing.commands import Command
from hfg.graph.editing.telling import as_commands
from hfg.graph.structure.adding import add
from hfg.graph.structure.assigning import declare_group, move
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.connecting import connect
from hfg.graph.structure.declaring import need_new_port
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.finding import find
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.gating import set_gate
from hfg.graph.structure.level import Level, Whole, inside
from hfg.graph.structure.naming import need_name
from hfg.graph.structure.option import Fields, unknown
from hfg.graph.structure.options import EdgeGiven, EdgeOptions, GroupGiven, GroupSpec, NodeGiven, NodeOptions
from hfg.graph.structure.pointing import node_at
from hfg.graph.structure.promoting import promote
from hfg.graph.structure.subgraph import Box
from hfg.nodetypes.node import Node, Place
from hfg.ports import EventPort, ParameterPort, Port, SlotPort, Source, Target

__all__ = ["Enclosed", "Graph", "Subgraph", "graph_of"]

N = TypeVar("N", bound=Node)
T = TypeVar("T")
Through: TypeAlias = Callable[[Observable[Any]], Observable[Any]]

_NOBODY: Final[Any] = None  # so that a forgotten `by=` is answered by a sentence


class Graph:
    """An activity flow graph; inside a subgraph, the part of it that lies there.

    While it runs its structure is changed by commands alone (`run.edit`): whatever else would raises `UsageError`.

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
        """For people; not part of any path."""
        return self._level.name

    @name.setter
    def name(self, name: str) -> None:
        self._level.name = need_name("a graph", name)

    @property
    def nodes(self) -> dict[str, Node]:
        """By name, in order of adding."""
        return self._level.nodes

    @property
    def edges(self) -> list[Edge]:
        """In order of connecting."""
        return self._level.edges

    @property
    def gates(self) -> list[Gate]:
        """In order of gating."""
        return self._level.gates.listed

    @property
    def groups(self) -> dict[str, GroupSpec]:
        """All groups of the whole graph by name; "loop" is always there."""
        return self._level.whole.groups.by_name

    @property
    def inputs(self) -> dict[str, GraphInput[Any]]:
        """The ports by which the graph is fed from outside (rule P10)."""
        return self._level.ports.inputs

    @property
    def outputs(self) -> dict[str, GraphOutput[Any]]:
        """The ports at which it is read from outside."""
        return self._level.ports.outputs

    @property
    def start(self) -> EventPort[None]:
        """The event that begins every run (rule A10); inside a subgraph that of the whole, as the next two are."""
        return self._level.ports.start

    @property
    def stop(self) -> SlotPort[object]:
        """The slot that ends the run well."""
        return self._level.ports.stop

    @property
    def abort(self) -> SlotPort[object]:
        """The slot that ends the run in failure."""
        return self._level.ports.abort

    @property
    def path(self) -> str:
        """That of the subgraph whose inside this is; "" for a whole graph."""
        return self._level.path

    # --- nodes and edges ---

    def add(self, node: N, *, name: str | None = None, **options: Unpack[NodeGiven]) -> N:
        """Add a node and return it; a subgraph builds its inside now.

        Args:
          node: belongs to no graph yet.
          name: its part of the path; by default the type's name, then with _2, _3, in order of adding.
          **options: how it runs; `help(hfg.graph.NodeOptions)` and docs/reference.md list all.

        Raises:
          GraphError: the name is taken or not allowed, an option is out of its range, or the node is in a graph
            already; nothing was changed.
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
        """Declare an edge from an output or event to an input or slot; a reactivex observable feeds from outside.

        Args:
          source: where it begins: the port, or its path, "fetch/camera.out".
          target: where it ends, in the same way.
          **options: how it transports; `help(hfg.graph.EdgeOptions)` and docs/reference.md list all.

        Raises:
          ConnectionError: the edge cannot be; nothing was changed.
          GraphError: a path leads nowhere.
        """
        _need_known(EdgeOptions, options, "graph.connect")
        return connect(self._level, source, target, options)

    # --- groups and gates ---

    def group(self, name: str, **options: Unpack[GroupGiven]) -> GroupSpec:
        """Declare where nodes run; groups belong to the whole graph, wherever they are declared.

        Args:
          name: what `add(..., group=name)` refers to; "loop" is the event loop, of which only the policy can be chosen.
          **options: what it is; `help(hfg.graph.GroupSpec)` and docs/reference.md list all.

        Raises:
          GraphError: a value is out of its range, or the group is declared otherwise already.
        """
        _need_known(GroupSpec, options, "graph.group")
        return declare_group(self._level, name, options)

    def move(self, node: Node | str, *, group: str | None) -> None:
        """Let a node run in another group; with a subgraph go all inside that have no group of their own.

        Args:
          node: of this graph or of a subgraph in it, or its path.
          group: one that is declared; None is that of the subgraph around the node, at last the loop.

        Raises:
          GraphError: the node is not in this graph, or the group is not declared; nothing was changed.
        """
        move(self._level, node, group)

    def gate(
        self, target: Node | str, *others: Never, by: Node | str = _NOBODY, idle_rate_hz: float | None = None
    ) -> Gate:
        """Couple the work of a node or subgraph to the activity of another: it works while `by` is active (rule A11).

        Args:
          target: who is gated: a node or subgraph, or its path.
          others: nobody; they are told how to be said.
          by: the state node or subgraph, or its path.
          idle_rate_hz: so many firings a second go on while `by` is inactive; None is none.

        Raises:
          GraphError: one of the two is not in this graph, or `target` has a gate already; nothing was changed.
        """
        if others or by is _NOBODY:
            raise UsageError(
                f"a gate has to say who works while whom is active, got {len(others) + 1} nodes and "
                f"{'no by=' if by is _NOBODY else 'by='}: write graph.gate(detector, by=fetch)"
            )
        return set_gate(self._level, target, by, idle_rate_hz)

    # --- ports of the whole ---

    def input(self, name: str, type: TypeForm[T]) -> GraphInput[T]:  # noqa: A002 - the word users know
        """Declare a port by which the graph is fed from outside, and give what nodes are connected to (rule P10).

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        need_new_port(self._level, "input", name, type)
        port: GraphInput[T] = GraphInput(self, name, type)
        self._level.ports.add(port)
        return port

    def output(self, name: str, type: TypeForm[T]) -> GraphOutput[T]:  # noqa: A002
        """Declare a port at which the graph is read from outside, and give what nodes are connected to (rule P10).

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        need_new_port(self._level, "output", name, type)
        port: GraphOutput[T] = GraphOutput(self, name, type)
        self._level.ports.add(port)
        return port

    def promote(self, outer: ParameterPort[T], inner: ParameterPort[T]) -> None:
        """Let a parameter of the subgraph stand for one inside, which takes its value now and when it is set (rule G3).

        Args:
          outer: the subgraph's, `self.speed`; it may stand for several.
          inner: `node.ports.parameters["limit"]`.

        Raises:
          GraphError: the two cannot be one; nothing was changed.
        """
        promote(self._level, outer, inner)

    # --- finding and checking ---

    def __getitem__(self, path: str) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
        """Find a node, "fetch/go_to", or a port, "fetch/go_to.goal"; ports of the whole graph by their name.

        Behind a port of a subgraph ".inner" names the side that looks into it.

        Raises:
          GraphError: there is none, or an input and an output share the name.
        """
        return find(self._level, path)

    def check(self) -> list[Problem]:
        """Look for what keeps the graph from working, or probably does; errors first."""
        return check(self)

    def draw(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        depth: int | None = None,
        fold: Iterable[Node | str] = (),
        active: Iterable[Node | str] | None = None,
        ports: Literal["used", "all"] = "used",
        format: Literal["svg", "mmd", "dot"] | None = None,  # noqa: A002 - the word users know
    ) -> str:
        """Draw it and give the text of the drawing; in a notebook a graph is shown by itself.

        An SVG has the notation of the paper: inputs left, outputs right, slots on top, events at the bottom; dark
        squares are synchronous, light circles asynchronous, double lines active edges. What is active in a run has a
        thick border.

        Args:
          path: a file that ends in ".svg", ".mmd" (Mermaid) or ".dot" (Graphviz); without it nothing is written.
          depth: so many subgraphs inside each other are shown open, 0 shows all of them folded; None folds none.
          fold: subgraphs, or their paths, that are folded whatever the depth.
          active: which nodes and subgraphs are shown as active, as `run.active()` gives them; None: those that are now.
          ports: "all" shows those, too, that no edge leads to.
          format: "svg", "mmd" or "dot", whatever the file is called; without a file and this the text is Mermaid.

        Raises:
          GraphError: a node is not in the graph, or is to be folded and no subgraph.
          UsageError: the file has another ending, or cannot be written, or an argument is none of its kind.
        """
        from hfg.graph.drawing.formats import draw, view_of  # here, for most programs draw nothing

        return draw(self, path, format=format, view=view_of(self, depth, fold, active, ports))

    # --- editing ---

    def edit(self, *commands: Command) -> None:
        """Carry commands out, all of them or, when one is refused, none; a graph that runs is edited by `run.edit`.

        Raises:
          GraphError: one cannot be; the message says which and why.
          UsageError: the graph runs, or is the inside of a subgraph.

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
        """Whether there is an edit to take back; of the last 1,000."""
        return bool(self._level.whole.history.done)

    @property
    def can_redo(self) -> bool:
        """Whether an edit was undone last, so that it can be carried out again."""
        return bool(self._level.whole.history.undone)

    @property
    def history(self) -> tuple[tuple[Command, ...], ...]:
        """The edits that can be taken back, as they were given, the last one last; of the last 1,000."""
        return tuple(transaction.commands for transaction in self._level.whole.history.done)

    def notes(self, path: str = "") -> dict[str, Any]:
        """Give what editors have noted by `commands.Note` about a node or subgraph, by name; nothing else reads it.

        Args:
          path: of the node; "" for the free notes about the whole graph.

        Raises:
          GraphError: there is no such node.
        """
        return copy.deepcopy(self._level.whole.notes.get(node_at(self._level, path) if path else None, {}))

    def as_commands(self) -> list[Command]:
        """Give the commands that make this graph: in one edit of an empty graph they give an equal one.

        Nodes are made by the references of their types, so types that cannot be found by name are refused, and so are
        values and code on edges that are no data.

        Raises:
          GraphError: something cannot be said by commands; the message names it and what to do.

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
        """Take the last edit back: everything is exactly as before it.

        Raises:
          UsageError: there is none, or the graph was changed by hand since, or runs.
        """
        transactions.undo(self)

    def redo(self) -> None:
        """Carry the edit out again that was undone last.

        Raises:
          UsageError: there is none, or the graph was changed since, or runs.
        """
        transactions.redo(self)

    def reload(self, module: str | ModuleType) -> None:
        """Run a changed module again; its node types replace those of its nodes, parameters are kept.

        Raises:
          GraphError: the module fails, or a new type does not fit the edges; nothing was changed.
          UsageError: the graph runs: `run.reload` is for that.
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
        """Whether it is an input that has its edge; asked by `>>`."""
        return port in self._level.connections.into

    @property
    def _run(self) -> object | None:
        """The run that it has as a whole, if any; asked by events."""
        return self._level.whole.run


def _need_known(kind: type[Fields], options: Iterable[str], call: str) -> None:
    """Refuse what Python refuses of a call whose arguments are written out."""
    wrong = unknown(kind, options, call) if options else None
    if wrong is not None:
        raise TypeError(f"{call}: {wrong}")


def _face_of(level: Level) -> Graph:
    return Graph(level.name, _level=level)


class Subgraph(Box):
    """A node that holds a graph.

    Ports are declared as on any node; `.inner` is the side of a port that looks into the box. A slot needs no handler:
    `begin = hfg.slot(type=int)`. The graph inside is built when the subgraph is added.

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
      iterate_over: names of inputs that take collections, whose elements the inside sees one by one; the declared types
        are those inside (rule G4).
    """

    __slots__ = ()

    _is_base: ClassVar[bool] = True

    def build(self, graph: Graph) -> None:
        """Add the nodes inside and connect them, also with the inner sides of the subgraph's own ports."""

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
