"""What every port has in common: whose it is, its name, type, direction and path, and how it is connected.

A port is *declared* in a class body (`Input`, `Output`, `Event`, `slot`, `Parameter`); the *bound* port of one node is
another class (`InputPort`, ...), made when it is first asked for. `Source[T]` and `Target[T]` are what type checkers
see of a direction: an edge goes from a `Source[T]` to a `Target[T]`. Stands on errors; knows nodes and graphs only by
what they must offer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, Protocol, TypeVar, cast

from hfg.errors import NotRunning, UsageError

__all__ = ["Kind", "Owner", "Port", "Relaying", "Source", "Target", "path_of"]

T_co = TypeVar("T_co", covariant=True)
T_contra = TypeVar("T_contra", contravariant=True)
Other = TypeVar("Other")

Kind = Literal["input", "output", "event", "slot", "parameter"]


class Owner(Protocol):
    """What a port needs of the node (or graph) it belongs to."""

    @property
    def _place(self) -> Any:
        """Where the node is: has `graph`, `name` and `path`; None before it is added."""


class Relaying:
    """Base of subgraphs: their ports are relays (rule G1), which `.inner` sees from inside the box."""

    __slots__ = ()


class Source(Generic[T_co]):
    """Where an edge may begin: an output, an event, a parameter, or the inner side of a subgraph's input or slot."""

    __slots__ = ()

    def activates(self, target: Target[T_co]) -> Any:
        """Connect with an active edge, the double line of the paper.

        The same as `graph.connect(self, target, active=True)`.
        """
        return _graph_of(self, target).connect(self, target, active=True)

    def __rshift__(self, other: Other) -> Other:
        """Connect to a target, or to the only free one of a node.

        Gives back `other`, so that chains read from left to right.
        """
        if isinstance(other, str):
            raise UsageError(
                f'>> takes nodes and ports, got the path "{other}"; write graph.connect(source, "{other}")'
            )
        finder = getattr(other, "_free_target", None)
        target = other if finder is None else finder()
        if not isinstance(target, Target):
            return NotImplemented
        _graph_of(self, target).connect(self, target)
        return other


class Target(Generic[T_contra]):
    """Where an edge may end: an input, a slot, a parameter, or the inner side of a subgraph's output or event."""

    __slots__ = ()


class Port:
    """A port of one node."""

    __slots__ = ("name", "node", "type")

    kind: ClassVar[Kind]

    def __init__(self, node: Owner, name: str, type: Any) -> None:  # noqa: A002 - the word users know
        self.node: Any = node
        self.name = name
        self.type = type

    @property
    def path(self) -> str:
        """Its address, "subgraph/node.port"; before the node is added, its type's name stands for the node."""
        return path_of(self.node, self.name)

    @property
    def graph(self) -> Any:
        """The graph in which its edges are drawn."""
        place = self.node._place
        return None if place is None else place.graph

    def __repr__(self) -> str:
        return f"<{self.kind} {self.path}>"

    if not TYPE_CHECKING:  # type checkers say of themselves what there is not

        @property
        def value(self) -> Any:
            """Refused: what passes is not kept."""
            raise AttributeError(self._without("value"))

        @property
        def connect(self) -> Any:
            """Refused: graphs connect."""
            raise AttributeError(self._without("connect"))

    def _without(self, name: str) -> str:
        """Say that there is nothing of this name, and what to do."""
        if name == "value":
            what, remedy = "a port holds no value", "look at what passes with run.tap(port), or connect it to a node"
        elif name == "connect":
            what, remedy = "it is an end of edges", "write graph.connect(source, target)"
        else:
            what, remedy = "it is an end of edges", "ask for its name, type, node or path"
        return f'{self.kind} "{self.path}" has no "{name}": {what}; {remedy}'

    def _not_running(self, call: str) -> NotRunning:
        return NotRunning(
            f'"{self.path}" cannot {call} outside a run: run the graph with hfg.run(graph), or try the node alone '
            "with hfg.testing.fire"
        )


def path_of(node: Any, name: str) -> str:
    """Give the path of a port called `name` of `node`; the ports of a root graph stand without a dot."""
    place = node._place
    if place is not None:
        return f"{place.path}.{name}" if place.path else name
    kind = getattr(node, "_type", None)
    return f"{kind.name}.{name}" if kind is not None else name


def _graph_of(source: object, target: object) -> Any:
    """Find the graph in which two ends are to be connected.

    Raises:
      UsageError: neither end belongs to a graph yet.
    """
    for end in (source, target):
        graph = getattr(end, "graph", None)
        if graph is not None:
            return graph
    first, second = cast(Any, source), cast(Any, target)
    raise UsageError(
        f'"{first.path}" and "{second.path}" belong to no graph yet: add their nodes with graph.add(...) before '
        "connecting them"
    )
