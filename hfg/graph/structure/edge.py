"""Edges as they are declared, before subgraphs are dissolved; and what can be asked of one of their ends.

Depends on ports and options; knows neither graphs nor what is right or wrong.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final, TypeAlias

import msgspec
from reactivex import Observable
from typing_extensions import TypeIs

from hfg.graph.structure.options import EdgeOptions, Overflow
from hfg.graph.structure.subgraph import iterated
from hfg.ports import InnerSource, InnerTarget, Port, Source, Target

PortEnd: TypeAlias = Port | InnerSource[Any] | InnerTarget[Any]
SourceEnd: TypeAlias = PortEnd | Observable[Any]  # that the direction is right is seen when an edge is declared
TargetEnd: TypeAlias = PortEnd
_ENDS: Final = (Source, Target)


class Edge(msgspec.Struct, frozen=True, eq=False):
    """One edge of one graph, before subgraphs are dissolved.

    Attributes:
      source: an output, event, parameter or inner side; or a plain reactivex observable, a feed from outside.
      target: an input, slot, parameter or inner side.
      options: shared with all edges that have the same.
    """

    source: Any
    target: Any
    options: EdgeOptions

    @property
    def active(self) -> bool:
        """A(e) of the paper: whether it also transports activity."""
        return self.options.active

    @property
    def capacity(self) -> int:
        """How many untaken signals its queue holds; for event edges."""
        return self.options.capacity

    @property
    def overflow(self) -> Overflow:
        """What happens to more of them."""
        return self.options.overflow

    @property
    def label(self) -> str:
        """Its ends, "a.out -> b.in"."""
        return f"{end_path(self.source)} -> {end_path(self.target)}"

    def __repr__(self) -> str:
        return f"<{'active edge' if self.active else 'edge'} {self.label}>"


def end_path(end: object) -> str:
    """Return the path of a port; an observable from outside has none."""
    path = getattr(end, "path", None) if isinstance(end, Source | Target) else None
    return path if isinstance(path, str) else "observable"


def is_port(end: object) -> TypeIs[PortEnd]:
    """Whether it is a port or the inner side of one, no observable from outside; an event is both, and a port."""
    return isinstance(end, _ENDS)


def is_feed(end: object) -> bool:
    """Return whether it is a plain observable, which feeds from outside; an event is one too, but a port."""
    return not isinstance(end, _ENDS)


def owner_of(end: SourceEnd) -> object:
    """Return the node, or whole graph, that an end belongs to as seen from outside; None for an inner side."""
    return end.node if isinstance(end, Port) else None


def is_single(target: TargetEnd) -> bool:
    """Return whether at most one edge may lead into it (rule P2): inputs and parameters.

    A subgraph's output seen from inside is a relay, at which streams may converge before a slot (rule G1); the check
    finds an input that gets two edges in this way. An iterating subgraph makes one list of each output (rule G4).
    """
    return target.kind in ("input", "parameter") or (target.kind == "output" and bool(iterated(target.node)))


def type_of(end: PortEnd) -> object:
    """Return the type that an edge meets; outside what iterates, collections of what is declared (rule G4)."""
    names = iterated(end.node)
    if not names or isinstance(end, InnerSource | InnerTarget):
        return end.type
    if end.kind == "input":
        return Collection[end.type] if end.name in names else end.type  # type: ignore[name-defined]  # a value
    return list[end.type] if end.kind == "output" else end.type  # type: ignore[name-defined]
