"""The common part of all ports: owner, name, type, direction, path and connections.

A port is *declared* in a class body (`Input`, `Output`, `Event`, `slot`, `Parameter`). The *bound* port of one node
belongs to another class (`InputPort`, ...) and is made when it is first used. Type checkers see the direction of a port
as `Source[T]` or `Target[T]`: an edge goes from a `Source[T]` to a `Target[T]`. Depends on errors, and on nodes and
graphs only through protocols.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, Protocol, TypeVar, cast

from hfg.base.token import Token
from hfg.errors import NotRunning, UsageError

__all__ = ["Kind", "Owner", "Port", "Relaying", "Source", "Target", "need_sendable", "path_of"]

T_co = TypeVar("T_co", covariant=True)
T_contra = TypeVar("T_contra", contravariant=True)
Other = TypeVar("Other")

Kind = Literal["input", "output", "event", "slot", "parameter"]


class Owner(Protocol):
    """The part of a node (or graph) that its ports need."""

    @property
    def _place(self) -> Any:
        """The place of the node, with `graph`, `name` and `path`; None before the node is added."""


class Relaying:
    """Base of subgraphs. Their ports are relays (rule G1), which `.inner` shows from inside the subgraph."""

    __slots__ = ()


class Source(Generic[T_co]):
    """Start of an edge: an output, an event, a parameter, or the inner side of a subgraph's input or slot."""

    __slots__ = ()

    def activates(self, target: Target[T_co]) -> Any:
        """Connect with an active edge, the double line of the paper. Return `target`.

        Same as `graph.connect(self, target, active=True)`.
        """
        return _graph_of(self, target).connect(self, target, active=True)

    def __rshift__(self, other: Other) -> Other:
        """Connect to a target, or to the only free target of a node.

        Returns `other`, so that chains read from left to right.
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
    """End of an edge: an input, a slot, a parameter, or the inner side of a subgraph's output or event."""

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
        """Its address, "subgraph/node.port".

        Before the node is added, the name of its type takes the place of its own.
        """
        return path_of(self.node, self.name)

    @property
    def graph(self) -> Any:
        """The graph that holds its edges."""
        place = self.node._place
        return None if place is None else place.graph

    def __repr__(self) -> str:
        return f"<{self.kind} {self.path}>"

    if not TYPE_CHECKING:  # type checkers report missing attributes themselves

        @property
        def value(self) -> Any:
            """Not available: ports do not keep values."""
            raise AttributeError(self._without("value"))

        @property
        def connect(self) -> Any:
            """Not available: use `graph.connect`."""
            raise AttributeError(self._without("connect"))

    def _without(self, name: str) -> str:
        """Return the message for a missing attribute, with a remedy."""
        if name == "value":
            what, remedy = (
                "a port does not hold a value",
                "watch its tokens with run.tap(port), or connect it to a node",
            )
        elif name == "connect":
            what, remedy = "it is only an end of edges", "write graph.connect(source, target)"
        else:
            what, remedy = "it is only an end of edges", "its attributes are name, type, node and path"
        return f'{self.kind} "{self.path}" has no "{name}": {what}; {remedy}'

    def _not_running(self, call: str) -> NotRunning:
        return NotRunning(
            f'"{self.path}" cannot {call} outside a run: run the graph with hfg.run(graph), or test the node '
            "by itself with hfg.testing.fire"
        )


def path_of(node: Any, name: str) -> str:
    """Return the path of a port called `name` of `node`. Paths of a root graph's own ports have no dot."""
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
        f'"{first.path}" and "{second.path}" do not belong to a graph yet: add their nodes with '
        "graph.add(...) before connecting them"
    )


def need_sendable(value: object, activity: object, stamp: object) -> None:
    """Refuse an invalid modifier or stamp, given or of a token that is passed on (T1, T5).

    Raises:
      UsageError: the modifier is not -1, 0 or +1, or the stamp is not finite.
    """
    if type(value) is Token:
        activity = value.activity if activity is None else activity
        stamp = value.stamp if stamp is None else stamp
    if stamp is not None and not (isinstance(stamp, int | float) and math.isfinite(stamp)):
        raise UsageError(f"stamp must be seconds on the run's clock, or None for what rule T5 says, got {stamp!r}")
    if activity is not None and not (isinstance(activity, int) and -1 <= activity <= 1):
        raise UsageError(f"activity must be -1, 0 or +1, or None for what rule A3 says, got {activity!r}")
