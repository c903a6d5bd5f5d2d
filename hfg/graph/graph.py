"""Graphs as users build them: nodes, edges, groups, gates, and the ports of the whole.

Everything is checked when it is said: what is refused changes nothing. What only the whole shows (`checks`) waits for
`check()`. Stands on `edges`, `options`, `naming` and `boundary`; knows nobody who runs it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any, TypeVar, overload

from reactivex import Observable
from typing_extensions import TypeForm

from hfg import errors
from hfg.errors import GraphError, UsageError
from hfg.graph.editing.commands import Command
from hfg.graph.structure.boundary import GraphInput, GraphOutput, lifecycle_ports
from hfg.graph.structure.boxes import is_box
from hfg.graph.structure.edges import Edge, end_path, is_single, refuse
from hfg.graph.structure.gates import Gate, refuse_gate
from hfg.graph.structure.members import iterated_inputs, need_new, need_subgraph_options, refuse_move
from hfg.graph.structure.naming import default_name, find, need_name, path_of
from hfg.graph.structure.options import (
    DEFAULT_CAPACITY,
    EdgeOptions,
    GroupSpec,
    NodeOptions,
    OnError,
    Overflow,
    Policy,
    Release,
    edge_options,
    group_spec,
    in_group,
    node_options,
)
from hfg.graph.structure.promotions import refuse_promotion
from hfg.graph.structure.refusals import Refusable
from hfg.nodetype import Node, Place
from hfg.ports import ParameterPort, Port, Source, Target
from hfg.problem import Problem
from hfg.token import Token
from hfg.types import is_hint

__all__ = ["Graph"]

N = TypeVar("N", bound=Node)
T = TypeVar("T")


class Graph:
    """An activity flow graph; inside a subgraph, the part of it that lies there.

    While it runs its structure is changed by commands alone (`run.edit`): whatever else would raises `UsageError`.

    Attributes:
      name: for people; not part of any path.
      nodes: by name, in order of adding.
      edges: in order of connecting.
      gates: in order of gating.
      inputs: the ports by which the graph is fed from outside (rule P10).
      outputs: the ports at which it is read from outside.
      start: the event that begins every run (rule A10); inside a subgraph it is that of the whole graph, as are `stop`
        and `abort`.
      stop: the slot that ends the run well.
      abort: the slot that ends the run in failure.

    Example:
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

    def __init__(self, name: str = "graph") -> None:
        self.name = need_name("a graph", name)
        self.nodes: dict[str, Node] = {}
        self.edges: list[Edge] = []
        self.gates: list[Gate] = []
        self.inputs: dict[str, GraphInput[Any]] = {}
        self.outputs: dict[str, GraphOutput[Any]] = {}
        self.start, self.stop, self.abort = lifecycle_ports(self)
        self._owner: Any = None  # the subgraph whose inside this is
        self._root: Graph = self
        self._groups: dict[str, GroupSpec] = {"loop": GroupSpec("loop")}
        self._declared_groups: set[str] = set()
        self._counts: dict[str, int] = {}  # how many nodes have the default name of their type
        self._into: dict[Any, Edge] = {}  # the edge into each input that has one
        self._pairs: set[tuple[Any, Any]] = set()  # the ends of all other edges
        self._gated: set[Node] = set()
        self._promoted: dict[
            str, list[ParameterPort[Any]]
        ] = {}  # the parameters inside that one of the subgraph stands for
        self._run: Any = None  # the run it has; written by the engine
        self._edited = False  # commands are being carried out, which a run follows
        self._revision = 0  # how often it was changed by hand
        self._history: Any = None  # what was edited by commands; written by `editing`

    @classmethod
    def _inside(cls, owner: Node, around: Graph) -> Graph:
        graph = cls(around.name)
        root = around._root
        graph._owner, graph._root = owner, root
        graph.start, graph.stop, graph.abort = root.start, root.stop, root.abort
        return graph

    # --- nodes and edges ---

    def add(
        self,
        node: N,
        *,
        name: str | None = None,
        group: str | None = None,
        priority: int = 0,
        max_rate_hz: float | None = None,
        on_error: OnError = "stop",
        restart_limit: int = 5,
        restart_backoff_s: float = 0.1,
        max_duration_s: float | None = None,
        release: Release = "auto",
        active_for_s: float | None = None,
        deadline_s: float | None = None,
        enabled: bool = True,
        iterate_over: Iterable[str] = (),
    ) -> N:
        """Add a node and give it back; a subgraph builds its inside now.

        Args:
          node: belongs to no graph yet.
          name: its part of the path; by default the type's name, then with _2, _3, in order of adding.
          group: where it runs, as declared with `group`; by default that of the subgraph around it, else the loop.
          priority: higher first, in a group with policy "priority".
          max_rate_hz: at most so many firings a second, measured between starts (rule F11).
          on_error: what follows when its code fails (rule X1).
          restart_limit: for "restart": how often.
          restart_backoff_s: for "restart": the first pause.
          max_duration_s: the time limit of a firing (rule X2).
          release: when what it takes counts as processed (rule F5).
          active_for_s: how long it may stay active before its `timeout` (rule A12).
          deadline_s: how old a token may become, in a group with policy "deadline" (rule R2).
          enabled: whether it is at the start of a run.
          iterate_over: of a subgraph: inputs that take collections (rule G4).

        Raises:
          GraphError: the name is taken or not allowed, an option is out of its range, or the node is in a graph
            already; nothing was changed.
        """
        self._need_rest("adding a node")
        need_new(node)
        if name is None:
            base = node._type.name
            name, number = default_name(base, self._counts, self.nodes)
        else:
            base, number = "", 0
            if need_name("a node", name) in self.nodes:
                raise GraphError(
                    f'{self._title} has a node "{name}" already; '
                    "choose another name, or leave name out for the next free one"
                )
        path = f"{self.path}/{name}" if self._owner is not None else name
        given = {
            "group": group,
            "priority": priority,
            "max_rate_hz": max_rate_hz,
            "on_error": on_error,
            "restart_limit": restart_limit,
            "restart_backoff_s": restart_backoff_s,
            "max_duration_s": max_duration_s,
            "release": release,
            "active_for_s": active_for_s,
            "deadline_s": deadline_s,
            "enabled": enabled,
            "iterate_over": iterated_inputs(node, path, iterate_over),
        }
        options = NodeOptions()
        with Refusable(path):
            options = node_options(f'node "{path}"', given)
        node._place, node._options = Place(self, name, path), options
        self.nodes[name] = node
        if is_box(node):
            self._build(node, options)
        if number:
            self._counts[base] = number
        return node

    @overload
    def connect(
        self,
        source: Source[T],
        target: Target[T],
        *,
        active: bool = False,
        capacity: int = DEFAULT_CAPACITY,
        overflow: Overflow = "wait",
        capacity_limit: int | None = None,
        through: Iterable[Callable[[Observable[Any]], Observable[Any]]] = (),
        initial: Iterable[T] = (),
    ) -> Edge: ...
    @overload
    def connect(
        self,
        source: Observable[T] | Observable[Token[T]],
        target: Target[T],
        *,
        active: bool = False,
        capacity: int = DEFAULT_CAPACITY,
        overflow: Overflow = "wait",
        capacity_limit: int | None = None,
        through: Iterable[Callable[[Observable[Any]], Observable[Any]]] = (),
        initial: Iterable[T] = (),
    ) -> Edge: ...
    def connect(
        self,
        source: Any,
        target: Any,
        *,
        active: bool = False,
        capacity: int = DEFAULT_CAPACITY,
        overflow: Overflow = "wait",
        capacity_limit: int | None = None,
        through: Iterable[Any] = (),
        initial: Iterable[Any] = (),
    ) -> Edge:
        """Draw an edge from an output or event to an input or slot; a reactivex observable feeds from outside.

        Args:
          source: where it begins.
          target: where it ends.
          active: it also transports activity, the double line of the paper.
          capacity: of an event edge: how many untaken signals it holds (rule P5).
          overflow: of an event edge: what happens to more of them.
          capacity_limit: of an event edge: how far "wait" may let the queue grow (rule F8).
          through: of an event edge: reactivex operators on the way (rule P9).
          initial: values that lie on it at the start, the oldest first (rule P7).

        Raises:
          ConnectionError: the edge cannot be; nothing was changed.
        """
        with Refusable(source, target):
            return self._draw(source, target, active, capacity, overflow, capacity_limit, through, initial)
        return Edge(source, target, EdgeOptions())

    def _draw(
        self,
        source: Any,
        target: Any,
        active: bool,
        capacity: int,
        overflow: Overflow,
        capacity_limit: int | None,
        through: Iterable[Any],
        initial: Iterable[Any],
    ) -> Edge:
        self._need_rest("connecting")
        if source is self.start and self._is_around(target):
            # `graph.start.activates(...)` inside a subgraph: the edge belongs where its node is (rule A10).
            inside: Graph = target.graph
            return inside.connect(
                source,
                target,
                active=active,
                capacity=capacity,
                overflow=overflow,
                capacity_limit=capacity_limit,
                through=through,
                initial=initial,
            )
        options = edge_options(
            lambda: f'"{end_path(source)}" -> "{end_path(target)}"',
            active,
            capacity,
            overflow,
            capacity_limit,
            through,
            initial,
        )
        refuse(self, source, target, options)
        single = is_single(target)
        if single and target in self._into:
            found = self._into[target]
            if found.source is source:
                raise errors.ConnectionError(
                    f'"{end_path(source)}" and "{target.path}" are connected already; an edge is drawn once'
                )
            raise errors.ConnectionError(
                f'"{target.path}" takes one edge and has one from "{end_path(found.source)}", '
                f'so "{end_path(source)}" cannot lead there too; '
                "use a slot, or a node that joins the two (rule P2)"
            )
        pair = (source, target)
        if not single and pair in self._pairs:
            raise errors.ConnectionError(
                f'"{end_path(source)}" and "{target.path}" are connected already; an edge is drawn once (rule P2)'
            )
        edge = Edge(source, target, options)
        if single:
            self._into[target] = edge
        else:
            self._pairs.add(pair)
        self.edges.append(edge)
        return edge

    # --- groups and gates ---

    @property
    def groups(self) -> dict[str, GroupSpec]:
        """All groups of the whole graph by name; "loop" is always there."""
        return self._root._groups

    def group(
        self, name: str, *, threads: int | None = None, policy: Policy = "fifo", seed: int | None = None
    ) -> GroupSpec:
        """Declare where nodes run; groups belong to the whole graph, wherever they are declared.

        Args:
          name: what `add(..., group=name)` refers to; "loop" is the event loop, of which only the policy can be chosen.
          threads: 1 for a thread of its own (the default), 0 for the event loop.
          policy: who is first when several can run (rule R2).
          seed: for policy "random"; by default the run's.

        Raises:
          GraphError: a value is out of its range, or the group is declared otherwise already.
        """
        self._need_rest("declaring a group")
        root = self._root
        with Refusable(name):
            spec = group_spec(name, (0 if name == "loop" else 1) if threads is None else threads, policy, seed)
            if name in root._declared_groups and root._groups[name] != spec:
                raise GraphError(
                    f'group "{name}" is declared already, as {root._groups[name]}; '
                    "declare it once, or choose another name"
                )
            root._declared_groups.add(name)
            root._groups[name] = spec
            return spec
        return root._groups.setdefault(str(name), GroupSpec(str(name)))

    def move(self, node: Node, *, group: str | None) -> None:
        """Let a node run in another group; with a subgraph go all inside that have no group of their own.

        Args:
          node: of this graph or of a subgraph in it.
          group: one that is declared; None is that of the subgraph around the node, at last the loop.

        Raises:
          GraphError: the node is not in this graph, or the group is not declared; nothing was changed.
        """
        self._need_rest("moving a node")
        refuse_move(self, node, group)
        node._options = in_group(node._options, group)

    def gate(self, target: Node, *, by: Node, idle_rate_hz: float | None = None) -> Gate:
        """Couple the work of a node or subgraph to the activity of another: it works while `by` is active (rule A11).

        Args:
          target: who is gated.
          by: the state node or subgraph.
          idle_rate_hz: so many firings a second go on while `by` is inactive; None is none.

        Raises:
          GraphError: one of the two is not in this graph, or `target` has a gate already; nothing was changed.
        """
        self._need_rest("gating")
        gate = Gate(target, by, idle_rate_hz)
        with Refusable(target):
            refuse_gate(self, target, by, idle_rate_hz)
            self.gates.append(gate)
            self._root._gated.add(target)
        return gate

    # --- ports of the whole ---

    def input(self, name: str, type: TypeForm[T]) -> GraphInput[T]:  # noqa: A002 - the word users know
        """Declare a port by which the graph is fed from outside, and give what nodes are connected to (rule P10).

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        port: GraphInput[T] = GraphInput(self, self._new_port("input", name, type), type)
        self.inputs[name] = port
        return port

    def output(self, name: str, type: TypeForm[T]) -> GraphOutput[T]:  # noqa: A002
        """Declare a port at which the graph is read from outside, and give what nodes are connected to (rule P10).

        Raises:
          GraphError: the name is taken or not allowed, or this is the inside of a subgraph.
        """
        port: GraphOutput[T] = GraphOutput(self, self._new_port("output", name, type), type)
        self.outputs[name] = port
        return port

    def promote(self, outer: ParameterPort[T], inner: ParameterPort[T]) -> None:
        """Let a parameter of the subgraph stand for one inside, which takes its value now and when it is set (rule G3).

        Args:
          outer: the subgraph's, `self.speed`; it may stand for several.
          inner: `node.ports.parameters["limit"]`.

        Raises:
          GraphError: the two cannot be one; nothing was changed.
        """
        self._need_rest("promoting a parameter")
        with Refusable(outer):
            refuse_promotion(self, outer, inner)
            inner.value = outer.value
            self._promoted.setdefault(outer.name, []).append(inner)

    # --- finding and checking ---

    def __getitem__(self, path: str) -> Any:
        """Find a node, "fetch/go_to", or a port, "fetch/go_to.goal"; ports of the whole graph by their name.

        Raises:
          GraphError: there is none, or an input and an output share the name.
        """
        return find(self, path)

    def check(self) -> list[Problem]:
        """Look for what keeps the graph from working, or probably does; errors first."""
        from hfg.graph.checks.checking import check

        return check(self)

    def draw(self, path: str | os.PathLike[str] | None = None) -> str:
        """Draw it and give the text of the drawing; in a notebook a graph is shown by itself.

        Double or thick lines are active edges, dashed ones begin at events; nodes that are active in a run have a thick
        border.

        Args:
          path: a file that ends in ".mmd" (Mermaid) or ".dot" (Graphviz); without it nothing is written and the text is
            Mermaid.

        Raises:
          UsageError: the file has another ending, or cannot be written.
        """
        from hfg.graph.drawing.formats import draw

        return draw(self, path)

    # --- editing ---

    def edit(self, *commands: Command) -> None:
        """Carry commands out, all of them or, when one is refused, none; a graph that runs is edited by `run.edit`.

        Raises:
          GraphError: one cannot be; the message says which and why.
          UsageError: the graph runs, or is the inside of a subgraph.

        Example:
          >>> from hfg import Graph, commands
          >>> graph = Graph()
          >>> graph.edit(commands.Add("hfg.testing.nodes:double", "double", options={"max_rate_hz": 5}))
          >>> graph.undo()
          >>> graph.nodes
          {}
        """
        from hfg.graph.editing.transactions import edit

        edit(self, commands)

    def undo(self) -> None:
        """Take the last edit back: everything is exactly as before it.

        Raises:
          UsageError: there is none, or the graph was changed by hand since, or runs.
        """
        from hfg.graph.editing.transactions import undo

        undo(self)

    def redo(self) -> None:
        """Carry the edit out again that was undone last.

        Raises:
          UsageError: there is none, or the graph was changed since, or runs.
        """
        from hfg.graph.editing.transactions import redo

        redo(self)

    def reload(self, module: str | ModuleType) -> None:
        """Run a changed module again; its node types replace those of its nodes, parameters are kept.

        Raises:
          GraphError: the module fails, or a new type does not fit the edges; nothing was changed.
          UsageError: the graph runs: `run.reload` is for that.
        """
        from hfg.graph.editing.transactions import reload

        reload(self, module)

    def _repr_markdown_(self) -> str:
        return f"```mermaid\n{self.draw()}```\n"

    @property
    def path(self) -> str:
        """That of the subgraph whose inside this is; "" for a whole graph."""
        return "" if self._owner is None else path_of(self._owner)

    @property
    def _place(self) -> Place:
        """Where its own ports are; asked by them."""
        return Place(self, self.name, "")

    def __repr__(self) -> str:
        return f"<{self._title}: {len(self.nodes)} nodes, {len(self.edges)} edges>"

    # --- inside ---

    def _need_rest(self, doing: str) -> None:
        """Refuse to change the structure under a run, which would not hear of it; and note that it was by hand."""
        root = self._root
        if root._edited:
            return
        if root._run is not None:
            raise UsageError(
                f"{self._title} runs, so {doing} by hand is refused: use commands, which the run follows, as in "
                "await run.edit(hfg.commands.Connect(...)), or stop the run first"
            )
        root._revision += 1

    @property
    def _title(self) -> str:
        return f'graph "{self.name}"' if self._owner is None else f'the graph inside "{self.path}"'

    def _build(self, node: Any, options: NodeOptions) -> None:
        """Let a subgraph make its inside; if that fails, nothing of it remains."""
        root = self._root
        groups, declared = dict(root._groups), set(root._declared_groups)
        try:
            need_subgraph_options(node, options)
            node._graph = Graph._inside(node, self)
            node.build(node._graph)
        except BaseException:
            root._groups, root._declared_groups = groups, declared
            self._take_back(node)
            raise

    def _take_back(self, node: Any) -> None:
        """Undo an addition that failed half-way, with everything that was added or connected meanwhile."""
        del self.nodes[node._place.name]
        gone: set[Any] = {node}
        waiting = [node]
        while waiting:
            inner = getattr(waiting.pop(), "_graph", None)
            if inner is not None:
                gone.update(inner.nodes.values())
                waiting += [below for below in inner.nodes.values() if is_box(below)]
                self._root._gated.difference_update(gate.target for gate in inner.gates)
        kept = [edge for edge in self.edges if gone.isdisjoint((getattr(edge.source, "node", None), edge.target.node))]
        self.edges[:] = kept
        self._into = {edge.target: edge for edge in kept if is_single(edge.target)}
        self._pairs = {(edge.source, edge.target) for edge in kept if not is_single(edge.target)}
        self.gates[:] = [gate for gate in self.gates if gone.isdisjoint((gate.target, gate.by))]
        self._root._gated -= gone
        for one in gone:
            one._place = one._options = None
            if hasattr(one, "_graph"):
                del one._graph

    def _is_taken(self, port: Port) -> bool:
        """Whether it is an input that has its edge."""
        return port in self._into

    def _is_around(self, target: Any) -> bool:
        """Whether a port lies in a graph inside this one."""
        home = getattr(target, "graph", None)
        return isinstance(home, Graph) and home is not self and home._root is self

    def _new_port(self, kind: str, name: str, hint: Any) -> str:
        self._need_rest("declaring a port")
        if self._owner is not None:
            raise GraphError(
                f'the graph inside "{self.path}" has the ports of its subgraph; '
                f"declare `{name} = hfg.{kind.title()}(...)` in its class"
            )
        need_name(f"an {kind} of the graph", name)
        if name in self._boundary_ports():
            raise GraphError(f'{self._title} has a port "{name}" already; choose another name')
        if not is_hint(hint):
            raise GraphError(
                f'the type of {kind} "{name}" is {hint!r:.80}, which is no type; write graph.{kind}("{name}", int)'
            )
        return name

    def _boundary_ports(self) -> dict[str, Port]:
        return {"start": self.start, "stop": self.stop, "abort": self.abort, **self.inputs, **self.outputs}
