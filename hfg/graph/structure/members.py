"""The nodes of one level by name, in order. Does not check which nodes may be there."""

from __future__ import annotations

from hfg.graph.structure.sequence import Sequence
from hfg.graph.structure.subgraph import Box, is_box
from hfg.nodetypes.node import Node


class Members:
    """The nodes of one level.

    Attributes:
      nodes: by name, in order of adding.
    """

    __slots__ = ("_boxes", "_counts", "_order", "nodes")

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        # How many nodes have the default name of their type: else naming ten thousand of a type would try all names.
        self._counts: dict[str, int] = {}
        self._order: Sequence[Node] | None = None  # from the first edit on, which is to cost what it touches
        self._boxes: dict[Box, None] = {}  # those among them, once there is an order

    def free_name(self, base: str) -> tuple[str, int]:
        """Return the type's name, or with _2, _3 in order of adding; and the number to `count` once the node is in."""
        number = self._counts.get(base, 0) + 1
        name = base if number == 1 else f"{base}_{number}"
        while name in self.nodes:  # the user gave this name to another node
            number += 1
            name = f"{base}_{number}"
        return name, number

    def count(self, base: str, number: int) -> None:
        """Note that the name with this number is in use."""
        self._counts[base] = number

    @property
    def order(self) -> Sequence[Node]:
        """The nodes in order, so that places are found without counting."""
        if self._order is None:
            self._order = Sequence(self.nodes.values())
            self._boxes = {node: None for node in self.nodes.values() if is_box(node)}
        return self._order

    @property
    def boxes(self) -> list[Box]:
        """The subgraphs among the nodes."""
        return list(self._boxes) if self.order.items else []

    def position(self, name: str) -> int:
        """Return the place of a node in the order."""
        return self.order.position(self.nodes[name])

    def append(self, name: str, node: Node) -> None:
        """Add a node after all others."""
        self._note(len(self.nodes), node)
        self.nodes[name] = node

    def insert(self, position: int, name: str, node: Node) -> None:
        """Add a node at its place in the order."""
        self._note(position, node)
        self._insert(position, name, node)

    def remove(self, name: str) -> None:
        """Take a node out."""
        self._forget(self.nodes.pop(name))

    def swap(self, name: str, node: Node) -> None:
        """Put another node in the place of one, under its name."""
        position = self._forget(self.nodes[name])
        self._note(position, node)
        self.nodes[name] = node

    def rename(self, before: str, after: str) -> None:
        """Return a node another name at the same place."""
        position = self.position(before)
        self._insert(position, after, self.nodes.pop(before))

    def _insert(self, position: int, name: str, node: Node) -> None:
        if position < len(self.nodes):
            names, nodes = list(self.nodes), list(self.nodes.values())
            names.insert(position, name)
            nodes.insert(position, node)
            self.nodes.clear()
            self.nodes.update(zip(names, nodes, strict=True))
        else:
            self.nodes[name] = node

    def _note(self, position: int, node: Node) -> None:
        if self._order is not None:
            self._order.insert(position, node)
            if is_box(node):
                self._boxes[node] = None

    def _forget(self, node: Node) -> int:
        if self._order is None:
            return 0
        if is_box(node):
            self._boxes.pop(node, None)
        return self._order.remove(node)

    def check_invariants(self) -> None:
        """Fail if the order is not that of the nodes; for tests."""
        if self._order is not None:
            assert self._order.items == list(self.nodes.values())
            assert set(self._boxes) == {node for node in self.nodes.values() if is_box(node)}
