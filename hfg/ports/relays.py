"""The inner sides of a subgraph's ports (rule G1).

Inside a subgraph, its inputs and slots are sources, and its outputs and events are targets. `subgraph.person.inner` is
made when it is first used. Depends on `base`.
"""

from __future__ import annotations

from typing import Any, TypeVar

from hfg.errors import UsageError
from hfg.ports.base import Kind, Port, Relaying, Source, Target

__all__ = ["InnerSource", "InnerTarget", "inner_source", "inner_target"]

T_co = TypeVar("T_co", covariant=True)
T_contra = TypeVar("T_contra", contravariant=True)


class _Inner:
    """One side of a relay; `outer` is the port as seen from outside."""

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
        """The port's kind, as seen from outside."""
        return self.outer.kind

    @property
    def path(self) -> str:
        """The port's path followed by ".inner", for messages."""
        return f"{self.outer.path}.inner"

    @property
    def graph(self) -> Any:
        """The inner graph."""
        return getattr(self.outer.node, "graph", None)

    def __repr__(self) -> str:
        return f"<inner {self.kind} {self.path}>"


class InnerSource(_Inner, Source[T_co]):
    """A subgraph's input or slot as seen from inside."""

    __slots__ = ()


class InnerTarget(_Inner, Target[T_contra]):
    """A subgraph's output or event as seen from inside."""

    __slots__ = ()


def inner_source(port: Port) -> InnerSource[Any]:
    """Return the inner side of an input or slot.

    Raises:
      UsageError: the port's node is not a subgraph.
    """
    _need_box(port)
    return InnerSource(port)


def inner_target(port: Port) -> InnerTarget[Any]:
    """Return the inner side of an output or event.

    Raises:
      UsageError: the port's node is not a subgraph.
    """
    _need_box(port)
    return InnerTarget(port)


def _need_box(port: Port) -> None:
    # The owner may also be a root graph, whose boundary has two sides, too; only plain nodes have no inside.
    if hasattr(port.node, "_type") and not isinstance(port.node, Relaying):
        raise UsageError(
            f'"{port.path}" has no inner side: only ports of an hfg.Subgraph have one; connect the port itself'
        )
