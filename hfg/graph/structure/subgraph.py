"""Subgraphs: nodes that hold a graph; their ports are relays between outside and inside (rules G1-G4).

Stands on `node`; knows graphs and levels by name alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from typing_extensions import TypeIs

from hfg.errors import UsageError
from hfg.nodetypes.node import Node
from hfg.ports import Relaying

if TYPE_CHECKING:
    from hfg.graph.graph import Graph
    from hfg.graph.structure.level import Level

__all__ = ["Subgraph", "inside", "is_box", "iterated"]


class Subgraph(Node, Relaying):
    """A node that holds a graph.

    Ports are declared as on any node; `.inner` is the side of a port that looks into the box. A slot needs no handler:
    `begin = hfg.slot(type=int)`. The graph inside is built when the subgraph is added.

    Example:
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

    __slots__ = ("_level",)

    iterate_over: ClassVar[tuple[str, ...]] = ()

    _level: Level  # what lies inside; written by the graph it is added to (`membership`), not there before

    def build(self, graph: Graph) -> None:
        """Add the nodes inside and connect them, also with the inner sides of the subgraph's own ports."""

    @property
    def graph(self) -> Graph:
        """The graph inside.

        Raises:
          UsageError: the subgraph was not added to a graph yet.
        """
        level = inside(self)
        if level is None:
            raise UsageError(
                f'subgraph "{self._type.name}" has no graph yet: build() runs when it is added with graph.add(...)'
            )
        return level.face

    @property
    def _graph(self) -> Graph:
        """The same for floors that ask `hasattr` first: before it is built, the attribute is not there."""
        return self._level.face

    def _set_parameter(self, name: str, value: object, *, own: bool = False) -> None:
        """Set it and every parameter inside that it stands for; all of them, or none if one refuses."""
        level = inside(self)
        standing_for = () if level is None else level.promotions.of(name)
        before = self._parameters.get(name)
        super()._set_parameter(name, value, own=own)
        done = []
        try:
            for port in standing_for:
                done.append((port, port.value))
                port.value = value
        except ValueError:
            done.pop()
            for port, old in done:
                port.value = old
            self._parameters[name] = before
            raise


def is_box(node: object) -> TypeIs[Subgraph]:
    """Say whether a node is a subgraph."""
    return isinstance(node, Subgraph)


def inside(node: object) -> Level | None:
    """Give what lies inside a subgraph; None for other nodes, and before it is built."""
    return getattr(node, "_level", None) if isinstance(node, Subgraph) else None


def iterated(node: object) -> tuple[str, ...]:
    """Give the names of the inputs that a subgraph iterates over (rule G4); none for other nodes."""
    if not isinstance(node, Subgraph) or node._options is None:
        return ()
    names: tuple[str, ...] = node._options.iterate_over
    return names
