"""Subgraphs: nodes that hold a graph; their ports are relays between outside and inside (rules G1-G4).

Stands on `structure` and `nodetype`.
"""

from __future__ import annotations

from typing import Any, ClassVar

from hfg.errors import UsageError
from hfg.graph.graph import Graph
from hfg.nodetype import Node
from hfg.ports import Relaying

__all__ = ["Subgraph"]


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

    __slots__ = ("_graph",)

    iterate_over: ClassVar[tuple[str, ...]] = ()

    _graph: Graph  # written by the graph it is added to; not there before

    def build(self, graph: Graph) -> None:
        """Add the nodes inside and connect them, also with the inner sides of the subgraph's own ports."""

    @property
    def graph(self) -> Graph:
        """The graph inside.

        Raises:
          UsageError: the subgraph was not added to a graph yet.
        """
        graph: Graph | None = getattr(self, "_graph", None)
        if graph is None:
            raise UsageError(
                f'subgraph "{self._type.name}" has no graph yet: build() runs when it is added with graph.add(...)'
            )
        return graph

    def _set_parameter(self, name: str, value: Any) -> None:
        """Set it and every parameter inside that it stands for; all of them, or none if one refuses."""
        graph: Graph | None = getattr(self, "_graph", None)
        inside = [] if graph is None else graph._promoted.get(name, [])
        before = self._parameters.get(name)
        super()._set_parameter(name, value)
        done = []
        try:
            for port in inside:
                done.append((port, port.value))
                port.value = value
        except ValueError:
            done.pop()
            for port, old in done:
                port.value = old
            self._parameters[name] = before
            raise
