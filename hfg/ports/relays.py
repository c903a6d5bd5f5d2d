"""The inner sides of a subgraph's ports (rule G1).

Seen from inside the box an input or slot is a source, and an output or event is a target. `subgraph.person.inner` is
made when it is first asked for. Stands on `base`.
"""

from __future__ import annotations

from typing import Any, TypeVar

from hfg.errors import UsageError
from hfg.ports.base import Kind, Port, Relaying, Source, Target

__all__ = ["InnerSource", "InnerTarget", "inner_source", "inner_target"]

T_co = TypeVar("T_co", covariant=True)
T_contra = TypeVar("T_contra", contravariant=True)


class _Inner:
    """One side of a relay; `outer` is the port as the world outside sees it."""

    __slots__ = ("outer",)

    def __init__(self, outer: Port) -> None:
        self.outer = outer

    @property
    def node(self) -> Any:
        """The subgraph."""
        return self.outer.node

    @property
    def name(self) -> str:
        """The port's name, the same on both sides."""
        return self.outer.name

    @property
    def type(self) -> Any:
        """The port's type, the same on both sides."""
        return self.outer.type

    @property
    def kind(self) -> Kind:
        """What the port is outside."""
        return self.outer.kind

    @property
    def path(self) -> str:
        """The port's path with ".inner" behind it, for messages."""
        return f"{self.outer.path}.inner"

    @property
    def graph(self) -> Any:
        """The graph in the box."""
        return getattr(self.outer.node, "graph", None)

    def __repr__(self) -> str:
        return f"<inner {self.kind} {self.path}>"


class InnerSource(_Inner, Source[T_co]):
    """A subgraph's input or slot, seen from inside."""

    __slots__ = ()


class InnerTarget(_Inner, Target[T_contra]):
    """A subgraph's output or event, seen from inside."""

    __slots__ = ()


def inner_source(port: Port) -> InnerSource[Any]:
    """Make the inner side of an input or slot.

    Raises:
      UsageError: the port's node is no subgraph.
    """
    _need_box(port)
    return InnerSource(port)


def inner_target(port: Port) -> InnerTarget[Any]:
    """Make the inner side of an output or event.

    Raises:
      UsageError: the port's node is no subgraph.
    """
    _need_box(port)
    return InnerTarget(port)


def _need_box(port: Port) -> None:
    # The owner may also be a root graph, whose boundary has two sides as well; only plain nodes have no inside.
    if hasattr(port.node, "_type") and not isinstance(port.node, Relaying):
        raise UsageError(
            f'"{port.path}" has no inner side: only ports of an hfg.Subgraph look into a box; connect the port itself'
        )
